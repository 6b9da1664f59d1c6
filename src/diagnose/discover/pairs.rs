//! A listed effect and a term that explain together what neither does alone: in a record in which they all but cancel.
//!
//! Each alone gains little beside the declared model, so a search that takes in one after the other begins with something else. All
//! pairs are scored together, each column with one filter pass:
//!
//! ```text
//! gain(i, j) = ½ (g̃_i, g̃_j) (J̃_ii, J̃_ij; J̃_ij, J̃_jj)⁻¹ (g̃_i, g̃_j)ᵀ
//! ```
//!
//! # Source
//! The score test as in [`crate::chamber`]; what forward selection misses: Miller, Subset Selection in Regression (2002), section 3.2.

use std::cmp::Ordering;
use std::sync::Arc;

use super::grammar::{Family, Term};
use super::search::{MOST_TERMS, Set, Tools, WITHIN_REACH};
use crate::chamber::{Effort, Scored, Scorer};
use crate::diagnose::joint::{
    EFFECT, Explanation, Member, Proposal, TestedStart, fitted, is_seen, tested_starts, with,
};
use crate::parallel::InParallel;

/// Pairs that are fitted, of different effects or different families.
const FITTED: usize = 6;

/// A listed effect and a term, where their fit begins.
struct Pair {
    listed: Proposal,
    term: Term,
    /// Of the term.
    amplitude: f64,
    /// The gain of both less what they cost.
    worth: f64,
}

impl Pair {
    /// Most worth first.
    fn order(&self, other: &Self) -> Ordering {
        let names = |p: &Self| (p.listed.member, p.term.family.text.clone());
        other.worth.total_cmp(&self.worth).then_with(|| names(self).cmp(&names(other)))
    }
}

impl Tools<'_, '_> {
    /// Where the best so far, of the declared model's rivals, takes two members or more: pairs, and what a search finds from one that is
    /// better.
    pub(super) fn in_the_place_of_two(
        &self,
        declared: &Explanation,
        listed: Option<&Explanation>,
        sets: &[Set],
    ) -> Vec<Set> {
        let formulas = sets.iter().filter(|s| !s.terms.is_empty()).map(|s| (s.total(), s.len()));
        let rivals = listed.into_iter().map(|l| (l.total(), l.members.len())).chain(formulas);
        let Some((best_total, members)) = rivals.max_by(|a, b| a.0.total_cmp(&b.0)) else { return Vec::new() };
        if members < 2 {
            return Vec::new();
        }
        let mut pairs = self.pairs(declared, best_total);
        if let Some(best) = pairs.first().filter(|p| p.total() > best_total).cloned() {
            pairs.extend(self.search(best, MOST_TERMS, &|_| ()));
        }
        pairs
    }

    /// Sets of one listed effect and one term that come near the best, judged, best first.
    fn pairs(&self, declared: &Explanation, best_total: f64) -> Vec<Set> {
        let bare = self.judged(self.plain(declared));
        let Ok(regression) = self.question.chamber.regression(&declared.fit) else { return Vec::new() };
        let pairs = self.promising_pairs(&regression, &bare);
        let sets = pairs.iter().in_parallel().filter_map(|pair| self.with_pair(&bare, pair));
        let mut sets = self.foremost(sets.filter(|s| s.merit > bare.merit).collect());
        sets.retain(|s| s.total() > best_total - WITHIN_REACH);
        for set in &mut sets {
            set.held_out_gain = set.held_out.zip(bare.held_out).map(|(with, without)| with - without);
        }
        sets
    }

    /// The pairs that promise most beside a set without terms, the best of each effect and family.
    fn promising_pairs(&self, regression: &Scorer, bare: &Set) -> Vec<Pair> {
        let rows = self.rows(&bare.explanation.fit);
        // Of one layer's effects there are as many as layers, and each looks like its neighbours'.
        let listed = tested_starts(self.question, &bare.explanation, &|candidate, _| !candidate.is_of_layer());
        // What cannot be solved beside the fit promises nothing.
        let listed: Vec<(&TestedStart, Scored)> = listed
            .iter()
            .in_parallel()
            .flat_map(|s| regression.score_model(&s.assumed).map(|scored| (s, scored)))
            .collect();
        let mut pairs: Vec<Pair> = self
            .families
            .iter()
            .in_parallel()
            .flat_map(|f| self.pairs_with(regression, bare, &listed, f, rows))
            .collect();
        pairs.sort_by(Pair::order);
        let mut seen: Vec<(Member, String)> = Vec::new();
        pairs.retain(|pair| {
            let own = (pair.listed.member, pair.term.family.text.clone());
            let is_new = pair.worth > 0.0 && !seen.contains(&own);
            seen.push(own);
            is_new
        });
        pairs.truncate(FITTED);
        pairs
    }

    /// The best point of a family's grid with each listed effect.
    fn pairs_with(
        &self,
        regression: &Scorer,
        bare: &Set,
        listed: &[(&TestedStart, Scored)],
        family: &Family,
        rows: f64,
    ) -> Vec<Pair> {
        let courses = &bare.grounds.courses;
        let mut best: Vec<Option<Pair>> = listed.iter().map(|_| None).collect();
        for inner in family.grid(courses.longest_s()) {
            let term = Term { family: family.clone(), inner };
            let scored = regression.score(&courses.column(&term));
            for ((direction, effect), best) in listed.iter().zip(&mut best) {
                let Some((gain, [of_effect, amplitude])) = effect.gain_with(&scored) else { continue };
                let (least, most) = direction.range();
                if !(least..=most).contains(&of_effect) {
                    continue;
                }
                let free = direction.free_parameters(self.question) as f64;
                let price = self.price(&term, rows) - EFFECT.log + 0.5 * (free + 1.0) * rows.ln();
                if best.as_ref().is_none_or(|b| gain - price > b.worth) {
                    let listed = direction.proposal(self.question, gain, of_effect);
                    *best = Some(Pair { listed, term: term.clone(), amplitude, worth: gain - price });
                }
            }
        }
        best.into_iter().flatten().collect()
    }

    /// Both fitted at once: either alone would take up what the other explains.
    fn with_pair(&self, bare: &Set, pair: &Pair) -> Option<Set> {
        let Proposal { member, values, .. } = pair.listed.clone();
        let (mut assumed, free) = with(self.question, self.windings, &bare.explanation.fit, member, values)?;
        (assumed.drift, assumed.cycle) = (false, false);
        let mut start = bare.explanation.fit.clone();
        self.question.chamber.quieten(&mut start);
        let mut grounds = Arc::clone(&bare.grounds);
        if is_seen(&assumed.model, &start.assumed.model) {
            let mut there = start.clone();
            (there.assumed.model, there.free) = (assumed.model.clone(), free.clone());
            grounds = self.grounds_of(&there);
        }
        assumed.inputs.push(self.input(&grounds, &pair.term, pair.amplitude));
        let found = fitted(self.question, self.windings, vec![member], &(assumed, free), &start, Effort::QUICK)?;
        Some(self.set(found, vec![pair.term.clone()], &grounds))
    }
}
