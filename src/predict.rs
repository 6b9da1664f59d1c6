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

use std::ops::Range;

use thiserror::Error;

use crate::chamber::{
    Assumption, Bend, Chamber, ChamberError, Effort, FilmSwitches, Fit, MOST_ROWS_FITTED, Place, Quantity, Told,
};
use crate::coil::CoilError;
use crate::numeric::noise::{WhiteNoise, white_noise};
use crate::pattern::Pattern;
use crate::rate::{CoilModel, Past, RateError, RateModel};
use crate::record::{Record, RecordError};
use crate::thermal::{GivenField, ThermalError, ThermalHistory};

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

/// What drove a record, as its readings tell.
#[derive(Debug, Clone)]
pub struct Boundary {
    /// Film between air and pack with its standard error [W/(m²K)]; None where the model's own counts.
    pub(crate) film_w_per_m2_k: Option<(f64, f64)>,
    /// Where the air's slope changed.
    pub(crate) bends: Vec<Bend>,
    /// None where the film is one.
    pub(crate) film_switches: Option<FilmSwitches>,
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
    /// Empty where values count as straight between the times.
    slopes_per_s: Vec<f64>,
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
    let Told { course, slopes_k_per_s, rate_variance_rad2_per_s2, bends } = chamber.told(&fit, 0)?;
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
    let times_s = chamber.times_s(0).to_vec();
    let course = Course { layers: course.layers, columns, times_s, values, slopes_per_s: slopes_k_per_s };
    let film_switches = chamber.film_switches(0, Some(&fit));
    let boundary = Boundary { film_w_per_m2_k, bends, film_switches, course, rate_variance_rad2_per_s2 };
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

impl Boundary {
    /// Of layers' temperatures that are known; nothing is left open then.
    ///
    /// # Errors
    /// A field of other layers than the coil's, or that does not span the record's averaging intervals.
    pub(crate) fn given(model: &CoilModel, field: &GivenField, record: &Record) -> Result<Self, PredictError> {
        let fault = |message: String| Err(PredictError::Field { message });
        let (history, layers) = (&field.history, model.coil.layers());
        if history.layers != layers {
            return fault(format!("expected the coil's {layers} layers, found {}", history.layers));
        }
        let (from_s, to_s) = (record.times_s()[0] - model.rate_mean_s, record.times_s()[record.rows() - 1]);
        let (first_s, last_s) = field.span_s();
        if from_s < first_s - SAME_S || to_s > last_s + SAME_S {
            return fault(format!(
                "the record's averaging intervals go from {from_s} to {to_s} s, the field from {first_s} to {last_s} s: it must span them"
            ));
        }
        let has_moments = !(history.axial_moment_k.is_empty() && history.axial_moment_k_per_s.is_empty());
        // Of moments only the changes count: where they are not given, their rates' integral stands for them.
        let moments_k = match has_moments && history.axial_moment_k.is_empty() {
            true => integral(&history.times_s, &history.axial_moment_k_per_s),
            false => history.axial_moment_k.clone(),
        };
        if history.len() < 2 {
            return fault("expected at least two times, found one".to_owned());
        }
        let columns = if has_moments { 2 * layers + 1 } else { layers + 1 };
        let gathered = |of_layers: &[f64], moments: &[f64], air: &[f64]| -> Vec<f64> {
            let rows = (0..history.len()).flat_map(|row| {
                let here = row * layers..(row + 1) * layers;
                let moments = if has_moments { &moments[here.clone()] } else { &[] };
                of_layers[here].iter().chain(moments).chain(&air[row..=row])
            });
            rows.copied().collect()
        };
        let slopes_per_s = match field.has_rates {
            true => gathered(&history.rate_k_per_s, &history.axial_moment_k_per_s, &history.ambient_rate_k_per_s),
            false => Vec::new(),
        };
        let values = gathered(&history.temperature_k, &moments_k, &history.ambient_k);
        let times_s = history.times_s.clone();
        let rate_variance_rad2_per_s2 = vec![0.0; times_s.len()];
        let course = Course { layers, columns, times_s, values, slopes_per_s };
        Ok(Self { film_w_per_m2_k: None, bends: Vec::new(), film_switches: None, course, rate_variance_rad2_per_s2 })
    }

    /// The pack over the averaging intervals of some of a record's rows.
    pub(crate) fn history(&self, record: &Record, rows: Range<usize>, rate_mean_s: f64) -> ThermalHistory {
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

/// Of rates that are straight between times, row-major as they are.
fn integral(times_s: &[f64], rates: &[f64]) -> Vec<f64> {
    let columns = rates.len() / times_s.len().max(1);
    let mut sums = vec![0.0; rates.len()];
    for row in 1..times_s.len() {
        let step_s = times_s[row] - times_s[row - 1];
        for j in row * columns..(row + 1) * columns {
            sums[j] = sums[j - columns] + 0.5 * step_s * (rates[j - columns] + rates[j]);
        }
    }
    sums
}

/// Two times that differ by less are one [s].
const SAME_S: f64 = 1e-6;

impl Course {
    /// Value and, if asked for, slope at a time; behind the last row straight on, before the first with the slope of the first interval:
    /// what dies away in it need not have been there before.
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
            if self.slopes_per_s.is_empty() {
                *value = a + x * (b - a);
                if let Some(slopes) = slopes.as_deref_mut() {
                    slopes[j] = (b - a) / length_s;
                }
                continue;
            }
            let (p, q) = (length_s * self.slope(right - 1, j), length_s * self.slope(right, j));
            // Hermite's cubic.
            let (c, d) = (3.0 * (b - a) - 2.0 * p - q, 2.0 * (a - b) + p + q);
            let slope = if x < 0.0 { b - a } else { p + inside * (2.0 * c + 3.0 * d * inside) } / length_s;
            *value = a + inside * (p + inside * (c + d * inside)) + if out { beyond_s * slope } else { 0.0 };
            if let Some(slopes) = slopes.as_deref_mut() {
                slopes[j] = slope;
            }
        }
    }

    fn value(&self, row: usize, column: usize) -> f64 {
        self.values[row * self.columns + column]
    }

    fn slope(&self, row: usize, column: usize) -> f64 {
        self.slopes_per_s[row * self.columns + column]
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
