//! What a gyro's data sheet says, from records at rest.
//!
//! ```text
//! B0 = mean(Ω)                                   bias
//! Bs(τ) = sd of the means over τ                 bias stability
//! Br = sd of B0 over Q records, with Q − 1       repeatability
//! Bt = max |B0_i − B0_m| / |T_i − T_m|           temperature sensitivity
//! ```
//!
//! | symbol | meaning | in code |
//! |---|---|---|
//! | B0_i, T_i | mean rate and temperature of test point i: a band of 5 K with at least 2 % of the rows | `temperature_points` |
//! | m | the test point nearest to room temperature, 20 °C | `REFERENCE_TEMPERATURE_K` |
//! | τ | averaging time, or one row where rows are further apart | `average_s` |
//!
//! Angle random walk is read off the Allan deviation's slope of −½; rate random walk, quantisation and flicker are fitted
//! to the whole curve ([`crate::numeric::allan`]). The bias instability is the Allan deviation's minimum as it is, not divided by 0.664. The
//! Allan deviation needs regular sampling: it is that of the longest stretch without a gap.
//!
//! Leaves out scale-factor errors and everything that needs a turntable.
//!
//! # Source
//! Thesis chapter on FOG drift compensation (2021), Eqs. (3-1) to (3-7), which leave open which test point m is: the
//! standards for gyros (GJB 2426A, IEEE Std 952) take room temperature. Bs there is the deviation of the output itself.

use thiserror::Error;

use crate::numeric::allan::{self, AllanPoint, NoiseModel};
use crate::numeric::statistics::{mean, standard_deviation};
use crate::record::Record;
use crate::units::REFERENCE_TEMPERATURE_K;

/// The measures of one record.
#[derive(Debug, Clone, PartialEq)]
pub struct Metrics {
    pub rows: usize,
    pub duration_s: f64,
    pub bias_rad_per_s: f64,
    /// None where there are not two means.
    pub bias_stability_rad_per_s: Option<f64>,
    /// What the stability was really averaged over.
    pub average_s: f64,
    pub peak_to_peak_rad_per_s: f64,
    /// Of the means over `average_s`.
    pub averaged_peak_to_peak_rad_per_s: f64,
    /// None where the record holds one test point only.
    pub temperature_sensitivity_rad_per_s_per_k: Option<f64>,
    pub temperature_points: Vec<TemperaturePoint>,
    pub allan: Option<Allan>,
}

/// Mean rate over a band of temperature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TemperaturePoint {
    pub temperature_k: f64,
    pub bias_rad_per_s: f64,
    pub rows: usize,
}

/// The Allan deviation and what it says.
#[derive(Debug, Clone, PartialEq)]
pub struct Allan {
    pub points: Vec<AllanPoint>,
    /// Angle random walk, read off the slope of −½ [rad/√s]; an upper bound where there is no such slope.
    pub white_rad_per_sqrt_s: f64,
    pub has_white_slope: bool,
    /// Fitted to the whole curve; in rad/s and powers of seconds.
    pub noises: NoiseModel,
    /// The point with the smallest deviation.
    pub minimum: AllanPoint,
    /// Of the stretch without a gap that it was computed from.
    pub rows: usize,
    pub interval_s: f64,
}

#[derive(Debug, Error, Clone, PartialEq)]
pub enum MetricsError {
    #[error("the averaging time must be positive, found {found_s} s")]
    Average { found_s: f64 },
    #[error("there is no record to measure")]
    Nothing,
}

/// Width of a test point.
const POINT_WIDTH_K: f64 = 5.0;
/// Share of the rows that a test point needs.
const POINT_SHARE: f64 = 0.02;
/// Intervals that differ less than this from the usual one are regular.
const REGULAR: f64 = 0.01;
/// Fewer regular rows have no Allan deviation worth the name.
const MIN_ALLAN_ROWS: usize = 16;

impl Metrics {
    /// # Errors
    /// An averaging time that is not positive.
    pub fn of(record: &Record, average_s: f64) -> Result<Self, MetricsError> {
        if !(average_s > 0.0 && average_s.is_finite()) {
            return Err(MetricsError::Average { found_s: average_s });
        }
        let rates = record.rate_rad_per_s();
        let per_mean = ((average_s / record.interval_s()).round() as usize).max(1);
        let means: Vec<f64> = means_over(record, per_mean);
        let points = temperature_points(record);
        Ok(Self {
            rows: record.rows(),
            duration_s: record.times_s()[record.rows() - 1] - record.times_s()[0],
            bias_rad_per_s: mean(rates),
            bias_stability_rad_per_s: Some(standard_deviation(&means)).filter(|s| s.is_finite()),
            average_s: per_mean as f64 * record.interval_s(),
            peak_to_peak_rad_per_s: peak_to_peak(rates),
            averaged_peak_to_peak_rad_per_s: peak_to_peak(&means),
            temperature_sensitivity_rad_per_s_per_k: temperature_sensitivity(&points),
            temperature_points: points,
            allan: Allan::of(record),
        })
    }
}

/// Br of several records; None of one.
///
/// # Errors
/// No record at all.
pub fn repeatability_rad_per_s(records: &[Metrics]) -> Result<Option<f64>, MetricsError> {
    if records.is_empty() {
        return Err(MetricsError::Nothing);
    }
    let biases: Vec<f64> = records.iter().map(|m| m.bias_rad_per_s).collect();
    Ok(Some(standard_deviation(&biases)).filter(|s| s.is_finite()))
}

fn peak_to_peak(values: &[f64]) -> f64 {
    let (low, high) =
        values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)));
    if high >= low { high - low } else { 0.0 }
}

/// Means of `per_mean` rows each that follow each other without a gap; what is left over at an end is dropped.
fn means_over(record: &Record, per_mean: usize) -> Vec<f64> {
    let mut breaks: Vec<usize> = record.gaps().into_iter().map(|(row, _)| row).collect();
    breaks.push(record.rows());
    let mut from = 0;
    let mut means = Vec::new();
    for to in breaks {
        means.extend(record.rate_rad_per_s()[from..to].chunks_exact(per_mean).map(mean));
        from = to;
    }
    means
}

fn temperature_points(record: &Record) -> Vec<TemperaturePoint> {
    let mut bands: std::collections::BTreeMap<i64, (f64, f64, usize)> = std::collections::BTreeMap::new();
    for (temperature_k, rate) in record.temperature_k().iter().zip(record.rate_rad_per_s()) {
        // Room temperature is the middle of a band.
        let band = ((temperature_k - REFERENCE_TEMPERATURE_K) / POINT_WIDTH_K).round() as i64;
        let sums = bands.entry(band).or_default();
        *sums = (sums.0 + temperature_k, sums.1 + rate, sums.2 + 1);
    }
    let least = (POINT_SHARE * record.rows() as f64).max(1.0);
    bands
        .into_values()
        .filter(|(_, _, rows)| *rows as f64 >= least)
        .map(|(temperature, rate, rows)| TemperaturePoint {
            temperature_k: temperature / rows as f64,
            bias_rad_per_s: rate / rows as f64,
            rows,
        })
        .collect()
}

fn temperature_sensitivity(points: &[TemperaturePoint]) -> Option<f64> {
    let from_room = |p: &TemperaturePoint| (p.temperature_k - REFERENCE_TEMPERATURE_K).abs();
    let reference = points.iter().min_by(|a, b| from_room(a).total_cmp(&from_room(b)))?;
    points
        .iter()
        .filter(|p| (p.temperature_k - reference.temperature_k).abs() > 0.5 * POINT_WIDTH_K)
        .map(|p| {
            (p.bias_rad_per_s - reference.bias_rad_per_s).abs() / (p.temperature_k - reference.temperature_k).abs()
        })
        .max_by(f64::total_cmp)
}

impl Allan {
    /// None where no stretch is long and regular enough.
    pub fn of(record: &Record) -> Option<Self> {
        let interval_s = record.interval_s();
        let times_s = record.times_s();
        let (mut best, mut from) = (0..0, 0);
        for row in 1..=times_s.len() {
            let broken =
                row == times_s.len() || (times_s[row] - times_s[row - 1] - interval_s).abs() > REGULAR * interval_s;
            if broken {
                if row - from > best.len() {
                    best = from..row;
                }
                from = row;
            }
        }
        if best.len() < MIN_ALLAN_ROWS {
            return None;
        }
        let rates = &record.rate_rad_per_s()[best];
        let points = allan::overlapping(rates, interval_s, &allan::factors(rates.len()));
        let minimum = *points.iter().min_by(|a, b| a.deviation.total_cmp(&b.deviation))?;
        let (white_rad_per_sqrt_s, has_white_slope) = allan::white_by_slope(&points)?;
        Some(Self {
            white_rad_per_sqrt_s,
            has_white_slope,
            noises: NoiseModel::fit(&points),
            minimum,
            rows: rates.len(),
            interval_s,
            points,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::kelvin_from_celsius;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use statrs::distribution::{ContinuousCDF, Normal};

    #[test]
    fn white_noise_over_a_linear_bias_gives_back_noise_and_slope() {
        let mut random = ChaCha8Rng::seed_from_u64(11);
        let normal = Normal::new(0.0, 1e-6).unwrap();
        let times_s: Vec<f64> = (0..40_000).map(|i| 0.5 * f64::from(i)).collect();
        let white: Vec<f64> = times_s.iter().map(|_| normal.inverse_cdf(random.random::<f64>())).collect();
        let still = Record::new("x", times_s.clone(), vec![300.0; 40_000], white.clone()).unwrap();
        let metrics = Metrics::of(&still, 10.0).unwrap();
        let allan = metrics.allan.unwrap();
        // N = σ √τ0, and means over 20 rows are √20 quieter.
        println!("white {:.4e} of {:.4e}", allan.white_rad_per_sqrt_s, 1e-6 * 0.5f64.sqrt());
        assert!((allan.white_rad_per_sqrt_s / (1e-6 * 0.5f64.sqrt()) - 1.0).abs() < 0.03);
        assert!((metrics.bias_stability_rad_per_s.unwrap() / (1e-6 / 20f64.sqrt()) - 1.0).abs() < 0.05);
        assert_eq!(metrics.temperature_sensitivity_rad_per_s_per_k, None);

        let temperature_k: Vec<f64> = times_s.iter().map(|t| kelvin_from_celsius(60.0 - 0.004 * t)).collect();
        let rates = temperature_k.iter().zip(&white).map(|(t, w)| 2e-6 * t + w).collect();
        let ramped = Record::new("x", times_s, temperature_k, rates).unwrap();
        let found = Metrics::of(&ramped, 10.0).unwrap().temperature_sensitivity_rad_per_s_per_k.unwrap();
        assert!((found / 2e-6 - 1.0).abs() < 0.01, "{found:e}");
    }

    #[test]
    fn repeatability_is_the_deviation_of_the_biases_with_one_less() {
        let record = |rate: f64| Record::new("x", vec![0.0, 1.0, 2.0], vec![300.0; 3], vec![rate; 3]).unwrap();
        let metrics: Vec<Metrics> = [1.0, 2.0, 4.0].map(|r| Metrics::of(&record(r), 10.0).unwrap()).into();
        let found = repeatability_rad_per_s(&metrics).unwrap().unwrap();
        assert!((found - (7.0f64 / 3.0).sqrt()).abs() < 1e-12);
        assert_eq!(repeatability_rad_per_s(&metrics[..1]).unwrap(), None);
    }
}
