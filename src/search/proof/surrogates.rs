//! Blends of rows that refute more than any row alone.
//!
//! ```text
//! max_s |Ω_s| ≥ Σ_s y_s Ω_s   for any y with Σ |y_s| ≤ 1
//! ```
//!
//! A blend is a row like any other, so the rearrangement bound of [`permutation_tree`](super::permutation_tree) holds for it. Single rows
//! bound little, because the open layers can nearly always cancel what is placed in one sample; they cannot in all
//! samples at once, and the best y says so. It is the dual solution of the relaxation in which the open layers share
//! the open places in any proportions (the permutahedron), so the best blend's bound is the linear relaxation's, without
//! a linear programme at the nodes of the search.
//!
//! The best y of a node is found by cutting planes: a `game` between the samples in use and the
//! arrangements met so far gives y, sorting gives the arrangement that is smallest under it, and samples that the mixture
//! of arrangements violates join. Blends that refuted nodes are tried on the next ones first. They are learnt once, on
//! a sample of the nodes of each level, before the search; what they are decides only how fast it is.
//!
//! # Source
//! Kelley, J. SIAM 8, 703 (1960), cutting planes; Dantzig and Wolfe, Oper. Res. 8, 101 (1960).

use super::matrix_game;
use super::permutation_tree::{Node, PermutationTree, Places};
use super::rows::SampleRow;

/// Nodes of a level from which the next level's are made while learning, times the square of the layers.
const BREADTH_TIMES_LAYERS_SQUARED: usize = 128 * 16 * 16;
const MOST_BREADTH: usize = 128;

/// Blends that are kept for a level: those that refuted most nodes.
const MOST_BLENDS: usize = 64;

/// Cutting planes and samples that one node may ask for.
const MOST_STEPS: usize = 60;

/// A blend is made to exceed the limit by this share, so that it also refutes nodes like the one it was made for.
const MARGIN: f64 = 1e-3;

const TOLERANCE: f64 = 1e-6;

/// Samples that join at once.
const JOINING: usize = 3;

/// What came of learning.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Lesson {
    /// Rows that bounds are made of.
    pub(crate) used: Vec<usize>,
    /// Patterns that no row refutes, P(j) innermost layer first.
    pub(crate) open: Vec<Vec<usize>>,
}

/// Signed weights of rows; their sizes add up to one.
pub(crate) type SurrogateWeights = Vec<(usize, f64)>;

/// Finds blends for nodes.
#[derive(Debug)]
pub(crate) struct Surrogates<'a> {
    rows: &'a [SampleRow],
    /// For each kind of term and layer: the factors of all rows.
    factors: Vec<Vec<Vec<f64>>>,
    layers: usize,
    has_difference: bool,
    has_axial: bool,
}

/// What the best blend says about a node.
#[derive(Debug, Clone, PartialEq)]
enum SurrogateVerdict {
    /// Nothing below the node stays under the limit.
    Refuted(SurrogateWeights),
    /// The blend that came nearest to it.
    Open(SurrogateWeights),
}

impl<'a> Surrogates<'a> {
    pub(crate) fn new(rows: &'a [SampleRow], lengths_m: &[f64], has_difference: bool, has_axial: bool) -> Self {
        let layers = lengths_m.len();
        let of_rows: Vec<Vec<Vec<f64>>> =
            rows.iter().map(|row| row.shifted(layers).factors(lengths_m, has_difference, has_axial)).collect();
        let terms = of_rows.first().map_or(0, Vec::len);
        let factors = (0..terms)
            .map(|t| (0..layers).map(|j| of_rows.iter().map(|factors| factors[t][j]).collect()).collect())
            .collect();
        Self { rows, factors, layers, has_difference, has_axial }
    }

    /// The row that a choice of weights makes.
    pub(crate) fn row(&self, weights: &SurrogateWeights) -> SampleRow {
        SampleRow::blend(weights.iter().map(|&(s, y)| (&self.rows[s], y)), self.layers)
    }

    /// Gives every level of a search the bounds that refute most.
    pub(crate) fn teach(&self, orders: &mut PermutationTree, limit_rad_per_s: f64, mirrored: bool) -> Lesson {
        let breadth = (BREADTH_TIMES_LAYERS_SQUARED / self.layers.pow(2)).clamp(1, MOST_BREADTH);
        let mut used = vec![false; self.rows.len()];
        let mut places = Places::default();
        let mut frontier: Vec<(Node, SurrogateWeights)> = vec![(orders.root(), Vec::new())];
        for open in (0..self.layers).rev() {
            let mut next = Vec::new();
            let mut taught: Vec<(usize, SurrogateWeights)> = Vec::new();
            for (node, hint) in &mut frontier {
                for place in 0..self.layers {
                    if !orders.place(node, place, mirrored) {
                        continue;
                    }
                    orders.set_places(node, &mut places);
                    match orders.refuting_bound(node, limit_rad_per_s as f32, &places) {
                        Some(bound) => taught[bound].0 += 1,
                        None => match self.best(&places, hint, limit_rad_per_s) {
                            SurrogateVerdict::Refuted(weights) => {
                                orders.add_bound(open, &self.row(&weights));
                                taught.push((1, weights));
                            }
                            SurrogateVerdict::Open(weights) => next.push((node.clone(), weights)),
                        },
                    }
                    node.take_back();
                }
            }
            let mut order: Vec<usize> = (0..taught.len()).collect();
            order.sort_by_key(|&k| (std::cmp::Reverse(taught[k].0), k));
            order.truncate(MOST_BLENDS);
            orders.keep_bounds(open, &order);
            order.iter().flat_map(|&k| &taught[k].1).for_each(|&(s, _)| used[s] = true);
            if open == 0 {
                for s in 0..self.rows.len() {
                    for sign in [1.0, -1.0] {
                        orders.add_bound(open, &self.row(&vec![(s, sign)]));
                    }
                }
            }
            let stride = next.len().div_ceil(breadth).max(1);
            frontier = next.into_iter().step_by(stride).collect();
        }
        Lesson {
            used: (0..used.len()).filter(|&s| used[s]).collect(),
            open: frontier.iter().map(|(node, _)| PermutationTree::segments(node)).collect(),
        }
    }

    /// The best blend for a node whose places are set.
    fn best(&self, places: &Places, hint: &SurrogateWeights, limit_rad_per_s: f64) -> SurrogateVerdict {
        let known = self.known(places);
        let mut active: Vec<(usize, f64)> = hint.iter().map(|&(s, y)| (s, y.signum())).collect();
        let mut weights = hint.clone();
        if active.is_empty() {
            let first = self.strongest_row(places, &known);
            active.push(first);
            weights = vec![first];
        }
        let mut columns = vec![self.smallest(places, &known, &weights)];
        let mut best = (f64::NEG_INFINITY, weights);
        for _ in 0..MOST_STEPS {
            let payoffs: Vec<Vec<f64>> =
                columns.iter().map(|column| active.iter().map(|&(s, sign)| sign * column[s]).collect()).collect();
            let game = matrix_game::solve(&payoffs);
            let weights: SurrogateWeights = active
                .iter()
                .zip(&game.rows)
                .filter(|(_, y)| **y > 1e-9)
                .map(|(&(s, sign), y)| (s, sign * y))
                .collect();
            let column = self.smallest(places, &known, &weights);
            let value: f64 = weights.iter().map(|&(s, y)| y * column[s]).sum();
            if value > best.0 {
                best = (value, weights);
            }
            if best.0 >= limit_rad_per_s * (1.0 + MARGIN) {
                return SurrogateVerdict::Refuted(best.1);
            }
            let is_settled = game.value - value <= TOLERANCE * limit_rad_per_s;
            if !is_settled && game.value >= limit_rad_per_s {
                columns.push(column);
                continue;
            }
            // With these samples the node cannot be refuted by more: those that the mixture violates join.
            let mixture = |s: usize| columns.iter().zip(&game.columns).map(|(c, share)| share * c[s]).sum::<f64>();
            let mut violated: Vec<(usize, f64)> = (0..self.rows.len())
                .map(|s| (s, mixture(s)))
                .filter(|(_, v)| v.abs() > game.value.max(limit_rad_per_s) * (1.0 + TOLERANCE))
                .filter(|(s, v)| !active.contains(&(*s, v.signum())))
                .collect();
            if violated.is_empty() {
                break;
            }
            violated.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()).then(a.0.cmp(&b.0)));
            active.extend(violated.iter().take(JOINING).map(|&(s, v)| (s, v.signum())));
            columns.push(column);
        }
        // The search itself rounds and leaves room for it.
        if best.0 >= limit_rad_per_s * (1.0 + 10.0 * TOLERANCE) {
            SurrogateVerdict::Refuted(best.1)
        } else {
            SurrogateVerdict::Open(best.1)
        }
    }

    /// What the placed layers add to each row.
    fn known(&self, places: &Places) -> Vec<f64> {
        let mut known: Vec<f64> = self.rows.iter().map(|row| row.constant).collect();
        for (term, (placed, _)) in self.factors.iter().zip(self.term_places(places)) {
            for (k, w) in placed.iter().enumerate() {
                add(&mut known, &term[self.layers - 1 - k], f64::from(*w));
            }
        }
        known
    }

    /// For each kind of term: the placed layers' places, outermost first, and the open ones in ascending order.
    fn term_places<'p>(&self, places: &'p Places) -> Vec<(Vec<f32>, &'p [f32])> {
        let mut terms = vec![(places.placed.clone(), places.open.as_slice())];
        if self.has_difference {
            terms.push((places.placed.iter().map(|w| -w.abs()).collect(), places.open_difference.as_slice()));
        }
        if self.has_axial {
            terms.push((places.signs.clone(), places.open_signs.as_slice()));
        }
        terms
    }

    /// The rows' values under the arrangement of the open layers that is smallest for a blend.
    fn smallest(&self, places: &Places, known: &[f64], weights: &SurrogateWeights) -> Vec<f64> {
        let mut column = known.to_vec();
        for (term, (_, open)) in self.factors.iter().zip(self.term_places(places)) {
            let mut order: Vec<(f64, usize)> =
                (0..open.len()).map(|j| (weights.iter().map(|&(s, y)| y * term[j][s]).sum::<f64>(), j)).collect();
            order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            for ((_, j), w) in order.iter().zip(open.iter().rev()) {
                add(&mut column, &term[*j], f64::from(*w));
            }
        }
        column
    }

    /// The single row, with its sign, whose bound is largest.
    fn strongest_row(&self, places: &Places, known: &[f64]) -> (usize, f64) {
        let mut best = (f64::NEG_INFINITY, (0, 1.0));
        for s in 0..self.rows.len() {
            for sign in [1.0, -1.0] {
                let value = sign * self.smallest(places, known, &vec![(s, sign)])[s];
                if value > best.0 {
                    best = (value, (s, sign));
                }
            }
        }
        best.1
    }
}

fn add(sum: &mut [f64], factors: &[f64], by: f64) {
    for (s, factor) in sum.iter_mut().zip(factors) {
        *s += factor * by;
    }
}

#[cfg(test)]
mod tests {
    use super::super::beam::promising;
    use super::*;
    use crate::pattern::windability::WindabilityClass;

    const LAYERS: usize = 6;

    /// Rows in no particular order, without a constant.
    fn rows() -> Vec<SampleRow> {
        let row = |s: usize| SampleRow {
            constant: 0.0,
            mean: (0..LAYERS).map(|j| ((s * s + 3 * s * j + 7 * j) as f64 * 0.9).sin()).collect(),
            difference: vec![0.0; LAYERS],
            axial: vec![0.0; LAYERS],
        };
        (0..12).map(row).collect()
    }

    fn smallest_by_enumeration(rows: &[SampleRow], places: &mut Vec<usize>) -> f64 {
        if places.len() == LAYERS {
            let weight = |j: usize| 2.0 * places[j] as f64 + 1.0 - LAYERS as f64;
            let value = |row: &SampleRow| (0..LAYERS).map(|j| row.mean[j] * weight(j)).sum::<f64>().abs();
            return rows.iter().map(value).fold(0.0, f64::max);
        }
        let mut smallest = f64::INFINITY;
        for place in 0..LAYERS {
            if !places.contains(&place) {
                places.push(place);
                smallest = smallest.min(smallest_by_enumeration(rows, places));
                places.pop();
            }
        }
        smallest
    }

    /// Nodes that a search under a limit leaves open, and the leaves among them.
    fn open_nodes(orders: &PermutationTree, node: &mut Node, limit: f64) -> (usize, usize) {
        let mut found = (0, usize::from(node.open == 0));
        for place in 0..LAYERS {
            if orders.place(node, place, true) {
                if orders.may_stay_under(node, limit as f32, &mut Places::default()) {
                    let below = open_nodes(orders, node, limit);
                    found = (found.0 + 1 + below.0, found.1 + below.1);
                }
                node.take_back();
            }
        }
        found
    }

    #[test]
    fn blends_keep_the_best_pattern_and_refute_everything_at_once_under_a_tenth_less() {
        let rows = rows();
        let lengths_m = [1.0; LAYERS];
        let best = smallest_by_enumeration(&rows, &mut Vec::new());
        let blender = Surrogates::new(&rows, &lengths_m, false, false);
        let open = |limit: f64| {
            let mut orders = PermutationTree::new(&lengths_m, WindabilityClass::Any, false, None);
            blender.teach(&mut orders, limit, true);
            open_nodes(&orders, &mut orders.root(), limit)
        };
        let (nodes, leaves) = open(best * (1.0 + 1e-4));
        assert_eq!(leaves, 1, "{nodes}");
        assert!(nodes < 100, "{nodes}");
        // A beam of 48 of the 6! / 2 patterns leads to the best one.
        let mut orders = PermutationTree::new(&lengths_m, WindabilityClass::Any, false, None);
        let limit = 1.05 * best;
        blender.teach(&mut orders, limit, true);
        let found = promising(&orders, limit, true, 48);
        let weight = |p: usize| 2.0 * p as f64 - 1.0 - LAYERS as f64;
        let value = |row: &SampleRow| (0..LAYERS).map(|j| row.mean[j] * weight(found[0][j])).sum::<f64>().abs();
        let worst = rows.iter().map(value).fold(0.0, f64::max);
        assert!(found.len() <= 48 && (worst / best - 1.0).abs() < 1e-6, "{worst} {best}");
        assert_eq!(open(0.9 * best).1, 0);
    }
}
