//! Derivatives of innovations by coordinates: slope and information of the likelihood.
//!
//! ```text
//! g = Σ −v'v/S − S'/2S + S'v²/2S²,   I = Σ v'v'ᵀ/S + S'S'ᵀ/2S²
//! ```

use nalgebra::{DMatrix, DVector};
use pulp::Arch;

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

    /// Slope of the log likelihood along it.
    pub(crate) fn score(&self, base: &[Innovation]) -> f64 {
        WeightedColumn::slope(base).dot(self)
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
        self.add_score_to(base, score);
        self.add_information_to(base, information);
    }

    pub(crate) fn add_score_to(&self, base: &[Innovation], score: &mut DVector<f64>) {
        Arch::new().dispatch(|| {
            let slope = WeightedColumn::slope(base);
            self.parameters.iter().zip(&self.columns).for_each(|(&p, column)| score[p] += slope.dot(column));
        });
    }

    pub(crate) fn add_information_to(&self, base: &[Innovation], information: &mut DMatrix<f64>) {
        Arch::new().dispatch(|| self.add_products_to(base, information));
    }

    #[inline(always)]
    fn add_products_to(&self, base: &[Innovation], information: &mut DMatrix<f64>) {
        let weighted: Vec<WeightedColumn> = self.columns.iter().map(|c| WeightedColumn::new(c, base)).collect();
        for (i, &p) in self.parameters.iter().enumerate() {
            for (k, &q) in self.parameters.iter().enumerate().take(i + 1) {
                let sum = weighted[i].dot(&self.columns[k]);
                information[(p, q)] += sum;
                if p != q {
                    information[(q, p)] += sum;
                }
            }
        }
    }

    /// Information of a further column by itself, and with those that there are.
    pub(crate) fn beside(&self, further: &DerivativeColumn, base: &[Innovation], cross: &mut DVector<f64>) -> f64 {
        let weighted = WeightedColumn::new(further, base);
        self.parameters.iter().zip(&self.columns).for_each(|(&p, column)| cross[p] += weighted.dot(column));
        weighted.dot(further)
    }
}

/// What columns are multiplied by: another one over the innovations' variances, v'/S and S'/2S², or the slope's weights.
struct WeightedColumn {
    value: Vec<f64>,
    variance: Vec<f64>,
}

impl WeightedColumn {
    #[inline(always)]
    fn new(column: &DerivativeColumn, base: &[Innovation]) -> Self {
        let value = column.value.iter().zip(base).map(|(d, i)| d / i.variance).collect();
        let variance = column.variance.iter().zip(base).map(|(d, i)| 0.5 * d / (i.variance * i.variance)).collect();
        Self { value, variance }
    }

    /// −v/S and ½ (v²/S − 1)/S.
    #[inline(always)]
    fn slope(base: &[Innovation]) -> Self {
        let value = base.iter().map(|i| -i.value / i.variance).collect();
        let variance = base.iter().map(|i| 0.5 * (i.value * i.value / i.variance - 1.0) / i.variance).collect();
        Self { value, variance }
    }

    #[inline(always)]
    fn dot(&self, other: &DerivativeColumn) -> f64 {
        dot(&self.value, &other.value) + dot(&self.variance, &other.variance)
    }
}

/// Σ a b, in as many sums at a time as a processor has room for.
#[inline(always)]
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a, b) = (a.chunks_exact(SUMS), b.chunks_exact(SUMS));
    let mut rest: f64 = a.remainder().iter().zip(b.remainder()).map(|(a, b)| a * b).sum();
    let mut sums = [0.0; SUMS];
    for (a, b) in a.zip(b) {
        for i in 0..SUMS {
            sums[i] += a[i] * b[i];
        }
    }
    sums.iter().for_each(|s| rest += s);
    rest
}

const SUMS: usize = 8;
