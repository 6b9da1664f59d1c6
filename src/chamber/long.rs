//! Long records: the chamber's numbers are found on the stretch that moves most.

use std::ops::Range;

use super::Chamber;

/// A change of temperature is told from noise over so many rows.
const APART: usize = 50;
/// Stretches that are compared overlap by all but this share of their length.
const STRIDE: usize = 8;

impl Chamber<'_> {
    /// The record's rows in that stretch of `most` rows of the chamber in which the readings move most; the whole record where
    /// it is no longer.
    pub fn busiest(&self, record: usize, most: usize) -> Range<usize> {
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
}
