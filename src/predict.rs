//! What a model says a record should have shown.
//!
//! ```text
//! Ω̂_k = Ω_model(boundary; (t_k − w, t_k]) + Ω_0,   Ω_0 = Σ (Ω_k − Ω_model)/v_k / Σ 1/v_k,   v_k = σ² + var_k
//! ```
//!
//! The offset Ω_0 (earth rate and bias) is always fitted; w is the logger's averaging interval, σ the record's noise
//! floor and var_k the variance that the boundary's estimate gives the prediction.
//!
//! # Source
//! The noise floor as in [`crate::numeric::noise`].

use thiserror::Error;

use crate::boundary::{self, Air, Boundary, BoundaryError, Observation, Start};
use crate::coil::CoilError;
use crate::numeric::noise::{WhiteNoise, white_noise};
use crate::numeric::piecewise::PiecewiseLinear;
use crate::pattern::Pattern;
use crate::rate::{CoilModel, Past, RateError, RateModel};
use crate::record::Record;
use crate::thermal::{self, HeatPath, ThermalError, ThermalHistory};
use crate::units::percent_from_fraction;

/// A model's prediction of one record.
///
/// # Shapes
/// One entry a row of the record.
#[derive(Debug, Clone)]
pub struct Prediction {
    /// With the offset.
    pub rate_rad_per_s: Vec<f64>,
    pub offset_rad_per_s: f64,
    /// What the uncertainty of the boundary contributes [(rad/s)²].
    pub boundary_variance_rad2_per_s2: Vec<f64>,
    /// The record's white noise.
    pub noise_rad_per_s: f64,
    /// The pack over each averaging interval.
    pub history: ThermalHistory,
}

/// How well a prediction agrees with its record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Agreement {
    pub rmse_rad_per_s: f64,
    /// 100 (1 − ‖y − ŷ‖/‖y − ȳ‖).
    pub nrmse_fit_percent: f64,
    /// Against noise and boundary, one degree of freedom for the offset.
    pub reduced_chi_square: f64,
}

impl Prediction {
    /// Compares with the record that was predicted.
    pub fn agreement(&self, record: &Record) -> Agreement {
        let measured = record.rate_rad_per_s();
        let count = measured.len() as f64;
        let mean = measured.iter().sum::<f64>() / count;
        let (mut squares, mut spread, mut chi_square) = (0.0, 0.0, 0.0);
        for ((m, p), variance) in measured.iter().zip(&self.rate_rad_per_s).zip(&self.boundary_variance_rad2_per_s2) {
            squares += (m - p).powi(2);
            spread += (m - mean).powi(2);
            chi_square += (m - p).powi(2) / (self.noise_rad_per_s.powi(2) + variance);
        }
        Agreement {
            rmse_rad_per_s: (squares / count).sqrt(),
            nrmse_fit_percent: percent_from_fraction(1.0 - (squares / spread).sqrt()),
            reduced_chi_square: chi_square / (count - 1.0),
        }
    }
}

#[derive(Debug, Error, Clone, PartialEq)]
pub enum PredictError {
    #[error(transparent)]
    Boundary(#[from] BoundaryError),
    #[error(transparent)]
    Thermal(#[from] ThermalError),
    #[error(transparent)]
    Rate(#[from] RateError),
    #[error(transparent)]
    Coil(#[from] CoilError),
}

/// Predicts a record, estimating its boundary first.
///
/// # Errors
/// A pattern of another layer count, a heat path that cannot be solved, a record whose temperature says nothing.
pub fn predict(model: &CoilModel, pattern: &Pattern, record: &Record) -> Result<Prediction, PredictError> {
    let boundary = estimate_boundary(model, pattern, record)?;
    predict_from(model, pattern, record, &boundary)
}

/// Estimates what drove a record, as far as the model says how the sensor is connected to it.
///
/// # Errors
/// As [`predict`].
pub fn estimate_boundary(model: &CoilModel, pattern: &Pattern, record: &Record) -> Result<Boundary, PredictError> {
    let (path, gains) = (model.heat_path()?, layer_gains_rad_per_k(model, pattern)?);
    Ok(boundary::estimate(&observation(model, record, &path, &gains))?)
}

/// As [`estimate_boundary`] for a sensor of another lag, beginning with what was found under another model.
///
/// # Errors
/// As [`predict`].
pub fn refine_boundary(
    model: &CoilModel,
    pattern: &Pattern,
    record: &Record,
    lag_s: f64,
    known: &Air,
    start: Start,
) -> Result<Boundary, PredictError> {
    let (path, gains) = (model.heat_path()?, layer_gains_rad_per_k(model, pattern)?);
    Ok(boundary::refine(&Observation { lag_s, ..observation(model, record, &path, &gains) }, known, start)?)
}

fn observation<'a>(model: &CoilModel, record: &'a Record, path: &'a HeatPath, gains: &'a [f64]) -> Observation<'a> {
    Observation {
        times_s: record.times_s(),
        temperature_k: record.temperature_k(),
        path,
        lag_s: model.sensor_lag_s(),
        layer_gain_rad_per_k: gains,
        rate_mean_s: model.rate_mean_s,
    }
}

/// Predicts a record from a boundary that is known already.
///
/// # Errors
/// As [`predict`].
pub fn predict_from(
    model: &CoilModel,
    pattern: &Pattern,
    record: &Record,
    boundary: &Boundary,
) -> Result<Prediction, PredictError> {
    let (path, mut drive) = boundary.driving(&model.heat_path()?, 0.0);
    if let Some(ambient_k) = measured_ambient(record) {
        drive.ambient_k = Some(ambient_k);
    }
    let history = thermal::solve(&path, &drive)?.means(record.times_s(), model.rate_mean_s);
    let coil_rad_per_s = rates_rad_per_s(model, pattern, record, &history)?;
    let noise_rad_per_s = noise_floor_rad_per_s(record);
    let boundary_variance = boundary.rate_variance_rad2_per_s2().to_vec();
    let (mut weights, mut sum) = (0.0, 0.0);
    for ((measured, predicted), variance) in record.rate_rad_per_s().iter().zip(&coil_rad_per_s).zip(&boundary_variance)
    {
        let weight = 1.0 / (noise_rad_per_s * noise_rad_per_s + variance);
        weights += weight;
        sum += weight * (measured - predicted);
    }
    let offset_rad_per_s = sum / weights;
    Ok(Prediction {
        rate_rad_per_s: coil_rad_per_s.iter().map(|r| r + offset_rad_per_s).collect(),
        offset_rad_per_s,
        boundary_variance_rad2_per_s2: boundary_variance,
        noise_rad_per_s,
        history,
    })
}

/// The model's rates over a history, without any offset, the record's channels included.
///
/// # Errors
/// A pattern of another layer count; effects that leave a layer no turns; a formula that has no value somewhere.
pub fn rates_rad_per_s(
    model: &CoilModel,
    pattern: &Pattern,
    record: &Record,
    history: &ThermalHistory,
) -> Result<Vec<f64>, RateError> {
    let names: Vec<String> = record.channels().iter().map(|c| c.name.clone()).collect();
    let rate = RateModel::new(model, pattern, &names)?;
    let mut channels = vec![0.0; names.len()];
    let mut past = Past::default();
    (0..history.len())
        .map(|row| {
            for (value, channel) in channels.iter_mut().zip(record.channels()) {
                *value = channel.values[row];
            }
            rate.checked_after(&rate.state(history, row, &channels), &mut past)
        })
        .collect()
}

/// dΩ/dṪ_j of the coil [rad/s per K/s], innermost layer first.
///
/// # Errors
/// A pattern of another layer count; effects that leave a layer no turns.
pub fn layer_gains_rad_per_k(model: &CoilModel, pattern: &Pattern) -> Result<Vec<f64>, RateError> {
    let rate = RateModel::new(model, pattern, &[])?;
    let scale = rate.scale_per_m2() * rate.coil().fibre().path_per_k();
    Ok(rate.weights().total_m2().iter().map(|w| w * scale).collect())
}

/// The measured ambient as a drive, if the record has a complete one.
pub(crate) fn measured_ambient(record: &Record) -> Option<PiecewiseLinear> {
    let values = record.ambient_k()?;
    PiecewiseLinear::new(record.times_s().to_vec(), values.to_vec()).ok()
}

/// White noise of one rate, from the record alone: what quadratics leave in short windows, steep and spoilt ones left out.
pub fn noise_floor(record: &Record) -> WhiteNoise {
    white_noise(record.times_s(), record.rate_rad_per_s())
}

/// As [`noise_floor`], the deviation alone.
pub fn noise_floor_rad_per_s(record: &Record) -> f64 {
    noise_floor(record).deviation
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use statrs::distribution::{ContinuousCDF, Normal};

    #[test]
    fn the_noise_floor_of_a_steep_signal_with_outliers_is_that_of_its_noise() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let normal = Normal::new(0.0, 2e-7).unwrap();
        let times: Vec<f64> = (0..4000).map(|i| 10.0 * i as f64).collect();
        let mut rates: Vec<f64> =
            times.iter().map(|t| 1e-4 * (t / 5000.0).sin() + normal.inverse_cdf(random.random::<f64>())).collect();
        for i in [100, 900, 2500] {
            rates[i] += 1e-3;
        }
        let record = Record::new("noise", times, vec![300.0; 4000], rates).unwrap();
        let floor = noise_floor_rad_per_s(&record);
        println!("noise floor {floor:.3e} of 2e-7");
        assert!((floor / 2e-7 - 1.0).abs() < 0.06);
    }
}
