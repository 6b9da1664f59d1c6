//! The passes over a record: forward with frozen gains where nothing changes, backward, and the response to known inputs.
//!
//! ```text
//! predict  x ← Φ x,  P ← Φ P Φᵀ + Q_0 + q Q_1                 q: the trend's noise at this row
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

use pulp::{Arch, NullaryFnOnce};

use super::sparse::{Sparse, Square};

/// Thermometers that a record may have: the sensor, one at the bore, one in the air.
pub(super) const THERMOMETERS: usize = 3;
/// Measurements of a row: the thermometers and the rate.
pub(super) const MEASURED: usize = THERMOMETERS + 1;
/// The rate among a row's measurements.
pub(super) const RATE: usize = THERMOMETERS;

/// Relative change of every S from row to row below which a row counts as settled, and how many of them freeze the gains:
/// together they cost less than 0.2 of log likelihood on 1 500 rows (a test).
const SETTLED: f64 = 5e-7;
const SETTLED_ROWS: usize = 4;

/// One step of time.
#[derive(Debug, Clone)]
pub(super) struct Step {
    pub phi: Sparse,
    pub phi_turned: Sparse,
    /// Row-major n × n: everything but the trend's noise, and the trend's per unit of its density.
    pub noise: Vec<f64>,
    pub trend_noise: Vec<f64>,
}

/// A linear Gaussian system with numbers in it.
#[derive(Debug, Clone)]
pub(super) struct System {
    pub size: usize,
    pub steps: Vec<Step>,
    /// Slope noise of the air's trend at rest and where readings bend [K²/s³].
    pub trend: (f64, f64),
    /// Rows of the thermometers and of the rate, each for the shares of a window: see [`Row::window`].
    pub rows: Sparse,
    pub variances: [f64; MEASURED],
    /// What is kept where a window begins: states and the rows (of `kept`) that they take.
    pub keep: Vec<usize>,
    pub kept: Sparse,
    pub mean: Vec<f64>,
    pub covariance: Vec<f64>,
}

/// What happens up to and at one row of a record.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Row {
    /// Steps to where the row's window begins, and from there to the row; indices into [`System::steps`].
    pub before: Vec<u16>,
    pub after: Vec<u16>,
    /// Whether a window begins in between.
    pub keeps: bool,
    /// Of how much the readings bend here: 0 at rest to 1.
    pub bend: f64,
    /// Rows of [`System::rows`] to measure with; None where there is no value.
    pub measured: [Option<u16>; MEASURED],
    /// Values that were averaged into this one: variances are divided by it.
    pub averaged: f64,
}

/// The values of a record's rows, known inputs already taken off.
///
/// # Shapes
/// One entry a row.
#[derive(Debug, Clone)]
pub(super) struct Values {
    pub of: [Vec<f64>; MEASURED],
}

/// An innovation with its variance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Innovation {
    pub value: f64,
    pub variance: f64,
}

/// Gains and covariance of a row; rows with frozen gains share one.
#[derive(Debug, Clone)]
struct Gains {
    /// Row-major, states: P before the measurements.
    covariance: Vec<f64>,
    /// A gain a measurement, one after another, and 1/S.
    gain: Vec<f64>,
}

/// What a forward pass leaves.
#[derive(Debug, Clone, Default)]
pub(super) struct Trace {
    /// In the order of rows, of each its measurements.
    pub innovations: Vec<Innovation>,
    gains: Vec<Gains>,
    /// Of each row its gains; only where they were to be kept.
    gains_of: Vec<u32>,
    /// Row-major rows × states: before the measurements.
    means: Vec<f64>,
    pub log_likelihood: f64,
    /// Rows for which the covariance was computed.
    pub thawed: usize,
}

/// Calls a function with the least number of states that has room.
macro_rules! dispatch {
    ($size:expr, $function:ident($($argument:expr),*)) => {
        match $size {
            0..=8 => $function::<8>($($argument),*),
            9..=12 => $function::<12>($($argument),*),
            13..=16 => $function::<16>($($argument),*),
            17..=20 => $function::<20>($($argument),*),
            21..=24 => $function::<24>($($argument),*),
            size => {
                assert!(size <= MOST_STATES, "a model has at most {MOST_STATES} states");
                $function::<MOST_STATES>($($argument),*)
            }
        }
    };
}

/// States for which there is room.
pub(super) const MOST_STATES: usize = 32;

/// The forward pass; gains and means are kept for the other passes if `keep`.
pub(super) fn forward(system: &System, rows: &[Row], values: &Values, keep: bool) -> Trace {
    Arch::new().dispatch(Forward { system, rows, values, keep })
}

/// The smoothed states, row-major rows × states, from a trace that kept its gains.
pub(super) fn smooth(system: &System, rows: &[Row], trace: &Trace) -> Vec<f64> {
    dispatch!(system.size, smooth_of(system, rows, trace))
}

/// What known inputs to the measurements make of the innovations, by the gains of a trace that kept them: their
/// innovations if they were measured themselves and all states began at zero.
pub(super) fn respond(system: &System, rows: &[Row], trace: &Trace, inputs: &Values) -> Vec<f64> {
    Arch::new().dispatch(Respond { system, rows, trace, inputs })
}

struct Forward<'a> {
    system: &'a System,
    rows: &'a [Row],
    values: &'a Values,
    keep: bool,
}

impl NullaryFnOnce for Forward<'_> {
    type Output = Trace;

    #[inline(always)]
    fn call(self) -> Trace {
        dispatch!(self.system.size, forward_of(self.system, self.rows, self.values, self.keep))
    }
}

struct Respond<'a> {
    system: &'a System,
    rows: &'a [Row],
    trace: &'a Trace,
    inputs: &'a Values,
}

impl NullaryFnOnce for Respond<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn call(self) -> Vec<f64> {
        dispatch!(self.system.size, respond_of(self.system, self.rows, self.trace, self.inputs))
    }
}

fn wide<const N: usize>(vector: &[f64]) -> [f64; N] {
    std::array::from_fn(|i| vector.get(i).copied().unwrap_or(0.0))
}

fn wide_square<const N: usize>(matrix: &[f64], n: usize) -> Square<N> {
    std::array::from_fn(|i| if i < n { wide(&matrix[i * n..(i + 1) * n]) } else { [0.0; N] })
}

#[inline(always)]
fn predict<const N: usize>(step: &Noise<N>, density: f64, covariance: &mut Square<N>) {
    *covariance = step.phi.surround(covariance);
    for i in 0..N {
        for j in 0..N {
            covariance[i][j] += step.noise[i][j] + density * step.trend_noise[i][j];
        }
    }
}

/// A step with its noises as wide as the compiler knows.
struct Noise<'a, const N: usize> {
    phi: &'a Sparse,
    noise: Square<N>,
    trend_noise: Square<N>,
}

#[inline(always)]
fn keep_window<const N: usize>(system: &System, covariance: &mut Square<N>) {
    for (place, &state) in system.keep.iter().enumerate() {
        // Cov(c·x, x), the state's own former content being forgotten.
        let mut along = system.kept.combine(place, covariance);
        along[state] = 0.0;
        for &other in &system.keep[place + 1..] {
            along[other] = 0.0;
        }
        let own = system.kept.dot(place, &along);
        for i in 0..N {
            covariance[i][state] = along[i];
            covariance[state][i] = along[i];
        }
        covariance[state][state] = own;
    }
}

#[inline(always)]
fn advance<const N: usize>(system: &System, row: &Row, mean: &mut [f64; N]) {
    for &step in &row.before {
        *mean = system.steps[step as usize].phi.times(mean);
    }
    if row.keeps {
        for (place, &state) in system.keep.iter().enumerate() {
            mean[state] = system.kept.dot(place, mean);
        }
    }
    for &step in &row.after {
        *mean = system.steps[step as usize].phi.times(mean);
    }
}

#[inline(always)]
fn forward_of<const N: usize>(system: &System, rows: &[Row], values: &Values, keep: bool) -> Trace {
    let n = system.size;
    let steps: Vec<Noise<N>> = system
        .steps
        .iter()
        .map(|s| Noise { phi: &s.phi, noise: wide_square(&s.noise, n), trend_noise: wide_square(&s.trend_noise, n) })
        .collect();
    let mut mean: [f64; N] = wide(&system.mean);
    let mut covariance: Square<N> = wide_square(&system.covariance, n);
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
        advance(system, row, &mut mean);
        if keep {
            trace.means.extend_from_slice(&mean[..n]);
        }
        let frozen = settled >= SETTLED_ROWS;
        if !frozen {
            trace.thawed += 1;
            let density = system.trend.0 + row.bend * (system.trend.1 - system.trend.0);
            row.before.iter().for_each(|&s| predict(&steps[s as usize], density, &mut covariance));
            if row.keeps {
                keep_window(system, &mut covariance);
            }
            row.after.iter().for_each(|&s| predict(&steps[s as usize], density, &mut covariance));
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
            let value = values.of[m][k] - system.rows.dot(h, &mean);
            if !frozen {
                let along = system.rows.combine(h, &covariance);
                let variance = system.rows.dot(h, &along) + system.variances[m] / row.averaged;
                change = change.max((variance / variances[m] - 1.0).abs());
                variances[m] = variance;
                frozen_logs += variance.ln();
                let gain = along.map(|a| a / variance);
                for i in 0..N {
                    for j in 0..N {
                        covariance[i][j] -= gain[i] * along[j];
                    }
                }
                gains[m] = gain;
                if keep && let Some(last) = trace.gains.last_mut() {
                    last.gain.extend_from_slice(&gain[..n]);
                    last.gain.push(1.0 / variance);
                }
            }
            for i in 0..N {
                mean[i] += gains[m][i] * value;
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
fn respond_of<const N: usize>(system: &System, rows: &[Row], trace: &Trace, inputs: &Values) -> Vec<f64> {
    let n = system.size;
    let mut mean = [0.0; N];
    let mut out = Vec::with_capacity(trace.innovations.len());
    for (k, row) in rows.iter().enumerate() {
        advance(system, row, &mut mean);
        let gains = &trace.gains[trace.gains_of[k] as usize].gain;
        let mut taken = gains.chunks_exact(n + 1);
        for (m, index) in row.measured.iter().enumerate() {
            let (Some(h), Some(gain)) = (*index, index.and_then(|_| taken.next())) else { continue };
            let input = inputs.of[m].get(k).copied().unwrap_or(0.0);
            let value = input - system.rows.dot(h as usize, &mean);
            out.push(value);
            for i in 0..n {
                mean[i] += gain[i] * value;
            }
        }
    }
    out
}

fn smooth_of<const N: usize>(system: &System, rows: &[Row], trace: &Trace) -> Vec<f64> {
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
        row.after.iter().rev().for_each(|&s| r = system.steps[s as usize].phi_turned.times(&r));
        if row.keeps {
            for (place, &state) in system.keep.iter().enumerate().rev() {
                let weight = std::mem::take(&mut r[state]);
                system.kept.add_to(place, weight, &mut r);
            }
        }
        row.before.iter().rev().for_each(|&s| r = system.steps[s as usize].phi_turned.times(&r));
    }
    states
}
