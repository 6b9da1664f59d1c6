//! The effect `spool_conduction`: equation, parameters, source and signature stand in its `SPEC`.

use super::{Acts, Effect, EffectSpec, Nature, ParameterSpec};
use crate::thermal::{HeatPath, SpoolWall};
use crate::units::Unit;

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "spool_conduction",
    summary: "The metal of the spool conducts along the axis, from flange to flange and into its flanges",
    equation: "C ∂T_s/∂t = k w ∂²T_s/∂z² + h (T(r_in) − T_s) per bore area, w the wall; into a spool's flange through k w over half the pack's depth",
    acts: Acts::HeatPath,
    nature: Nature::Physical,
    parameters: &[
        ParameterSpec {
            key: "conductivity_w_per_m_k",
            unit: Unit::WattPerMetreKelvin,
            meaning: "conductivity of the spool: 167 for aluminium 6061, 6.7 for titanium Ti-6Al-4V",
            lower: 0.05,
            upper: 2000.0,
            start: 167.0,
            default: None,
        },
        ParameterSpec {
            key: "wall_mm",
            unit: Unit::Millimetre,
            meaning: "w, thickness of the spool's wall and flanges",
            lower: 0.01,
            upper: 100.0,
            start: 2.0,
            default: None,
        },
    ],
    choices: &[],
    source: "conduction along a thin wall (fin), Incropera et al., section 3.6; conductivities of metals: table A.1",
    signature: "an axial gradient that dies out faster than the pack's own conduction lets it; nothing without a heated flange",
    happens: "The spool carries heat along the axis much faster than the pack does, so that the bore's ends come closer to each other.",
    remedy: "A spool of poorly conducting metal keeps a flange's heat near the flange, a well conducting one spreads it; compare both in the model.",
    experiment: "heat one flange with coils on spools of two metals, or sensors at both ends of the bore",
    build: |values, _, _| Box::new(Conducting(SpoolWall { conductivity_w_per_m_k: values[0], thickness_m: values[1] })),
};

#[derive(Debug)]
struct Conducting(SpoolWall);

impl Effect for Conducting {
    fn change_heat_path(&self, path: &mut HeatPath) {
        path.spool_wall = Some(self.0);
    }
}
