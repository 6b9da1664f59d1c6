//! The answer of `trim` as a document.

use serde::Serialize;

use super::EstimateJson;
use super::diagnosis::FindingJson;
use super::inputs::InputsJson;
use crate::diagnose::trim::{End, Trim};
use crate::units::deg_per_h_from_rad_per_s;

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct TrimJson {
    pub(crate) model: String,
    pub(crate) pattern: String,
    /// Surplus fibre at end A; negative at end B.
    pub(crate) asymmetric_length_m: EstimateJson,
    /// To be cut at `end`.
    pub(crate) cut_m: f64,
    /// "A" or "B".
    pub(crate) end: &'static str,
    /// As many turns more on the outermost layer at the other end do the same.
    pub(crate) turns_at_other_end: f64,
    pub(crate) turns_at_other_end_standard_error: Option<f64>,
    /// Whether the length is more than two standard errors.
    pub(crate) is_significant: bool,
    /// The largest rate error under the records' temperatures, as the coil is, and after the cut.
    pub(crate) present_rate_deg_per_h: f64,
    pub(crate) predicted_rate_deg_per_h: f64,
    /// The largest that one standard error of the cut adds.
    pub(crate) predicted_rate_standard_error_deg_per_h: Option<f64>,
    /// The cut that leaves the smallest largest error; null where none changes it.
    pub(crate) least: Option<LeastJson>,
    /// The fitted surplus, and what looks the same in these records.
    pub(crate) effect: FindingJson,
    pub(crate) inputs: InputsJson,
}

/// Where what the winding itself makes is balanced as far as one length can.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct LeastJson {
    pub(crate) cut_m: f64,
    /// "A" or "B".
    pub(crate) end: &'static str,
    pub(crate) turns_at_other_end: f64,
    pub(crate) rate_deg_per_h: f64,
}

fn end_name(end: End) -> &'static str {
    match end {
        End::A => "A",
        End::B => "B",
    }
}

impl TrimJson {
    pub(crate) fn new(model: &str, pattern: &str, trim: &Trim, inputs: InputsJson) -> Self {
        Self {
            model: model.to_owned(),
            pattern: pattern.to_owned(),
            asymmetric_length_m: EstimateJson {
                value: trim.asymmetric_length_m,
                standard_error: trim.standard_error_m,
            },
            cut_m: trim.cut_m,
            end: end_name(trim.end),
            turns_at_other_end: trim.turns_at_other_end,
            turns_at_other_end_standard_error: trim.turns_standard_error,
            is_significant: trim.standard_error_m.is_some_and(|e| trim.cut_m > 2.0 * e),
            present_rate_deg_per_h: deg_per_h_from_rad_per_s(trim.present_rad_per_s),
            predicted_rate_deg_per_h: deg_per_h_from_rad_per_s(trim.predicted_rad_per_s),
            predicted_rate_standard_error_deg_per_h: trim.uncertain_rad_per_s.map(deg_per_h_from_rad_per_s),
            least: trim.least.map(|least| LeastJson {
                cut_m: least.cut_m,
                end: end_name(least.end),
                turns_at_other_end: least.turns_at_other_end,
                rate_deg_per_h: deg_per_h_from_rad_per_s(least.rad_per_s),
            }),
            effect: FindingJson::new(&trim.finding),
            inputs,
        }
    }
}
