//! The thesis chapter on drift compensation: its numbers beside what a record simulated from its stated numbers gives.
//!
//! ```text
//! R = K T + R0 in three lines;   B0 = F̄/S_n (3-1);   B_t = max |B_i − B_m|/|T_i − T_m| (3-4);   ARW = RMS/√W (3-5)
//! δθ = ARW √t (3-6);   B_s²(τ) = a0 + a1/τ + a2/τ², ARW = √a1 (3-7);   G(z) = 5 (z + 1)/(13 z − 3)
//! ```
//!
//! The chapter gives no record. This one follows its text: sums over 1 s of outputs at 100 Hz, a slow warming from 14 to 42 °C,
//! the lines of Eq. (3-11) with the printed break points, and white noise so large that what is left has the printed band. It
//! shows whether the printed numbers belong together, not that the chapter's gyro behaved so.
//!
//! # Source
//! Master's thesis on a line-of-sight stabilisation with a fibre-optic gyro (2021), chapter 3, Eqs. (3-1) to (3-11). The text is
//! scrambled where equations stand: G(z) is the one first-order filter of unit gain that its digits allow, and its time constant
//! of 4 s is the printed 0.04 Hz.

mod table;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use statrs::distribution::{ContinuousCDF, Normal};
use thiserror::Error;

use crate::compensate::CompensateError;
use crate::compensate::empirical::PiecewiseBias;
use crate::metrics::{Metrics, MetricsError};
use crate::numeric::spectrum::{Density, power_spectral_density};
use crate::numeric::statistics::{line, mean, rms, standard_deviation};
use crate::record::{Record, RecordError};
use crate::units::{
    celsius_from_kelvin, kelvin_from_celsius, rad_per_s_from_deg_per_h, rad_per_s_from_deg_per_s, s_from_h,
};

pub(crate) const TITLE: &str = "Master's thesis on a line-of-sight stabilisation with a fibre-optic gyro (2021), chapter 3: \
                         temperature drift of the gyro and its compensation";

/// Slope \[bit/°C] and value at 0 °C [bit\] of Eq. (3-11), and where each line ends [°C]; 100 outputs a second.
pub(crate) const LINES: [(f64, f64, f64); 3] =
    [(0.3386, -7.3229, 23.6), (0.1045, -2.0033, 30.0), (0.4082, -11.492, f64::INFINITY)];
/// What is left after compensation \[bit\], and the same in °/s: the only place where the two units meet.
pub(crate) const BAND_BIT: f64 = 2.5;
pub(crate) const BAND_DEG_PER_S: f64 = 0.0076;
const RANGE_C: (f64, f64) = (14.0, 42.0);
const ROWS: usize = 18_000;
/// Of one row [bit]: with it 3600 filtered means stay within the printed band.
const NOISE_BIT: f64 = 2.5;
/// Rows in a mean.
const MEAN_ROWS: usize = 5;
/// The offset of another start-up.
const TURN_ON_DEG_PER_H: f64 = 1.0;
/// Filtered means that tell a start-up's offset: ten minutes.
const TURN_ON_MEANS: usize = 120;
/// Of rows of one second.
const BANDWIDTH_HZ: f64 = 1.0;
const SEED: u64 = 2021;
/// Start-ups that repeatability is of: those after the first two.
const START_UPS: u64 = 6;
/// The chapter's "short term".
const SHORT_TERM_H: f64 = 1.0;
const STRETCH: usize = 2048;

/// A printed number beside the computed one.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PrintedComparison {
    pub(crate) place: &'static str,
    pub(crate) what: &'static str,
    pub(crate) unit: &'static str,
    /// None where the chapter gives the equation, but no number.
    pub(crate) published: Option<f64>,
    pub(crate) computed: f64,
    pub(crate) explanation: &'static str,
}

/// Everything that the chapter shows, computed.
#[derive(Debug, Clone, PartialEq)]
pub struct ThesisReproduction {
    pub(crate) comparisons: Vec<PrintedComparison>,
    /// Of the filtered means: time, temperature [°C], rate before and after [°/s].
    pub(crate) rows: Vec<[f64; 4]>,
    /// Of another start-up: time, angle integrated before and behind the lines of the first, its shift removed [°].
    pub(crate) angles: Vec<[f64; 3]>,
    pub(crate) spectrum: Vec<Density>,
    pub(crate) errata: &'static [(&'static str, &'static str, &'static str)],
}

/// Why the thesis cannot be reproduced.
#[derive(Debug, Error, Clone, PartialEq)]
#[allow(missing_docs, reason = "its messages say what each means")]
pub enum ThesisError {
    #[error(transparent)]
    Record(#[from] RecordError),
    #[error(transparent)]
    Compensate(#[from] CompensateError),
    #[error(transparent)]
    Metrics(#[from] MetricsError),
}

/// Place, what is printed, what is used.
pub(crate) const ERRATA: &[(&str, &str, &str)] = &[
    (
        "break points, text before Eq. (3-11)",
        "the three lines are said to meet at 23.6 and 30 °C; those that are printed meet at 22.72 and 31.24 °C",
        "the printed break points, at which the lines jump by 0.21 and 0.38 bit",
    ),
    (
        "zones, text before Eq. (3-8)",
        "below 25, from 25 to 30 and above 30 °C; Eq. (3-11) changes lines at 23.6 and 30 °C",
        "the break points of Eq. (3-11)",
    ),
    ("range, text before and after compensation", "14 to 42 °C, once 15 to 42 °C", "14 to 42 °C"),
    (
        "Fig. 3-3",
        "a spectrum of samples at 10 Hz; the records are of 1 Hz, sums of outputs at 100 Hz",
        "rows of 1 Hz, so the spectrum ends at 0.5 Hz",
    ),
    (
        "peak to peak after compensation",
        "0.00163 °/s, a reduction by 96 %; but Fig. 3-4 and the text leave ±2.5 bit = ±0.0076 °/s, which is 0.0152 °/s: \
         a decimal place (0.0163 °/s, a reduction by 59 %)",
        "±2.5 bit",
    ),
    (
        "Fig. 3-4 and text",
        "±2.5 (±0.0076 °/s) is the only place where bits and °/s meet: S_n = 329 bit/(°/s)",
        "that scale factor for everything",
    ),
    ("Eq. (3-6)", "δθ = RMS and √t with a factor that the text garbles", "δθ = ARW √t"),
];

/// °/s of one bit.
fn deg_per_s(bits: f64) -> f64 {
    bits * BAND_DEG_PER_S / BAND_BIT
}

fn bias_bit(temperature_c: f64) -> f64 {
    let (slope, at_zero, _) =
        LINES.iter().find(|(_, _, until_c)| temperature_c <= *until_c).copied().unwrap_or(LINES[2]);
    slope * temperature_c + at_zero
}

/// Temperature [°C] and rate [°/s] of one start-up, row by row.
fn raw(seed: u64, offset_deg_per_s: f64) -> Vec<(f64, f64)> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let normal = Normal::standard();
    (0..ROWS)
        .map(|i| {
            let temperature_c = RANGE_C.0 + (RANGE_C.1 - RANGE_C.0) * i as f64 / (ROWS - 1) as f64;
            let noise = NOISE_BIT * normal.inverse_cdf(random.random::<f64>());
            (temperature_c, offset_deg_per_s + deg_per_s(bias_bit(temperature_c) + noise))
        })
        .collect()
}

/// Means over five rows through G(z), as a record.
fn filtered(raw: &[(f64, f64)]) -> Result<Record, RecordError> {
    let means: Vec<(f64, f64)> = raw
        .chunks_exact(MEAN_ROWS)
        .map(|rows| {
            let of = |value: fn(&(f64, f64)) -> f64| mean(&rows.iter().map(value).collect::<Vec<_>>());
            (of(|r| r.0), of(|r| r.1))
        })
        .collect();
    let (mut before, mut out) = (means[0].1, means[0].1);
    let rates = means
        .iter()
        .map(|(_, rate)| {
            out = (3.0 * out + 5.0 * (rate + before)) / 13.0;
            before = *rate;
            rad_per_s_from_deg_per_s(out)
        })
        .collect();
    let times_s = (1..=means.len()).map(|i| (i * MEAN_ROWS) as f64).collect();
    Record::new("thesis2021", times_s, means.iter().map(|m| kelvin_from_celsius(m.0)).collect(), rates)
}

fn in_deg_per_s(rate_rad_per_s: f64) -> f64 {
    rate_rad_per_s / rad_per_s_from_deg_per_s(1.0)
}

/// The record without what the lines say.
fn compensated(record: &Record, lines: &PiecewiseBias) -> Result<Record, RecordError> {
    let left = record.each_row().map(|r| r.rate_rad_per_s - lines.bias_rad_per_s(r.temperature_k)).collect();
    Record::new("thesis2021", record.times_s().to_vec(), record.temperature_k().to_vec(), left)
}

/// Means of start-ups behind the lines, whose offsets are drawn with [`TURN_ON_DEG_PER_H`]: B_0i of Eq. (3-3) [°/s].
fn start_ups(lines: &PiecewiseBias) -> Result<Vec<f64>, RecordError> {
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let normal = Normal::standard();
    (2..2 + START_UPS)
        .map(|number| {
            let offset_deg_per_h = TURN_ON_DEG_PER_H * normal.inverse_cdf(random.random::<f64>());
            let offset = in_deg_per_s(rad_per_s_from_deg_per_h(offset_deg_per_h));
            let left = compensated(&filtered(&raw(SEED + number, offset))?, lines)?;
            Ok(in_deg_per_s(mean(left.rate_rad_per_s())))
        })
        .collect()
}

/// Time and the angles that a record turns by before and after its shift and its lines are taken off.
fn integrated(record: &Record, left: &Record, shift_deg_per_s: f64) -> Vec<[f64; 3]> {
    let (interval_s, mut angles) = (record.interval_s(), [0.0; 2]);
    let rates = record.each_row().zip(left.each_row());
    rates
        .map(|(before, after)| {
            angles[0] += in_deg_per_s(before.rate_rad_per_s) * interval_s;
            angles[1] += (in_deg_per_s(after.rate_rad_per_s) - shift_deg_per_s) * interval_s;
            [before.time_s, angles[0], angles[1]]
        })
        .collect()
}

/// √a1 of Eq. (3-7), over averaging times that double.
fn walk_by_fit(rates: &[f64], interval_s: f64) -> f64 {
    let mut points = Vec::new();
    let mut rows = 1;
    while rates.len() / rows >= 32 {
        let means: Vec<f64> = rates.chunks_exact(rows).map(mean).collect();
        points.push((1.0 / (rows as f64 * interval_s), standard_deviation(&means).powi(2)));
        rows *= 2;
    }
    // With the weights of equal relative error the quadratic term does not show in white noise; the slope at long times is a1.
    let long: Vec<(f64, f64)> = points.iter().skip(1).copied().collect();
    line(long.into_iter()).map_or(f64::NAN, |(_, slope)| slope.max(0.0).sqrt())
}

/// What a Kalman filter makes of a constant rate behind the lines, with its own standard error: x' = x, z = x + white noise.
fn kalman_estimate(raw: &[(f64, f64)], lines: &PiecewiseBias) -> (f64, f64) {
    let noise = deg_per_s(NOISE_BIT).powi(2);
    // Before the first row any rate is as likely.
    let (mut rate, mut variance) = (0.0, 1e6 * noise);
    for (temperature_c, measured) in raw {
        let left = measured - in_deg_per_s(lines.bias_rad_per_s(kelvin_from_celsius(*temperature_c)));
        let gain = variance / (variance + noise);
        rate += gain * (left - rate);
        variance *= 1.0 - gain;
    }
    (rate, variance.sqrt())
}

/// # Errors
/// None that the chapter's own numbers lead to.
pub fn reproduce() -> Result<ThesisReproduction, ThesisError> {
    let raw_rows = raw(SEED, 0.0);
    let record = filtered(&raw_rows)?;
    let lines = PiecewiseBias::fit(&[&record])?;
    let after = compensated(&record, &lines)?;
    let interval_s = record.interval_s();
    let (measured, left) = (Metrics::of(&record, interval_s)?, Metrics::of(&after, interval_s)?);
    // Another start-up: step 1 takes off what its first minutes show.
    let other_rows = raw(SEED + 1, in_deg_per_s(rad_per_s_from_deg_per_h(TURN_ON_DEG_PER_H)));
    let other_before = filtered(&other_rows)?;
    let other = compensated(&other_before, &lines)?;
    let rates: Vec<f64> = other.rate_rad_per_s().iter().map(|r| in_deg_per_s(*r)).collect();
    let shift = mean(&rates[TURN_ON_MEANS..]);
    let at_start = mean(&rates[..TURN_ON_MEANS]);
    let removed = shift - at_start;
    let estimate = kalman_estimate(&other_rows, &lines);
    let angles = integrated(&other_before, &other, at_start);
    let until = |time_s: f64| {
        let row = angles.iter().rev().find(|row| row[0] <= time_s);
        row.map_or([f64::NAN; 2], |row| [row[1], row[2]])
    };

    let noise: Vec<f64> = raw_rows.iter().map(|(t, rate)| rate - deg_per_s(bias_bit(*t))).collect();
    let crossing = |a: usize, b: usize| (LINES[b].1 - LINES[a].1) / (LINES[a].0 - LINES[b].0);
    // A row a second holds white noise up to 1 Hz, counted on both sides of zero.
    let walk = rms(&noise) / BANDWIDTH_HZ.sqrt();
    let comparisons = table::comparisons(&table::SimulatedMeasures {
        measured: &measured,
        left: &left,
        lines: &lines,
        crossings_c: [crossing(0, 1), crossing(1, 2)],
        walk,
        walk_by_fit: walk_by_fit(&noise, 1.0),
        shifts: [shift, removed],
        repeatability: standard_deviation(&start_ups(&lines)?),
        angles: [until(s_from_h(SHORT_TERM_H)), until(f64::INFINITY)],
        estimate,
    });
    let all: Vec<f64> = raw_rows.iter().map(|r| r.1).collect();
    let rows = record
        .each_row()
        .zip(after.each_row())
        .map(|(b, a)| {
            [
                b.time_s,
                celsius_from_kelvin(b.temperature_k),
                in_deg_per_s(b.rate_rad_per_s),
                in_deg_per_s(a.rate_rad_per_s),
            ]
        })
        .collect();
    let spectrum = power_spectral_density(&all, 1.0, STRETCH, 60);
    Ok(ThesisReproduction { comparisons, rows, angles, spectrum, errata: ERRATA })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_printed_numbers_belong_together_but_for_the_errata() {
        let found = reproduce().unwrap();
        for c in &found.comparisons {
            println!("{:12} {:45} {:>12?} {:>12.6} {}", c.place, c.what, c.published, c.computed, c.unit);
            assert!(c.computed.is_finite(), "{}", c.what);
        }
        let ratio = |what: &str| {
            let c = found.comparisons.iter().find(|c| c.what == what).unwrap();
            c.computed / c.published.unwrap()
        };
        for what in [
            "peak to peak before",
            "temperature sensitivity before",
            "band after, half of peak to peak",
            "bandwidth of G(z)",
        ] {
            // One drawn record: its peaks scatter by some 15 %.
            assert!((ratio(what) - 1.0).abs() < 0.2, "{what}: {}", ratio(what));
        }
        assert!(ratio("peak to peak after") > 8.0);
        let hours = found.comparisons.iter().filter(|c| c.unit.starts_with("°/h") && c.published.is_some()).count();
        assert_eq!(hours, 4);
        // About a point of the middle zone the sensitivity is the printed one, to the points' own noise of a per cent and the means over
        // 5 °C; about 20 °C it is the lower line's slope.
        assert!((ratio("temperature sensitivity before, m at 25 °C") - 1.0).abs() < 0.05);
        // Another start-up an hour on: the lines leave less than its shift and the noise of ten minutes come to.
        let of = |what: &str| found.comparisons.iter().find(|c| c.what == what).unwrap().computed;
        assert!((of("lower break point, of the lines") - 22.72).abs() < 0.01);
        assert!((of("upper break point, of the lines") - 31.24).abs() < 0.01);
        let removed = of("shift of another start-up, removed");
        assert!(
            (of("drift angle of another start-up, 5 h, after") - 18_000.0 * removed).abs()
                < 0.05 * 18_000.0 * removed.abs()
        );
        assert!(
            of("drift angle of another start-up, 5 h, before").abs()
                > 5.0 * of("drift angle of another start-up, 5 h, after").abs()
        );
        // Of offsets of 1 °/h, six of them: within the χ² band of 99 %.
        let repeatability = of("bias repeatability") * 3600.0;
        assert!((0.25..2.2).contains(&repeatability), "{repeatability}");
        for (summed, output) in [("K_l", "slope of the lower line"), ("R_0h", "upper line at 0 °C")] {
            assert!((of(summed) - 100.0 * of(output)).abs() < 1e-9);
        }
        let (estimate, error) = (of("Kalman estimate of a rate of 1 °/h"), of("its standard error"));
        // The lines that are taken off know the rate as badly as the estimate does.
        assert!((estimate - TURN_ON_DEG_PER_H).abs() < 3.0 * 2f64.sqrt() * error && error < 0.3, "{estimate} {error}");
        let (walk, fit) = (of("angle random walk, RMS/√W"), of("angle random walk, fit of B_s²"));
        assert!((fit / walk - 1.0).abs() < 0.1, "{walk} {fit}");
    }
}
