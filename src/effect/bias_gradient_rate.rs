//! The effect `bias_gradient_rate`: equation, parameters, source and signature stand in its `SPEC`.

use super::{Acts, Effect, EffectSpec, Nature, PackState, ParameterSpec};
use crate::units::Unit;

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "bias_gradient_rate",
    summary: "A bias that is proportional to the rate of the radial temperature difference; empirical",
    equation: "Ω_b = b d(T_out − T_in)/dt",
    acts: Acts::Outside,
    nature: Nature::Empirical,
    parameters: &[ParameterSpec {
        key: "gain_deg_per_h_s_per_k",
        unit: Unit::DegPerHourSecondPerKelvin,
        meaning: "b",
        lower: -100000.0,
        upper: 100000.0,
        start: 10.0,
        default: None,
    }],
    choices: &[],
    source: "thesis chapter on FOG drift compensation (2021), section 3.2: D_∇Ṫ",
    signature: "a pulse after each change of ramp that lasts until the pack has settled",
    happens: "A bias follows the change of the temperature difference across the pack, without any coil physics behind it.",
    remedy: "Compensate with the difference between the outermost and the innermost layer; a second sensor at the bore shows whether it is real.",
    experiment: "a second sensor at the bore: regress on the measured difference's rate",
    build: |values, _, _| Box::new(BiasGradientRate { gain_rad_per_k: values[0] }),
};

#[derive(Debug)]
struct BiasGradientRate {
    gain_rad_per_k: f64,
}

impl Effect for BiasGradientRate {
    fn outside_rate_rad_per_s(&self, state: &PackState) -> f64 {
        self.gain_rad_per_k * state.gradient_rate_k_per_s()
    }

    fn is_beside_coil(&self) -> bool {
        true
    }
}
