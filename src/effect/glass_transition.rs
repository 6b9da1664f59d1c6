//! The effect `glass_transition`: equation, parameters, source and signature stand in its `SPEC`.

use super::{Acts, Effect, EffectSpec, FibrePlace, Nature, ParameterSpec};
use crate::pattern::Half;
use crate::units::Unit;

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "glass_transition",
    summary: "A strain mismatch of the halves that acts only below the potting's glass transition",
    equation: "κ_B − κ_A = m κ / (1 + e^{(T − T_g)/w})",
    acts: Acts::Response,
    nature: Nature::Physical,
    parameters: &[
        ParameterSpec {
            key: "mismatch",
            unit: Unit::One,
            meaning: "m far below the transition",
            lower: -0.5,
            upper: 0.5,
            start: 0.002,
            default: None,
        },
        ParameterSpec {
            key: "transition_c",
            unit: Unit::Celsius,
            meaning: "T_g, the glass transition",
            lower: -80.0,
            upper: 150.0,
            start: 10.0,
            default: None,
        },
        ParameterSpec {
            key: "width_k",
            unit: Unit::Kelvin,
            meaning: "w, width of the transition",
            lower: 0.5,
            upper: 40.0,
            start: 5.0,
            default: None,
        },
    ],
    choices: &[],
    source: "stiffening of the potting below T_g, as reported for quadrupolar coils; logistic form is the simplest monotonic one",
    signature: "an error ∝ Ṫ in the cold only",
    happens: "Below its glass transition the potting is stiff and strains one half of the fibre more than the other; above it lets go.",
    remedy: "Choose a potting whose transition lies outside the range of use, or compensate with the pack's rate of temperature below the transition only.",
    experiment: "the same slow ramp through the whole temperature range: the error steps where the potting stiffens",
    build: |values, _, _| {
        Box::new(GlassTransition { mismatch: values[0], transition_k: values[1], width_k: values[2] })
    },
};

#[derive(Debug)]
struct GlassTransition {
    mismatch: f64,
    transition_k: f64,
    width_k: f64,
}

impl Effect for GlassTransition {
    fn is_linear(&self) -> bool {
        false
    }

    fn path_depends_on_temperature(&self) -> bool {
        true
    }

    fn path_factor(&self, place: &FibrePlace) -> f64 {
        let glassy = 1.0 / (1.0 + ((place.temperature_k - self.transition_k) / self.width_k).exp());
        match place.half {
            Half::A => 1.0 - 0.5 * self.mismatch * glassy,
            Half::B => 1.0 + 0.5 * self.mismatch * glassy,
        }
    }
}
