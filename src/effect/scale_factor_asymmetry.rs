//! The effect `scale_factor_asymmetry`: equation, parameters, source and signature stand in its `SPEC`.

use super::turning::Turning;
use super::{Acts, Effect, EffectSpec, Nature, PackState, ParameterSpec};
use crate::units::Unit;

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "scale_factor_asymmetry",
    summary: "The scale factor is another forwards than backwards",
    equation: "Ω_b = ½ a |I|, I the table's rate",
    acts: Acts::ScaleFactor,
    nature: Nature::Physical,
    parameters: &[ParameterSpec {
        key: "asymmetry_ppm",
        unit: Unit::PartsPerMillion,
        meaning: "a, forwards less backwards",
        lower: -1e5,
        upper: 1e5,
        start: 50.0,
        default: None,
    }],
    choices: &[],
    source: "IEEE Std 952-1997, 12.9 (asymmetry); definition as in the program's `metrics`",
    signature: "the residual steps with the size of the table's rate, whichever way it turns",
    happens: "The gyro shows more when it turns one way than the other, as where the modulation's reset is not a whole turn of the phase.",
    remedy: "Calibrate each direction by itself, and look at the modulation's depth; no winding changes it.",
    experiment: "even rates of one size both ways at one temperature",
    build: |values, _, binding| Box::new(ScaleFactorAsymmetry { asymmetry: values[0], turning: Turning::of(binding) }),
};

#[derive(Debug)]
struct ScaleFactorAsymmetry {
    asymmetry: f64,
    turning: Turning,
}

impl Effect for ScaleFactorAsymmetry {
    fn is_linear(&self) -> bool {
        !self.turning.is_there()
    }

    fn outside_rate_rad_per_s(&self, state: &PackState) -> f64 {
        0.5 * self.asymmetry * self.turning.rad_per_s(state).abs()
    }
}
