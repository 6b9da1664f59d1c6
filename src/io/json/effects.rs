//! The list of effects as a JSON document.

use serde::Serialize;

use crate::effect::{Acts, EffectSpec};

/// The answer of `effects`.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct EffectsJson {
    /// In the catalogue's order.
    pub effects: Vec<EffectJson>,
}

/// One description of the catalogue.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct EffectJson {
    pub(crate) kind: &'static str,
    pub(crate) summary: &'static str,
    pub(crate) equation: &'static str,
    pub(crate) acts: &'static str,
    pub(crate) parameters: Vec<EffectParameterJson>,
    pub(crate) choices: Vec<EffectChoiceJson>,
    pub(crate) source: &'static str,
    pub(crate) signature: &'static str,
    pub(crate) happens: &'static str,
    pub(crate) remedy: &'static str,
    pub(crate) experiment: &'static str,
}

/// Bounds, start and default in the parameter's own unit.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct EffectParameterJson {
    pub(crate) key: &'static str,
    pub(crate) unit: &'static str,
    pub(crate) meaning: &'static str,
    pub(crate) lower: f64,
    pub(crate) upper: f64,
    pub(crate) start: f64,
    /// Null where a model file must state the parameter.
    pub(crate) default: Option<f64>,
}

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct EffectChoiceJson {
    pub(crate) key: &'static str,
    pub(crate) options: &'static [&'static str],
    pub(crate) meaning: &'static str,
}

impl EffectJson {
    /// As the catalogue describes it.
    pub fn of(spec: &EffectSpec) -> Self {
        Self {
            kind: spec.kind,
            summary: spec.summary,
            equation: spec.equation,
            acts: match spec.acts {
                Acts::HeatPath => "heat path",
                Acts::Winding => "winding",
                Acts::Sensor => "sensor",
                Acts::Response => "response",
                Acts::Outside => "outside",
                Acts::ScaleFactor => "scale factor",
            },
            parameters: spec
                .parameters
                .iter()
                .map(|p| EffectParameterJson {
                    key: p.key,
                    unit: p.unit.symbol(),
                    meaning: p.meaning,
                    lower: p.lower,
                    upper: p.upper,
                    start: p.start,
                    default: p.default,
                })
                .collect(),
            choices: spec
                .choices
                .iter()
                .map(|c| EffectChoiceJson { key: c.key, options: c.options, meaning: c.meaning })
                .collect(),
            source: spec.source,
            signature: spec.signature,
            happens: spec.happens,
            remedy: spec.remedy,
            experiment: spec.experiment,
        }
    }
}
