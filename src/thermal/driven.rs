//! One drive, many heat paths: what every possible mode remembers of the drive at a record's rows, kept once.
//!
//! ```text
//! T_j = s_j u − Σ_i a_ji z(λ_i),   z(λ) = ∫ k(t') e^{−λ(t−t')} dt'          k = du/dt
//! z(λ_i) ≈ Σ_n w_in z(Λ_n),   Λ_n = Λ_0 e^{n h}                             w_in: Lagrange's polynomials in ln λ
//! ```
//!
//! z(Λ_n) does not depend on the heat path. A path costs its eigenvalues and one product of small matrices, however many
//! modes it has: a heated flange makes thousands.
//!
//! Holds for constant properties. The interpolation is exact to some 10⁻⁷ of the drive's rate (a test measures it).
//!
//! # Source
//! The modal solution of [`super::pack`]; sums of exponentials by interpolation in ln λ: any text on Laplace transforms.

use std::sync::{Arc, OnceLock};

use nalgebra::{DMatrix, DVector};

use super::modal::{Contents, Decay, Response, heated_mode};
use super::pack::Pack;
use super::{BoreHeat, Drive, Extent, HeatPath, Instant, Side, ThermalError, ThermalHistory, check, solve};
use crate::numeric::piecewise::PiecewiseLinear;

/// Slower than this [1/s] is not distinguished from it; faster than the last node (100/s) is over at once.
const SLOWEST_PER_S: f64 = 1e-6;
/// h, in ln λ.
const SPACING: f64 = 0.25;
const NODES: usize = 75;
/// Nodes that one mode is interpolated from.
const STENCIL: usize = 12;

/// A drive as a record's rows see it, ready for any number of heat paths.
#[derive(Debug)]
pub struct Driven {
    drive: Drive,
    rows: Arc<Rows>,
    boundary: Arc<Memory>,
    /// Made when a path first asks for it.
    ambient: Option<Arc<OnceLock<Memory>>>,
    ambient_k: Arc<Vec<f64>>,
    ambient_rate_k_per_s: Arc<Vec<f64>>,
    /// e^{−Λ_n (t − t_0)} at each instant, for what begins with the drive; made when it is first asked for.
    since_start: Arc<OnceLock<DMatrix<f64>>>,
}

/// The instants that the rows of a record need.
#[derive(Debug)]
struct Rows {
    times_s: Vec<f64>,
    window_s: f64,
    instants: Vec<Instant>,
    /// Of each row, the instant at its end; the window's beginning is the one before.
    ends: Vec<usize>,
}

/// What the nodes remember of one input, on average over each row's window and by how much it changes there.
#[derive(Debug)]
pub struct Memory {
    value: DVector<f64>,
    value_per_s: DVector<f64>,
    /// Nodes × rows.
    memory: DMatrix<f64>,
    memory_per_s: DMatrix<f64>,
}

impl Rows {
    fn new(times_s: &[f64], window_s: f64) -> Self {
        let (instants, ends) = super::window_instants(times_s, window_s);
        Self { times_s: times_s.to_vec(), window_s, instants, ends }
    }

    /// The mean over each row's window and the change per second; `rate` serves where the window has no width.
    fn over(&self, value: &DMatrix<f64>, rate: impl FnOnce() -> DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
        if self.window_s <= 0.0 {
            return (value.clone(), rate());
        }
        let (height, count) = (value.nrows(), self.ends.len());
        let (mut mean, mut change) = (DMatrix::zeros(height, count), DMatrix::zeros(height, count));
        let columns = mean.as_mut_slice().chunks_exact_mut(height).zip(change.as_mut_slice().chunks_exact_mut(height));
        for (&end, (mean, change)) in self.ends.iter().zip(columns) {
            let (before, after) = value.as_slice()[(end - 1) * height..(end + 1) * height].split_at(height);
            for (((m, c), a), b) in mean.iter_mut().zip(change).zip(before).zip(after) {
                *m = 0.5 * (a + b);
                *c = (b - a) / self.window_s;
            }
        }
        (mean, change)
    }

    /// An input over each row's window, and its change there.
    fn inputs(&self, input: &PiecewiseLinear) -> (Vec<f64>, Vec<f64>) {
        let count = self.instants.len();
        let value = DMatrix::from_fn(1, count, |_, i| input.value(self.instants[i].time_s));
        let (value, per_s) = self.over(&value, || {
            DMatrix::from_fn(1, count, |_, i| match self.instants[i].side {
                Side::Before => input.slope_before(self.instants[i].time_s),
                Side::After => input.slope_after(self.instants[i].time_s),
            })
        });
        (value.data.into(), per_s.data.into())
    }
}

impl Memory {
    fn new(input: &PiecewiseLinear, rows: &Rows) -> Self {
        let decay_per_s = nodes_per_s();
        let contents = Contents::new(input, &decay_per_s);
        let count = rows.instants.len();
        let mut decay = Decay::new(&decay_per_s);
        let mut content = DMatrix::zeros(NODES, count);
        let mut slopes = Vec::with_capacity(count);
        for (&instant, column) in rows.instants.iter().zip(content.as_mut_slice().chunks_exact_mut(NODES)) {
            slopes.push(contents.at(instant, &mut decay, column).slope);
        }
        let mut memory = content.clone();
        for (column, slope) in memory.as_mut_slice().chunks_exact_mut(NODES).zip(&slopes) {
            for (m, l) in column.iter_mut().zip(&decay_per_s) {
                *m = (slope - *m) / l;
            }
        }
        let (memory, memory_per_s) = rows.over(&memory, || content);
        let (value, value_per_s) = rows.inputs(input);
        Self { value: value.into(), value_per_s: value_per_s.into(), memory, memory_per_s }
    }

    /// self + factor · other.
    fn plus(&self, factor: f64, other: &Self) -> Self {
        Self {
            value: &self.value + factor * &other.value,
            value_per_s: &self.value_per_s + factor * &other.value_per_s,
            memory: &self.memory + factor * &other.memory,
            memory_per_s: &self.memory_per_s + factor * &other.memory_per_s,
        }
    }

    /// Adds what a response makes of this input to temperatures and rates, outputs × rows.
    fn add_to(&self, response: &Response, decay_per_s: &[f64], window_s: f64, to: &mut [DMatrix<f64>; 2]) {
        let (first, seen) = seen_by_nodes(&response.amplitude, decay_per_s, Beyond::Remembered);
        let [temperature, rate] = to;
        temperature.ger(1.0, &response.steady, &self.value, 1.0);
        temperature.gemm(-1.0, &seen, &self.memory.rows(first, seen.ncols()), 1.0);
        rate.ger(1.0, &response.steady, &self.value_per_s, 1.0);
        let (first, seen) = if window_s > 0.0 {
            (first, seen)
        } else {
            seen_by_nodes(&response.amplitude, decay_per_s, Beyond::Content)
        };
        rate.gemm(-1.0, &seen, &self.memory_per_s.rows(first, seen.ncols()), 1.0);
    }
}

impl Driven {
    /// For records whose rates are means over `window_s` before each time, as in [`super::Field::means`].
    pub fn new(drive: Drive, times_s: &[f64], window_s: f64) -> Self {
        let rows = Rows::new(times_s, window_s);
        let boundary = Arc::new(Memory::new(&drive.boundary_k, &rows));
        let ambient = drive.ambient_k.as_ref().map(|_| Arc::default());
        let (ambient_k, ambient_rate_k_per_s) = rows.inputs(drive.ambient_k());
        Self {
            drive,
            rows: Arc::new(rows),
            boundary,
            ambient,
            ambient_k: Arc::new(ambient_k),
            ambient_rate_k_per_s: Arc::new(ambient_rate_k_per_s),
            since_start: Arc::default(),
        }
    }

    pub fn window_s(&self) -> f64 {
        self.rows.window_s
    }

    /// What the same rows remember of another input.
    pub fn memory_of(&self, input: &PiecewiseLinear) -> Memory {
        Memory::new(input, &self.rows)
    }

    /// The drive with `factor` times an input added to its boundary; `drive` is that sum.
    pub fn with(&self, factor: f64, input: &Memory, drive: Drive) -> Self {
        Self {
            drive,
            rows: self.rows.clone(),
            boundary: Arc::new(self.boundary.plus(factor, input)),
            ambient: self.ambient.clone(),
            ambient_k: self.ambient_k.clone(),
            ambient_rate_k_per_s: self.ambient_rate_k_per_s.clone(),
            since_start: self.since_start.clone(),
        }
    }

    /// The pack over each row's window.
    ///
    /// # Errors
    /// As [`solve`].
    pub fn means(&self, path: &HeatPath) -> Result<ThermalHistory, ThermalError> {
        if path.extent == Extent::HalfSpace || path.conductivity_slope_per_k != 0.0 || path.start.is_some() {
            return Ok(solve(path, &self.drive)?.means(&self.rows.times_s, self.rows.window_s));
        }
        check(path)?;
        let pack = Pack::new(path)?;
        let rows = self.rows.times_s.len();
        let decay_per_s = pack.decays_per_s();
        let mut columns = [DMatrix::zeros(pack.outputs, rows), DMatrix::zeros(pack.outputs, rows)];
        match (&pack.ambient, &self.ambient) {
            (Some(response), Some(ambient)) => {
                let ambient = ambient.get_or_init(|| Memory::new(self.drive.ambient_k(), &self.rows));
                self.boundary.add_to(&pack.boundary, decay_per_s, self.rows.window_s, &mut columns);
                ambient.add_to(response, decay_per_s, self.rows.window_s, &mut columns);
            }
            _ => self.boundary.add_to(&pack.joint(), decay_per_s, self.rows.window_s, &mut columns),
        }
        if let Some((heat, content)) = &pack.heat {
            let (first, seen) = seen_by_nodes(content, decay_per_s, Beyond::Remembered);
            let warmed = self.heated(heat, first, seen.ncols());
            for (column, warmed) in columns.iter_mut().zip(&warmed) {
                column.gemm(1.0, &seen, warmed, 1.0);
            }
        }
        let [temperature, rate] = columns;
        let mut history = ThermalHistory {
            layers: pack.layers,
            times_s: self.rows.times_s.clone(),
            temperature_k: Vec::new(),
            rate_k_per_s: Vec::new(),
            axial_moment_k: Vec::new(),
            axial_moment_k_per_s: Vec::new(),
            ambient_k: self.ambient_k.to_vec(),
            ambient_rate_k_per_s: self.ambient_rate_k_per_s.to_vec(),
        };
        (history.temperature_k, history.axial_moment_k) = shared(temperature, pack.layers);
        (history.rate_k_per_s, history.axial_moment_k_per_s) = shared(rate, pack.layers);
        Ok(history)
    }

    /// What the bore's heat puts into the nodes from `first` on, nodes × rows.
    fn heated(&self, heat: &BoreHeat, first: usize, count: usize) -> [DMatrix<f64>; 2] {
        let decay_per_s = nodes_per_s();
        let instants = &self.rows.instants;
        let start_s = self.drive.start_s();
        let left = self.since_start.get_or_init(|| {
            DMatrix::from_fn(NODES, instants.len(), |n, i| (-decay_per_s[n] * (instants[i].time_s - start_s)).exp())
        });
        let (mut value, mut rate) = (DMatrix::zeros(count, instants.len()), DMatrix::zeros(count, instants.len()));
        for (i, instant) in instants.iter().enumerate() {
            let since_s = instant.time_s - start_s;
            let building = (-since_s / heat.time_constant_s).exp();
            for n in 0..count {
                let node = first + n;
                (value[(n, i)], rate[(n, i)]) =
                    heated_mode(heat, decay_per_s[node], since_s, left[(node, i)], building);
            }
        }
        self.rows.over(&value, || rate).into()
    }
}

/// What is wanted of a mode beyond the last node, where everything is over at once.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Beyond {
    /// z, which is k/λ there.
    Remembered,
    /// dz/dt, which is the last node's.
    Content,
}

/// Λ_n.
fn nodes_per_s() -> Vec<f64> {
    (0..NODES).map(|n| SLOWEST_PER_S * (SPACING * n as f64).exp()).collect()
}

/// The first node that any mode is interpolated from, and what the outputs see of each node from there on.
fn seen_by_nodes(amplitude: &DMatrix<f64>, decay_per_s: &[f64], beyond: Beyond) -> (usize, DMatrix<f64>) {
    let mut seen = DMatrix::zeros(amplitude.nrows(), NODES);
    let (mut first, mut last) = (NODES - STENCIL, STENCIL);
    for (mode, decay_per_s) in decay_per_s.iter().enumerate() {
        let (from, weights) = stencil(*decay_per_s, beyond);
        first = first.min(from);
        last = last.max(from + STENCIL);
        for (n, w) in weights.iter().enumerate() {
            seen.column_mut(from + n).axpy(*w, &amplitude.column(mode), 1.0);
        }
    }
    (first, seen.columns(first, last.max(first) - first).into_owned())
}

/// The nodes around a decay, and Lagrange's weights.
fn stencil(decay_per_s: f64, beyond: Beyond) -> (usize, [f64; STENCIL]) {
    let last = (NODES - 1) as f64;
    let further = (decay_per_s / SLOWEST_PER_S).ln() / SPACING - last;
    let place = (further + last).clamp(0.0, last);
    let from = (place as usize).saturating_sub(STENCIL / 2 - 1).min(NODES - STENCIL);
    let x = place - from as f64;
    let mut weights = [1.0; STENCIL];
    for (n, w) in weights.iter_mut().enumerate() {
        for other in (0..STENCIL).filter(|&other| other != n) {
            *w *= (x - other as f64) / (n as f64 - other as f64);
        }
    }
    if further > 0.0 && beyond == Beyond::Remembered {
        weights.iter_mut().for_each(|w| *w *= (-SPACING * further).exp());
    }
    (from, weights)
}

/// The outputs' columns as layers' means and, where there are as many again, moments; row-major.
fn shared(columns: DMatrix<f64>, layers: usize) -> (Vec<f64>, Vec<f64>) {
    if columns.nrows() == layers {
        return (columns.data.into(), Vec::new());
    }
    let (mut means, mut moments) = (Vec::new(), Vec::new());
    for column in columns.as_slice().chunks_exact(columns.nrows()) {
        means.extend_from_slice(&column[..layers]);
        moments.extend_from_slice(&column[layers..]);
    }
    (means, moments)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thermal::{Flange, FlangeFilm, Location, Material, PackShape, Spool};

    fn drive() -> Drive {
        let knots: Vec<f64> = (0..400).map(|i| 5.0 * f64::from(i)).chain([903.7, 1204.2]).collect();
        let course = |after_s: f64, lag_s: f64| {
            let mut knots = knots.clone();
            knots.sort_by(f64::total_cmp);
            let values = knots
                .iter()
                .map(|&t| 293.0 + 15.0 * (1.0 - (-(t - after_s).max(0.0) / lag_s).exp()) - 0.01 * (t - 1204.2).max(0.0))
                .collect();
            PiecewiseLinear::new(knots, values).unwrap()
        };
        Drive { boundary_k: course(300.0, 500.0), ambient_k: Some(course(250.0, 200.0)) }
    }

    fn paths() -> Vec<(&'static str, HeatPath)> {
        let shape = PackShape { layers: 12, bore_radius_m: 0.04, radial_pitch_m: 165e-6, height_m: 8.5e-3 };
        let material = Material::Conductivity { w_per_m_k: 0.35, heat_capacity_j_per_m3_k: 1.7e6 };
        let plain = HeatPath::new(shape, Extent::Pack, material, Location::OuterLayer);
        let film = HeatPath { location: Location::Ambient, film_w_per_m2_k: Some(20.0), ..plain.clone() };
        let spool = Spool { heat_capacity_j_per_m2_k: 4000.0, contact_w_per_m2_k: 300.0, mount_w_per_m2_k: 20.0 };
        let bore_heat = Some(BoreHeat { power_w_per_m2: 50.0, time_constant_s: 300.0 });
        let flange = Some(FlangeFilm { flange: Flange::Second, film_w_per_m2_k: 50.0 });
        vec![
            ("plain", plain.clone()),
            ("film", film.clone()),
            ("spool and heat", HeatPath { spool: Some(spool), bore_heat, ..plain.clone() }),
            ("flange", HeatPath { flange, ..plain }),
            ("all", HeatPath { spool: Some(spool), bore_heat, flange, ..film }),
        ]
    }

    #[test]
    fn every_path_has_the_means_of_its_own_modes() {
        let times_s: Vec<f64> = (1..190).map(|i| 10.0 * f64::from(i)).collect();
        for window_s in [10.0, 4.0, 0.0] {
            let driven = Driven::new(drive(), &times_s, window_s);
            for (name, path) in paths() {
                let exact = solve(&path, &drive()).unwrap().means(&times_s, window_s);
                let found = driven.means(&path).unwrap();
                let off = |a: &[f64], b: &[f64]| {
                    assert_eq!(a.len(), b.len(), "{name}");
                    let largest = a.iter().map(|v| v.abs()).fold(1e-300, f64::max);
                    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / largest
                };
                let rates = off(&exact.rate_k_per_s, &found.rate_k_per_s);
                let moments = off(&exact.axial_moment_k_per_s, &found.axial_moment_k_per_s);
                let temperatures = off(&exact.temperature_k, &found.temperature_k);
                println!(
                    "{name}, {window_s} s: rates {rates:.1e}, moments {moments:.1e}, temperatures {temperatures:.1e}"
                );
                assert!(rates < 5e-7 && moments < 2e-6 && temperatures < 1e-8);
                assert!(off(&exact.ambient_k, &found.ambient_k) < 1e-12);
                assert!(off(&exact.ambient_rate_k_per_s, &found.ambient_rate_k_per_s) < 1e-12);
            }
        }
    }

    #[test]
    fn a_sum_of_drives_is_remembered_as_the_sum_of_what_each_leaves() {
        let times_s: Vec<f64> = (1..100).map(|i| 10.0 * f64::from(i)).collect();
        let (first, other) = (drive().boundary_k, drive().ambient_k.unwrap());
        let values = first.knots().iter().map(|&t| first.value(t) + 0.3 * other.value(t)).collect();
        let sum = Drive::boundary(PiecewiseLinear::new(first.knots().to_vec(), values).unwrap());
        let of_first = Driven::new(Drive::boundary(first), &times_s, 10.0);
        let path = &paths()[0].1;
        let together = of_first.with(0.3, &of_first.memory_of(&other), sum.clone()).means(path).unwrap();
        let directly = Driven::new(sum, &times_s, 10.0).means(path).unwrap();
        for (a, b) in together.rate_k_per_s.iter().zip(&directly.rate_k_per_s) {
            assert!((a - b).abs() < 1e-13);
        }
    }
}
