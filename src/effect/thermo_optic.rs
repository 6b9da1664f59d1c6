//! The effect `thermo_optic`: equation, parameters, source and signature stand in its `SPEC`.

use super::{Acts, Effect, EffectSpec, FibrePlace, Nature, ParameterSpec};
use crate::units::Unit;

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "thermo_optic",
    summary: "No new physics: the declared thermo-optic coefficient κ is wrong by a factor",
    equation: "κ → factor · κ",
    acts: Acts::Response,
    nature: Nature::DeclaredNumber,
    parameters: &[ParameterSpec {
        key: "factor",
        unit: Unit::One,
        meaning: "true over declared κ",
        lower: 0.1,
        upper: 10.0,
        start: 1.05,
        default: None,
    }],
    choices: &[],
    source: "dn/dT of doped silica in a coating: 0.8 … 1.4e-5 per kelvin",
    signature: "the whole error is larger or smaller by one factor at every temperature and rate",
    happens: "The fibre answers a change of temperature more or less than the declared dn/dT says, all layers alike.",
    remedy: "Correct the declared dn/dT by the factor; the ranking of windings stays, their errors scale.",
    experiment: "an interferometric measurement of the fibre's dn/dT",
    build: |values, _, _| Box::new(ThermoOptic { factor: values[0] }),
};

#[derive(Debug)]
struct ThermoOptic {
    factor: f64,
}

impl Effect for ThermoOptic {
    fn path_factor(&self, _place: &FibrePlace) -> f64 {
        self.factor
    }
}
