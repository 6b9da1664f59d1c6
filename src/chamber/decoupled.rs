//! Other coordinates of the same system, in which little depends on much else: for passes of which only innovations are wanted.
//!
//! ```text
//! dz = A z dt + …,  dx_k = (b_k·(z, x_1 … x_{k−1}) − λ_k x_k) dt + …:   x'_k = x_k − t_k·z,  t_k (A + λ_k) = b_k
//! F' = T F T⁻¹,  G' = T G Tᵀ,  h' = h T⁻¹
//! ```
//!
//! z are the air's level and its ripple with what drives it, x_k what follows the air: skin, modes, sensor. In these coordinates a mode
//! is how far it lags behind the level and its own response to the ripple, and depends on itself, the slope and the turbulence only:
//! behind a film that stays, its row of Φ has three entries instead of eight. Slope and turbulence stay as they are, since their decays may be those of a mode, where
//! A + λ is singular; those of the level (0) and of the ripple (complex) are not.
//!
//! Innovations, and so the likelihood, are the same in all coordinates (a test compares them).
//!
//! # Source
//! Sylvester's equation, as in block diagonalisation: Golub and Van Loan, Matrix Computations, section 7.6.3.

use nalgebra::{Matrix4, Vector4};

use super::layout::Layout;

/// An entry of F' this much smaller than its row's largest is what rounding leaves of zero.
const ROUNDING: f64 = 1e-13;

/// T = 1 − Σ_k e_k t_kᵀ.
pub(super) struct Decoupling {
    size: usize,
    /// Of each follower, what it takes of which state.
    shares: Vec<(usize, Vec<(usize, f64)>)>,
}

impl Decoupling {
    /// # Shapes
    /// `f` row-major n × n, without a switched film.
    pub(super) fn new(f: &[f64], layout: &Layout) -> Self {
        let n = layout.size;
        let ripple = [layout.ripple, layout.ripple + 1, layout.driver, layout.driver + 1];
        let within = Matrix4::from_fn(|a, b| f[ripple[a] * n + ripple[b]]);
        let mut shares: Vec<(usize, Vec<(usize, f64)>)> = Vec::new();
        for follower in layout.skin.into_iter().chain(0..layout.modes).chain(layout.lag) {
            let row = &f[follower * n..(follower + 1) * n];
            // What it follows of a state, itself or through the followers before it.
            let follows = |state: usize| -> f64 {
                let through = |(before, of): &(usize, Vec<(usize, f64)>)| -> f64 {
                    let share = of.iter().find(|(s, _)| *s == state).map_or(0.0, |s| s.1);
                    row[*before] * share
                };
                row[state] + shares.iter().map(through).sum::<f64>()
            };
            let decay = -row[follower];
            let level = follows(layout.trend) / decay;
            let shifted = within.transpose() + Matrix4::identity() * decay;
            let asked = Vector4::from_fn(|a, _| follows(ripple[a]));
            let own = shifted.lu().solve(&asked).unwrap_or_default();
            let of = std::iter::once((layout.trend, level)).chain(ripple.into_iter().zip(own.iter().copied()));
            shares.push((follower, of.filter(|(_, share)| share.is_finite()).collect()));
        }
        Self { size: n, shares }
    }

    /// Rows over the states as rows over the new ones: R T⁻¹.
    ///
    /// # Shapes
    /// `rows` row-major, n columns.
    pub(super) fn take_rows(&self, rows: &mut [f64]) {
        for row in rows.chunks_exact_mut(self.size) {
            for (follower, of) in &self.shares {
                let own = row[*follower];
                of.iter().for_each(|&(state, share)| row[state] += own * share);
            }
        }
    }

    /// A vector of states, or the columns of a matrix: T X.
    ///
    /// # Shapes
    /// `columns` row-major n × `width`.
    pub(super) fn take_columns(&self, columns: &mut [f64], width: usize) {
        for (follower, of) in &self.shares {
            for &(state, share) in of {
                for j in 0..width {
                    columns[follower * width + j] -= share * columns[state * width + j];
                }
            }
        }
    }

    /// What drives a change of the states: T F T⁻¹.
    pub(super) fn take_dynamics(&self, f: &mut [f64]) {
        self.take_rows(f);
        self.take_columns(f, self.size);
        for row in f.chunks_exact_mut(self.size) {
            let largest = row.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
            row.iter_mut().filter(|v| v.abs() < ROUNDING * largest).for_each(|v| *v = 0.0);
        }
    }

    /// A covariance of the states: T C Tᵀ.
    pub(super) fn take_covariance(&self, covariance: &mut [f64]) {
        let n = self.size;
        self.take_columns(covariance, n);
        for i in 0..n {
            for j in 0..i {
                covariance.swap(i * n + j, j * n + i);
            }
        }
        self.take_columns(covariance, n);
    }
}
