//! Patterns that a proof begins with: the classics of the class and what a short search finds.

use super::{Goal, Task};
use crate::pattern::Pattern;
use crate::pattern::classic::Classic;
use crate::pattern::windability::WindabilityClass;
use crate::search::anneal::rounds::{
    DEFAULT_RESTARTS_PER_ROUND, Optimisation, Plan, Rounds, Rules, default_moves_per_restart,
};
use crate::search::anneal::sample_cost::SampleCost;
use crate::search::cost::columns::Norm;
use crate::search::cost::objective::Objective;
use crate::search::cost::samples::SampleMatrix;
use crate::search::cost::worst_case::SearchError;

/// Rounds without a better pattern after which the short search ends.
const PATIENCE: u64 = 2;

/// A restart takes this part of the moves that a search of its own would give it.
const SHORTENED: u64 = 8;

/// Patterns of the search that are kept.
const MOST_FOUND: usize = 6;

/// The classics of the class, then the best patterns of a short search; the same seed gives the same patterns.
///
/// # Errors
/// Effects that leave a layer no turns; rates that are not finite.
pub fn starting_patterns(task: &Task, seed: u64) -> Result<Vec<Pattern>, SearchError> {
    let (matrix, norm) = match task.goal {
        Goal::WorstRate => (Objective::WorstRate.of_profiles(task.model, task.solved)?, Norm::Largest),
        Goal::Pointing => (Objective::Pointing.of_profiles(task.model, task.solved)?, Norm::Largest),
        Goal::RootMeanSquare => (Objective::RootMeanSquare.of_profiles(task.model, task.solved)?, Norm::RootMeanSquare),
        Goal::Guaranteed(step) => (SampleMatrix::new(task.model, &step.parts(task.model, 1)?.changes)?, Norm::Sum),
    };
    Ok(quickly_found(matrix, norm, task.class, seed))
}

/// The same of a norm of samples.
pub(crate) fn quickly_found(matrix: SampleMatrix, norm: Norm, class: WindabilityClass, seed: u64) -> Vec<Pattern> {
    let layers = matrix.layers();
    let classics = Classic::ALL.into_iter().filter_map(|classic| classic.pattern(layers).ok());
    let classics: Vec<Pattern> = classics.filter(|p| class.admits(p)).collect();
    if layers < 4 {
        return classics;
    }
    let plan = Plan {
        seed,
        restarts_per_round: DEFAULT_RESTARTS_PER_ROUND,
        moves_per_restart: default_moves_per_restart(layers) / SHORTENED,
        rules: Rules { rounds: u64::MAX, patience: PATIENCE, moves: None, target: None },
        starts: Vec::new(),
    };
    let mut search = Optimisation::new(SampleCost::new(matrix, class, norm), plan);
    while search.advance() {}
    let found = search.state().found.iter().take(MOST_FOUND);
    let found = found.map(|f| Pattern::new(f.segments.clone()).expect("a walk visits permutations only"));
    classics.into_iter().chain(found).collect()
}
