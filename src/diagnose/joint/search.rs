//! Searches: from the declared model, from another heat path, in a chamber that is looked through anew, and of one kind only.

use super::back::complete;
use super::cache::{Cache, carried, keep};
use super::explanation::{fitted, in_order, with};
use super::forward::{Kinks, Search};
use super::judge::{Care, judge};
use super::odds::{CERTAIN, WINDOW};
use super::own_air::{best_by_own_air, best_without_controllers};
use super::screen::{Proposal, proposals};
use super::tries::from_other_days;
use super::{Explanation, Found, Member, Outcome, Question};
use crate::chamber::{ChamberError, Effort, Fit};
use crate::parallel::InParallel;

/// What a score test must promise for records that were only judged by to be searched themselves, and for a search to go on in
/// another chamber: what an effect costs, twice.
const PROMISING: f64 = 12.0;

/// Sets of explanations for records that the declared model, found on others, was only judged by: searched where the score test promises
/// enough, and judged. `progress` is told the share that is done.
///
/// # Errors
/// A declared model that cannot be solved for these records.
pub(crate) fn search_if_it_promises(
    question: &Question,
    declared: &Fit,
    progress: &(dyn Fn(f64) + Sync),
) -> Outcome<Option<Found>> {
    let day = question.chamber.fit(&declared.assumed, &[], &question.fitted, Some(declared), Effort::FULL)?;
    let day = question.chamber.in_better_order(day, Effort::FULL)?;
    let null = Explanation::new(question, &[], Vec::new(), day.clone());
    if most_promised(question, &null)? <= PROMISING {
        return Ok(None);
    }
    let found = ranked(question, day, progress)?;
    Ok(Some(if found.is_elsewhere { again(question, found)? } else { judged(question, found)? }))
}

/// Sets that were only ranked, judged in the chamber that they were found in.
///
/// # Errors
/// As [`search_if_it_promises`].
pub(crate) fn judged(question: &Question, mut found: Found) -> Outcome<Found> {
    judge(question, &found.windings, &mut found.explanations, Care::InFull)?;
    Ok(found)
}

/// Searches sets of explanations, and ranks them: from the declared model, and in air of another kind that some candidate would have seen, if that
/// may be the chamber's. What else is missing hangs on which it is.
///
/// # Errors
/// As [`search_if_it_promises`].
pub(crate) fn ranked(question: &Question, null: Fit, progress: &(dyn Fn(f64) + Sync)) -> Outcome<Found> {
    progress(0.2);
    let declared = Explanation::new(question, &[], Vec::new(), null);
    let mut cache = Cache::new();
    cache.insert(declared.key(), declared.clone());
    let (best, mut most, mut found) =
        ranked_from(question, declared.clone(), cache.clone(), &|share| progress(0.2 + 0.4 * share))?;
    let mut others = vec![best_by_own_air(question, &declared)];
    // Another winding stands for much: before it is named, air without a controller is asked for.
    if best.has_winding() && question.fitted.iter().any(|&r| question.chamber.is_controlled(r)) {
        others.push(best_without_controllers(question, &declared));
    }
    progress(0.6);
    for other in others.into_iter().flatten().filter(|own| own.merit > declared.merit - WINDOW) {
        let there = Question { chamber: &other.chamber, ..question.clone() };
        let mut cache = carried(&there, &[], cache.clone());
        let price = other.explanation.merit - other.merit;
        keep(&mut cache, other.explanation.clone());
        let (_, worth, found_there) =
            ranked_from(&there, other.explanation, cache, &|share| progress(0.6 + 0.4 * share))?;
        if worth - price > most + PROMISING {
            (most, found) = (worth - price, Found { is_elsewhere: true, ..found_there });
        }
    }
    Ok(found)
}

/// A search from a set: the best that it ended with, what that is worth less what the kinks of its own air cost, and all that was found, ranked.
fn ranked_from(
    question: &Question,
    best: Explanation,
    cache: Cache,
    progress: &(dyn Fn(f64) + Sync),
) -> Outcome<(Explanation, f64, Found)> {
    let mut search = Search::new(question, best, cache);
    search.go_on(question, Kinks::Own, progress)?;
    let Search { chamber, best, mut cache, windings, promised, left, price, is_elsewhere } = search;
    let here = Question { chamber: &chamber, ..question.clone() };
    let mut explanations: Vec<Explanation> = cache.values().cloned().collect();
    judge(&here, &windings, &mut explanations, Care::AsRanked)?;
    // What held-out records prefer, and what may stand for another winding, is as complete as what the search ended with.
    let preferred = preferred(&explanations, &best);
    if !preferred.is_empty() {
        preferred.iter().for_each(|set| complete(&here, &windings, set, &mut cache));
        explanations = cache.into_values().collect();
        judge(&here, &windings, &mut explanations, Care::AsRanked)?;
    }
    let worth = best.merit - price;
    let found = Found { explanations, promised: promised.unwrap_or_default(), left, windings, is_elsewhere };
    Ok((best, worth, found))
}

/// Of judged sets, the likeliest, and the likeliest before any gave its mass to a smaller one, if they go further than the best of the search or held-out
/// records alone prefer them, and, if the likeliest is wound otherwise, the likeliest that is not.
fn preferred(judged: &[Explanation], best: &Explanation) -> Vec<Explanation> {
    let Some(first) = judged.first() else { return Vec::new() };
    let others = judged.iter().filter(|e| !e.is_outside() && e.key() != first.key());
    let likelier = others.max_by(|a, b| a.total().total_cmp(&b.total())).filter(|e| e.total() > first.total());
    let is_further = |e: &&Explanation| e.members.len() > best.members.len() || e.merit < best.merit - WINDOW;
    let further = [Some(first), likelier].into_iter().flatten().filter(is_further);
    let plain = judged.iter().find(|e| !e.has_winding() && e.members.len() > 1 && !e.is_outside());
    let plain = plain.filter(|e| first.has_winding() && e.key() != best.key() && e.total() > first.total() - WINDOW);
    further.chain(plain).cloned().collect()
}

/// What was found, judged again in a chamber that is looked through with the best of it ([`crate::chamber::Chamber::with_timed_shocks_by`]):
/// what the old one's kinks and gross errors hid is looked for beside the best once more, where the score test promises more than it did.
///
/// # Errors
/// A declared model that cannot be solved for these records.
pub(crate) fn again(question: &Question, found: Found) -> Outcome<Found> {
    let Found { explanations, promised, left, mut windings, .. } = found;
    let there = explanations.in_parallel().filter_map(|e| {
        let begin = e.begin();
        fitted(question, &windings, e.members, &begin, &e.fit.to_another_chamber(), Effort::FULL)
    });
    let mut cache: Cache = there.map(|e| (e.key(), e)).collect();
    if !cache.contains_key(&Vec::new()) {
        return Err(ChamberError::Unsolvable);
    }
    let best = cache.values().filter(|e| !e.is_beyond_physical()).min_by(|a, b| in_order(a, b)).cloned();
    if let Some(best) = best.filter(|best| best.members.len() < question.depth && !best.is_outside())
        && most_promised(question, &best)? > PROMISING.max(left + CERTAIN.log)
    {
        let mut search = Search { windings, promised: Some(promised.clone()), ..Search::new(question, best, cache) };
        search.go_on(question, Kinks::Given, &|_| ())?;
        (windings, cache) = (search.windings, search.cache);
    }
    let mut explanations: Vec<Explanation> = cache.into_values().collect();
    judge(question, &windings, &mut explanations, Care::InFull)?;
    Ok(Found { explanations, promised, left, windings, is_elsewhere: false })
}

fn most_promised(question: &Question, best: &Explanation) -> Outcome<f64> {
    Ok(proposals(question, best)?.iter().map(|p| p.gain).fold(0.0, f64::max))
}

/// The best fit of the only kind among the candidates, and mean squares of standardised innovations before and after.
pub(crate) fn fit_one(question: &Question, base: &Fit) -> Option<Explanation> {
    let null = Explanation::new(question, &[], Vec::new(), base.clone());
    let begins: Vec<(usize, Vec<f64>)> = question
        .candidates
        .iter()
        .enumerate()
        .flat_map(|(place, c)| c.starts.iter().map(move |start| (place, start.clone())))
        .collect();
    let mut proposals = proposals(question, &null).ok()?;
    proposals.extend(begins.into_iter().map(|(place, values)| Proposal {
        member: Member::Effect(place),
        values: Some(values),
        gain: 0.0,
        short: None,
    }));
    let fits = proposals.in_parallel().filter_map(|p| {
        let begin = with(question, &[], base, p.member, p.values)?;
        fitted(question, &[], vec![p.member], &begin, base, Effort::QUICK)
    });
    let fits: Vec<Explanation> = fits.collect();
    let best = fits.into_iter().max_by(|a, b| a.merit.total_cmp(&b.merit))?;
    Some(from_other_days(question, &[], best))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::chamber::{Assumption, Chamber, Quantity};
    use crate::diagnose::experiment::fixtures::{model, pattern};
    use crate::diagnose::tests::{bare_day, of_first_record};

    fn judged(members: Vec<Member>, merit: f64, held_out: f64) -> Explanation {
        let fit = Fit::to_nothing(Assumption::new(model(Vec::new()), pattern()), Vec::new(), 1e-7);
        let held_out = Some(held_out);
        Explanation { members, fit, merit, held_out, in_readings: 0.0, understated: 0.0, probability: 0.0 }
    }

    #[test]
    fn what_another_chamber_took_held_out_days_for_is_no_beginning() {
        let declared = model(Vec::new());
        let pattern = pattern();
        let records = [3, 4].map(|seed| bare_day(&declared, 20.0, seed));
        let assumed = Assumption::new(declared.clone(), pattern.clone());
        let chamber = Chamber::new(&declared, &[&records[0], &records[1]]).unwrap();
        let (chamber, null) = chamber.with_shocks(&assumed, &[0]).unwrap();
        let question = of_first_record(&chamber, &declared, &pattern, &[], 1);
        let held_out = |fit: &Fit| {
            let explanations = vec![Explanation::new(&question, &[], Vec::new(), fit.clone())];
            let found = Found {
                explanations,
                promised: Vec::new(),
                left: f64::INFINITY,
                windings: Vec::new(),
                is_elsewhere: false,
            };
            again(&question, found).unwrap().explanations[0].held_out
        };
        let mut from_elsewhere = null.clone();
        question.held_out_evidence(&mut from_elsewhere);
        let mut days = from_elsewhere.days.to_vec();
        assert_eq!(days.len(), 1);
        days[0].set_number(Quantity::RateNoise, 1.0);
        from_elsewhere.days = Arc::new(days);
        assert!(held_out(&null).is_some_and(f64::is_finite));
        assert_eq!(held_out(&null), held_out(&from_elsewhere));
    }

    #[test]
    fn what_held_out_records_prefer_is_asked_further_and_effects_in_the_place_of_a_winding() {
        let (one, wound) = (Member::Effect(0), Member::Winding(0));
        let best = judged(vec![one], 100.0, 50.0);
        let keys = |list: Vec<Explanation>| list.iter().map(Explanation::key).collect::<Vec<_>>();
        // What the search ended with needs no more.
        assert!(preferred(std::slice::from_ref(&best), &best).is_empty());
        let further = judged(vec![one, Member::Effect(1)], 101.0, 58.0);
        assert_eq!(keys(preferred(&[further.clone(), best.clone()], &best)), [further.key()]);
        // So is what gave its mass to a smaller one, though it was likelier: another effect in the place of one of it may be certain.
        let list = [best.clone(), further.clone()];
        assert_eq!(keys(preferred(&list, &best)), [further.key()]);
        let behind = judged(vec![one, Member::Effect(1)], 101.0, 48.0);
        assert!(preferred(&[best.clone(), behind], &best).is_empty());
        // In the place of another winding, too, unless it is far behind.
        let rewound = judged(vec![one, wound], 102.0, 60.0);
        let list = [rewound.clone(), further.clone(), best.clone()];
        assert_eq!(keys(preferred(&list, &best)), [rewound.key(), further.key()]);
        let far = judged(vec![one, Member::Effect(1)], 80.0, 55.0);
        assert_eq!(keys(preferred(&[rewound.clone(), far, best.clone()], &best)), [rewound.key()]);
    }
}
