//! From an objective to a search: the cost that it compiles to, and the rounds that make it small.

use super::anneal::limits::draw;
use super::anneal::quantile::{self, QuantileCost};
use super::anneal::restart::generator;
use super::anneal::rounds::{Optimisation, Plan, Rounds, Rules, State};
use super::anneal::sample_cost::SampleCost;
use super::cost::Cost;
use super::cost::columns::Norm;
use super::cost::guaranteed::UnitStep;
use super::cost::objective::Objective;
use super::cost::sampled_coils::SampledCoils;
use super::cost::samples::SampleMatrix;
use super::cost::tolerance::Measure;
use super::evaluator::{Evaluator, JudgeError};
use crate::pattern::Pattern;
use crate::pattern::classic::Classic;
use crate::pattern::windability::WindabilityClass;
use crate::rate::LayerWeights;
use crate::search::cost::worst_case::SearchError;

/// Whose worst case a search is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Whose {
    /// The coil's as declared, sampled over its profiles.
    Declared,
    /// That of the coils built with the tolerances: their 95 % quantile.
    Built,
}

impl Evaluator<'_> {
    /// Begins a search for what the evaluator judges by, or goes on from a saved state; everything else must then be as it
    /// was when it was saved. `None` for a state that no such search can have been in.
    ///
    /// # Errors
    /// Rates that are not finite; an objective that the model has not.
    pub(crate) fn search(
        &self,
        class: WindabilityClass,
        plan: Plan,
        saved: Option<State>,
    ) -> Result<Option<Box<dyn Rounds>>, JudgeError> {
        let coils = match (self.objective, self.unit_step) {
            (Objective::P95, _) => Some(self.sampled_coils(Whose::Built, class, plan.seed)?),
            (Objective::GuaranteedRate, Some(step)) if step.is_heated() => {
                Some(SampledCoils::nominal(self.model, step)?)
            }
            _ => None,
        };
        let Some(coils) = coils else {
            let matrix = match (self.objective, self.unit_step) {
                (Objective::GuaranteedRate, Some(step)) => step.samples(self.model)?,
                (Objective::GuaranteedRate, None) => {
                    UnitStep::new(self.model, self.profiles.max_rate_k_per_s)?.samples(self.model)?
                }
                (objective, _) => objective.of_profiles(self.model, self.solved)?,
            };
            return Ok(begun(self.sample_cost(matrix, class, self.objective.norm())?, plan, saved));
        };
        Ok(begun(QuantileCost::new(coils, class), plan, saved))
    }

    /// Moves of a restart of a short search: where a move is judged on whole coils, as many as one over built coils has.
    pub(super) fn short_moves_per_restart(&self, layers: usize) -> u64 {
        let is_heated = self.objective == Objective::GuaranteedRate && self.unit_step.is_some_and(UnitStep::is_heated);
        if is_heated {
            quantile::default_moves_per_restart(layers)
        } else {
            self.objective.default_moves_per_restart(layers)
        }
    }

    /// A norm of samples as the annealer runs on it.
    ///
    /// # Errors
    /// Effects that leave a layer no turns.
    pub(super) fn sample_cost(
        &self,
        matrix: SampleMatrix,
        class: WindabilityClass,
        norm: Norm,
    ) -> Result<SampleCost, SearchError> {
        let cost = SampleCost::new(matrix, class, norm);
        let layers = self.model.coil.layers();
        match Classic::Qua.pattern(layers).or(Classic::Dip.pattern(layers)) {
            Ok(near) => Ok(cost.frozen_at(&LayerWeights::new(&self.model.wound_coil()?, &near)?)),
            Err(_) => Ok(cost),
        }
    }

    /// The declared coil alone, or all coils built with the tolerances, ready to be searched within `Limits`.
    ///
    /// # Errors
    /// No tolerances, or none that are above zero.
    pub fn sampled_coils(&self, of: Whose, class: WindabilityClass, seed: u64) -> Result<SampledCoils, JudgeError> {
        match of {
            Whose::Declared => Ok(SampledCoils::declared(self.model, self.profiles, &self.probes(class, seed)?)?),
            Whose::Built => {
                let coils = self.coils()?;
                let probes = match coils.measure() {
                    Measure::Guaranteed => Vec::new(),
                    Measure::Sampled => self.probes(class, seed)?,
                };
                Ok(SampledCoils::new(&coils, &probes)?)
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
            restarts_per_round: 8,
            moves_per_restart: super::anneal::rounds::default_moves_per_restart(layers),
            rules,
            starts: Vec::new(),
        };
        let mut random = generator(seed, 0);
        let drawn: Vec<Vec<usize>> = (0..RANDOM).map(|_| draw(class, layers, &mut random)).collect();
        let matrix = Objective::WorstRate.of_profiles(self.model, self.solved)?;
        let mut search = Optimisation::new(SampleCost::new(matrix, class, Objective::WorstRate.norm()), plan);
        while search.advance() {}
        let found = search.state().found.iter().map(|f| f.segments.clone());
        let classics = Classic::ALL.into_iter().filter_map(|classic| classic.pattern(layers).ok());
        Ok(classics.chain(drawn.into_iter().chain(found).filter_map(|s| Pattern::new(s).ok())).collect())
    }
}

/// `None` for a state that no such search can have been in.
fn begun<C: Cost + 'static>(cost: C, plan: Plan, saved: Option<State>) -> Option<Box<dyn Rounds>> {
    match saved {
        None => Some(Box::new(Optimisation::new(cost, plan))),
        Some(state) => Optimisation::resume(cost, plan, state).map(|search| Box::new(search) as Box<dyn Rounds>),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coil::LayerLength;
    use crate::profile::ProfileSpec;
    use crate::rate::CoilModel;
    use crate::search::cost::columns::Work;
    use crate::search::cost::sampled_coils::QuantileWorst;
    use crate::search::cost::samples::tests::{model, profiles};
    use crate::search::cost::signs::segments_of_signs;
    use crate::search::cost::tolerance::{AsBuilt, Coils, ToleranceSpec};
    use crate::search::cost::worst_case::SolvedProfiles;

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
            as_built: AsBuilt::default(),
            samples,
            seed: 5,
            limit_rad_per_s: None,
        }
    }

    fn plan(seed: u64) -> Plan {
        let rules = Rules { rounds: 8, patience: 2, moves: None, target: None };
        Plan { seed, restarts_per_round: 8, moves_per_restart: 400, rules, starts: vec![] }
    }

    fn with_evaluator<T>(
        model: &CoilModel,
        objective: Objective,
        tolerance: &ToleranceSpec,
        run: impl FnOnce(&Evaluator) -> T,
    ) -> T {
        let profiles = profile_spec();
        let solved = SolvedProfiles::new(model, &profiles.profiles()).unwrap();
        let unit_step = UnitStep::new(model, profiles.max_rate_k_per_s).ok();
        let (unit_step, tolerance) = (unit_step.as_ref(), Some(tolerance));
        run(&Evaluator { model, solved: &solved, objective, unit_step, profiles: &profiles, tolerance })
    }

    fn searched(evaluator: &Evaluator, seed: u64) -> (Pattern, f64) {
        let mut search = evaluator.search(WindabilityClass::Standard, plan(seed), None).unwrap().unwrap();
        while search.advance() {}
        let best = evaluator.best(WindabilityClass::Standard, &search.state().found, &[]).unwrap().unwrap();
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
            with_evaluator(&model, Objective::P95, &tolerance, |evaluator| {
                let all = standard_patterns(layers);
                let p95 = Coils::new(&model, evaluator.profiles, &tolerance).unwrap().p95_rad_per_s(&all).unwrap();
                let smallest = p95.iter().copied().fold(f64::INFINITY, f64::min);
                let (pattern, found) = searched(evaluator, 1);
                assert!((found / smallest - 1.0).abs() < 1e-9, "{effects:?} {pattern:?}: {found} {smallest}");
                // What the search runs on is never above what is reported, and hardly below it.
                let coils = SampledCoils::new(
                    &evaluator.coils().unwrap(),
                    &evaluator.probes(WindabilityClass::Standard, 1).unwrap(),
                );
                let coils = coils.unwrap();
                for (pattern, p95) in all.iter().zip(&p95) {
                    let share = coils.cost(pattern.segments()) / p95;
                    // Sampled worst cases are compiled at the declared coil's instants, not at each coil's own peaks.
                    let least = if evaluator.unit_step.is_some() { 0.998 } else { 0.99 };
                    assert!((least..=1.0 + 1e-9).contains(&share), "{effects:?} {pattern:?}: {share}");
                }
            });
        }
    }

    #[test]
    fn with_a_heated_bore_the_pattern_of_the_smallest_guaranteed_error_is_that_of_all_standard_patterns() {
        let model = model(8, LayerLength::Actual, &["surface_film", "self_heating"]);
        with_evaluator(&model, Objective::GuaranteedRate, &tolerance(0.0, 2), |evaluator| {
            let bound = |p: &Pattern| evaluator.judge("x", p).unwrap().objective_rad_per_s;
            let smallest = standard_patterns(8).iter().map(bound).fold(f64::INFINITY, f64::min);
            let (pattern, found) = searched(evaluator, 1);
            assert!((found / smallest - 1.0).abs() < 1e-9, "{pattern:?}: {found} {smallest}");
        });
    }

    #[test]
    fn a_pattern_that_wins_only_on_paper_loses_when_it_is_built() {
        let model = model(12, LayerLength::Actual, &["surface_film"]);
        let tolerance = tolerance(0.0005, 24);
        let (on_paper, _) =
            with_evaluator(&model, Objective::WorstRate, &tolerance, |evaluator| searched(evaluator, 1));
        with_evaluator(&model, Objective::P95, &tolerance, |evaluator| {
            let (built, _) = searched(evaluator, 1);
            let worst = |p: &Pattern| evaluator.judge("x", p).unwrap();
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
        with_evaluator(&model, Objective::P95, &tolerance, |evaluator| {
            let class = WindabilityClass::Captive(1);
            let of = |threads: usize| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| {
                    let mut search = evaluator.search(class, plan(3), None).unwrap().unwrap();
                    while search.advance() {}
                    search.state().clone()
                })
            };
            let unbroken = of(1);
            assert_eq!(unbroken, of(2));
            let mut broken = evaluator.search(class, plan(3), None).unwrap().unwrap();
            for _ in 0..3 {
                broken.advance();
            }
            let saved = broken.state().clone();
            broken.gather();
            let mut resumed = evaluator.search(class, plan(3), Some(saved)).unwrap().unwrap();
            while resumed.advance() {}
            assert_eq!(*resumed.state(), unbroken);
        });
    }

    #[test]
    fn coils_that_are_worst_near_by_tell_what_all_do_until_a_pattern_is_worst_in_others() {
        let model = model(12, LayerLength::Actual, &["surface_film", "strain_mismatch"]);
        with_evaluator(&model, Objective::P95, &tolerance(0.004, 400), |evaluator| {
            let coils = SampledCoils::new(&evaluator.coils().unwrap(), &[]).unwrap();
            let near = Classic::Qua.pattern(12).unwrap().segments().to_vec();
            let telling = coils.worst_with(std::slice::from_ref(&near)).unwrap();
            assert_eq!(telling.count(), 40);
            let of_all = coils.cost(&near);
            // Coarser in time by a little.
            assert!((telling.cost(&near) / of_all - 1.0).abs() < 0.003, "{} {of_all}", telling.cost(&near));
            // Fewer coils are above, never more.
            for classic in [Classic::Zyl, Classic::Dip, Classic::Sym] {
                let other = classic.pattern(12).unwrap().segments().to_vec();
                assert!(telling.cost(&other) <= coils.cost(&other) * (1.0 + 1e-9), "{classic:?}");
                let both = coils.worst_with(&[near.clone(), other.clone()]).unwrap();
                assert!((both.cost(&other) / coils.cost(&other) - 1.0).abs() < 0.003, "{classic:?}");
            }
            let few = SampledCoils::nominal(&model, evaluator.unit_step.unwrap()).unwrap();
            assert!(few.worst_with(&[near]).is_none());
        });
    }

    #[test]
    fn a_descent_by_coils_that_tell_ends_on_the_smallest_quantile_of_all_coils() {
        let model = model(8, LayerLength::Actual, &["surface_film", "strain_mismatch"]);
        with_evaluator(&model, Objective::P95, &tolerance(0.004, 100), |evaluator| {
            let coils = SampledCoils::new(&evaluator.coils().unwrap(), &[]).unwrap();
            let smallest = standard_patterns(8).iter().map(|p| coils.cost(p.segments())).fold(f64::INFINITY, f64::min);
            let search = Optimisation::new(QuantileCost::new(coils, WindabilityClass::Standard), plan(1));
            let start = Classic::Zyl.pattern(8).unwrap().segments().to_vec();
            let reached = search.in_other_orders(&[start], &|| true).unwrap();
            assert!((reached.cost / smallest - 1.0).abs() < 1e-9, "{} {smallest}", reached.cost);
        });
    }

    #[test]
    fn a_pattern_that_passes_is_judged_in_all_coils_and_one_that_does_not_is_hardly_ever_better() {
        let model = model(12, LayerLength::Actual, &["surface_film", "strain_mismatch"]);
        with_evaluator(&model, Objective::P95, &tolerance(0.004, 400), |evaluator| {
            let coils = SampledCoils::new(&evaluator.coils().unwrap(), &[]).unwrap();
            let here = draw(WindabilityClass::Captive(1), 12, &mut generator(1, 0));
            let mut state = QuantileWorst::new(&coils, &here);
            let limit = state.cost();
            let (mut passed, mut missed) = (0, 0);
            for stream in 1..200 {
                let there = draw(WindabilityClass::Captive(1), 12, &mut generator(1, stream));
                let cost = coils.cost(&there);
                match state.propose(&coils, &there, limit) {
                    Some(proposed) => {
                        assert_eq!(proposed, cost);
                        passed += 1;
                    }
                    None => missed += u32::from(cost <= limit),
                }
            }
            println!("{passed} passed, {missed} missed");
            assert!(passed > 10 && missed * 20 < passed, "{passed} passed, {missed} missed");
        });
    }

    #[test]
    fn most_moves_are_refused_after_a_fraction_of_the_coils() {
        let model = model(10, LayerLength::Actual, &["surface_film"]);
        with_evaluator(&model, Objective::P95, &tolerance(0.004, 100), |evaluator| {
            let coils = SampledCoils::new(&evaluator.coils().unwrap(), &[]).unwrap();
            let mut search = Optimisation::new(QuantileCost::new(coils, WindabilityClass::Any), plan(1));
            while search.advance() {}
            let Work { moves, samples, .. } = search.state().work;
            println!("{} coils a move of 100", samples as f64 / moves as f64);
            assert!(samples < moves * 50, "{samples} coils in {moves} moves");
        });
    }
}
