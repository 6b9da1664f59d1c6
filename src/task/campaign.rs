//! A campaign's cells: which belong together, what each costs, what a search of one finds, and the table of them all.

use std::path::Path;

use crate::io::json::campaign::{CampaignJson, CellJson, CellStateJson};
use crate::io::read::campaign_file::{CampaignFile, Cell, KIND};
use crate::io::write::campaign_cells::read_cell;
use crate::pattern::windability::WindabilityClass;
use crate::search::anneal::rounds::{DEFAULT_PATIENCE, DEFAULT_RESTARTS_PER_ROUND, Plan, Rules, State};
use crate::search::answer::{Answer, Ended};
use crate::search::cost::objective::Objective;
use crate::search::run::RunError;
use crate::search::{self, Observer};
use crate::units::deg_per_h_from_rad_per_s;

use super::TaskError;

/// Some of a campaign's cells, in the grid's order.
#[derive(Debug, Clone)]
pub struct Part<'a> {
    pub campaign: &'a CampaignFile,
    pub cells: Vec<&'a Cell>,
}

impl<'a> Part<'a> {
    pub fn whole(campaign: &'a CampaignFile, cells: &'a [Cell]) -> Self {
        Self { campaign, cells: cells.iter().collect() }
    }

    /// The cells of such identifiers.
    ///
    /// # Errors
    /// An identifier that no cell has.
    pub fn of_ids(campaign: &'a CampaignFile, cells: &'a [Cell], ids: &[String]) -> Result<Self, TaskError> {
        if let Some(unknown) = ids.iter().find(|id| !cells.iter().any(|cell| cell.id == **id)) {
            let message = format!(
                "no cell of this campaign has the identifier \"{unknown}\": it changes with model, settings and program; see campaign --list"
            );
            return Err(TaskError::Option { option: "--cell", message });
        }
        Ok(Self { campaign, cells: cells.iter().filter(|cell| ids.contains(&cell.id)).collect() })
    }

    /// One of `count` parts that cost about the same: cells are dealt by falling cost, there and back. `index` counts from 1.
    pub fn dealt(campaign: &'a CampaignFile, cells: &'a [Cell], index: usize, count: usize) -> Self {
        let costs: Vec<f64> = cells.iter().map(|cell| estimated_s(campaign, cell)).collect();
        let mut order: Vec<usize> = (0..cells.len()).collect();
        order.sort_by(|&a, &b| costs[b].total_cmp(&costs[a]));
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
        let found: Vec<Option<CellJson>> =
            self.cells.iter().map(|cell| folder.and_then(|folder| read_cell(folder, &cell.id))).collect();
        let ids = |of: &dyn Fn(&Option<CellJson>) -> bool| -> Vec<String> {
            self.cells.iter().zip(&found).filter(|(_, found)| of(found)).map(|(cell, _)| cell.id.clone()).collect()
        };
        CampaignJson {
            campaign: self.campaign.name.clone(),
            cells: self.cells.iter().zip(&found).map(|(cell, found)| self.state(cell, found.is_some())).collect(),
            searched,
            missing: ids(&Option::is_none),
            failed: ids(&|found| found.as_ref().is_some_and(|found| found.failure.is_some())),
            results: found.into_iter().flatten().collect(),
        }
    }

    fn state(&self, cell: &Cell, done: bool) -> CellStateJson {
        CellStateJson {
            id: cell.id.clone(),
            kind: KIND.to_owned(),
            model: cell.file.model.name.clone(),
            layers: cell.file.model.coil.layers(),
            class: cell.class.to_string(),
            objective: cell.objective.key().to_owned(),
            seed: cell.seed,
            done,
            estimated_s: estimated_s(self.campaign, cell),
        }
    }
}

/// Who gets the card of that place, where cards are dealt there and back.
fn player(place: usize, count: usize) -> usize {
    let (turn, at) = (place / count, place % count);
    if turn.is_multiple_of(2) { at } else { count - 1 - at }
}

/// Rounds that searches take until so many were without a better pattern.
const USUAL_ROUNDS: u64 = DEFAULT_PATIENCE + 2;

/// What the shared starts and the refinement at the end take, in rounds.
const FURTHER_ROUNDS: u64 = 7;

/// Seconds of one thread for the fields and baselines, and for a move and layer.
const BEGINNING_S: f64 = 0.3;
const MOVE_S: f64 = 1.2e-8;
const QUANTILE_MOVE_S: f64 = 4e-7;

/// Beyond so many layers a search over permutations ends with bounds that take so many times what the moves take.
const BOUNDED_LAYERS: usize = 16;
const BOUNDS_OVER_MOVES: f64 = 10.0;

/// What a cell takes on one thread, to deal and to group cells by: within a factor of two of what was measured for 8 to 24
/// layers of the paper's coil (`results/campaigns`) but for the guaranteed rate, of which it says a third; elsewhere an order of
/// magnitude.
pub fn estimated_s(campaign: &CampaignFile, cell: &Cell) -> f64 {
    let layers = cell.file.model.coil.layers();
    let plan = plan(campaign, cell);
    let rounds = plan.rules.rounds.min(USUAL_ROUNDS) + FURTHER_ROUNDS;
    let moves = (rounds * plan.restarts_per_round as u64 * plan.moves_per_restart) as f64;
    let move_s = if cell.objective == Objective::P95 { QUANTILE_MOVE_S } else { MOVE_S };
    let is_bounded = cell.class != WindabilityClass::Standard && layers > BOUNDED_LAYERS;
    BEGINNING_S + moves * layers as f64 * move_s * if is_bounded { BOUNDS_OVER_MOVES } else { 1.0 }
}

fn plan(campaign: &CampaignFile, cell: &Cell) -> Plan {
    let layers = cell.file.model.coil.layers();
    Plan {
        seed: cell.seed,
        restarts_per_round: DEFAULT_RESTARTS_PER_ROUND,
        moves_per_restart: campaign
            .moves_per_restart
            .unwrap_or_else(|| cell.objective.default_moves_per_restart(layers)),
        rules: Rules {
            rounds: campaign.rounds.unwrap_or(u64::MAX),
            patience: DEFAULT_PATIENCE,
            moves: None,
            target: None,
        },
        starts: Vec::new(),
    }
}

/// Searches one cell; `saved` is where an interrupted search of it was. None if the observer ended it.
///
/// What a model itself does not permit is a result as well: the cell's failure.
pub fn search_cell(
    campaign: &CampaignFile,
    cell: &Cell,
    saved: Option<State>,
    observer: &mut dyn Observer,
) -> Option<CellJson> {
    let request = search::Request {
        model: &cell.file.model,
        profiles: &cell.file.profiles,
        tolerance: cell.file.tolerance.as_ref(),
        objective: cell.objective,
        class: cell.class,
        plan: plan(campaign, cell),
        saved,
        former: None,
        prove: false,
        recommend: false,
        cuts: false,
        uncertain: &[],
    };
    match search::run(&request, observer) {
        Ok(answer) => answer.filter(|answer| answer.ended != Ended::Signal).map(|answer| found(cell, &answer)),
        Err(RunError::Judge(error)) => Some(CellJson { failure: Some(error.to_string()), ..nothing(cell) }),
        // A state that does not fit is of no use.
        Err(RunError::Resume) => search_cell(campaign, cell, None, observer),
    }
}

fn found(cell: &Cell, answer: &Answer) -> CellJson {
    let best = &answer.best;
    CellJson {
        worst_rate_deg_per_h: Some(deg_per_h_from_rad_per_s(best.worst.rate_rad_per_s.abs())),
        objective_deg_per_h: (cell.objective != Objective::WorstPhase)
            .then(|| deg_per_h_from_rad_per_s(best.objective_rad_per_s)),
        improvement_over_qua: answer.improvement_over_qua,
        evaluations: answer.evaluations,
        stopped_by: answer.ended.key().to_owned(),
        segments: best.pattern.segments().to_vec(),
        ..nothing(cell)
    }
}

fn nothing(cell: &Cell) -> CellJson {
    CellJson {
        id: cell.id.clone(),
        kind: KIND.to_owned(),
        model: cell.file.model.name.clone(),
        layers: cell.file.model.coil.layers(),
        windability: cell.class.to_string(),
        objective: cell.objective.key().to_owned(),
        seed: cell.seed,
        worst_rate_deg_per_h: None,
        objective_deg_per_h: None,
        improvement_over_qua: None,
        evaluations: 0,
        stopped_by: "failure".to_owned(),
        segments: Vec::new(),
        failure: None,
    }
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
