//! A compensator that knows no coil and no line: ridge regression on what a rate may follow of a temperature.
//!
//! ```text
//! R_c = β_0 + Σ_i β_i x_i,   β = argmin Σ (R − R_c)² + λ Σ_i (β_i s_i)²
//! ```
//!
//! | symbol | meaning | in code |
//! |---|---|---|
//! | x_i | lagged temperatures, powers, slopes, warming up, all of the past only | [`crate::metrics::thermal`] |
//! | s_i, λ | the column's root mean square; the strength that predicts blocks left out best | `LearnedCoefficients::fit` |
//!
//! Each eighth of the record (of several records each whole one) is predicted from the others for every λ; the least error of these is
//! what the compensator is worth on such a day, beside what it leaves of what it was fitted to: where the two differ, it only fits.
//!
//! # Source
//! Hoerl and Kennard, Technometrics 12 (1970) 55; cross-validation by blocks: Roberts et al., Ecography 40 (2017) 913.

use std::collections::VecDeque;

use nalgebra::{DMatrix, DVector};

use super::CompensateError;
use crate::metrics::thermal::{COLUMNS, ThermalColumns};
use crate::record::{Record, RecordRow};

/// One record is left out by so many blocks in turn.
const BLOCKS: usize = 8;
/// λ of the mean square of a column, tried in turn: a decade apart.
const STRENGTHS: [f64; 9] = [1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2];
/// A block needs more rows than there are columns.
const LEAST_ROWS: usize = BLOCKS * 2 * (COLUMNS + 1);
/// In-sample and cross-validated errors further apart than this factor: it only fits.
pub(crate) const ONLY_FITS: f64 = 1.5;
/// Steps this many times the usual one begin anew.
pub(crate) const LONGEST_GAP: f64 = 1000.0;

/// Ready for any record of the same gyro.
#[derive(Debug, Clone, PartialEq)]
pub struct LearnedCoefficients {
    /// β_0, then one a column.
    pub(crate) coefficients: Vec<f64>,
    /// Of the record that it was fitted to, of several the longest; the shortest lag follows it.
    pub(crate) interval_s: f64,
    /// Root mean square of what it leaves of what it was fitted to, and of the blocks (or whole records) that it was not shown.
    pub(crate) left_rad_per_s: f64,
    pub(crate) cross_validated_rad_per_s: f64,
}

/// Normal equations of some rows.
#[derive(Clone)]
struct Sums {
    n: f64,
    xx: DMatrix<f64>,
    xy: DVector<f64>,
    yy: f64,
}

impl Sums {
    fn new() -> Self {
        Self { n: 0.0, xx: DMatrix::zeros(COLUMNS + 1, COLUMNS + 1), xy: DVector::zeros(COLUMNS + 1), yy: 0.0 }
    }

    fn add(&mut self, x: &DVector<f64>, y: f64) {
        self.n += 1.0;
        self.xx.ger(1.0, x, x, 1.0);
        self.xy.axpy(y, x, 1.0);
        self.yy += y * y;
    }

    fn with(&self, other: &Sums, sign: f64) -> Self {
        Self {
            n: self.n + sign * other.n,
            xx: &self.xx + &other.xx * sign,
            xy: &self.xy + &other.xy * sign,
            yy: self.yy + sign * other.yy,
        }
    }

    fn left(&self, beta: &DVector<f64>) -> f64 {
        (self.yy - 2.0 * beta.dot(&self.xy) + beta.dot(&(&self.xx * beta))).max(0.0)
    }

    /// A column that does not vary gets no coefficient.
    fn solve(&self, strength: f64) -> Option<DVector<f64>> {
        let mut matrix = self.xx.clone();
        for i in 1..=COLUMNS {
            let square = self.xx[(i, i)];
            matrix[(i, i)] += if square > 0.0 { strength * square } else { 1.0 };
        }
        Some(matrix.cholesky()?.solve(&self.xy))
    }
}

impl LearnedCoefficients {
    /// To some records together.
    ///
    /// # Errors
    /// Records too short to leave parts of them out.
    pub fn fit(records: &[&Record]) -> Result<Self, CompensateError> {
        let rows = records.iter().map(|record| record.rows()).sum();
        if rows < LEAST_ROWS {
            return Err(CompensateError::TooFew { needed: LEAST_ROWS, found: rows });
        }
        let interval_s = records.iter().map(|record| record.interval_s()).fold(0.0, f64::max);
        // About the mean, so that β_0 does not need its digits.
        let level = records.iter().flat_map(|record| record.rate_rad_per_s()).sum::<f64>() / rows as f64;
        let is_one = records.len() == 1;
        let mut blocks = vec![Sums::new(); if is_one { BLOCKS } else { records.len() }];
        for (place, record) in records.iter().enumerate() {
            let mut follower = Follower::default();
            for (i, row) in record.each_row().enumerate() {
                let x = follower.columns(row.time_s, row.temperature_k, interval_s);
                let block = if is_one { i * BLOCKS / rows } else { place };
                blocks[block].add(&x, row.rate_rad_per_s - level);
            }
        }
        let all = blocks.iter().fold(Sums::new(), |sum, block| sum.with(block, 1.0));
        let judged = |strength: f64| -> Option<f64> {
            blocks.iter().map(|block| Some(block.left(&all.with(block, -1.0).solve(strength)?))).sum()
        };
        let best = STRENGTHS
            .iter()
            .filter_map(|s| Some((judged(*s)?, *s)))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .and_then(|(error, strength)| Some((error, all.solve(strength)?)));
        let Some((error, beta)) = best else {
            return Err(CompensateError::TooFew { needed: LEAST_ROWS, found: rows });
        };
        let left_rad_per_s = (all.left(&beta) / all.n).sqrt();
        let mut coefficients: Vec<f64> = beta.iter().copied().collect();
        coefficients[0] += level;
        Ok(Self { coefficients, interval_s, left_rad_per_s, cross_validated_rad_per_s: (error / all.n).sqrt() })
    }

    /// Whether it does clearly worse on what it was not shown.
    pub(crate) fn only_fits(&self) -> bool {
        self.cross_validated_rad_per_s > ONLY_FITS * self.left_rad_per_s
    }

    fn bias_rad_per_s(&self, x: &DVector<f64>) -> f64 {
        self.coefficients.iter().zip(x.iter()).map(|(c, x)| c * x).sum()
    }
}

/// The columns of one temperature as it comes.
#[derive(Debug, Clone, Default)]
pub(super) struct Follower {
    columns: Option<ThermalColumns>,
    last_s: f64,
    /// The latest biases, the newest last.
    recent: VecDeque<f64>,
}

impl Follower {
    fn columns(&mut self, time_s: f64, temperature_k: f64, interval_s: f64) -> DVector<f64> {
        let row = RecordRow { time_s, temperature_k, rate_rad_per_s: 0.0, table_rad_per_s: None };
        if time_s - self.last_s > LONGEST_GAP * interval_s {
            self.columns = None;
        }
        self.last_s = time_s;
        let columns = self.columns.get_or_insert_with(|| ThermalColumns::new(row, interval_s));
        columns.advance(row);
        let mut x = DVector::from_element(COLUMNS + 1, 1.0);
        columns.write(&mut x.as_mut_slice()[1..]);
        x
    }

    /// A reading that is missing repeats the bias; `most` of them are kept.
    pub(super) fn step(&mut self, learned: &LearnedCoefficients, time_s: f64, temperature_k: Option<f64>, most: usize) {
        let bias = match temperature_k {
            Some(temperature_k) => learned.bias_rad_per_s(&self.columns(time_s, temperature_k, learned.interval_s)),
            None => self.recent.back().copied().unwrap_or(learned.coefficients[0]),
        };
        self.recent.push_back(bias);
        if self.recent.len() > most {
            self.recent.pop_front();
        }
    }

    /// `lag` steps ago.
    pub(super) fn bias_rad_per_s(&self, lag: usize) -> Option<f64> {
        self.recent.len().checked_sub(lag + 1).map(|place| self.recent[place])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A lagged temperature that cycles, and a rate that follows its change.
    fn day(phase: f64) -> Record {
        let times_s: Vec<f64> = (0..6000).map(|i| 10.0 * f64::from(i)).collect();
        let temperature_k: Vec<f64> = times_s.iter().map(|t| 298.0 + 15.0 * (t / 1500.0 + phase).sin()).collect();
        let rate = times_s
            .iter()
            .enumerate()
            .map(|(i, t)| {
                1e-6 + 1e-5 * 0.01 * (t / 1500.0 + phase - 0.2).cos() + 1e-9 * ((i * 7919 % 101) as f64 - 50.0)
            })
            .collect();
        Record::new("day", times_s, temperature_k, rate).unwrap()
    }

    #[test]
    fn a_learned_day_compensates_another_one_and_says_what_it_is_worth() {
        let learned = LearnedCoefficients::fit(&[&day(0.0)]).unwrap();
        println!("left {:e}, cross-validated {:e}", learned.left_rad_per_s, learned.cross_validated_rad_per_s);
        let other = day(0.0);
        let mut follower = Follower::default();
        let left: Vec<f64> = other
            .each_row()
            .map(|row| {
                follower.step(&learned, row.time_s, Some(row.temperature_k), 3);
                row.rate_rad_per_s - follower.bias_rad_per_s(0).unwrap()
            })
            .collect();
        let rms = (left.iter().map(|l| l * l).sum::<f64>() / left.len() as f64).sqrt();
        // The noise of one row: uniform over 101 steps.
        assert!(rms < 1.1 * 2.92e-8, "{rms:e}");
        // What it was not shown is followed worse than what it was, and that is what is said.
        assert!(learned.cross_validated_rad_per_s > learned.left_rad_per_s);
    }

    #[test]
    fn a_record_too_short_to_leave_parts_out_is_refused() {
        let short = Record::new("x", vec![0.0, 1.0, 2.0], vec![300.0; 3], vec![0.0; 3]).unwrap();
        assert!(matches!(LearnedCoefficients::fit(&[&short]), Err(CompensateError::TooFew { .. })));
    }
}
