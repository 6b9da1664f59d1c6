//! What `campaign` answers: its cells, which of them are done, and what they found.

use serde::{Deserialize, Serialize};

/// A cell of a campaign, as a list shows it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CellStateJson {
    /// Changes with everything that the cell's result depends on, and with nothing else.
    pub id: String,
    pub kind: String,
    pub model: String,
    pub layers: usize,
    pub class: String,
    pub objective: String,
    pub seed: u64,
    pub done: bool,
    /// On one thread of the machine in `results/campaigns`; an order of magnitude.
    pub estimated_s: f64,
}

/// What a cell found; its file depends on nothing but the cell.
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
    /// Why there is no result, where the model itself permits none; trying again would end the same way.
    pub failure: Option<String>,
}

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
    /// Identifiers of the cells that have no result because their model permits none.
    pub failed: Vec<String>,
    /// Of the cells that are done.
    pub results: Vec<CellJson>,
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
