//! What a set of explanations gains in the readings alone.
//!
//! ```text
//! ln p(rates | readings, set) = ln p(rates, readings | set) − ln p(readings | set)
//! ```
//!
//! Readings of one thermometer show what the air did and cannot show a coil: whatever a lag or another pack makes of an air that is
//! known, another air makes without it. What is taken to be likely of the air is a guess; a set that only makes readings
//! likelier, or less likely, under this guess has said nothing of the coil. So sets are judged by the rates, given the readings. Where a
//! record has a second thermometer, at the bore or in the air, the two together do show the pack, and nothing is taken off.

use std::cell::OnceCell;
use std::sync::Arc;

use super::{Explanation, Member, Question};
use crate::chamber::{Assumption, Effort, Fit};
use crate::parallel::InParallel;
use crate::rate::CoilModel;

/// Takes off what sets gain beside the `declared` model in the readings alone, and gives back what they lose, with the coil's numbers as they were
/// found. `readings`: what the declared model makes of them, once asked.
pub(super) fn take_off(
    question: &Question,
    readings: &OnceCell<Readings>,
    declared: &Fit,
    explanations: &mut [Explanation],
) {
    let mut changing: Vec<&mut Explanation> =
        explanations.iter_mut().filter(|e| changes_readings(question, e)).collect();
    if changing.is_empty() {
        return;
    }
    let readings = readings.get_or_init(|| Readings::new(question, declared));
    changing.iter_mut().in_parallel().for_each(|e| e.in_readings = readings.gain(question, &e.fit));
}

/// The readings alone by the declared model, which sets are compared with.
#[derive(Debug, Clone)]
pub(in crate::diagnose) struct Readings {
    /// Of the fitted and of the held-out records: with the chamber's kinks, and as much as that or with those that they have by it.
    declared: [(f64, f64); 2],
    /// Its fit: where those of sets begin.
    fit: Option<Fit>,
}

impl Readings {
    pub(in crate::diagnose) fn new(question: &Question, declared: &Fit) -> Self {
        let chamber = question.chamber.without_rates();
        let blind = blind(question, &chamber);
        let ((there, fit), own) = (alone(&blind, declared, None), own_kinks(&blind, declared));
        Self { declared: [0, 1].map(|of| (there[of], there[of].max(own[of]))), fit }
    }

    /// What a fit gains beside it, or loses: nothing where it lies between what kinks make of the declared model.
    pub(in crate::diagnose) fn gain(&self, question: &Question, fit: &Fit) -> f64 {
        let chamber = question.chamber.without_rates();
        let (own, _) = alone(&blind(question, &chamber), fit, self.fit.as_ref());
        let gains = own.iter().zip(&self.declared).map(|(own, declared)| beside(*own, *declared));
        gains.filter(|gain| gain.is_finite()).sum()
    }
}

/// By how much a log evidence lies beyond the least or the most.
fn beside(own: f64, (least, most): (f64, f64)) -> f64 {
    own - own.max(least).min(most)
}

/// The question of the records that have one thermometer, in a chamber that sees readings only.
fn blind<'q>(question: &Question<'q>, chamber: &'q crate::chamber::Chamber<'q>) -> Question<'q> {
    let has_one_thermometer = |place: &usize| {
        let record = chamber.record(*place);
        record.inner_k().is_none() && record.ambient_k().is_none()
    };
    let of = |places: &[usize]| places.iter().copied().filter(has_one_thermometer).collect();
    let (fitted, held_out) = (of(&question.fitted), of(&question.held_out));
    Question { chamber, fitted, held_out, ..question.clone() }
}

/// Log evidence of the readings of the records that were fitted, and of those held out; and the fit of the former.
fn alone(blind: &Question, fit: &Fit, beside: Option<&Fit>) -> ([f64; 2], Option<Fit>) {
    let mut start = reduced(blind, fit);
    match beside {
        Some(beside) => start.begin_beside(beside),
        // Days that rates were seen on are no beginning for days without.
        None => start.days = Arc::default(),
    }
    let mut own = None;
    let fitted = match &blind.fitted[..] {
        [] => 0.0,
        records => {
            own = blind.chamber.fit(&start.assumed, &[], records, Some(&start), Effort::FULL).ok();
            own.as_ref().map_or(f64::NEG_INFINITY, Fit::merit_of_chamber)
        }
    };
    let held_out = blind.held_out_evidence(&mut start);
    if let Some(own) = &mut own {
        own.days = start.days;
    }
    ([fitted, held_out], own)
}

/// … of the declared model with the kinks that the readings have by it; those of the chamber may be another's.
fn own_kinks(blind: &Question, declared: &Fit) -> [f64; 2] {
    match blind.chamber.with_own_kinks(&reduced(blind, declared), Effort::QUICK) {
        Ok(Some((chamber, fit, prices))) => {
            let ([fitted, held_out], _) = alone(&Question { chamber: &chamber, ..blind.clone() }, &fit, None);
            let price = |records: &[usize]| records.iter().map(|&r| prices[r]).sum::<f64>();
            [fitted - price(&blind.fitted), held_out - price(&blind.held_out)]
        }
        _ => [f64::NEG_INFINITY; 2],
    }
}

/// Whether readings are others by one model than by another.
pub(in crate::diagnose) fn is_seen(model: &CoilModel, without: &CoilModel) -> bool {
    match (model.heat_path(), without.heat_path()) {
        (Ok(a), Ok(b)) => a != b || model.sensor_lag_s() != without.sensor_lag_s(),
        _ => true,
    }
}

/// Whether only readings see what a model has more than another: the coil is heated as it was.
pub(super) fn is_seen_alone(model: &CoilModel, without: &CoilModel) -> bool {
    matches!((model.heat_path(), without.heat_path()), (Ok(a), Ok(b)) if a == b)
}

/// Whether readings would be others with a set's members.
pub(in crate::diagnose) fn changes_readings(question: &Question, explanation: &Explanation) -> bool {
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

/// A fit with what readings depend on only, to begin with; nothing of its effects is free.
fn reduced(question: &Question, fit: &Fit) -> Fit {
    let mut reduced = fit.clone();
    reduced.free.clear();
    reduced.assumed = Assumption::new(fit.assumed.model.clone(), question.pattern.clone());
    for place in (0..reduced.assumed.model.effects.len()).rev() {
        let mut without = reduced.assumed.model.clone();
        without.effects.remove(place);
        if !is_seen(&reduced.assumed.model, &without) {
            reduced.assumed.model = without;
        }
    }
    reduced
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loss_in_the_readings_counts_as_a_gain_does_and_what_kinks_may_make_does_not() {
        assert_eq!(beside(7.0, (2.0, 5.0)), 2.0);
        assert_eq!(beside(-1.0, (2.0, 5.0)), -3.0);
        assert_eq!(beside(3.0, (2.0, 5.0)), 0.0);
        assert_eq!(beside(1.0, (2.0, 2.0)), -1.0);
        // Where nothing could be fitted nothing is said.
        assert!(!beside(f64::NEG_INFINITY, (2.0, 5.0)).is_finite());
    }
}
