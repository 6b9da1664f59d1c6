//! Which steps of a longer use case were taken, and of what: a step is taken again only where something that it is made of
//! has changed.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::io::files::{read_text, sha256_hex, write_atomically};

use super::TaskError;
use super::measurement::Measurement;

/// The file that says which steps were taken, and of what.
const STEPS: &str = "steps.json";

/// The steps of one folder; each writes a folder of its own within it.
pub(super) struct Steps {
    path: PathBuf,
    /// By the name of a step's folder: a hash of what it was made of.
    made_of: BTreeMap<String, String>,
}

impl Steps {
    /// What was taken before.
    pub fn of(folder: &Path) -> Self {
        let path = folder.join(STEPS);
        // A file that cannot be understood says nothing: all steps are taken again.
        let made_of = read_text(&path).ok().and_then(|text| serde_json::from_str(&text).ok());
        Self { path, made_of: made_of.unwrap_or_default() }
    }

    /// Whether a step was taken of the same and all that it wrote is there.
    pub fn is_taken(&self, into: &Path, made_of: &str, results: &[&str]) -> bool {
        let is_there = results.iter().all(|result| into.join(result).is_file());
        is_there && self.made_of.get(&name_of(into)).is_some_and(|known| known == made_of)
    }

    /// Notes that a step was taken, or begun.
    pub fn take(&mut self, step: &Path, made_of: &str) -> Result<(), TaskError> {
        self.made_of.insert(name_of(step), made_of.to_owned());
        let text = serde_json::to_string_pretty(&self.made_of)? + "\n";
        Ok(write_atomically(&self.path, text.as_bytes())?)
    }
}

pub(super) fn name_of(folder: &Path) -> String {
    folder.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

/// A hash of the program, of texts and of measurements; `None` for a measurement that came from no file, of which nobody
/// can say whether it has changed.
pub(super) fn made_of(texts: &[&str], measurements: &[&Measurement]) -> Option<String> {
    let mut all = env!("CARGO_PKG_VERSION").to_owned();
    for text in texts {
        all += &sha256_hex(text);
    }
    for measurement in measurements {
        all += &format!("{}\n{}", measurement.file, measurement.sha256.as_ref()?);
    }
    Some(sha256_hex(&all))
}
