//! What is no effect and yet explains records, as JSON: another winding, steps of the offset, a film that is switched.

use serde::{Deserialize, Serialize};

use crate::chamber::FilmSwitches;
use crate::diagnose::{Hypothesis, OffsetStep};
use crate::units::deg_per_h_from_rad_per_s;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct HypothesisJson {
    /// The classic that the coil seems to be wound as.
    pub(crate) winding: Option<String>,
    pub(crate) reversed: bool,
    /// Two layers that changed places, counted from 1 innermost.
    pub(crate) exchanged_layers: Option<[usize; 2]>,
    pub(crate) offset_steps: Vec<OffsetStepJson>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct FilmSwitchesJson {
    pub(crate) record: String,
    /// Whether it begins behind the other film.
    pub(crate) begins_switched: bool,
    pub(crate) times_s: Vec<f64>,
    /// The other film over the usual one.
    pub(crate) film_ratio: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct OffsetStepJson {
    pub(crate) record: String,
    pub(crate) time_s: f64,
    pub(crate) size_deg_per_h: f64,
}

impl HypothesisJson {
    pub(super) fn new(hypothesis: &Hypothesis) -> Self {
        let step = |s: &OffsetStep| OffsetStepJson {
            record: s.record.clone(),
            time_s: s.time_s,
            size_deg_per_h: deg_per_h_from_rad_per_s(s.size_rad_per_s),
        };
        Self {
            winding: hypothesis.winding.map(str::to_owned),
            reversed: hypothesis.reversed,
            exchanged_layers: hypothesis.exchanged.map(|(a, b)| [a, b]),
            offset_steps: hypothesis.offset_steps.iter().map(step).collect(),
        }
    }
}

impl FilmSwitchesJson {
    pub(super) fn new(switches: &FilmSwitches) -> Self {
        Self {
            record: switches.record.clone(),
            begins_switched: switches.begins_switched,
            times_s: switches.times_s.clone(),
            film_ratio: switches.film_ratio,
        }
    }
}
