//! The effect `spool_mass`: equation, parameters, source and signature stand in its `SPEC`.

use super::{Acts, Effect, EffectSpec, Nature, ParameterSpec};
use crate::thermal::{HeatPath, Spool};
use crate::units::Unit;

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "spool_mass",
    summary: "A spool of lumped heat capacity behind a contact conductance at the bore, optionally mounted to the ambient",
    equation: "C dT_s/dt = h (T(r_in) − T_s) + h_m (T_ambient − T_s), per bore area",
    acts: Acts::HeatPath,
    nature: Nature::Physical,
    parameters: &[
        ParameterSpec {
            key: "heat_capacity_j_per_m2_k",
            unit: Unit::JoulePerSquareMetreKelvin,
            meaning: "heat capacity of the spool per bore area",
            lower: 10.0,
            upper: 1000000.0,
            start: 4000.0,
            default: None,
        },
        ParameterSpec {
            key: "contact_w_per_m2_k",
            unit: Unit::WattPerSquareMetreKelvin,
            meaning: "conductance between spool and innermost layer",
            lower: 1.0,
            upper: 100000.0,
            start: 300.0,
            default: None,
        },
        ParameterSpec {
            key: "mount_w_per_m2_k",
            unit: Unit::WattPerSquareMetreKelvin,
            meaning: "conductance between spool and ambient",
            lower: 0.0,
            upper: 10000.0,
            start: 0.0,
            default: Some(0.0),
        },
    ],
    choices: &[],
    source: "lumped-capacitance model, Incropera et al., Fundamentals of Heat and Mass Transfer, chapter 5",
    signature: "the inner layers lag behind for the time C/h_eff during every ramp: an error ∝ Ṫ that builds up and dies out slowly, strongest in patterns that do not cancel a linear gradient",
    happens: "The spool takes up and gives back heat through its contact with the innermost layer, so the inner layers lag behind during and after every ramp.",
    remedy: "Add the spool to the model before another winding is chosen; a lighter spool, a thermal break at the bore or a winding that cancels a linear gradient makes its error smaller.",
    experiment: "the same ramp with the coil on its spool and freed from it, or a second sensor at the bore",
    build: |values, _, _| {
        Box::new(SpoolMass(Spool {
            heat_capacity_j_per_m2_k: values[0],
            contact_w_per_m2_k: values[1],
            mount_w_per_m2_k: values[2],
        }))
    },
};

#[derive(Debug)]
struct SpoolMass(Spool);

impl Effect for SpoolMass {
    fn change_heat_path(&self, path: &mut HeatPath) {
        path.spool = Some(self.0);
    }
}
