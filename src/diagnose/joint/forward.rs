//! Forward and back from a set: score test, fits of what promises most, the best as long as it is better, and what it does without.

use super::back::{complete, look_back, rest};
use super::cache::{Cache, carried, keep};
use super::odds::{CERTAIN, WINDING};
use super::own_air::{InOwnAir, best_by_own_kinks};
use super::screen::{foremost, looked_at};
use super::tries::{discrete, from_other_days, tried};
use super::winding::{promise_beside, promising};
use super::{Explanation, Outcome, Question, Winding};
use crate::chamber::{Chamber, Effort};

/// An effect that gains so much may stand for another winding: what that costs beforehand, whichever it is, and what makes it certain.
const MAY_BE_WOUND: f64 = CERTAIN.log - WINDING.log;
/// A set must be better by so much to go on from: what is better by less gives its mass to the smaller one.
const WORTH_A_STEP: f64 = CERTAIN.log;

/// Whether a search may go on in a chamber with the kinks that a set would have placed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kinks {
    Own,
    /// The chamber was looked through by the best set already.
    Given,
}

/// A search under way, all of its fits in one chamber.
pub(super) struct Search<'a> {
    pub(super) chamber: Chamber<'a>,
    pub(super) best: Explanation,
    pub(super) cache: Cache,
    pub(super) windings: Vec<Winding>,
    /// What the first score test promised of each candidate; None before it.
    pub(super) promised: Option<Vec<(usize, f64)>>,
    /// The most that the last score test promised, at or above what is left beside the best.
    pub(super) left: f64,
    /// What the kinks of its chamber cost more than those of the chamber that was asked about.
    pub(super) price: f64,
    /// Whether its chamber is another than that.
    pub(super) is_elsewhere: bool,
}

impl<'a> Search<'a> {
    /// From a set, with others that were fitted in the same chamber.
    pub(super) fn new(question: &Question<'a>, best: Explanation, cache: Cache) -> Self {
        let chamber = question.chamber.clone();
        Self { chamber, best, cache, windings: Vec::new(), promised: None, left: 0.0, price: 0.0, is_elsewhere: false }
    }

    /// On to larger sets as long as they are better, and back; at last what may stand in the place of each member.
    ///
    /// # Errors
    /// Of the best set, that it cannot be solved.
    pub(super) fn go_on(&mut self, question: &Question, kinks: Kinks, progress: &(dyn Fn(f64) + Sync)) -> Outcome<()> {
        for stage in self.best.members.len().min(question.depth)..question.depth {
            let found = self.beside(question)?;
            progress((stage + 1) as f64 / question.depth as f64);
            if !self.take(question, found, kinks) {
                break;
            }
        }
        let here = Question { chamber: &self.chamber, ..question.clone() };
        complete(&here, &self.windings, &self.best, &mut self.cache);
        Ok(())
    }

    /// The sets with one member more, best first.
    fn beside(&mut self, question: &Question) -> Outcome<Vec<Explanation>> {
        let here = Question { chamber: &self.chamber, ..question.clone() };
        let best = &self.best;
        let mut proposals = looked_at(&here, best)?;
        self.left = proposals.iter().map(|p| p.gain).fold(0.0, f64::max);
        if self.promised.is_none() {
            // Where nothing promises what would make another winding certain, nothing is wound otherwise.
            if best.is_outside() || proposals.iter().any(|p| p.gain > MAY_BE_WOUND) {
                self.windings = promising(&here, &best.fit)?;
            }
            self.promised = Some(foremost(&proposals));
        } else if !best.has_winding() {
            // Beside what has been found since, another winding is worth something else.
            promise_beside(&here, &best.fit, &mut self.windings);
        }
        proposals.extend(discrete(&here, &self.windings, best));
        Ok(tried(&here, &self.windings, best, proposals))
    }

    /// The best of what was found, where it is better than the best so far; whether there may be more.
    fn take(&mut self, question: &Question, found: Vec<Explanation>, kinks: Kinks) -> bool {
        let foremost = found.iter().find(|e| !e.is_beyond_physical()).cloned();
        let own = match kinks {
            Kinks::Own => {
                let here = Question { chamber: &self.chamber, ..question.clone() };
                best_by_own_kinks(&self.chamber, &here, &self.windings, &found)
            }
            Kinks::Given => None,
        };
        found.into_iter().for_each(|explanation| keep(&mut self.cache, explanation));
        let least = foremost.as_ref().map_or(self.base(), |f| f.merit.max(self.base())) + WORTH_A_STEP;
        let next = match (own.filter(|own| own.merit > least), foremost) {
            (Some(own), _) => self.moved(question, own),
            (None, Some(next)) => next,
            (None, None) => return false,
        };
        let here = Question { chamber: &self.chamber, ..question.clone() };
        let next = from_other_days(&here, &self.windings, next);
        keep(&mut self.cache, next.clone());
        // What was fitted with the larger set may be a better chamber for the smaller one.
        let last = next.members.len().checked_sub(1);
        let again = last.and_then(|last| rest(&here, &self.windings, &next, last, Effort::QUICK));
        again.into_iter().for_each(|again| keep(&mut self.cache, again));
        if next.merit < self.base() + WORTH_A_STEP {
            return false;
        }
        self.best = look_back(&here, &self.windings, next, &mut self.cache);
        !self.best.members.iter().any(|m| m.is_outside())
    }

    /// What the best set is worth by the best fit of it.
    fn base(&self) -> f64 {
        self.cache.get(&self.best.key()).map_or(self.best.merit, |b| b.merit)
    }

    /// To the chamber with a set's own kinks; what was found so far is fitted again there.
    fn moved(&mut self, question: &Question, own: InOwnAir<'a>) -> Explanation {
        self.price += own.explanation.merit - own.merit;
        self.chamber = own.chamber;
        self.is_elsewhere = true;
        let here = Question { chamber: &self.chamber, ..question.clone() };
        self.cache = carried(&here, &self.windings, std::mem::take(&mut self.cache));
        own.explanation
    }
}
