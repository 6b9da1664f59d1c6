//! Sets of explanations, each in the air that it would have seen: with its own kinks, or, by another heat path, in air of another kind.
//!
//! Where the air is straight but for kinks, readings place them ([`crate::chamber::Chamber::with_shocks`]), by what a set makes of the
//! coil and the sensor. Placed by one set they favour it: another sees the air turn at other times and has to bend it there. So
//! the foremost sets are compared with the kinks that each would have placed,
//!
//! ```text
//! M(set, its kinks) − n ln(1/p)         n: kinks that it needs more than there were; p: how often a row has one
//! ```
//!
//! and the search goes on in the chamber of the best. A set that is wrong needs kinks that the truth does without.

use super::explanation::with;
use super::{Explanation, Member, Outcome, Question, Winding, is_seen, is_seen_alone};
use crate::chamber::{Chamber, Controllers, Effort, Films, OwnAir};
use crate::diagnose::candidate::Candidate;
use crate::parallel::InParallel;

/// Sets that are looked at with kinks of their own after each score test: more are behind by what no kinks make up for.
const LOOKED_AT: usize = 4;

/// A set in a chamber with its own air.
pub(super) struct InOwnAir<'a> {
    pub(crate) chamber: Chamber<'a>,
    pub(crate) explanation: Explanation,
    /// With what its kinks cost more than those of the common chamber.
    pub(crate) merit: f64,
}

/// The best of the foremost sets, each with its own kinks; None where no air is straight. `found` is in order.
pub(super) fn best_by_own_kinks<'a>(
    chamber: &Chamber<'a>,
    question: &Question,
    windings: &[Winding],
    found: &[Explanation],
) -> Option<InOwnAir<'a>> {
    let foremost: Vec<&Explanation> = found.iter().filter(|e| !e.is_beyond_physical()).take(LOOKED_AT).collect();
    let own = foremost.in_parallel().filter_map(|e| {
        let own = chamber.with_own_kinks(&e.fit, Effort::QUICK).ok()??;
        Some(in_own_air(question, windings, e.members.clone(), own))
    });
    best(own.collect())
}

/// The best set of one effect that makes the heat path another one, as a pack that ends does of a half space, in the air that it would have seen.
/// Where readings look like air of no kind by the declared path, such a set is far behind in the common chamber.
pub(super) fn best_by_own_air<'a>(question: &Question<'a>, declared: &Explanation) -> Option<InOwnAir<'a>> {
    let is_whole = |candidate: &Candidate| candidate.free.is_empty();
    best_of_one(question, declared, &is_whole, Controllers::MayBe)
}

/// The best set of one effect that only readings see, as a lag of the sensor, in air that no controller makes. A controller's time and a lag are two
/// in a row, of which readings see little more than the sum: beside the one, no score test asks for the other.
pub(super) fn best_without_controllers<'a>(question: &Question<'a>, declared: &Explanation) -> Option<InOwnAir<'a>> {
    // Those that readings do not see either are left out below.
    let leaves_heat_path =
        |candidate: &Candidate| is_seen_alone(&question.model.with_effect(candidate.effect.clone()), question.model);
    best_of_one(question, declared, &leaves_heat_path, Controllers::None)
}

fn best_of_one<'a>(
    question: &Question<'a>,
    declared: &Explanation,
    is_asked: &dyn Fn(&Candidate) -> bool,
    controllers: Controllers,
) -> Option<InOwnAir<'a>> {
    let places: Vec<usize> = (0..question.candidates.len()).filter(|&p| is_asked(&question.candidates[p])).collect();
    let own = places.in_parallel().filter_map(|place| {
        // A heat path that cannot be solved speaks against itself alone.
        by_effect(question, declared, place, controllers).unwrap_or_default()
    });
    best(own.collect())
}

fn by_effect<'a>(
    question: &Question<'a>,
    declared: &Explanation,
    place: usize,
    controllers: Controllers,
) -> Outcome<Option<InOwnAir<'a>>> {
    let member = Member::Effect(place);
    let Some((assumed, free)) = with(question, &[], &declared.fit, member, None) else { return Ok(None) };
    // What readings do not see leads to no other air.
    if !is_seen(&assumed.model, &declared.fit.assumed.model) {
        return Ok(None);
    }
    let chamber = question.chamber;
    let records: Vec<_> = (0..chamber.records()).map(|r| chamber.record(r)).collect();
    let whole = Chamber::new(question.model, &records)?.switched_like(chamber, Films::Same);
    let own = whole.with_own_airs(chamber, &assumed, &free, &question.fitted, controllers)?;
    Ok(Some(in_own_air(question, &[], vec![member], own)))
}

fn in_own_air<'a>(
    question: &Question,
    windings: &[Winding],
    members: Vec<Member>,
    (chamber, fit, prices): OwnAir<'a>,
) -> InOwnAir<'a> {
    let price: f64 = question.fitted.iter().map(|&r| prices[r]).sum();
    let there = Question { chamber: &chamber, ..question.clone() };
    let explanation = Explanation::new(&there, windings, members, fit);
    let merit = explanation.merit - price;
    InOwnAir { chamber, explanation, merit }
}

fn best(all: Vec<InOwnAir>) -> Option<InOwnAir> {
    all.into_iter().filter(|o| !o.explanation.is_beyond_physical()).max_by(|a, b| a.merit.total_cmp(&b.merit))
}
