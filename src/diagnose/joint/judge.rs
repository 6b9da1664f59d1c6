//! Held-out records, posterior masses, and sets that are as good without some of their members.

use rayon::prelude::*;

use super::explanation::fitted;
use super::{Explanation, Question, Winding};
use crate::chamber::{ChamberError, Effort};

/// Sets so much worse than the best are forgotten.
const WINDOW: f64 = 20.0;
/// Sets that are judged by held-out records at most.
const JUDGED: usize = 8;
/// A set that is better than one within it by less than this is that one.
const AS_GOOD: f64 = 3.0;
/// What a set with an estimate beyond what is physical must be better by to be heard.
const UNPHYSICAL: f64 = 30.0;

/// Held-out records, posterior masses, and what is as good without some of its members.
pub(super) fn judge(question: &Question, windings: &[Winding], explanations: &mut Vec<Explanation>) {
    // A size that no coil has is no explanation beside one that does nearly as well.
    let physical =
        explanations.iter().filter(|e| !e.is_beyond_physical()).map(|e| e.merit).fold(f64::NEG_INFINITY, f64::max);
    explanations.retain(|e| e.members.is_empty() || !e.is_beyond_physical() || e.merit > physical + UNPHYSICAL);
    let order = |list: &mut Vec<Explanation>| {
        list.sort_by(|a, b| b.total().total_cmp(&a.total()).then_with(|| a.key().cmp(&b.key())))
    };
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
        if let Some(again) = fitted(question, windings, e.members.clone(), &begin, &e.fit, Effort::FULL)
            && again.merit > e.merit
        {
            *e = again;
        }
        if !question.held_out.is_empty() {
            let scores: Result<Vec<f64>, ChamberError> = question
                .held_out
                .iter()
                .map(|&r| question.chamber.held_out(&e.fit, r).map(|fit| fit.evidence))
                .collect();
            e.held_out = Some(scores.map_or(f64::NEG_INFINITY, |s| s.iter().sum()));
        }
    });
    order(explanations);
    let top = explanations.first().map_or(0.0, Explanation::total);
    let masses: Vec<f64> = explanations.iter().map(|e| (e.total() - top).exp()).collect();
    let sum: f64 = masses.iter().sum();
    for (e, mass) in explanations.iter_mut().zip(masses) {
        e.probability = mass / sum;
    }
    // From the largest set on: its mass goes to the best set within it that is as good.
    let mut places: Vec<usize> = (0..explanations.len()).collect();
    places.sort_by_key(|&i| std::cmp::Reverse(explanations[i].members.len()));
    for &large in &places {
        let within = places
            .iter()
            .copied()
            .filter(|&small| {
                let (a, b) = (&explanations[small], &explanations[large]);
                a.members.len() < b.members.len()
                    && a.members.iter().all(|m| b.members.contains(m))
                    && a.total() > b.total() - AS_GOOD
            })
            .max_by(|&a, &b| explanations[a].total().total_cmp(&explanations[b].total()));
        if let Some(small) = within {
            explanations[small].probability += explanations[large].probability;
            explanations[large].probability = 0.0;
        }
    }
    explanations.sort_by(|a, b| b.probability.total_cmp(&a.probability).then(b.total().total_cmp(&a.total())));
}
