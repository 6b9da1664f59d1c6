//! Sets that a search has fitted in one chamber.

use std::collections::BTreeMap;

use super::explanation::{fitted, in_order};
use super::tries::TRIED;
use super::{Explanation, Member, Question, Winding};
use crate::chamber::Effort;
use crate::parallel::InParallel;

/// Sets that were fitted, by their members.
pub(super) type Cache = BTreeMap<Vec<Member>, Explanation>;

pub(super) fn keep(cache: &mut Cache, explanation: Explanation) {
    let key = explanation.key();
    if cache.get(&key).is_none_or(|known| explanation.merit > known.merit) {
        cache.insert(key, explanation);
    }
}

/// What was found in one chamber in another: the declared model and the best.
pub(super) fn carried(question: &Question, windings: &[Winding], cache: Cache) -> Cache {
    let mut all: Vec<Explanation> = cache.into_values().collect();
    all.sort_by(in_order);
    let mut kept = 0;
    all.retain(|e| {
        kept += 1;
        e.members.is_empty() || kept <= TRIED
    });
    let there = all.in_parallel().filter_map(|e| {
        let begin = e.begin();
        fitted(question, windings, e.members, &begin, &e.fit, Effort::QUICK)
    });
    there.map(|e| (e.key(), e)).collect()
}
