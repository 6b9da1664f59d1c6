//! Many restarts in rounds, until a rule says that it is enough.
//!
//! A round is a fixed number of restarts, advanced slice by slice in parallel. Each has a generator of its own, and
//! what they found is gathered in their order, so the result depends on the seed alone and not on threads. Between
//! slices the whole state is a plain value ([`State`]) that can be saved and taken up again.

use super::restart::{Cooling, Restart, cooling_for};
use super::windows;
use crate::parallel::InParallel;
use crate::pattern::Pattern;
use crate::search::cost::columns::Work;
use crate::search::cost::{Cost, InFull};

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
    /// Of all random numbers of the search.
    pub seed: u64,
    /// Independent of each other, on any number of threads.
    pub restarts_per_round: usize,
    /// Of each restart.
    pub moves_per_restart: u64,
    /// When it ends.
    pub rules: Rules,
    /// Patterns of the class to begin with; the first restarts start from them.
    pub starts: Vec<Vec<usize>>,
}

/// Moves a restart for a layer count: enough for the schedule to settle in the packs of `examples/`.
pub fn default_moves_per_restart(layers: usize) -> u64 {
    ((layers as u64).pow(2) * 128).min(1_000_000)
}

pub(crate) const DEFAULT_RESTARTS_PER_ROUND: usize = 8;
pub(crate) const DEFAULT_PATIENCE: u64 = 6;

impl Plan {
    /// The usual effort of a search for layers of this count: until six rounds have brought nothing better.
    pub fn usual(layers: usize, seed: u64) -> Self {
        Self {
            seed,
            restarts_per_round: DEFAULT_RESTARTS_PER_ROUND,
            moves_per_restart: default_moves_per_restart(layers),
            rules: Rules { rounds: u64::MAX, patience: DEFAULT_PATIENCE, moves: None, target: None },
            starts: Vec::new(),
        }
    }
}

/// Why a search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Stop {
    /// The plan's rounds are done.
    Rounds,
    /// The plan's moves are done.
    Moves,
    /// So many rounds brought nothing better.
    Patience,
    /// The cost is good enough.
    Target,
    /// No pattern of the class is better.
    Proved,
}

impl Stop {
    const ALL: [Stop; 5] = [Stop::Rounds, Stop::Moves, Stop::Patience, Stop::Target, Stop::Proved];

    /// As written in results.
    pub(crate) fn key(self) -> &'static str {
        match self {
            Stop::Rounds => "rounds",
            Stop::Moves => "moves",
            Stop::Patience => "no improvement",
            Stop::Target => "target",
            Stop::Proved => "proved",
        }
    }

    pub(crate) fn from_key(key: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|stop| stop.key() == key)
    }
}

/// A pattern that was found, judged on all samples.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundPattern {
    /// In the cost's unit.
    pub cost: f64,
    /// P(j), innermost layer first.
    pub segments: Vec<usize>,
}

/// The state after a round.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RoundRecord {
    pub(crate) round: u64,
    pub(crate) evaluations: u64,
    pub(crate) best_cost: f64,
    pub(crate) working_samples: usize,
}

/// The part of a search that changes: save it between slices, and the search goes on from it.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// Rounds that have ended.
    pub round: u64,
    pub(crate) restarts: Vec<Restart>,
    /// Best first, no two alike, at most [`MOST_FOUND`].
    pub found: Vec<FoundPattern>,
    /// Since something better was found.
    pub rounds_without_improvement: u64,
    /// Indices of the samples that the restarts run on, those that bind most first.
    pub(crate) working: Vec<usize>,
    /// Of all restarts that have ended.
    pub work: Work,
    pub(crate) history: Vec<RoundRecord>,
    pub(crate) stop: Option<Stop>,
}

impl State {
    /// Ends the search for a reason from outside: what is best was proved, or what is good enough was found, elsewhere.
    pub(crate) fn conclude(&mut self, stop: Stop) {
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
    pub(crate) fn first_with_best(&self) -> Option<&RoundRecord> {
        let best_cost = self.found.first()?.cost;
        self.history.iter().find(|record| record.best_cost <= best_cost)
    }

    /// Puts a pattern in its place among the best.
    pub(super) fn keep(&mut self, found: FoundPattern) {
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
pub(crate) const MOST_FOUND: usize = 24;

/// A search under way, whatever it makes small.
#[derive(Debug)]
pub struct Optimisation<C: Cost> {
    full: C,
    plan: Plan,
    cooling: Cooling,
    /// What the restarts run on, where it is not all of it.
    working: Option<C>,
    state: State,
}

/// A search in rounds that can be stopped, saved and taken up between slices, whatever it judges by.
pub trait Rounds {
    /// Advances every restart by one slice; true while there is more to do.
    fn advance(&mut self) -> bool;

    /// Judges what the restarts of an unfinished round have found so far. For the last answer of a search that is
    /// stopped from outside; save its state before.
    fn gather(&mut self);

    /// Ends the search for a reason from outside.
    fn conclude(&mut self, stop: Stop);

    /// Where it is.
    fn state(&self) -> &State;

    /// What is searched for and how.
    fn plan(&self) -> &Plan;

    /// Whether the rounds run on something that is only near to the cost.
    fn is_approximated(&self) -> bool;

    /// A pattern judged on all samples.
    fn judged(&self, segments: &[usize]) -> FoundPattern;

    /// What short restarts find that begin, hardly warm, at given patterns: each judged on all samples.
    fn refined(&self, starts: &[Vec<usize>], moves: u64) -> Vec<FoundPattern>;

    /// The best that descents from given patterns and from near them come to through all orders of a few neighbours and all ends of a
    /// few layers.
    fn in_other_orders(&self, starts: &[Vec<usize>], goes_on: &dyn Fn() -> bool) -> Option<FoundPattern>;

    /// The best pattern so far, if a round has ended or a start was given.
    fn best(&self) -> Option<&FoundPattern> {
        self.state().found.first()
    }

    /// Moves judged so far.
    fn evaluations(&self) -> u64 {
        self.state().work.moves + self.state().restarts.iter().map(|r| r.work.moves).sum::<u64>()
    }
}

impl<C: Cost> Optimisation<C> {
    /// At its beginning: the plan's starts are judged.
    pub fn new(cost: C, plan: Plan) -> Self {
        let working = cost.first_working_set(plan.seed, &plan.starts);
        let mut search = Self::resume_parts(cost, plan, State::new(working));
        for start in search.plan.starts.clone() {
            search.judge(&start);
        }
        search.begin_round();
        search
    }

    /// Goes on from a saved state; everything else must be as it was when it was saved. `None` for a state that no
    /// search for this cost can have been in.
    pub(crate) fn resume(cost: C, plan: Plan, state: State) -> Option<Self> {
        let is_pattern = |segments: &Vec<usize>| {
            segments.len() == cost.layers() && Pattern::new(segments.clone()).is_ok() && cost.admits(segments)
        };
        let runs_on_all = cost.first_working_set(plan.seed, &plan.starts).is_empty();
        let fits = state.working.iter().all(|&s| s < cost.samples())
            && state.working.is_empty() == runs_on_all
            && state.found.iter().all(|f| is_pattern(&f.segments))
            && state.restarts.iter().all(|r| is_pattern(&r.segments) && is_pattern(&r.best_segments))
            && (state.stop.is_some() || state.restarts.len() == plan.restarts_per_round);
        fits.then(|| Self::resume_parts(cost, plan, state))
    }

    fn resume_parts(full: C, plan: Plan, state: State) -> Self {
        let working = (!state.working.is_empty()).then(|| full.select(&state.working));
        let cooling = cooling_for(&full, plan.seed, plan.moves_per_restart);
        Self { full, plan, cooling, working, state }
    }

    fn running(&self) -> &C {
        self.working.as_ref().unwrap_or(&self.full)
    }

    /// Whether a restart has come upon something that is good enough on all samples: its round then ends early.
    fn has_reached_target(&self) -> bool {
        self.plan.rules.target.is_some_and(|target| {
            let promising = self.state.restarts.iter().filter(|r| r.best_cost <= target);
            promising.map(|r| self.full.in_full(&r.best_segments, &[]).cost).any(|cost| cost <= target)
        })
    }

    fn begin_round(&mut self) {
        let count = self.plan.restarts_per_round as u64;
        let first = self.state.round * count;
        self.state.restarts = (first..first + count)
            .map(|index| {
                let start = self.plan.starts.get(index as usize).map(Vec::as_slice);
                Restart::new(self.running(), self.plan.seed, index, start)
            })
            .collect();
    }

    fn end_round(&mut self) {
        let before = self.best().map_or(f64::INFINITY, |f| f.cost);
        let restarts = std::mem::take(&mut self.state.restarts);
        let mut joining = Vec::new();
        for restart in restarts {
            self.state.work += restart.work;
            joining.extend(self.judge(&restart.best_segments));
        }
        let samples = self.running().samples();
        self.state.end_round(&self.plan.rules, before, samples);
        if self.state.stop.is_none() {
            self.renew_working_set(joining);
            self.begin_round();
        }
    }

    /// Judges a pattern on all samples and keeps it if it is among the best; the samples that exceed the working set.
    fn judge(&mut self, segments: &[usize]) -> Vec<usize> {
        let InFull { cost, segments, joining } = self.full.in_full(segments, &self.state.working);
        self.state.keep(FoundPattern { cost, segments });
        joining
    }

    /// Adds samples and puts those first that bind the best patterns.
    fn renew_working_set(&mut self, mut joining: Vec<usize>) {
        if self.working.is_none() {
            return;
        }
        joining.sort_unstable();
        joining.dedup();
        let mut is_in = vec![false; self.full.samples()];
        for &s in &self.state.working {
            is_in[s] = true;
        }
        joining.retain(|&s| !is_in[s]);
        self.state.working.extend(joining);
        let best: Vec<&[usize]> = self.state.found.iter().map(|f| f.segments.as_slice()).collect();
        self.full.order_working_set(&best, &mut self.state.working);
        self.working = Some(self.full.select(&self.state.working));
    }
}

impl<C: Cost> Rounds for Optimisation<C> {
    fn advance(&mut self) -> bool {
        if self.state.stop.is_some() {
            return false;
        }
        let (cost, cooling) = (self.working.as_ref().unwrap_or(&self.full), &self.cooling);
        self.state.restarts.iter_mut().filter(|r| !r.is_done(cooling)).in_parallel().for_each(|restart| {
            restart.advance(cost, cooling);
        });
        if self.state.restarts.iter().all(|r| r.is_done(&self.cooling)) || self.has_reached_target() {
            self.end_round();
        }
        self.state.stop.is_none()
    }

    fn gather(&mut self) {
        for restart in self.state.restarts.clone() {
            self.judge(&restart.best_segments);
        }
    }

    fn conclude(&mut self, stop: Stop) {
        self.state.conclude(stop);
    }

    fn state(&self) -> &State {
        &self.state
    }

    fn plan(&self) -> &Plan {
        &self.plan
    }

    fn is_approximated(&self) -> bool {
        self.full.is_approximated()
    }

    fn judged(&self, segments: &[usize]) -> FoundPattern {
        let InFull { cost, segments, .. } = self.full.in_full(segments, &self.state.working);
        FoundPattern { cost, segments }
    }

    fn in_other_orders(&self, starts: &[Vec<usize>], goes_on: &dyn Fn() -> bool) -> Option<FoundPattern> {
        let reached = windows::followed(&self.full, starts, goes_on)?;
        Some(FoundPattern { cost: reached.cost, segments: reached.segments })
    }

    fn refined(&self, starts: &[Vec<usize>], moves: u64) -> Vec<FoundPattern> {
        let refine = |cost: &C, stream: usize, start: &[usize]| {
            let hot = WARMTH * self.full.in_full(start, &[]).cost;
            let cooling = Cooling { hot, cold: hot * COLD_OVER_WARM, moves };
            // Streams far from those of the rounds' restarts.
            let mut restart = Restart::new(cost, self.plan.seed, u64::MAX / 2 + stream as u64, Some(start));
            while !restart.is_done(&cooling) {
                restart.advance(cost, &cooling);
            }
            restart.best_segments
        };
        let all = |cost: &C, pass: usize, starts: &[Vec<usize>]| -> Vec<Vec<usize>> {
            let stream = |index: usize| pass * starts.len() + index;
            starts.iter().enumerate().in_parallel().map(|(index, start)| refine(cost, stream(index), start)).collect()
        };
        if !self.full.is_approximated() || self.state.working.is_empty() {
            let telling = self.full.that_tell(starts);
            let refined = all(telling.as_ref().unwrap_or(&self.full), 0, starts);
            return refined.iter().map(|segments| self.judged(segments)).collect();
        }
        // On samples that bind, as in the rounds; what binds besides joins for the second pass.
        let mut working = self.state.working.clone();
        let (mut found, mut from) = (Vec::new(), starts.to_vec());
        for pass in 0..PASSES {
            from = all(&self.full.narrowed(&working), pass, &from);
            for segments in &mut from {
                let InFull { cost, segments: kept, joining } = self.full.in_full(segments, &working);
                working.extend(joining);
                segments.clone_from(&kept);
                found.push(FoundPattern { cost, segments: kept });
            }
            working.sort_unstable();
            working.dedup();
            let best: Vec<&[usize]> = from.iter().map(Vec::as_slice).collect();
            self.full.order_working_set(&best, &mut working);
        }
        found
    }
}

/// Start of a refinement's cooling over the cost where it begins, and its end over its start.
const WARMTH: f64 = 0.05;
const COLD_OVER_WARM: f64 = 1e-2;
/// Passes of a refinement where rounds run on what is only near the cost.
const PASSES: usize = 2;

#[cfg(test)]
mod tests;
