//! A heat network whose conductivity depends on temperature, stepped in time.
//!
//! ```text
//! T(h) = (I − h A_r)⁻¹ (I − h A_z)⁻¹ (T + h b),   A, b at the conductivities of the step's start
//! T₁₁ = T(h), T₂₁ = T(h/2)², T₃₁ = T(h/4)⁴;   T_{k,j+1} = T_{k,j} + (T_{k,j} − T_{k−1,j}) / (2^j − 1)
//! ```
//!
//! Linearly implicit Euler, factorised by direction, extrapolated to third order; the two last columns differ by an
//! estimate of the error.
//!
//! # Source
//! P. Deuflhard, SIAM Review 27 (1985) 505, sections 3 and 4.

use super::network::Network;

/// Longest step where a flange is heated, in units of the time that heat takes from one slice to the next: the product
/// of two directions' operators is not their sum.
const FLANGE_STEP: f64 = 16.0;

/// What drives the network at one time.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Drive {
    pub(crate) rise_k: f64,
    pub(crate) rate_k_per_s: f64,
    pub(crate) heat_w_per_m2: f64,
}

/// −back·x_{i−1} + diagonal·x_i − ahead·x_{i+1} = known.
#[derive(Debug, Clone, Copy)]
struct Row {
    back: f64,
    ahead: f64,
    diagonal: f64,
    known: f64,
}

/// Layer means of temperature, rate, and first axial moments of the rate.
pub(super) type Means = (Vec<f64>, Vec<f64>, Vec<f64>);

impl Network {
    fn slices(&self) -> usize {
        self.axis.as_ref().map_or(1, |axis| axis.slices)
    }

    fn conductivity(&self, rise_k: f64) -> f64 {
        self.conductivity_w_per_m_k * (1.0 + self.slope_per_k * rise_k)
    }

    /// Conductance from node i outwards in a slice: the material of a link is as warm as the cells at its ends.
    fn link(&self, slice: &[f64], i: usize, drive: Drive) -> f64 {
        let rise_k = match slice.get(i + 1) {
            Some(next_k) if i < self.spool => *next_k,
            Some(next_k) => 0.5 * (slice[i] + next_k),
            None if self.outermost_is_drive => 0.5 * (slice[i] + drive.rise_k),
            None => slice[i],
        };
        self.links[i].conductance(self.conductivity(rise_k))
    }

    /// Exchange of a node with the same node of the next slice [1/s]; the spool does not conduct along the axis.
    fn along(&self, node: usize, here_k: f64, there_k: f64) -> f64 {
        let per_s = self.axis.as_ref().map_or(0.0, |axis| axis.exchange_per_s);
        if node < self.spool { 0.0 } else { per_s * (1.0 + self.slope_per_k * 0.5 * (here_k + there_k)) }
    }

    /// Exchange of a node with the air behind a heated flange [1/s].
    fn film_at(&self, slice: usize, node: usize, rise_k: f64) -> f64 {
        match &self.axis {
            Some(axis) if node >= self.spool => axis.film_per_s(slice, self.conductivity(rise_k)),
            _ => 0.0,
        }
    }

    /// Heat that enters node i from outside, per its temperature and in all.
    fn outside(&self, i: usize, drive: Drive) -> (f64, f64) {
        if i > 0 {
            return (0.0, 0.0);
        }
        (self.mount, self.mount * drive.rise_k + drive.heat_w_per_m2 * self.bore_radius_m)
    }

    /// dT/dt of every node.
    fn slope(&self, state: &[f64], drive: Drive) -> Vec<f64> {
        let (n, slices) = (self.nodes(), self.slices());
        let mut out = vec![0.0; state.len()];
        for (m, slice) in state.chunks_exact(n).enumerate() {
            let mut inflow = 0.0;
            for i in 0..n {
                let next_k = slice.get(i + 1).copied().unwrap_or(drive.rise_k);
                let (per_k, heat) = self.outside(i, drive);
                let outflow = self.link(slice, i, drive) * (slice[i] - next_k);
                let mut change = (inflow - outflow + heat - per_k * slice[i]) / self.capacity[i];
                inflow = outflow;
                for neighbour in [m.wrapping_sub(1), m + 1] {
                    if neighbour < slices {
                        let there_k = state[neighbour * n + i];
                        change += self.along(i, slice[i], there_k) * (there_k - slice[i]);
                    }
                }
                out[m * n + i] = change + self.film_at(m, i, slice[i]) * (drive.rise_k - slice[i]);
            }
        }
        out
    }

    /// One implicit step, with the conductivities of its start.
    fn euler(&self, from: &[f64], dt_s: f64, before: Drive, drive: Drive) -> Vec<f64> {
        let (n, slices) = (self.nodes(), self.slices());
        let mut next = from.to_vec();
        let mut rows = Vec::with_capacity(n.max(slices));
        if slices > 1 {
            for i in 0..n {
                rows.clear();
                for m in 0..slices {
                    let here_k = from[m * n + i];
                    let exchange = |m: usize| dt_s * self.along(i, here_k, from[m * n + i]);
                    let back = if m > 0 { exchange(m - 1) } else { 0.0 };
                    let ahead = if m + 1 < slices { exchange(m + 1) } else { 0.0 };
                    let film = dt_s * self.film_at(m, i, here_k);
                    let known = here_k + film * drive.rise_k;
                    rows.push(Row { back, ahead, diagonal: 1.0 + back + ahead + film, known });
                }
                tridiagonal(&mut rows, |m, value| next[m * n + i] = value);
            }
        }
        for (line, warm) in next.chunks_exact_mut(n).zip(from.chunks_exact(n)) {
            rows.clear();
            let mut inner = 0.0;
            for (i, from_k) in line.iter().enumerate() {
                let share = dt_s / self.capacity[i];
                let outer = self.link(warm, i, before);
                let (back, ahead) = (share * inner, share * outer);
                let (per_k, heat) = self.outside(i, drive);
                let known = from_k + share * heat + if i + 1 == n { ahead * drive.rise_k } else { 0.0 };
                rows.push(Row { back, ahead, diagonal: 1.0 + back + ahead + share * per_k, known });
                inner = outer;
            }
            tridiagonal(&mut rows, |i, value| line[i] = value);
        }
        next
    }

    /// As far as `dt_s`, to third order in time.
    fn step(&self, from: &[f64], at_s: f64, dt_s: f64, drive: &dyn Fn(f64) -> Drive) -> Vec<f64> {
        let [whole, halves, quarters] = [1, 2, 4].map(|parts| {
            let part_s = dt_s / f64::from(parts);
            (0..parts).fold(from.to_vec(), |state, part| {
                let start_s = at_s + f64::from(part) * part_s;
                self.euler(&state, part_s, drive(start_s), drive(start_s + part_s))
            })
        });
        let extrapolated = whole.iter().zip(&halves).zip(&quarters).map(|((w, h), q)| {
            let (first, second) = (2.0 * h - w, 2.0 * q - h);
            second + (second - first) / 3.0
        });
        extrapolated.collect()
    }

    /// A network that has not warmed yet.
    pub(crate) fn still(&self) -> Vec<f64> {
        vec![0.0; self.nodes() * self.slices()]
    }

    /// From one time to a later one, in as many steps as it takes; `closer`: the longest step is so many times shorter.
    pub(crate) fn advance(
        &self,
        nodes: &mut Vec<f64>,
        from_s: f64,
        to_s: f64,
        closer: usize,
        drive: &dyn Fn(f64) -> Drive,
    ) {
        let longest = FLANGE_STEP / closer as f64;
        let longest_s = self.axis.as_ref().map_or(f64::INFINITY, |axis| longest / axis.exchange_per_s);
        let parts = ((to_s - from_s) / longest_s).ceil().max(1.0);
        let dt_s = (to_s - from_s) / parts;
        for i in 0..parts as usize {
            *nodes = self.step(nodes, from_s + i as f64 * dt_s, dt_s, drive);
        }
    }

    pub(crate) fn means(&self, nodes: &[f64], drive: Drive) -> Means {
        let (n, slices) = (self.nodes(), self.slices());
        let slopes = self.slope(nodes, drive);
        let even = vec![1.0 / slices as f64; slices];
        let moments = self.axis.as_ref().map(|axis| axis.moment_weights());
        let of = |values: &[f64], weights: &[f64], layer: usize| -> f64 {
            let slice_mean = |m: usize| self.shares(layer).map(|(i, share)| share * values[m * n + i]).sum::<f64>();
            weights.iter().enumerate().map(|(m, w)| w * slice_mean(m)).sum()
        };
        let solved = self.solved_layers();
        let given = usize::from(self.outermost_is_drive);
        let list = |f: &dyn Fn(usize) -> f64, last: f64| -> Vec<f64> {
            (0..solved).map(f).chain(std::iter::repeat_n(last, given)).collect()
        };
        (
            list(&|j| of(nodes, &even, j), drive.rise_k),
            list(&|j| of(&slopes, &even, j), drive.rate_k_per_s),
            moments.map_or_else(Vec::new, |weights| list(&|j| of(&slopes, &weights, j), 0.0)),
        )
    }
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
