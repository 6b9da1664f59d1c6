//! The JSON document of `compare`; also read back for reports.

use serde::{Deserialize, Serialize};

use crate::chamber::Noise;
use crate::compare::Comparison;
use crate::compare::adequacy::Adequacy;
use crate::compare::regimes::RecordPart;
use crate::compare::sensors::SensorMisfit;
use crate::units::deg_per_h_from_rad_per_s;

use super::hypothesis::FilmSwitchesJson;
use super::inputs::InputsJson;
use super::metrics::GrossErrorJson;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct CompareJson {
    pub(crate) model: String,
    pub(crate) pattern: String,
    /// "adequate" or "missing": whether every record is the model's prediction and noise.
    pub(crate) verdict: String,
    pub(crate) records: Vec<RecordComparisonJson>,
    pub(crate) inputs: InputsJson,
}

/// One record beside its prediction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct RecordComparisonJson {
    pub(crate) file: String,
    /// Where the layers' temperatures come from, if not from the record's own sensor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) field: Option<String>,
    pub(crate) rows: usize,
    pub(crate) verdict: String,
    pub(crate) rmse_deg_per_h: f64,
    /// Null where the record does not vary.
    pub(crate) nrmse_fit_percent: Option<f64>,
    pub(crate) r_squared: Option<f64>,
    pub(crate) noise_floor_deg_per_h: f64,
    pub(crate) noise_floor_standard_error_deg_per_h: f64,
    pub(crate) noise_floor_method: String,
    pub(crate) reduced_chi_square: f64,
    /// What the uncertainty of the estimated boundary is expected to add to it.
    pub(crate) boundary_chi_square: f64,
    /// Against noise and boundary together.
    pub(crate) whitened_chi_square: f64,
    pub(crate) offset_deg_per_h: f64,
    pub(crate) largest_error_deg_per_h: f64,
    pub(crate) largest_error_time_s: f64,
    pub(crate) autocorrelation: Vec<f64>,
    pub(crate) autocorrelation_band_99: f64,
    pub(crate) ljung_box: LjungBoxJson,
    pub(crate) correlations: Vec<CorrelationJson>,
    pub(crate) regimes: Vec<PartJson>,
    pub(crate) temperature_bands: Vec<PartJson>,
    pub(crate) rate_bands: Vec<PartJson>,
    /// Where the model fails, in words.
    pub(crate) findings: Vec<String>,
    /// Null where the rates have no noise.
    pub(crate) noise: Option<NoisePartsJson>,
    pub(crate) estimated_film_w_per_m2_k: Option<f64>,
    pub(crate) estimated_film_standard_error_w_per_m2_k: Option<f64>,
    pub(crate) estimated_kinks_s: Vec<f64>,
    /// Null where the film between air and pack is one throughout.
    #[serde(default)]
    pub(crate) film_switches: Option<FilmSwitchesJson>,
    /// Thermometers at layers, each beside the model's layer.
    #[serde(default)]
    pub(crate) sensors: Vec<SensorJson>,
    pub(crate) gross_errors: Vec<GrossErrorJson>,
    pub(crate) gaps: usize,
}

/// Reading less model of one thermometer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct SensorJson {
    pub(crate) column: String,
    pub(crate) layer: usize,
    pub(crate) rows: usize,
    pub(crate) mean_difference_c: f64,
    pub(crate) rms_difference_c: f64,
    pub(crate) largest_difference_c: f64,
    pub(crate) largest_difference_time_s: f64,
}

impl SensorJson {
    fn new(found: &SensorMisfit) -> Self {
        Self {
            column: found.column.clone(),
            layer: found.layer,
            rows: found.rows,
            mean_difference_c: found.mean_k,
            rms_difference_c: found.rms_k,
            largest_difference_c: found.largest_k,
            largest_difference_time_s: found.largest_time_s,
        }
    }
}

/// What a record's rate consists of beside the coil.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct NoisePartsJson {
    /// Of one logged rate.
    pub(crate) white_deg_per_h: f64,
    /// Null where the record does not determine it.
    pub(crate) white_standard_error_deg_per_h: Option<f64>,
    pub(crate) wander_deg_per_h: f64,
    /// What the air did and the sensor could not see.
    pub(crate) unresolved_air_deg_per_h: f64,
    /// What is beyond all that.
    pub(crate) model_error_deg_per_h: f64,
}

impl NoisePartsJson {
    fn new(noise: &Noise) -> Self {
        let error = deg_per_h_from_rad_per_s(noise.white_standard_error_rad_per_s());
        Self {
            white_deg_per_h: deg_per_h_from_rad_per_s(noise.white_rad_per_s),
            white_standard_error_deg_per_h: Some(error).filter(|e| e.is_finite()),
            wander_deg_per_h: deg_per_h_from_rad_per_s(noise.wander_rad_per_s),
            unresolved_air_deg_per_h: deg_per_h_from_rad_per_s(noise.unresolved_air_rad_per_s),
            model_error_deg_per_h: deg_per_h_from_rad_per_s(noise.model_error_rad_per_s),
        }
    }
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct LjungBoxJson {
    pub(crate) statistic: f64,
    pub(crate) lags: usize,
    pub(crate) p_value: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct CorrelationJson {
    pub(crate) with: String,
    pub(crate) correlation: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct PartJson {
    pub(crate) name: String,
    pub(crate) share_of_squared_error: f64,
    pub(crate) rmse_deg_per_h: f64,
    pub(crate) rows: usize,
    pub(crate) share_of_rows: f64,
    pub(crate) chi_square_per_row: f64,
}

/// How the noise floor is found; also said in reports.
pub(crate) const NOISE_FLOOR_METHOD: &str =
    "what quadratics leave of 11 rows each, windows above the 98 % point of chi-square left out";

fn verdict_word(verdict: Adequacy) -> &'static str {
    match verdict {
        Adequacy::Adequate => "adequate",
        Adequacy::Missing => "missing",
    }
}

impl PartJson {
    fn new(part: &RecordPart) -> Self {
        Self {
            name: part.name.clone(),
            share_of_squared_error: part.share_of_squared_error,
            rmse_deg_per_h: deg_per_h_from_rad_per_s(part.rmse_rad_per_s),
            rows: part.rows,
            share_of_rows: part.share_of_rows,
            chi_square_per_row: part.chi_square_per_row,
        }
    }
}

impl RecordComparisonJson {
    pub(crate) fn new(file: &str, found: &Comparison, gross_errors: Vec<GrossErrorJson>, gaps: usize) -> Self {
        let parts = |parts: &[RecordPart]| parts.iter().map(PartJson::new).collect();
        Self {
            file: file.to_owned(),
            field: None,
            rows: found.rows,
            verdict: verdict_word(found.verdict).to_owned(),
            rmse_deg_per_h: deg_per_h_from_rad_per_s(found.rmse_rad_per_s),
            nrmse_fit_percent: Some(found.nrmse_fit_percent).filter(|p| p.is_finite()),
            r_squared: found.r_squared,
            noise_floor_deg_per_h: deg_per_h_from_rad_per_s(found.noise_rad_per_s),
            noise_floor_standard_error_deg_per_h: deg_per_h_from_rad_per_s(found.noise_standard_error_rad_per_s),
            noise_floor_method: NOISE_FLOOR_METHOD.to_owned(),
            reduced_chi_square: found.reduced_chi_square,
            boundary_chi_square: found.boundary_chi_square,
            whitened_chi_square: found.whitened_chi_square,
            offset_deg_per_h: deg_per_h_from_rad_per_s(found.offset_rad_per_s),
            largest_error_deg_per_h: deg_per_h_from_rad_per_s(found.largest.residual_rad_per_s),
            largest_error_time_s: found.largest.time_s,
            autocorrelation: found.autocorrelation.clone(),
            autocorrelation_band_99: found.autocorrelation_band,
            ljung_box: LjungBoxJson {
                statistic: found.ljung_box.statistic,
                lags: found.ljung_box.lags,
                p_value: found.ljung_box.p_value,
            },
            correlations: found
                .correlations
                .iter()
                .map(|c| CorrelationJson { with: c.with.to_string(), correlation: c.value })
                .collect(),
            regimes: parts(&found.regimes),
            temperature_bands: parts(&found.temperature_bands),
            rate_bands: parts(&found.rate_bands),
            findings: found.findings.iter().map(ToString::to_string).collect(),
            noise: found.standing.as_ref().and_then(|s| s.noise.first()).map(NoisePartsJson::new),
            estimated_film_w_per_m2_k: found.film_w_per_m2_k.map(|f| f.0),
            estimated_film_standard_error_w_per_m2_k: found.film_w_per_m2_k.map(|f| f.1).filter(|e| e.is_finite()),
            estimated_kinks_s: found.bends_s.clone(),
            film_switches: found.film_switches.as_ref().map(FilmSwitchesJson::new),
            sensors: found.sensors.iter().map(SensorJson::new).collect(),
            gross_errors,
            gaps,
        }
    }
}

impl CompareJson {
    pub(crate) fn new(model: &str, pattern: &str, records: Vec<RecordComparisonJson>, inputs: InputsJson) -> Self {
        let all = records.iter().all(|r| r.verdict == verdict_word(Adequacy::Adequate));
        let verdict = verdict_word(if all { Adequacy::Adequate } else { Adequacy::Missing });
        Self { model: model.to_owned(), pattern: pattern.to_owned(), verdict: verdict.to_owned(), records, inputs }
    }

    pub(crate) fn is_adequate(&self) -> bool {
        self.verdict == verdict_word(Adequacy::Adequate)
    }
}
