//! The JSON document of `metrics`; also read back for reports.

use serde::{Deserialize, Serialize};

use crate::metrics::{Allan, Metrics};
use crate::numeric::allan::NoiseModel;
use crate::units::{
    arcsec_from_rad, celsius_from_kelvin, deg_per_h_from_rad_per_s, deg_per_h_per_h_from_rad_per_s2,
    deg_per_h_per_sqrt_h_from_rad_per_s_per_sqrt_s, deg_per_sqrt_h_from_rad_per_sqrt_s,
};

use super::inputs::InputsJson;

/// The measures under the keys that scripts read. Over several records: the mean bias and the worst of the others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MetricsJson {
    pub bias_deg_per_h: f64,
    pub bias_stability_deg_per_h: Option<f64>,
    pub bias_stability_average_s: f64,
    /// The minimum of the Allan deviation.
    pub bias_instability_deg_per_h: Option<f64>,
    pub repeatability_deg_per_h: Option<f64>,
    pub temperature_sensitivity_deg_per_h_per_c: Option<f64>,
    pub angle_random_walk_deg_per_sqrt_h: Option<f64>,
    pub peak_to_peak_deg_per_h: f64,
    pub records: Vec<RecordMetricsJson>,
    pub inputs: InputsJson,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RecordMetricsJson {
    pub file: String,
    pub rows: usize,
    pub duration_s: f64,
    pub bias_deg_per_h: f64,
    pub bias_stability_deg_per_h: Option<f64>,
    pub bias_stability_average_s: f64,
    pub bias_instability_deg_per_h: Option<f64>,
    pub bias_instability_tau_s: Option<f64>,
    pub temperature_sensitivity_deg_per_h_per_c: Option<f64>,
    pub angle_random_walk_deg_per_sqrt_h: Option<f64>,
    /// False: nothing falls with −½, and the angle random walk is an upper bound.
    pub angle_random_walk_has_slope: bool,
    pub rate_random_walk_deg_per_h_per_sqrt_h: Option<f64>,
    pub flicker_deg_per_h: Option<f64>,
    pub quantisation_arcsec: Option<f64>,
    pub peak_to_peak_deg_per_h: f64,
    /// Of the means over `bias_stability_average_s`.
    pub averaged_peak_to_peak_deg_per_h: f64,
    pub temperature_points: Vec<TemperaturePointJson>,
    /// Rows of the stretch without a gap that the Allan deviation is of; 0: no stretch was long enough.
    pub allan_rows: usize,
    pub allan: Vec<AllanPointJson>,
    /// The fitted noises that show, the steepest fall first.
    pub allan_noises: Vec<AllanNoiseJson>,
    pub gross_errors: Vec<GrossErrorJson>,
    pub gaps: usize,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TemperaturePointJson {
    pub temperature_c: f64,
    pub bias_deg_per_h: f64,
    pub rows: usize,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AllanPointJson {
    pub tau_s: f64,
    pub deviation_deg_per_h: f64,
    pub standard_error_deg_per_h: f64,
}

/// One noise in the Allan deviation: a straight line in the picture of logarithms.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AllanNoiseJson {
    /// "quantisation", "angle random walk", "bias instability", "rate random walk" or "rate ramp".
    pub noise: String,
    pub value: f64,
    pub unit: String,
    pub slope: f64,
    pub deviation_at_1_s_deg_per_h: f64,
}

/// A value that stands alone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GrossErrorJson {
    pub time_s: f64,
    pub column: String,
    /// Whether it was left out of everything.
    pub dropped: bool,
}

impl RecordMetricsJson {
    pub fn new(file: &str, metrics: &Metrics, gross_errors: Vec<GrossErrorJson>, gaps: usize) -> Self {
        let allan = metrics.allan.as_ref();
        let of_noise = |show: fn(&Allan) -> f64| allan.map(show);
        Self {
            file: file.to_owned(),
            rows: metrics.rows,
            duration_s: metrics.duration_s,
            bias_deg_per_h: deg_per_h_from_rad_per_s(metrics.bias_rad_per_s),
            bias_stability_deg_per_h: metrics.bias_stability_rad_per_s.map(deg_per_h_from_rad_per_s),
            bias_stability_average_s: metrics.average_s,
            bias_instability_deg_per_h: of_noise(|a| deg_per_h_from_rad_per_s(a.minimum.deviation)),
            bias_instability_tau_s: of_noise(|a| a.minimum.tau_s),
            temperature_sensitivity_deg_per_h_per_c: metrics
                .temperature_sensitivity_rad_per_s_per_k
                .map(deg_per_h_from_rad_per_s),
            angle_random_walk_deg_per_sqrt_h: of_noise(|a| deg_per_sqrt_h_from_rad_per_sqrt_s(a.white_rad_per_sqrt_s)),
            angle_random_walk_has_slope: allan.is_some_and(|a| a.has_white_slope),
            rate_random_walk_deg_per_h_per_sqrt_h: of_noise(|a| {
                deg_per_h_per_sqrt_h_from_rad_per_s_per_sqrt_s(a.noises.random_walk)
            }),
            flicker_deg_per_h: of_noise(|a| deg_per_h_from_rad_per_s(a.noises.flicker)),
            quantisation_arcsec: of_noise(|a| arcsec_from_rad(a.noises.quantisation)),
            peak_to_peak_deg_per_h: deg_per_h_from_rad_per_s(metrics.peak_to_peak_rad_per_s),
            averaged_peak_to_peak_deg_per_h: deg_per_h_from_rad_per_s(metrics.averaged_peak_to_peak_rad_per_s),
            temperature_points: metrics
                .temperature_points
                .iter()
                .map(|p| TemperaturePointJson {
                    temperature_c: celsius_from_kelvin(p.temperature_k),
                    bias_deg_per_h: deg_per_h_from_rad_per_s(p.bias_rad_per_s),
                    rows: p.rows,
                })
                .collect(),
            allan_rows: allan.map_or(0, |a| a.rows),
            allan: allan.map_or_else(Vec::new, |a| {
                a.points
                    .iter()
                    .map(|p| AllanPointJson {
                        tau_s: p.tau_s,
                        deviation_deg_per_h: deg_per_h_from_rad_per_s(p.deviation),
                        standard_error_deg_per_h: deg_per_h_from_rad_per_s(p.standard_error),
                    })
                    .collect()
            }),
            allan_noises: allan.map_or_else(Vec::new, noises),
            gross_errors,
            gaps,
        }
    }
}

/// The lines of the noises that were found; the angle random walk is the one read off the slope.
fn noises(allan: &Allan) -> Vec<AllanNoiseJson> {
    let found = &allan.noises;
    let walk = if allan.has_white_slope { allan.white_rad_per_sqrt_s } else { 0.0 };
    let line = |noise: &str, value: f64, unit: &str, slope: f64, at_1_s: f64| AllanNoiseJson {
        noise: noise.to_owned(),
        value,
        unit: unit.to_owned(),
        slope,
        deviation_at_1_s_deg_per_h: deg_per_h_from_rad_per_s(at_1_s),
    };
    let at_1_s = |noise: NoiseModel| noise.deviation(1.0);
    let none = NoiseModel::default();
    let mut lines = vec![
        line(
            "quantisation",
            arcsec_from_rad(found.quantisation),
            "arcsec",
            -1.0,
            at_1_s(NoiseModel { quantisation: found.quantisation, ..none }),
        ),
        line("angle random walk", deg_per_sqrt_h_from_rad_per_sqrt_s(walk), "°/√h", -0.5, walk),
        line(
            "bias instability",
            deg_per_h_from_rad_per_s(found.flicker),
            "°/h",
            0.0,
            at_1_s(NoiseModel { flicker: found.flicker, ..none }),
        ),
        line(
            "rate random walk",
            deg_per_h_per_sqrt_h_from_rad_per_s_per_sqrt_s(found.random_walk),
            "°/h/√h",
            0.5,
            at_1_s(NoiseModel { random_walk: found.random_walk, ..none }),
        ),
        line(
            "rate ramp",
            deg_per_h_per_h_from_rad_per_s2(found.ramp),
            "°/h/h",
            1.0,
            at_1_s(NoiseModel { ramp: found.ramp, ..none }),
        ),
    ];
    lines.retain(|l| l.value > 0.0);
    lines
}

impl MetricsJson {
    pub fn new(records: Vec<RecordMetricsJson>, repeatability_rad_per_s: Option<f64>, inputs: InputsJson) -> Self {
        let count = records.len().max(1) as f64;
        let worst =
            |show: fn(&RecordMetricsJson) -> Option<f64>| records.iter().filter_map(show).max_by(f64::total_cmp);
        Self {
            bias_deg_per_h: records.iter().map(|r| r.bias_deg_per_h).sum::<f64>() / count,
            bias_stability_deg_per_h: worst(|r| r.bias_stability_deg_per_h),
            bias_stability_average_s: worst(|r| Some(r.bias_stability_average_s)).unwrap_or(0.0),
            bias_instability_deg_per_h: worst(|r| r.bias_instability_deg_per_h),
            repeatability_deg_per_h: repeatability_rad_per_s.map(deg_per_h_from_rad_per_s),
            temperature_sensitivity_deg_per_h_per_c: worst(|r| r.temperature_sensitivity_deg_per_h_per_c),
            angle_random_walk_deg_per_sqrt_h: worst(|r| r.angle_random_walk_deg_per_sqrt_h),
            peak_to_peak_deg_per_h: worst(|r| Some(r.peak_to_peak_deg_per_h)).unwrap_or(0.0),
            records,
            inputs,
        }
    }
}
