//! A campaign's searches: what each costs, and what it finds.

use crate::io::json::campaign::CellJson;
use crate::io::read::campaign_file::CampaignKind;
use crate::io::read::campaign_file::grid::{GridSearch, SearchGrid};
use crate::pattern::windability::WindabilityClass;
use crate::search::anneal::rounds::{DEFAULT_PATIENCE, DEFAULT_RESTARTS_PER_ROUND, Plan, Rules, State};
use crate::search::answer::{Answer, Ended};
use crate::search::cost::objective::Objective;
use crate::search::run::RunError;
use crate::search::{self, Observer};
use crate::units::deg_per_h_from_rad_per_s;

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
pub(super) fn estimated_s(grid: &SearchGrid, cell: &GridSearch) -> f64 {
    let layers = cell.file.model.coil.layers();
    let plan = plan(grid, cell);
    let rounds = plan.rules.rounds.min(USUAL_ROUNDS) + FURTHER_ROUNDS;
    let moves = (rounds * plan.restarts_per_round as u64 * plan.moves_per_restart) as f64;
    let move_s = if cell.objective == Objective::P95 { QUANTILE_MOVE_S } else { MOVE_S };
    let is_bounded = cell.class != WindabilityClass::Standard && layers > BOUNDED_LAYERS;
    BEGINNING_S + moves * layers as f64 * move_s * if is_bounded { BOUNDS_OVER_MOVES } else { 1.0 }
}

fn plan(grid: &SearchGrid, cell: &GridSearch) -> Plan {
    let layers = cell.file.model.coil.layers();
    Plan {
        seed: cell.seed,
        restarts_per_round: DEFAULT_RESTARTS_PER_ROUND,
        moves_per_restart: grid.moves_per_restart.unwrap_or_else(|| cell.objective.default_moves_per_restart(layers)),
        rules: Rules { rounds: grid.rounds.unwrap_or(u64::MAX), patience: DEFAULT_PATIENCE, moves: None, target: None },
        starts: Vec::new(),
    }
}

/// Searches one cell; `saved` is where an interrupted search of it was. None if the observer ended it.
///
/// What a model itself does not permit is a result as well: the cell's failure.
pub(crate) fn search_cell(
    grid: &SearchGrid,
    id: &str,
    cell: &GridSearch,
    saved: Option<State>,
    observer: &mut dyn Observer,
) -> Option<CellJson> {
    let request = search::Request {
        tolerance: cell.file.tolerance.as_ref(),
        objective: cell.objective,
        class: cell.class,
        plan: plan(grid, cell),
        saved,
        ..search::Request::new(&cell.file.model, &cell.file.profiles)
    };
    match search::run(&request, observer) {
        Ok(answer) => answer.filter(|answer| answer.ended != Ended::Signal).map(|answer| found(id, cell, &answer)),
        Err(RunError::Judge(error)) => Some(CellJson { failure: Some(error.to_string()), ..nothing(id, cell) }),
        // A state that does not fit is of no use.
        Err(RunError::Resume) => search_cell(grid, id, cell, None, observer),
    }
}

fn found(id: &str, cell: &GridSearch, answer: &Answer) -> CellJson {
    let best = &answer.best;
    CellJson {
        worst_rate_deg_per_h: Some(deg_per_h_from_rad_per_s(best.worst.rate_rad_per_s.abs())),
        objective_deg_per_h: (cell.objective != Objective::WorstPhase)
            .then(|| deg_per_h_from_rad_per_s(best.objective_rad_per_s)),
        improvement_over_qua: answer.improvement_over_qua,
        evaluations: answer.evaluations,
        stopped_by: answer.ended.key().to_owned(),
        segments: best.pattern.segments().to_vec(),
        ..nothing(id, cell)
    }
}

fn nothing(id: &str, cell: &GridSearch) -> CellJson {
    CellJson {
        id: id.to_owned(),
        kind: CampaignKind::SEARCH.to_owned(),
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
