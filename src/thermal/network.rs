//! The pack in space: spectral elements from the bore outwards, a lumped spool in front of them, housings behind them,
//! elements along the axis.
//!
//! ```text
//! C dT/dt = −(K + X) T + b u(t) + b_a a(t) + b_q q(t)          per radian and height
//! K_ij = ∫ k r ℓ_i' ℓ_j' dr,   C_i = ∫ ρc r ℓ_i dr,   X: films, contacts, mount
//! ```
//!
//! K holds what the pack's own material conducts, X what does not depend on it. A layer's temperature is its mean over the
//! volume, integrated exactly. The modal solution (`pack`) and the stepped one (`stepped`) are two solutions of this one
//! network.
//!
//! # Source
//! Spectral elements with Lobatto's quadrature, see [`super::elements`].

use nalgebra::DMatrix;

use super::elements::{Elements, Grading};
use super::{Flange, FlangeFilm, HeatPath, Location, PackMaterial};

/// The narrowest element, at a surface, in layers …
const NARROWEST_LAYERS: f64 = 0.5;
/// … and the widest, deep inside.
const WIDEST_LAYERS: f64 = 8.0;
/// The narrowest element at a heated flange, in radial pitches.
const NARROWEST_AT_FLANGE: f64 = 2.0;

/// Orders of the elements with one cell a layer, across and along the axis, and what each further cell adds, up to so many.
const ORDER: usize = 8;
const ORDER_ALONG: usize = 6;
const ORDER_A_CELL: usize = 2;
const MOST_RAISED: usize = 3;

fn order(first: usize, cells_per_layer: usize) -> usize {
    first + ORDER_A_CELL * (cells_per_layer.min(MOST_RAISED) - 1)
}

/// A conductance between two nodes that is not of the material.
#[derive(Debug, Clone, Copy)]
pub(super) struct Contact {
    pub(crate) nodes: [usize; 2],
    pub(crate) conductance: f64,
}

/// The radial network, for one place of the axis.
#[derive(Debug, Clone)]
pub(super) struct Network {
    pub(crate) conductivity_w_per_m_k: f64,
    /// One entry a node; the spool (if any) first, housings last.
    pub(crate) capacity: Vec<f64>,
    /// K at the declared conductivity.
    pub(crate) conduction: DMatrix<f64>,
    /// Heat that the material conducts into each node per kelvin of the drive, where the drive is the outermost node.
    pub(crate) from_drive: Vec<f64>,
    pub(crate) contacts: Vec<Contact>,
    /// What else joins each node to the drive, and what joins it to the ambient.
    pub(crate) to_drive: Vec<f64>,
    pub(crate) to_ambient: Vec<f64>,
    /// The bore's heat enters node 0; this is its share per unit flux.
    pub(crate) heated: f64,
    /// Nodes in front of the pack's first one.
    pub(crate) spool_nodes: usize,
    pub(crate) pack_nodes: usize,
    pub(crate) layers: usize,
    /// The share of each node in a layer's mean, layers × nodes …
    pub(crate) shares: DMatrix<f64>,
    /// … and that of the drive.
    pub(crate) drive_share: Vec<f64>,
}

impl Network {
    #[expect(
        clippy::too_many_lines,
        reason = "one network, from the bore outwards: each part joins the nodes that the parts before it numbered"
    )]
    pub(crate) fn new(path: &HeatPath) -> Self {
        let shape = &path.shape;
        let pitch_m = shape.radial_pitch_m;
        let (conductivity, heat_capacity) = match path.material {
            PackMaterial::Conductivity { w_per_m_k, heat_capacity_j_per_m3_k } => (w_per_m_k, heat_capacity_j_per_m3_k),
            // Only the ratio matters where nothing else exchanges heat with the pack.
            PackMaterial::Diffusivity { m2_per_s } => (m2_per_s, 1.0),
        };
        let edge_m = |layers: f64| shape.bore_radius_m + layers * pitch_m;
        let outer_layer_is_drive = path.location == Location::OuterLayer;
        let spool_is_drive = path.location == Location::Spool;
        let (housings, film_w_per_m2_k) = path.enclosure();
        // The drive sits in the middle of the outermost layer, or at its surface.
        let depth_layers = shape.layers as f64 - if outer_layer_is_drive { 0.5 } else { 0.0 };
        let narrowest_m = NARROWEST_LAYERS * pitch_m / path.cells_per_layer as f64;
        // The bore is a source of fronts too where heat enters there.
        let is_heated_inside = path.bore_heat.is_some() || path.spool.is_some_and(|s| s.mount_w_per_m2_k > 0.0);
        let grading = Grading {
            at_start: is_heated_inside.then_some(narrowest_m),
            at_end: Some(narrowest_m),
            widest: WIDEST_LAYERS * pitch_m,
        };
        let length_m = depth_layers * pitch_m;
        let gaps_m: Vec<f64> = path.gaps.iter().map(|gap| gap.above_layer as f64 * pitch_m).collect();
        let elements = Elements::new(order(ORDER, path.cells_per_layer), grading.breaks(length_m), &gaps_m);

        let spool_nodes = usize::from(path.spool.is_some() && !spool_is_drive);
        let inner = elements.nodes();
        let drive_is_node = film_w_per_m2_k.is_none();
        let solved = inner - usize::from(drive_is_node);
        let n = spool_nodes + solved + housings.len();
        let radius_m = |x: f64| shape.bore_radius_m + x;
        let mut capacity = Vec::with_capacity(n);
        let mut contacts = Vec::new();
        let mut to_drive = vec![0.0; n];
        let mut to_ambient = vec![0.0; n];
        let join = |a: usize, b: usize, conductance: f64| Contact { nodes: [a, b], conductance };
        let first_housing = spool_nodes + solved;
        if let Some(spool) = path.spool {
            let contact = spool.contact_w_per_m2_k * shape.bore_radius_m;
            // What is inside a housing is mounted to it.
            let mount = spool.mount_w_per_m2_k * shape.bore_radius_m;
            if spool_is_drive {
                to_drive[0] += contact;
                if !housings.is_empty() {
                    to_drive[first_housing] += mount;
                }
            } else {
                capacity.push(spool.heat_capacity_j_per_m2_k * shape.bore_radius_m);
                contacts.push(join(0, 1, contact));
                if mount > 0.0 && !housings.is_empty() {
                    contacts.push(join(0, first_housing, mount));
                } else {
                    to_ambient[0] += mount;
                }
            }
        }
        capacity.extend(elements.masses(radius_m).iter().take(solved).map(|m| m * heat_capacity));
        for (gap, gap_m) in path.gaps.iter().zip(&gaps_m) {
            if let Some(behind) = elements.node_behind(*gap_m).filter(|behind| *behind > 0) {
                let conductance = gap.conductance_w_per_m2_k * radius_m(*gap_m);
                contacts.push(join(spool_nodes + behind - 1, spool_nodes + behind, conductance));
            }
        }
        let stiffness = elements.stiffness(radius_m) * conductivity;
        let mut conduction = DMatrix::zeros(n, n);
        conduction
            .view_mut((spool_nodes, spool_nodes), (solved, solved))
            .copy_from(&stiffness.view((0, 0), (solved, solved)));
        let mut from_drive = vec![0.0; n];
        if drive_is_node {
            for i in 0..solved {
                from_drive[spool_nodes + i] = -stiffness[(i, solved)];
            }
        }
        let mut shares = DMatrix::zeros(shape.layers, n);
        let mut drive_share = vec![0.0; shape.layers];
        for layer in 0..shape.layers {
            if outer_layer_is_drive && layer + 1 == shape.layers {
                drive_share[layer] = 1.0;
                break;
            }
            let (from, to) = (layer as f64 * pitch_m, (layer as f64 + 1.0) * pitch_m);
            let factors = elements.integral(from, to.min(length_m), radius_m);
            let volume: f64 = factors.iter().sum();
            for (i, factor) in factors.iter().enumerate() {
                if i < solved {
                    shares[(layer, spool_nodes + i)] = factor / volume;
                } else {
                    drive_share[layer] = factor / volume;
                }
            }
        }
        let surface_m = edge_m(depth_layers);
        for (i, housing) in housings.iter().enumerate() {
            capacity.push(housing.heat_capacity_j_per_m2_k * surface_m);
            contacts.push(join(first_housing + i - 1, first_housing + i, housing.gap_w_per_m2_k * surface_m));
        }
        if let Some(film) = film_w_per_m2_k {
            // A sensor on the spool or a flange leaves the outer surface to the air.
            let is_ambient = matches!(path.location, Location::Spool | Location::Flange(_));
            let outside = if is_ambient { &mut to_ambient } else { &mut to_drive };
            outside[n - 1] += film * surface_m;
        }
        Self {
            conductivity_w_per_m_k: conductivity,
            capacity,
            conduction,
            from_drive,
            contacts,
            to_drive,
            to_ambient,
            heated: if spool_is_drive { 0.0 } else { shape.bore_radius_m },
            spool_nodes,
            pack_nodes: solved,
            layers: shape.layers,
            shares,
            drive_share,
        }
    }

    pub(crate) fn nodes(&self) -> usize {
        self.capacity.len()
    }

    /// Which nodes are the pack's own.
    pub(crate) fn pack(&self) -> std::ops::Range<usize> {
        self.spool_nodes..self.spool_nodes + self.pack_nodes
    }

    /// b: heat into each node per kelvin of the drive.
    pub(crate) fn boundary(&self) -> Vec<f64> {
        self.from_drive.iter().zip(&self.to_drive).map(|(a, b)| a + b).collect()
    }

    /// K + X.
    pub(crate) fn operator(&self) -> DMatrix<f64> {
        let mut operator = self.conduction.clone();
        for &Contact { nodes: [a, b], conductance } in &self.contacts {
            operator[(a, a)] += conductance;
            operator[(b, b)] += conductance;
            operator[(a, b)] -= conductance;
            operator[(b, a)] -= conductance;
        }
        for (i, (drive, ambient)) in self.to_drive.iter().zip(&self.to_ambient).enumerate() {
            operator[(i, i)] += drive + ambient;
        }
        operator
    }

    /// C^{−1/2} (K + X + diag(C) `extra`) C^{−1/2} at the declared conductivity, `extra` acting on the pack's nodes only.
    pub(crate) fn symmetrised(&self, extra_per_s: f64) -> DMatrix<f64> {
        let mut matrix = self.operator();
        let roots: Vec<f64> = self.capacity.iter().map(|c| 1.0 / c.sqrt()).collect();
        for (mut column, root) in matrix.column_iter_mut().zip(&roots) {
            column.iter_mut().zip(&roots).for_each(|(v, r)| *v *= r * root);
        }
        for i in self.pack() {
            matrix[(i, i)] += extra_per_s;
        }
        matrix
    }
}

/// Elements along the axis where a flange is heated, in shares of the height.
#[derive(Debug, Clone)]
pub(super) struct AxialElements {
    /// Shares of the nodes in a mean over the axis.
    pub(crate) masses: Vec<f64>,
    /// ∫ ℓ_i' ℓ_j' dz over the height [1/m²].
    pub(crate) stiffness_per_m2: DMatrix<f64>,
    /// Weights of ∫ T ζ dζ over −½ … ½.
    pub(crate) moment: Vec<f64>,
    /// The flanges' nodes and their films over the height [W/(m³ K)]; where a spool's flange touches the pack, that contact, last.
    pub(crate) flanges: Vec<(usize, f64)>,
}

impl AxialElements {
    /// None where no flange is heated.
    pub(crate) fn new(path: &HeatPath) -> Option<Self> {
        let touched =
            path.spool_flanges.iter().map(|f| FlangeFilm { flange: f.flange, film_w_per_m2_k: f.contact_w_per_m2_k });
        let flanges: Vec<FlangeFilm> = path.flange.into_iter().chain(path.opposite_flange).chain(touched).collect();
        if flanges.is_empty() {
            return None;
        }
        let height_m = path.shape.height_m;
        let narrowest = NARROWEST_AT_FLANGE * path.shape.radial_pitch_m / path.cells_per_layer as f64 / height_m;
        let at = |which: Flange| flanges.iter().any(|f| f.flange == which).then_some(narrowest.min(0.5));
        let grading = Grading { at_start: at(Flange::First), at_end: at(Flange::Second), widest: 0.5 };
        let elements = Elements::new(order(ORDER_ALONG, path.cells_per_layer), grading.breaks(1.0), &[]);
        let heated = |flange: &FlangeFilm| {
            let node = if flange.flange == Flange::First { 0 } else { elements.nodes() - 1 };
            (node, flange.film_w_per_m2_k / height_m)
        };
        Some(Self {
            masses: elements.masses(|_| 1.0),
            stiffness_per_m2: elements.stiffness(|_| 1.0) / (height_m * height_m),
            moment: elements.integral(0.0, 1.0, |zeta| zeta - 0.5),
            flanges: flanges.iter().map(heated).collect(),
        })
    }

    pub(crate) fn nodes(&self) -> usize {
        self.masses.len()
    }
}
