//! The modes of a linear pack, nodes and outputs from them, and what a conductivity that depends on temperature drives in them.
//!
//! The equations stand in [`super::stepped`].

use nalgebra::DMatrix;

use super::modal::heated_mode;
use super::network::{AxialElements, Network};
use super::{BoreHeat, HeatPath, ThermalError};
use crate::numeric::piecewise::PiecewiseLinear;
use crate::numeric::tridiagonal::diagonalise_full;
use crate::units::REFERENCE_TEMPERATURE_K;

/// What one input has put into the modes of the linear pack so far.
#[derive(Debug, Clone)]
pub(super) struct Track<'a> {
    input: &'a PiecewiseLinear,
    /// Content that a kelvin of it drives.
    by_input: &'a [f64],
    time_s: f64,
    next_knot: usize,
    /// Σ_q Δk_q e^{−λ (t−t_q)}.
    content: Vec<f64>,
    /// e^{−λ t} of the times that were waited last.
    left: (f64, Vec<f64>),
}

impl<'a> Track<'a> {
    pub(super) fn new(input: &'a PiecewiseLinear, by_input: &'a [f64]) -> Self {
        let modes = by_input.len();
        let left = (0.0, vec![1.0; modes]);
        Self { input, by_input, time_s: f64::NEG_INFINITY, next_knot: 0, content: vec![0.0; modes], left }
    }

    pub(super) fn wait(&mut self, until_s: f64, decay_per_s: &[f64]) {
        let waited_s = until_s - self.time_s;
        self.time_s = until_s;
        if waited_s == f64::INFINITY || waited_s <= 0.0 {
            return;
        }
        if waited_s != self.left.0 {
            self.left.0 = waited_s;
            self.left.1.iter_mut().zip(decay_per_s).for_each(|(left, l)| *left = (-l * waited_s).exp());
        }
        self.content.iter_mut().zip(&self.left.1).for_each(|(content, left)| *content *= left);
    }

    /// Adds what the input has made of each mode just before a time; times must not fall.
    pub(super) fn add_to(&mut self, time_s: f64, middle_k: f64, decay_per_s: &[f64], contents: &mut [f64]) {
        while let Some(&knot_s) = self.input.knots().get(self.next_knot).filter(|knot| **knot < time_s) {
            self.wait(knot_s, decay_per_s);
            let before = self.next_knot.checked_sub(1).map_or(0.0, |i| self.input.slope_of(i));
            let change = self.input.slope_of(self.next_knot) - before;
            self.content.iter_mut().for_each(|content| *content += change);
            self.next_knot += 1;
        }
        self.wait(time_s, decay_per_s);
        let (value, slope) = (self.input.value(time_s) - middle_k, self.input.slope_before(time_s));
        for (((c, b), l), content) in contents.iter_mut().zip(self.by_input).zip(decay_per_s).zip(&self.content) {
            *c += b / l * (value - (slope - content) / l);
        }
    }
}

/// The linear pack at T_m with its modes, and what bends it.
#[derive(Debug)]
pub(super) struct LinearisedPack {
    pub(super) network: Network,
    pub(super) axis: Option<AxialElements>,
    /// a at T_m.
    pub(super) slope_per_k: f64,
    diffusivity_m2_per_s: f64,
    pub(super) middle_k: f64,
    pub(super) heat: Option<BoreHeat>,
    /// C^{−1/2} V for each axial mode, nodes × modes; one for all where they share it.
    pub(super) radial: Vec<DMatrix<f64>>,
    /// Places along the axis × axial modes.
    pub(super) axial: DMatrix<f64>,
    /// λ, radial modes first.
    pub(super) decay_per_s: Vec<f64>,
    /// Content that each input drives.
    pub(super) by_boundary: Vec<f64>,
    pub(super) by_ambient: Vec<f64>,
    pub(super) by_heat: Vec<f64>,
    /// Outputs × contents.
    pub(super) seen: DMatrix<f64>,
    /// −Vᵀ K, and what the drive's ν adds, where nothing varies along the axis.
    pub(super) bending: DMatrix<f64>,
    pub(super) bending_drive: Vec<f64>,
}

impl LinearisedPack {
    /// `path` conducts as at T_m.
    #[expect(clippy::too_many_lines, reason = "modes first, then what each input makes of them")]
    pub(super) fn new(path: &HeatPath, middle_k: f64) -> Result<Self, ThermalError> {
        let network = Network::new(path);
        let axis = AxialElements::new(path);
        let diffusivity_m2_per_s = path.material.diffusivity_m2_per_s();
        let n = network.nodes();
        let (axial, axial_per_m2) = axial_modes(axis.as_ref(), network.conductivity_w_per_m_k)?;
        let places = axial.nrows();
        let mut radial = Vec::new();
        let mut decay_per_s = Vec::with_capacity(n * places);
        let is_shared = network.pack_nodes == network.nodes();
        let mut of_shared = Vec::new();
        for per_m2 in &axial_per_m2 {
            let extra_per_s = diffusivity_m2_per_s * per_m2;
            if !is_shared || radial.is_empty() {
                let mut shape = DMatrix::identity(n, n);
                let matrix = network.symmetrised(if is_shared { 0.0 } else { extra_per_s });
                of_shared = diagonalise_full(matrix, &mut shape).map_err(|_| ThermalError::Eigen)?;
                for (mut row, capacity) in shape.row_iter_mut().zip(&network.capacity) {
                    row /= capacity.sqrt();
                }
                radial.push(shape);
            }
            decay_per_s.extend(of_shared.iter().map(|l| l + if is_shared { extra_per_s } else { 0.0 }));
        }
        if decay_per_s.iter().any(|l| !(*l > 0.0)) {
            return Err(ThermalError::Eigen);
        }
        let mut system = Self {
            network,
            axis,
            slope_per_k: path.conductivity_slope_per_k,
            diffusivity_m2_per_s,
            middle_k,
            heat: path.bore_heat,
            radial,
            axial,
            decay_per_s,
            by_boundary: Vec::new(),
            by_ambient: Vec::new(),
            by_heat: Vec::new(),
            seen: DMatrix::zeros(0, 0),
            bending: DMatrix::zeros(0, 0),
            bending_drive: Vec::new(),
        };
        let masses = system.axis.as_ref().map_or(vec![1.0], |axis| axis.masses.clone());
        let uniform = |per_node: &[f64]| DMatrix::from_fn(n, places, |i, k| per_node[i] * masses[k]);
        let at_bore = |share: f64| -> Vec<f64> { (0..n).map(|i| if i == 0 { share } else { 0.0 }).collect() };
        system.by_boundary = system.content(&uniform(&system.network.boundary()));
        system.by_heat = system.content(&uniform(&at_bore(system.network.heated)));
        let mut from_air = uniform(&system.network.to_ambient);
        if let Some(axis) = &system.axis {
            for &(node, film) in &axis.flanges {
                let per_capacity = diffusivity_m2_per_s / system.network.conductivity_w_per_m_k * film;
                for i in system.network.pack() {
                    from_air[(i, node)] += system.network.capacity[i] * per_capacity;
                }
            }
        }
        system.by_ambient = system.content(&from_air);
        system.seen = system.outputs_of_contents(&masses);
        if system.axis.is_none() {
            system.bending = -system.shape(0).tr_mul(&system.network.conduction);
            system.bending_drive = system.content(&DMatrix::from_column_slice(n, 1, &system.network.from_drive));
        }
        Ok(system)
    }

    pub(super) fn outputs(&self) -> usize {
        self.network.layers * if self.axis.is_some() { 2 } else { 1 }
    }

    pub(super) fn shape(&self, axial_mode: usize) -> &DMatrix<f64> {
        &self.radial[axial_mode.min(self.radial.len() - 1)]
    }

    /// What heat into the nodes drives in each mode.
    pub(super) fn content(&self, into: &DMatrix<f64>) -> Vec<f64> {
        let along = into * &self.axial;
        (0..along.ncols()).flat_map(|m| self.shape(m).tr_mul(&along.column(m)).as_slice().to_vec()).collect()
    }

    pub(super) fn outputs_of_contents(&self, masses: &[f64]) -> DMatrix<f64> {
        let (n, layers) = (self.network.nodes(), self.network.layers);
        let mut seen = DMatrix::zeros(self.outputs(), self.decay_per_s.len());
        let over = |weights: &[f64]| self.axial.tr_mul(&nalgebra::DVector::from_column_slice(weights));
        let mean = over(masses);
        let moment = self.axis.as_ref().map(|axis| over(&axis.moment));
        for m in 0..self.axial.ncols() {
            let of_layers = &self.network.shares * self.shape(m);
            let mut columns = seen.columns_mut(m * n, n);
            columns.rows_mut(0, layers).copy_from(&(&of_layers * mean[m]));
            if let Some(moment) = &moment {
                columns.rows_mut(layers, layers).copy_from(&(&of_layers * moment[m]));
            }
        }
        seen
    }

    /// Adds what the bore's heat has made of each mode so long after the start.
    pub(super) fn add_heat(&self, since_s: f64, contents: &mut [f64]) {
        let Some(heat) = &self.heat else { return };
        let since_s = since_s.max(0.0);
        let building = (-since_s / heat.time_constant_s).exp();
        for ((c, b), l) in contents.iter_mut().zip(&self.by_heat).zip(&self.decay_per_s) {
            *c += b * heated_mode(heat, *l, since_s, (-l * since_s).exp(), building).0;
        }
    }

    /// Temperatures of the nodes above T_m, times' nodes side by side; contents × times in.
    pub(super) fn temperatures(&self, contents: &DMatrix<f64>) -> DMatrix<f64> {
        let n = self.network.nodes();
        if self.axis.is_none() {
            return self.shape(0) * contents;
        }
        let places = self.axial.nrows();
        let mut out = DMatrix::zeros(n * places, contents.ncols());
        for (column, mut out) in contents.column_iter().zip(out.column_iter_mut()) {
            let mut across = DMatrix::zeros(n, places);
            for m in 0..places {
                across.column_mut(m).copy_from(&(self.shape(m) * column.rows(m * n, n)));
            }
            let nodes = across * self.axial.transpose();
            out.copy_from_slice(nodes.as_slice());
        }
        out
    }

    /// What ν drives in each mode, contents × times; nodes × times and the drive's own ν in.
    pub(super) fn bent(&self, temperatures: &DMatrix<f64>, drive_k: &[f64]) -> DMatrix<f64> {
        let half = 0.5 * self.slope_per_k;
        let nu = temperatures.map(|t| half * t * t);
        let n = self.network.nodes();
        let at_drive = |t: usize| half * drive_k[t] * drive_k[t];
        let Some(axis) = &self.axis else {
            let mut out = &self.bending * nu;
            for (t, mut column) in out.column_iter_mut().enumerate() {
                let drive = at_drive(t);
                column.iter_mut().zip(&self.bending_drive).for_each(|(f, k)| *f += k * drive);
            }
            return out;
        };
        let places = axis.nodes();
        let mut out = DMatrix::zeros(self.decay_per_s.len(), nu.ncols());
        for (t, mut out) in out.column_iter_mut().enumerate() {
            let field = DMatrix::from_column_slice(n, places, nu.column(t).as_slice());
            let mut into = -(&self.network.conduction * &field);
            let drive = at_drive(t);
            for (mut column, mass) in into.column_iter_mut().zip(&axis.masses) {
                column.iter_mut().zip(&self.network.from_drive).for_each(|(f, k)| *f = (*f + k * drive) * mass);
            }
            let along = &field * &axis.stiffness_per_m2;
            for i in self.network.pack() {
                let capacity = self.network.capacity[i] * self.diffusivity_m2_per_s;
                for k in 0..places {
                    into[(i, k)] -= capacity * along[(i, k)];
                }
            }
            out.copy_from_slice(&self.content(&into));
        }
        out
    }

    pub(super) fn is_conducting(&self, temperatures: &DMatrix<f64>) -> Result<(), ThermalError> {
        match temperatures.iter().find(|t| !(1.0 + self.slope_per_k * **t > 0.0)) {
            None => Ok(()),
            Some(t) => {
                let factor = 1.0 - self.slope_per_k * (self.middle_k - REFERENCE_TEMPERATURE_K);
                let slope_per_k = self.slope_per_k / factor;
                Err(ThermalError::ConductivityNotPositive { temperature_k: t + self.middle_k, slope_per_k })
            }
        }
    }
}

/// Modes along the axis (places × modes, orthonormal over it) and their decays [1/m²]; one, uniform, without a flange.
pub(super) fn axial_modes(
    axis: Option<&AxialElements>,
    conductivity_w_per_m_k: f64,
) -> Result<(DMatrix<f64>, Vec<f64>), ThermalError> {
    let Some(axis) = axis else { return Ok((DMatrix::from_element(1, 1, 1.0), vec![0.0])) };
    let n = axis.nodes();
    let roots: Vec<f64> = axis.masses.iter().map(|m| m.sqrt()).collect();
    let mut operator = DMatrix::from_fn(n, n, |i, j| axis.stiffness_per_m2[(i, j)] / (roots[i] * roots[j]));
    for &(node, film) in &axis.flanges {
        operator[(node, node)] += film / conductivity_w_per_m_k / axis.masses[node];
    }
    let mut modes = DMatrix::identity(n, n);
    let decay = diagonalise_full(operator, &mut modes).map_err(|_| ThermalError::Eigen)?;
    for (mut row, root) in modes.row_iter_mut().zip(&roots) {
        row /= *root;
    }
    Ok((modes, decay))
}
