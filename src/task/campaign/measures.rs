//! Numbers of a fleet's data sheets: what is usual in the batch, who stands apart, and what one correction for all would take away.
//!
//! ```text
//! apart:          |x_i − median| > z (1 + c/n) · MAD,    z = Φ⁻¹(1 − 0.05/2nk)
//! common share:   n x̄² / Σ x_i²
//! ```
//!
//! | symbol | meaning | in code |
//! |---|---|---|
//! | x_i | a gyro's number, its logarithm where all are positive | `values` |
//! | MAD | median absolute deviation as a Gaussian's standard deviation | `robust_deviation` |
//! | n, k | gyros, of which fewer than 8 say nobody stands apart; measures | `FEWEST`, `MEASURES` |
//! | c | the MAD of few numbers is itself uncertain | `FEW_GYROS` |
//!
//! With this limit about one Gaussian batch of twenty has any gyro apart in any measure: 4 % to 6.7 % for n from 8 to 100 with c = 12
//! (160 000 drawn batches each, 40 000 from 50 on).

use statrs::distribution::{ContinuousCDF, Normal};

use crate::io::json::campaign::GyroJson;
use crate::io::json::fleet::{GyroValueJson, MeasureJson, ThermalCurveJson, ThermalPointJson};
use crate::io::json::metrics::MetricsJson;
use crate::numeric::statistics::{mean, median, robust_deviation};

/// Fewer gyros than these do not say who stands apart.
pub(super) const FEWEST: usize = 8;
const FEW_GYROS: f64 = 12.0;
/// Chance that any gyro of a batch is said to stand apart in any measure though none does.
const FALSE_ALARM: f64 = 0.05;

/// How many robust deviations from the median stand apart, in a batch of so many.
pub(super) fn apart(gyros: usize) -> f64 {
    let n = gyros as f64;
    Normal::standard().inverse_cdf(1.0 - 0.5 * FALSE_ALARM / (n * MEASURES.len() as f64)) * (1.0 + FEW_GYROS / n)
}

type Show = fn(&MetricsJson) -> Option<f64>;

/// Key, unit, whether it has a sign, and the number.
const MEASURES: [(&str, &str, bool, Show); 8] = [
    ("bias_deg_per_h", "°/h", true, |m| Some(m.bias_deg_per_h)),
    ("bias_stability_deg_per_h", "°/h", false, |m| m.bias_stability_deg_per_h),
    ("bias_instability_deg_per_h", "°/h", false, |m| m.bias_instability_deg_per_h),
    ("repeatability_deg_per_h", "°/h", false, |m| m.repeatability_deg_per_h),
    ("temperature_sensitivity_deg_per_h_per_c", "°/h/°C", false, |m| m.temperature_sensitivity_deg_per_h_per_c),
    ("angle_random_walk_deg_per_sqrt_h", "°/√h", false, |m| m.angle_random_walk_deg_per_sqrt_h),
    ("peak_to_peak_deg_per_h", "°/h", false, |m| Some(m.peak_to_peak_deg_per_h)),
    ("drift_angle_deg", "°", true, |m| Some(m.drift_angle_deg)),
];

/// All measures that at least two gyros have.
pub(super) fn of(gyros: &[GyroJson]) -> Vec<MeasureJson> {
    MEASURES.iter().filter_map(|measure| measured(measure, gyros)).collect()
}

fn measured((key, unit, has_sign, show): &(&str, &str, bool, Show), gyros: &[GyroJson]) -> Option<MeasureJson> {
    let found: Vec<(&str, f64)> = gyros
        .iter()
        .filter_map(|gyro| Some((gyro.gyro.as_str(), gyro.metrics.as_ref().and_then(show)?)))
        .filter(|(_, value)| value.is_finite())
        .collect();
    if found.len() < 2 {
        return None;
    }
    let values: Vec<f64> = found.iter().map(|(_, value)| *value).collect();
    let is_factor = !has_sign && values.iter().all(|v| *v > 0.0);
    let judged: Vec<f64> = values.iter().map(|v| if is_factor { v.ln() } else { *v }).collect();
    let (centre, spread) = (median(&judged), robust_deviation(&judged));
    let limit = if judged.len() < FEWEST || spread == 0.0 { f64::INFINITY } else { apart(judged.len()) * spread };
    let square: f64 = values.iter().map(|v| v * v).sum();
    let common = (*has_sign && square > 0.0).then(|| values.len() as f64 * mean(&values).powi(2) / square);
    let single = judged.iter().map(|v| (v - centre).abs() > limit);
    Some(MeasureJson {
        key: (*key).to_owned(),
        unit: (*unit).to_owned(),
        median: if is_factor { centre.exp() } else { centre },
        spread: if is_factor { spread.exp() } else { spread },
        spread_is_factor: is_factor,
        common_share: common,
        values: found
            .iter()
            .zip(single)
            .map(|((gyro, value), single)| GyroValueJson {
                gyro: (*gyro).to_owned(),
                value: *value,
                standard_error: None,
                single,
            })
            .collect(),
    })
}

/// The bias over temperature that the gyros share, by whole degrees; none where they share no temperatures, or no curve.
pub(super) fn thermal_curve(gyros: &[GyroJson]) -> Option<ThermalCurveJson> {
    let curves: Vec<Vec<(i64, f64)>> =
        gyros.iter().filter_map(|gyro| gyro.metrics.as_ref()).map(curve).filter(|curve| curve.len() > 1).collect();
    let mut degrees: Vec<i64> = curves.iter().flatten().map(|(degree, _)| *degree).collect();
    degrees.sort_unstable();
    degrees.dedup();
    let (mut points, mut square, mut left) = (Vec::new(), 0.0, 0.0);
    for degree in degrees {
        let at: Vec<f64> = curves.iter().flatten().filter(|(own, _)| *own == degree).map(|(_, bias)| *bias).collect();
        if at.len() < 2 {
            continue;
        }
        let sum: f64 = at.iter().sum();
        for bias in &at {
            square += bias * bias;
            left += (bias - (sum - bias) / (at.len() - 1) as f64).powi(2);
        }
        points.push(ThermalPointJson {
            temperature_c: degree as f64,
            bias_deg_per_h: sum / at.len() as f64,
            gyros: at.len(),
        });
    }
    (points.len() > 1 && left < square).then(|| ThermalCurveJson { points, common_share: 1.0 - left / square })
}

/// A gyro's mean bias at each whole degree, about the mean of these.
fn curve(metrics: &MetricsJson) -> Vec<(i64, f64)> {
    let mut by_degree: std::collections::BTreeMap<i64, (f64, f64)> = Default::default();
    for point in metrics.records.iter().flat_map(|record| &record.temperature_points) {
        let at = by_degree.entry(point.temperature_c.round() as i64).or_default();
        at.0 += point.bias_deg_per_h * point.rows as f64;
        at.1 += point.rows as f64;
    }
    let means: Vec<(i64, f64)> =
        by_degree.into_iter().filter(|(_, (_, rows))| *rows > 0.0).map(|(t, (sum, rows))| (t, sum / rows)).collect();
    let centre = mean(&means.iter().map(|(_, bias)| *bias).collect::<Vec<_>>());
    means.into_iter().map(|(degree, bias)| (degree, bias - centre)).collect()
}
