//! A pack whose conductivity depends on temperature, stepped in time by an implicit L-stable method.
//!
//! ```text
//! C dT/dt = −G(T) T + b(T) u(t) + …,   k = k0 (1 + a (T − 20 °C))
//! (I − γτA) k1 = τ F(t, T),  (I − γτA) k2 = τ F(t + τ, T + k1) − 2 k1,  T ← T + 3/2 k1 + 1/2 k2,  γ = 1 − 1/√2
//! ```
//!
//! The method (ROS2) is of second order whatever A is, so A holds the conductances of the step's start, and with a
//! heated flange the product (I − γτA_r)(I − γτA_z), which leaves only tridiagonal systems. One step is compared with
//! two half steps: the difference controls the step and its extrapolation is kept, of third order. Between steps the
//! layers follow cubic Hermite polynomials. Steps end at every knot of the drive.
//!
//! Holds for any drive under which the conductivity stays positive. With a = 0 it is the network that [`super::pack`]
//! solves exactly; a test compares the two.
//!
//! # Source
//! Verwer, Spee, Blom, Hundsdorfer, SIAM J. Sci. Comput. 20 (1999) 1456 (ROS2 with approximate factorisation); Hairer
//! and Wanner, Solving Ordinary Differential Equations II, sections II.4 and IV.7.

use super::course::Course;
use super::network::{Link, Network, Slices};
use super::pack::Pack;
use super::{Drive, HeatPath, Instant, Side, ThermalError, ThermalHistory, Wanted};
use crate::numeric::piecewise::PiecewiseLinear;
use crate::units::REFERENCE_TEMPERATURE_K;

const GAMMA: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;

/// Error allowed in one step, as a share of the span of the drive's temperatures: rates right
/// after a change of ramp are off by far more, and a winding that cancels most of them shows it (`tests/verify`) …
pub(super) const TOLERANCE_SHARE: f64 = 1e-8;
/// … but no less than this [K].
const LEAST_TOLERANCE_K: f64 = 1e-9;
/// A step is never shorter than this share of the fastest response.
const SHORTEST_SHARE: f64 = 1e-3;

/// What acts from outside at one time.
#[derive(Debug, Clone, Copy)]
struct Inputs {
    boundary_k: f64,
    ambient_k: f64,
    heat_w_per_m2: f64,
}

/// Conductances at one state of the pack, per radian and height.
#[derive(Debug, Default)]
struct Conductances {
    /// From each node outwards; the last node's leads to the drive.
    outwards: Vec<f64>,
    /// From each node to the same node of the next slice.
    along: Vec<f64>,
    /// From each node of the slice at the flange to the air.
    to_flange: Vec<f64>,
}

/// The network in space, and how it changes with temperature.
#[derive(Debug, Clone)]
struct System {
    network: Network,
    slices: Option<Slices>,
    slope_per_k: f64,
    diffusivity_m2_per_s: f64,
    heat: Option<super::BoreHeat>,
    start_s: f64,
}

/// A pack with variable conductivity under one drive.
#[derive(Debug, Clone)]
pub struct SteppedField {
    layers: usize,
    outputs: usize,
    outermost_is_drive: bool,
    drive: Drive,
    course: Course,
}

impl System {
    fn new(path: &HeatPath, start_s: f64) -> Self {
        Self {
            network: Network::new(path),
            slices: path.flange.map(|flange| Slices::new(path, flange)),
            slope_per_k: path.conductivity_slope_per_k,
            diffusivity_m2_per_s: path.material.diffusivity_m2_per_s(),
            heat: path.bore_heat,
            start_s,
        }
    }

    fn slice_count(&self) -> usize {
        self.slices.map_or(1, |s| s.count)
    }

    fn outputs(&self) -> usize {
        self.network.layers * if self.slices.is_some() { 2 } else { 1 }
    }

    fn factor(&self, temperature_k: f64) -> f64 {
        1.0 + self.slope_per_k * (temperature_k - REFERENCE_TEMPERATURE_K)
    }

    fn inputs(&self, drive: &Drive, time_s: f64) -> Inputs {
        let heat_w_per_m2 = self.heat.map_or(0.0, |heat| {
            let since_s = (time_s - self.start_s).max(0.0);
            heat.power_w_per_m2 * -(-since_s / heat.time_constant_s).exp_m1()
        });
        Inputs { boundary_k: drive.boundary_k.value(time_s), ambient_k: drive.ambient_k().value(time_s), heat_w_per_m2 }
    }

    fn conductances(&self, state: &[f64], inputs: &Inputs, out: &mut Conductances) {
        let (n, first) = (self.network.nodes(), self.network.spool_nodes);
        let k0 = self.network.conductivity_w_per_m_k;
        out.outwards.clear();
        out.along.clear();
        out.to_flange.clear();
        let through = |link: &Link, temperature_k: f64| link.conductance(k0 * self.factor(temperature_k));
        for slice in state.chunks_exact(n) {
            for (i, link) in self.network.links.iter().enumerate() {
                // With k linear in T the mean of both is exact for a steady flow; a contact sees the cell beside it.
                let temperature_k = if i < first { slice[i + 1] } else { 0.5 * (slice[i] + slice[i + 1]) };
                out.outwards.push(through(link, temperature_k));
            }
            let outermost_k = slice[n - 1];
            let surface_k =
                if self.network.outermost_is_drive { 0.5 * (outermost_k + inputs.boundary_k) } else { outermost_k };
            out.outwards.push(through(&self.network.to_boundary, surface_k));
        }
        let Some(slices) = &self.slices else { return };
        let unit = self.diffusivity_m2_per_s / (slices.width_m * slices.width_m);
        for pair in 0..slices.count - 1 {
            for i in 0..n {
                let middle_k = 0.5 * (state[pair * n + i] + state[(pair + 1) * n + i]);
                let conducts = f64::from(i >= first);
                out.along.push(conducts * unit * self.network.capacity[i] * self.factor(middle_k));
            }
        }
        let per_capacity = self.diffusivity_m2_per_s / k0 / slices.width_m;
        let at_flange = slices.at_flange() * n;
        for i in 0..n {
            let film = slices.flange_w_per_m2_k(k0 * self.factor(state[at_flange + i]));
            out.to_flange.push(f64::from(i >= first) * per_capacity * self.network.capacity[i] * film);
        }
    }

    /// dT/dt.
    fn rates(&self, state: &[f64], inputs: &Inputs, g: &Conductances, out: &mut [f64]) {
        let n = self.network.nodes();
        for (s, (slice, out)) in state.chunks_exact(n).zip(out.chunks_exact_mut(n)).enumerate() {
            let outwards = &g.outwards[s * n..(s + 1) * n];
            let mut inflow =
                self.network.mount * (inputs.ambient_k - slice[0]) + self.network.heated * inputs.heat_w_per_m2;
            for i in 0..n {
                let next_k = if i + 1 < n { slice[i + 1] } else { inputs.boundary_k };
                let outflow = outwards[i] * (slice[i] - next_k);
                out[i] = (inflow - outflow) / self.network.capacity[i];
                inflow = outflow;
            }
        }
        let Some(slices) = &self.slices else { return };
        for (pair, along) in g.along.chunks_exact(n).enumerate() {
            for i in 0..n {
                let flow = along[i] * (state[pair * n + i] - state[(pair + 1) * n + i]) / self.network.capacity[i];
                out[pair * n + i] -= flow;
                out[(pair + 1) * n + i] += flow;
            }
        }
        let at_flange = slices.at_flange() * n;
        for (i, film) in g.to_flange.iter().enumerate() {
            out[at_flange + i] += film * (inputs.ambient_k - state[at_flange + i]) / self.network.capacity[i];
        }
    }

    /// Solves (I − θA_r)(I − θA_z) x = b in place.
    fn solve(&self, theta_s: f64, g: &Conductances, b: &mut [f64], scratch: &mut Vec<f64>) {
        let n = self.network.nodes();
        let capacity = &self.network.capacity;
        for (s, slice) in b.chunks_exact_mut(n).enumerate() {
            let outwards = &g.outwards[s * n..(s + 1) * n];
            let inwards = |i: usize| if i > 0 { outwards[i - 1] } else { self.network.mount };
            thomas(n, scratch, slice, 1, |i| {
                let scale = theta_s / capacity[i];
                let below = if i > 0 { -scale * outwards[i - 1] } else { 0.0 };
                let above = if i + 1 < n { -scale * outwards[i] } else { 0.0 };
                (below, 1.0 + scale * (inwards(i) + outwards[i]), above)
            });
        }
        let Some(slices) = &self.slices else { return };
        let (count, heated) = (slices.count, slices.at_flange());
        for i in self.network.spool_nodes..n {
            let scale = theta_s / capacity[i];
            thomas(count, scratch, &mut b[i..], n, |s| {
                let below = if s > 0 { scale * g.along[(s - 1) * n + i] } else { 0.0 };
                let above = if s + 1 < count { scale * g.along[s * n + i] } else { 0.0 };
                let film = if s == heated { scale * g.to_flange[i] } else { 0.0 };
                (-below, 1.0 + below + above + film, -above)
            });
        }
    }

    /// Layer means, then axial moments; linear in the state, so it serves rates too. The drive's layer is left zero.
    fn project(&self, state: &[f64], out: &mut Vec<f64>) {
        let n = self.network.nodes();
        let count = self.slice_count();
        let start = out.len();
        out.resize(start + self.outputs(), 0.0);
        let moments = self.slices.map(|s| s.moment_weights());
        for layer in 0..self.network.solved_layers() {
            let nodes = self.network.nodes_of(layer);
            let capacity = self.network.layer_capacity(layer);
            for s in 0..count {
                let mean: f64 =
                    nodes.clone().map(|i| self.network.capacity[i] * state[s * n + i]).sum::<f64>() / capacity;
                out[start + layer] += mean / count as f64;
                if let Some(weights) = &moments {
                    out[start + self.network.layers + layer] += weights[s] * mean;
                }
            }
        }
    }
}

/// Solves a tridiagonal system in place; `x` holds every `stride`-th entry, `row(i)` gives (below, diagonal, above).
fn thomas(n: usize, scratch: &mut Vec<f64>, x: &mut [f64], stride: usize, row: impl Fn(usize) -> (f64, f64, f64)) {
    scratch.clear();
    let (mut previous, mut carried) = (0.0, 0.0);
    for i in 0..n {
        let (below, diagonal, above) = row(i);
        let pivot = diagonal - below * previous;
        previous = above / pivot;
        carried = (x[i * stride] - below * carried) / pivot;
        x[i * stride] = carried;
        scratch.push(previous);
    }
    for i in (0..n - 1).rev() {
        x[i * stride] -= scratch[i] * x[(i + 1) * stride];
    }
}

/// Integrates a system and keeps the course of its outputs.
struct Integrator<'a> {
    system: &'a System,
    state: Vec<f64>,
    step_s: f64,
    tolerance_k: f64,
    shortest_s: f64,
    frozen: Conductances,
    current: Conductances,
    stages: [Vec<f64>; 2],
    scratch: Vec<f64>,
}

impl<'a> Integrator<'a> {
    fn new(system: &'a System, start_k: f64, tolerance_k: f64, shortest_s: f64) -> Self {
        let size = system.network.nodes() * system.slice_count();
        Self {
            system,
            state: vec![start_k; size],
            step_s: shortest_s,
            tolerance_k,
            shortest_s: shortest_s * SHORTEST_SHARE,
            frozen: Conductances::default(),
            current: Conductances::default(),
            stages: [vec![0.0; size], vec![0.0; size]],
            scratch: Vec::new(),
        }
    }

    /// One step of ROS2 with the frozen conductances in A.
    fn ros2(&mut self, drive: &Drive, from_s: f64, step_s: f64, state: &[f64]) -> Vec<f64> {
        let system = self.system;
        let [k1, k2] = &mut self.stages;
        let inputs = system.inputs(drive, from_s);
        system.conductances(state, &inputs, &mut self.current);
        system.rates(state, &inputs, &self.current, k1);
        k1.iter_mut().for_each(|k| *k *= step_s);
        system.solve(GAMMA * step_s, &self.frozen, k1, &mut self.scratch);
        let middle: Vec<f64> = state.iter().zip(k1.iter()).map(|(y, k)| y + k).collect();
        let inputs = system.inputs(drive, from_s + step_s);
        system.conductances(&middle, &inputs, &mut self.current);
        system.rates(&middle, &inputs, &self.current, k2);
        for (k2, k1) in k2.iter_mut().zip(k1.iter()) {
            *k2 = *k2 * step_s - 2.0 * k1;
        }
        system.solve(GAMMA * step_s, &self.frozen, k2, &mut self.scratch);
        state.iter().zip(k1.iter().zip(k2.iter())).map(|(y, (k1, k2))| y + 1.5 * k1 + 0.5 * k2).collect()
    }

    /// From one knot to the next; the drive is linear between them.
    fn advance(
        &mut self,
        drive: &Drive,
        from_s: f64,
        to_s: f64,
        course: Option<&mut Course>,
    ) -> Result<(), ThermalError> {
        let mut course = course;
        let mut time_s = from_s;
        self.step_s = self.step_s.min(to_s - from_s);
        while time_s < to_s {
            // No sliver is left for a last step.
            let left_s = to_s - time_s;
            let step_s = if self.step_s >= left_s * (1.0 - 1e-9) {
                left_s
            } else if self.step_s > 0.5 * left_s {
                0.5 * left_s
            } else {
                self.step_s
            };
            let state = std::mem::take(&mut self.state);
            let inputs = self.system.inputs(drive, time_s);
            self.system.conductances(&state, &inputs, &mut self.frozen);
            let whole = self.ros2(drive, time_s, step_s, &state);
            let half = self.ros2(drive, time_s, 0.5 * step_s, &state);
            let halves = self.ros2(drive, time_s + 0.5 * step_s, 0.5 * step_s, &half);
            let error_k = whole.iter().zip(&halves).map(|(a, b)| (a - b).abs() / 3.0).fold(0.0, f64::max);
            let factor = (0.9 * (self.tolerance_k / error_k.max(1e-300)).cbrt()).clamp(0.2, 4.0);
            if !error_k.is_finite() {
                return Err(ThermalError::Eigen);
            }
            if error_k > self.tolerance_k && step_s > self.shortest_s {
                self.state = state;
                self.step_s = step_s * factor;
                continue;
            }
            time_s = if step_s == left_s { to_s } else { time_s + step_s };
            self.state = halves.iter().zip(&whole).map(|(b, a)| b + (b - a) / 3.0).collect();
            self.check_conductivity()?;
            if step_s >= self.step_s || factor < 1.0 {
                self.step_s = step_s * factor;
            }
            if let Some(course) = course.as_deref_mut() {
                self.record(drive, time_s, course);
            }
        }
        Ok(())
    }

    fn check_conductivity(&self) -> Result<(), ThermalError> {
        let slope_per_k = self.system.slope_per_k;
        match self.state.iter().find(|t| !(self.system.factor(**t) > 0.0)) {
            None => Ok(()),
            Some(&temperature_k) => Err(ThermalError::ConductivityNotPositive { temperature_k, slope_per_k }),
        }
    }

    fn record(&mut self, drive: &Drive, time_s: f64, course: &mut Course) {
        let inputs = self.system.inputs(drive, time_s);
        self.system.conductances(&self.state, &inputs, &mut self.current);
        self.system.rates(&self.state, &inputs, &self.current, &mut self.stages[0]);
        course.times_s.push(time_s);
        self.system.project(&self.state, &mut course.value);
        self.system.project(&self.stages[0], &mut course.rate);
    }
}

impl SteppedField {
    /// # Errors
    /// Values so extreme that nothing converges; a conductivity that does not stay positive.
    pub fn new(path: &HeatPath, drive: &Drive, tolerance_share: f64) -> Result<Self, ThermalError> {
        let system = System::new(path, drive.start_s());
        // The linear pack at the declared conductivity tells the time scales.
        let linear = Pack::new(path)?;
        let values = || drive.boundary_k.values().iter().chain(drive.ambient_k().values()).copied();
        let (lowest_k, highest_k) = values().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        for temperature_k in [lowest_k, highest_k] {
            if !(system.factor(temperature_k) > 0.0) {
                let slope_per_k = system.slope_per_k;
                return Err(ThermalError::ConductivityNotPositive { temperature_k, slope_per_k });
            }
        }
        let tolerance_k = (tolerance_share * (highest_k - lowest_k)).max(LEAST_TOLERANCE_K);
        let slowest = system.factor(lowest_k).min(system.factor(highest_k)).min(1.0);
        let settling_s = linear.settling_s() / slowest;
        let mut integrator = Integrator::new(&system, drive.boundary_k.first_value(), tolerance_k, linear.shortest_s());
        let start_s = drive.start_s();
        if drive.ambient_k().first_value() != drive.boundary_k.first_value() {
            let still = Drive {
                boundary_k: PiecewiseLinear::constant(drive.boundary_k.first_value()),
                ambient_k: Some(PiecewiseLinear::constant(drive.ambient_k().first_value())),
            };
            integrator.advance(&still, start_s - settling_s, start_s, None)?;
            integrator.step_s = linear.shortest_s();
        }
        let mut knots: Vec<f64> = drive.boundary_k.knots().iter().chain(drive.ambient_k().knots()).copied().collect();
        knots.retain(|k| *k >= start_s);
        knots.sort_by(f64::total_cmp);
        knots.dedup();
        let warming_s = path.bore_heat.map_or(0.0, |heat| 40.0 * heat.time_constant_s);
        knots.push(knots[knots.len() - 1] + settling_s + warming_s);
        let mut course = Course::default();
        integrator.record(drive, start_s, &mut course);
        for pair in knots.windows(2) {
            integrator.advance(drive, pair[0], pair[1], Some(&mut course))?;
        }
        Ok(Self {
            layers: path.shape.layers,
            outputs: system.outputs(),
            outermost_is_drive: system.network.outermost_is_drive,
            drive: drive.clone(),
            course,
        })
    }

    pub(super) fn at(&self, instants: &[Instant], wanted: Wanted) -> ThermalHistory {
        let mut history = ThermalHistory::with_capacity(self.layers, instants.len());
        let (mut value, mut rate) = (vec![0.0; self.outputs], vec![0.0; self.outputs]);
        for &instant in instants {
            self.course.at(instant.time_s, self.outputs, &mut value, &mut rate);
            if self.outermost_is_drive {
                value[self.layers - 1] = self.drive.boundary_k.value(instant.time_s);
                rate[self.layers - 1] = match instant.side {
                    Side::Before => self.drive.boundary_k.slope_before(instant.time_s),
                    Side::After => self.drive.boundary_k.slope_after(instant.time_s),
                };
            }
            if wanted.temperatures() {
                history.temperature_k.extend_from_slice(&value[..self.layers]);
                history.axial_moment_k.extend_from_slice(&value[self.layers..]);
            }
            if wanted.rates() {
                history.rate_k_per_s.extend_from_slice(&rate[..self.layers]);
                history.axial_moment_k_per_s.extend_from_slice(&rate[self.layers..]);
            }
            history.times_s.push(instant.time_s);
            super::push_ambient(&mut history, &self.drive, instant);
        }
        history
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thermal::modal::PackField;
    use crate::thermal::{BoreHeat, Extent, Flange, FlangeFilm, Location, Material, PackShape, Spool};

    fn path(location: Location) -> HeatPath {
        let shape = PackShape { layers: 8, bore_radius_m: 0.04, radial_pitch_m: 165e-6, height_m: 0.0085 };
        let material = Material::Conductivity { w_per_m_k: 0.35, heat_capacity_j_per_m3_k: 1.7e6 };
        HeatPath::new(shape, Extent::Pack, material, location)
    }

    fn drive() -> Drive {
        let boundary = PiecewiseLinear::new(vec![0.0, 200.0, 600.0, 900.0], vec![290.0, 296.0, 296.0, 291.0]).unwrap();
        let ambient = PiecewiseLinear::new(vec![0.0, 150.0, 700.0], vec![291.0, 296.0, 288.0]).unwrap();
        Drive { boundary_k: boundary, ambient_k: Some(ambient) }
    }

    /// The largest differences of temperatures, rates, moments and their rates, each as a share of its largest value.
    fn differences(path: &HeatPath) -> [f64; 4] {
        let instants: Vec<Instant> = (0..240).map(|i| Instant::after(1.0 + 4.9 * i as f64)).collect();
        let exact = PackField::new(Pack::new(path).unwrap(), &drive()).at(&instants, Wanted::All);
        let stepped = SteppedField::new(path, &drive(), TOLERANCE_SHARE).unwrap().at(&instants, Wanted::All);
        let share =
            |a: &[f64], b: &[f64], scale: f64| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / scale;
        let largest = |a: &[f64]| a.iter().map(|v| v.abs()).fold(1e-300, f64::max);
        [
            share(&exact.temperature_k, &stepped.temperature_k, 6.0),
            share(&exact.rate_k_per_s, &stepped.rate_k_per_s, largest(&exact.rate_k_per_s)),
            share(&exact.axial_moment_k, &stepped.axial_moment_k, largest(&exact.axial_moment_k)),
            share(&exact.axial_moment_k_per_s, &stepped.axial_moment_k_per_s, largest(&exact.axial_moment_k_per_s)),
        ]
    }

    #[test]
    fn with_constant_conductivity_the_steps_follow_the_exact_modes() {
        let spool = Spool { heat_capacity_j_per_m2_k: 4000.0, contact_w_per_m2_k: 300.0, mount_w_per_m2_k: 20.0 };
        let heat = BoreHeat { power_w_per_m2: 50.0, time_constant_s: 300.0 };
        let flange = FlangeFilm { flange: Flange::Second, film_w_per_m2_k: 50.0 };
        let plain = path(Location::OuterLayer);
        let film = HeatPath { film_w_per_m2_k: Some(20.0), ..path(Location::Ambient) };
        let full = HeatPath { spool: Some(spool), bore_heat: Some(heat), ..film.clone() };
        let flanged = HeatPath { flange: Some(flange), ..full.clone() };
        for (name, path) in [("plain", plain), ("film", film), ("spool and heat", full), ("flange", flanged)] {
            let found = differences(&path);
            println!("{name}: temperatures, rates, moments, their rates {found:?}");
            assert!(found[0] < 1e-6 && found[1] < 2e-4 && found[2] < 1e-5 && found[3] < 1e-3, "{name}: {found:?}");
        }
    }

    #[test]
    fn a_steep_slope_of_the_conductivity_is_refused_and_a_small_one_changes_the_field_in_proportion() {
        let mut steep = path(Location::OuterLayer);
        steep.conductivity_slope_per_k = -0.5;
        assert!(matches!(
            SteppedField::new(&steep, &drive(), TOLERANCE_SHARE),
            Err(ThermalError::ConductivityNotPositive { .. })
        ));
        let instants: Vec<Instant> = (0..50).map(|i| Instant::after(20.0 * i as f64)).collect();
        let with_slope = |slope_per_k: f64| {
            let path = HeatPath { conductivity_slope_per_k: slope_per_k, ..path(Location::OuterLayer) };
            SteppedField::new(&path, &drive(), TOLERANCE_SHARE).unwrap().at(&instants, Wanted::All).temperature_k
        };
        let (none, one, two) = (with_slope(0.0), with_slope(1e-3), with_slope(2e-3));
        let change = |a: &[f64]| a.iter().zip(&none).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let ratio = change(&two) / change(&one);
        println!("doubling the slope changes temperatures {ratio:.4} times as much");
        assert!((ratio - 2.0).abs() < 0.02);
    }
}
