//! What a search answers: the best pattern beside the classics, what is known about it, and what to wind.

use super::anneal::rounds::{State, Stop};
use super::aside::{GridCheck, Resolution};
use super::end_turns::BestEndTurns;
use super::evaluator::{Judged, name_of};
use super::optimality::Proof;
use super::outlook::OtherBoundary;
use super::prospect::Outlook;
use super::recommendation::Recommendation;
use super::validation::Validation;
use crate::numeric::order::sort_ascending;
use crate::pattern::Pattern;
use crate::profile::Profile;

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

/// A former pattern under the model of this search.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Former {
    pub(crate) judged: Judged,
    /// Whether the best pattern of this search is better by more than rounding.
    pub(crate) best_changed: bool,
    pub(crate) statement: String,
}

/// Sampled and guaranteed agree when they are this close.
pub(crate) const AGREE: f64 = 0.01;

/// What cutting planes have come to.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Cuts {
    /// Worst admissible profiles that joined the searched ones.
    pub(crate) joined: Vec<Profile>,
    /// The best pattern's worst rate over the searched profiles and those that joined.
    pub(crate) sampled_rad_per_s: f64,
    /// Over all admissible profiles, or over those drawn to stand for them.
    pub(crate) worst_rad_per_s: f64,
    /// Whether the model has a guaranteed worst rate.
    pub(crate) is_guaranteed: bool,
}

impl Cuts {
    pub(crate) fn agree(&self) -> bool {
        self.worst_rad_per_s <= self.sampled_rad_per_s * (1.0 + AGREE)
    }
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
    /// None where the search was interrupted.
    pub(crate) resolution: Option<Resolution>,
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
    pub(crate) ends: Option<BestEndTurns>,
}

impl Answer {
    /// Whether the same request ends here on every machine.
    pub(crate) fn is_reproducible(&self) -> bool {
        matches!(self.ended, Ended::Rule(_)) && !self.proof.was_cut_short
    }

    /// What else than the best pattern may be worth winding, by its name, likeliest first: the recommended one, the classics, what the search found.
    pub(crate) fn others(&self) -> impl Iterator<Item = (String, Pattern)> {
        let recommended = self.recommendation.iter().map(|r| (r.name.clone(), r.pattern.clone()));
        let mut classics: Vec<&Judged> = self.baselines.iter().collect();
        sort_ascending(&mut classics, |item| item.objective_rad_per_s);
        let classics = classics.into_iter().map(|judged| (judged.name.clone(), judged.pattern.clone()));
        let found = self.state.found.iter().filter_map(|found| Pattern::new(found.segments.clone()).ok());
        recommended.chain(classics).chain(found.map(|pattern| (name_of(&pattern), pattern)))
    }
}
