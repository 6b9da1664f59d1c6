//! What the explorer's page asks of the model inside it, and what it is answered.

use serde::{Deserialize, Serialize};

use super::{PatternJson, WindabilityJson};

/// The answer of `explore`.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct ExploreJson {
    pub(crate) page: String,
    pub(crate) bytes: usize,
}

/// Numbers of the model that the page's reader moves; null for what stays as it is, or is not in the model.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct SettingsJson {
    pub(crate) film_w_per_m2_k: Option<f64>,
    pub(crate) diffusivity_m2_per_s: Option<f64>,
    pub(crate) max_rate_c_per_h: Option<f64>,
    pub(crate) spool_j_per_m2_k: Option<f64>,
}

/// What the page holds besides its own words.
#[derive(Debug, Serialize)]
pub(crate) struct ExplorerDataJson {
    /// The model file's name, without its folder.
    pub(crate) file: String,
    /// The model's source; where its pattern was a file, without it.
    pub(crate) source: String,
    /// Windings to begin with, the first of them shown.
    pub(crate) patterns: Vec<NamedSegmentsJson>,
}

#[derive(Debug, Clone, Serialize)]
pub(crate) struct NamedSegmentsJson {
    pub(crate) name: String,
    pub(crate) title: String,
    pub(crate) segments: Vec<usize>,
}

/// A request; layers are counted from the innermost.
#[derive(Debug, Deserialize)]
#[serde(tag = "ask", rename_all = "snake_case")]
pub(crate) enum AskJson {
    /// The model, with other numbers where some are set.
    Open {
        file: String,
        source: String,
        #[serde(default)]
        settings: SettingsJson,
    },
    /// The worst rate alone: the first number.
    Worst { segments: Vec<usize> },
    /// As `evaluate` answers.
    Judge { name: String, segments: Vec<usize> },
    /// Rate errors over a profile's time.
    Series { profile: String, patterns: Vec<Vec<usize>> },
    /// What the layers do, and add to the rate error, at a time.
    Moment { profile: String, time_s: f64, segments: Vec<usize> },
    /// The exchange of two layers that helps most.
    Swap { segments: Vec<usize>, as_easy: bool },
    /// Files to keep.
    Save { name: String, segments: Vec<usize> },
}

/// What the page is answered; one line of JSON a request.
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub(crate) enum AnswerJson {
    Open {
        model: String,
        layers: usize,
        notes: Vec<String>,
        settings: SettingsJson,
        /// Whether a film or a spool can be added.
        has_surfaces: bool,
        profiles: Vec<ProfileJson>,
        classics: Vec<NamedSegmentsJson>,
        /// The heads of the cells that a judged winding comes with.
        columns: Vec<&'static str>,
    },
    Worst {
        worst_rate_deg_per_h: f64,
        /// As the program's table prints it.
        shown: String,
        windability: WindabilityJson,
    },
    Judge {
        pattern: PatternJson,
        /// As the program's table prints them.
        cells: Vec<String>,
        /// Why the pattern is hard to make.
        hard_because: Option<String>,
    },
    Series {
        times_s: Vec<f64>,
        boundary_c: Vec<f64>,
        rates_deg_per_h: Vec<Vec<f64>>,
    },
    Moment {
        temperatures_c: Vec<f64>,
        boundary_c: f64,
        /// What each layer adds to the rate error; none for formulas that are not linear in the coil's own.
        shares_deg_per_h: Option<Vec<f64>>,
        rest_deg_per_h: f64,
    },
    Swap {
        /// Null where no exchange helps.
        layers: Option<[usize; 2]>,
        segments: Vec<usize>,
        worst_rate_deg_per_h: Option<f64>,
        class: Option<String>,
    },
    Save {
        pattern_file: String,
        pattern_toml: String,
        model_file: String,
        model_toml: String,
    },
    Refused {
        error: String,
    },
}

#[derive(Debug, Serialize)]
pub(crate) struct ProfileJson {
    pub(crate) name: String,
    pub(crate) duration_s: f64,
}
