//! The effect `scale_factor_temperature`: equation, parameters, source and signature stand in its `SPEC`.

use super::turning::Turning;
use super::{Acts, Effect, EffectSpec, Memory, Nature, PackState, ParameterSpec};
use crate::units::{REFERENCE_TEMPERATURE_K, Unit};

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "scale_factor_temperature",
    summary: "The scale factor depends on the pack's mean temperature, and on whether it came there from below or from above",
    equation: "Ω_b = [c (T − 20 °C) + ½ h p] I, p = (T − play(T, 0.5 K))/0.5 K from −1 after cooling to 1 after warming, I the table's rate",
    acts: Acts::ScaleFactor,
    nature: Nature::Physical,
    parameters: &[
        ParameterSpec {
            key: "coefficient_ppm_per_k",
            unit: Unit::PartsPerMillionPerKelvin,
            meaning: "c",
            lower: -10_000.0,
            upper: 10_000.0,
            start: 5.0,
            default: None,
        },
        ParameterSpec {
            key: "hysteresis_ppm",
            unit: Unit::PartsPerMillion,
            meaning: "h, after warming less after cooling",
            lower: -1e5,
            upper: 1e5,
            start: 20.0,
            default: Some(0.0),
        },
    ],
    choices: &[],
    source: "thesis chapter on FOG drift compensation (2021), section 3.2: F = S(1 + ε(T))(I + E + D); play operator: Krasnosel'skii and Pokrovskii, Systems with Hysteresis (1989)",
    signature: "the steps of the residual with the table's rate grow with temperature; with hysteresis they are others on the way up than on the way down",
    happens: "The gyro's gain drifts with temperature: the source's wavelength moves, and the coil's area and the fibre's index with it.",
    remedy: "Compensate the scale factor with the temperature, or hold the source's temperature; no winding changes it.",
    experiment: "even rates both ways in soaks at several temperatures, going up and coming down",
    build: |values, _, binding| {
        Box::new(ScaleFactorTemperature {
            coefficient_per_k: values[0],
            hysteresis: values[1],
            turning: Turning::of(binding),
        })
    },
};

/// Half of what the temperature must go back by before the other branch is reached.
const HALF_WIDTH_K: f64 = 0.5;

#[derive(Debug)]
struct ScaleFactorTemperature {
    coefficient_per_k: f64,
    hysteresis: f64,
    turning: Turning,
}

impl ScaleFactorTemperature {
    /// `branch` from −1 to 1.
    fn rate_rad_per_s(&self, state: &PackState, branch: f64) -> f64 {
        let error = self.coefficient_per_k * (state.mean_temperature_k - REFERENCE_TEMPERATURE_K);
        (error + 0.5 * self.hysteresis * branch) * self.turning.rad_per_s(state)
    }
}

impl Effect for ScaleFactorTemperature {
    fn is_linear(&self) -> bool {
        !self.turning.is_there()
    }

    fn outside_rate_rad_per_s(&self, state: &PackState) -> f64 {
        self.rate_rad_per_s(state, 0.0)
    }

    fn outside_rate_after(&self, state: &PackState, memory: &mut Memory) -> f64 {
        if !self.remembers() {
            return self.outside_rate_rad_per_s(state);
        }
        let followed_k = memory.play(state.time_s, state.mean_temperature_k, HALF_WIDTH_K);
        self.rate_rad_per_s(state, (state.mean_temperature_k - followed_k) / HALF_WIDTH_K)
    }

    fn remembers(&self) -> bool {
        self.hysteresis != 0.0 && self.turning.is_there()
    }
}
