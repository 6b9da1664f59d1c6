//! A real winding pack: radial conduction in a finite cylinder, solved exactly in time by its eigenmodes.
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
//! | C | heat capacity of a cell, per radian and height | J/(m K rad) | `capacity` |
//! | G | conductances between cells and to the boundary | W/(m K rad) | `conductance` |
//! | u, k | drive temperature and its rate, piecewise linear and constant | K, K/s | `Drive::boundary_k` |
//! | a | ambient temperature, where it is known apart from the drive | K | `Drive::ambient_k` |
//! | q | heat into the bore | W/m² | `BoreHeat` |
//! | λ_i | decay rate of mode i | 1/s | `decay_per_s` |
//! | s_j, a_ji | steady response and modal amplitude of layer j | 1 | `steady`, `amplitude` |
//!
//! Holds for constant properties and no axial variation; the outermost layer's temperature is imposed at its middle
//! (`OuterLayer`), or its surface exchanges heat with the air (`Ambient`). Conductances between cell centres are those
//! of a cylinder, k/ln(r₂/r₁), so a steady radial flow is exact; the scheme is of second order in the cell's size.
//!
//! # Source
//! Finite volumes after Patankar (1980), chapter 4; modal solution of a linear system driven by ramps, any text on
//! linear systems. The semi-discrete operator is exact in time: there is no time step.

use nalgebra::{DMatrix, SymmetricEigen};

use super::{BoreHeat, Drive, HeatPath, Instant, Location, Material, Side, ThermalError, ThermalHistory};
use crate::numeric::piecewise::PiecewiseLinear;

/// How one input acts: the layers' steady response to it and what each mode takes away from that.
#[derive(Debug, Clone)]
struct InputResponse {
    steady: Vec<f64>,
    /// Row-major, layers × modes.
    amplitude: Vec<f64>,
}

/// The modal form of a pack's heat path.
#[derive(Debug, Clone)]
pub struct Pack {
    layers: usize,
    decay_per_s: Vec<f64>,
    boundary: InputResponse,
    /// Present where something is mounted to the ambient and the ambient is not the drive itself.
    ambient: Option<InputResponse>,
    /// Row-major layers × modes: the temperature of a layer per mode content that the bore's heat excites.
    heat: Option<(BoreHeat, Vec<f64>)>,
    shortest_s: f64,
}

/// The discretised operator: cells from the bore outwards, the spool (if any) in front of them.
struct Network {
    capacity: Vec<f64>,
    /// Between node i and node i+1.
    links: Vec<f64>,
    /// To the drive, to the ambient; only the outermost node and the spool have any.
    to_boundary: Vec<f64>,
    to_ambient: Vec<f64>,
    /// Share of the bore's heat flux that a node takes, per unit flux.
    heated: Vec<f64>,
    /// Nodes in front of the pack's first cell.
    spool_nodes: usize,
}

impl Network {
    fn new(path: &HeatPath) -> Self {
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
        let count = match path.location {
            // The outermost layer's middle carries the drive: only its inner half is left to solve.
            Location::OuterLayer => (shape.layers - 1) * cells + cells / 2,
            Location::Ambient => shape.layers * cells,
        };
        let spool_nodes = usize::from(path.spool.is_some());
        let nodes = count + spool_nodes;
        let mut network = Network {
            capacity: Vec::with_capacity(nodes),
            links: Vec::with_capacity(nodes),
            to_boundary: vec![0.0; nodes],
            to_ambient: vec![0.0; nodes],
            heated: vec![0.0; nodes],
            spool_nodes,
        };
        if let Some(spool) = path.spool {
            network.capacity.push(spool.heat_capacity_j_per_m2_k * shape.bore_radius_m);
            let half_cell = (centre_m(0) / shape.bore_radius_m).ln() / conductivity;
            network.links.push(1.0 / (1.0 / (spool.contact_w_per_m2_k * shape.bore_radius_m) + half_cell));
            network.to_ambient[0] = spool.mount_w_per_m2_k * shape.bore_radius_m;
        }
        for i in 0..count {
            network.capacity.push(heat_capacity * 0.5 * (edge_m(i + 1).powi(2) - edge_m(i).powi(2)));
            if i + 1 < count {
                network.links.push(conductivity / (centre_m(i + 1) / centre_m(i)).ln());
            }
        }
        let last_m = centre_m(count - 1);
        network.to_boundary[nodes - 1] = match path.location {
            Location::OuterLayer => {
                let drive_m = shape.bore_radius_m + (shape.layers as f64 - 0.5) * shape.radial_pitch_m;
                conductivity / (drive_m / last_m).ln()
            }
            Location::Ambient => {
                let outer_m = edge_m(count);
                let half_cell = (outer_m / last_m).ln() / conductivity;
                let film = path.film_w_per_m2_k.map_or(0.0, |h| 1.0 / (h * outer_m));
                1.0 / (half_cell + film)
            }
        };
        // The bore's heat enters the spool if there is one, else the innermost cell.
        network.heated[0] = shape.bore_radius_m;
        network
    }

    /// C^{−1/2} G C^{−1/2}.
    fn symmetrised(&self) -> DMatrix<f64> {
        let n = self.capacity.len();
        let mut matrix = DMatrix::zeros(n, n);
        for i in 0..n {
            let mut diagonal = self.to_boundary[i] + self.to_ambient[i];
            if i > 0 {
                diagonal += self.links[i - 1];
            }
            if i + 1 < n {
                diagonal += self.links[i];
                let off = -self.links[i] / (self.capacity[i] * self.capacity[i + 1]).sqrt();
                matrix[(i, i + 1)] = off;
                matrix[(i + 1, i)] = off;
            }
            matrix[(i, i)] = diagonal / self.capacity[i];
        }
        matrix
    }
}

impl Pack {
    /// # Errors
    /// Values so extreme that the eigenvalues do not converge or are not positive.
    pub fn new(path: &HeatPath) -> Result<Self, ThermalError> {
        let network = Network::new(path);
        let nodes = network.capacity.len();
        let matrix = network.symmetrised();
        if matrix.iter().any(|v| !v.is_finite()) {
            return Err(ThermalError::Eigen);
        }
        let eigen = SymmetricEigen::try_new(matrix, f64::EPSILON, 100 * nodes).ok_or(ThermalError::Eigen)?;
        let decay_per_s: Vec<f64> = eigen.eigenvalues.iter().copied().collect();
        if decay_per_s.iter().any(|l| !(*l > 0.0)) {
            return Err(ThermalError::Eigen);
        }
        let layers = path.shape.layers;
        let projected = layer_projection(path, &network, &eigen.eigenvectors);
        let excitation = |input: &[f64]| -> Vec<f64> {
            (0..nodes)
                .map(|mode| {
                    (0..nodes).map(|i| eigen.eigenvectors[(i, mode)] * input[i] / network.capacity[i].sqrt()).sum()
                })
                .collect()
        };
        let response = |input: &[f64], is_boundary: bool| -> InputResponse {
            let excitation = excitation(input);
            let mut amplitude: Vec<f64> = projected.clone();
            for row in amplitude.chunks_exact_mut(nodes) {
                for (mode, value) in row.iter_mut().enumerate() {
                    *value *= excitation[mode] / decay_per_s[mode];
                }
            }
            let mut steady: Vec<f64> = amplitude.chunks_exact(nodes).map(|row| row.iter().sum()).collect();
            if is_boundary && path.location == Location::OuterLayer {
                // The outermost layer is the drive itself.
                steady[layers - 1] = 1.0;
            }
            InputResponse { steady, amplitude }
        };
        let mounted = network.to_ambient.iter().any(|&g| g != 0.0);
        let boundary = response(&network.to_boundary, true);
        let ambient = mounted.then(|| response(&network.to_ambient, false));
        let heat = path.bore_heat.map(|bore_heat| {
            let excitation = excitation(&network.heated);
            let mut content = projected.clone();
            for row in content.chunks_exact_mut(nodes) {
                for (mode, value) in row.iter_mut().enumerate() {
                    *value *= excitation[mode];
                }
            }
            (bore_heat, content)
        });
        let shortest_s = 1.0 / decay_per_s.iter().copied().fold(0.0, f64::max);
        Ok(Self { layers, decay_per_s, boundary, ambient, heat, shortest_s })
    }

    fn modes(&self) -> usize {
        self.decay_per_s.len()
    }

    /// λ_i [1/s], in no particular order.
    pub fn decays_per_s(&self) -> &[f64] {
        &self.decay_per_s
    }

    /// a_ji: what mode `mode` takes away from a layer's steady response while drive and ambient are one temperature.
    pub fn amplitude(&self, layer: usize, mode: usize) -> f64 {
        let place = layer * self.modes() + mode;
        self.boundary.amplitude[place] + self.ambient.as_ref().map_or(0.0, |a| a.amplitude[place])
    }

    /// The rate of every layer after a unit step of the drive's rate; the ambient, if apart, does the same step.
    pub fn step_rates(&self, time_s: f64, layers: &mut [f64]) {
        let decayed: Vec<f64> = self.decay_per_s.iter().map(|l| (-l * time_s.max(0.0)).exp()).collect();
        layers.fill(0.0);
        if time_s < 0.0 {
            return;
        }
        for response in std::iter::once(&self.boundary).chain(&self.ambient) {
            for (j, rate) in layers.iter_mut().enumerate() {
                *rate += response.steady[j] - dot(response.row(j, self.modes()), &decayed);
            }
        }
    }

    /// Fifty time constants of the slowest mode: nothing is left then but rounding.
    pub fn settling_s(&self) -> f64 {
        50.0 / self.decay_per_s.iter().copied().fold(f64::INFINITY, f64::min)
    }

    pub fn shortest_s(&self) -> f64 {
        self.shortest_s
    }
}

impl InputResponse {
    fn row(&self, layer: usize, modes: usize) -> &[f64] {
        &self.amplitude[layer * modes..(layer + 1) * modes]
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Row-major layers × modes: the volume mean of each layer per unit of each mode. A layer that is the drive has zeros.
fn layer_projection(path: &HeatPath, network: &Network, vectors: &DMatrix<f64>) -> Vec<f64> {
    let nodes = network.capacity.len();
    let cells = path.cells_per_layer;
    let layers = path.shape.layers;
    let mut projected = vec![0.0; layers * nodes];
    let solved_layers = match path.location {
        Location::OuterLayer => layers - 1,
        Location::Ambient => layers,
    };
    for layer in 0..solved_layers {
        let of_layer = network.spool_nodes + layer * cells..network.spool_nodes + (layer + 1) * cells;
        let volume: f64 = network.capacity[of_layer.clone()].iter().sum();
        for mode in 0..nodes {
            projected[layer * nodes + mode] =
                of_layer.clone().map(|i| network.capacity[i].sqrt() * vectors[(i, mode)]).sum::<f64>() / volume;
        }
    }
    projected
}

/// The contents of the modes that one piecewise-linear input excites, at each of its knots.
#[derive(Debug, Clone)]
struct ModalTrack {
    input: PiecewiseLinear,
    /// Row-major knots × modes, just after each knot: Σ_q Δk_q e^{−λ_i (t−t_q)}.
    content: Vec<f64>,
}

impl ModalTrack {
    fn new(input: &PiecewiseLinear, decay_per_s: &[f64]) -> Self {
        let modes = decay_per_s.len();
        let knots = input.knots();
        let mut content = Vec::with_capacity(knots.len() * modes);
        let mut state = vec![0.0; modes];
        let mut slope = 0.0;
        for (i, &time_s) in knots.iter().enumerate() {
            if i > 0 {
                let elapsed_s = time_s - knots[i - 1];
                for (s, l) in state.iter_mut().zip(decay_per_s) {
                    *s *= (-l * elapsed_s).exp();
                }
            }
            let change = input.slope_of(i) - slope;
            slope = input.slope_of(i);
            for s in &mut state {
                *s += change;
            }
            content.extend_from_slice(&state);
        }
        Self { input: input.clone(), content }
    }

    /// Writes the modes' contents at an instant; returns the input's value and slope there.
    fn at(&self, instant: Instant, decay_per_s: &[f64], state: &mut [f64]) -> (f64, f64) {
        let modes = decay_per_s.len();
        let knots = self.input.knots();
        let past = match instant.side {
            Side::After => knots.partition_point(|&k| k <= instant.time_s),
            Side::Before => knots.partition_point(|&k| k < instant.time_s),
        };
        let Some(knot) = past.checked_sub(1) else {
            state.fill(0.0);
            return (self.input.first_value(), 0.0);
        };
        let elapsed_s = instant.time_s - knots[knot];
        let stored = &self.content[knot * modes..(knot + 1) * modes];
        for ((s, stored), l) in state.iter_mut().zip(stored).zip(decay_per_s) {
            *s = stored * (-l * elapsed_s).exp();
        }
        (self.input.values()[knot] + self.input.slope_of(knot) * elapsed_s, self.input.slope_of(knot))
    }
}

/// A pack under one drive.
#[derive(Debug, Clone)]
pub struct PackField {
    pack: Pack,
    drive: Drive,
    boundary: ModalTrack,
    ambient: Option<ModalTrack>,
}

impl PackField {
    pub fn new(pack: Pack, drive: &Drive) -> Self {
        let boundary = ModalTrack::new(&drive.boundary_k, &pack.decay_per_s);
        let ambient = pack.ambient.is_some().then(|| ModalTrack::new(drive.ambient_k(), &pack.decay_per_s));
        Self { pack, drive: drive.clone(), boundary, ambient }
    }

    pub fn at(&self, instants: &[Instant]) -> ThermalHistory {
        let (layers, modes) = (self.pack.layers, self.pack.modes());
        let mut history = ThermalHistory::with_capacity(layers, instants.len());
        let mut state = vec![0.0; modes];
        let mut lagging = vec![0.0; modes];
        for &instant in instants {
            history.times_s.push(instant.time_s);
            let start = history.rate_k_per_s.len();
            history.rate_k_per_s.resize(start + layers, 0.0);
            history.temperature_k.resize(start + layers, 0.0);
            let tracks = std::iter::once((&self.boundary, &self.pack.boundary))
                .chain(self.ambient.as_ref().zip(self.pack.ambient.as_ref()));
            for (track, response) in tracks {
                let (value, slope) = track.at(instant, &self.pack.decay_per_s, &mut state);
                for ((lag, s), l) in lagging.iter_mut().zip(&state).zip(&self.pack.decay_per_s) {
                    *lag = (slope - s) / l;
                }
                for j in 0..layers {
                    let row = response.row(j, modes);
                    history.rate_k_per_s[start + j] += response.steady[j] * slope - dot(row, &state);
                    history.temperature_k[start + j] += response.steady[j] * value - dot(row, &lagging);
                }
            }
            if let Some((heat, content)) = &self.pack.heat {
                let since_s = instant.time_s - self.drive.start_s();
                for (mode, &l) in self.pack.decay_per_s.iter().enumerate() {
                    (lagging[mode], state[mode]) = heated_mode(heat, l, since_s);
                }
                for j in 0..layers {
                    let row = &content[j * modes..(j + 1) * modes];
                    history.temperature_k[start + j] += dot(row, &lagging);
                    history.rate_k_per_s[start + j] += dot(row, &state);
                }
            }
            super::push_ambient(&mut history, &self.drive, instant);
        }
        history
    }
}

/// c and dc/dt of c' = −λ c + q∞ (1 − e^{−t/τ}), c(0) = 0.
fn heated_mode(heat: &BoreHeat, decay_per_s: f64, time_s: f64) -> (f64, f64) {
    if time_s <= 0.0 {
        return (0.0, 0.0);
    }
    let (l, m) = (decay_per_s, 1.0 / heat.time_constant_s);
    let (el, em) = ((-l * time_s).exp(), (-m * time_s).exp());
    // (e^{−mt} − e^{−lt})/(l − m) without cancellation where l ≈ m.
    let difference =
        if ((l - m) * time_s).abs() < 1e-8 { time_s * em } else { em * -(-(l - m) * time_s).exp_m1() / (l - m) };
    let content = (1.0 - el) / l - difference;
    let rate = m * difference;
    (heat.power_w_per_m2 * content, heat.power_w_per_m2 * rate)
}
