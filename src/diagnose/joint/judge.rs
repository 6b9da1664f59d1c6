//! Held-out records, posterior masses, and sets that are as good without some of their members.

use rayon::prelude::*;

use super::adjust::adjust;
use super::back::rest;
use super::explanation::fitted;
use super::odds::{CERTAIN, WINDOW};
use super::parsimony::give_to_smaller;
use super::readings::take_off;
use super::{Explanation, Member, Outcome, Question, Winding};
use crate::chamber::{Effort, Fit};

/// Sets that are judged by held-out records at most.
const JUDGED: usize = 8;
/// … and sets whose smaller ones begin again from what was found with them.
const LOOKED_INTO: usize = 3;

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
#[expect(
    clippy::too_many_lines,
    reason = "the steps of one judgement: each orders or weighs what the step before left"
)]
pub(super) fn judge(
    question: &Question,
    windings: &[Winding],
    explanations: &mut Vec<Explanation>,
    care: Care,
) -> Outcome<()> {
    let order = |list: &mut Vec<Explanation>| {
        list.sort_by(|a, b| b.total().total_cmp(&a.total()).then_with(|| a.key().cmp(&b.key())))
    };
    order(explanations);
    // What a larger set has found of the chamber may be better for a smaller one, too.
    let again: Vec<Explanation> = explanations
        .iter()
        .take(if care == Care::InFull { LOOKED_INTO } else { 0 })
        .flat_map(|e| (0..e.members.len()).map(move |place| (e, place)))
        .collect::<Vec<_>>()
        .into_par_iter()
        .filter_map(|(large, place)| rest(question, windings, large, place, Effort::QUICK))
        .collect();
    for small in again {
        match explanations.iter_mut().find(|e| e.key() == small.key()) {
            Some(known) if small.merit > known.merit => *known = small,
            Some(_) => {}
            None => explanations.push(small),
        }
    }
    order(explanations);
    let least = explanations.first().map_or(0.0, |e| e.merit) - WINDOW;
    let mut kept = 0;
    explanations.retain(|e| {
        kept += 1;
        e.members.is_empty() || (e.merit > least && kept <= JUDGED)
    });
    let judged = |e: &mut Explanation| {
        // What was only ranked is fitted in full before it is judged.
        let begin = e.begin();
        if care == Care::InFull
            && !e.fit.is_full()
            && let Some(again) = fitted(question, windings, e.members.clone(), &begin, &e.fit, Effort::FULL)
            && again.merit > e.merit
        {
            *e = again;
        }
        if !question.held_out.is_empty() {
            e.held_out = Some(question.held_out_evidence(&mut e.fit));
        }
    };
    // The first finds what the held-out records' days were; the others begin there.
    if let Some((first, others)) = explanations.split_first_mut() {
        judged(first);
        others.par_iter_mut().for_each(|e| {
            e.fit.days.clone_from(&first.fit.days);
            judged(e);
        });
    }
    if let Some(declared) = explanations.iter().find(|e| e.members.is_empty()).map(|e| e.fit.clone()) {
        take_off(question, &declared, explanations);
    }
    order(explanations);
    adjust(question, explanations)?;
    order(explanations);
    let top = explanations.first().map_or(0.0, Explanation::total);
    let masses: Vec<f64> = explanations.iter().map(|e| (e.total() - top).exp()).collect();
    let sum: f64 = masses.iter().sum();
    for (e, mass) in explanations.iter_mut().zip(masses) {
        e.probability = mass / sum;
    }
    let errors: Vec<Option<[f64; 2]>> = explanations.par_iter().map(|e| errors(question, e).unwrap_or(None)).collect();
    // From the largest set on: its mass goes to the best set within it that is as good, that lacks no news, or that predicts
    // rates better.
    let totals: Vec<f64> = explanations.iter().map(Explanation::total).collect();
    let sizes: Vec<usize> = explanations.iter().map(|e| e.members.len()).collect();
    let mut masses: Vec<f64> = explanations.iter().map(|e| e.probability).collect();
    give_to_smaller(&mut masses, &totals, &sizes, |small, large| {
        let (a, b) = (&explanations[small], &explanations[large]);
        let more = || b.members.iter().filter(|m| !a.members.contains(m));
        let no_news = || more().all(|m| b.is_no_news(question.model.effects.len(), *m));
        let worsens = || {
            more().all(|m| matches!(m, Member::Effect(_) | Member::Refitted(_)))
                && errors[small].zip(errors[large]).is_some_and(|(a, b)| is_worse(b, a))
        };
        a.members.iter().all(|m| b.members.contains(m))
            && (a.total() > b.total() - CERTAIN.log || no_news() || worsens())
    });
    explanations.iter_mut().zip(masses).for_each(|(e, mass)| e.probability = mass);
    explanations.sort_by(|a, b| b.probability.total_cmp(&a.probability).then(b.total().total_cmp(&a.total())));
    Ok(())
}

/// A share of the mass below which nothing is named.
const LOOKED_AT: f64 = 0.01;

/// Whether the first leaves more of fitted and of held-out rates than the second: what is missing in a coil lowers one of them.
fn is_worse(errors: [f64; 2], than: [f64; 2]) -> bool {
    errors[0] > than[0] && errors[1] >= than[1]
}

/// Mean squares that readings and a set leave of the rates of fitted and of held-out records.
fn errors(question: &Question, explanation: &Explanation) -> Outcome<Option<[f64; 2]>> {
    if explanation.probability < LOOKED_AT && !explanation.members.is_empty() {
        return Ok(None);
    }
    let of = |fit: &Fit, records: &[usize]| -> Outcome<f64> {
        let mut squares: Vec<f64> = Vec::new();
        for &r in records {
            let residuals = question.chamber.prediction(fit, r)?.residual_rad_per_s;
            squares.extend(residuals.iter().filter(|v| v.is_finite()).map(|v| v * v));
        }
        Ok(squares.iter().sum::<f64>() / squares.len().max(1) as f64)
    };
    let days = question.held_out.iter().zip(&*explanation.fit.days).map(|(&r, day)| of(day, &[r]));
    let days: Outcome<Vec<f64>> = days.collect();
    Ok(Some([of(&explanation.fit, &question.fitted)?, days?.iter().sum()]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_raises_both_errors_is_worse_and_what_lowers_either_is_not() {
        assert!(is_worse([1.1, 2.1], [1.0, 2.0]));
        assert!(!is_worse([1.1, 1.9], [1.0, 2.0]) && !is_worse([0.9, 2.1], [1.0, 2.0]));
        // Nothing held out.
        assert!(is_worse([1.1, 0.0], [1.0, 0.0]) && !is_worse([1.0, 0.0], [1.0, 0.0]));
    }
}
