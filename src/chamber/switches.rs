//! Whether, and when, the film of a record is switched: steps of the film's logarithm, one after another, and then two films.
//!
//! ```text
//! δa'(t) = (a − T)(t) from row j on, per unit of ln h;   V_j: what innovations that makes, in their deviations
//! ln h(t) = Σ β_j 1(t ≥ t_j): the steps that leave least of the innovations, as many as pay for having been possible at any row;
//! its levels fall into two: the usual film, and the other
//! ```
//!
//! Steps are looked for in an air and with a gyro as usual, because those that were fitted without a switch have taken in what it
//! does. So they are proposals only: the likelihood of the whole model, everything fitted, says which are needed.

use nalgebra::{DMatrix, DVector};

use super::ascent::Effort;
use super::coil_side::film_is_free;
use super::film_step::FilmStep;
use super::filter;
use super::fit::Fit;
use super::kinks::highest;
use super::layout::Numbers;
use super::prior::{Quantity, SWITCHED_LOG};
use super::responses::responses;
use super::row::Film;
use super::series::Series;
use super::system::decoupled_system;
use super::{Chamber, ChamberError, Innovation};
use crate::numeric::order::sort_ascending;
use crate::numeric::pursuit::Pursuit;
use crate::parallel::InParallel;
use crate::thermal::Extent;

/// Steps in one record, and times that it is looked through with those found so far.
const MOST_STEPS: usize = 12;
const ROUNDS: usize = 4;
/// Steps of so many rows are one: a switch is not at a row.
const STEP_ROWS: f64 = 5.0;
/// Rows that a step is looked for at.
const MOST_PLACES: usize = 1500;
/// The first film ratio that is tried differs by no more than this factor.
const MOST_RATIO: f64 = 4.0;
/// Strides in rows by which switches are moved: each list one after another.
const STRIDES_ROWS: [&[f64]; 2] = [&[1.0, 0.4], &[0.3, 0.1]];
/// A round that gains less is the last.
const LEAST_GAIN: f64 = 1.0;

/// Which of a record's two films is the usual one, as against another chamber of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Films {
    Same,
    Exchanged,
}

/// The film between air and pack of a record, which changes to another one and back.
#[derive(Debug, Clone, PartialEq)]
pub struct FilmSwitches {
    /// The record's name.
    pub record: String,
    /// Whether it begins behind the other film.
    pub begins_switched: bool,
    /// When the film changes \[s\].
    pub times_s: Vec<f64>,
    /// The other film over the usual one; None where the record's numbers are not known.
    pub film_ratio: Option<f64>,
}

impl std::fmt::Display for FilmSwitches {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("the film between air and pack changes")?;
        if let Some(ratio) = self.film_ratio {
            write!(f, " to {ratio:.2} times what it is else")?;
        }
        let times: Vec<String> = self.times_s.iter().map(|t| format!("{t:.0}")).collect();
        f.write_str(if times.len() > 1 { " and back" } else { "" })?;
        write!(f, ", at {} s", times.join(", "))?;
        f.write_str(if self.begins_switched { ", the record beginning behind the other one" } else { "" })
    }
}

/// A film that is switched at some times: one before the first row is that the record begins behind the other film.
#[derive(Debug, Clone, PartialEq)]
struct Switches {
    times_s: Vec<f64>,
    /// Logarithm of the other film's ratio to the usual one.
    log_ratio: f64,
}

impl Chamber<'_> {
    /// The same records, those with a switched film whose readings and rates say by a fit that they have one, and what that gains in
    /// the fitted ones; None where none has. The chamber is as [`Chamber::new`] made it: what a switch does is a kink, or a gross
    /// error, to air that has been looked through.
    ///
    /// # Errors
    /// As [`Chamber::fit`].
    pub(crate) fn with_switched_film(&self, fit: &Fit) -> Result<Option<(Self, f64)>, ChamberError> {
        let of = |r: usize| self.switched(&self.usual_day(fit, r), r);
        let found: Result<Vec<_>, _> = (0..self.records()).in_parallel().map(of).collect();
        let found = found?;
        if found.iter().all(Option::is_none) {
            return Ok(None);
        }
        let (mut switched, mut gain) = (self.clone(), 0.0);
        for (r, found) in found.into_iter().enumerate() {
            if let Some((series, own)) = found {
                switched.observed[r].series = series;
                gain += if fit.records.contains(&r) { own } else { 0.0 };
            }
        }
        Ok(Some((switched, gain)))
    }

    /// These records, as [`Chamber::new`] made them, with their film switched when it is in another chamber of them.
    pub(crate) fn switched_like(&self, other: &Chamber, films: Films) -> Self {
        let mut switched = self.clone();
        for (own, there) in switched.observed.iter_mut().zip(&other.observed) {
            let mut times_s = there.series.film_switches_s.clone();
            if times_s.is_empty() {
                continue;
            }
            if films == Films::Exchanged {
                let before = times_s.iter().filter(|t| **t <= own.series.start_s).count();
                times_s.drain(..before);
                if before % 2 == 0 {
                    times_s.insert(0, own.series.start_s);
                }
            }
            own.series = own.series.with_film_switches(&times_s);
        }
        switched
    }

    /// These records with the film of some switched as it is in another chamber of them, both as [`Chamber::new`] made them.
    pub(crate) fn with_films_of(&self, other: &Self, records: &[usize]) -> Self {
        let mut with = self.clone();
        records.iter().for_each(|&r| with.observed[r].series = other.observed[r].series.clone());
        with
    }

    /// When the film of a record is switched \[s\].
    pub(crate) fn film_switches_s(&self, record: usize) -> &[f64] {
        &self.observed[record].series.film_switches_s
    }

    /// The switched film of a record, and what a fit of the record found it to be; None where it has one film.
    pub(crate) fn film_switches(&self, record: usize, fit: Option<&Fit>) -> Option<FilmSwitches> {
        let begin_s = self.times_s(record)[0];
        let (before, times_s): (Vec<f64>, Vec<f64>) = self.film_switches_s(record).iter().partition(|t| **t <= begin_s);
        (!times_s.is_empty()).then(|| FilmSwitches {
            record: self.record(record).name().to_owned(),
            begins_switched: before.len() % 2 == 1,
            times_s,
            film_ratio: fit.map(|fit| fit.number(Quantity::FilmRatio, record)),
        })
    }

    /// What the switches of these records cost in log prior.
    pub(crate) fn film_price(&self, records: &[usize]) -> f64 {
        let of = |&r: &usize| {
            let switches = self.film_switches_s(r).len() as f64;
            if switches > 0.0 { switches * (self.times_s(r).len() as f64).ln() - SWITCHED_LOG } else { 0.0 }
        };
        records.iter().map(of).sum()
    }

    /// A record by a fit in an air and with a gyro as usual.
    fn usual_day(&self, fit: &Fit, record: usize) -> Fit {
        let mut day = fit.clone();
        let medians = Numbers::medians(&self.observed[record].series);
        let mut numbers = self.completed(fit, &[record])[record];
        Quantity::AIR.iter().for_each(|&quantity| numbers.set(quantity, medians.get(quantity)));
        day.numbers[record] = numbers;
        day.records = vec![record];
        day.assumed.drift = false;
        self.with_usual_gyro(day, record)
    }

    /// With a gyro whose white noise is the floor of short windows, and that wanders as most do.
    fn with_usual_gyro(&self, mut day: Fit, record: usize) -> Fit {
        let medians = Numbers::medians(&self.observed[record].series);
        let gyro = [Quantity::RateNoise, Quantity::WanderShare, Quantity::WanderTime];
        gyro.into_iter().for_each(|quantity| day.numbers[record].set(quantity, medians.get(quantity)));
        day
    }

    /// A record with its switches, if it has any, and what they gain.
    fn switched(&self, usual: &Fit, record: usize) -> Result<Option<(Series, f64)>, ChamberError> {
        // Of a half space all that is known is how its outermost layer follows the air.
        if usual.assumed.model.heat_path()?.extent == Extent::HalfSpace {
            return Ok(None);
        }
        let whole = &self.observed[record].series;
        let mut best: Option<(Series, f64)> = None;
        let (mut chamber, mut day) = (self.clone(), usual.clone());
        for _ in 0..ROUNDS {
            let proposed = chamber.proposed_switches(&day, record)?;
            let judged = |found: Switches| -> Result<Option<(Series, Fit, f64)>, ChamberError> {
                let (times_s, timed) = self.timed_switches(&day, record, found)?;
                // Another film throughout is none that is switched.
                if times_s.iter().all(|t| *t <= whole.start_s) {
                    return Ok(None);
                }
                let mut there = self.clone();
                there.observed[record].series = whole.with_film_switches(&times_s);
                let with = there.fit(&timed.assumed, &[], &[record], Some(&timed), Effort::QUICK)?;
                let worth = with.posterior() - there.film_price(&[record]);
                Ok(Some((there.observed.swap_remove(record).series, with, worth)))
            };
            let found: Result<Vec<_>, ChamberError> = proposed.in_parallel().map(judged).collect();
            let found = found?.into_iter().flatten().max_by(|a, b| a.2.total_cmp(&b.2));
            let Some((series, with, worth)) = found else { break };
            if best.as_ref().is_some_and(|best| worth < best.1 + LEAST_GAIN) {
                break;
            }
            chamber.observed[record].series = series.clone();
            best = Some((series, worth));
            day = chamber.with_usual_gyro(with, record);
        }
        let Some((series, worth)) = best else { return Ok(None) };
        let without = self.fit(&usual.assumed, &[], &[record], Some(usual), Effort::QUICK)?;
        let gain = worth - without.posterior();
        Ok((gain > 0.0).then_some((series, gain)))
    }

    /// Switches that a record may have in the place of those that it has; none where it seems to need no others.
    fn proposed_switches(&self, day: &Fit, record: usize) -> Result<Vec<Switches>, ChamberError> {
        let (side, system, trace) = self.traced(day, record)?;
        let series = &self.observed[record].series;
        let numbers = &day.numbers[record];
        let states = filter::smooth(&system, &series.rows, &trace);
        let course = side.reference(&day.assumed, numbers, &self.observed[record], &states, None)?;
        let outermost = course.layers - 1;
        let apart = |k: usize| numbers.film_ratio(series.film_at(k)) * (course.air_k[k] - course.row(k)[outermost]);
        let apart_k: Vec<f64> = (0..course.air_k.len()).map(apart).collect();
        let places: Vec<usize> = (0..apart_k.len()).step_by(apart_k.len().div_ceil(MOST_PLACES)).collect();
        let step = FilmStep::new(&side, series, &apart_k);
        let columns = responses(&system, &series.rows, &trace, &places, |row| step.before(row));
        // A film that is fitted may be another one throughout.
        let is_fitted = film_is_free(&day.assumed)?;
        let steps = needed_steps(columns, &trace.innovations, is_fitted);
        if steps.is_empty() {
            return Ok(Vec::new());
        }
        let at_s = |row: usize| 0.5 * (series.times_s[row] + series.times_s[row.max(1) - 1]);
        let mut changes: Vec<Step> = steps.iter().map(|&(i, log)| Step { time_s: at_s(places[i]), log }).collect();
        let mut film = Film::Usual;
        for &time_s in &series.film_switches_s {
            let before = numbers.film_ratio(film);
            film = film.other();
            changes.push(Step { time_s, log: (numbers.film_ratio(film) / before).ln() });
        }
        let changes = joined(changes, STEP_ROWS * series.shortest_s());
        let end_s = series.start_s + series.duration_s;
        let levels = two_films(&changes, series.start_s, end_s, is_fitted);
        let alternating = alternating(&changes, &series.times_s, &apart_k);
        Ok(levels.into_iter().chain(alternating).collect())
    }

    /// Switches at the likelihood's maximum along time, without those that it does not need, and the fit with them.
    fn timed_switches(&self, day: &Fit, record: usize, found: Switches) -> Result<(Vec<f64>, Fit), ChamberError> {
        let whole = &self.observed[record].series;
        let row_s = whole.shortest_s();
        let price = (whole.times_s.len() as f64).ln();
        let most = MOST_RATIO.ln();
        let (mut chamber, mut day, mut times_s) = (self.clone(), day.clone(), found.times_s);
        day.numbers[record].set(Quantity::FilmRatio, found.log_ratio.clamp(-most, most).exp());
        for strides in STRIDES_ROWS {
            chamber.observed[record].series = whole.with_film_switches(&times_s);
            day = chamber.fit(&day.assumed, &[], &[record], Some(&day), Effort::SHORT)?;
            let numbers = chamber.numbers_for(&day, record);
            let (side, values) = chamber.side_and_values(&day, record, &numbers)?;
            let likelihood = |times_s: &[f64]| {
                let series = whole.with_film_switches(times_s);
                let system = decoupled_system(&side.parts(&day.assumed), &numbers, &series);
                filter::forward(&system, &series.rows, &values, false).log_likelihood
            };
            let (others, here) = (times_s.clone(), likelihood(&times_s));
            let strides: Vec<f64> = strides.iter().map(|rows| rows * row_s).collect();
            times_s.iter_mut().enumerate().filter(|(_, t)| **t > whole.start_s).in_parallel().for_each(
                |(place, time_s)| {
                    let at = |moved_s: f64| {
                        let mut all = others.clone();
                        all[place] = moved_s;
                        all.sort_by(f64::total_cmp);
                        likelihood(&all)
                    };
                    *time_s = highest(at, *time_s, here, &strides);
                },
            );
            times_s.sort_by(f64::total_cmp);
            while let Some(fewer) = without_needless(&times_s, &likelihood, price) {
                times_s = fewer;
            }
        }
        Ok((times_s, day))
    }
}

/// The switches without the one, or the two in a row, without which the likelihood falls least, if that is by less than their price.
fn without_needless(times_s: &[f64], likelihood: &(impl Fn(&[f64]) -> f64 + Sync), price: f64) -> Option<Vec<f64>> {
    let here = likelihood(times_s);
    let spans = (0..times_s.len()).flat_map(|from| [(from, from + 1), (from, from + 2)]);
    let spans: Vec<(usize, usize)> = spans.filter(|(_, to)| *to <= times_s.len()).collect();
    let without = |(from, to): (usize, usize)| {
        let mut fewer = times_s.to_vec();
        fewer.drain(from..to);
        (here - likelihood(&fewer) - price * (to - from) as f64, fewer)
    };
    let all: Vec<(f64, Vec<f64>)> = spans.in_parallel().map(without).collect();
    let (cost, fewer) = all.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    (cost < 0.0).then_some(fewer)
}

/// Steps of the film's logarithm that innovations need, each with the column that it is.
fn needed_steps(mut columns: DMatrix<f64>, innovations: &[Innovation], is_fitted: bool) -> Vec<(usize, f64)> {
    let of =
        |value: &dyn Fn(&Innovation) -> f64| DVector::from_iterator(innovations.len(), innovations.iter().map(value));
    let deviations = of(&|i| i.variance.sqrt());
    columns.column_iter_mut().for_each(|mut column| column.component_div_assign(&deviations));
    // The place and the size of each.
    let price = 1.5 * (columns.ncols() as f64).ln();
    let mut pursuit = Pursuit::new(columns, of(&|i| i.value / i.variance.sqrt()));
    if is_fitted {
        pursuit.take(0);
    }
    while pursuit.taken.len() < MOST_STEPS {
        match pursuit.best() {
            Some((place, gain)) if gain > price => pursuit.take(place),
            _ => break,
        }
    }
    pursuit.coefficients().into_iter().filter(|(place, _)| !is_fitted || *place > 0).collect()
}

/// A step of the film's logarithm.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Step {
    time_s: f64,
    log: f64,
}

/// Steps in order of time, those near each other as one.
fn joined(mut steps: Vec<Step>, near_s: f64) -> Vec<Step> {
    sort_ascending(&mut steps, |item| item.time_s);
    let mut groups: Vec<Vec<Step>> = Vec::new();
    for step in steps {
        match groups.last_mut() {
            Some(group) if step.time_s - group[group.len() - 1].time_s <= near_s => group.push(step),
            _ => groups.push(vec![step]),
        }
    }
    let one = |group: Vec<Step>| {
        let largest = group.iter().copied().max_by(|a, b| a.log.abs().total_cmp(&b.log.abs()))?;
        Some(Step { log: group.iter().map(|s| s.log).sum(), ..largest })
    };
    groups.into_iter().filter_map(one).collect()
}

/// Switches that steps are, one up and one down: where two in a row go the same way, the film went back between them while the pack was
/// as warm as the air, and nothing showed it.
fn alternating(steps: &[Step], times_s: &[f64], apart_k: &[f64]) -> Option<Switches> {
    let mut found: Vec<f64> = Vec::new();
    for (i, step) in steps.iter().enumerate() {
        if let Some(before) = i.checked_sub(1).map(|i| steps[i]).filter(|before| (before.log > 0.0) == (step.log > 0.0))
        {
            let between = (0..times_s.len()).filter(|&k| times_s[k] > before.time_s && times_s[k] < step.time_s);
            let still = between.min_by(|&a, &b| apart_k[a].abs().total_cmp(&apart_k[b].abs()))?;
            found.push(times_s[still]);
        }
        found.push(step.time_s);
    }
    let size = steps.iter().map(|s| s.log.abs()).fold(0.0, f64::max);
    Some(Switches { log_ratio: size * steps.first()?.log.signum(), times_s: found })
}

/// Levels that steps lead to as two films: those of which the levels, by how long each lasts, differ least from their two means. None
/// where all are one.
fn two_films(steps: &[Step], begin_s: f64, end_s: f64, is_fitted: bool) -> Option<Switches> {
    let mut levels = vec![(begin_s, 0.0)];
    for step in steps {
        let level = levels[levels.len() - 1].1 + step.log;
        match levels.last_mut() {
            Some(last) if step.time_s <= last.0 => last.1 = level,
            _ => levels.push((step.time_s, level)),
        }
    }
    let lasts_s = |i: usize| levels.get(i + 1).map_or(end_s, |next| next.0) - levels[i].0;
    let mean = |is_high: bool, bar: f64| {
        let own = (0..levels.len()).filter(|&i| (levels[i].1 > bar) == is_high);
        let add = |(time_s, sum): (f64, f64), i: usize| (time_s + lasts_s(i), sum + lasts_s(i) * levels[i].1);
        let (time_s, sum) = own.fold((0.0, 0.0), add);
        (time_s, sum / time_s)
    };
    let mut sorted: Vec<f64> = levels.iter().map(|l| l.1).collect();
    sorted.sort_by(f64::total_cmp);
    let apart = |bar: f64| {
        let ((low_s, low), (high_s, high)) = (mean(false, bar), mean(true, bar));
        (low_s * high_s * (high - low).powi(2), bar, low, high)
    };
    let all = sorted.windows(2).map(|w| apart(0.5 * (w[0] + w[1]))).filter(|found| found.0 > 0.0);
    let (_, bar, low, high) = all.max_by(|a, b| a.0.total_cmp(&b.0))?;
    // The usual film is the one that the model states, or the one that the record begins behind.
    let usual_is_high = if is_fitted { levels[0].1 > bar } else { high.abs() < low.abs() };
    let mut is_usual = true;
    let mut times_s = Vec::new();
    for (from_s, level) in levels {
        if ((level > bar) == usual_is_high) != is_usual {
            is_usual = !is_usual;
            times_s.push(from_s);
        }
    }
    let log_ratio = if usual_is_high { low - high } else { high - low };
    (!times_s.is_empty()).then_some(Switches { times_s, log_ratio })
}

#[cfg(test)]
mod tests {
    use super::super::dense::tests::model;
    use super::super::kinks::tests::kinked;
    use super::super::{Assumption, Effort};
    use super::*;
    use crate::pattern::classic::Classic;

    fn step(time_s: f64, log: f64) -> Step {
        Step { time_s, log }
    }

    #[test]
    fn steps_beside_each_other_are_one_at_the_largest() {
        let all = joined(vec![step(300.0, 0.5), step(100.0, 0.2), step(110.0, 0.6)], 50.0);
        assert_eq!(all.len(), 2);
        assert!((all[0].log - 0.8).abs() < 1e-12 && all[0].time_s == 110.0 && all[1].time_s == 300.0, "{all:?}");
    }

    #[test]
    fn levels_are_two_films_of_which_the_one_that_is_stated_is_usual() {
        let steps = [step(100.0, 0.7), step(400.0, -0.6), step(410.0, -0.05), step(700.0, 0.5)];
        let found = two_films(&steps, 0.0, 1000.0, false).unwrap();
        assert_eq!(found.times_s, [100.0, 400.0, 700.0]);
        assert!((0.5..0.7).contains(&found.log_ratio), "{found:?}");
        // Of a model that states none it is that at the beginning; here the record begins behind the film that is not stated.
        let begun = [step(100.0, -0.8), step(900.0, 0.8)];
        let from_the_first = two_films(&begun, 0.0, 1000.0, true).unwrap();
        assert!(from_the_first.times_s == [100.0, 900.0] && from_the_first.log_ratio < 0.0);
        let stated = [step(0.0, 0.8), step(100.0, -0.8)];
        let found = two_films(&stated, 0.0, 1000.0, false).unwrap();
        assert!(found.times_s == [0.0, 100.0] && found.log_ratio > 0.0, "{found:?}");
        assert_eq!(two_films(&[], 0.0, 1000.0, false), None);
    }

    #[test]
    fn between_two_steps_up_the_film_went_back_where_nothing_showed_it() {
        let times_s: Vec<f64> = (0..10).map(|k| 100.0 * f64::from(k)).collect();
        let apart_k = [3.0, 3.0, 2.0, 1.0, 0.1, -1.0, -2.0, -2.0, -1.0, 0.0];
        let found = alternating(&[step(150.0, 0.3), step(750.0, 0.5)], &times_s, &apart_k).unwrap();
        assert_eq!(found.times_s, [150.0, 400.0, 750.0]);
        assert!(found.log_ratio > 0.0);
    }

    #[test]
    fn a_step_of_the_film_moves_innovations_as_another_film_from_there_on_does() {
        let (model, pattern) = (model(Vec::new()), Classic::Zyl.pattern(8).unwrap());
        let record = kinked(&model, &pattern);
        let chamber = Chamber::new(&model, &[&record]).unwrap();
        let assumed = Assumption::new(model, pattern);
        let fit = chamber.fit(&assumed, &[], &[0], None, Effort::QUICK).unwrap();
        let series = &chamber.observed[0].series;
        let (side, system, trace) = chamber.traced(&fit, 0).unwrap();
        let states = filter::smooth(&system, &series.rows, &trace);
        let course = side.reference(&assumed, &fit.numbers[0], &chamber.observed[0], &states, None).unwrap();
        let apart_k: Vec<f64> =
            (0..course.air_k.len()).map(|k| course.air_k[k] - course.row(k)[course.layers - 1]).collect();
        // In the middle of a ramp.
        let row = series.times_s.iter().position(|t| *t > 1300.0).unwrap();
        let step = FilmStep::new(&side, series, &apart_k);
        let column = responses(&system, &series.rows, &trace, &[row], |row| step.before(row));
        let mut moved = chamber.clone();
        moved.observed[0].series = series.with_film_switches(&[series.times_s[row - 1]]);
        let by = 1e-3_f64;
        let mut there = fit.clone();
        there.numbers[0].set(Quantity::FilmRatio, by.exp());
        let (_, _, other) = moved.traced(&there, 0).unwrap();
        let (mut along, mut squares, mut own) = (0.0, 0.0, 0.0);
        for ((a, b), v) in trace.innovations.iter().zip(&other.innovations).zip(column.iter()) {
            let change = (a.value - b.value) / by / a.variance.sqrt();
            let promised = v / a.variance.sqrt();
            along += change * promised;
            squares += promised * promised;
            own += change * change;
        }
        let (correlation, size) = (along / (squares * own).sqrt(), (own / squares).sqrt());
        println!("{correlation} {size}");
        assert!(correlation > 0.99 && (size - 1.0).abs() < 0.05, "{correlation} {size}");
    }
}
