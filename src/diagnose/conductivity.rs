//! What a conductivity that depends on temperature does to the pack, cheaply enough to be tried many times.
//!
//! ```text
//! H(a) = H(0) + a (H₊ − H₋)/(2 a₁) + a² (H₊ + H₋ − 2 H₀)/(2 a₁²),   H± = H(±a₁)
//! ```
//!
//! H(0) is the linear field with whatever else a hypothesis changes, H± are two stepped solutions of the path under
//! which the boundary was estimated.
//!
//! Holds for slopes that change the conductivity by some ten per cent over the record (the next term is of third order).
//! Leaves out how the other changes of a hypothesis change the effect of the slope.

use crate::numeric::piecewise::PiecewiseLinear;
use crate::thermal::{self, Drive, HeatPath, ThermalHistory};

/// a₁ [1/K].
const TRIED_SLOPE_PER_K: f64 = 0.002;

/// By how much the drive of the tried solutions may differ from the estimated one \[K\]: all three have the same drive, so
/// that this only changes the effect of the slope by its own share, and there are ten times fewer steps.
const DRIVE_TOLERANCE_K: f64 = 2e-3;
/// Error of one step, as a share of the drive's span.
const STEP_TOLERANCE: f64 = 1e-6;

/// First and second derivative of a pack's history with respect to the slope.
pub(super) struct SlopeResponse {
    first: Parts,
    second: Parts,
}

/// What differs between two histories of one record.
struct Parts {
    temperature_k: Vec<f64>,
    rate_k_per_s: Vec<f64>,
    axial_moment_k_per_s: Vec<f64>,
}

impl SlopeResponse {
    /// None where the path cannot be solved with such a slope.
    pub fn new(path: &HeatPath, drive: &Drive, times_s: &[f64], rate_mean_s: f64) -> Option<Self> {
        let simple = |course: &PiecewiseLinear| course.simplified(DRIVE_TOLERANCE_K);
        let drive = Drive { boundary_k: simple(&drive.boundary_k), ambient_k: drive.ambient_k.as_ref().map(simple) };
        let at = |slope_per_k: f64| {
            let path = HeatPath { conductivity_slope_per_k: slope_per_k, ..path.clone() };
            Some(thermal::solve_within(&path, &drive, STEP_TOLERANCE).ok()?.means(times_s, rate_mean_s))
        };
        let (none, more, less) = (at(0.0)?, at(TRIED_SLOPE_PER_K)?, at(-TRIED_SLOPE_PER_K)?);
        let first = |above: f64, below: f64, _: f64| (above - below) / (2.0 * TRIED_SLOPE_PER_K);
        let second = |above: f64, below: f64, middle: f64| {
            (above + below - 2.0 * middle) / (2.0 * TRIED_SLOPE_PER_K * TRIED_SLOPE_PER_K)
        };
        Some(Self {
            first: Parts::combined(&more, &less, &none, first),
            second: Parts::combined(&more, &less, &none, second),
        })
    }

    /// Adds the effect of a slope to a history without one.
    pub fn add_to(&self, history: &mut ThermalHistory, slope_per_k: f64) {
        for (parts, factor) in [(&self.first, slope_per_k), (&self.second, slope_per_k * slope_per_k)] {
            let add = |to: &mut [f64], from: &[f64]| to.iter_mut().zip(from).for_each(|(t, f)| *t += factor * f);
            add(&mut history.temperature_k, &parts.temperature_k);
            add(&mut history.rate_k_per_s, &parts.rate_k_per_s);
            add(&mut history.axial_moment_k_per_s, &parts.axial_moment_k_per_s);
        }
    }
}

impl Parts {
    fn combined(
        above: &ThermalHistory,
        below: &ThermalHistory,
        middle: &ThermalHistory,
        by: impl Fn(f64, f64, f64) -> f64,
    ) -> Self {
        let of = |part: fn(&ThermalHistory) -> &Vec<f64>| {
            part(above).iter().zip(part(below)).zip(part(middle)).map(|((a, b), m)| by(*a, *b, *m)).collect()
        };
        Self {
            temperature_k: of(|h| &h.temperature_k),
            rate_k_per_s: of(|h| &h.rate_k_per_s),
            axial_moment_k_per_s: of(|h| &h.axial_moment_k_per_s),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thermal::{Extent, Location, Material, PackShape};

    #[test]
    fn a_slope_between_the_tried_ones_and_beyond_is_that_of_the_stepped_solution() {
        let shape = PackShape { layers: 8, bore_radius_m: 0.04, radial_pitch_m: 400e-6, height_m: 8.5e-3 };
        let material = Material::Conductivity { w_per_m_k: 0.35, heat_capacity_j_per_m3_k: 1.7e6 };
        let path = HeatPath::new(shape, Extent::Pack, material, Location::OuterLayer);
        let outer = PiecewiseLinear::new(vec![0.0, 100.0, 1300.0, 2000.0], vec![293.0, 293.0, 323.0, 323.0]).unwrap();
        let drive = Drive::boundary(outer);
        let times_s: Vec<f64> = (1..200).map(|i| 10.0 * f64::from(i)).collect();
        let response = SlopeResponse::new(&path, &drive, &times_s, 10.0).unwrap();
        let without = thermal::solve(&path, &drive).unwrap().means(&times_s, 10.0);
        for slope_per_k in [0.001, -0.0035] {
            let bent = HeatPath { conductivity_slope_per_k: slope_per_k, ..path.clone() };
            let exact = thermal::solve(&bent, &drive).unwrap().means(&times_s, 10.0);
            let mut quick = without.clone();
            response.add_to(&mut quick, slope_per_k);
            let effect = distance(&exact.rate_k_per_s, &without.rate_k_per_s);
            let error = distance(&exact.rate_k_per_s, &quick.rate_k_per_s);
            println!("slope {slope_per_k}: effect {effect:.3e} K/s, error {error:.1e}");
            assert!(error < 0.01 * effect);
        }
    }

    fn distance(a: &[f64], b: &[f64]) -> f64 {
        (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt()
    }
}
