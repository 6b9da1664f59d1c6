//! The class `standard`, searched as a choice of signs: which end of what is inside it each layer lies at.
//!
//! With the columns d_m of [`signs`](crate::search::cost::signs) the error is c + Σ ε_m d_m in every sample, for any layer
//! lengths, plus what lies between known bounds where the halves respond differently or something varies along the
//! axis. The signs are cut into two sets of at most 2^20 sums each; [`box_join`](super::box_join) finds every pair of sums
//! that stays under the limit. What signs are left over are tried one choice after the other. Where a pattern's mirror
//! image has the opposite error, the outermost sign is fixed.

use super::box_join::{BoxStep, Matching, Target, Tree};
use super::candidates::Judge;
use super::rows::{Range, SampleRow};
use super::{PassOutcome, StopWish};
use crate::parallel::InParallel;
use crate::search::cost::signs::segments_of_signs;

/// Sums in either set, as a power of two: 16 samples of them fit 64 MB.
const MOST_BITS: usize = 20;

/// Single precision loses less than this of a sample's scale.
const ROUNDING: f64 = 1e-6;

/// Pieces of work that are shared out: more than threads, and always the same.
const SHARES: usize = 256;

/// A choice of samples, made ready.
#[derive(Debug)]
pub(crate) struct SignSearch {
    rows: Vec<PreparedRow>,
    left: Tree,
    right: Tree,
    /// Which sign each column of the trees belongs to.
    left_signs: Vec<usize>,
    right_signs: Vec<usize>,
    /// Signs that are tried one choice after the other, in the order of the bits.
    outer_signs: Vec<usize>,
    signs: usize,
    mirrored: bool,
}

#[derive(Debug)]
struct PreparedRow {
    constant: f64,
    columns: Vec<f64>,
    curved: Range,
    rounding: f64,
}

impl SignSearch {
    pub(crate) fn new(rows: &[SampleRow], lengths_m: &[f64], mirrored: bool) -> Self {
        let signs = lengths_m.len() - 1;
        let rows: Vec<PreparedRow> = rows
            .iter()
            .map(|row| PreparedRow {
                constant: row.constant,
                columns: sign_columns(row, lengths_m),
                curved: row.curved_range(lengths_m),
                rounding: ROUNDING * row.scale(lengths_m),
            })
            .collect();
        let free = signs - usize::from(mirrored);
        let inside = free.min(2 * MOST_BITS);
        let left_signs: Vec<usize> = (0..inside).step_by(2).collect();
        let right_signs: Vec<usize> = (1..inside).step_by(2).collect();
        let columns = |signs: &[usize]| -> Vec<Vec<f64>> {
            signs.iter().map(|&m| rows.iter().map(|row| row.columns[m]).collect()).collect()
        };
        let start = vec![0.0; rows.len()];
        let left = Tree::of_corners(&start, &columns(&left_signs));
        let right = Tree::of_corners(&start, &columns(&right_signs));
        Self { rows, left, right, left_signs, right_signs, outer_signs: (inside..free).collect(), signs, mirrored }
    }

    /// Every choice of signs that may stay under the limit is judged.
    pub(crate) fn search(&self, judge: &Judge, limit_rad_per_s: f64, watch: &StopWish) -> PassOutcome {
        let choices = 1u64 << self.outer_signs.len();
        let mut outcome = PassOutcome::default();
        for choice in 0..choices {
            outcome.absorb(self.search_choice(choice, judge, limit_rad_per_s, watch));
            if watch.report((choice + 1) as f64 / choices as f64).is_break() && choice + 1 < choices {
                outcome.complete = false;
            }
            if !outcome.complete {
                break;
            }
        }
        outcome
    }

    fn search_choice(&self, choice: u64, judge: &Judge, limit_rad_per_s: f64, watch: &StopWish) -> PassOutcome {
        let target = Target::new(self.rows.iter().map(|row| {
            let outer = self.outer_signs.iter().enumerate();
            let sum: f64 =
                outer.map(|(k, &m)| if choice >> k & 1 == 1 { row.columns[m] } else { -row.columns[m] }).sum();
            let known = row.constant + sum + if self.mirrored { row.columns[self.signs - 1] } else { 0.0 };
            let reach = limit_rad_per_s + row.rounding;
            (-reach - known - row.curved.high, reach - known - row.curved.low)
        }));
        let matching = Matching { left: &self.left, right: &self.right };
        let mut outcome = PassOutcome::default();
        let shares = matching.shares(&target, SHARES, &mut outcome.nodes);
        let found: Vec<PassOutcome> = shares
            .iter()
            .in_parallel()
            .map(|&share| {
                let mut mine = PassOutcome::default();
                let mut nodes = 0;
                let end = matching.search(share, &target, &mut nodes, &mut |step| match step {
                    BoxStep::Pause => watch.pause(),
                    BoxStep::Match { left, right } => {
                        let segments = segments_of_signs(&self.high(choice, left, right));
                        mine.judge(judge, &segments, limit_rad_per_s, watch)
                    }
                });
                mine.complete = end.is_continue();
                mine.nodes += nodes;
                mine
            })
            .collect();
        found.into_iter().for_each(|o| outcome.absorb(o));
        outcome
    }

    fn high(&self, choice: u64, left: u32, right: u32) -> Vec<bool> {
        let mut high = vec![true; self.signs];
        let sets =
            [(&self.left_signs, u64::from(left)), (&self.right_signs, u64::from(right)), (&self.outer_signs, choice)];
        for (signs, number) in sets {
            for (k, &m) in signs.iter().enumerate() {
                high[m] = number >> k & 1 == 1;
            }
        }
        high
    }
}

/// d_m of one sample's mean responses; entry k belongs to layer index k + 1.
fn sign_columns(row: &SampleRow, lengths_m: &[f64]) -> Vec<f64> {
    let (mut inside_m, mut inside) = (0.0, 0.0);
    let mut columns = Vec::with_capacity(lengths_m.len());
    for (s, l) in row.mean.iter().zip(lengths_m) {
        columns.push(l * (inside_m * s - inside));
        inside += l * s;
        inside_m += l;
    }
    columns.remove(0);
    columns
}
