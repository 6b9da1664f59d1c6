//! The physical compensator: the coil's own model driven by one thermometer, as a small linear difference equation.
//!
//! ```text
//! x = (y_1 … y_m, a, s [, z]),  y_i' = −λ_i y_i + s,  a' = s,  s' = white,  τ z' = T_out − z
//! x⁻ = F x,  o_0 = ω·x,  o_j = o_{j−1};   e = T − h·x⁻,  x = x⁻ + k e,  o_j = o_j + κ_j e
//! ```
//!
//! | symbol | meaning | in code |
//! |---|---|---|
//! | y_i, a, s | modes of the pack behind its film, air temperature and its rate | `Filter::state` |
//! | z | the sensor behind its lag | the last state, where there is a lag |
//! | o_j | rate error of the row j rows ago, given all readings until now | `Filter::chain` |
//! | k, κ | gains of the stationary Kalman filter and fixed-lag smoother | `gain`, `chain_gain` |
//!
//! The smoothed o_j is what a delay buys: a reading tells more about the row before it than about its own.
//!
//! Holds for models that are linear in the temperatures' rates, besides a bias that depends on temperature. Modes that
//! settle within a quarter of a row follow at once.
//!
//! # Source
//! Kalman, J. Basic Eng. 82 (1960) 35; fixed-lag smoothing by augmented states: Anderson and Moore, Optimal Filtering
//! (1979), section 7.3.

use nalgebra::DMatrix;

use super::CompensateError;
use crate::boundary::Boundary;
use crate::numeric::piecewise::PiecewiseLinear;
use crate::pattern::Pattern;
use crate::rate::{CoilModel, RateModel};
use crate::record::Record;
use crate::thermal::pack::Pack;
use crate::thermal::{Extent, Location, Material, ThermalHistory};
use crate::units::REFERENCE_TEMPERATURE_K;

/// The film where no record told it: moving air in a chamber.
const USUAL_FILM_W_PER_M2_K: f64 = 25.0;
/// The thermometer's noise where no record told it.
const USUAL_NOISE_K: f64 = 0.005;
/// (K/s)² per s; ramps of 1 K/min that begin every hour or so.
const USUAL_SLOPE_NOISE: f64 = 1e-9;
const USUAL_DELAY_S: f64 = 60.0;
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
    pub noise_k: f64,
    pub slope_noise_k2_per_s3: f64,
    pub delay_s: f64,
    pub offset_rad_per_s: f64,
}

impl Physical {
    /// From a model, with usual values for what only a record can tell.
    ///
    /// # Errors
    /// A model that is not linear in the rates, or whose heat path cannot be solved.
    pub fn new(model: &CoilModel, pattern: &Pattern) -> Result<Self, CompensateError> {
        Self::with_film(model, pattern, USUAL_FILM_W_PER_M2_K, USUAL_NOISE_K)
    }

    /// With film and noise from a record's boundary.
    ///
    /// # Errors
    /// As [`Physical::new`].
    pub fn with_boundary(model: &CoilModel, pattern: &Pattern, boundary: &Boundary) -> Result<Self, CompensateError> {
        let film = boundary.air().film_w_per_m2_k.unwrap_or(USUAL_FILM_W_PER_M2_K);
        Self::with_film(model, pattern, film, boundary.air().noise_k)
    }

    fn with_film(
        model: &CoilModel,
        pattern: &Pattern,
        film_w_per_m2_k: f64,
        noise_k: f64,
    ) -> Result<Self, CompensateError> {
        let mut path = model.heat_path()?;
        let real_layers = path.shape.layers;
        let mut buried = 0;
        if path.extent == Extent::HalfSpace {
            path.extent = Extent::Pack;
            buried = (DEEP - 1) * real_layers;
            path.shape.layers = real_layers + buried;
            path.shape.bore_radius_m = FLAT * path.shape.radial_pitch_m * real_layers as f64;
        }
        if path.conductivity_slope_per_k != 0.0 || path.bore_heat.is_some() || path.flange.is_some() {
            return Err(CompensateError::NotLinear);
        }
        let location = path.location;
        path.location = Location::Ambient;
        if location == Location::OuterLayer {
            path.film_w_per_m2_k = match path.material {
                Material::Conductivity { .. } => Some(film_w_per_m2_k),
                Material::Diffusivity { .. } => None,
            };
        }
        let pack = Pack::new(&path)?;
        let (gains, gain_air, bias) = linear_gains(model, pattern, real_layers)?;
        let mut order: Vec<usize> = (0..pack.decays_per_s().len()).collect();
        order.sort_by(|a, b| pack.decays_per_s()[*a].total_cmp(&pack.decays_per_s()[*b]));
        let functional = |mode: usize| -> f64 {
            gains.iter().enumerate().map(|(layer, gain)| gain * pack.amplitude(buried + layer, mode)).sum()
        };
        Ok(Self {
            decay_per_s: order.iter().map(|&i| pack.decays_per_s()[i]).collect(),
            outer: order.iter().map(|&i| pack.amplitude(path.shape.layers - 1, i)).collect(),
            functional: order.iter().map(|&i| functional(i)).collect(),
            functional_air: gains.iter().sum::<f64>() + gain_air,
            location,
            lag_s: model.sensor_lag_s(),
            rate_mean_s: model.rate_mean_s,
            bias,
            noise_k,
            slope_noise_k2_per_s3: USUAL_SLOPE_NOISE,
            delay_s: USUAL_DELAY_S,
            offset_rad_per_s: 0.0,
        })
    }

    /// Chooses slope noise, delay and offset so that a record's rate is compensated best.
    pub fn tune(&mut self, record: &Record) {
        let interval_s = record.interval_s();
        let mut best = f64::INFINITY;
        for exponent in -26..=-8 {
            let mut trial = self.clone();
            trial.slope_noise_k2_per_s3 = 10f64.powf(0.5 * f64::from(exponent));
            let (squares, means) = trial.misfit(record);
            let least = squares.iter().copied().fold(f64::INFINITY, f64::min);
            if least >= best {
                continue;
            }
            best = least;
            // The shortest delay that is as good as any: within half a percent of the mean square.
            let lag = squares.iter().position(|s| *s <= 1.005 * least).unwrap_or(0).max(1);
            self.slope_noise_k2_per_s3 = trial.slope_noise_k2_per_s3;
            self.delay_s = lag as f64 * interval_s;
            self.offset_rad_per_s = means[lag];
        }
    }

    /// Variance and mean of the compensated rate at each lag.
    fn misfit(&self, record: &Record) -> (Vec<f64>, Vec<f64>) {
        let interval_s = record.interval_s();
        let mut filter = Filter::new(self, interval_s, TRIAL_DELAY_ROWS);
        let mut sums = vec![(0.0, 0.0, 0.0); TRIAL_DELAY_ROWS + 1];
        let rates = record.rate_rad_per_s();
        let biases: Vec<f64> = record.temperature_k().iter().map(|t| self.temperature_bias_rad_per_s(*t)).collect();
        let mut rows_of_step: Vec<Option<usize>> = Vec::new();
        let mut last_s = record.times_s()[0];
        for (row, (&time_s, &temperature_k)) in record.times_s().iter().zip(record.temperature_k()).enumerate() {
            let steps = ((time_s - last_s) / interval_s).round().max(if row == 0 { 0.0 } else { 1.0 }) as usize;
            for _ in 1..steps.min(MOST_DELAY_ROWS) {
                filter.step(None);
                rows_of_step.push(None);
            }
            filter.step(Some(temperature_k));
            rows_of_step.push(Some(row));
            last_s = time_s;
            for (lag, sum) in sums.iter_mut().enumerate() {
                let Some(step) = rows_of_step.len().checked_sub(lag + 1) else { continue };
                if let Some(then) = rows_of_step[step] {
                    let left = rates[then] - filter.chain[lag] - biases[then];
                    *sum = (sum.0 + 1.0, sum.1 + left, sum.2 + left * left);
                }
            }
        }
        sums.iter().map(|(n, sum, square)| ((square - sum * sum / n) / n, sum / n)).unzip()
    }

    pub(super) fn temperature_bias_rad_per_s(&self, temperature_k: f64) -> f64 {
        self.bias.as_ref().map_or(0.0, |b| b.value(temperature_k))
    }

    /// Whether the difference equation is all there is.
    pub fn is_linear(&self) -> bool {
        self.bias.is_none()
    }
}

/// Rows of delay that are tried while tuning.
const TRIAL_DELAY_ROWS: usize = 30;

/// dΩ/dṪ_j, dΩ/dȧ and the bias over temperature; an error where that is not the whole model.
type LinearModel = (Vec<f64>, f64, Option<PiecewiseLinear>);

fn linear_gains(model: &CoilModel, pattern: &Pattern, layers: usize) -> Result<LinearModel, CompensateError> {
    let rate = RateModel::new(model, pattern, &[])?;
    if !model.missing_channels(&[]).is_empty() {
        return Err(CompensateError::NotLinear);
    }
    let at = |temperature_k: f64, rates: &[f64], air: f64| {
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
        rate.rate_error_rad_per_s(&rate.state(&history, 0, &[]))
    };
    let still = vec![0.0; layers];
    let zero = at(REFERENCE_TEMPERATURE_K, &still, 0.0);
    // A usual ramp's rate, so that what is linear is probed where it is used.
    let probe_k_per_s = 1e-2;
    let gains: Vec<f64> = (0..layers)
        .map(|layer| {
            let mut rates = still.clone();
            rates[layer] = probe_k_per_s;
            (at(REFERENCE_TEMPERATURE_K, &rates, 0.0) - zero) / probe_k_per_s
        })
        .collect();
    let gain_air = (at(REFERENCE_TEMPERATURE_K, &still, probe_k_per_s) - zero) / probe_k_per_s;
    let table: Vec<f64> = (0..TABLE_ROWS).map(|i| TABLE_FROM_K + i as f64).collect();
    let biases: Vec<f64> = table.iter().map(|&t| at(t, &still, 0.0)).collect();
    let size: f64 = gains.iter().map(|g| g.abs() * probe_k_per_s).sum::<f64>().max(f64::MIN_POSITIVE);
    for (sign, above_k) in [(1.0, 0.0), (-1.0, 0.0), (1.0, 30.0), (-0.5, -30.0)] {
        let rates: Vec<f64> = (0..layers).map(|j| sign * probe_k_per_s * (1.0 + j as f64 / layers as f64)).collect();
        let air = 0.7 * sign * probe_k_per_s;
        let temperature_k = REFERENCE_TEMPERATURE_K + above_k;
        let expected =
            gains.iter().zip(&rates).map(|(g, r)| g * r).sum::<f64>() + gain_air * air + at(temperature_k, &still, 0.0);
        if (at(temperature_k, &rates, air) - expected).abs() > 1e-9 * size {
            return Err(CompensateError::NotLinear);
        }
    }
    let varies = biases.iter().any(|b| *b != 0.0);
    let bias = if varies { PiecewiseLinear::new(table, biases).ok() } else { None };
    Ok((gains, gain_air, bias))
}

/// The difference equation for one interval.
///
/// # Shapes
/// `transition` row-major n × n; `rate`, `reading`, `gain`, `state` of length n; `chain_gain`, `chain` one entry a row of
/// delay and one for the row itself.
#[derive(Debug, Clone)]
pub struct Filter {
    pub transition: Vec<f64>,
    pub rate: Vec<f64>,
    pub reading: Vec<f64>,
    pub gain: Vec<f64>,
    pub chain_gain: Vec<f64>,
    pub state: Vec<f64>,
    pub chain: Vec<f64>,
    next: Vec<f64>,
    /// Where the air's temperature and, if there is one, the sensor's are.
    pub level_states: Vec<usize>,
    started: bool,
}

impl Filter {
    pub fn new(physical: &Physical, interval_s: f64, delay_rows: usize) -> Self {
        let slow = physical.decay_per_s.iter().take_while(|l| **l * interval_s < FAST).count();
        let has_lag = physical.lag_s > 0.0;
        let n = slow + 2 + usize::from(has_lag);
        let (air, slope) = (slow, slow + 1);
        // What the fast modes take, being s/λ.
        let fast = |of: &[f64]| -> f64 { of.iter().zip(&physical.decay_per_s).skip(slow).map(|(c, l)| -c / l).sum() };
        let row = |of_air: f64, of: &[f64]| -> Vec<f64> {
            let mut row = vec![0.0; n];
            for (entry, c) in row.iter_mut().zip(&of[..slow]) {
                *entry = -c;
            }
            row[air] = of_air;
            row[slope] = fast(of);
            row
        };
        let outer = match physical.location {
            Location::OuterLayer => row(1.0, &physical.outer),
            Location::Ambient => row(1.0, &vec![0.0; physical.outer.len()]),
        };
        let mut dynamics = DMatrix::zeros(n, n);
        for (mode, l) in physical.decay_per_s[..slow].iter().enumerate() {
            dynamics[(mode, mode)] = -l;
            dynamics[(mode, slope)] = 1.0;
        }
        dynamics[(air, slope)] = 1.0;
        let mut reading = outer.clone();
        let mut level_states = vec![air];
        if has_lag {
            for (column, c) in outer.iter().enumerate() {
                dynamics[(n - 1, column)] = c / physical.lag_s;
            }
            dynamics[(n - 1, n - 1)] = -1.0 / physical.lag_s;
            reading = vec![0.0; n];
            reading[n - 1] = 1.0;
            level_states.push(n - 1);
        }
        let functional = row(physical.functional_air, &physical.functional);
        let after = (&dynamics * interval_s).exp();
        let functional = DMatrix::from_row_slice(1, n, &functional);
        let window_s = physical.rate_mean_s.min(interval_s);
        let rate = if window_s > 0.0 {
            let before = (&dynamics * (interval_s - window_s)).exp();
            (&functional * (&after - before)) / window_s
        } else {
            &functional * &dynamics * &after
        };
        let (gain, chain_gain) = stationary_gains(
            &after,
            &rate,
            &DMatrix::from_row_slice(1, n, &reading),
            slope,
            physical.slope_noise_k2_per_s3 * interval_s,
            physical.noise_k.powi(2).max(1e-12),
            delay_rows,
        );
        Self {
            transition: after.transpose().as_slice().to_vec(),
            rate: rate.as_slice().to_vec(),
            reading,
            gain,
            chain_gain,
            state: vec![0.0; n],
            chain: vec![0.0; delay_rows + 1],
            next: vec![0.0; n],
            level_states,
            started: false,
        }
    }

    /// One row further; without a reading the model goes on by itself.
    pub fn step(&mut self, temperature_k: Option<f64>) {
        if !self.started {
            if let Some(temperature_k) = temperature_k {
                for &level in &self.level_states {
                    self.state[level] = temperature_k;
                }
                self.started = true;
            }
            return;
        }
        let n = self.state.len();
        let newest = dot(&self.rate, &self.state);
        for (entry, row) in self.next.iter_mut().zip(self.transition.chunks_exact(n)) {
            *entry = dot(row, &self.state);
        }
        std::mem::swap(&mut self.state, &mut self.next);
        let last = self.chain.len() - 1;
        self.chain.copy_within(0..last, 1);
        self.chain[0] = newest;
        if let Some(temperature_k) = temperature_k {
            let error = temperature_k - dot(&self.reading, &self.state);
            for (entry, gain) in self.state.iter_mut().zip(&self.gain) {
                *entry += gain * error;
            }
            for (entry, gain) in self.chain.iter_mut().zip(&self.chain_gain) {
                *entry += gain * error;
            }
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Gains of the filter and of its fixed-lag smoother, where they no longer change.
fn stationary_gains(
    transition: &DMatrix<f64>,
    rate: &DMatrix<f64>,
    reading: &DMatrix<f64>,
    slope: usize,
    slope_variance: f64,
    reading_variance: f64,
    delay_rows: usize,
) -> (Vec<f64>, Vec<f64>) {
    const MOST_ROUNDS: usize = 20_000;
    let n = transition.nrows();
    let mut p = DMatrix::<f64>::identity(n, n) * 1e-4;
    let mut cross: Vec<DMatrix<f64>> = vec![DMatrix::zeros(1, n); delay_rows + 1];
    let (mut gain, mut chain_gain) = (DMatrix::zeros(n, 1), vec![0.0; delay_rows + 1]);
    let mut settled = 0;
    for _ in 0..MOST_ROUNDS {
        p[(slope, slope)] += slope_variance;
        let newest = rate * &p * transition.transpose();
        for j in (1..=delay_rows).rev() {
            cross[j] = &cross[j - 1] * transition.transpose();
        }
        cross[0] = newest;
        p = transition * &p * transition.transpose();
        let seen = &p * reading.transpose();
        let variance = (reading * &seen)[(0, 0)] + reading_variance;
        let new_gain = &seen / variance;
        p -= &new_gain * &new_gain.transpose() * variance;
        p = 0.5 * (&p + p.transpose());
        for (entry, cross) in chain_gain.iter_mut().zip(cross.iter_mut()) {
            *entry = (&*cross * reading.transpose())[(0, 0)] / variance;
            *cross -= new_gain.transpose() * (*entry * variance);
        }
        let change = (&new_gain - &gain).norm();
        let is_still = change <= 1e-13 * new_gain.norm();
        gain = new_gain;
        settled = if is_still { settled + 1 } else { 0 };
        if settled > delay_rows + 1 {
            break;
        }
    }
    (gain.as_slice().to_vec(), chain_gain)
}
