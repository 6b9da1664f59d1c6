//! What records taught of film, offset and chamber, as JSON.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use crate::chamber::{Estimate, Learned, PRIORS, Quantity};
use crate::units::deg_per_h_from_rad_per_s;

use super::EstimateJson;
use super::schema::{described, table};

/// What is written into the `[boundary]` table of a model file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct BoundaryJson {
    /// Null where the model states the film or the records do not determine it.
    pub(crate) surface_film_w_per_m2_k: Option<EstimateJson>,
    pub(crate) offset_deg_per_h: Option<EstimateJson>,
    /// By its key in the model file, which ends in the unit.
    pub(crate) chamber: BTreeMap<String, EstimateJson>,
    pub(crate) records: usize,
}

impl EstimateJson {
    fn new(estimate: Estimate, from_si: fn(f64) -> f64) -> Self {
        let error = from_si(estimate.standard_error);
        Self { value: from_si(estimate.value), standard_error: Some(error).filter(|e| e.is_finite()) }
    }
}

impl BoundaryJson {
    pub(crate) fn new(learned: &Learned) -> Self {
        let same: fn(f64) -> f64 = |v| v;
        Self {
            surface_film_w_per_m2_k: learned.film_w_per_m2_k.map(|e| EstimateJson::new(e, same)),
            offset_deg_per_h: learned.offset_rad_per_s.map(|e| EstimateJson::new(e, deg_per_h_from_rad_per_s)),
            chamber: learned
                .numbers
                .iter()
                .map(|(quantity, estimate)| {
                    let from_si = if quantity.is_rate() { deg_per_h_from_rad_per_s } else { same };
                    (quantity.key().to_owned(), EstimateJson::new(*estimate, from_si))
                })
                .collect(),
            records: learned.records,
        }
    }

    /// For a reader of the command's answer.
    pub(crate) fn words(&self) -> String {
        let stated = |e: &EstimateJson, digits: usize| match e.standard_error {
            Some(error) => format!("{:.digits$} ± {error:.digits$}", e.value),
            None => format!("{:.digits$}", e.value),
        };
        let film = match &self.surface_film_w_per_m2_k {
            Some(film) => format!(
                "film {} W/(m²K): evaluate and optimise on the new model drive the coil by the air, through this film",
                stated(film, 2)
            ),
            None => "film: stated by the model, or not determined by the records".to_owned(),
        };
        match &self.offset_deg_per_h {
            Some(offset) => format!("{film}\noffset {} °/h", stated(offset, 4)),
            None => film,
        }
    }
}

/// The `[boundary]` table of a model file.
pub(super) fn schema() -> Value {
    let number = |quantity: Quantity| {
        let own = table(
            quantity.key(),
            &["value"],
            json!({ "value": { "type": "number", "exclusiveMinimum": 0 }, "standard_error": { "type": "number", "minimum": 0 } }),
        );
        (quantity.key().to_owned(), own)
    };
    let chamber: Map<String, Value> =
        PRIORS.iter().map(|p| p.quantity).filter(|q| q.is_learned()).map(number).collect();
    table(
        "boundary",
        &[],
        json!({
            "location": { "enum": ["ambient"], "description": "profiles are courses of the air" },
            "surface_film_w_per_m2_k": described("number", "searches drive the coil by the air through this film"),
            "surface_film_standard_error_w_per_m2_k": described("number", "of the film"),
            "offset_deg_per_h": described("number", "mean offset of the records"),
            "offset_standard_error_deg_per_h": described("number", "of the offset"),
            "records": { "type": "integer", "minimum": 1 },
            "chamber": table("chamber", &[], Value::Object(chamber)),
        }),
    )
}
