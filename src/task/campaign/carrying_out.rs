//! Carries a campaign out in a folder: computes cells, and writes the table, the page and the pictures of them all.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use crate::io::files::WriteError;
use crate::io::json::campaign::{CampaignJson, CellJson};
use crate::io::read::campaign_file::grid::{GridSearch, SearchGrid};
use crate::io::read::campaign_file::{CampaignCell, CampaignKind, CellWork};
use crate::io::write::campaign_cells::{
    check_kept, forget_unfinished, is_done, read_cell, state_folder, write_cell, write_table,
};
use crate::io::write::checkpoint::{read_checkpoint, write_checkpoint};
use crate::report::built_coils::built_coils_page;
use crate::report::campaign::{campaign_page, charts};
use crate::report::fleet::fleet_page;
use crate::search;
use crate::search::anneal::rounds::Rounds;
use crate::search::run::Halt;
use crate::task::{Observer, TaskError};

use super::coils::judge_block;
use super::gyros::{diagnose_gyro, measure_gyro};
use super::search::search_cell;
use super::{CampaignPart, CampaignTable};

/// More identifiers than these are in the document only.
const MOST_SHOWN: usize = 20;

/// Whoever carries a campaign out.
pub trait Face: Observer {
    /// From time to time within a long cell: whether its state should be kept now.
    fn keeps_state(&self) -> bool;
}

/// Computes the cells of a part that are not done; how many that were, none if the work was ended first.
///
/// # Errors
/// A record that cannot be opened, a result that cannot be written.
pub fn compute(part: &CampaignPart, folder: &Path, face: &dyn Face) -> Result<Option<usize>, TaskError> {
    part.check_kept(folder)?;
    let mut computed = 0;
    let cells = part.cells.len();
    for (place, cell) in part.cells.iter().enumerate() {
        let within = Within { face, place, cells };
        if !is_done(folder, cell) {
            match (&cell.work, &part.campaign.kind) {
                (CellWork::Search(search), CampaignKind::Search(grid)) => {
                    if !searched(grid, cell, search, folder, face)? {
                        return Ok(None);
                    }
                }
                (CellWork::Search(_), _) => {}
                _ if !face.goes_on() => return Ok(None),
                (CellWork::Tolerance(block), _) => write_cell(folder, &judge_block(&cell.id, block))?,
                (CellWork::Metrics(gyro), _) => write_cell(folder, &measure_gyro(&cell.id, gyro, &within)?)?,
                (CellWork::Diagnose(gyro), _) => write_cell(folder, &diagnose_gyro(&cell.id, gyro, &within)?)?,
            }
            computed += 1;
        }
        within.at(1.0, "");
    }
    Ok(Some(computed))
}

/// The table of a whole campaign with its page and pictures, unless something is missing.
///
/// # Errors
/// A folder that cannot be written.
pub fn merge(
    whole: &CampaignPart,
    folder: &Path,
    searched: usize,
    observer: &dyn Observer,
) -> Result<CampaignJson, TaskError> {
    whole.check_kept(folder)?;
    let (answer, table) = whole.merged(folder, searched);
    if let Some(table) = table {
        write_table(folder, &table.csv, &pages(&whole.campaign.kind, &answer, &table))?;
        forget_unfinished(folder);
        observer.note(&format!("wrote {}", folder.join("summary.csv").display()));
    } else {
        observer.note(&missing_words(&answer));
    }
    Ok(answer)
}

impl CampaignPart<'_> {
    /// Refuses a folder in which the campaign's table or pictures would take the place of what it reads.
    ///
    /// # Errors
    /// As said.
    fn check_kept(&self, folder: &Path) -> Result<(), WriteError> {
        let inputs = self.campaign.inputs();
        check_kept(folder, inputs.iter().map(PathBuf::as_path))
    }
}

/// Which cells are missing, in a line.
pub(crate) fn missing_words(answer: &CampaignJson) -> String {
    let shown: Vec<&str> = answer.missing.iter().take(MOST_SHOWN).map(String::as_str).collect();
    let further = answer.missing.len() - shown.len();
    let further = if further > 0 { format!(" and {further} more") } else { String::new() };
    let (missing, all) = (answer.missing.len(), answer.cells.len());
    format!("{missing} of {all} cells are missing: {}{further}", shown.join(", "))
}

/// Searches one cell; false if the work was ended first.
fn searched(
    grid: &SearchGrid,
    cell: &CampaignCell,
    search: &GridSearch,
    folder: &Path,
    face: &dyn Face,
) -> Result<bool, TaskError> {
    let mut watch = Watch { cell, folder, state_folder: state_folder(folder, &cell.id), face, fault: None };
    // A checkpoint that is damaged is none.
    let saved = read_checkpoint(&watch.state_folder, &cell.id).unwrap_or(None);
    let found = search_cell(grid, &cell.id, search, saved, &mut watch);
    match (found, watch.fault) {
        // Another process has the same cell and was faster.
        _ if is_done(folder, cell) => {}
        (_, Some(fault)) => return Err(fault.into()),
        (None, None) => return Ok(false),
        (Some(found), None) => write_cell(folder, &found)?,
    }
    Ok(true)
}

/// The page, and the pictures that stand beside it.
fn pages(kind: &CampaignKind, answer: &CampaignJson, table: &CampaignTable) -> Vec<(String, String)> {
    let page = match (kind, &answer.fleet) {
        (CampaignKind::Search(_), _) => campaign_page(answer),
        (_, Some(fleet)) => fleet_page(&answer.campaign, fleet, &table.gyros),
        (_, None) => built_coils_page(answer),
    };
    let pictures = charts(&answer.results);
    let pictures = pictures.into_iter().map(|(objective, svg)| (format!("summary-{objective}.svg"), svg));
    std::iter::once(("report.html".to_owned(), page)).chain(pictures).collect()
}

/// Watches a cell among the others.
struct Within<'a> {
    face: &'a dyn Face,
    place: usize,
    cells: usize,
}

impl Observer for Within<'_> {
    fn note(&self, words: &str) {
        self.face.note(words);
    }

    fn at(&self, share_done: f64, _words: &str) {
        let done = self.place as f64 + share_done;
        self.face.at(done / self.cells as f64, &format!("cell {} of {}", self.place + 1, self.cells));
    }

    fn goes_on(&self) -> bool {
        self.face.goes_on()
    }
}

/// Ends a search as soon as the face wants it or another process has done it; keeps its state from time to time.
struct Watch<'a> {
    cell: &'a CampaignCell,
    folder: &'a Path,
    state_folder: PathBuf,
    face: &'a dyn Face,
    fault: Option<WriteError>,
}

impl search::Observer for Watch<'_> {
    fn advanced(&mut self, search: &dyn Rounds) -> ControlFlow<Halt> {
        let is_stopped = !self.face.goes_on();
        if is_stopped || self.face.keeps_state() {
            if read_cell::<CellJson>(self.folder, &self.cell.id).is_some() {
                return ControlFlow::Break(Halt::Signal);
            }
            self.fault = write_checkpoint(&self.state_folder, &self.cell.id, search.state()).err();
        }
        if is_stopped || self.fault.is_some() { ControlFlow::Break(Halt::Signal) } else { ControlFlow::Continue(()) }
    }

    fn goes_on(&self) -> bool {
        self.face.goes_on()
    }
}
