//! The passes of a state-space model, at a number of states that the compiler knows: a row is then a few registers.
//!
//! Transitions and measurement rows are mostly zero; only what is not zero is multiplied.

// Loops over an index that the compiler knows the end of: iterators stay calls in functions as large as these.
#![allow(clippy::needless_range_loop)]

use pulp::{Arch, NullaryFnOnce};

use super::state_space::{Smoothed, StateSpace};

type Square<const N: usize> = [[f64; N]; N];

/// The entries of a matrix that are not zero, row by row.
#[derive(Debug, Clone)]
pub(super) struct Sparse {
    /// Where each row's entries begin; one more than there are rows.
    starts: Vec<usize>,
    entries: Vec<(usize, f64)>,
}

impl Sparse {
    /// # Shapes
    /// `matrix` row-major with `columns` columns.
    pub fn new(matrix: &[f64], columns: usize) -> Self {
        let mut sparse = Self { starts: vec![0], entries: Vec::new() };
        for row in matrix.chunks_exact(columns) {
            sparse.entries.extend(row.iter().copied().enumerate().filter(|(_, v)| *v != 0.0));
            sparse.starts.push(sparse.entries.len());
        }
        sparse
    }

    pub fn transposed(matrix: &[f64], n: usize) -> Self {
        let turned: Vec<f64> = (0..n * n).map(|i| matrix[i % n * n + i / n]).collect();
        Self::new(&turned, n)
    }

    #[inline(always)]
    fn rows(&self) -> usize {
        self.starts.len() - 1
    }

    #[inline(always)]
    fn row(&self, row: usize) -> &[(usize, f64)] {
        &self.entries[self.starts[row]..self.starts[row + 1]]
    }

    /// One row times a vector.
    #[inline(always)]
    pub fn dot(&self, row: usize, vector: &[f64]) -> f64 {
        let mut sum = 0.0;
        for &(k, v) in self.row(row) {
            sum += v * vector[k];
        }
        sum
    }

    /// out = M x.
    #[inline(always)]
    pub fn times(&self, vector: &[f64], out: &mut [f64]) {
        for row in 0..self.rows() {
            out[row] = self.dot(row, vector);
        }
    }

    /// out = M X.
    #[inline(always)]
    fn times_square<const N: usize>(&self, x: &Square<N>, out: &mut Square<N>) {
        for row in 0..self.rows() {
            out[row] = self.combine(row, x);
        }
    }

    /// Σ_k m_k X_k over one row of M.
    #[inline(always)]
    fn combine<const N: usize>(&self, row: usize, x: &Square<N>) -> [f64; N] {
        let mut sum = [0.0; N];
        for &(k, v) in self.row(row) {
            let line = &x[k];
            for j in 0..N {
                sum[j] += v * line[j];
            }
        }
        sum
    }

    /// S ← M S Mᵀ for a symmetric S.
    #[inline(always)]
    fn surround<const N: usize>(&self, square: &mut Square<N>) {
        let mut product = [[0.0; N]; N];
        self.times_square(square, &mut product);
        let mut turned = [[0.0; N]; N];
        for i in 0..N {
            for j in 0..N {
                turned[i][j] = product[j][i];
            }
        }
        self.times_square(&turned, &mut product);
        for i in 0..N {
            for j in 0..N {
                square[i][j] = 0.5 * (product[i][j] + product[j][i]);
            }
        }
    }
}

/// What the forward pass leaves for the backward pass.
#[derive(Default)]
pub(super) struct Trace {
    pub means: Vec<f64>,
    pub covariances: Vec<f64>,
    pub gains: Vec<f64>,
    /// Each innovation and its variance.
    pub innovations: Vec<(f64, f64)>,
}

/// What of the forward pass is to be kept.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Keep {
    Nothing,
    Gains,
    /// Means and covariances too.
    States,
}

/// Calls a function with the least number of states that has room.
macro_rules! dispatch {
    ($size:expr, $function:ident($($argument:expr),*)) => {
        match $size {
            0..=4 => $function::<4>($($argument),*),
            5..=6 => $function::<6>($($argument),*),
            7..=8 => $function::<8>($($argument),*),
            9..=10 => $function::<10>($($argument),*),
            11..=12 => $function::<12>($($argument),*),
            13..=14 => $function::<14>($($argument),*),
            15..=24 => $function::<24>($($argument),*),
            size => {
                assert!(size <= MOST_STATES, "a model has at most {MOST_STATES} states");
                $function::<MOST_STATES>($($argument),*)
            }
        }
    };
}

/// The forward pass: the log-likelihood, Σ v²/f, and what is kept.
pub(super) fn forward(model: &StateSpace, keep: Keep) -> (f64, f64, Trace) {
    Arch::new().dispatch(Forward { model, keep })
}

/// Both passes; states and the functional's variance only where a functional is given.
pub(super) fn smooth(model: &StateSpace, functional: Option<&[f64]>) -> Smoothed {
    Arch::new().dispatch(Smooth { model, functional })
}

/// The passes, compiled once for each width of the processor's registers. Nothing is summed in another order for it, so
/// that the result is the same on all.
struct Forward<'a> {
    model: &'a StateSpace,
    keep: Keep,
}

struct Smooth<'a> {
    model: &'a StateSpace,
    functional: Option<&'a [f64]>,
}

impl NullaryFnOnce for Forward<'_> {
    type Output = (f64, f64, Trace);

    #[inline(always)]
    fn call(self) -> Self::Output {
        dispatch!(self.model.size, forward_of(self.model, self.keep))
    }
}

impl NullaryFnOnce for Smooth<'_> {
    type Output = Smoothed;

    #[inline(always)]
    fn call(self) -> Self::Output {
        dispatch!(self.model.size, smooth_of(self.model, self.functional))
    }
}

const MOST_STATES: usize = 64;

fn wide<const N: usize>(vector: &[f64]) -> [f64; N] {
    std::array::from_fn(|i| vector.get(i).copied().unwrap_or(0.0))
}

fn wide_square<const N: usize>(matrix: &[f64], n: usize) -> Square<N> {
    std::array::from_fn(|i| if i < n { wide(&matrix[i * n..(i + 1) * n]) } else { [0.0; N] })
}

fn sparse_rows(model: &StateSpace) -> Sparse {
    Sparse::new(&model.rows.concat(), model.size)
}

#[inline(always)]
fn forward_of<const N: usize>(model: &StateSpace, keep: Keep) -> (f64, f64, Trace) {
    let n = model.size;
    let rows = sparse_rows(model);
    let transitions: Vec<Sparse> = model.transitions.iter().map(|t| Sparse::new(t, n)).collect();
    let directions = Sparse::new(&model.directions.concat(), n);
    let mut mean: [f64; N] = wide(&model.mean);
    let mut covariance: Square<N> = wide_square(&model.covariance, n);
    let (mut log_likelihood, mut squares) = (0.0, 0.0);
    let mut trace = Trace::default();
    for (index, stage) in model.stages.iter().enumerate() {
        if keep == Keep::States {
            trace.means.extend_from_slice(&mean[..n]);
            covariance[..n].iter().for_each(|line| trace.covariances.extend_from_slice(&line[..n]));
        }
        for measurement in &stage.measurements {
            let gain = rows.combine(measurement.row, &covariance);
            let variance = rows.dot(measurement.row, &gain) + measurement.variance;
            let innovation = measurement.value - rows.dot(measurement.row, &mean);
            let share = gain.map(|g| g / variance);
            for i in 0..N {
                mean[i] += share[i] * innovation;
                for j in 0..N {
                    covariance[i][j] -= share[i] * gain[j];
                }
            }
            log_likelihood -= 0.5 * ((std::f64::consts::TAU * variance).ln() + innovation * innovation / variance);
            squares += innovation * innovation / variance;
            if keep != Keep::Nothing {
                trace.gains.extend_from_slice(&share[..n]);
                trace.innovations.push((innovation, variance));
            }
        }
        if index + 1 == model.stages.len() {
            break;
        }
        for &(direction, variance) in &stage.disturbances {
            let along = directions.row(direction);
            for &(i, a) in along {
                for &(j, b) in along {
                    covariance[i][j] += variance * a * b;
                }
            }
        }
        let transition = &transitions[stage.transition];
        let before = mean;
        transition.times(&before, &mut mean);
        transition.surround(&mut covariance);
    }
    (log_likelihood, squares, trace)
}

#[inline(always)]
fn smooth_of<const N: usize>(model: &StateSpace, functional: Option<&[f64]>) -> Smoothed {
    let n = model.size;
    let keep = if functional.is_some() { Keep::States } else { Keep::Gains };
    let (log_likelihood, squared_innovations, trace) = forward_of::<N>(model, keep);
    let (stages, count) = (model.stages.len(), model.directions.len());
    let states = if functional.is_some() { stages } else { 0 };
    let mut smoothed = Smoothed {
        log_likelihood,
        squared_innovations,
        measurements: trace.innovations.len(),
        states: vec![0.0; states * n],
        score: vec![0.0; stages * count],
        information: vec![0.0; stages * count],
        functional_variance: vec![0.0; states],
    };
    let rows: Vec<[f64; N]> = model.rows.iter().map(|row| wide(row)).collect();
    let transitions: Vec<Sparse> = model.transitions.iter().map(|t| Sparse::transposed(t, n)).collect();
    let directions = Sparse::new(&model.directions.concat(), n);
    let functional: Option<[f64; N]> = functional.map(wide);
    let mut r = [0.0; N];
    let mut information = [[0.0; N]; N];
    let mut taken = trace.innovations.len();
    for index in (0..stages).rev() {
        let stage = &model.stages[index];
        if index + 1 < stages {
            let transition = &transitions[stage.transition];
            let after = r;
            transition.times(&after, &mut r);
            transition.surround(&mut information);
            for d in 0..count {
                smoothed.score[index * count + d] = directions.dot(d, &r);
                smoothed.information[index * count + d] =
                    directions.row(d).iter().map(|&(i, a)| a * directions.dot(d, &information[i])).sum();
            }
        }
        for measurement in stage.measurements.iter().rev() {
            taken -= 1;
            let gain: [f64; N] = wide(&trace.gains[taken * n..(taken + 1) * n]);
            absorb(&rows[measurement.row], &gain, trace.innovations[taken], &mut r, &mut information);
        }
        let Some(functional) = &functional else { continue };
        let covariance: Square<N> = wide_square(&trace.covariances[index * n * n..(index + 1) * n * n], n);
        let place = index * n..(index + 1) * n;
        let means = &trace.means[place.clone()];
        for ((state, mean), line) in smoothed.states[place].iter_mut().zip(means).zip(&covariance) {
            *state = mean + dot(line, &r);
        }
        let along = combined(functional, &covariance);
        smoothed.functional_variance[index] =
            (dot(functional, &along) - dot(&along, &combined(&along, &information))).max(0.0);
    }
    smoothed
}

/// r ← h v/f + (I − K h)ᵀ r and N ← h hᵀ/f + (I − K h)ᵀ N (I − K h).
#[inline(always)]
fn absorb<const N: usize>(
    row: &[f64; N],
    gain: &[f64; N],
    (innovation, variance): (f64, f64),
    r: &mut [f64; N],
    information: &mut Square<N>,
) {
    let along = dot(gain, r);
    let spread = combined(gain, information);
    let total = dot(gain, &spread) + 1.0 / variance;
    for i in 0..N {
        r[i] += row[i] * (innovation / variance - along);
        for j in 0..N {
            information[i][j] += row[i] * row[j] * total - row[i] * spread[j] - spread[i] * row[j];
        }
    }
}

/// S v for a symmetric S.
#[inline(always)]
fn combined<const N: usize>(vector: &[f64; N], square: &Square<N>) -> [f64; N] {
    let mut sum = [0.0; N];
    for i in 0..N {
        for j in 0..N {
            sum[j] += vector[i] * square[i][j];
        }
    }
    sum
}

#[inline(always)]
fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    let mut sum = 0.0;
    for i in 0..N {
        sum += a[i] * b[i];
    }
    sum
}
