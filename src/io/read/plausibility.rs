//! What a model file states that is possible but unlikely: `check` says it, nothing is refused for it.
//!
//! # Source
//! Ranges of silica fibre at 0.6 to 1.7 µm and of potted or dry packs: Lefèvre, The Fiber-Optic Gyroscope (2014),
//! sections 6 and 7; polymers and composites, Incropera et al., table A.3; least bend radius of standard fibre, IEC
//! 60793-2-50.

use crate::effect;
use crate::io::model::{Advice, ModelFile, Unusual};
use crate::rate::CoilModel;
use crate::thermal::PackMaterial;
use crate::units::{mm_from_m, nm_from_m, um_from_m};

/// A key, the range in which its value usually lies, and its unit.
struct Usual {
    key: &'static str,
    low: f64,
    high: f64,
    unit: &'static str,
    value: fn(&CoilModel) -> Option<f64>,
}

const USUAL: [Usual; 8] = [
    Usual {
        key: "fibre.refractive_index",
        low: 1.40,
        high: 1.60,
        unit: "",
        value: |m| Some(m.coil.fibre().refractive_index),
    },
    Usual {
        key: "fibre.thermo_optic_per_k",
        low: 5e-6,
        high: 1.5e-5,
        unit: " 1/K",
        value: |m| Some(m.coil.fibre().thermo_optic_per_k),
    },
    Usual {
        key: "fibre.wavelength_nm",
        low: 600.0,
        high: 1700.0,
        unit: " nm",
        value: |m| Some(nm_from_m(m.coil.fibre().wavelength_m)),
    },
    Usual {
        key: "fibre.outer_diameter_um",
        low: 80.0,
        high: 500.0,
        unit: " µm: cladding and coating together",
        value: |m| Some(um_from_m(m.coil.fibre().outer_diameter_m)),
    },
    Usual {
        key: "the bore's radius",
        low: 8.0,
        high: 500.0,
        unit: " mm: fibre that is bent more tightly loses light and breaks",
        value: |m| Some(mm_from_m(m.coil.bore_radius_m())),
    },
    Usual {
        key: "thermal.conductivity_w_per_m_k",
        low: 0.05,
        high: 3.0,
        unit: " W/(m K)",
        value: |m| match m.material {
            PackMaterial::Conductivity { w_per_m_k, .. } => Some(w_per_m_k),
            PackMaterial::Diffusivity { .. } => None,
        },
    },
    Usual {
        key: "thermal.volumetric_heat_capacity_j_per_m3_k",
        low: 8e5,
        high: 4e6,
        unit: " J/(m³ K)",
        value: |m| match m.material {
            PackMaterial::Conductivity { heat_capacity_j_per_m3_k, .. } => Some(heat_capacity_j_per_m3_k),
            PackMaterial::Diffusivity { .. } => None,
        },
    },
    Usual {
        key: "thermal.diffusivity_m2_per_s",
        low: 2e-8,
        high: 2e-6,
        unit: " m²/s",
        value: |m| match m.material {
            PackMaterial::Conductivity { .. } => None,
            PackMaterial::Diffusivity { m2_per_s } => Some(m2_per_s),
        },
    },
];

/// Lengths closer than this are the same.
const SAME_LENGTH: f64 = 1e-3;

/// Everything that is said about a model file besides its faults.
pub fn advice(file: &ModelFile) -> Vec<Advice> {
    let mut advice = file.advice.clone();
    let model = &file.model;
    advice.extend(USUAL.iter().filter_map(|usual| {
        let found = (usual.value)(model)?;
        let Usual { key, low, high, unit, .. } = *usual;
        (!(low..=high).contains(&found)).then_some(Advice::Unusual(Unusual { key, found, low, high, unit }))
    }));
    let used_m = model.coil.length_m();
    if let Some(stated_m) = file.stated_length_m.filter(|stated| (stated / used_m - 1.0).abs() > SAME_LENGTH) {
        advice.push(Advice::LengthNotUsed { stated_m, used_m });
    }
    if model.prescribes_outermost_layer() {
        advice.push(Advice::PrescribedBoundary { film: effect::FILM.spec.kind });
    }
    advice
}
