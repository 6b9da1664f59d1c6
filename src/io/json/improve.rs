//! The answer of `improve` as a document.

use serde::Serialize;
use serde_json::Value;

use super::proposals::ProposalJson;
use super::search::GainJson;

/// The parts that other commands have answered are theirs word for word.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct ImproveJson {
    pub(crate) model: String,
    pub(crate) measured_pattern: String,
    #[cfg_attr(feature = "cli", schemars(with = "String"))]
    pub(crate) verdict: Value,
    #[cfg_attr(feature = "cli", schemars(with = "Vec<super::diagnosis::FindingJson>"))]
    pub(crate) effects: Value,
    /// Formulas for what no listed effect explains; the first is in `after` and in the predicted record where it predicts.
    pub(crate) proposals: Vec<ProposalJson>,
    /// Null where the model declares one, or no record showed any.
    pub(crate) film_w_per_m2_k: Option<f64>,
    #[cfg_attr(feature = "cli", schemars(with = "Option<super::search::RecommendationJson>"))]
    pub(crate) recommendation: Value,
    #[cfg_attr(feature = "cli", schemars(with = "Option<super::search::ValidationJson>"))]
    pub(crate) validation: Value,
    /// What windings promise over the models that the records allow; null where nothing is uncertain.
    #[cfg_attr(feature = "cli", schemars(with = "Option<super::search::UncertaintyJson>"))]
    pub(crate) uncertainty: Value,
    /// What the measured winding costs under the model as it is now.
    #[cfg_attr(feature = "cli", schemars(with = "Option<super::search::FormerJson>"))]
    pub(crate) measured_pattern_under_new_model: Value,
    pub(crate) predicted_gain: GainJson,
    pub(crate) predicted_record: String,
    /// Null where there is nothing to tell apart.
    pub(crate) next_experiment: Option<String>,
    #[cfg_attr(feature = "cli", schemars(with = "Option<String>"))]
    pub(crate) suggested_experiment: Value,
    pub(crate) steps: Vec<ImproveStepJson>,
    pub(crate) page: String,
}

/// A command of the loop and where its results are.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct ImproveStepJson {
    pub step: String,
    pub(crate) folder: String,
}

/// A row of the record that the new coil should show.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct PredictedRow {
    pub(crate) time_s: f64,
    pub(crate) temperature_c: f64,
    pub(crate) rate_deg_per_h: f64,
    /// 95 % of the rows lie between these.
    pub(crate) low_deg_per_h: f64,
    pub(crate) high_deg_per_h: f64,
}
