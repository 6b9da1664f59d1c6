//! Searches that begin without what may stand in a formula's place.
//!
//! A listed effect that is linear in a variable, and a wander that takes up the rest, do nearly what a bend of that variable does; so do
//! several listed effects together. No term beside them gains much, and beside the declared model nothing does while another effect
//! is missing too. So the foremost sets are tried without their wander, and then without each of their listed effects in turn: what the
//! others leave is then what a formula has to explain.

use super::search::{Set, Tools, WITHIN_REACH};
use crate::chamber::{Effort, Fit, Free};
use crate::diagnose::joint::{Explanation, Found, Member, fitted, without};
use crate::parallel::InParallel;

/// Terms that are fitted beside each of them.
const LEAST_TRIED: usize = 2;

impl Tools<'_, '_> {
    /// The best set with a term that is found so; None where none comes near what the listed effects are worth.
    pub(super) fn without_shadows(&self, found: &Found, best_listed: f64) -> Option<Set> {
        let leader = found.explanations.first()?;
        let bare = self.without_outside(leader)?;
        let mut begun: Vec<Explanation> = Vec::new();
        if bare.members.len() < leader.members.len() {
            begun.push(bare.clone());
        }
        // Without its only one it is the declared model, with which another search begins.
        if bare.members.len() > 1 {
            let fewer = (0..bare.members.len()).in_parallel().filter_map(|place| self.fewer(&bare, place));
            begun.extend(fewer.collect::<Vec<_>>());
        }
        let sets = begun.iter().in_parallel().flat_map(|e| {
            let set = self.plain(e);
            let regression = self.question.chamber.regression(&e.fit);
            let with = regression.map_or_else(|_| Vec::new(), |r| self.with_terms(&set, &r, LEAST_TRIED));
            with.into_iter().map(|with| (with, set.clone())).collect::<Vec<_>>()
        });
        let sets: Vec<(Set, Set)> = sets.collect();
        let (best, bare) = sets.into_iter().max_by(|(a, _), (b, _)| a.merit.total_cmp(&b.merit))?;
        let mut best = self.judged(self.consistent(best));
        if best.total() < best_listed - WITHIN_REACH {
            return None;
        }
        best.held_out_gain = best.held_out.zip(self.judged(bare).held_out).map(|(with, without)| with - without);
        Some(best)
    }

    /// An explanation without a wander or a cycle; None where nothing listed is left.
    fn without_outside(&self, leader: &Explanation) -> Option<Explanation> {
        let mut bare = leader.clone();
        while let Some(place) = bare.members.iter().position(|m| m.is_outside()) {
            bare = self.fewer(&bare, place)?;
        }
        bare.members.iter().any(|m| matches!(m, Member::Effect(_) | Member::Refitted(_))).then_some(bare)
    }

    /// An explanation without one of its members, from a gyro that does not wander: what is left shows as wander again.
    fn fewer(&self, from: &Explanation, place: usize) -> Option<Explanation> {
        let mut members: Vec<Member> = from.members.clone();
        members.remove(place);
        let begin: (_, Vec<Free>) = without(self.question, from, place);
        let mut start: Fit = from.fit.clone();
        start.calm(&self.question.fitted);
        fitted(self.question, self.windings, members, &begin, &start, Effort::QUICK)
    }
}
