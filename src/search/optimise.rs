//! Many restarts in rounds, until a rule says that it is enough.
//!
//! A round is a fixed number of restarts, advanced slice by slice in parallel. Each has a generator of its own, and
//! what they found is gathered in their order, so the result depends on the seed alone and not on threads. Between
//! slices the whole state is a plain value ([`Optimisation::state`]) that can be saved and taken up again.
//!
//! Under a largest-value objective the restarts run on a working set of samples: a thinned grid and whatever was seen
//! to bind. What a restart found is judged on all samples; every sample that exceeds the working set's value joins the
//! set for the next rounds. The working set's cost is never above the true one, so nothing good is lost by it, and
//! nothing is reported that was not judged in full.

use rayon::prelude::*;

use super::anneal::{Cooling, Restart, cooling_for, generator};
use super::columns::{BLOCK, Norm, Work};
use super::samples::SampleMatrix;
use super::walk::Space;
use crate::pattern::Pattern;
use crate::pattern::windability::WindabilityClass;

/// When a search ends; whichever rule fires first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rules {
    /// Rounds at most.
    pub rounds: u64,
    /// Rounds without a better pattern.
    pub patience: u64,
    /// Moves at most, counted at the end of each round.
    pub moves: Option<u64>,
    /// A cost that is good enough.
    pub target: Option<f64>,
}

/// What is searched for and how.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    pub seed: u64,
    pub norm: Norm,
    pub restarts_per_round: usize,
    pub moves_per_restart: u64,
    pub rules: Rules,
    /// Patterns of the class to begin with; the first restarts start from them.
    pub starts: Vec<Vec<usize>>,
}

/// Moves a restart for a layer count: enough for the schedule to settle in the packs of `examples/`.
pub fn default_moves_per_restart(layers: usize) -> u64 {
    ((layers as u64).pow(2) * 128).min(1_000_000)
}

pub const DEFAULT_RESTARTS_PER_ROUND: usize = 8;
pub const DEFAULT_PATIENCE: u64 = 6;

/// Why a search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stop {
    Rounds,
    Moves,
    Patience,
    Target,
    /// No pattern of the class is better.
    Proved,
}

impl Stop {
    const ALL: [Stop; 5] = [Stop::Rounds, Stop::Moves, Stop::Patience, Stop::Target, Stop::Proved];

    /// As written in results.
    pub fn key(self) -> &'static str {
        match self {
            Stop::Rounds => "rounds",
            Stop::Moves => "moves",
            Stop::Patience => "no improvement",
            Stop::Target => "target",
            Stop::Proved => "proved",
        }
    }

    pub fn from_key(key: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|stop| stop.key() == key)
    }
}

/// A pattern that was found, judged on all samples.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    pub cost: f64,
    /// P(j), innermost layer first.
    pub segments: Vec<usize>,
}

/// The state after a round.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RoundRecord {
    pub round: u64,
    pub evaluations: u64,
    pub best_cost: f64,
    pub working_samples: usize,
}

/// The part of a search that changes: save it between slices, and the search goes on from it.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    pub round: u64,
    pub restarts: Vec<Restart>,
    /// Best first, no two alike, at most [`MOST_FOUND`].
    pub found: Vec<Found>,
    pub rounds_without_improvement: u64,
    /// Indices of the samples that the restarts run on, those that bind most first.
    pub working: Vec<usize>,
    pub work: Work,
    pub history: Vec<RoundRecord>,
    pub stop: Option<Stop>,
}

impl State {
    /// Ends the search for a reason from outside: what is best was proved, or what is good enough was found, elsewhere.
    pub fn conclude(&mut self, stop: Stop) {
        for restart in std::mem::take(&mut self.restarts) {
            self.work += restart.work;
        }
        self.stop = Some(stop);
    }

    /// Before the first round.
    pub(super) fn new(working: Vec<usize>) -> Self {
        Self {
            round: 0,
            restarts: Vec::new(),
            found: Vec::new(),
            rounds_without_improvement: 0,
            working,
            work: Work::default(),
            history: Vec::new(),
            stop: None,
        }
    }

    /// The first round after which the best was known; none if it was given.
    pub fn first_with_best(&self) -> Option<&RoundRecord> {
        let best_cost = self.found.first()?.cost;
        self.history.iter().find(|record| record.best_cost <= best_cost)
    }

    /// Puts a pattern in its place among the best.
    pub(super) fn keep(&mut self, found: Found) {
        if !self.found.iter().any(|f| f.segments == found.segments) {
            let at = self.found.partition_point(|f| (f.cost, &f.segments) < (found.cost, &found.segments));
            self.found.insert(at, found);
            self.found.truncate(MOST_FOUND);
        }
    }

    /// Closes the books of a round; `before` is the best cost at its start.
    pub(super) fn end_round(&mut self, rules: &Rules, before: f64, working_samples: usize) {
        self.round += 1;
        let best_cost = self.found.first().map_or(f64::INFINITY, |f| f.cost);
        // Rounding between mirror images is no improvement.
        let improved = best_cost < before * (1.0 - 1e-12);
        self.rounds_without_improvement = if improved { 0 } else { self.rounds_without_improvement + 1 };
        let evaluations = self.work.moves;
        self.history.push(RoundRecord { round: self.round, evaluations, best_cost, working_samples });
        self.stop = if rules.target.is_some_and(|target| best_cost <= target) {
            Some(Stop::Target)
        } else if rules.moves.is_some_and(|moves| evaluations >= moves) {
            Some(Stop::Moves)
        } else if self.rounds_without_improvement >= rules.patience {
            Some(Stop::Patience)
        } else if self.round >= rules.rounds {
            Some(Stop::Rounds)
        } else {
            None
        };
    }
}

/// Patterns kept for the final judgement by the reference.
pub const MOST_FOUND: usize = 24;

/// A search under way.
#[derive(Debug)]
pub struct Optimisation {
    full: Space,
    plan: Plan,
    cooling: Cooling,
    working: Space,
    state: State,
}

impl Optimisation {
    pub fn new(matrix: SampleMatrix, class: WindabilityClass, plan: Plan) -> Self {
        let full = Space::new(matrix, class);
        let working = first_working_set(&full, &plan);
        let state = State::new(working);
        let mut search = Self::resume_parts(full, plan, state);
        for start in search.plan.starts.clone() {
            search.judge(start);
        }
        search.begin_round();
        search
    }

    /// Goes on from a saved state; everything else must be as it was when it was saved. `None` for a state that no
    /// search over this matrix and class can have been in.
    pub fn resume(matrix: SampleMatrix, class: WindabilityClass, plan: Plan, state: State) -> Option<Self> {
        let full = Space::new(matrix, class);
        let is_pattern = |segments: &Vec<usize>| {
            segments.len() == full.layers() && Pattern::new(segments.clone()).is_ok() && full.admits(segments)
        };
        let samples = full.matrix().samples();
        let fits = state.working.iter().all(|&s| s < samples)
            && state.found.iter().all(|f| is_pattern(&f.segments))
            && state.restarts.iter().all(|r| is_pattern(&r.segments) && is_pattern(&r.best_segments))
            && (state.stop.is_some() || state.restarts.len() == plan.restarts_per_round);
        fits.then(|| Self::resume_parts(full, plan, state))
    }

    fn resume_parts(full: Space, plan: Plan, state: State) -> Self {
        let working = Space::new(full.matrix().select(&state.working), full.class());
        let cooling = cooling_for(&full, plan.norm, plan.seed, plan.moves_per_restart);
        Self { full, plan, cooling, working, state }
    }

    pub fn state(&self) -> &State {
        &self.state
    }

    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The best pattern so far; there is one as soon as a round has ended or a start was given.
    pub fn best(&self) -> Option<&Found> {
        self.state.found.first()
    }

    /// Moves judged so far.
    pub fn evaluations(&self) -> u64 {
        self.state.work.moves + self.state.restarts.iter().map(|r| r.work.moves).sum::<u64>()
    }

    /// How much of the present round is done, from 0 to 1.
    pub fn round_progress(&self) -> f64 {
        let done: u64 = self.state.restarts.iter().map(|r| r.moves).sum();
        done as f64 / (self.plan.moves_per_restart * self.plan.restarts_per_round as u64) as f64
    }

    /// Advances every restart by one slice; true while there is more to do.
    pub fn advance(&mut self) -> bool {
        if self.state.stop.is_some() {
            return false;
        }
        let (space, cooling, norm) = (&self.working, &self.cooling, self.plan.norm);
        self.state.restarts.par_iter_mut().filter(|r| !r.is_done(cooling)).for_each(|restart| {
            restart.advance(space, norm, cooling);
        });
        if self.state.restarts.iter().all(|r| r.is_done(&self.cooling)) || self.has_reached_target() {
            self.end_round();
        }
        self.state.stop.is_none()
    }

    /// Whether a restart has come upon something that is good enough on all samples: its round then ends early.
    fn has_reached_target(&self) -> bool {
        self.plan.rules.target.is_some_and(|target| {
            let promising = self.state.restarts.iter().filter(|r| r.best_cost <= target);
            promising.map(|r| self.plan.norm.of(&values_of(&self.full, &r.best_segments))).any(|cost| cost <= target)
        })
    }

    /// Ends the search for a reason from outside.
    pub fn conclude(&mut self, stop: Stop) {
        self.state.conclude(stop);
    }

    /// Judges what the restarts of an unfinished round have found so far. For the last answer of a search that is
    /// stopped from outside; save its state before.
    pub fn gather(&mut self) {
        for restart in self.state.restarts.clone() {
            self.judge(restart.best_segments);
        }
    }

    fn begin_round(&mut self) {
        let count = self.plan.restarts_per_round as u64;
        let first = self.state.round * count;
        self.state.restarts = (first..first + count)
            .map(|index| {
                let start = self.plan.starts.get(index as usize).map(Vec::as_slice);
                Restart::new(&self.working, self.plan.seed, index, start)
            })
            .collect();
    }

    fn end_round(&mut self) {
        let before = self.best().map_or(f64::INFINITY, |f| f.cost);
        let restarts = std::mem::take(&mut self.state.restarts);
        let mut joining = Vec::new();
        for restart in restarts {
            self.state.work += restart.work;
            joining.extend(self.judge(restart.best_segments));
        }
        self.state.end_round(&self.plan.rules, before, self.state.working.len());
        if self.state.stop.is_none() {
            self.renew_working_set(joining);
            self.begin_round();
        }
    }

    /// Judges a pattern on all samples and keeps it if it is among the best; the samples that exceed the working set.
    fn judge(&mut self, segments: Vec<usize>) -> Vec<usize> {
        let layers = segments.len();
        let values = values_of(&self.full, &segments);
        let cost = self.plan.norm.of(&values);
        // Of a pattern and its mirror image, if both cost the same, the one that comes first.
        let mirrored: Vec<usize> = segments.iter().map(|s| layers + 1 - s).collect();
        let mirrored_cost = self.plan.norm.of(&values_of(&self.full, &mirrored));
        let same = (mirrored_cost - cost).abs() <= 1e-12 * cost;
        let kept = if same && mirrored < segments { mirrored } else { segments };
        self.state.keep(Found { cost, segments: kept });
        if self.plan.norm != Norm::Largest {
            return Vec::new();
        }
        let working = self.state.working.iter().map(|&s| values[s].abs()).fold(0.0, f64::max);
        peaks(&values, working * (1.0 + 1e-9))
    }

    /// Adds samples and puts those first that bind the best patterns.
    fn renew_working_set(&mut self, mut joining: Vec<usize>) {
        joining.sort_unstable();
        joining.dedup();
        let mut is_in = vec![false; self.full.matrix().samples()];
        for &s in &self.state.working {
            is_in[s] = true;
        }
        joining.retain(|&s| !is_in[s]);
        self.state.working.extend(joining);
        if self.plan.norm == Norm::Largest {
            let patterns: Vec<&[usize]> = self.state.found.iter().map(|f| f.segments.as_slice()).collect();
            order_by_binding(&self.full, &patterns, &mut self.state.working);
        }
        self.working = Space::new(self.full.matrix().select(&self.state.working), self.full.class());
    }
}

fn values_of(space: &Space, segments: &[usize]) -> Vec<f64> {
    space.columns().values(space.walk(segments.to_vec()).coefficients())
}

/// The local maxima of |v| above a limit.
fn peaks(values: &[f64], limit: f64) -> Vec<usize> {
    let size = |i: usize| values[i].abs();
    (0..values.len())
        .filter(|&i| {
            size(i) > limit && (i == 0 || size(i) >= size(i - 1)) && (i + 1 == values.len() || size(i) >= size(i + 1))
        })
        .collect()
}

/// Every so many-th sample is in the first working set.
const THINNING: usize = 8;
const PROBED_PATTERNS: usize = 64;

/// A thinned grid and the samples that bind random patterns; all samples where they are few or all of them count.
fn first_working_set(full: &Space, plan: &Plan) -> Vec<usize> {
    let samples = full.matrix().samples();
    if plan.norm != Norm::Largest {
        return (0..samples).collect();
    }
    let mut random = generator(plan.seed, 0);
    let drawn: Vec<Vec<usize>> = (0..PROBED_PATTERNS).map(|_| full.draw(&mut random)).collect();
    let mut working: Vec<usize> = if samples <= THINNING * BLOCK {
        (0..samples).collect()
    } else {
        let binding = drawn.iter().chain(&plan.starts).flat_map(|segments| {
            let values = values_of(full, segments);
            peaks(&values, 0.9 * plan.norm.of(&values))
        });
        binding.chain((0..samples).step_by(THINNING)).collect()
    };
    working.sort_unstable();
    working.dedup();
    let patterns: Vec<&[usize]> = drawn.iter().map(Vec::as_slice).collect();
    order_by_binding(full, &patterns, &mut working);
    working
}

/// Puts first the samples that come nearest to the largest value under given patterns.
fn order_by_binding(full: &Space, patterns: &[&[usize]], samples: &mut [usize]) {
    let mut scores = vec![0.0_f64; full.matrix().samples()];
    for segments in patterns {
        let values = values_of(full, segments);
        let largest = Norm::Largest.of(&values);
        if largest > 0.0 {
            for (score, v) in scores.iter_mut().zip(&values) {
                *score += (v / largest).powi(8);
            }
        }
    }
    samples.sort_by(|&a, &b| scores[b].total_cmp(&scores[a]).then(a.cmp(&b)));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coil::LayerLength;
    use crate::search::samples::tests::{model, profiles};
    use crate::search::signs::{segments_of_signs, sign_columns, sign_value};
    use crate::search::worst_case::SolvedProfiles;

    fn plan(norm: Norm, seed: u64) -> Plan {
        let rules = Rules { rounds: 8, patience: 2, moves: None, target: None };
        Plan { seed, norm, restarts_per_round: 4, moves_per_restart: 4000, rules, starts: vec![] }
    }

    #[test]
    fn up_to_fourteen_layers_the_search_finds_the_smallest_of_all_standard_patterns() {
        for layers in [2, 4, 6, 8, 10, 12, 14] {
            let model = model(layers, LayerLength::Actual, &[]);
            let solved = SolvedProfiles::new(&model, &profiles()[..1]).unwrap();
            let (matrix, _) = SampleMatrix::of_profiles(&model, &solved).unwrap();
            let columns = sign_columns(&matrix).unwrap();
            for norm in [Norm::Largest, Norm::RootMeanSquare] {
                let smallest = (0..1u32 << (layers - 2))
                    .map(|bits| {
                        let high: Vec<f64> = (0..layers - 1).map(|m| sign_value(bits >> m & 1 == 1)).collect();
                        norm.of(&columns.values(&high))
                    })
                    .fold(f64::INFINITY, f64::min);
                let mut search = Optimisation::new(matrix.clone(), WindabilityClass::Standard, plan(norm, 3));
                while search.advance() {}
                let found = search.best().unwrap();
                assert!((found.cost / smallest - 1.0).abs() < 1e-9, "{layers} layers, {norm:?}");
            }
        }
    }

    #[test]
    fn the_work_of_a_search_is_counted_and_is_that_of_its_plan() {
        let model = model(8, LayerLength::Equal, &[]);
        let solved = SolvedProfiles::new(&model, &profiles()).unwrap();
        let (matrix, _) = SampleMatrix::of_profiles(&model, &solved).unwrap();
        let mut plan = plan(Norm::Largest, 1);
        plan.rules = Rules { rounds: 2, patience: 9, moves: None, target: None };
        let mut search = Optimisation::new(matrix, WindabilityClass::Any, plan);
        while search.advance() {}
        assert_eq!(search.evaluations(), 2 * 4 * 4000);
        assert_eq!(search.state().stop, Some(Stop::Rounds));
        let samples_a_move = search.state().work.samples as f64 / search.evaluations() as f64;
        assert!(samples_a_move < 200.0, "{samples_a_move}");
    }

    #[test]
    fn a_round_ends_with_the_slice_in_which_a_restart_reaches_the_target() {
        let model = model(8, LayerLength::Equal, &[]);
        let solved = SolvedProfiles::new(&model, &profiles()).unwrap();
        let (matrix, _) = SampleMatrix::of_profiles(&model, &solved).unwrap();
        let search = |target: Option<f64>| {
            let mut plan = plan(Norm::Largest, 1);
            plan.moves_per_restart = 4 * crate::search::anneal::SLICE_MOVES;
            plan.rules = Rules { rounds: 1, patience: 9, moves: None, target };
            let mut search = Optimisation::new(matrix.clone(), WindabilityClass::Any, plan);
            while search.advance() {}
            search
        };
        let best_cost = search(None).best().unwrap().cost;
        let reached = search(Some(3.0 * best_cost));
        assert_eq!(reached.state().stop, Some(Stop::Target));
        assert_eq!(reached.evaluations(), 4 * crate::search::anneal::SLICE_MOVES);
        assert!(reached.best().unwrap().cost <= 3.0 * best_cost);
        assert_eq!(reached.state().first_with_best().unwrap().evaluations, reached.evaluations());
        assert_eq!(search(Some(0.5 * best_cost)).state().stop, Some(Stop::Rounds));
    }

    #[test]
    fn a_search_never_ends_worse_than_where_it_began() {
        let model = model(8, LayerLength::Equal, &[]);
        let solved = SolvedProfiles::new(&model, &profiles()).unwrap();
        let (matrix, _) = SampleMatrix::of_profiles(&model, &solved).unwrap();
        let start = segments_of_signs(&[true, false, false, true, true, false, true]);
        let space = Space::new(matrix.clone(), WindabilityClass::Standard);
        let cost = Norm::Largest.of(&values_of(&space, &start));
        let mut plan = plan(Norm::Largest, 1);
        plan.starts = vec![start];
        plan.moves_per_restart = 1;
        plan.restarts_per_round = 1;
        let mut search = Optimisation::new(matrix, WindabilityClass::Standard, plan);
        while search.advance() {}
        assert!(search.best().unwrap().cost <= cost);
    }
}
