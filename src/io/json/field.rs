//! What commands say of temperature fields from elsewhere, and of a search under them.

use serde::Serialize;

use super::{PatternJson, ProofJson};

/// A field that was read.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct FieldJson {
    pub(crate) file: String,
    /// Null for a pipe, which cannot be read twice.
    pub(crate) sha256: Option<String>,
    pub(crate) layers: usize,
    pub(crate) rows: usize,
    pub(crate) from_s: f64,
    pub(crate) to_s: f64,
    /// "given", or "straight between times" where only temperatures were.
    pub(crate) rates: &'static str,
}

/// The answer of `optimise --field`.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct FieldSearchJson {
    pub(crate) model: String,
    pub(crate) fields: Vec<FieldJson>,
    pub(crate) objective: String,
    pub(crate) windability: String,
    pub(crate) seed: u64,
    pub(crate) best: PatternJson,
    pub(crate) baselines: Vec<PatternJson>,
    /// QUA's objective over the best pattern's; null where QUA does not fit the layer count.
    pub(crate) improvement_over_qua: Option<f64>,
    pub(crate) statement: String,
    /// Over the rows of the fields.
    pub(crate) proof: ProofJson,
    pub(crate) evaluations: u64,
    /// On the screen only: files don't depend on the clock.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) evaluations_per_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) seconds: Option<f64>,
    pub(crate) rounds: u64,
    /// "no improvement", "rounds", "moves", "target", "clock" or "interrupted".
    pub(crate) stopped_by: String,
    /// False where the clock or a signal ended the search.
    pub(crate) reproducible: bool,
}
