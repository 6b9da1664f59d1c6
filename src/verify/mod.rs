//! Checks a schedule against the coil that it is for, with code of its own.
//!
//! Geometry, turns, reels, flanges, classes, the pack's temperatures and the rate error are worked out again from the
//! raw coil and the declared effects. All violations come at once, each with its row and what to do.
//!
//! What is compared how closely: lengths, radii and turns to the last printed digit; words and counts exactly; the
//! rate error at the stated profile and time, and as the worst over all profiles and times, to its last printed digit
//! (where the conductivity depends on temperature, within a tolerance that is stated). Shared with what emits schedules
//! are the model as it was read, the profiles, and the parser of a user's formula; [`Verification::taken_as_given`]
//! says so of each file.

mod along;
mod expected;
mod form;
mod heat;
mod laplace;
mod layers;
mod network;
mod optics;
mod page;
mod parts;
mod physics;
mod program;
mod rate;
mod stepping;
mod strain;
mod waves;
mod winding;

use crate::profile::ProfileSpec;
use crate::rate::CoilModel;
use crate::units::{deg_per_h_from_rad_per_s, mm_from_m};

pub(crate) use form::Kind;

/// What a file claims, in SI; what its kind of file says must be there, and nothing else.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Claim {
    /// None only where nothing was read yet.
    pub(crate) kind: Option<Kind>,
    /// Whether the file says more of the whole than a table's last columns can.
    pub(crate) is_document: bool,
    /// What wrote the file.
    pub(crate) program: Option<String>,
    pub(crate) model: Option<String>,
    pub(crate) model_sha256: Option<String>,
    pub(crate) pattern: Option<String>,
    /// Of the pattern's name and segments.
    pub(crate) pattern_sha256: Option<String>,
    pub(crate) segments: Option<Vec<i64>>,
    /// Turns more or fewer at end A and at end B.
    pub(crate) end_turns: [Option<i64>; 2],
    pub(crate) class: Option<String>,
    pub(crate) reels: Option<i64>,
    pub(crate) captive: Option<i64>,
    pub(crate) max_climb: Option<i64>,
    pub(crate) worst_rate_rad_per_s: Option<f64>,
    pub(crate) worst_profile: Option<String>,
    pub(crate) worst_time_s: Option<f64>,
    /// The fibre in words.
    pub(crate) fibre: Option<String>,
    pub(crate) length_m: Option<f64>,
    pub(crate) midpoint_m: Option<f64>,
    pub(crate) midpoint_layer: Option<i64>,
    pub(crate) start_mark_m: Option<f64>,
    pub(crate) expected_trim_m: Option<f64>,
    pub(crate) supply: Option<Vec<ClaimedReel>>,
    pub(crate) shop: Option<Shop>,
    pub(crate) rows: Vec<Row>,
    /// The page as its file has it, where the file is one.
    pub(crate) page: Option<String>,
    /// The lines of a machine program, where the file is one; its rows are what these wind.
    pub(crate) code: Option<String>,
    /// What was found where the file was read.
    pub(crate) unread: Vec<Violation>,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ClaimedReel {
    pub(crate) name: String,
    pub(crate) captive: bool,
    pub(crate) prepared_before_step: i64,
    pub(crate) taken_from: Option<String>,
    pub(crate) from_m: f64,
    pub(crate) to_m: f64,
    pub(crate) load_m: Option<f64>,
}

/// One row of a schedule; further columns are checked where they are present.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Row {
    pub(crate) step: i64,
    pub(crate) layer: i64,
    pub(crate) half: String,
    pub(crate) segment: i64,
    pub(crate) supply_reel: String,
    pub(crate) direction: String,
    pub(crate) turns: f64,
    /// From the first flange to the nearest turn, where a program says so.
    pub(crate) free_m: Option<f64>,
    pub(crate) fibre_from_m: f64,
    pub(crate) fibre_to_m: f64,
    pub(crate) length_m: f64,
    pub(crate) radius_m: f64,
    pub(crate) climb: i64,
    pub(crate) cumulative_m: f64,
    pub(crate) crossover: Option<String>,
    pub(crate) balance_m: Option<f64>,
    pub(crate) rotation: Option<String>,
    pub(crate) axial_pitch_m: Option<f64>,
    pub(crate) tension_n: Option<f64>,
    pub(crate) tension_min_n: Option<f64>,
    pub(crate) tension_max_n: Option<f64>,
    pub(crate) turns_per_min: Option<f64>,
    pub(crate) reel_change: Option<bool>,
    pub(crate) potting: Option<bool>,
    /// Entered by hand.
    pub(crate) measured_length_m: Option<String>,
    pub(crate) checked_by: Option<String>,
}

/// The winding shop's settings.
#[derive(Debug, Clone, PartialEq)]
pub struct Shop {
    /// Words that are copied, not computed, each with its name.
    pub(crate) words: Vec<(&'static str, String)>,
    pub(crate) tension_n: f64,
    pub(crate) tension_taper_per_layer: f64,
    pub(crate) tension_limit: f64,
    pub(crate) allowance_m: f64,
    pub(crate) potting_every_layers: i64,
    pub(crate) winding_speed_turns_per_min: f64,
}

/// What the schedule should be for.
#[derive(Debug, Clone, Copy)]
pub struct Truth<'a> {
    /// The coil.
    pub model: &'a CoilModel,
    /// The temperature profiles that windings are judged on.
    pub profiles: &'a ProfileSpec,
    /// Of the model file; 64 hexadecimal digits.
    pub model_sha256: &'a str,
    /// The winding shop.
    pub shop: &'a Shop,
    /// What the program's own pages hold.
    pub assets: &'a Assets,
}

/// What the program's pages hold besides their words; SHA-256 as 64 hexadecimal digits.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Assets {
    pub(crate) style_sha256: String,
    pub(crate) drawing_style_sha256: String,
    pub(crate) script_sha256: String,
    /// What a browser may load and run.
    pub(crate) policy: String,
}

/// One thing that is not as it should be.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Violation {
    /// Counted from 1; none for the file as a whole.
    pub row: Option<usize>,
    /// Which entry of the file, as it is written there.
    pub field: String,
    pub(crate) expected: String,
    pub(crate) found: String,
    pub(crate) remedy: &'static str,
}

impl std::fmt::Display for Violation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let Some(row) = self.row {
            write!(f, "row {row}: ")?;
        }
        write!(f, "{} must be {}, found {}: {}", self.field, self.expected, self.found, self.remedy)
    }
}

/// What was found, and how the rate error was checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Verification {
    /// In the file's order; empty where everything is as it should be.
    pub violations: Vec<Violation>,
    /// Comparisons made.
    pub checks: usize,
    /// How the rate error was checked.
    pub rate_check: RateCheck,
    /// What was worked out again by code of this module's own.
    pub(crate) recomputed: Vec<&'static str>,
    /// What was not.
    pub taken_as_given: Vec<&'static str>,
}

/// How far the claimed rate error could be checked.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum RateCheck {
    /// Not claimed, or not to be worked out: the rows are no winding, or an effect is not known (a violation says so).
    None,
    /// Against a solution of this module's own.
    Independent {
        /// The worst over all profiles and times.
        worst_rad_per_s: f64,
        /// How closely the claim was compared with it.
        tolerance_rad_per_s: f64,
        /// The same, where it stands for the continuum behind a claim's grid; none in a half space, which has none.
        finer_rad_per_s: Option<f64>,
        /// How many profiles were gone through.
        profiles: usize,
    },
}

const EMIT_AGAIN: &str = "emit the schedule again from the model, do not edit it";

/// Collects violations and counts comparisons.
#[derive(Debug, Default)]
struct Findings {
    violations: Vec<Violation>,
    checks: usize,
}

impl Findings {
    fn add(&mut self, row: Option<usize>, field: &str, expected: String, found: String, remedy: &'static str) {
        self.violations.push(Violation { row, field: field.to_owned(), expected, found, remedy });
    }

    fn same<T: PartialEq + std::fmt::Display>(&mut self, row: Option<usize>, field: &str, expected: &T, found: &T) {
        self.checks += 1;
        if expected != found {
            self.add(row, field, expected.to_string(), found.to_string(), EMIT_AGAIN);
        }
    }

    /// As [`Findings::same`], where the file has the field.
    fn same_if<T: PartialEq + std::fmt::Display>(
        &mut self,
        row: Option<usize>,
        field: &str,
        expected: &T,
        found: Option<&T>,
    ) {
        if let Some(found) = found {
            self.same(row, field, expected, found);
        }
    }

    /// Not NaN either.
    fn near(&mut self, row: Option<usize>, field: &str, expected: f64, found: f64, printed: Printed) {
        self.checks += 1;
        if !((expected - found).abs() <= printed.tolerance()) {
            self.add(row, field, printed.show(expected), printed.show(found), EMIT_AGAIN);
        }
    }

    fn near_if(&mut self, row: Option<usize>, field: &str, expected: f64, found: Option<f64>, printed: Printed) {
        if let Some(found) = found {
            self.near(row, field, expected, found, printed);
        }
    }
}

/// How a number is printed, and so how closely it can be compared: half the last digit.
#[derive(Debug, Clone, Copy)]
enum Printed {
    /// Metres, six digits.
    Metres,
    /// Millimetres, four digits; held in metres.
    Millimetres,
    /// Turns, newtons and the like, four digits.
    Plain,
    /// Degrees per hour, six digits; held in rad/s.
    DegPerHour,
}

impl Printed {
    fn tolerance(self) -> f64 {
        match self {
            Printed::Metres => 5.001e-7,
            Printed::Millimetres => 5.001e-8,
            Printed::Plain => 5.001e-5,
            Printed::DegPerHour => 5.1e-7 * crate::units::rad_per_s_from_deg_per_h(1.0),
        }
    }

    fn show(self, value: f64) -> String {
        match self {
            Printed::Metres => format!("{value:.6} m"),
            Printed::Millimetres => format!("{:.4} mm", mm_from_m(value)),
            Printed::Plain => format!("{value:.4}"),
            Printed::DegPerHour => format!("{:.6} °/h", deg_per_h_from_rad_per_s(value)),
        }
    }
}

/// Checks everything that a file claims, and that it claims nothing else.
pub fn verify(truth: &Truth, claim: &Claim) -> Verification {
    let mut findings = Findings { violations: claim.unread.clone(), checks: claim.unread.len() };
    let executed = claim.code.as_ref().map(|code| Claim { rows: program::run(code, &mut findings), ..claim.clone() });
    let claim = executed.as_ref().unwrap_or(claim);
    form::check(claim, &mut findings);
    findings.same_if(None, "model", &truth.model.name, claim.model.as_ref());
    if let Some(found) = &claim.model_sha256 {
        findings.checks += 1;
        if found != truth.model_sha256 {
            let remedy =
                "the model file is not the one that the schedule was made from: use that revision or emit again";
            findings.add(None, "model_sha256", truth.model_sha256.to_owned(), found.clone(), remedy);
        }
    }
    // Where nothing could be read, what is missing needs no saying.
    if claim.kind.is_none() && !claim.unread.is_empty() {
        let (recomputed, taken_as_given) = (Vec::new(), vec!["the model as its file was read"]);
        let Findings { violations, checks } = findings;
        return Verification { violations, checks, rate_check: RateCheck::None, recomputed, taken_as_given };
    }
    let winding = winding::read(truth, claim, &mut findings);
    if let Some(html) = &claim.page {
        let segments = winding.as_ref().map(|winding| winding.segments.as_slice());
        page::check(claim, truth.assets, html, segments, &mut findings);
    }
    let mut rate_check = RateCheck::None;
    if let Some(winding) = &winding {
        expected::check(truth, claim, winding, &mut findings);
        rate_check = rate::check(truth, claim, winding, &mut findings);
    }
    let (recomputed, taken_as_given) = scope(truth, claim, winding.is_some(), rate_check);
    let Findings { violations, checks } = findings;
    Verification { violations, checks, rate_check, recomputed, taken_as_given }
}

/// What was worked out again, and what was taken as the program's other parts gave it.
fn scope(
    truth: &Truth,
    claim: &Claim,
    is_winding: bool,
    rate_check: RateCheck,
) -> (Vec<&'static str>, Vec<&'static str>) {
    let (mut again, mut given) = (vec!["that every segment is wound once"], vec!["the model as its file was read"]);
    if is_winding {
        again.push("turns, lengths, radii, directions and crossovers of every layer");
        again.push("which reel feeds which layer, what it holds and what was drawn from it");
    }
    if is_winding && (claim.class.is_some() || claim.captive.is_some()) {
        again.push("the class of windability");
    }
    if claim.page.is_some() && is_winding {
        again.push("every element, attribute, word and line of the page; its style and scripts by their SHA-256");
    }
    if claim.code.is_some() {
        again.push("every line of the program, run on a model of the machine");
    }
    again.push("that the file holds what its kind of file holds, and nothing else");
    match rate_check {
        RateCheck::None => given.push("the rate error"),
        RateCheck::Independent { .. } => {
            again.push("temperatures and rate error at the stated profile and time");
            again.push("the worst rate error over all profiles and times");
            given.push("the profiles that the model's seed draws");
            if truth.model.effects.iter().any(|e| matches!(e.subject(), crate::effect::Subject::Formula(_))) {
                given.push("how a user's formula is read");
            }
        }
    }
    if claim.pattern.is_some() {
        given.push("the pattern's name, where it is not a classic winding's");
    }
    (again, given)
}
