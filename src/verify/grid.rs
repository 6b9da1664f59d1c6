//! A pack on a grid of this module's own, stepped in time.
//!
//! Nodes on the bore, on layers' middles and on the surface (four intervals a layer; the emitter has two cells a
//! layer), on the flanges where one is heated. Backward Euler, factorised by direction, with Richardson extrapolation;
//! a conductivity that depends on temperature is taken at the step's end by repetition.

use super::heat::State;
use super::physics::Physics;
use crate::rate::CoilModel;

/// Intervals a layer; even, so that a layer's middle is a node.
const NODES: usize = 4;
/// Nodes from flange to flange; odd, for Simpson's rule.
const SLICES: usize = 17;
/// Longest step where a flange is heated, in units of the time that heat takes from one slice to the next: the product
/// of two directions' operators is not their sum.
const FLANGE_STEP: f64 = 8.0;

/// What drives the pack at one time.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Drive {
    pub rise_k: f64,
    pub rate_k_per_s: f64,
    pub heat_w_per_m2: f64,
}

/// A pack on its grid; everything per radian, and per height where no flange is heated.
#[derive(Debug)]
pub(super) struct Grid {
    layers: usize,
    /// The spool's node, if there is one, comes first.
    spool: usize,
    capacity: Vec<f64>,
    /// Between node i and the next one; the last leads to the drive.
    links: Vec<f64>,
    /// Whether a link goes through the pack's material.
    through_pack: Vec<bool>,
    mount: f64,
    bore_radius_m: f64,
    step_m: f64,
    outermost_is_drive: bool,
    slope_per_k: f64,
    slices: usize,
    /// k/(ρc Δz²) [1/s].
    axial_per_s: f64,
    /// What the factorised step bears.
    longest_step_s: f64,
    /// Film over the heat capacity of the half cell at the flange [1/s]; and whether it is the first flange.
    flange: Option<(f64, bool)>,
}

impl Grid {
    pub fn new(model: &CoilModel, physics: &Physics, height_m: f64) -> Self {
        let coil = &model.coil;
        let (layers, bore_m, pitch_m) = (coil.layers(), coil.bore_radius_m(), coil.radial_pitch_m());
        let (k, heat_capacity) = (physics.conductivity_w_per_m_k, physics.heat_capacity_j_per_m3_k);
        let step_m = pitch_m / NODES as f64;
        let outermost_is_drive = !physics.driven_from_outside;
        // The node at which the temperature is given, unless a film lies outside it.
        let last = if outermost_is_drive { (2 * layers - 1) * NODES / 2 } else { layers * NODES };
        let solved = if physics.film_w_per_m2_k.is_some() && !outermost_is_drive { last + 1 } else { last };
        let (mut capacity, mut links, mut through_pack) = (Vec::new(), Vec::new(), Vec::new());
        if let Some(spool) = physics.spool {
            capacity.push(spool.heat_capacity_j_per_m2_k * bore_m);
            links.push(spool.contact_w_per_m2_k * bore_m);
            through_pack.push(false);
        }
        let radius_m = |i: f64| bore_m + i * step_m;
        for i in 0..solved {
            let inner_m = radius_m((i as f64 - 0.5).max(0.0));
            let outer_m = radius_m((i as f64 + 0.5).min(last as f64));
            capacity.push(heat_capacity * 0.5 * (outer_m + inner_m) * (outer_m - inner_m));
            if i < last {
                links.push(k * radius_m(i as f64 + 0.5) / step_m);
                through_pack.push(true);
            } else {
                links.push(physics.film_w_per_m2_k.unwrap_or(0.0) * radius_m(last as f64));
                through_pack.push(false);
            }
        }
        let slices = if physics.flange.is_some() { SLICES } else { 1 };
        let spacing_m = height_m / (SLICES - 1) as f64;
        Self {
            layers,
            spool: usize::from(physics.spool.is_some()),
            capacity,
            links,
            through_pack,
            mount: physics.spool.map_or(0.0, |s| s.mount_w_per_m2_k * bore_m),
            bore_radius_m: bore_m,
            step_m,
            outermost_is_drive,
            slope_per_k: physics.conductivity_slope_per_k,
            slices,
            axial_per_s: k / (heat_capacity * spacing_m * spacing_m),
            longest_step_s: if slices > 1 {
                FLANGE_STEP * spacing_m * spacing_m * heat_capacity / k
            } else {
                f64::INFINITY
            },
            flange: physics.flange.map(|f| (f.film_w_per_m2_k / (0.5 * spacing_m * heat_capacity), f.is_first)),
        }
    }

    fn nodes(&self) -> usize {
        self.capacity.len()
    }

    fn factor(&self, rise_k: f64) -> f64 {
        1.0 + self.slope_per_k * rise_k
    }

    /// Conductance from node i outwards, in a slice that is so warm.
    fn link(&self, slice: &[f64], i: usize, drive: Drive) -> f64 {
        if self.slope_per_k == 0.0 || !self.through_pack[i] {
            return self.links[i];
        }
        let next_k = slice.get(i + 1).copied().unwrap_or(drive.rise_k);
        self.links[i] * self.factor(0.5 * (slice[i] + next_k))
    }

    /// Heat that enters node i from outside the pack, per its temperature and in all.
    fn outside(&self, i: usize, drive: Drive) -> (f64, f64) {
        let mount = if i == 0 && self.spool == 1 { self.mount } else { 0.0 };
        let heat = if i == 0 { drive.heat_w_per_m2 * self.bore_radius_m } else { 0.0 };
        (mount, mount * drive.rise_k + heat)
    }

    /// Rate of exchange along the axis between two neighbours of radial node i [1/s].
    fn along(&self, here_k: f64, there_k: f64) -> f64 {
        self.axial_per_s * self.factor(0.5 * (here_k + there_k))
    }

    /// The flange's film at a slice, if it is the heated one [1/s].
    fn film_at(&self, slice: usize) -> f64 {
        match self.flange {
            Some((film, true)) if slice == 0 => film,
            Some((film, false)) if slice + 1 == self.slices => film,
            _ => 0.0,
        }
    }

    /// dT/dt of every node.
    fn slope(&self, state: &[f64], drive: Drive) -> Vec<f64> {
        let n = self.nodes();
        let mut out = vec![0.0; state.len()];
        for (m, slice) in state.chunks_exact(n).enumerate() {
            for i in 0..n {
                let next_k = slice.get(i + 1).copied().unwrap_or(drive.rise_k);
                let (per_k, heat) = self.outside(i, drive);
                let mut flow = self.link(slice, i, drive) * (next_k - slice[i]) + heat - per_k * slice[i];
                if i > 0 {
                    flow -= self.link(slice, i - 1, drive) * (slice[i] - slice[i - 1]);
                }
                out[m * n + i] = flow / self.capacity[i];
                if i >= self.spool && self.slices > 1 {
                    let ends = if m == 0 || m + 1 == self.slices { 2.0 } else { 1.0 };
                    for other in [m.wrapping_sub(1), m + 1] {
                        if other < self.slices {
                            let there_k = state[other * n + i];
                            out[m * n + i] += ends * self.along(slice[i], there_k) * (there_k - slice[i]);
                        }
                    }
                    out[m * n + i] += self.film_at(m) * (drive.rise_k - slice[i]);
                }
            }
        }
        out
    }

    /// One step of backward Euler, conductivities as in `warm`.
    fn euler(&self, from: &[f64], warm: &[f64], dt_s: f64, drive: Drive) -> Vec<f64> {
        let n = self.nodes();
        let mut next = from.to_vec();
        let mut rows = Vec::with_capacity(n.max(self.slices));
        if self.slices > 1 {
            for i in self.spool..n {
                self.axis_rows(&mut rows, from, warm, i, dt_s, drive);
                tridiagonal(&mut rows, |m, value| next[m * n + i] = value);
            }
        }
        for (line, slice) in next.chunks_exact_mut(n).zip(warm.chunks_exact(n)) {
            self.radius_rows(&mut rows, line, slice, dt_s, drive);
            tridiagonal(&mut rows, |i, value| line[i] = value);
        }
        next
    }

    fn radius_rows(&self, rows: &mut Vec<Row>, from: &[f64], warm: &[f64], dt_s: f64, drive: Drive) {
        let n = self.nodes();
        rows.clear();
        let mut inner = 0.0;
        for (i, from_k) in from.iter().enumerate() {
            let share = dt_s / self.capacity[i];
            let outer = self.link(warm, i, drive);
            let (back, ahead) = (share * inner, share * outer);
            let (per_k, heat) = self.outside(i, drive);
            let known = from_k + share * heat + if i + 1 == n { ahead * drive.rise_k } else { 0.0 };
            rows.push(Row { back, ahead, diagonal: 1.0 + back + ahead + share * per_k, known });
            inner = outer;
        }
    }

    fn axis_rows(&self, rows: &mut Vec<Row>, from: &[f64], warm: &[f64], node: usize, dt_s: f64, drive: Drive) {
        let (n, last) = (self.nodes(), self.slices - 1);
        rows.clear();
        let at = |m: usize| warm[m * n + node];
        for m in 0..=last {
            let ends = if m == 0 || m == last { 2.0 } else { 1.0 };
            let back = if m > 0 { dt_s * ends * self.along(at(m), at(m - 1)) } else { 0.0 };
            let ahead = if m < last { dt_s * ends * self.along(at(m), at(m + 1)) } else { 0.0 };
            let film = dt_s * self.film_at(m);
            let known = from[m * n + node] + film * drive.rise_k;
            rows.push(Row { back, ahead, diagonal: 1.0 + back + ahead + film, known });
        }
    }

    /// As far as `dt_s`, of second order in time.
    fn step(&self, from: &[f64], at_s: f64, dt_s: f64, drive: &dyn Fn(f64) -> Drive) -> Vec<f64> {
        let implicit = |from: &[f64], at_s: f64, dt_s: f64| {
            let drive = drive(at_s + dt_s);
            let mut next = self.euler(from, from, dt_s, drive);
            if self.slope_per_k != 0.0 {
                for _ in 0..2 {
                    next = self.euler(from, &next, dt_s, drive);
                }
            }
            next
        };
        let whole = implicit(from, at_s, dt_s);
        let half = implicit(from, at_s, 0.5 * dt_s);
        let halves = implicit(&half, at_s + 0.5 * dt_s, 0.5 * dt_s);
        halves.iter().zip(&whole).map(|(h, w)| 2.0 * h - w).collect()
    }

    pub fn state(&self, nodes: &[f64], time_s: f64, drive: Drive) -> State {
        let n = self.nodes();
        let slopes = self.slope(nodes, drive);
        let last = self.slices - 1;
        // Simpson's rule over the height, for the mean and for the first moment.
        let simpson = |m: usize| match m {
            _ if last == 0 => 1.0,
            m if m == 0 || m == last => 1.0 / (3.0 * last as f64),
            m if m % 2 == 1 => 4.0 / (3.0 * last as f64),
            _ => 2.0 / (3.0 * last as f64),
        };
        // Over a layer's volume, by Simpson's rule again; the surface that carries the drive is no node.
        let across = |values: &[f64], slice: usize, j: usize, given: f64| {
            let first = j * NODES;
            let parts = (0..=NODES).map(|i| {
                let weight = if i == 0 || i == NODES {
                    1.0
                } else if i % 2 == 1 {
                    4.0
                } else {
                    2.0
                };
                let radius_m = self.bore_radius_m + self.step_m * (first + i) as f64;
                let node = self.spool + first + i;
                let value = if node < n { values[slice * n + node] } else { given };
                (weight * radius_m, weight * radius_m * value)
            });
            let (volume, sum) = parts.fold((0.0, 0.0), |(v, s), (a, b)| (v + a, s + b));
            sum / volume
        };
        let over_height = |values: &[f64], j: usize, given: f64, arm: &dyn Fn(usize) -> f64| {
            (0..self.slices).map(|m| simpson(m) * arm(m) * across(values, m, j, given)).sum::<f64>()
        };
        let height = |m: usize| m as f64 / last.max(1) as f64 - 0.5;
        let is_drive = |j: usize| self.outermost_is_drive && j + 1 == self.layers;
        let layers = 0..self.layers;
        State {
            time_s,
            rise_k: layers
                .clone()
                .map(|j| if is_drive(j) { drive.rise_k } else { over_height(nodes, j, drive.rise_k, &|_| 1.0) })
                .collect(),
            rate_k_per_s: layers
                .clone()
                .map(|j| {
                    if is_drive(j) { drive.rate_k_per_s } else { over_height(&slopes, j, drive.rate_k_per_s, &|_| 1.0) }
                })
                .collect(),
            moment_k_per_s: if last == 0 {
                Vec::new()
            } else {
                layers
                    .map(|j| if is_drive(j) { 0.0 } else { over_height(&slopes, j, drive.rate_k_per_s, &height) })
                    .collect()
            },
            ambient_rise_k: drive.rise_k,
            ambient_rate_k_per_s: drive.rate_k_per_s,
        }
    }

    /// A pack that has not warmed yet.
    pub fn still(&self) -> Vec<f64> {
        vec![0.0; self.nodes() * self.slices]
    }

    /// From one time to a later one, in as many steps as it takes.
    pub fn advance(&self, nodes: &mut Vec<f64>, from_s: f64, to_s: f64, drive: &dyn Fn(f64) -> Drive) {
        let parts = ((to_s - from_s) / self.longest_step_s).ceil().max(1.0);
        let dt_s = (to_s - from_s) / parts;
        for i in 0..parts as usize {
            *nodes = self.step(nodes, from_s + i as f64 * dt_s, dt_s, drive);
        }
    }

    /// The states at times that begin with the start, at which the pack is as warm as the drive.
    pub fn march(&self, times_s: &[f64], drive: &dyn Fn(f64) -> Drive) -> Vec<State> {
        let mut nodes = self.still();
        let mut states = vec![self.state(&nodes, times_s[0], drive(times_s[0]))];
        for times in times_s.windows(2) {
            self.advance(&mut nodes, times[0], times[1], drive);
            states.push(self.state(&nodes, times[1], drive(times[1])));
        }
        states
    }
}

/// −back·x_{i−1} + diagonal·x_i − ahead·x_{i+1} = known.
#[derive(Debug, Clone, Copy)]
struct Row {
    back: f64,
    ahead: f64,
    diagonal: f64,
    known: f64,
}

fn tridiagonal(rows: &mut [Row], mut solved: impl FnMut(usize, f64)) {
    for i in 1..rows.len() {
        let before = rows[i - 1];
        let share = rows[i].back / before.diagonal;
        rows[i].diagonal -= share * before.ahead;
        rows[i].known += share * before.known;
    }
    let mut after = 0.0;
    for (i, row) in rows.iter().enumerate().rev() {
        after = (row.known + row.ahead * after) / row.diagonal;
        solved(i, after);
    }
}
