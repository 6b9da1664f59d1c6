//! The search over permutations: a descent from the outermost layer inwards.
//!
//! [`permutation_tree`](super::permutation_tree) bounds what a node can lead to.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::candidates::Judge;
use super::permutation_tree::{Node, PermutationTree, Places};
use super::{PassOutcome, StopWish};
use crate::parallel::InParallel;

/// Pieces of work that are shared out: more than threads, and always the same.
const SHARES: usize = 256;

/// Pieces that are searched under the same limit.
const TOGETHER: usize = 16;

/// One piece may take so many times its even share of the nodes allowed.
const UNEVENNESS: u64 = 8;

const NODES_PER_PAUSE: u64 = 1 << 12;

/// What all pieces of a search share.
#[derive(Clone, Copy)]
struct Search<'a, 'w> {
    orders: &'a PermutationTree,
    judge: &'a Judge<'a>,
    limit_rad_per_s: f64,
    mirrored: bool,
    most_nodes: u64,
    watch: &'a StopWish<'w>,
}

/// Judges every pattern that may stay under the limit.
pub(crate) fn search(
    orders: &PermutationTree,
    judge: &Judge,
    limit_rad_per_s: f64,
    mirrored: bool,
    watch: &StopWish,
) -> PassOutcome {
    let mut outcome = PassOutcome::default();
    let mut shares = vec![orders.root()];
    let mut places = Places::default();
    while shares.len() < SHARES && shares.iter().any(|n| n.open != 0) {
        let mut next = Vec::new();
        for share in &mut shares {
            for place in 0..orders.layers() {
                if orders.place(share, place, mirrored) {
                    outcome.nodes += 1;
                    if orders.may_stay_under(share, limit_rad_per_s as f32, &mut places) {
                        next.push(share.clone());
                    }
                    share.take_back();
                }
            }
        }
        shares = next;
    }
    let most_nodes = (watch.most_nodes / shares.len().max(1) as u64).saturating_mul(UNEVENNESS);
    let done = AtomicUsize::new(0);
    for together in shares.chunks(TOGETHER) {
        // What the pieces before found is a limit for these, at any number of threads.
        let limit_rad_per_s = outcome.best.as_ref().map_or(limit_rad_per_s, |best| best.rate_rad_per_s);
        let search = Search { orders, judge, limit_rad_per_s, mirrored, most_nodes, watch };
        let found: Vec<PassOutcome> = together
            .iter()
            .in_parallel()
            .map(|share| {
                let mut descent = Descent { search, places: Places::default(), found: PassOutcome::default() };
                descent.found.complete = descent.descend(&mut share.clone()).is_continue();
                let count = done.fetch_add(1, Ordering::Relaxed) + 1;
                let _ = watch.report(count as f64 / shares.len() as f64);
                descent.found
            })
            .collect();
        found.into_iter().for_each(|o| outcome.absorb(o));
        let is_enough = outcome.best.as_ref().is_some_and(|best| best.rate_rad_per_s <= watch.good_enough_rad_per_s);
        if outcome.overflowed || is_enough || watch.is_stopped() || outcome.nodes > watch.most_nodes {
            outcome.complete &= done.load(Ordering::Relaxed) == shares.len();
            break;
        }
    }
    outcome
}

/// The depth-first search of one piece.
struct Descent<'a, 'w> {
    search: Search<'a, 'w>,
    places: Places,
    found: PassOutcome,
}

impl Descent<'_, '_> {
    fn descend(&mut self, node: &mut Node) -> ControlFlow<()> {
        let Search { orders, judge, limit_rad_per_s, mirrored, most_nodes, watch } = self.search;
        if node.open == 0 {
            return self.found.judge(judge, &PermutationTree::segments(node), limit_rad_per_s, watch);
        }
        for place in 0..orders.layers() {
            if !orders.place(node, place, mirrored) {
                continue;
            }
            self.found.nodes += 1;
            if self.found.nodes > most_nodes {
                return ControlFlow::Break(());
            }
            if self.found.nodes.is_multiple_of(NODES_PER_PAUSE) {
                watch.pause()?;
            }
            if orders.may_stay_under(node, limit_rad_per_s as f32, &mut self.places) {
                self.descend(node)?;
            }
            node.take_back();
        }
        ControlFlow::Continue(())
    }
}
