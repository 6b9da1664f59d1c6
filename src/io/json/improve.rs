//! The answer of `improve` as a document.

use serde::Serialize;
use serde_json::Value;

use super::proposals::ProposalJson;
use super::search::GainJson;

/// The parts that other commands have answered are theirs word for word.
#[derive(Debug, Clone, Serialize)]
pub struct ImproveJson {
    pub model: String,
    pub measured_pattern: String,
    pub verdict: Value,
    pub effects: Value,
    /// Formulas for what no listed effect explains; the first is in `after` and in the predicted record where it predicts.
    pub proposals: Vec<ProposalJson>,
    /// Null where the model declares one, or no record showed any.
    pub film_w_per_m2_k: Option<f64>,
    pub recommendation: Value,
    pub validation: Value,
    /// What windings promise over the models that the records allow; null where nothing is uncertain.
    pub uncertainty: Value,
    /// What the measured winding costs under the model as it is now.
    pub measured_pattern_under_new_model: Value,
    pub predicted_gain: GainJson,
    pub predicted_record: String,
    /// Null where there is nothing to tell apart.
    pub next_experiment: Option<String>,
    pub suggested_experiment: Value,
    pub steps: Vec<StepJson>,
    pub page: String,
}

/// A command of the loop and where its results are.
#[derive(Debug, Clone, Serialize)]
pub struct StepJson {
    pub step: String,
    pub folder: String,
}

/// A row of the record that the new coil should show.
#[derive(Debug, Clone, Serialize)]
pub struct PredictedRow {
    pub time_s: f64,
    pub temperature_c: f64,
    pub rate_deg_per_h: f64,
    /// 95 % of the rows lie between these.
    pub low_deg_per_h: f64,
    pub high_deg_per_h: f64,
}
