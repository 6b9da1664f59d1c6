//! Branch and bound over permutations, from the outermost layer inwards.
//!
//! A node has placed the outer layers F; the m inner layers R share the open places p. With l̄ and δ_i the mean length
//! of the layers in R and their deviations from it, the sum over a sample's mean responses S is, exactly,
//!
//! ```text
//! Σ_j S_j w_j = Σ_{j∈F} S_j l_j W_j + Σ_{i∈R} S_i l_i W_{p(i)} + Σ_{i∈R} δ_i V_{p(i)} + Σ_{i<k∈R} ±( S_i l_i δ_k − S_k l_k δ_i )
//! W_p = (placed length before p) − (placed length after p) + l̄ (open places before p − after p)
//! V_p = Σ_{j∈F} S_j l_j sgn(P(j) − p)
//! ```
//!
//! | part | bounded by |
//! |---|---|
//! | F | known |
//! | S_i l_i W_p | the rearrangement inequality: factors and places sorted alike, or in opposite order |
//! | δ_i V_p | half the sum of the deviations' sizes times the range of V over the open places; Σ δ_i = 0 |
//! | pairs in R | the sum of their sizes |
//!
//! With equal lengths the last two vanish. Differences between the halves and axial moments are further terms of the
//! kind factor times place, bounded in the same way and added. Because Σ_j w_j = 0 for every pattern, S may be shifted by
//! a constant; it is shifted so that the open layers' mean is zero, which keeps what single precision loses small.
//!
//! A node is refuted where a bound of its level, a row or a blend of rows ([`surrogates`](super::surrogates)), is not below the
//! limit. Levels are counted by open layers.
//!
//! The winding's class needs no more than the set of open places: a pattern has at most K captive runs if at every
//! step the layers wound so far fill at most K + 1 intervals, and what is wound before layer j are the layers inside it.
//!
//! # Source
//! Hardy, Littlewood, Pólya, Inequalities, theorem 368 (rearrangement).

use super::rows::{SampleRow, deviations_m};
use super::simd_bounds::{Bound, BoundLanes, BoundLevel, BoundShape, LANES};
use crate::pattern::windability::WindabilityClass;

/// More layers than this do not fit the set of open places.
pub(crate) const MOST_LAYERS: usize = 64;

/// A problem: lengths, class, and bounds by level. Lengths are in units of the innermost layer's, so that with equal
/// lengths every place is an exact small integer.
#[derive(Debug, Clone)]
pub(crate) struct PermutationTree {
    layers: usize,
    lengths_m: Vec<f64>,
    lengths: Vec<f32>,
    equal: bool,
    most_intervals: u32,
    has_difference: bool,
    /// Rows with an axial term are searched twice, for either direction of the first layer.
    axial_sign: Option<f32>,
    levels: Vec<BoundLevel>,
    whole: f32,
    /// For each number of open layers: l̄, and half of Σ |δ_i|.
    mean: Vec<f32>,
    half_deviation: Vec<f32>,
}

/// The outer layers' places.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Node {
    /// Place of each layer that has one, outermost layer first.
    pub(crate) places: Vec<u8>,
    /// Bit p is set while place p is open.
    pub(crate) open: u64,
}

/// Places of a node as a bound needs them, shared by all rows; kept between nodes for its room.
#[derive(Debug, Default)]
pub(crate) struct Places {
    /// W at the places of F, outermost layer first, then the open places' in ascending order.
    pub(super) placed: Vec<f32>,
    pub(super) open: Vec<f32>,
    /// −|W| sorted.
    pub(super) open_difference: Vec<f32>,
    /// Of F's layers, in the order of their places: the layer, and whether an open place lies between it and the next.
    along: Vec<(usize, bool)>,
    open_first: bool,
    pub(super) signs: Vec<f32>,
    pub(super) open_signs: Vec<f32>,
}

impl Node {
    pub(crate) fn open_count(&self) -> usize {
        self.open.count_ones() as usize
    }

    /// Takes back the layer placed last.
    pub(crate) fn take_back(&mut self) {
        if let Some(place) = self.places.pop() {
            self.open |= 1 << place;
        }
    }
}

impl PermutationTree {
    /// No bounds yet. `has_difference` where the halves respond differently in any row that will be given;
    /// `axial_sign` where any has an axial term.
    pub(crate) fn new(
        lengths_m: &[f64],
        class: WindabilityClass,
        has_difference: bool,
        axial_sign: Option<f32>,
    ) -> Self {
        let layers = lengths_m.len();
        let lengths: Vec<f64> = lengths_m.iter().map(|l| l / lengths_m[0]).collect();
        let half_deviation = |open| 0.5 * deviations_m(&lengths, open).iter().map(|d| d.abs()).sum::<f64>() as f32;
        let mean = |open: usize| (lengths[..open].iter().sum::<f64>() / open.max(1) as f64) as f32;
        Self {
            layers,
            lengths_m: lengths_m.to_vec(),
            equal: lengths_m.iter().all(|l| *l == lengths_m[0]),
            most_intervals: match class {
                WindabilityClass::Standard => 1,
                WindabilityClass::Captive(most) => most.min(layers) as u32 + 1,
                WindabilityClass::Any => layers as u32,
            },
            has_difference,
            axial_sign,
            levels: vec![BoundLevel::default(); layers + 1],
            whole: lengths.iter().sum::<f64>() as f32,
            mean: (0..=layers).map(mean).collect(),
            half_deviation: (0..=layers).map(half_deviation).collect(),
            lengths: lengths.iter().map(|l| *l as f32).collect(),
        }
    }

    /// Σ_s (row)_s ≥ limit refutes a node with so many open layers from now on; tried after what is there already.
    pub(crate) fn add_bound(&mut self, open: usize, row: &SampleRow) {
        let shape = BoundShape {
            lengths_m: &self.lengths_m,
            has_difference: self.has_difference,
            has_axial: self.axial_sign.is_some(),
            equal: self.equal,
        };
        self.levels[open].push(&Bound::new(row, open, &shape));
    }

    /// Keeps only the given bounds of a level, in the given order.
    pub(crate) fn keep_bounds(&mut self, open: usize, kept: &[usize]) {
        self.levels[open] = self.levels[open].select(kept);
    }

    pub(crate) fn root(&self) -> Node {
        Node { places: Vec::new(), open: if self.layers == 64 { u64::MAX } else { (1 << self.layers) - 1 } }
    }

    pub(crate) fn layers(&self) -> usize {
        self.layers
    }

    /// Whether layers wound at these places, and no others, leave few enough captive runs.
    pub(crate) fn admits(&self, wound: u64) -> bool {
        (wound & !(wound << 1)).count_ones() <= self.most_intervals
    }

    /// P(j), innermost layer first.
    pub(crate) fn segments(node: &Node) -> Vec<usize> {
        node.places.iter().rev().map(|&p| usize::from(p) + 1).collect()
    }

    /// W of a place of which all that lies before it is known.
    fn w(&self, from: f32, length: f32) -> f32 {
        2.0 * from + length - self.whole
    }

    fn sign(&self, place: usize) -> f32 {
        let sign = self.axial_sign.unwrap_or(0.0);
        if place.is_multiple_of(2) { -sign } else { sign }
    }

    pub(crate) fn set_places(&self, node: &Node, found: &mut Places) {
        let placed_count = node.places.len();
        let open_count = self.layers - placed_count;
        let mean = self.mean[open_count];
        let mut layer_at = [u8::MAX; MOST_LAYERS];
        for (k, &p) in node.places.iter().enumerate() {
            layer_at[usize::from(p)] = k as u8;
        }
        found.placed.resize(placed_count, 0.0);
        found.signs.resize(placed_count, 0.0);
        found.open.clear();
        found.open_signs.clear();
        found.along.clear();
        found.open_first = false;
        let mut from = 0.0;
        for (p, &k) in layer_at[..self.layers].iter().enumerate() {
            if k == u8::MAX {
                found.open.push(self.w(from, mean));
                found.open_signs.push(self.sign(p));
                from += mean;
                match found.along.last_mut() {
                    Some((_, open_behind)) => *open_behind = true,
                    None => found.open_first = true,
                }
            } else {
                let k = usize::from(k);
                let layer = self.layers - 1 - k;
                found.placed[k] = self.w(from, self.lengths[layer]);
                found.signs[k] = self.sign(p);
                from += self.lengths[layer];
                found.along.push((layer, false));
            }
        }
        if self.has_difference {
            found.open_difference.clear();
            found.open_difference.extend(found.open.iter().map(|w| -w.abs()));
            found.open_difference.sort_by(f32::total_cmp);
        }
        if self.axial_sign.is_some() {
            found.open_signs.sort_by(f32::total_cmp);
        }
    }

    /// By how much each bound of a block exceeds the limit at best below a node.
    #[inline]
    fn excess(&self, block: &BoundLanes, places: &Places, limit: f32) -> [f32; LANES] {
        let open_count = places.open.len();
        let mut sum = block.constant;
        let placed = |k: usize| self.layers - 1 - k;
        for (k, w) in places.placed.iter().enumerate() {
            add(&mut sum, &block.terms[0][placed(k)], *w);
        }
        arrange(&block.sorted[0], &places.open, &mut sum);
        let mut next_term = 1;
        if self.has_difference {
            for (k, w) in places.placed.iter().enumerate() {
                add(&mut sum, &block.terms[1][placed(k)], -w.abs());
            }
            arrange(&block.sorted[1], &places.open_difference, &mut sum);
            next_term = 2;
        }
        if self.axial_sign.is_some() {
            for (k, sign) in places.signs.iter().enumerate() {
                add(&mut sum, &block.terms[next_term][placed(k)], *sign);
            }
            arrange(&block.sorted[next_term], &places.open_signs, &mut sum);
        }
        let mut slack = block.slack;
        if !self.equal && open_count > 1 {
            let range = self.range_of_v(block, places);
            add(&mut slack, &range, self.half_deviation[open_count]);
        }
        let mut excess = [0.0; LANES];
        for i in 0..LANES {
            excess[i] = sum[i] - slack[i] - limit;
        }
        excess
    }

    /// max V_p − min V_p over the open places.
    fn range_of_v(&self, block: &BoundLanes, places: &Places) -> [f32; LANES] {
        let mut v = [0.0; LANES];
        for (layer, _) in &places.along {
            add(&mut v, &block.terms[0][*layer], 1.0);
        }
        let (mut low, mut high) = ([f32::INFINITY; LANES], [f32::NEG_INFINITY; LANES]);
        let mut widen = |v: &[f32; LANES]| {
            for i in 0..LANES {
                low[i] = if v[i] < low[i] { v[i] } else { low[i] };
                high[i] = if v[i] > high[i] { v[i] } else { high[i] };
            }
        };
        if places.open_first {
            widen(&v);
        }
        for (layer, open_behind) in &places.along {
            add(&mut v, &block.terms[0][*layer], -2.0);
            if *open_behind {
                widen(&v);
            }
        }
        let mut range = [0.0; LANES];
        for i in 0..LANES {
            range[i] = high[i] - low[i];
        }
        range
    }

    /// Whether a pattern below the node may stay under the limit. What is not a number refutes nothing.
    pub(crate) fn may_stay_under(&self, node: &Node, limit: f32, places: &mut Places) -> bool {
        self.set_places(node, places);
        let blocks = self.levels[node.open_count()].blocks();
        blocks.iter().all(|block| self.excess(block, places, limit).iter().all(|e| !(*e >= 0.0)))
    }

    /// By how much the largest bound below the node exceeds the limit; minus infinity where there is no bound.
    pub(crate) fn largest_excess(&self, node: &Node, limit: f32, places: &mut Places) -> f32 {
        self.set_places(node, places);
        let blocks = self.levels[node.open_count()].blocks().iter();
        blocks.flat_map(|block| self.excess(block, places, limit)).fold(f32::NEG_INFINITY, f32::max)
    }

    /// The first bound of the level that refutes a node whose places are set.
    pub(crate) fn refuting_bound(&self, node: &Node, limit: f32, places: &Places) -> Option<usize> {
        self.levels[node.open_count()].blocks().iter().enumerate().find_map(|(b, block)| {
            self.excess(block, places, limit).iter().position(|e| *e >= 0.0).map(|lane| b * LANES + lane)
        })
    }

    /// Puts the next layer on a place if that is open, the class admits it, and no mirror image stands for it.
    pub(crate) fn place(&self, node: &mut Node, place: usize, mirrored: bool) -> bool {
        let is_mirror_image = mirrored && node.places.is_empty() && place >= self.layers / 2;
        if is_mirror_image || node.open >> place & 1 == 0 || !self.admits(node.open & !(1 << place)) {
            return false;
        }
        node.open &= !(1 << place);
        node.places.push(place as u8);
        true
    }
}

#[inline]
fn add(sum: &mut [f32; LANES], factors: &[f32; LANES], by: f32) {
    for (s, factor) in sum.iter_mut().zip(factors) {
        *s += factor * by;
    }
}

/// Adds the smallest sum of factors times places; both ascending.
#[inline]
fn arrange(factors: &[[f32; LANES]], places: &[f32], low: &mut [f32; LANES]) {
    for (factor, place) in factors.iter().zip(places.iter().rev()) {
        add(low, factor, *place);
    }
}
