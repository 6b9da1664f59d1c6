//! Where the air's slope has its kinks, to a share of a row.
//!
//! Readings say near which rows ([`super::shocks`]); readings and rates together when: each kink begins where the shocks have
//! their centre that the measurements imply when it may be anywhere near, and goes to the likelihood's maximum along time. A
//! kink without which the likelihood falls by less than the logarithm of the rows, where it might have been, is none.

use std::ops::Range;

use super::ascent::Effort;
use super::doubts::doubts;
use super::elsewhere::Elsewhere;
use super::filter::{self, System, Values};
use super::fit::Fit;
use super::kinked_rows::Bend;
use super::layout::Numbers;
use super::prior::Quantity;
use super::series::Series;
use super::system::{AfterKinks, decoupled_system};
use super::{Assumption, Chamber, ChamberError};
use crate::parallel::InParallel;

/// Strides in rows by which kinks are moved: each list one after another, all kinks anew with the next.
const STRIDES_ROWS: [[f64; 2]; 3] = [[0.5, 0.15], [0.15, 0.05], [0.05, 0.015]];
/// Strides that one parabola may move a kink by.
const MOST_STRIDES: f64 = 2.0;
/// Numbers that were fitted with kinks at wrong times move them less than they should: fits and kinks take turns, at most so often,
/// while any kink moves by this share of a row.
const MOST_TURNS: usize = 4;
const MOVED_ROWS: f64 = 0.02;
/// Strides in the logarithm of the time of an onset.
const ONSET_STRIDES: [f64; 2] = [0.4, 0.15];

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
            kinks = self.move_kinks(&fit, 0, kinks, &STRIDES_ROWS[1..])?.0;
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

    /// Moves a record's kinks, each somewhere within a few rows so far or where it was found to be by another fit, to the times that readings
    /// and rates have them at.
    ///
    /// # Errors
    /// A model that cannot be solved.
    pub(crate) fn time_kinks(&mut self, fit: &Fit, record: usize) -> Result<Vec<Bend>, ChamberError> {
        let timed = self.observed[record].series.timed_kinks();
        let windows = self.observed[record].series.widen_kinks();
        let slopes = self.slopes(fit, record)?;
        let times_s = &self.observed[record].series.times_s;
        let centres = windows.into_iter().map(|window| centre(times_s, &slopes, window)).collect();
        let Some(timed) = timed else { return Ok(self.move_kinks(fit, record, centres, &STRIDES_ROWS)?.0) };
        // Within a few rows of where they were the centre may be that of another maximum, a better one or a worse.
        let mut here = self.clone();
        let (kinks, worth) = here.move_kinks(fit, record, timed, &STRIDES_ROWS)?;
        let (others, other_worth) = self.move_kinks(fit, record, centres, &STRIDES_ROWS)?;
        if other_worth > worth {
            return Ok(others);
        }
        self.observed[record].series = here.observed.swap_remove(record).series;
        Ok(kinks)
    }

    /// Moves kinks, about where they are so far, to the likelihood's maximum; takes out those that are none. With them comes the log likelihood
    /// less what they cost.
    fn move_kinks(
        &mut self,
        fit: &Fit,
        record: usize,
        mut kinks: Vec<Bend>,
        strides_rows: &[[f64; 2]],
    ) -> Result<(Vec<Bend>, f64), ChamberError> {
        if kinks.is_empty() {
            return Ok((kinks, f64::NEG_INFINITY));
        }
        let mut base = self.observed[record].series.clone();
        base.straighten();
        let mut numbers = self.numbers_for(fit, record);
        let (side, values) = self.side_and_values(fit, record, &numbers)?;
        let likelihood_by = |numbers: &Numbers| {
            let straight = decoupled_system(&side.parts(&fit.assumed), numbers, &base);
            KinkLikelihood::new(&base, straight, &values)
        };
        let mut likelihood = likelihood_by(&numbers);
        for strides in strides_rows {
            likelihood.climb(&mut kinks, &strides.map(|rows| rows * base.shortest_s()));
            likelihood.take_out_worthless(&mut kinks);
            if base.delays {
                set_in(&mut kinks, &mut numbers, |numbers, kinks| likelihood_by(numbers).of(kinks));
                likelihood = likelihood_by(&numbers);
            }
            likelihood.size(&mut kinks);
        }
        self.observed[record].series = base.with_kinks(&kinks);
        let worth = likelihood.of(&kinks) - likelihood.price() * kinks.len() as f64;
        Ok((kinks, worth))
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

/// The likelihood of a record whose air is straight but for kinks.
struct KinkLikelihood<'a> {
    base: &'a Series,
    /// Without any kink.
    straight: System,
    after: AfterKinks,
    values: &'a Values,
}

impl<'a> KinkLikelihood<'a> {
    fn new(base: &'a Series, straight: System, values: &'a Values) -> Self {
        Self { base, after: straight.after_kinks(base, &base.steps), straight, values }
    }

    fn with(&self, kinks: &[Bend]) -> (Series, System) {
        let series = self.base.with_kinks(kinks);
        let system = System { kinks: self.after.of(&series.after_kinks), ..self.straight.clone() };
        (series, system)
    }

    /// With kinks that differ from those elsewhere in one stretch only.
    fn beside(&self, elsewhere: &Elsewhere, stretch: usize, kinks: &[Bend]) -> f64 {
        let (rows, after_kinks) = self.base.rows_with_kinks(elsewhere.rows_of(stretch), kinks);
        elsewhere.log_likelihood(stretch, rows, self.after.of(&after_kinks))
    }

    fn of(&self, kinks: &[Bend]) -> f64 {
        let (series, system) = self.with(kinks);
        filter::forward(&system, &series.rows, self.values, false).log_likelihood
    }

    /// Of a kink, which might have been at any row.
    fn price(&self) -> f64 {
        (self.base.times_s.len() as f64).ln()
    }

    /// Moves each kink, the others where they are, to the maximum along time.
    fn climb(&self, kinks: &mut [Bend], strides_s: &[f64]) {
        let others = kinks.to_vec();
        let reach_s = MOST_STRIDES * strides_s.iter().sum::<f64>();
        let (series, system) = self.with(&others);
        let stretches = others.iter().map(|kink| self.base.rows_about(kink.time_s, reach_s)).collect();
        let elsewhere = Elsewhere::new(&system, &series.rows, self.values, stretches);
        kinks.iter_mut().enumerate().in_parallel().for_each(|(place, kink)| {
            let at = |time_s: f64| {
                let mut all = others.clone();
                all[place].time_s = time_s;
                self.beside(&elsewhere, place, &all)
            };
            kink.time_s = highest(at, kink.time_s, at(kink.time_s), strides_s);
        });
    }

    /// Gives each kink the size that all measurements say it has.
    fn size(&self, kinks: &mut [Bend]) {
        let (series, system) = self.with(kinks);
        let trace = filter::forward(&system, &series.rows, self.values, true);
        let doubts = doubts(&system, &series.rows, &trace);
        kinks.iter_mut().for_each(|kink| kink.slope_change_k_per_s = doubts.kinks[self.base.row_of(kink.time_s)].1);
    }

    /// Takes out, one by one, the kink without which the likelihood falls least, while that is by less than its price: what another one nearby
    /// does as well is none.
    fn take_out_worthless(&self, kinks: &mut Vec<Bend>) {
        let price = self.price();
        while !kinks.is_empty() {
            let (series, system) = self.with(kinks);
            let stretches = kinks.iter().map(|kink| self.base.rows_about(kink.time_s, 0.0)).collect();
            let elsewhere = Elsewhere::new(&system, &series.rows, self.values, stretches);
            let cost = |place: usize| {
                let mut others = kinks.clone();
                others.remove(place);
                self.beside(&elsewhere, place, kinks) - self.beside(&elsewhere, place, &others)
            };
            let costs: Vec<f64> = (0..kinks.len()).in_parallel().map(cost).collect();
            let least = costs.into_iter().enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
            match least {
                Some((place, cost)) if cost < price => kinks.remove(place),
                _ => break,
            };
        }
    }
}

/// The time of the highest likelihood near a time: by parabolas through three, ever closer.
pub(super) fn highest(at: impl Fn(f64) -> f64, start_s: f64, value: f64, strides_s: &[f64]) -> f64 {
    let (mut best_s, mut best) = (start_s, value);
    for &stride_s in strides_s {
        let (before, after) = (at(best_s - stride_s), at(best_s + stride_s));
        let curvature = before - 2.0 * best + after;
        let top =
            if curvature < 0.0 { (0.5 * (before - after) / curvature).clamp(-MOST_STRIDES, MOST_STRIDES) } else { 0.0 };
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

#[cfg(test)]
pub(super) mod tests {
    use super::super::airs::tests::staged;
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

    #[test]
    fn where_a_kink_moves_or_goes_all_other_rows_say_what_they_would_in_a_pass_over_the_whole_record() {
        let (model, pattern) = (model(Vec::new()), Classic::Zyl.pattern(8).unwrap());
        let record = kinked(&model, &pattern);
        let chamber = Chamber::new(&model, &[&record]).unwrap();
        let assumed = Assumption::new(model, pattern);
        let fit = chamber.fit(&assumed, &[], &[0], None, Effort::NONE).unwrap();
        let mut numbers = chamber.numbers_for(&fit, 0);
        numbers.set(Quantity::FilmRatio, 2.0);
        let (side, values) = chamber.side_and_values(&fit, 0, &numbers).unwrap();
        let whole = &chamber.observed[0].series;
        // The last one in the rows at the end, behind which there are none.
        let end_s = whole.start_s + whole.duration_s - 4.0;
        let bend = |time_s: f64| Bend { time_s, slope_change_k_per_s: 0.02 };
        let kinks: Vec<Bend> = KINKS_S.into_iter().chain([end_s]).map(bend).collect();
        for base in [whole.clone(), whole.with_film_switches(&[1500.0, 2875.0])] {
            let straight = decoupled_system(&side.parts(&assumed), &numbers, &base);
            let likelihood = KinkLikelihood::new(&base, straight, &values);
            let (series, system) = likelihood.with(&kinks);
            let stretches = kinks.iter().map(|kink| base.rows_about(kink.time_s, 13.0)).collect();
            let elsewhere = Elsewhere::new(&system, &series.rows, &values, stretches);
            let beside = |place: usize, kinks: &[Bend]| likelihood.beside(&elsewhere, place, kinks);
            for place in 0..kinks.len() {
                let moved = [-13.0, -3.7, 2.0, 13.0].map(|later_s| {
                    let mut moved = kinks.clone();
                    moved[place].time_s += later_s;
                    moved
                });
                let mut fewer = kinks.clone();
                fewer.remove(place);
                for others in moved.iter().chain([&fewer]) {
                    let (found, exact) =
                        (beside(place, others) - beside(place, &kinks), likelihood.of(others) - likelihood.of(&kinks));
                    assert!((found - exact).abs() < 1e-6, "{place}: {found} for {exact}");
                }
            }
        }
    }

    #[test]
    fn a_stages_step_in_a_gap_of_the_record_has_its_whole_size() {
        let (model, pattern) = (model(Vec::new()), Classic::Zyl.pattern(8).unwrap());
        let approach_s = 40.0;
        let whole = in_air(&model, &pattern, &staged(approach_s, 0.0));
        // Behind a step of -9 K at 1707.7 s, until the air is within 2 K of its set point.
        let kept: Vec<usize> = (0..600).filter(|&k| !(1705.0..1765.0).contains(&whole.times_s()[k])).collect();
        let of = |column: &[f64]| kept.iter().map(|&k| column[k]).collect::<Vec<f64>>();
        let columns = [whole.times_s(), whole.temperature_k(), whole.rate_rad_per_s()].map(of);
        let [times_s, temperature_k, rate_rad_per_s] = columns;
        let record = Record::new("gap", times_s, temperature_k, rate_rad_per_s).unwrap();
        let mut chamber = Chamber::new(&model, &[&record]).unwrap();
        let series = &mut chamber.observed[0].series;
        series.approaches = true;
        series.take_out_bends();
        let assumed = Assumption { drift: true, ..Assumption::new(model, pattern) };
        let mut fit = chamber.fit(&assumed, &[], &[0], None, Effort::NONE).unwrap();
        fit.numbers[0].set(Quantity::Film, 25.0);
        fit.numbers[0].set(Quantity::ApproachTime, approach_s);
        let steps_k = [(904.3, 18.0), (1707.7, -9.0), (2612.9, 16.0), (3571.4, -29.0), (4703.6, 7.0)];
        let near = steps_k.map(|(time_s, _)| Bend { time_s: time_s + 2.0, slope_change_k_per_s: 0.3 });
        let (kinks, _) = chamber.move_kinks(&fit, 0, near.to_vec(), &STRIDES_ROWS).unwrap();
        for ((time_s, step_k), found) in steps_k.into_iter().zip(&kinks) {
            assert!((found.time_s - time_s).abs() < 1.0, "{time_s}: {found:?}");
            let share = found.slope_change_k_per_s * approach_s / step_k;
            assert!((share - 1.0).abs() < 0.05, "{time_s}: {found:?} is {share} of the step");
        }
    }
}
