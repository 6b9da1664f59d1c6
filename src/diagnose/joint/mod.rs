//! The search over sets of explanations in the joint model, and what is left of them by posterior mass.
//!
//! ```text
//! M(set) = ln E(fitted rates | readings) + ln E(held-out rates | readings, the coil's numbers as fitted) + Σ ln p(member)
//! p(set) ∝ e^M;   a set that holds a smaller one as good gives its mass to that one
//! ```
//!
//! # Source
//! Kass and Raftery, J. Am. Stat. Assoc. 90 (1995) 773; Madigan and Raftery, ibid. 89 (1994) 1535 (Occam's window).

mod adjust;
mod back;
mod beside;
mod cache;
mod explanation;
mod forward;
mod judge;
mod odds;
mod own_air;
mod parsimony;
mod readings;
mod screen;
mod search;
mod tries;
mod winding;

use std::sync::Arc;

use crate::chamber::{Chamber, ChamberError, Effort, Fit, Free};
use crate::diagnose::candidate::Candidate;
use crate::pattern::Pattern;

pub(crate) use back::refit_without;
pub(crate) use beside::beside;
pub(crate) use explanation::{Explanation, Member};
pub(in crate::diagnose) use explanation::{fitted, with, without};
pub(in crate::diagnose) use odds::EFFECT;
pub(in crate::diagnose) use parsimony::give_to_smaller;
use readings::is_seen_alone;
pub(in crate::diagnose) use readings::{Readings, changes_readings, is_seen};
pub(in crate::diagnose) use screen::{Proposal, TestedStart, proposals_along, tested_starts};
pub(crate) use search::{again, fit_one, judged, ranked, search_if_it_promises};
pub(crate) use winding::Winding;

/// What is asked of the search.
#[derive(Debug, Clone)]
pub(crate) struct Question<'a> {
    pub(crate) chamber: &'a Chamber<'a>,
    pub(crate) model: &'a crate::rate::CoilModel,
    pub(crate) pattern: &'a Pattern,
    pub(crate) candidates: &'a [Candidate],
    /// Places of the records to fit, and of those that are held out.
    pub(crate) fitted: Vec<usize>,
    pub(crate) held_out: Vec<usize>,
    /// Members that a set may have.
    pub(crate) depth: usize,
}

impl Question<'_> {
    /// The merit of the best set found, less what the switches of the film cost in its chamber.
    pub(crate) fn most(&self, found: &Found) -> f64 {
        let merit = found.explanations.first().map_or(f64::NEG_INFINITY, |best| best.merit);
        merit - self.chamber.film_price(&self.fitted)
    }

    /// Log evidence of the held-out records with the coil's numbers as a fit has them; −∞ where one cannot be solved. The fit keeps
    /// what their days were.
    pub(crate) fn held_out_evidence(&self, fit: &mut Fit) -> f64 {
        let days: Outcome<Vec<Fit>> = self.held_out.iter().map(|&r| self.chamber.held_out(fit, r)).collect();
        let Ok(days) = days else { return f64::NEG_INFINITY };
        let evidence = days.iter().map(|day| day.evidence).sum();
        fit.days = Arc::new(days);
        evidence
    }
}

/// What the search found.
#[derive(Debug, Clone)]
pub(crate) struct Found {
    /// Best first; probabilities add up to one. The declared model is always among them.
    pub(crate) explanations: Vec<Explanation>,
    /// Of each candidate the gain in log likelihood that the score test promised, largest first, with the effect there.
    pub(crate) promised: Vec<(usize, f64)>,
    /// The most that the search's last score test promised.
    pub(super) left: f64,
    pub(crate) windings: Vec<Winding>,
    /// Whether its fits are of another chamber than that which was asked about.
    pub(crate) is_elsewhere: bool,
}

impl Found {
    /// The declared model, with whatever belongs to the day.
    pub(crate) fn declared(&self) -> Option<&Explanation> {
        self.explanations.iter().find(|e| e.members.is_empty())
    }

    /// The fit of the likeliest set.
    pub(crate) fn likeliest(&self) -> Option<&Fit> {
        self.explanations.first().map(|e| &e.fit)
    }
}

/// The sets on the way to one: its first effect, its first two, and so on, each fitted by itself.
///
/// # Errors
/// A set that cannot be solved.
pub(in crate::diagnose) fn on_the_way(question: &Question, to: &Explanation) -> Outcome<Vec<Explanation>> {
    let declared = question.model.effects.len();
    let added = to.fit.assumed.model.effects.len() - declared;
    let shorter = |kept: usize| {
        let mut assumed = to.fit.assumed.clone();
        assumed.model.effects.truncate(declared + kept);
        let free: Vec<Free> = to.fit.free.iter().filter(|f| f.effect < declared + kept).copied().collect();
        let fit = question.chamber.fit(&assumed, &free, &question.fitted, Some(&to.fit), Effort::QUICK)?;
        Ok(Explanation { fit, held_out: None, probability: 0.0, ..to.clone() })
    };
    (1..added).map(shorter).collect()
}

pub(in crate::diagnose) type Outcome<T> = Result<T, ChamberError>;

/// Rates that a fit has seen.
pub(in crate::diagnose) fn rates(chamber: &Chamber, fit: &Fit) -> usize {
    fit.records.iter().map(|&r| chamber.times_s(r).len()).sum::<usize>().max(2)
}
