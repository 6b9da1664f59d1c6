//! The effect `bias_temperature_rate`: equation, parameters, source and signature stand in its `SPEC`.

use super::{Acts, Effect, EffectSpec, Nature, PackState, ParameterSpec};
use crate::units::Unit;

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "bias_temperature_rate",
    summary: "A bias that is proportional to the pack's mean rate of temperature; empirical",
    equation: "Ω_b = b dT/dt",
    acts: Acts::Outside,
    nature: Nature::Empirical,
    parameters: &[ParameterSpec {
        key: "gain_deg_per_h_s_per_k",
        unit: Unit::DegPerHourSecondPerKelvin,
        meaning: "b",
        lower: -10000.0,
        upper: 10000.0,
        start: 10.0,
        default: None,
    }],
    choices: &[],
    source: "thesis chapter on FOG drift compensation (2021), section 3.2: D_Ṫ",
    signature: "a step that lasts as long as a ramp; the same as a strain mismatch in every record of one coil",
    happens: "A bias follows the pack's rate of temperature; from one coil's records it cannot be told from a strain mismatch, only the sign under a flip can.",
    remedy: "Compensate with the rate of temperature, and flip the coil to learn whether fibre or electronics is the cause.",
    experiment: "flip the coil: an elasto-optic error changes sign, an electronic one does not",
    build: |values, _, _| Box::new(BiasTemperatureRate { gain_rad_per_k: values[0] }),
};

#[derive(Debug)]
struct BiasTemperatureRate {
    gain_rad_per_k: f64,
}

impl Effect for BiasTemperatureRate {
    fn outside_rate_rad_per_s(&self, state: &PackState) -> f64 {
        self.gain_rad_per_k * state.mean_rate_k_per_s
    }

    fn is_beside_coil(&self) -> bool {
        true
    }
}
