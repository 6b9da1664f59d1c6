//! The measures of a rate as they stand in documents.

use serde::Serialize;

use crate::io::json::metrics::{GrossErrorTally, RecordMetricsJson};
use crate::metrics::Metrics;

/// The measures of a rate, before or after.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct MeasuresJson {
    pub(crate) bias_deg_per_h: f64,
    pub(crate) bias_stability_deg_per_h: Option<f64>,
    pub(crate) bias_instability_deg_per_h: Option<f64>,
    pub(crate) angle_random_walk_deg_per_sqrt_h: Option<f64>,
    pub(crate) temperature_sensitivity_deg_per_h_per_c: Option<f64>,
    pub(crate) peak_to_peak_deg_per_h: f64,
    pub(crate) averaged_peak_to_peak_deg_per_h: f64,
    pub(crate) drift_angle_deg: f64,
}

impl MeasuresJson {
    pub(crate) fn new(metrics: &Metrics) -> Self {
        let all = RecordMetricsJson::new("", metrics, GrossErrorTally::default(), 0);
        Self {
            bias_deg_per_h: all.bias_deg_per_h,
            bias_stability_deg_per_h: all.bias_stability_deg_per_h,
            bias_instability_deg_per_h: all.bias_instability_deg_per_h,
            angle_random_walk_deg_per_sqrt_h: all.angle_random_walk_deg_per_sqrt_h,
            temperature_sensitivity_deg_per_h_per_c: all.temperature_sensitivity_deg_per_h_per_c,
            peak_to_peak_deg_per_h: all.peak_to_peak_deg_per_h,
            averaged_peak_to_peak_deg_per_h: all.averaged_peak_to_peak_deg_per_h,
            drift_angle_deg: all.drift_angle_deg,
        }
    }

    /// Name, unit and value of each.
    pub(crate) fn all(&self) -> [(&'static str, &'static str, Option<f64>); 8] {
        [
            ("bias", "°/h", Some(self.bias_deg_per_h)),
            ("bias stability, means over 10 s", "°/h", self.bias_stability_deg_per_h),
            ("bias instability (Allan minimum)", "°/h", self.bias_instability_deg_per_h),
            ("angle random walk", "°/√h", self.angle_random_walk_deg_per_sqrt_h),
            ("temperature sensitivity", "°/h/°C", self.temperature_sensitivity_deg_per_h_per_c),
            ("peak to peak", "°/h", Some(self.peak_to_peak_deg_per_h)),
            ("peak to peak of the means", "°/h", Some(self.averaged_peak_to_peak_deg_per_h)),
            ("drift angle", "°", Some(self.drift_angle_deg)),
        ]
    }
}
