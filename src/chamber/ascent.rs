//! The way up to the maximum of the posterior: Fisher scoring in a trust region with a side of its own for every coordinate.
//!
//! ```text
//! maximise g·Δ − ½ Δᵀ I Δ   where |Δ_i| ≤ ρ s_i and bounds hold        s_i: stride of the coordinate, ρ: the region's share of it
//! ```
//!
//! A coordinate that runs off (a ripple that is not there, a film that readings say nothing of) stops at its own side and shortens
//! no other's step.
//!
//! Derivatives of innovations change slowly, and cost as many passes as there are coordinates. They serve for several steps,
//! with the innovations of each point:
//!
//! ```text
//! g ≈ Σ −v'v/S + ½ (S'/S) (v²/S − 1)           v', S'/S: of an earlier point; v, S: of this one
//! ```
//!
//! They are taken anew where they no longer foretell what a step gains, and before an ascent to the top ends. For the same reason
//! those of one fit serve the next that begins where it ended, with one effect more or one less ([`KnownDerivatives`]).
//!
//! # Source
//! Conn, Gould, Toint, Trust-Region Methods (2000), chapters 6 and 7.7 (boxes); Nocedal and Wright, Numerical Optimization
//! (2006), algorithm 16.3 (active sets of a convex quadratic programme).

use nalgebra::{DMatrix, DVector};

use super::derivative::{DerivativeColumn, Derivatives};
use super::filter::Innovation;
use super::known::Reference;
use super::layout::Numbers;
use super::model_point::{ModelPoint, log_likelihood};
use super::parameter::{Parameter, write};
use super::{Assumption, Chamber, ChamberError};
use crate::parallel::InParallel;

/// Steps that derivatives of one point serve for.
const SERVED: usize = 4;
/// The region's share of the strides at most, and steps in a row that may fail with derivatives of the very point.
const WIDEST: f64 = 4.0;
const FAILURES: usize = 5;
/// A step that gains less than this share of what was foretold narrows the region; one that gains more than the other widens it
/// where it ended at a side.
const POOR: f64 = 0.25;
const GOOD: f64 = 0.7;

/// How much work a fit may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Effort {
    /// Times that derivatives are taken.
    pub(crate) iterations: usize,
    /// A step that gains less ends the fit.
    pub(crate) tolerance: f64,
    /// Times that the course is smoothed again where the model is not linear.
    pub(crate) rounds: usize,
}

impl Effort {
    /// To a tenth of a unit of log likelihood.
    pub(crate) const FULL: Self = Self { iterations: 25, tolerance: 0.1, rounds: 2 };
    /// To half a unit: enough to rank sets.
    pub(crate) const QUICK: Self = Self { iterations: 10, tolerance: 0.7, rounds: 1 };
    /// No step: where a fit begins, as a fit.
    pub(crate) const NONE: Self = Self { iterations: 0, tolerance: 0.0, rounds: 1 };
    /// Enough to rank starts.
    pub(crate) const SHORT: Self = Self { iterations: 1, tolerance: 3.0, rounds: 1 };
    /// Whether what is fitted so far is only compared.
    pub(super) fn is_for_ranking(self) -> bool {
        self.tolerance > Self::QUICK.tolerance
    }
}

/// Derivatives of innovations at a point, for ascents that begin there or nearby.
#[derive(Debug, Clone)]
pub(super) struct KnownDerivatives {
    parameters: Vec<Parameter>,
    /// What each parameter is of: effects and inputs have other places in other assumptions.
    owners: Vec<Option<String>>,
    records: Vec<usize>,
    /// Of each record, in the order of `records`.
    derivatives: Vec<Derivatives>,
    variances: Vec<Vec<f64>>,
}

impl KnownDerivatives {
    fn new(parameters: &[Parameter], records: &[usize], derivatives: Vec<Derivatives>, at: &Ascent) -> Self {
        let variances = at.innovations.iter().map(|own| own.iter().map(|i| i.variance).collect()).collect();
        let owners = parameters.iter().map(|p| p.place.owner(&at.point.assumed)).collect();
        Self { parameters: parameters.to_vec(), owners, records: records.to_vec(), derivatives, variances }
    }

    /// The innovations' derivative by a parameter in one record, taken along to where innovations are `base`; None where it was not
    /// taken, or where other measurements were.
    fn column(
        &self,
        parameter: &Parameter,
        owner: Option<&str>,
        record: usize,
        base: &[Innovation],
    ) -> Option<DerivativeColumn> {
        let is_same = |p: &Parameter| p.place.is_same_of_owner(parameter.place) && p.scale == parameter.scale;
        let own = self.parameters.iter().zip(&self.owners).position(|(p, o)| is_same(p) && o.as_deref() == owner)?;
        let place = self.records.iter().position(|r| *r == record)?;
        let (derivatives, variances) = (&self.derivatives[place], &self.variances[place]);
        let column = derivatives.parameters.iter().position(|p| *p == own)?;
        (variances.len() == base.len()).then(|| {
            let mut column = derivatives.columns[column].clone();
            carry_variance(&mut column, variances.iter().zip(base).map(|(before, b)| b.variance / before));
            column
        })
    }
}

/// A point on the way.
pub(super) struct Ascent<'c> {
    pub(super) point: ModelPoint<'c>,
    pub(super) coordinates: Vec<f64>,
    innovations: Vec<Vec<Innovation>>,
    pub(super) log_likelihood: f64,
    posterior: f64,
    /// Of data and prior.
    pub(super) information: DMatrix<f64>,
    pub(super) known_derivatives: Option<KnownDerivatives>,
}

/// Where an ascent ended, without what it was computed from.
pub(super) struct AscentEnd {
    pub(super) assumed: Assumption,
    pub(super) numbers: Vec<Numbers>,
    pub(super) coordinates: Vec<f64>,
    pub(super) log_likelihood: f64,
    pub(super) information: DMatrix<f64>,
    pub(super) known_derivatives: Option<KnownDerivatives>,
}

impl From<Ascent<'_>> for AscentEnd {
    fn from(ascent: Ascent) -> Self {
        let Ascent { point, coordinates, log_likelihood, information, known_derivatives, .. } = ascent;
        let ModelPoint { assumed, numbers, .. } = point;
        Self { assumed, numbers, coordinates, log_likelihood, information, known_derivatives }
    }
}

/// Where an ascent begins, and along what it goes.
pub(super) struct Beginning<'a, 'c> {
    pub(super) assumed: &'a Assumption,
    pub(super) numbers: &'a [Numbers],
    pub(super) parameters: &'a [Parameter],
    pub(super) records: &'a [usize],
    pub(super) courses: &'c [Option<Reference>],
}

impl Chamber<'_> {
    /// The highest point that an effort reaches from where assumption and numbers are; `known` may be of a point nearby.
    ///
    /// # Errors
    /// A model that cannot be solved where the ascent begins, or beside a point on it.
    pub(super) fn ascended<'c>(
        &self,
        begin: &Beginning<'_, 'c>,
        effort: Effort,
        known: Option<&KnownDerivatives>,
    ) -> Result<Ascent<'c>, ChamberError> {
        let &Beginning { assumed, numbers, parameters, records, courses } = begin;
        let first = records.first().copied().unwrap_or(0);
        let coordinates: Vec<f64> = parameters
            .iter()
            .map(|p| {
                let read = p.read(assumed, numbers, first);
                if read.is_finite() { read.clamp(p.lower, p.upper) } else { p.mean }
            })
            .collect();
        let mut state = self.state(assumed, numbers, parameters, coordinates, records, courses)?;
        let (mut derivatives, mut is_fresh) = self.derivatives_beside(&state, parameters, records, known)?;
        let (mut taken, mut served, mut failures, mut share) = (usize::from(is_fresh), 0, 0, 1.0);
        let mut information = information_of(&derivatives, &state, parameters);
        loop {
            if effort.iterations == 0 {
                break;
            }
            let score = score_of(&derivatives, &state, parameters);
            let step = Step::new(parameters, &state.coordinates, &score, &information, share);
            let next = state.coordinates.iter().zip(step.change.iter()).map(|(x, d)| x + d).collect();
            let there = self.state(&state.point.assumed, &state.point.numbers, parameters, next, records, courses);
            let gain = there.as_ref().map_or(f64::NEG_INFINITY, |there| there.posterior - state.posterior);
            share = step.next_share(share, gain);
            let (was_fresh, is_up, is_little) = (is_fresh, gain > 0.0, gain < effort.tolerance);
            if let (Ok(there), true) = (there, is_up) {
                carry(&mut derivatives, &state.innovations, &there.innovations);
                (state, is_fresh, served) = (there, false, served + 1);
            }
            failures = if gain < POOR * step.promised { failures + 1 } else { 0 };
            // With derivatives of the very point, what they foretell says whether this is the top.
            if was_fresh && is_little && (step.promised < effort.tolerance || failures == FAILURES) {
                break;
            }
            if (!was_fresh && (is_little || gain < POOR * step.promised)) || served == SERVED {
                if taken >= effort.iterations {
                    break;
                }
                derivatives =
                    self.derivatives(&state.point, parameters, &state.coordinates, records, &state.innovations)?;
                information = information_of(&derivatives, &state, parameters);
                (taken, served, failures, is_fresh) = (taken + 1, 0, 0, true);
            }
        }
        let information = information_of(&derivatives, &state, parameters);
        let known_derivatives = Some(KnownDerivatives::new(parameters, records, derivatives, &state));
        Ok(Ascent { information, known_derivatives, ..state })
    }

    /// Derivatives at a point: those that are known of one nearby, and the rest taken here; whether all are of the very point.
    fn derivatives_beside(
        &self,
        state: &Ascent,
        parameters: &[Parameter],
        records: &[usize],
        known: Option<&KnownDerivatives>,
    ) -> Result<(Vec<Derivatives>, bool), ChamberError> {
        let owners: Vec<Option<String>> = parameters.iter().map(|p| p.place.owner(&state.point.assumed)).collect();
        let column =
            |p: usize, i: usize| known?.column(&parameters[p], owners[p].as_deref(), records[i], &state.innovations[i]);
        let of_records = |p: usize| -> Option<Vec<(usize, DerivativeColumn)>> {
            let own = (0..records.len()).filter(|&i| parameters[p].concerns(records[i]));
            own.map(|i| Some((i, column(p, i)?))).collect()
        };
        let carried: Vec<Option<Vec<(usize, DerivativeColumn)>>> = (0..parameters.len()).map(of_records).collect();
        let (unknown, rest): (Vec<usize>, Vec<Parameter>) =
            (0..parameters.len()).filter(|&p| carried[p].is_none()).map(|p| (p, parameters[p])).unzip();
        let coordinates: Vec<f64> = unknown.iter().map(|&p| state.coordinates[p]).collect();
        let mut all = self.derivatives(&state.point, &rest, &coordinates, records, &state.innovations)?;
        all.iter_mut().for_each(|own| own.parameters.iter_mut().for_each(|p| *p = unknown[*p]));
        let is_fresh = unknown.len() == parameters.len();
        for (p, columns) in carried.into_iter().enumerate() {
            for (i, column) in columns.into_iter().flatten() {
                all[i].parameters.push(p);
                all[i].columns.push(column);
            }
        }
        Ok((all, is_fresh))
    }

    fn state<'c>(
        &self,
        assumed: &Assumption,
        numbers: &[Numbers],
        parameters: &[Parameter],
        coordinates: Vec<f64>,
        records: &[usize],
        courses: &'c [Option<Reference>],
    ) -> Result<Ascent<'c>, ChamberError> {
        let (mut assumed, mut numbers) = (assumed.clone(), numbers.to_vec());
        if !write(parameters, &coordinates, &mut assumed, &mut numbers) {
            return Err(ChamberError::Unsolvable);
        }
        let point = self.model_point(assumed, numbers, records, courses)?;
        let innovations: Result<Vec<_>, _> =
            records.iter().in_parallel().map(|&r| self.innovations(&point, r)).collect();
        let innovations = innovations?;
        let log_likelihood: f64 = innovations.iter().map(|i| log_likelihood(i)).sum();
        let log_prior: f64 = parameters.iter().zip(&coordinates).map(|(p, &c)| p.log_prior(c)).sum();
        if !log_likelihood.is_finite() {
            return Err(ChamberError::Unsolvable);
        }
        let posterior = log_likelihood + log_prior;
        let information = DMatrix::zeros(0, 0);
        Ok(Ascent { point, coordinates, innovations, log_likelihood, posterior, information, known_derivatives: None })
    }
}

/// Gradient of the posterior.
fn score_of(derivatives: &[Derivatives], state: &Ascent, parameters: &[Parameter]) -> DVector<f64> {
    let mut score = DVector::zeros(parameters.len());
    derivatives.iter().zip(&state.innovations).for_each(|(own, base)| own.add_score_to(base, &mut score));
    for (i, p) in parameters.iter().enumerate() {
        score[i] += p.prior_slope(state.coordinates[i]).0;
    }
    score
}

/// Information of the posterior.
fn information_of(derivatives: &[Derivatives], state: &Ascent, parameters: &[Parameter]) -> DMatrix<f64> {
    let mut information = DMatrix::zeros(parameters.len(), parameters.len());
    derivatives.iter().zip(&state.innovations).for_each(|(own, base)| own.add_information_to(base, &mut information));
    for (i, p) in parameters.iter().enumerate() {
        information[(i, i)] += p.prior_slope(state.coordinates[i]).1;
    }
    information
}

/// Takes a variance's derivative along to another point, by what the variance is there of what it was: the relative one stays.
fn carry_variance(column: &mut DerivativeColumn, ratios: impl Iterator<Item = f64>) {
    column.variance.iter_mut().zip(ratios).for_each(|(d, ratio)| *d *= ratio);
}

/// Takes all derivatives along to another point.
fn carry(derivatives: &mut [Derivatives], from: &[Vec<Innovation>], to: &[Vec<Innovation>]) {
    for ((own, from), to) in derivatives.iter_mut().zip(from).zip(to) {
        let ratios: Vec<f64> = from.iter().zip(to).map(|(a, b)| b.variance / a.variance).collect();
        for column in &mut own.columns {
            carry_variance(column, ratios.iter().copied());
        }
    }
}

/// A step within the region.
struct Step {
    change: DVector<f64>,
    /// What the quadratic model foretells.
    promised: f64,
    /// Whether it ends at a side of the region.
    is_held: bool,
}

impl Step {
    fn new(
        parameters: &[Parameter],
        coordinates: &[f64],
        score: &DVector<f64>,
        information: &DMatrix<f64>,
        share: f64,
    ) -> Self {
        let sides: Vec<(f64, f64)> = parameters
            .iter()
            .zip(coordinates)
            .map(|(p, x)| ((p.lower - x).max(-share * p.stride()), (p.upper - x).min(share * p.stride())))
            .collect();
        let change = within(information, score, &sides);
        let promised = score.dot(&change) - 0.5 * (information * &change).dot(&change);
        let is_held = change.iter().zip(parameters).any(|(d, p)| d.abs() > 0.99 * share * p.stride());
        Self { change, promised, is_held }
    }

    /// How wide the region is after it.
    fn next_share(&self, share: f64, gain: f64) -> f64 {
        if gain < POOR * self.promised {
            0.25 * share
        } else if gain > GOOD * self.promised && self.is_held {
            WIDEST.min(2.0 * share)
        } else {
            share
        }
    }
}

/// Maximises g·x − ½ xᵀ A x in a box that holds 0, A positive definite: active sets, from 0 on.
fn within(a: &DMatrix<f64>, g: &DVector<f64>, sides: &[(f64, f64)]) -> DVector<f64> {
    let count = g.len();
    let mut x = DVector::zeros(count);
    let mut held: Vec<bool> = sides.iter().map(|(low, high)| high <= low).collect();
    for _ in 0..8 * count {
        let slope = g - a * &x;
        let free: Vec<usize> = (0..count).filter(|&i| !held[i]).collect();
        let direction = direction(a, &slope, &free);
        let room = |i: usize, d: f64| if d > 0.0 { (sides[i].1 - x[i]) / d } else { (sides[i].0 - x[i]) / d };
        let first = free
            .iter()
            .zip(&direction)
            .filter(|(_, d)| **d != 0.0)
            .map(|(&i, &d)| (room(i, d).max(0.0), i))
            .min_by(|p, q| p.0.total_cmp(&q.0).then(p.1.cmp(&q.1)));
        match first {
            Some((length, at)) if length < 1.0 => {
                free.iter().zip(&direction).for_each(|(&i, d)| x[i] += length * d);
                x[at] = if x[at] - sides[at].0 < sides[at].1 - x[at] { sides[at].0 } else { sides[at].1 };
                held[at] = true;
                continue;
            }
            _ => free.iter().zip(&direction).for_each(|(&i, d)| x[i] += d),
        }
        // At the best of this face: let go what wants back inside, most first.
        let slope = g - a * &x;
        let inwards = |i: usize| if x[i] - sides[i].0 < sides[i].1 - x[i] { slope[i] } else { -slope[i] };
        let pressed = (0..count).filter(|&i| held[i] && sides[i].1 > sides[i].0 && inwards(i) > 1e-9 * g[i].abs());
        match pressed.max_by(|&i, &j| inwards(i).total_cmp(&inwards(j)).then(j.cmp(&i))) {
            Some(i) => held[i] = false,
            None => break,
        }
    }
    x
}

/// To the maximum over the free coordinates.
fn direction(a: &DMatrix<f64>, slope: &DVector<f64>, free: &[usize]) -> Vec<f64> {
    let size = free.len();
    let mut own = DMatrix::from_fn(size, size, |i, j| a[(free[i], free[j])]);
    let right = DVector::from_fn(size, |i, _| slope[free[i]]);
    // Rounding alone can leave a direction that nothing determines: a little more of its own information does.
    let mut ridge = 1e-12;
    while ridge < 1.0 {
        (0..size).for_each(|i| own[(i, i)] *= 1.0 + ridge);
        if let Some(factor) = own.clone().cholesky() {
            return factor.solve(&right).iter().copied().collect();
        }
        ridge *= 100.0;
    }
    vec![0.0; size]
}

#[cfg(test)]
mod tests {
    use super::super::Free;
    use super::super::dense::tests::{effect, model};
    use super::super::kinks::tests::kinked;
    use super::super::prior::Quantity;
    use super::*;
    use crate::pattern::classic::Classic;

    #[test]
    fn an_ascent_ends_at_the_same_top_from_afar_and_with_derivatives_of_another_point() {
        let (bare, pattern) = (model(Vec::new()), Classic::Zyl.pattern(8).unwrap());
        let record = kinked(&bare, &pattern);
        let chamber = Chamber::new(&bare, &[&record]).unwrap();
        let top = chamber.fit_anew(&Assumption::new(bare, pattern.clone()), &[], &[0]).unwrap();
        let with_effect = Assumption::new(model(vec![effect("strain_mismatch", &[0.001])]), pattern);
        let free = [Free { effect: 0, parameter: 0, stated: None, deviation: None }];
        let reached = |change: &dyn Fn(&mut crate::chamber::Fit)| {
            let mut start = top.clone();
            change(&mut start);
            chamber.fit(&with_effect, &free, &[0], Some(&start), Effort::FULL).unwrap()
        };
        let known = reached(&|_| ());
        for far in [
            reached(&|start| start.known_derivatives = None),
            // A film and a white noise ten times too large: one coordinate that has far to go shortens no other's way.
            reached(&|start| {
                let noise = start.numbers[0].get(Quantity::RateNoise);
                start.numbers[0].set(Quantity::RateNoise, 10.0 * noise);
                start.numbers[0].set(Quantity::Film, 250.0);
            }),
        ] {
            let apart = known.posterior() - far.posterior();
            println!("{apart}");
            // Less than what a fit that ranks sets stops at.
            assert!(apart.abs() < 0.5, "{apart}");
        }
    }

    fn best(a: &DMatrix<f64>, g: &DVector<f64>, sides: &[(f64, f64)]) -> f64 {
        // Every corner of faces: each coordinate at its lower side, its upper one or free.
        let count = g.len();
        let mut best = f64::NEG_INFINITY;
        for code in 0..3_usize.pow(count as u32) {
            let mut x = DVector::zeros(count);
            let kinds: Vec<usize> = (0..count).map(|i| code / 3_usize.pow(i as u32) % 3).collect();
            kinds.iter().enumerate().for_each(|(i, kind)| x[i] = [sides[i].0, sides[i].1, 0.0][*kind]);
            let free: Vec<usize> = (0..count).filter(|&i| kinds[i] == 2).collect();
            let slope = g - a * &x;
            free.iter().zip(direction(a, &slope, &free)).for_each(|(&i, d)| x[i] = d);
            if (0..count).all(|i| x[i] >= sides[i].0 - 1e-9 && x[i] <= sides[i].1 + 1e-9) {
                best = best.max(g.dot(&x) - 0.5 * (a * &x).dot(&x));
            }
        }
        best
    }

    #[test]
    fn a_step_is_the_best_of_all_faces_of_its_box() {
        let mut seed = 1_u64;
        let mut draw = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        for _ in 0..200 {
            let count = 5;
            let root = DMatrix::from_fn(count, count, |_, _| draw());
            let a = &root * root.transpose() + DMatrix::identity(count, count) * 1e-3;
            let g = DVector::from_fn(count, |_, _| draw());
            let sides: Vec<(f64, f64)> = (0..count).map(|i| (-(i as f64) * draw().abs(), draw().abs())).collect();
            let x = within(&a, &g, &sides);
            assert!(x.iter().zip(&sides).all(|(x, (low, high))| *x >= low - 1e-12 && *x <= high + 1e-12));
            let value = g.dot(&x) - 0.5 * (&a * &x).dot(&x);
            let most = best(&a, &g, &sides);
            assert!((value - most).abs() < 1e-9 * (1.0 + most.abs()), "{value} {most}");
        }
    }
}
