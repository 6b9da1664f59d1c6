//! The earth's rate about a gyro's sensitive axis: the known part of its offset.
//!
//! ```text
//! E = Ω_E (sin φ sin el + cos φ cos el cos az)
//! ```
//!
//! φ is the latitude, el the axis' elevation above the horizon, az its azimuth from true north. Ω_E is a turn in a sidereal day.
//!
//! Over several attitudes the offset's steps show the scale factor: b_i = (1 + ε) E_i + D.
//!
//! # Source
//! IERS Conventions (2010), table 1.2: Ω_E = 7.292115e-5 rad/s. IEEE Std 952-1997, 12.8.

use super::scale_factor::ScaleFactorEstimate;

/// Of the earth \[rad/s\].
pub(crate) const EARTH_RATE_RAD_PER_S: f64 = 7.292_115e-5;

/// Where a gyro stands and how its sensitive axis points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Attitude {
    pub(crate) latitude_rad: f64,
    pub(crate) elevation_rad: f64,
    pub(crate) azimuth_rad: f64,
}

impl Attitude {
    /// E \[rad/s\].
    pub(crate) fn earth_rad_per_s(&self) -> f64 {
        let (sin_latitude, cos_latitude) = self.latitude_rad.sin_cos();
        let (sin_elevation, cos_elevation) = self.elevation_rad.sin_cos();
        EARTH_RATE_RAD_PER_S * (sin_latitude * sin_elevation + cos_latitude * cos_elevation * self.azimuth_rad.cos())
    }
}

/// What the offset's steps between attitudes show.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Positions {
    /// ε, of one; its standard error is infinite where two attitudes determine it just so.
    pub(crate) scale_error: ScaleFactorEstimate,
    /// D.
    pub(crate) bias_rad_per_s: f64,
}

/// The line through offsets over the earth's rates; None where all attitudes have the same.
pub(crate) fn positions(earth_rad_per_s: &[f64], offset_rad_per_s: &[f64]) -> Option<Positions> {
    let count = earth_rad_per_s.len() as f64;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / count;
    let (e0, b0) = (mean(earth_rad_per_s), mean(offset_rad_per_s));
    let pairs = || earth_rad_per_s.iter().zip(offset_rad_per_s).map(|(e, b)| (e - e0, b - b0));
    let square: f64 = pairs().map(|(e, _)| e * e).sum();
    // A hundredth of the earth's rate apart.
    if !(square > 1e-4 * EARTH_RATE_RAD_PER_S * EARTH_RATE_RAD_PER_S) {
        return None;
    }
    let slope = pairs().map(|(e, b)| e * b).sum::<f64>() / square;
    let left: f64 = pairs().map(|(e, b)| (b - slope * e).powi(2)).sum();
    let standard_error = if count > 2.0 { (left / (count - 2.0) / square).sqrt() } else { f64::INFINITY };
    Some(Positions {
        scale_error: ScaleFactorEstimate { value: slope - 1.0, standard_error },
        bias_rad_per_s: b0 - slope * e0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::deg_per_h_from_rad_per_s;

    fn at(latitude: f64, elevation: f64, azimuth: f64) -> f64 {
        let [latitude_rad, elevation_rad, azimuth_rad] = [latitude, elevation, azimuth].map(f64::to_radians);
        deg_per_h_from_rad_per_s(Attitude { latitude_rad, elevation_rad, azimuth_rad }.earth_rad_per_s())
    }

    #[test]
    fn the_earths_rate_is_whole_at_the_pole_and_towards_north_at_the_equator() {
        assert!((at(90.0, 90.0, 0.0) - 15.041_067).abs() < 1e-6);
        assert!((at(0.0, 0.0, 0.0) - 15.041_067).abs() < 1e-6);
        assert!(at(0.0, 90.0, 0.0).abs() < 1e-12 && at(48.0, 0.0, 90.0).abs() < 1e-12);
        assert!((at(30.0, 90.0, 0.0) - 0.5 * 15.041_067).abs() < 1e-6);
        assert_eq!(at(48.0, -90.0, 0.0), -at(48.0, 90.0, 0.0));
    }

    #[test]
    fn steps_of_the_offset_between_attitudes_give_scale_factor_and_bias() {
        let earth = [5e-5, -5e-5, 2e-5];
        let offsets = earth.map(|e| 1.002 * e + 3e-7);
        let found = positions(&earth, &offsets).unwrap();
        assert!((found.scale_error.value - 2e-3).abs() < 1e-12 && (found.bias_rad_per_s - 3e-7).abs() < 1e-18);
        assert_eq!(positions(&[5e-5, 5e-5], &[1.0, 2.0]), None);
    }
}
