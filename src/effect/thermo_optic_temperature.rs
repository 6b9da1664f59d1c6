//! The effect `thermo_optic_temperature`: equation, parameters, source and signature stand in its `SPEC`.

use super::{Acts, Effect, EffectSpec, FibrePlace, Nature, ParameterSpec};
use crate::units::REFERENCE_TEMPERATURE_K;
use crate::units::Unit;

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "thermo_optic_temperature",
    summary: "The fibre's thermo-optic response depends on temperature",
    equation: "κ = κ0 (1 + a (T − 20 °C))",
    acts: Acts::Response,
    nature: Nature::Physical,
    parameters: &[ParameterSpec {
        key: "slope_per_k",
        unit: Unit::PerKelvin,
        meaning: "a, relative change of κ per kelvin",
        lower: -0.02,
        upper: 0.02,
        start: 0.001,
        default: None,
    }],
    choices: &[],
    source: "Leviton and Frey, Proc. SPIE 6273 (2006): dn/dT of silica rises with temperature",
    signature: "the whole error scales with temperature: equal ramps give larger transients in the warm",
    happens: "The fibre's thermo-optic response grows or falls with temperature, so equal ramps make unequal errors in the cold and the warm.",
    remedy: "Declare the slope: it belongs to the fibre, and a compensation with a constant coefficient is wrong at the ends of the range.",
    experiment: "the same ramp at −30, 20 and 60 °C; unlike a conductivity's slope the transients keep their duration",
    build: |values, _, _| Box::new(ThermoOpticTemperature { slope_per_k: values[0] }),
};

#[derive(Debug)]
struct ThermoOpticTemperature {
    slope_per_k: f64,
}

impl Effect for ThermoOpticTemperature {
    fn is_linear(&self) -> bool {
        false
    }

    fn path_depends_on_temperature(&self) -> bool {
        true
    }

    fn path_factor(&self, place: &FibrePlace) -> f64 {
        1.0 + self.slope_per_k * (place.temperature_k - REFERENCE_TEMPERATURE_K)
    }
}
