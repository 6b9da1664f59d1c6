//! A broad and shallow look at the permutations: the pattern that a proof should begin with.
//!
//! Level by level, outermost layer first, the nodes with the smallest bounds are kept and the rest let go. The bounds are
//! those of the proof ([`permutation_tree`](super::permutation_tree)), so that what is kept is what the relaxation holds to be nearest to
//! the best; it proves nothing, and what it finds is judged as everything else. A better pattern to begin with is
//! a lower limit for the whole proof.
//!
//! # Source
//! Ow, Morton, Int. J. Prod. Res. 26, 35 (1988), beam search.

use super::permutation_tree::{Node, PermutationTree, Places};
use crate::parallel::InParallel;

/// Patterns whose bounds stay below the limit, most promising first, at most `width`.
pub(crate) fn promising(
    orders: &PermutationTree,
    limit_rad_per_s: f64,
    mirrored: bool,
    width: usize,
) -> Vec<Vec<usize>> {
    let limit = limit_rad_per_s as f32;
    let mut kept = vec![(0.0, orders.root())];
    for _ in 0..orders.layers() {
        let children = |(_, parent): &(f32, Node)| {
            let (mut node, mut places) = (parent.clone(), Places::default());
            let mut found = Vec::new();
            for place in 0..orders.layers() {
                if orders.place(&mut node, place, mirrored) {
                    let excess = orders.largest_excess(&node, limit, &mut places);
                    if excess < 0.0 {
                        found.push((excess, node.clone()));
                    }
                    node.take_back();
                }
            }
            found
        };
        let mut next: Vec<(f32, Node)> = kept.iter().in_parallel().flat_map(children).collect();
        let order = |a: &(f32, Node), b: &(f32, Node)| a.0.total_cmp(&b.0).then_with(|| a.1.places.cmp(&b.1.places));
        if next.len() > width {
            next.select_nth_unstable_by(width, order);
            next.truncate(width);
        }
        next.sort_unstable_by(order);
        kept = next;
    }
    kept.iter().map(|(_, node)| PermutationTree::segments(node)).collect()
}
