//! The JSON document of `extend`.

use serde::{Deserialize, Serialize};

use super::boundary::BoundaryJson;
use super::comparison::CompareJson;
use super::diagnosis::FindingJson;

/// The answer of `extend`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct ExtendJson {
    /// The new model file.
    pub(crate) written: String,
    pub(crate) effect: FindingJson,
    /// What the new model file states as `[boundary]`; null without a record to fit to.
    pub(crate) boundary: Option<BoundaryJson>,
    /// Every record given, as `compare` shows it.
    pub(crate) before: CompareJson,
    pub(crate) after: CompareJson,
}
