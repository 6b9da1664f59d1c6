//! The score test: what each effect of the catalogue promises beside a fit, and where a fit with it should begin.

use std::collections::{BTreeMap, BTreeSet};

use super::explanation::with;
use super::{Explanation, Member, Outcome, Question};
use crate::chamber::{Assumption, Effort, Fit};
use crate::diagnose::candidate::Candidate;
use crate::effect::DeclaredEffect;
use crate::numeric::order::sort_descending;
use crate::parallel::InParallel;
use crate::units::Unit;

/// A direction is looked at so near to the fit, as a share of the start: a layer that is five per cent off multiplies what the
/// air's turbulence does to the rate, and such variances hide what its mean explains.
const TESTED_SHARE: f64 = 0.02;
/// Where the score test promises more, its order is not to be relied on: each is fitted …
const LARGE: f64 = 25.0;
/// … and so many of those that promise this share of the most, all layers of a coil among them.
const CLOSE: f64 = 0.5;
const LOOKED_AT: usize = 40;
/// What is fitted at all, shortly or at length, promises so much.
pub(super) const WORTH_A_FIT: f64 = 3.0;
/// Layers whose halves lie on the same side differ little; what was not fitted to tells them apart.
const LAYERS_TRIED: usize = 3;

/// One more member, where its fit begins, and what the score test promises.
#[derive(Debug, Clone)]
pub(in crate::diagnose) struct Proposal {
    pub(crate) member: Member,
    pub(crate) values: Option<Vec<f64>>,
    pub(crate) gain: f64,
    /// What a short fit with it from a gyro that does not wander came to, where one was made.
    pub(super) short: Option<Fit>,
}

/// The score test of every candidate from each of its starts; of what every layer has one for, the best layer's.
pub(in crate::diagnose) fn proposals(question: &Question, best: &Explanation) -> Outcome<Vec<Proposal>> {
    proposals_along(question, best, &|_, _| true)
}

/// The same, where an assumption with a candidate differs by more than that effect: `along` changes the rest, and says
/// whether it is looked at.
pub(in crate::diagnose) fn proposals_along(
    question: &Question,
    best: &Explanation,
    along: &(dyn Fn(&Candidate, &mut Assumption) -> bool + Sync),
) -> Outcome<Vec<Proposal>> {
    Ok(best_layers(question, scored(question, best, along)?, 1))
}

/// The same, and where something large is missing a short fit of each that promises anything: the score test then says alike of
/// whatever follows the mean rate, and little of what comes and goes, because the gyro's wander stands for all of it. What has no
/// number that could be small (a pack that ends) is no direction, so it is fitted whatever is missing.
pub(super) fn looked_at(question: &Question, best: &Explanation) -> Outcome<Vec<Proposal>> {
    let mut all = scored(question, best, &|_, _| true)?;
    sort_descending(&mut all, |item| item.gain);
    let most = all.first().map_or(0.0, |p| p.gain);
    let least = if most > LARGE { WORTH_A_FIT } else { f64::INFINITY };
    let foremost = are_best_layers(question, &all, LAYERS_TRIED);
    let is_whole =
        |p: &Proposal| matches!(p.member, Member::Effect(place) if question.candidates[place].free.is_empty());
    let mut seen = BTreeSet::new();
    let is_close = |i: &usize| all[*i].gain > LARGE.max(CLOSE * most) && seen.insert(all[*i].member);
    let mut asked: Vec<usize> = (0..all.len()).filter(is_close).take(LOOKED_AT).collect();
    let others = (0..all.len()).filter(|&i| (foremost[i] && all[i].gain > least) || is_whole(&all[i]));
    asked.extend(others.filter(|&i| seen.insert(all[i].member)));
    let mut calm = best.fit.clone();
    calm.calm(&question.fitted);
    let shorts: Vec<(usize, Fit)> = asked
        .in_parallel()
        .filter_map(|i| {
            let (assumed, free) = with(question, &[], &best.fit, all[i].member, all[i].values.clone())?;
            let there = question.chamber.fit(&assumed, &free, &question.fitted, Some(&calm), Effort::SHORT).ok()?;
            Some((i, there))
        })
        .collect();
    for (i, short) in shorts {
        all[i].gain = all[i].gain.max(short.posterior() - best.fit.posterior());
        all[i].short = Some(short);
    }
    Ok(best_layers(question, all, LAYERS_TRIED))
}

/// A candidate from one of its starts, so near to a fit that what it adds is a direction.
pub(in crate::diagnose) struct TestedStart {
    place: usize,
    start: Vec<f64>,
    /// Of the start, where it is looked at.
    share: f64,
    /// The least and the largest multiple of the start that may be.
    range: (f64, f64),
    pub(crate) assumed: Assumption,
}

impl TestedStart {
    /// Multiples of what was looked at that may be.
    pub(in crate::diagnose) fn range(&self) -> (f64, f64) {
        (self.range.0 / self.share, self.range.1 / self.share)
    }

    /// How many parameters a fit with it has more.
    pub(in crate::diagnose) fn free_parameters(&self, question: &Question) -> usize {
        question.candidates[self.place].free.len()
    }

    /// Where a fit with so many times what was looked at begins.
    pub(in crate::diagnose) fn proposal(&self, question: &Question, gain: f64, amplitude: f64) -> Proposal {
        let candidate = &question.candidates[self.place];
        let values = scaled(&candidate.effect, &candidate.free, &self.start, amplitude * self.share);
        Proposal { member: Member::Effect(self.place), values: Some(values), gain, short: None }
    }
}

/// Every candidate that a set lacks, from each of its starts; `along` changes the rest of an assumption, and says whether it is looked at.
pub(in crate::diagnose) fn tested_starts(
    question: &Question,
    best: &Explanation,
    along: &(dyn Fn(&Candidate, &mut Assumption) -> bool + Sync),
) -> Vec<TestedStart> {
    let mut asked: Vec<(usize, Vec<f64>)> = Vec::new();
    for (place, candidate) in question.candidates.iter().enumerate() {
        let there = best.members.iter().any(|m| match m {
            Member::Effect(own) => question.candidates[*own].kind() == candidate.kind(),
            _ => false,
        });
        // With a default a parameter joins only once the effect is there.
        let fuller = question.candidates[..place].iter().any(|c| candidate.is_fuller_than(c));
        if !there && !fuller {
            asked.extend(candidate.starts.iter().map(|start| (place, start.clone())));
        }
    }
    let direction = |(place, start): (usize, Vec<f64>)| {
        let candidate = &question.candidates[place];
        let (effect, free) = (&candidate.effect, &candidate.free);
        let (share, values) = match is_sized(effect, free) {
            true => (TESTED_SHARE, scaled(effect, free, &start, TESTED_SHARE)),
            false => (1.0, start.clone()),
        };
        let (mut assumed, _) = with(question, &[], &best.fit, Member::Effect(place), Some(values))?;
        let range = range(effect, free);
        along(candidate, &mut assumed).then_some(TestedStart { place, start, share, range, assumed })
    };
    asked.in_parallel().filter_map(direction).collect()
}

fn scored(
    question: &Question,
    best: &Explanation,
    along: &(dyn Fn(&Candidate, &mut Assumption) -> bool + Sync),
) -> Outcome<Vec<Proposal>> {
    let directions = tested_starts(question, best, along);
    let changed: Vec<&Assumption> = directions.iter().map(|d| &d.assumed).collect();
    let scores = question.chamber.score_models(&best.fit, &changed)?;
    let scored = directions.iter().zip(scores).filter_map(|(direction, score)| {
        let (least, most) = direction.range();
        let (gain, amplitude) = score?.gain(least, most);
        Some(direction.proposal(question, gain, amplitude))
    });
    Ok(scored.collect())
}

/// Of what every layer has a candidate for, only the layers that promise most: their neighbours look alike.
fn best_layers(question: &Question, proposals: Vec<Proposal>, count: usize) -> Vec<Proposal> {
    let kept = are_best_layers(question, &proposals, count);
    proposals.into_iter().zip(kept).filter_map(|(p, keep)| keep.then_some(p)).collect()
}

fn are_best_layers(question: &Question, proposals: &[Proposal], count: usize) -> Vec<bool> {
    let candidate = |p: &Proposal| match p.member {
        Member::Effect(place) => Some(&question.candidates[place]).filter(|c| c.is_of_layer()),
        _ => None,
    };
    let is_outdone = |p: &Proposal| {
        candidate(p).is_some_and(|own| {
            let of_kind = |o: &&Proposal| candidate(o).is_some_and(|c| c.kind() == own.kind());
            proposals.iter().filter(of_kind).filter(|o| o.gain > p.gain).count() >= count
        })
    };
    proposals.iter().map(|p| !is_outdone(p)).collect()
}

/// Multiples of a start that a score test may look for: either sign where the parameter has both.
fn range(effect: &DeclaredEffect, free: &[usize]) -> (f64, f64) {
    let parameters = effect.parameters();
    if free.iter().any(|&i| parameters[i].lower < 0.0 && parameters[i].unit != Unit::Celsius) {
        (-100.0, 100.0)
    } else if free.iter().any(|&i| parameters[i].unit == Unit::One) {
        (-4.0, 4.0)
    } else {
        (0.0, 2.0)
    }
}

/// Whether a start can be made smaller, down to nothing.
fn is_sized(effect: &DeclaredEffect, free: &[usize]) -> bool {
    let mut free =
        effect.parameters().into_iter().enumerate().filter(|(i, p)| free.contains(i) && p.unit != Unit::Celsius);
    free.any(|(_, p)| p.lower < 0.0 || (p.unit == Unit::One && p.lower > 0.0))
}

/// A start moved to where the score test wants it; what only has an order stays where it is.
fn scaled(effect: &DeclaredEffect, free: &[usize], start: &[f64], amplitude: f64) -> Vec<f64> {
    let parameters = effect.parameters();
    let mut values = start.to_vec();
    for &i in free {
        let p = &parameters[i];
        if p.unit == Unit::Celsius {
            continue;
        }
        // A parameter without a bound, such as a channel's gain, has nothing to keep away from.
        let inset = if (p.upper - p.lower).is_finite() { 1e-6 * (p.upper - p.lower) } else { 0.0 };
        let inside = |v: f64| v.clamp(p.lower + inset, p.upper - inset);
        if p.lower < 0.0 {
            values[i] = inside(amplitude * start[i]);
        } else if p.unit == Unit::One && p.lower > 0.0 {
            values[i] = inside(start[i].powf(amplitude));
        }
    }
    values
}

/// The best promise of each candidate.
pub(super) fn foremost(proposals: &[Proposal]) -> Vec<(usize, f64)> {
    let mut best: BTreeMap<usize, f64> = BTreeMap::new();
    for proposal in proposals {
        if let Member::Effect(place) = proposal.member {
            let known = best.entry(place).or_insert(f64::NEG_INFINITY);
            *known = known.max(proposal.gain);
        }
    }
    let mut all: Vec<(usize, f64)> = best.into_iter().collect();
    sort_descending(&mut all, |item| item.1);
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chamber::Chamber;
    use crate::diagnose::candidate::candidates;
    use crate::diagnose::experiment::fixtures::{effect, model, pattern};
    use crate::diagnose::tests::{bare_day, of_first_record};

    #[test]
    fn where_something_large_is_missing_what_promises_anything_is_fitted_and_where_nothing_is_no_more() {
        let declared = model(Vec::new());
        let pattern = pattern();
        let candidates = candidates(&declared, &[]);
        for (hidden, is_large) in [(vec![effect("midpoint_offset", &[0.1])], true), (Vec::new(), false)] {
            let record = bare_day(&model(hidden), 20.0, 3);
            let assumed = Assumption::new(declared.clone(), pattern.clone());
            let (chamber, null) = Chamber::new(&declared, &[&record]).unwrap().with_shocks(&assumed, &[0]).unwrap();
            let question = of_first_record(&chamber, &declared, &pattern, &candidates, 2);
            let null = Explanation::new(&question, &[], Vec::new(), null);
            let scored = scored(&question, &null, &|_, _| true).unwrap();
            let most = scored.iter().map(|p| p.gain).fold(0.0, f64::max);
            assert_eq!(most > LARGE, is_large, "{most}");
            let looked_at = looked_at(&question, &null).unwrap();
            let has_numbers = |p: &Proposal| matches!(p.member, Member::Effect(c) if !candidates[c].free.is_empty());
            assert!(is_large || !looked_at.iter().any(|p| has_numbers(p) && p.short.is_some()));
            let fitted = |member| looked_at.iter().any(|p| p.member == member && p.short.is_some());
            let promising = scored.iter().filter(|p| has_numbers(p) && !candidates[place(p)].is_of_layer());
            let mut promising: Vec<Member> = promising.filter(|p| p.gain > WORTH_A_FIT).map(|p| p.member).collect();
            promising.dedup();
            assert!(promising.iter().all(|&member| fitted(member) || !is_large), "{promising:?}");
            assert!(!is_large || promising.len() > 2, "{promising:?}");
        }
    }

    fn place(proposal: &Proposal) -> usize {
        let Member::Effect(place) = proposal.member else { unreachable!() };
        place
    }
}
