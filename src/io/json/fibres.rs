//! Fibres of the library as a document, and the `[fibre]` table's schema.

use serde::Serialize;
use serde_json::{Value, json};

use super::schema::{described, table};
use crate::stress::fibres::{FIBRES, FibreEntry};
use crate::units::REFERENCE_TEMPERATURE_K;

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct FibresJson {
    pub(crate) fibres: Vec<FibreJson>,
}

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct FibreJson {
    pub(crate) name: &'static str,
    /// "solid", "polarisation-maintaining", "thin" or "hollow-core".
    pub(crate) kind: &'static str,
    pub(crate) refractive_index: f64,
    pub(crate) group_index: f64,
    pub(crate) thermo_optic_per_k: f64,
    pub(crate) wavelength_nm: f64,
    pub(crate) glass_diameter_um: f64,
    pub(crate) hole_diameter_um: f64,
    pub(crate) coatings: Vec<CoatingJson>,
    pub(crate) outer_diameter_um: f64,
    /// κ and expansion of the coated fibre by itself at 20 °C.
    pub(crate) path_per_k: f64,
    pub(crate) expansion_per_k: f64,
    pub(crate) source: &'static str,
    /// False: not every number was read in an accessible source.
    pub(crate) source_was_read: bool,
}

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct CoatingJson {
    pub(crate) material: &'static str,
    pub(crate) outer_diameter_um: f64,
}

impl FibreJson {
    /// None where a material of it is in no library.
    pub(crate) fn of(entry: &FibreEntry) -> Option<Self> {
        let free = entry.made_of()?.free_fibre(&entry.optics(), REFERENCE_TEMPERATURE_K);
        let coatings = entry.coatings.iter();
        Some(Self {
            name: entry.name,
            kind: entry.kind,
            refractive_index: entry.refractive_index,
            group_index: entry.group_index,
            thermo_optic_per_k: entry.thermo_optic_per_k,
            wavelength_nm: entry.wavelength_nm,
            glass_diameter_um: entry.glass_diameter_um,
            hole_diameter_um: entry.hole_diameter_um,
            coatings: coatings
                .map(|&(material, outer_diameter_um)| CoatingJson { material, outer_diameter_um })
                .collect(),
            outer_diameter_um: entry.outer_diameter_um(),
            path_per_k: free.path_per_k,
            expansion_per_k: free.expansion_per_k,
            source: entry.source.text,
            source_was_read: entry.source.was_read,
        })
    }
}

impl FibresJson {
    pub(crate) fn all() -> Self {
        Self { fibres: FIBRES.iter().filter_map(FibreJson::of).collect() }
    }
}

/// The `[fibre]` table of a model file.
pub(super) fn schema() -> Value {
    let names: Vec<&str> = FIBRES.iter().map(|entry| entry.name).collect();
    let mut schema = table(
        "fibre",
        &[],
        json!({
            "library": { "enum": names, "description": "a fibre of the library; what is stated beside it holds" },
            "refractive_index": described("number", "phase index of the guided mode"),
            "group_index": described("number", "with which light travels; default: the phase index"),
            "thermo_optic_per_k": described("number", "dn/dT"),
            "thermal_expansion_per_k": described("number", "alpha in dn/dT + n·alpha; 0 leaves it out"),
            "wavelength_nm": described("number", "of the light in vacuum"),
            "outer_diameter_um": described("number", "over the coating"),
        }),
    );
    let stated = ["refractive_index", "thermo_optic_per_k", "wavelength_nm", "outer_diameter_um"];
    schema["anyOf"] = json!([{ "required": ["library"] }, { "required": stated }]);
    schema
}
