//! Whether an effect explains data that it was not fitted to.

use nalgebra::{DMatrix, DVector};

use super::evidence::{Role, sum_of_squares};
use super::hypothesis::{Hypothesis, Trial};

/// Blocks in time, over all fitted rows, where no record was held out.
const BLOCKS: usize = 6;

/// By how much χ² of unseen data is smaller with a hypothesis than without one of its members.
pub(super) fn confirmation(trial: &Trial, with: &Hypothesis, without: &Hypothesis) -> Option<f64> {
    if trial.evidence.rows(Role::Holdout) > 0 {
        Some(without.unseen - with.unseen)
    } else {
        Some(left_out(trial, without)? - left_out(trial, with)?)
    }
}

/// Σ over blocks of the χ² of a block under the fit to all others, linear about the fit to all.
fn left_out(trial: &Trial, hypothesis: &Hypothesis) -> Option<f64> {
    let columns = trial.derivatives(hypothesis)?;
    let rows = hypothesis.residuals.len();
    let mut total = 0.0;
    for block in 0..BLOCKS {
        let inside = rows * block / BLOCKS..rows * (block + 1) / BLOCKS;
        let own = &hypothesis.residuals[inside.clone()];
        if columns.is_empty() {
            total += sum_of_squares(own);
            continue;
        }
        let outside = |i: usize| !inside.contains(&i);
        let count = columns.len();
        let product = |a: &[f64], b: &[f64]| -> f64 { (0..rows).filter(|&i| outside(i)).map(|i| a[i] * b[i]).sum() };
        let normal = DMatrix::from_fn(count, count, |i, j| product(&columns[i], &columns[j]));
        let right = DVector::from_fn(count, |i, _| -product(&columns[i], &hypothesis.residuals));
        // What the other blocks do not determine stays as it is.
        let step = normal.svd(true, true).solve(&right, 1e-12).ok()?;
        total += inside
            .map(|i| (hypothesis.residuals[i] + (0..count).map(|k| columns[k][i] * step[k]).sum::<f64>()).powi(2))
            .sum::<f64>();
    }
    Some(total)
}
