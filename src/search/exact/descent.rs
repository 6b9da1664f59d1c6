//! The search over permutations: a descent from the outermost layer inwards, and a meeting with the innermost ones.
//!
//! [`orders`](super::orders) bounds what a node can lead to. With equal lengths the descent ends
//! [`INNER_LAYERS`] above the leaves: the nodes that are left are gathered by their open places, and
//! [`inner`](super::inner) completes those of one group together.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use super::inner::{INNER_LAYERS, Inner};
use super::judge::Judge;
use super::orders::{Node, Orders, Places};
use super::{Outcome, Watch};

/// Pieces of work that are shared out: more than threads, and always the same.
const SHARES: usize = 256;

/// Pieces whose nodes are completed together.
const SHARES_TOGETHER: usize = 128;

/// One piece may take so many times its even share of the nodes allowed.
const UNEVENNESS: u64 = 8;

const NODES_PER_PAUSE: u64 = 1 << 12;

/// Nodes that one piece gathers before it completes them on its own.
const MOST_GATHERED: usize = 1 << 15;

/// What all pieces of a search share.
#[derive(Clone, Copy)]
struct Search<'a, 'w> {
    orders: &'a Orders,
    judge: &'a Judge<'a>,
    limit_rad_per_s: f64,
    mirrored: bool,
    most_nodes: u64,
    watch: &'a Watch<'w>,
    /// Layers that are not descended into.
    inner: usize,
}

/// Judges every pattern that may stay under the limit.
pub fn search(orders: &Orders, judge: &Judge, limit_rad_per_s: f64, mirrored: bool, watch: &Watch) -> Outcome {
    let inner = if orders.equal() { INNER_LAYERS.min(orders.layers()) } else { 0 };
    let mut outcome = Outcome::default();
    let mut shares = vec![orders.root()];
    let mut places = Places::default();
    while shares.len() < SHARES && shares.iter().any(|n| n.open_count() > inner) {
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
    let search = Search { orders, judge, limit_rad_per_s, mirrored, most_nodes, watch, inner };
    let done = AtomicUsize::new(0);
    for together in shares.chunks(SHARES_TOGETHER) {
        let descents: Vec<(Outcome, Vec<Node>)> = together
            .par_iter()
            .map(|share| {
                let mut descent = Descent::new(search);
                descent.found.complete = descent.descend(&mut share.clone()).is_continue();
                let count = done.fetch_add(1, Ordering::Relaxed) + 1;
                let _ = watch.report(count as f64 / shares.len() as f64);
                (descent.found, descent.gathered)
            })
            .collect();
        let mut gathered = Vec::new();
        for (found, nodes) in descents {
            outcome.absorb(found);
            gathered.extend(nodes);
        }
        let completed: Vec<Outcome> = by_open_places(&mut gathered).par_iter().map(|g| search.complete(g)).collect();
        completed.into_iter().for_each(|o| outcome.absorb(o));
        if watch.is_stopped() {
            outcome.complete &= done.load(Ordering::Relaxed) == shares.len();
            break;
        }
    }
    outcome
}

/// Nodes that leave the same places open, each group in the order of the descent.
fn by_open_places(nodes: &mut [Node]) -> Vec<&[Node]> {
    nodes.sort_by_key(|n| n.open);
    nodes.chunk_by(|a, b| a.open == b.open).collect()
}

impl Search<'_, '_> {
    /// Completes nodes that leave the same places open.
    fn complete(&self, group: &[Node]) -> Outcome {
        let mut found = Outcome::default();
        found.complete = self.complete_into(group, &mut found).is_continue();
        found
    }

    fn complete_into(&self, group: &[Node], found: &mut Outcome) -> ControlFlow<()> {
        let inner = Inner::new(self.orders, group[0].open);
        let (mut low, mut high) = (Vec::new(), Vec::new());
        let mut places: Vec<Vec<u8>> = Vec::new();
        for node in group {
            self.orders.room(node, self.limit_rad_per_s as f32, &mut low, &mut high);
            inner.matches(&low, &high, &mut found.nodes, |inner| places.push([&node.places, inner].concat()));
            for places in places.drain(..) {
                let segments = Orders::segments(&Node { places, open: 0 });
                found.judge(self.judge, &segments, self.limit_rad_per_s, self.watch)?;
            }
        }
        self.watch.pause()
    }
}

/// The depth-first search of one piece.
struct Descent<'a, 'w> {
    search: Search<'a, 'w>,
    places: Places,
    gathered: Vec<Node>,
    found: Outcome,
}

impl<'a, 'w> Descent<'a, 'w> {
    fn new(search: Search<'a, 'w>) -> Self {
        Self { search, places: Places::default(), gathered: Vec::new(), found: Outcome::default() }
    }

    fn descend(&mut self, node: &mut Node) -> ControlFlow<()> {
        let Search { orders, judge, limit_rad_per_s, mirrored, most_nodes, watch, inner } = self.search;
        if node.open_count() <= inner {
            if node.open == 0 {
                return self.found.judge(judge, &Orders::segments(node), limit_rad_per_s, watch);
            }
            self.gathered.push(node.clone());
            return if self.gathered.len() < MOST_GATHERED { ControlFlow::Continue(()) } else { self.complete_own() };
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

    fn complete_own(&mut self) -> ControlFlow<()> {
        let mut gathered = std::mem::take(&mut self.gathered);
        for group in by_open_places(&mut gathered) {
            self.search.complete_into(group, &mut self.found)?;
        }
        ControlFlow::Continue(())
    }
}
