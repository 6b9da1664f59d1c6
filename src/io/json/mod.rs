//! JSON documents: mirror types of what commands answer, with the keys that scripts read.

pub(crate) mod boundary;
pub(crate) mod built_coils;
pub mod campaign;
pub(crate) mod comparison;
pub mod diagnosis;
pub mod effects;
pub(crate) mod experiment;
pub(crate) mod explore;
pub mod extend;
pub(crate) mod fibres;
pub(crate) mod field;
pub(crate) mod fleet;
pub mod further_schemas;
pub(crate) mod hypothesis;
pub(crate) mod improve;
pub mod inputs;
pub(crate) mod metrics;
pub(crate) mod noise;
pub(crate) mod pareto;
pub(crate) mod proposals;
pub(crate) mod scale_factor;
pub mod schedule;
pub mod schema;
pub mod search;
pub(crate) mod stress;
pub(crate) mod temperatures;
pub(crate) mod tolerance;
pub(crate) mod trim;

use serde::{Deserialize, Serialize};

use crate::io::fault::{Fault, Faults};
use crate::pattern::Pattern;
use crate::pattern::windability::WindingGraph;
use crate::search::aside::PointingError;
use crate::search::cost::worst_case::WorstCase;
use crate::search::optimality::Proof;
use crate::search::proof::Status;
use crate::units::{deg_from_rad, deg_per_h_from_rad_per_s};

/// Raised when a key changes its meaning or goes; new keys do not raise it.
pub(crate) const SCHEMA_VERSION: u32 = 1;

/// A document with its schema version in front.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct Document<T: Serialize> {
    pub(crate) schema_version: u32,
    #[serde(flatten)]
    pub(crate) body: T,
}

impl<T: Serialize> Document<T> {
    /// With this program's version of the schema.
    pub fn new(body: T) -> Self {
        Self { schema_version: SCHEMA_VERSION, body }
    }
}

/// A value with its standard error; null where that is not known, or the records determine the value just so.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct EstimateJson {
    pub(crate) value: f64,
    pub(crate) standard_error: Option<f64>,
}

/// What it takes to wind a pattern.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct WindabilityJson {
    pub(crate) class: String,
    pub(crate) reels: usize,
    pub(crate) captive: usize,
    pub(crate) max_climb: usize,
}

impl WindabilityJson {
    /// By the winding graph.
    pub fn of(pattern: &Pattern) -> Self {
        let found = WindingGraph::new(pattern).windability();
        Self {
            class: found.class().to_string(),
            reels: found.reels,
            captive: found.captive,
            max_climb: found.max_climb,
        }
    }
}

/// A pattern with its worst case.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct PatternJson {
    pub(crate) name: String,
    pub(crate) segments: Vec<usize>,
    /// Whole turns more (or, below zero, fewer) than whole layers at either end of the fibre; absent without any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) end_a_turns: Option<i32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) end_b_turns: Option<i32>,
    pub(crate) worst_rate_deg_per_h: f64,
    pub(crate) worst_phase_rad: f64,
    pub(crate) worst_profile: String,
    pub(crate) worst_time_s: f64,
    /// Null where the model is nonlinear and no bound over all profiles exists.
    pub(crate) guaranteed_worst_rate_deg_per_h: Option<f64>,
    /// By how much the worst rate may differ from that of the continuum, whatever the grid; the guaranteed rate holds for the
    /// continuum, because it contains this margin. Null where nobody asked.
    pub(crate) grid_margin_deg_per_h: Option<f64>,
    /// The largest integral of the rate error over the profiles, up to any time, with its sign; null where nobody asked.
    pub(crate) worst_pointing_error_deg: Option<f64>,
    /// Its largest size over all profiles of any length within the largest rate; null where there is no such bound.
    pub(crate) guaranteed_pointing_error_deg: Option<f64>,
    /// The 95 % quantile over built coils, where it was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) p95_rate_deg_per_h: Option<f64>,
    pub(crate) windability: WindabilityJson,
}

impl PatternJson {
    /// `phase_rad` is the phase at the worst rate; the worst rate is shown as a size.
    pub(crate) fn new(
        name: &str,
        pattern: &Pattern,
        worst: &WorstCase,
        phase_rad: f64,
        guaranteed_rad_per_s: Option<f64>,
    ) -> Self {
        let ends = Some(pattern.end_turns()).filter(|ends| !ends.is_none());
        Self {
            name: name.to_owned(),
            segments: pattern.segments().to_vec(),
            end_a_turns: ends.map(|ends| ends.a),
            end_b_turns: ends.map(|ends| ends.b),
            worst_rate_deg_per_h: deg_per_h_from_rad_per_s(worst.rate_rad_per_s.abs()),
            worst_phase_rad: phase_rad.abs(),
            worst_profile: worst.profile.clone(),
            worst_time_s: worst.time_s,
            guaranteed_worst_rate_deg_per_h: guaranteed_rad_per_s.map(deg_per_h_from_rad_per_s),
            grid_margin_deg_per_h: None,
            worst_pointing_error_deg: None,
            guaranteed_pointing_error_deg: None,
            p95_rate_deg_per_h: None,
            windability: WindabilityJson::of(pattern),
        }
    }

    pub(crate) fn with_pointing(mut self, pointing: &PointingError) -> Self {
        self.worst_pointing_error_deg = Some(deg_from_rad(pointing.worst_rad));
        self.guaranteed_pointing_error_deg = pointing.guaranteed_rad.map(deg_from_rad);
        self
    }

    /// With what the grid may be off, which what is guaranteed must contain.
    pub(crate) fn with_margin(mut self, grid_margin_rad_per_s: f64) -> Self {
        let margin = deg_per_h_from_rad_per_s(grid_margin_rad_per_s);
        self.grid_margin_deg_per_h = Some(margin);
        self.guaranteed_worst_rate_deg_per_h = self.guaranteed_worst_rate_deg_per_h.map(|g| g + margin);
        self
    }
}

/// The answer of `evaluate`.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct EvaluateJson {
    pub(crate) model: String,
    pub(crate) patterns: Vec<PatternJson>,
    /// Null for a half space.
    pub(crate) other_boundary: Option<search::OtherBoundaryJson>,
    /// Formulas that the guaranteed rates leave out, which no pattern changes.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) guaranteed_beside: Vec<GuaranteedBesideJson>,
    /// What the windings were evaluated under, where that is not the model's profiles.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) fields: Vec<field::FieldJson>,
}

/// A formula that no guaranteed worst case holds.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct GuaranteedBesideJson {
    pub(crate) formula: String,
    /// By how much it can change the rate beside the guaranteed one; null where nothing bounds it.
    pub(crate) at_most_deg_per_h: Option<f64>,
}

impl GuaranteedBesideJson {
    /// Formulas with their largest sizes [rad/s].
    pub(crate) fn all(left_out: &[(String, f64)]) -> Vec<Self> {
        let one = |(formula, bound): &(String, f64)| Self {
            formula: formula.clone(),
            at_most_deg_per_h: bound.is_finite().then(|| deg_per_h_from_rad_per_s(*bound)),
        };
        left_out.iter().map(one).collect()
    }

    pub(crate) fn in_words(&self) -> String {
        match self.at_most_deg_per_h {
            Some(bound) => format!(
                "the guaranteed rates leave out the formula \"{}\", which adds at most {bound:.4} °/h whatever the winding",
                self.formula
            ),
            None => format!(
                "the guaranteed rates leave out the formula \"{}\": nothing bounds it over all profiles",
                self.formula
            ),
        }
    }
}

/// What was proved about the best pattern.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct ProofJson {
    /// "optimal", "gap" or "none".
    pub(crate) status: String,
    /// No pattern of the class has a smaller worst rate, in the continuum either; null where nothing was proved.
    pub(crate) lower_bound_deg_per_h: Option<f64>,
    /// By how much the grid may put any pattern's rate off the continuum's: "optimal" means that none is better by more.
    /// Null where nothing was proved.
    pub(crate) grid_margin_deg_per_h: Option<f64>,
}

impl ProofJson {
    pub(crate) fn of(proof: &Proof) -> Self {
        let where_proved = |rad_per_s: f64| (proof.status != Status::None).then(|| deg_per_h_from_rad_per_s(rad_per_s));
        Self {
            status: proof.status.to_string(),
            lower_bound_deg_per_h: where_proved(proof.lower_bound_rad_per_s),
            grid_margin_deg_per_h: where_proved(proof.grid_margin_rad_per_s),
        }
    }
}

/// The answer of `exact`.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct ExactJson {
    pub(crate) model: String,
    pub(crate) windability: String,
    /// What the proof is about.
    pub(crate) objective: String,
    pub(crate) best: PatternJson,
    /// What the proof's lower bound is to be compared with.
    pub(crate) best_objective_deg_per_h: f64,
    pub(crate) proof: ProofJson,
    /// Nodes whose bound was computed; the same on every machine unless the clock ended the proof.
    pub(crate) nodes: u64,
    /// Patterns judged on all samples.
    pub(crate) judged: u64,
    /// Samples that the last pass refuted by.
    pub(crate) rows: usize,
    pub(crate) seconds: f64,
}

/// One fault of a file.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct FaultJson {
    pub(crate) message: String,
    /// Counted from 1; null for a fault of the file as a whole.
    pub(crate) line: Option<usize>,
    pub(crate) note: Option<String>,
}

impl FaultJson {
    /// All of a file, in the source's order.
    pub fn all(faults: &Faults) -> Vec<Self> {
        let shown = |fault: &Fault| Self {
            message: fault.message.clone(),
            line: fault.span.as_ref().map(|s| faults.source[..s.start].matches('\n').count() + 1),
            note: fault.note.clone(),
        };
        faults.faults.iter().map(shown).collect()
    }
}

/// The answer of `check`.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct CheckJson {
    /// Its path, as the user gave it.
    pub file: String,
    /// What makes it unusable; empty for a good file.
    pub faults: Vec<FaultJson>,
    /// What could be meant otherwise; nothing is refused for it.
    pub advice: Vec<String>,
}

/// One classic winding.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct ClassicJson {
    /// Its short name: QUA.
    pub name: String,
    /// Its name in words.
    pub title: String,
    /// Of the coil that it was made for.
    pub layers: usize,
    /// P(j), counted from 1, innermost layer first.
    pub segments: Vec<usize>,
    /// What it takes to wind it.
    pub windability: WindabilityJson,
}

/// The answer of `patterns`.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct PatternsJson {
    /// Those that exist for the layer count.
    pub patterns: Vec<ClassicJson>,
}

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct ViolationJson {
    /// Counted from 1; null for the file as a whole.
    pub(crate) row: Option<usize>,
    pub(crate) field: String,
    pub(crate) expected: String,
    pub(crate) found: String,
    pub(crate) remedy: String,
    pub(crate) message: String,
}

/// The answer of `verify`.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct VerifyJson {
    pub(crate) model: String,
    pub(crate) schedule: String,
    pub(crate) checks: usize,
    pub(crate) rate_check: String,
    /// The worst over all profiles and times, worked out again, and how closely the claim must agree with it.
    pub(crate) independent_worst_rate_deg_per_h: Option<f64>,
    pub(crate) rate_tolerance_deg_per_h: Option<f64>,
    /// The same on a finer heat network; null in a half space, which has a closed form.
    pub(crate) finer_worst_rate_deg_per_h: Option<f64>,
    pub(crate) recomputed: Vec<&'static str>,
    pub(crate) taken_as_given: Vec<&'static str>,
    pub(crate) violations: Vec<ViolationJson>,
}

/// What a command wrote.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct WrittenJson {
    pub(crate) files: Vec<String>,
}

/// A script for a shell.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct CompletionsJson {
    pub(crate) shell: String,
    pub(crate) script: String,
}

/// A JSON Schema with what it is of.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct SchemaJson {
    /// Of which file or document.
    pub kind: String,
    /// A JSON Schema of the draft 2020-12.
    pub schema: serde_json::Value,
}

/// The answer of `report`.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct ReportJson {
    /// The page's path.
    pub report: String,
    /// Its size.
    pub bytes: usize,
}
