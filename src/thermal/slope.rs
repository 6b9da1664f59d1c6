//! A conductivity that depends weakly on temperature, as a series in its slope: no time steps.
//!
//! ```text
//! T = T0 + a T1 + a² T2 + a³ T3,   k = k0 (1 + a θ),   θ = T − 20 °C,   k ∇T = k0 ∇(θ + a θ²/2)
//! C dT_m/dt = −G T_m − K q_m,   q_1 = θ0²/2,   q_2 = θ0 T1,   q_3 = θ0 T2 + T1²/2
//! ```
//!
//! Every order is the linear network driven by what the orders before leave; each is solved by the modes of that network,
//! exactly for heat flows that are linear between the drive's knots and the rows' instants.
//!
//! Holds for slopes that change the conductivity by some ten or twenty per cent (the next term is of fourth order). Leaves out
//! flanges.
//!
//! # Source
//! Regular perturbation of the network of [`super::network`] in Kirchhoff's form; a test compares it with the stepped solution.

use nalgebra::{DMatrix, DVector};

use super::network::Network;
use super::{Drive, Extent, HeatPart, HeatPath, ThermalError, check, window_instants};
use crate::numeric::piecewise::PiecewiseLinear;
use crate::numeric::tridiagonal::diagonalise_full;
use crate::units::REFERENCE_TEMPERATURE_K;

/// The layers' temperatures and rates over each row's window, per unit (squared, cubed) of the slope.
///
/// # Shapes
/// Row-major, one row a window, one column a layer.
#[derive(Debug, Clone)]
pub struct SlopeTerm {
    pub temperature_k: Vec<f64>,
    pub rate_k_per_s: Vec<f64>,
}

/// Terms of the series.
pub const SLOPE_ORDERS: usize = 3;

/// What the terms of the series are to be multiplied with.
pub fn slope_powers(slope_per_k: f64) -> [f64; SLOPE_ORDERS] {
    [slope_per_k, slope_per_k.powi(2), slope_per_k.powi(3)]
}

/// The network's modes, and the times at which everything is sampled.
struct Modes {
    network: Network,
    decay_per_s: Vec<f64>,
    /// Nodes × modes: C^{−1/2} V.
    shape: DMatrix<f64>,
    times_s: Vec<f64>,
}

/// T1, T2 and T3 of a path, whatever slope it states itself.
///
/// # Errors
/// A half space or a flange; values so extreme that the eigenvalues do not converge.
pub fn slope_series(
    path: &HeatPath,
    drive: &Drive,
    ends_s: &[f64],
    window_s: f64,
) -> Result<[SlopeTerm; SLOPE_ORDERS], ThermalError> {
    check(&HeatPath { conductivity_slope_per_k: 1.0, ..path.clone() })?;
    if path.extent == Extent::HalfSpace || path.varies_along() || path.start.is_some() {
        return Err(ThermalError::Nonlinear { part: HeatPart::VaryingConductivityBesideFlange });
    }
    let (instants, places) = window_instants(ends_s, window_s);
    let modes = Modes::new(path, |shortest_s| {
        let mut times_s: Vec<f64> = instants.iter().map(|i| i.time_s.max(drive.start_s())).collect();
        for input in [&drive.boundary_k, drive.ambient_k()] {
            times_s.extend(input.knots());
            times_s.extend(settling_times_s(input, shortest_s));
        }
        times_s.retain(|t| *t >= drive.start_s());
        times_s.sort_by(f64::total_cmp);
        times_s.dedup_by(|later, earlier| *later - *earlier < SAME_TIME_S);
        times_s
    })?;
    let (network, count) = (&modes.network, modes.times_s.len());
    let n = network.nodes();
    let boundary_k: Vec<f64> = modes.times_s.iter().map(|&t| drive.boundary_k.value(t)).collect();

    let boundary = network.boundary();
    let mut into = DMatrix::zeros(n, count);
    for (t, &time_s) in modes.times_s.iter().enumerate() {
        let heat = path
            .bore_heat
            .map_or(0.0, |heat| heat.power_w_per_m2 * -(-(time_s - drive.start_s()) / heat.time_constant_s).exp_m1());
        for (into, per_k) in into.column_mut(t).iter_mut().zip(&boundary) {
            *into = per_k * (boundary_k[t] - REFERENCE_TEMPERATURE_K);
        }
        let ambient_k = drive.ambient_k().value(time_s) - REFERENCE_TEMPERATURE_K;
        for (into, per_k) in into.column_mut(t).iter_mut().zip(&network.to_ambient) {
            *into += per_k * ambient_k;
        }
        into[(0, t)] += network.heated * heat;
    }
    // Everything in kelvins above the reference.
    let zeroth = modes.solve(&into).0;
    let half_square = |k: f64| 0.5 * k * k;
    let at_drive = boundary_k.iter().map(|k| half_square(k - REFERENCE_TEMPERATURE_K)).collect::<Vec<f64>>();
    let (first, first_rate) = modes.solve(&modes.flows(zeroth.map(half_square), Some(&at_drive)));
    let (second, second_rate) = modes.solve(&modes.flows(zeroth.component_mul(&first), None));
    let curved = zeroth.component_mul(&second) + first.map(half_square);
    let (third, third_rate) = modes.solve(&modes.flows(curved, None));

    let place_of = |time_s: f64| {
        let after = modes.times_s.partition_point(|t| *t < time_s - SAME_TIME_S);
        after.min(count - 1)
    };
    let of = |value: &DMatrix<f64>, rate: &DMatrix<f64>| {
        let (value, rate) = (modes.layers(value), modes.layers(rate));
        let (mut temperature_k, mut rate_k_per_s) = (Vec::new(), Vec::new());
        for &place in &places {
            let end = value.column(place_of(instants[place].time_s));
            if window_s > 0.0 {
                let start = value.column(place_of(instants[place - 1].time_s.max(drive.start_s())));
                temperature_k.extend(start.iter().zip(end.iter()).map(|(a, b)| 0.5 * (a + b)));
                rate_k_per_s.extend(start.iter().zip(end.iter()).map(|(a, b)| (b - a) / window_s));
            } else {
                temperature_k.extend(end.iter());
                rate_k_per_s.extend(rate.column(place_of(instants[place].time_s)).iter());
            }
        }
        SlopeTerm { temperature_k, rate_k_per_s }
    };
    Ok([of(&first, &first_rate), of(&second, &second_rate), of(&third, &third_rate)])
}

/// Two times closer than this are one [s].
const SAME_TIME_S: f64 = 1e-6;
/// Changes of the drive's rate beyond this share of its range make heat flows that are not linear for a while …
const SUDDEN: f64 = 0.03;
/// … this long at most, in units of the time from one knot to the next.
const WHILE_KNOTS: f64 = 3.0;

/// Times at which the heat flows after a sudden change of the drive's rate are sampled, ever further apart.
fn settling_times_s(input: &PiecewiseLinear, shortest_s: f64) -> Vec<f64> {
    let knots = input.knots();
    let slopes: Vec<f64> = (0..knots.len()).map(|i| input.slope_of(i)).collect();
    let largest = slopes.iter().fold(0.0_f64, |a, s| a.max(s.abs()));
    let mut gaps: Vec<f64> = knots.windows(2).map(|w| w[1] - w[0]).collect();
    gaps.sort_by(f64::total_cmp);
    let longest_s = gaps.get(gaps.len() / 2).map_or(0.0, |gap| WHILE_KNOTS * gap);
    let mut times_s = Vec::new();
    for (i, &time_s) in knots.iter().enumerate() {
        let before = if i > 0 { slopes[i - 1] } else { 0.0 };
        if (slopes[i] - before).abs() > SUDDEN * largest {
            let mut after_s = shortest_s;
            while after_s < longest_s {
                times_s.push(time_s + after_s);
                after_s *= 1.5;
            }
        }
    }
    times_s
}

impl Modes {
    /// Sampled at the times that `times_s` makes of the shortest time constant.
    fn new(path: &HeatPath, times_s: impl FnOnce(f64) -> Vec<f64>) -> Result<Self, ThermalError> {
        let network = Network::new(path);
        let n = network.nodes();
        let mut shape = DMatrix::identity(n, n);
        let decay_per_s = diagonalise_full(network.symmetrised(0.0), &mut shape).map_err(|_| ThermalError::Eigen)?;
        if decay_per_s.iter().any(|l| !(*l > 0.0)) {
            return Err(ThermalError::Eigen);
        }
        for (mut row, capacity) in shape.row_iter_mut().zip(&network.capacity) {
            row /= capacity.sqrt();
        }
        let shortest_s = path.shape.radial_pitch_m.powi(2) / (16.0 * path.material.diffusivity_m2_per_s());
        Ok(Self { network, decay_per_s, shape, times_s: times_s(shortest_s) })
    }

    /// Temperatures of the nodes and their rates under heat into each node, both nodes × times; steady before the first.
    fn solve(&self, into: &DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
        let (n, count) = (self.decay_per_s.len(), self.times_s.len());
        let driven = self.shape.transpose() * into;
        let mut content = DMatrix::zeros(n, count);
        let mut warming = DMatrix::zeros(n, count);
        let mut state: DVector<f64> =
            DVector::from_iterator(n, self.decay_per_s.iter().zip(driven.column(0).iter()).map(|(l, p)| p / l));
        content.set_column(0, &state);
        let mut step_s = f64::NAN;
        let mut weights = vec![(0.0, 0.0, 0.0); n];
        for t in 1..count {
            let wide_s = self.times_s[t] - self.times_s[t - 1];
            if wide_s != step_s {
                step_s = wide_s;
                weights = self.decay_per_s.iter().map(|l| linear_step(*l, step_s)).collect();
            }
            for (i, (left, from, to)) in weights.iter().enumerate() {
                state[i] = left * state[i] + from * driven[(i, t - 1)] + to * driven[(i, t)];
                warming[(i, t)] = driven[(i, t)] - self.decay_per_s[i] * state[i];
            }
            content.set_column(t, &state);
        }
        (&self.shape * content, &self.shape * warming)
    }

    /// −K q, with what the drive's own q brings.
    fn flows(&self, q: DMatrix<f64>, at_drive: Option<&[f64]>) -> DMatrix<f64> {
        let mut into = -(&self.network.conduction * q);
        if let Some(at_drive) = at_drive {
            for (mut column, drive) in into.column_iter_mut().zip(at_drive) {
                column.iter_mut().zip(&self.network.from_drive).for_each(|(into, per_k)| *into += per_k * drive);
            }
        }
        into
    }

    /// Layer means, layers × times; what the drive imposes has no terms.
    fn layers(&self, nodes: &DMatrix<f64>) -> DMatrix<f64> {
        &self.network.shares * nodes
    }
}

/// What is left of a mode after a step, and the weights of its drive at the step's beginning and end.
fn linear_step(decay_per_s: f64, step_s: f64) -> (f64, f64, f64) {
    let z = decay_per_s * step_s;
    let (whole, late) = if z < 1e-3 {
        (1.0 - z / 2.0 + z * z / 6.0, 0.5 - z / 6.0 + z * z / 24.0)
    } else {
        (-(-z).exp_m1() / z, (z + (-z).exp_m1()) / (z * z))
    };
    ((-z).exp(), step_s * (whole - late), step_s * late)
}
