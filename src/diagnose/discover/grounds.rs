//! What a set's terms are made of: the variables by the set's own coil, and where they go with it.
//!
//! Layers are what the readings imply by a model: of a pack on a spool they run otherwise than of a bare one, and with a thermometer
//! that lags they run ahead of it. An effect of the coil or of the sensor so changes what a formula reads, often by more than it
//! changes the rate itself. A set is fitted with both:
//!
//! ```text
//! term(p) = term(p₀) + Σ ∂term/∂p (p − p₀),   p: what is free of the listed effects that readings depend on
//! ```
//!
//! and its variables are made anew where p was found to be elsewhere.

use std::sync::Arc;

use super::courses::Courses;
use super::grammar::Term;
use super::search::{Set, Tools, WORTH_LISTED};
use crate::chamber::{Assumption, ChamberError, Column, Effort, Fit, Follow, Free, Input, Quantity};
use crate::diagnose::candidate::Candidate;
use crate::diagnose::joint::{Member, Proposal, Question, fitted, is_seen, proposals_along};
use crate::numeric::order::sort_descending;
use crate::parallel::InParallel;
use crate::rate::CoilModel;

/// Variables along the records, and the same with each number of the coil moved a little.
#[derive(Debug, Clone)]
pub(crate) struct Grounds {
    /// By which its courses are.
    model: CoilModel,
    pub(crate) courses: Courses,
    moved: Vec<Moved>,
}

#[derive(Debug, Clone)]
struct Moved {
    effect: usize,
    parameter: usize,
    about: f64,
    step: f64,
    /// Over the fitted records.
    courses: Courses,
}

/// Rounds in which a set's variables are made anew, and the share of their range by which they may be off: a tenth of the best stated
/// error of an amplitude.
const GROUNDED: usize = 2;
pub(super) const SAME: f64 = 1e-3;
/// Starts of effects of the coil that are fitted with a formula at once.
const PAIRED: usize = 4;
/// Relative step of a derivative by a number of the coil.
const STEP_SHARE: f64 = 0.02;

/// Which listed effects are scored beside a set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sought {
    Everything,
    /// Those of the coil and of the sensor that move the variables of its terms.
    WhatMoves,
}

impl Grounds {
    /// By a fit; `days` have the chambers of records that were not fitted.
    ///
    /// # Errors
    /// A model that cannot be solved.
    pub(crate) fn new(question: &Question, fit: &Fit, days: &[Fit]) -> Result<Self, ChamberError> {
        let film = fit.records.first().map(|&r| fit.number(Quantity::Film, r));
        let days: Vec<Fit> = days
            .iter()
            .map(|day| {
                let mut day = day.clone();
                day.assumed = fit.assumed.clone();
                film.into_iter().for_each(|film| day.set_number(Quantity::Film, film));
                day
            })
            .collect();
        let courses = courses(question, fit, &days)?;
        let moved: Vec<Moved> =
            fit.free.iter().in_parallel().filter_map(|free| Moved::new(question, fit, free)).collect();
        Ok(Self { model: fit.assumed.model.clone(), courses, moved })
    }

    /// Whether they are also those of another model.
    pub(super) fn are_of(&self, model: &CoilModel) -> bool {
        !is_seen(model, &self.model)
    }

    /// Whether they go anywhere with the coil.
    pub(crate) fn moves(&self) -> bool {
        !self.moved.is_empty()
    }

    /// A term's column, and where it goes.
    pub(crate) fn column(&self, term: &Term) -> (Column, Vec<Follow>) {
        let column = self.courses.column(term);
        let follows = self.moved.iter().map(|moved| {
            let there = moved.courses.column(term);
            let pairs = there.rate_rad_per_s.iter().zip(&column.rate_rad_per_s);
            let slope = |(t, c): (&Vec<f64>, &Vec<f64>)| t.iter().zip(c).map(|(t, c)| (t - c) / moved.step).collect();
            let Moved { effect, parameter, about, .. } = *moved;
            Follow { effect, parameter, about, slope_rad_per_s: pairs.map(slope).collect() }
        });
        let follows = follows.collect();
        (column, follows)
    }
}

impl Moved {
    /// None for what readings do not depend on.
    fn new(question: &Question, fit: &Fit, free: &Free) -> Option<Self> {
        let model = &fit.assumed.model;
        let mut without = model.clone();
        let effect = without.effects.remove(free.effect);
        if !is_seen(model, &without) {
            return None;
        }
        let about = *effect.values().get(free.parameter)?;
        let spec = effect.spec().parameters.get(free.parameter)?;
        let size = if about == 0.0 { spec.unit.to_si(spec.start).abs() } else { about.abs() };
        [STEP_SHARE, -STEP_SHARE].into_iter().find_map(|share| {
            let step = share * size;
            let mut values = effect.values().to_vec();
            values[free.parameter] += step;
            let mut there = fit.clone();
            let Ok(moved) = effect.with_values(values) else { return None };
            there.assumed.model.effects[free.effect] = moved;
            let Ok(courses) = courses(question, &there, &[]) else { return None };
            Some(Self { effect: free.effect, parameter: free.parameter, about, step, courses })
        })
    }
}

/// The variables by a fit.
///
/// # Errors
/// A model that cannot be solved.
pub(crate) fn courses(question: &Question, fit: &Fit, days: &[Fit]) -> Result<Courses, ChamberError> {
    let coil = fit.assumed.model.wound_coil()?;
    Courses::new(question.chamber, fit, days, coil.layer_lengths_m())
}

impl Tools<'_, '_> {
    /// What terms are made of by a fit; where it cannot be solved, by that which the search began with.
    pub(crate) fn grounds_of(&self, fit: &Fit) -> Arc<Grounds> {
        Grounds::new(self.question, fit, &self.days).map_or_else(|_| Arc::clone(&self.grounds), Arc::new)
    }

    /// A set's terms with other listed effects; where readings depend on those, its variables are made anew.
    pub(crate) fn with_coil(&self, set: &Set, members: Vec<Member>, begin: (Assumption, Vec<Free>)) -> Option<Set> {
        let (mut assumed, free) = begin;
        let fit = &set.explanation.fit;
        let mut grounds = Arc::clone(&set.grounds);
        let is_moved = set.grounds.moves() || is_seen(&assumed.model, &fit.assumed.model);
        if is_moved && !set.terms.is_empty() {
            let mut there = fit.clone();
            (there.assumed.model, there.free) = (assumed.model.clone(), free.clone());
            grounds = self.grounds_of(&there);
            let first = assumed.inputs.len() - set.terms.len();
            for (place, term) in set.terms.iter().enumerate() {
                let carried = self.carried(&assumed.inputs[first + place], &grounds.courses.column(term));
                assumed.inputs[first + place] = self.input(&grounds, term, carried);
            }
        }
        let found = fitted(self.question, self.windings, members, &(assumed, free), fit, Effort::QUICK)?;
        if is_moved && set.terms.is_empty() {
            grounds = self.grounds_of(&found.fit);
        }
        Some(self.set(found, set.terms.clone(), &grounds))
    }

    /// A set whose variables are those of its own fit, as far as its coil moved them.
    pub(crate) fn grounded(&self, mut set: Set) -> Set {
        if set.terms.is_empty() || !set.grounds.moves() {
            return set;
        }
        for _ in 0..GROUNDED {
            let grounds = self.grounds_of(&set.explanation.fit);
            if grounds.courses.apart(&set.grounds.courses) <= SAME {
                break;
            }
            let there = Set { grounds, ..set.clone() };
            let begin = (self.assumed_with(&there, &there.terms), there.explanation.fit.free.clone());
            let (members, fit) = (there.explanation.members.clone(), &there.explanation.fit);
            let Some(found) = fitted(self.question, self.windings, members, &begin, fit, Effort::QUICK) else { break };
            set = self.set(found, there.terms, &there.grounds);
        }
        set
    }

    /// With numbers and variables that follow its fit.
    pub(crate) fn consistent(&self, set: Set) -> Set {
        self.followed(self.grounded(set))
    }

    /// The amplitude with which a term of other variables does most nearly what it did: where a difference is three times as large, a
    /// third of it.
    fn carried(&self, input: &Input, there: &Column) -> f64 {
        let (mut product, mut square) = (0.0, 0.0);
        for &r in &self.question.fitted {
            let (before, after) = (&input.rate_rad_per_s[r], &there.rate_rad_per_s[r]);
            let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len().max(1) as f64;
            let (own, other) = (mean(before), mean(after));
            for (b, a) in before.iter().zip(after) {
                product += (b - own) * (a - other);
                square += (a - other).powi(2);
            }
        }
        let share = product / square;
        input.amplitude * if share.is_finite() { share } else { 1.0 }
    }

    /// Sets of one term and an effect of the coil or the sensor that moves its variables: with the wrong ones a true formula may do worse on
    /// other records than none.
    pub(crate) fn paired(&self, bare: &Set, tried: &[Set]) -> Vec<Set> {
        let is_moved = |s: &&Set| {
            s.terms.len() == 1
                && s.merit > bare.merit
                && s.explanation.members.len() == bare.explanation.members.iter().filter(|m| !m.is_outside()).count()
                && s.terms[0].family.is_of_coil()
        };
        let Some(foremost) = tried.iter().filter(is_moved).max_by(|a, b| a.merit.total_cmp(&b.merit)) else {
            return Vec::new();
        };
        let Ok(mut listed) = self.listed_beside(foremost, Sought::WhatMoves) else { return Vec::new() };
        listed.retain(|p| p.gain > WORTH_LISTED);
        sort_descending(&mut listed, |item| item.gain);
        listed.truncate(PAIRED);
        let found: Vec<Set> = listed.iter().in_parallel().filter_map(|p| self.with_listed(foremost, p)).collect();
        let gains = found.into_iter().filter(|s| s.merit > foremost.merit);
        gains.collect::<Vec<_>>().in_parallel().map(|s| self.judged(self.consistent(s))).collect()
    }

    /// The score test of every listed effect beside a set, with what it makes of the variables of its terms.
    pub(crate) fn listed_beside(&self, set: &Set, sought: Sought) -> Result<Vec<Proposal>, ChamberError> {
        let fit = &set.explanation.fit;
        let along = |candidate: &Candidate, assumed: &mut Assumption| {
            // One layer's gap moves the variables by little, and there are as many as layers.
            let moves = !candidate.is_of_layer() && is_seen(&assumed.model, &fit.assumed.model);
            if set.terms.is_empty() || !moves {
                return sought == Sought::Everything;
            }
            let mut there = fit.clone();
            there.assumed.model = assumed.model.clone();
            let Ok(courses) = courses(self.question, &there, &[]) else { return false };
            let first = assumed.inputs.len() - set.terms.len();
            for (input, term) in assumed.inputs[first..].iter_mut().zip(&set.terms) {
                let column = courses.column(term);
                input.amplitude = self.carried(input, &column);
                input.rate_rad_per_s = column.rate_rad_per_s;
                input.follows.clear();
            }
            true
        };
        proposals_along(self.question, &set.explanation, &along)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chamber::{Chamber, Place};
    use crate::diagnose::candidate;
    use crate::diagnose::discover::grammar::{Allowed, families, variables};
    use crate::diagnose::experiment::fixtures::{effect, model, pattern};
    use crate::diagnose::tests::of_first_record;
    use crate::numeric::piecewise::PiecewiseLinear;
    use crate::record::Record;
    use crate::thermal::exposure::expose;

    /// Ramps without a rate but noise: what is read of a pack.
    fn record() -> Record {
        let model = model(Vec::new());
        let times_s: Vec<f64> = (1..=300).map(|i| 10.0 * f64::from(i)).collect();
        let air = PiecewiseLinear::new(
            vec![0.0, 500.0, 1200.0, 2100.0, 3000.0],
            vec![293.15, 293.15, 308.15, 288.15, 288.15],
        );
        let exposed = expose(&model.heat_path().unwrap(), Some(25.0), 0.0, &air.unwrap(), &times_s).unwrap();
        let wave = |i: usize, f: f64| ((i * i) as f64 * f).sin();
        let shown = exposed.shown_k.iter().enumerate().map(|(i, t)| t + 0.002 * wave(i, 0.7)).collect();
        let rates = (0..times_s.len()).map(|i| 2e-7 * wave(i, 1.3)).collect();
        Record::new("ramps".to_owned(), times_s, shown, rates).unwrap()
    }

    #[test]
    fn a_term_goes_with_the_coil_as_it_does_where_its_variables_are_made_anew() {
        let (pattern, record) = (pattern(), record());
        let with = model(vec![effect("sensor_lag", &[60.0])]);
        let chamber = Chamber::new(&with, &[&record]).unwrap();
        let candidates = candidate::candidates(&with, &[&record]);
        let question = of_first_record(&chamber, &with, &pattern, &candidates, 1);
        let free = [Free { effect: 0, parameter: 0, stated: None, deviation: None }];
        let mut fit = chamber.fit_anew(&Assumption::new(with.clone(), pattern.clone()), &free, &[0]).unwrap();
        let lag_s = |lag: f64, fit: &mut Fit| fit.assumed.model.effects[0] = effect("sensor_lag", &[lag]);
        lag_s(60.0, &mut fit);
        let here = Grounds::new(&question, &fit, &[]).unwrap();
        assert!(here.moves());
        // A formula beside the declared model reads other layers, and so does one beside another lag.
        assert!(here.are_of(&fit.assumed.model) && !here.are_of(&model(Vec::new())));
        lag_s(66.0, &mut fit);
        assert!(!here.are_of(&fit.assumed.model));
        let there = Grounds::new(&question, &fit, &[]).unwrap();
        let of =
            |text: &str| families(&variables(&here.courses), &Allowed::default()).into_iter().find(|f| f.text == text);
        for text in ["mean_rate*(T_mean - 20)", "(T - T_in)^2", "t"] {
            let term = Term { family: of(text).unwrap(), inner: Vec::new() };
            let (column, follows) = here.column(&term);
            let truth = there.courses.column(&term).rate_rad_per_s.swap_remove(0);
            let moved = |k: usize| column.rate_rad_per_s[0][k] + 6.0 * follows[0].slope_rad_per_s[0][k];
            let size = |of: &dyn Fn(usize) -> f64| (0..truth.len()).map(|k| of(k).powi(2)).sum::<f64>().sqrt();
            let change = size(&|k| truth[k] - column.rate_rad_per_s[0][k]);
            let left = size(&|k| truth[k] - moved(k));
            println!(
                "{text}: changes by {:.3} of itself, of which {:.3} is left",
                change / size(&|k| truth[k]),
                left / change
            );
            assert!(if text == "t" { change == 0.0 } else { left < 0.15 * change && change > 0.0 }, "{text}");
        }
        // A coil whose rate alone is changed leaves the variables where they are.
        let stress = model(vec![effect("stress_gradient", &[0.1])]);
        let fit = chamber.fit(&Assumption::new(stress, pattern.clone()), &free, &[0], None, Effort::SHORT).unwrap();
        assert!(fit.parameters.iter().any(|p| p.place == Place::Effect { effect: 0, parameter: 0 }));
        assert!(!Grounds::new(&question, &fit, &[]).unwrap().moves());
    }
}
