//! A campaign's cells: which belong together, what each costs, what is found about one, and the table of them all.

use std::path::Path;

use crate::io::json::campaign::{BlockJson, CampaignJson, CellDocument, CellJson, CellStateJson, GyroJson};
use crate::io::read::campaign_file::{CampaignCell, CampaignFile, CampaignKind, CellWork};
use crate::io::write::campaign_cells::read_cell;
use crate::io::write::campaign_tables;
use crate::numeric::order::sort_descending;
use crate::rate::CoilModel;

use super::TaskError;

mod batch;
#[cfg(feature = "report")]
pub mod carrying_out;
pub(crate) mod coils;
pub(crate) mod gyros;
mod measures;
pub(crate) mod search;

/// Some of a campaign's cells, in the grid's order.
#[derive(Debug, Clone)]
pub struct CampaignPart<'a> {
    pub(crate) campaign: &'a CampaignFile,
    pub(crate) cells: Vec<&'a CampaignCell>,
}

impl<'a> CampaignPart<'a> {
    /// All of its cells.
    pub fn whole(campaign: &'a CampaignFile, cells: &'a [CampaignCell]) -> Self {
        Self { campaign, cells: cells.iter().collect() }
    }

    /// The cells of such identifiers.
    ///
    /// # Errors
    /// An identifier that no cell has.
    pub fn of_ids(campaign: &'a CampaignFile, cells: &'a [CampaignCell], ids: &[String]) -> Result<Self, TaskError> {
        if let Some(unknown) = ids.iter().find(|id| !cells.iter().any(|cell| cell.id == **id)) {
            let message = format!(
                "no cell of this campaign has the identifier \"{unknown}\": it changes with model, settings and program; see campaign --list"
            );
            return Err(TaskError::Option { option: "--cell", message });
        }
        Ok(Self { campaign, cells: cells.iter().filter(|cell| ids.contains(&cell.id)).collect() })
    }

    /// One of `count` parts that cost about the same: cells are dealt by falling cost, there and back. `index` counts from 1.
    pub fn dealt(campaign: &'a CampaignFile, cells: &'a [CampaignCell], index: usize, count: usize) -> Self {
        let costs: Vec<f64> = cells.iter().map(|cell| estimated_s(campaign, cell)).collect();
        let mut order: Vec<usize> = (0..cells.len()).collect();
        sort_descending(&mut order, |item| costs[*item]);
        let mut own: Vec<usize> = order
            .into_iter()
            .enumerate()
            .filter(|(place, _)| player(*place, count) == index - 1)
            .map(|(_, cell)| cell)
            .collect();
        own.sort_unstable();
        Self { campaign, cells: own.into_iter().map(|i| &cells[i]).collect() }
    }

    /// What the cells take together on one thread.
    pub fn estimated_s(&self) -> f64 {
        self.cells.iter().map(|cell| estimated_s(self.campaign, cell)).sum()
    }

    /// The answer about these cells; `searched` of them were computed just now. Without a folder nothing is done.
    pub fn answer(&self, folder: Option<&Path>, searched: usize) -> CampaignJson {
        let mut answer = CampaignJson {
            campaign: self.campaign.name.clone(),
            cells: Vec::with_capacity(self.cells.len()),
            searched,
            missing: Vec::new(),
            failed: Vec::new(),
            results: Vec::new(),
            built_coils: Vec::new(),
            fleet: None,
        };
        for cell in &self.cells {
            let found = folder.and_then(|folder| Found::read(folder, cell));
            match &found {
                None => answer.missing.push(cell.id.clone()),
                Some(found) if found.failure().is_some() => answer.failed.push(cell.id.clone()),
                Some(_) => {}
            }
            answer.cells.push(self.state(cell, found.is_some()));
            if let Some(Found::Search(found)) = found {
                answer.results.push(*found);
            }
        }
        answer
    }

    /// The answer about a whole campaign, and its table if nothing is missing.
    pub(crate) fn merged(&self, folder: &Path, searched: usize) -> (CampaignJson, Option<CampaignTable>) {
        let mut answer = self.answer(Some(folder), searched);
        if !answer.missing.is_empty() {
            return (answer, None);
        }
        let mut gyros = Vec::new();
        let table = match &self.campaign.kind {
            CampaignKind::Search(_) => campaign_tables::searches(&answer.results),
            CampaignKind::Tolerance(_) => {
                answer.built_coils = coils::merged(folder, &self.cells);
                campaign_tables::built_coils(&answer.built_coils)
            }
            CampaignKind::Metrics(_) | CampaignKind::Diagnose(_) => {
                gyros = self.cells.iter().filter_map(|cell| read_cell::<GyroJson>(folder, &cell.id)).collect();
                answer.fleet = Some(batch::of(self.campaign.kind.key(), &gyros));
                campaign_tables::gyros(&gyros)
            }
        };
        (answer, Some(CampaignTable { csv: table, gyros }))
    }

    fn state(&self, cell: &CampaignCell, done: bool) -> CellStateJson {
        let state = CellStateJson {
            id: cell.id.clone(),
            kind: self.campaign.kind.key().to_owned(),
            model: None,
            layers: None,
            class: None,
            objective: None,
            seed: None,
            coils: None,
            gyro: None,
            done,
            estimated_s: estimated_s(self.campaign, cell),
        };
        let of = |model: &CoilModel| (Some(model.name.clone()), Some(model.coil.layers()));
        match &cell.work {
            CellWork::Search(search) => {
                let (model, layers) = of(&search.file.model);
                let (class, objective) = (search.class.to_string(), search.objective.key().to_owned());
                let seed = Some(search.seed);
                CellStateJson { model, layers, class: Some(class), objective: Some(objective), seed, ..state }
            }
            CellWork::Tolerance(block) => {
                let (model, layers) = of(&block.file.model);
                let coils = Some([block.coils.start + 1, block.coils.end]);
                CellStateJson { model, layers, seed: Some(block.spec.seed), coils, ..state }
            }
            CellWork::Metrics(gyro) | CellWork::Diagnose(gyro) => {
                let (model, layers) = gyro.file.as_ref().map_or((None, None), |file| of(&file.model));
                CellStateJson { model, layers, gyro: Some(gyro.name.clone()), ..state }
            }
        }
    }
}

/// What a table is written from beside the answer.
#[derive(Debug)]
pub(crate) struct CampaignTable {
    pub(crate) csv: Vec<u8>,
    /// Of a fleet.
    pub(crate) gyros: Vec<GyroJson>,
}

/// A cell's result.
enum Found {
    Search(Box<CellJson>),
    Block(Box<BlockJson>),
    Gyro(Box<GyroJson>),
}

impl Found {
    fn read(folder: &Path, cell: &CampaignCell) -> Option<Self> {
        match &cell.work {
            CellWork::Search(_) => read_cell(folder, &cell.id).map(|found| Found::Search(Box::new(found))),
            CellWork::Tolerance(_) => read_cell(folder, &cell.id).map(|found| Found::Block(Box::new(found))),
            CellWork::Metrics(_) | CellWork::Diagnose(_) => {
                read_cell(folder, &cell.id).map(|found| Found::Gyro(Box::new(found)))
            }
        }
    }

    fn failure(&self) -> Option<&str> {
        match self {
            Found::Search(found) => found.failure(),
            Found::Block(found) => found.failure(),
            Found::Gyro(found) => found.failure(),
        }
    }
}

/// What a cell takes on one thread, to deal and to group cells by.
fn estimated_s(campaign: &CampaignFile, cell: &CampaignCell) -> f64 {
    match (&campaign.kind, &cell.work) {
        (CampaignKind::Search(grid), CellWork::Search(search)) => search::estimated_s(grid, search),
        (_, CellWork::Tolerance(block)) => coils::estimated_s(block),
        (_, CellWork::Metrics(gyro) | CellWork::Diagnose(gyro)) => gyros::estimated_s(gyro),
        // A search stands in a grid.
        (_, CellWork::Search(_)) => 0.0,
    }
}

/// Who gets the card of that place, where cards are dealt there and back.
fn player(place: usize, count: usize) -> usize {
    let (turn, at) = (place / count, place % count);
    if turn.is_multiple_of(2) { at } else { count - 1 - at }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cards_that_are_dealt_there_and_back_give_everyone_about_the_same() {
        let dealt: Vec<usize> = (0..8).map(|place| player(place, 3)).collect();
        assert_eq!(dealt, [0, 1, 2, 2, 1, 0, 0, 1]);
    }
}
