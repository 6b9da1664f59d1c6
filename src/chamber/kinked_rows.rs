//! Kinks of the air's slope in the rows of a record: where each may be, or at its time.

use std::ops::Range;

use super::row::{Move, Row};
use super::series::{SHORT_ROW_S, Series, TimeStep, place_of_step};

/// A change of the air's slope that stands out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bend {
    pub(crate) time_s: f64,
    pub(crate) slope_change_k_per_s: f64,
}

/// Rows to each side of where readings have a kink in which it may be: a lagging sensor shows it late.
const REACH_ROWS: usize = 5;

impl Series {
    /// The rows of each kink, and its variance.
    fn rows_of_kinks(&self) -> Vec<(Range<usize>, f64)> {
        let mut found: Vec<(Range<usize>, f64)> = Vec::new();
        for (k, row) in self.rows.iter().enumerate().skip(1).filter(|(_, row)| row.kink > 0.0) {
            match found.last_mut() {
                Some((rows, size)) if rows.end == k && *size == row.kink => rows.end = k + 1,
                _ => found.push((k..k + 1, row.kink)),
            }
        }
        found
    }

    /// Kinks that are at their times; None where one may be in several rows.
    pub(super) fn timed_kinks(&self) -> Option<Vec<Bend>> {
        let found = self.rows_of_kinks();
        let bend = |(rows, size): (Range<usize>, f64)| Bend {
            time_s: self.kink_s(rows.start),
            slope_change_k_per_s: size.sqrt(),
        };
        let is_timed = !found.is_empty() && found.iter().all(|(rows, _)| rows.len() == 1);
        is_timed.then(|| found.into_iter().map(bend).collect())
    }

    /// Lets each kink be anywhere within reach of where it was found and nearer than any other; the rows of each.
    pub(super) fn widen_kinks(&mut self) -> Vec<Range<usize>> {
        let found = self.rows_of_kinks();
        let middles: Vec<usize> = found.iter().map(|(rows, _)| usize::midpoint(rows.start, rows.end - 1)).collect();
        let windows = middles.iter().enumerate().map(|(place, &middle)| {
            let from = if place > 0 { usize::midpoint(middles[place - 1], middle) + 1 } else { 1 };
            let to = middles.get(place + 1).map_or(self.rows.len(), |next| usize::midpoint(middle, *next) + 1);
            from.max(middle.saturating_sub(REACH_ROWS))..to.min(middle + REACH_ROWS + 1)
        });
        let windows: Vec<Range<usize>> = windows.collect();
        for (window, (_, size)) in windows.iter().zip(&found) {
            self.rows[window.clone()].iter_mut().for_each(|row| row.kink = *size);
        }
        windows
    }

    /// The row in whose steps a time lies.
    pub(super) fn row_of(&self, time_s: f64) -> usize {
        self.times_s.partition_point(|t| *t <= time_s).clamp(1, self.rows.len() - 1)
    }

    /// The rows that a time may lie in, give or take, and the one before them.
    pub(super) fn rows_about(&self, time_s: f64, reach_s: f64) -> Range<usize> {
        self.row_of(time_s - reach_s) - 1..self.row_of(time_s + reach_s) + 1
    }

    /// The time of a row's kink: the middle of where it may be.
    pub(super) fn kink_s(&self, row: usize) -> f64 {
        let mut at_s = self.times_s[row.max(1) - 1];
        if !self.rows[row].is_kinked_within() {
            return at_s;
        }
        let (mut sum_s, mut count) = (0.0, 0.0);
        for movement in &self.rows[row].moves {
            match movement {
                Move::Step(step) => at_s += self.steps[*step as usize].length_s,
                Move::Keep(_) => {}
                Move::Kink(place) => {
                    sum_s += at_s - self.after_kink_s(*place);
                    count += 1.0;
                }
            }
        }
        sum_s / count
    }

    /// Lets the air bend nowhere but at kinks.
    pub(super) fn take_out_bends(&mut self) {
        self.rows.iter_mut().for_each(|row| row.bend = 0.0);
    }

    /// Takes all kinks out, and the places within rows where they may be.
    pub(super) fn straighten(&mut self) {
        for row in &mut self.rows {
            row.kink = 0.0;
            row.moves.retain(|m| !matches!(m, Move::Kink(_)));
        }
        (self.kinks, self.after_kinks) = (0, Vec::new());
    }

    /// Lets rows have a kink of this size, wherever it is in them: in a row that is long beside what the coil's outer layers
    /// take to follow, a rate tells when.
    pub(super) fn kink_within(&mut self, rows: Range<usize>, size_k_per_s: f64) {
        for k in rows {
            self.rows[k].kink += size_k_per_s * size_k_per_s;
            if self.rows[k].is_kinked_within() {
                continue;
            }
            let mut moves = Vec::new();
            for movement in self.rows[k].moves.clone() {
                moves.push(movement);
                let Move::Step(step) = movement else { continue };
                let whole = self.steps[step as usize];
                let parts = (whole.length_s / SHORT_ROW_S).ceil().max(1.0);
                for part in 0..parts as usize {
                    let length_s = whole.length_s * (1.0 - part as f64 / parts);
                    moves.push(self.kink_before(TimeStep { length_s, ..whole }));
                }
            }
            // One place alone is where the steps begin.
            if moves.iter().filter(|m| matches!(m, Move::Kink(_))).count() > 1 {
                self.rows[k].moves = moves;
            }
        }
    }

    /// From one of the kinks to the end of the step that it is within \[s\].
    pub(super) fn after_kink_s(&self, place: u16) -> f64 {
        self.after_kinks[place as usize].length_s
    }

    /// A kink so long before the end of a step.
    pub(super) fn kink_before(&mut self, end: TimeStep) -> Move {
        Move::Kink(place_of_step(&mut self.after_kinks, end))
    }

    /// Kinks at these times; of rows that have none so far.
    pub(super) fn with_kinks(&self, kinks: &[Bend]) -> Series {
        let mut with = self.clone();
        (with.rows, with.after_kinks) = self.rows_with_kinks(0..self.rows.len(), kinks);
        with
    }

    /// Some of the rows with those of kinks at these times that are in them, and the times from these kinks to the ends of their steps.
    pub(super) fn rows_with_kinks(&self, within: Range<usize>, kinks: &[Bend]) -> (Vec<Row>, Vec<TimeStep>) {
        let mut rows = self.rows[within.clone()].to_vec();
        let mut after_kinks = self.after_kinks.clone();
        for kink in kinks {
            let place = self.row_of(kink.time_s);
            if !within.contains(&place) {
                continue;
            }
            let row = &mut rows[place - within.start];
            let mut left_s = kink.time_s - self.times_s[place - 1];
            row.kink += kink.slope_change_k_per_s.powi(2);
            if left_s <= 0.0 || row.is_kinked_within() {
                continue;
            }
            let last = row.moves.iter().rposition(|m| matches!(m, Move::Step(_)));
            for (place, movement) in row.moves.clone().into_iter().enumerate() {
                let Move::Step(step) = movement else { continue };
                let whole = self.steps[step as usize];
                let after_s = whole.length_s - left_s;
                if after_s > 0.0 || Some(place) == last {
                    let end = TimeStep { length_s: after_s.max(0.0), ..whole };
                    row.moves.insert(place + 1, Move::Kink(place_of_step(&mut after_kinks, end)));
                    break;
                }
                left_s = -after_s;
            }
        }
        (rows, after_kinks)
    }
}
