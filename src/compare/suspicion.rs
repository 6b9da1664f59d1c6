//! What is worth saying about records and declared numbers before any physics is named.
//!
//! | suspicion | said where |
//! |---|---|
//! | the time step contradicts `rate_mean_s` | the median step is not the stated mean's length within `STEP_TOLERANCE` |
//! | the record starts in a ramp | over the first `START_S` the sensor's straight line is steeper than `STEADY_K_PER_S` and than 5 of its errors |
//! | a Fahrenheit coefficient | a fitted factor on dn/dT is 5/9 or 9/5 within `FACTOR_TOLERANCE` |

use crate::record::Record;
use crate::units::c_per_min_from_k_per_s;

/// A logger whose steps differ from the mean's length by less than this rounds its stamps; by more it does something else.
const STEP_TOLERANCE: f64 = 0.25;

/// Long enough for two cycles of a compressor's ripple to average out, short enough for a ramp that has just begun not to count.
const START_S: f64 = 300.0;

/// 0.2 K/min: a chamber that holds its temperature drifts less, ripple of 0.2 K and 150 s included; tests ramp faster.
const STEADY_K_PER_S: f64 = 0.2 / 60.0;

/// Standard errors by which a slope must exceed zero.
const SLOPE_ERRORS: f64 = 5.0;

/// A wrong unit is exact; what is fitted of it is not.
const FACTOR_TOLERANCE: f64 = 0.03;

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Suspicion {
    Step { record: String, step_s: f64, rate_mean_s: f64 },
    Ramp { record: String, slope_k_per_s: f64 },
    Fahrenheit { factor: f64 },
}

impl std::fmt::Display for Suspicion {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Suspicion::Step { record, step_s, rate_mean_s } => write!(
                f,
                "{record}: rows are {step_s} s apart, but sensor.rate_mean_s says that each rate is a mean over {rate_mean_s} s: if the logger averages from row to row, state {step_s}"
            ),
            Suspicion::Ramp { record, slope_k_per_s } => write!(
                f,
                "{record} starts in a ramp ({:+.2} °C/min in its first {START_S:.0} s): the pack was not at rest, and what its layers had then is estimated, not known; a record that starts after a soak says more",
                c_per_min_from_k_per_s(*slope_k_per_s)
            ),
            Suspicion::Fahrenheit { factor } => {
                let (ratio, way) =
                    if *factor < 1.0 { ("5/9", "per °F") } else { ("9/5", "per °F where per K was meant") };
                write!(
                    f,
                    "the thermo-optic coefficient is wrong by {factor:.3}, close to {ratio}: was dn/dT stated {way}?"
                )
            }
        }
    }
}

/// What a record's own rows say against what is stated of it.
pub(crate) fn of_record(record: &Record, rate_mean_s: f64) -> Vec<Suspicion> {
    let mut found = Vec::new();
    let step_s = record.interval_s();
    if rate_mean_s > 0.0 && ((step_s / rate_mean_s).ln()).abs() > STEP_TOLERANCE.ln_1p() {
        found.push(Suspicion::Step { record: record.name().to_owned(), step_s, rate_mean_s });
    }
    if let Some(slope_k_per_s) = start_slope(record) {
        found.push(Suspicion::Ramp { record: record.name().to_owned(), slope_k_per_s });
    }
    found
}

/// Whether a fitted factor on dn/dT looks like a temperature scale.
pub(crate) fn of_factor(factor: f64) -> Option<Suspicion> {
    let near = |scale: f64| (factor / scale - 1.0).abs() < FACTOR_TOLERANCE;
    (near(5.0 / 9.0) || near(9.0 / 5.0)).then_some(Suspicion::Fahrenheit { factor })
}

/// Slope of the sensor over the first rows, where it is too steep for a pack at rest \[K/s\].
fn start_slope(record: &Record) -> Option<f64> {
    let (times, readings) = (record.times_s(), record.temperature_k());
    let end = times.first()? + START_S;
    let rows = times.iter().take_while(|t| **t <= end).count().max(5).min(times.len());
    if rows < 5 {
        return None;
    }
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let (t0, y0) = (mean(&times[..rows]), mean(&readings[..rows]));
    let pairs = || times[..rows].iter().zip(&readings[..rows]).map(|(t, y)| (t - t0, y - y0));
    let square: f64 = pairs().map(|(t, _)| t * t).sum();
    let slope = pairs().map(|(t, y)| t * y).sum::<f64>() / square;
    let rest: f64 = pairs().map(|(t, y)| (y - slope * t).powi(2)).sum();
    let error = (rest / (rows - 2) as f64 / square).sqrt();
    (slope.abs() > STEADY_K_PER_S && slope.abs() > SLOPE_ERRORS * error).then_some(slope)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(step_s: f64, temperature: impl Fn(f64) -> f64) -> Record {
        let times: Vec<f64> = (0..200).map(|i| f64::from(i) * step_s).collect();
        let readings = times.iter().map(|t| 293.15 + temperature(*t)).collect();
        Record::new("day.csv", times, readings, vec![0.0; 200]).expect("a record")
    }

    #[test]
    fn a_step_that_contradicts_the_mean_is_said_and_a_rounded_one_is_not() {
        assert_eq!(of_record(&record(10.0, |_| 0.0), 10.0), []);
        assert_eq!(of_record(&record(10.5, |_| 0.0), 10.0), []);
        assert_eq!(of_record(&record(60.0, |_| 0.0), 0.0), []);
        assert!(matches!(of_record(&record(60.0, |_| 0.0), 10.0)[..], [Suspicion::Step { step_s: 60.0, .. }]));
        assert!(matches!(of_record(&record(1.0, |_| 0.0), 10.0)[..], [Suspicion::Step { .. }]));
    }

    #[test]
    fn a_start_in_a_ramp_is_said_and_ripple_or_a_ramp_after_rest_is_not() {
        let ripple = |t: f64| 0.2 * (std::f64::consts::TAU * t / 150.0).sin();
        assert_eq!(of_record(&record(10.0, ripple), 10.0), []);
        assert_eq!(of_record(&record(10.0, |t| (t - 300.0).max(0.0) / 60.0), 10.0), []);
        let found = of_record(&record(10.0, |t| t / 60.0 + ripple(t)), 10.0);
        assert!(
            matches!(found[..], [Suspicion::Ramp { slope_k_per_s, .. }] if (slope_k_per_s * 60.0 - 1.0).abs() < 0.1)
        );
        assert!(found[0].to_string().starts_with("day.csv starts in a ramp (+"));
    }

    #[test]
    fn a_factor_of_five_ninths_or_its_inverse_is_a_temperature_scale() {
        assert_eq!(of_factor(1.1), None);
        assert_eq!(of_factor(0.6), None);
        assert!(of_factor(0.5601).is_some_and(|s| s.to_string().contains("per °F")));
        assert!(of_factor(1.79).is_some());
    }
}
