//! `custom`: a bias by a formula of the user's own.
//!
//! ```text
//! Ω_b [°/h] = formula(t, T, dT_dt, T_in, …, named parameters, columns of the record)
//! ```
//!
//! | variable | meaning | unit |
//! |---|---|---|
//! | t | time in the record or profile | s |
//! | T | the outermost layer's temperature | °C |
//! | dT_dt | its rate | K/s |
//! | T_in, T_inner | the innermost layer's temperature | °C |
//! | T_mean | the pack's mean temperature | °C |
//! | mean_rate | its rate | K/s |
//! | T_ambient, dT_ambient_dt | the ambient's temperature and rate | °C, K/s |
//!
//! Every other name is a parameter, if the model file lists it, or a column of the record. A profile has no columns;
//! a formula that reads one adds nothing there.

use thiserror::Error;

use super::{Acts, Binding, Effect, EffectSpec, Nature, PackState, Subject};
use crate::numeric::expression::{Expression, ExpressionError};
use crate::units::{celsius_from_kelvin, rad_per_s_from_deg_per_h};

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "custom",
    summary: "A bias in °/h by a formula of the user's own, with named parameters under [effect.parameters]",
    equation: "Ω_b = formula(t, T, dT_dt, T_in, T_mean, mean_rate, T_ambient, dT_ambient_dt, parameters, columns)",
    acts: Acts::Outside,
    nature: Nature::Formula,
    parameters: &[],
    choices: &[],
    source: "the user",
    signature: "whatever the formula describes",
    happens: "The rate holds what the formula describes.",
    remedy: "Compensate with the formula; where it stands for a cause, name and remove the cause.",
    experiment: "the one that changes the formula's variables one at a time",
    build: |values, _, binding| Box::new(CustomBias::new(values, binding)),
};

/// The variables that every formula may use.
pub const VARIABLES: [&str; 9] =
    ["t", "T", "dT_dt", "T_in", "T_inner", "T_mean", "mean_rate", "T_ambient", "dT_ambient_dt"];

/// A formula with its parameters' names.
#[derive(Debug, Clone, PartialEq)]
pub struct Formula {
    expression: Expression,
    parameters: Vec<String>,
    channels: Vec<String>,
}

#[derive(Debug, Error, Clone, PartialEq)]
pub enum FormulaError {
    #[error(transparent)]
    Expression(#[from] ExpressionError),
    #[error("parameter {name} has the name of a variable: rename it")]
    Shadows { name: String },
    #[error("parameter {name} does not occur in the formula: remove it or use it")]
    Unused { name: String },
}

impl Formula {
    /// # Errors
    /// Text that is no formula; parameters that shadow a variable or that the formula does not use.
    pub fn new(source: &str, parameters: Vec<String>) -> Result<Self, FormulaError> {
        let expression = Expression::parse(source)?;
        for name in &parameters {
            if VARIABLES.contains(&name.as_str()) {
                return Err(FormulaError::Shadows { name: name.clone() });
            }
            if !expression.variables().iter().any(|v| v.name == *name) {
                return Err(FormulaError::Unused { name: name.clone() });
            }
        }
        let channels = expression
            .variables()
            .iter()
            .map(|v| v.name.clone())
            .filter(|name| !VARIABLES.contains(&name.as_str()) && !parameters.contains(name))
            .collect();
        Ok(Self { expression, parameters, channels })
    }

    pub fn expression(&self) -> &Expression {
        &self.expression
    }

    /// In the order in which values are given.
    pub fn parameters(&self) -> &[String] {
        &self.parameters
    }

    /// The columns of a record that the formula reads.
    pub fn channels(&self) -> &[String] {
        &self.channels
    }
}

/// Where a variable's value comes from.
#[derive(Debug, Clone, Copy)]
enum Origin {
    Known(usize),
    Parameter(f64),
    Channel(usize),
    /// A column that is not there.
    Absent,
}

#[derive(Debug)]
struct CustomBias {
    /// None only where the effect was declared without a formula, which `DeclaredEffect` does not allow.
    expression: Option<Expression>,
    origins: Vec<Origin>,
}

impl CustomBias {
    fn new(values: &[f64], binding: &Binding) -> Self {
        let Subject::Formula(formula) = binding.subject else {
            return Self { expression: None, origins: Vec::new() };
        };
        let origins = formula
            .expression
            .variables()
            .iter()
            .map(|variable| {
                if let Some(i) = VARIABLES.iter().position(|v| *v == variable.name) {
                    Origin::Known(i)
                } else if let Some(i) = formula.parameters.iter().position(|p| *p == variable.name) {
                    Origin::Parameter(values[i])
                } else {
                    binding.channels.iter().position(|c| *c == variable.name).map_or(Origin::Absent, Origin::Channel)
                }
            })
            .collect();
        Self { expression: Some(formula.expression.clone()), origins }
    }
}

/// In the order of [`VARIABLES`].
fn known(state: &PackState) -> [f64; VARIABLES.len()] {
    let outer = state.temperatures_k.len() - 1;
    let inner_c = celsius_from_kelvin(state.temperatures_k[0]);
    [
        state.time_s,
        celsius_from_kelvin(state.temperatures_k[outer]),
        state.rates_k_per_s[outer],
        inner_c,
        inner_c,
        celsius_from_kelvin(state.mean_temperature_k),
        state.mean_rate_k_per_s,
        celsius_from_kelvin(state.ambient_k),
        state.ambient_rate_k_per_s,
    ]
}

impl Effect for CustomBias {
    /// A formula may be anything.
    fn is_linear(&self) -> bool {
        false
    }

    fn outside_rate_rad_per_s(&self, state: &PackState) -> f64 {
        let Some(expression) = &self.expression else { return 0.0 };
        let known = known(state);
        let mut values = Vec::with_capacity(self.origins.len());
        for origin in &self.origins {
            values.push(match *origin {
                Origin::Known(i) => known[i],
                Origin::Parameter(value) => value,
                Origin::Channel(i) => match state.channels.get(i) {
                    Some(value) => *value,
                    None => return 0.0,
                },
                Origin::Absent => return 0.0,
            });
        }
        rad_per_s_from_deg_per_h(expression.evaluate(&values))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_sorted_into_variables_parameters_and_columns() {
        let formula = Formula::new("a*dT_dt + b*supply_v*T", vec!["a".into(), "b".into()]).unwrap();
        assert_eq!(formula.channels(), ["supply_v"]);
        assert_eq!(formula.parameters(), ["a", "b"]);
    }

    #[test]
    fn parameters_that_shadow_or_are_not_used_are_refused() {
        assert!(matches!(Formula::new("T", vec!["T".into()]), Err(FormulaError::Shadows { .. })));
        assert!(matches!(Formula::new("T", vec!["a".into()]), Err(FormulaError::Unused { .. })));
    }
}
