//! Compensation row by row: what comes in goes out, in order, after a stated number of rows, in bounded memory.
//!
//! A rate that stands alone between neighbours that agree is replaced by their median; a temperature that is missing or
//! leaps is left out, and the model goes on by itself until it is back; a gap is bridged in steps of the usual interval; a
//! clock that steps back is taken as one interval. Each is flagged; no row is lost.

use std::collections::VecDeque;

use super::Compensator;
use super::empirical::Window;
use super::filter::Filter;
use super::formulas::{AtWork, FormulaColumns, columns_seen, seen};
use super::learned::Follower;
use crate::numeric::statistics::{median, median_in_place};

/// What one row holds; None is a drop-out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Its stamp, from any zero.
    pub time_s: f64,
    /// Of the thermometer that drives the model.
    pub temperature_k: Option<f64>,
    /// Of the thermometer at the bore, where the model reads one.
    pub inner_k: Option<f64>,
    /// What the model's further columns add to the rate error; 0 where it reads none.
    pub channel_rad_per_s: Option<f64>,
    /// What formulas read of the further columns.
    pub columns: FormulaColumns,
    /// As measured.
    pub rate_rad_per_s: Option<f64>,
}

/// What happened to a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Flag {
    /// The row could not be read; it is passed on as it is.
    Malformed,
    /// Its stamp is not behind the one before it.
    ClockBack,
    /// Rows are missing before it.
    Gap,
    /// The temperature was missing or implausible: the last good one stood in.
    TemperatureHeld,
    /// A further column was missing: its last good value stood in.
    ChannelHeld,
    /// The rate was missing: the last good one stood in.
    RateHeld,
    /// The rate is a gross error: the last good one stood in.
    RateRejected,
}

impl Flag {
    /// As in files.
    pub fn word(self) -> &'static str {
        match self {
            Flag::Malformed => "malformed",
            Flag::ClockBack => "clock_back",
            Flag::Gap => "gap",
            Flag::TemperatureHeld => "temperature_held",
            Flag::ChannelHeld => "channel_held",
            Flag::RateHeld => "rate_held",
            Flag::RateRejected => "rate_rejected",
        }
    }
}

/// A row on its way out, with what it was tagged with on its way in.
#[derive(Debug, Clone, PartialEq)]
pub struct Compensated<T> {
    /// What the row was tagged with.
    pub tag: T,
    /// None where nothing is known yet: a malformed row, or a drop-out before the first good row.
    pub rate_rad_per_s: Option<f64>,
    /// What happened to it; empty for a good row.
    pub flags: Vec<Flag>,
}

/// Rows that tell the usual interval.
const FIRST_ROWS: usize = 4;
/// From this many usual intervals on it is a gap.
const GAP: f64 = 1.5;
/// After a gap of more steps the pack has forgotten what was before.
const LONGEST_GAP_STEPS: f64 = 20_000.0;
/// Steps over gaps that each row earns, up to [`LONGEST_GAP_STEPS`]: a stream whose first rows were close together and whose
/// further ones are far apart would otherwise bridge a long gap at every row.
const BRIDGED_STEPS_A_ROW: f64 = 100.0;
/// Rows that are closer are one instant.
const LEAST_INTERVAL_S: f64 = 1e-6;
/// A coil's temperature does not leap by more than this, and so much per second.
const LEAP_K: f64 = 1.0;
const LEAP_K_PER_S: f64 = 0.1;
/// So many leaps to one place are a change, not errors.
const LEAPS: usize = 5;
/// Rows to each side that a rate is compared with.
const NEIGHBOURS: usize = 3;
/// A gross error is so many usual changes of rate away from both sides,
const GROSS: f64 = 10.0;
/// and so many times further than the sides are from each other.
const APART: f64 = 3.0;
/// Rows before the usual change of rate is known.
const SETTLING_ROWS: u64 = 30;

#[derive(Debug)]
struct Pending<T> {
    tag: T,
    step: Option<u64>,
    time_s: f64,
    temperature_k: Option<f64>,
    channel_rad_per_s: f64,
    columns: FormulaColumns,
    rate_rad_per_s: Option<f64>,
    flags: Vec<Flag>,
    bias_rad_per_s: Option<f64>,
}

#[derive(Debug)]
enum Predictor {
    Physical(Box<Filter>),
    Piecewise,
    Regression(Window),
    Learned(Box<Follower>),
}

/// A compensator at work.
#[derive(Debug)]
pub struct Stream<'c, T> {
    compensator: &'c Compensator,
    interval_s: f64,
    delay: usize,
    predictor: Option<Predictor>,
    formulas: Option<AtWork>,
    first: Vec<(T, Option<Reading>)>,
    pending: VecDeque<Pending<T>>,
    step: u64,
    last_s: f64,
    bridgeable_steps: f64,
    last_temperature: Option<(f64, u64)>,
    /// What the further columns were in the row before, and when; none before the first.
    last_columns: Option<(f64, f64, FormulaColumns)>,
    leaps: Vec<f64>,
    before: VecDeque<f64>,
    usual_change: f64,
    rates_seen: u64,
    last_compensated: Option<f64>,
}

impl<'c, T> Stream<'c, T> {
    /// Before the first row.
    pub fn new(compensator: &'c Compensator) -> Self {
        Self {
            compensator,
            interval_s: 0.0,
            delay: 1,
            predictor: None,
            formulas: None,
            first: Vec::new(),
            pending: VecDeque::new(),
            step: 0,
            last_s: f64::NEG_INFINITY,
            bridgeable_steps: LONGEST_GAP_STEPS,
            last_temperature: None,
            last_columns: None,
            leaps: Vec::new(),
            before: VecDeque::new(),
            usual_change: 0.0,
            rates_seen: 0,
            last_compensated: None,
        }
    }

    /// Rows by which the output follows the input, once the interval is known.
    pub fn delay_rows(&self) -> usize {
        self.delay
    }

    /// Takes a row (None: it could not be read) and hands on the rows that are ready.
    pub fn push(&mut self, tag: T, reading: Option<Reading>, mut out: impl FnMut(Compensated<T>)) {
        if self.predictor.is_some() {
            self.take(tag, reading, &mut out);
            return;
        }
        self.first.push((tag, reading));
        let known = self.first.iter().filter(|(_, r)| r.is_some()).count();
        if known >= FIRST_ROWS || self.first.len() >= 64 * FIRST_ROWS {
            self.start(&mut out);
        }
    }

    /// Hands on all that is left.
    pub fn finish(mut self, mut out: impl FnMut(Compensated<T>)) {
        if self.predictor.is_none() {
            self.start(&mut out);
        }
        for row in 0..self.pending.len() {
            self.find_bias(row);
        }
        while !self.pending.is_empty() {
            self.emit(&mut out);
        }
    }

    fn start(&mut self, out: &mut impl FnMut(Compensated<T>)) {
        let times: Vec<f64> = self.first.iter().filter_map(|(_, r)| Some(r.as_ref()?.time_s)).collect();
        let steps: Vec<f64> = times.windows(2).map(|w| w[1] - w[0]).filter(|s| *s >= LEAST_INTERVAL_S).collect();
        let found_s = median(&steps);
        self.interval_s = if found_s > 0.0 { found_s } else { 1.0 };
        self.delay = self.compensator.delay_rows(self.interval_s);
        self.predictor = Some(self.new_predictor());
        if let Compensator::Physical(physical) = self.compensator {
            self.formulas = physical.formulas_at_work(self.interval_s);
        }
        for (tag, reading) in std::mem::take(&mut self.first) {
            self.take(tag, reading, out);
        }
    }

    fn new_predictor(&self) -> Predictor {
        match self.compensator {
            Compensator::Physical(physical) => {
                Predictor::Physical(Box::new(physical.filter(self.interval_s, self.delay)))
            }
            Compensator::Piecewise(_) => Predictor::Piecewise,
            Compensator::Regression(_) => Predictor::Regression(Window::new(self.delay)),
            Compensator::Learned(_) => Predictor::Learned(Box::default()),
        }
    }

    fn restart(&mut self) {
        if let Some(formulas) = &mut self.formulas {
            formulas.restart();
        }
        match self.predictor.as_mut() {
            Some(Predictor::Physical(filter)) => filter.restart(),
            Some(Predictor::Regression(window)) => *window = Window::new(self.delay),
            Some(Predictor::Learned(follower)) => **follower = Follower::default(),
            Some(Predictor::Piecewise) | None => {}
        }
    }

    fn take(&mut self, tag: T, reading: Option<Reading>, out: &mut impl FnMut(Compensated<T>)) {
        let mut pending = Pending {
            tag,
            step: None,
            time_s: f64::NAN,
            temperature_k: None,
            channel_rad_per_s: 0.0,
            columns: FormulaColumns::default(),
            rate_rad_per_s: None,
            flags: Vec::new(),
            bias_rad_per_s: None,
        };
        if let Some(reading) = reading.filter(|r| r.time_s.is_finite()) {
            let steps = self.steps_to(reading.time_s, &mut pending.flags);
            for _ in 1..steps {
                self.advance(None, None);
            }
            let temperature_k = self.accept(reading.temperature_k.filter(|t| t.is_finite()), steps);
            if temperature_k.is_none() {
                pending.flags.push(Flag::TemperatureHeld);
            }
            let channel = reading.channel_rad_per_s.filter(|c| c.is_finite());
            if channel.is_none() {
                pending.flags.push(Flag::ChannelHeld);
            }
            (pending.channel_rad_per_s, pending.columns) = self.seen(reading.time_s, channel, &reading.columns);
            let of_the_air_k = match self.compensator {
                Compensator::Physical(physical) => temperature_k.map(|t| physical.of_the_air_k(reading.time_s, t)),
                Compensator::Piecewise(_) | Compensator::Regression(_) | Compensator::Learned(_) => temperature_k,
            };
            self.advance(of_the_air_k, reading.inner_k.filter(|t| t.is_finite()));
            pending.time_s = reading.time_s;
            pending.step = Some(self.step);
            pending.temperature_k = temperature_k.or(self.last_temperature.map(|(t, _)| t));
            pending.rate_rad_per_s = reading.rate_rad_per_s.filter(|r| r.is_finite());
        } else {
            pending.flags.push(Flag::Malformed);
        }
        self.pending.push_back(pending);
        // Rows that waited their time, and unreadable ones in front of the queue.
        while self.pending.front().is_some_and(|p| p.step.is_none_or(|s| self.step - s >= self.delay as u64)) {
            self.find_bias(0);
            self.emit(out);
        }
    }

    fn steps_to(&mut self, time_s: f64, flags: &mut Vec<Flag>) -> u64 {
        let since_s = time_s - self.last_s;
        self.last_s = time_s;
        if since_s == f64::INFINITY {
            return 1;
        }
        self.bridgeable_steps = (self.bridgeable_steps + BRIDGED_STEPS_A_ROW).min(LONGEST_GAP_STEPS);
        if since_s < LEAST_INTERVAL_S {
            flags.push(Flag::ClockBack);
            return 1;
        }
        if since_s < GAP * self.interval_s {
            return 1;
        }
        flags.push(Flag::Gap);
        let steps = (since_s / self.interval_s).round();
        if steps > self.bridgeable_steps {
            for row in 0..self.pending.len() {
                self.find_bias(row);
            }
            self.restart();
            self.last_temperature = None;
            return 1;
        }
        self.bridgeable_steps -= steps;
        steps as u64
    }

    /// A temperature that does not leap, or that several leaps agree on.
    fn accept(&mut self, temperature_k: Option<f64>, steps: u64) -> Option<f64> {
        let temperature_k = temperature_k?;
        let now = self.step + 1;
        if let Some((last_k, at)) = self.last_temperature {
            let since_s = (now.saturating_sub(at).max(steps)) as f64 * self.interval_s;
            let limit_k = LEAP_K + LEAP_K_PER_S * since_s;
            if (temperature_k - last_k).abs() > limit_k {
                self.leaps.push(temperature_k);
                let agree = self.leaps.iter().all(|l| (l - temperature_k).abs() <= limit_k);
                if self.leaps.len() < LEAPS || !agree {
                    if !agree {
                        self.leaps.clear();
                    }
                    return None;
                }
                self.restart();
            }
        }
        self.leaps.clear();
        self.last_temperature = Some((temperature_k, now));
        Some(temperature_k)
    }

    fn advance(&mut self, temperature_k: Option<f64>, inner_k: Option<f64>) {
        // The bias of a row whose time is up is found before the step that would push it out of the filter's memory.
        for row in 0..self.pending.len() {
            match self.pending[row].step {
                Some(step) if self.step - step >= self.delay as u64 => self.find_bias(row),
                Some(_) => break,
                None => {}
            }
        }
        match self.predictor.as_mut() {
            Some(Predictor::Physical(filter)) => {
                filter.step(temperature_k);
                if let Some(formulas) = &mut self.formulas {
                    formulas.see(&filter.state(), self.delay + 1);
                }
            }
            Some(Predictor::Regression(window)) => window.push(temperature_k, inner_k),
            Some(Predictor::Learned(follower)) => {
                if let Compensator::Learned(learned) = self.compensator {
                    let time_s = self.step as f64 * self.interval_s;
                    follower.step(learned, time_s, temperature_k, self.delay + 2);
                }
            }
            Some(Predictor::Piecewise) | None => {}
        }
        self.step += 1;
    }

    /// What the row's rate sees of the further columns: of what the model's channels add, and of each that formulas read.
    fn seen(&mut self, time_s: f64, channel_rad_per_s: Option<f64>, columns: &FormulaColumns) -> (f64, FormulaColumns) {
        let Compensator::Physical(physical) = self.compensator else { return (0.0, FormulaColumns::default()) };
        let Some((last_s, last, before)) = self.last_columns else {
            let channel = channel_rad_per_s.unwrap_or(0.0);
            self.last_columns = Some((time_s, channel, *columns));
            return (channel, *columns);
        };
        let now = channel_rad_per_s.unwrap_or(last);
        self.last_columns = Some((time_s, now, *columns));
        let (since_s, mean_s) = (time_s - last_s, physical.rate_mean_s());
        (seen(now, last, since_s, mean_s), columns_seen(columns, &before, since_s, mean_s))
    }

    /// The bias of a pending row as it is known now.
    fn find_bias(&mut self, row: usize) {
        let Some(pending) = self.pending.get(row) else { return };
        let (Some(step), None) = (pending.step, pending.bias_rad_per_s) else { return };
        let lag = (self.step - step) as usize;
        let (time_s, temperature_k, channel) = (pending.time_s, pending.temperature_k, pending.channel_rad_per_s);
        let columns = pending.columns;
        let bias_rad_per_s = match (&self.predictor, self.compensator) {
            (Some(Predictor::Physical(filter)), Compensator::Physical(physical)) => (lag <= self.delay).then(|| {
                let air = filter.rate_error_rad_per_s(lag);
                let known = physical.error_rad_per_s(air, time_s, temperature_k, channel);
                let thermal = physical.thermal_rate_rad_per_s(air, time_s, temperature_k);
                let formulas = self.formulas.as_mut();
                let beside = formulas.map_or(0.0, |f| f.rate_rad_per_s(lag, time_s, thermal, &columns));
                known + beside + physical.offset_rad_per_s
            }),
            (Some(Predictor::Regression(window)), Compensator::Regression(regression)) => {
                Some(regression.bias_rad_per_s(&window.regressors(lag, self.interval_s)))
            }
            (Some(Predictor::Learned(follower)), _) => follower.bias_rad_per_s(lag),
            (_, Compensator::Piecewise(piecewise)) => temperature_k.map(|t| piecewise.bias_rad_per_s(t)),
            _ => None,
        };
        if let Some(pending) = self.pending.get_mut(row) {
            pending.bias_rad_per_s = bias_rad_per_s;
        }
    }

    /// Sends the oldest row on its way.
    fn emit(&mut self, out: &mut impl FnMut(Compensated<T>)) {
        let Some(mut row) = self.pending.pop_front() else { return };
        if row.step.is_none() {
            out(Compensated { tag: row.tag, rate_rad_per_s: None, flags: row.flags });
            return;
        }
        let compensated = match row.rate_rad_per_s {
            None => {
                row.flags.push(Flag::RateHeld);
                self.last_compensated
            }
            Some(rate) => {
                let mut after = [0.0; NEIGHBOURS];
                let found = self.pending.iter().filter_map(|p| p.rate_rad_per_s);
                let rows = after.iter_mut().zip(found).map(|(place, rate)| *place = rate).count();
                let kept = self.without_gross_error(rate, &mut after[..rows], &mut row.flags);
                row.bias_rad_per_s.map(|bias| kept - bias)
            }
        };
        self.last_compensated = compensated.or(self.last_compensated);
        out(Compensated { tag: row.tag, rate_rad_per_s: compensated, flags: row.flags });
    }

    fn without_gross_error(&mut self, rate: f64, after: &mut [f64], flags: &mut Vec<Flag>) -> f64 {
        let mut before = [0.0; NEIGHBOURS];
        let rows = before.iter_mut().zip(&self.before).map(|(place, rate)| *place = *rate).count();
        let (earlier, later) = (median_in_place(&mut before[..rows]), median_in_place(after));
        let limit = (GROSS * self.usual_change).max(APART * (later - earlier).abs());
        let gross = self.rates_seen > SETTLING_ROWS && (rate - earlier).abs() > limit && (rate - later).abs() > limit;
        let kept = if gross {
            flags.push(Flag::RateRejected);
            0.5 * (earlier + later)
        } else {
            rate
        };
        if let Some(last) = self.before.back() {
            // A median that follows: up and down by the same factor, so that half of the changes are larger.
            let change = (kept - last).abs();
            self.usual_change = match self.usual_change {
                0.0 => change,
                usual if change > usual => usual * FOLLOW,
                usual => usual / FOLLOW,
            };
        }
        self.rates_seen += 1;
        self.before.push_back(kept);
        if self.before.len() > NEIGHBOURS {
            self.before.pop_front();
        }
        kept
    }
}

/// How fast the usual change of rate follows.
const FOLLOW: f64 = 1.05;
