//! The effect `spool_flange`: equation, parameters, source and signature stand in its `SPEC`.

use super::{Acts, ChoiceSpec, Effect, EffectSpec, Nature, ParameterSpec};
use crate::thermal::{Flange, HeatPath, SpoolFlange};
use crate::units::Unit;

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "spool_flange",
    summary: "A flange of the spool, of one temperature, touches the pack's face and exchanges heat with what surrounds the coil; one declaration a flange",
    equation: "C dT_f/dt = h ⟨T(face) − T_f⟩ + film (T_around − T_f), per area of the pack's face; T_around is the innermost housing's temperature or the ambient's",
    acts: Acts::HeatPath,
    nature: Nature::Physical,
    parameters: &[
        ParameterSpec {
            key: "heat_capacity_j_per_m2_k",
            unit: Unit::JoulePerSquareMetreKelvin,
            meaning: "heat capacity of the flange per area of the pack's face: 4900 for 2 mm of aluminium",
            lower: 10.0,
            upper: 1e7,
            start: 4900.0,
            default: None,
        },
        ParameterSpec {
            key: "contact_w_per_m2_k",
            unit: Unit::WattPerSquareMetreKelvin,
            meaning: "conductance between the flange and the pack's face",
            lower: 0.1,
            upper: 100000.0,
            start: 300.0,
            default: None,
        },
        ParameterSpec {
            key: "film_w_per_m2_k",
            unit: Unit::WattPerSquareMetreKelvin,
            meaning: "film coefficient at the flange's outer face",
            lower: 0.0,
            upper: 100000.0,
            start: 20.0,
            default: None,
        },
    ],
    choices: &[ChoiceSpec {
        key: "flange",
        options: &["first", "second"],
        meaning: "which flange; layer 1 starts at the first",
    }],
    source: "lumped-capacitance model, Incropera et al., chapter 5; axial contribution to the Shupe error: Mohr, J. Lightwave Technol. 14, 27 (1996)",
    signature: "as axial_gradient, but later by the flange's heat capacity, and balanced where both flanges are alike",
    happens: "A flange of the spool takes heat from what surrounds the coil and passes it on to one end of every layer.",
    remedy: "Make both flanges alike, or insulate the one that is warmer; with both declared, windings can be compared with the axial gradient counted.",
    experiment: "a sensor on each flange during a ramp",
    build: |values, choices, _| {
        Box::new(OfSpool(SpoolFlange {
            flange: if choices[0] == 0 { Flange::First } else { Flange::Second },
            heat_capacity_j_per_m2_k: values[0],
            contact_w_per_m2_k: values[1],
            film_w_per_m2_k: values[2],
        }))
    },
};

#[derive(Debug)]
struct OfSpool(SpoolFlange);

impl Effect for OfSpool {
    fn change_heat_path(&self, path: &mut HeatPath) {
        // A flange that is declared again is that flange.
        path.spool_flanges.retain(|known| known.flange != self.0.flange);
        path.spool_flanges.push(self.0);
    }
}
