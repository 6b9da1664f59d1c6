//! The likelihood of a record of which a few rows are changed, by a pass over those: what all rows behind them say is kept.
//!
//! ```text
//! ln p(y_b… | x + δ, P + Δ) = ln p(y_b… | x, P) + r·δ − ½ δᵀNδ − ½ ln det(1 + N Δ) + ½ r'ᵀ Δ (1 + N Δ)⁻¹ r',   r' = r − N δ
//! ```
//!
//! x and P are what the rows before a row b foretell of its states, as they were; r and N are what the backward pass has there of all
//! measurements from b on, and say all of them by what the states are when b begins. That is exact, but for gains that the passes have frozen.
//!
//! # Source
//! de Jong and Penzer, J. Am. Stat. Assoc. 93 (1998) 796, whose shocks are changes of x and P at one row.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::backward::{Visited, backward};
use super::filter::{self, MEASURED, Row, System, Trace, Values};

/// A record as it was, of which some rows will be changed.
pub(super) struct Elsewhere<'a> {
    system: &'a System,
    values: &'a Values,
    trace: Trace,
    stretches: Vec<Stretch>,
}

/// Rows that may be changed, but for how the first begins.
struct Stretch {
    rows: Range<usize>,
    /// r and N where the row behind begins; None where there is none.
    behind: Option<(DVector<f64>, DMatrix<f64>)>,
}

impl<'a> Elsewhere<'a> {
    /// `stretches`: rows that may be changed together, but for what happens up to the first of each.
    pub(super) fn new(system: &'a System, rows: &[Row], values: &'a Values, stretches: Vec<Range<usize>>) -> Self {
        let trace = filter::forward(system, rows, values, true);
        let mut stretches: Vec<Stretch> = stretches.into_iter().map(|rows| Stretch { rows, behind: None }).collect();
        let n = system.size;
        backward(system, rows, &trace, &mut |visited| {
            let Visited::Row { row, r, information } = visited else { return };
            for stretch in stretches.iter_mut().filter(|s| s.rows.end == row) {
                let lines = information.lines().flatten().copied();
                stretch.behind = Some((DVector::from_column_slice(r), DMatrix::from_row_iterator(n, n, lines)));
            }
        });
        Self { system, values, trace, stretches }
    }

    /// The rows of a stretch and the one behind, up to which something may be changed.
    pub(super) fn rows_of(&self, stretch: usize) -> Range<usize> {
        let Stretch { rows, behind } = &self.stretches[stretch];
        rows.start..if behind.is_some() { rows.end + 1 } else { rows.end }
    }

    /// The log likelihood with a stretch's rows ([`Self::rows_of`]) changed to `own`, less that of all rows elsewhere as they were.
    pub(super) fn log_likelihood(&self, stretch: usize, mut own: Vec<Row>, kinks: Vec<Vec<f64>>) -> f64 {
        let Stretch { rows: changed, behind } = &self.stretches[stretch];
        let whole = self.rows_of(stretch);
        (own[0].moves, own[0].kink) = (Vec::new(), 0.0);
        if let (Some(_), Some(last)) = (behind, own.last_mut()) {
            last.measured = [None; MEASURED];
        }
        let (mean, covariance) = (self.mean(whole.start).to_vec(), self.covariance(whole.start).to_vec());
        let system = System { mean, covariance, kinks, ..self.system.clone() };
        let values =
            Values { of: self.values.of.each_ref().map(|v| v.get(whole.clone()).unwrap_or_default().to_vec()) };
        let there = filter::forward(&system, &own, &values, true);
        let (Some((r, information)), Some(last)) = (behind, there.gains.last()) else { return there.log_likelihood };
        let n = system.size;
        let mean = &there.means[there.means.len() - n..];
        let moved = DVector::from_column_slice(mean) - DVector::from_column_slice(self.mean(changed.end));
        let square = |flat: &[f64]| DMatrix::from_row_slice(n, n, flat);
        let wider = square(&last.covariance) - square(self.covariance(changed.end));
        let rest = r - information * &moved;
        let decomposed = (DMatrix::identity(n, n) + information * &wider).lu();
        let determinant = decomposed.determinant();
        let Some(solved) = decomposed.solve(&rest) else { return f64::NEG_INFINITY };
        if !(determinant > 0.0) {
            return f64::NEG_INFINITY;
        }
        let by_mean = 0.5 * (r + &rest).dot(&moved);
        there.log_likelihood + by_mean - 0.5 * determinant.ln() + 0.5 * rest.dot(&(wider * solved))
    }

    /// What is foretold of a row's states.
    fn mean(&self, row: usize) -> &[f64] {
        &self.trace.means[row * self.system.size..(row + 1) * self.system.size]
    }

    fn covariance(&self, row: usize) -> &[f64] {
        &self.trace.gains[self.trace.gains_of[row] as usize].covariance
    }
}
