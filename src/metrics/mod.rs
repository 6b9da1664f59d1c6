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
//! White noise (angle random walk), flicker, random walk of the rate, quantisation and ramp come with intervals that hold together
//! with 95 %, from all octaves at once ([`crate::numeric::coloured`]); what follows the temperature ([`thermal`]) is not taken for
//! noise. The bias instability is the Allan deviation's minimum as it is, not divided by 0.664. The Allan deviation needs regular
//! sampling: it is that of the longest stretch without a gap; the noises are of all rows.
//!
//! Where a table turned the gyro, its rate is taken off, and the scale factor is had from its even stretches ([`scale_factor`]).
//! The earth's rate is a known part of the bias where latitude and attitude are stated ([`earth`]).
//!
//! # Source
//! Thesis chapter on FOG drift compensation (2021), Eqs. (3-1) to (3-7), which leave open which test point m is: the
//! standards for gyros (GJB 2426A, IEEE Std 952) take room temperature. Bs there is the deviation of the output itself.

pub(crate) mod earth;
mod meter;
pub(crate) mod scale_factor;
pub(crate) mod thermal;

use thiserror::Error;

pub(crate) use meter::Meter;

use crate::numeric::allan::AllanPoint;
use crate::numeric::coloured::NoiseStrengths;
use crate::numeric::statistics::standard_deviation;
use crate::record::Record;
use crate::units::REFERENCE_TEMPERATURE_K;
use scale_factor::ScaleFactor;

/// The measures of one record.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Metrics {
    pub(crate) rows: usize,
    pub(crate) duration_s: f64,
    /// The usual one.
    pub(crate) interval_s: f64,
    pub(crate) gaps: usize,
    /// Steps that differ from the usual interval.
    pub(crate) irregular_steps: usize,
    pub(crate) bias_rad_per_s: f64,
    /// None where there are not two means.
    pub(crate) bias_stability_rad_per_s: Option<f64>,
    /// What the stability was really averaged over.
    pub(crate) average_s: f64,
    pub(crate) peak_to_peak_rad_per_s: f64,
    /// Of the means over `average_s`.
    pub(crate) averaged_peak_to_peak_rad_per_s: f64,
    /// The rate integrated over the record, each value standing for the time before it.
    pub(crate) drift_angle_rad: f64,
    pub(crate) temperature_range_k: f64,
    /// None where the record holds one test point only.
    pub(crate) temperature_sensitivity_rad_per_s_per_k: Option<f64>,
    pub(crate) temperature_points: Vec<TemperaturePoint>,
    pub(crate) allan: Option<Allan>,
    /// None for a record too short to tell noises apart.
    pub(crate) noises: Option<NoiseStrengths>,
    /// None where no table turned the gyro at several rates.
    pub(crate) scale_factor: Option<ScaleFactor>,
}

/// Mean rate over a band of temperature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TemperaturePoint {
    pub(crate) temperature_k: f64,
    pub(crate) bias_rad_per_s: f64,
    pub(crate) rows: usize,
}

/// The Allan deviation and what it says.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Allan {
    pub(crate) points: Vec<AllanPoint>,
    /// The point with the smallest deviation.
    pub(crate) minimum: AllanPoint,
    /// Of the stretch without a gap that it was computed from.
    pub(crate) rows: usize,
    pub(crate) interval_s: f64,
}

#[derive(Debug, Error, Clone, PartialEq)]
#[non_exhaustive]
pub enum MetricsError {
    #[error("the averaging time must be positive, found {found_s} s")]
    Average { found_s: f64 },
    #[error("a record needs at least {needed} rows, found {found}")]
    TooShort { needed: usize, found: usize },
    #[error("there is no record to measure")]
    Nothing,
}

/// Width of a test point.
const POINT_WIDTH_K: f64 = 5.0;
/// Share of the rows that a test point needs.
const POINT_SHARE: f64 = 0.02;

impl Metrics {
    /// Of a gyro on a table what it shows beside the turning; of one at rest its bias.
    pub(crate) fn offset_rad_per_s(&self) -> f64 {
        self.scale_factor.as_ref().map_or(self.bias_rad_per_s, |scale| scale.offset_rad_per_s)
    }

    /// # Errors
    /// An averaging time that is not positive.
    pub(crate) fn of(record: &Record, average_s: f64) -> Result<Self, MetricsError> {
        let mut meter = Meter::new(average_s)?;
        record.each_row().for_each(|row| meter.push(row));
        meter.finish()
    }
}

/// Br of several records; None of one.
///
/// # Errors
/// No record at all.
pub(crate) fn repeatability_rad_per_s(records: &[Metrics]) -> Result<Option<f64>, MetricsError> {
    if records.is_empty() {
        return Err(MetricsError::Nothing);
    }
    let biases: Vec<f64> = records.iter().map(|m| m.bias_rad_per_s).collect();
    Ok(Some(standard_deviation(&biases)).filter(|s| s.is_finite()))
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
        let walk = metrics.noises.unwrap().white;
        // N = σ √τ0, and means over 20 rows are √20 quieter.
        println!("white {walk:?} of {:.4e}", 1e-6 * 0.5f64.sqrt());
        assert!((walk.value / (1e-6 * 0.5f64.sqrt()) - 1.0).abs() < 0.03);
        assert!((metrics.bias_stability_rad_per_s.unwrap() / (1e-6 / 20f64.sqrt()) - 1.0).abs() < 0.05);
        assert_eq!(metrics.temperature_sensitivity_rad_per_s_per_k, None);

        let temperature_k: Vec<f64> = times_s.iter().map(|t| kelvin_from_celsius(60.0 - 0.004 * t)).collect();
        let rates = temperature_k.iter().zip(&white).map(|(t, w)| 2e-6 * t + w).collect();
        let ramped = Record::new("x", times_s, temperature_k, rates).unwrap();
        let found = Metrics::of(&ramped, 10.0).unwrap().temperature_sensitivity_rad_per_s_per_k.unwrap();
        assert!((found / 2e-6 - 1.0).abs() < 0.01, "{found:e}");
    }

    #[test]
    fn a_rate_that_is_the_same_in_every_row_has_no_noise_whatever_gap_the_record_has() {
        for (rate, gap_s) in [(1.7e-6, 1e4), (0.3, 1e9), (1e-308, 4e-11), (-7.123_456_7e-3, 1e-3)] {
            let times_s: Vec<f64> = (0..160).map(|i| 10.0 * f64::from(i) + if i > 33 { gap_s } else { 0.0 }).collect();
            let temperature_k = (0..160).map(|i| 293.0 + 0.05 * f64::from(i)).collect();
            let metrics =
                Metrics::of(&Record::new("x", times_s, temperature_k, vec![rate; 160]).unwrap(), 10.0).unwrap();
            assert_eq!(metrics.noises, None, "{rate} {gap_s}");
        }
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
