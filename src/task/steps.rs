//! Which steps of a longer use case were taken, and of what: a step is taken again only where something that it is made of
//! has changed, or what it left.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::io::files::{read_text, sha256_hex, write_atomically};

use super::TaskError;
use super::measurement::Measurement;

/// The file that says which steps were taken, and of what.
const STEPS: &str = "steps.json";

/// The steps of one folder; each writes a folder of its own within it.
pub(super) struct Steps {
    path: PathBuf,
    /// By the name of a step's folder.
    taken: BTreeMap<String, Step>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Step {
    /// A hash of what it was made of.
    made_of: String,
    /// A hash of each file that later steps read: one that was changed since is not gone on from.
    left: BTreeMap<String, String>,
}

impl Steps {
    /// What was taken before.
    pub(crate) fn of(folder: &Path) -> Self {
        let path = folder.join(STEPS);
        // A file that cannot be understood says nothing: all steps are taken again.
        let taken = read_text(&path).ok().and_then(|text| serde_json::from_str(&text).ok());
        Self { path, taken: taken.unwrap_or_default() }
    }

    /// Whether a step was taken of the same and its results are there as it left them.
    pub(crate) fn is_taken(&self, into: &Path, made_of: &str, results: &[&str]) -> bool {
        let Some(step) = self.taken.get(&name_of(into)).filter(|step| step.made_of == made_of) else { return false };
        results.iter().all(|result| {
            let there = hash_of(&into.join(result));
            there.is_some() && there.as_ref() == step.left.get(*result)
        })
    }

    /// Notes that a step was taken, and what it left.
    pub(crate) fn take(&mut self, step: &Path, made_of: &str, results: &[&str]) -> Result<(), TaskError> {
        let hashes = results.iter().filter_map(|result| Some(((*result).to_owned(), hash_of(&step.join(result))?)));
        self.taken.insert(name_of(step), Step { made_of: made_of.to_owned(), left: hashes.collect() });
        let text = serde_json::to_string_pretty(&self.taken)? + "\n";
        Ok(write_atomically(&self.path, text.as_bytes())?)
    }
}

fn hash_of(path: &Path) -> Option<String> {
    Some(sha256_hex(&std::fs::read_to_string(path).ok()?))
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
