//! Bounds of one level of the search, eight side by side in single precision.

use super::rows::{SampleRow, curved_slack, deviations_m};

/// Bounds judged at once.
pub(crate) const LANES: usize = 8;

/// Relative error of one operation in single precision.
const UNIT_ROUNDING: f64 = 6e-8;

/// What all bounds of a problem have in common.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BoundShape<'a> {
    pub(crate) lengths_m: &'a [f64],
    pub(crate) has_difference: bool,
    pub(crate) has_axial: bool,
    pub(crate) equal: bool,
}

/// A row, or a blend of rows, made ready for nodes with a given number of open layers.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Bound {
    constant: f64,
    /// For each kind of term (mean, difference, axial): the factor of each layer's place.
    terms: Vec<Vec<f64>>,
    /// The open layers' factors in ascending order.
    sorted: Vec<Vec<f64>>,
    /// What the true value may be below the sum: pairs among the open layers, differences between halves, rounding.
    slack: f64,
}

impl Bound {
    pub(crate) fn new(row: &SampleRow, open: usize, shape: &BoundShape) -> Self {
        let lengths_m = shape.lengths_m;
        let row = row.shifted(open);
        let terms = row.factors(lengths_m, shape.has_difference, shape.has_axial);
        let sorted = terms
            .iter()
            .map(|factors| {
                let mut sorted = factors[..open].to_vec();
                sorted.sort_by(f64::total_cmp);
                sorted
            })
            .collect();
        let layers = lengths_m.len() as f64;
        // Equal layers' places are small integers; others' are sums of lengths, each rounded.
        let operations = if shape.equal { layers + 6.0 } else { 5.0 * layers + 6.0 };
        let rounding = UNIT_ROUNDING * operations * row.scale(lengths_m);
        let of_halves: Vec<f64> = row.difference.iter().zip(lengths_m).map(|(d, l)| d * l).collect();
        let of_lengths = if shape.equal {
            0.0
        } else {
            pairs_slack(&row, lengths_m, &deviations_m(lengths_m, open)) + curved_slack(&of_halves, lengths_m, open)
        };
        Self { constant: row.constant, terms, sorted, slack: of_lengths + rounding }
    }
}

/// Σ_{i<k∈R} |S_i l_i δ_k − S_k l_k δ_i|
fn pairs_slack(row: &SampleRow, lengths_m: &[f64], deviations_m: &[f64]) -> f64 {
    let factor = |j: usize| row.mean[j] * lengths_m[j];
    let open = deviations_m.len();
    let mut sum = 0.0;
    for i in 0..open {
        for k in i + 1..open {
            sum += (factor(i) * deviations_m[k] - factor(k) * deviations_m[i]).abs();
        }
    }
    sum
}

/// Eight bounds, lane by lane.
#[derive(Debug, Clone)]
pub(crate) struct BoundLanes {
    pub(crate) constant: [f32; LANES],
    pub(crate) terms: Vec<Vec<[f32; LANES]>>,
    pub(crate) sorted: Vec<Vec<[f32; LANES]>>,
    pub(crate) slack: [f32; LANES],
}

impl BoundLanes {
    /// Lanes without a bound refute nothing.
    fn like(bound: &Bound) -> Self {
        let zeros = |terms: &Vec<Vec<f64>>| terms.iter().map(|t| vec![[0.0; LANES]; t.len()]).collect();
        Self {
            constant: [f32::NEG_INFINITY; LANES],
            terms: zeros(&bound.terms),
            sorted: zeros(&bound.sorted),
            slack: [0.0; LANES],
        }
    }

    fn set(&mut self, lane: usize, bound: &Bound) {
        self.constant[lane] = bound.constant as f32;
        self.slack[lane] = bound.slack as f32;
        let both = [(&mut self.terms, &bound.terms), (&mut self.sorted, &bound.sorted)];
        for (to, from) in both {
            for (to, from) in to.iter_mut().flatten().zip(from.iter().flatten()) {
                to[lane] = *from as f32;
            }
        }
    }
}

/// All bounds of a level, in the order in which they are tried.
#[derive(Debug, Clone, Default)]
pub(crate) struct BoundLevel {
    bounds: Vec<Bound>,
    blocks: Vec<BoundLanes>,
}

impl BoundLevel {
    pub(crate) fn blocks(&self) -> &[BoundLanes] {
        &self.blocks
    }

    pub(crate) fn push(&mut self, bound: &Bound) {
        let lane = self.bounds.len() % LANES;
        if lane == 0 {
            self.blocks.push(BoundLanes::like(bound));
        }
        self.blocks.last_mut().expect("a block was just added").set(lane, bound);
        self.bounds.push(bound.clone());
    }

    /// Only the given bounds, in the given order.
    pub(crate) fn select(&self, kept: &[usize]) -> Self {
        let mut selected = Self::default();
        for &k in kept {
            selected.push(&self.bounds[k]);
        }
        selected
    }
}
