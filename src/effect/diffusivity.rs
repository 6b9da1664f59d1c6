//! The effect `diffusivity`: equation, parameters, source and signature stand in its `SPEC`.

use super::{Acts, Effect, EffectSpec, Nature, ParameterSpec};
use crate::thermal::HeatPath;
use crate::units::Unit;

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "diffusivity",
    summary: "No new physics: the declared conductivity (or diffusivity) is wrong by a factor",
    equation: "k → factor · k",
    acts: Acts::HeatPath,
    nature: Nature::DeclaredNumber,
    parameters: &[ParameterSpec {
        key: "factor",
        unit: Unit::One,
        meaning: "true over declared conductivity",
        lower: 0.1,
        upper: 10.0,
        start: 1.1,
        default: None,
    }],
    choices: &[],
    source: "effective conductivity of a fibre pack is rarely known better than 20 %",
    signature: "all transients are faster or slower by one factor",
    happens: "Heat moves through the pack faster or slower than the declared conductivity and heat capacity say.",
    remedy: "Correct the declared numbers by the factor: nothing is wrong with the coil, but windings ranked with the old numbers should be ranked again.",
    experiment: "a laser-flash or hot-disk measurement of the pack; a second sensor at the bore",
    build: |values, _, _| Box::new(Diffusivity { factor: values[0] }),
};

#[derive(Debug)]
struct Diffusivity {
    factor: f64,
}

impl Effect for Diffusivity {
    fn change_heat_path(&self, path: &mut HeatPath) {
        path.material = path.material.scaled(self.factor);
    }
}
