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
//! kind factor times place, bounded in the same way and added.
//!
//! The winding's class needs no more than the set of open places: a pattern has at most K captive runs if at every
//! step the layers wound so far fill at most K + 1 intervals, and what is wound before layer j are the layers inside it.
//!
//! # Source
//! Hardy, Littlewood, Pólya, Inequalities, theorem 368 (rearrangement).

use super::rows::{Row, curved_slack, deviations_m};
use crate::pattern::windability::WindabilityClass;

/// Rows judged at once.
pub const LANES: usize = 8;

/// Single precision loses less than this of a row's scale for each layer: two roundings in the place, two in the sum.
const ROUNDING_PER_LAYER: f64 = 3e-7;

/// More layers than this do not fit the set of open places.
pub const MOST_LAYERS: usize = 64;

/// Eight rows: coefficients by layer, and everything that a bound adds up, lane by lane.
#[derive(Debug, Clone)]
struct RowBlock {
    constant: [f32; LANES],
    /// S_j l_j.
    mean: Vec<[f32; LANES]>,
    terms: Vec<Vec<[f32; LANES]>>,
    /// For each term and number of open layers: their factors in ascending order.
    sorted: Vec<Vec<Vec<[f32; LANES]>>>,
    /// For each number of open layers: pairs in R, and the slack of differences between the halves and of rounding.
    slack: Vec<[f32; LANES]>,
}

/// A problem: rows, lengths, class.
#[derive(Debug, Clone)]
pub struct Orders {
    layers: usize,
    lengths_m: Vec<f32>,
    equal: bool,
    most_intervals: u32,
    has_difference: bool,
    /// Rows with an axial term are searched twice, for either direction of the first layer.
    axial_sign: Option<f32>,
    blocks: Vec<RowBlock>,
    whole_m: f32,
    /// For each number of open layers: l̄, and half of Σ |δ_i|.
    mean_m: Vec<f32>,
    half_deviation_m: Vec<f32>,
}

/// The outer layers' places.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Node {
    /// Place of each layer that has one, outermost layer first.
    pub places: Vec<u8>,
    /// Bit p is set while place p is open.
    pub open: u64,
}

/// Places of a node as a bound needs them, shared by all rows; kept between nodes for its room.
#[derive(Debug, Default)]
pub struct Places {
    /// W at the places of F, outermost layer first, then the open places' in ascending order.
    placed: Vec<f32>,
    open: Vec<f32>,
    /// −|W| sorted.
    open_difference: Vec<f32>,
    /// Of F's layers, in the order of their places: the layer, and whether an open place lies between it and the next.
    along: Vec<(usize, bool)>,
    open_first: bool,
    signs: Vec<f32>,
    open_signs: Vec<f32>,
}

impl Node {
    pub fn open_count(&self) -> usize {
        self.open.count_ones() as usize
    }

    /// Takes back the layer placed last.
    pub fn take_back(&mut self) {
        if let Some(place) = self.places.pop() {
            self.open |= 1 << place;
        }
    }
}

impl Orders {
    /// `axial_sign` must be given if any row has an axial term.
    pub fn new(rows: &[Row], lengths_m: &[f64], class: WindabilityClass, axial_sign: Option<f32>) -> Self {
        let layers = lengths_m.len();
        let has_difference = rows.iter().any(|r| r.difference.iter().any(|d| *d != 0.0));
        let deviations: Vec<Vec<f64>> = (0..=layers).map(|open| deviations_m(lengths_m, open)).collect();
        Self {
            layers,
            lengths_m: lengths_m.iter().map(|l| *l as f32).collect(),
            equal: lengths_m.iter().all(|l| *l == lengths_m[0]),
            most_intervals: match class {
                WindabilityClass::Standard => 1,
                WindabilityClass::Captive(most) => most.min(layers) as u32 + 1,
                WindabilityClass::Any => layers as u32,
            },
            has_difference,
            axial_sign,
            blocks: rows
                .chunks(LANES)
                .map(|rows| RowBlock::new(rows, lengths_m, &deviations, has_difference, axial_sign.is_some()))
                .collect(),
            whole_m: lengths_m.iter().sum::<f64>() as f32,
            mean_m: (0..=layers)
                .map(|open| (lengths_m[..open].iter().sum::<f64>() / open.max(1) as f64) as f32)
                .collect(),
            half_deviation_m: deviations.iter().map(|d| 0.5 * d.iter().map(|d| d.abs()).sum::<f64>() as f32).collect(),
        }
    }

    pub fn root(&self) -> Node {
        Node { places: Vec::new(), open: if self.layers == 64 { u64::MAX } else { (1 << self.layers) - 1 } }
    }

    pub fn layers(&self) -> usize {
        self.layers
    }

    /// Whether all layers have the same length.
    pub fn equal(&self) -> bool {
        self.equal
    }

    /// Rows, padded.
    pub fn width(&self) -> usize {
        self.blocks.len() * LANES
    }

    /// Whether layers wound at these places, and no others, leave few enough captive runs.
    pub fn admits(&self, wound: u64) -> bool {
        (wound & !(wound << 1)).count_ones() <= self.most_intervals
    }

    /// P(j), innermost layer first.
    pub fn segments(node: &Node) -> Vec<usize> {
        node.places.iter().rev().map(|&p| usize::from(p) + 1).collect()
    }

    /// W of a place of which all that lies before it is known.
    fn w(&self, from_m: f32, length_m: f32) -> f32 {
        2.0 * from_m + length_m - self.whole_m
    }

    fn sign(&self, place: usize) -> f32 {
        let sign = self.axial_sign.unwrap_or(0.0);
        if place.is_multiple_of(2) { -sign } else { sign }
    }

    fn set_places(&self, node: &Node, found: &mut Places) {
        let placed_count = node.places.len();
        let open_count = self.layers - placed_count;
        let mean_m = self.mean_m[open_count];
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
        let mut from_m = 0.0;
        for (p, &k) in layer_at[..self.layers].iter().enumerate() {
            if k == u8::MAX {
                found.open.push(self.w(from_m, mean_m));
                found.open_signs.push(self.sign(p));
                from_m += mean_m;
                match found.along.last_mut() {
                    Some((_, open_behind)) => *open_behind = true,
                    None => found.open_first = true,
                }
            } else {
                let k = usize::from(k);
                let layer = self.layers - 1 - k;
                found.placed[k] = self.w(from_m, self.lengths_m[layer]);
                found.signs[k] = self.sign(p);
                from_m += self.lengths_m[layer];
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

    /// By how much each row of a block exceeds the limit at best below a node.
    #[inline]
    fn excess(&self, block: &RowBlock, places: &Places, limit: f32) -> [f32; LANES] {
        let open_count = places.open.len();
        let mut known = block.constant;
        for (k, w) in places.placed.iter().enumerate() {
            add(&mut known, &block.mean[self.layers - 1 - k], *w);
        }
        let (mut low, mut high) = ([0.0; LANES], [0.0; LANES]);
        arrange(&block.sorted[0][open_count], &places.open, &mut low, &mut high);
        let mut next_term = 0;
        if self.has_difference {
            for (k, w) in places.placed.iter().enumerate() {
                add(&mut known, &block.terms[0][self.layers - 1 - k], -w.abs());
            }
            arrange(&block.sorted[1][open_count], &places.open_difference, &mut low, &mut high);
            next_term = 1;
        }
        if self.axial_sign.is_some() {
            for (k, sign) in places.signs.iter().enumerate() {
                add(&mut known, &block.terms[next_term][self.layers - 1 - k], *sign);
            }
            arrange(&block.sorted[next_term + 1][open_count], &places.open_signs, &mut low, &mut high);
        }
        let mut slack = block.slack[open_count];
        if !self.equal && open_count > 1 {
            let range = self.range_of_v(block, places);
            add(&mut slack, &range, self.half_deviation_m[open_count]);
        }
        let mut excess = [0.0; LANES];
        for i in 0..LANES {
            let above = known[i] + low[i] - slack[i] - limit;
            let below = -limit - (known[i] + high[i] + slack[i]);
            excess[i] = if above > below { above } else { below };
        }
        excess
    }

    /// max V_p − min V_p over the open places.
    fn range_of_v(&self, block: &RowBlock, places: &Places) -> [f32; LANES] {
        let mut v = [0.0; LANES];
        for (layer, _) in &places.along {
            add(&mut v, &block.mean[*layer], 1.0);
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
            add(&mut v, &block.mean[*layer], -2.0);
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

    /// Whether a pattern below the node may stay under the limit in every row. What is not a number refutes nothing.
    pub fn may_stay_under(&self, node: &Node, limit: f32, places: &mut Places) -> bool {
        self.set_places(node, places);
        self.blocks.iter().all(|block| self.excess(block, places, limit).iter().all(|e| !(*e >= 0.0)))
    }

    /// The row that exceeds the limit most below a node, if any does.
    pub fn refuting_row(&self, node: &Node, limit: f32, places: &mut Places) -> Option<usize> {
        self.set_places(node, places);
        let mut worst = (0.0, None);
        for (b, block) in self.blocks.iter().enumerate() {
            for (i, e) in self.excess(block, places, limit).into_iter().enumerate() {
                if e >= worst.0 && e.is_finite() {
                    worst = (e, Some(b * LANES + i));
                }
            }
        }
        worst.1
    }

    /// Puts the next layer on a place if that is open, the class admits it, and no mirror image stands for it.
    pub fn place(&self, node: &mut Node, place: usize, mirrored: bool) -> bool {
        let is_mirror_image = mirrored && node.places.is_empty() && place >= self.layers / 2;
        if is_mirror_image || node.open >> place & 1 == 0 || !self.admits(node.open & !(1 << place)) {
            return false;
        }
        node.open &= !(1 << place);
        node.places.push(place as u8);
        true
    }

    /// Adds what a layer contributes on a place to all rows; for equal lengths.
    pub fn add_placed(&self, layer: usize, place: usize, sum: &mut [f32]) {
        let length_m = self.lengths_m[0];
        let w = self.w(place as f32 * length_m, length_m);
        let axial_term = usize::from(self.has_difference);
        for (block, sum) in self.blocks.iter().zip(sum.chunks_exact_mut(LANES)) {
            add(sum, &block.mean[layer], w);
            if self.has_difference {
                add(sum, &block.terms[0][layer], -w.abs());
            }
            if self.axial_sign.is_some() {
                add(sum, &block.terms[axial_term][layer], self.sign(place));
            }
        }
    }

    /// Between what bounds the sum of the layers without a place must lie; for equal lengths.
    pub fn room(&self, node: &Node, limit: f32, low: &mut Vec<f32>, high: &mut Vec<f32>) {
        low.clear();
        low.extend(self.blocks.iter().flat_map(|b| b.constant));
        for (k, &place) in node.places.iter().enumerate() {
            self.add_placed(self.layers - 1 - k, usize::from(place), low);
        }
        high.clear();
        let slack = self.blocks.iter().flat_map(|b| &b.slack[node.open_count()]);
        for (known, slack) in low.iter_mut().zip(slack) {
            let reach = limit + slack;
            high.push(reach - *known);
            *known = -reach - *known;
        }
    }
}

/// A row's factor of a layer's place.
type Factor<'a> = Box<dyn Fn(&Row, usize) -> f64 + 'a>;

impl RowBlock {
    fn new(rows: &[Row], lengths_m: &[f64], deviations: &[Vec<f64>], difference: bool, axial: bool) -> Self {
        let layers = lengths_m.len();
        let lanes = |of: &dyn Fn(&Row) -> f64| {
            let mut lanes = [0.0; LANES];
            for (lane, row) in lanes.iter_mut().zip(rows) {
                *lane = of(row) as f32;
            }
            lanes
        };
        let mut factors: Vec<Factor> = vec![Box::new(|row: &Row, j: usize| row.mean[j] * lengths_m[j])];
        if difference {
            factors.push(Box::new(|row: &Row, j: usize| row.difference[j] * lengths_m[j]));
        }
        if axial {
            factors.push(Box::new(|row: &Row, j: usize| 2.0 * row.axial[j] * lengths_m[j] * lengths_m[j]));
        }
        let by_layer = |of: &dyn Fn(&Row, usize) -> f64| -> Vec<[f32; LANES]> {
            (0..layers).map(|j| lanes(&|row| of(row, j))).collect()
        };
        let sorted = |of: &dyn Fn(&Row, usize) -> f64| -> Vec<Vec<[f32; LANES]>> {
            (0..=layers)
                .map(|open| {
                    let of_row = |row: &Row| {
                        let mut factors: Vec<f64> = (0..open).map(|j| of(row, j)).collect();
                        factors.sort_by(f64::total_cmp);
                        factors
                    };
                    let of_rows: Vec<Vec<f64>> = rows.iter().map(of_row).collect();
                    (0..open)
                        .map(|rank| {
                            let mut lanes = [0.0; LANES];
                            for (lane, factors) in lanes.iter_mut().zip(&of_rows) {
                                *lane = factors[rank] as f32;
                            }
                            lanes
                        })
                        .collect()
                })
                .collect()
        };
        let slack = (0..=layers)
            .map(|open| {
                lanes(&|row| {
                    let of_halves: Vec<f64> = row.difference.iter().zip(lengths_m).map(|(d, l)| d * l).collect();
                    pairs_slack(row, lengths_m, &deviations[open])
                        + curved_slack(&of_halves, lengths_m, open)
                        + ROUNDING_PER_LAYER * layers as f64 * row.scale(lengths_m)
                })
            })
            .collect();
        Self {
            constant: lanes(&|row| row.constant),
            mean: by_layer(&*factors[0]),
            terms: factors[1..].iter().map(|f| by_layer(&**f)).collect(),
            sorted: factors.iter().map(|f| sorted(&**f)).collect(),
            slack,
        }
    }
}

/// Σ_{i<k∈R} |S_i l_i δ_k − S_k l_k δ_i|
fn pairs_slack(row: &Row, lengths_m: &[f64], deviations_m: &[f64]) -> f64 {
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

#[inline]
fn add(sum: &mut [f32], factors: &[f32; LANES], by: f32) {
    for (s, factor) in sum.iter_mut().zip(factors) {
        *s += factor * by;
    }
}

/// Adds the smallest and the largest sum of factors times places; both ascending.
#[inline]
fn arrange(factors: &[[f32; LANES]], places: &[f32], low: &mut [f32; LANES], high: &mut [f32; LANES]) {
    for (rank, place) in places.iter().enumerate() {
        add(high, &factors[rank], *place);
        add(low, &factors[places.len() - 1 - rank], *place);
    }
}
