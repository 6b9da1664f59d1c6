//! A linear stochastic system over a step of time.
//!
//! ```text
//! dx = F x dt + dW,  ⟨dW dWᵀ⟩ = G dt:   Φ = e^{FΔ},   Q = ∫_0^Δ e^{Fs} G e^{Fᵀs} ds
//! Φ(2h) = Φ(h)²,   Q(2h) = Q(h) + Φ(h) Q(h) Φ(h)ᵀ,   both by their Taylor series at h = Δ/2^k
//! ```
//!
//! Van Loan's one exponential of a doubled matrix overflows where a mode is stiff; doubling does not. A record whose rows differ
//! has steps of a hundred lengths, which need not be doubled from nothing: a step is the next shorter one and a little more.
//!
//! ```text
//! Φ(a + δ) = Φ(δ) Φ(a),   Q(a + δ) = Q(δ) + Φ(δ) Q(a) Φ(δ)ᵀ
//! ```
//!
//! # Source
//! Moler and Van Loan, SIAM Rev. 45 (2003) 3, method 3.

// Loops over an index that the compiler knows the end of: iterators stay calls in functions as large as these.
#![allow(clippy::needless_range_loop)]

use super::arithmetic::{Arithmetic, Pass, dispatched};
use super::sparse::{MOST_STATES, Sparse, Square, dispatch, turned, wide_square};
use crate::numeric::order::sort_ascending;

/// Terms of the series; what they leave out is below ½^13/13! = 2e-14.
const TERMS: usize = 12;
const LARGEST_NORM: f64 = 0.5;
/// Differences between lengths that differ by less are one \[s\]: rounding leaves less of them in records of up to a million seconds.
const ROUNDING_S: f64 = 1e-9;
/// Noises that are told apart.
const NOISES: usize = 2;

/// What steps follow from, behind one film; all row-major n × n.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ContinuousDynamics {
    /// F, and what drives it, which is the same behind either film: G, and that of the trend's noise.
    pub(super) of: Vec<f64>,
    pub(super) noises: [Vec<f64>; NOISES],
}

/// Φ and, for each of the noises, Q; all row-major n × n.
#[derive(Debug, Clone)]
pub(super) struct Discrete {
    pub(crate) transition: Vec<f64>,
    pub(crate) noises: [Vec<f64>; NOISES],
}

/// The system over each of the steps, in their order.
///
/// # Shapes
/// `system` row-major n × n \[1/s\]; each of `noises` a G, likewise; one entry of the answer a step.
pub(super) fn discretise(system: &[f64], noises: [&[f64]; NOISES], n: usize, steps_s: &[f64]) -> Vec<Discrete> {
    dispatched(Discretise { system, noises, n, steps_s })
}

struct Discretise<'a> {
    system: &'a [f64],
    noises: [&'a [f64]; NOISES],
    n: usize,
    steps_s: &'a [f64],
}

impl Pass for Discretise<'_> {
    type Output = Vec<Discrete>;

    #[inline(always)]
    fn run(self, arithmetic: impl Arithmetic) -> Self::Output {
        dispatch!(self.n, discretise_of(arithmetic, &self))
    }
}

/// What a state that changes by one makes of all states any time after: a column of Φ, made up of those of doubled lengths and the series
/// for what is left.
pub(super) struct ChangesAfter {
    state: usize,
    f: Sparse,
    doubled: Vec<(f64, Sparse)>,
}

impl ChangesAfter {
    /// For times up to the longest.
    ///
    /// # Shapes
    /// `system` row-major n × n \[1/s\].
    pub(super) fn new(system: &[f64], n: usize, state: usize, longest_s: f64) -> Self {
        let f = Sparse::new(system, n);
        let unit_s = series_unit_s(system, n, longest_s.max(f64::MIN_POSITIVE));
        let doubled = dispatched(Doubled { f: &f, unit_s, longest_s });
        Self { state, f, doubled }
    }

    /// A column for each of the times, in their order.
    pub(super) fn at(&self, times_s: &[f64]) -> Vec<Vec<f64>> {
        dispatched(ColumnsAt { of: self, times_s })
    }
}

/// Φ of one unit of time, of two, of four … up to the longest.
struct Doubled<'a> {
    f: &'a Sparse,
    unit_s: f64,
    longest_s: f64,
}

impl Pass for Doubled<'_> {
    type Output = Vec<(f64, Sparse)>;

    #[inline(always)]
    fn run(self, arithmetic: impl Arithmetic) -> Self::Output {
        dispatch!(self.f.rows(), doubled_of(arithmetic, &self))
    }
}

struct ColumnsAt<'a> {
    of: &'a ChangesAfter,
    times_s: &'a [f64],
}

impl Pass for ColumnsAt<'_> {
    type Output = Vec<Vec<f64>>;

    #[inline(always)]
    fn run(self, arithmetic: impl Arithmetic) -> Self::Output {
        dispatch!(self.of.f.rows(), columns_of(arithmetic, &self))
    }
}

#[inline(always)]
fn doubled_of<const N: usize>(arithmetic: impl Arithmetic, of: &Doubled) -> Vec<(f64, Sparse)> {
    let n = of.f.rows();
    let mut doubled: Vec<(f64, Sparse)> = Vec::new();
    let (mut length_s, mut phi) = (of.unit_s, transition_of::<N>(arithmetic, of.f, of.unit_s));
    while length_s < of.longest_s {
        let sparse = Sparse::of_square(&phi, n);
        phi = sparse.times_square(arithmetic, &phi);
        doubled.push((length_s, sparse));
        length_s *= 2.0;
    }
    doubled
}

#[inline(always)]
fn columns_of<const N: usize>(arithmetic: impl Arithmetic, asked: &ColumnsAt) -> Vec<Vec<f64>> {
    let ChangesAfter { state, f, doubled } = asked.of;
    let column = |&time_s: &f64| {
        let (mut change, mut left_s) = ([0.0; N], time_s);
        change[*state] = 1.0;
        for (length_s, phi) in doubled.iter().rev() {
            if *length_s <= left_s {
                left_s -= length_s;
                change = phi.times(arithmetic, &change);
            }
        }
        let mut term = change;
        for order in 1..=TERMS {
            term = f.times(arithmetic, &term).map(|v| v * left_s / order as f64);
            (0..N).for_each(|i| change[i] += term[i]);
        }
        change[..f.rows()].to_vec()
    };
    asked.times_s.iter().map(column).collect()
}

/// Φ over a time for which the series serves.
#[inline(always)]
fn transition_of<const N: usize>(arithmetic: impl Arithmetic, f: &Sparse, time_s: f64) -> Square<N> {
    let mut sum = [[0.0; N]; N];
    (0..f.rows()).for_each(|i| sum[i][i] = 1.0);
    let mut term = sum;
    for order in 1..=TERMS {
        term = f.times_square(arithmetic, &term);
        for i in 0..N {
            for j in 0..N {
                term[i][j] *= time_s / order as f64;
                sum[i][j] += term[i][j];
            }
        }
    }
    sum
}

/// The longest time for which the series serves, at most this one.
fn series_unit_s(system: &[f64], n: usize, longest_s: f64) -> f64 {
    let norm = system.chunks_exact(n).map(|row| row.iter().map(|v| v.abs()).sum::<f64>()).fold(0.0, f64::max);
    if norm.is_finite() { longest_s.min(LARGEST_NORM / norm) } else { longest_s }
}

/// Φ and the two Q over one length of time.
#[derive(Clone)]
struct Over<const N: usize> {
    transition: Square<N>,
    noises: [Square<N>; NOISES],
}

impl<const N: usize> Over<N> {
    fn nothing(n: usize) -> Self {
        let mut transition = [[0.0; N]; N];
        (0..n).for_each(|i| transition[i][i] = 1.0);
        Self { transition, noises: [[[0.0; N]; N]; NOISES] }
    }

    #[inline(always)]
    fn add(&mut self, other: &Self, factor: f64) {
        for i in 0..N {
            for j in 0..N {
                self.transition[i][j] += factor * other.transition[i][j];
                for k in 0..NOISES {
                    self.noises[k][i][j] += factor * other.noises[k][i][j];
                }
            }
        }
    }

    /// Carries it on by another time, whose Φ comes with it.
    #[inline(always)]
    fn carry_on(&mut self, arithmetic: impl Arithmetic, by: &Self, phi: &Sparse) {
        self.transition = phi.times_square(arithmetic, &self.transition);
        for k in 0..NOISES {
            let half = turned(&phi.times_square(arithmetic, &self.noises[k]));
            for i in 0..phi.rows() {
                self.noises[k][i] = phi.combine_onto(arithmetic, i, &half, &by.noises[k][i]);
            }
        }
    }

    fn discrete(&self, n: usize) -> Discrete {
        let flat = |square: &Square<N>| {
            let mut flat = Vec::with_capacity(n * n);
            square[..n].iter().for_each(|row| flat.extend_from_slice(&row[..n]));
            flat
        };
        Discrete { transition: flat(&self.transition), noises: [flat(&self.noises[0]), flat(&self.noises[1])] }
    }
}

/// What a step is longer than the next shorter one, and its Φ.
struct More<const N: usize> {
    time_s: f64,
    over: Over<N>,
    phi: Sparse,
}

#[inline(always)]
fn discretise_of<const N: usize>(arithmetic: impl Arithmetic, of: &Discretise) -> Vec<Discrete> {
    let n = of.n;
    let longest_s = of.steps_s.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let unit_s = series_unit_s(of.system, n, longest_s);
    let series = series_of::<N>(arithmetic, of, unit_s);
    let mut order: Vec<usize> = (0..of.steps_s.len()).collect();
    sort_ascending(&mut order, |item| of.steps_s[*item]);
    let mut found: Vec<(usize, Discrete)> = Vec::with_capacity(order.len());
    let (mut known_s, mut known) = (0.0, Over::<N>::nothing(n));
    let mut last: Option<More<N>> = None;
    for place in order {
        // What is left out is made up for by the next.
        let more_s = of.steps_s[place] - known_s;
        let more = match last.take() {
            Some(same) if (same.time_s - more_s).abs() < ROUNDING_S => same,
            _ => {
                let over = over(arithmetic, &series, more_s / unit_s, n);
                let phi = Sparse::of_square(&over.transition, n);
                More { time_s: more_s, over, phi }
            }
        };
        known.carry_on(arithmetic, &more.over, &more.phi);
        known_s += more.time_s;
        found.push((place, known.discrete(n)));
        last = Some(more);
    }
    found.sort_by_key(|f| f.0);
    found.into_iter().map(|f| f.1).collect()
}

/// So many units of time, of whose powers the series' terms are.
#[inline(always)]
fn over<const N: usize>(arithmetic: impl Arithmetic, series: &[Over<N>], units: f64, n: usize) -> Over<N> {
    let doublings = units.log2().ceil().clamp(0.0, 60.0) as i32;
    let share = units / 2.0_f64.powi(doublings);
    let mut sum = Over::nothing(n);
    let mut power = 1.0;
    for term in series {
        power *= share;
        sum.add(term, power);
    }
    for _ in 0..doublings {
        let half = sum.clone();
        sum.carry_on(arithmetic, &half, &Sparse::of_square(&half.transition, n));
    }
    sum
}

/// The terms of Φ's and Q's series at one unit of time.
#[inline(always)]
fn series_of<const N: usize>(arithmetic: impl Arithmetic, of: &Discretise, unit_s: f64) -> Vec<Over<N>> {
    let n = of.n;
    let scaled: Vec<f64> = of.system.iter().map(|v| v * unit_s).collect();
    let f = Sparse::new(&scaled, n);
    let mut first = Over { transition: wide_square(&scaled, n), noises: of.noises.map(|g| wide_square(g, n)) };
    first.noises.iter_mut().flatten().flatten().for_each(|g| *g *= unit_s);
    let mut terms = vec![first];
    for order in 2..=TERMS {
        let (before, share) = (&terms[order - 2], 1.0 / order as f64);
        let mut next = Over { transition: f.times_square(arithmetic, &before.transition), noises: before.noises };
        next.transition.iter_mut().flatten().for_each(|v| *v *= share);
        for noise in &mut next.noises {
            // The terms are symmetric: F t + (F t)ᵀ.
            let product = f.times_square(arithmetic, noise);
            let other = turned(&product);
            for i in 0..N {
                for j in 0..N {
                    noise[i][j] = (product[i][j] + other[i][j]) * share;
                }
            }
        }
        terms.push(next);
    }
    terms
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chamber::system::diagonal;

    #[test]
    fn a_change_of_one_state_is_carried_on_as_the_whole_system_is() {
        let f = [[-2.5, 0.0, 0.0, 2.5], [0.0, -0.01, 0.05, 0.3], [0.0, -0.05, -0.01, 0.0], [0.0, 0.0, 0.0, -0.002]];
        let (f, none) = (f.concat(), [0.0; 16]);
        let times_s = [9.8, 0.0, 0.02, 60.0, 3.7];
        let longest_s = times_s.iter().copied().fold(0.0, f64::max);
        for state in 0..4 {
            for (time_s, found) in times_s.iter().zip(ChangesAfter::new(&f, 4, state, longest_s).at(&times_s)) {
                let whole = &discretise(&f, [&none, &none], 4, &[*time_s])[0].transition;
                assert!(
                    (0..4).all(|i| (found[i] - whole[4 * i + state]).abs() < 1e-12),
                    "{state}, {time_s}: {found:?}"
                );
            }
        }
    }

    #[test]
    fn a_stiff_mode_behind_a_random_walk_is_the_closed_form() {
        // x' = −λ (x − w), w' = noise of density q.
        let (l, q, step) = (3.0_f64, 0.2, 20.0);
        let found = &discretise(&[-l, l, 0.0, 0.0], [&[0.0, 0.0, 0.0, q], &[0.0; 4]], 2, &[step])[0];
        let left = (-l * step).exp();
        assert!((found.transition[0] - left).abs() < 1e-14 && (found.transition[1] - 1.0 + left).abs() < 1e-13);
        let cross = q * (step - (1.0 - left) / l);
        let own = q * (step - 2.0 * (1.0 - left) / l + (1.0 - left * left) / (2.0 * l));
        for (found, exact) in found.noises[0].iter().zip([own, cross, cross, q * step]) {
            assert!((found / exact - 1.0).abs() < 1e-12, "{found} for {exact}");
        }
    }

    #[test]
    fn a_step_is_the_same_beside_any_others() {
        // A stiff mode, an oscillator that noise drives, and a random walk that both follow.
        let f = [[-2.5, 0.0, 0.0, 2.5], [0.0, -0.01, 0.05, 0.3], [0.0, -0.05, -0.01, 0.0], [0.0, 0.0, 0.0, -0.002]];
        let (f, rest, bend) = (f.concat(), diagonal(&[0.0, 0.0, 0.4, 0.0]), diagonal(&[0.0, 0.0, 0.0, 1.0]));
        // Some longer than the next by the same, as far as instants are told.
        let steps_s = [10.0, 3.7, 9.8, 3.701, 60.0, 10.0, 0.02, 10.1, 10.2, 10.3 + 4e-15, 10.4];
        let all = discretise(&f, [&rest, &bend], 4, &steps_s);
        for (step_s, found) in steps_s.iter().zip(&all) {
            let alone = &discretise(&f, [&rest, &bend], 4, &[*step_s])[0];
            let of = |d: &Discrete| [&d.transition[..], &d.noises[0], &d.noises[1]].map(<[f64]>::to_vec);
            for (one, other) in of(alone).iter().zip(of(found)) {
                let size = one.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
                assert!(one.iter().zip(&other).all(|(a, b)| (a - b).abs() < 1e-13 * size), "{step_s}");
            }
        }
    }
}
