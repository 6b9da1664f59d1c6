//! Every sum of one vector from each of two sets that lies within a box.
//!
//! ```text
//! { (i, k) : low ≤ x_i + y_k ≤ high in every coordinate }
//! ```
//!
//! Both sets are put into balanced trees of boxes. A pair of boxes none of whose sums can be within the limit is
//! dropped with everything inside it; of any other pair the larger set is cut. This is how a space of 2^40 patterns is
//! searched through two sets of 2^20 sums (Horowitz and Sahni, J. ACM 21, 277 (1974), with a tree in place of the
//! sorted list, because there are many coordinates).
//!
//! Coordinates are held in single precision: the caller widens the box by the rounding, and judges what is left in full.

use std::ops::ControlFlow;

use rayon::prelude::*;

/// Coordinates are padded to a multiple of this with zeros.
const LANES: usize = 8;

/// Points at a leaf of a tree.
const LEAF_BITS: u32 = 3;

/// Where points stand that only fill a tree up: no sum with one of them is within any box.
const FAR: f32 = f32::MAX / 4.0;

/// Points that are filled in one piece of work.
const POINTS_AT_ONCE: usize = 256;

/// Of sums that are matched once and not again, so many of a part say which direction is its widest.
const SAMPLED: usize = 64;

/// 2^b points in a balanced tree of boxes.
#[derive(Debug)]
pub(crate) struct Tree {
    bits: u32,
    /// Coordinates of a point, padded.
    width: usize,
    /// In the order of the leaves.
    points: Vec<f32>,
    /// What each point was numbered when it was given.
    names: Vec<u32>,
    /// Node i has the children 2i and 2i + 1; the root is 1. Lows, then highs.
    boxes: Vec<f32>,
}

impl Tree {
    /// The corners of a cube: Σ ±column over all choices of signs, added to `start`.
    ///
    /// Point number `i` has +column k where bit k of `i` is set.
    pub(crate) fn of_corners(start: &[f64], columns: &[Vec<f64>]) -> Self {
        let bits = columns.len() as u32;
        let width = start.len().next_multiple_of(LANES);
        let mut first: Vec<f64> = start.to_vec();
        for column in columns {
            for (v, d) in first.iter_mut().zip(column) {
                *v -= d;
            }
        }
        let mut points = vec![0.0_f32; width << bits];
        let corner = |number: u32| {
            let mut v = first.clone();
            for (k, column) in columns.iter().enumerate() {
                if number >> k & 1 == 1 {
                    for (v, d) in v.iter_mut().zip(column) {
                        *v += 2.0 * d;
                    }
                }
            }
            v
        };
        points.par_chunks_mut(width).enumerate().for_each(|(number, point)| {
            for (p, v) in point.iter_mut().zip(corner(number as u32)) {
                *p = v as f32;
            }
        });
        Self::new(bits, width, &points, usize::MAX)
    }

    /// The sums of one vector of each set, added to `start`; a set has its vectors one after the other.
    ///
    /// Point number `i` has vector `i mod n` of the first set, which has n, and so on with `i div n` and the next set.
    pub(crate) fn of_sums(start: &[f64], sets: &[Vec<f64>]) -> Self {
        let samples = start.len();
        let width = samples.next_multiple_of(LANES);
        let count: usize = sets.iter().map(|set| set.len() / samples).product();
        let bits = count.next_power_of_two().ilog2();
        let mut points = vec![0.0_f32; width << bits];
        points.par_chunks_mut(width * POINTS_AT_ONCE).enumerate().for_each(|(chunk, points)| {
            let mut sum = vec![0.0; samples];
            for (index, point) in points.chunks_exact_mut(width).enumerate() {
                let number = chunk * POINTS_AT_ONCE + index;
                if number >= count {
                    point.fill(FAR);
                    continue;
                }
                sum.copy_from_slice(start);
                let mut rest = number;
                for set in sets {
                    let vectors = set.len() / samples;
                    let vector = &set[rest % vectors * samples..(rest % vectors + 1) * samples];
                    sum.iter_mut().zip(vector).for_each(|(v, d)| *v += d);
                    rest /= vectors;
                }
                point.iter_mut().zip(&sum).for_each(|(p, v)| *p = *v as f32);
            }
        });
        Self::new(bits, width, &points, SAMPLED)
    }

    /// `measured` points of a part at most say which direction is its widest.
    fn new(bits: u32, width: usize, given: &[f32], measured: usize) -> Self {
        let count = 1usize << bits;
        let mut names: Vec<u32> = (0..count as u32).collect();
        let levels = bits.saturating_sub(LEAF_BITS);
        for level in 0..levels {
            names.par_chunks_mut(count >> level).for_each(|part| split_at_median(part, width, given, measured));
        }
        let mut points = vec![0.0; given.len()];
        points.par_chunks_mut(width).zip(&names).for_each(|(to, &name)| {
            to.copy_from_slice(&given[name as usize * width..(name as usize + 1) * width]);
        });
        let mut tree = Self { bits, width, points, names, boxes: Vec::new() };
        tree.boxes = tree.bounding_boxes(levels);
        tree
    }

    fn bounding_boxes(&self, levels: u32) -> Vec<f32> {
        let (width, count) = (self.width, 1usize << self.bits);
        let mut boxes = vec![0.0; 2 * width * (2 << levels)];
        let first_leaf = 1usize << levels;
        let per_leaf = count >> levels;
        boxes[first_leaf * 2 * width..].par_chunks_mut(2 * width).enumerate().for_each(|(leaf, bounds)| {
            let (low, high) = bounds.split_at_mut(width);
            low.fill(f32::INFINITY);
            high.fill(f32::NEG_INFINITY);
            for point in self.points[leaf * per_leaf * width..(leaf + 1) * per_leaf * width].chunks_exact(width) {
                for ((l, h), p) in low.iter_mut().zip(high.iter_mut()).zip(point) {
                    *l = l.min(*p);
                    *h = h.max(*p);
                }
            }
        });
        for node in (1..first_leaf).rev() {
            let (parents, children) = boxes.split_at_mut(2 * node * 2 * width);
            let parent = &mut parents[node * 2 * width..];
            let (a, b) = children[..4 * width].split_at(2 * width);
            for k in 0..width {
                parent[k] = a[k].min(b[k]);
                parent[width + k] = a[width + k].max(b[width + k]);
            }
        }
        boxes
    }

    fn levels(&self) -> u32 {
        self.bits.saturating_sub(LEAF_BITS)
    }

    fn bounds(&self, node: usize) -> &[f32] {
        &self.boxes[node * 2 * self.width..(node + 1) * 2 * self.width]
    }

    /// The points below a node, as a range in the order of the leaves.
    fn range(&self, node: usize) -> std::ops::Range<usize> {
        let level = node.ilog2();
        let size = 1usize << (self.bits - level);
        let from = (node - (1 << level)) * size;
        from..from + size
    }

    fn point(&self, at: usize) -> &[f32] {
        &self.points[at * self.width..(at + 1) * self.width]
    }
}

/// Puts the half with the smaller coordinates first, along the widest direction.
fn split_at_median(part: &mut [u32], width: usize, given: &[f32], measured: usize) {
    let mut low = vec![f32::INFINITY; width];
    let mut high = vec![f32::NEG_INFINITY; width];
    for &name in part.iter().step_by(part.len().div_ceil(measured)) {
        let point = &given[name as usize * width..(name as usize + 1) * width];
        for ((l, h), p) in low.iter_mut().zip(high.iter_mut()).zip(point) {
            *l = l.min(*p);
            *h = h.max(*p);
        }
    }
    let mut axis = 0;
    for k in 1..width {
        if high[k] - low[k] > high[axis] - low[axis] {
            axis = k;
        }
    }
    let at = |name: u32| given[name as usize * width + axis];
    let middle = part.len() / 2;
    // Ties are broken by number, so that the tree is the same on every machine.
    part.select_nth_unstable_by(middle, |&a, &b| at(a).total_cmp(&at(b)).then(a.cmp(&b)));
}

/// Where a sum must lie, coordinate by coordinate.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Target {
    low: Vec<f32>,
    high: Vec<f32>,
}

impl Target {
    /// Coordinates that pad the trees are free.
    pub(crate) fn new(bounds: impl Iterator<Item = (f64, f64)>) -> Self {
        let (mut low, mut high): (Vec<f32>, Vec<f32>) = bounds.map(|(l, h)| (l as f32, h as f32)).unzip();
        let width = low.len().next_multiple_of(LANES);
        low.resize(width, f32::NEG_INFINITY);
        high.resize(width, f32::INFINITY);
        Self { low, high }
    }
}

/// Two trees of equal width, to be matched.
#[derive(Debug)]
pub(crate) struct Matching<'a> {
    pub(crate) left: &'a Tree,
    pub(crate) right: &'a Tree,
}

/// A pair of nodes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct NodePair {
    left: usize,
    right: usize,
}

impl Matching<'_> {
    fn within(&self, pair: NodePair, target: &Target) -> bool {
        sums_within(self.left.bounds(pair.left), self.right.bounds(pair.right), target)
    }

    /// Pairs that together hold every match: the work to share out. Counts the pairs looked at.
    pub(crate) fn shares(&self, target: &Target, at_least: usize, nodes: &mut u64) -> Vec<NodePair> {
        let mut pairs = vec![NodePair { left: 1, right: 1 }];
        loop {
            *nodes += pairs.len() as u64;
            pairs.retain(|&p| self.within(p, target));
            if pairs.is_empty() || pairs.len() >= at_least {
                return pairs;
            }
            let next: Vec<NodePair> = pairs.iter().flat_map(|&p| self.cut(p)).collect();
            if next == pairs {
                return pairs;
            }
            pairs = next;
        }
    }

    /// The larger set is cut; a pair of leaves stays.
    fn cut(&self, pair: NodePair) -> Vec<NodePair> {
        let (left_level, right_level) = (pair.left.ilog2(), pair.right.ilog2());
        let left_can = left_level < self.left.levels();
        let right_can = right_level < self.right.levels();
        let left_first = self.left.bits - left_level >= self.right.bits - right_level;
        if left_can && (left_first || !right_can) {
            [2 * pair.left, 2 * pair.left + 1].map(|left| NodePair { left, ..pair }).to_vec()
        } else if right_can {
            [2 * pair.right, 2 * pair.right + 1].map(|right| NodePair { right, ..pair }).to_vec()
        } else {
            vec![pair]
        }
    }

    /// Visits every match, from the roots on, as [`Matching::search`] does.
    pub(crate) fn visit_all(
        &self,
        target: &Target,
        nodes: &mut u64,
        visit: &mut impl FnMut(BoxStep) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        self.search(NodePair { left: 1, right: 1 }, target, nodes, visit)
    }

    /// Visits every match below a pair as the numbers of its points; `visit` answers whether to go on.
    /// Returns false if it was stopped. Counts the pairs looked at.
    pub(crate) fn search(
        &self,
        pair: NodePair,
        target: &Target,
        nodes: &mut u64,
        visit: &mut impl FnMut(BoxStep) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        *nodes += 1;
        if nodes.is_multiple_of(PAIRS_PER_PAUSE) {
            visit(BoxStep::Pause)?;
        }
        if !self.within(pair, target) {
            return ControlFlow::Continue(());
        }
        let (left_level, right_level) = (pair.left.ilog2(), pair.right.ilog2());
        let left_can = left_level < self.left.levels();
        let right_can = right_level < self.right.levels();
        if !left_can && !right_can {
            return self.search_leaves(pair, target, visit);
        }
        let left_first = self.left.bits - left_level >= self.right.bits - right_level;
        for child in 0..2 {
            let next = if left_can && (left_first || !right_can) {
                NodePair { left: 2 * pair.left + child, ..pair }
            } else {
                NodePair { right: 2 * pair.right + child, ..pair }
            };
            self.search(next, target, nodes, visit)?;
        }
        ControlFlow::Continue(())
    }

    fn search_leaves(
        &self,
        pair: NodePair,
        target: &Target,
        visit: &mut impl FnMut(BoxStep) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        for i in self.left.range(pair.left) {
            for k in self.right.range(pair.right) {
                if point_within(self.left.point(i), self.right.point(k), target) {
                    visit(BoxStep::Match { left: self.left.names[i], right: self.right.names[k] })?;
                }
            }
        }
        ControlFlow::Continue(())
    }
}

/// What a search asks its caller about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum BoxStep {
    /// A candidate.
    Match { left: u32, right: u32 },
    /// Nothing found for a while.
    Pause,
}

const PAIRS_PER_PAUSE: u64 = 1 << 16;

#[inline]
fn sums_within(a: &[f32], b: &[f32], target: &Target) -> bool {
    let width = target.low.len();
    let (a_low, a_high) = a.split_at(width);
    let (b_low, b_high) = b.split_at(width);
    for from in (0..width).step_by(LANES) {
        let to = from + LANES;
        let (al, ah, bl, bh) = (&a_low[from..to], &a_high[from..to], &b_low[from..to], &b_high[from..to]);
        let (low, high) = (&target.low[from..to], &target.high[from..to]);
        let mut outside = false;
        for k in 0..LANES {
            outside |= (al[k] + bl[k] > high[k]) | (ah[k] + bh[k] < low[k]);
        }
        if outside {
            return false;
        }
    }
    true
}

#[inline]
fn point_within(a: &[f32], b: &[f32], target: &Target) -> bool {
    for from in (0..a.len()).step_by(LANES) {
        let to = from + LANES;
        let (a, b, low, high) = (&a[from..to], &b[from..to], &target.low[from..to], &target.high[from..to]);
        let mut outside = false;
        for k in 0..LANES {
            let sum = a[k] + b[k];
            outside |= (sum > high[k]) | (sum < low[k]);
        }
        if outside {
            return false;
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_of_sets_of_any_sizes_are_matched_as_corners_are() {
        let set = |first: usize, vectors: usize| -> Vec<f64> {
            (0..2 * vectors).map(|i| ((2 * first + i) as f64 * 1.3).sin()).collect()
        };
        let (left, right) = ([set(0, 5), set(5, 6)], [set(11, 24)]);
        let at = |sets: &[Vec<f64>], number: usize, i: usize| -> f64 {
            let mut rest = number;
            sets.iter()
                .map(|set| {
                    let vectors = set.len() / 2;
                    let value = set[rest % vectors * 2 + i];
                    rest /= vectors;
                    value
                })
                .sum()
        };
        let start = [0.2, -0.1];
        let mut expected = Vec::new();
        for a in 0..30 {
            for b in 0..24 {
                if (0..2).all(|i| (start[i] + at(&left, a, i) + at(&right, b, i)).abs() <= 0.3) {
                    expected.push((a as u32, b as u32));
                }
            }
        }
        let trees = (Tree::of_sums(&start, &left), Tree::of_sums(&[0.0; 2], &right));
        let matching = Matching { left: &trees.0, right: &trees.1 };
        let (mut nodes, mut found) = (0, Vec::new());
        let _ = matching.visit_all(&Target::new([(-0.3, 0.3); 2].into_iter()), &mut nodes, &mut |step| {
            if let BoxStep::Match { left, right } = step {
                found.push((left, right));
            }
            ControlFlow::Continue(())
        });
        found.sort_unstable();
        assert!(!expected.is_empty());
        assert_eq!(found, expected);
    }

    #[test]
    fn every_sum_within_the_box_and_no_other_is_visited_with_fewer_pairs_than_sums() {
        let column = |k: usize| (0..3).map(|i| ((3 * k + i) as f64 * 1.7).sin() + 0.1).collect::<Vec<f64>>();
        let left: Vec<Vec<f64>> = (0..7).map(column).collect();
        let right: Vec<Vec<f64>> = (7..13).map(column).collect();
        let start = [0.3, -0.2, 0.1];
        let sum = |columns: &[Vec<f64>], number: u32, i: usize| -> f64 {
            columns.iter().enumerate().map(|(k, c)| if number >> k & 1 == 1 { c[i] } else { -c[i] }).sum()
        };
        let mut expected = Vec::new();
        for a in 0..1 << 7 {
            for b in 0..1 << 6 {
                if (0..3).all(|i| (start[i] + sum(&left, a, i) + sum(&right, b, i)).abs() <= 0.5) {
                    expected.push((a, b));
                }
            }
        }
        let trees = (Tree::of_corners(&start, &left), Tree::of_corners(&[0.0; 3], &right));
        let matching = Matching { left: &trees.0, right: &trees.1 };
        let target = Target::new([(-0.5, 0.5); 3].into_iter());
        let (mut nodes, mut found) = (0, Vec::new());
        for pair in matching.shares(&target, 16, &mut nodes) {
            let _ = matching.search(pair, &target, &mut nodes, &mut |step| {
                if let BoxStep::Match { left, right } = step {
                    found.push((left, right));
                }
                ControlFlow::Continue(())
            });
        }
        found.sort_unstable();
        assert!(!expected.is_empty());
        assert_eq!(found, expected);
        assert!(nodes < 1 << 12, "{nodes} pairs for {} sums", 1 << 13);
    }
}
