//! Where searches for a formula begin: beneath whatever stands for it, beside the listed effects that are the answer so far, and without
//! those that may stand in its place.

use super::search::{MOST_TERMS, Set, Tools};
use super::{BEATS, NEAR};
use crate::diagnose::joint::{Explanation, Found, Member};

impl Tools<'_, '_> {
    /// Every set that such a search fitted; None where no formula promises anything.
    pub(super) fn begun(
        &self,
        found: &Found,
        declared: &Explanation,
        best_listed: f64,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Option<Vec<Set>> {
        let is_listed = |e: &&Explanation| {
            !e.members.is_empty() && e.members.iter().all(|m| matches!(m, Member::Effect(_) | Member::Refitted(_)))
        };
        let listed = found.explanations.iter().find(is_listed);
        let umbrella = || self.umbrella(found, declared);
        // Where a listed set is the answer, leaves nothing, a formula in its place has to do the same for more.
        let is_answer = |e: &&Explanation| !e.is_outside() && e.total() > best_listed - NEAR;
        let mut sets: Vec<Set> = Vec::new();
        let mut is_beside_listed = false;
        if let Some(listed) = listed.filter(is_answer) {
            // A wander takes up a slow term before a term is tried.
            let umbrella = umbrella();
            let may_replace = self.may_replace(&umbrella, listed)
                || (umbrella.explanation.is_outside() && self.may_replace(&self.plain(declared), listed));
            if may_replace {
                sets = self.beneath(umbrella, declared, best_listed, &|share| progress(0.4 * share));
            }
            let replaces = |s: &Set| s.explanation.members.is_empty() && s.total() > best_listed + BEATS;
            if !sets.iter().any(|s| !s.terms.is_empty() && replaces(s)) {
                let beside = self.search(self.plain(listed), MOST_TERMS, &|share| progress(0.4 + 0.4 * share));
                let gains = |s: &Set| !s.terms.is_empty() && s.total() > listed.total();
                let promises = may_replace || listed.members.len() > 1 || beside.iter().any(gains);
                let without = self.searched_without_shadows(found, best_listed);
                if !promises && without.is_empty() {
                    return None;
                }
                sets.extend(beside);
                sets.extend(without);
                is_beside_listed = true;
            }
        } else {
            sets = self.searched_without_shadows(found, best_listed);
            sets.extend(self.beneath(umbrella(), declared, best_listed, &|share| progress(0.8 * share)));
        }
        let best_yet = sets.iter().map(Set::total).fold(f64::NEG_INFINITY, f64::max);
        if let Some(listed) = listed.filter(|e| !is_beside_listed && e.total() + BEATS > best_yet) {
            sets.extend(self.search(self.plain(listed), MOST_TERMS, &|_| ()));
        }
        let pairs = self.in_the_place_of_two(declared, listed, &sets);
        sets.extend(pairs);
        Some(sets)
    }

    /// What is searched without what may stand in a formula's place; empty where nothing of it comes near.
    fn searched_without_shadows(&self, found: &Found, best_listed: f64) -> Vec<Set> {
        let begun = self.without_shadows(found, best_listed);
        begun.map(|set| self.search(set, MOST_TERMS, &|_| ())).unwrap_or_default()
    }

    /// The declared model with whatever takes up what it leaves: its wander, or one of the sets that say so.
    fn umbrella(&self, found: &Found, declared: &Explanation) -> Set {
        let outside = found.explanations.iter().find(|e| {
            !e.members.is_empty() && e.members.iter().all(|m| matches!(m, Member::Drift)) && e.merit > declared.merit
        });
        let mut set = self.plain(declared);
        if let Some(outside) = outside {
            // Compared with the declared model, scored beneath the umbrella.
            set.explanation.fit = outside.fit.clone();
            set.explanation.members = outside.members.clone();
            set.merit = outside.merit;
            set.held_out = outside.held_out;
        }
        set
    }
}
