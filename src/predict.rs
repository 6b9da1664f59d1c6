//! What a model says a record should have shown.
//!
//! ```text
//! Ω̂_k = Ω_model(course; (t_k − w, t_k]) + Ω_0,   Ω_0 = Σ (Ω_k − Ω_model)/v_k / Σ 1/v_k,   v_k = σ² + var_k
//! ```
//!
//! Film and chamber are what readings and rates show together; the course of the layers is what the readings alone imply in
//! that chamber ([`crate::chamber`]), and between the chamber's rows a cubic with their slopes. The offset Ω_0 (earth rate and bias) is always fitted; w is the logger's
//! averaging interval, σ the record's noise floor and var_k the variance that what the readings leave open gives the
//! prediction.
//!
//! # Source
//! The noise floor as in [`crate::numeric::noise`].

mod boundary;

use thiserror::Error;

use crate::chamber::{Assumption, Chamber, ChamberError, Effort, Fit, MOST_ROWS_FITTED, Quantity};
use crate::coil::CoilError;
use crate::numeric::noise::{WhiteNoise, white_noise};
use crate::pattern::Pattern;
use crate::rate::{CoilModel, Past, RateError, RateModel};
use crate::record::{Record, RecordError};
use crate::thermal::{ThermalError, ThermalHistory};

pub use boundary::Boundary;

/// A model's prediction of one record.
///
/// # Shapes
/// One entry a row of the record.
#[derive(Debug, Clone)]
pub struct RecordPrediction {
    /// With the offset.
    pub rate_rad_per_s: Vec<f64>,
    /// The record's bias, as estimated; contained in the rates.
    pub offset_rad_per_s: f64,
    /// What the readings leave open contributes [(rad/s)²].
    pub boundary_variance_rad2_per_s2: Vec<f64>,
    /// The record's white noise.
    pub noise_rad_per_s: f64,
    /// The pack over each averaging interval.
    pub(crate) pack: Vec<PackRow>,
}

/// The pack over one averaging interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PackRow {
    /// Of the outermost layer.
    pub(crate) outer_k: f64,
    pub(crate) outer_rate_k_per_s: f64,
    /// Over the fibre's length.
    pub(crate) mean_k: f64,
    pub(crate) mean_rate_k_per_s: f64,
    /// Outermost less innermost layer.
    pub(crate) gradient_k: f64,
    pub(crate) gradient_rate_k_per_s: f64,
}

/// Why a record cannot be predicted.
#[derive(Debug, Error, Clone, PartialEq)]
#[allow(missing_docs, reason = "its messages say what each means")]
#[non_exhaustive]
pub enum PredictError {
    #[error("the course of the air needs at least {needed} readings of temperature, found {found}")]
    TooFew { needed: usize, found: usize },
    #[error(
        "column {column} is a thermometer at layer {layer}: expected a layer of the coil, 1 (innermost) to {layers}"
    )]
    NoSuchLayer { column: String, layer: usize, layers: usize },
    #[error("the temperature field does not fit: {message}")]
    Field { message: String },
    #[error(transparent)]
    Record(#[from] RecordError),
    #[error(transparent)]
    Chamber(#[from] ChamberError),
    #[error(transparent)]
    Thermal(#[from] ThermalError),
    #[error(transparent)]
    Rate(#[from] RateError),
    #[error(transparent)]
    Coil(#[from] CoilError),
}

/// Fewer readings than this hold no ramp.
const LEAST_READINGS: usize = 16;
/// Rows that are worked out at a time.
const ROWS_AT_A_TIME: usize = 4096;

/// A record, taken in.
#[derive(Debug)]
pub(crate) struct Read<'a> {
    pub(crate) chamber: Chamber<'a>,
    /// Film, chamber and noise, by readings and rates together.
    pub(crate) fit: Fit,
    pub(crate) boundary: Boundary,
}

/// Takes a record in: film and chamber are what readings and rates show together, whatever else the rate may do beside
/// the model left to a wander; what drove the coil is then what the readings imply.
///
/// # Errors
/// A pattern of another layer count, a heat path that cannot be solved, a record whose temperature says nothing.
pub(crate) fn read<'a>(model: &CoilModel, pattern: &Pattern, record: &'a Record) -> Result<Read<'a>, PredictError> {
    if record.rows() < LEAST_READINGS {
        return Err(PredictError::TooFew { needed: LEAST_READINGS, found: record.rows() });
    }
    let mut chamber = Chamber::of_any(model, &[record])?;
    let rows = chamber.busiest(0, MOST_ROWS_FITTED);
    let fit;
    if rows == (0..record.rows()) || chamber.times_s(0).len() <= MOST_ROWS_FITTED {
        let assumed = assumed(model, pattern, &chamber);
        (chamber, fit) = chamber.with_timed_shocks(&assumed)?;
    } else {
        let stretch = record.stretch(rows)?;
        let part = Chamber::of_any(model, &[&stretch])?;
        let assumed = assumed(model, pattern, &part);
        let (part, found) = part.with_timed_shocks(&assumed)?;
        fit = chamber.adopt(&part, &found)?;
        chamber.time_kinks(&fit, 0)?;
    }
    let boundary = Boundary::told(&chamber, &fit, 0)?;
    Ok(Read { chamber, fit, boundary })
}

/// What the model lacks is left to a wander, so that the air does not make up for it.
fn assumed(model: &CoilModel, pattern: &Pattern, chamber: &Chamber) -> Assumption {
    Assumption { drift: chamber.noise_floor_rad_per_s(0) > 0.0, ..Assumption::new(model.clone(), pattern.clone()) }
}

/// The white noise where a fit without the wander begins, in units of the floor: unresolved air may make most of the floor.
const NOISE_STARTS: [f64; 2] = [1.0, 0.2];

/// In log likelihood: a quick fit that is so far behind one with a wander does not catch up by more work.
const HOPELESS: f64 = 50.0;

impl Read<'_> {
    /// What the declared model alone makes of readings and rates, and the same with a wander beside it; of a long record, of the
    /// stretch that moves most.
    ///
    /// # Errors
    /// Rates without noise, a model that cannot be solved.
    pub(crate) fn declared<T>(
        &self,
        then: impl FnOnce(&Chamber, &Fit, &Fit) -> Result<T, PredictError>,
    ) -> Result<T, PredictError> {
        if self.chamber.times_s(0).len() <= MOST_ROWS_FITTED {
            return then(&self.chamber, &without_wander(&self.chamber, &self.fit)?, &self.fit);
        }
        let stretch = self.chamber.record(0).stretch(self.chamber.busiest(0, MOST_ROWS_FITTED))?;
        let mut part = Chamber::new(&self.fit.assumed.model, &[&stretch])?;
        let wandering = part.adopt(&self.chamber, &self.fit)?;
        let wandering = part.fit(&wandering.assumed.clone(), &[], &[0], Some(&wandering), Effort::QUICK)?;
        let fit = without_wander(&part, &wandering)?;
        then(&part, &fit, &wandering)
    }
}

fn without_wander(chamber: &Chamber, with: &Fit) -> Result<Fit, ChamberError> {
    let assumed = Assumption { drift: false, ..with.assumed.clone() };
    let mut best: Option<Fit> = None;
    for share in NOISE_STARTS {
        let mut start = with.clone();
        start.set_number(Quantity::RateNoise, share * chamber.noise_floor_rad_per_s(0));
        let fit = chamber.fit(&assumed, &[], &[0], Some(&start), Effort::SHORT)?;
        if best.as_ref().is_none_or(|b| fit.posterior() > b.posterior()) {
            best = Some(fit);
        }
    }
    let best = best.ok_or(ChamberError::Unsolvable)?;
    let fit = chamber.fit(&assumed, &[], &[0], Some(&best), Effort::QUICK)?;
    if with.posterior() - fit.posterior() > HOPELESS {
        return Ok(fit);
    }
    chamber.fit(&assumed, &[], &[0], Some(&fit), Effort::FULL)
}

/// Estimates what drove a record, as far as the model says how the sensor is connected to it.
///
/// # Errors
/// As [`read`].
pub fn estimate_boundary(model: &CoilModel, pattern: &Pattern, record: &Record) -> Result<Boundary, PredictError> {
    Ok(read(model, pattern, record)?.boundary)
}

/// Predicts a record, estimating its boundary first.
///
/// # Errors
/// As [`read`].
pub fn predict(model: &CoilModel, pattern: &Pattern, record: &Record) -> Result<RecordPrediction, PredictError> {
    predict_from(model, pattern, record, &estimate_boundary(model, pattern, record)?)
}

/// Predicts a record from a boundary that is known already.
///
/// # Errors
/// As [`read`].
pub fn predict_from(
    model: &CoilModel,
    pattern: &Pattern,
    record: &Record,
    boundary: &Boundary,
) -> Result<RecordPrediction, PredictError> {
    let rows = record.rows();
    let names: Vec<String> = record.channels().iter().map(|c| c.name.clone()).collect();
    let rate = RateModel::new(model, pattern, &names)?;
    let seen = record.channel_means(model.rate_mean_s);
    let mut channels = vec![0.0; names.len()];
    let mut past = Past::default();
    let mut coil_rad_per_s = Vec::with_capacity(rows);
    let mut pack = Vec::with_capacity(rows);
    let mut from = 0;
    while from < rows {
        let to = (from + ROWS_AT_A_TIME).min(rows);
        let history = boundary.history(record, from..to, model.rate_mean_s);
        for row in 0..history.len() {
            channels.iter_mut().zip(&seen).for_each(|(value, column)| *value = column[from + row]);
            let state = rate.state(&history, row, &channels);
            coil_rad_per_s.push(rate.checked_after(&state, &mut past)?);
            let last = history.layers - 1;
            pack.push(PackRow {
                outer_k: state.temperatures_k[last],
                outer_rate_k_per_s: state.rates_k_per_s[last],
                mean_k: state.mean_temperature_k,
                mean_rate_k_per_s: state.mean_rate_k_per_s,
                gradient_k: state.temperatures_k[last] - state.temperatures_k[0],
                gradient_rate_k_per_s: state.gradient_rate_k_per_s(),
            });
        }
        from = to;
    }
    let noise_rad_per_s = noise_floor_rad_per_s(record);
    let boundary_variance = boundary.rate_variances_rad2_per_s2(record.times_s());
    let (mut weights, mut sum) = (0.0, 0.0);
    for ((measured, predicted), variance) in record.rate_rad_per_s().iter().zip(&coil_rad_per_s).zip(&boundary_variance)
    {
        let weight = 1.0 / (noise_rad_per_s * noise_rad_per_s + variance).max(f64::MIN_POSITIVE);
        weights += weight;
        sum += weight * (measured - predicted);
    }
    let offset_rad_per_s = sum / weights;
    Ok(RecordPrediction {
        rate_rad_per_s: coil_rad_per_s.iter().map(|r| r + offset_rad_per_s).collect(),
        offset_rad_per_s,
        boundary_variance_rad2_per_s2: boundary_variance,
        noise_rad_per_s,
        pack,
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
    let seen = record.channel_means(model.rate_mean_s);
    let mut channels = vec![0.0; names.len()];
    let mut past = Past::default();
    (0..history.len())
        .map(|row| {
            channels.iter_mut().zip(&seen).for_each(|(value, column)| *value = column[row]);
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
