//! The effect `axial_gradient`: equation, parameters, source and signature stand in its `SPEC`.

use super::{Acts, ChoiceSpec, Effect, EffectSpec, Nature, ParameterSpec};
use crate::thermal::{Flange, FlangeFilm, HeatPath};
use crate::units::Unit;

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "axial_gradient",
    summary: "A flange exchanges heat with the ambient, so temperature varies along the axis; declared twice, both flanges do",
    equation: "k dT/dz = ±h (T − T_air) at one flange; the optics see the layer's first axial moment ∫ Ṫ ζ dζ, signed by its direction",
    acts: Acts::HeatPath,
    nature: Nature::Physical,
    parameters: &[ParameterSpec {
        key: "film_w_per_m2_k",
        unit: Unit::WattPerSquareMetreKelvin,
        meaning: "film coefficient at the flange",
        lower: 0.1,
        upper: 100000.0,
        start: 20.0,
        default: None,
    }],
    choices: &[ChoiceSpec {
        key: "flange",
        options: &["first", "second"],
        meaning: "the flange that exchanges heat; layer 1 starts at the first",
    }],
    source: "Mohr, J. Lightwave Technol. 14, 27 (1996): the axial contribution to the Shupe error",
    signature: "an error in the transients that does not follow from the radial model and whose sign belongs to the flange",
    happens: "One flange exchanges heat with the air, so the two ends of every layer differ in temperature and the directions of winding no longer cancel.",
    remedy: "Insulate or equalise the flanges; with the flange declared, windings can be compared with the axial gradient counted.",
    experiment: "heat one flange, then the other; or insulate both",
    build: |values, choices, _| {
        let flange = if choices[0] == 0 { Flange::First } else { Flange::Second };
        Box::new(AxialGradient(FlangeFilm { flange, film_w_per_m2_k: values[0] }))
    },
};

#[derive(Debug)]
struct AxialGradient(FlangeFilm);

impl Effect for AxialGradient {
    fn change_heat_path(&self, path: &mut HeatPath) {
        match path.flange {
            Some(first) if first.flange != self.0.flange => path.opposite_flange = Some(self.0),
            _ => path.flange = Some(self.0),
        }
    }
}
