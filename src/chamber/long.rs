//! Long records: the chamber's numbers are found on the stretch that moves most, and hold for the whole.

use std::ops::Range;

use super::fit::{Fit, Wanted};
use super::shocks::GROSS_ROUNDS;
use super::{Chamber, ChamberError};

/// Numbers of a chamber are fitted to at most so many of its rows: a day of half-minute rows, more than they need.
pub(crate) const MOST_ROWS_FITTED: usize = 4000;
/// A change of temperature is told from noise over so many rows.
const APART: usize = 50;
/// Stretches that are compared overlap by all but this share of their length.
const STRIDE: usize = 8;

impl Chamber<'_> {
    /// The record's rows in that stretch of `most` rows of the chamber in which the readings move most; the whole record where
    /// it is no longer.
    pub(crate) fn busiest(&self, record: usize, most: usize) -> Range<usize> {
        let series = &self.observed[record].series;
        let rows = series.rows.len();
        let whole = |from: usize, to: usize| series.spans[from].0..series.spans[to - 1].1 + 1;
        if rows <= most {
            return whole(0, rows);
        }
        let readings = &series.values[0];
        let moved = |k: usize| {
            let change = readings[k + APART] - readings[k];
            if change.is_finite() { change.abs() } else { 0.0 }
        };
        let mut sums = vec![0.0];
        for k in 0..rows - APART {
            sums.push(sums[k] + moved(k));
        }
        let starts = (0..rows - most).step_by((most / STRIDE).max(1)).chain([rows - most]);
        let sum = |from: usize| sums[(from + most - APART).min(sums.len() - 1)] - sums[from];
        let best = starts.reduce(|a, b| if sum(b) > sum(a) { b } else { a }).unwrap_or(0);
        whole(best, best + most)
    }

    /// Takes over numbers that were found on another stretch of the first record: what is a gross error under them is left out,
    /// and kinks are found if that stretch had them; nothing is fitted.
    ///
    /// # Errors
    /// A model that cannot be solved.
    pub(crate) fn adopt(&mut self, stretch: &Chamber, found: &Fit) -> Result<Fit, ChamberError> {
        let mut fit = found.of_record(found.records[0]);
        self.observed[0].series.approaches = stretch.observed[0].series.approaches;
        self.observed[0].series.delays = stretch.observed[0].series.delays;
        self.observed[0].series.controlled = stretch.observed[0].series.controlled;
        let smooth = |chamber: &Self, fit: &mut Fit| {
            let (assumed, numbers) = (fit.assumed.clone(), fit.numbers.clone());
            chamber.smooth_courses(&assumed, &numbers, &[0], &mut fit.courses, Wanted::Everywhere)
        };
        smooth(self, &mut fit)?;
        for _ in 0..GROSS_ROUNDS {
            let gross = self.gross(&fit, 0)?;
            if gross.is_empty() {
                break;
            }
            gross.iter().for_each(|&(row, m)| self.observed[0].series.leave_out(row, m));
        }
        let has_kinks = stretch.observed[0].series.rows.iter().any(|row| row.kink > 0.0);
        if has_kinks {
            let bends = stretch.observed[0].series.rows.iter().any(|row| row.bend > 0.0);
            self.place_kinks(&fit, 0, bends)?;
        }
        smooth(self, &mut fit)?;
        Ok(fit)
    }
}
