//! What a conductivity that depends on temperature does to the pack, cheaply enough to be tried many times.
//!
//! ```text
//! H(a) = H(0) + a H_1 + a² H_2 + a³ H_3
//! ```
//!
//! H(0) is the linear field with whatever else a hypothesis changes; the others belong to the path under which the
//! boundary was estimated.
//!
//! Holds for slopes that change the conductivity by some ten or twenty per cent over the record (the next term is of fourth order).
//! Leaves out how the other changes of a hypothesis change the effect of the slope.

use crate::thermal::{self, Drive, HeatPath, SlopeTerm, ThermalHistory};

/// What a slope adds to a pack's history, by powers of the slope.
pub(super) struct SlopeResponse {
    terms: [SlopeTerm; thermal::SLOPE_ORDERS],
}

impl SlopeResponse {
    /// None where the path cannot be solved with such a slope. A flange is left out.
    pub fn new(path: &HeatPath, drive: &Drive, times_s: &[f64], rate_mean_s: f64) -> Option<Self> {
        let path = path.without_flanges();
        Some(Self { terms: thermal::slope_series(&path, drive, times_s, rate_mean_s).ok()? })
    }

    /// Adds the effect of a slope to a history without one.
    pub fn add_to(&self, history: &mut ThermalHistory, slope_per_k: f64) {
        for (term, factor) in self.terms.iter().zip(thermal::slope_powers(slope_per_k)) {
            let add = |to: &mut [f64], from: &[f64]| to.iter_mut().zip(from).for_each(|(t, f)| *t += factor * f);
            add(&mut history.temperature_k, &term.temperature_k);
            add(&mut history.rate_k_per_s, &term.rate_k_per_s);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::piecewise::PiecewiseLinear;
    use crate::thermal::{BoreHeat, Extent, Location, Material, PackShape, Spool};

    #[test]
    fn a_slope_does_what_it_does_in_the_stepped_solution() {
        let shape = PackShape { layers: 8, bore_radius_m: 0.04, radial_pitch_m: 400e-6, height_m: 8.5e-3 };
        let material = Material::Conductivity { w_per_m_k: 0.35, heat_capacity_j_per_m3_k: 1.7e6 };
        let plain = HeatPath::new(shape, Extent::Pack, material, Location::OuterLayer);
        let spool = Spool { heat_capacity_j_per_m2_k: 4000.0, contact_w_per_m2_k: 300.0, mount_w_per_m2_k: 20.0 };
        let bore_heat = Some(BoreHeat { power_w_per_m2: 50.0, time_constant_s: 300.0 });
        let full = HeatPath {
            location: Location::Ambient,
            film_w_per_m2_k: Some(25.0),
            spool: Some(spool),
            bore_heat,
            ..plain.clone()
        };
        let outer = PiecewiseLinear::new(vec![0.0, 103.0, 1300.0, 2000.0], vec![293.0, 293.0, 323.0, 323.0]).unwrap();
        let drive = Drive::boundary(outer);
        let times_s: Vec<f64> = (1..200).map(|i| 10.0 * f64::from(i)).collect();
        for (path, window_s) in [(plain.clone(), 10.0), (plain, 0.0), (full, 10.0)] {
            let response = SlopeResponse::new(&path, &drive, &times_s, window_s).unwrap();
            let without = thermal::solve(&path, &drive).unwrap().means(&times_s, window_s);
            for slope_per_k in [0.001, -0.0035] {
                let bent = HeatPath { conductivity_slope_per_k: slope_per_k, ..path.clone() };
                let exact = thermal::solve(&bent, &drive).unwrap().means(&times_s, window_s);
                let mut quick = without.clone();
                response.add_to(&mut quick, slope_per_k);
                let effect = distance(&exact.rate_k_per_s, &without.rate_k_per_s);
                let error = distance(&exact.rate_k_per_s, &quick.rate_k_per_s);
                println!("slope {slope_per_k}: effect {effect:.3e} K/s, error {error:.1e}");
                // Where the outermost layer itself turns sharply, the two differ by how its shock is sampled.
                let share = if path.film_w_per_m2_k.is_some() { 0.002 } else { 0.01 };
                assert!(error < share * effect);
                let effect = distance(&exact.temperature_k, &without.temperature_k);
                assert!(distance(&exact.temperature_k, &quick.temperature_k) < share * effect);
            }
        }
    }

    fn distance(a: &[f64], b: &[f64]) -> f64 {
        (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt()
    }
}
