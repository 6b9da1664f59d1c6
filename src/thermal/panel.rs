//! A stretch of time on which what drives a mode is a polynomial, under which the mode has a closed form however fast it is.
//!
//! ```text
//! e(x_j) = e(0) e^{−z x_j} + Σ_k E_jk g_k,   z = λ h,   E = ∫_0^{x_j} e^{−z (x_j − s)} d/ds ℓ_k(s) ds
//! ```
//!
//! # Source
//! Exponential collocation: Hochbruck and Ostermann, Acta Numerica 19 (2010) 209, section 2.2.

use nalgebra::DMatrix;

use super::ThermalError;
use crate::numeric::lobatto::Lobatto;

/// Degree of the polynomials on a panel.
pub(super) const DEGREE: usize = 7;

/// Φ_q(y) = ∫_0^1 e^{−y (1−v)} v^q dv for q = 0 … DEGREE.
pub(super) fn moments(y: f64) -> [f64; DEGREE + 1] {
    /// From here on the recurrence upwards loses nothing; before, the one downwards does not.
    const LARGE: f64 = 4.0;
    let mut moments = [0.0; DEGREE + 1];
    if y >= LARGE {
        moments[0] = -(-y).exp_m1() / y;
        for q in 1..=DEGREE {
            moments[q] = (1.0 - q as f64 * moments[q - 1]) / y;
        }
        return moments;
    }
    let (mut term, mut n) = ((-y).exp(), 0.0);
    while n < y || term > 1e-18 {
        moments[DEGREE] += term / (DEGREE as f64 + 1.0 + n);
        n += 1.0;
        term *= y / n;
    }
    for q in (1..=DEGREE).rev() {
        moments[q - 1] = (1.0 - y * moments[q]) / q as f64;
    }
    moments
}

/// The polynomials of a panel of length one.
#[derive(Debug)]
pub(super) struct Panel {
    pub(super) lobatto: Lobatto,
    /// Of the nodes, from 0 to 1.
    pub(super) places: Vec<f64>,
    /// Coefficients of s^q in the slope of what has given values at the nodes.
    pub(super) slope_powers: DMatrix<f64>,
    /// What the values at the nodes have of Legendre's polynomial of the highest degree.
    pub(super) last_term: Vec<f64>,
}

impl Panel {
    pub(super) fn new() -> Result<Self, ThermalError> {
        let lobatto = Lobatto::new(DEGREE);
        let places: Vec<f64> = lobatto.nodes.iter().map(|x| 0.5 * (x + 1.0)).collect();
        let vandermonde = DMatrix::from_fn(DEGREE + 1, DEGREE + 1, |i, q| places[i].powi(q as i32));
        let inverse = vandermonde.try_inverse().ok_or(ThermalError::Eigen)?;
        let slope_powers = inverse * &lobatto.derivative * 2.0;
        // w_i = 2/(p (p+1) P_p(x_i)²), and the discrete norm of P_p is 2/p; its sign alternates between neighbouring nodes.
        let p = DEGREE as f64;
        let last_term = lobatto
            .weights
            .iter()
            .enumerate()
            .map(|(i, w)| {
                let size = (2.0 / (p * (p + 1.0) * w)).sqrt();
                0.5 * p * w * if (DEGREE - i).is_multiple_of(2) { size } else { -size }
            })
            .collect();
        Ok(Self { lobatto, places, slope_powers, last_term })
    }

    /// Of all modes on a panel of a length.
    pub(super) fn weights(&self, decay_per_s: &[f64], length_s: f64) -> PanelWeights {
        let nodes = DEGREE + 1;
        let mut weights = PanelWeights {
            left: Vec::with_capacity(decay_per_s.len() * nodes),
            made: Vec::with_capacity(decay_per_s.len() * nodes * nodes),
        };
        for l in decay_per_s {
            for &x in &self.places {
                weights.left.push((-l * length_s * x).exp());
                let moments = moments(l * length_s * x);
                let mut power = 1.0;
                let mut row = [0.0; DEGREE + 1];
                for (q, moment) in moments.iter().enumerate() {
                    power *= x;
                    for (k, value) in row.iter_mut().enumerate() {
                        *value += power * moment * self.slope_powers[(q, k)];
                    }
                }
                weights.made.extend(row);
            }
        }
        weights
    }
}

/// Of every mode at every node: what is left of e, and what the values of g make of it.
#[derive(Debug)]
pub(super) struct PanelWeights {
    pub(super) left: Vec<f64>,
    /// By mode, node and value.
    pub(super) made: Vec<f64>,
}
