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
//! | T_layer_7, dT_layer_7_dt | any layer's temperature and rate, counted from 1 innermost | °C, K/s |
//! | thermal_rate | the model's own thermal rate error | °/h |
//!
//! `lag(x, tau_s)` and `play(x, half_width)` remember what x was before and begin at rest, y = x.
//!
//! Every other name is a parameter, if the model file lists it, or a column of the record. A profile has no columns;
//! a formula that reads one adds nothing there. Where the rate is a mean over `rate_mean_s`, so is a column, by straight lines between rows:
//! a rate sees what a current was since the row before, not only what it is at the row.

use thiserror::Error;

use super::{Acts, Binding, Effect, EffectSpec, Memory, Nature, PackState, Subject};
use crate::numeric::expression::{Degree, EvaluationError, Expression, ExpressionError, ValueRange};
use crate::units::{celsius_from_kelvin, deg_per_h_from_rad_per_s, rad_per_s_from_deg_per_h};

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "custom",
    summary: "A bias in °/h by a formula of the user's own, with named parameters under [effect.parameters]",
    equation: "Ω_b = formula(t, T, dT_dt, T_in, T_mean, mean_rate, T_ambient, dT_ambient_dt, T_layer_1 …, thermal_rate, parameters, columns), also of lag(x, tau_s) and play(x, half_width)",
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

/// The variables that every formula may use, besides those of single layers.
pub(crate) const VARIABLES: [&str; 10] =
    ["t", "T", "dT_dt", "T_in", "T_inner", "T_mean", "mean_rate", "T_ambient", "dT_ambient_dt", THERMAL_RATE];

/// The model's own thermal rate error.
pub(crate) const THERMAL_RATE: &str = "thermal_rate";

/// A variable of one layer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum OfLayer {
    /// Index 0 is the innermost.
    Temperature(usize),
    Rate(usize),
}

impl OfLayer {
    /// `T_layer_K` or `dT_layer_K_dt`, K counted from 1 innermost; None for any other name.
    pub(crate) fn named(name: &str) -> Option<Self> {
        let number = |digits: &str| {
            let plain = !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit()) && !digits.starts_with('0');
            digits.parse::<usize>().ok().filter(|_| plain).map(|n| n - 1)
        };
        if let Some(digits) = name.strip_prefix("T_layer_") {
            return number(digits).map(OfLayer::Temperature);
        }
        number(name.strip_prefix("dT_layer_")?.strip_suffix("_dt")?).map(OfLayer::Rate)
    }

    /// Index 0 is the innermost.
    pub(crate) fn layer(self) -> usize {
        match self {
            OfLayer::Temperature(layer) | OfLayer::Rate(layer) => layer,
        }
    }
}

/// Whether a name is a variable that the model gives a value to.
pub(crate) fn is_variable(name: &str) -> bool {
    VARIABLES.contains(&name) || OfLayer::named(name).is_some()
}

/// A formula with its parameters' names.
#[derive(Debug, Clone, PartialEq)]
pub struct Formula {
    expression: Expression,
    parameters: Vec<String>,
    channels: Vec<String>,
}

/// Why a formula makes no effect.
#[derive(Debug, Error, Clone, PartialEq)]
#[allow(missing_docs, reason = "its messages say what each means")]
#[non_exhaustive]
pub enum FormulaError {
    #[error(transparent)]
    Expression(#[from] ExpressionError),
    #[error("parameter {name} has the name of a variable: rename it")]
    Shadows { name: String },
    #[error("parameter {name} does not occur in the formula: remove it or use it")]
    Unused { name: String },
    #[error("{name} is not a layer of this coil: its layers are 1, the innermost, to {layers}")]
    NoSuchLayer { name: String, layers: usize, at: std::ops::Range<usize> },
}

impl FormulaError {
    /// Where in the formula (bytes), if it is one place.
    pub(crate) fn at(&self) -> Option<std::ops::Range<usize>> {
        match self {
            FormulaError::Expression(error) => error.at(),
            FormulaError::NoSuchLayer { at, .. } => Some(at.clone()),
            FormulaError::Shadows { .. } | FormulaError::Unused { .. } => None,
        }
    }
}

impl Formula {
    /// # Errors
    /// Text that is no formula; parameters that shadow a variable or that the formula does not use.
    pub fn new(source: &str, parameters: Vec<String>) -> Result<Self, FormulaError> {
        let expression = Expression::parse(source)?;
        for name in &parameters {
            if is_variable(name) {
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
            .filter(|name| !is_variable(name) && !parameters.contains(name))
            .collect();
        Ok(Self { expression, parameters, channels })
    }

    pub(crate) fn expression(&self) -> &Expression {
        &self.expression
    }

    /// In the order in which values are given.
    pub(crate) fn parameters(&self) -> &[String] {
        &self.parameters
    }

    /// The columns of a record that the formula reads.
    pub(crate) fn channels(&self) -> &[String] {
        &self.channels
    }

    /// Whether a parameter is nothing but a time constant or a half width, and so above zero.
    pub(crate) fn is_size(&self, parameter: &str) -> bool {
        let variable = self.expression.variables().iter().position(|v| v.name == parameter);
        variable.is_some_and(|v| self.expression.is_size(v))
    }

    /// # Errors
    /// A variable of a layer that a coil of so many layers lacks.
    pub(crate) fn check_layers(&self, layers: usize) -> Result<(), FormulaError> {
        let beyond = |v: &&crate::numeric::expression::Variable| {
            OfLayer::named(&v.name).is_some_and(|of| of.layer() >= layers) && !self.parameters.contains(&v.name)
        };
        match self.expression.variables().iter().find(beyond) {
            Some(v) => Err(FormulaError::NoSuchLayer { name: v.name.clone(), layers, at: v.at.clone() }),
            None => Ok(()),
        }
    }

    /// How it depends on variables that `which` picks by name; parameters are numbers.
    fn degree(&self, which: &dyn Fn(&str) -> bool) -> Degree {
        let variables = self.expression.variables();
        self.expression.degree(&|v| !self.parameters.contains(&variables[v].name) && which(&variables[v].name))
    }

    /// The largest size [rad/s] under any profile without columns whose rates stay within a bound; infinite where it has none.
    /// `values` in the order of the parameters.
    pub(crate) fn bound_rad_per_s(&self, values: &[f64], max_rate_k_per_s: f64) -> f64 {
        if !self.channels.is_empty() {
            return 0.0;
        }
        let rates = ValueRange { low: -max_rate_k_per_s, high: max_rate_k_per_s };
        let of = |name: &str| match self.parameters.iter().position(|p| p == name) {
            Some(place) => ValueRange::at(values[place]),
            None if is_rate(name) => rates,
            None if name == "t" => ValueRange { low: 0.0, high: f64::INFINITY },
            None => ValueRange::EVERYTHING,
        };
        let bounds: Vec<ValueRange> = self.expression.variables().iter().map(|v| of(&v.name)).collect();
        rad_per_s_from_deg_per_h(self.expression.range(&bounds).size())
    }
}

/// Whether a variable is a rate of temperature, which no layer exceeds the drive in.
fn is_rate(name: &str) -> bool {
    matches!(name, "dT_dt" | "mean_rate" | "dT_ambient_dt") || matches!(OfLayer::named(name), Some(OfLayer::Rate(_)))
}

/// Where a variable's value comes from.
#[derive(Debug, Clone, Copy)]
enum Origin {
    Known(usize),
    Layer(OfLayer),
    Parameter(f64),
    Channel(usize),
    /// A column that is not there.
    Absent,
}

#[derive(Debug)]
struct CustomBias {
    /// None only where the effect was declared without a formula, which `DeclaredEffect` does not allow.
    formula: Option<Formula>,
    origins: Vec<Origin>,
}

impl CustomBias {
    fn new(values: &[f64], binding: &Binding) -> Self {
        let Subject::Formula(formula) = binding.subject else {
            return Self { formula: None, origins: Vec::new() };
        };
        let origins = formula
            .expression
            .variables()
            .iter()
            .map(|variable| {
                if let Some(i) = VARIABLES.iter().position(|v| *v == variable.name) {
                    Origin::Known(i)
                } else if let Some(of) = OfLayer::named(&variable.name) {
                    if of.layer() < binding.coil.layers() { Origin::Layer(of) } else { Origin::Absent }
                } else if let Some(i) = formula.parameters.iter().position(|p| *p == variable.name) {
                    Origin::Parameter(values[i])
                } else {
                    binding.channels.iter().position(|c| *c == variable.name).map_or(Origin::Absent, Origin::Channel)
                }
            })
            .collect();
        Self { formula: Some(formula.clone()), origins }
    }

    /// In the order of the expression's variables; None where a column is not there.
    fn values(&self, state: &PackState) -> Option<Vec<f64>> {
        let known = known(state);
        self.origins
            .iter()
            .map(|origin| match *origin {
                Origin::Known(i) => Some(known[i]),
                Origin::Layer(OfLayer::Temperature(layer)) => Some(celsius_from_kelvin(state.temperatures_k[layer])),
                Origin::Layer(OfLayer::Rate(layer)) => Some(state.rates_k_per_s[layer]),
                Origin::Parameter(value) => Some(value),
                Origin::Channel(i) => state.channels.get(i).copied(),
                Origin::Absent => None,
            })
            .collect()
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
        deg_per_h_from_rad_per_s(state.thermal_rate_rad_per_s),
    ]
}

impl Effect for CustomBias {
    /// A formula may be anything; one without a column's value adds nothing.
    fn is_linear(&self) -> bool {
        self.formula.as_ref().is_none_or(|f| {
            let in_rates = f.degree(&|name| is_rate(name) || name == THERMAL_RATE);
            in_rates == Degree::Homogeneous
                && f.degree(&|name| is_variable(name) && !is_rate(name) && name != THERMAL_RATE) == Degree::Not
                && f.channels.is_empty()
        })
    }

    fn outside_rate_rad_per_s(&self, state: &PackState) -> f64 {
        let (Some(formula), Some(values)) = (&self.formula, self.values(state)) else { return 0.0 };
        rad_per_s_from_deg_per_h(formula.expression.evaluate(&values))
    }

    fn outside_rate_after(&self, state: &PackState, memory: &mut Memory) -> f64 {
        let (Some(formula), Some(values)) = (&self.formula, self.values(state)) else { return 0.0 };
        rad_per_s_from_deg_per_h(formula.expression.evaluate_after(&values, state.time_s, memory))
    }

    /// Layers' temperatures are the pack's, whichever fibre lies there.
    fn is_beside_coil(&self) -> bool {
        self.formula.is_some() && self.degree_in_thermal_rate() == Degree::Not
    }

    fn remembers(&self) -> bool {
        self.formula.as_ref().is_some_and(|f| f.expression.remembers())
    }

    fn degree_in_thermal_rate(&self) -> Degree {
        self.formula.as_ref().map_or(Degree::Not, |f| f.degree(&|name| name == THERMAL_RATE))
    }

    fn fault(&self, state: &PackState, memory: &Memory) -> Option<EvaluationError> {
        let (formula, values) = (self.formula.as_ref()?, self.values(state)?);
        formula.expression.fault(&values, state.time_s, memory)
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

    #[test]
    fn layers_are_variables_by_their_number_and_must_be_there() {
        let formula = Formula::new("a*(T_layer_3 - T_layer_12) + dT_layer_1_dt + T_layer_0", vec!["a".into()]).unwrap();
        assert_eq!(formula.channels(), ["T_layer_0"]);
        assert!(formula.check_layers(12).is_ok());
        assert_eq!(formula.check_layers(11).unwrap_err().at(), Some(15..25));
    }

    #[test]
    fn a_formula_is_bounded_where_rates_or_a_saturation_bound_it() {
        let bound = |source: &str| {
            let formula = Formula::new(source, vec!["a".into()]).unwrap();
            deg_per_h_from_rad_per_s(formula.bound_rad_per_s(&[0.5], 0.003))
        };
        assert!((bound("a*tanh(T - 40)") - 0.5).abs() < 1e-12);
        assert!((bound("a*lag(abs(dT_dt), 100)*1000") - 1.5).abs() < 1e-12);
        assert_eq!(bound("a*T_mean"), f64::INFINITY);
    }
}
