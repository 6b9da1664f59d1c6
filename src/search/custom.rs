//! Searches for what a caller brings: an array of sensitivities, or any function of the pattern.
//!
//! ```text
//! minimise ‖ c_s + Σ_j a_sj (2 P(j) − 1 − N) ‖   over the patterns P of a class
//! ```
//!
//! The annealer is the one that every search runs on; costs keep the caller's unit.

use std::ops::ControlFlow;
use std::sync::Arc;

use rand_chacha::ChaCha8Rng;
use thiserror::Error;

use super::anneal::limits::{WindingLimits, draw, neighbour};
use super::anneal::quantile;
use super::anneal::rounds::{FoundPattern, Optimisation, Plan, RoundRecord, Rounds, State};
use super::answer::Ended;
use super::cost::columns::Work;
use super::cost::samples::SampleMatrix;
use super::cost::{Cost, InFull, MoveProposal, Pace, Position};
use super::request::{Halt, Observer};
use crate::pattern::classic::Classic;
use crate::pattern::windability::WindabilityClass;

/// Layers that a caller's array or function may have.
pub(crate) const MOST_LAYERS: usize = 400;

/// Why a caller's cost cannot be searched.
#[derive(Debug, Error, Clone, PartialEq)]
#[allow(missing_docs, reason = "its messages say what each means")]
#[non_exhaustive]
pub enum CustomError {
    #[error("layers must be even and from 2 to {MOST_LAYERS}, found {found}")]
    Layers { found: usize },
    #[error("expected at least one sample, found none")]
    Empty,
    #[error("the array has {found} values, which is no multiple of {layers} layers")]
    Shape { layers: usize, found: usize },
    #[error("constant must have one value a sample, {expected}, found {found}")]
    Constant { expected: usize, found: usize },
    #[error("sensitivities must be finite numbers: the one of sample {sample}, layer {layer} is {found}")]
    NotFinite { sample: usize, layer: usize, found: f64 },
    #[error("constant must be finite numbers: that of sample {sample} is {found}")]
    ConstantNotFinite { sample: usize, found: f64 },
}

fn check_layers(layers: usize) -> Result<(), CustomError> {
    // What no cylindrical winding has is no layer count.
    let fits = layers <= MOST_LAYERS && Classic::Zyl.pattern(layers).is_ok();
    if fits { Ok(()) } else { Err(CustomError::Layers { found: layers }) }
}

/// The matrix of an array of sensitivities: row-major, samples × layers, innermost layer first; `constant` is empty or has one
/// value a sample.
///
/// # Errors
/// A shape that does not fit, numbers that are not finite.
pub fn sensitivity_matrix(layers: usize, sensitivities: &[f64], constant: &[f64]) -> Result<SampleMatrix, CustomError> {
    check_layers(layers)?;
    if sensitivities.is_empty() {
        return Err(CustomError::Empty);
    }
    if !sensitivities.len().is_multiple_of(layers) {
        return Err(CustomError::Shape { layers, found: sensitivities.len() });
    }
    let samples = sensitivities.len() / layers;
    if !constant.is_empty() && constant.len() != samples {
        return Err(CustomError::Constant { expected: samples, found: constant.len() });
    }
    if let Some(at) = sensitivities.iter().position(|v| !v.is_finite()) {
        let (sample, layer, found) = (at / layers, at % layers + 1, sensitivities[at]);
        return Err(CustomError::NotFinite { sample, layer, found });
    }
    if let Some(sample) = constant.iter().position(|v| !v.is_finite()) {
        return Err(CustomError::ConstantNotFinite { sample, found: constant[sample] });
    }
    Ok(SampleMatrix::of_sensitivities(layers, sensitivities, constant))
}

/// As [`Plan::usual`], where a move costs what a caller's function costs.
pub fn default_function_plan(layers: usize, seed: u64) -> Plan {
    Plan { moves_per_restart: quantile::default_moves_per_restart(layers), ..Plan::usual(layers, seed) }
}

/// What a search for a caller's cost found.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct CustomAnswer {
    /// Best first, no two alike.
    pub found: Vec<FoundPattern>,
    /// Moves judged.
    pub evaluations: u64,
    /// Rounds that have ended.
    pub rounds: u64,
    /// Why it ended.
    pub ended: Ended,
    pub(crate) history: Vec<RoundRecord>,
}

/// Makes a cost small; `None` if the observer ended it before anything was found.
pub fn search<C: Cost>(cost: C, plan: Plan, observer: &mut dyn Observer) -> Option<CustomAnswer> {
    run(Optimisation::new(cost, plan), observer)
}

/// As [`search`], from a saved state; everything else must be as it was when it was saved. `None` for a state that no search
/// for this cost can have been in.
pub(crate) fn resume<C: Cost>(
    cost: C,
    plan: Plan,
    state: State,
    observer: &mut dyn Observer,
) -> Option<Option<CustomAnswer>> {
    Some(run(Optimisation::resume(cost, plan, state)?, observer))
}

fn run<C: Cost>(mut search: Optimisation<C>, observer: &mut dyn Observer) -> Option<CustomAnswer> {
    observer.begun(&search);
    let ended = loop {
        let goes_on = search.advance();
        match observer.advanced(&search) {
            ControlFlow::Break(Halt::Clock) => break Ended::Clock,
            ControlFlow::Break(Halt::Signal) => break Ended::Signal,
            ControlFlow::Continue(()) if !goes_on => break Ended::Rule(search.state().stop),
            ControlFlow::Continue(()) => {}
        }
    };
    observer.ended(&search);
    search.gather();
    let (state, evaluations) = (search.state(), search.evaluations());
    (!state.found.is_empty()).then(|| CustomAnswer {
        found: state.found.clone(),
        history: state.history.clone(),
        evaluations,
        rounds: state.round,
        ended,
    })
}

/// Any function of P(j), innermost layer first. It must give the same number for the same pattern, from any thread.
pub struct FunctionCost<F> {
    function: Arc<F>,
    layers: usize,
    limits: WindingLimits,
}

impl<F: Fn(&[usize]) -> f64 + Send + Sync> FunctionCost<F> {
    /// # Errors
    /// A layer count that no winding has.
    pub fn new(layers: usize, limits: impl Into<WindingLimits>, function: F) -> Result<Self, CustomError> {
        check_layers(layers)?;
        Ok(Self { function: Arc::new(function), layers, limits: limits.into() })
    }
}

impl<F> Clone for FunctionCost<F> {
    fn clone(&self) -> Self {
        Self { function: Arc::clone(&self.function), layers: self.layers, limits: self.limits }
    }
}

impl<F> std::fmt::Debug for FunctionCost<F> {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.debug_struct("FunctionCost")
            .field("layers", &self.layers)
            .field("limits", &self.limits)
            .finish_non_exhaustive()
    }
}

/// A pattern, its cost, and the pattern proposed last.
#[derive(Debug, Clone)]
pub struct FunctionPosition {
    segments: Vec<usize>,
    cost: f64,
    proposed: (Vec<usize>, f64),
    work: Work,
}

impl<F: Fn(&[usize]) -> f64 + Send + Sync> Position<FunctionCost<F>> for FunctionPosition {
    fn cost(&self) -> f64 {
        self.cost
    }

    fn segments(&self) -> Vec<usize> {
        self.segments.clone()
    }

    fn propose(&mut self, cost: &FunctionCost<F>, random: &mut ChaCha8Rng, limit: f64) -> MoveProposal {
        self.work.moves += 1;
        let Some(candidate) = neighbour(cost.limits, &self.segments, random) else { return MoveProposal::Outside };
        let proposed = (cost.function)(&candidate);
        self.work.samples += 1;
        self.proposed = (candidate, proposed);
        if proposed <= limit { MoveProposal::Within(proposed) } else { MoveProposal::Refused }
    }

    fn cost_of(&mut self, cost: &FunctionCost<F>, segments: &[usize], limit: f64) -> Option<f64> {
        self.work.samples += 1;
        Some((cost.function)(segments)).filter(|found| *found <= limit)
    }

    fn accept(&mut self, _cost: &FunctionCost<F>) {
        self.work.accepted += 1;
        self.cost = self.proposed.1;
        std::mem::swap(&mut self.segments, &mut self.proposed.0);
    }

    fn refuse(&mut self, _cost: &FunctionCost<F>) {}

    fn work(&self) -> Work {
        self.work
    }
}

impl<F: Fn(&[usize]) -> f64 + Send + Sync> Cost for FunctionCost<F> {
    type Position = FunctionPosition;

    /// A move costs what the function costs; a stop should not wait long for it.
    const PACE: Pace = Pace { slice_moves: 128, moves_per_temperature: 16, probed_patterns: 4, probed_moves: 16 };

    fn layers(&self) -> usize {
        self.layers
    }

    fn samples(&self) -> usize {
        1
    }

    fn admits(&self, segments: &[usize]) -> bool {
        self.limits.admits(segments)
    }

    fn is_of_permutations(&self) -> bool {
        self.limits.class != WindabilityClass::Standard
    }

    fn draw(&self, random: &mut ChaCha8Rng) -> Vec<usize> {
        draw(self.limits, self.layers, random)
    }

    fn at(&self, segments: &[usize]) -> FunctionPosition {
        let cost = (self.function)(segments);
        FunctionPosition {
            segments: segments.to_vec(),
            cost,
            proposed: (segments.to_vec(), cost),
            work: Work::default(),
        }
    }

    fn in_full(&self, segments: &[usize], _working: &[usize]) -> InFull {
        InFull { cost: (self.function)(segments), segments: segments.to_vec(), joining: Vec::new() }
    }

    fn select(&self, _working: &[usize]) -> Self {
        self.clone()
    }

    fn first_working_set(&self, _seed: u64, _starts: &[Vec<usize>]) -> Vec<usize> {
        Vec::new()
    }

    fn order_working_set(&self, _best: &[&[usize]], _working: &mut [usize]) {}
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pattern::windability::WindabilityClass;
    use crate::search::anneal::sample_cost::SampleCost;
    use crate::search::cost::columns::Norm;
    use crate::search::request::Unobserved;

    const LAYERS: usize = 6;

    /// Two rows that no pattern makes vanish together.
    fn sensitivities() -> Vec<f64> {
        let row = |k: usize| (0..LAYERS).map(move |j| ((3 * j + 5 * k * k + 1) % 7) as f64 - 2.6 + 0.1 * k as f64);
        (0..3).flat_map(row).collect()
    }

    fn cost_of(segments: &[usize], constant: &[f64]) -> f64 {
        let values = sensitivities();
        let rows = values.chunks(LAYERS).zip(constant).map(|(row, c)| {
            let parts = row.iter().zip(segments).map(|(a, p)| a * (2.0 * *p as f64 - 1.0 - LAYERS as f64));
            (c + parts.sum::<f64>()).abs()
        });
        rows.fold(0.0, f64::max)
    }

    fn permutations(left: Vec<usize>) -> Vec<Vec<usize>> {
        if left.is_empty() {
            return vec![Vec::new()];
        }
        let with = |i: usize| {
            let mut rest = left.clone();
            let first = rest.remove(i);
            permutations(rest).into_iter().map(move |tail| [vec![first], tail].concat())
        };
        (0..left.len()).flat_map(with).collect()
    }

    #[test]
    fn array_and_function_find_the_best_of_all_patterns_and_report_the_cost_that_the_formula_gives() {
        let constant = [0.4, -0.3, 0.2];
        for class in [WindabilityClass::Any, WindabilityClass::Captive(1), WindabilityClass::Standard] {
            let limits = WindingLimits::from(class);
            let all = permutations((1..=LAYERS).collect()).into_iter().filter(|p| limits.admits(p));
            let smallest = all.map(|p| cost_of(&p, &constant)).fold(f64::INFINITY, f64::min);
            let matrix = sensitivity_matrix(LAYERS, &sensitivities(), &constant).unwrap();
            let of_array =
                search(SampleCost::new(matrix, class, Norm::Largest), Plan::usual(LAYERS, 1), &mut Unobserved);
            let function = FunctionCost::new(LAYERS, class, |p: &[usize]| cost_of(p, &constant)).unwrap();
            let plan = Plan { moves_per_restart: 2000, ..Plan::usual(LAYERS, 1) };
            let of_function = search(function, plan, &mut Unobserved);
            for answer in [of_array.unwrap(), of_function.unwrap()] {
                let best = &answer.found[0];
                assert!((best.cost - smallest).abs() < 1e-9, "{class}: {} {smallest}", best.cost);
                assert!((cost_of(&best.segments, &constant) - best.cost).abs() < 1e-9, "{:?}", best.segments);
            }
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_patterns_for_a_function_at_one_and_two_threads() {
        let of = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let function = |p: &[usize]| cost_of(p, &[0.0; 3]);
            let cost = FunctionCost::new(LAYERS, WindabilityClass::Any, function).unwrap();
            let plan = Plan { moves_per_restart: 300, ..Plan::usual(LAYERS, 7) };
            pool.install(|| search(cost, plan, &mut Unobserved))
        };
        assert_eq!(of(1), of(2));
    }

    #[test]
    fn an_array_that_does_not_fit_is_refused_with_what_was_expected_and_found() {
        let said = |layers: usize, values: &[f64], constant: &[f64]| {
            sensitivity_matrix(layers, values, constant).err().map(|e| e.to_string()).unwrap_or_default()
        };
        assert!(said(3, &[0.0; 6], &[]).contains("must be even"));
        assert!(said(4, &[0.0; 6], &[]).contains("no multiple of 4"));
        assert!(said(4, &[], &[]).contains("found none"));
        assert!(said(4, &[0.0, 1.0, f64::NAN, 0.0], &[]).contains("sample 0, layer 3 is NaN"));
        assert!(said(4, &[0.0; 8], &[1.0]).contains("one value a sample, 2, found 1"));
        assert!(said(4, &[0.0; 4], &[f64::INFINITY]).contains("sample 0 is inf"));
    }
}
