//! What a reading on a coarse grid says: between which bounds the thermometer was, not what it was give or take an error.
//!
//! ```text
//! m = y − e/D,  V = 1/D − R + σ²              what all other measurements make of the reading before it is rounded
//! μ, s²: mean and variance of N(m, V) from v − q/2 to v + q/2
//! 1/τ = 1/s² − 1/V,  y ← τ (μ/s² − m/V),  R ← σ² + τ        until nothing changes
//! ```
//!
//! Where a sensor's own noise is far smaller than its step, errors of rounding are those of the course itself: a row at which the reading
//! goes to the next value says where the course is to a fraction of the step, one among many equal ones says little.
//!
//! | symbol | meaning | in code |
//! |---|---|---|
//! | v, q | a reading and the sensor's step | |
//! | y, R | what takes the reading's place, with its variance | `Series::values`, `Row::rounding` times q²/12 |
//! | e/D, 1/D | a value less what all others make of it, and its variance | [`super::doubts`] |
//! | σ | noise of the sensor before it rounds | `Quantity::ReadingNoise` |
//!
//! # Source
//! Minka, Expectation propagation for approximate Bayesian inference, Proc. UAI (2001) 362. With a noise σ before rounding the mean error
//! follows the course by (q/π) e^(−2π²σ²/q²) at most, the first harmonic of its Fourier series: Widrow and Kollár, Quantization Noise (2008).

use statrs::distribution::{Continuous, ContinuousCDF, Normal};

use super::ascent::Effort;
use super::coil_side::run_kept;
use super::doubts::doubts;
use super::fit::Fit;
use super::grid::GRIDDED;
use super::prior::Quantity;
use super::{Chamber, ChamberError};

/// With a noise of this share of the step errors of rounding follow the course by less than 4 % of the step.
const DITHERS: f64 = 1.0 / 3.0;
/// Passes over a record by one set of numbers, and of what a pass asks for the share that is done: readings hang together.
const PASSES: usize = 6;
const DONE: f64 = 0.6;
/// Times that numbers are fitted to what takes the readings' place.
const FITS: usize = 2;
/// A reading says nothing with so many times the variance of rounding.
const NOTHING: f64 = 1e4;

impl Chamber<'_> {
    /// Puts readings of coarse sensors where everything else says they were between the steps of their grid; a fit to that.
    ///
    /// # Errors
    /// As [`Chamber::fit`].
    pub(super) fn between_steps(&mut self, mut fit: Fit, records: &[usize]) -> Result<Fit, ChamberError> {
        let coarse: Vec<usize> = records.iter().copied().filter(|&r| self.is_coarse(&fit, r)).collect();
        if coarse.is_empty() {
            return Ok(fit);
        }
        for _ in 0..FITS {
            for &r in &coarse {
                for _ in 0..PASSES {
                    self.put_between_steps(&fit, r)?;
                }
            }
            fit = self.fit(&fit.assumed.clone(), &fit.free.clone(), records, Some(&fit), Effort::SHORT)?;
        }
        Ok(fit)
    }

    /// Rows of several readings are their means: rounding is averaged there.
    fn is_coarse(&self, fit: &Fit, record: usize) -> bool {
        let series = &self.observed[record].series;
        let noise_k = self.numbers_for(fit, record).get(Quantity::ReadingNoise);
        series.averaged == 1 && noise_k < DITHERS * series.resolution_k
    }

    /// One pass over a record's readings.
    fn put_between_steps(&mut self, fit: &Fit, record: usize) -> Result<(), ChamberError> {
        let numbers = self.numbers_for(fit, record);
        let (side, values) = self.side_and_values(fit, record, &numbers)?;
        let observed = &self.observed[record];
        let (system, trace) = run_kept(&side, &fit.assumed, &numbers, observed, &values);
        let doubts = doubts(&system, &observed.series.rows, &trace);
        let read = [Some(observed.record.temperature_k()), observed.record.inner_k()];
        let step_k = observed.series.resolution_k;
        let rounding = step_k * step_k / 12.0;
        let mut next = 0;
        let series = &mut self.observed[record].series;
        for (k, row) in series.rows.iter_mut().enumerate() {
            for m in (0..row.measured.len()).filter(|&m| row.measured[m].is_some()) {
                let (standardised, precision) = (doubts.values[next], doubts.precisions[next]);
                next += 1;
                let Some(read) = read.get(m).copied().flatten().filter(|_| m < GRIDDED) else { continue };
                let (taken, known) = (values.of[m][k], series.values[m][k] - values.of[m][k]);
                let own = system.variances[m];
                let before = rounding * row.rounding[m];
                let others =
                    Gaussian { mean: taken - standardised / precision.sqrt(), variance: 1.0 / precision - before };
                if !(others.variance > own) {
                    continue;
                }
                let reading = read[series.spans[k].0] - series.reference_k - known;
                let said = others.said_between(reading - 0.5 * step_k, reading + 0.5 * step_k, NOTHING * rounding);
                // Precisions, and they times their means, go a share of the way.
                let (old, new) = (1.0 / before, 1.0 / said.variance);
                let mixed = old + DONE * (new - old);
                let mean = (old * taken + DONE * (new * said.mean - old * taken)) / mixed;
                series.values[m][k] = mean + known;
                row.rounding[m] = 1.0 / (mixed * rounding);
            }
        }
        Ok(())
    }
}

/// A normal density.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Gaussian {
    mean: f64,
    variance: f64,
}

impl Gaussian {
    /// What must be multiplied with it for mean and variance of it between bounds; with this variance at most.
    fn said_between(self, low: f64, high: f64, most: f64) -> Self {
        let between = self.between(low, high);
        let precision = 1.0 / between.variance - 1.0 / self.variance;
        if !(precision > 1.0 / most) {
            return Self { mean: between.mean, variance: most };
        }
        Self {
            mean: (between.mean / between.variance - self.mean / self.variance) / precision,
            variance: 1.0 / precision,
        }
    }

    /// Mean and variance between bounds.
    fn between(self, low: f64, high: f64) -> Self {
        let deviation = self.variance.sqrt();
        // The tail towards +∞ keeps its digits.
        let turned = if 0.5 * (low + high) < self.mean { -1.0 } else { 1.0 };
        let (a, b) = (turned * (low - self.mean) / deviation, turned * (high - self.mean) / deviation);
        let (a, b) = (a.min(b), a.max(b));
        let flat = Self { mean: 0.5 * (low + high), variance: (high - low).powi(2) / 12.0 };
        let unit = Normal::standard();
        let share = unit.sf(a) - unit.sf(b);
        if b - a < NARROW || !(share > f64::MIN_POSITIVE) {
            return flat;
        }
        let (at_a, at_b) = (unit.pdf(a), unit.pdf(b));
        let mean = (at_a - at_b) / share;
        let variance = 1.0 + (a * at_a - b * at_b) / share - mean * mean;
        if variance > 0.0 {
            Self { mean: self.mean + turned * deviation * mean, variance: self.variance * variance }
        } else {
            flat
        }
    }
}

/// Bounds so near that the density between them is even, in deviations.
const NARROW: f64 = 1e-3;

#[cfg(test)]
mod tests {
    use super::super::Assumption;
    use super::super::dense::tests::model;
    use super::super::kinks::tests::kinked;
    use super::*;
    use crate::pattern::classic::Classic;
    use crate::record::Record;

    /// Mean and variance by summing over many points.
    fn summed(of: Gaussian, low: f64, high: f64) -> Gaussian {
        let points = 200_000;
        let (mut weight, mut first, mut second) = (0.0, 0.0, 0.0);
        for i in 0..points {
            let x = low + (f64::from(i) + 0.5) / f64::from(points) * (high - low);
            let density = (-0.5 * (x - of.mean).powi(2) / of.variance).exp();
            weight += density;
            first += density * x;
            second += density * x * x;
        }
        let mean = first / weight;
        Gaussian { mean, variance: second / weight - mean * mean }
    }

    #[test]
    fn mean_and_variance_between_bounds_are_those_of_a_sum() {
        for (mean, variance) in [(0.0, 1.0), (0.7, 0.04), (-2.5, 0.3), (3.0, 25.0), (0.1, 1e-4)] {
            let of = Gaussian { mean, variance };
            let (found, exact) = (of.between(-0.5, 0.5), summed(of, -0.5, 0.5));
            assert!((found.mean - exact.mean).abs() < 1e-6, "{found:?} for {exact:?}");
            assert!((found.variance / exact.variance - 1.0).abs() < 1e-4, "{found:?} for {exact:?}");
        }
        // Too far away for any digits: even between the bounds.
        let far = Gaussian { mean: 100.0, variance: 1.0 }.between(-0.5, 0.5);
        assert!(far.variance > 0.0 && far.mean.abs() <= 0.5);
    }

    #[test]
    fn errors_of_rounding_follow_a_course_by_little_with_such_a_noise() {
        let harmonic = (-2.0 * (std::f64::consts::PI * DITHERS).powi(2)).exp() / std::f64::consts::PI;
        assert!(harmonic < 0.04 && harmonic > 0.03, "{harmonic}");
    }

    #[test]
    fn what_is_said_makes_of_what_others_say_what_lies_between() {
        let others = Gaussian { mean: 0.4, variance: 0.09 };
        let (said, between) = (others.said_between(-0.5, 0.5, 1e3), others.between(-0.5, 0.5));
        let precision = 1.0 / said.variance + 1.0 / others.variance;
        let mean = (said.mean / said.variance + others.mean / others.variance) / precision;
        assert!((mean - between.mean).abs() < 1e-12 && (precision * between.variance - 1.0).abs() < 1e-12);
        // Well within the bounds it says nothing.
        assert_eq!(Gaussian { mean: 0.0, variance: 1e-6 }.said_between(-0.5, 0.5, 1e3).variance, 1e3);
    }

    #[test]
    #[ignore = "long: --include-ignored"]
    fn what_takes_a_coarse_sensors_readings_place_is_nearer_to_what_they_were() {
        let (bare, pattern) = (model(Vec::new()), Classic::Zyl.pattern(8).unwrap());
        let fine = kinked(&bare, &pattern);
        let rounded = fine.temperature_k().iter().map(|t| (t / 0.1).round() * 0.1).collect();
        let coarse = Record::new("coarse", fine.times_s().to_vec(), rounded, fine.rate_rad_per_s().to_vec()).unwrap();
        let declared = Assumption::new(bare.clone(), pattern);
        let (chamber, _) = Chamber::new(&bare, &[&coarse]).unwrap().with_shocks(&declared, &[0]).unwrap();
        let series = &chamber.observed[0].series;
        let off = |readings: &dyn Fn(usize) -> f64| {
            let squares = fine.temperature_k().iter().enumerate().map(|(k, t)| (readings(k) - t).powi(2));
            squares.sum::<f64>().sqrt() / (fine.temperature_k().len() as f64).sqrt()
        };
        let before = off(&|k| coarse.temperature_k()[k]);
        let after = off(&|k| series.values[0][k] + series.reference_k);
        println!("{before:.4} K before, {after:.4} K after");
        assert!(after < 0.6 * before, "{after} of {before}");
        // A fine sensor's are left as they are.
        let (chamber, _) = Chamber::new(&bare, &[&fine]).unwrap().with_shocks(&declared, &[0]).unwrap();
        let series = &chamber.observed[0].series;
        assert!((0..600).all(
            |k| series.values[0][k] + series.reference_k == fine.temperature_k()[k] || series.values[0][k].is_nan()
        ));
    }
}
