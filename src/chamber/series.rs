//! A record as rows of a filter: averaged to the pack's own time scale, gross errors and gaps left out.
//!
//! ```text
//! mean of b readings   = those of the window's middle: interpolated between its two ends
//! mean of b rates      = (c·x(t) − c·x(t − b Δ))/(b Δ), exactly, where each is itself a mean over Δ
//! ```

use super::filter::{AMBIENT, MEASURED, Move, RATE, Row};
use super::grid::{GRIDDED, resolution, run_lengths};
use super::row::Film;
use crate::numeric::noise::white_noise;
use crate::numeric::statistics::median;
use crate::record::Record;

/// What the rows of one record are, before any number of the model is known.
#[derive(Debug, Clone)]
pub(super) struct Series {
    /// Ends of the windows [s].
    pub(crate) times_s: Vec<f64>,
    /// Readings in K above `reference_k` (sensor, bore, air), and the rate in rad/s; NaN where there is none.
    pub(crate) values: [Vec<f64>; MEASURED],
    pub(crate) reference_k: f64,
    /// The record's further columns as a row's rate sees them.
    pub(crate) columns: Vec<Vec<f64>>,
    /// One entry a row; `Row::measured` holds places of [`Self::shapes`] times measured.
    pub(crate) rows: Vec<Row>,
    /// Distinct steps of time.
    pub(super) steps: Vec<TimeStep>,
    /// Times from kinks to the ends of the steps that they are within.
    pub(super) after_kinks: Vec<TimeStep>,
    /// Distinct ways in which a row is measured.
    pub(crate) shapes: Vec<Shape>,
    /// Of each row, the first and last of the record's rows in it.
    pub(crate) spans: Vec<(usize, usize)>,
    /// Rows of the record whose reading or rate was left out as a gross error.
    pub(crate) spikes: usize,
    /// Kinks that were placed in its air.
    pub(super) kinks: usize,
    /// Whether its air takes time to take on another slope, as that of a controlled chamber does, and whether it may be taken for that.
    pub(super) controlled: bool,
    pub(super) may_be_controlled: bool,
    /// Whether its air approaches a set point, as that of a stage does behind a step: its slope dies away.
    pub(super) approaches: bool,
    /// … and takes on the slope that a step asks for with a delay.
    pub(super) delays: bool,
    /// When the film between air and pack changes to another one and back, ascending [s].
    pub(super) film_switches_s: Vec<f64>,
    /// Values in one row.
    pub(crate) averaged: usize,
    /// Resolution of the sensor [K]; 0 where readings are not on a grid.
    pub(crate) resolution_k: f64,
    pub(crate) noise_floor_rad_per_s: f64,
    pub(crate) duration_s: f64,
    /// The record's first instant [s].
    pub(crate) start_s: f64,
    /// Whether a rate's window may begin before the row before it.
    pub(crate) overlaps: bool,
    pub(super) shape_of: Vec<u16>,
}

/// A step of time behind one film.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TimeStep {
    pub(super) length_s: f64,
    pub(super) film: Film,
}

/// Where a record comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Origin {
    Measured,
    /// Worked out, without noise.
    Planned,
}

/// How a row is measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shape {
    /// Length of the rate's window [s]; 0: the rate at an instant.
    pub(crate) window_s: f64,
    /// Share of the window's end in the readings, the rest being its beginning's.
    pub(crate) end_share: f64,
    /// Of the two slots that remember a window's beginning.
    pub(crate) slot: u8,
    /// The film at the row.
    pub(super) film: Film,
}

/// Rows are averaged while they are shorter than this share of the pack's own time …
const TIME_SHARE: f64 = 0.5;
/// … and to at most so many seconds, unless there are more rows than this, and then to at most so many.
pub(super) const SHORT_ROW_S: f64 = 10.0;
const MANY_ROWS: f64 = 3000.0;
const LONG_ROW_S: f64 = 60.0;
/// More distinct steps than this are put together from binary fractions of the usual one.
const MOST_STEPS: usize = 128;
const FINEST_S: f64 = 0.05;
/// Two times that differ by less are the same [s].
const SAME_S: f64 = 1e-6;
/// The air's bends: readings are smoothed over one time, compared over the other, and the air moved earlier than they by
/// the last [s].
const SMOOTHED_S: f64 = 210.0;
const COMPARED_S: f64 = 200.0;
const EARLIER_S: f64 = 80.0;
/// A bend of this share of the largest is one.
const FULL_BEND: f64 = 0.25;
/// Levels of the trend's noise; between them gains may stay frozen.
const LEVELS: f64 = 8.0;

impl Series {
    /// `pack_s`: the shortest time in which the pack evens out that a row should resolve.
    pub(crate) fn new(record: &Record, rate_mean_s: f64, pack_s: f64, origin: Origin) -> Self {
        let mut columns: [Vec<f64>; MEASURED] = [
            record.temperature_k().to_vec(),
            record.inner_k().map(<[f64]>::to_vec).unwrap_or_default(),
            record.ambient_k().map(<[f64]>::to_vec).unwrap_or_default(),
            record.rate_rad_per_s().to_vec(),
        ];
        let gross = if origin == Origin::Measured { record.gross_errors() } else { Vec::new() };
        for error in &gross {
            columns[if error.column == "rate" { RATE } else { 0 }][error.row] = f64::NAN;
        }
        let (times_s, interval_s) = (record.times_s(), record.interval_s());
        let duration_s = times_s[times_s.len() - 1] - times_s[0];
        let reference_k = columns[0].iter().copied().find(|v| v.is_finite()).unwrap_or(0.0);
        for column in &mut columns[..RATE] {
            column.iter_mut().for_each(|v| *v -= reference_k);
        }
        let resolution_k = resolution(&columns[0]);
        let row_s = (TIME_SHARE * pack_s).min(SHORT_ROW_S).max((duration_s / MANY_ROWS).min(LONG_ROW_S));
        let averaged = ((row_s / interval_s) + 1e-9).floor().max(1.0) as usize;
        let blocks = if averaged > 1 {
            slots(times_s, &columns, averaged, interval_s)
        } else {
            let whole = |i: usize| Block {
                time_s: times_s[i],
                values: std::array::from_fn(|m| columns[m].get(i).copied().unwrap_or(f64::NAN)),
                span: (i, i),
            };
            (0..times_s.len()).map(whole).collect()
        };
        let channels = record.channel_means(rate_mean_s);
        let mut series = Self {
            times_s: blocks.iter().map(|b| b.time_s).collect(),
            values: std::array::from_fn(|m| blocks.iter().map(|b| b.values[m]).collect()),
            reference_k,
            columns: channels.iter().map(|c| blocks.iter().map(|b| b.mean(c)).collect()).collect(),
            rows: Vec::new(),
            steps: Vec::new(),
            shapes: Vec::new(),
            spans: blocks.iter().map(|b| b.span).collect(),
            spikes: gross.len(),
            after_kinks: Vec::new(),
            kinks: 0,
            controlled: false,
            may_be_controlled: true,
            approaches: false,
            delays: false,
            film_switches_s: Vec::new(),
            averaged,
            resolution_k,
            noise_floor_rad_per_s: white_noise(times_s, record.rate_rad_per_s()).deviation,
            duration_s,
            start_s: times_s[0],
            overlaps: false,
            shape_of: Vec::new(),
        };
        series.plan(rate_mean_s, averaged as f64 * interval_s);
        series.count_repeats(&columns, origin);
        series
    }

    /// How many readings in a row are one value of the sensor's grid, of each row: of a block's readings the mean, as its variance counts them.
    fn count_repeats(&mut self, columns: &[Vec<f64>; MEASURED], origin: Origin) {
        // What was worked out lies on no grid.
        if origin == Origin::Planned || self.resolution_k == 0.0 {
            return;
        }
        for (m, column) in columns.iter().enumerate().take(GRIDDED).filter(|(_, column)| !column.is_empty()) {
            let lengths = run_lengths(column);
            for (row, &(from, to)) in self.rows.iter_mut().zip(&self.spans) {
                let own = &lengths[from..=to];
                row.rounding[m] = own.iter().sum::<f64>() / own.len() as f64;
            }
        }
    }

    /// The mean of the readings \[K\], gross errors left out.
    pub(super) fn mean_k(&self) -> f64 {
        let known: Vec<f64> = self.values[0].iter().copied().filter(|v| v.is_finite()).collect();
        self.reference_k + known.iter().sum::<f64>() / known.len().max(1) as f64
    }

    /// Takes a gross error out.
    pub(crate) fn leave_out(&mut self, row: usize, measurement: usize) {
        self.values[measurement][row] = f64::NAN;
        self.rows[row].measured[measurement] = None;
        self.spikes += 1;
    }

    /// Values as another series of the same rows has them: what it leaves out, and what a coarse sensor's readings say by it.
    pub(super) fn take_values_of(&mut self, other: &Self) {
        self.values.clone_from(&other.values);
        self.spikes = other.spikes;
        let rows = self.rows.iter_mut().zip(&other.rows);
        rows.for_each(|(row, there)| (row.measured, row.rounding) = (there.measured, there.rounding));
    }

    /// Takes in again what was left out since.
    pub(super) fn take_in_again(&mut self, before: &Self) {
        self.values.clone_from(&before.values);
        self.rows.iter_mut().zip(&before.rows).for_each(|(row, whole)| row.measured = whole.measured);
        self.spikes = before.spikes;
    }

    pub(crate) fn shape_of(&self, row: usize) -> usize {
        self.shape_of[row] as usize
    }

    /// The step like this one, which may be a new one.
    pub(super) fn step_of(&mut self, step: TimeStep) -> u16 {
        place_of_step(&mut self.steps, step)
    }

    /// The usual time between rows [s].
    pub(crate) fn shortest_s(&self) -> f64 {
        let steps: Vec<f64> = self.times_s.windows(2).map(|w| w[1] - w[0]).collect();
        median(&steps)
    }

    /// Steps, windows and bends of all rows.
    #[expect(
        clippy::too_many_lines,
        reason = "windows, events and steps of a row follow from each other by what is worked out once"
    )]
    fn plan(&mut self, rate_mean_s: f64, block_s: f64) {
        // A thermometer in the air bends with it; any other shows later, and rounded off, what the air has done.
        let bends = match &self.values[AMBIENT] {
            air if air.iter().any(|v| v.is_finite()) => bends(&self.times_s, air, 0.0),
            _ => bends(&self.times_s, &self.values[0], EARLIER_S),
        };
        let wanted_s = if self.averaged > 1 { block_s } else { rate_mean_s };
        let times_s = &self.times_s;
        let windows_s: Vec<f64> = (0..times_s.len())
            .map(|k| {
                let gap_s = if k > 0 { times_s[k] - times_s[k - 1] } else { 0.0 };
                if (gap_s - wanted_s).abs() < 0.05 * wanted_s {
                    gap_s
                } else if wanted_s <= gap_s || (k > 1 && times_s[k] - wanted_s >= times_s[k - 2]) {
                    wanted_s
                } else {
                    gap_s
                }
            })
            .collect();
        self.overlaps = (1..times_s.len()).any(|k| windows_s[k] > times_s[k] - times_s[k - 1] + SAME_S);
        let begins_s: Vec<f64> = (0..times_s.len()).map(|k| times_s[k] - windows_s[k]).collect();
        let slot_of = |k: usize| if self.overlaps { (k % 2) as u8 } else { 0 };
        // Of each row: what happens before it, and how long after the last.
        let happens = |k: usize| -> Vec<(f64, u8)> {
            let last_s = if k > 0 { times_s[k - 1] } else { times_s[k] };
            let mut begun: Vec<(f64, u8)> = [k, k + 1]
                .into_iter()
                // At the first row no window has begun yet.
                .filter(|&j| k > 0 && j < times_s.len() && windows_s[j] > 0.0)
                .filter(|&j| if j == k { begins_s[j] >= last_s - SAME_S } else { begins_s[j] < times_s[k] - SAME_S })
                .map(|j| (begins_s[j].max(last_s), slot_of(j)))
                .collect();
            begun.sort_by(|a, b| a.0.total_cmp(&b.0));
            let mut at_s = last_s;
            for event in &mut begun {
                let after_s = event.0 - at_s;
                at_s = event.0;
                event.0 = after_s;
            }
            begun
        };
        let events: Vec<Vec<(f64, u8)>> = (0..times_s.len()).map(happens).collect();
        let rest_s = |k: usize| {
            let gap_s = if k > 0 { times_s[k] - times_s[k - 1] } else { 0.0 };
            gap_s - events[k].iter().map(|e| e.0).sum::<f64>()
        };
        let steps = StepTable::new(
            (0..times_s.len()).flat_map(|k| events[k].iter().map(|e| e.0).chain([rest_s(k)]).collect::<Vec<_>>()),
            block_s,
        );
        let end_share = if self.averaged > 1 { 0.5 * (self.averaged as f64 + 1.0) / self.averaged as f64 } else { 1.0 };
        for k in 0..times_s.len() {
            let window_s = windows_s[k];
            let keeps = k > 0 && window_s > 0.0;
            let end_share = if keeps { end_share } else { 1.0 };
            let shape = Shape { window_s, end_share, slot: slot_of(k), film: Film::Usual };
            let place = place_of(&mut self.shapes, shape);
            self.shape_of.push(place as u16);
            let measured = std::array::from_fn(|m| {
                let there = self.values[m][k].is_finite() && (m != RATE || k > 0);
                there.then_some((place * MEASURED + m) as u16)
            });
            let mut moves = Vec::new();
            for &(after_s, slot) in &events[k] {
                moves.extend(steps.of(after_s).into_iter().map(Move::Step));
                moves.push(Move::Keep(slot));
            }
            moves.extend(steps.of(rest_s(k)).into_iter().map(Move::Step));
            let (bend, averaged) = (bends[k], self.averaged as f64);
            self.rows.push(Row { moves, bend, kink: 0.0, measured, averaged, rounding: [1.0; MEASURED] });
        }
        let step = |length_s: f64| TimeStep { length_s, film: Film::Usual };
        self.steps = steps.lengths_s.into_iter().map(step).collect();
    }
}

/// The place of a step, which may be a new one.
pub(super) fn place_of_step(steps: &mut Vec<TimeStep>, step: TimeStep) -> u16 {
    let is_same = |s: &TimeStep| (s.length_s - step.length_s).abs() < SAME_S && s.film == step.film;
    steps.iter().position(is_same).unwrap_or_else(|| {
        steps.push(step);
        steps.len() - 1
    }) as u16
}

/// The place of a shape, which may be a new one.
pub(super) fn place_of(shapes: &mut Vec<Shape>, shape: Shape) -> usize {
    shapes.iter().position(|s| same(s, &shape)).unwrap_or_else(|| {
        shapes.push(shape);
        shapes.len() - 1
    })
}

fn same(a: &Shape, b: &Shape) -> bool {
    (a.window_s - b.window_s).abs() < SAME_S
        && (a.end_share - b.end_share).abs() < SAME_S
        && (a.slot, a.film) == (b.slot, b.film)
}

/// Rows that become one.
struct Block {
    time_s: f64,
    values: [f64; MEASURED],
    span: (usize, usize),
}

impl Block {
    fn mean(&self, values: &[f64]) -> f64 {
        let (from, to) = self.span;
        values[from..=to].iter().sum::<f64>() / (to + 1 - from) as f64
    }
}

/// Of a slot's rows at least this share must be there.
const PRESENT: f64 = 0.7;

/// Slots of `count` rows each, that end where their last row should stand.
fn slots(times_s: &[f64], columns: &[Vec<f64>; MEASURED], count: usize, interval_s: f64) -> Vec<Block> {
    let slot_s = count as f64 * interval_s;
    let first_s = times_s[0] - interval_s;
    let slot_of = |t: f64| ((t - first_s) / slot_s - 1e-6).ceil() as usize;
    let mut blocks = Vec::new();
    let mut from = 0;
    while from < times_s.len() {
        let slot = slot_of(times_s[from]);
        let to = from + times_s[from..].partition_point(|&t| slot_of(t) <= slot);
        let time_s = first_s + slot as f64 * slot_s;
        let middle_s = time_s - 0.5 * (count as f64 - 1.0) * interval_s;
        let mut values = [f64::NAN; MEASURED];
        for (m, column) in columns.iter().enumerate().filter(|(_, c)| !c.is_empty()) {
            let present: Vec<usize> = (from..to).filter(|&i| column[i].is_finite()).collect();
            if (present.len() as f64) < PRESENT * count as f64 {
                continue;
            }
            let mean = |f: &dyn Fn(usize) -> f64| present.iter().map(|&i| f(i)).sum::<f64>() / present.len() as f64;
            let (first, last) = (present[0], present[present.len() - 1]);
            // Where some are missing, the rest's mean is that of another instant.
            let slope = if m == RATE || last == first {
                0.0
            } else {
                (column[last] - column[first]) / (times_s[last] - times_s[first])
            };
            values[m] = mean(&|i| column[i]) - slope * (mean(&|i| times_s[i]) - middle_s);
        }
        if values.iter().any(|v| v.is_finite()) {
            blocks.push(Block { time_s, values, span: (from, to - 1) });
        }
        from = to;
    }
    blocks
}

/// Distinct steps; where there are too many, fractions of one that add up to each.
struct StepTable {
    lengths_s: Vec<f64>,
    /// None where each length stands for itself.
    finest_s: Option<f64>,
}

impl StepTable {
    fn new(lengths: impl Iterator<Item = f64>, usual_s: f64) -> Self {
        let mut lengths_s: Vec<f64> = Vec::new();
        let mut longest_s = usual_s;
        for length_s in lengths.filter(|&l| l > SAME_S) {
            longest_s = longest_s.max(length_s);
            if lengths_s.len() <= MOST_STEPS && !lengths_s.iter().any(|l| (l - length_s).abs() < SAME_S) {
                lengths_s.push(length_s);
            }
        }
        if lengths_s.len() <= MOST_STEPS {
            return Self { lengths_s, finest_s: None };
        }
        let finest_s = usual_s / 2.0_f64.powi((usual_s / FINEST_S).log2().ceil().max(0.0) as i32);
        let mut lengths_s = vec![finest_s];
        while lengths_s[lengths_s.len() - 1] < longest_s {
            lengths_s.push(2.0 * lengths_s[lengths_s.len() - 1]);
        }
        Self { lengths_s, finest_s: Some(finest_s) }
    }

    fn of(&self, length_s: f64) -> Vec<u16> {
        let Some(finest_s) = self.finest_s else {
            return self
                .lengths_s
                .iter()
                .position(|l| (l - length_s).abs() < SAME_S)
                .map(|i| i as u16)
                .into_iter()
                .collect();
        };
        let units = (length_s / finest_s).round().max(0.0) as u64;
        (0..self.lengths_s.len()).rev().filter(|i| units >> i & 1 == 1).map(|i| i as u16).collect()
    }
}

/// How much the readings bend at each row, from 0 to 1 in a few levels, so much earlier as the air does what bends them.
fn bends(times_s: &[f64], readings: &[f64], earlier_s: f64) -> Vec<f64> {
    let known: Vec<(f64, f64)> =
        times_s.iter().zip(readings).filter(|(_, v)| v.is_finite()).map(|(t, v)| (*t, *v)).collect();
    if known.len() < 3 {
        return vec![0.0; times_s.len()];
    }
    let steps: Vec<f64> = times_s.windows(2).map(|w| w[1] - w[0]).collect();
    let grid_s = median(&steps).max(5.0);
    let start_s = times_s[0];
    let count = ((times_s[times_s.len() - 1] - start_s) / grid_s).ceil() as usize + 1;
    let mut place = 0;
    let on_grid: Vec<f64> = (0..count)
        .map(|i| {
            let t = start_s + i as f64 * grid_s;
            while place + 2 < known.len() && known[place + 1].0 < t {
                place += 1;
            }
            let ((t0, y0), (t1, y1)) = (known[place], known[place + 1]);
            y0 + (y1 - y0) * ((t - t0) / (t1 - t0)).clamp(0.0, 1.0)
        })
        .collect();
    let at = |values: &[f64], i: isize| values[i.clamp(0, count as isize - 1) as usize];
    let half = ((0.5 * SMOOTHED_S / grid_s).round() as isize).max(1);
    let smooth: Vec<f64> = (0..count as isize)
        .map(|i| (-half..=half).map(|o| at(&on_grid, i + o)).sum::<f64>() / (2 * half + 1) as f64)
        .collect();
    let apart = ((COMPARED_S / grid_s).round() as isize).max(1);
    let earlier = (earlier_s / grid_s).round() as isize;
    let bend = |i: isize| (at(&smooth, i + apart) - 2.0 * at(&smooth, i) + at(&smooth, i - apart)).abs();
    let raw: Vec<f64> = (0..count as isize).map(|i| bend((i + earlier).min(count as isize - 1))).collect();
    let full = FULL_BEND * raw.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    times_s
        .iter()
        .map(|t| {
            let share = (raw[(((t - start_s) / grid_s).round() as usize).min(count - 1)] / full).min(1.0);
            (share * share * LEVELS).round() / LEVELS
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Readings on a grid of 0.1 K at this time between rows.
    fn on_a_grid(steps: &[i32], interval_s: f64) -> Series {
        let times_s = (0..steps.len()).map(|k| interval_s * k as f64).collect();
        let readings = steps.iter().map(|step| 290.0 + 0.1 * f64::from(*step)).collect();
        let rates = (0..steps.len()).map(|k| 1e-7 * (3.7 * k as f64).sin()).collect();
        let record = Record::new("gridded", times_s, readings, rates).unwrap();
        Series::new(&record, interval_s, 20.0, Origin::Measured)
    }

    #[test]
    fn readings_that_repeat_a_value_of_the_grid_are_counted_and_averaged_ones_as_their_mean_varies() {
        let steps = [0, 0, 0, 1, 2, 2, 3, 4, 5, 5, 5, 5];
        let series = on_a_grid(&steps, 10.0);
        let repeats: Vec<f64> = series.rows.iter().map(|row| row.rounding[0]).collect();
        assert_eq!(repeats, [3.0, 3.0, 3.0, 1.0, 2.0, 2.0, 1.0, 1.0, 4.0, 4.0, 4.0, 4.0]);
        assert!(series.rows.iter().all(|row| row.rounding[AMBIENT] == 1.0 && row.rounding[RATE] == 1.0));
        // Four rows of 2.5 s in one: the grid's variance times this over four is that of the mean. Errors in a run are one error, which
        // a run that goes on in the next block shares with it.
        let series = on_a_grid(&steps, 2.5);
        assert_eq!(series.averaged, 4);
        let repeats: Vec<f64> = series.rows.iter().map(|row| row.rounding[0]).collect();
        assert_eq!(repeats, [(3.0 * 3.0 + 1.0) / 4.0, (2.0 * 2.0 + 1.0 + 1.0) / 4.0, 4.0]);
    }
}
