//! Derivatives of innovations by coordinates: slope and information of the likelihood.
//!
//! ```text
//! g = Σ −v'v/S − S'/2S + S'v²/2S²,   I = Σ v'v'ᵀ/S + S'S'ᵀ/2S²
//! ```

use nalgebra::{DMatrix, DVector};

use super::filter::Innovation;

/// dv and dS of one coordinate.
#[derive(Debug, Clone)]
pub(super) struct DerivativeColumn {
    pub(crate) value: Vec<f64>,
    pub(crate) variance: Vec<f64>,
}

impl DerivativeColumn {
    pub(crate) fn new(base: &[Innovation], there: &[Innovation], step: f64) -> Self {
        let over = |f: fn(&Innovation) -> f64| base.iter().zip(there).map(|(b, t)| (f(t) - f(b)) / step).collect();
        Self { value: over(|i| i.value), variance: over(|i| i.variance) }
    }
}

/// The derivatives of one record's innovations.
#[derive(Debug, Clone, Default)]
pub(super) struct Derivatives {
    pub(crate) parameters: Vec<usize>,
    pub(crate) columns: Vec<DerivativeColumn>,
}

impl Derivatives {
    /// As [`Self::add_to`] for values without noise, whose variances say nothing.
    pub(crate) fn add_values_to(&self, base: &[Innovation], score: &mut DVector<f64>, information: &mut DMatrix<f64>) {
        let sum = |a: &[f64], b: &mut dyn Iterator<Item = f64>| -> f64 {
            a.iter().zip(b).zip(base).map(|((a, b), i)| a * b / i.variance).sum()
        };
        for (&p, column) in self.parameters.iter().zip(&self.columns) {
            score[p] -= sum(&column.value, &mut base.iter().map(|b| b.value));
            for (&q, other) in self.parameters.iter().zip(&self.columns) {
                information[(p, q)] += sum(&column.value, &mut other.value.iter().copied());
            }
        }
    }

    pub(crate) fn add_to(&self, base: &[Innovation], score: &mut DVector<f64>, information: &mut DMatrix<f64>) {
        let weighted: Vec<(Vec<f64>, Vec<f64>)> = self
            .columns
            .iter()
            .map(|c| {
                let value = c.value.iter().zip(base).map(|(d, i)| d / i.variance).collect();
                let variance = c.variance.iter().zip(base).map(|(d, i)| 0.5 * d / (i.variance * i.variance)).collect();
                (value, variance)
            })
            .collect();
        for (i, &p) in self.parameters.iter().enumerate() {
            let (value, variance) = &weighted[i];
            score[p] += base
                .iter()
                .zip(value.iter().zip(variance))
                .map(|(b, (dv, ds))| -dv * b.value + ds * (b.value * b.value - b.variance))
                .sum::<f64>();
            for (k, &q) in self.parameters.iter().enumerate().take(i + 1) {
                let other = &self.columns[k];
                let sum = dot(value, &other.value) + dot(variance, &other.variance);
                information[(p, q)] += sum;
                if p != q {
                    information[(q, p)] += sum;
                }
            }
        }
    }
}

impl Derivatives {
    /// Score of the last column, and its information with all.
    pub(crate) fn last_row(&self, base: &[Innovation], size: usize) -> (f64, DVector<f64>) {
        let mut row = DVector::zeros(size);
        let mut score = 0.0;
        if let Some(last) = self.columns.last() {
            let value: Vec<f64> = last.value.iter().zip(base).map(|(d, i)| d / i.variance).collect();
            let variance: Vec<f64> =
                last.variance.iter().zip(base).map(|(d, i)| 0.5 * d / (i.variance * i.variance)).collect();
            for (b, (dv, ds)) in base.iter().zip(value.iter().zip(&variance)) {
                score += -dv * b.value + ds * (b.value * b.value - b.variance);
            }
            for (&p, column) in self.parameters.iter().zip(&self.columns) {
                row[p] += dot(&value, &column.value) + dot(&variance, &column.variance);
            }
        }
        (score, row)
    }
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
