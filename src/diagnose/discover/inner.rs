//! Inner numbers of a set's terms: Newton steps beside everything that is fitted, and what they are known to.

use super::grammar::Term;
use super::search::{Set, Tools};
use crate::chamber::{Column, Effort, Place, Scored};
use crate::diagnose::joint::fitted;

/// Rounds in which inner numbers follow the fitted amplitude; a step below this share of its error ends them.
const POLISHED: usize = 2;
const SETTLED_SHARE: f64 = 0.15;
/// Relative step of a derivative by an inner number.
const STEP_SHARE: f64 = 0.02;

impl Tools<'_, '_> {
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
                    set.grounds.courses.column(&moved)
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
            let (low, high) = family.bounds(*inner, set.grounds.courses.longest_s());
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
        Some((self.set(found, terms, &set.grounds), longest))
    }
}
