//! The effect `conductivity_temperature`: equation, parameters, source and signature stand in its `SPEC`.

use super::{Acts, Effect, EffectSpec, Nature, ParameterSpec};
use crate::thermal::HeatPath;
use crate::units::Unit;

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "conductivity_temperature",
    summary: "The pack's conductivity depends on temperature",
    equation: "k = k0 (1 + a (T − 20 °C))",
    acts: Acts::HeatPath,
    nature: Nature::Physical,
    parameters: &[ParameterSpec {
        key: "slope_per_k",
        unit: Unit::PerKelvin,
        meaning: "a, relative change of k per kelvin",
        lower: -0.01,
        upper: 0.01,
        start: 0.002,
        default: None,
    }],
    choices: &[],
    source: "polymer coatings and adhesives: a few 0.1 % per kelvin",
    signature: "the error of equal ramps is larger in the cold (or warm) and settles slower there",
    happens: "The potting conducts heat better or worse as it warms, so the pack's time constants depend on temperature.",
    remedy: "Declare the slope: transients in the cold and the warm are then both predicted, and a winding that suits one is not chosen for both.",
    experiment: "the same ramp at −30, 20 and 60 °C",
    build: |values, _, _| Box::new(ConductivityTemperature { slope_per_k: values[0] }),
};

#[derive(Debug)]
struct ConductivityTemperature {
    slope_per_k: f64,
}

impl Effect for ConductivityTemperature {
    fn is_linear(&self) -> bool {
        false
    }

    fn change_heat_path(&self, path: &mut HeatPath) {
        path.conductivity_slope_per_k = self.slope_per_k;
    }
}
