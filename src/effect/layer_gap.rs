//! The effect `layer_gap`: equation, parameters, source and signature stand in its `SPEC`.

use super::{Acts, Effect, EffectSpec, Nature, ParameterSpec};
use crate::thermal::{HeatPath, LayerGap};
use crate::units::Unit;

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "layer_gap",
    summary: "The pack has come loose above one layer: heat crosses there through a contact conductance only",
    equation: "k dT/dr = h (T(r+) − T(r−)) at the outer surface of the layer",
    acts: Acts::HeatPath,
    nature: Nature::Physical,
    parameters: &[
        ParameterSpec {
            key: "above_layer",
            unit: Unit::Layer,
            meaning: "the layer below the gap, counted from 1 innermost",
            lower: 1.0,
            upper: 10000.0,
            start: 1.0,
            default: None,
        },
        ParameterSpec {
            key: "conductance_w_per_m2_k",
            unit: Unit::WattPerSquareMetreKelvin,
            meaning: "h, contact conductance per area of the gap",
            lower: 1.0,
            upper: 100000.0,
            start: 250.0,
            default: None,
        },
    ],
    choices: &[],
    source: "thermal contact conductance, Incropera et al., section 3.1.4: an air gap of 0.1 mm has 250 W/(m²K)",
    signature: "all layers below the gap follow later than those above it, by the heat capacity below over h; the error's transients last longer",
    happens: "The pack has come loose between two layers, and what lies below the gap follows a change of temperature later than what lies above it.",
    remedy: "Pot under vacuum, lower the winding's tension gradient, or cycle the coil before acceptance; an open gap cannot be closed by another winding.",
    experiment: "ramps after a cold soak and after a hot soak, which open and close the gap; a radiograph of the pack",
    build: |values, _, _| Box::new(Loose { above_layer: values[0].round() as usize, conductance: values[1] }),
};

#[derive(Debug)]
struct Loose {
    /// Counted from 1 innermost.
    above_layer: usize,
    conductance: f64,
}

impl Effect for Loose {
    fn change_heat_path(&self, path: &mut HeatPath) {
        if (1..path.shape.layers).contains(&self.above_layer) {
            path.gaps.push(LayerGap { above_layer: self.above_layer, conductance_w_per_m2_k: self.conductance });
        }
    }
}
