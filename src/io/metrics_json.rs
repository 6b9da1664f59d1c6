//! The JSON document of `metrics`.

use serde::Serialize;

use crate::metrics::{Allan, Metrics};
use crate::units::{
    arcsec_from_rad, celsius_from_kelvin, deg_per_h_from_rad_per_s, deg_per_h_per_sqrt_h_from_rad_per_s_per_sqrt_s,
    deg_per_sqrt_h_from_rad_per_sqrt_s,
};

/// The measures under the keys that scripts read. Over several records: the mean bias and the worst of the others.
#[derive(Debug, Serialize)]
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
}

#[derive(Debug, Serialize)]
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
    pub gross_errors: Vec<GrossErrorJson>,
    pub gaps: usize,
}

#[derive(Debug, Serialize)]
pub struct TemperaturePointJson {
    pub temperature_c: f64,
    pub bias_deg_per_h: f64,
    pub rows: usize,
}

#[derive(Debug, Serialize)]
pub struct AllanPointJson {
    pub tau_s: f64,
    pub deviation_deg_per_h: f64,
    pub standard_error_deg_per_h: f64,
}

/// A value that stands alone.
#[derive(Debug, Clone, Serialize)]
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
            gross_errors,
            gaps,
        }
    }
}

impl MetricsJson {
    pub fn new(records: Vec<RecordMetricsJson>, repeatability_rad_per_s: Option<f64>) -> Self {
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
        }
    }
}
