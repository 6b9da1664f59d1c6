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
//! | C | heat capacity of a cell, per radian and height | J/(m K rad) | `Network::capacity` |
//! | G | conductances between cells and to the boundary | W/(m K rad) | `Network::links` |
//! | u, k | drive temperature and its rate, piecewise linear and constant | K, K/s | `Drive::boundary_k` |
//! | a | ambient temperature, where it is known apart from the drive | K | `Drive::ambient_k` |
//! | q | heat into the bore | W/m² | `BoreHeat` |
//! | λ_i | decay rate of mode i | 1/s | `decay_per_s` |
//! | s_j, a_ji | steady response and modal amplitude of output j | 1 | `steady`, `amplitude` |
//!
//! Outputs are the layers' means and, where a flange is heated, their first axial moments. A flange makes the field
//! two-dimensional but keeps it separable: each mode of the axial operator carries a radial network of its own, with
//! K μ_m added to every cell of the pack (the spool does not conduct along the axis).
//!
//! Holds for constant properties; the outermost layer's temperature is imposed at its middle (`OuterLayer`), or its
//! surface exchanges heat with the air (`Ambient`).
//!
//! # Source
//! Modal solution of a linear system driven by ramps, any text on linear systems; separation of variables, Carslaw and
//! Jaeger (1959), section 5.6. The semi-discrete operator is exact in time: there is no time step.

use nalgebra::{DMatrix, DVector};

use super::modal::Response;
use super::network::{Network, Slices};
use super::{BoreHeat, HeatPath, ThermalError};
use crate::numeric::tridiagonal::diagonalise;

/// The modal form of a pack's heat path.
#[derive(Debug, Clone)]
pub struct Pack {
    pub(super) layers: usize,
    /// Layer means, then (with a heated flange) first axial moments.
    pub(super) outputs: usize,
    /// Ascending.
    pub(super) decay_per_s: Vec<f64>,
    pub(super) boundary: Response,
    /// Present where something exchanges heat with the ambient besides the outer surface.
    pub(super) ambient: Option<Response>,
    /// Outputs × modes: the temperature of an output per mode content that the bore's heat excites.
    pub(super) heat: Option<(BoreHeat, DMatrix<f64>)>,
}

/// A mode whose share of every response is smaller than this is rounding.
const NEGLIGIBLE: f64 = 1e-14;

/// Eigenmodes along the axis; without a heated flange there is one, uniform.
struct AxialModes {
    /// μ_m [1/m²].
    decay_per_m2: Vec<f64>,
    /// What a mode's content adds to the mean over the axis, and what a uniform input adds to its content.
    mean: Vec<f64>,
    uniform: Vec<f64>,
    /// Mode content per unit of the flange's air [1/m²], and the mode's first moment; both empty without a flange.
    flange_per_m2: Vec<f64>,
    moment: Vec<f64>,
    /// Of the pack's material.
    diffusivity_m2_per_s: f64,
}

impl AxialModes {
    fn new(path: &HeatPath, network: &Network) -> Result<Self, ThermalError> {
        let diffusivity_m2_per_s = path.material.diffusivity_m2_per_s();
        let Some(flange) = path.flange else {
            return Ok(Self {
                decay_per_m2: vec![0.0],
                mean: vec![1.0],
                uniform: vec![1.0],
                flange_per_m2: Vec::new(),
                moment: Vec::new(),
                diffusivity_m2_per_s,
            });
        };
        let slices = Slices::new(path, flange);
        let (n, heated) = (slices.count, slices.at_flange());
        let link = slices.width_m.powi(-2);
        let k = network.conductivity_w_per_m_k;
        let to_air = slices.flange_w_per_m2_k(k) / (slices.width_m * k);
        let mut diagonal: Vec<f64> = (0..n).map(|i| link * (f64::from(i > 0) + f64::from(i + 1 < n))).collect();
        diagonal[heated] += to_air;
        let moment = slices.moment_weights();
        let mut rows = DMatrix::from_fn(3, n, |row, i| match row {
            0 => 1.0,
            1 => f64::from(i == heated) * to_air,
            _ => moment[i],
        });
        diagonalise(&mut diagonal, &vec![-link; n - 1], &mut rows).map_err(|_| ThermalError::Eigen)?;
        let row = |r: usize| rows.row(r).iter().copied().collect::<Vec<f64>>();
        Ok(Self {
            decay_per_m2: diagonal,
            mean: row(0).iter().map(|v| v / n as f64).collect(),
            uniform: row(0),
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
struct Mode {
    decay_per_s: f64,
    seen: Vec<f64>,
    boundary: f64,
    ambient: f64,
    heat: f64,
}

impl Pack {
    /// # Errors
    /// Values so extreme that the eigenvalues do not converge or are not positive.
    pub fn new(path: &HeatPath) -> Result<Self, ThermalError> {
        let network = Network::new(path);
        let axial = AxialModes::new(path, &network)?;
        let layers = network.layers;
        let outputs = layers * if axial.has_moments() { 2 } else { 1 };
        let mut modes = Vec::with_capacity(network.nodes() * axial.mean.len());
        // A spool does not conduct along the axis: only without one do all axial modes share their radial ones.
        let shared = (network.spool_nodes == 0).then(|| radial(&network, &axial, 0.0)).transpose()?;
        for m in 0..axial.mean.len() {
            let extra_per_s = axial.diffusivity_m2_per_s * axial.decay_per_m2[m];
            match &shared {
                Some(shared) => modes.extend(radial_modes(shared, extra_per_s, &network, &axial, m)),
                None => modes.extend(radial_modes(&radial(&network, &axial, extra_per_s)?, 0.0, &network, &axial, m)),
            }
        }
        if modes.iter().any(|mode| !(mode.decay_per_s > 0.0)) {
            return Err(ThermalError::Eigen);
        }
        modes.sort_by(|a, b| a.decay_per_s.total_cmp(&b.decay_per_s));

        let has_ambient = network.mount != 0.0 || axial.has_moments();
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
        if network.outermost_is_drive {
            boundary_steady[layers - 1] = 1.0;
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
        let boundary = Response::new(boundary_steady, amplitude(|mode| mode.boundary), &decay_per_s);
        let ambient = has_ambient.then(|| Response::new(ambient_steady, amplitude(|mode| mode.ambient), &decay_per_s));
        let heat = path.bore_heat.map(|bore_heat| {
            (bore_heat, DMatrix::from_fn(outputs, modes.len(), |j, i| modes[i].seen[j] * modes[i].heat))
        });
        Ok(Self { layers, outputs, decay_per_s, boundary, ambient, heat })
    }

    pub(super) fn modes(&self) -> usize {
        self.decay_per_s.len()
    }

    /// λ_i [1/s], ascending.
    pub fn decays_per_s(&self) -> &[f64] {
        &self.decay_per_s
    }

    /// a_ji: what mode `mode` takes away from a layer's steady response while drive and ambient are one temperature.
    pub fn amplitude(&self, layer: usize, mode: usize) -> f64 {
        self.boundary.amplitude[(layer, mode)] + self.ambient.as_ref().map_or(0.0, |a| a.amplitude[(layer, mode)])
    }

    /// Drive and ambient as one temperature.
    pub(super) fn joint(&self) -> Response {
        match &self.ambient {
            None => self.boundary.clone(),
            Some(ambient) => self.boundary.plus(ambient),
        }
    }

    /// The rate of every layer after a unit step of the drive's rate; the ambient, if apart, does the same step.
    pub fn step_rates(&self, time_s: f64, layers: &mut [f64]) {
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
    pub fn settling_s(&self) -> f64 {
        50.0 / self.decay_per_s[0]
    }

    pub fn shortest_s(&self) -> f64 {
        1.0 / self.decay_per_s[self.modes() - 1]
    }
}

/// Radial modes: their decays, and what layers (rows) and inputs (the last rows) see of each.
struct Radial {
    decay_per_s: Vec<f64>,
    rows: DMatrix<f64>,
}

/// With `extra_per_s` added to every cell's decay.
fn radial(network: &Network, axial: &AxialModes, extra_per_s: f64) -> Result<Radial, ThermalError> {
    let (n, solved) = (network.nodes(), network.solved_layers());
    let (mut decay_per_s, off) = network.symmetrised(extra_per_s);
    let has_moments = axial.has_moments();
    let (boundary_row, mount_row, heat_row, flange_row) = (solved, solved + 1, solved + 2, solved + 3);
    let mut rows = DMatrix::zeros(solved + 3 + usize::from(has_moments), n);
    for layer in 0..solved {
        let capacity = network.layer_capacity(layer);
        for i in network.nodes_of(layer) {
            rows[(layer, i)] = network.capacity[i].sqrt() / capacity;
        }
    }
    let inner_root = network.capacity[0].sqrt();
    rows[(boundary_row, n - 1)] =
        network.to_boundary.conductance(network.conductivity_w_per_m_k) / network.capacity[n - 1].sqrt();
    rows[(mount_row, 0)] = network.mount / inner_root;
    rows[(heat_row, 0)] = network.heated / inner_root;
    if has_moments {
        for i in network.spool_nodes..n {
            rows[(flange_row, i)] = network.capacity[i].sqrt() * axial.diffusivity_m2_per_s;
        }
    }
    diagonalise(&mut decay_per_s, &off, &mut rows).map_err(|_| ThermalError::Eigen)?;
    Ok(Radial { decay_per_s, rows })
}

/// The modes that belong to axial mode `m`, each decaying by `extra_per_s` faster than the radial one.
fn radial_modes(
    radial: &Radial,
    extra_per_s: f64,
    network: &Network,
    axial: &AxialModes,
    m: usize,
) -> impl Iterator<Item = Mode> {
    let (n, layers, solved) = (network.nodes(), network.layers, network.solved_layers());
    let has_moments = axial.has_moments();
    let (boundary_row, mount_row, heat_row, flange_row) = (solved, solved + 1, solved + 2, solved + 3);
    let rows = &radial.rows;
    (0..n).map(move |i| {
        let mut seen = vec![0.0; layers * if has_moments { 2 } else { 1 }];
        for layer in 0..solved {
            seen[layer] = axial.mean[m] * rows[(layer, i)];
            if has_moments {
                seen[layers + layer] = axial.moment[m] * rows[(layer, i)];
            }
        }
        let from_flange = if has_moments { axial.flange_per_m2[m] * rows[(flange_row, i)] } else { 0.0 };
        Mode {
            decay_per_s: radial.decay_per_s[i] + extra_per_s,
            seen,
            boundary: axial.uniform[m] * rows[(boundary_row, i)],
            ambient: axial.uniform[m] * rows[(mount_row, i)] + from_flange,
            heat: axial.uniform[m] * rows[(heat_row, i)],
        }
    })
}

/// Keeps the modes that any output sees of any input; a flange makes many that none does.
fn drop_negligible(modes: &mut Vec<Mode>) {
    let shares = |mode: &Mode| {
        let seen = mode.seen.iter().fold(0.0, |most: f64, s| if s.abs() > most { s.abs() } else { most });
        [mode.boundary, mode.ambient, mode.heat].map(|input| (seen * input / mode.decay_per_s).abs())
    };
    let of_each: Vec<[f64; 3]> = modes.iter().map(shares).collect();
    let largest = [0, 1, 2].map(|input| of_each.iter().map(|shares| shares[input]).fold(0.0, f64::max));
    let mut of_each = of_each.iter();
    modes.retain(|_| {
        of_each.next().is_some_and(|shares| shares.iter().zip(largest).any(|(s, most)| *s > NEGLIGIBLE * most))
    });
}
