//! The effect `scale_factor_error`: equation, parameters, source and signature stand in its `SPEC`.

use super::turning::Turning;
use super::{Acts, Effect, EffectSpec, Nature, PackState, ParameterSpec};
use crate::units::Unit;

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "scale_factor_error",
    summary: "The scale factor is another than the stated one",
    equation: "Ω_b = ε I, I the table's rate",
    acts: Acts::ScaleFactor,
    nature: Nature::Physical,
    parameters: &[ParameterSpec {
        key: "error_ppm",
        unit: Unit::PartsPerMillion,
        meaning: "ε",
        lower: -1e5,
        upper: 1e5,
        start: 100.0,
        default: None,
    }],
    choices: &[],
    source: "thesis chapter on FOG drift compensation (2021), section 3.2; IEEE Std 952-1997, 12.9",
    signature: "the residual steps with the table's rate, by as much at every temperature",
    happens: "The gyro shows more or less than the table turns, in one proportion: wavelength, coil area or the feedback's gain are other than assumed.",
    remedy: "Calibrate the scale factor on the table; no winding changes it.",
    experiment: "several even rates both ways at one temperature",
    build: |values, _, binding| Box::new(ScaleFactorError { error: values[0], turning: Turning::of(binding) }),
};

#[derive(Debug)]
struct ScaleFactorError {
    error: f64,
    turning: Turning,
}

impl Effect for ScaleFactorError {
    fn is_linear(&self) -> bool {
        !self.turning.is_there()
    }

    fn outside_rate_rad_per_s(&self, state: &PackState) -> f64 {
        self.error * self.turning.rad_per_s(state)
    }
}
