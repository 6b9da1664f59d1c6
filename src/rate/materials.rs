//! A model's materials: which there are, and the same model made of others.

use super::CoilModel;
use crate::effect::{DeclaredEffect, Subject, THERMAL_STRESS};
use crate::stress::{Materials, PackStress};
use crate::units::REFERENCE_TEMPERATURE_K;

impl CoilModel {
    /// What the coil is made of, where the model states it.
    pub(crate) fn materials(&self) -> Option<&Materials> {
        self.effects.iter().find_map(|effect| match effect.subject() {
            Subject::Materials(materials) => Some(materials.as_ref()),
            _ => None,
        })
    }

    /// The same coil made of these; κ is what they make of it at 20 °C, on average over the fibre.
    pub fn with_materials(&self, materials: &Materials) -> Self {
        let mut model = self.clone();
        let fibre = self.coil.fibre();
        let path_per_k = PackStress::new(materials, &self.coil).mean_path_per_k(&self.coil, REFERENCE_TEMPERATURE_K);
        let beyond_index = (path_per_k - fibre.thermo_optic_per_k) / fibre.refractive_index;
        model.coil = self.coil.with_thermal_expansion(beyond_index);
        let declared = DeclaredEffect::thermal_stress(materials.clone());
        match model.effects.iter_mut().find(|effect| effect.spec().kind == THERMAL_STRESS.kind) {
            Some(effect) => *effect = declared,
            None => model.effects.push(declared),
        }
        model
    }
}
