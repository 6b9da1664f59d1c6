//! A former pattern that a search's best is compared with.

use std::path::Path;

use super::CliError;
use crate::io::fault::Faults;
use crate::io::model::NamedPattern;
use crate::io::read::pattern_file::resolve_pattern;

/// A winding's name, a pattern file, or the folder of a search, whose best pattern counts.
pub(super) fn former_pattern(stated: &str, layers: usize) -> Result<NamedPattern, CliError> {
    let folder = Path::new(stated);
    if !folder.is_dir() {
        return Ok(resolve_pattern(stated, layers, None)?);
    }
    let best = folder.join("best.toml");
    if !best.is_file() {
        let message = "holds no best.toml: is it the folder that `coilwright optimise … -o DIR` wrote?";
        return Err(Faults::of_file(stated, message).into());
    }
    Ok(resolve_pattern(&best.display().to_string(), layers, None)?)
}
