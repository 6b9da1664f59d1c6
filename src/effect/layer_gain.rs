//! The effect `layer_gain`: equation, parameters, source and signature stand in its `SPEC`.

use super::{Acts, Effect, EffectSpec, FibrePlace, Nature, ParameterSpec};
use crate::units::Unit;

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "layer_gain",
    summary: "One layer's fibre responds differently to temperature: wound with another tension, or potted differently",
    equation: "κ_j = κ (1 + c) for j = layer, κ elsewhere",
    acts: Acts::Response,
    nature: Nature::Physical,
    parameters: &[
        ParameterSpec {
            key: "layer",
            unit: Unit::Layer,
            meaning: "which layer, counted from 1 innermost",
            lower: 1.0,
            upper: 10000.0,
            start: 1.0,
            default: None,
        },
        ParameterSpec {
            key: "change",
            unit: Unit::One,
            meaning: "c, relative change of the layer's thermo-optic response",
            lower: -0.5,
            upper: 0.5,
            start: 0.05,
            default: None,
        },
    ],
    choices: &[],
    source: "Mohr and Schadt, Proc. SPIE 5502, 410 (2004): strain from winding and potting adds to dn/dT; here of one layer only",
    signature: "transients after each change of ramp as of one layer alone, at the delay of that layer; in a steady ramp ∝ the layer's weight",
    happens: "One layer was wound with another tension or potted differently, and its light path grows by another amount per kelvin than the others'.",
    remedy: "Keep tension and potting alike over all layers; a winding in which the layer's weight is small is less sensitive to it.",
    experiment: "the same pack with its ends spliced as another winding, or a record of a coil wound the other way on the same machine: records of one winding seldom tell a single layer from a gradient",
    build: |values, _, _| Box::new(LayerGain { layer: values[0].round() as usize, factor: 1.0 + values[1] }),
};

#[derive(Debug)]
struct LayerGain {
    /// Counted from 1 innermost.
    layer: usize,
    factor: f64,
}

impl Effect for LayerGain {
    fn path_factor(&self, place: &FibrePlace) -> f64 {
        if place.layer + 1 == self.layer { self.factor } else { 1.0 }
    }
}
