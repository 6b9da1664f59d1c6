//! What compensators leave of records that they were not fitted to.

use serde::Serialize;

use super::measures::MeasuresJson;

/// Each record in turn, compensated by what was fitted to the others.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct LeaveOneOutJson {
    /// What is left of all records where only the mean rate of the others is taken off.
    pub by_offset_rms_deg_per_h: f64,
    pub records: Vec<LeftOutRecordJson>,
    pub methods: Vec<LeftOutMethodJson>,
}

/// A record as it is.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct LeftOutRecordJson {
    pub file: String,
    pub before: MeasuresJson,
    pub by_offset_rms_deg_per_h: f64,
}

/// One method on all records.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct LeftOutMethodJson {
    pub method: &'static str,
    /// Of all records, by what was fitted to all of them; null where the method cannot be used.
    pub fitted_rms_deg_per_h: Option<f64>,
    /// Of all records, each by what was fitted to the others; null where one of these fits failed.
    pub left_out_rms_deg_per_h: Option<f64>,
    /// It does clearly worse on what it was not shown.
    pub only_fits: bool,
    /// What is to be said of it.
    pub reason: Option<String>,
    pub records: Vec<LeftOutJson>,
}

/// One method on one record, fitted to the others.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct LeftOutJson {
    pub file: String,
    pub rms_deg_per_h: Option<f64>,
    /// About its own mean: without what its start-up added to the bias.
    pub deviation_deg_per_h: Option<f64>,
    pub delay_rows: Option<usize>,
    pub measures: Option<MeasuresJson>,
    /// Why there is no number.
    pub reason: Option<String>,
}

impl LeftOutJson {
    pub(crate) fn failed(file: String, reason: String) -> Self {
        Self {
            file,
            rms_deg_per_h: None,
            deviation_deg_per_h: None,
            delay_rows: None,
            measures: None,
            reason: Some(reason),
        }
    }
}
