//! The explorer's page of a model, with windings to begin with.

use std::path::Path;

use crate::io::files::write_atomically;
use crate::io::json::explore::{ExploreJson, ExplorerDataJson, NamedSegmentsJson};
use crate::io::model::{ModelFile, NamedPattern};
use crate::io::write::model_tuning::without_pattern;
use crate::pattern::classic::Classic;
use crate::report::explorer::explorer_page;

use super::TaskError;

/// The page that `explore` writes where no other name is given.
pub(crate) const EXPLORER_FILE: &str = "explorer.html";

/// The page; the first of the windings is shown, then the model's own.
///
/// # Errors
/// A model's source that cannot be edited.
pub(crate) fn page(file: &ModelFile, patterns: &[NamedPattern]) -> Result<String, TaskError> {
    let path =
        file.path.file_name().map_or_else(|| "model.toml".to_owned(), |name| name.to_string_lossy().into_owned());
    // A pattern that stands in a file of its own comes along by its segments.
    let own_is_classic = file.pattern.as_ref().is_none_or(|named| Classic::from_key(&named.name).is_ok());
    let source = if own_is_classic { file.source.clone() } else { without_pattern(&path, &file.source)? };
    let mut all: Vec<NamedSegmentsJson> = Vec::new();
    for NamedPattern { name, pattern } in patterns.iter().chain(&file.pattern) {
        let segments = pattern.segments().to_vec();
        if all.iter().all(|known| known.segments != segments) {
            let title = Classic::from_key(name).map_or_else(|_| name.clone(), |classic| classic.title().to_owned());
            all.push(NamedSegmentsJson { name: name.clone(), title, segments });
        }
    }
    Ok(explorer_page(&file.model.name, &ExplorerDataJson { file: path, source, patterns: all })?)
}

/// Writes the page.
///
/// # Errors
/// As [`page()`]; a file that cannot be written.
pub fn write(file: &ModelFile, patterns: &[NamedPattern], path: &Path) -> Result<ExploreJson, TaskError> {
    let page = page(file, patterns)?;
    write_atomically(path, page.as_bytes())?;
    Ok(ExploreJson { page: path.display().to_string(), bytes: page.len() })
}
