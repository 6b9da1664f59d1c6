//! Back from a set: what it does without, and what may stand in a member's place.

use super::cache::{Cache, keep};
use super::explanation::{fitted, in_order, key, with, without};
use super::screen::proposals;
use super::tries::{TRIED, choose};
use super::{Explanation, Member, Question, Winding};
use crate::chamber::Effort;
use crate::parallel::InParallel;

/// A set without one of its members, beginning with the chamber that was found with it.
pub(super) fn rest(
    question: &Question,
    windings: &[Winding],
    from: &Explanation,
    place: usize,
    effort: Effort,
) -> Option<Explanation> {
    let mut members = from.members.clone();
    members.remove(place);
    fitted(question, windings, members, &without(question, from, place), &from.fit, effort)
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
            .in_parallel()
            .filter_map(|place| {
                let mut members = best.members.clone();
                members.remove(place);
                let again = rest(question, windings, &best, place, Effort::QUICK);
                again.into_iter().chain(cache.get(&key(members)).cloned()).max_by(|a, b| a.merit.total_cmp(&b.merit))
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
    let places = 0..best.members.len();
    let found = places.in_parallel().flat_map(|place| with_others(question, windings, best, place, cache));
    let found: Vec<Explanation> = found.collect();
    found.into_iter().for_each(|explanation| keep(cache, explanation));
}

/// A set with others in the place of an effect, fitted.
fn with_others(
    question: &Question,
    windings: &[Winding],
    best: &Explanation,
    place: usize,
    known: &Cache,
) -> Vec<Explanation> {
    let Member::Effect(own) = best.members[place] else { return Vec::new() };
    let mut short = next_of_kin(question, windings, best, place, own);
    if best.members.len() > 1 {
        // Where the rest stays as it is, what is like the member promises as much; where it is fitted by itself, what moves it too.
        let rests = [Effort::NONE, Effort::QUICK].in_parallel();
        let rests = rests.filter_map(|effort| rest(question, windings, best, place, effort));
        let rests: Vec<Explanation> = rests.collect();
        let alone = rests.iter().map(|rest| rest.merit).fold(f64::NEG_INFINITY, f64::max);
        let beside = rests.iter().in_parallel().flat_map(|rest| beside_rest(question, windings, rest, known));
        short.extend(beside.filter(|other| other.merit > alone).collect::<Vec<_>>());
    }
    let mut foremost = Cache::new();
    short.into_iter().for_each(|explanation| keep(&mut foremost, explanation));
    let mut foremost: Vec<Explanation> = foremost.into_values().collect();
    foremost.sort_by(in_order);
    foremost.truncate(TRIED);
    let further = foremost.in_parallel().filter_map(|short| {
        fitted(question, windings, short.members.clone(), &short.begin(), &short.fit, Effort::QUICK)
    });
    further.collect()
}

/// What differs from an effect by free parameters, or by one layer, in its place, after a short fit.
fn next_of_kin(
    question: &Question,
    windings: &[Winding],
    best: &Explanation,
    place: usize,
    own: usize,
) -> Vec<Explanation> {
    let mut rest = best.fit.clone();
    (rest.assumed, rest.free) = without(question, best, place);
    let (own, values) = (&question.candidates[own], best.effects(question).into_iter().find(|e| e.0 == own));
    let values = values.map(|e| e.1.values().to_vec());
    let kin = question.candidates.iter().enumerate().filter(|(_, c)| c.is_fuller_than(own) || c.is_next_to(own));
    let short = kin.in_parallel().filter_map(|(other, candidate)| {
        let member = Member::Effect(other);
        let values = values.clone().filter(|_| !candidate.is_of_layer());
        let begin = with(question, windings, &rest, member, values)?;
        let mut members = best.members.clone();
        members.remove(place);
        members.push(member);
        fitted(question, windings, members, &begin, &best.fit, Effort::SHORT)
    });
    short.collect()
}

/// What promises most beside a rest, and no fit is known of, after a short fit.
fn beside_rest(question: &Question, windings: &[Winding], rest: &Explanation, known: &Cache) -> Vec<Explanation> {
    let chosen = choose(proposals(question, rest).unwrap_or_default());
    let fits = chosen.in_parallel().filter_map(|p| {
        let mut members = rest.members.clone();
        members.push(p.member);
        if known.contains_key(&key(members.clone())) {
            return None;
        }
        let begin = with(question, windings, &rest.fit, p.member, p.values)?;
        fitted(question, windings, members, &begin, &rest.fit, Effort::SHORT)
    });
    fits.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chamber::{Assumption, Chamber};
    use crate::diagnose::candidate::candidates;
    use crate::diagnose::experiment::fixtures::{effect, model, pattern};
    use crate::diagnose::tests::{bare_day, of_first_record};

    #[test]
    fn in_its_place_a_member_promises_what_it_is_worth_and_beside_a_rest_that_makes_up_for_it_less() {
        let hidden = [effect("midpoint_offset", &[0.1]), effect("glass_transition", &[-0.0013, 302.8, 4.6])];
        let record = bare_day(&model(hidden.to_vec()), 20.0, 3);
        let (declared, pattern) = (model(Vec::new()), pattern());
        let assumed = Assumption::new(declared.clone(), pattern.clone());
        let (chamber, null) = Chamber::new(&declared, &[&record]).unwrap().with_shocks(&assumed, &[0]).unwrap();
        let candidates = candidates(&declared, &[&record]);
        let question = of_first_record(&chamber, &declared, &pattern, &candidates, 2);
        let place = |kind: &str| Member::Effect(candidates.iter().position(|c| c.kind() == kind).unwrap());
        let [own, other] = ["midpoint_offset", "glass_transition"].map(place);
        let one = with(&question, &[], &null, own, Some(hidden[0].values().to_vec())).unwrap();
        let one = fitted(&question, &[], vec![own], &one, &null, Effort::SHORT).unwrap();
        let both = with(&question, &[], &one.fit, other, Some(hidden[1].values().to_vec())).unwrap();
        let best = fitted(&question, &[], vec![own, other], &both, &null, Effort::FULL).unwrap();
        let promised = |effort| {
            let rest = rest(&question, &[], &best, 0, effort).unwrap();
            let of_own = proposals(&question, &rest).unwrap().into_iter().filter(|p| p.member == own);
            (rest.merit, of_own.map(|p| p.gain).fold(0.0, f64::max))
        };
        let (in_place, (alone, beside)) = (promised(Effort::NONE).1, promised(Effort::QUICK));
        let worth = best.merit - alone;
        assert!(in_place > 0.8 * worth && beside < 0.5 * worth, "{in_place} {beside} {worth}");
    }
}
