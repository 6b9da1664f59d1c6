//! The value of a matrix game: the weights on rows that make the smallest column as large as possible.
//!
//! ```text
//! v = max over y of min over q of Σ_s y_s M_sq,   y ≥ 0, Σ y = 1
//! ```
//!
//! Solved as the linear programme of the other player, whose slack basis is feasible once the payoffs are shifted above
//! zero; the row weights are its dual values. The games here have a dozen rows and columns, so a dense tableau is
//! computed anew each time. Whatever comes out is a valid choice of weights: rounding, or the bound on pivots, can make
//! it worse but not wrong.
//!
//! # Source
//! Dantzig, "A proof of the equivalence of the programming problem and the game problem" (1951).

/// Pivots after which the weights at hand are taken.
const MOST_PIVOTS: usize = 200;

const TINY: f64 = 1e-12;

/// Both players' weights, and what the row player can count on.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Solution {
    pub(crate) rows: Vec<f64>,
    pub(crate) columns: Vec<f64>,
    pub(crate) value: f64,
}

/// Solves a game given column by column; there must be a row and a column.
pub(crate) fn solve(columns: &[Vec<f64>]) -> Solution {
    let (m, n) = (columns[0].len(), columns.len());
    let smallest = columns.iter().flatten().copied().fold(f64::INFINITY, f64::min);
    let largest = columns.iter().flatten().copied().fold(f64::NEG_INFINITY, f64::max);
    let scale = (largest - smallest).max(f64::MIN_POSITIVE);
    let payoff = |q: usize, s: usize| (columns[q][s] - smallest) / scale + 1.0;
    // Maximise Σ u with M u ≤ 1: unknowns, slacks, right-hand side; the last row holds the reduced costs.
    let width = n + m + 1;
    let mut tableau = vec![0.0; (m + 1) * width];
    for s in 0..m {
        for q in 0..n {
            tableau[s * width + q] = payoff(q, s);
        }
        tableau[s * width + n + s] = 1.0;
        tableau[s * width + width - 1] = 1.0;
    }
    tableau[m * width..m * width + n].fill(-1.0);
    let mut basis: Vec<usize> = (n..n + m).collect();
    for pivot in 0..MOST_PIVOTS {
        let costs = &tableau[m * width..m * width + n + m];
        // The steepest at first; the first of all later, which cannot cycle.
        let entering = if pivot < MOST_PIVOTS / 2 {
            (0..n + m).filter(|&k| costs[k] < -TINY).min_by(|&a, &b| costs[a].total_cmp(&costs[b]))
        } else {
            (0..n + m).find(|&k| costs[k] < -TINY)
        };
        let Some(entering) = entering else { break };
        let ratio = |s: usize| tableau[s * width + width - 1] / tableau[s * width + entering];
        let leaving = (0..m)
            .filter(|&s| tableau[s * width + entering] > TINY)
            .min_by(|&a, &b| ratio(a).total_cmp(&ratio(b)).then(basis[a].cmp(&basis[b])));
        let Some(leaving) = leaving else { break };
        let factor = 1.0 / tableau[leaving * width + entering];
        let pivot_row: Vec<f64> = tableau[leaving * width..(leaving + 1) * width].iter().map(|v| v * factor).collect();
        for (s, row) in tableau.chunks_exact_mut(width).enumerate() {
            if s == leaving {
                row.copy_from_slice(&pivot_row);
            } else if row[entering] != 0.0 {
                let by = row[entering];
                for (v, p) in row.iter_mut().zip(&pivot_row) {
                    *v -= by * p;
                }
            }
        }
        basis[leaving] = entering;
    }
    let duals = &tableau[m * width + n..m * width + n + m];
    let mut column_weights = vec![0.0; n];
    for (s, &b) in basis.iter().enumerate() {
        if b < n {
            column_weights[b] = tableau[s * width + width - 1];
        }
    }
    let rows = shares(duals);
    let columns_shares = shares(&column_weights);
    let value = (0..m)
        .map(|s| columns.iter().zip(&columns_shares).map(|(column, share)| share * column[s]).sum::<f64>())
        .fold(f64::NEG_INFINITY, f64::max);
    Solution { rows, columns: columns_shares, value }
}

/// Non-negative, with the sum one.
fn shares(weights: &[f64]) -> Vec<f64> {
    let sum: f64 = weights.iter().map(|w| w.max(0.0)).sum();
    if sum > 0.0 {
        weights.iter().map(|w| w.max(0.0) / sum).collect()
    } else {
        vec![1.0 / weights.len() as f64; weights.len()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_players_are_certain_of_the_same_value_in_any_game() {
        for (m, n) in [(1, 1), (1, 5), (5, 1), (3, 3), (7, 12), (12, 30)] {
            let columns: Vec<Vec<f64>> = (0..n)
                .map(|q| (0..m).map(|s| 1e-6 * ((17 * q + 5 * s * s + q * s) as f64 * 0.7).sin()).collect())
                .collect();
            let Solution { rows, columns: shares, value } = solve(&columns);
            assert!((rows.iter().sum::<f64>() - 1.0).abs() < 1e-12 && rows.iter().all(|y| *y >= 0.0));
            let least = columns
                .iter()
                .map(|c| c.iter().zip(&rows).map(|(v, y)| v * y).sum::<f64>())
                .fold(f64::INFINITY, f64::min);
            let most = (0..m)
                .map(|s| columns.iter().zip(&shares).map(|(c, x)| c[s] * x).sum::<f64>())
                .fold(f64::NEG_INFINITY, f64::max);
            assert!((least - value).abs() < 1e-15 && (most - value).abs() < 1e-15, "{m} {n}: {least} {most} {value}");
        }
    }

    #[test]
    fn the_even_game_is_won_by_nobody() {
        let Solution { rows, value, .. } = solve(&[vec![1.0, -1.0], vec![-1.0, 1.0]]);
        assert!(value.abs() < 1e-15 && (rows[0] - 0.5).abs() < 1e-15);
    }
}
