//! A campaign's folder: one file a cell under its identifier, the state of cells that were interrupted, and the table of all.

use std::path::{Path, PathBuf};

use serde_json::{Map, Value};

use crate::io::files::{WriteError, sha256_hex, write_atomically};
use crate::io::folder::{Replacement, check_read};
use crate::io::json::campaign::{BlockJson, CellDocument, CellJson, GyroJson};
use crate::io::read::campaign_file::{CampaignCell, CellWork};
use crate::search::cost::objective::Objective;

use super::checkpoint::CHECKPOINT_FILE;

/// Files of a folder by so many first digits of their identifiers: a million cells are then 256 folders of 4 000.
const FOLDER_DIGITS: usize = 2;

/// The place of a cell's result under a campaign's folder.
pub(crate) fn cell_path(folder: &Path, id: &str) -> PathBuf {
    folder.join("cells").join(&id[..FOLDER_DIGITS.min(id.len())]).join(format!("{id}.json"))
}

/// A cell's result, if it is there, as it was written, and of this cell.
pub(crate) fn read_cell<T: CellDocument>(folder: &Path, id: &str) -> Option<T> {
    let text = std::fs::read_to_string(cell_path(folder, id)).ok()?;
    let mut document: Map<String, Value> = serde_json::from_str(&text).ok()?;
    let stated = document.shift_remove(CHECKSUM)?;
    if stated.as_str() != Some(&sum(&document)) {
        return None;
    }
    serde_json::from_value::<T>(document.into()).ok().filter(|found| found.id() == id)
}

/// The key of the SHA-256 of all the rest: a number that was changed would go into the table unnoticed.
const CHECKSUM: &str = "checksum";

fn sum(document: &Map<String, Value>) -> String {
    sha256_hex(&serde_json::to_string(document).expect("a cell's numbers can be written"))
}

/// Whether a cell's result is there.
pub(crate) fn is_done(folder: &Path, cell: &CampaignCell) -> bool {
    match &cell.work {
        CellWork::Search(_) => read_cell::<CellJson>(folder, &cell.id).is_some(),
        CellWork::Tolerance(_) => read_cell::<BlockJson>(folder, &cell.id).is_some(),
        CellWork::Metrics(_) | CellWork::Diagnose(_) => read_cell::<GyroJson>(folder, &cell.id).is_some(),
    }
}

/// Writes what a cell found, whole or not at all; then its interrupted state is of no more use.
///
/// # Errors
/// A file that cannot be written.
pub(crate) fn write_cell<T: CellDocument>(folder: &Path, found: &T) -> Result<(), WriteError> {
    let document = serde_json::to_value(found).expect("a cell's numbers can be written");
    let Value::Object(mut document) = document else { unreachable!("a cell's result has named fields") };
    document.insert(CHECKSUM.to_owned(), sum(&document).into());
    let json = serde_json::to_string_pretty(&document).expect("a cell's numbers can be written") + "\n";
    write_atomically(&cell_path(folder, found.id()), json.as_bytes())?;
    forget_state(folder, found.id());
    Ok(())
}

/// Where the checkpoint of a cell stands while it is searched.
pub(crate) fn state_folder(folder: &Path, id: &str) -> PathBuf {
    folder.join("unfinished").join(id)
}

/// Takes the checkpoint of a cell away. One that stays behind does no harm.
pub(crate) fn forget_state(folder: &Path, id: &str) {
    let own = state_folder(folder, id);
    let _ = std::fs::remove_file(own.join(CHECKPOINT_FILE));
    let _ = std::fs::remove_dir(&own);
}

/// Takes the folder of interrupted cells away once there is none.
pub(crate) fn forget_unfinished(folder: &Path) {
    let _ = std::fs::remove_dir(folder.join("unfinished"));
}

/// Refuses a folder in which the table or a picture would take the place of what the campaign reads.
///
/// # Errors
/// As said.
pub(crate) fn check_kept<'a>(folder: &Path, read: impl IntoIterator<Item = &'a Path>) -> Result<(), WriteError> {
    let pictures = pictures_of_objectives();
    let kinds: Vec<&str> = OF_ALL.into_iter().chain(pictures.iter().map(String::as_str)).collect();
    check_read(folder, &kinds, read)
}

/// What every campaign's table comes with, or came with.
const OF_ALL: [&str; 3] = ["summary.csv", "report.html", "summary.svg"];

fn pictures_of_objectives() -> Vec<String> {
    Objective::ALL.iter().map(|objective| format!("summary-{}.svg", objective.key())).collect()
}

/// Writes the table and pictures of a complete campaign, as a whole.
///
/// # Errors
/// Files that cannot be written.
pub(crate) fn write_table(folder: &Path, table: &[u8], further: &[(String, String)]) -> Result<(), WriteError> {
    let mut files = Replacement::of(folder);
    files.add("summary.csv", table)?;
    for (name, text) in further {
        files.add(name, text.as_bytes())?;
    }
    let names: Vec<&str> =
        std::iter::once("summary.csv").chain(further.iter().map(|(name, _)| name.as_str())).collect();
    // Pictures of objectives that are no longer asked for go as well.
    let former = pictures_of_objectives();
    let names: Vec<&str> = names.into_iter().chain(former.iter().map(String::as_str)).chain(["summary.svg"]).collect();
    files.commit(&names)
}
