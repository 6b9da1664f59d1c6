//! A campaign's folder: one file a cell under its identifier, the state of cells that were interrupted, and the table of all.

use std::path::{Path, PathBuf};

use crate::io::files::{WriteError, write_atomically};
use crate::io::folder::Replacement;
use crate::io::json::campaign::CellJson;
use crate::io::table::Table;
use crate::search::cost::objective::Objective;
use crate::text::sink;

use super::checkpoint::CHECKPOINT_FILE;

/// Files of a folder by so many first digits of their identifiers: a million cells are then 256 folders of 4 000.
const FOLDER_DIGITS: usize = 2;

/// The place of a cell's result under a campaign's folder.
pub fn cell_path(folder: &Path, id: &str) -> PathBuf {
    folder.join("cells").join(&id[..FOLDER_DIGITS.min(id.len())]).join(format!("{id}.json"))
}

/// A cell's result, if it is there, whole and of this cell.
pub fn read_cell(folder: &Path, id: &str) -> Option<CellJson> {
    let text = std::fs::read_to_string(cell_path(folder, id)).ok()?;
    serde_json::from_str::<CellJson>(&text).ok().filter(|found| found.id == id)
}

/// Writes what a cell found, whole or not at all; then its interrupted state is of no more use.
///
/// # Errors
/// A file that cannot be written.
pub fn write_cell(folder: &Path, found: &CellJson) -> Result<(), WriteError> {
    let json = serde_json::to_string_pretty(found).expect("a cell's numbers are finite") + "\n";
    write_atomically(&cell_path(folder, &found.id), json.as_bytes())?;
    forget_state(folder, &found.id);
    Ok(())
}

/// Where the checkpoint of a cell stands while it is searched.
pub fn state_folder(folder: &Path, id: &str) -> PathBuf {
    folder.join("unfinished").join(id)
}

/// Takes the checkpoint of a cell away. One that stays behind does no harm.
pub fn forget_state(folder: &Path, id: &str) {
    let own = state_folder(folder, id);
    let _ = std::fs::remove_file(own.join(CHECKPOINT_FILE));
    let _ = std::fs::remove_dir(&own);
}

/// Takes the folder of interrupted cells away once there is none.
pub fn forget_unfinished(folder: &Path) {
    let _ = std::fs::remove_dir(folder.join("unfinished"));
}

/// Writes the table and pictures of a complete campaign, as a whole.
///
/// # Errors
/// Files that cannot be written.
pub fn write_table(folder: &Path, results: &[CellJson], further: &[(String, String)]) -> Result<(), WriteError> {
    let mut files = Replacement::of(folder);
    files.add("summary.csv", &summary_csv(results))?;
    for (name, text) in further {
        files.add(name, text.as_bytes())?;
    }
    let names: Vec<&str> =
        std::iter::once("summary.csv").chain(further.iter().map(|(name, _)| name.as_str())).collect();
    // Pictures of objectives that are no longer asked for go as well.
    let former: Vec<String> =
        Objective::ALL.iter().map(|objective| format!("summary-{}.svg", objective.key())).collect();
    let names: Vec<&str> = names.into_iter().chain(former.iter().map(String::as_str)).chain(["summary.svg"]).collect();
    files.commit(&names)
}

/// The table of all cells, in the grid's order.
fn summary_csv(results: &[CellJson]) -> Vec<u8> {
    let mut table = Table::with_header([
        "cell",
        "model",
        "layers",
        "class",
        "objective",
        "seed",
        "worst_rate_deg_per_h",
        "objective_deg_per_h",
        "improvement_over_qua",
        "evaluations",
        "segments",
        "id",
        "failure",
    ]);
    for (index, found) in results.iter().enumerate() {
        let segments: Vec<String> = found.segments.iter().map(ToString::to_string).collect();
        let number = |value: Option<f64>| value.map(|v| v.to_string()).unwrap_or_default();
        let cells = [
            (index + 1).to_string(),
            found.model.clone(),
            found.layers.to_string(),
            found.windability.clone(),
            found.objective.clone(),
            found.seed.to_string(),
            number(found.worst_rate_deg_per_h),
            number(found.objective_deg_per_h),
            number(found.improvement_over_qua),
            found.evaluations.to_string(),
            segments.join(" "),
            found.id.clone(),
            found.failure.clone().unwrap_or_default(),
        ];
        table.row(cells.iter().map(|text| sink::Cell::text(text)));
    }
    table.into_bytes()
}
