//! Members of a set exchanged for others: a search that goes forward takes what promises most first, which need not be what is best
//! beside the terms that follow, and two that stand for one (a straight line and a mirrored bend for a bend) stay two.

use rayon::prelude::*;

use super::grounds::Sought;
use super::search::{Set, TRIED, Tools, WITHIN_REACH, WORTH_LISTED};

/// Effects of the catalogue that follow the pack's mean rate and so look alike in ramps: mismatch, surplus at either end with either lead, the
/// empirical ones.
const ALIKE: usize = 6;

impl Tools<'_, '_> {
    /// The set with each of its listed effects exchanged for what else promises much in its place.
    pub(crate) fn exchanged(&self, set: &Set) -> Vec<Set> {
        let mut all = Vec::new();
        if set.grounds.moves() {
            // Terms that were chosen before the coil was found that they belong to.
            all.extend(self.other_terms(set, set));
        }
        for place in 0..set.explanation.members.len() {
            let Some(fewer) = self.without(set, place) else { continue };
            all.extend(self.other_terms(set, &fewer));
            let Ok(mut others) = self.listed_beside(&fewer, Sought::Everything) else { continue };
            others.retain(|p| p.gain > WORTH_LISTED && p.member != set.explanation.members[place]);
            others.sort_by(|a, b| b.gain.total_cmp(&a.gain));
            others.truncate(ALIKE);
            let sets: Vec<Set> = others.par_iter().filter_map(|p| self.with_listed(&fewer, p)).collect();
            let near = sets.into_iter().filter(|s| s.merit > set.merit - WITHIN_REACH);
            all.extend(
                near.collect::<Vec<_>>()
                    .into_par_iter()
                    .map(|s| self.as_confirmed_as(set, self.judged(self.consistent(s))))
                    .collect::<Vec<_>>(),
            );
        }
        all
    }

    /// Other terms in the place of all of a set's, beside fewer of its listed effects.
    fn other_terms(&self, set: &Set, fewer: &Set) -> Vec<Set> {
        let mut bare = fewer.clone();
        while !bare.terms.is_empty() {
            let Some(next) = self.without(&bare, bare.len() - 1) else { return Vec::new() };
            bare = next;
        }
        let bare = self.judged(bare);
        let confirmed = |mut other: Set| {
            other.held_out_gain = other.held_out.zip(bare.held_out).map(|(with, without)| with - without);
            other
        };
        let Ok(regression) = self.question.chamber.regression(&bare.explanation.fit) else { return Vec::new() };
        let mut others = self.with_terms(&bare, &regression, TRIED);
        others.retain(|s| s.merit > set.merit - WITHIN_REACH);
        self.foremost(others).into_iter().map(confirmed).collect()
    }

    /// What the held-out records gained with the other set's last member, and what they gained or lost by the exchange.
    fn as_confirmed_as(&self, other: &Set, set: Set) -> Set {
        let by_exchange = set.held_out.zip(other.held_out).map(|(a, b)| a - b);
        let held_out_gain = other.held_out_gain.zip(by_exchange).map(|(gain, more)| gain + more);
        Set { held_out_gain, ..set }
    }
}
