//! The effect `self_heating`: equation, parameters, source and signature stand in its `SPEC`.

use super::{Acts, Effect, EffectSpec, Nature, ParameterSpec};
use crate::thermal::{BoreHeat, HeatPath};
use crate::units::Unit;

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "self_heating",
    summary: "Electronics heat the bore after power-on",
    equation: "q(t) = q∞ (1 − e^{−t/τ}) into the bore, t from power-on at the start of the record or profile",
    acts: Acts::HeatPath,
    nature: Nature::Physical,
    parameters: &[
        ParameterSpec {
            key: "power_w_per_m2",
            unit: Unit::WattPerSquareMetre,
            meaning: "final heat flux per bore area",
            lower: -2000.0,
            upper: 2000.0,
            start: 50.0,
            default: None,
        },
        ParameterSpec {
            key: "time_constant_s",
            unit: Unit::Second,
            meaning: "time constant of the warm-up",
            lower: 1.0,
            upper: 20000.0,
            start: 600.0,
            default: None,
        },
    ],
    choices: &[],
    source: "warm-up drift of FOG; first-order heating of the electronics",
    signature: "an error that dies out after power-on whatever the chamber does, also at constant temperature",
    happens: "The electronics warm the bore after power-on, and the heat spreads outwards through the pack.",
    remedy: "Move the source away from the bore or wait until it has settled; where it stays, the model with this heat compensates it.",
    experiment: "power-on at constant chamber temperature; then the same with the electronics outside",
    build: |values, _, _| Box::new(SelfHeating(BoreHeat { power_w_per_m2: values[0], time_constant_s: values[1] })),
};

#[derive(Debug)]
struct SelfHeating(BoreHeat);

impl Effect for SelfHeating {
    fn change_heat_path(&self, path: &mut HeatPath) {
        path.bore_heat = Some(self.0);
    }
}
