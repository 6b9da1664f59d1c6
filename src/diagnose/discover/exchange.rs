//! Members of a set exchanged for others: a search that goes forward takes what promises most first, which need not be what is best
//! beside the terms that follow, and two that stand for one (a straight line and a mirrored bend for a bend) stay two.

use super::NEAR;
use super::grounds::Sought;
use super::search::{Set, TRIED, Tools, WITHIN_REACH, WORTH_LISTED};
use crate::diagnose::joint::Proposal;
use crate::numeric::order::sort_descending;
use crate::parallel::InParallel;

/// Effects of the catalogue that follow the pack's mean rate and so look alike in ramps: mismatch, surplus at either end with either lead, the
/// empirical ones.
const ALIKE: usize = 6;

/// What an exchange makes is looked at once more: its terms were chosen beside what it took out.
const MOST_EXCHANGES: usize = 2;

impl Tools<'_, '_> {
    /// Adds what comes of exchanging members of the best set, if that is as good as what is listed, and of the set that becomes the best.
    ///
    /// # Shapes
    /// `sets`: best first, before and after.
    pub(super) fn exchange(&self, sets: &mut Vec<Set>, best_listed: f64) {
        for _ in 0..MOST_EXCHANGES {
            let Some(best) = sets.first().filter(|best| best.total() > best_listed - NEAR).cloned() else { return };
            sets.extend(self.exchanged(&best).into_iter().filter(|s| s.total().is_finite()));
            sort_descending(sets, |item| item.total());
            if sets[0].says_the_same(&best) {
                return;
            }
        }
    }

    /// The set with each of its listed effects exchanged for what else promises much in its place.
    fn exchanged(&self, set: &Set) -> Vec<Set> {
        let mut all = Vec::new();
        if set.grounds.moves() {
            // Terms that were chosen before the coil was found that they belong to.
            all.extend(self.other_terms(set, set));
        }
        let in_its_place = |place: usize| -> Vec<Set> {
            let Some(fewer) = self.without(set, place) else { return Vec::new() };
            let mut found = self.other_terms(set, &fewer);
            let sets = self.with_others(&fewer, &|p| p.member != set.explanation.members[place]);
            let near = sets.into_iter().filter(|s| s.merit > set.merit - WITHIN_REACH);
            found.extend(self.all_judged(set, near.collect()));
            found
        };
        let places = 0..set.explanation.members.len();
        all.extend(places.in_parallel().flat_map(in_its_place).collect::<Vec<Set>>());
        if set.explanation.members.len() > 1 {
            all.extend(self.beside_the_terms_alone(set));
        }
        all
    }

    /// One effect in the place of all that are listed: together they may stand for one that none of them leads to.
    fn beside_the_terms_alone(&self, set: &Set) -> Vec<Set> {
        let mut bare = set.clone();
        while !bare.explanation.members.is_empty() {
            let Some(next) = self.without(&bare, 0) else { return Vec::new() };
            bare = next;
        }
        let sets = self.with_others(&bare, &|p| !set.explanation.members.contains(&p.member));
        self.all_judged(set, sets.into_iter().filter(|s| s.merit > set.merit - WITHIN_REACH).collect())
    }

    /// A set with each of the listed effects that promise most beside it.
    fn with_others(&self, fewer: &Set, is_other: &dyn Fn(&Proposal) -> bool) -> Vec<Set> {
        let Ok(mut others) = self.listed_beside(fewer, Sought::Everything) else { return Vec::new() };
        others.retain(|p| p.gain > WORTH_LISTED && is_other(p));
        sort_descending(&mut others, |item| item.gain);
        others.truncate(ALIKE);
        others.iter().in_parallel().filter_map(|p| self.with_listed(fewer, p)).collect()
    }

    /// Sets that came of an exchange, with their held-out records looked at.
    fn all_judged(&self, exchanged: &Set, sets: Vec<Set>) -> Vec<Set> {
        sets.in_parallel().map(|s| self.as_confirmed_as(exchanged, self.judged(self.consistent(s)))).collect()
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
