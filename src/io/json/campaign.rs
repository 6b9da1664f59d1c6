//! What `campaign` answers: its cells, which of them are done, and what they found.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::built_coils::BuiltCoilsJson;
use super::diagnosis::DiagnosisJson;
use super::fleet::FleetJson;
use super::metrics::MetricsJson;

/// What the cells of a campaign may be.
pub(crate) const KINDS: [&str; 4] = ["search", "tolerance", "metrics", "diagnose"];

/// A cell of a campaign, as a list shows it; what its kind does not have is null.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct CellStateJson {
    /// Changes with everything that the cell's result depends on, and with nothing else.
    pub(crate) id: String,
    /// One of [`KINDS`].
    pub(crate) kind: String,
    pub(crate) model: Option<String>,
    pub(crate) layers: Option<usize>,
    pub(crate) class: Option<String>,
    pub(crate) objective: Option<String>,
    pub(crate) seed: Option<u64>,
    /// The first and the last of the built coils, counted from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) coils: Option<[u64; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) gyro: Option<String>,
    pub(crate) done: bool,
    /// On one thread of the machine in `results/campaigns`; an order of magnitude.
    pub(crate) estimated_s: f64,
}

/// A cell's result as its file holds it; the file depends on nothing but the cell.
pub(crate) trait CellDocument: Serialize + DeserializeOwned {
    fn id(&self) -> &str;

    /// Why there is no result, where what the cell was given permits none; trying again would end the same way.
    fn failure(&self) -> Option<&str>;
}

/// What a search found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct CellJson {
    pub(crate) id: String,
    pub(crate) kind: String,
    pub(crate) model: String,
    pub(crate) layers: usize,
    pub(crate) windability: String,
    pub(crate) objective: String,
    pub(crate) seed: u64,
    /// Null where the cell failed.
    pub(crate) worst_rate_deg_per_h: Option<f64>,
    /// Null for the phase, which is no rate.
    pub(crate) objective_deg_per_h: Option<f64>,
    /// QUA's objective over the best pattern's.
    pub(crate) improvement_over_qua: Option<f64>,
    pub(crate) evaluations: u64,
    pub(crate) stopped_by: String,
    pub(crate) segments: Vec<usize>,
    pub(crate) failure: Option<String>,
}

/// What became of a block of built coils.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct BlockJson {
    pub(crate) id: String,
    pub(crate) kind: String,
    pub(crate) model: String,
    pub(crate) layers: usize,
    pub(crate) seed: u64,
    /// Counted from 1.
    pub(crate) first_coil: u64,
    pub(crate) coils: u64,
    /// "guaranteed" or "sampled".
    pub(crate) measure: String,
    pub(crate) limit_deg_per_h: Option<f64>,
    pub(crate) patterns: Vec<BlockPatternJson>,
    pub(crate) failure: Option<String>,
}

/// A pattern in a block of built coils: what is needed for the quantiles of all blocks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct BlockPatternJson {
    pub(crate) name: String,
    pub(crate) segments: Vec<usize>,
    pub(crate) nominal_rad_per_s: f64,
    /// Coils within the limit; null without one.
    pub(crate) within_limit: Option<u64>,
    /// Step of a grid and how many coils lie in it.
    pub(crate) steps: Vec<(u64, u64)>,
    /// The worst cases of the worst coils, descending.
    pub(crate) largest_rad_per_s: Vec<f64>,
}

/// What was found about a gyro of a fleet: the document of `metrics` or `diagnose`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct GyroJson {
    pub(crate) id: String,
    pub(crate) kind: String,
    pub(crate) gyro: String,
    pub(crate) metrics: Option<MetricsJson>,
    pub(crate) diagnosis: Option<DiagnosisJson>,
    pub(crate) failure: Option<String>,
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
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct CampaignJson {
    pub(crate) campaign: String,
    /// Those that were asked for: all, or those of a part.
    pub(crate) cells: Vec<CellStateJson>,
    /// Computed by this call; the others were there already.
    pub(crate) searched: usize,
    /// Of the cells asked for, the identifiers of those that are not done.
    pub(crate) missing: Vec<String>,
    /// Identifiers of the cells that have no result because what they were given permits none.
    pub(crate) failed: Vec<String>,
    /// Of the searches that are done.
    pub(crate) results: Vec<CellJson>,
    /// Of each model, over all its blocks; once none is missing.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) built_coils: Vec<BuiltCoilsJson>,
    /// What the gyros of a fleet have in common and what is single; once none is missing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) fleet: Option<FleetJson>,
}

/// The answer of `campaign --emit`.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct WorkflowJson {
    /// What is run.
    #[serde(flatten)]
    pub campaign: CampaignJson,
    /// Which workflow engine it was written for.
    pub engine: String,
    /// Jobs that the cells are dealt to.
    pub parts: usize,
    /// What was written, below the folder.
    pub files: Vec<String>,
}
