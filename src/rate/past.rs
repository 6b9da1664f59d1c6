//! Effects that remember: what came before a state, and what is wrong where a formula has no value.

use super::{CoilModel, RateError, RateModel};
use crate::effect::{DeclaredEffect, Memory, PackState, Subject};
use crate::numeric::expression::Degree;

/// What the effects of a model remember of the states before; empty: at rest.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Past {
    /// One entry an effect.
    of: Vec<Memory>,
}

/// The formula of an effect that has one.
pub(super) fn formula_of(effect: &DeclaredEffect) -> String {
    match effect.subject() {
        Subject::Formula(formula) => formula.expression().source().to_owned(),
        Subject::None | Subject::Channel(_) | Subject::Materials(_) => String::new(),
    }
}

impl CoilModel {
    /// Whether the rate depends on states that came before.
    pub(crate) fn remembers(&self) -> bool {
        self.effects.iter().any(|e| e.bind(&self.coil, &[]).remembers())
    }

    /// The model without formulas that are not linear in the rates of temperature, which have no guaranteed worst case
    /// together with the coil; and each of those with the largest size it may have [rad/s], infinite where it has none.
    pub(crate) fn without_unguaranteed(&self, max_rate_k_per_s: f64) -> (Self, Vec<(String, f64)>) {
        let (mut rest, mut left_out) = (self.clone(), Vec::new());
        rest.effects.retain(|effect| {
            let Subject::Formula(formula) = effect.subject() else { return true };
            if effect.bind(&self.coil, &[]).is_linear() {
                return true;
            }
            let bound = formula.bound_rad_per_s(effect.values(), max_rate_k_per_s);
            left_out.push((formula.expression().source().to_owned(), bound));
            false
        });
        (rest, left_out)
    }
}

impl RateModel {
    /// Whether the rate depends on states that came before.
    pub(crate) fn remembers(&self) -> bool {
        self.effects.iter().any(|e| e.remembers())
    }

    /// Whether what is outside the coil depends on the coil's own rate.
    pub(super) fn follows_thermal_rate(&self) -> bool {
        self.effects.iter().any(|e| e.degree_in_thermal_rate() != Degree::Not)
    }

    pub(super) fn outside_rad_per_s(&self, state: &PackState, past: &mut Past) -> f64 {
        past.of.resize(self.effects.len(), Memory::default());
        self.effects.iter().zip(&mut past.of).map(|(e, memory)| e.outside_rate_after(state, memory)).sum()
    }

    /// # Errors
    /// A formula that is not linear in the coil's own rate: no sum over layer weights holds it.
    pub(crate) fn check_searchable(&self) -> Result<(), RateError> {
        match self.effects.iter().position(|e| e.degree_in_thermal_rate() == Degree::Beyond) {
            Some(place) => Err(RateError::NotSearchable { formula: self.formulas[place].clone() }),
            None => Ok(()),
        }
    }

    /// Which formula has no value at a state, and why; None where all have one. The past is what was before.
    pub(crate) fn fault(&self, state: &PackState, past: &Past) -> Option<RateError> {
        let coil = self.thermal_rate_rad_per_s(state);
        let state = PackState { thermal_rate_rad_per_s: coil, ..*state };
        let at_rest = Memory::default();
        self.effects.iter().enumerate().find_map(|(place, effect)| {
            let fault = effect.fault(&state, past.of.get(place).unwrap_or(&at_rest))?;
            Some(RateError::Formula { formula: self.formulas[place].clone(), time_s: state.time_s, fault })
        })
    }

    /// # Errors
    /// What [`RateModel::fault`] says, where a rate is no number.
    pub(crate) fn checked_after(&self, state: &PackState, past: &mut Past) -> Result<f64, RateError> {
        let before = self.has_formulas().then(|| past.clone());
        let rate = self.rate_error_after(state, past);
        match before.filter(|_| !rate.is_finite()).and_then(|before| self.fault(state, &before)) {
            Some(fault) => Err(fault),
            None => Ok(rate),
        }
    }

    /// Whether the user's own formulas are part of it.
    pub(crate) fn has_formulas(&self) -> bool {
        self.formulas.iter().any(|f| !f.is_empty())
    }
}
