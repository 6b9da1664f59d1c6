//! The winding graph: can a pattern be wound, and what does it cost the operator.
//!
//! Nodes are the segments on their layers, edges the fibre's continuity from one segment to the next. Winding goes
//! from the innermost layer outwards. At each step the segments that are not wound yet fall into runs of fibre;
//! each run hangs on a supply reel. A run between two segments that are already on the coil is *captive*: both its
//! ends are held, so its reel must travel around the coil with every turn.

use petgraph::graph::{NodeIndex, UnGraph};
use petgraph::unionfind::UnionFind;
use petgraph::visit::{EdgeRef, NodeIndexable};

use super::Pattern;

/// A segment on its layer, both counted from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Placement {
    pub(crate) segment: usize,
    pub(crate) layer: usize,
}

/// The fibre passing from one segment to the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Crossover {
    /// How many layers lie between the two, counted outwards or inwards alike.
    pub(crate) climb: usize,
}

/// The fibre's continuity drawn over the layers.
#[derive(Debug, Clone)]
pub struct WindingGraph {
    graph: UnGraph<Placement, Crossover>,
    /// In the order of winding: the node wound at each step.
    order: Vec<NodeIndex>,
}

/// The state after one layer has been wound.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct WindingStep {
    /// Runs of fibre still unwound; each hangs on a reel.
    pub reels: usize,
    /// Those of them whose two ends are both on the coil.
    pub captive: usize,
    /// Largest climb of the crossovers that this step completes; 0 if it completes none.
    pub climb: usize,
    /// Layers that this step's segment is joined to and that are wound already, and how far away: at its low and high end.
    pub joined_low: Option<usize>,
    /// As `joined_low`, at the high end.
    pub joined_high: Option<usize>,
}

/// A pattern's demands on the winding shop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Windability {
    /// Most reels in use at any moment, the one that feeds included.
    pub reels: usize,
    /// Most captive runs at any moment.
    pub captive: usize,
    /// Largest number of layers that a crossover climbs.
    pub max_climb: usize,
    /// Crossovers that climb over at least one other layer.
    pub(crate) long_crossovers: usize,
}

/// How much a winding shop will put up with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum WindabilityClass {
    /// Never a captive run: the wound segments are always one interval. 2^(N−1) patterns.
    Standard,
    /// At most so many captive runs at any moment.
    Captive(usize),
    /// Any permutation.
    Any,
}

impl WindabilityClass {
    /// Whether the winding shop can wind it.
    pub fn admits(self, pattern: &Pattern) -> bool {
        match self {
            WindabilityClass::Standard => WindingGraph::new(pattern).windability().captive == 0,
            WindabilityClass::Captive(most) => WindingGraph::new(pattern).windability().captive <= most,
            WindabilityClass::Any => true,
        }
    }

    /// As written in model files: `standard`, `captive:K`, `any`.
    pub fn parse(text: &str) -> Option<Self> {
        match text {
            "standard" => Some(WindabilityClass::Standard),
            "any" => Some(WindabilityClass::Any),
            _ => text.strip_prefix("captive:")?.parse().ok().map(WindabilityClass::Captive),
        }
    }
}

impl std::fmt::Display for WindabilityClass {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            WindabilityClass::Standard => f.pad("standard"),
            WindabilityClass::Captive(most) => f.pad(&format!("captive:{most}")),
            WindabilityClass::Any => f.pad("any"),
        }
    }
}

impl Windability {
    /// The narrowest class that admits the pattern.
    pub fn class(&self) -> WindabilityClass {
        if self.captive == 0 { WindabilityClass::Standard } else { WindabilityClass::Captive(self.captive) }
    }
}

impl WindingGraph {
    /// One node a segment; an edge where a segment is wound upon another.
    pub fn new(pattern: &Pattern) -> Self {
        let pieces = pattern.pieces();
        let mut graph = UnGraph::with_capacity(pieces.len(), pieces.len() - 1);
        let nodes: Vec<NodeIndex> = pieces
            .iter()
            .map(|piece| graph.add_node(Placement { segment: piece.segment, layer: piece.layer + 1 }))
            .collect();
        for s in 1..nodes.len() {
            let climb = pieces[s].layer.abs_diff(pieces[s - 1].layer);
            graph.add_edge(nodes[s - 1], nodes[s], Crossover { climb });
        }
        let order = pattern.winding_order().into_iter().map(|piece| nodes[piece]).collect();
        Self { graph, order }
    }

    /// What each step of winding finds and leaves, from the innermost layer outwards.
    ///
    /// Walks the winding backwards: taking layers off the coil joins unwound segments into runs, and a union-find
    /// over the fibre's edges counts them.
    pub fn steps(&self) -> Vec<WindingStep> {
        let count = self.graph.node_count();
        let last = count - 1;
        let mut wound = vec![true; count];
        let mut runs = UnionFind::<usize>::new(count);
        let (mut run_count, mut free_runs) = (0usize, 0usize);
        let mut steps =
            vec![WindingStep { reels: 0, captive: 0, climb: 0, joined_low: None, joined_high: None }; count];
        for (step, &node) in self.order.iter().enumerate().rev() {
            let (mut climb, mut joined_low, mut joined_high) = (0, None, None);
            for edge in self.graph.edges(node) {
                let other = if edge.source() == node { edge.target() } else { edge.source() };
                if wound[self.graph.to_index(other)] {
                    climb = climb.max(edge.weight().climb);
                    let end = if other < node { &mut joined_low } else { &mut joined_high };
                    *end = Some(edge.weight().climb);
                }
            }
            steps[step] =
                WindingStep { reels: run_count, captive: run_count - free_runs, climb, joined_low, joined_high };
            // Take this segment off again: it joins the runs on both its sides.
            let at = self.graph.to_index(node);
            wound[at] = false;
            run_count += 1;
            for edge in self.graph.edges(node) {
                let other = self.graph.to_index(if edge.source() == node { edge.target() } else { edge.source() });
                if !wound[other] && runs.union(at, other) {
                    run_count -= 1;
                }
            }
            // The runs that hold the fibre's own ends are the ones that are not captive.
            free_runs = match (wound[0], wound[last]) {
                (true, true) => 0,
                (false, true) | (true, false) => 1,
                (false, false) => {
                    if runs.equiv(0, last) {
                        1
                    } else {
                        2
                    }
                }
            };
        }
        steps
    }

    /// The cheapest way to wind it.
    pub fn windability(&self) -> Windability {
        let steps = self.steps();
        let climbs = || self.graph.edge_references().map(|e| e.weight().climb);
        // Before the first layer the whole fibre hangs on one reel; a first layer from the middle needs two.
        Windability {
            reels: steps.iter().map(|s| s.reels).max().unwrap_or(0).max(1),
            captive: steps.iter().map(|s| s.captive).max().unwrap_or(0),
            max_climb: climbs().max().unwrap_or(0),
            long_crossovers: climbs().filter(|&c| c > 1).count(),
        }
    }

    /// The first step that leaves a captive run, and the run's segments: why a pattern is hard to make.
    pub fn first_captive_run(&self) -> Option<CaptiveRun> {
        let step = self.steps().iter().position(|s| s.captive > 0)?;
        let mut wound: Vec<usize> = self.order[..=step].iter().map(|&n| self.graph[n].segment).collect();
        wound.sort_unstable();
        wound.windows(2).find(|w| w[1] > w[0] + 1).map(|w| CaptiveRun {
            after_layer: step + 1,
            first_segment: w[0] + 1,
            last_segment: w[1] - 1,
        })
    }
}

/// A run of fibre both ends of which are on the coil already.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CaptiveRun {
    /// Counted from 1.
    pub(crate) after_layer: usize,
    pub(crate) first_segment: usize,
    pub(crate) last_segment: usize,
}

impl std::fmt::Display for CaptiveRun {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "after layer {} the fibre of segments {} to {} is held at both its ends, by segments {} and {} on the coil",
            self.after_layer,
            self.first_segment,
            self.last_segment,
            self.first_segment - 1,
            self.last_segment + 1
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pattern::classic::Classic;

    fn of(classic: Classic, layers: usize) -> Windability {
        WindingGraph::new(&classic.pattern(layers).unwrap()).windability()
    }

    #[test]
    fn the_classics_but_sym_are_standard() {
        for classic in Classic::ALL {
            let found = of(classic, 16);
            if classic == Classic::Sym {
                assert_eq!(found.class(), WindabilityClass::Captive(1));
            } else {
                assert_eq!(found.class(), WindabilityClass::Standard, "{classic:?}");
            }
        }
    }

    #[test]
    fn cylindrical_needs_one_reel_and_the_dipole_two() {
        assert_eq!((of(Classic::Zyl, 12).reels, of(Classic::Zyl, 12).max_climb), (1, 1));
        assert_eq!((of(Classic::Dip, 12).reels, of(Classic::Dip, 12).max_climb), (2, 2));
        assert_eq!((of(Classic::Qua, 12).reels, of(Classic::Qua, 12).max_climb), (2, 3));
    }

    #[test]
    fn the_graph_says_why_sym_is_hard_to_make() {
        let graph = WindingGraph::new(&Classic::Sym.pattern(12).unwrap());
        let run = graph.first_captive_run().unwrap();
        assert_eq!(run, CaptiveRun { after_layer: 7, first_segment: 7, last_segment: 11 });
        assert_eq!(
            run.to_string(),
            "after layer 7 the fibre of segments 7 to 11 is held at both its ends, by segments 6 and 12 on the coil"
        );
    }

    #[test]
    fn counting_by_scanning_the_segments_agrees_for_every_pattern_of_six_layers() {
        let mut standard = 0;
        for_each_permutation(6, &mut |segments| {
            let pattern = Pattern::new(segments.to_vec()).unwrap();
            let steps = WindingGraph::new(&pattern).steps();
            let mut wound = [false; 6];
            for (layer, step) in steps.iter().enumerate() {
                wound[pattern.segment(layer) - 1] = true;
                let runs: Vec<(usize, usize)> = runs_of_unwound(&wound);
                assert_eq!(step.reels, runs.len());
                assert_eq!(step.captive, runs.iter().filter(|(a, b)| *a > 0 && *b < 5).count());
            }
            standard += usize::from(WindabilityClass::Standard.admits(&pattern));
        });
        assert_eq!(standard, 1 << 5);
    }

    fn runs_of_unwound(wound: &[bool]) -> Vec<(usize, usize)> {
        let mut runs: Vec<(usize, usize)> = Vec::new();
        for (i, _) in wound.iter().enumerate().filter(|(_, w)| !**w) {
            match runs.last_mut() {
                Some(run) if run.1 + 1 == i => run.1 = i,
                _ => runs.push((i, i)),
            }
        }
        runs
    }

    fn for_each_permutation(n: usize, visit: &mut dyn FnMut(&[usize])) {
        fn descend(rest: &mut Vec<usize>, done: &mut Vec<usize>, visit: &mut dyn FnMut(&[usize])) {
            if rest.is_empty() {
                visit(done);
            }
            for i in 0..rest.len() {
                let segment = rest.remove(i);
                done.push(segment);
                descend(rest, done, visit);
                done.pop();
                rest.insert(i, segment);
            }
        }
        descend(&mut (1..=n).collect(), &mut Vec::new(), visit);
    }
}
