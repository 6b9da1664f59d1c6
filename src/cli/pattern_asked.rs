//! Patterns as a user states them: a winding's name or a pattern file.

use super::CliError;
use crate::io::model::{ModelFile, NamedPattern};
use crate::io::read::pattern_file::resolve_pattern;

/// The pattern that was asked for, if one was.
pub(super) fn pattern_asked(file: &ModelFile, stated: Option<&str>) -> Result<Option<NamedPattern>, CliError> {
    Ok(patterns_asked(file, stated.as_slice())?.pop())
}

/// The patterns that were asked for.
pub(super) fn patterns_asked(file: &ModelFile, stated: &[impl AsRef<str>]) -> Result<Vec<NamedPattern>, CliError> {
    let layers = file.model.coil.layers();
    stated.iter().map(|stated| Ok(resolve_pattern(stated.as_ref(), layers, None)?)).collect()
}
