//! The physical compensator: the coil's own model driven by one thermometer, as a small difference equation.
//!
//! ```text
//! x: the chamber's system, its air seen through the sensor,   Ω_coil = c·dx/dt
//! Ω = f(T) (Ω_coil + Ω_h(t)) + b(T) + Σ g_c c + Ω_0
//! ```
//!
//! | symbol | meaning | in code |
//! |---|---|---|
//! | x | modes of the pack behind its film, the air's trend, turbulence and ripple, the sensor | [`crate::chamber::Causal`] |
//! | f(T), Ω_h | factor of the coil's error over temperature; heat from the electronics | `factor`, `heating` |
//! | b(T), g_c | bias over temperature; rate per unit of a further column | `bias`, `channels` |
//! | Ω_0 | offset of the record it was tuned on | `offset_rad_per_s` |
//!
//! How x is known from the readings is in [`super::filter`]: the model of `compare` and `diagnose`, run forwards. Film,
//! thermometer and air are those that a record's readings and rates showed together; delay and offset are chosen by what
//! the filter leaves of the record's rate.
//!
//! Holds for models that are linear in the temperatures' rates, besides a factor and a bias over temperature. A conductivity
//! that depends on temperature is taken at the middle of the fitted record's temperatures, and how much it differs at its
//! ends is stated.
//!
//! # Source
//! As [`super::filter`]; the chamber as in [`crate::chamber`].

mod beside;

use super::CompensateError;
use super::filter::{Dynamics, Filter, Tuning};
use super::formulas::{Formulas, seen};
use super::heating::Heating;
use crate::chamber::{BREAK_K2_PER_S2, BREAKS_PER_S, Causal, Surroundings};
use crate::effect::DeclaredEffect;
use crate::numeric::piecewise::PiecewiseLinear;
use crate::parallel::InParallel;
use crate::pattern::Pattern;
use crate::rate::{CoilModel, RateModel};
use crate::record::Record;
use crate::thermal::pack::Pack;
use crate::thermal::{Extent, HeatPath, Location, PackMaterial, ThermalError, ThermalHistory};
use crate::units::REFERENCE_TEMPERATURE_K;

const USUAL_DELAY_S: f64 = 100.0;
/// Hypotheses about the last break of the air's slope.
pub const USUAL_HYPOTHESES: usize = 8;
/// Wanders within this factor of the best mean square are as good: the largest follows most of what another record may hold.
const WANDER_AS_GOOD: f64 = 1.1;
/// Delays within this factor are as good: the shortest is taken.
const DELAY_AS_GOOD: f64 = 1.01;
/// Noise of the air's slope between breaks that is tried \[K²/s³\], largest first: 10 to the power of so many halves.
const WANDER_HALF_DECADES: std::ops::RangeInclusive<i32> = 12..=24;
/// Rows that tell delay, wander and offset.
const MOST_ROWS_TUNED: usize = 20_000;
/// The most rows that a compensator looks ahead.
pub(crate) const MOST_DELAY_ROWS: usize = 512;
const TABLE_FROM_K: f64 = REFERENCE_TEMPERATURE_K - 100.0;
const TABLE_ROWS: usize = 201;

/// The model as far as compensation needs it, and the tuning.
#[derive(Debug, Clone)]
pub struct Physical {
    path: HeatPath,
    /// dΩ/dṪ_j, and dΩ/dȧ.
    gains: Vec<f64>,
    gain_air: f64,
    surroundings: Surroundings,
    lag_s: f64,
    rate_mean_s: f64,
    /// Over temperature, where the model has a bias that depends on it.
    bias: Option<PiecewiseLinear>,
    /// Over temperature, where the whole coil's error scales with it.
    factor: Option<PiecewiseLinear>,
    heating: Option<Heating>,
    /// Further columns and what each adds [rad/s per unit].
    channels: Vec<(String, f64)>,
    formulas: Option<Formulas>,
    /// Where the conductivity depends on temperature.
    linearised: Option<Linearised>,
    /// At least 1; with 1 it is one difference equation without breaks.
    pub hypotheses: usize,
    pub(crate) delay_s: f64,
    /// Bias of the record that it was tuned on.
    pub offset_rad_per_s: f64,
}

/// A stretch of a record, ready for trials.
struct Part {
    record: Record,
    dynamics: Dynamics,
    /// What formulas add to each row.
    beside: Vec<f64>,
    /// In rows of the record, those that are tried.
    lags: Vec<usize>,
}

/// A conductivity that was taken at one temperature.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Linearised {
    /// The temperature at which it was taken.
    pub at_k: f64,
    /// The largest relative difference of the conductivity over the fitted record.
    pub conductivity_error: f64,
}

impl Physical {
    /// From a model, with surroundings as they usually are.
    ///
    /// # Errors
    /// A model that is not linear in the rates, or whose heat path cannot be solved.
    pub(crate) fn new(model: &CoilModel, pattern: &Pattern) -> Result<Self, CompensateError> {
        Self::within(model, pattern, Surroundings::usual(), None)
    }

    /// Within surroundings that records showed; `range_k` is that of their temperatures.
    ///
    /// # Errors
    /// As [`Physical::new`].
    pub(crate) fn within(
        model: &CoilModel,
        pattern: &Pattern,
        surroundings: Surroundings,
        range_k: Option<(f64, f64)>,
    ) -> Result<Self, CompensateError> {
        let (model, formulas) = &Formulas::split(model);
        let mut path = model.heat_path()?;
        let is_half_space = path.extent == Extent::HalfSpace;
        let cannot_be_heated = is_half_space || matches!(path.material, PackMaterial::Diffusivity { .. });
        let has_no_chain = |p: &HeatPath| p.varies_along() || (p.has_own_course() && cannot_be_heated);
        if has_no_chain(&path) {
            let is_refused = |one: &CoilModel| one.heat_path().is_ok_and(|p| has_no_chain(&p));
            return Err(not_linear(model, is_refused));
        }
        let linearised = linearise(&mut path, range_k);
        let layers = path.shape.layers;
        let Some(linear) = linear_gains(model, pattern, layers)? else {
            let is_refused = |one: &CoilModel| matches!(linear_gains(one, pattern, layers), Ok(None));
            return Err(not_linear(model, is_refused));
        };
        let LinearModel { gains, gain_air, factor, bias, channels } = linear;
        let mut heating = None;
        if path.has_own_course() {
            let mut heated = path.clone();
            if path.location == Location::OuterLayer {
                heated.location = Location::Ambient;
            }
            if path.location == Location::OuterLayer {
                heated.film_w_per_m2_k = Some(surroundings.film_w_per_m2_k);
            }
            let slowest_per_s = Pack::new(&heated)?.decays_per_s().iter().copied().fold(f64::INFINITY, f64::min);
            heating = Heating::of(&heated, &gains, slowest_per_s, model.rate_mean_s, model.sensor_lag_s())?;
            if path.location != Location::OuterLayer {
                heating = heating.map(Heating::unseen);
            }
            path = path.driven_only();
        }
        let found = Self {
            formulas: Formulas::new(&model.coil, formulas.clone()),
            path,
            gains,
            gain_air,
            surroundings,
            lag_s: model.sensor_lag_s(),
            rate_mean_s: model.rate_mean_s,
            bias,
            factor,
            heating,
            channels,
            linearised,
            hypotheses: USUAL_HYPOTHESES,
            delay_s: USUAL_DELAY_S,
            offset_rad_per_s: 0.0,
        };
        found.causal(1.0)?;
        Ok(found)
    }

    /// Chooses delay and offset so that the records' rates are compensated best, each about its own mean, and how much more the
    /// air's slope wanders to a filter that does not know beforehand when it breaks. The offset is the mean of all.
    pub(crate) fn tune(&mut self, records: &[&Record]) {
        let most = MOST_ROWS_TUNED / records.len().max(1);
        let interval_s = records.iter().map(|record| record.interval_s()).fold(0.0, f64::max);
        let part = |record: &&Record| {
            let record = record.stretch(0..record.rows().min(most)).unwrap_or_else(|_| (*record).clone());
            let own_s = record.interval_s();
            let dynamics = self.dynamics(own_s).ok()?;
            let lags = (0..=TRIAL_DELAY_ROWS).map(|lag| (lag as f64 * interval_s / own_s).round() as usize);
            let lags = lags.map(|lag| lag.min(MOST_DELAY_ROWS)).collect();
            Some(Part { beside: self.formulas_over(&record), record, dynamics, lags })
        };
        let parts: Option<Vec<Part>> = records.iter().map(part).collect();
        let Some(parts) = parts.filter(|parts| !parts.is_empty()) else { return };
        let least = |squares: &[f64]| squares.iter().copied().fold(f64::INFINITY, f64::min);
        let trials: Vec<(Surroundings, Vec<f64>, Vec<f64>)> = WANDER_HALF_DECADES
            .in_parallel()
            .map(|halves| {
                let mut trial = self.clone();
                trial.surroundings = self.surroundings.wandering(10f64.powf(-0.5 * f64::from(halves)));
                let (squares, means) = trial.misfit(&parts);
                (trial.surroundings, squares, means)
            })
            .collect();
        let best = trials.iter().map(|t| least(&t.1)).fold(f64::INFINITY, f64::min);
        let Some((surroundings, squares, means)) = trials.into_iter().find(|t| least(&t.1) <= WANDER_AS_GOOD * best)
        else {
            return;
        };
        let own = least(&squares);
        let lag = squares.iter().position(|s| *s <= DELAY_AS_GOOD * own).unwrap_or(0).max(1);
        self.surroundings = surroundings;
        self.delay_s = lag as f64 * interval_s;
        self.offset_rad_per_s = means[lag];
    }

    /// Variance about each record's own mean, and the mean, of the compensated rate at each lag.
    fn misfit(&self, parts: &[Part]) -> (Vec<f64>, Vec<f64>) {
        let by_part: Vec<Vec<(f64, f64, f64)>> = parts.iter().map(|part| self.sums(part)).collect();
        (0..=TRIAL_DELAY_ROWS)
            .map(|lag| {
                let (mut rows, mut sums, mut squares) = (0.0, 0.0, 0.0);
                for (n, sum, square) in by_part.iter().map(|part| part[lag]) {
                    rows += n;
                    sums += sum;
                    squares += square - sum * sum / n;
                }
                (squares / rows, sums / rows)
            })
            .unzip()
    }

    /// Rows, sum and sum of squares of the compensated rate at each lag.
    fn sums(&self, part: &Part) -> Vec<(f64, f64, f64)> {
        let Part { record, dynamics, beside, lags } = part;
        let interval_s = record.interval_s();
        let mut filter = Filter::new(dynamics, &self.tuning(interval_s, lags[TRIAL_DELAY_ROWS]));
        let mut sums = vec![(0.0, 0.0, 0.0); TRIAL_DELAY_ROWS + 1];
        let rates = record.rate_rad_per_s();
        let error = |row: usize, air: f64| {
            let channel = self.channel_seen_rad_per_s(record, row).unwrap_or(0.0);
            self.error_rad_per_s(air, record.times_s()[row], Some(record.temperature_k()[row]), channel)
        };
        let mut rows_of_step: Vec<Option<usize>> = Vec::new();
        let mut last_s = record.times_s()[0];
        for (row, (&time_s, &temperature_k)) in record.times_s().iter().zip(record.temperature_k()).enumerate() {
            let steps = ((time_s - last_s) / interval_s).round().max(if row == 0 { 0.0 } else { 1.0 }) as usize;
            for _ in 1..steps.min(MOST_DELAY_ROWS) {
                filter.step(None);
                rows_of_step.push(None);
            }
            filter.step(Some(self.of_the_air_k(time_s, temperature_k)));
            rows_of_step.push(Some(row));
            last_s = time_s;
            for (&lag, sum) in lags.iter().zip(&mut sums) {
                let Some(step) = rows_of_step.len().checked_sub(lag + 1) else { continue };
                if let Some(then) = rows_of_step[step] {
                    let left = rates[then] - beside[then] - error(then, filter.rate_error_rad_per_s(lag));
                    *sum = (sum.0 + 1.0, sum.1 + left, sum.2 + left * left);
                }
            }
        }
        sums
    }

    fn causal(&self, interval_s: f64) -> Result<Causal, ThermalError> {
        Causal::new(&self.path, &self.gains, self.gain_air, self.lag_s, &self.surroundings, interval_s)
    }

    fn dynamics(&self, interval_s: f64) -> Result<Dynamics, ThermalError> {
        Ok(Dynamics::new(&self.causal(interval_s)?, interval_s, self.rate_mean_s.min(interval_s)))
    }

    fn tuning(&self, interval_s: f64, delay_rows: usize) -> Tuning {
        let (least, most) = BREAK_PROBABILITIES;
        Tuning {
            slope_variance: self.surroundings.rest_noise_k2_per_s3() * interval_s,
            break_probability: (BREAKS_PER_S * interval_s).clamp(least, most),
            break_variance: BREAK_K2_PER_S2,
            noise_k: self.surroundings.reading_noise_k().max(LEAST_NOISE_K),
            delay_rows,
            hypotheses: self.hypotheses,
        }
    }

    /// The filter for records of one interval.
    pub fn filter(&self, interval_s: f64, delay_rows: usize) -> Filter {
        // What was solved for one interval is solved for another: only how many modes are states differs.
        let dynamics = self.dynamics(interval_s).expect("the heat path was solved when the compensator was made");
        Filter::new(&dynamics, &self.tuning(interval_s, delay_rows))
    }

    /// Further columns that the model reads.
    pub fn channel_names(&self) -> impl Iterator<Item = &str> {
        self.channels.iter().map(|c| c.0.as_str())
    }

    /// What the further columns add; None where one is missing.
    pub fn channel_bias_rad_per_s(&self, values: impl Iterator<Item = Option<f64>>) -> Option<f64> {
        self.channels.iter().zip(values).map(|((_, gain), value)| Some(gain * value.filter(|v| v.is_finite())?)).sum()
    }

    /// As a rate sees it.
    fn channel_seen_rad_per_s(&self, record: &Record, row: usize) -> Option<f64> {
        let now = self.channel_bias_of(record, row)?;
        let Some(last) = row.checked_sub(1) else { return Some(now) };
        let before = self.channel_bias_of(record, last).unwrap_or(f64::NAN);
        Some(seen(now, before, record.times_s()[row] - record.times_s()[last], self.rate_mean_s))
    }

    /// The time that a rate is a mean over \[s\].
    pub(crate) fn rate_mean_s(&self) -> f64 {
        self.rate_mean_s
    }

    pub(super) fn channel_bias_of(&self, record: &Record, row: usize) -> Option<f64> {
        let value = |name: &str| Some(record.channels().iter().find(|c| c.name == name)?.values[row]);
        self.channel_bias_rad_per_s(self.channel_names().map(value))
    }

    /// None where the conductivity does not depend on temperature.
    pub fn linearised(&self) -> Option<Linearised> {
        self.linearised
    }

    /// A reading without what the heat in the bore does to it.
    pub(super) fn of_the_air_k(&self, time_s: f64, temperature_k: f64) -> f64 {
        self.heating.as_ref().map_or(temperature_k, |h| temperature_k - h.reading_k(time_s))
    }

    /// The whole rate error of a row but for the offset, `air_rad_per_s` being what the air's temperature makes in the coil.
    pub(super) fn error_rad_per_s(
        &self,
        air_rad_per_s: f64,
        time_s: f64,
        temperature_k: Option<f64>,
        channel_rad_per_s: f64,
    ) -> f64 {
        let coil = air_rad_per_s + self.heating.as_ref().map_or(0.0, |h| h.rate_rad_per_s(time_s));
        let at = |table: &Option<PiecewiseLinear>, without: f64| match (table, temperature_k) {
            (Some(table), Some(temperature_k)) => table.value(temperature_k),
            _ => without,
        };
        coil * at(&self.factor, 1.0) + at(&self.bias, 0.0) + channel_rad_per_s
    }

    /// Whether the difference equation, and formulas beside it, are all there is.
    pub(crate) fn is_linear(&self) -> bool {
        self.bias.is_none() && self.factor.is_none() && self.heating.is_none() && self.channels.is_empty()
    }
}

/// Rows of delay that are tried while tuning.
const TRIAL_DELAY_ROWS: usize = 30;
const LEAST_NOISE_K: f64 = 1e-6;
/// A row is never sure to hold a break, nor sure not to.
const BREAK_PROBABILITIES: (f64, f64) = (1e-6, 0.1);

/// Takes the conductivity at the middle of a range of temperatures.
fn linearise(path: &mut HeatPath, range_k: Option<(f64, f64)>) -> Option<Linearised> {
    let slope_per_k = std::mem::take(&mut path.conductivity_slope_per_k);
    if slope_per_k == 0.0 {
        return None;
    }
    let (low_k, high_k) = range_k.unwrap_or((REFERENCE_TEMPERATURE_K, REFERENCE_TEMPERATURE_K));
    let at_k = 0.5 * (low_k + high_k);
    let factor = 1.0 + slope_per_k * (at_k - REFERENCE_TEMPERATURE_K);
    match &mut path.material {
        PackMaterial::Conductivity { w_per_m_k, .. } => *w_per_m_k *= factor,
        PackMaterial::Diffusivity { m2_per_s } => *m2_per_s *= factor,
    }
    Some(Linearised { at_k, conductivity_error: (slope_per_k * 0.5 * (high_k - low_k) / factor).abs() })
}

/// The declared effects that no difference equation of this kind can hold: those that are refused on their own too.
fn not_linear(model: &CoilModel, is_refused: impl Fn(&CoilModel) -> bool) -> CompensateError {
    let alone = |effect: &DeclaredEffect| CoilModel { effects: vec![effect.clone()], ..model.clone() };
    let effects = model.effects.iter().filter(|e| is_refused(&alone(e))).map(DeclaredEffect::kind).collect();
    CompensateError::NotLinear { effects }
}

/// What a model is where it is linear in the temperatures' rates.
struct LinearModel {
    /// dΩ/dṪ_j.
    gains: Vec<f64>,
    /// dΩ/dȧ.
    gain_air: f64,
    /// By which both grow with temperature, over it; None where they do not.
    factor: Option<PiecewiseLinear>,
    /// Over temperature.
    bias: Option<PiecewiseLinear>,
    channels: Vec<(String, f64)>,
}

/// None where that is not the whole model.
#[expect(clippy::too_many_lines, reason = "probes of one model, and the check that they say all of it")]
fn linear_gains(model: &CoilModel, pattern: &Pattern, layers: usize) -> Result<Option<LinearModel>, CompensateError> {
    let names = model.missing_channels(&[]);
    let rate = RateModel::new(model, pattern, &names)?;
    let off = vec![0.0; names.len()];
    let at = |temperature_k: f64, rates: &[f64], air: f64, channels: &[f64]| {
        let history = ThermalHistory {
            layers,
            times_s: vec![0.0],
            temperature_k: vec![temperature_k; layers],
            rate_k_per_s: rates.to_vec(),
            axial_moment_k_per_s: Vec::new(),
            axial_moment_k: Vec::new(),
            ambient_k: vec![temperature_k],
            ambient_rate_k_per_s: vec![air],
        };
        rate.rate_error_rad_per_s(&rate.state(&history, 0, channels))
    };
    let still = vec![0.0; layers];
    let zero = at(REFERENCE_TEMPERATURE_K, &still, 0.0, &off);
    // A usual ramp's rate, so that what is linear is probed where it is used.
    let probe_k_per_s = 1e-2;
    let gains: Vec<f64> = (0..layers)
        .map(|layer| {
            let mut rates = still.clone();
            rates[layer] = probe_k_per_s;
            (at(REFERENCE_TEMPERATURE_K, &rates, 0.0, &off) - zero) / probe_k_per_s
        })
        .collect();
    let gain_air = (at(REFERENCE_TEMPERATURE_K, &still, probe_k_per_s, &off) - zero) / probe_k_per_s;
    let channel_gains: Vec<f64> = (0..names.len())
        .map(|channel| {
            let mut one = off.clone();
            one[channel] = 1.0;
            at(REFERENCE_TEMPERATURE_K, &still, 0.0, &one) - zero
        })
        .collect();
    let table: Vec<f64> = (0..TABLE_ROWS).map(|i| TABLE_FROM_K + i as f64).collect();
    let biases: Vec<f64> = table.iter().map(|&t| at(t, &still, 0.0, &off)).collect();
    let size: f64 = gains.iter().map(|g| g.abs() * probe_k_per_s).sum::<f64>().max(f64::MIN_POSITIVE);
    // All layers as they push the error: the largest there is, and so the one that tells a factor best.
    let all: Vec<f64> = gains.iter().map(|g| probe_k_per_s * g.signum()).collect();
    let pushed = |temperature_k: f64| at(temperature_k, &all, 0.0, &off) - at(temperature_k, &still, 0.0, &off);
    let factor_at = |temperature_k: f64| pushed(temperature_k) / size;
    let factors: Vec<f64> = table.iter().map(|&t| factor_at(t)).collect();
    for (sign, above_k) in [(1.0, 0.0), (-1.0, 0.0), (1.0, 30.0), (-0.5, -30.0)] {
        let rates: Vec<f64> = (0..layers).map(|j| sign * probe_k_per_s * (1.0 + j as f64 / layers as f64)).collect();
        let air = 0.7 * sign * probe_k_per_s;
        let values: Vec<f64> = (0..names.len()).map(|c| sign * (3.0 + c as f64)).collect();
        let temperature_k = REFERENCE_TEMPERATURE_K + above_k;
        let from_channels: f64 = channel_gains.iter().zip(&values).map(|(g, v)| g * v).sum();
        let coil = gains.iter().zip(&rates).map(|(g, r)| g * r).sum::<f64>() + gain_air * air;
        let expected = factor_at(temperature_k) * coil + at(temperature_k, &still, 0.0, &off) + from_channels;
        let found = at(temperature_k, &rates, air, &values);
        if (found - expected).abs() > 1e-9 * (size + from_channels.abs()) {
            return Ok(None);
        }
    }
    let over_temperature = |values: Vec<f64>, without: f64| {
        let varies = values.iter().any(|v| (v - without).abs() > 1e-9 * without);
        if varies { PiecewiseLinear::new(table.clone(), values).ok() } else { None }
    };
    let (factor, bias) = (over_temperature(factors, 1.0), over_temperature(biases, 0.0));
    let channels = names.into_iter().zip(channel_gains).collect();
    Ok(Some(LinearModel { gains, gain_air, factor, bias, channels }))
}
