//! What a set of explanations gains in the readings alone.
//!
//! ```text
//! ln p(rates | readings, set) = ln p(rates, readings | set) − ln p(readings | set)
//! ```
//!
//! Readings of one thermometer show what the air did and cannot show a coil: whatever a lag or another pack makes of an air that is
//! known, another air makes without it. What is taken to be likely of the air is a guess; a set that only makes readings
//! likelier under this guess has said nothing of the coil. So sets are judged by the rates, given the readings.

use rayon::prelude::*;

use super::{Explanation, Member, Question};
use crate::chamber::{Assumption, Chamber, Effort, Fit, Free};
use crate::rate::CoilModel;

/// The chamber without its rates, and the declared model to compare with.
pub(super) struct Readings<'a> {
    blind: Chamber<'a>,
    declared: Fit,
}

impl<'a> Readings<'a> {
    pub(super) fn new(question: &Question<'a>, declared: Fit) -> Self {
        Self { blind: question.chamber.without_rates(), declared }
    }

    /// Takes off what sets gain in the readings alone, with the coil's numbers as they were found.
    pub(super) fn take_off(&self, question: &Question, explanations: &mut [Explanation]) {
        let mut changing: Vec<&mut Explanation> =
            explanations.iter_mut().filter(|e| changes_readings(question, e)).collect();
        if changing.is_empty() {
            return;
        }
        let none = self.alone(question, &self.declared);
        changing.par_iter_mut().for_each(|e| {
            let own = self.alone(question, &e.fit);
            let gains = own.iter().zip(&none).map(|(own, none)| (own - none).max(0.0)).filter(|gain| gain.is_finite());
            e.in_readings = gains.sum();
        });
    }

    /// Log evidence of the readings of the records that were fitted, and of those held out.
    fn alone(&self, question: &Question, fit: &Fit) -> [f64; 2] {
        let start = reduced(question, fit);
        let fitted = self.blind.fit(&start.assumed, &[], &question.fitted, Some(&start), Effort::FULL);
        let blind = Question { chamber: &self.blind, ..question.clone() };
        [fitted.map_or(f64::NEG_INFINITY, |fit| fit.merit_of_chamber()), blind.held_out_evidence(&start)]
    }
}

/// What readings depend on.
fn is_seen(model: &CoilModel, without: &CoilModel) -> bool {
    match (model.heat_path(), without.heat_path()) {
        (Ok(a), Ok(b)) => a != b || model.sensor_lag_s() != without.sensor_lag_s(),
        _ => true,
    }
}

/// Whether readings would be others with a set's members.
fn changes_readings(question: &Question, explanation: &Explanation) -> bool {
    explanation.members.iter().any(|member| match member {
        Member::Effect(candidate) => {
            is_seen(&question.model.with_effect(question.candidates[*candidate].effect.clone()), question.model)
        }
        Member::Refitted(effect) => {
            let mut without = question.model.clone();
            without.effects.remove(*effect);
            is_seen(question.model, &without)
        }
        Member::Winding(_) | Member::Step { .. } | Member::Drift | Member::Cycle => false,
    })
}

/// A fit with what readings depend on only.
fn reduced(question: &Question, fit: &Fit) -> Fit {
    let mut reduced = fit.clone();
    reduced.assumed = Assumption::new(fit.assumed.model.clone(), question.pattern.clone());
    for place in (0..reduced.assumed.model.effects.len()).rev() {
        let mut without = reduced.assumed.model.clone();
        without.effects.remove(place);
        if !is_seen(&reduced.assumed.model, &without) {
            reduced.assumed.model = without;
            reduced.free.retain(|f| f.effect != place);
            reduced.free.iter_mut().filter(|f| f.effect > place).for_each(|f: &mut Free| f.effect -= 1);
        }
    }
    reduced
}
