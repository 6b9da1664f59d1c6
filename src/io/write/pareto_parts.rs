//! What the parts of a front's search found, one file a part: a front that was interrupted goes on from them.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::io::files::{WriteError, sha256_hex, write_atomically};
use crate::io::folder::{check_read, clear_left_behind, remove_numbered};
use crate::io::model::ModelFile;
use crate::pattern::Pattern;
use crate::pattern::classic::Classic;
use crate::text::sink::Cell;

/// What all parts of one front have in common and what a part must agree with to be kept.
#[derive(Debug, Clone)]
pub(crate) struct Front<'a> {
    pub(crate) folder: &'a Path,
    pub(crate) file: &'a ModelFile,
    pub(crate) seed: u64,
    pub(crate) rounds: u64,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PartJson {
    fingerprint: String,
    /// SHA-256 of the part's other lines: a pattern that was changed is no longer what was found.
    checksum: String,
    /// What was searched, in words.
    part: String,
    /// P(j) of each pattern found, innermost layer first.
    found: Vec<Vec<usize>>,
}

impl PartJson {
    fn sum(&self) -> String {
        sha256_hex(&format!("{}\n{}\n{:?}", self.fingerprint, self.part, self.found))
    }
}

/// What an earlier front left in the folder: its pictures, the pattern files that its table lists, and the table, last: it must
/// not go before what it lists.
pub(crate) fn files_of_front(folder: &Path) -> Vec<String> {
    let mut names = ["pareto.svg", "pareto-p95.svg"].map(str::to_owned).to_vec();
    if let Ok(mut reader) = csv::Reader::from_path(folder.join("pareto.csv")) {
        let column = reader.headers().ok().and_then(|header| header.iter().position(|name| name == "file"));
        let listed = reader.records().filter_map(|row| row.ok()?.get(column?).map(|cell| Cell::read(cell).to_owned()));
        // Only what stands in the folder itself and is a pattern file by its name.
        names.extend(listed.filter(|name| name.ends_with(".toml") && !name.contains(['/', '\\', '#'])));
    }
    names.push("pareto.csv".to_owned());
    names
}

/// Refuses a folder in which a front's files would take the place of what the command reads, or in which an earlier front's
/// go that it reads.
///
/// # Errors
/// As said.
pub fn check_kept<'a>(folder: &Path, read: impl IntoIterator<Item = &'a Path>) -> Result<(), WriteError> {
    let classics = Classic::ALL.iter().map(|classic| format!("{}.toml", classic.key()));
    let names: Vec<String> = files_of_front(folder).into_iter().chain(classics).collect();
    check_read(folder, &names.iter().map(String::as_str).collect::<Vec<_>>(), read)
}

impl Front<'_> {
    /// The patterns of a part that has been searched; none if it has not, or for another request.
    pub(crate) fn read_part(&self, number: usize, part: &str) -> Option<Vec<Pattern>> {
        let text = std::fs::read_to_string(self.path(number)).ok()?;
        let read: PartJson = serde_json::from_str(&text).ok()?;
        let layers = self.file.model.coil.layers();
        let fits = read.fingerprint == self.fingerprint(part)
            && read.checksum == read.sum()
            && read.found.iter().all(|s| s.len() == layers);
        fits.then(|| read.found.into_iter().map(|s| Pattern::new(s).ok()).collect())?
    }

    /// Keeps what a part found: whole or not at all.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub(crate) fn write_part(&self, number: usize, part: &str, found: &[Pattern]) -> Result<(), WriteError> {
        let found = found.iter().map(|p| p.segments().to_vec()).collect();
        let (fingerprint, part) = (self.fingerprint(part), part.to_owned());
        let mut document = PartJson { fingerprint, checksum: String::new(), part, found };
        document.checksum = document.sum();
        let json = serde_json::to_string(&document).expect("numbers, strings and lists can always be written as JSON");
        write_atomically(&self.path(number), (json + "\n").as_bytes())
    }

    /// Takes away the parts of a front that had more of them, and what killed runs left half written.
    ///
    /// # Errors
    /// A file that cannot be removed.
    pub(crate) fn keep_parts(&self, count: usize) -> Result<(), WriteError> {
        let parts = self.folder.join("parts");
        remove_numbered(&parts, count)?;
        clear_left_behind(&parts).map_err(|source| WriteError::Folder { path: parts, source })
    }

    fn path(&self, number: usize) -> PathBuf {
        self.folder.join("parts").join(format!("{number:03}.json"))
    }

    fn fingerprint(&self, part: &str) -> String {
        let version = env!("CARGO_PKG_VERSION");
        sha256_hex(&format!("{version}\n{part}\n{} {}\n{}", self.seed, self.rounds, self.file.source))
    }
}
