//! The effect `unsteady_start`: equation, parameters, source and signature stand in its `SPEC`.

use super::{Acts, Effect, EffectSpec, Nature, ParameterSpec};
use crate::thermal::{HeatPath, Start};
use crate::units::Unit;

/// A difference of temperature, zero unless stated.
const fn above(key: &'static str, meaning: &'static str, start: f64) -> ParameterSpec {
    ParameterSpec { key, unit: Unit::Kelvin, meaning, lower: -500.0, upper: 500.0, start, default: Some(0.0) }
}

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "unsteady_start",
    summary: "The record or profile does not begin in a steady state: parts differ in temperature, or a ramp had been going on",
    equation: "T(0) = T_drive(0) + ΔT of pack, spool and housings; dT_drive/dt = rate for −lasted < t < 0",
    acts: Acts::HeatPath,
    nature: Nature::Physical,
    parameters: &[
        above("pack_above_k", "by how much the pack is warmer than the drive at the start", 1.0),
        above("spool_above_k", "by how much the spool and its flanges are", 0.0),
        above("housing_above_k", "by how much the housings are", 0.0),
        ParameterSpec {
            key: "rate_c_per_h",
            unit: Unit::CelsiusPerHour,
            meaning: "rate of the drive before the start",
            lower: -10000.0,
            upper: 10000.0,
            start: 0.0,
            default: Some(0.0),
        },
        ParameterSpec {
            key: "lasted_s",
            unit: Unit::Second,
            meaning: "for how long it had been going on",
            lower: 1.0,
            upper: 1e7,
            start: 100000.0,
            default: Some(100000.0),
        },
    ],
    choices: &[],
    source: "superposition in a linear system: Carslaw and Jaeger, Conduction of Heat in Solids (1959), sections 1.14 and 3.4",
    signature: "an error at the beginning that dies out with the pack's own time constants, whatever the chamber does afterwards",
    happens: "At the first row some parts are warmer than others, and an error remains until they have become even.",
    remedy: "Let the coil rest for several of its time constants before a record begins, or declare how it began.",
    experiment: "the same ramp after a long and after a short rest",
    build: |values, _, _| {
        Box::new(Unsteady(Start {
            pack_above_k: values[0],
            spool_above_k: values[1],
            housing_above_k: values[2],
            rate_k_per_s: values[3],
            lasted_s: values[4],
        }))
    },
};

#[derive(Debug)]
struct Unsteady(Start);

impl Effect for Unsteady {
    fn change_heat_path(&self, path: &mut HeatPath) {
        path.start = Some(self.0);
    }
}
