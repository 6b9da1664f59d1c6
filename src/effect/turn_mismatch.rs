//! The effect `turn_mismatch`: equation, parameters, source and signature stand in its `SPEC`.

use super::{Acts, Effect, EffectSpec, Nature, ParameterSpec};
use crate::units::Unit;

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "turn_mismatch",
    summary: "Nesting: every second layer has fewer turns, so the layers' lengths alternate",
    equation: "M_j = M − ΔM on layers 2, 4, 6, … counted from the spool",
    acts: Acts::Winding,
    nature: Nature::Physical,
    parameters: &[ParameterSpec {
        key: "turns",
        unit: Unit::One,
        meaning: "ΔM, turns missing on every second layer",
        lower: -20.0,
        upper: 20.0,
        start: 1.0,
        default: None,
    }],
    choices: &[],
    source: "orthocyclic winding: a nested layer holds one turn less",
    signature: "the layers' weights change and with them the shape of the transient after each change of ramp",
    happens: "Layers that nest in the one below have fewer turns, so layers that should cancel differ in length.",
    remedy: "Declare the counted turns, so that a winding is judged by the lengths it will have; even out the turns in the next coil.",
    experiment: "count the turns; it cannot be switched off on a wound coil",
    build: |values, _, _| Box::new(TurnMismatch { turns: values[0] }),
};

#[derive(Debug)]
struct TurnMismatch {
    turns: f64,
}

impl Effect for TurnMismatch {
    fn change_turns(&self, turns: &mut [f64]) {
        for layer_turns in turns.iter_mut().skip(1).step_by(2) {
            *layer_turns -= self.turns;
        }
    }
}
