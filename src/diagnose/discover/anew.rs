//! What the fitted records speak for and the held-out ones against, judged once more.
//!
//! Gross errors and kinks of the air were looked for with the best of the listed effects. A term in the place of such an effect
//! shows the air at other times: where the kinks are the other's it seems worse than it is, most of all on records that were
//! not fitted. So both are judged in both chambers, each of which favours the one that it was looked through with:
//!
//! ```text
//! ½ [(M_term − M_listed | kinks by the listed) + (M_term − M_listed | kinks by the term)] ≥ what a set with terms must be better by
//! ```

use std::sync::Arc;

use super::grammar::Allowed;
use super::search::{MOST_TERMS, Set, WITHIN_REACH};
use super::{BEATS, Discovered, concluded, tools};
use crate::chamber::{Chamber, ChamberError, Effort, Fit};
use crate::diagnose::joint::{Explanation, Found, Question, fitted};
use crate::parallel::InParallel;

/// The discovery in a chamber that was looked through with a set, and that chamber; None where the set is not better on
/// average. `behind` says by how much it is worse where it was found.
///
/// # Errors
/// A chamber that cannot be looked through with the set.
pub(crate) fn anew<'a>(
    question: &Question<'a>,
    found: &Found,
    allowed: &Allowed,
    set: &Set,
    behind: f64,
) -> Result<Option<(Discovered, Chamber<'a>)>, ChamberError> {
    let chamber = looked_through(question, &set.explanation.fit)?;
    let there = Question { chamber: &chamber, ..question.clone() };
    let least = found.explanations.iter().map(Explanation::total).fold(f64::NEG_INFINITY, f64::max) - WITHIN_REACH;
    let listed: Vec<Explanation> = found
        .explanations
        .iter()
        .filter(|e| e.members.is_empty() || e.total() > least)
        .in_parallel()
        .filter_map(|e| refitted_from(&there, found, e, &e.fit.to_another_chamber()))
        .collect();
    let Some(declared) = listed.iter().find(|e| e.members.is_empty()) else { return Ok(None) };
    let Some(tools) = tools(&there, found, &declared.fit, &set.explanation.fit, allowed)? else { return Ok(None) };
    let mut there = Set { grounds: Arc::clone(&tools.grounds), ..set.clone() };
    there.explanation.fit = set.explanation.fit.to_another_chamber();
    let mut begun = tools.judged(tools.refitted(&there).ok_or(ChamberError::Unsolvable)?);
    begun.held_out_gain = begun.held_out.zip(declared.held_out).map(|(with, without)| with - without);
    let sets = tools.search(begun, MOST_TERMS, &|_| ());
    let totals: Vec<f64> = listed.iter().map(Explanation::total).collect();
    let discovered = concluded(&tools, sets, &totals, 2.0 * BEATS + behind)?;
    Ok(discovered.map(|d| (d, chamber)))
}

fn looked_through<'a>(question: &Question<'a>, fit: &Fit) -> Result<Chamber<'a>, ChamberError> {
    let records: Vec<_> = (0..question.chamber.records()).map(|r| question.chamber.record(r)).collect();
    Chamber::new(question.model, &records)?.with_timed_shocks_by(fit.clone(), &question.fitted)
}

/// What listed sets are worth where a set with a formula was found: what it found of the air may be better for them, too.
pub(crate) fn worth_beside(question: &Question, found: &Found, set: &Set) -> Vec<f64> {
    let least = set.total() - WITHIN_REACH;
    let worth = |e: &Explanation| {
        let is_asked = e.total() > least && e.total() < set.total();
        let there = if is_asked { refitted_from(question, found, e, &set.explanation.fit) } else { None };
        there.map_or(e.total(), |there| there.total().max(e.total()))
    };
    found.explanations.iter().in_parallel().map(worth).collect()
}

/// A listed set fitted again from another fit's chamber, with its held-out records.
fn refitted_from(question: &Question, found: &Found, known: &Explanation, from: &Fit) -> Option<Explanation> {
    let begin = (known.fit.assumed.clone(), known.fit.free.clone());
    let mut own = fitted(question, &found.windings, known.members.clone(), &begin, from, Effort::FULL)?;
    if !question.held_out.is_empty() {
        own.held_out = Some(question.held_out_evidence(&mut own.fit));
    }
    own.in_readings = known.in_readings;
    Some(own)
}
