//! The search for the pattern that is best when it is built imperfectly.
//!
//! ```text
//! minimise P95(P) over the patterns of a class, the coils drawn once for all of them ([`super::builds`])
//! ```
//!
//! Rounds of annealed restarts as in [`super::optimise`], with the same state, rules and checkpoints; a move is judged
//! coil by coil, those first that are worst now, and refused as soon as so many coils are above the Metropolis limit that
//! the quantile must be. Most moves are refused after a twentieth of the coils.
//!
//! The same search serves the guaranteed worst case of a coil whose bore is heated: one coil, and no sum over samples.
//!
//! # Source
//! Sample average approximation: Kleywegt, Shapiro, Homem-de-Mello, SIAM J. Optim. 12, 479 (2002).

use rayon::prelude::*;

use super::anneal::{Cooling, Restart, generator};
use super::builds::{Builds, BuiltWorst};
use super::columns::Work;
use super::guaranteed::UnitStep;
use super::limits::{Limits, draw, neighbour};
use super::objective::Objective;
use super::optimise::{Found, Optimisation, Plan, Rules, State, Stop};
use super::tolerance::Measure;
use super::verdict::{Bench, JudgeError};
use super::walk::uniform;
use crate::pattern::Pattern;
use crate::pattern::classic::Classic;
use crate::pattern::windability::WindabilityClass;

/// A search in rounds that can be stopped, saved and taken up between slices, whatever it judges by.
pub trait Rounds {
    /// Advances every restart by one slice; true while there is more to do.
    fn advance(&mut self) -> bool;

    /// Judges what the restarts of an unfinished round have found so far; save the state before.
    fn gather(&mut self);

    /// Ends the search for a reason from outside.
    fn conclude(&mut self, stop: Stop);

    fn state(&self) -> &State;

    fn plan(&self) -> &Plan;

    /// The best pattern so far, if a round has ended or a start was given.
    fn best(&self) -> Option<&Found> {
        self.state().found.first()
    }

    /// Moves judged so far.
    fn evaluations(&self) -> u64 {
        self.state().work.moves + self.state().restarts.iter().map(|r| r.work.moves).sum::<u64>()
    }
}

impl Rounds for Optimisation {
    fn advance(&mut self) -> bool {
        Optimisation::advance(self)
    }

    fn gather(&mut self) {
        Optimisation::gather(self);
    }

    fn conclude(&mut self, stop: Stop) {
        Optimisation::conclude(self, stop);
    }

    fn state(&self) -> &State {
        Optimisation::state(self)
    }

    fn plan(&self) -> &Plan {
        Optimisation::plan(self)
    }
}

/// Whose worst case a search is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Whose {
    /// The coil's as declared, sampled over its profiles.
    Declared,
    /// That of the coils built with the tolerances: their 95 % quantile.
    Built,
}

impl Bench<'_> {
    /// Begins a search for what the bench judges by, or goes on from a saved state; everything else must then be as it
    /// was when it was saved. `None` for a state that no such search can have been in.
    ///
    /// # Errors
    /// Rates that are not finite; an objective that the model has not.
    pub fn search(
        &self,
        class: WindabilityClass,
        plan: Plan,
        saved: Option<State>,
    ) -> Result<Option<Box<dyn Rounds>>, JudgeError> {
        let builds = match (self.objective, self.unit_step) {
            (Objective::P95, _) => Some(self.builds(Whose::Built, class, plan.seed)?),
            (Objective::GuaranteedRate, Some(step)) if step.is_heated() => Some(Builds::nominal(self.model, step)?),
            _ => None,
        };
        let Some(builds) = builds else {
            let matrix = match (self.objective, self.unit_step) {
                (Objective::GuaranteedRate, Some(step)) => step.samples(self.model)?,
                (Objective::GuaranteedRate, None) => {
                    UnitStep::new(self.model, self.profiles.max_rate_k_per_s)?.samples(self.model)?
                }
                (objective, _) => objective.of_profiles(self.model, self.solved)?,
            };
            return Ok(match saved {
                None => Some(Box::new(Optimisation::new(matrix, class, plan))),
                Some(state) => Optimisation::resume(matrix, class, plan, state).map(|s| Box::new(s) as Box<dyn Rounds>),
            });
        };
        Ok(match saved {
            None => Some(Box::new(RobustSearch::new(builds, class, plan))),
            Some(state) => RobustSearch::resume(builds, class, plan, state).map(|s| Box::new(s) as Box<dyn Rounds>),
        })
    }

    /// The declared coil alone, or all coils built with the tolerances, ready to be searched within [`Limits`].
    ///
    /// # Errors
    /// No tolerances, or none that are above zero.
    pub fn builds(&self, of: Whose, class: WindabilityClass, seed: u64) -> Result<Builds, JudgeError> {
        match of {
            Whose::Declared => Ok(Builds::declared(self.model, self.profiles, &self.probes(class, seed)?)?),
            Whose::Built => {
                let coils = self.coils()?;
                let probes = match coils.measure() {
                    Measure::Guaranteed => Vec::new(),
                    Measure::Sampled => self.probes(class, seed)?,
                };
                Ok(Builds::new(&coils, &probes)?)
            }
        }
    }

    /// Patterns that show at which instants the coil as declared errs most: the classics, random ones, and what a short
    /// search for a small worst rate finds.
    fn probes(&self, class: WindabilityClass, seed: u64) -> Result<Vec<Pattern>, JudgeError> {
        const RANDOM: usize = 64;
        let layers = self.model.coil.layers();
        let rules = Rules { rounds: 2, patience: 2, moves: None, target: None };
        let plan = Plan {
            seed,
            norm: Objective::WorstRate.norm(),
            restarts_per_round: 8,
            moves_per_restart: super::optimise::default_moves_per_restart(layers),
            rules,
            starts: Vec::new(),
        };
        let mut random = generator(seed, 0);
        let drawn: Vec<Vec<usize>> = (0..RANDOM).map(|_| draw(class, layers, &mut random)).collect();
        let mut search = Optimisation::new(Objective::WorstRate.of_profiles(self.model, self.solved)?, class, plan);
        while search.advance() {}
        let found = search.state().found.iter().map(|f| f.segments.clone());
        let classics = Classic::ALL.into_iter().filter_map(|classic| classic.pattern(layers).ok());
        Ok(classics.chain(drawn.into_iter().chain(found).filter_map(|s| Pattern::new(s).ok())).collect())
    }
}

/// Moves between two points at which a restart can be stopped: a move costs about a hundred times one over samples.
const SLICE_MOVES: u64 = 512;

/// The temperature is renewed after so many moves.
const MOVES_PER_TEMPERATURE: u64 = 16;

/// Start of cooling over the mean change of cost by a random move at a random pattern, and its end over its start.
const HOT: f64 = 0.3;
const COLD_OVER_HOT: f64 = 1e-3;

/// Moves a restart for a layer count.
pub fn default_moves_per_restart(layers: usize) -> u64 {
    ((layers as u64).pow(2) * 16).max(1000)
}

/// A search under way.
#[derive(Debug)]
pub struct RobustSearch {
    builds: Builds,
    limits: Limits,
    plan: Plan,
    cooling: Cooling,
    state: State,
}

impl RobustSearch {
    pub fn new(builds: Builds, limits: impl Into<Limits>, plan: Plan) -> Self {
        let limits = limits.into();
        let cooling = cooling_for(&builds, limits, &plan);
        let mut search = Self { builds, limits, plan, cooling, state: State::new(Vec::new()) };
        for start in search.plan.starts.clone() {
            search.judge(start);
        }
        search.begin_round();
        search
    }

    /// Goes on from a saved state; everything else must be as it was when it was saved. `None` for a state that no
    /// search over these coils within these limits can have been in.
    pub fn resume(builds: Builds, limits: impl Into<Limits>, plan: Plan, state: State) -> Option<Self> {
        let limits = limits.into();
        let fits = |segments: &Vec<usize>| {
            segments.len() == builds.layers() && Pattern::new(segments.clone()).is_ok() && limits.admits(segments)
        };
        let is_ours = state.working.is_empty()
            && state.found.iter().all(|f| fits(&f.segments))
            && state.restarts.iter().all(|r| fits(&r.segments) && fits(&r.best_segments))
            && (state.stop.is_some() || state.restarts.len() == plan.restarts_per_round);
        let cooling = cooling_for(&builds, limits, &plan);
        is_ours.then(|| Self { builds, limits, plan, cooling, state })
    }

    fn begin_round(&mut self) {
        let (count, layers) = (self.plan.restarts_per_round as u64, self.builds.layers());
        let first = self.state.round * count;
        self.state.restarts = (first..first + count)
            .map(|index| {
                let mut random = generator(self.plan.seed, index + 1);
                let start = self.plan.starts.get(index as usize).cloned();
                let segments = start.unwrap_or_else(|| draw(self.limits, layers, &mut random));
                Restart {
                    index,
                    moves: 0,
                    best_segments: segments.clone(),
                    segments,
                    best_cost: f64::INFINITY,
                    random,
                    work: Work::default(),
                }
            })
            .collect();
    }

    fn judge(&mut self, segments: Vec<usize>) {
        self.state.keep(Found { cost: self.builds.cost(&segments), segments });
    }
}

impl Rounds for RobustSearch {
    fn advance(&mut self) -> bool {
        if self.state.stop.is_some() {
            return false;
        }
        let (builds, limits, cooling) = (&self.builds, self.limits, &self.cooling);
        let unfinished = self.state.restarts.par_iter_mut().filter(|r| !r.is_done(cooling));
        unfinished.for_each(|restart| advance(restart, builds, limits, cooling));
        let is_good_enough = |r: &Restart| self.plan.rules.target.is_some_and(|target| r.best_cost <= target);
        let restarts = &self.state.restarts;
        if restarts.iter().all(|r| r.is_done(&self.cooling)) || restarts.iter().any(is_good_enough) {
            let before = self.best().map_or(f64::INFINITY, |f| f.cost);
            for restart in std::mem::take(&mut self.state.restarts) {
                self.state.work += restart.work;
                self.judge(restart.best_segments);
            }
            self.state.end_round(&self.plan.rules, before, self.builds.samples());
            if self.state.stop.is_none() {
                self.begin_round();
            }
        }
        self.state.stop.is_none()
    }

    fn conclude(&mut self, stop: Stop) {
        self.state.conclude(stop);
    }

    fn gather(&mut self) {
        for restart in self.state.restarts.clone() {
            self.judge(restart.best_segments);
        }
    }

    fn state(&self) -> &State {
        &self.state
    }

    fn plan(&self) -> &Plan {
        &self.plan
    }
}

/// One slice of a restart.
fn advance(restart: &mut Restart, builds: &Builds, limits: Limits, cooling: &Cooling) {
    let mut worst = BuiltWorst::new(builds, &restart.segments);
    if worst.cost() < restart.best_cost {
        (restart.best_cost, restart.best_segments) = (worst.cost(), restart.segments.clone());
    }
    let until = cooling.moves.min(restart.moves + SLICE_MOVES);
    let mut temperature = 0.0;
    let first = restart.moves;
    while restart.moves < until {
        if (restart.moves - first).is_multiple_of(MOVES_PER_TEMPERATURE) {
            temperature = cooling.temperature(restart.moves);
        }
        restart.moves += 1;
        restart.work.moves += 1;
        let limit = worst.cost() - temperature * libm::log(uniform(&mut restart.random));
        let Some(candidate) = neighbour(limits, &restart.segments, &mut restart.random) else { continue };
        if worst.propose(builds, &candidate, limit).is_some() {
            worst.accept();
            restart.work.accepted += 1;
            if worst.cost() < restart.best_cost {
                (restart.best_cost, restart.best_segments) = (worst.cost(), candidate.clone());
            }
            restart.segments = candidate;
        }
    }
    restart.work.samples += worst.judged;
}

/// As hot as a typical move is large, cooled until no such move passes; measured on stream 0 of the seed.
fn cooling_for(builds: &Builds, limits: Limits, plan: &Plan) -> Cooling {
    const PATTERNS: usize = 4;
    const MOVES: usize = 16;
    let mut random = generator(plan.seed, 0);
    let (mut total, mut count) = (0.0, 0usize);
    for _ in 0..PATTERNS {
        let segments = draw(limits, builds.layers(), &mut random);
        let cost = builds.cost(&segments);
        for _ in 0..MOVES {
            if let Some(candidate) = neighbour(limits, &segments, &mut random) {
                total += (builds.cost(&candidate) - cost).abs();
                count += 1;
            }
        }
    }
    let typical = total / count.max(1) as f64;
    let hot = if typical > 0.0 { HOT * typical } else { f64::MIN_POSITIVE.sqrt() };
    Cooling { hot, cold: hot * COLD_OVER_HOT, moves: plan.moves_per_restart }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coil::LayerLength;
    use crate::profile::ProfileSpec;
    use crate::rate::CoilModel;
    use crate::search::samples::tests::{model, profiles};
    use crate::search::signs::segments_of_signs;
    use crate::search::tolerance::{Coils, ToleranceSpec};
    use crate::search::worst_case::SolvedProfiles;

    fn profile_spec() -> ProfileSpec {
        let listed = profiles();
        ProfileSpec { max_rate_k_per_s: 0.003, count: 4, segments: 3, duration_s: 400.0, seed: 1, listed }
    }

    fn tolerance(mismatch_sd: f64, samples: usize) -> ToleranceSpec {
        ToleranceSpec {
            turns_per_layer_sd: 0.5,
            radial_pitch_sd: 0.01,
            midpoint_offset_sd_m: 0.01,
            diffusivity_sd: 0.1,
            film_sd: 0.2,
            mismatch_sd,
            samples,
            seed: 5,
            limit_rad_per_s: None,
        }
    }

    fn plan(seed: u64) -> Plan {
        let rules = Rules { rounds: 8, patience: 2, moves: None, target: None };
        let norm = Objective::P95.norm();
        Plan { seed, norm, restarts_per_round: 8, moves_per_restart: 400, rules, starts: vec![] }
    }

    fn with_bench<T>(
        model: &CoilModel,
        objective: Objective,
        tolerance: &ToleranceSpec,
        run: impl FnOnce(&Bench) -> T,
    ) -> T {
        let profiles = profile_spec();
        let solved = SolvedProfiles::new(model, &profiles.profiles()).unwrap();
        let unit_step = UnitStep::new(model, profiles.max_rate_k_per_s).ok();
        let (unit_step, tolerance) = (unit_step.as_ref(), Some(tolerance));
        run(&Bench { model, solved: &solved, objective, unit_step, profiles: &profiles, tolerance })
    }

    fn searched(bench: &Bench, seed: u64) -> (Pattern, f64) {
        let mut search = bench.search(WindabilityClass::Standard, plan(seed), None).unwrap().unwrap();
        while search.advance() {}
        let best = bench.best(WindabilityClass::Standard, &search.state().found, &[]).unwrap().unwrap();
        (best.pattern, best.objective_rad_per_s)
    }

    fn standard_patterns(layers: usize) -> Vec<Pattern> {
        (0..1u32 << (layers - 1))
            .map(|bits| {
                let high: Vec<bool> = (0..layers - 1).map(|m| bits >> m & 1 == 1).collect();
                Pattern::new(segments_of_signs(&high)).unwrap()
            })
            .collect()
    }

    #[test]
    fn the_pattern_that_is_best_built_imperfectly_is_that_of_all_standard_patterns_with_and_without_a_guaranteed_bound()
    {
        let cases: [(usize, &[&str]); 3] = [
            (8, &["surface_film"]),
            (6, &["surface_film", "self_heating"]),
            (6, &["surface_film", "heating_cooling_asymmetry"]),
        ];
        for (layers, effects) in cases {
            let model = model(layers, LayerLength::Actual, effects);
            let tolerance = tolerance(0.004, 16);
            with_bench(&model, Objective::P95, &tolerance, |bench| {
                let all = standard_patterns(layers);
                let p95 = Coils::new(&model, bench.profiles, &tolerance).unwrap().p95_rad_per_s(&all).unwrap();
                let smallest = p95.iter().copied().fold(f64::INFINITY, f64::min);
                let (pattern, found) = searched(bench, 1);
                assert!((found / smallest - 1.0).abs() < 1e-9, "{effects:?} {pattern:?}: {found} {smallest}");
                // What the search runs on is never above what is reported, and hardly below it.
                let builds =
                    Builds::new(&bench.coils().unwrap(), &bench.probes(WindabilityClass::Standard, 1).unwrap());
                let builds = builds.unwrap();
                for (pattern, p95) in all.iter().zip(&p95) {
                    let share = builds.cost(pattern.segments()) / p95;
                    // Sampled worst cases are compiled at the declared coil's instants, not at each coil's own peaks.
                    let least = if bench.unit_step.is_some() { 0.998 } else { 0.99 };
                    assert!((least..=1.0 + 1e-9).contains(&share), "{effects:?} {pattern:?}: {share}");
                }
            });
        }
    }

    #[test]
    fn with_a_heated_bore_the_pattern_of_the_smallest_guaranteed_error_is_that_of_all_standard_patterns() {
        let model = model(8, LayerLength::Actual, &["surface_film", "self_heating"]);
        with_bench(&model, Objective::GuaranteedRate, &tolerance(0.0, 2), |bench| {
            let bound = |p: &Pattern| bench.judge("x", p).unwrap().objective_rad_per_s;
            let smallest = standard_patterns(8).iter().map(bound).fold(f64::INFINITY, f64::min);
            let (pattern, found) = searched(bench, 1);
            assert!((found / smallest - 1.0).abs() < 1e-9, "{pattern:?}: {found} {smallest}");
        });
    }

    #[test]
    fn a_pattern_that_wins_only_on_paper_loses_when_it_is_built() {
        let model = model(12, LayerLength::Actual, &["surface_film"]);
        let tolerance = tolerance(0.0005, 24);
        let (on_paper, _) = with_bench(&model, Objective::WorstRate, &tolerance, |bench| searched(bench, 1));
        with_bench(&model, Objective::P95, &tolerance, |bench| {
            let (built, _) = searched(bench, 1);
            let worst = |p: &Pattern| bench.judge("x", p).unwrap();
            let (paper, built) = (worst(&on_paper), worst(&built));
            println!("on paper {paper:?}\nbuilt {built:?}");
            assert!(paper.worst.rate_rad_per_s.abs() < 0.99 * built.worst.rate_rad_per_s.abs());
            assert!(paper.p95_rad_per_s.unwrap() > 1.15 * built.p95_rad_per_s.unwrap());
        });
    }

    #[test]
    fn the_same_seed_gives_the_same_patterns_at_one_and_two_threads_and_after_an_interruption() {
        let model = model(10, LayerLength::Actual, &["surface_film"]);
        let tolerance = tolerance(0.004, 12);
        with_bench(&model, Objective::P95, &tolerance, |bench| {
            let class = WindabilityClass::Captive(1);
            let of = |threads: usize| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| {
                    let mut search = bench.search(class, plan(3), None).unwrap().unwrap();
                    while search.advance() {}
                    search.state().clone()
                })
            };
            let unbroken = of(1);
            assert_eq!(unbroken, of(2));
            let mut broken = bench.search(class, plan(3), None).unwrap().unwrap();
            for _ in 0..3 {
                broken.advance();
            }
            let saved = broken.state().clone();
            broken.gather();
            let mut resumed = bench.search(class, plan(3), Some(saved)).unwrap().unwrap();
            while resumed.advance() {}
            assert_eq!(*resumed.state(), unbroken);
        });
    }

    #[test]
    fn most_moves_are_refused_after_a_fraction_of_the_coils() {
        let model = model(10, LayerLength::Actual, &["surface_film"]);
        with_bench(&model, Objective::P95, &tolerance(0.004, 100), |bench| {
            let builds = Builds::new(&bench.coils().unwrap(), &[]).unwrap();
            let mut search = RobustSearch::new(builds, WindabilityClass::Any, plan(1));
            while search.advance() {}
            let Work { moves, samples, .. } = search.state().work;
            println!("{} coils a move of 100", samples as f64 / moves as f64);
            assert!(samples < moves * 50, "{samples} coils in {moves} moves");
        });
    }
}
