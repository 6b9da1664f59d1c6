//! A publication's results as files.

use std::path::Path;

use super::TaskError;
use crate::io::folder::Replacement;
use crate::report::yan1998::ReproductionFile;

/// Files that one of the publications leaves: in one folder the other's do not stay beside its own.
const KINDS: &[&str] = &[
    "README.md",
    "table2.csv",
    "figure2.csv",
    "figure2.svg",
    "figure3-#m.csv",
    "figure3-#m.svg",
    "comparisons.csv",
    "record.csv",
    "figure3-#.svg",
    "figure3-5-6.svg",
    "figure3-7-8.svg",
];

/// Writes a publication's files as a whole into a folder that the caller holds; their paths.
///
/// # Errors
/// A folder that cannot be written.
pub fn write(folder: &Path, files: &[ReproductionFile]) -> Result<Vec<String>, TaskError> {
    let mut replacement = Replacement::of(folder);
    files.iter().try_for_each(|file| replacement.add(&file.name, file.contents.as_bytes()))?;
    replacement.commit(KINDS)?;
    Ok(files.iter().map(|file| folder.join(&file.name).display().to_string()).collect())
}
