//! The search: score test over everything that may be missing, fits of what promises most, forward and back.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::explanation::{fitted, with, without};
use super::judge::{Care, judge};
use super::odds::{CERTAIN, WINDING, WINDOW};
use super::own_air::{best_by_own_air, best_by_own_kinks};
use super::screen::{Proposal, foremost, looked_at, proposals};
use super::winding::{promise_beside, promising};
use super::{Explanation, Found, Member, Outcome, Question, Winding};
use crate::chamber::{Assumption, Effort, Fit, Free, Quantity};

/// Members that are fitted after each score test, as far as they promise this much …
const TRIED: usize = 8;
const WORTH_A_FIT: f64 = 3.0;
/// … and this share of what the first does.
const WORTH_BESIDE: f64 = 0.08;
/// An effect that gains so much needs no comparison with a mere wander yet.
const PLAIN: f64 = 25.0;
/// … and one that gains so much may stand for another winding: what that costs beforehand, and what makes it certain.
const MAY_BE_WOUND: f64 = CERTAIN.log - WINDING.log;
/// Another winding that promises less than this share of the most is not fitted from several chambers.
const MAY_WIN: f64 = 1.0 / 3.0;
/// A set must be better by so much to go on from: what is better by less gives its mass to the smaller one.
const WORTH_A_STEP: f64 = CERTAIN.log;
/// What a score test on records that were only judged by must promise for them to be searched themselves: what an effect costs, twice.
const PROMISING: f64 = 12.0;
/// Periods of a cycle and times of an offset step, as shares of the record.
const CYCLES: [f64; 3] = [0.06, 0.15, 0.4];
const STEPS: usize = 60;

/// Where a fit begins: what is assumed, and what of its effects is free.
type Begin = (Assumption, Vec<Free>);

/// Sets that were fitted, by their members.
type Cache = BTreeMap<Vec<Member>, Explanation>;

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
    let null = Explanation::new(question, &[], Vec::new(), day.clone());
    let most = proposals(question, &null)?.iter().map(|p| p.gain).fold(0.0, f64::max);
    if most <= PROMISING {
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

/// Searches sets of explanations, and ranks them: from the declared model, and from another heat path that its candidates give it, if one may be
/// the coil's. What else is missing hangs on which it is.
///
/// # Errors
/// As [`search_if_it_promises`].
pub(crate) fn ranked(question: &Question, null: Fit, progress: &(dyn Fn(f64) + Sync)) -> Outcome<Found> {
    progress(0.2);
    let declared = Explanation::new(question, &[], Vec::new(), null);
    let mut cache = Cache::new();
    cache.insert(declared.key(), declared.clone());
    let (_, best, found) =
        ranked_from(question, declared.clone(), cache.clone(), &|share| progress(0.2 + 0.4 * share))?;
    let other = best_by_own_air(question, &declared).filter(|own| own.merit > declared.merit - WINDOW);
    let Some(other) = other else { return Ok(found) };
    progress(0.6);
    let there = Question { chamber: &other.chamber, ..question.clone() };
    let mut cache = carried(&there, &[], cache);
    let price = other.explanation.merit - other.merit;
    keep(&mut cache, other.explanation.clone());
    let path = other.explanation.members.clone();
    let (best_there, worth, found_there) =
        ranked_from(&there, other.explanation, cache, &|share| progress(0.6 + 0.4 * share))?;
    // Without the other path in the end it has only gone astray.
    let is_by_it = path.iter().all(|m| best_there.members.contains(m));
    Ok(if is_by_it && worth - price > best { Found { is_elsewhere: true, ..found_there } } else { found })
}

/// Forward and back from a set: the best, what it is worth less what the kinks of its own air cost, and all.
fn ranked_from(
    question: &Question,
    mut best: Explanation,
    mut cache: Cache,
    progress: &(dyn Fn(f64) + Sync),
) -> Outcome<(Explanation, f64, Found)> {
    let mut windings: Vec<Winding> = Vec::new();
    let mut promised = Vec::new();
    let mut chamber = question.chamber.clone();
    let mut is_elsewhere = false;
    let mut price = 0.0;
    for stage in 0..question.depth {
        let here = Question { chamber: &chamber, ..question.clone() };
        let mut proposals = looked_at(&here, &best)?;
        if stage == 0 {
            // Where nothing promises what would make another winding certain, nothing is wound otherwise.
            if best.is_outside() || proposals.iter().any(|p| p.gain > MAY_BE_WOUND) {
                windings = promising(&here, &best.fit)?;
            }
            promised = foremost(&proposals);
        } else if !best.has_winding() {
            // Beside what has been found since, another winding is worth something else.
            promise_beside(&here, &best.fit, &mut windings);
        }
        proposals.extend(discrete(&here, &windings, &best));
        let found = tried(&here, &windings, &best, proposals);
        progress((stage + 1) as f64 / question.depth as f64);
        let foremost = found.iter().find(|e| !e.is_beyond_physical()).cloned();
        let own = best_by_own_kinks(&chamber, &here, &windings, &found);
        found.into_iter().for_each(|explanation| keep(&mut cache, explanation));
        let base = cache.get(&best.key()).map_or(best.merit, |b| b.merit);
        let least = foremost.as_ref().map_or(base, |f| f.merit.max(base)) + WORTH_A_STEP;
        let next = match own.filter(|own| own.merit > least) {
            Some(own) => {
                price += own.explanation.merit - own.merit;
                chamber = own.chamber;
                is_elsewhere = true;
                cache = carried(&Question { chamber: &chamber, ..question.clone() }, &windings, cache);
                own.explanation
            }
            None => match foremost {
                Some(next) => next,
                None => break,
            },
        };
        let here = Question { chamber: &chamber, ..question.clone() };
        let next = calmed(&here, &windings, next);
        keep(&mut cache, next.clone());
        // What was fitted with the larger set may be a better chamber for the smaller one.
        if let Some(again) = refit_without_last(&here, &windings, &next) {
            keep(&mut cache, again);
        }
        let base = cache.get(&best.key()).map_or(best.merit, |b| b.merit);
        if next.merit < base + WORTH_A_STEP {
            break;
        }
        best = look_back(&here, &windings, next, &mut cache);
        if best.members.iter().any(|m| m.is_outside()) {
            break;
        }
    }
    let here = Question { chamber: &chamber, ..question.clone() };
    complete(&here, &windings, &best, &mut cache);
    let mut explanations: Vec<Explanation> = cache.into_values().collect();
    judge(&here, &windings, &mut explanations, Care::AsRanked)?;
    let worth = best.merit - price;
    Ok((best, worth, Found { explanations, promised, windings, is_elsewhere }))
}

/// What was found, judged again in a chamber that is looked through with the best of it ([`crate::chamber::Chamber::with_timed_shocks_by`]).
///
/// # Errors
/// A declared model that cannot be solved for these records.
pub(crate) fn again(question: &Question, found: Found) -> Outcome<Found> {
    let Found { explanations, promised, windings, .. } = found;
    let mut explanations: Vec<Explanation> = explanations
        .into_par_iter()
        .filter_map(|e| {
            let begin = (e.fit.assumed.clone(), e.fit.free.clone());
            fitted(question, &windings, e.members, &begin, &e.fit, Effort::FULL)
        })
        .collect();
    judge(question, &windings, &mut explanations, Care::InFull)?;
    let has_declared = explanations.iter().any(|e| e.members.is_empty());
    has_declared
        .then_some(Found { explanations, promised, windings, is_elsewhere: false })
        .ok_or(crate::chamber::ChamberError::Unsolvable)
}

/// What promises most beside a set, fitted, best first; where none of it is plain, also what says that something else is there.
fn tried(question: &Question, windings: &[Winding], best: &Explanation, proposals: Vec<Proposal>) -> Vec<Explanation> {
    let mut found = fit_all(question, windings, best, choose(proposals));
    let most = found.iter().map(|e| e.merit - best.merit).fold(0.0, f64::max);
    if most < PLAIN {
        found.extend(fit_all(question, windings, best, outside(best)));
    }
    found.sort_by(in_order);
    found
}

/// Best first.
fn in_order(a: &Explanation, b: &Explanation) -> std::cmp::Ordering {
    b.merit.total_cmp(&a.merit).then_with(|| a.key().cmp(&b.key()))
}

fn keep(cache: &mut Cache, explanation: Explanation) {
    let key = explanation.key();
    if cache.get(&key).is_none_or(|known| explanation.merit > known.merit) {
        cache.insert(key, explanation);
    }
}

/// What was found in one chamber in another: the declared model and the best.
fn carried(question: &Question, windings: &[Winding], cache: Cache) -> Cache {
    let mut all: Vec<Explanation> = cache.into_values().collect();
    all.sort_by(in_order);
    let mut kept = 0;
    all.retain(|e| {
        kept += 1;
        e.members.is_empty() || kept <= TRIED
    });
    let there = all.into_par_iter().filter_map(|e| {
        let begin = (e.fit.assumed.clone(), e.fit.free.clone());
        fitted(question, windings, e.members, &begin, &e.fit, Effort::QUICK)
    });
    there.map(|e| (e.key(), e)).collect()
}

/// Members that are no effects of the catalogue. What cannot be scored is fitted wherever something is missing.
fn discrete(question: &Question, windings: &[Winding], best: &Explanation) -> Vec<Proposal> {
    let mut all = Vec::new();
    let mut add = |member: Member, gain: f64| {
        if !best.members.contains(&member) {
            all.push(Proposal { member, values: None, gain });
        }
    };
    if !best.has_winding() {
        windings.iter().enumerate().for_each(|(w, winding)| add(Member::Winding(w), winding.promised));
    }
    for (effect, declared) in question.model.effects.iter().enumerate() {
        if declared.values().iter().any(|v| *v != 0.0) {
            add(Member::Refitted(effect), f64::INFINITY);
        }
    }
    all.extend(steps(question, best));
    all
}

/// Members that say that something else is there.
fn outside(best: &Explanation) -> Vec<Proposal> {
    let all = [Member::Drift, Member::Cycle].into_iter().filter(|m| !best.members.contains(m));
    all.map(|member| Proposal { member, values: None, gain: f64::INFINITY }).collect()
}

/// The most promising step of the offset.
fn steps(question: &Question, best: &Explanation) -> Option<Proposal> {
    let chamber = question.chamber;
    let places: Vec<(usize, usize)> = question
        .fitted
        .iter()
        .flat_map(|&r| {
            let rows = chamber.times_s(r).len();
            (1..STEPS).map(move |i| (r, i * rows / STEPS)).filter(|(_, row)| *row > 2)
        })
        .collect();
    let scan = |places: &[(usize, usize)]| -> Option<(f64, (usize, usize))> {
        let columns: Vec<_> = places.iter().map(|&(r, row)| crate::chamber::Column::step(chamber, r, row)).collect();
        let scores = chamber.score(&best.fit, &columns).ok()?;
        let gains = places.iter().enumerate().map(|(i, place)| (scores.gain(i).0, *place));
        gains.max_by(|a, b| a.0.total_cmp(&b.0))
    };
    let (coarse, (record, row)) = scan(&places)?;
    if coarse < WORTH_A_FIT {
        return None;
    }
    let rows = chamber.times_s(record).len();
    let width = (rows / STEPS).max(1);
    let from = row.saturating_sub(width).max(2);
    let fine: Vec<(usize, usize)> = (from..(row + width).min(rows - 1)).map(|k| (record, k)).collect();
    let (gain, (record, row)) = scan(&fine)?;
    Some(Proposal { member: Member::Step { record, row }, values: None, gain })
}

/// The most promising proposals, one start a member, two where they promise nearly the same.
fn choose(mut proposals: Vec<Proposal>) -> Vec<Proposal> {
    proposals.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let first = proposals.iter().map(|p| p.gain).filter(|g| g.is_finite()).fold(0.0, f64::max);
    let least = WORTH_A_FIT.max(WORTH_BESIDE * first);
    let mut seen: BTreeMap<Member, usize> = BTreeMap::new();
    let mut scored = 0;
    proposals.retain(|p| {
        if !(p.gain > least) {
            return false;
        }
        let times = seen.entry(p.member).or_insert(0);
        *times += 1;
        // Other windings were chosen before, by a fit each.
        let is_scored = p.gain.is_finite() && !matches!(p.member, Member::Winding(_));
        if is_scored && *times == 1 {
            scored += 1;
        }
        *times == 1 && (!is_scored || scored <= TRIED)
    });
    proposals
}

fn fit_all(question: &Question, windings: &[Winding], best: &Explanation, tried: Vec<Proposal>) -> Vec<Explanation> {
    let mut calm = best.fit.clone();
    calm.calm(&question.fitted);
    let most = tried.iter().map(|p| p.gain).filter(|g| g.is_finite()).fold(0.0, f64::max);
    tried
        .into_par_iter()
        .filter_map(|proposal| {
            let mut members = best.members.clone();
            members.push(proposal.member);
            let begin = with(question, windings, &best.fit, proposal.member, proposal.values)?;
            if proposal.member == Member::Cycle {
                let longest = question.fitted.iter().map(|&r| duration_s(question, r)).fold(0.0, f64::max);
                let starts = CYCLES.map(|share| moved(&best.fit, Quantity::CyclePeriod, share * longest));
                return from_the_best(question, windings, &members, &begin, &starts.each_ref());
            }
            // Wander that stood for what was missing may stay where it is: each begins without it, too.
            let known = from_the_best(question, windings, &members, &begin, &[&best.fit, &calm]);
            let is_better = known.as_ref().is_some_and(|k| k.merit > best.merit);
            if !matches!(proposal.member, Member::Winding(_)) || !is_better || proposal.gain < MAY_WIN * most {
                return known;
            }
            // The chamber that made the best of the declared winding is far from that of the right one.
            let again = question.chamber.fit_anew(&begin.0, &begin.1, &question.fitted).ok();
            let again = again.map(|fit| Explanation::new(question, windings, members, fit));
            known.into_iter().chain(again).max_by(|a, b| a.merit.total_cmp(&b.merit))
        })
        .collect()
}

/// A set fitted from whichever start a short fit leads furthest from.
fn from_the_best(
    question: &Question,
    windings: &[Winding],
    members: &[Member],
    begin: &Begin,
    starts: &[&Fit],
) -> Option<Explanation> {
    let short = starts.par_iter().filter_map(|from| {
        let members = members.to_vec();
        fitted(question, windings, members, begin, from, Effort::SHORT)
    });
    let best = short.max_by(|a, b| a.merit.total_cmp(&b.merit))?;
    let begin = (best.fit.assumed.clone(), best.fit.free.clone());
    fitted(question, windings, members.to_vec(), &begin, &best.fit, Effort::QUICK)
}

/// A set once more from a gyro that does not wander: with less missing there may be a better maximum there.
fn calmed(question: &Question, windings: &[Winding], known: Explanation) -> Explanation {
    let mut start = known.fit.clone();
    start.calm(&question.fitted);
    let begin = (known.fit.assumed.clone(), known.fit.free.clone());
    let further = [&known.fit, &start]
        .into_par_iter()
        .filter_map(|from| fitted(question, windings, known.members.clone(), &begin, from, Effort::FULL));
    let further: Vec<Explanation> = further.collect();
    further.into_iter().fold(known, |best, again| if again.merit > best.merit { again } else { best })
}

fn duration_s(question: &Question, record: usize) -> f64 {
    let times = question.chamber.times_s(record);
    times[times.len() - 1] - times[0]
}

fn moved(fit: &Fit, quantity: Quantity, value: f64) -> Fit {
    let mut fit = fit.clone();
    fit.set_number(quantity, value);
    fit
}

/// The set before its last member, beginning with the chamber that was found with it.
fn refit_without_last(question: &Question, windings: &[Winding], next: &Explanation) -> Option<Explanation> {
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
fn look_back(question: &Question, windings: &[Winding], mut best: Explanation, cache: &mut Cache) -> Explanation {
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
fn complete(question: &Question, windings: &[Winding], best: &Explanation, cache: &mut Cache) {
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
    }));
    let fits = proposals.into_par_iter().filter_map(|p| {
        let begin = with(question, &[], base, p.member, p.values)?;
        fitted(question, &[], vec![p.member], &begin, base, Effort::QUICK)
    });
    let fits: Vec<Explanation> = fits.collect();
    let best = fits.into_iter().max_by(|a, b| a.merit.total_cmp(&b.merit))?;
    Some(calmed(question, &[], best))
}
