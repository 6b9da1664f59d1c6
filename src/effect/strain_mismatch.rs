//! The effect `strain_mismatch`: equation, parameters, source and signature stand in its `SPEC`.

use super::{Acts, Effect, EffectSpec, FibrePlace, Nature, ParameterSpec};
use crate::pattern::Half;
use crate::units::Unit;

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "strain_mismatch",
    summary: "Elasto-optic: the two halves of the fibre respond differently (the T-dot or Mohr bias)",
    equation: "κ_B − κ_A = m κ; in a steady ramp Ω = n κ m L Ṫ/(4D)",
    acts: Acts::Response,
    nature: Nature::Physical,
    parameters: &[ParameterSpec {
        key: "mismatch",
        unit: Unit::One,
        meaning: "m, relative difference of the halves",
        lower: -0.5,
        upper: 0.5,
        start: 0.002,
        default: None,
    }],
    choices: &[],
    source: "Mohr and Schadt, Proc. SPIE 5502, 410 (2004): bias from elasto-optic interactions; 0.03 … 4.9 °/h at 5 °C/min are reported",
    signature: "a step of the error that lasts as long as the ramp and is ∝ the pack's mean rate, the same at every temperature",
    happens: "One half of the fibre is strained more than the other, so equal warming of both halves does not cancel and an error follows the pack's rate of temperature.",
    remedy: "Wind both halves with equal tension or trim the fibre at one end; in the gyro, compensate with the pack's rate of temperature.",
    experiment: "ramps of several rates long enough to settle; flip the coil (it changes sign), trim an end (it does not follow)",
    build: |values, _, _| Box::new(StrainMismatch { mismatch: values[0] }),
};

#[derive(Debug)]
struct StrainMismatch {
    mismatch: f64,
}

impl Effect for StrainMismatch {
    fn path_factor(&self, place: &FibrePlace) -> f64 {
        match place.half {
            Half::A => 1.0 - 0.5 * self.mismatch,
            Half::B => 1.0 + 0.5 * self.mismatch,
        }
    }
}
