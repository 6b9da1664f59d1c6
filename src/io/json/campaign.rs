//! What `campaign` answers: its cells, which of them are done, and what they found.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::built_coils::BuiltCoilsJson;
use super::diagnosis::DiagnosisJson;
use super::fleet::FleetJson;
use super::metrics::MetricsJson;

/// What the cells of a campaign may be.
pub const KINDS: [&str; 4] = ["search", "tolerance", "metrics", "diagnose"];

/// A cell of a campaign, as a list shows it; what its kind does not have is null.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CellStateJson {
    /// Changes with everything that the cell's result depends on, and with nothing else.
    pub id: String,
    /// One of [`KINDS`].
    pub kind: String,
    pub model: Option<String>,
    pub layers: Option<usize>,
    pub class: Option<String>,
    pub objective: Option<String>,
    pub seed: Option<u64>,
    /// The first and the last of the built coils, counted from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coils: Option<[u64; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gyro: Option<String>,
    pub done: bool,
    /// On one thread of the machine in `results/campaigns`; an order of magnitude.
    pub estimated_s: f64,
}

/// A cell's result as its file holds it; the file depends on nothing but the cell.
pub trait CellDocument: Serialize + DeserializeOwned {
    fn id(&self) -> &str;

    /// Why there is no result, where what the cell was given permits none; trying again would end the same way.
    fn failure(&self) -> Option<&str>;
}

/// What a search found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CellJson {
    pub id: String,
    pub kind: String,
    pub model: String,
    pub layers: usize,
    pub windability: String,
    pub objective: String,
    pub seed: u64,
    /// Null where the cell failed.
    pub worst_rate_deg_per_h: Option<f64>,
    /// Null for the phase, which is no rate.
    pub objective_deg_per_h: Option<f64>,
    /// QUA's objective over the best pattern's.
    pub improvement_over_qua: Option<f64>,
    pub evaluations: u64,
    pub stopped_by: String,
    pub segments: Vec<usize>,
    pub failure: Option<String>,
}

/// What became of a block of built coils.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BlockJson {
    pub id: String,
    pub kind: String,
    pub model: String,
    pub layers: usize,
    pub seed: u64,
    /// Counted from 1.
    pub first_coil: u64,
    pub coils: u64,
    /// "guaranteed" or "sampled".
    pub measure: String,
    pub limit_deg_per_h: Option<f64>,
    pub patterns: Vec<BlockPatternJson>,
    pub failure: Option<String>,
}

/// A pattern in a block of built coils: what is needed for the quantiles of all blocks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BlockPatternJson {
    pub name: String,
    pub segments: Vec<usize>,
    pub nominal_rad_per_s: f64,
    /// Coils within the limit; null without one.
    pub within_limit: Option<u64>,
    /// Step of a grid and how many coils lie in it.
    pub steps: Vec<(u64, u64)>,
    /// The worst cases of the worst coils, descending.
    pub largest_rad_per_s: Vec<f64>,
}

/// What was found about a gyro of a fleet: the document of `metrics` or `diagnose`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GyroJson {
    pub id: String,
    pub kind: String,
    pub gyro: String,
    pub metrics: Option<MetricsJson>,
    pub diagnosis: Option<DiagnosisJson>,
    pub failure: Option<String>,
}

macro_rules! cell_documents {
    ($($document:ty),*) => {
        $(impl CellDocument for $document {
            fn id(&self) -> &str {
                &self.id
            }

            fn failure(&self) -> Option<&str> {
                self.failure.as_deref()
            }
        })*
    };
}
cell_documents!(CellJson, BlockJson, GyroJson);

/// The answer of `campaign`.
#[derive(Debug, Serialize)]
pub struct CampaignJson {
    pub campaign: String,
    /// Those that were asked for: all, or those of a part.
    pub cells: Vec<CellStateJson>,
    /// Computed by this call; the others were there already.
    pub searched: usize,
    /// Of the cells asked for, the identifiers of those that are not done.
    pub missing: Vec<String>,
    /// Identifiers of the cells that have no result because what they were given permits none.
    pub failed: Vec<String>,
    /// Of the searches that are done.
    pub results: Vec<CellJson>,
    /// Of each model, over all its blocks; once none is missing.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub built_coils: Vec<BuiltCoilsJson>,
    /// What the gyros of a fleet have in common and what is single; once none is missing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fleet: Option<FleetJson>,
}

/// The answer of `campaign --emit`.
#[derive(Debug, Serialize)]
pub struct WorkflowJson {
    #[serde(flatten)]
    pub campaign: CampaignJson,
    pub engine: String,
    /// Jobs that the cells are dealt to.
    pub parts: usize,
    /// What was written, below the folder.
    pub files: Vec<String>,
}
