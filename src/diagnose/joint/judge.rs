//! Held-out records, posterior masses, and sets that are as good without some of their members.

use std::cell::OnceCell;
use std::collections::BTreeSet;

use nalgebra::DVector;

use super::adjust::adjust;
use super::back::rest;
use super::explanation::fitted;
use super::odds::{CERTAIN, WINDOW};
use super::parsimony::give_to_smaller;
use super::readings::take_off;
use super::{Explanation, Member, Outcome, Question, Winding};
use crate::chamber::{Column, Effort, Fit};
use crate::parallel::InParallel;

/// Sets that are judged by held-out records at most.
const JUDGED: usize = 8;
/// … and sets whose smaller ones begin again from what was found with them.
const LOOKED_INTO: usize = 3;

/// Two log posteriors whose fits each end to within a tolerance differ by what is known to this.
const KNOWN_TO: f64 = 2.0 * Effort::FULL.tolerance;

/// How far sets are looked into before they are judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Care {
    /// As they were ranked: enough to say in which chamber they are to be judged.
    AsRanked,
    /// Each fitted in full, and smaller ones begun again from the largest.
    InFull,
}

/// Held-out records, posterior masses, and what is as good without some of its members.
///
/// # Errors
/// A set that was fitted and cannot be solved any more.
pub(super) fn judge(
    question: &Question,
    windings: &[Winding],
    explanations: &mut Vec<Explanation>,
    care: Care,
) -> Outcome<()> {
    order(explanations);
    let mut looked_into: BTreeSet<Vec<Member>> = BTreeSet::new();
    if care == Care::InFull {
        let foremost: Vec<Explanation> = explanations.iter().take(LOOKED_INTO).cloned().collect();
        looked_into.extend(foremost.iter().map(Explanation::key));
        take_better(explanations, without_one(question, windings, &foremost));
        order(explanations);
    }
    let least = explanations.first().map_or(0.0, |e| e.merit) - WINDOW;
    keep_asked(explanations, least, !question.held_out.is_empty());
    let assessor = Assessor { question, windings, care, least };
    // The first finds what the held-out records' days were; the others begin there.
    if let Some((first, others)) = explanations.split_first_mut() {
        assessor.assess(first, None);
        assessor.assess_all(others, first);
    }
    let declared = explanations.iter().find(|e| e.members.is_empty()).map(|e| e.fit.clone());
    let readings = OnceCell::new();
    let take_off = |sets: &mut [Explanation]| {
        if let Some(declared) = &declared {
            take_off(question, &readings, declared, sets);
        }
    };
    take_off(explanations);
    order(explanations);
    // What held-out records prefer may be too large as well, and was not near enough to be looked into.
    while care == Care::InFull
        && !question.held_out.is_empty()
        && let Some(first) = explanations.first().cloned()
        && looked_into.insert(first.key())
    {
        let known: BTreeSet<Vec<Member>> = explanations.iter().map(Explanation::key).collect();
        let mut smaller = without_one(question, windings, std::slice::from_ref(&first));
        smaller.retain(|e| !known.contains(&e.key()));
        assessor.assess_all(&mut smaller, &first);
        take_off(&mut smaller);
        explanations.extend(smaller);
        order(explanations);
    }
    adjust(question, explanations)?;
    order(explanations);
    give_masses(question, explanations);
    Ok(())
}

fn order(explanations: &mut [Explanation]) {
    explanations.sort_by(|a, b| b.total().total_cmp(&a.total()).then_with(|| a.key().cmp(&b.key())));
}

/// Sets without one of their members, begun from what was found with it: what a larger set has found of the chamber may be better for
/// a smaller one, too.
fn without_one(question: &Question, windings: &[Winding], sets: &[Explanation]) -> Vec<Explanation> {
    sets.iter()
        .flat_map(|e| (0..e.members.len()).map(move |place| (e, place)))
        .in_parallel()
        .filter_map(|(large, place)| rest(question, windings, large, place, Effort::QUICK))
        .collect()
}

/// Takes sets that are not known, or better than as they are known.
fn take_better(explanations: &mut Vec<Explanation>, others: Vec<Explanation>) {
    for other in others {
        match explanations.iter_mut().find(|e| e.key() == other.key()) {
            Some(known) if other.merit > known.merit => *known = other,
            Some(_) => {}
            None => explanations.push(other),
        }
    }
}

/// Fits sets in full and asks the held-out records, before sets are weighed.
struct Assessor<'h, 'q> {
    question: &'h Question<'q>,
    windings: &'h [Winding],
    care: Care,
    /// The merit from which on a set is near the best of the fitted records.
    least: f64,
}

impl Assessor<'_, '_> {
    fn assess_all(&self, sets: &mut [Explanation], first: &Explanation) {
        let top = of_all_records(first);
        sets.iter_mut().in_parallel().for_each(|e| {
            e.fit.days.clone_from(&first.fit.days);
            self.assess(e, Some(top));
        });
    }

    /// Fits a set that was only ranked in full, and asks the held-out records; what is far from the best by those, too, stays as it is.
    fn assess(&self, e: &mut Explanation, top: Option<f64>) {
        let is_far = e.merit <= self.least && !e.members.is_empty();
        if let Some(top) = top.filter(|_| is_far) {
            // By another best, in another chamber.
            e.understated = 0.0;
            self.ask_held_out(e);
            if of_all_records(e) < top - WINDOW {
                return;
            }
        }
        let begin = e.begin();
        if self.care == Care::InFull
            && !e.fit.is_full()
            && let Some(again) = fitted(self.question, self.windings, e.members.clone(), &begin, &e.fit, Effort::FULL)
            && again.merit > e.merit
        {
            *e = again;
        }
        self.ask_held_out(e);
    }

    fn ask_held_out(&self, e: &mut Explanation) {
        if !self.question.held_out.is_empty() {
            e.held_out = Some(self.question.held_out_evidence(&mut e.fit));
        }
    }
}

/// What fitted and held-out records say, before anything is taken off.
fn of_all_records(e: &Explanation) -> f64 {
    e.merit + e.held_out.unwrap_or(0.0)
}

/// Posterior masses, from the largest set on: its mass goes to the best set within it that is as good, that lacks no news, or that predicts
/// rates better.
fn give_masses(question: &Question, explanations: &mut [Explanation]) {
    let top = explanations.first().map_or(0.0, Explanation::total);
    let masses: Vec<f64> = explanations.iter().map(|e| (e.total() - top).exp()).collect();
    let sum: f64 = masses.iter().sum();
    for (e, mass) in explanations.iter_mut().zip(masses) {
        e.probability = mass / sum;
    }
    let rates: Vec<Option<Rates>> =
        explanations.iter().in_parallel().map(|e| rates(question, e).unwrap_or(None)).collect();
    let sizes: Vec<usize> = explanations.iter().map(|e| e.members.len()).collect();
    let is_no_news = |small: usize, large: usize| {
        let mut more = explanations[large].more_than(&explanations[small]);
        more.all(|m| explanations[large].is_no_news(question.model.effects.len(), m))
    };
    // Within what declared numbers are known to.
    let worth = worth(explanations, is_no_news);
    let mut masses: Vec<f64> = explanations.iter().map(|e| e.probability).collect();
    give_to_smaller(&mut masses, &worth, &sizes, |small, large| {
        let worsens = || {
            let mut more = explanations[large].more_than(&explanations[small]);
            more.all(|m| matches!(m, Member::Effect(_) | Member::Refitted(_)))
                && rates[small].as_ref().zip(rates[large].as_ref()).is_some_and(|(from, to)| {
                    mean_gain(question, &explanations[small].fit, from, to).is_ok_and(is_loss)
                })
        };
        explanations[small].is_within(&explanations[large])
            && (is_as_good(worth[small], worth[large]) || is_no_news(small, large) || worsens())
    });
    explanations.iter_mut().zip(masses).for_each(|(e, mass)| e.probability = mass);
    explanations.sort_by(|a, b| b.probability.total_cmp(&a.probability).then(b.total().total_cmp(&a.total())));
}

/// What each set is worth where those that have more than it, but nothing that is news, are the same set.
fn worth(explanations: &[Explanation], is_no_news: impl Fn(usize, usize) -> bool) -> Vec<f64> {
    let of = |small: usize| {
        let stands_for =
            |large: &usize| explanations[small].is_within(&explanations[*large]) && is_no_news(small, *large);
        let totals = (0..explanations.len()).filter(stands_for).map(|large| explanations[large].total());
        totals.fold(explanations[small].total(), f64::max)
    };
    (0..explanations.len()).map(of).collect()
}

/// Keeps the declared model, the foremost sets whose merit is above the `least`, and, where records are held out, the best of each smaller
/// size: what fitted records need may be what held-out ones refute.
fn keep_asked(explanations: &mut Vec<Explanation>, least: f64, is_held_out: bool) {
    let largest = explanations.first().map_or(0, |e| e.members.len());
    let (mut kept, mut sizes) = (0, BTreeSet::new());
    explanations.retain(|e| {
        kept += 1;
        let size = e.members.len();
        let is_first_of_size = sizes.insert(size);
        size == 0 || (e.merit > least && kept <= JUDGED) || (is_held_out && is_first_of_size && size < largest)
    });
}

/// Whether a smaller set is as good as a larger one that holds it: the larger is not certain beside it, as far as fits know.
fn is_as_good(small: f64, large: f64) -> bool {
    small > large - CERTAIN.log - KNOWN_TO
}

/// A share of the mass below which nothing is named.
const LOOKED_AT: f64 = 0.01;

/// Rates that a set predicts [rad/s] of each of the chamber's records, from readings alone; empty where it was neither fitted nor asked.
type Rates = Vec<Vec<f64>>;

fn rates(question: &Question, explanation: &Explanation) -> Outcome<Option<Rates>> {
    if explanation.probability < LOOKED_AT && !explanation.members.is_empty() {
        return Ok(None);
    }
    let mut all = vec![Vec::new(); question.chamber.records()];
    let fitted = question.fitted.iter().map(|&r| (r, &explanation.fit));
    for (r, fit) in fitted.chain(question.held_out.iter().copied().zip(&*explanation.fit.days)) {
        all[r] = question.chamber.prediction(fit, r)?.rate_rad_per_s;
    }
    Ok(Some(all))
}

/// By how much the log likelihoods of fitted and of held-out rates rise if the rates that a fit predicts are replaced by others and all that is
/// said of noise and air stays as it is, what was fitted apart ([`crate::chamber::Chamber::score`]).
fn mean_gain(question: &Question, fit: &Fit, from: &Rates, to: &Rates) -> Outcome<[f64; 2]> {
    let change = |(from, to): (&Vec<f64>, &Vec<f64>)| -> Vec<f64> {
        from.iter().zip(to).map(|(from, to)| to - from).map(|d| if d.is_finite() { d } else { 0.0 }).collect()
    };
    let column = [Column { rate_rad_per_s: from.iter().zip(to).map(change).collect() }];
    let gain = |fit: &Fit| Ok(question.chamber.score(fit, &column)?.gain_of(&DVector::from_element(1, 1.0)));
    let held_out: Outcome<Vec<f64>> = fit.days.iter().map(gain).collect();
    Ok([gain(fit)?, held_out?.iter().sum()])
}

/// Whether what a set predicts is worse in fitted and in held-out records: what is missing in a coil is seen in one of them.
fn is_loss(gain: [f64; 2]) -> bool {
    gain[0] < 0.0 && gain[1] <= 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chamber::{Assumption, Chamber};
    use crate::diagnose::candidate::candidates;
    use crate::diagnose::experiment::fixtures::{effect, model, pattern};
    use crate::diagnose::joint::with;
    use crate::diagnose::tests::{bare_day, of_first_record};

    fn of(effects: &[usize], merit: f64) -> Explanation {
        let fit = Fit::to_nothing(Assumption::new(model(Vec::new()), pattern()), Vec::new(), 1e-7);
        let members = effects.iter().copied().map(Member::Effect).collect();
        let (held_out, in_readings, understated, probability) = (None, 0.0, 0.0, 0.0);
        Explanation { members, fit, merit, held_out, in_readings, understated, probability }
    }

    /// Fitted records need four effects, by 150; held-out ones may refute all but the first.
    #[test]
    fn where_records_are_held_out_the_best_of_each_smaller_size_is_asked() {
        let all = [
            of(&[0, 1, 2, 3], 400.0),
            of(&[0, 1, 2, 4], 395.0),
            of(&[0, 1, 2, 5], 350.0),
            of(&[0, 1, 2], 330.0),
            of(&[0, 1], 270.0),
            of(&[0, 2], 265.0),
            of(&[0], 250.0),
            of(&[], 0.0),
        ];
        let kept = |is_held_out: bool| {
            let mut sets = all.to_vec();
            keep_asked(&mut sets, 400.0 - WINDOW, is_held_out);
            sets.iter().map(|e| e.merit).collect::<Vec<f64>>()
        };
        assert_eq!(kept(true), [400.0, 395.0, 330.0, 270.0, 250.0, 0.0]);
        assert_eq!(kept(false), [400.0, 395.0, 0.0]);
    }

    /// A record of nothing was answered by an offset of the middle, where dn/dT that is less than 1 % off does as well.
    #[test]
    fn a_set_is_worth_what_it_is_with_declared_numbers_as_far_off_as_they_may_be() {
        // {}, {dn/dT}, {offset}, {offset, dn/dT}.
        let all = [of(&[], 0.0), of(&[0], 20.0), of(&[1], 20.2), of(&[1, 0], 21.0)];
        let is_no_news = |small: usize, large: usize| all[large].more_than(&all[small]).all(|m| m == Member::Effect(0));
        assert_eq!(worth(&all, is_no_news), [20.0, 20.0, 21.0, 21.0]);
        assert_eq!(worth(&all, |small, large| small == large), [0.0, 20.0, 20.2, 21.0]);
        // … the offset then goes to nothing, which it did not.
        assert!(is_as_good(20.0, 21.0) && !is_as_good(0.0, 20.2));
    }

    /// A record with one effect was answered by two: the second was certain by 0.04, which another end of the same fits undid.
    #[test]
    fn a_larger_set_is_certain_beside_a_smaller_one_only_by_more_than_fits_leave_open() {
        assert!(is_as_good(63_678.89, 63_681.87) && is_as_good(1.0, 0.0));
        assert!(!is_as_good(0.0, CERTAIN.log + 2.0 * KNOWN_TO));
    }

    #[test]
    fn rates_of_what_is_hidden_gain_and_those_without_it_lose() {
        let hidden = effect("midpoint_offset", &[0.1]);
        let declared = model(Vec::new());
        let records = [3, 4].map(|seed| bare_day(&model(vec![hidden.clone()]), 20.0, seed));
        let pattern = pattern();
        let assumed = Assumption::new(declared.clone(), pattern.clone());
        let (chamber, null) =
            Chamber::new(&declared, &[&records[0], &records[1]]).unwrap().with_shocks(&assumed, &[0]).unwrap();
        let candidates = candidates(&declared, &[&records[0], &records[1]]);
        let question = of_first_record(&chamber, &declared, &pattern, &candidates, 1);
        let place = Member::Effect(candidates.iter().position(|c| c.kind() == "midpoint_offset").unwrap());
        let begin = with(&question, &[], &null, place, Some(hidden.values().to_vec())).unwrap();
        let without = Explanation::new(&question, &[], Vec::new(), null.clone());
        let found = fitted(&question, &[], vec![place], &begin, &null, Effort::QUICK).unwrap();
        let [without, found] = [without, found].map(|mut explanation| {
            question.held_out_evidence(&mut explanation.fit);
            Explanation { probability: 1.0, ..explanation }
        });
        let of = |explanation: &Explanation| rates(&question, explanation).unwrap().unwrap();
        let gain = mean_gain(&question, &without.fit, &of(&without), &of(&found)).unwrap();
        let loss = mean_gain(&question, &found.fit, &of(&found), &of(&without)).unwrap();
        assert!(gain.iter().all(|g| *g > 10.0) && loss.iter().all(|g| *g < -10.0), "{gain:?} {loss:?}");
        assert!(is_loss(loss) && !is_loss(gain));
    }

    #[test]
    fn what_predicts_fitted_and_held_out_rates_worse_is_a_loss_and_what_predicts_either_better_is_not() {
        assert!(is_loss([-1.0, -2.0]));
        assert!(!is_loss([-1.0, 2.0]) && !is_loss([1.0, -2.0]));
        // Nothing held out.
        assert!(is_loss([-1.0, 0.0]) && !is_loss([1.0, 0.0]));
    }
}
