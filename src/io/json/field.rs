//! What commands say of temperature fields from elsewhere, and of a search under them.

use serde::Serialize;

use super::{PatternJson, ProofJson};

/// A field that was read.
#[derive(Debug, Clone, Serialize)]
pub struct FieldJson {
    pub file: String,
    /// Null for a pipe, which cannot be read twice.
    pub sha256: Option<String>,
    pub layers: usize,
    pub rows: usize,
    pub from_s: f64,
    pub to_s: f64,
    /// "given", or "straight between times" where only temperatures were.
    pub rates: &'static str,
}

/// The answer of `optimise --field`.
#[derive(Debug, Clone, Serialize)]
pub struct FieldSearchJson {
    pub model: String,
    pub fields: Vec<FieldJson>,
    pub objective: String,
    pub windability: String,
    pub seed: u64,
    pub best: PatternJson,
    pub baselines: Vec<PatternJson>,
    /// QUA's objective over the best pattern's; null where QUA does not fit the layer count.
    pub improvement_over_qua: Option<f64>,
    pub statement: String,
    /// Nothing is proved under a field: its status is "none".
    pub proof: ProofJson,
    pub evaluations: u64,
    /// On the screen only: files don't depend on the clock.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub evaluations_per_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seconds: Option<f64>,
    pub rounds: u64,
    /// "no improvement", "rounds", "moves", "target", "clock" or "interrupted".
    pub stopped_by: String,
    /// False where the clock or a signal ended the search.
    pub reproducible: bool,
}
