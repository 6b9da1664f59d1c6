//! Where the air's slope has its kinks, to a share of a row.
//!
//! Readings say near which rows ([`super::shocks`]); readings and rates together when: each kink begins where the shocks have
//! their centre that the measurements imply when it may be anywhere near, and goes to the likelihood's maximum along time. A
//! kink without which the likelihood falls by less than the logarithm of the rows, where it might have been, is none.

use std::ops::Range;

use rayon::prelude::*;

use super::ascent::Effort;
use super::filter::{self, Move};
use super::fit::Fit;
use super::layout::Numbers;
use super::prior::Quantity;
use super::series::{SHORT_ROW_S, Series, TimeStep};
use super::system::decoupled_system;
use super::{Assumption, Chamber, ChamberError};

/// A change of the air's slope that stands out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bend {
    pub(crate) time_s: f64,
    pub(crate) slope_change_k_per_s: f64,
}

/// Rows to each side of where readings have a kink in which it may be: a lagging sensor shows it late.
const REACH_ROWS: usize = 5;
/// Strides in rows by which kinks are moved: each list one after another, all kinks anew with the next.
const STRIDES_ROWS: [[f64; 2]; 2] = [[0.5, 0.15], [0.15, 0.05]];
/// Numbers that were fitted with kinks at wrong times move them less than they should: fits and kinks take turns, at most so often,
/// while any kink moves by this share of a row.
const MOST_TURNS: usize = 4;
const MOVED_ROWS: f64 = 0.02;
/// Strides in the logarithm of the time of an onset.
const ONSET_STRIDES: [f64; 2] = [0.4, 0.15];
/// A share of a step that counts as none.
const NO_SHARE: f64 = 1e-3;

impl Chamber<'_> {
    /// As [`Chamber::with_shocks`] for the first record, with its kinks, and its film's switches, at the times that readings and rates have
    /// them at.
    ///
    /// # Errors
    /// As [`Chamber::fit`].
    pub(crate) fn with_timed_shocks(self, assumed: &Assumption) -> Result<(Self, Fit), ChamberError> {
        let whole = self.clone();
        let (chamber, fit) = self.with_timed_shocks_behind_these_films(assumed)?;
        // What rates say nothing of is one film's.
        if whole.observed[0].blind {
            return Ok((chamber, fit));
        }
        let Some((switched, _)) = whole.with_switched_film(&fit)? else { return Ok((chamber, fit)) };
        let (switched, other) = switched.with_timed_shocks_behind_these_films(assumed)?;
        let is_better = switched.gain_over(&other, (&chamber, &fit), 0)? > 0.0;
        Ok(if is_better { (switched, other) } else { (chamber, fit) })
    }

    /// With the film switched, or not, as it is.
    fn with_timed_shocks_behind_these_films(mut self, assumed: &Assumption) -> Result<(Self, Fit), ChamberError> {
        let fit = self.best_start(assumed, &[], &[0])?;
        let fit = self.looked_through(fit, &[0])?;
        let mut kinks = self.time_kinks(&fit, 0)?;
        let mut fit = self.fit(assumed, &[], &[0], Some(&fit), Effort::FULL)?;
        for _ in 1..MOST_TURNS {
            let before: Vec<f64> = kinks.iter().map(|kink| kink.time_s).collect();
            kinks = self.move_kinks(&fit, 0, kinks, &STRIDES_ROWS[1..])?;
            let enough_s = MOVED_ROWS * self.observed[0].series.shortest_s();
            let stays = |(kink, before_s): (&Bend, &f64)| (kink.time_s - before_s).abs() < enough_s;
            if kinks.len() == before.len() && kinks.iter().zip(&before).all(stays) {
                break;
            }
            fit = self.fit(assumed, &[], &[0], Some(&fit), Effort::FULL)?;
        }
        Ok((self, fit))
    }

    /// The chamber with every record's kinks at the times that a fit has them at: what is said of predictions, and sets that differ in
    /// little, need them sharper than a search does.
    ///
    /// # Errors
    /// A model that cannot be solved.
    pub(crate) fn with_timed_kinks(mut self, fit: &Fit) -> Result<Self, ChamberError> {
        for record in 0..self.records() {
            if fit.records.contains(&record) {
                self.time_kinks(fit, record)?;
            } else {
                let day = self.held_out(fit, record)?;
                self.time_kinks(&day, record)?;
            }
        }
        Ok(self)
    }

    /// Moves a record's kinks, each somewhere within a few rows so far, to the times that readings and rates have them at.
    ///
    /// # Errors
    /// A model that cannot be solved.
    pub(crate) fn time_kinks(&mut self, fit: &Fit, record: usize) -> Result<Vec<Bend>, ChamberError> {
        let windows = self.observed[record].series.widen_kinks();
        let slopes = self.slopes(fit, record)?;
        let times_s = &self.observed[record].series.times_s;
        let kinks = windows.into_iter().map(|window| centre(times_s, &slopes, window)).collect();
        self.move_kinks(fit, record, kinks, &STRIDES_ROWS)
    }

    /// Moves kinks, about where they are so far, to the likelihood's maximum; takes out those that are none.
    fn move_kinks(
        &mut self,
        fit: &Fit,
        record: usize,
        mut kinks: Vec<Bend>,
        strides_rows: &[[f64; 2]],
    ) -> Result<Vec<Bend>, ChamberError> {
        if kinks.is_empty() {
            return Ok(kinks);
        }
        let mut base = self.observed[record].series.clone();
        base.straighten();
        let mut numbers = self.numbers_for(fit, record);
        let (side, values) = self.side_and_values(fit, record, &numbers)?;
        let likelihood_by = |numbers: &Numbers, kinks: &[Bend]| {
            let series = base.with_kinks(kinks);
            let system = decoupled_system(&side.parts(&fit.assumed), numbers, &series);
            filter::forward(&system, &series.rows, &values, false).log_likelihood
        };
        let row_s = base.shortest_s();
        for strides in strides_rows {
            let likelihood = |kinks: &[Bend]| likelihood_by(&numbers, kinks);
            let (others, here) = (kinks.clone(), likelihood(&kinks));
            kinks.par_iter_mut().enumerate().for_each(|(place, kink)| {
                let at = |time_s: f64| {
                    let mut all = others.clone();
                    all[place].time_s = time_s;
                    likelihood(&all)
                };
                kink.time_s = highest(at, kink.time_s, here, &strides.map(|rows| rows * row_s));
            });
            // What another kink nearby does as well is none.
            while let Some(place) = worthless(&kinks, &likelihood, (base.times_s.len() as f64).ln()) {
                kinks.remove(place);
            }
            if base.delays {
                set_in(&mut kinks, &mut numbers, likelihood_by);
            }
            self.observed[record].series = base.with_kinks(&kinks);
            let slopes = self.slopes(fit, record)?;
            for kink in &mut kinks {
                let row = base.row_of(kink.time_s);
                kink.slope_change_k_per_s = slopes[row] - slopes[row - 1];
            }
        }
        self.observed[record].series = base.with_kinks(&kinks);
        Ok(kinks)
    }

    /// The air's slope at each row by all measurements \[K/s\].
    fn slopes(&self, fit: &Fit, record: usize) -> Result<Vec<f64>, ChamberError> {
        let (_, system, trace) = self.traced(fit, record)?;
        let states = filter::smooth(&system, &self.observed[record].series.rows, &trace);
        Ok(states.chunks_exact(system.size).map(|x| x[system.slope]).collect())
    }

    /// Where and by how much the air's slope changes, by its value at each row: at kinks where there are any, else where the
    /// readings bend.
    pub(super) fn bends(&self, record: usize, slope: impl Fn(usize) -> f64) -> Vec<Bend> {
        let series = &self.observed[record].series;
        let kinked = series.rows.iter().any(|row| row.kink > 0.0);
        let bent =
            |k: usize| series.rows.get(k).is_some_and(|row| if kinked { row.kink > 0.0 } else { row.bend > 0.0 });
        let at_s = |i: usize| if kinked { series.kink_s(i) } else { 0.5 * (series.times_s[i] + series.times_s[i - 1]) };
        let mut bends = Vec::new();
        let mut k = 1;
        while k < series.rows.len() {
            if !bent(k) {
                k += 1;
                continue;
            }
            let from = k - 1;
            while bent(k) {
                k += 1;
            }
            // The centre of the steps that the slope takes.
            let steps: Vec<f64> = (from + 1..k).map(|i| (slope(i) - slope(i - 1)).abs()).collect();
            let whole: f64 = steps.iter().sum();
            let time_s = steps.iter().zip(from + 1..k).map(|(s, i)| s * at_s(i)).sum::<f64>() / whole;
            if whole > 0.0 {
                bends.push(Bend { time_s, slope_change_k_per_s: slope(k - 1) - slope(from) });
            }
        }
        bends
    }
}

/// Gives kinks and the time in which the air takes on each one's slope what is likeliest of both: a kink that is seen sooner and sets in more
/// slowly differs little from one that does neither.
fn set_in(kinks: &mut [Bend], numbers: &mut Numbers, likelihood: impl Fn(&Numbers, &[Bend]) -> f64) {
    let onset = Quantity::OnsetTime;
    let (prior, before_s) = (onset.prior(), numbers.get(onset));
    let with = |log_s: f64| -> (Numbers, Vec<Bend>) {
        let mut other = *numbers;
        other.set(onset, log_s.exp());
        let sooner = |kink: &Bend| Bend { time_s: kink.time_s - (log_s.exp() - before_s), ..*kink };
        (other, kinks.iter().map(sooner).collect())
    };
    let at = |log_s: f64| {
        let (numbers, kinks) = with(log_s);
        likelihood(&numbers, &kinks) - 0.5 * ((log_s - prior.median.ln()) / prior.deviation).powi(2)
    };
    let start = before_s.ln();
    let best = highest(at, start, at(start), &ONSET_STRIDES);
    let (found, sooner) = with(best);
    kinks.copy_from_slice(&sooner);
    *numbers = found;
}

/// The kink that changes in some rows add up to: their centre and their sum.
fn centre(times_s: &[f64], slopes: &[f64], rows: Range<usize>) -> Bend {
    let changes: Vec<f64> = rows.clone().map(|k| slopes[k] - slopes[k - 1]).collect();
    let sizes: f64 = changes.iter().map(|c| c.abs()).sum();
    let time_s =
        changes.iter().zip(rows).map(|(c, k)| c.abs() * times_s[k - 1]).sum::<f64>() / sizes.max(f64::MIN_POSITIVE);
    Bend { time_s, slope_change_k_per_s: changes.iter().sum() }
}

/// The kink without which the likelihood falls least, if that is by less than its price.
fn worthless(kinks: &[Bend], likelihood: &(impl Fn(&[Bend]) -> f64 + Sync), price: f64) -> Option<usize> {
    let here = likelihood(kinks);
    let without = |place: usize| {
        let mut others = kinks.to_vec();
        others.remove(place);
        here - likelihood(&others)
    };
    let costs: Vec<f64> = (0..kinks.len()).into_par_iter().map(without).collect();
    let (place, cost) = costs.into_iter().enumerate().min_by(|a, b| a.1.total_cmp(&b.1))?;
    (cost < price).then_some(place)
}

/// The time of the highest likelihood near a time: by parabolas through three, ever closer.
pub(super) fn highest(at: impl Fn(f64) -> f64, start_s: f64, value: f64, strides_s: &[f64]) -> f64 {
    let (mut best_s, mut best) = (start_s, value);
    for &stride_s in strides_s {
        let (before, after) = (at(best_s - stride_s), at(best_s + stride_s));
        let curvature = before - 2.0 * best + after;
        let top = if curvature < 0.0 { (0.5 * (before - after) / curvature).clamp(-2.0, 2.0) } else { 0.0 };
        let middle_s = best_s;
        for (time_s, value) in [
            (middle_s - stride_s, before),
            (middle_s + stride_s, after),
            (middle_s + top * stride_s, at(middle_s + top * stride_s)),
        ] {
            if value > best {
                (best_s, best) = (time_s, value);
            }
        }
    }
    best_s
}

impl Series {
    /// Lets each kink be anywhere within reach of where it was found and nearer than any other; the rows of each.
    fn widen_kinks(&mut self) -> Vec<Range<usize>> {
        let mut found: Vec<(Range<usize>, f64)> = Vec::new();
        for (k, row) in self.rows.iter().enumerate().skip(1).filter(|(_, row)| row.kink > 0.0) {
            match found.last_mut() {
                Some((rows, size)) if rows.end == k && *size == row.kink => rows.end = k + 1,
                _ => found.push((k..k + 1, row.kink)),
            }
        }
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
    fn row_of(&self, time_s: f64) -> usize {
        self.times_s.partition_point(|t| *t <= time_s).clamp(1, self.rows.len() - 1)
    }

    /// The time of a row's kink: the middle of where it may be.
    fn kink_s(&self, row: usize) -> f64 {
        let mut at_s = self.times_s[row.max(1) - 1];
        if !self.rows[row].is_kinked_within() {
            return at_s;
        }
        let (mut sum_s, mut count) = (0.0, 0.0);
        for movement in &self.rows[row].moves {
            match movement {
                Move::Step(step) => at_s += self.steps[*step as usize].length_s,
                Move::Keep(_) => {}
                Move::Kink => {
                    sum_s += at_s;
                    count += 1.0;
                }
            }
        }
        sum_s / count
    }

    /// Takes all kinks out, and the places within rows where they may be.
    pub(super) fn straighten(&mut self) {
        for row in &mut self.rows {
            row.kink = 0.0;
            row.moves.retain(|m| *m != Move::Kink);
        }
        self.kinks = 0;
    }

    /// Lets rows have a kink of this size, wherever it is in them: in a row that is long beside what the coil's outer layers
    /// take to follow, a rate tells when.
    pub(super) fn kink_within(&mut self, rows: Range<usize>, size_k_per_s: f64) {
        for k in rows {
            self.rows[k].kink += size_k_per_s * size_k_per_s;
            if self.rows[k].moves.contains(&Move::Kink) {
                continue;
            }
            let mut moves = Vec::new();
            for movement in std::mem::take(&mut self.rows[k].moves) {
                let Move::Step(step) = movement else {
                    moves.push(movement);
                    continue;
                };
                let whole = self.steps[step as usize];
                let parts = (whole.length_s / SHORT_ROW_S).ceil().max(1.0);
                let length_s = whole.length_s / parts;
                let part = if parts > 1.0 { self.step_of(TimeStep { length_s, ..whole }) } else { step };
                (0..parts as usize).for_each(|_| moves.extend([Move::Kink, Move::Step(part)]));
            }
            // One place alone is where the steps begin.
            if moves.iter().filter(|m| **m == Move::Kink).count() == 1 {
                moves.retain(|m| *m != Move::Kink);
            }
            self.rows[k].moves = moves;
        }
    }

    /// Kinks at these times; of rows that have none so far.
    pub(super) fn with_kinks(&self, kinks: &[Bend]) -> Series {
        let mut with = self.clone();
        for kink in kinks {
            let row = with.row_of(kink.time_s);
            let mut left_s = kink.time_s - with.times_s[row - 1];
            with.rows[row].kink += kink.slope_change_k_per_s.powi(2);
            let mut moves = Vec::new();
            let mut placed = left_s <= 0.0 || with.rows[row].is_kinked_within();
            for &movement in &with.rows[row].moves {
                let Move::Step(step) = movement else {
                    moves.push(movement);
                    continue;
                };
                let whole = with.steps[step as usize];
                let step_s = whole.length_s;
                let share = left_s / step_s;
                if placed || share >= 1.0 - NO_SHARE {
                    moves.push(movement);
                } else if share <= NO_SHARE {
                    moves.extend([Move::Kink, movement]);
                    placed = true;
                } else {
                    let first = with.steps.len() as u16;
                    with.steps.extend([left_s, step_s - left_s].map(|length_s| TimeStep { length_s, ..whole }));
                    moves.extend([Move::Step(first), Move::Kink, Move::Step(first + 1)]);
                    placed = true;
                }
                left_s -= step_s;
            }
            if !placed {
                moves.push(Move::Kink);
            }
            with.rows[row].moves = moves;
        }
        with
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::dense::tests::model;
    use super::*;
    use crate::numeric::piecewise::PiecewiseLinear;
    use crate::pattern::Pattern;
    use crate::pattern::classic::Classic;
    use crate::rate::{CoilModel, RateModel};
    use crate::record::Record;
    use crate::thermal::{exposure::expose, solve};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use statrs::distribution::{ContinuousCDF, Normal};

    /// Up, and down with a stop of under three minutes; every kink at a time that is no row's.
    pub(in crate::chamber) const KINKS_S: [f64; 6] = [904.3, 1707.7, 2312.9, 2871.4, 3036.1, 4003.6];
    const AIR_K: [f64; 8] = [293.0, 293.0, 313.0, 313.0, 306.0, 306.0, 293.0, 293.0];

    fn knots_s() -> Vec<f64> {
        [&[0.0], &KINKS_S[..], &[6000.0]].concat()
    }

    /// A record in that air.
    pub(in crate::chamber) fn kinked(model: &CoilModel, pattern: &Pattern) -> Record {
        in_air(model, pattern, &PiecewiseLinear::new(knots_s(), AIR_K.to_vec()).unwrap())
    }

    /// A record of 6000 s behind a film of 25 W/(m²K).
    pub(in crate::chamber) fn in_air(model: &CoilModel, pattern: &Pattern, air: &PiecewiseLinear) -> Record {
        let times_s: Vec<f64> = (1..=600).map(|i| 10.0 * f64::from(i)).collect();
        let exposed = expose(&model.heat_path().unwrap(), Some(25.0), 0.0, air, &times_s).unwrap();
        let history = solve(&exposed.path, &exposed.drive).unwrap().means(&times_s, 10.0);
        let rates = RateModel::new(model, pattern, &[]).unwrap().series_rad_per_s(&history);
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let normal = Normal::new(0.0, 1.0).unwrap();
        let mut noise = |deviation: f64| deviation * normal.inverse_cdf(random.random::<f64>());
        let rates = rates.into_iter().map(|r| r + noise(2e-7)).collect();
        let temperature_k = exposed.shown_k.into_iter().map(|t| t + noise(0.003)).collect();
        Record::new("kinked", times_s, temperature_k, rates).unwrap()
    }

    #[test]
    fn kinks_between_rows_are_found_to_a_tenth_of_a_row() {
        let (model, pattern) = (model(Vec::new()), Classic::Zyl.pattern(8).unwrap());
        let (record, knots_s) = (kinked(&model, &pattern), knots_s());
        let assumed = Assumption { drift: true, ..Assumption::new(model.clone(), pattern) };
        let (chamber, fit) = Chamber::new(&model, &[&record]).unwrap().with_timed_shocks(&assumed).unwrap();
        let slopes = chamber.slopes(&fit, 0).unwrap();
        let found = chamber.bends(0, |k| slopes[k]);
        println!("{found:?}");
        for (place, time_s) in KINKS_S.into_iter().enumerate() {
            let slope = |i: usize| (AIR_K[i + 1] - AIR_K[i]) / (knots_s[i + 1] - knots_s[i]);
            let change = slope(place + 1) - slope(place);
            let near =
                found.iter().min_by(|a, b| (a.time_s - time_s).abs().total_cmp(&(b.time_s - time_s).abs())).unwrap();
            assert!((near.time_s - time_s).abs() < 1.0, "{time_s}: {near:?}");
            assert!((near.slope_change_k_per_s / change - 1.0).abs() < 0.1, "{time_s}: {near:?} of {change}");
        }
    }
}
