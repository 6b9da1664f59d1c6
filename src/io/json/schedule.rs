//! Schedules as files: JSON, CSV and a plain table, written and read.
//!
//! One [`ScheduleJson`] stands behind the schedule, the traveller and the winder's program; the latter two fill more
//! of its optional fields. In CSV the last columns repeat what is claimed of the whole, so that a file on its own
//! says what it claims and its first line is the header.

use serde::{Deserialize, Serialize};

use crate::coil::Fibre;
use crate::io::files::sha256_hex;
use crate::io::model::{ModelFile, NamedPattern};
use crate::pattern::windability::WindingGraph;
use crate::pattern::{EndTurns, Half};
use crate::schedule::production::Production;
use crate::schedule::{Rotation, Schedule, ScheduleStep};
use crate::search::cost::worst_case::WorstCase;
use crate::thermal::Flange;
use crate::units::{deg_per_h_from_rad_per_s, mm_from_m, nm_from_m, percent_from_fraction, um_from_m};

use super::SCHEMA_VERSION;
use crate::io::table::rows_as_csv;

/// Raised when a word of a machine program changes its meaning.
pub(crate) const PROGRAM_VERSION: u32 = 1;

/// Digits after the point: micrometres of fibre, a tenth of a micrometre of radius.
pub(crate) const LENGTH_DECIMALS: i32 = 6;
pub(crate) const MM_DECIMALS: i32 = 4;
pub(crate) const TURNS_DECIMALS: i32 = 4;
pub(crate) const RATE_DECIMALS: i32 = 6;

/// What every form of a schedule says of a step; a table without one of these columns is no schedule.
pub(in crate::io) const STEP_COLUMNS: [&str; 13] = [
    "step",
    "layer",
    "half",
    "segment",
    "supply_reel",
    "direction",
    "turns",
    "fibre_from_m",
    "fibre_to_m",
    "length_m",
    "radius_mm",
    "climb",
    "cumulative_m",
];

/// A schedule, a traveller's data or a machine program.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ScheduleJson {
    pub(crate) schema_version: u32,
    /// "schedule", "traveller" or "machine program".
    pub(crate) document: String,
    pub(crate) program: String,
    pub(crate) model: String,
    /// Of the model file that it was made from; 64 hexadecimal digits.
    pub model_sha256: String,
    pub(crate) pattern: String,
    /// Of the pattern's name and segments, so that neither changes alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) pattern_sha256: Option<String>,
    pub(crate) segments: Vec<i64>,
    /// Whole turns more (or, below zero, fewer) than whole layers at either end of the fibre; absent without any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end_a_turns: Option<i32>,
    /// As `end_a_turns`, at end B.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end_b_turns: Option<i32>,
    /// What it takes to wind the pattern.
    pub windability: ClaimedWindability,
    /// The largest size of the rate error over the profiles.
    pub worst_rate_deg_per_h: f64,
    pub(crate) worst_profile: String,
    /// When it occurs in its profile.
    pub worst_time_s: f64,
    /// The fibre in words.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) fibre: Option<String>,
    pub(crate) length_m: f64,
    /// The fibre's middle: arclength from end A, and the layer (counted from 1) in which it lies, the inner one of two.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) midpoint_m: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) midpoint_layer: Option<i64>,
    pub(crate) start_mark_m: f64,
    /// Segments of half A less those of half B: what must be trimmed from end A, or, below zero, from end B.
    pub expected_trim_m: f64,
    pub(crate) reels: Vec<ReelJson>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) production: Option<ProductionJson>,
    /// In winding order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub steps: Vec<StepJson>,
}

/// What a document says it takes to wind the pattern.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ClaimedWindability {
    /// "standard", "captive:N" or "any".
    pub class: String,
    pub(crate) reels: i64,
    pub(crate) captive: i64,
    pub(crate) max_climb: i64,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct ReelJson {
    pub(crate) name: String,
    pub(crate) captive: bool,
    pub(crate) prepared_before_step: i64,
    pub(crate) taken_from: Option<String>,
    pub(crate) from_m: f64,
    pub(crate) to_m: f64,
    /// What to load: the fibre to be wound and the allowance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) load_m: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct ProductionJson {
    pub(crate) part_number: String,
    pub(crate) revision: String,
    pub(crate) spool: String,
    pub(crate) tension_n: f64,
    pub(crate) tension_taper_percent_per_layer: f64,
    pub(crate) tension_limit_percent: f64,
    pub(crate) allowance_m: f64,
    pub(crate) adhesive: String,
    pub(crate) potting_every_layers: i64,
    pub(crate) cure: String,
    pub(crate) winding_speed_turns_per_min: f64,
}

/// One layer's winding.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct StepJson {
    /// Counted from 1.
    pub step: i64,
    pub(crate) layer: i64,
    pub(crate) half: String,
    /// Counted from 1 at end A.
    pub segment: i64,
    pub(crate) supply_reel: String,
    /// From which flange to which, in words.
    pub direction: String,
    /// Of this layer.
    pub turns: f64,
    pub(crate) fibre_from_m: f64,
    pub(crate) fibre_to_m: f64,
    /// Of this layer's fibre.
    pub length_m: f64,
    /// Of this layer's middle.
    pub radius_mm: f64,
    /// Largest climb of the crossovers that the step completes, in layers.
    pub climb: i64,
    pub(crate) cumulative_m: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) crossover: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) balance_m: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) rotation: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) axial_pitch_mm: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) tension_n: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) tension_min_n: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) tension_max_n: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) turns_per_min: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) reel_change: Option<bool>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) potting: Option<bool>,
    /// Entered by hand.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) measured_length_m: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) checked_by: Option<String>,
}

/// To so many digits after the point, as the files have it.
pub(crate) fn rounded(value: f64, decimals: i32) -> f64 {
    let scale = 10f64.powi(decimals);
    let result = (value * scale).round() / scale;
    // No "-0".
    if result == 0.0 { 0.0 } else { result }
}

pub(crate) fn direction_word(from: Flange) -> &'static str {
    match from {
        Flange::First => "first-to-second",
        Flange::Second => "second-to-first",
    }
}

pub(crate) fn flange_word(flange: Flange) -> &'static str {
    match flange {
        Flange::First => "first",
        Flange::Second => "second",
    }
}

fn length(value_m: f64) -> f64 {
    rounded(value_m, LENGTH_DECIMALS)
}

impl ScheduleJson {
    /// The schedule of a pattern with what is claimed about it.
    pub fn new(file: &ModelFile, named: &NamedPattern, schedule: &Schedule, worst: &WorstCase) -> Self {
        let windability = WindingGraph::new(&named.pattern).windability();
        let ends = Some(named.pattern.end_turns()).filter(|ends| !ends.is_none());
        Self {
            schema_version: SCHEMA_VERSION,
            document: "schedule".to_owned(),
            program: concat!("coilwright ", env!("CARGO_PKG_VERSION")).to_owned(),
            model: file.model.name.clone(),
            model_sha256: sha256_hex(&file.source),
            pattern: named.name.clone(),
            pattern_sha256: Some(pattern_sha256(named)),
            segments: named.pattern.segments().iter().map(|&s| s as i64).collect(),
            end_a_turns: ends.map(|ends| ends.a),
            end_b_turns: ends.map(|ends| ends.b),
            windability: ClaimedWindability {
                class: windability.class().to_string(),
                reels: windability.reels as i64,
                captive: windability.captive as i64,
                max_climb: windability.max_climb as i64,
            },
            worst_rate_deg_per_h: rounded(deg_per_h_from_rad_per_s(worst.rate_rad_per_s.abs()), RATE_DECIMALS),
            worst_profile: worst.profile.clone(),
            worst_time_s: rounded(worst.time_s, LENGTH_DECIMALS),
            fibre: Some(fibre_words(file.model.coil.fibre())),
            length_m: length(schedule.length_m()),
            midpoint_m: Some(length(0.5 * schedule.length_m())),
            midpoint_layer: Some(schedule.midpoint_layer() as i64),
            start_mark_m: length(schedule.start_mark_m()),
            expected_trim_m: length(schedule.expected_trim_m()),
            reels: schedule
                .reels()
                .iter()
                .map(|reel| ReelJson {
                    name: reel.name.to_string(),
                    captive: reel.captive,
                    prepared_before_step: reel.prepared_before_step as i64,
                    taken_from: reel.taken_from.map(|name| name.to_string()),
                    from_m: length(reel.from_m),
                    to_m: length(reel.to_m),
                    load_m: None,
                })
                .collect(),
            production: None,
            steps: schedule.steps().iter().map(StepJson::new).collect(),
        }
    }

    /// As CSV: a row a step; the last columns repeat what is claimed of the whole.
    ///
    /// # Errors
    /// None in practice: it is written to memory.
    pub fn csv(&self) -> Result<String, csv::Error> {
        let claims = ClaimColumns {
            model: self.model.clone(),
            model_sha256: self.model_sha256.clone(),
            pattern: self.pattern.clone(),
            windability_class: self.windability.class.clone(),
            worst_rate_deg_per_h: self.worst_rate_deg_per_h,
        };
        let bytes = rows_as_csv(self.steps.iter().map(|step| (step, &claims)))?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    }
}

/// The last columns of every row of a CSV.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(in crate::io) struct ClaimColumns {
    pub(crate) model: String,
    pub(crate) model_sha256: String,
    pub(crate) pattern: String,
    pub(crate) windability_class: String,
    pub(crate) worst_rate_deg_per_h: f64,
}

impl StepJson {
    fn new(step: &ScheduleStep) -> Self {
        Self {
            step: step.step as i64,
            layer: step.layer as i64,
            half: match step.half {
                Half::A => "A".to_owned(),
                Half::B => "B".to_owned(),
            },
            segment: step.segment as i64,
            supply_reel: step.supply_reel.to_string(),
            direction: direction_word(step.from_flange).to_owned(),
            turns: rounded(step.turns, TURNS_DECIMALS),
            fibre_from_m: length(step.fibre_from_m),
            fibre_to_m: length(step.fibre_to_m),
            length_m: length(step.length_m),
            radius_mm: rounded(mm_from_m(step.radius_m), MM_DECIMALS),
            climb: step.climb as i64,
            cumulative_m: length(step.cumulative_m),
            crossover: None,
            balance_m: None,
            rotation: None,
            axial_pitch_mm: None,
            tension_n: None,
            tension_min_n: None,
            tension_max_n: None,
            turns_per_min: None,
            reel_change: None,
            potting: None,
            measured_length_m: None,
            checked_by: None,
        }
    }
}

/// Of the name, a line break, and the segments with spaces between; with turns at the ends these follow on a line of their own.
fn pattern_sha256(named: &NamedPattern) -> String {
    let segments: Vec<String> = named.pattern.segments().iter().map(ToString::to_string).collect();
    let EndTurns { a, b } = named.pattern.end_turns();
    let ends = if named.pattern.end_turns().is_none() { String::new() } else { format!("\n{a} {b}") };
    sha256_hex(&format!("{}\n{}{ends}", named.name, segments.join(" ")))
}

/// What the header says of the fibre: `250.0 µm over the coating, n 1.447 at 1300 nm`.
fn fibre_words(fibre: &Fibre) -> String {
    let (diameter_um, wavelength_nm) = (um_from_m(fibre.outer_diameter_m), nm_from_m(fibre.wavelength_m));
    format!("{diameter_um:.1} µm over the coating, n {} at {wavelength_nm:.0} nm", fibre.refractive_index)
}

/// What the operator reads about the crossovers that a step completes: `second flange, from layer 3, 2 layers`.
pub(crate) fn crossover_words(step: &ScheduleStep) -> String {
    let begins = (step.start_gap_turns > 0.0).then(|| {
        let gap = rounded(step.start_gap_turns, TURNS_DECIMALS);
        format!("begin {gap} turns from the {} flange", flange_word(step.from_flange))
    });
    let crossovers = step.crossovers.iter().map(|c| {
        let layers = if c.climb == 1 { "layer" } else { "layers" };
        format!("{} flange, from layer {}, {} {layers}", flange_word(c.flange), c.from_layer, c.climb)
    });
    begins.into_iter().chain(crossovers).collect::<Vec<String>>().join("; ")
}

pub(crate) fn rotation_word(rotation: Rotation) -> &'static str {
    match rotation {
        Rotation::Clockwise => "cw",
        Rotation::Counterclockwise => "ccw",
    }
}

impl ProductionJson {
    pub(crate) fn new(production: &Production) -> Self {
        Self {
            part_number: production.part_number.clone(),
            revision: production.revision.clone(),
            spool: production.spool.clone(),
            tension_n: production.tension_n,
            tension_taper_percent_per_layer: percent_from_fraction(production.tension_taper_per_layer),
            tension_limit_percent: percent_from_fraction(production.tension_limit),
            allowance_m: production.allowance_m,
            adhesive: production.adhesive.clone(),
            potting_every_layers: production.potting_every_layers as i64,
            cure: production.cure.clone(),
            winding_speed_turns_per_min: production.winding_speed_turns_per_min,
        }
    }
}
