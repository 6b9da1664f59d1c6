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

use rayon::prelude::*;

use super::NEAR;
use super::courses::Courses;
use super::grammar::{Family, Term};
use crate::chamber::{Assumption, Column, Effort, Fit, Input, Place, Scored, Scorer};
use crate::diagnose::joint::{
    EFFECT, Explanation, Member, Proposal, Question, Winding, fitted, proposals, rates, with, without,
};
use crate::numeric::maximise::golden_section_within;

/// A set of listed effects and unlisted terms, fitted.
#[derive(Debug, Clone)]
pub(crate) struct Set {
    /// Its members are the listed ones; the terms are the last inputs of its fit.
    pub(crate) explanation: Explanation,
    pub(crate) terms: Vec<Term>,
    /// Prices of the terms included.
    pub(crate) merit: f64,
    pub(crate) held_out: Option<f64>,
    /// By how much the held-out records gained with the last member.
    pub(crate) held_out_gain: Option<f64>,
}

impl Set {
    pub(crate) fn total(&self) -> f64 {
        self.merit + self.held_out.unwrap_or(0.0)
    }

    /// °/h per unit of the term's form.
    pub(crate) fn amplitude(&self, term: usize) -> f64 {
        self.explanation.fit.assumed.inputs[self.first_input() + term].amplitude
    }

    pub(crate) fn first_input(&self) -> usize {
        self.explanation.fit.assumed.inputs.len() - self.terms.len()
    }

    pub(crate) fn len(&self) -> usize {
        self.explanation.members.len() + self.terms.len()
    }
}

/// What a search over terms works with.
pub(crate) struct Tools<'q, 'a> {
    pub(crate) question: &'q Question<'a>,
    pub(crate) windings: &'q [Winding],
    pub(crate) courses: Courses,
    pub(crate) families: Vec<Family>,
    /// All points of all grids.
    pub(crate) candidates: usize,
}

/// Terms in a set at most.
pub(crate) const MOST_TERMS: usize = 4;
/// Families that are refined after each score test, and fitted as far as they promise enough.
const REFINED: usize = 12;
const TRIED: usize = 4;
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
/// Rounds in which inner numbers follow the fitted amplitude; a step below this share of its error ends them.
const POLISHED: usize = 2;
const SETTLED_SHARE: f64 = 0.15;
/// Relative step of a derivative by an inner number.
const STEP_SHARE: f64 = 0.02;

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
    fn rows(&self, fit: &Fit) -> f64 {
        rates(self.question.chamber, fit) as f64
    }

    /// What a term costs beside its amplitude, which the merit of its fit pays for.
    fn price(&self, term: &Term, rows: f64) -> f64 {
        -EFFECT.log + (self.candidates.max(1) as f64).ln() + 0.5 * rows.ln() * term.inner.len() as f64
    }

    fn promise(&self, term: Term, scored: &Scored, rows: f64) -> PromisingTerm {
        let (gain, amplitude) = scored.gain();
        let worth = gain - self.price(&term, rows) - 0.5 * rows.ln();
        PromisingTerm { term, gain, amplitude, worth }
    }

    /// The most that any point of any grid is worth at a fit.
    fn most_worth(&self, scorer: &Scorer, fit: &Fit) -> f64 {
        let rows = self.rows(fit);
        let longest_s = self.courses.longest_s();
        let of = |family: &Family| {
            let points = family.grid(longest_s).into_iter().map(|inner| Term { family: family.clone(), inner });
            points
                .map(|term| {
                    let scored = scorer.score(&self.courses.column(&term));
                    self.promise(term, &scored, rows).worth
                })
                .fold(f64::NEG_INFINITY, f64::max)
        };
        self.families.par_iter().map(of).reduce(|| f64::NEG_INFINITY, f64::max)
    }

    /// The best of each family at a fit, refined; most worth first.
    pub(crate) fn promises(&self, scorer: &Scorer, fit: &Fit) -> Vec<PromisingTerm> {
        let rows = self.rows(fit);
        let longest_s = self.courses.longest_s();
        let mut best: Vec<PromisingTerm> = self
            .families
            .par_iter()
            .filter_map(|family| {
                let points = family.grid(longest_s).into_iter().map(|inner| Term { family: family.clone(), inner });
                let scored = points.map(|term| {
                    let scored = scorer.score(&self.courses.column(&term));
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
            best.into_par_iter().map(|promise| self.refined(scorer, promise, rows, longest_s)).collect();
        order(&mut refined);
        refined
    }

    /// Inner numbers where the gain is largest, one after the other.
    fn refined(&self, scorer: &Scorer, promise: PromisingTerm, rows: f64, longest_s: f64) -> PromisingTerm {
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
                let gain = |v: f64| scorer.score(&self.courses.column(&moved(v))).gain().0;
                let (from, to) = ((here - width).max(to(low)), (here + width).min(to(high)));
                let at = golden_section_within(gain, from, to, REFINED_SHARE).at;
                let term = moved(at);
                let scored = scorer.score(&self.courses.column(&term));
                let there = self.promise(term, &scored, rows);
                if there.gain > best.gain {
                    best = there;
                }
            }
        }
        best
    }

    /// A column as an input of unknown amplitude.
    fn input(&self, term: &Term, amplitude: f64) -> Input {
        let column = self.courses.column(term);
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
        Input { name: term.family.text.clone(), rate_rad_per_s: column.rate_rad_per_s, amplitude, deviation }
    }

    /// The prices of terms taken off what their fit is worth.
    pub(crate) fn set(&self, explanation: Explanation, terms: Vec<Term>) -> Set {
        let rows = self.rows(&explanation.fit);
        let merit = explanation.merit - terms.iter().map(|t| self.price(t, rows)).sum::<f64>();
        Set { explanation, terms, merit, held_out: None, held_out_gain: None }
    }

    /// A set without any term.
    pub(crate) fn plain(&self, explanation: &Explanation) -> Set {
        Set { merit: explanation.merit, held_out: explanation.held_out, ..self.set(explanation.clone(), Vec::new()) }
    }

    /// A set with one more term, fitted from the set's own chamber.
    fn with_term(&self, set: &Set, promise: &PromisingTerm) -> Option<Set> {
        let mut assumed = set.explanation.fit.assumed.clone();
        assumed.drift = false;
        assumed.cycle = false;
        assumed.inputs.push(self.input(&promise.term, promise.amplitude));
        let mut terms = set.terms.clone();
        terms.push(promise.term.clone());
        let members: Vec<Member> = set.explanation.members.iter().copied().filter(|m| !m.is_outside()).collect();
        let begin = (assumed, set.explanation.fit.free.clone());
        // From a quiet gyro: what the term does not explain shows as wander again.
        let mut start = set.explanation.fit.clone();
        self.question.chamber.quieten(&mut start);
        let found = fitted(self.question, self.windings, members, &begin, &start, Effort::QUICK)?;
        Some(self.set(found, terms))
    }

    /// A set that was fitted in another chamber, in this one.
    pub(crate) fn refitted(&self, set: &Set) -> Option<Set> {
        let fit = &set.explanation.fit;
        let begin = (self.assumed_with(set, &set.terms), fit.free.clone());
        let found = fitted(self.question, self.windings, set.explanation.members.clone(), &begin, fit, Effort::FULL)?;
        Some(self.followed(self.set(found, set.terms.clone())))
    }

    /// What the set's fit assumes, with the courses of these terms as its inputs and the amplitudes as they were found.
    fn assumed_with(&self, set: &Set, terms: &[Term]) -> Assumption {
        let mut assumed = set.explanation.fit.assumed.clone();
        let first = set.first_input();
        for (place, term) in terms.iter().enumerate() {
            assumed.inputs[first + place] = self.input(term, set.amplitude(place));
        }
        assumed
    }

    pub(crate) fn with_listed(&self, set: &Set, proposal: &Proposal) -> Option<Set> {
        let begin = with(self.question, self.windings, &set.explanation.fit, proposal.member, proposal.values.clone())?;
        let mut members = set.explanation.members.clone();
        members.push(proposal.member);
        let fit = &set.explanation.fit;
        let found = fitted(self.question, self.windings, members, &begin, fit, Effort::QUICK)?;
        Some(self.set(found, set.terms.clone()))
    }

    /// With inner numbers that follow the fit.
    pub(crate) fn followed(&self, mut best: Set) -> Set {
        for _ in 0..POLISHED {
            let Some((next, share)) = self.polished(&best) else { break };
            if next.merit > best.merit {
                best = next;
            } else {
                break;
            }
            if share < SETTLED_SHARE {
                break;
            }
        }
        best
    }

    /// Derivatives of the terms' columns by their inner numbers, as columns: of the term, and the place of the number.
    fn inner_columns(&self, set: &Set) -> Vec<(usize, usize, Column)> {
        let mut all = Vec::new();
        for (place, term) in set.terms.iter().enumerate() {
            let amplitude = set.amplitude(place);
            for inner in 0..term.inner.len() {
                let step = self.step(term, inner);
                let at = |sign: f64| {
                    let mut moved = term.clone();
                    moved.inner[inner] += sign * step;
                    self.courses.column(&moved)
                };
                let (up, down) = (at(1.0), at(-1.0));
                let slope = |r: usize| {
                    let pairs = up.rate_rad_per_s[r].iter().zip(&down.rate_rad_per_s[r]);
                    pairs.map(|(u, d)| amplitude * (u - d) / (2.0 * step)).collect()
                };
                let rate_rad_per_s = (0..up.rate_rad_per_s.len()).map(slope).collect();
                all.push((place, inner, Column { rate_rad_per_s }));
            }
        }
        all
    }

    fn step(&self, term: &Term, inner: usize) -> f64 {
        if term.family.form.inner[inner].is_size() {
            STEP_SHARE * term.inner[inner]
        } else {
            0.5 * STEP_SHARE * (term.family.x.high - term.family.x.low)
        }
    }

    /// Standard errors of each term's amplitude and then of its inner numbers, cleared of all else that was fitted. Amplitude and
    /// inner numbers of a term go together: an amplitude is known as well as they are.
    pub(crate) fn errors(&self, set: &Set) -> Vec<Vec<f64>> {
        let fit = &set.explanation.fit;
        let first = set.first_input();
        let coordinate =
            |term: usize| fit.parameters.iter().position(|p| p.place == Place::Input { input: first + term });
        let mut errors: Vec<Vec<f64>> = set.terms.iter().map(|t| vec![f64::NAN; 1 + t.inner.len()]).collect();
        for (term, errors) in errors.iter_mut().enumerate() {
            errors[0] = coordinate(term).map_or(f64::NAN, |k| fit.standard_errors[k]);
        }
        let Ok(scorer) = self.question.chamber.scorer(fit) else { return errors };
        let columns = self.inner_columns(set);
        let scored: Vec<Scored> = columns.iter().map(|(_, _, c)| scorer.score(c)).collect();
        let count = scored.len();
        let information = nalgebra::DMatrix::from_fn(count, count, |i, k| scored[i].information_with(&scored[k]));
        let Some(factor) = information.cholesky() else { return errors };
        let covariance = factor.inverse();
        for (i, (term, inner, _)) in columns.iter().enumerate() {
            errors[*term][1 + inner] = covariance[(i, i)].sqrt();
        }
        for (term, errors) in errors.iter_mut().enumerate() {
            let Some(k) = coordinate(term) else { continue };
            let weights = nalgebra::DVector::from_iterator(count, scored.iter().map(|s| s.weight(k)));
            errors[0] = errors[0].hypot(weights.dot(&(&covariance * &weights)).max(0.0).sqrt());
        }
        errors
    }

    /// Inner numbers one Newton step further, fitted again; and the longest step in units of its error.
    fn polished(&self, set: &Set) -> Option<(Set, f64)> {
        if set.terms.iter().all(|t| t.inner.is_empty()) {
            return None;
        }
        let scorer = self.question.chamber.scorer(&set.explanation.fit).ok()?;
        let columns = self.inner_columns(set);
        let scored: Vec<Scored> = columns.iter().map(|(_, _, c)| scorer.score(c)).collect();
        let count = scored.len();
        let information = nalgebra::DMatrix::from_fn(count, count, |i, k| scored[i].information_with(&scored[k]));
        let score = nalgebra::DVector::from_iterator(count, scored.iter().map(|s| s.score));
        let factor = information.cholesky()?;
        let change = factor.solve(&score);
        let covariance = factor.inverse();
        let mut terms = set.terms.clone();
        let mut longest: f64 = 0.0;
        for (i, (term, inner, _)) in columns.iter().enumerate() {
            let family = &terms[*term].family;
            let (low, high) = family.bounds(*inner, self.courses.longest_s());
            let here = terms[*term].inner[*inner];
            let reach = if family.form.inner[*inner].is_size() { 0.4 * here } else { 0.1 * (high - low) };
            let moved = (here + change[i].clamp(-reach, reach)).clamp(low, high);
            longest = longest.max((moved - here).abs() / covariance[(i, i)].sqrt());
            terms[*term].inner[*inner] = moved;
        }
        let begin = (self.assumed_with(set, &terms), set.explanation.fit.free.clone());
        let members = set.explanation.members.clone();
        let fit = &set.explanation.fit;
        let found = fitted(self.question, self.windings, members, &begin, fit, Effort::QUICK)?;
        Some((self.set(found, terms), longest))
    }

    /// With the held-out records looked at, amplitudes and effects as they were fitted.
    pub(crate) fn judged(&self, mut set: Set) -> Set {
        if self.question.held_out.is_empty() || set.held_out.is_some() {
            return set;
        }
        let mut frozen = set.explanation.fit.clone();
        frozen.assumed.inputs.iter_mut().for_each(|input| input.deviation = 0.0);
        set.held_out = Some(self.question.held_out_evidence(&frozen));
        set
    }

    /// The next sets from one, best first; all of them were fitted. None beyond the set itself is worth more: empty.
    pub(crate) fn onwards(&self, set: &Set) -> Vec<Set> {
        let fit = &set.explanation.fit;
        let chamber = self.question.chamber;
        let (Ok(scorer), Ok(regression)) = (chamber.scorer(fit), chamber.regression(fit)) else { return Vec::new() };
        // Whether there is anything is asked beneath the wander that was fitted, what it is without it. Where the gyro wanders more than gyros
        // do there is something, and a slow term looks like that wander until it is fitted.
        if !set.explanation.is_outside() && self.most_worth(&scorer, fit) < 0.0 {
            return Vec::new();
        }
        let promises = self.promises(&regression, fit);
        let first = promises.first().map_or(0.0, |p| p.gain);
        let listed: Vec<Proposal> = match proposals(self.question, &set.explanation) {
            Ok(mut all) => {
                all.sort_by(|a, b| b.gain.total_cmp(&a.gain));
                all.retain(|p| p.gain > WORTH_LISTED);
                all.truncate(LISTED_TRIED);
                all
            }
            Err(_) => Vec::new(),
        };
        let worthy = promises.iter().filter(|p| p.worth > 0.0 && p.gain > WORTH_BESIDE * first).take(ALIKE_TRIED);
        let tried = worthy.enumerate().filter(|(place, p)| *place < TRIED || p.gain > first - NEAR);
        let tried: Vec<&PromisingTerm> = tried.map(|(_, p)| p).collect();
        let mut next: Vec<Set> = tried.par_iter().filter_map(|promise| self.with_term(set, promise)).collect();
        next.extend(listed.par_iter().filter_map(|p| self.with_listed(set, p)).collect::<Vec<_>>());
        next.sort_by(|a, b| b.merit.total_cmp(&a.merit));
        let near = next.first().map_or(f64::NEG_INFINITY, |best| best.merit - NEAR);
        let alike = next.iter().take(ALIKE_TRIED).filter(|s| s.merit > near).count();
        next.truncate(alike.max(HELD_OUT_TRIED));
        let mut next: Vec<Set> = next.into_par_iter().map(|s| self.judged(self.followed(s))).collect();
        next.sort_by(|a, b| b.total().total_cmp(&a.total()));
        next
    }

    /// Whether one term in the place of all that is listed comes near what the listed effects are worth.
    pub(crate) fn may_replace(&self, declared: Set, listed: f64) -> bool {
        let one = self.search(declared, 1, &|_| ());
        one.iter().any(|set| !set.terms.is_empty() && set.total() > listed - WITHIN_REACH)
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
            let chosen = next.iter().find(|s| gains(s)).cloned();
            all.extend(next);
            let Some(chosen) = chosen else { break };
            best = self.look_back(chosen, &mut all);
        }
        all.sort_by(|a, b| b.total().total_cmp(&a.total()));
        all
    }

    /// Leaves out what the rest does not need.
    fn look_back(&self, mut best: Set, all: &mut Vec<Set>) -> Set {
        while best.len() > 1 {
            let places: Vec<usize> = (0..best.len()).collect();
            let smaller: Vec<Set> = places.par_iter().filter_map(|&place| self.without(&best, place)).collect();
            let smaller: Vec<Set> = smaller.into_iter().filter(|s| s.merit > best.merit - WORTH_A_STEP).collect();
            let judged: Vec<Set> = smaller.into_par_iter().map(|s| self.judged(s)).collect();
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
        let (begin, members, terms) = if place < listed {
            let mut members = set.explanation.members.clone();
            members.remove(place);
            (without(self.question, &set.explanation, place), members, set.terms.clone())
        } else {
            let mut assumed = fit.assumed.clone();
            assumed.inputs.remove(set.first_input() + place - listed);
            let mut terms = set.terms.clone();
            terms.remove(place - listed);
            ((assumed, fit.free.clone()), set.explanation.members.clone(), terms)
        };
        let found = fitted(self.question, self.windings, members, &begin, fit, Effort::QUICK)?;
        Some(self.set(found, terms))
    }
}
