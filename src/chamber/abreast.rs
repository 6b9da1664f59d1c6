//! Several forward passes over one record at once: systems that differ in their numbers only, one in each SIMD lane.
//!
//! What [`super::filter::forward`] does for one system, in the same order. Here each number of mean and covariance is as many numbers
//! as there are lanes, so that columns need no padding and a covariance is worked out on one side of its diagonal only: derivatives,
//! which are most of a fit's passes, take two fifths less time.

// Loops over an index that the compiler knows the end of: iterators stay calls in functions as large as these.
#![allow(clippy::needless_range_loop)]

use super::arithmetic::{Arithmetic, Pass, dispatched};
use super::filter::{Innovation, MEASURED, Move, Row, SETTLED, SETTLED_ROWS, System, Values};
use super::sparse::{MOST_STATES, Sparse};

/// Passes that go abreast.
pub(super) const LANES: usize = 4;

/// A number of each system.
type Lanes = [f64; LANES];
/// Row-major and symmetric; what is beyond the model's states stays zero.
type Covariances<const N: usize> = [[Lanes; N]; N];

/// The innovations of systems of one structure, at most [`LANES`] of them, by the values of each.
pub(super) fn forward(systems: &[System], rows: &[Row], values: &[&Values]) -> Vec<Vec<Innovation>> {
    dispatched(Abreast { systems, rows, values })
}

struct Abreast<'a> {
    systems: &'a [System],
    rows: &'a [Row],
    values: &'a [&'a Values],
}

impl Pass for Abreast<'_> {
    type Output = Vec<Vec<Innovation>>;

    /// With the least number of states that has room, and as many sums at a time as there are registers for.
    #[inline(always)]
    fn run(self, arithmetic: impl Arithmetic) -> Self::Output {
        match self.systems[0].size {
            0..=12 => pass::<12, 12, 6>(arithmetic, &self),
            13..=16 => pass::<16, 8, 4>(arithmetic, &self),
            17..=20 => pass::<20, 10, 5>(arithmetic, &self),
            21..=24 => pass::<24, 12, 6>(arithmetic, &self),
            size => {
                assert!(size <= MOST_STATES, "a model has at most {MOST_STATES} states");
                pass::<MOST_STATES, 8, 8>(arithmetic, &self)
            }
        }
    }
}

/// What is in no system, which nothing divides by zero for.
const NO_SYSTEM: Lanes = [1.0; LANES];

/// A number of each system.
fn each<'a>(systems: &'a [System], number: impl Fn(&'a System) -> f64) -> Lanes {
    std::array::from_fn(|lane| systems.get(lane).map_or(NO_SYSTEM[lane], &number))
}

/// The entries of a matrix that are not zero in every system, row by row.
struct WideEntries {
    starts: Vec<usize>,
    columns: Vec<u32>,
    values: Vec<Lanes>,
}

impl WideEntries {
    fn new<'a>(systems: &'a [System], matrix: impl Fn(&'a System) -> &'a Sparse) -> Self {
        let mut all = Self { starts: vec![0], columns: Vec::new(), values: Vec::new() };
        for row in 0..matrix(&systems[0]).rows() {
            let begin = all.columns.len();
            for (lane, system) in systems.iter().enumerate() {
                for &(column, value) in matrix(system).row(row) {
                    let known = all.columns[begin..].iter().position(|c| *c as usize == column);
                    let place = known.map_or(all.columns.len(), |known| begin + known);
                    if known.is_none() {
                        all.columns.push(column as u32);
                        all.values.push([0.0; LANES]);
                    }
                    all.values[place][lane] = value;
                }
            }
            all.starts.push(all.columns.len());
        }
        all
    }

    #[inline(always)]
    fn row(&self, row: usize) -> impl Iterator<Item = (usize, &Lanes)> {
        let range = self.starts[row]..self.starts[row + 1];
        self.columns[range.clone()].iter().map(|c| *c as usize).zip(&self.values[range])
    }

    /// One row times a vector.
    #[inline(always)]
    fn dot(&self, arithmetic: impl Arithmetic, row: usize, vector: &[Lanes]) -> Lanes {
        let mut sum = [0.0; LANES];
        for (k, v) in self.row(row) {
            let x = &vector[k];
            for l in 0..LANES {
                sum[l] = arithmetic.add_product(v[l], x[l], sum[l]);
            }
        }
        sum
    }

    /// One row times some columns of X, from one on.
    #[inline(always)]
    fn sums<const N: usize, const B: usize>(
        &self,
        arithmetic: impl Arithmetic,
        row: usize,
        x: &Covariances<N>,
        from: usize,
    ) -> [Lanes; B] {
        let mut sums = [[0.0; LANES]; B];
        for (k, v) in self.row(row) {
            let Some(line) = x[k][from..].first_chunk::<B>() else { break };
            for b in 0..B {
                for l in 0..LANES {
                    sums[b][l] = arithmetic.add_product(v[l], line[b][l], sums[b][l]);
                }
            }
        }
        sums
    }

    /// One row times X.
    #[inline(always)]
    fn combine<const N: usize, const B: usize>(
        &self,
        arithmetic: impl Arithmetic,
        row: usize,
        x: &Covariances<N>,
    ) -> [Lanes; N] {
        let mut line = [[0.0; LANES]; N];
        for from in (0..N).step_by(B) {
            line[from..from + B].copy_from_slice(&self.sums::<N, B>(arithmetic, row, x, from));
        }
        line
    }
}

/// One step of time.
struct WideStep {
    phi: WideEntries,
    /// Everything but the trend's noise, and the trend's per unit of its density; in the order in which they are added.
    noises: Vec<[Lanes; 2]>,
}

/// Two symmetric matrices row by row up to the diagonal, in blocks of C columns.
fn in_blocks<const C: usize>(n: usize, noise: &[Lanes], trend_noise: &[Lanes]) -> Vec<[Lanes; 2]> {
    let mut blocks = Vec::with_capacity(n * (n + 2 * C) / 2);
    for i in 0..n {
        for j in 0..(i / C + 1) * C {
            let place = i * n + j;
            blocks.push(if j < n { [noise[place], trend_noise[place]] } else { [[0.0; LANES]; 2] });
        }
    }
    blocks
}

/// Systems of one structure, and what a pass over a record knows of each so far; C: columns of a covariance that are worked out at a time.
struct AbreastPass<'a, A, const N: usize, const C: usize> {
    arithmetic: A,
    systems: &'a [System],
    steps: Vec<WideStep>,
    measured: WideEntries,
    kept: WideEntries,
    trend: (Lanes, Lanes),
    mean: [Lanes; N],
    covariance: Box<Covariances<N>>,
    room: Box<Covariances<N>>,
    gains: [[Lanes; N]; MEASURED],
    variances: [Lanes; MEASURED],
}

impl<'a, A: Arithmetic, const N: usize, const C: usize> AbreastPass<'a, A, N, C> {
    fn new(arithmetic: A, systems: &'a [System]) -> Self {
        let n = systems[0].size;
        let wide = |matrix: &dyn Fn(&'a System) -> &'a [f64]| -> Vec<Lanes> {
            let mut wide = vec![NO_SYSTEM; n * n];
            for (lane, system) in systems.iter().enumerate() {
                wide.iter_mut().zip(matrix(system)).for_each(|(lanes, value)| lanes[lane] = *value);
            }
            wide
        };
        let step = |i: usize| WideStep {
            phi: WideEntries::new(systems, |s| &s.steps[i].phi),
            noises: in_blocks::<C>(n, &wide(&|s| &s.steps[i].noise), &wide(&|s| &s.steps[i].trend_noise)),
        };
        let mut mean = [[0.0; LANES]; N];
        let mut covariance = Box::new([[[0.0; LANES]; N]; N]);
        let begin = wide(&|s| &s.covariance);
        for i in 0..n {
            mean[i] = each(systems, |s| s.mean[i]);
            covariance[i][..n].copy_from_slice(&begin[i * n..(i + 1) * n]);
        }
        Self {
            arithmetic,
            systems,
            steps: (0..systems[0].steps.len()).map(step).collect(),
            measured: WideEntries::new(systems, |s| &s.rows),
            kept: WideEntries::new(systems, |s| &s.kept),
            trend: (each(systems, |s| s.trend.0), each(systems, |s| s.trend.1)),
            mean,
            covariance,
            room: Box::new([[[0.0; LANES]; N]; N]),
            gains: [[[0.0; LANES]; N]; MEASURED],
            variances: [[1.0; LANES]; MEASURED],
        }
    }

    /// The means up to a row.
    #[inline(always)]
    fn advance(&mut self, row: &Row) {
        for &movement in &row.moves {
            match movement {
                Move::Step(step) => {
                    let phi = &self.steps[step as usize].phi;
                    let mut next = [[0.0; LANES]; N];
                    for i in 0..self.systems[0].size {
                        next[i] = phi.dot(self.arithmetic, i, &self.mean);
                    }
                    self.mean = next;
                }
                Move::Keep(slot) => {
                    for &(state, kept) in &self.systems[0].keeps[slot as usize] {
                        self.mean[state] = self.kept.dot(self.arithmetic, kept, &self.mean);
                    }
                }
                Move::Kink(_) => {}
            }
        }
    }

    /// The covariances up to a row.
    #[inline(always)]
    fn predict<const B: usize>(&mut self, row: &Row) {
        if !row.is_kinked_within() {
            let slope = self.systems[0].slope;
            self.covariance[slope][slope].iter_mut().for_each(|own| *own += row.kink);
        }
        for &movement in &row.moves {
            match movement {
                Move::Step(step) => self.step::<B>(step, row.bend),
                Move::Keep(slot) => self.keep_window::<B>(slot),
                Move::Kink(place) => self.kink(place, row.kink),
            }
        }
    }

    #[inline(always)]
    fn kink(&mut self, place: u16, variance: f64) {
        let n = self.systems[0].size;
        let change = |i: usize| each(self.systems, |s| s.kinks[place as usize][i]);
        let changes: [Lanes; N] = std::array::from_fn(|i| if i < n { change(i) } else { [0.0; LANES] });
        for i in 0..n {
            for j in 0..n {
                for l in 0..LANES {
                    self.covariance[i][j][l] += variance * changes[i][l] * changes[j][l];
                }
            }
        }
    }

    /// P ← Φ P Φᵀ + Q, columns in blocks: first P Φᵀ, and of the second product what is left of the diagonal, where modes, whose rows have
    /// most entries, have fewest columns.
    #[inline(always)]
    fn step<const B: usize>(&mut self, step: u16, bend: f64) {
        let n = self.systems[0].size;
        let WideStep { phi, noises } = &self.steps[step as usize];
        let density: Lanes = std::array::from_fn(|l| self.trend.0[l] + bend * (self.trend.1[l] - self.trend.0[l]));
        for i in 0..n {
            for from in (0..N).step_by(B) {
                let sums = phi.sums::<N, B>(self.arithmetic, i, &self.covariance, from);
                for b in 0..B {
                    self.room[from + b][i] = sums[b];
                }
            }
        }
        let mut noises = noises.chunks_exact(C);
        for i in 0..n {
            for from in (0..=i).step_by(C) {
                let mut sums = phi.sums::<N, C>(self.arithmetic, i, &self.room, from);
                let Some(added) = noises.next() else { break };
                for b in 0..C {
                    let [noise, trend_noise] = &added[b];
                    for l in 0..LANES {
                        sums[b][l] += noise[l] + density[l] * trend_noise[l];
                    }
                    self.covariance[i][from + b] = sums[b];
                    self.covariance[from + b][i] = sums[b];
                }
            }
        }
    }

    #[inline(always)]
    fn keep_window<const B: usize>(&mut self, slot: u8) {
        let n = self.systems[0].size;
        let keeps = &self.systems[0].keeps[slot as usize];
        for (place, &(state, row)) in keeps.iter().enumerate() {
            // Cov(c·x, x), the state's own former content being forgotten.
            let mut along = self.kept.combine::<N, B>(self.arithmetic, row, &self.covariance);
            along[state] = [0.0; LANES];
            for &(other, _) in &keeps[place + 1..] {
                along[other] = [0.0; LANES];
            }
            let own = self.kept.dot(self.arithmetic, row, &along);
            for i in 0..n {
                self.covariance[i][state] = along[i];
                self.covariance[state][i] = along[i];
            }
            self.covariance[state][state] = own;
        }
    }

    /// Gain and variance of one measurement, and what is left of the covariances; the variance's largest relative change.
    #[inline(always)]
    fn weigh<const B: usize>(&mut self, m: usize, h: usize, row: &Row) -> f64 {
        let n = self.systems[0].size;
        let along = self.measured.combine::<N, B>(self.arithmetic, h, &self.covariance);
        let mut variance = self.measured.dot(self.arithmetic, h, &along);
        let noises = each(self.systems, |s| s.noise(m, row));
        let mut change: f64 = 0.0;
        for l in 0..LANES {
            variance[l] += noises[l];
            if l < self.systems.len() {
                change = change.max((variance[l] / self.variances[m][l] - 1.0).abs());
            }
        }
        for i in 0..n {
            let own: Lanes = std::array::from_fn(|l| along[i][l] / variance[l]);
            self.gains[m][i] = own;
            for j in i..n {
                let mut left = self.covariance[i][j];
                for l in 0..LANES {
                    left[l] = self.arithmetic.add_product(-own[l], along[j][l], left[l]);
                }
                self.covariance[i][j] = left;
                self.covariance[j][i] = left;
            }
        }
        self.variances[m] = variance;
        change
    }

    /// Takes one measurement in; its innovations.
    #[inline(always)]
    fn take_in(&mut self, m: usize, h: usize, values: Lanes) -> Lanes {
        let expected = self.measured.dot(self.arithmetic, h, &self.mean);
        let innovation: Lanes = std::array::from_fn(|l| values[l] - expected[l]);
        for i in 0..N {
            for l in 0..LANES {
                self.mean[i][l] = self.arithmetic.add_product(self.gains[m][i][l], innovation[l], self.mean[i][l]);
            }
        }
        innovation
    }
}

#[inline(always)]
fn pass<const N: usize, const B: usize, const C: usize>(
    arithmetic: impl Arithmetic,
    asked: &Abreast,
) -> Vec<Vec<Innovation>> {
    let rows = asked.rows;
    let mut pass = AbreastPass::<_, N, C>::new(arithmetic, asked.systems);
    let mut found: Vec<Vec<Innovation>> = asked.systems.iter().map(|_| Vec::with_capacity(2 * rows.len())).collect();
    let mut settled = 0;
    for (k, row) in rows.iter().enumerate() {
        let alike = k > 0 && *row == rows[k - 1];
        if !alike {
            settled = 0;
        }
        let frozen = settled >= SETTLED_ROWS;
        pass.advance(row);
        if !frozen {
            pass.predict::<B>(row);
        }
        let mut change: f64 = 0.0;
        for (m, index) in row.measured.iter().enumerate() {
            let Some(h) = *index else { continue };
            if !frozen {
                change = change.max(pass.weigh::<B>(m, h as usize, row));
            }
            let values = std::array::from_fn(|l| asked.values.get(l).map_or(0.0, |v| v.of[m][k]));
            let innovations = pass.take_in(m, h as usize, values);
            for (l, own) in found.iter_mut().enumerate() {
                own.push(Innovation { value: innovations[l], variance: pass.variances[m][l] });
            }
        }
        if !frozen {
            settled = if alike && change < SETTLED { settled + 1 } else { 0 };
        }
    }
    found
}
