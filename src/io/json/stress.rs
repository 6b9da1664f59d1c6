//! Materials, what they do to a coil, and which of them suit it, as documents.

use serde::Serialize;
use serde_json::{Value, json};

use super::schema::{described, name, table};
use crate::stress::library::{Entry, MATERIALS};
use crate::stress::material::Material;
use crate::units::{celsius_from_kelvin, mpa_from_pa};

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct MaterialsJson {
    pub(crate) materials: Vec<MaterialJson>,
}

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct MaterialJson {
    pub(crate) name: String,
    /// "glass", "coating", "adhesive" or "spool"; null for what a model file defines.
    pub(crate) used_as: Option<&'static str>,
    pub(crate) at: Vec<ElasticJson>,
    pub(crate) source: &'static str,
    /// False: the usual number of the field, of which no accessible source was read.
    pub(crate) source_was_read: bool,
}

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct ElasticJson {
    pub(crate) temperature_c: f64,
    pub(crate) youngs_modulus_mpa: f64,
    pub(crate) poisson_ratio: f64,
    pub(crate) expansion_per_k: f64,
}

impl ElasticJson {
    pub(crate) fn of(material: &Material, temperature_k: f64) -> Self {
        let elastic = material.at(temperature_k);
        Self {
            temperature_c: celsius_from_kelvin(temperature_k),
            youngs_modulus_mpa: mpa_from_pa(elastic.youngs_modulus_pa),
            poisson_ratio: elastic.poisson_ratio,
            expansion_per_k: elastic.expansion_per_k,
        }
    }
}

impl MaterialJson {
    pub(crate) fn of(entry: &Entry, temperatures_k: &[f64]) -> Self {
        let material = entry.material();
        Self {
            name: entry.name.to_owned(),
            used_as: Some(entry.used_as.word()),
            at: temperatures_k.iter().map(|t| ElasticJson::of(&material, *t)).collect(),
            source: entry.source.text,
            source_was_read: entry.source.was_read,
        }
    }
}

/// What a uniform change of temperature does to a coil, per kelvin.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct StressJson {
    pub(crate) model: String,
    /// Whether nothing depends on temperature, so that a guaranteed worst case exists.
    pub(crate) is_linear: bool,
    pub(crate) temperatures: Vec<StressAtJson>,
}

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct StressAtJson {
    pub(crate) temperature_c: f64,
    /// The coated fibre by itself, nothing holding it.
    pub(crate) free_fibre: FreeFibreJson,
    /// κ of the coil, on average over the fibre.
    pub(crate) path_per_k: f64,
    /// `strength` of the free effect `stress_gradient` that comes nearest; null where it says nothing of these layers.
    pub(crate) stress_gradient_strength: Option<f64>,
    /// Innermost first.
    pub(crate) layers: Vec<LayerStressJson>,
    pub(crate) patterns: Vec<PatternStressJson>,
}

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct FreeFibreJson {
    pub(crate) expansion_per_k: f64,
    pub(crate) path_per_k: f64,
}

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct LayerStressJson {
    /// Counted from 1 innermost.
    pub(crate) layer: usize,
    pub(crate) hoop_strain_per_k: f64,
    pub(crate) radial_strain_per_k: f64,
    pub(crate) axial_strain_per_k: f64,
    /// Of the glass, across the fibre.
    pub(crate) glass_transverse_strain_per_k: f64,
    /// κ_j.
    pub(crate) path_per_k: f64,
}

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct PatternStressJson {
    pub(crate) name: String,
    /// `mismatch` of the free effect `strain_mismatch` that makes the same error in a steady ramp.
    pub(crate) equivalent_mismatch: f64,
    /// At the steepest rate of the profiles.
    pub(crate) steady_ramp_deg_per_h: f64,
}

/// Pottings and spools by their effect on the worst case, best first.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct PottingJson {
    pub(crate) model: String,
    pub(crate) choices: Vec<PottingChoiceJson>,
}

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct PottingChoiceJson {
    pub(crate) adhesive: String,
    /// Null for a pack that stands by itself.
    pub(crate) spool: Option<String>,
    /// Whether it is what the model file states.
    pub(crate) is_declared: bool,
    /// The winding that is best with it.
    pub(crate) best_pattern: String,
    pub(crate) worst_rate_deg_per_h: f64,
    pub(crate) worst_profile: String,
    /// Null where stiffness or expansion depend on temperature.
    pub(crate) guaranteed_worst_rate_deg_per_h: Option<f64>,
    pub(crate) path_per_k: f64,
    pub(crate) equivalent_mismatch: f64,
}

/// The `[materials]` table of a model file.
#[expect(clippy::too_many_lines, reason = "one schema, table by table")]
pub(super) fn schema() -> Value {
    let material = |of: &str| {
        let names: Vec<&str> = MATERIALS.iter().map(|entry| entry.name).collect();
        json!({ "description": format!("{of}: a material of the library or of [[materials.own]]"),
            "anyOf": [{ "enum": names }, { "type": "string" }] })
    };
    let property = |of: &str| {
        let transition = table(
            "a glass transition",
            &["glassy", "rubbery", "transition_c", "width_k"],
            json!({
                "glassy": described("number", "far below the transition"),
                "rubbery": described("number", "far above it"),
                "transition_c": described("number", "its middle"),
                "width_k": { "type": "number", "minimum": 1, "maximum": 100 },
            }),
        );
        let pair = json!({ "type": "array", "minItems": 2, "maxItems": 2, "items": { "type": "number" } });
        json!({ "description": of, "anyOf": [
            { "type": "number" },
            { "type": "array", "minItems": 1, "items": pair, "description": "temperature_c and value, rising" },
            transition,
        ] })
    };
    let coating = table(
        "a coating",
        &["material", "outer_diameter_um"],
        json!({ "material": material("the coating"), "outer_diameter_um": described("number", "over it") }),
    );
    let fibre = table(
        "materials.fibre",
        &["glass", "glass_diameter_um"],
        json!({
            "glass": material("the glass"),
            "glass_diameter_um": described("number", "over the glass"),
            "hole_diameter_um": described("number", "of a hollow core's glass tube; 0: light runs in the glass"),
            "strain_optic_p11": described("number", "p11 of the glass; 0.113, and 0 where the core is hollow"),
            "strain_optic_p12": described("number", "p12 of the glass; 0.252, and 0 where the core is hollow"),
            "coatings": { "type": "array", "items": coating, "description": "from within outwards" },
        }),
    );
    let own = table(
        "materials.own",
        &["name", "youngs_modulus_mpa", "expansion_per_k"],
        json!({
            "name": name("of the material"),
            "youngs_modulus_mpa": property("E over temperature"),
            "poisson_ratio": property("or bulk_modulus_mpa"),
            "bulk_modulus_mpa": property("or poisson_ratio"),
            "expansion_per_k": property("linear expansion over temperature"),
            "source": { "type": "string", "description": "where the numbers are from" },
        }),
    );
    table(
        "materials",
        &["adhesive", "fibre"],
        json!({
            "adhesive": material("what fills the gaps between the turns"),
            "spool": material("what the pack is bonded to; none for a pack that stands by itself"),
            "spool_thickness_mm": described("number", "of its tube"),
            "fibre": fibre,
            "own": { "type": "array", "items": own },
        }),
    )
}
