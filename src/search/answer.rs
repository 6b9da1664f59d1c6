//! What a search answers: the best pattern beside the classics, what is known about it, and what to wind.

use super::anneal::rounds::{State, Stop};
use super::aside::{GridCheck, PointingResolution};
use super::cost::objective::Objective;
use super::cutting::Cuts;
use super::end_turns::WithEnds;
use super::evaluator::Judged;
use super::outlook::OtherBoundary;
use super::proof::{Certificate, Status};
use super::prospect::{Gain, Prospect};
use super::recommendation::Recommendation;
use super::validation::Validation;

/// How a search came to its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ended {
    /// By a rule of its plan, or because nothing better exists.
    Rule(Option<Stop>),
    /// Its time was over.
    Clock,
    /// It was interrupted.
    Signal,
}

impl Ended {
    /// As written in results.
    pub fn key(self) -> &'static str {
        match self {
            Ended::Rule(stop) => stop.map_or("rounds", Stop::key),
            Ended::Clock => "clock",
            Ended::Signal => "interrupted",
        }
    }
}

/// What came upon the best pattern.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FoundBy {
    Classic,
    Annealing,
    /// A search for another objective.
    Shared,
    /// The search by bounds at the end.
    Bounds,
}

impl FoundBy {
    /// As written in results.
    pub(crate) fn key(self) -> &'static str {
        match self {
            FoundBy::Classic => "classic",
            FoundBy::Annealing => "annealing",
            FoundBy::Shared => "shared",
            FoundBy::Bounds => "bounds",
        }
    }
}

/// What is proved about the best pattern.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Proof {
    pub(crate) status: Status,
    /// No pattern of the class is below this; zero where nothing is proved.
    pub(crate) lower_bound_rad_per_s: f64,
    /// By how much the grid may put the best pattern's rate, and that of any other, off the continuum's.
    pub(crate) grid_margin_rad_per_s: f64,
    /// The time was over before the proof was.
    pub(crate) was_cut_short: bool,
}

impl Proof {
    pub(crate) const NONE: Proof =
        Proof { status: Status::None, lower_bound_rad_per_s: 0.0, grid_margin_rad_per_s: 0.0, was_cut_short: false };

    pub(crate) fn of(certificate: &Certificate) -> Self {
        let Certificate { status, lower_bound_rad_per_s, .. } = *certificate;
        Self { status, lower_bound_rad_per_s, grid_margin_rad_per_s: 0.0, was_cut_short: status != Status::Optimal }
    }

    /// With what the grid may be off for any pattern: the lower bound then holds for the continuum.
    pub(crate) fn beside_grid(self, grid_margin_rad_per_s: f64) -> Self {
        let lower_bound_rad_per_s = (self.lower_bound_rad_per_s - grid_margin_rad_per_s).max(0.0);
        Self { lower_bound_rad_per_s, grid_margin_rad_per_s, ..self }
    }

    /// To be said after how good the best pattern is under the objective.
    pub(crate) fn words(&self, objective: Objective) -> String {
        let what = objective.title();
        match self.status {
            Status::Optimal => format!(" Proved: no pattern of the class has a smaller {what} at any time."),
            Status::Gap => format!(
                " Proved: no pattern of the class has a {what} below {}.",
                objective.shown(self.lower_bound_rad_per_s)
            ),
            Status::None => String::new(),
        }
    }
}

/// A former pattern under the model of this search.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Former {
    pub(crate) judged: Judged,
    /// Whether the best pattern of this search is better by more than rounding.
    pub(crate) best_changed: bool,
    pub(crate) statement: String,
}

/// What patterns promise where the model is not known for certain.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Outlook {
    /// Models that may be the true one.
    pub(crate) models: usize,
    /// By their names; the best first.
    pub(crate) prospects: Vec<(String, Prospect)>,
    /// Of the recommended pattern over the former one, or over QUA where there is none.
    pub(crate) gain: Option<Gain>,
}

/// The answer of [`super::run()`].
#[derive(Debug, Clone, PartialEq)]
pub struct Answer {
    /// No pattern that was found or tried is better, but for rounding.
    pub best: Judged,
    /// The classics that fit the layer count.
    pub baselines: Vec<Judged>,
    /// QUA's objective over the best pattern's; none where QUA does not fit the layer count or the error is zero.
    pub improvement_over_qua: Option<f64>,
    /// What was found, in words.
    pub statement: String,
    /// None where the temperature has no grid or the search was interrupted.
    pub(crate) grid_check: Option<GridCheck>,
    /// None unless the search was for the pointing error.
    pub(crate) resolution: Option<PointingResolution>,
    /// None where no former pattern was given.
    pub(crate) compared_with: Option<Former>,
    pub(crate) proof: Proof,
    pub(crate) found_by: FoundBy,
    /// Moves judged in all, by when the best was known, and in this run.
    pub(crate) evaluations: u64,
    pub(crate) evaluations_when_found: u64,
    pub(crate) evaluations_now: u64,
    pub(crate) state: State,
    /// How the search came to its end.
    pub ended: Ended,
    /// None where the search was interrupted.
    pub(crate) validation: Option<Validation>,
    pub(crate) recommendation: Option<Recommendation>,
    /// None where the model is known or the search was interrupted.
    pub(crate) outlook: Option<Outlook>,
    /// What the candidates would cost with the other boundary; none for a half space or an interrupted search.
    pub(crate) boundary: Option<OtherBoundary>,
    /// None unless worst admissible profiles were to join the searched ones.
    pub(crate) cuts: Option<Cuts>,
    /// None unless turns at the ends were to be chosen, and where the search was interrupted.
    pub(crate) ends: Option<WithEnds>,
}

impl Answer {
    /// Whether the same request ends here on every machine.
    pub(crate) fn is_reproducible(&self) -> bool {
        matches!(self.ended, Ended::Rule(_)) && !self.proof.was_cut_short
    }
}
