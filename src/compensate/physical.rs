//! The physical compensator: the coil's own model driven by one thermometer, as a small difference equation.
//!
//! ```text
//! x = (y_1 … y_m, a, s [, z]),  y_i' = −λ_i y_i + s,  a' = s,  s' = white + breaks,  τ z' = T_out − z
//! Ω_coil = ω·x,   Ω = f(T) (Ω_coil + Ω_h(t)) + b(T) + Σ g_c c + Ω_0
//! ```
//!
//! | symbol | meaning | in code |
//! |---|---|---|
//! | y_i, a, s | modes of the pack behind its film, air temperature and its rate | `decay_per_s`, `outer`, `functional` |
//! | z | the sensor behind its lag | `lag_s` |
//! | f(T), Ω_h | factor of the coil's error over temperature; heat from the electronics | `factor`, `heating` |
//! | b(T), g_c | bias over temperature; rate per unit of a further column | `bias`, `channels` |
//! | Ω_0 | offset of the record it was tuned on | `offset_rad_per_s` |
//!
//! How x is known from the readings is in [`super::filter`]. Film and thermometer's noise come from the boundary's estimate
//! of a record; how much the slope wanders, the delay and the offset from the record's rate.
//!
//! Holds for models that are linear in the temperatures' rates, besides a factor and a bias over temperature. A conductivity
//! that depends on temperature is taken at the middle of the fitted record's temperatures, and how much it differs at its
//! ends is stated. Modes that settle within a quarter of a row follow at once.
//!
//! # Source
//! As [`super::filter`]; the pack's modes as in [`crate::thermal::pack`].

mod beside;

use nalgebra::DMatrix;

use super::CompensateError;
use super::filter::{Dynamics, Filter, Tuning};
use super::formulas::Formulas;
use super::heating::Heating;
use crate::boundary::Boundary;
use crate::effect::DeclaredEffect;
use crate::numeric::piecewise::PiecewiseLinear;
use crate::pattern::Pattern;
use crate::rate::{CoilModel, RateModel};
use crate::record::Record;
use crate::thermal::pack::Pack;
use crate::thermal::{Extent, HeatPath, Location, Material, ThermalHistory};
use crate::units::REFERENCE_TEMPERATURE_K;

/// The film where no record told it: moving air in a chamber.
const USUAL_FILM_W_PER_M2_K: f64 = 25.0;
/// The thermometer's noise where no record told it.
const USUAL_NOISE_K: f64 = 0.005;
/// (K/s)² per s; a chamber's air between its breaks.
const USUAL_SLOPE_NOISE: f64 = 3e-10;
const USUAL_DELAY_S: f64 = 100.0;
/// Hypotheses about the last break of the air's slope.
pub const USUAL_HYPOTHESES: usize = 8;
/// Slope noises within this factor of the best mean square are as good: the largest follows most of what another record
/// may hold.
const AS_GOOD: f64 = 1.1;
/// Delays within this factor are as good: the shortest is taken.
const DELAY_AS_GOOD: f64 = 1.01;
/// Modes faster than this many times a row follow at once.
const FAST: f64 = 4.0;
/// A half space is this many packs deep: heat does not come back within hours.
const DEEP: usize = 6;
/// A radius this many times the pack's makes a slab of it.
const FLAT: f64 = 1e3;
/// The most rows that a compensator looks ahead.
pub const MOST_DELAY_ROWS: usize = 512;
const TABLE_FROM_K: f64 = REFERENCE_TEMPERATURE_K - 100.0;
const TABLE_ROWS: usize = 201;

/// The model as far as compensation needs it, and the tuning.
#[derive(Debug, Clone)]
pub struct Physical {
    /// λ_i, ascending [1/s].
    decay_per_s: Vec<f64>,
    /// What each mode takes from the outermost layer's temperature.
    outer: Vec<f64>,
    /// What each mode takes from the rate error's integral [rad/K].
    functional: Vec<f64>,
    /// Of the air's temperature in the rate error's integral [rad/K].
    functional_air: f64,
    location: Location,
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
    pub noise_k: f64,
    pub slope_noise_k2_per_s3: f64,
    pub delay_s: f64,
    pub offset_rad_per_s: f64,
}

/// A conductivity that was taken at one temperature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Linearised {
    pub at_k: f64,
    /// The largest relative difference of the conductivity over the fitted record.
    pub conductivity_error: f64,
}

impl Physical {
    /// From a model, with usual values for what only a record can tell.
    ///
    /// # Errors
    /// A model that is not linear in the rates, or whose heat path cannot be solved.
    pub fn new(model: &CoilModel, pattern: &Pattern) -> Result<Self, CompensateError> {
        Self::with_film(model, pattern, USUAL_FILM_W_PER_M2_K, USUAL_NOISE_K, None)
    }

    /// With film and noise from a record's boundary.
    ///
    /// # Errors
    /// As [`Physical::new`].
    pub fn with_boundary(
        model: &CoilModel,
        pattern: &Pattern,
        boundary: &Boundary,
        record: &Record,
    ) -> Result<Self, CompensateError> {
        let film = boundary.air().film_w_per_m2_k.unwrap_or(USUAL_FILM_W_PER_M2_K);
        let range_k = record
            .temperature_k()
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), t| (low.min(*t), high.max(*t)));
        Self::with_film(model, pattern, film, boundary.air().noise_k, Some(range_k))
    }

    fn with_film(
        model: &CoilModel,
        pattern: &Pattern,
        film_w_per_m2_k: f64,
        noise_k: f64,
        range_k: Option<(f64, f64)>,
    ) -> Result<Self, CompensateError> {
        let (model, formulas) = &Formulas::split(model);
        let mut path = model.heat_path()?;
        let real_layers = path.shape.layers;
        let mut buried = 0;
        if path.extent == Extent::HalfSpace {
            path.extent = Extent::Pack;
            buried = (DEEP - 1) * real_layers;
            path.shape.layers = real_layers + buried;
            path.shape.bore_radius_m = FLAT * path.shape.radial_pitch_m * real_layers as f64;
        }
        let cannot_be_heated = buried > 0 || matches!(path.material, Material::Diffusivity { .. });
        if path.flange.is_some() || (path.bore_heat.is_some() && cannot_be_heated) {
            let is_refused = |one: &CoilModel| {
                one.heat_path().is_ok_and(|p| p.flange.is_some() || (p.bore_heat.is_some() && cannot_be_heated))
            };
            return Err(not_linear(model, is_refused));
        }
        let linearised = linearise(&mut path, range_k);
        let location = path.location;
        path.location = Location::Ambient;
        if location == Location::OuterLayer {
            path.film_w_per_m2_k = match path.material {
                Material::Conductivity { .. } => Some(film_w_per_m2_k),
                Material::Diffusivity { .. } => None,
            };
        }
        let pack = Pack::new(&path)?;
        let Some(linear) = linear_gains(model, pattern, real_layers)? else {
            let is_refused = |one: &CoilModel| matches!(linear_gains(one, pattern, real_layers), Ok(None));
            return Err(not_linear(model, is_refused));
        };
        let LinearModel { gains, gain_air, factor, bias, channels } = linear;
        let mut order: Vec<usize> = (0..pack.decays_per_s().len()).collect();
        order.sort_by(|a, b| pack.decays_per_s()[*a].total_cmp(&pack.decays_per_s()[*b]));
        let slowest_per_s = order.first().map_or(f64::INFINITY, |&i| pack.decays_per_s()[i]);
        let mut heating = Heating::of(&path, &gains, slowest_per_s, model.rate_mean_s, model.sensor_lag_s())?;
        if location == Location::Ambient {
            heating = heating.map(Heating::unseen);
        }
        let functional = |mode: usize| -> f64 {
            gains.iter().enumerate().map(|(layer, gain)| gain * pack.amplitude(buried + layer, mode)).sum()
        };
        let amplitude =
            DMatrix::from_fn(real_layers, order.len(), |layer, mode| pack.amplitude(buried + layer, order[mode]));
        Ok(Self {
            formulas: Formulas::new(&model.coil, formulas.clone(), amplitude),
            decay_per_s: order.iter().map(|&i| pack.decays_per_s()[i]).collect(),
            outer: order.iter().map(|&i| pack.amplitude(path.shape.layers - 1, i)).collect(),
            functional: order.iter().map(|&i| functional(i)).collect(),
            functional_air: gains.iter().sum::<f64>() + gain_air,
            location,
            lag_s: model.sensor_lag_s(),
            rate_mean_s: model.rate_mean_s,
            bias,
            factor,
            heating,
            channels,
            linearised,
            hypotheses: USUAL_HYPOTHESES,
            noise_k,
            slope_noise_k2_per_s3: USUAL_SLOPE_NOISE,
            delay_s: USUAL_DELAY_S,
            offset_rad_per_s: 0.0,
        })
    }

    /// Chooses slope noise, delay and offset so that a record's rate is compensated best.
    pub fn tune(&mut self, record: &Record) {
        let interval_s = record.interval_s();
        let dynamics = self.dynamics(interval_s);
        let beside = self.formulas_over(record);
        let trials: Vec<(f64, Vec<f64>, Vec<f64>)> = (-24..=-12)
            .map(|exponent| {
                let mut trial = self.clone();
                trial.slope_noise_k2_per_s3 = 10f64.powf(0.5 * f64::from(exponent));
                let (squares, means) = trial.misfit(&dynamics, record, &beside);
                (trial.slope_noise_k2_per_s3, squares, means)
            })
            .collect();
        let least = |squares: &[f64]| squares.iter().copied().fold(f64::INFINITY, f64::min);
        let best = trials.iter().map(|t| least(&t.1)).fold(f64::INFINITY, f64::min);
        let Some((slope_noise, squares, means)) = trials.iter().rev().find(|t| least(&t.1) <= AS_GOOD * best) else {
            return;
        };
        let own = least(squares);
        let lag = squares.iter().position(|s| *s <= DELAY_AS_GOOD * own).unwrap_or(0).max(1);
        self.slope_noise_k2_per_s3 = *slope_noise;
        self.delay_s = lag as f64 * interval_s;
        self.offset_rad_per_s = means[lag];
    }

    /// Variance and mean of the compensated rate at each lag.
    fn misfit(&self, dynamics: &Dynamics, record: &Record, beside: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let interval_s = record.interval_s();
        let mut filter = Filter::new(dynamics, &self.tuning(interval_s, TRIAL_DELAY_ROWS));
        let mut sums = vec![(0.0, 0.0, 0.0); TRIAL_DELAY_ROWS + 1];
        let rates = record.rate_rad_per_s();
        let error = |row: usize, air: f64| {
            let channel = self.channel_bias_of(record, row).unwrap_or(0.0);
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
            for (lag, sum) in sums.iter_mut().enumerate() {
                let Some(step) = rows_of_step.len().checked_sub(lag + 1) else { continue };
                if let Some(then) = rows_of_step[step] {
                    let left = rates[then] - beside[then] - error(then, filter.rate_error_rad_per_s(lag));
                    *sum = (sum.0 + 1.0, sum.1 + left, sum.2 + left * left);
                }
            }
        }
        sums.iter().map(|(n, sum, square)| ((square - sum * sum / n) / n, sum / n)).unzip()
    }

    /// Modes that are states: the others follow within a row.
    fn slow_modes(&self, interval_s: f64) -> usize {
        self.decay_per_s.iter().take_while(|l| **l * interval_s < FAST).count()
    }

    fn dynamics(&self, interval_s: f64) -> Dynamics {
        let slow = self.slow_modes(interval_s);
        let has_lag = self.lag_s > 0.0;
        let n = slow + 2 + usize::from(has_lag);
        let (air, slope) = (slow, slow + 1);
        // What the fast modes take, being s/λ.
        let fast = |of: &[f64]| -> f64 { of.iter().zip(&self.decay_per_s).skip(slow).map(|(c, l)| -c / l).sum() };
        let row = |of_air: f64, of: &[f64]| -> DMatrix<f64> {
            let mut row = DMatrix::zeros(1, n);
            for (mode, c) in of[..slow].iter().enumerate() {
                row[mode] = -c;
            }
            row[air] = of_air;
            row[slope] = fast(of);
            row
        };
        let outer = match self.location {
            Location::OuterLayer => row(1.0, &self.outer),
            Location::Ambient => row(1.0, &vec![0.0; self.outer.len()]),
        };
        let mut dynamics = DMatrix::zeros(n, n);
        for (mode, l) in self.decay_per_s[..slow].iter().enumerate() {
            dynamics[(mode, mode)] = -l;
            dynamics[(mode, slope)] = 1.0;
        }
        dynamics[(air, slope)] = 1.0;
        let mut reading = outer.clone();
        let mut level_states = vec![air];
        if has_lag {
            for column in 0..n {
                dynamics[(n - 1, column)] = outer[column] / self.lag_s;
            }
            dynamics[(n - 1, n - 1)] = -1.0 / self.lag_s;
            reading = DMatrix::zeros(1, n);
            reading[n - 1] = 1.0;
            level_states.push(n - 1);
        }
        let functional = row(self.functional_air, &self.functional);
        let window_s = self.rate_mean_s.min(interval_s);
        Dynamics::new(&dynamics, &functional, reading, level_states, slope, interval_s, window_s)
    }

    fn tuning(&self, interval_s: f64, delay_rows: usize) -> Tuning {
        Tuning {
            slope_variance: self.slope_noise_k2_per_s3 * interval_s,
            noise_k: self.noise_k.max(LEAST_NOISE_K),
            delay_rows,
            hypotheses: self.hypotheses,
        }
    }

    /// The filter for records of one interval.
    pub fn filter(&self, interval_s: f64, delay_rows: usize) -> Filter {
        Filter::new(&self.dynamics(interval_s), &self.tuning(interval_s, delay_rows))
    }

    /// Further columns that the model reads.
    pub fn channel_names(&self) -> impl Iterator<Item = &str> {
        self.channels.iter().map(|c| c.0.as_str())
    }

    /// What the further columns add; None where one is missing.
    pub fn channel_bias_rad_per_s(&self, values: impl Iterator<Item = Option<f64>>) -> Option<f64> {
        self.channels.iter().zip(values).map(|((_, gain), value)| Some(gain * value.filter(|v| v.is_finite())?)).sum()
    }

    pub(super) fn channel_bias_of(&self, record: &Record, row: usize) -> Option<f64> {
        let value = |name: &str| Some(record.channels().iter().find(|c| c.name == name)?.values[row]);
        self.channel_bias_rad_per_s(self.channel_names().map(value))
    }

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
    pub fn is_linear(&self) -> bool {
        self.bias.is_none() && self.factor.is_none() && self.heating.is_none() && self.channels.is_empty()
    }
}

/// Rows of delay that are tried while tuning.
const TRIAL_DELAY_ROWS: usize = 30;
const LEAST_NOISE_K: f64 = 1e-6;

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
        Material::Conductivity { w_per_m_k, .. } => *w_per_m_k *= factor,
        Material::Diffusivity { m2_per_s } => *m2_per_s *= factor,
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
