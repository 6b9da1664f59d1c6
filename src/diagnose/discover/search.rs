//! Listed effects and unlisted terms in one competition: score test of all, refinement, fits of the best, forward and back.
//!
//! ```text
//! merit(set) = ln E(fitted) + Σ ln p(listed) + Σ_terms { ln p(term) − ln(candidates) − ½ ln n a inner number }
//! total = merit + ln E(held-out | effects and amplitudes as fitted)
//! ```
//!
//! A gain is in units of what the base fit leaves unexplained: its wander is fitted with it, and a term that explains the
//! wander gains by that once it is fitted.
//!
//! # Source
//! As [`super`]; variable projection: Golub and Pereyra, SIAM J. Numer. Anal. 10 (1973) 413.

use std::sync::{Arc, OnceLock};

use super::courses::Courses;
use super::grammar::{Family, Term};
use super::grounds::{Grounds, Sought};
use super::{BEATS, NEAR};
use crate::chamber::{Assumption, Effort, Fit, Input, Scored, Scorer};
use crate::diagnose::joint::{
    EFFECT, Explanation, Member, Proposal, Question, Readings, Winding, changes_readings, fitted, rates, with, without,
};
use crate::numeric::maximise::golden_section_within;
use crate::numeric::order::sort_descending;
use crate::parallel::InParallel;

/// A set of listed effects and unlisted terms, fitted.
#[derive(Debug, Clone)]
pub(crate) struct Set {
    /// Its members are the listed ones; the terms are the last inputs of its fit.
    pub(crate) explanation: Explanation,
    pub(crate) terms: Vec<Term>,
    /// Prices of the terms included.
    pub(crate) merit: f64,
    pub(crate) held_out: Option<f64>,
    /// Whether its held-out records, and what of it is gained in the readings alone, were looked at.
    pub(super) is_judged: bool,
    /// By how much the held-out records gained with the last member.
    pub(crate) held_out_gain: Option<f64>,
    /// What its terms are made of.
    pub(crate) grounds: Arc<Grounds>,
}

impl Set {
    pub(crate) fn total(&self) -> f64 {
        self.merit + self.held_out.unwrap_or(0.0) - self.explanation.in_readings
    }

    /// °/h per unit of the term's form.
    pub(crate) fn amplitude(&self, term: usize) -> f64 {
        self.explanation.fit.assumed.inputs[self.first_input() + term].amplitude
    }

    pub(crate) fn first_input(&self) -> usize {
        self.explanation.fit.assumed.inputs.len() - self.terms.len()
    }

    /// Whether another has the same listed effects and the same formulas.
    pub(crate) fn says_the_same(&self, other: &Self) -> bool {
        self.explanation.key() == other.explanation.key()
            && self.terms.len() == other.terms.len()
            && self.terms.iter().all(|t| other.terms.iter().any(|u| u.is_sister_of(t)))
    }

    /// Whether it has all that another has.
    pub(super) fn holds(&self, other: &Self) -> bool {
        other.explanation.members.iter().all(|m| self.explanation.members.contains(m))
            && other.terms.iter().all(|t| self.terms.iter().any(|own| own.is_sister_of(t)))
    }

    pub(crate) fn len(&self) -> usize {
        self.explanation.members.len() + self.terms.len()
    }
}

/// What a search over terms works with.
pub(crate) struct Tools<'q, 'a> {
    pub(crate) question: &'q Question<'a>,
    pub(crate) windings: &'q [Winding],
    /// The declared model's, and what readings alone say by it, once that is asked for.
    pub(crate) declared: &'q Fit,
    pub(crate) readings: OnceLock<Readings>,
    /// Of the fit that the search began with, and the chambers of the held-out records by it.
    pub(crate) grounds: Arc<Grounds>,
    pub(crate) days: Vec<Fit>,
    pub(crate) families: Vec<Family>,
    /// All points of all grids.
    pub(crate) candidates: usize,
}

/// Terms in a set at most.
pub(crate) const MOST_TERMS: usize = 4;
/// Families that are refined after each score test, and fitted as far as they promise enough.
const REFINED: usize = 12;
pub(crate) const TRIED: usize = 4;
/// A share of a grid's step that is less than the numbers' errors; fits follow them further.
const REFINED_SHARE: f64 = 0.02;
/// Listed effects that are fitted beside them.
const LISTED_TRIED: usize = 2;
/// … if they promise so much; terms, if they promise this share of what the first does.
pub(crate) const WORTH_LISTED: f64 = 8.0;
const WORTH_BESIDE: f64 = 0.25;
/// Sets whose held-out records are looked at after each stage, and with them those that the fitted records hardly tell from the best.
const HELD_OUT_TRIED: usize = 2;
const ALIKE_TRIED: usize = 6;
/// A step must gain so much more than it costs, and the held-out records anything at all.
const WORTH_A_STEP: f64 = 2.0;
/// A first term that is further behind than this is given up: the window of the search over listed effects.
pub(crate) const WITHIN_REACH: f64 = 20.0;
/// An amplitude is likely to make a term of so many of the record's noises.
const LIKELY_NOISES: f64 = 10.0;
/// A term that promises something at a fit.
#[derive(Debug, Clone)]
pub(crate) struct PromisingTerm {
    pub(crate) term: Term,
    /// Rise of the log likelihood at the best amplitude, and that amplitude.
    pub(crate) gain: f64,
    pub(crate) amplitude: f64,
    /// The gain less what the term costs.
    pub(crate) worth: f64,
}

impl Tools<'_, '_> {
    pub(super) fn rows(&self, fit: &Fit) -> f64 {
        rates(self.question.chamber, fit) as f64
    }

    /// What a term costs beside its amplitude, which the merit of its fit pays for.
    pub(super) fn price(&self, term: &Term, rows: f64) -> f64 {
        -EFFECT.log + (self.candidates.max(1) as f64).ln() + 0.5 * rows.ln() * term.inner.len() as f64
    }

    fn promise(&self, term: Term, scored: &Scored, rows: f64) -> PromisingTerm {
        let (gain, amplitude) = scored.gain();
        let worth = gain - self.price(&term, rows) - 0.5 * rows.ln();
        PromisingTerm { term, gain, amplitude, worth }
    }

    /// The most that any point of any grid is worth at a set.
    fn most_worth(&self, scorer: &Scorer, set: &Set) -> f64 {
        let rows = self.rows(&set.explanation.fit);
        let courses = &set.grounds.courses;
        let longest_s = courses.longest_s();
        let of = |family: &Family| {
            let points = family.grid(longest_s).into_iter().map(|inner| Term { family: family.clone(), inner });
            points
                .map(|term| {
                    let scored = scorer.score(&courses.column(&term));
                    self.promise(term, &scored, rows).worth
                })
                .fold(f64::NEG_INFINITY, f64::max)
        };
        self.families.iter().in_parallel().map(of).fold(f64::NEG_INFINITY, f64::max)
    }

    /// The best of each family at a set, refined; most worth first.
    pub(crate) fn promises(&self, scorer: &Scorer, set: &Set) -> Vec<PromisingTerm> {
        let rows = self.rows(&set.explanation.fit);
        let courses = &set.grounds.courses;
        let longest_s = courses.longest_s();
        let mut best: Vec<PromisingTerm> = self
            .families
            .iter()
            .in_parallel()
            .filter_map(|family| {
                let points = family.grid(longest_s).into_iter().map(|inner| Term { family: family.clone(), inner });
                let scored = points.map(|term| {
                    let scored = scorer.score(&courses.column(&term));
                    self.promise(term, &scored, rows)
                });
                scored.max_by(|a, b| a.gain.total_cmp(&b.gain))
            })
            .collect();
        let order = |all: &mut Vec<PromisingTerm>| {
            all.sort_by(|a, b| b.worth.total_cmp(&a.worth).then_with(|| a.term.family.text.cmp(&b.term.family.text)))
        };
        order(&mut best);
        best.truncate(REFINED);
        let mut refined: Vec<PromisingTerm> =
            best.in_parallel().map(|promise| self.refined(scorer, courses, promise, rows)).collect();
        order(&mut refined);
        refined
    }

    /// Inner numbers where the gain is largest, one after the other.
    fn refined(&self, scorer: &Scorer, courses: &Courses, promise: PromisingTerm, rows: f64) -> PromisingTerm {
        let longest_s = courses.longest_s();
        let count = promise.term.inner.len();
        let mut best = promise;
        for _ in 0..if count > 1 { 2 } else { count } {
            for place in 0..count {
                let inner = best.term.family.form.inner[place];
                let (low, high) = best.term.family.bounds(place, longest_s);
                let to = |v: f64| if inner.is_size() { v.ln() } else { v };
                let back = |v: f64| if inner.is_size() { v.exp() } else { v };
                // A step of the grid to each side.
                let width = if inner.is_size() { 0.6 } else { 0.15 * (high - low) };
                let here = to(best.term.inner[place]);
                let moved = |v: f64| {
                    let mut term = best.term.clone();
                    term.inner[place] = back(v);
                    term
                };
                let gain = |v: f64| scorer.score(&courses.column(&moved(v))).gain().0;
                let (from, to) = ((here - width).max(to(low)), (here + width).min(to(high)));
                let at = golden_section_within(gain, from, to, REFINED_SHARE).at;
                let term = moved(at);
                let scored = scorer.score(&courses.column(&term));
                let there = self.promise(term, &scored, rows);
                if there.gain > best.gain {
                    best = there;
                }
            }
        }
        best
    }

    /// A column as an input of unknown amplitude.
    pub(super) fn input(&self, grounds: &Grounds, term: &Term, amplitude: f64) -> Input {
        let (column, follows) = grounds.column(term);
        let (mut squares, mut count) = (0.0, 0usize);
        for &r in &self.question.fitted {
            let own = &column.rate_rad_per_s[r];
            let mean = own.iter().sum::<f64>() / own.len().max(1) as f64;
            squares += own.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
            count += own.len();
        }
        let size = (squares / count.max(1) as f64).sqrt().max(f64::MIN_POSITIVE);
        let noises = self.question.fitted.iter().map(|&r| self.question.chamber.noise_floor_rad_per_s(r));
        let deviation = LIKELY_NOISES * noises.fold(0.0, f64::max) / size;
        Input { name: term.family.text.clone(), rate_rad_per_s: column.rate_rad_per_s, amplitude, deviation, follows }
    }

    /// The prices of terms taken off what their fit is worth.
    pub(crate) fn set(&self, explanation: Explanation, terms: Vec<Term>, grounds: &Arc<Grounds>) -> Set {
        let rows = self.rows(&explanation.fit);
        let merit = explanation.merit - terms.iter().map(|t| self.price(t, rows)).sum::<f64>();
        Set {
            explanation,
            terms,
            merit,
            held_out: None,
            is_judged: false,
            held_out_gain: None,
            grounds: Arc::clone(grounds),
        }
    }

    /// A set without any term.
    pub(crate) fn plain(&self, explanation: &Explanation) -> Set {
        let fit = &explanation.fit;
        let grounds =
            if self.grounds.are_of(&fit.assumed.model) { Arc::clone(&self.grounds) } else { self.grounds_of(fit) };
        let set = self.set(explanation.clone(), Vec::new(), &grounds);
        let is_judged = explanation.held_out.is_some();
        Set { merit: explanation.merit, held_out: explanation.held_out, is_judged, ..set }
    }

    /// A set with one more term, fitted from the set's own chamber.
    fn with_term(&self, set: &Set, promise: &PromisingTerm) -> Option<Set> {
        let mut assumed = set.explanation.fit.assumed.clone();
        assumed.drift = false;
        assumed.cycle = false;
        assumed.inputs.push(self.input(&set.grounds, &promise.term, promise.amplitude));
        let mut terms = set.terms.clone();
        terms.push(promise.term.clone());
        let members: Vec<Member> = set.explanation.members.iter().copied().filter(|m| !m.is_outside()).collect();
        let begin = (assumed, set.explanation.fit.free.clone());
        // From a quiet gyro: what the term does not explain shows as wander again.
        let mut start = set.explanation.fit.clone();
        self.question.chamber.quieten(&mut start);
        let from = |start: &Fit| {
            let found = fitted(self.question, self.windings, members.clone(), &begin, start, Effort::QUICK)?;
            Some(self.set(found, terms.clone(), &set.grounds))
        };
        let found = from(&start)?;
        // With one term more nothing is less likely: an ascent that ended there has lost its way, among whatever else is missing.
        if found.explanation.fit.posterior() > set.explanation.fit.posterior() || set.explanation.is_outside() {
            return Some(found);
        }
        from(&set.explanation.fit).into_iter().chain([found]).max_by(|a, b| a.merit.total_cmp(&b.merit))
    }

    /// A set that was fitted in another chamber, in this one.
    pub(crate) fn refitted(&self, set: &Set) -> Option<Set> {
        let fit = &set.explanation.fit;
        let begin = (self.assumed_with(set, &set.terms), fit.free.clone());
        let found = fitted(self.question, self.windings, set.explanation.members.clone(), &begin, fit, Effort::FULL)?;
        Some(self.followed(self.set(found, set.terms.clone(), &set.grounds)))
    }

    /// What the set's fit assumes, with the courses of these terms as its inputs and the amplitudes as they were found.
    pub(super) fn assumed_with(&self, set: &Set, terms: &[Term]) -> Assumption {
        let mut assumed = set.explanation.fit.assumed.clone();
        let first = set.first_input();
        for (place, term) in terms.iter().enumerate() {
            assumed.inputs[first + place] = self.input(&set.grounds, term, set.amplitude(place));
        }
        assumed
    }

    /// A set with one more listed effect, and with what that makes of the variables of its terms.
    pub(crate) fn with_listed(&self, set: &Set, proposal: &Proposal) -> Option<Set> {
        let begin = with(self.question, self.windings, &set.explanation.fit, proposal.member, proposal.values.clone())?;
        let mut members = set.explanation.members.clone();
        members.push(proposal.member);
        self.with_coil(set, members, begin)
    }

    /// With the held-out records looked at, amplitudes and effects as they were fitted.
    pub(crate) fn judged(&self, mut set: Set) -> Set {
        if set.is_judged {
            return set;
        }
        if !self.question.held_out.is_empty() {
            let mut frozen = set.explanation.fit.clone();
            frozen.assumed.inputs.iter_mut().for_each(|input| input.deviation = 0.0);
            set.held_out = Some(self.question.held_out_evidence(&mut frozen));
            set.explanation.fit.days = frozen.days;
        }
        if changes_readings(self.question, &set.explanation) {
            let readings = self.readings.get_or_init(|| Readings::new(self.question, self.declared));
            set.explanation.in_readings = readings.gain(self.question, &set.explanation.fit);
        }
        set.is_judged = true;
        set
    }

    /// A set with each of the terms that promise most, fitted.
    pub(crate) fn with_terms(&self, set: &Set, regression: &Scorer, most: usize) -> Vec<Set> {
        let promises = self.promises(regression, set);
        let first = promises.first().map_or(0.0, |p| p.gain);
        let worthy = promises.iter().filter(|p| p.worth > 0.0 && p.gain > WORTH_BESIDE * first).take(ALIKE_TRIED);
        let tried = worthy.enumerate().filter(|(place, p)| *place < most || p.gain > first - NEAR);
        let tried: Vec<&PromisingTerm> = tried.map(|(_, p)| p).collect();
        tried.iter().in_parallel().filter_map(|promise| self.with_term(set, promise)).collect()
    }

    /// The foremost of sets in the order of their merits, and those that the fitted records hardly tell from it, with numbers and variables
    /// that follow their fits and the held-out records looked at.
    pub(crate) fn foremost(&self, mut sets: Vec<Set>) -> Vec<Set> {
        sort_descending(&mut sets, |item| item.merit);
        let near = sets.first().map_or(f64::NEG_INFINITY, |best| best.merit - NEAR);
        let alike = sets.iter().take(ALIKE_TRIED).filter(|s| s.merit > near).count();
        sets.truncate(alike.max(HELD_OUT_TRIED));
        let mut sets: Vec<Set> = sets.in_parallel().map(|s| self.judged(self.consistent(s))).collect();
        sort_descending(&mut sets, |item| item.total());
        sets
    }

    /// Whether a set leaves anything, asked beneath the wander that was fitted; what it is, is asked without it. Where the gyro wanders more
    /// than gyros do there is something, and a slow term looks like that wander until it is fitted.
    fn leaves_anything(&self, scorer: &Scorer, set: &Set) -> bool {
        set.explanation.is_outside() || self.most_worth(scorer, set) >= 0.0
    }

    /// The next sets from one, best first; all of them were fitted. None beyond the set itself is worth more: empty.
    pub(crate) fn onwards(&self, set: &Set) -> Vec<Set> {
        let fit = &set.explanation.fit;
        let chamber = self.question.chamber;
        let (Ok(scorer), Ok(regression)) = (chamber.scorer(fit), chamber.regression(fit)) else { return Vec::new() };
        let is_anything = self.leaves_anything(&scorer, set);
        if !is_anything && set.terms.is_empty() {
            return Vec::new();
        }
        // No formula is left to be found; an effect that moves the variables of those that were may be.
        let sought = if is_anything { Sought::Everything } else { Sought::WhatMoves };
        let mut listed = self.listed_beside(set, sought).unwrap_or_default();
        sort_descending(&mut listed, |item| item.gain);
        listed.retain(|p| p.gain > WORTH_LISTED);
        listed.truncate(LISTED_TRIED);
        let mut next = if is_anything { self.with_terms(set, &regression, TRIED) } else { Vec::new() };
        next.extend(listed.iter().in_parallel().filter_map(|p| self.with_listed(set, p)).collect::<Vec<_>>());
        self.foremost(next)
    }

    /// Whether one term in the place of all that is listed comes near what the listed effects are worth.
    pub(crate) fn may_replace(&self, declared: &Set, listed: &Explanation) -> bool {
        let fit = &declared.explanation.fit;
        let (Ok(scorer), Ok(regression)) = (self.question.chamber.scorer(fit), self.question.chamber.regression(fit))
        else {
            return false;
        };
        if !self.leaves_anything(&scorer, declared) {
            return false;
        }
        let mut sets = self.with_terms(declared, &regression, TRIED);
        sets.retain(|s| s.merit > listed.merit - WITHIN_REACH);
        self.foremost(sets).iter().any(|s| s.total() > listed.total() - WITHIN_REACH)
    }

    /// What is found from what lies beneath a wander; where that is no better than what is listed, from the declared model, too: a wander
    /// may have taken up a slow term, and the gyro's noise with it.
    pub(crate) fn beneath(
        &self,
        umbrella: Set,
        declared: &Explanation,
        best_listed: f64,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Vec<Set> {
        let wanders = umbrella.explanation.is_outside();
        let mut sets = self.search(umbrella, MOST_TERMS, &|share| progress(share));
        let is_better = |s: &Set| !s.terms.is_empty() && s.total() >= best_listed + BEATS;
        if wanders && !sets.iter().any(is_better) {
            sets.extend(self.search(self.plain(declared), MOST_TERMS, &|_| ()));
        }
        sets
    }

    /// Forward and back from a set, to so many terms; every set that was fitted and judged, best first.
    pub(crate) fn search(&self, from: Set, most_terms: usize, progress: &(dyn Fn(f64) + Sync)) -> Vec<Set> {
        let mut best = self.judged(from);
        let mut all = vec![best.clone()];
        for stage in 0..most_terms {
            if best.terms.len() >= most_terms {
                break;
            }
            progress(stage as f64 / most_terms as f64);
            let mut next = self.onwards(&best);
            for set in &mut next {
                set.held_out_gain = set.held_out.zip(best.held_out).map(|(a, b)| a - b);
            }
            let gains =
                |s: &Set| s.total() > best.total() + WORTH_A_STEP && s.held_out_gain.is_none_or(|gain| gain > 0.0);
            let mut chosen = next.iter().find(|s| gains(s)).cloned();
            if chosen.is_none() && best.terms.is_empty() {
                let mut pairs = self.paired(&best, &next);
                for set in &mut pairs {
                    set.held_out_gain = set.held_out.zip(best.held_out).map(|(a, b)| a - b);
                }
                chosen = pairs.iter().filter(|s| gains(s)).max_by(|a, b| a.total().total_cmp(&b.total())).cloned();
                all.extend(pairs);
            }
            all.extend(next);
            let Some(chosen) = chosen else { break };
            best = self.look_back(chosen, &mut all);
        }
        sort_descending(&mut all, |item| item.total());
        all
    }

    /// Leaves out what the rest does not need.
    fn look_back(&self, mut best: Set, all: &mut Vec<Set>) -> Set {
        while best.len() > 1 {
            let places: Vec<usize> = (0..best.len()).collect();
            let smaller: Vec<Set> =
                places.iter().in_parallel().filter_map(|&place| self.without(&best, place)).collect();
            let smaller: Vec<Set> = smaller.into_iter().filter(|s| s.merit > best.merit - WORTH_A_STEP).collect();
            let judged: Vec<Set> = smaller.in_parallel().map(|s| self.judged(self.grounded(s))).collect();
            let Some(least) = judged.iter().max_by(|a, b| a.total().total_cmp(&b.total())).cloned() else { break };
            all.extend(judged);
            if least.total() < best.total() {
                break;
            }
            best = Set { held_out_gain: best.held_out_gain, ..least };
        }
        best
    }

    /// The set without one of its members: listed ones first, then terms.
    pub(crate) fn without(&self, set: &Set, place: usize) -> Option<Set> {
        let listed = set.explanation.members.len();
        let fit = &set.explanation.fit;
        if place < listed {
            let mut members = set.explanation.members.clone();
            members.remove(place);
            return self.with_coil(set, members, without(self.question, &set.explanation, place));
        }
        let mut assumed = fit.assumed.clone();
        assumed.inputs.remove(set.first_input() + place - listed);
        let mut terms = set.terms.clone();
        terms.remove(place - listed);
        let (begin, members) = ((assumed, fit.free.clone()), set.explanation.members.clone());
        let found = fitted(self.question, self.windings, members, &begin, fit, Effort::QUICK)?;
        Some(self.set(found, terms, &set.grounds))
    }
}
