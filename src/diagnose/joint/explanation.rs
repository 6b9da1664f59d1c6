//! One set of explanations, fitted.

use super::odds::{EFFECT, KNOWN_WITHIN, OUTSIDE, PHYSICAL, REFITTED, STATED_WITHIN, STEP};
use super::{Question, Winding, rates};
use crate::chamber::{Assumption, Effort, Fit, Free, Input, Parameter, Place, Scale, StatedNumber, is_factor};
use crate::effect::{DeclaredEffect, Nature};

/// One thing that a set assumes beside the declared model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Member {
    /// An effect of the catalogue: its candidate.
    Effect(usize),
    /// The numbers of an effect that the model declares are wrong: its place in the model.
    Refitted(usize),
    /// Another winding: its place among those looked at.
    Winding(usize),
    /// The offset steps before this row of this record.
    Step {
        record: usize,
        row: usize,
    },
    /// Wander, and a cycle, that nothing in the model makes.
    Drift,
    Cycle,
}

impl Member {
    pub(crate) fn is_outside(self) -> bool {
        matches!(self, Member::Drift | Member::Cycle)
    }
}

/// A set with its fit and what it is worth.
#[derive(Debug, Clone)]
pub(crate) struct Explanation {
    /// In the order in which they joined.
    pub(crate) members: Vec<Member>,
    pub(crate) fit: Fit,
    /// Log evidence of the fitted records, prior of the set included.
    pub(crate) merit: f64,
    /// … of the held-out ones; None where it was not computed or nothing was held out.
    pub(crate) held_out: Option<f64>,
    /// What of both is gained in the readings alone, or lost where it is negative, and says nothing of the coil.
    pub(crate) in_readings: f64,
    /// What its difference from the best is not worth, because the records' air is not quite as it is taken to be.
    pub(crate) understated: f64,
    pub(crate) probability: f64,
}

impl Explanation {
    pub(crate) fn new(question: &Question, windings: &[Winding], members: Vec<Member>, fit: Fit) -> Self {
        let prior: f64 = members
            .iter()
            .map(|m| match m {
                // Any of the layers may be the one.
                Member::Effect(c) if question.candidates[*c].is_of_layer() => {
                    EFFECT.log - (question.model.coil.layers() as f64).ln()
                }
                Member::Effect(_) => EFFECT.log,
                Member::Refitted(_) => REFITTED.log,
                Member::Winding(w) => windings[*w].log_prior,
                Member::Step { record, .. } => STEP.log - (question.chamber.times_s(*record).len() as f64).ln(),
                Member::Drift | Member::Cycle => OUTSIDE.log,
            })
            .sum();
        let merit = fit.merit(rates(question.chamber, &fit)) + prior;
        let mut explanation =
            Self { members, fit, merit, held_out: None, in_readings: 0.0, understated: 0.0, probability: 0.0 };
        if explanation.is_beyond_physical() {
            // Whatever it is, it is not what it is called.
            explanation.merit += OUTSIDE.log;
        }
        explanation
    }

    /// Where it ended, to begin there.
    pub(super) fn begin(&self) -> Begin {
        (self.fit.assumed.clone(), self.fit.free.clone())
    }

    pub(super) fn has_winding(&self) -> bool {
        self.members.iter().any(|m| matches!(m, Member::Winding(_)))
    }

    /// Whether another has all of its members.
    pub(super) fn is_within(&self, other: &Explanation) -> bool {
        self.members.iter().all(|m| other.members.contains(m))
    }

    /// What another does not have.
    pub(super) fn more_than(&self, other: &Explanation) -> impl Iterator<Item = Member> {
        self.members.iter().copied().filter(|m| !other.members.contains(m))
    }

    /// The members in an order of their own.
    pub(crate) fn key(&self) -> Vec<Member> {
        key(self.members.clone())
    }

    pub(crate) fn total(&self) -> f64 {
        self.merit + self.held_out.unwrap_or(0.0) - self.in_readings + self.understated
    }

    /// Of all rates, given the readings: what of its total the records say, and not priors and prices.
    pub(super) fn log_likelihood(&self) -> f64 {
        self.fit.log_likelihood + self.held_out.unwrap_or(0.0) - self.in_readings
    }

    /// Whether something is in it that no known effect explains: a member that says so, an estimate beyond what is physical.
    pub(crate) fn is_outside(&self) -> bool {
        self.members.iter().any(|m| m.is_outside()) || self.is_beyond_physical()
    }

    pub(crate) fn is_beyond_physical(&self) -> bool {
        self.fit.parameters.iter().zip(&self.fit.coordinates).any(|(p, &x)| {
            let Place::Effect { effect, .. } = p.place else { return false };
            let at_bound = (p.scale == Scale::Logarithm && p.lower > f64::NEG_INFINITY && x - p.lower < 1e-3)
                || p.upper - x < 1e-3 * p.deviation
                || (p.scale == Scale::Linear && p.lower < 0.0 && x - p.lower < 1e-3 * p.deviation);
            // What only says what a rate follows has no size that would be unphysical.
            let is_empirical = self.fit.assumed.model.effects[effect].spec().nature == Nature::Empirical;
            at_bound || (!is_empirical && p.distance(x).abs() > PHYSICAL)
        })
    }

    /// Whether a member corrects declared numbers, all of them by less than they are known to; the model declares so many effects.
    pub(super) fn is_no_news(&self, declared: usize, member: Member) -> bool {
        let effect = match member {
            Member::Effect(_) => {
                let effects = self.members.iter().filter(|m| matches!(m, Member::Effect(_)));
                declared + effects.take_while(|m| **m != member).count()
            }
            Member::Refitted(effect) => effect,
            _ => return false,
        };
        let is_of_factor = |parameter: usize| {
            let spec = self.fit.assumed.model.effects[effect].spec().parameters.get(parameter);
            matches!(member, Member::Refitted(_)) || spec.is_some_and(is_factor)
        };
        let mut own = self.fit.parameters.iter().zip(&self.fit.coordinates).filter_map(|(p, x)| match p.place {
            Place::Effect { effect: of, parameter } if of == effect => Some((p, parameter, x)),
            _ => None,
        });
        let is_known = |(p, parameter, x): (&Parameter, usize, &f64)| {
            p.scale == Scale::Logarithm && is_of_factor(parameter) && (x - p.mean).abs() < (1.0 + KNOWN_WITHIN).ln()
        };
        // What has no number of its own is there or not.
        own.next().is_some_and(is_known) && own.all(is_known)
    }

    /// The effects that it adds to the declared model, each with its candidate.
    pub(crate) fn effects(&self, question: &Question) -> Vec<(usize, DeclaredEffect)> {
        let declared = question.model.effects.len();
        let added = self.members.iter().filter_map(|m| match m {
            Member::Effect(candidate) => Some(*candidate),
            _ => None,
        });
        added.zip(self.fit.assumed.model.effects[declared..].iter().cloned()).collect()
    }
}

/// Where a fit begins: what is assumed, and what of its effects is free.
pub(in crate::diagnose) type Begin = (Assumption, Vec<Free>);

/// What an explanation with one more member assumes, its values as given for an effect.
pub(in crate::diagnose) fn with(
    question: &Question,
    windings: &[Winding],
    from: &Fit,
    member: Member,
    values: Option<Vec<f64>>,
) -> Option<Begin> {
    let (mut assumed, mut free) = (from.assumed.clone(), from.free.clone());
    match member {
        Member::Effect(place) => {
            let candidate = &question.candidates[place];
            let effect = match values {
                Some(values) => candidate.effect.with_values(values).ok()?,
                None => candidate.effect.clone(),
            };
            let effect_place = assumed.model.effects.len();
            assumed.model.effects.push(effect);
            free.extend(candidate.free.iter().map(|&parameter| Free {
                effect: effect_place,
                parameter,
                stated: None,
                deviation: candidate.deviation,
            }));
        }
        Member::Refitted(effect) => {
            let parameters = question.model.effects[effect].values().iter().enumerate();
            free.extend(parameters.filter(|(_, v)| **v != 0.0).map(|(parameter, &value)| Free {
                effect,
                parameter,
                stated: Some(StatedNumber { value, within: STATED_WITHIN }),
                deviation: None,
            }));
        }
        Member::Winding(winding) => assumed.pattern = windings[winding].pattern.clone(),
        Member::Step { record, row } => assumed.inputs.push(step(question, record, row)),
        Member::Drift => assumed.drift = true,
        Member::Cycle => assumed.cycle = true,
    }
    Some((assumed, free))
}

/// The assumption of an explanation without one of its members.
pub(in crate::diagnose) fn without(question: &Question, from: &Explanation, place: usize) -> Begin {
    let (mut assumed, mut free) = (from.fit.assumed.clone(), from.fit.free.clone());
    let declared = question.model.effects.len();
    match from.members[place] {
        Member::Effect(_) => {
            let before = from.members[..place].iter().filter(|m| matches!(m, Member::Effect(_))).count();
            let effect = declared + before;
            assumed.model.effects.remove(effect);
            free.retain(|f| f.effect != effect);
            free.iter_mut().filter(|f| f.effect > effect).for_each(|f| f.effect -= 1);
        }
        Member::Refitted(effect) => {
            assumed.model.effects[effect] = question.model.effects[effect].clone();
            free.retain(|f| f.effect != effect);
        }
        Member::Winding(_) => assumed.pattern = question.pattern.clone(),
        Member::Step { .. } => {
            let before = from.members[..place].iter().filter(|m| matches!(m, Member::Step { .. })).count();
            assumed.inputs.remove(before);
        }
        Member::Drift => assumed.drift = false,
        Member::Cycle => assumed.cycle = false,
    }
    (assumed, free)
}

/// An offset that steps: of the size of the record's noise, give or take an order.
fn step(question: &Question, record: usize, row: usize) -> Input {
    let chamber = question.chamber;
    let course = |r: usize| {
        let rows = chamber.times_s(r).len();
        (0..rows).map(|k| f64::from(r == record && k >= row)).collect()
    };
    Input {
        name: format!("offset step at {:.0} s", chamber.times_s(record)[row]),
        rate_rad_per_s: (0..chamber.records()).map(course).collect(),
        amplitude: 0.0,
        deviation: 10.0 * chamber.noise_floor_rad_per_s(record),
        follows: Vec::new(),
    }
}

/// Members in an order of their own, whichever they joined in.
pub(super) fn key(mut members: Vec<Member>) -> Vec<Member> {
    members.sort_unstable();
    members
}

/// Best first.
pub(super) fn in_order(a: &Explanation, b: &Explanation) -> std::cmp::Ordering {
    b.merit.total_cmp(&a.merit).then_with(|| a.key().cmp(&b.key()))
}

/// Fits a set.
pub(in crate::diagnose) fn fitted(
    question: &Question,
    windings: &[Winding],
    members: Vec<Member>,
    (assumed, free): &Begin,
    from: &Fit,
    effort: Effort,
) -> Option<Explanation> {
    let fit = question.chamber.fit(assumed, free, &question.fitted, Some(from), effort).ok()?;
    Some(Explanation::new(question, windings, members, fit))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chamber::Tails;
    use crate::diagnose::experiment::fixtures::{effect, model, pattern};

    /// With one effect of the catalogue, its first parameter as given.
    fn explanation(kind: &str, values: &[f64], scale: Scale) -> Explanation {
        let assumed = Assumption::new(model(vec![effect(kind, values)]), pattern());
        let mut fit = Fit::to_nothing(assumed, Vec::new(), 1e-7);
        if let Some(value) = values.first() {
            let place = Place::Effect { effect: 0, parameter: 0 };
            let (lower, upper) = (f64::NEG_INFINITY, f64::INFINITY);
            fit.parameters.push(Parameter {
                place,
                scale,
                tails: Tails::Normal,
                mean: 0.0,
                deviation: 0.1,
                lower,
                upper,
            });
            fit.coordinates.push(if scale == Scale::Logarithm { value.ln() } else { *value });
        }
        let members = vec![Member::Effect(3)];
        Explanation { members, fit, merit: 0.0, held_out: None, in_readings: 0.0, understated: 0.0, probability: 0.0 }
    }

    #[test]
    fn a_factor_within_a_hundredth_is_no_news_and_an_effect_without_a_number_is() {
        let no_news =
            |kind: &str, values: &[f64], scale| explanation(kind, values, scale).is_no_news(0, Member::Effect(3));
        assert!(no_news("diffusivity", &[1.0015], Scale::Logarithm));
        assert!(no_news("diffusivity", &[0.992], Scale::Logarithm));
        assert!(!no_news("diffusivity", &[1.02], Scale::Logarithm));
        // Nothing was declared of these.
        assert!(!no_news("midpoint_offset", &[0.001], Scale::Linear));
        assert!(!no_news("finite_pack", &[], Scale::Linear));
    }

    #[test]
    fn a_mechanism_has_sizes_that_are_unphysical_and_what_only_follows_a_rate_has_none() {
        let large = |kind: &str| explanation(kind, &[0.4], Scale::Linear).is_beyond_physical();
        assert!(large("strain_mismatch") && !large("bias_gradient_rate"));
    }
}
