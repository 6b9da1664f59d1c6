//! The effect `bias_temperature`: equation, parameters, source and signature stand in its `SPEC`.

use super::{Acts, Effect, EffectSpec, Nature, PackState, ParameterSpec};
use crate::units::REFERENCE_TEMPERATURE_K;
use crate::units::Unit;

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "bias_temperature",
    summary: "A bias that depends on the pack's mean temperature",
    equation: "Ω_b = b1 (T − 20 °C) + b2 (T − 20 °C)²",
    acts: Acts::Outside,
    nature: Nature::Empirical,
    parameters: &[
        ParameterSpec {
            key: "linear_deg_per_h_per_k",
            unit: Unit::DegPerHourPerKelvin,
            meaning: "b1",
            lower: -10.0,
            upper: 10.0,
            start: 0.005,
            default: Some(0.0),
        },
        ParameterSpec {
            key: "quadratic_deg_per_h_per_k2",
            unit: Unit::DegPerHourPerSquareKelvin,
            meaning: "b2",
            lower: -1.0,
            upper: 1.0,
            start: 0.0001,
            default: Some(0.0),
        },
    ],
    choices: &[],
    source: "thesis chapter on FOG drift compensation (2021), section 3.2: D_ΔT",
    signature: "the residual follows temperature, also in a soak",
    happens: "The gyro's bias drifts with the pack's temperature even when nothing changes in time; light source, coupler and electronics do this, the winding does not.",
    remedy: "Compensate with the temperature itself; no winding changes it.",
    experiment: "long soaks at several temperatures",
    build: |values, _, _| {
        Box::new(BiasTemperature { linear_rad_per_s_k: values[0], quadratic_rad_per_s_k2: values[1] })
    },
};

#[derive(Debug)]
struct BiasTemperature {
    linear_rad_per_s_k: f64,
    quadratic_rad_per_s_k2: f64,
}

impl Effect for BiasTemperature {
    fn is_linear(&self) -> bool {
        false
    }

    fn outside_rate_rad_per_s(&self, state: &PackState) -> f64 {
        let above_k = state.mean_temperature_k - REFERENCE_TEMPERATURE_K;
        (self.linear_rad_per_s_k + self.quadratic_rad_per_s_k2 * above_k) * above_k
    }

    fn is_beside_coil(&self) -> bool {
        true
    }
}
