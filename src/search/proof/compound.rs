//! Many small moves at once: what finds a better pattern where no single move, and no pair of them, is one.
//!
//! Where the goal is nearly one linear form of the weights (the pointing error: differences of temperature have hardly more
//! than one shape) the search is a partition of numbers, and its landscape has a minimum at almost every pattern. What still helps is to
//! choose among very many patterns at once. Around a pattern x, moves that do not touch each other are drawn, each of
//! which can be made or left:
//!
//! ```text
//! v(x with the moves of M) ≈ v(x) + Σ_{a in M} ( v(x with a) − v(x) )             every subset M of up to 2^32 of them
//! ```
//!
//! The subsets whose values stay under the limit at chosen samples are found by two sets of sums ([`box_join`](super::box_join)), the
//! most promising are judged in full, and what refutes them joins the samples.
//!
//! | class | a move | where the sum is exact |
//! |---|---|---|
//! | `standard`, `captive:K`, `any` | a layer goes to the other end of the inner layers that it joins | where the halves respond alike |
//! | `captive:K`, `any` | two neighbouring runs of segments change places whole | for layers of any lengths, but for a run across the middle where the halves differ |
//!
//! A layer that goes to the other end takes along no run that it was not at before, so that every set of such moves leaves as many
//! captive runs as there were.
//!
//! That runs of different lengths shift nothing that another move touches is because they are drawn as a tree: the fibre is cut in two at
//! random, each part again, down to single segments, and every cut can have its two parts exchanged or not. Where the halves respond alike
//! what two layers contribute depends on which of them comes first on the fibre and on nothing else,
//!
//! ```text
//! Σ_j T_j ∫_j (L − 2z) dz = Σ over pairs, j before k, of l_j l_k (T_j − T_k)
//! ```
//!
//! and each pair is parted by one cut.
//!
//! # Source
//! Sets of sums: Horowitz and Sahni, J. ACM 21, 277 (1974). Large neighbourhoods: Ahuja, Ergun, Orlin, Punnen, Discrete Appl.
//! Math. 123, 75 (2002).

use rand_chacha::ChaCha8Rng;

use super::box_join::{Matching, Tree};
use super::candidates::Judge;
use super::neighbourhood::{Following, Matches, Neighbourhood, followed};
use super::{PassOutcome, Task};
use crate::pattern::windability::WindabilityClass;
use crate::pattern::{Pattern, layers_by_segment, segments_by_layer};
use crate::search::anneal::limits::{WindingLimits, layers_at_an_end, pick, to_other_end};
use crate::search::cost::worst_case::SearchError;

/// Moves of a neighbourhood at most: both sets of their sums are made in milliseconds.
const MOST_MOVES: usize = 32;

/// How far patterns are followed by default.
const COURSE: Following =
    Following { chains: 4, drawn: 8, patience: 4, most_rounds: 32, seed: 0, first_stream: u64::MAX / 4 };

/// With fewer layers a neighbourhood is smaller and found in less time: for every so many layers fewer than [`MOST_MOVES`] there is twice
/// as much of everything, doubled so often at most. On 20 layers seeds then end on one pattern by rms, 15 and 40 % below what they ended on, in the time that it took.
const MOVES_PER_DOUBLING: usize = 4;
const MOST_DOUBLINGS: usize = 3;

/// The best pattern that comes of given ones, at worst the best of them. The same patterns and seed give the same one, at
/// any number of threads.
///
/// # Errors
/// As [`super::prove`].
pub(crate) fn compounded(task: &Task, starts: &[Pattern], seed: u64) -> Result<Pattern, SearchError> {
    let layers = task.model.coil.layers();
    if task.class == WindabilityClass::Standard && layers <= MOST_MOVES {
        // One neighbourhood is the whole class.
        return followed::<Moves>(task, starts, Following { drawn: 1, seed, ..COURSE });
    }
    let more = 1 << (MOST_MOVES.saturating_sub(layers) / MOVES_PER_DOUBLING).min(MOST_DOUBLINGS);
    let course = Following {
        chains: COURSE.chains * more,
        drawn: COURSE.drawn * more,
        patience: COURSE.patience * more,
        most_rounds: COURSE.most_rounds * more,
        seed,
        ..COURSE
    };
    followed::<Moves>(task, starts, course)
}

/// A move that can be made or left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Move {
    /// The layer goes to the other end of the run of inner layers at one end of which it lies.
    End(usize),
    /// The segments after the first `from` up to the first `middle` change places with those up to the first `to`.
    Exchange { from: usize, middle: usize, to: usize },
}

/// A pattern, and moves that do not touch each other; what lies inside another one comes before it.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Moves {
    segments: Vec<usize>,
    moves: Vec<Move>,
}

impl Neighbourhood for Moves {
    const SHARES: &'static [f64] = &[0.1, 0.25, 0.5, 0.8, 1.0];
    const MOST_JUDGED: usize = 64;

    /// By itself each move stays within the class; most sets of such moves then do.
    fn draw(class: WindabilityClass, segments: &[usize], random: &mut ChaCha8Rng) -> Self {
        let layers = segments.len();
        let is_of_ends = match class {
            WindabilityClass::Standard => true,
            WindabilityClass::Captive(_) | WindabilityClass::Any => pick(random, 2) == 1,
        };
        let mut all: Vec<Move> = if is_of_ends {
            layers_at_an_end(segments).into_iter().map(Move::End).collect()
        } else {
            cuts(layers, random)
        };
        for i in (1..all.len()).rev() {
            all.swap(i, pick(random, i + 1));
        }
        // Those that change least first: their sums lie closest together.
        all.sort_by_key(|made| match *made {
            Move::End(_) => 0,
            Move::Exchange { from, middle, to } => (middle - from) * (to - middle),
        });
        let limits = WindingLimits::from(class);
        let mut drawn = Self { segments: segments.to_vec(), moves: Vec::new() };
        for made in all {
            if drawn.moves.len() < MOST_MOVES && limits.admits(&drawn.with(&[made])) {
                drawn.moves.push(made);
            }
        }
        drawn.moves.sort_by_key(|made| match *made {
            Move::End(layer) => layer,
            Move::Exchange { from, to, .. } => to - from,
        });
        drawn
    }

    fn search(&self, judge: &Judge, samples: &[usize], class: WindabilityClass, limit_rad_per_s: f64) -> PassOutcome {
        if self.moves.len() < 2 || limit_rad_per_s == 0.0 {
            return PassOutcome::default();
        }
        let here = judge.values_at(samples, &self.segments);
        let halves: Vec<Vec<f64>> = self
            .moves
            .iter()
            .map(|made| {
                let there = judge.values_at(samples, &self.with(std::slice::from_ref(made)));
                there.iter().zip(&here).map(|(there, here)| 0.5 * (there - here)).collect()
            })
            .collect();
        let (left, right) = halves.split_at(halves.len() / 2);
        let middle: Vec<f64> =
            (0..samples.len()).map(|s| here[s] + halves.iter().map(|half| half[s]).sum::<f64>()).collect();
        let trees = [Tree::of_corners(&middle, left), Tree::of_corners(&vec![0.0; samples.len()], right)];
        let number = |l: u32, r: u32| u64::from(l) | u64::from(r) << left.len();
        let predicted = |l: u32, r: u32| -> f64 {
            let number = number(l, r);
            let of = |s: usize| {
                let sum: f64 = halves
                    .iter()
                    .enumerate()
                    .map(|(k, half)| if number >> k & 1 == 1 { half[s] } else { -half[s] })
                    .sum();
                (middle[s] + sum).abs()
            };
            (0..samples.len()).map(of).fold(0.0, f64::max)
        };
        let pattern = |l: u32, r: u32| {
            let number = number(l, r);
            let made: Vec<Move> =
                self.moves.iter().enumerate().filter(|(k, _)| number >> k & 1 == 1).map(|(_, m)| *m).collect();
            Some(self.with(&made)).filter(|segments| WindingLimits::from(class).admits(segments))
        };
        let matches = Matches {
            matching: Matching { left: &trees[0], right: &trees[1] },
            samples: samples.len(),
            limit_rad_per_s,
            pattern: &pattern,
            predicted: &predicted,
        };
        matches.judged::<Self>(judge)
    }
}

impl Moves {
    fn with(&self, moves: &[Move]) -> Vec<usize> {
        let mut order = layers_by_segment(&self.segments);
        for made in moves {
            match *made {
                Move::Exchange { from, middle, to } => order[from..to].rotate_left(middle - from),
                Move::End(layer) => to_other_end(&mut order, layer),
            }
        }
        segments_by_layer(&order)
    }
}

/// Every cut of a fibre that is cut at random down to single segments.
fn cuts(segments: usize, random: &mut ChaCha8Rng) -> Vec<Move> {
    let mut cuts = Vec::new();
    let mut parts = vec![(0, segments)];
    while let Some((from, to)) = parts.pop() {
        if to - from < 2 {
            continue;
        }
        let middle = from + 1 + pick(random, to - from - 1);
        cuts.push(Move::Exchange { from, middle, to });
        parts.extend([(from, middle), (middle, to)]);
    }
    cuts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coil::LayerLength;
    use crate::pattern::windability::WindingGraph;
    use crate::search::anneal::limits::neighbour;
    use crate::search::anneal::restart::generator;
    use crate::search::cost::samples::tests::{model, profiles};
    use crate::search::cost::worst_case::SolvedProfiles;
    use crate::search::proof::{Goal, checked_judge};

    /// Values of all subsets of moves are sums of those of the moves alone; says how many moves of each kind there were.
    fn assert_sums_are_exact(class: WindabilityClass) -> (usize, usize) {
        let model = model(12, LayerLength::Actual, &["surface_film"]);
        let solved = SolvedProfiles::new(&model, &profiles()).unwrap();
        let judge = checked_judge(&Task { model: &model, solved: &solved, class, goal: Goal::Pointing }).unwrap();
        let samples: Vec<usize> = (0..judge.matrix().samples()).collect();
        let captive =
            |segments: &[usize]| WindingGraph::new(&Pattern::new(segments.to_vec()).unwrap()).windability().captive;
        let (mut ends, mut exchanges) = (0, 0);
        for stream in 0..40 {
            let mut random = generator(1, stream);
            let mut start = crate::search::anneal::limits::draw(class, 12, &mut random);
            for _ in 0..200 {
                start = neighbour(class.into(), &start, &mut random).unwrap_or(start);
            }
            let drawn = Moves::draw(class, &start, &mut random);
            let here = judge.values_at(&samples, &start);
            let made: Vec<Move> = drawn.moves.iter().copied().filter(|_| pick(&mut random, 2) == 1).collect();
            let mut expected = here.clone();
            for a_move in &made {
                let there = judge.values_at(&samples, &drawn.with(&[*a_move]));
                expected.iter_mut().zip(there.iter().zip(&here)).for_each(|(e, (t, h))| *e += t - h);
            }
            let with_all = drawn.with(&made);
            let found = judge.values_at(&samples, &with_all);
            let scale = expected.iter().chain(&here).fold(0.0_f64, |most, v| most.max(v.abs()));
            for (e, f) in expected.iter().zip(&found) {
                assert!((e - f).abs() < 1e-10 * scale, "{class}: {e} {f} of {scale}");
            }
            if drawn.moves.iter().all(|m| matches!(m, Move::End(_))) {
                assert_eq!(captive(&with_all), captive(&start), "{start:?} {made:?}");
                ends += drawn.moves.len();
            } else {
                exchanges += drawn.moves.len();
            }
        }
        (ends, exchanges)
    }

    #[test]
    fn moves_that_do_not_touch_each_other_add_up_exactly_for_layers_of_different_lengths() {
        assert_eq!(assert_sums_are_exact(WindabilityClass::Standard), (40 * 11, 0));
        let (ends, exchanges) = assert_sums_are_exact(WindabilityClass::Captive(1));
        assert!(ends > 100 && exchanges > 0, "{ends} {exchanges}");
        assert_sums_are_exact(WindabilityClass::Any);
    }
}
