//! The effect `thermal_stress`: what a model file's materials do; equation, source and signature stand in its `SPEC`.

use std::sync::Arc;

use super::{Acts, Effect, EffectSpec, Nature, Subject};
use crate::stress::{Materials, PackStress};

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "thermal_stress",
    summary: "Thermal stress of pack and spool, computed from the materials: every layer's strain follows all temperatures",
    equation: "κ_j Ṫ_j becomes ξ Ṫ_j + n ε̇_a − n³/2 [(p11 + p12)(ε̇_t − α_g Ṫ_j) + p12 (ε̇_a − α_g Ṫ_j)], ε̇ = ε̇(Ṫ_1 … Ṫ_N)",
    acts: Acts::Response,
    nature: Nature::Physical,
    parameters: &[],
    choices: &[],
    source: "Butter and Hocker, Appl. Opt. 17, 2867 (1978); Mohr and Schadt, Proc. SPIE 5502, 410 (2004); the layered thick ring: Lekhnitskii, Timoshenko and Goodier",
    signature: "an error ∝ the pack's mean rate in a steady ramp, as of halves that differ, which depends on the winding; where a material goes through its glass transition it changes with temperature",
    happens: "Spool, adhesive and coatings expand more than glass and strain the fibre of each layer by another amount.",
    remedy: "Choose spool and potting by what `coilwright potting` says of them, and a winding whose halves lie at equal radii.",
    experiment: "one slow ramp through the whole range of temperature: in it the error follows the stress alone",
    build: |_, _, binding| match binding.subject {
        Subject::Materials(materials) => Box::new(ThermalStress {
            is_linear: materials.is_constant(),
            path_per_k: binding.coil.fibre().path_per_k(),
            stress: PackStress::new(materials, binding.coil),
        }),
        _ => Box::new(NoMaterials),
    },
};

#[derive(Debug)]
struct ThermalStress {
    is_linear: bool,
    /// κ of the model, which the layers' changes are given in.
    path_per_k: f64,
    stress: PackStress,
}

impl Effect for ThermalStress {
    fn is_linear(&self) -> bool {
        self.is_linear
    }

    fn followed_rates(&self, temperatures_k: &[f64], rates_k_per_s: &[f64]) -> Option<Vec<f64>> {
        let changes = self.stress.changes(temperatures_k, rates_k_per_s);
        Some(changes.iter().map(|layer| layer.path / self.path_per_k).collect())
    }
}

/// Without materials there is nothing that could be strained.
#[derive(Debug)]
struct NoMaterials;

impl Effect for NoMaterials {}

/// What an effect of these materials is about.
pub(super) fn subject(materials: Materials) -> Subject {
    Subject::Materials(Arc::new(materials))
}
