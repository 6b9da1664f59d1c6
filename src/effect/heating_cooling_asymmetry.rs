//! The effect `heating_cooling_asymmetry`: equation, parameters, source and signature stand in its `SPEC`.

use super::{Acts, Effect, EffectSpec, Nature, PackState, ParameterSpec};
use crate::units::Unit;

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "heating_cooling_asymmetry",
    summary: "The coil's error is larger while it warms up than while it cools, or the reverse",
    equation: "Ω → Ω (1 + g sign(mean Ṫ))",
    acts: Acts::Response,
    nature: Nature::Empirical,
    parameters: &[ParameterSpec {
        key: "gain",
        unit: Unit::One,
        meaning: "g, relative excess while heating",
        lower: -0.9,
        upper: 0.9,
        start: 0.02,
        default: None,
    }],
    choices: &[],
    source: "empirical: hysteresis of potting and coating",
    signature: "residuals of heating and cooling ramps have the same sign and size relative to the error itself",
    happens: "The coil answers more strongly in one direction of temperature than in the other, as where a contact opens on cooling and closes on heating.",
    remedy: "Look for a contact or a potting that moves; until it is found, compensate with a gain of its own for each direction.",
    experiment: "the same ramp upwards and downwards through the same temperatures",
    build: |values, _, _| Box::new(HeatingCoolingAsymmetry { gain: values[0] }),
};

#[derive(Debug)]
struct HeatingCoolingAsymmetry {
    gain: f64,
}

impl Effect for HeatingCoolingAsymmetry {
    fn is_linear(&self) -> bool {
        false
    }

    fn coil_gain(&self, state: &PackState) -> f64 {
        let rate = state.mean_rate_k_per_s;
        if rate == 0.0 { 1.0 } else { 1.0 + self.gain * rate.signum() }
    }
}
