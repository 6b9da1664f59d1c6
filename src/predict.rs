//! What a model says a record should have shown.
//!
//! ```text
//! Ω̂_k = Ω_model(course; (t_k − w, t_k]) + Ω_0,   Ω_0 = Σ (Ω_k − Ω_model)/v_k / Σ 1/v_k,   v_k = σ² + var_k
//! ```
//!
//! The course of the layers is what the readings alone imply in the model's chamber ([`crate::chamber`]); between the
//! chamber's rows it is a cubic with their slopes. The offset Ω_0 (earth rate and bias) is always fitted; w is the logger's
//! averaging interval, σ the record's noise floor and var_k the variance that what the readings leave open gives the
//! prediction.
//!
//! # Source
//! The noise floor as in [`crate::numeric::noise`].

use std::ops::Range;

use thiserror::Error;

use crate::chamber::{Assumption, Bend, Chamber, ChamberError, Effort, Fit, Place, Quantity, Told};
use crate::coil::CoilError;
use crate::numeric::noise::{WhiteNoise, white_noise};
use crate::pattern::Pattern;
use crate::rate::{CoilModel, Past, RateError, RateModel};
use crate::record::{Record, RecordError};
use crate::thermal::{ThermalError, ThermalHistory};

/// A model's prediction of one record.
///
/// # Shapes
/// One entry a row of the record.
#[derive(Debug, Clone)]
pub struct Prediction {
    /// With the offset.
    pub rate_rad_per_s: Vec<f64>,
    pub offset_rad_per_s: f64,
    /// What the readings leave open contributes [(rad/s)²].
    pub boundary_variance_rad2_per_s2: Vec<f64>,
    /// The record's white noise.
    pub noise_rad_per_s: f64,
    /// The pack over each averaging interval.
    pub pack: Vec<PackRow>,
}

/// The pack over one averaging interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PackRow {
    /// Of the outermost layer.
    pub outer_k: f64,
    pub outer_rate_k_per_s: f64,
    /// Over the fibre's length.
    pub mean_k: f64,
    pub mean_rate_k_per_s: f64,
    /// Outermost less innermost layer.
    pub gradient_k: f64,
    pub gradient_rate_k_per_s: f64,
}

/// What drove a record, as its readings tell.
#[derive(Debug, Clone)]
pub struct Boundary {
    /// Film between air and pack with its standard error [W/(m²K)]; None where the model's own counts.
    pub film_w_per_m2_k: Option<(f64, f64)>,
    /// Where the air's slope changed.
    pub bends: Vec<Bend>,
    course: Course,
    /// One entry a row of the chamber.
    rate_variance_rad2_per_s2: Vec<f64>,
}

/// Layers and air between the rows of a chamber.
#[derive(Debug, Clone)]
struct Course {
    layers: usize,
    /// Layers, axial moments, air.
    columns: usize,
    times_s: Vec<f64>,
    /// Row-major rows × columns.
    values: Vec<f64>,
}

#[derive(Debug, Error, Clone, PartialEq)]
pub enum PredictError {
    #[error("the course of the air needs at least {needed} readings of temperature, found {found}")]
    TooFew { needed: usize, found: usize },
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
/// Numbers of a chamber are fitted to at most so many of its rows: a day of half-minute rows, more than they need.
const MOST_ROWS_FITTED: usize = 4000;
/// Rows that are worked out at a time.
const ROWS_AT_A_TIME: usize = 4096;

/// A record whose readings have been taken in, and no rate yet.
#[derive(Debug)]
pub struct Read<'a> {
    pub chamber: Chamber<'a>,
    pub fit: Fit,
    pub boundary: Boundary,
}

/// Takes in a record's readings.
///
/// # Errors
/// A pattern of another layer count, a heat path that cannot be solved, a record whose temperature says nothing.
pub fn read<'a>(model: &CoilModel, pattern: &Pattern, record: &'a Record) -> Result<Read<'a>, PredictError> {
    if record.rows() < LEAST_READINGS {
        return Err(PredictError::TooFew { needed: LEAST_READINGS, found: record.rows() });
    }
    let assumed = Assumption::new(model.clone(), pattern.clone());
    let mut chamber = Chamber::of_readings(model, &[record])?;
    let rows = chamber.busiest(0, MOST_ROWS_FITTED);
    let fit;
    if rows == (0..record.rows()) || chamber.times_s(0).len() <= MOST_ROWS_FITTED {
        let settled;
        (chamber, settled) = chamber.settled(&assumed, &[0])?;
        chamber.sharpen(&settled, 0)?;
        fit = chamber.fit(&assumed, &[], &[0], Some(&settled), Effort::QUICK)?;
    } else {
        let stretch = record.stretch(rows)?;
        let (stretch, found) = Chamber::of_readings(model, &[&stretch])?.settled(&assumed, &[0])?;
        fit = chamber.adopt(&stretch, &found)?;
        chamber.sharpen(&fit, 0)?;
    }
    let Told { course, rate_variance_rad2_per_s2, bends } = chamber.told(&fit, 0)?;
    let film_w_per_m2_k = fit.value(Place::Quantity { quantity: Quantity::Film, record: None });
    let reference_k = chamber.reference_k(0);
    let columns = course.outputs + 1;
    let mut values = Vec::with_capacity(course.air_k.len() * columns);
    for (row, air_k) in course.air_k.iter().enumerate() {
        let (layers, moments) = course.row(row).split_at(course.layers);
        values.extend(layers.iter().map(|t| reference_k + t));
        values.extend_from_slice(moments);
        values.push(reference_k + air_k);
    }
    let course = Course { layers: course.layers, columns, times_s: chamber.times_s(0).to_vec(), values };
    let boundary = Boundary { film_w_per_m2_k, bends, course, rate_variance_rad2_per_s2 };
    Ok(Read { chamber, fit, boundary })
}

/// The white noise where a joint fit begins, in units of the floor: unresolved air may make most of the floor.
const NOISE_STARTS: [f64; 2] = [1.0, 0.2];

impl<'a> Read<'a> {
    /// What readings and rates say together, beginning with the chamber that the readings showed; of a long record, the
    /// stretch that moves most.
    ///
    /// # Errors
    /// Rates without noise, a model that cannot be solved.
    pub fn with_rates<T>(
        self,
        then: impl FnOnce(&Chamber, &Fit) -> Result<T, PredictError>,
    ) -> Result<T, PredictError> {
        let Self { mut chamber, fit, .. } = self;
        if chamber.times_s(0).len() <= MOST_ROWS_FITTED {
            let fit = joint(&mut chamber, &fit)?;
            return then(&chamber, &fit);
        }
        let stretch = chamber.record(0).stretch(chamber.busiest(0, MOST_ROWS_FITTED))?;
        let mut part = Chamber::of_readings(&fit.assumed.model, &[&stretch])?;
        let fit = part.adopt(&chamber, &fit)?;
        let fit = joint(&mut part, &fit)?;
        then(&part, &fit)
    }
}

/// Readings and rates of a chamber's only record, from what the readings showed.
fn joint(chamber: &mut Chamber, of_readings: &Fit) -> Result<Fit, PredictError> {
    chamber.see_rates()?;
    let mut best: Option<Fit> = None;
    for share in NOISE_STARTS {
        let mut start = of_readings.clone();
        start.set_number(Quantity::RateNoise, share * chamber.noise_floor_rad_per_s(0));
        let fit = chamber.fit(&start.assumed.clone(), &[], &[0], Some(&start), Effort::QUICK)?;
        if best.as_ref().is_none_or(|b| fit.posterior() > b.posterior()) {
            best = Some(fit);
        }
    }
    let best = best.ok_or(ChamberError::Unsolvable)?;
    let best = chamber.without_gross_errors(best, &[0])?;
    Ok(chamber.fit(&best.assumed.clone(), &[], &[0], Some(&best), Effort::FULL)?)
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
pub fn predict(model: &CoilModel, pattern: &Pattern, record: &Record) -> Result<Prediction, PredictError> {
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
) -> Result<Prediction, PredictError> {
    let rows = record.rows();
    let names: Vec<String> = record.channels().iter().map(|c| c.name.clone()).collect();
    let rate = RateModel::new(model, pattern, &names)?;
    let mut channels = vec![0.0; names.len()];
    let mut past = Past::default();
    let mut coil_rad_per_s = Vec::with_capacity(rows);
    let mut pack = Vec::with_capacity(rows);
    let mut from = 0;
    while from < rows {
        let to = (from + ROWS_AT_A_TIME).min(rows);
        let history = boundary.history(record, from..to, model.rate_mean_s);
        for row in 0..history.len() {
            for (value, channel) in channels.iter_mut().zip(record.channels()) {
                *value = channel.values[from + row];
            }
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
    Ok(Prediction {
        rate_rad_per_s: coil_rad_per_s.iter().map(|r| r + offset_rad_per_s).collect(),
        offset_rad_per_s,
        boundary_variance_rad2_per_s2: boundary_variance,
        noise_rad_per_s,
        pack,
    })
}

impl Boundary {
    /// The pack over the averaging intervals of some of a record's rows.
    pub fn history(&self, record: &Record, rows: Range<usize>, rate_mean_s: f64) -> ThermalHistory {
        let course = &self.course;
        let count = rows.len();
        let mut history = ThermalHistory::with_capacity(course.layers, count);
        history.times_s.extend_from_slice(&record.times_s()[rows.clone()]);
        let (mut end, mut start) = (vec![0.0; course.columns], vec![0.0; course.columns]);
        let mut rates = vec![0.0; course.columns];
        let air = course.columns - 1;
        for row in rows {
            let time_s = record.times_s()[row];
            course.at(time_s, &mut end, Some(&mut rates));
            if rate_mean_s > 0.0 {
                course.at(time_s - rate_mean_s, &mut start, None);
                for ((rate, end), start) in rates.iter_mut().zip(&mut end).zip(&start) {
                    *rate = (*end - start) / rate_mean_s;
                    *end = 0.5 * (*end + start);
                }
            }
            history.temperature_k.extend_from_slice(&end[..course.layers]);
            history.rate_k_per_s.extend_from_slice(&rates[..course.layers]);
            history.axial_moment_k.extend_from_slice(&end[course.layers..air]);
            history.axial_moment_k_per_s.extend_from_slice(&rates[course.layers..air]);
            history.ambient_k.push(end[air]);
            history.ambient_rate_k_per_s.push(rates[air]);
        }
        history
    }

    /// Variance that what the readings leave open gives the rates at some times [(rad/s)²].
    fn rate_variances_rad2_per_s2(&self, times_s: &[f64]) -> Vec<f64> {
        let last = self.course.times_s.len() - 1;
        let row = |t: &f64| self.course.times_s.partition_point(|end| *end < t - SAME_S).clamp(1, last);
        times_s.iter().map(|t| self.rate_variance_rad2_per_s2[row(t)]).collect()
    }
}

/// Two times that differ by less are one [s].
const SAME_S: f64 = 1e-6;

impl Course {
    /// Value and, if asked for, slope at a time; straight on before the first row and behind the last.
    fn at(&self, time_s: f64, values: &mut [f64], slopes: Option<&mut [f64]>) {
        let last = self.times_s.len() - 1;
        let right = self.times_s.partition_point(|&t| t < time_s).clamp(1, last);
        let (t0, t1) = (self.times_s[right - 1], self.times_s[right]);
        let length_s = t1 - t0;
        let x = (time_s - t0) / length_s;
        let inside = x.clamp(0.0, 1.0);
        let (beyond_s, out) = ((x - inside) * length_s, x != inside);
        let mut slopes = slopes;
        for (j, value) in values.iter_mut().enumerate() {
            let (a, b) = (self.value(right - 1, j), self.value(right, j));
            let (p, q) = (length_s * self.slope(right - 1, j), length_s * self.slope(right, j));
            // Hermite's cubic.
            let (c, d) = (3.0 * (b - a) - 2.0 * p - q, 2.0 * (a - b) + p + q);
            let slope = (p + inside * (2.0 * c + 3.0 * d * inside)) / length_s;
            *value = a + inside * (p + inside * (c + d * inside)) + if out { beyond_s * slope } else { 0.0 };
            if let Some(slopes) = slopes.as_deref_mut() {
                slopes[j] = slope;
            }
        }
    }

    fn value(&self, row: usize, column: usize) -> f64 {
        self.values[row * self.columns + column]
    }

    /// Of the parabola through a row and its neighbours; at the ends, that of the last piece.
    fn slope(&self, row: usize, column: usize) -> f64 {
        let secant = |right: usize| {
            (self.value(right, column) - self.value(right - 1, column))
                / (self.times_s[right] - self.times_s[right - 1])
        };
        let last = self.times_s.len() - 1;
        if row == 0 || row == last {
            return secant(row.max(1));
        }
        let before_s = self.times_s[row] - self.times_s[row - 1];
        let after_s = self.times_s[row + 1] - self.times_s[row];
        (after_s * secant(row) + before_s * secant(row + 1)) / (before_s + after_s)
    }
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
