//! The JSON document of `metrics`; also read back for reports.

use serde::{Deserialize, Serialize};

use crate::metrics::Metrics;
use crate::numeric::allan::NoiseModel;
use crate::numeric::coloured::{Interval, NoiseStrengths};
use crate::units::{
    arcsec_from_rad, celsius_from_kelvin, deg_from_rad, deg_per_h_from_rad_per_s, deg_per_h_per_h_from_rad_per_s2,
    deg_per_h_per_sqrt_h_from_rad_per_s_per_sqrt_s, deg_per_sqrt_h_from_rad_per_sqrt_s,
};

use super::inputs::InputsJson;
use super::scale_factor::{PositionsJson, ScaleFactorJson};

/// The measures under the keys that scripts read. Over several records: the mean bias and the worst of the others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct MetricsJson {
    pub(crate) bias_deg_per_h: f64,
    pub(crate) bias_stability_deg_per_h: Option<f64>,
    pub(crate) bias_stability_average_s: f64,
    /// The minimum of the Allan deviation.
    pub(crate) bias_instability_deg_per_h: Option<f64>,
    pub(crate) repeatability_deg_per_h: Option<f64>,
    pub(crate) temperature_sensitivity_deg_per_h_per_c: Option<f64>,
    pub(crate) angle_random_walk_deg_per_sqrt_h: Option<f64>,
    pub(crate) peak_to_peak_deg_per_h: f64,
    /// Of several records the largest.
    pub(crate) drift_angle_deg: f64,
    /// Of several records, for each kind the largest.
    pub(crate) noise: Vec<NoiseJson>,
    /// Null where no rate table turned the gyro.
    #[serde(default)]
    pub(crate) scale_factor: Option<ScaleFactorJson>,
    /// Null where the attitude is not stated, or is the same in all records.
    #[serde(default)]
    pub(crate) positions: Option<PositionsJson>,
    pub(crate) records: Vec<RecordMetricsJson>,
    pub(crate) inputs: InputsJson,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct RecordMetricsJson {
    pub(crate) file: String,
    pub(crate) rows: usize,
    pub(crate) duration_s: f64,
    pub(crate) bias_deg_per_h: f64,
    pub(crate) bias_stability_deg_per_h: Option<f64>,
    pub(crate) bias_stability_average_s: f64,
    pub(crate) bias_instability_deg_per_h: Option<f64>,
    pub(crate) bias_instability_tau_s: Option<f64>,
    pub(crate) temperature_sensitivity_deg_per_h_per_c: Option<f64>,
    pub(crate) angle_random_walk_deg_per_sqrt_h: Option<f64>,
    /// False: white noise may be absent, and the angle random walk is an upper bound.
    pub(crate) angle_random_walk_has_slope: bool,
    pub(crate) rate_random_walk_deg_per_h_per_sqrt_h: Option<f64>,
    pub(crate) flicker_deg_per_h: Option<f64>,
    pub(crate) quantisation_arcsec: Option<f64>,
    pub(crate) peak_to_peak_deg_per_h: f64,
    /// Of the means over `bias_stability_average_s`.
    pub(crate) averaged_peak_to_peak_deg_per_h: f64,
    /// The rate integrated over the record.
    pub(crate) drift_angle_deg: f64,
    /// Five kinds, each with an interval; all five hold together with 95 %. Empty where the record is too short.
    pub(crate) noise: Vec<NoiseJson>,
    /// Null where no rate table turned the gyro. Bias, noise and drift are of the rate without the table's.
    #[serde(default)]
    pub(crate) scale_factor: Option<ScaleFactorJson>,
    /// About the sensitive axis; null where latitude and attitude are not stated.
    #[serde(default)]
    pub(crate) earth_rate_deg_per_h: Option<f64>,
    /// The bias (on a table: its offset) without the earth's rate.
    #[serde(default)]
    pub(crate) bias_without_earth_deg_per_h: Option<f64>,
    pub(crate) temperature_range_c: f64,
    /// Root mean square of what follows the temperature, which was not taken for noise.
    pub(crate) thermal_deg_per_h: Option<f64>,
    /// What to keep in mind with these numbers.
    pub(crate) cautions: Vec<String>,
    pub(crate) temperature_points: Vec<TemperaturePointJson>,
    /// Rows of the stretch without a gap that the Allan deviation is of; 0: no stretch was long enough.
    pub(crate) allan_rows: usize,
    pub(crate) allan: Vec<AllanPointJson>,
    /// The fitted noises that show, the steepest fall first.
    pub(crate) allan_noises: Vec<AllanNoiseJson>,
    /// The first ten thousand of them.
    pub(crate) gross_errors: Vec<GrossErrorJson>,
    /// How many there are.
    #[serde(default)]
    pub(crate) gross_errors_count: usize,
    pub(crate) gaps: usize,
}

/// Values that stand alone, as a record passes by: counted all, listed as far as a document has use for them.
#[derive(Debug, Clone, Default)]
pub(crate) struct GrossErrorTally {
    pub(crate) first: Vec<GrossErrorJson>,
    pub(crate) count: usize,
}

/// More than this many are counted, not listed: a document and its page stay small however long the record is.
const MOST_LISTED: usize = 10_000;

impl GrossErrorTally {
    pub(crate) fn push(&mut self, error: impl FnOnce() -> GrossErrorJson) {
        self.count += 1;
        if self.first.len() < MOST_LISTED {
            self.first.push(error());
        }
    }
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct TemperaturePointJson {
    pub(crate) temperature_c: f64,
    pub(crate) bias_deg_per_h: f64,
    pub(crate) rows: usize,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct AllanPointJson {
    pub(crate) tau_s: f64,
    pub(crate) deviation_deg_per_h: f64,
    pub(crate) standard_error_deg_per_h: f64,
}

/// One noise in the Allan deviation: a straight line in the picture of logarithms.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct AllanNoiseJson {
    /// "quantisation", "angle random walk", "bias instability", "rate random walk" or "rate ramp".
    pub(crate) noise: String,
    pub(crate) value: f64,
    pub(crate) unit: String,
    pub(crate) slope: f64,
    pub(crate) deviation_at_1_s_deg_per_h: f64,
}

/// The strength of one noise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct NoiseJson {
    /// "white", "flicker", "rate_random_walk", "quantisation" or "ramp".
    pub(crate) kind: String,
    pub(crate) value: f64,
    pub(crate) low: f64,
    pub(crate) high: f64,
    pub(crate) unit: String,
}

/// A value that stands alone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct GrossErrorJson {
    pub(crate) time_s: f64,
    pub(crate) column: String,
    /// Whether it was left out of everything.
    pub(crate) dropped: bool,
}

impl RecordMetricsJson {
    pub(crate) fn new(file: &str, metrics: &Metrics, gross_errors: GrossErrorTally, gaps: usize) -> Self {
        let allan = metrics.allan.as_ref();
        let noises = metrics.noises.as_ref();
        let of_noise = |show: fn(&NoiseStrengths) -> f64| noises.map(show);
        Self {
            file: file.to_owned(),
            rows: metrics.rows,
            duration_s: metrics.duration_s,
            bias_deg_per_h: deg_per_h_from_rad_per_s(metrics.bias_rad_per_s),
            bias_stability_deg_per_h: metrics.bias_stability_rad_per_s.map(deg_per_h_from_rad_per_s),
            bias_stability_average_s: metrics.average_s,
            bias_instability_deg_per_h: allan.map(|a| deg_per_h_from_rad_per_s(a.minimum.deviation)),
            bias_instability_tau_s: allan.map(|a| a.minimum.tau_s),
            temperature_sensitivity_deg_per_h_per_c: metrics
                .temperature_sensitivity_rad_per_s_per_k
                .map(deg_per_h_from_rad_per_s),
            angle_random_walk_deg_per_sqrt_h: of_noise(|n| {
                deg_per_sqrt_h_from_rad_per_sqrt_s(if n.white.low > 0.0 { n.white.value } else { n.white.high })
            }),
            angle_random_walk_has_slope: noises.is_some_and(|n| n.white.low > 0.0),
            rate_random_walk_deg_per_h_per_sqrt_h: of_noise(|n| {
                deg_per_h_per_sqrt_h_from_rad_per_s_per_sqrt_s(n.random_walk.value)
            }),
            flicker_deg_per_h: of_noise(|n| deg_per_h_from_rad_per_s(n.flicker.value)),
            quantisation_arcsec: of_noise(|n| arcsec_from_rad(n.quantisation.value)),
            peak_to_peak_deg_per_h: deg_per_h_from_rad_per_s(metrics.peak_to_peak_rad_per_s),
            averaged_peak_to_peak_deg_per_h: deg_per_h_from_rad_per_s(metrics.averaged_peak_to_peak_rad_per_s),
            drift_angle_deg: deg_from_rad(metrics.drift_angle_rad),
            noise: noises.map_or_else(Vec::new, strengths),
            scale_factor: metrics.scale_factor.as_ref().map(|found| ScaleFactorJson::new(found, None)),
            earth_rate_deg_per_h: None,
            bias_without_earth_deg_per_h: None,
            temperature_range_c: metrics.temperature_range_k,
            thermal_deg_per_h: of_noise(|n| deg_per_h_from_rad_per_s(n.explained)),
            cautions: cautions(metrics, gross_errors.count),
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
            allan_noises: noises.map_or_else(Vec::new, lines),
            gross_errors_count: gross_errors.count,
            gross_errors: gross_errors.first,
            gaps,
        }
    }
}

impl RecordMetricsJson {
    /// With what is known of how the record was taken: the scale factor it was read by, and the earth's rate about the axis.
    pub(crate) fn taken(
        mut self,
        metrics: &Metrics,
        raw_per_deg_per_h: Option<f64>,
        earth_rad_per_s: Option<f64>,
    ) -> Self {
        self.scale_factor = metrics.scale_factor.as_ref().map(|found| ScaleFactorJson::new(found, raw_per_deg_per_h));
        self.earth_rate_deg_per_h = earth_rad_per_s.map(deg_per_h_from_rad_per_s);
        self.bias_without_earth_deg_per_h =
            earth_rad_per_s.map(|earth| deg_per_h_from_rad_per_s(metrics.offset_rad_per_s() - earth));
        self
    }
}

/// The five kinds with their intervals.
fn strengths(found: &NoiseStrengths) -> Vec<NoiseJson> {
    let noise = |kind: &str, interval: Interval, convert: fn(f64) -> f64, unit: &str| NoiseJson {
        kind: kind.to_owned(),
        value: convert(interval.value),
        low: convert(interval.low),
        high: convert(interval.high),
        unit: unit.to_owned(),
    };
    vec![
        noise("white", found.white, deg_per_sqrt_h_from_rad_per_sqrt_s, "°/√h"),
        noise("flicker", found.flicker, deg_per_h_from_rad_per_s, "°/h"),
        noise("rate_random_walk", found.random_walk, deg_per_h_per_sqrt_h_from_rad_per_s_per_sqrt_s, "°/h/√h"),
        noise("quantisation", found.quantisation, arcsec_from_rad, "arcsec"),
        noise("ramp", found.ramp, deg_per_h_per_h_from_rad_per_s2, "°/h/h"),
    ]
}

/// What a reader must know beside the numbers.
fn cautions(metrics: &Metrics, gross_errors: usize) -> Vec<String> {
    let mut said = Vec::new();
    if let Some(scale) = &metrics.scale_factor {
        said.push("a table turned the gyro: bias, stability, noise and drift are of the rate without the table's, its starts and stops included".to_owned());
        if scale.error.value.abs() > 1.0 {
            said.push("the rate goes against the table's, or in another unit: give the column its unit, or turn the sign of scale".to_owned());
        }
        if scale.left_out > 0 {
            said.push(format!("{} further even stretches of the table are left out", scale.left_out));
        }
    }
    let Some(noises) = &metrics.noises else {
        said.push("too short or too irregular to tell noises apart: no noise coefficients".to_owned());
        return said;
    };
    let total = metrics.bias_stability_rad_per_s.unwrap_or(0.0);
    if noises.explained > CLEARLY * total && metrics.temperature_range_k > STILL_K {
        said.push(format!(
            "the temperature moved by {:.1} °C and {:.3} °/h rms of the rate follow it: taken for thermal, not for noise; \
             slow noise that happens to follow the temperature is taken for thermal too",
            metrics.temperature_range_k,
            deg_per_h_from_rad_per_s(noises.explained)
        ));
    }
    if noises.white.low <= 0.0 {
        said.push("white noise may be absent: the angle random walk is an upper bound".to_owned());
    }
    let wide = [("flicker", noises.flicker), ("rate random walk", noises.random_walk)];
    for (name, interval) in wide.iter().filter(|(_, i)| i.low > 0.0 && i.high > WIDE * i.low) {
        said.push(format!(
            "{name} is known to a factor of {:.1} only: a longer record tells more",
            interval.high / interval.low
        ));
    }
    if metrics.irregular_steps as f64 > IRREGULAR * metrics.rows as f64 {
        said.push(format!(
            "{} of {} steps differ from the usual interval of {} s: the noises are those of a regular clock",
            metrics.irregular_steps, metrics.rows, metrics.interval_s
        ));
    }
    if gross_errors > 0 {
        said.push(format!("{gross_errors} values stand alone; where they are used they count as noise"));
    }
    said
}

/// Of the means' spread: less than this that follows the temperature is not worth a word.
const CLEARLY: f64 = 0.1;
const STILL_K: f64 = 0.5;
/// Ends of an interval further apart than this factor are wide.
const WIDE: f64 = 3.0;
/// Of all steps.
const IRREGULAR: f64 = 0.05;

/// The lines of the noises that were found.
fn lines(found: &NoiseStrengths) -> Vec<AllanNoiseJson> {
    let (quantisation, walk) = (found.quantisation.value, found.white.value);
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
            arcsec_from_rad(quantisation),
            "arcsec",
            -1.0,
            at_1_s(NoiseModel { quantisation, ..none }),
        ),
        line("angle random walk", deg_per_sqrt_h_from_rad_per_sqrt_s(walk), "°/√h", -0.5, walk),
        line(
            "bias instability",
            deg_per_h_from_rad_per_s(found.flicker.value),
            "°/h",
            0.0,
            at_1_s(NoiseModel { flicker: found.flicker.value, ..none }),
        ),
        line(
            "rate random walk",
            deg_per_h_per_sqrt_h_from_rad_per_s_per_sqrt_s(found.random_walk.value),
            "°/h/√h",
            0.5,
            at_1_s(NoiseModel { random_walk: found.random_walk.value, ..none }),
        ),
        line(
            "rate ramp",
            deg_per_h_per_h_from_rad_per_s2(found.ramp.value),
            "°/h/h",
            1.0,
            at_1_s(NoiseModel { ramp: found.ramp.value, ..none }),
        ),
    ];
    lines.retain(|l| l.value > 0.0);
    lines
}

impl MetricsJson {
    pub(crate) fn new(
        records: Vec<RecordMetricsJson>,
        repeatability_rad_per_s: Option<f64>,
        inputs: InputsJson,
    ) -> Self {
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
            drift_angle_deg: records
                .iter()
                .map(|r| r.drift_angle_deg)
                .max_by(|a, b| a.abs().total_cmp(&b.abs()))
                .unwrap_or(0.0),
            noise: loudest(&records),
            scale_factor: ScaleFactorJson::of_all(
                &records.iter().filter_map(|r| r.scale_factor.as_ref()).collect::<Vec<_>>(),
            ),
            positions: None,
            records,
            inputs,
        }
    }
}

/// For each kind the one of the record that has most of it.
fn loudest(records: &[RecordMetricsJson]) -> Vec<NoiseJson> {
    let mut found: Vec<NoiseJson> = Vec::new();
    for noise in records.iter().flat_map(|r| &r.noise) {
        match found.iter_mut().find(|n| n.kind == noise.kind) {
            None => found.push(noise.clone()),
            Some(held) if noise.value > held.value => *held = noise.clone(),
            Some(_) => {}
        }
    }
    found
}
