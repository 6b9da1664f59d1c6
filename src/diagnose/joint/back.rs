//! Back from a set: what it does without, and what may stand in a member's place.

use rayon::prelude::*;

use super::cache::{Cache, keep};
use super::explanation::{Begin, fitted, with, without};
use super::screen::proposals;
use super::tries::choose;
use super::{Explanation, Member, Question, Winding};
use crate::chamber::Effort;

/// The set before its last member, beginning with the chamber that was found with it.
pub(super) fn refit_without_last(question: &Question, windings: &[Winding], next: &Explanation) -> Option<Explanation> {
    let place = next.members.len().checked_sub(1)?;
    let mut members = next.members.clone();
    members.remove(place);
    fitted(question, windings, members, &without(question, next, place), &next.fit, Effort::QUICK)
}

/// The rest of a set, fitted again without one member.
pub(crate) fn refit_without(question: &Question, from: &Explanation, place: usize) -> Option<Explanation> {
    let mut members = from.members.clone();
    members.remove(place);
    let begin = without(question, from, place);
    let fit = question.chamber.fit(&begin.0, &begin.1, &question.fitted, Some(&from.fit), Effort::QUICK).ok()?;
    Some(Explanation {
        members,
        fit,
        merit: f64::NEG_INFINITY,
        held_out: None,
        in_readings: 0.0,
        understated: 0.0,
        probability: 0.0,
    })
}

/// Leaves out what the rest does not need.
pub(super) fn look_back(
    question: &Question,
    windings: &[Winding],
    mut best: Explanation,
    cache: &mut Cache,
) -> Explanation {
    while best.members.len() > 1 {
        let smaller: Vec<Explanation> = (0..best.members.len())
            .into_par_iter()
            .filter_map(|place| {
                let mut members = best.members.clone();
                members.remove(place);
                let mut key = members.clone();
                key.sort_unstable();
                let again =
                    fitted(question, windings, members, &without(question, &best, place), &best.fit, Effort::QUICK);
                again.into_iter().chain(cache.get(&key).cloned()).max_by(|a, b| a.merit.total_cmp(&b.merit))
            })
            .collect();
        smaller.iter().for_each(|s| keep(cache, s.clone()));
        let Some(least) = smaller.into_iter().max_by(|a, b| a.merit.total_cmp(&b.merit)) else { break };
        if least.merit < best.merit {
            break;
        }
        best = least;
    }
    best
}

/// The best set once more with the parameters that have defaults, and with each member exchanged for what promises most.
pub(super) fn complete(question: &Question, windings: &[Winding], best: &Explanation, cache: &mut Cache) {
    let mut begins: Vec<(Vec<Member>, Begin)> = Vec::new();
    for (place, member) in best.members.iter().enumerate() {
        let Member::Effect(own) = member else { continue };
        let rest = without(question, best, place);
        let mut rest_fit = best.fit.clone();
        (rest_fit.assumed, rest_fit.free) = (rest.0.clone(), rest.1.clone());
        for (other, candidate) in question.candidates.iter().enumerate() {
            let own_candidate = &question.candidates[*own];
            if candidate.is_fuller_than(own_candidate) || candidate.is_next_to(own_candidate) {
                let values = if candidate.is_of_layer() {
                    None
                } else {
                    best.effects(question).iter().find(|e| e.0 == *own).map(|e| e.1.values().to_vec())
                };
                let mut members = best.members.clone();
                members.remove(place);
                members.push(Member::Effect(other));
                if let Some(begin) = with(question, windings, &rest_fit, Member::Effect(other), values) {
                    begins.push((members, begin));
                }
            }
        }
        if best.members.len() > 1 {
            let mut members = best.members.clone();
            members.remove(place);
            let Ok(rest_fit) = question.chamber.fit(&rest.0, &rest.1, &question.fitted, Some(&best.fit), Effort::FULL)
            else {
                continue;
            };
            let rest = Explanation::new(question, windings, members.clone(), rest_fit);
            let Ok(proposals) = proposals(question, &rest) else { continue };
            for proposal in choose(proposals) {
                let mut members = members.clone();
                members.push(proposal.member);
                let mut key = members.clone();
                key.sort_unstable();
                if !cache.contains_key(&key)
                    && let Some(begin) = with(question, windings, &rest.fit, proposal.member, proposal.values)
                {
                    begins.push((members, begin));
                }
            }
        }
    }
    let found: Vec<Explanation> = begins
        .into_par_iter()
        .filter_map(|(members, begin)| fitted(question, windings, members, &begin, &best.fit, Effort::QUICK))
        .collect();
    found.into_iter().for_each(|explanation| keep(cache, explanation));
}
