//! The list of effects as a JSON document.

use serde::Serialize;

use crate::effect::{Acts, EffectSpec};

#[derive(Debug, Serialize)]
pub struct EffectsJson {
    pub effects: Vec<EffectJson>,
}

#[derive(Debug, Serialize)]
pub struct EffectJson {
    pub kind: &'static str,
    pub summary: &'static str,
    pub equation: &'static str,
    pub acts: &'static str,
    pub parameters: Vec<ParameterJson>,
    pub choices: Vec<ChoiceJson>,
    pub source: &'static str,
    pub signature: &'static str,
    pub happens: &'static str,
    pub remedy: &'static str,
    pub experiment: &'static str,
}

/// Bounds, start and default in the parameter's own unit.
#[derive(Debug, Serialize)]
pub struct ParameterJson {
    pub key: &'static str,
    pub unit: &'static str,
    pub meaning: &'static str,
    pub lower: f64,
    pub upper: f64,
    pub start: f64,
    /// Null where a model file must state the parameter.
    pub default: Option<f64>,
}

#[derive(Debug, Serialize)]
pub struct ChoiceJson {
    pub key: &'static str,
    pub options: &'static [&'static str],
    pub meaning: &'static str,
}

impl EffectJson {
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
                .map(|p| ParameterJson {
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
                .map(|c| ChoiceJson { key: c.key, options: c.options, meaning: c.meaning })
                .collect(),
            source: spec.source,
            signature: spec.signature,
            happens: spec.happens,
            remedy: spec.remedy,
            experiment: spec.experiment,
        }
    }
}
