//! Held-out records, posterior masses, and sets that are as good without some of their members.

use rayon::prelude::*;

use super::explanation::{fitted, without};
use super::odds::{CERTAIN, WINDOW};
use super::readings::take_off;
use super::{Explanation, Question, Winding};
use crate::chamber::Effort;

/// Sets that are judged by held-out records at most.
const JUDGED: usize = 8;
/// … and sets whose smaller ones begin again from what was found with them.
const LOOKED_INTO: usize = 3;

/// Held-out records, posterior masses, and what is as good without some of its members.
#[expect(
    clippy::too_many_lines,
    reason = "the steps of one judgement: each orders or weighs what the step before left"
)]
pub(super) fn judge(question: &Question, windings: &[Winding], explanations: &mut Vec<Explanation>) {
    let order = |list: &mut Vec<Explanation>| {
        list.sort_by(|a, b| b.total().total_cmp(&a.total()).then_with(|| a.key().cmp(&b.key())))
    };
    order(explanations);
    // What a larger set has found of the chamber may be better for a smaller one, too.
    let again: Vec<Explanation> = explanations
        .iter()
        .take(LOOKED_INTO)
        .flat_map(|e| (0..e.members.len()).map(move |place| (e, place)))
        .collect::<Vec<_>>()
        .into_par_iter()
        .filter_map(|(large, place)| {
            let mut members = large.members.clone();
            members.remove(place);
            fitted(question, windings, members, &without(question, large, place), &large.fit, Effort::QUICK)
        })
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
    explanations.par_iter_mut().for_each(|e| {
        // What was only ranked is fitted in full before it is judged.
        let begin = (e.fit.assumed.clone(), e.fit.free.clone());
        if !e.fit.is_full()
            && let Some(again) = fitted(question, windings, e.members.clone(), &begin, &e.fit, Effort::FULL)
            && again.merit > e.merit
        {
            *e = again;
        }
        if !question.held_out.is_empty() {
            e.held_out = Some(question.held_out_evidence(&e.fit));
        }
    });
    if let Some(declared) = explanations.iter().find(|e| e.members.is_empty()).map(|e| e.fit.clone()) {
        take_off(question, &declared, explanations);
    }
    order(explanations);
    let top = explanations.first().map_or(0.0, Explanation::total);
    let masses: Vec<f64> = explanations.iter().map(|e| (e.total() - top).exp()).collect();
    let sum: f64 = masses.iter().sum();
    for (e, mass) in explanations.iter_mut().zip(masses) {
        e.probability = mass / sum;
    }
    // From the largest set on: its mass goes to the best set within it that is as good, or that lacks no news.
    let mut places: Vec<usize> = (0..explanations.len()).collect();
    places.sort_by_key(|&i| std::cmp::Reverse(explanations[i].members.len()));
    for &large in &places {
        let within = places
            .iter()
            .copied()
            .filter(|&small| {
                let (a, b) = (&explanations[small], &explanations[large]);
                let no_news = || {
                    let mut more = b.members.iter().filter(|m| !a.members.contains(m));
                    more.all(|m| b.is_no_news(question.model.effects.len(), *m))
                };
                a.members.len() < b.members.len()
                    && a.members.iter().all(|m| b.members.contains(m))
                    && (a.total() > b.total() - CERTAIN.log || no_news())
            })
            .max_by(|&a, &b| explanations[a].total().total_cmp(&explanations[b].total()));
        if let Some(small) = within {
            explanations[small].probability += explanations[large].probability;
            explanations[large].probability = 0.0;
        }
    }
    explanations.sort_by(|a, b| b.probability.total_cmp(&a.probability).then(b.total().total_cmp(&a.total())));
}
