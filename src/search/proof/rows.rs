//! The few samples that a proof runs on, with what bounds the sum of a pattern that is not complete yet.
//!
//! A lower bound over some instants is a lower bound over all of them, so a proof may choose its samples freely. In
//! every sample
//!
//! ```text
//! Ω = c + Σ_j ( S_j w_j + D_j u_j + X_j x_j ),   S = (A + B)/2,  D = (A − B)/2,  w = w^A + w^B,  u = w^A − w^B ≤ 0
//! ```
//!
//! | symbol | meaning | in code |
//! |---|---|---|
//! | A_j, B_j | response of a layer's weight in either half of the fibre | `SampleMatrix` |
//! | S_j, D_j | their mean and half their difference; D = 0 where the halves respond alike | `SampleRow::mean`, `SampleRow::difference` |
//! | X_j | response of the axial moment's weight | `SampleRow::axial` |

use crate::search::cost::samples::SampleMatrix;

/// One sample's coefficients, one entry a layer, innermost first.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SampleRow {
    pub(crate) constant: f64,
    pub(crate) mean: Vec<f64>,
    pub(crate) difference: Vec<f64>,
    pub(crate) axial: Vec<f64>,
}

/// An interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Range {
    pub(crate) low: f64,
    pub(crate) high: f64,
}

impl SampleRow {
    /// A sample of a matrix.
    pub(crate) fn of(matrix: &SampleMatrix, sample: usize) -> Self {
        let (layout, columns) = (matrix.layout, &matrix.columns);
        let layers = 0..layout.layers;
        let a = |j: usize| columns.column(layout.column_a(j))[sample];
        let b = |j: usize| columns.column(layout.column_b(j))[sample];
        Self {
            constant: columns.constant()[sample],
            mean: layers.clone().map(|j| 0.5 * (a(j) + b(j))).collect(),
            difference: layers.clone().map(|j| 0.5 * (a(j) - b(j))).collect(),
            axial: layers
                .map(|j| if layout.axial { columns.column(layout.column_axial(j))[sample] } else { 0.0 })
                .collect(),
        }
    }

    /// Σ of rows times weights.
    pub(crate) fn blend<'a>(parts: impl Iterator<Item = (&'a Self, f64)> + Clone, layers: usize) -> Self {
        let sum = |of: fn(&Self) -> &[f64]| {
            (0..layers).map(|j| parts.clone().map(|(row, y)| y * of(row)[j]).sum()).collect::<Vec<f64>>()
        };
        Self {
            constant: parts.clone().map(|(row, y)| y * row.constant).sum(),
            mean: sum(|r| &r.mean),
            difference: sum(|r| &r.difference),
            axial: sum(|r| &r.axial),
        }
    }

    /// The same row with S shifted by a constant, which changes no pattern's value because Σ w_j = 0: zero in the mean
    /// over the `open` innermost layers, or over all if none is open.
    pub(crate) fn shifted(&self, open: usize) -> Self {
        let count = if open == 0 { self.mean.len() } else { open };
        let shift = self.mean[..count].iter().sum::<f64>() / count as f64;
        Self { mean: self.mean.iter().map(|s| s - shift).collect(), ..self.clone() }
    }

    /// For each kind of term (mean, and where asked for difference and axial) the factor of each layer's place, with
    /// lengths along the fibre in units of the innermost layer's.
    pub(crate) fn factors(&self, lengths_m: &[f64], has_difference: bool, has_axial: bool) -> Vec<Vec<f64>> {
        let unit_m = lengths_m[0];
        let times = |of: &[f64]| of.iter().zip(lengths_m).map(|(v, l)| v * l * unit_m).collect::<Vec<f64>>();
        let mut terms = vec![times(&self.mean)];
        if has_difference {
            terms.push(times(&self.difference));
        }
        if has_axial {
            terms.push(self.axial.iter().zip(lengths_m).map(|(x, l)| 2.0 * x * l * l).collect());
        }
        terms
    }

    /// No term of the row can be larger than this; rounding is judged against it.
    pub(crate) fn scale(&self, lengths_m: &[f64]) -> f64 {
        let length_m: f64 = lengths_m.iter().sum();
        let layers = self.mean.iter().zip(&self.difference).zip(&self.axial).zip(lengths_m);
        let sum: f64 = layers.map(|(((s, d), x), l)| l * length_m * (s.abs() + d.abs()) + 2.0 * l * l * x.abs()).sum();
        self.constant.abs() + sum
    }

    /// Σ_j (D_j u_j + X_j x_j) of any pattern lies in this range.
    ///
    /// u_j is −l_j |2 z̄_j − L| but for the one segment that may straddle the middle. It is taken at the places of
    /// equally long segments; the lengths' deviations from their mean move any place by less than their sum.
    pub(crate) fn curved_range(&self, lengths_m: &[f64]) -> Range {
        let layers = lengths_m.len();
        let axial: f64 = self.axial.iter().zip(lengths_m).map(|(x, l)| 2.0 * l * l * x.abs()).sum();
        let mut factors: Vec<f64> = self.difference.iter().zip(lengths_m).map(|(d, l)| d * l).collect();
        let slack: f64 = axial + curved_slack(&factors, lengths_m, layers);
        let mean_m = lengths_m.iter().sum::<f64>() / layers as f64;
        let mut places: Vec<f64> =
            (0..layers).map(|p| -mean_m * (2.0 * p as f64 + 1.0 - layers as f64).abs()).collect();
        factors.sort_by(f64::total_cmp);
        places.sort_by(f64::total_cmp);
        let high: f64 = factors.iter().zip(&places).map(|(f, u)| f * u).sum();
        let low: f64 = factors.iter().rev().zip(&places).map(|(f, u)| f * u).sum();
        Range { low: low - slack, high: high + slack }
    }
}

/// How far Σ D_j u_j may be from its value with the `open` innermost layers as long as their mean; `factors` are D_j l_j.
pub(crate) fn curved_slack(factors: &[f64], lengths_m: &[f64], open: usize) -> f64 {
    let deviation_m: f64 = deviations_m(lengths_m, open).iter().map(|d| d.abs()).sum();
    let equal = lengths_m.iter().all(|l| *l == lengths_m[0]);
    let straddle = factors.iter().zip(lengths_m).map(|(f, l)| f.abs() * l).fold(0.0, f64::max);
    let sum: f64 = factors.iter().map(|f| f.abs()).sum();
    // With an even number of equal segments none straddles the middle.
    if equal { 0.0 } else { deviation_m * sum + 0.5 * straddle }
}

/// The lengths of the innermost layers less their mean.
pub(crate) fn deviations_m(lengths_m: &[f64], open: usize) -> Vec<f64> {
    let mean_m = lengths_m[..open].iter().sum::<f64>() / open.max(1) as f64;
    lengths_m[..open].iter().map(|l| l - mean_m).collect()
}
