//! What stands behind the values of an effect or a term where it is written into a model file: its errors.

use crate::io::json::diagnosis::FindingJson;
use crate::io::json::proposals::{TermJson, TermParameterJson};
use crate::io::write::model_edit::Remark;
use crate::report::diagnosis::value_in_words;
use crate::text::sink::TomlComment;

/// What stands behind an effect's values in a model file.
pub(super) fn remarks(effect: &FindingJson) -> Vec<Remark> {
    let fitted = effect.parameters.iter().filter(|(_, p)| p.fitted);
    fitted.map(|(key, p)| Remark { key: key.clone(), text: TomlComment::of(value_in_words(p)) }).collect()
}

/// What stands behind a proposed term's values in a model file.
pub(super) fn term_remarks(term: &TermJson) -> Vec<Remark> {
    let words = |p: &TermParameterJson| match p.standard_error {
        Some(error) => format!("{:.4e} ± {error:.1e} {}", p.value, p.unit),
        None => format!("{:.4e} {}", p.value, p.unit),
    };
    term.parameters.iter().map(|(key, p)| Remark { key: key.clone(), text: TomlComment::of(words(p)) }).collect()
}
