//! A linear stochastic system over a step of time.
//!
//! ```text
//! dx = F x dt + dW,  ⟨dW dWᵀ⟩ = G dt:   Φ = e^{FΔ},   Q = ∫_0^Δ e^{Fs} G e^{Fᵀs} ds
//! Φ(2h) = Φ(h)²,   Q(2h) = Q(h) + Φ(h) Q(h) Φ(h)ᵀ,   both by their Taylor series at h = Δ/2^k
//! ```
//!
//! Van Loan's one exponential of a doubled matrix overflows where a mode is stiff; doubling does not.
//!
//! # Source
//! Moler and Van Loan, SIAM Rev. 45 (2003) 3, method 3.

use super::sparse::Sparse;

/// Terms of the series; what they leave out is below ½^13/13! = 2e-14.
const TERMS: usize = 12;
const LARGEST_NORM: f64 = 0.5;

/// Φ and, for each of the noises, Q; all row-major n × n.
#[derive(Debug, Clone)]
pub(super) struct Discrete {
    pub(crate) transition: Vec<f64>,
    pub(crate) noises: Vec<Vec<f64>>,
}

/// # Shapes
/// `system` row-major n × n; each of `noises` the diagonal of a G.
pub(super) fn discretise(system: &[f64], noises: &[Vec<f64>], n: usize, step_s: f64) -> Discrete {
    let norm = system.chunks_exact(n).map(|row| row.iter().map(|v| v.abs()).sum::<f64>()).fold(0.0, f64::max) * step_s;
    let doublings = if norm.is_finite() { (norm / LARGEST_NORM).log2().ceil().clamp(0.0, 60.0) as i32 } else { 0 };
    let h = step_s / 2.0_f64.powi(doublings);
    let scaled: Vec<f64> = system.iter().map(|v| v * h).collect();
    let f = Sparse::new(&scaled, n);
    let mut transition = vec![0.0; n * n];
    (0..n).for_each(|i| transition[i * n + i] = 1.0);
    let mut term = transition.clone();
    for order in 1..=TERMS {
        term = f.times_matrix(&term, n);
        term.iter_mut().for_each(|v| *v /= order as f64);
        transition.iter_mut().zip(&term).for_each(|(t, v)| *t += v);
    }
    let mut noises: Vec<Vec<f64>> = noises.iter().map(|diagonal| noise_of(&f, diagonal, n, h)).collect();
    for _ in 0..doublings {
        let phi = Sparse::new(&transition, n);
        for noise in &mut noises {
            let half = turned(&phi.times_matrix(noise, n), n);
            let carried = phi.times_matrix(&half, n);
            noise.iter_mut().zip(carried).for_each(|(q, c)| *q += c);
        }
        transition = phi.times_matrix(&transition, n);
    }
    Discrete { transition, noises }
}

fn noise_of(f: &Sparse, diagonal: &[f64], n: usize, h: f64) -> Vec<f64> {
    let mut term = vec![0.0; n * n];
    diagonal.iter().enumerate().for_each(|(i, g)| term[i * n + i] = g * h);
    let mut sum = term.clone();
    for order in 2..=TERMS {
        // The terms are symmetric: F t + (F t)ᵀ.
        let product = f.times_matrix(&term, n);
        let other = turned(&product, n);
        for ((t, a), b) in term.iter_mut().zip(&product).zip(&other) {
            *t = (a + b) / order as f64;
        }
        sum.iter_mut().zip(&term).for_each(|(s, t)| *s += t);
    }
    sum
}

fn turned(matrix: &[f64], n: usize) -> Vec<f64> {
    (0..n * n).map(|i| matrix[i % n * n + i / n]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stiff_mode_behind_a_random_walk_is_the_closed_form() {
        // x' = −λ (x − w), w' = noise of density q.
        let (l, q, step) = (3.0_f64, 0.2, 20.0);
        let found = discretise(&[-l, l, 0.0, 0.0], &[vec![0.0, q]], 2, step);
        let left = (-l * step).exp();
        assert!((found.transition[0] - left).abs() < 1e-14 && (found.transition[1] - 1.0 + left).abs() < 1e-13);
        let cross = q * (step - (1.0 - left) / l);
        let own = q * (step - 2.0 * (1.0 - left) / l + (1.0 - left * left) / (2.0 * l));
        for (found, exact) in found.noises[0].iter().zip([own, cross, cross, q * step]) {
            assert!((found / exact - 1.0).abs() < 1e-12, "{found} for {exact}");
        }
    }
}
