//! An effect with its parameters, as a model declares it.

use thiserror::Error;

use super::{
    Acts, Address, Binding, CHANNEL, CUSTOM, Effect, EffectSpec, FILM, ParameterSpec, Subject, THERMAL_STRESS, custom,
    thermal_stress,
};
use crate::coil::Coil;
use crate::stress::Materials;
use crate::units::Unit;

/// An effect with its parameters, as a model declares it.
#[derive(Debug, Clone)]
pub struct DeclaredEffect {
    spec: &'static EffectSpec,
    /// SI, in the order of the spec.
    values: Vec<f64>,
    choices: Vec<usize>,
    subject: Subject,
}

/// One parameter of a declared effect, whether its spec or the user names it.
#[derive(Debug, Clone, PartialEq)]
pub struct DeclaredParameter {
    pub(crate) key: String,
    pub(crate) unit: Unit,
    /// SI.
    pub(crate) lower: f64,
    pub(crate) upper: f64,
}

/// Why a declaration makes no effect.
#[derive(Debug, Error, Clone, PartialEq)]
#[allow(missing_docs, reason = "its messages say what each means")]
#[non_exhaustive]
pub enum EffectError {
    #[error("{kind} takes {expected} parameters, found {found}")]
    Count { kind: &'static str, expected: usize, found: usize },
    #[error("effect.{key} must lie between {lower} and {upper} {unit} for {kind}, found {found}", unit = .unit.symbol())]
    OutOfBounds { kind: &'static str, key: &'static str, lower: f64, upper: f64, unit: Unit, found: f64 },
    #[error("effect.{key} must be one of {options:?} for {kind}")]
    Choice { kind: &'static str, key: &'static str, options: &'static [&'static str] },
    #[error("effect.{key} must be a whole number for {kind}, found {found}")]
    NotWhole { kind: &'static str, key: &'static str, found: f64 },
    #[error("effect.{key} must be one of the layers 1 (innermost) to {most} of this coil for {kind}, found {found}")]
    NoSuchLayer { kind: &'static str, key: &'static str, most: usize, found: f64 },
}

impl DeclaredEffect {
    /// # Errors
    /// A value outside its bounds, or as many values or choices as the effect does not take.
    pub fn new(spec: &'static EffectSpec, values: Vec<f64>, choices: Vec<usize>) -> Result<Self, EffectError> {
        let kind = spec.kind;
        if values.len() != spec.parameters.len() {
            return Err(EffectError::Count { kind, expected: spec.parameters.len(), found: values.len() });
        }
        if choices.len() != spec.choices.len() {
            return Err(EffectError::Count { kind, expected: spec.choices.len(), found: choices.len() });
        }
        for (parameter, &si) in spec.parameters.iter().zip(&values) {
            let ParameterSpec { key, unit, lower, upper, .. } = *parameter;
            let found = unit.from_si(si);
            let slack = 1e-9 * (upper - lower).abs();
            if !(found >= lower - slack && found <= upper + slack) {
                return Err(EffectError::OutOfBounds { kind, key, lower, upper, unit, found });
            }
            if unit == Unit::Layer && found.fract() != 0.0 {
                return Err(EffectError::NotWhole { kind, key, found });
            }
        }
        for (choice, &index) in spec.choices.iter().zip(&choices) {
            if index >= choice.options.len() {
                return Err(EffectError::Choice { kind, key: choice.key, options: choice.options });
            }
        }
        Ok(Self { spec, values, choices, subject: Subject::None })
    }

    /// # Errors
    /// A layer that a coil of so many layers has not, or above which there is none.
    pub(crate) fn check_layers(&self, layers: usize) -> Result<(), EffectError> {
        let most = layers - usize::from(self.spec.acts == Acts::HeatPath);
        for (parameter, &found) in self.spec.parameters.iter().zip(&self.values) {
            if parameter.unit == Unit::Layer && found > most as f64 {
                return Err(EffectError::NoSuchLayer { kind: self.spec.kind, key: parameter.key, most, found });
            }
        }
        Ok(())
    }

    /// The layer that it is about, counted from 1 innermost, where it is about one.
    pub(crate) fn layer(&self) -> Option<usize> {
        let of_layer = self.spec.parameters.iter().position(|p| p.unit == Unit::Layer)?;
        self.values.get(of_layer).map(|v| v.round() as usize)
    }

    /// The effect at the start values of a fit and its first choices.
    ///
    /// # Example
    /// ```
    /// use coilwright::{CoilModel, DeclaredEffect, effect};
    ///
    /// let film = effect::find("surface_film").expect("in the catalogue");
    /// let model = CoilModel::builder("behind a film", 8).mean_diameter_m(0.08).turns_per_layer(98.0);
    /// let model = model.effect(DeclaredEffect::at_start(film)).build()?;
    /// assert_eq!(model.effects[0].kind(), "surface_film");
    /// # Ok::<(), coilwright::coil::CoilError>(())
    /// ```
    pub fn at_start(spec: &'static EffectSpec) -> Self {
        Self {
            spec,
            values: spec.parameters.iter().map(|p| p.unit.to_si(p.start)).collect(),
            choices: vec![0; spec.choices.len()],
            subject: Subject::None,
        }
    }

    /// The ambient air behind a film at the outer surface.
    pub(crate) fn film(film_w_per_m2_k: f64) -> Self {
        let spec = FILM.spec;
        Self { spec, values: vec![film_w_per_m2_k], choices: Vec::new(), subject: Subject::None }
    }

    /// Linear in a further column of the record.
    pub(crate) fn channel(name: impl Into<String>, gain_rad_per_s_per_unit: f64) -> Self {
        let subject = Subject::Channel(name.into());
        Self { spec: CHANNEL, values: vec![gain_rad_per_s_per_unit], choices: Vec::new(), subject }
    }

    /// The thermal stress of what the coil is made of.
    pub(crate) fn thermal_stress(materials: Materials) -> Self {
        let subject = thermal_stress::subject(materials);
        Self { spec: THERMAL_STRESS, values: Vec::new(), choices: Vec::new(), subject }
    }

    /// A formula of the user's own; `values` in the order of its parameters.
    ///
    /// # Errors
    /// As many values as the formula has no parameters.
    pub fn custom(formula: custom::Formula, values: Vec<f64>) -> Result<Self, EffectError> {
        let expected = formula.parameters().len();
        if values.len() != expected {
            return Err(EffectError::Count { kind: CUSTOM.kind, expected, found: values.len() });
        }
        Ok(Self { spec: CUSTOM, values, choices: Vec::new(), subject: Subject::Formula(formula) })
    }

    /// The same effect with other values (SI).
    ///
    /// # Errors
    /// As [`DeclaredEffect::new`].
    pub(crate) fn with_values(&self, values: Vec<f64>) -> Result<Self, EffectError> {
        match &self.subject {
            Subject::None => Self::new(self.spec, values, self.choices.clone()),
            Subject::Channel(name) => match values[..] {
                [gain] => Ok(Self::channel(name.clone(), gain)),
                _ => Err(EffectError::Count { kind: CHANNEL.kind, expected: 1, found: values.len() }),
            },
            Subject::Formula(formula) => Self::custom(formula.clone(), values),
            Subject::Materials(_) if values.is_empty() => Ok(self.clone()),
            Subject::Materials(_) => {
                Err(EffectError::Count { kind: THERMAL_STRESS.kind, expected: 0, found: values.len() })
            }
        }
    }

    /// As written in files: the spec's kind, or `channel:NAME`.
    pub fn kind(&self) -> String {
        match &self.subject {
            Subject::Channel(name) => format!("channel:{name}"),
            Subject::None | Subject::Formula(_) | Subject::Materials(_) => self.spec.kind.to_owned(),
        }
    }

    pub(crate) fn subject(&self) -> &Subject {
        &self.subject
    }

    /// In the order of [`DeclaredEffect::values`]; bounds in SI.
    pub(crate) fn parameters(&self) -> Vec<DeclaredParameter> {
        match &self.subject {
            Subject::Formula(formula) => formula
                .parameters()
                .iter()
                .map(|key| DeclaredParameter {
                    key: key.clone(),
                    unit: Unit::One,
                    lower: if formula.is_size(key) { f64::MIN_POSITIVE } else { f64::NEG_INFINITY },
                    upper: f64::INFINITY,
                })
                .collect(),
            Subject::None | Subject::Channel(_) | Subject::Materials(_) => self
                .spec
                .parameters
                .iter()
                .map(|p| DeclaredParameter {
                    key: p.key.to_owned(),
                    unit: p.unit,
                    lower: p.unit.to_si(p.lower),
                    upper: p.unit.to_si(p.upper),
                })
                .collect(),
        }
    }

    /// The record's columns that it reads, besides the needed ones.
    pub(crate) fn channels(&self) -> Vec<String> {
        match &self.subject {
            Subject::None | Subject::Materials(_) => Vec::new(),
            Subject::Channel(name) => vec![name.clone()],
            Subject::Formula(formula) => formula.channels().to_vec(),
        }
    }

    pub(crate) fn spec(&self) -> &'static EffectSpec {
        self.spec
    }

    /// Whether it is the effect that an address leads to.
    pub(crate) fn is_at(&self, address: Address) -> bool {
        self.spec.kind == address.spec.kind
    }

    /// SI, in the order of the spec's parameters.
    pub(crate) fn values(&self) -> &[f64] {
        &self.values
    }

    pub(crate) fn choices(&self) -> &[usize] {
        &self.choices
    }

    /// Ready to act on a coil; `channels` names a record's further columns.
    pub fn bind(&self, coil: &Coil, channels: &[String]) -> Box<dyn Effect> {
        let binding = Binding { coil, subject: &self.subject, channels };
        (self.spec.build)(&self.values, &self.choices, &binding)
    }
}
