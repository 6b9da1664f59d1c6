//! A real winding pack: conduction in a finite cylinder, solved exactly in time by its eigenmodes.
//!
//! ```text
//! C dT/dt = −G T + b u(t) + b_a a(t) + b_q q(t)
//! S = C^{−1/2} G C^{−1/2} = V diag(λ) Vᵀ          (symmetric, all λ > 0)
//! Ṫ_j(t) = Σ_q Δk_q ( s_j − Σ_i a_ji e^{−λ_i (t−t_q)} )
//! T_j(t) = s_j u(t) − Σ_i a_ji ( k(t) − Σ_q Δk_q e^{−λ_i (t−t_q)} ) / λ_i
//! ```
//!
//! | symbol | meaning | unit | in code |
//! |---|---|---|---|
//! | C | heat capacity of a node, per radian and height | J/(m K rad) | `Network::capacity` |
//! | G | conductances between nodes and to the boundary | W/(m K rad) | `Network::operator` |
//! | u, k | drive temperature and its rate, piecewise linear and constant | K, K/s | `Drive::boundary_k` |
//! | a | ambient temperature, where it is known apart from the drive | K | `Drive::ambient_k` |
//! | q | heat into the bore | W/m² | `BoreHeat` |
//! | λ_i | decay rate of mode i | 1/s | `decay_per_s` |
//! | s_j, a_ji | steady response and modal amplitude of output j | 1 | `steady`, `amplitude` |
//!
//! Outputs are the layers' means and, where a flange is heated, their first axial moments. A flange makes the field
//! two-dimensional but keeps it separable: each mode of the axial operator carries a radial network of its own, with
//! K μ_m added to every node of the pack (the spool does not conduct along the axis).
//!
//! Holds for constant properties; the outermost layer's temperature is imposed at its middle (`OuterLayer`), or its
//! surface exchanges heat with the air (`Ambient`).
//!
//! # Source
//! Modal solution of a linear system driven by ramps, any text on linear systems; separation of variables, Carslaw and
//! Jaeger (1959), section 5.6. The semi-discrete operator is exact in time: there is no time step.

use nalgebra::{DMatrix, DVector};

use super::joined;
use super::modal::Response;
use super::network::{AxialElements, Network};
use super::{BoreHeat, HeatPath, Location, ThermalError};
use crate::numeric::order::sort_ascending;
use crate::numeric::tridiagonal::diagonalise_full;

/// The modal form of a pack's heat path.
#[derive(Debug, Clone)]
pub struct Pack {
    pub(super) layers: usize,
    /// Layer means, then (with a heated flange) first axial moments.
    pub(super) outputs: usize,
    shortest_s: f64,
    /// Ascending.
    pub(super) decay_per_s: Vec<f64>,
    pub(super) boundary: Response,
    /// Present where something exchanges heat with the ambient besides the outer surface.
    pub(super) ambient: Option<Response>,
    /// Outputs × modes: the temperature of an output per mode content that the bore's heat excites.
    pub(super) heat: Option<(BoreHeat, DMatrix<f64>)>,
    pub(super) start: Option<OwnStart>,
}

/// What a start that is not steady leaves in the outputs.
#[derive(Debug, Clone)]
pub(super) struct OwnStart {
    /// Outputs × modes: what decays with each mode.
    pub(crate) content: DMatrix<f64>,
    /// The outputs' rates before the start.
    pub(crate) before_k_per_s: DVector<f64>,
}

/// A mode whose share of every response is smaller than this is left out: a heated flange makes thousands of them, which
/// together stay below a ten-thousandth of what the grid leaves (`tests/validation/flange.rs`).
const NEGLIGIBLE: f64 = 1e-9;

/// Eigenmodes along the axis; without a heated flange there is one, uniform.
pub(super) struct AxialModes {
    /// μ_m [1/m²].
    pub(crate) decay_per_m2: Vec<f64>,
    /// What a mode's content adds to the mean over the axis, and what a uniform input adds to its content.
    pub(crate) mean: Vec<f64>,
    pub(crate) uniform: Vec<f64>,
    /// Places of the axis × modes.
    pub(crate) places: DMatrix<f64>,
    /// Mode content per unit of the flange's air [1/m²], and the mode's first moment; both empty without a flange.
    flange_per_m2: Vec<f64>,
    pub(crate) moment: Vec<f64>,
    /// Of the pack's material.
    pub(crate) diffusivity_m2_per_s: f64,
}

impl AxialModes {
    fn new(path: &HeatPath, network: &Network) -> Result<Self, ThermalError> {
        let diffusivity_m2_per_s = path.material.diffusivity_m2_per_s();
        let Some(axis) = AxialElements::new(path) else {
            return Ok(Self {
                decay_per_m2: vec![0.0],
                mean: vec![1.0],
                uniform: vec![1.0],
                places: DMatrix::from_element(1, 1, 1.0),
                flange_per_m2: Vec::new(),
                moment: Vec::new(),
                diffusivity_m2_per_s,
            });
        };
        let k = network.conductivity_w_per_m_k;
        let roots: Vec<f64> = axis.masses.iter().map(|m| m.sqrt()).collect();
        let n = axis.nodes();
        let mut operator = DMatrix::from_fn(n, n, |i, j| axis.stiffness_per_m2[(i, j)] / (roots[i] * roots[j]));
        let mut rows = DMatrix::from_fn(3 + n, n, |row, i| match row {
            0 => roots[i],
            1 => 0.0,
            2 => axis.moment[i] / roots[i],
            place => f64::from(u8::from(place - 3 == i)) / roots[i],
        });
        for &(node, film_w_per_m3_k) in &axis.flanges {
            let to_air = film_w_per_m3_k / k;
            operator[(node, node)] += to_air / axis.masses[node];
            rows[(1, node)] += to_air / roots[node];
        }
        let decay_per_m2 = diagonalise_full(operator, &mut rows).map_err(|_| ThermalError::Eigen)?;
        let row = |r: usize| rows.row(r).iter().copied().collect::<Vec<f64>>();
        Ok(Self {
            decay_per_m2,
            mean: row(0),
            uniform: row(0),
            places: rows.rows(3, n).into_owned(),
            flange_per_m2: row(1),
            moment: row(2),
            diffusivity_m2_per_s,
        })
    }

    fn has_moments(&self) -> bool {
        !self.moment.is_empty()
    }
}

/// One mode: its decay, what each output sees of it, and what each input puts into it.
pub(super) struct Mode {
    pub(crate) decay_per_s: f64,
    pub(crate) seen: Vec<f64>,
    pub(crate) boundary: f64,
    pub(crate) ambient: f64,
    pub(crate) heat: f64,
    /// Its content at a start that is not even.
    pub(crate) start: f64,
}

impl Pack {
    /// # Errors
    /// Values so extreme that the eigenvalues do not converge or are not positive.
    pub fn new(path: &HeatPath) -> Result<Self, ThermalError> {
        Self::with_part(path, None)
    }

    /// With the temperature of a part around the coil (housing, spool, flange) as one more output, the last.
    ///
    /// # Errors
    /// As [`Pack::new`]; a part that is not there, or is the drive.
    #[expect(clippy::too_many_lines, reason = "modes, then what each input makes of them, from the same sums")]
    pub(super) fn with_part(path: &HeatPath, part: Option<Location>) -> Result<Self, ThermalError> {
        let network = Network::new(path);
        let axial = AxialModes::new(path, &network)?;
        let layers = network.layers;
        let outputs = layers * if axial.has_moments() { 2 } else { 1 } + usize::from(part.is_some());
        let mut modes = if path.is_joined() {
            joined::modes(path, &network, &axial, part)?
        } else {
            separable_modes(path, &network, &axial, part)?
        };
        if modes.iter().any(|mode| !(mode.decay_per_s > 0.0)) {
            return Err(ThermalError::Eigen);
        }
        sort_ascending(&mut modes, |item| item.decay_per_s);

        let has_ambient = network.to_ambient.iter().any(|g| *g != 0.0) || axial.has_moments();
        let steady_of = |input: fn(&Mode) -> f64| {
            let mut steady = DVector::zeros(outputs);
            for mode in &modes {
                let share = input(mode) / mode.decay_per_s;
                for (s, seen) in steady.as_mut_slice().iter_mut().zip(&mode.seen) {
                    *s += seen * share;
                }
            }
            steady
        };
        let mut boundary_steady = steady_of(|mode| mode.boundary);
        for (steady, share) in boundary_steady.iter_mut().zip(&network.drive_share) {
            *steady += share;
        }
        let ambient_steady = steady_of(|mode| mode.ambient);

        drop_negligible(&mut modes);
        let decay_per_s: Vec<f64> = modes.iter().map(|mode| mode.decay_per_s).collect();
        let amplitude = |input: fn(&Mode) -> f64| {
            let mut columns = Vec::with_capacity(outputs * modes.len());
            for mode in &modes {
                let share = input(mode) / mode.decay_per_s;
                columns.extend(mode.seen.iter().map(|seen| seen * share));
            }
            DMatrix::from_vec(outputs, modes.len(), columns)
        };
        // A layer that is the drive does follow it at once; one that ends at it has a share of the surface's node.
        let mut at_once = DVector::zeros(outputs);
        for (own, &share) in at_once.iter_mut().zip(&network.drive_share).filter(|(_, share)| **share < 1.0) {
            *own = share;
        }
        let boundary = Response::new(boundary_steady, amplitude(|mode| mode.boundary), &decay_per_s, at_once);
        let nothing = DVector::zeros(outputs);
        let ambient =
            has_ambient.then(|| Response::new(ambient_steady, amplitude(|mode| mode.ambient), &decay_per_s, nothing));
        let heat = path.bore_heat.map(|bore_heat| {
            (bore_heat, DMatrix::from_fn(outputs, modes.len(), |j, i| modes[i].seen[j] * modes[i].heat))
        });
        let (boundary, ambient) = match (path.location, ambient) {
            // What is inside a housing sees nothing else.
            (Location::Housing(_), Some(ambient)) => (boundary.plus(&ambient), None),
            (_, ambient) => (boundary, ambient),
        };
        let start = path.start.map(|start| {
            let joint = ambient.as_ref().map_or_else(|| boundary.clone(), |ambient| boundary.plus(ambient));
            // A ramp that ends there has left each mode behind.
            let behind_s = |l: f64| -(-l * start.lasted_s).exp_m1() / l;
            OwnStart {
                content: DMatrix::from_fn(outputs, modes.len(), |j, i| {
                    modes[i].seen[j] * modes[i].start
                        - start.rate_k_per_s * joint.amplitude[(j, i)] * behind_s(decay_per_s[i])
                }),
                before_k_per_s: &joint.steady * start.rate_k_per_s,
            }
        });
        // Heat crosses half a layer in about this time.
        let shortest_s = path.shape.radial_pitch_m.powi(2) / (16.0 * path.material.diffusivity_m2_per_s());
        Ok(Self { layers, outputs, shortest_s, decay_per_s, boundary, ambient, heat, start })
    }

    pub(super) fn modes(&self) -> usize {
        self.decay_per_s.len()
    }

    /// λ_i [1/s], ascending.
    pub(crate) fn decays_per_s(&self) -> &[f64] {
        &self.decay_per_s
    }

    /// Drive and ambient as one temperature.
    pub(super) fn joint(&self) -> Response {
        match &self.ambient {
            None => self.boundary.clone(),
            Some(ambient) => self.boundary.plus(ambient),
        }
    }

    /// The rate of every layer after a unit step of the drive's rate; the ambient, if apart, does the same step.
    pub(crate) fn step_rates(&self, time_s: f64, layers: &mut [f64]) {
        layers.fill(0.0);
        if time_s < 0.0 {
            return;
        }
        for response in std::iter::once(&self.boundary).chain(&self.ambient) {
            for (j, rate) in layers.iter_mut().enumerate() {
                *rate += response.steady[j];
            }
            for (i, l) in self.decay_per_s.iter().enumerate() {
                let left = (-l * time_s).exp();
                for (j, rate) in layers.iter_mut().enumerate() {
                    *rate -= response.amplitude[(j, i)] * left;
                }
            }
        }
    }

    /// Fifty time constants of the slowest mode: nothing is left then but rounding.
    pub(crate) fn settling_s(&self) -> f64 {
        50.0 / self.decay_per_s[0]
    }

    pub(crate) fn shortest_s(&self) -> f64 {
        self.shortest_s
    }
}

/// Products of radial and axial modes.
fn separable_modes(
    path: &HeatPath,
    network: &Network,
    axial: &AxialModes,
    part: Option<Location>,
) -> Result<Vec<Mode>, ThermalError> {
    let part = part.map(|part| part_node(path, network, part).ok_or(ThermalError::Eigen)).transpose()?;
    let mut modes = Vec::with_capacity(network.nodes() * axial.mean.len());
    // A spool does not conduct along the axis: only without one do all axial modes share their radial ones.
    let shared =
        (network.pack_nodes == network.nodes()).then(|| radial(path, network, axial, part, 0.0)).transpose()?;
    for m in 0..axial.mean.len() {
        let extra_per_s = axial.diffusivity_m2_per_s * axial.decay_per_m2[m];
        match &shared {
            Some(shared) => modes.extend(radial_modes(shared, extra_per_s, network, axial, part, m)),
            None => {
                let own = radial(path, network, axial, part, extra_per_s)?;
                modes.extend(radial_modes(&own, 0.0, network, axial, part, m));
            }
        }
    }
    Ok(modes)
}

/// The node of a part around the coil; none where that is not there.
pub(super) fn part_node(path: &HeatPath, network: &Network, part: Location) -> Option<usize> {
    match part {
        Location::Spool => (network.spool_nodes > 0).then_some(0),
        Location::Housing(place) => {
            let index = path.enclosure().0.iter().position(|housing| housing.place == place)?;
            Some(network.pack().end + index)
        }
        _ => None,
    }
}

/// Radial modes: their decays, and what layers (rows) and inputs (the last rows) see of each.
struct Radial {
    decay_per_s: Vec<f64>,
    rows: DMatrix<f64>,
}

/// With `extra_per_s` added to every cell's decay.
fn radial(
    path: &HeatPath,
    network: &Network,
    axial: &AxialModes,
    part: Option<usize>,
    extra_per_s: f64,
) -> Result<Radial, ThermalError> {
    let (n, layers) = (network.nodes(), network.layers);
    let has_moments = axial.has_moments();
    let (boundary_row, ambient_row, heat_row, start_row, part_row, flange_row) =
        (layers, layers + 1, layers + 2, layers + 3, layers + 4, layers + 5);
    let mut rows = DMatrix::zeros(layers + 5 + usize::from(has_moments), n);
    let boundary = network.boundary();
    for (i, capacity) in network.capacity.iter().enumerate() {
        let root = capacity.sqrt();
        for layer in 0..layers {
            rows[(layer, i)] = network.shares[(layer, i)] / root;
        }
        rows[(boundary_row, i)] = boundary[i] / root;
        if i == 0 {
            rows[(heat_row, i)] = network.heated / root;
        }
        rows[(ambient_row, i)] = network.to_ambient[i] / root;
        rows[(start_row, i)] = root
            * path.start.map_or(0.0, |start| match i {
                i if i < network.spool_nodes => start.spool_above_k,
                i if network.pack().contains(&i) => start.pack_above_k,
                _ => start.housing_above_k,
            });
        if part == Some(i) {
            rows[(part_row, i)] = 1.0 / root;
        }
        if has_moments && network.pack().contains(&i) {
            rows[(flange_row, i)] = root * axial.diffusivity_m2_per_s;
        }
    }
    let decay_per_s = diagonalise_full(network.symmetrised(extra_per_s), &mut rows).map_err(|_| ThermalError::Eigen)?;
    Ok(Radial { decay_per_s, rows })
}

/// The modes that belong to axial mode `m`, each decaying by `extra_per_s` faster than the radial one.
fn radial_modes(
    radial: &Radial,
    extra_per_s: f64,
    network: &Network,
    axial: &AxialModes,
    part: Option<usize>,
    m: usize,
) -> impl Iterator<Item = Mode> {
    let (n, layers) = (network.nodes(), network.layers);
    let has_moments = axial.has_moments();
    let (boundary_row, ambient_row, heat_row, start_row, part_row, flange_row) =
        (layers, layers + 1, layers + 2, layers + 3, layers + 4, layers + 5);
    let rows = &radial.rows;
    (0..n).map(move |i| {
        let mut seen = vec![0.0; layers * if has_moments { 2 } else { 1 }];
        for layer in 0..layers {
            seen[layer] = axial.mean[m] * rows[(layer, i)];
            if has_moments {
                seen[layers + layer] = axial.moment[m] * rows[(layer, i)];
            }
        }
        if part.is_some() {
            seen.push(axial.mean[m] * rows[(part_row, i)]);
        }
        let from_flange = if has_moments { axial.flange_per_m2[m] * rows[(flange_row, i)] } else { 0.0 };
        Mode {
            decay_per_s: radial.decay_per_s[i] + extra_per_s,
            seen,
            boundary: axial.uniform[m] * rows[(boundary_row, i)],
            ambient: axial.uniform[m] * rows[(ambient_row, i)] + from_flange,
            heat: axial.uniform[m] * rows[(heat_row, i)],
            start: axial.uniform[m] * rows[(start_row, i)],
        }
    })
}

/// Keeps the modes that any output sees of any input; a flange makes many that none does.
fn drop_negligible(modes: &mut Vec<Mode>) {
    let shares = |mode: &Mode| {
        let seen = mode.seen.iter().fold(0.0, |most: f64, s| if s.abs() > most { s.abs() } else { most });
        [mode.boundary, mode.ambient, mode.heat, mode.start * mode.decay_per_s]
            .map(|input| (seen * input / mode.decay_per_s).abs())
    };
    let of_each: Vec<[f64; 4]> = modes.iter().map(shares).collect();
    let largest = [0, 1, 2, 3].map(|input| of_each.iter().map(|shares| shares[input]).fold(0.0, f64::max));
    let mut of_each = of_each.iter();
    modes.retain(|_| {
        of_each.next().is_some_and(|shares| shares.iter().zip(largest).any(|(s, most)| *s > NEGLIGIBLE * most))
    });
}
