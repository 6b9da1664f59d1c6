//! What is tried beside a set: what promises most, and what no score test sees.

use std::collections::BTreeMap;

use super::explanation::{Begin, fitted, in_order, with};
use super::screen::{Proposal, WORTH_A_FIT};
use super::{Explanation, Member, Question, Winding};
use crate::chamber::{Effort, Fit, Quantity};
use crate::numeric::order::sort_descending;
use crate::parallel::InParallel;

/// Members that are fitted after each score test, as far as they promise [`WORTH_A_FIT`] …
pub(super) const TRIED: usize = 8;
/// … and this share of what the first does, or, where a short fit was made, what that gained: a long one has brought up to twice as much.
const WORTH_BESIDE: f64 = 0.08;
const WORTH_A_LONG_FIT: f64 = 0.25;
/// An effect that gains so much needs no comparison with a mere wander yet.
const PLAIN: f64 = 25.0;
/// Another winding that promises less than this share of the most is not fitted from several chambers.
const MAY_WIN: f64 = 1.0 / 3.0;
/// Periods of a cycle and times of an offset step, as shares of the record.
const CYCLES: [f64; 3] = [0.06, 0.15, 0.4];
const STEPS: usize = 60;

/// What promises most beside a set, fitted, best first; where none of it is plain, also what says that something else is there.
pub(super) fn tried(
    question: &Question,
    windings: &[Winding],
    best: &Explanation,
    proposals: Vec<Proposal>,
) -> Vec<Explanation> {
    let mut found = fit_all(question, windings, best, choose(proposals));
    let most = found.iter().map(|e| e.merit - best.merit).fold(0.0, f64::max);
    if most < PLAIN {
        found.extend(fit_all(question, windings, best, outside(best)));
    }
    found.sort_by(in_order);
    found
}

/// Members that are no effects of the catalogue. What cannot be scored is fitted wherever something is missing.
pub(super) fn discrete(question: &Question, windings: &[Winding], best: &Explanation) -> Vec<Proposal> {
    let mut all = Vec::new();
    let mut add = |member: Member, gain: f64| {
        if !best.members.contains(&member) {
            all.push(Proposal { member, values: None, gain, short: None });
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
    all.map(|member| Proposal { member, values: None, gain: f64::INFINITY, short: None }).collect()
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
    Some(Proposal { member: Member::Step { record, row }, values: None, gain, short: None })
}

/// The most promising proposals, one start a member, two where they promise nearly the same.
pub(super) fn choose(mut proposals: Vec<Proposal>) -> Vec<Proposal> {
    sort_descending(&mut proposals, |item| item.gain);
    let first = proposals.iter().map(|p| p.gain).filter(|g| g.is_finite()).fold(0.0, f64::max);
    let mut seen: BTreeMap<Member, usize> = BTreeMap::new();
    let mut scored = 0;
    proposals.retain(|p| {
        let share = if p.short.is_some() { WORTH_A_LONG_FIT } else { WORTH_BESIDE };
        if !(p.gain > WORTH_A_FIT.max(share * first)) {
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
        .in_parallel()
        .filter_map(|proposal| {
            let mut members = best.members.clone();
            members.push(proposal.member);
            let begin = with(question, windings, &best.fit, proposal.member, proposal.values)?;
            if proposal.member == Member::Cycle {
                let longest = question.fitted.iter().map(|&r| duration_s(question, r)).fold(0.0, f64::max);
                let starts = CYCLES.map(|share| moved(&best.fit, Quantity::CyclePeriod, share * longest));
                return from_the_best(question, windings, &members, &begin, &starts.each_ref(), None);
            }
            // Wander that stood for what was missing may stay where it is: each begins without it, too.
            let starts: &[&Fit] = if proposal.short.is_some() { &[&best.fit] } else { &[&best.fit, &calm] };
            let known = from_the_best(question, windings, &members, &begin, starts, proposal.short);
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

/// A set fitted from whichever start a short fit leads furthest from, or led as `known`.
fn from_the_best(
    question: &Question,
    windings: &[Winding],
    members: &[Member],
    begin: &Begin,
    starts: &[&Fit],
    known: Option<Fit>,
) -> Option<Explanation> {
    let short = starts.iter().in_parallel().filter_map(|from| {
        let members = members.to_vec();
        fitted(question, windings, members, begin, from, Effort::SHORT)
    });
    let known = known.map(|fit| Explanation::new(question, windings, members.to_vec(), fit));
    let short: Vec<Explanation> = short.collect();
    let best = short.into_iter().chain(known).max_by(|a, b| a.merit.total_cmp(&b.merit))?;
    fitted(question, windings, members.to_vec(), &best.begin(), &best.fit, Effort::QUICK)
}

/// A set once more from a gyro that does not wander, and with the lags of a stage and of the pack in the other order: with less missing there may be
/// a better maximum there.
pub(super) fn from_other_days(question: &Question, windings: &[Winding], known: Explanation) -> Explanation {
    let mut calm = known.fit.clone();
    calm.calm(&question.fitted);
    // Lags that cannot be exchanged speak for those that were found.
    let exchanged = question.chamber.with_lags_exchanged(&known.fit).unwrap_or_default();
    let starts: Vec<&Fit> = [&known.fit, &calm].into_iter().chain(&exchanged).collect();
    let begin = known.begin();
    let further = starts
        .in_parallel()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chamber::Assumption;
    use crate::diagnose::experiment::fixtures::{model, pattern};

    #[test]
    fn what_a_short_fit_leaves_far_behind_is_fitted_no_further_than_a_score_that_may_be_wrong() {
        let short = Fit::to_nothing(Assumption::new(model(Vec::new()), pattern()), Vec::new(), 1e-7);
        let proposal = |effect: usize, gain: f64, is_fitted: bool| Proposal {
            member: Member::Effect(effect),
            values: None,
            gain,
            short: is_fitted.then(|| short.clone()),
        };
        let chosen = choose(vec![
            proposal(0, 100.0, true),
            proposal(1, 10.0, true),
            proposal(2, 10.0, false),
            proposal(3, 30.0, true),
            proposal(4, 2.0, false),
        ]);
        let members: Vec<Member> = chosen.iter().map(|p| p.member).collect();
        assert_eq!(members, [0, 3, 2].map(Member::Effect));
        // Nothing else says what is there: then a small promise is worth a fit.
        assert_eq!(choose(vec![proposal(1, 10.0, true)]).len(), 1);
    }
}
