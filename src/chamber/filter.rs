//! The passes over a record: forward with frozen gains where nothing changes, backward, and the response to known inputs.
//!
//! ```text
//! predict  x ← Φ x,  P ← Φ P Φᵀ + Q_0 + q Q_1                 q: the trend's noise at this row
//!          where the air has a kink, P ← P + κ² u uᵀ           κ: how large it seems; u = Φ(t) e_s, t after it; s: the trend's slope
//! keep     z ← c·x                                             where a rate's window begins
//! take in  v = y − h·x,  S = h P hᵀ + R,  x ← x + P h v/S,  P ← P − P h hᵀ P/S
//! smooth   r ← h v/S + (I − K h)ᵀ r,  r ← Φᵀ r,  x̂ = x + P r
//! ```
//!
//! Once S has settled while rows are alike, gains stay as they are until a row differs (a gap, a missing value, another
//! noise of the trend): the covariance has then converged to the accuracy of [`SETTLED`].
//!
//! # Source
//! Kalman, J. Basic Eng. 82 (1960) 35; de Jong, J. Am. Stat. Assoc. 84 (1989) 1085 (smoothing without inverses).

// Loops over an index that the compiler knows the end of: iterators stay calls in functions as large as these.
#![allow(clippy::needless_range_loop)]

use std::sync::Arc;

use super::arithmetic::{Arithmetic, Pass, dispatched};
use super::discretise::ContinuousDynamics;
pub(super) use super::row::{AMBIENT, MEASURED, Move, RATE, Row};
use super::sparse::{MOST_STATES, Sparse, Square, dispatch, turn, wide, wide_square};

/// Relative change of every S from row to row below which a row counts as settled, and how many of them freeze the gains:
/// together they cost less than 0.2 of log likelihood on 1 500 rows (a test).
pub(super) const SETTLED: f64 = 5e-7;
pub(super) const SETTLED_ROWS: usize = 4;

/// One step of time.
#[derive(Debug, Clone)]
pub(super) struct Step {
    pub(crate) phi: Sparse,
    pub(crate) phi_turned: Sparse,
    /// Row-major n × n: everything but the trend's noise, and the trend's per unit of its density.
    pub(crate) noise: Vec<f64>,
    pub(crate) trend_noise: Vec<f64>,
}

/// A linear Gaussian system with numbers in it.
#[derive(Debug, Clone)]
pub(super) struct System {
    pub(crate) size: usize,
    pub(crate) steps: Arc<[Step]>,
    /// Slope noise of the air's trend at rest and where readings bend [K²/s³].
    pub(crate) trend: (f64, f64),
    /// The state that is the trend's slope.
    pub(crate) slope: usize,
    /// What a slope that changes by one within a step makes of the states by the step's end.
    pub(crate) kinks: Vec<Vec<f64>>,
    /// Behind each film.
    pub(crate) dynamics: Arc<[ContinuousDynamics]>,
    /// Rows of the thermometers and of the rate, each for the shares of a window: see [`Row::window`].
    pub(crate) rows: Sparse,
    pub(crate) variances: [f64; MEASURED],
    /// What a coarse grid adds to the variance of a reading whose neighbours are other values.
    pub(crate) grids: [f64; MEASURED],
    /// What is kept where a window begins, by the window's slot: states and the rows (of `kept`) that they take.
    pub(crate) keeps: Vec<Vec<(usize, usize)>>,
    pub(crate) kept: Sparse,
    pub(crate) mean: Vec<f64>,
    pub(crate) covariance: Vec<f64>,
}

impl System {
    /// Variance of one measurement's own error at a row.
    #[inline(always)]
    pub(super) fn noise(&self, m: usize, row: &Row) -> f64 {
        (self.variances[m] + self.grids[m] * row.rounding[m]) / row.averaged
    }
}

/// The values of a record's rows, known inputs already taken off.
///
/// # Shapes
/// One entry a row.
#[derive(Debug, Clone)]
pub(super) struct Values {
    pub(crate) of: [Vec<f64>; MEASURED],
}

/// An innovation with its variance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Innovation {
    pub(crate) value: f64,
    pub(crate) variance: f64,
}

/// Gains and covariance of a row; rows with frozen gains share one.
#[derive(Debug, Clone)]
pub(super) struct Gains {
    /// Row-major, states: P before the measurements.
    pub(crate) covariance: Vec<f64>,
    /// A gain a measurement, one after another, and 1/S.
    pub(crate) gain: Vec<f64>,
}

/// What a forward pass leaves.
#[derive(Debug, Clone, Default)]
pub(super) struct Trace {
    /// In the order of rows, of each its measurements.
    pub(crate) innovations: Vec<Innovation>,
    pub(crate) gains: Vec<Gains>,
    /// Of each row its gains; only where they were to be kept.
    pub(crate) gains_of: Vec<u32>,
    /// Row-major rows × states: before the measurements.
    pub(crate) means: Vec<f64>,
    pub(crate) log_likelihood: f64,
    /// Rows for which the covariance was computed.
    pub(crate) thawed: usize,
}

/// The forward pass; gains and means are kept for the other passes if `keep`.
pub(super) fn forward(system: &System, rows: &[Row], values: &Values, keep: bool) -> Trace {
    dispatched(Forward { system, rows, values, keep })
}

/// The smoothed states, row-major rows × states, from a trace that kept its gains.
pub(super) fn smooth(system: &System, rows: &[Row], trace: &Trace) -> Vec<f64> {
    dispatched(Smooth { system, rows, trace })
}

/// What known inputs to the measurements make of the innovations, by the gains of a trace that kept them: their
/// innovations if they were measured themselves and all states began at zero.
pub(super) fn respond(system: &System, rows: &[Row], trace: &Trace, inputs: &Values) -> Vec<f64> {
    dispatched(Respond { system, rows, trace, inputs })
}

struct Smooth<'a> {
    system: &'a System,
    rows: &'a [Row],
    trace: &'a Trace,
}

impl Pass for Smooth<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run(self, arithmetic: impl Arithmetic) -> Vec<f64> {
        dispatch!(self.system.size, smooth_of(arithmetic, self.system, self.rows, self.trace))
    }
}

struct Forward<'a> {
    system: &'a System,
    rows: &'a [Row],
    values: &'a Values,
    keep: bool,
}

impl Pass for Forward<'_> {
    type Output = Trace;

    #[inline(always)]
    fn run(self, arithmetic: impl Arithmetic) -> Trace {
        dispatch!(self.system.size, forward_of(arithmetic, self.system, self.rows, self.values, self.keep))
    }
}

struct Respond<'a> {
    system: &'a System,
    rows: &'a [Row],
    trace: &'a Trace,
    inputs: &'a Values,
}

impl Pass for Respond<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run(self, arithmetic: impl Arithmetic) -> Vec<f64> {
        dispatch!(self.system.size, respond_of(arithmetic, self.system, self.rows, self.trace, self.inputs))
    }
}

/// P ← Φ P Φᵀ + Q.
#[inline(always)]
fn predict<const N: usize>(
    arithmetic: impl Arithmetic,
    phi: &Sparse,
    noise: &Square<N>,
    covariance: &mut Square<N>,
    [room, turned]: &mut [Square<N>; 2],
) {
    for i in 0..phi.rows() {
        room[i] = phi.combine(arithmetic, i, covariance);
    }
    turn(room, turned);
    for i in 0..phi.rows() {
        covariance[i] = phi.combine_onto(arithmetic, i, turned, &noise[i]);
    }
}

/// The noise of one step and how much the trend has.
struct StepNoise<const N: usize> {
    of: Option<(u16, f64)>,
    noise: Square<N>,
}

impl<const N: usize> StepNoise<N> {
    #[inline(always)]
    fn at(&mut self, system: &System, step: u16, density: f64) -> &Square<N> {
        if self.of != Some((step, density)) {
            self.of = Some((step, density));
            let (own, n) = (&system.steps[step as usize], system.size);
            let lines = own.noise.chunks_exact(n).zip(own.trend_noise.chunks_exact(n));
            for (line, (noise, trend_noise)) in self.noise.iter_mut().zip(lines) {
                for j in 0..n {
                    line[j] = noise[j] + density * trend_noise[j];
                }
            }
        }
        &self.noise
    }
}

/// P ← P + κ² u uᵀ.
#[inline(always)]
fn add_kink<const N: usize>(arithmetic: impl Arithmetic, change: &[f64], variance: f64, covariance: &mut Square<N>) {
    let change: [f64; N] = wide(change);
    for i in 0..N {
        for j in 0..N {
            covariance[i][j] = arithmetic.add_product(variance * change[i], change[j], covariance[i][j]);
        }
    }
}

#[inline(always)]
fn keep_window<const N: usize>(arithmetic: impl Arithmetic, system: &System, slot: u8, covariance: &mut Square<N>) {
    let keeps = &system.keeps[slot as usize];
    for (place, &(state, row)) in keeps.iter().enumerate() {
        // Cov(c·x, x), the state's own former content being forgotten.
        let mut along = system.kept.combine(arithmetic, row, covariance);
        along[state] = 0.0;
        for &(other, _) in &keeps[place + 1..] {
            along[other] = 0.0;
        }
        let own = system.kept.dot(arithmetic, row, &along);
        for i in 0..N {
            covariance[i][state] = along[i];
            covariance[state][i] = along[i];
        }
        covariance[state][state] = own;
    }
}

#[inline(always)]
fn advance<const N: usize>(arithmetic: impl Arithmetic, system: &System, row: &Row, mean: &mut [f64; N]) {
    for &movement in &row.moves {
        match movement {
            Move::Step(step) => *mean = system.steps[step as usize].phi.times(arithmetic, mean),
            Move::Keep(slot) => {
                for &(state, kept) in &system.keeps[slot as usize] {
                    mean[state] = system.kept.dot(arithmetic, kept, mean);
                }
            }
            Move::Kink(_) => {}
        }
    }
}

/// r ← Mᵀ r over what happened between the row before and this one.
#[inline(always)]
pub(super) fn retreat<const N: usize>(arithmetic: impl Arithmetic, system: &System, movement: Move, r: &mut [f64; N]) {
    match movement {
        Move::Step(step) => *r = system.steps[step as usize].phi_turned.times(arithmetic, r),
        Move::Keep(slot) => {
            for &(state, kept) in system.keeps[slot as usize].iter().rev() {
                let weight = std::mem::take(&mut r[state]);
                system.kept.add_to(kept, weight, r);
            }
        }
        Move::Kink(_) => {}
    }
}

#[inline(always)]
#[expect(
    clippy::too_many_lines,
    reason = "the inner loop of every fit: one pass over a row, unrolled for each size, without a call between"
)]
fn forward_of<const N: usize>(
    arithmetic: impl Arithmetic,
    system: &System,
    rows: &[Row],
    values: &Values,
    keep: bool,
) -> Trace {
    let n = system.size;
    let mut added = StepNoise { of: None, noise: [[0.0; N]; N] };
    let mut mean: [f64; N] = wide(&system.mean);
    let mut covariance: Square<N> = wide_square(&system.covariance, n);
    let mut room: [Square<N>; 2] = [[[0.0; N]; N]; 2];
    let mut gains = [[0.0; N]; MEASURED];
    let mut variances = [0.0; MEASURED];
    let mut trace = Trace { innovations: Vec::with_capacity(2 * rows.len()), ..Trace::default() };
    let (mut settled, mut log_determinant, mut frozen_logs) = (0, 0.0, 0.0);
    let mut sum = 0.0;
    for (k, row) in rows.iter().enumerate() {
        let alike = k > 0 && *row == rows[k - 1];
        if !alike {
            settled = 0;
        }
        advance(arithmetic, system, row, &mut mean);
        if keep {
            trace.means.extend_from_slice(&mean[..n]);
        }
        let frozen = settled >= SETTLED_ROWS;
        if !frozen {
            trace.thawed += 1;
            let density = system.trend.0 + row.bend * (system.trend.1 - system.trend.0);
            if !row.is_kinked_within() {
                covariance[system.slope][system.slope] += row.kink;
            }
            for &movement in &row.moves {
                match movement {
                    Move::Step(step) => {
                        let phi = &system.steps[step as usize].phi;
                        predict(arithmetic, phi, added.at(system, step, density), &mut covariance, &mut room);
                    }
                    Move::Keep(slot) => keep_window(arithmetic, system, slot, &mut covariance),
                    Move::Kink(place) => add_kink(arithmetic, &system.kinks[place as usize], row.kink, &mut covariance),
                }
            }
            if keep {
                let mut flat = Vec::with_capacity(n * n);
                covariance[..n].iter().for_each(|line| flat.extend_from_slice(&line[..n]));
                trace.gains.push(Gains { covariance: flat, gain: Vec::new() });
            }
            frozen_logs = 0.0;
        }
        let mut change: f64 = 0.0;
        for (m, index) in row.measured.iter().enumerate() {
            let Some(h) = *index else { continue };
            let h = h as usize;
            let value = values.of[m][k] - system.rows.dot(arithmetic, h, &mean);
            if !frozen {
                let along = system.rows.combine(arithmetic, h, &covariance);
                let variance = system.rows.dot(arithmetic, h, &along) + system.noise(m, row);
                change = change.max((variance / variances[m] - 1.0).abs());
                variances[m] = variance;
                frozen_logs += variance.ln();
                let gain = &mut gains[m];
                for i in 0..N {
                    gain[i] = along[i] / variance;
                    for j in 0..N {
                        covariance[i][j] = arithmetic.add_product(-gain[i], along[j], covariance[i][j]);
                    }
                }
                if keep && let Some(last) = trace.gains.last_mut() {
                    last.gain.extend_from_slice(&gain[..n]);
                    last.gain.push(1.0 / variance);
                }
            }
            for i in 0..N {
                mean[i] = arithmetic.add_product(gains[m][i], value, mean[i]);
            }
            sum += value * value / variances[m];
            trace.innovations.push(Innovation { value, variance: variances[m] });
        }
        log_determinant += frozen_logs;
        if keep {
            trace.gains_of.push(trace.gains.len() as u32 - 1);
        }
        if !frozen {
            settled = if alike && change < SETTLED { settled + 1 } else { 0 };
        }
    }
    trace.log_likelihood = -0.5 * (sum + log_determinant + trace.innovations.len() as f64 * std::f64::consts::TAU.ln());
    trace
}

#[inline(always)]
fn respond_of<const N: usize>(
    arithmetic: impl Arithmetic,
    system: &System,
    rows: &[Row],
    trace: &Trace,
    inputs: &Values,
) -> Vec<f64> {
    let n = system.size;
    let mut mean = [0.0; N];
    let mut out = Vec::with_capacity(trace.innovations.len());
    for (k, row) in rows.iter().enumerate() {
        advance(arithmetic, system, row, &mut mean);
        let gains = &trace.gains[trace.gains_of[k] as usize].gain;
        let mut taken = gains.chunks_exact(n + 1);
        for (m, index) in row.measured.iter().enumerate() {
            let (Some(h), Some(gain)) = (*index, index.and_then(|_| taken.next())) else { continue };
            let input = inputs.of[m].get(k).copied().unwrap_or(0.0);
            let value = input - system.rows.dot(arithmetic, h as usize, &mean);
            out.push(value);
            for i in 0..n {
                mean[i] += gain[i] * value;
            }
        }
    }
    out
}

#[inline(always)]
fn smooth_of<const N: usize>(arithmetic: impl Arithmetic, system: &System, rows: &[Row], trace: &Trace) -> Vec<f64> {
    let n = system.size;
    let mut states = vec![0.0; rows.len() * n];
    let mut r = [0.0; N];
    let mut taken = trace.innovations.len();
    for (k, row) in rows.iter().enumerate().rev() {
        let gains = &trace.gains[trace.gains_of[k] as usize];
        let present: Vec<usize> = row.measured.iter().flatten().map(|&h| h as usize).collect();
        for (place, &h) in present.iter().enumerate().rev() {
            taken -= 1;
            let Innovation { value, variance } = trace.innovations[taken];
            let gain = &gains.gain[place * (n + 1)..place * (n + 1) + n];
            let along: f64 = gain.iter().zip(&r).map(|(g, r)| g * r).sum();
            system.rows.add_to(h, value / variance - along, &mut r);
        }
        for i in 0..n {
            let line = &gains.covariance[i * n..(i + 1) * n];
            let correction: f64 = line.iter().zip(&r).map(|(p, r)| p * r).sum();
            states[k * n + i] = trace.means[k * n + i] + correction;
        }
        row.moves.iter().rev().for_each(|&movement| retreat(arithmetic, system, movement, &mut r));
    }
    states
}
