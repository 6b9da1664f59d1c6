//! The pack's heat network, built again.
//!
//! ```text
//! C dT/dt + G (T − u) = q,   C = ρc (r₂² − r₁²)/2,   G = k/ln(r₂/r₁), in series with a contact or film   per radian
//! ```
//!
//! It is stepped where the conductivity depends on temperature; what is linear has a closed form ([`super::layers`]). A
//! spool stands in front of the first cell; the axis is cut into slices where a flange is heated.

use super::physics::Physics;
use crate::rate::CoilModel;

/// How finely the pack is cut.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cut {
    /// Even, so that a layer's middle is a face between cells.
    pub(crate) cells_per_layer: usize,
    /// Along the axis, where a flange is heated.
    pub(crate) slices: usize,
}

/// A way for heat: through the material, then through a contact or a film.
#[derive(Debug, Clone, Copy)]
pub(super) struct Link {
    /// ln(r₂/r₁) of the material's part.
    log_ratio: f64,
    /// Resistance of the rest [rad m K/W].
    rest: f64,
}

impl Link {
    pub(crate) fn conductance(self, conductivity_w_per_m_k: f64) -> f64 {
        1.0 / (self.log_ratio / conductivity_w_per_m_k + self.rest)
    }
}

/// Everything per radian and per height.
#[derive(Debug, Clone)]
pub(super) struct Network {
    pub(crate) layers: usize,
    pub(crate) cells_per_layer: usize,
    /// The spool's node, if there is one, comes first.
    pub(crate) spool: usize,
    pub(crate) capacity: Vec<f64>,
    /// Between node i and the next one; the last leads to the drive.
    pub(crate) links: Vec<Link>,
    pub(crate) mount: f64,
    pub(crate) bore_radius_m: f64,
    pub(crate) outermost_is_drive: bool,
    pub(crate) conductivity_w_per_m_k: f64,
    pub(crate) slope_per_k: f64,
    pub(crate) axis: Option<Axis>,
}

/// The cut along the axis.
#[derive(Debug, Clone)]
pub(super) struct Axis {
    pub(crate) slices: usize,
    /// k/(ρc Δz²) [1/s].
    pub(crate) exchange_per_s: f64,
    /// Δz ρc [J/(m² K)] and Δz/2 [m].
    pub(crate) slice_capacity_j_per_m2_k: f64,
    pub(crate) half_slice_m: f64,
    /// Slices that touch a heated flange, with its film [W/(m² K)].
    pub(crate) heated: Vec<(usize, f64)>,
}

impl Axis {
    /// From a slice to the air behind its flange, if it has one [1/s].
    pub(crate) fn film_per_s(&self, slice: usize, conductivity_w_per_m_k: f64) -> f64 {
        let of = |film: f64| {
            let resistance = self.half_slice_m / conductivity_w_per_m_k + 1.0 / film;
            1.0 / (resistance * self.slice_capacity_j_per_m2_k)
        };
        self.heated.iter().filter(|(at, _)| *at == slice).map(|(_, film)| of(*film)).sum()
    }

    /// First moment over ζ = −½ … ½ of what the slices hold, exact for what is linear in ζ.
    pub(crate) fn moment_weights(&self) -> Vec<f64> {
        let n = self.slices as f64;
        let centres: Vec<f64> = (0..self.slices).map(|m| (m as f64 + 0.5) / n - 0.5).collect();
        let of_linear: f64 = centres.iter().map(|c| c * c).sum();
        centres.iter().map(|c| c / (12.0 * of_linear)).collect()
    }
}

impl Network {
    pub(crate) fn new(model: &CoilModel, physics: &Physics, height_m: f64, cut: Cut) -> Self {
        let coil = &model.coil;
        let (layers, bore_m, pitch_m) = (coil.layers(), coil.bore_radius_m(), coil.radial_pitch_m());
        let cells = cut.cells_per_layer;
        let outermost_is_drive = !physics.driven_from_outside;
        // Where the outermost layer carries the drive, it does so at its middle.
        let count = layers * cells - if outermost_is_drive { cells / 2 } else { 0 };
        let width_m = pitch_m / cells as f64;
        let radius_m = |faces: f64| bore_m + faces * width_m;
        let between = |inner: f64, outer: f64| Link { log_ratio: (radius_m(outer) / radius_m(inner)).ln(), rest: 0.0 };
        let (mut capacity, mut links) = (Vec::new(), Vec::new());
        if let Some(spool) = physics.spool {
            capacity.push(spool.heat_capacity_j_per_m2_k * bore_m);
            links.push(Link { rest: 1.0 / (spool.contact_w_per_m2_k * bore_m), ..between(0.0, 0.5) });
        }
        for i in 0..count {
            let (inner_m, outer_m) = (radius_m(i as f64), radius_m(i as f64 + 1.0));
            capacity.push(physics.heat_capacity_j_per_m3_k * 0.5 * (outer_m + inner_m) * (outer_m - inner_m));
            links.push(if i + 1 < count {
                between(i as f64 + 0.5, i as f64 + 1.5)
            } else {
                let film = physics.film_w_per_m2_k.filter(|_| !outermost_is_drive);
                let rest = film.map_or(0.0, |film| 1.0 / (film * radius_m(count as f64)));
                Link { rest, ..between(i as f64 + 0.5, count as f64) }
            });
        }
        for &(above, conductance_w_per_m2_k) in &physics.gaps {
            // The way that crosses the face between the layers.
            let face = above * cells;
            let crossing = physics.spool.iter().count() + face - 1;
            links[crossing].rest += 1.0 / (conductance_w_per_m2_k * radius_m(face as f64));
        }
        let axis = (!physics.flanges.is_empty()).then(|| {
            let slice_m = height_m / cut.slices as f64;
            Axis {
                slices: cut.slices,
                exchange_per_s: physics.diffusivity_m2_per_s() / (slice_m * slice_m),
                slice_capacity_j_per_m2_k: slice_m * physics.heat_capacity_j_per_m3_k,
                half_slice_m: 0.5 * slice_m,
                heated: physics
                    .flanges
                    .iter()
                    .map(|flange| (if flange.is_first { 0 } else { cut.slices - 1 }, flange.film_w_per_m2_k))
                    .collect(),
            }
        });
        Self {
            layers,
            cells_per_layer: cells,
            spool: usize::from(physics.spool.is_some()),
            capacity,
            links,
            mount: physics.spool.map_or(0.0, |s| s.mount_w_per_m2_k * bore_m),
            bore_radius_m: bore_m,
            outermost_is_drive,
            conductivity_w_per_m_k: physics.conductivity_w_per_m_k,
            slope_per_k: physics.conductivity_slope_per_k,
            axis,
        }
    }

    pub(crate) fn nodes(&self) -> usize {
        self.capacity.len()
    }

    /// Layers that nodes stand for; the last one may be the drive.
    pub(crate) fn solved_layers(&self) -> usize {
        self.layers - usize::from(self.outermost_is_drive)
    }

    /// The share of each of a layer's nodes in its mean, with the node's index.
    pub(crate) fn shares(&self, layer: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let first = self.spool + layer * self.cells_per_layer;
        let nodes = first..first + self.cells_per_layer;
        let whole: f64 = self.capacity[nodes.clone()].iter().sum();
        nodes.map(move |i| (i, self.capacity[i] / whole))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_profile_has_its_own_moment() {
        let axis = Axis {
            slices: 7,
            exchange_per_s: 1.0,
            slice_capacity_j_per_m2_k: 1.0,
            half_slice_m: 1.0,
            heated: vec![(0, 1.0)],
        };
        let weights = axis.moment_weights();
        let of = |f: &dyn Fn(f64) -> f64| -> f64 {
            weights.iter().enumerate().map(|(m, w)| w * f((m as f64 + 0.5) / 7.0 - 0.5)).sum()
        };
        assert!((of(&|zeta| zeta) - 1.0 / 12.0).abs() < 1e-15);
        assert!(of(&|_| 1.0).abs() < 1e-15);
    }
}
