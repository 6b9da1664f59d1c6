//! What `metrics` says of a gyro's scale factor, and of the earth's rate in its bias.

use serde::{Deserialize, Serialize};

use super::EstimateJson;
use crate::metrics::earth::Positions;
use crate::metrics::scale_factor::{ScaleFactor, ScaleFactorEstimate};
use crate::units::{
    celsius_from_kelvin, deg_per_h_from_rad_per_s, deg_per_s_from_rad_per_s, fraction_from_ppm, ppm_from_fraction,
};

impl EstimateJson {
    fn ppm(estimate: ScaleFactorEstimate) -> Self {
        let error = ppm_from_fraction(estimate.standard_error);
        Self { value: ppm_from_fraction(estimate.value), standard_error: Some(error).filter(|e| e.is_finite()) }
    }
}

/// Of one record on a rate table; of several the mean error, its deviation as repeatability, and the worst of the others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct ScaleFactorJson {
    /// By how much the gyro shows more than it turns.
    pub(crate) error_ppm: EstimateJson,
    /// The temperature at which that is.
    pub(crate) at_temperature_c: f64,
    /// Raw units that are one degree an hour, by this record; null where its rate is not raw.
    pub(crate) raw_units_per_deg_per_h: Option<f64>,
    /// Null where the temperature did not change.
    pub(crate) temperature_coefficient_ppm_per_k: Option<EstimateJson>,
    /// Warming less cooling; null where it did not get both warmer and cooler.
    pub(crate) hysteresis_ppm: Option<EstimateJson>,
    /// The largest residual over the largest rate.
    pub(crate) nonlinearity_ppm: f64,
    /// Turning forwards less turning backwards; null where the table turned one way.
    pub(crate) asymmetry_ppm: Option<EstimateJson>,
    /// The deviation over runs, or over records; null where there is one.
    pub(crate) repeatability_ppm: Option<f64>,
    pub(crate) runs: usize,
    /// Earth's rate and drift together.
    pub(crate) offset_deg_per_h: f64,
    /// The even stretches, in their order.
    pub(crate) stretches: Vec<StretchJson>,
}

/// A stretch in which the table turned evenly.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct StretchJson {
    pub(crate) table_rate_deg_per_s: f64,
    /// What the gyro showed beside it.
    pub(crate) error_deg_per_h: f64,
    /// What the fit leaves of that.
    pub(crate) residual_deg_per_h: f64,
    pub(crate) temperature_c: f64,
    pub(crate) rows: usize,
}

impl ScaleFactorJson {
    /// `raw_per_deg_per_h` is the scale factor that the record was read by.
    pub(crate) fn new(found: &ScaleFactor, raw_per_deg_per_h: Option<f64>) -> Self {
        let stretches = found.stretches.iter().zip(&found.residual_rad_per_s);
        Self {
            error_ppm: EstimateJson::ppm(found.error),
            at_temperature_c: celsius_from_kelvin(found.at_k),
            raw_units_per_deg_per_h: raw_per_deg_per_h.map(|scale| scale * (1.0 + found.error.value)),
            temperature_coefficient_ppm_per_k: found.per_k.map(EstimateJson::ppm),
            hysteresis_ppm: found.hysteresis.map(EstimateJson::ppm),
            nonlinearity_ppm: ppm_from_fraction(found.nonlinearity),
            asymmetry_ppm: found.asymmetry.map(EstimateJson::ppm),
            repeatability_ppm: found.repeatability.map(ppm_from_fraction),
            runs: found.runs,
            offset_deg_per_h: deg_per_h_from_rad_per_s(found.offset_rad_per_s),
            stretches: stretches
                .map(|(s, residual)| StretchJson {
                    table_rate_deg_per_s: deg_per_s_from_rad_per_s(s.table_rad_per_s),
                    error_deg_per_h: deg_per_h_from_rad_per_s(s.beside_rad_per_s),
                    residual_deg_per_h: deg_per_h_from_rad_per_s(*residual),
                    temperature_c: celsius_from_kelvin(s.temperature_k),
                    rows: s.rows,
                })
                .collect(),
        }
    }

    /// Of several records together; None of none.
    pub(crate) fn of_all(all: &[&Self]) -> Option<Self> {
        let [first, _, ..] = all else { return all.first().map(|one| (*one).clone()) };
        let count = all.len() as f64;
        let mean = all.iter().map(|s| s.error_ppm.value).sum::<f64>() / count;
        let square: f64 = all.iter().map(|s| (s.error_ppm.value - mean).powi(2)).sum();
        let deviation = (square / (count - 1.0)).sqrt();
        let worst = |of: fn(&Self) -> Option<&EstimateJson>| {
            let found = all.iter().filter_map(|s| of(s));
            found.max_by(|a, b| a.value.abs().total_cmp(&b.value.abs())).cloned()
        };
        let scale = first.raw_units_per_deg_per_h.map(|raw| raw / (1.0 + fraction_from_ppm(first.error_ppm.value)));
        Some(Self {
            error_ppm: EstimateJson { value: mean, standard_error: Some(deviation / count.sqrt()) },
            at_temperature_c: all.iter().map(|s| s.at_temperature_c).sum::<f64>() / count,
            raw_units_per_deg_per_h: scale.map(|scale| scale * (1.0 + fraction_from_ppm(mean))),
            temperature_coefficient_ppm_per_k: worst(|s| s.temperature_coefficient_ppm_per_k.as_ref()),
            hysteresis_ppm: worst(|s| s.hysteresis_ppm.as_ref()),
            nonlinearity_ppm: all.iter().map(|s| s.nonlinearity_ppm).fold(0.0, f64::max),
            asymmetry_ppm: worst(|s| s.asymmetry_ppm.as_ref()),
            repeatability_ppm: Some(deviation),
            runs: all.iter().map(|s| s.runs).sum(),
            offset_deg_per_h: all.iter().map(|s| s.offset_deg_per_h).sum::<f64>() / count,
            stretches: Vec::new(),
        })
    }
}

/// What the offset's steps between attitudes show.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct PositionsJson {
    pub(crate) scale_error_ppm: EstimateJson,
    /// Of the gyro itself, without the earth's rate.
    pub(crate) bias_deg_per_h: f64,
}

impl PositionsJson {
    pub(crate) fn new(found: &Positions) -> Self {
        Self {
            scale_error_ppm: EstimateJson::ppm(found.scale_error),
            bias_deg_per_h: deg_per_h_from_rad_per_s(found.bias_rad_per_s),
        }
    }
}
