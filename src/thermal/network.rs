//! The pack as finite volumes: cells from the bore outwards, a lumped spool in front of them, slices along the axis.
//!
//! ```text
//! C dT/dt = −G T + b u(t) + b_a a(t) + b_q q(t)          per radian and height
//! k / ln(r₂/r₁)                                           conductance between two cell centres: that of a cylinder
//! ```
//!
//! Exact for a steady radial flow; of second order in the cell's size otherwise. The modal solution (`pack`) and the
//! stepped one (`stepped`) are two solutions of this one network.
//!
//! # Source
//! Finite volumes after Patankar, Numerical Heat Transfer and Fluid Flow (1980), chapter 4.

use std::ops::Range;

use super::{FlangeFilm, HeatPath, Location, Material};

/// A conductance that partly goes through the pack's own material.
#[derive(Debug, Clone, Copy)]
pub(super) struct Link {
    /// Conductance of the material's part per unit of its conductivity.
    shape: f64,
    /// Resistance of the rest (contact, film), not of the material.
    rest: f64,
}

impl Link {
    fn through(length_ratio: f64) -> Self {
        Self { shape: 1.0 / length_ratio.ln(), rest: 0.0 }
    }

    fn with_rest(self, conductance: f64) -> Self {
        Self { rest: self.rest + 1.0 / conductance, ..self }
    }

    /// For a given conductivity of the material.
    pub fn conductance(&self, conductivity_w_per_m_k: f64) -> f64 {
        1.0 / (1.0 / (self.shape * conductivity_w_per_m_k) + self.rest)
    }

    /// First, second and third derivative of the conductance with respect to the material's conductivity.
    pub fn derivatives(&self, conductivity_w_per_m_k: f64) -> [f64; 3] {
        let held = 1.0 + self.shape * conductivity_w_per_m_k * self.rest;
        let first = self.shape / (held * held);
        let second = -2.0 * first * self.shape * self.rest / held;
        [first, second, -3.0 * second * self.shape * self.rest / held]
    }
}

/// The radial network, for one slice of the axis.
#[derive(Debug, Clone)]
pub(super) struct Network {
    pub conductivity_w_per_m_k: f64,
    /// One entry a node; the spool (if any) first.
    pub capacity: Vec<f64>,
    /// Between node i and node i + 1.
    pub links: Vec<Link>,
    /// From the outermost node to the drive.
    pub to_boundary: Link,
    /// From the spool to the ambient; zero without a mount.
    pub mount: f64,
    /// The bore's heat enters node 0; this is its share per unit flux.
    pub heated: f64,
    /// Nodes in front of the pack's first cell.
    pub spool_nodes: usize,
    pub layers: usize,
    cells_per_layer: usize,
    /// The outermost layer is the drive itself and no node.
    pub outermost_is_drive: bool,
}

impl Network {
    pub fn new(path: &HeatPath) -> Self {
        let shape = &path.shape;
        let cells = path.cells_per_layer;
        let width_m = shape.radial_pitch_m / cells as f64;
        let (conductivity, heat_capacity) = match path.material {
            Material::Conductivity { w_per_m_k, heat_capacity_j_per_m3_k } => (w_per_m_k, heat_capacity_j_per_m3_k),
            // Only the ratio matters where nothing else exchanges heat with the pack.
            Material::Diffusivity { m2_per_s } => (m2_per_s, 1.0),
        };
        let edge_m = |i: usize| shape.bore_radius_m + i as f64 * width_m;
        let centre_m = |i: usize| edge_m(i) + 0.5 * width_m;
        let outermost_is_drive = path.location == Location::OuterLayer;
        // Where the outermost layer's middle carries the drive, only its inner half is left to solve.
        let count = if outermost_is_drive { (shape.layers - 1) * cells + cells / 2 } else { shape.layers * cells };
        let spool_nodes = usize::from(path.spool.is_some());
        let mut capacity = Vec::with_capacity(count + spool_nodes);
        let mut links = Vec::with_capacity(count + spool_nodes);
        if let Some(spool) = path.spool {
            capacity.push(spool.heat_capacity_j_per_m2_k * shape.bore_radius_m);
            let contact = spool.contact_w_per_m2_k * shape.bore_radius_m;
            links.push(Link::through(centre_m(0) / shape.bore_radius_m).with_rest(contact));
        }
        for i in 0..count {
            capacity.push(heat_capacity * 0.5 * (edge_m(i + 1).powi(2) - edge_m(i).powi(2)));
            if i + 1 < count {
                links.push(Link::through(centre_m(i + 1) / centre_m(i)));
            }
        }
        let last_m = centre_m(count - 1);
        let to_boundary = if outermost_is_drive {
            let drive_m = shape.bore_radius_m + (shape.layers as f64 - 0.5) * shape.radial_pitch_m;
            Link::through(drive_m / last_m)
        } else {
            let outer_m = edge_m(count);
            let surface = Link::through(outer_m / last_m);
            path.film_w_per_m2_k.map_or(surface, |film| surface.with_rest(film * outer_m))
        };
        Self {
            conductivity_w_per_m_k: conductivity,
            capacity,
            links,
            to_boundary,
            mount: path.spool.map_or(0.0, |s| s.mount_w_per_m2_k * shape.bore_radius_m),
            heated: shape.bore_radius_m,
            spool_nodes,
            layers: shape.layers,
            cells_per_layer: cells,
            outermost_is_drive,
        }
    }

    pub fn nodes(&self) -> usize {
        self.capacity.len()
    }

    /// Layers whose temperature follows from nodes.
    pub fn solved_layers(&self) -> usize {
        self.layers - usize::from(self.outermost_is_drive)
    }

    /// The nodes of a solved layer, all of one layer's volume.
    pub fn nodes_of(&self, layer: usize) -> Range<usize> {
        let first = self.spool_nodes + layer * self.cells_per_layer;
        first..first + self.cells_per_layer
    }

    pub fn layer_capacity(&self, layer: usize) -> f64 {
        self.capacity[self.nodes_of(layer)].iter().sum()
    }

    /// C^{−1/2} (G + diag(C) `extra`) C^{−1/2} at the declared conductivity, `extra` acting on the pack's cells only:
    /// the diagonal and the off-diagonal.
    pub fn symmetrised(&self, extra_per_s: f64) -> (Vec<f64>, Vec<f64>) {
        let n = self.nodes();
        let k = self.conductivity_w_per_m_k;
        let links: Vec<f64> = self.links.iter().map(|l| l.conductance(k)).collect();
        let diagonal = (0..n)
            .map(|i| {
                let inwards = if i > 0 { links[i - 1] } else { 0.0 };
                let outwards = links.get(i).copied().unwrap_or_else(|| self.to_boundary.conductance(k));
                let mount = if i == 0 { self.mount } else { 0.0 };
                let extra = if i < self.spool_nodes { 0.0 } else { extra_per_s };
                (inwards + outwards + mount) / self.capacity[i] + extra
            })
            .collect();
        let off = (0..n - 1).map(|i| -links[i] / (self.capacity[i] * self.capacity[i + 1]).sqrt()).collect();
        (diagonal, off)
    }
}

/// Slices along the axis where a flange is heated.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slices {
    pub count: usize,
    pub width_m: f64,
    pub flange: FlangeFilm,
}

impl Slices {
    pub fn new(path: &HeatPath, flange: FlangeFilm) -> Self {
        Self { count: path.axial_slices, width_m: path.shape.height_m / path.axial_slices as f64, flange }
    }

    /// The slice that touches the heated flange.
    pub fn at_flange(&self) -> usize {
        match self.flange.flange {
            super::Flange::First => 0,
            super::Flange::Second => self.count - 1,
        }
    }

    /// From the middle of the last slice to the air behind the flange, per area.
    pub fn flange_w_per_m2_k(&self, conductivity_w_per_m_k: f64) -> f64 {
        1.0 / (0.5 * self.width_m / conductivity_w_per_m_k + 1.0 / self.flange.film_w_per_m2_k)
    }

    /// Weights of ∫ T ζ dζ over −½ … ½, scaled so that a linear profile has exactly its moment.
    pub fn moment_weights(&self) -> Vec<f64> {
        let n = self.count as f64;
        let exact = 1.0 / (1.0 - 1.0 / (n * n));
        (0..self.count).map(|i| ((i as f64 + 0.5) / n - 0.5) / n * exact).collect()
    }
}
