//! Residuals whose inner products are weighted by the inverse covariance of noise and boundary.

use super::air::Scene;
use super::{Air, BoundaryError};
use crate::numeric::state_space::Whitener;

/// Turns a column over a record's rows into one whose inner products are weighted by the residuals' inverse covariance.
#[derive(Debug, Clone)]
pub struct RateWhitener {
    whitener: Whitener,
    /// Which measurement of the whitener is the rate of each row.
    rate_places: Vec<usize>,
    noise_rad_per_s: f64,
}

impl RateWhitener {
    pub(super) fn new(scene: &Scene, air: &Air, noise_rad_per_s: f64) -> Result<Self, BoundaryError> {
        let space = scene.joint_space(air, noise_rad_per_s)?;
        Ok(Self { whitener: space.space.whitener(), rate_places: space.rate_places, noise_rad_per_s })
    }

    /// # Shapes
    /// One value a row in; more than one a row out, in units of the noise.
    pub fn whiten(&self, column_rad_per_s: &[f64]) -> Vec<f64> {
        let mut measurements = vec![0.0; self.whitener.len()];
        for (&place, value) in self.rate_places.iter().zip(column_rad_per_s) {
            measurements[place] = value / self.noise_rad_per_s;
        }
        self.whitener.whiten(&measurements)
    }
}
