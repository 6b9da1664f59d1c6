//! Noise told apart, as JSON.

use serde::{Deserialize, Serialize};

use crate::chamber::Remedy;
use crate::diagnose::RecordNoise;
use crate::units::deg_per_h_from_rad_per_s;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct RecordNoiseJson {
    pub(crate) record: String,
    /// Of one logged rate.
    pub(crate) white_deg_per_h: f64,
    pub(crate) white_standard_error_deg_per_h: f64,
    pub(crate) wander_deg_per_h: f64,
    /// What the air did and the sensor could not see.
    pub(crate) unresolved_air_deg_per_h: f64,
    /// What the rate differs from the prediction beyond all that.
    #[serde(default)]
    pub(crate) model_error_deg_per_h: f64,
    /// What a change of the measurement would leave of the unresolved air, most helpful first.
    #[serde(default)]
    pub(crate) remedies: Vec<RemedyJson>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct RemedyJson {
    pub(crate) change: String,
    pub(crate) unresolved_air_deg_per_h: f64,
}

impl RecordNoiseJson {
    pub(super) fn new(of: &RecordNoise) -> Self {
        Self {
            record: of.record.clone(),
            white_deg_per_h: deg_per_h_from_rad_per_s(of.noise.white_rad_per_s),
            white_standard_error_deg_per_h: deg_per_h_from_rad_per_s(of.noise.white_standard_error_rad_per_s()),
            wander_deg_per_h: deg_per_h_from_rad_per_s(of.noise.wander_rad_per_s),
            unresolved_air_deg_per_h: deg_per_h_from_rad_per_s(of.noise.unresolved_air_rad_per_s),
            model_error_deg_per_h: deg_per_h_from_rad_per_s(of.noise.model_error_rad_per_s),
            remedies: of.noise.remedies.iter().map(RemedyJson::new).collect(),
        }
    }
}

impl RemedyJson {
    fn new(&(remedy, left_rad_per_s): &(Remedy, f64)) -> Self {
        let change = match remedy {
            Remedy::QuieterSensor => "a sensor of a tenth of the noise",
            Remedy::FinerResolution => "readings that are not rounded",
            Remedy::SensorInAir => "a sensor without lag in the air",
            Remedy::CalmerAir => "air that ripples and is turbulent half as much",
        };
        Self { change: change.to_owned(), unresolved_air_deg_per_h: deg_per_h_from_rad_per_s(left_rad_per_s) }
    }
}
