//! The answer of `improve` as a document.

use serde::Serialize;
use serde_json::Value;

use crate::search::gain::Gain;

/// The parts that other commands have answered are theirs word for word.
#[derive(Debug, Clone, Serialize)]
pub struct ImproveJson {
    pub model: String,
    pub measured_pattern: String,
    pub verdict: Value,
    pub effects: Value,
    /// Null where the model declares one, or no record showed any.
    pub film_w_per_m2_k: Option<f64>,
    pub recommendation: Value,
    pub validation: Value,
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

/// How many times smaller the recommended winding's error is than the measured one's.
#[derive(Debug, Clone, Serialize)]
pub struct GainJson {
    pub value: f64,
    /// 5 and 95 % of models drawn within the parameters' errors lie below.
    pub low: f64,
    pub high: f64,
}

impl GainJson {
    pub fn of(gain: &Gain) -> Self {
        let Gain { value, low, high } = *gain;
        Self { value, low, high }
    }

    /// In one sentence.
    pub fn words(&self) -> String {
        format!(
            "predicted gain over the measured winding: {:.2} times less error (5 to 95 % of what the parameters' errors allow: {:.2} to {:.2})",
            self.value, self.low, self.high
        )
    }
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
