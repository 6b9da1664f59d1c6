//! A linear map over samples, kept so that a small change of its coefficients is cheap to judge.
//!
//! ```text
//! v_s = c_s + Σ_k x_k D_ks
//! ```
//!
//! | symbol | meaning | in code |
//! |---|---|---|
//! | v_s | value at sample s | `SampleValues::values` |
//! | x_k | coefficient of column k | given as changes Δx_k |
//! | D_k | column k, contiguous over samples | `Columns::column` |
//!
//! A move changes a few x_k. Its cost is judged block by block against a limit that was drawn before, and the
//! judging ends with the first block that is over the limit: most moves are refused after one block that stays in the
//! first-level cache. Only an accepted move passes over all samples: (k + 2) · 8 bytes and 2k + 2 operations a sample
//! for k changed columns, which is bound by cache bandwidth.

/// Samples judged at once; values, changed columns and the result of a block fit the first-level cache.
pub(crate) const BLOCK: usize = 64;

/// How the values of all samples make one cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Norm {
    /// max |v|
    Largest,
    /// √(mean v²)
    RootMeanSquare,
    /// Σ |v|
    Sum,
}

impl Norm {
    /// The cost that a running total stands for.
    fn finish(self, total: f64, samples: usize) -> f64 {
        match self {
            Norm::Largest | Norm::Sum => total,
            Norm::RootMeanSquare => (total / samples as f64).sqrt(),
        }
    }

    /// The largest running total that is still within a limit on the cost.
    fn total_limit(self, limit: f64, samples: usize) -> f64 {
        match self {
            Norm::Largest | Norm::Sum => limit,
            Norm::RootMeanSquare if limit < 0.0 => -1.0,
            Norm::RootMeanSquare => limit * limit * samples as f64,
        }
    }

    /// Adds a block to a running total. Eight lanes, so that the order of additions is the same on every machine.
    #[inline]
    fn gather(self, total: f64, block: &[f64]) -> f64 {
        let mut lanes = [0.0_f64; 8];
        match self {
            Norm::Largest => {
                for chunk in block.chunks_exact(8) {
                    for (lane, v) in lanes.iter_mut().zip(chunk) {
                        let size = v.abs();
                        *lane = if size > *lane { size } else { *lane };
                    }
                }
                lanes.iter().fold(total, |a, &b| if b > a { b } else { a })
            }
            Norm::RootMeanSquare => {
                for chunk in block.chunks_exact(8) {
                    for (lane, v) in lanes.iter_mut().zip(chunk) {
                        *lane += v * v;
                    }
                }
                total + lanes.iter().sum::<f64>()
            }
            Norm::Sum => {
                for chunk in block.chunks_exact(8) {
                    for (lane, v) in lanes.iter_mut().zip(chunk) {
                        *lane += v.abs();
                    }
                }
                total + lanes.iter().sum::<f64>()
            }
        }
    }

    /// The cost of given values.
    pub(crate) fn of(self, values: &[f64]) -> f64 {
        let total = match self {
            Norm::Largest => values.iter().map(|v| v.abs()).fold(0.0, f64::max),
            Norm::RootMeanSquare => values.iter().map(|v| v * v).sum(),
            Norm::Sum => values.iter().map(|v| v.abs()).sum(),
        };
        self.finish(total, values.len())
    }
}

/// Columns over samples, padded with samples that are always zero to a whole number of blocks.
///
/// # Shapes
/// `data` holds one column after the other, each `padded` long.
#[derive(Debug, Clone, PartialEq)]
pub struct Columns {
    samples: usize,
    padded: usize,
    constant: Vec<f64>,
    data: Vec<f64>,
}

impl Columns {
    /// From the constant and the columns, each with one entry a sample.
    ///
    /// # Panics
    /// Columns of unequal length are a bug of the caller.
    pub(crate) fn new(constant: &[f64], columns: &[Vec<f64>]) -> Self {
        let samples = constant.len();
        let padded = samples.next_multiple_of(BLOCK).max(BLOCK);
        let pad = |column: &[f64]| {
            assert_eq!(column.len(), samples, "every column has one entry a sample");
            let mut full = column.to_vec();
            full.resize(padded, 0.0);
            full
        };
        Self { samples, padded, constant: pad(constant), data: columns.iter().flat_map(|c| pad(c)).collect() }
    }

    pub(crate) fn samples(&self) -> usize {
        self.samples
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.data.len() / self.padded
    }

    /// Without the padding.
    pub fn column(&self, index: usize) -> &[f64] {
        &self.data[index * self.padded..index * self.padded + self.samples]
    }

    /// Without the padding.
    pub fn constant(&self) -> &[f64] {
        &self.constant[..self.samples]
    }

    /// The same map with the samples in another order, or fewer of them.
    pub(crate) fn select(&self, samples: &[usize]) -> Self {
        let pick = |column: &[f64]| samples.iter().map(|&s| column[s]).collect::<Vec<f64>>();
        let columns: Vec<Vec<f64>> = (0..self.count()).map(|k| pick(self.column(k))).collect();
        Self::new(&pick(self.constant()), &columns)
    }

    #[inline]
    fn block(&self, column: usize, from: usize) -> &[f64] {
        let start = column * self.padded + from;
        &self.data[start..start + BLOCK]
    }

    /// All values for given coefficients, padding included.
    fn padded_values(&self, coefficients: &[f64]) -> Vec<f64> {
        let mut values = self.constant.clone();
        for (index, &coefficient) in coefficients.iter().enumerate().filter(|(_, c)| **c != 0.0) {
            let column = &self.data[index * self.padded..(index + 1) * self.padded];
            for (v, d) in values.iter_mut().zip(column) {
                *v += coefficient * d;
            }
        }
        values
    }

    /// All values for given coefficients.
    pub fn values(&self, coefficients: &[f64]) -> Vec<f64> {
        let mut values = self.padded_values(coefficients);
        values.truncate(self.samples);
        values
    }
}

/// What judging moves has cost: counted, so that tests can bound it on any machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Work {
    /// Moves judged.
    pub moves: u64,
    /// Moves that were made.
    pub accepted: u64,
    /// Sum over moves of the samples looked at, padding included.
    pub samples: u64,
}

impl std::ops::AddAssign for Work {
    fn add_assign(&mut self, other: Self) {
        self.moves += other.moves;
        self.accepted += other.accepted;
        self.samples += other.samples;
    }
}

/// A change of one coefficient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Change {
    pub(crate) column: usize,
    pub(crate) by: f64,
}

/// The values of all samples for the present coefficients, and room for a proposal.
#[derive(Debug, Clone)]
pub(crate) struct SampleValues {
    norm: Norm,
    values: Vec<f64>,
    proposed: Vec<f64>,
    cost: f64,
    proposed_cost: f64,
    pub(crate) work: Work,
}

impl SampleValues {
    pub(crate) fn new(columns: &Columns, coefficients: &[f64], norm: Norm) -> Self {
        let values = columns.padded_values(coefficients);
        let proposed = values.clone();
        let mut state = Self { norm, values, proposed, cost: 0.0, proposed_cost: 0.0, work: Work::default() };
        state.cost = state.recomputed_cost(columns);
        state
    }

    fn recomputed_cost(&self, columns: &Columns) -> f64 {
        let total = self.values.chunks_exact(BLOCK).fold(0.0, |total, block| self.norm.gather(total, block));
        self.norm.finish(total, columns.samples)
    }

    pub(crate) fn cost(&self) -> f64 {
        self.cost
    }

    /// The cost after changes, or `None` as soon as it is known to be above `limit`.
    ///
    /// The answer is kept: [`SampleValues::accept`] makes it the present state.
    #[inline]
    pub(crate) fn propose(&mut self, columns: &Columns, changes: &[Change], limit: f64) -> Option<f64> {
        self.work.moves += 1;
        let total_limit = self.norm.total_limit(limit, columns.samples);
        let mut total = 0.0;
        for from in (0..self.values.len()).step_by(BLOCK) {
            let now = &self.values[from..from + BLOCK];
            let next = &mut self.proposed[from..from + BLOCK];
            match *changes {
                [one] => {
                    let d = columns.block(one.column, from);
                    for i in 0..BLOCK {
                        next[i] = now[i] + one.by * d[i];
                    }
                }
                [one, two] => {
                    let (d, e) = (columns.block(one.column, from), columns.block(two.column, from));
                    for i in 0..BLOCK {
                        next[i] = now[i] + (one.by * d[i] + two.by * e[i]);
                    }
                }
                _ => {
                    next.copy_from_slice(now);
                    for change in changes {
                        for (v, d) in next.iter_mut().zip(columns.block(change.column, from)) {
                            *v += change.by * d;
                        }
                    }
                }
            }
            total = self.norm.gather(total, next);
            self.work.samples += BLOCK as u64;
            if !(total <= total_limit) {
                return None;
            }
        }
        self.proposed_cost = self.norm.finish(total, columns.samples);
        Some(self.proposed_cost)
    }

    /// Makes the last proposal, which must have passed, the present state.
    pub(crate) fn accept(&mut self) {
        self.work.accepted += 1;
        std::mem::swap(&mut self.values, &mut self.proposed);
        self.cost = self.proposed_cost;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(samples: usize, columns: usize) -> Columns {
        let of = |k: usize| (0..samples).map(|s| ((s * (k + 1)) as f64 * 0.37).sin()).collect::<Vec<f64>>();
        Columns::new(&of(columns), &(0..columns).map(of).collect::<Vec<_>>())
    }

    #[test]
    fn a_proposal_has_the_cost_of_recomputation_for_every_norm_and_any_number_of_changes() {
        let columns = wave(1000, 6);
        for norm in [Norm::Largest, Norm::RootMeanSquare, Norm::Sum] {
            let mut coefficients = vec![1.0, -2.0, 0.5, 0.0, 3.0, -1.0];
            let mut values = SampleValues::new(&columns, &coefficients, norm);
            for count in 1..=4 {
                let changes: Vec<Change> =
                    (0..count).map(|k| Change { column: k, by: 0.3 * (k as f64 + 1.0) }).collect();
                let found = values.propose(&columns, &changes, f64::INFINITY).unwrap();
                values.accept();
                for change in &changes {
                    coefficients[change.column] += change.by;
                }
                let expected = norm.of(&columns.values(&coefficients));
                assert!((found - expected).abs() < 1e-12 * expected, "{norm:?} {found} {expected}");
            }
        }
    }

    #[test]
    fn a_move_over_the_limit_is_refused_after_the_first_block_and_one_within_it_sees_every_sample() {
        let columns = wave(1000, 3);
        let mut values = SampleValues::new(&columns, &[0.0; 3], Norm::Largest);
        let change = [Change { column: 0, by: 10.0 }];
        assert_eq!(values.propose(&columns, &change, 5.0), None);
        assert_eq!(values.work.samples, BLOCK as u64);
        assert!(values.propose(&columns, &change, 50.0).is_some());
        assert_eq!(values.work.samples, BLOCK as u64 + 1024);
    }
}
