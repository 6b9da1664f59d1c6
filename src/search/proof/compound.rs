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
//! | `standard` | a layer goes to the other end of what lies inside it | where the halves respond alike |
//! | `captive:K`, `any` | two neighbouring runs of segments change places whole | for layers of any lengths, but for a run across the middle where the halves differ |
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

use std::ops::ControlFlow;

use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::box_join::{BoxStep, Matching, Target, Tree};
use super::candidates::{Judge, PatternCandidate};
use super::sampling::neighbours;
use super::{PassOutcome, Task, checked_judge, first_best};
use crate::pattern::Pattern;
use crate::pattern::windability::WindabilityClass;
use crate::search::anneal::limits::{WindingLimits, pick};
use crate::search::anneal::restart::generator;
use crate::search::cost::signs::{segments_of_signs, signs_of_segments};
use crate::search::cost::worst_case::SearchError;

/// Moves of a neighbourhood at most: both sets of their sums are made in milliseconds.
const MOST_MOVES: usize = 32;

/// Samples by which subsets are refuted at first, and at most.
const FIRST_SAMPLES: usize = 16;
const MOST_SAMPLES: usize = 32;

/// Patterns that are followed, each on its own.
const CHAINS: usize = 4;

/// Neighbourhoods that are looked at in a round, shared out over the chains.
const DRAWN: usize = 8;

/// Rounds without a better pattern after which the search ends, and rounds at most.
const PATIENCE: usize = 4;
const MOST_ROUNDS: usize = 32;

/// Limits over a pattern's own value that are tried in turn: the smallest under which there is something is searched.
const SHARES: [f64; 5] = [0.1, 0.25, 0.5, 0.8, 1.0];

/// Subsets of a neighbourhood that are looked at under one limit, and those of them that are judged.
const MOST_MATCHES: usize = 4096;
const MOST_JUDGED: usize = 64;

/// Streams of random numbers, far from those of the annealing.
const FIRST_STREAM: u64 = u64::MAX / 4;

/// The best pattern that comes of given ones, at worst the best of them. The same patterns and seed give the same one, at
/// any number of threads.
///
/// # Errors
/// As [`super::prove`].
pub(crate) fn compounded(task: &Task, starts: &[Pattern], seed: u64) -> Result<Pattern, SearchError> {
    let mut judge = checked_judge(task)?;
    let best = first_best(&mut judge, task.class, starts)?;
    let admitted: Vec<Pattern> = starts.iter().filter(|p| task.class.admits(p)).cloned().collect();
    let mut chains = vec![best];
    for start in admitted.iter() {
        if chains.iter().all(|known| known.segments != start.segments()) && chains.len() < CHAINS {
            chains.push(judge.candidate_and_witness(start)?.0);
        }
    }
    let layers = task.model.coil.layers();
    let mut samples = judge.binding_samples(&neighbours(task.class, &admitted), FIRST_SAMPLES);
    let mut idle = 0;
    for round in 0..MOST_ROUNDS {
        chains.sort_by(|a, b| a.rate_rad_per_s.total_cmp(&b.rate_rad_per_s).then_with(|| a.segments.cmp(&b.segments)));
        if idle == PATIENCE {
            break;
        }
        // Where nothing has come of all, the better half has the whole effort.
        chains.truncate((CHAINS >> idle).max(1));
        // With few layers one neighbourhood is the whole class.
        let draws = if task.class == WindabilityClass::Standard && layers <= MOST_MOVES { 1 } else { DRAWN };
        let before_rad_per_s = chains[0].rate_rad_per_s;
        judge.try_first(&samples);
        let drawn: Vec<(usize, Neighbourhood)> = (0..draws)
            .map(|index| {
                let mut random = generator(seed, FIRST_STREAM + (round * DRAWN + index) as u64);
                let chain = index % chains.len();
                (chain, Neighbourhood::draw(task.class, &chains[chain].segments, &mut random))
            })
            .collect();
        let found: Vec<PassOutcome> = drawn
            .par_iter()
            .map(|(chain, drawn)| drawn.search(&judge, &samples, task.class, chains[*chain].rate_rad_per_s))
            .collect();
        let mut whole = PassOutcome::default();
        for ((chain, _), mut outcome) in drawn.iter().zip(found) {
            if let Some(better) = outcome.best.take() {
                chains[*chain] = chains[*chain].clone().better(better);
            }
            whole.absorb(outcome);
        }
        join(&mut judge, &mut samples, &whole);
        let is_better =
            |chain: &PatternCandidate| chain.rate_rad_per_s < before_rad_per_s * (1.0 - super::RELATIVE_TOLERANCE);
        idle = if chains.iter().any(is_better) { 0 } else { idle + 1 };
    }
    let best = chains.swap_remove(0);
    Ok(Pattern::new(best.segments).expect("moves make permutations only"))
}

/// What refuted patterns that had stayed under the limit at the samples so far, as often as it did.
fn join(judge: &mut Judge, samples: &mut Vec<usize>, outcome: &PassOutcome) {
    let first_new = judge.matrix().samples();
    let mut joining: Vec<usize> = Vec::new();
    if judge.add_witnesses(&outcome.between) {
        joining.extend(first_new..judge.matrix().samples());
    }
    let mut sorted = outcome.refuting.clone();
    sorted.sort_unstable();
    let mut counted: Vec<(usize, usize)> = sorted.chunk_by(|a, b| a == b).map(|c| (c.len(), c[0])).collect();
    counted.sort_by_key(|&(count, sample)| (std::cmp::Reverse(count), sample));
    joining.extend(counted.into_iter().map(|(_, sample)| sample));
    joining.retain(|sample| !samples.contains(sample));
    let room = (samples.len() + FIRST_SAMPLES).min(MOST_SAMPLES).saturating_sub(samples.len());
    samples.extend(joining.into_iter().take(room));
}

/// A move that can be made or left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Move {
    /// The layer outside the numbered one goes to the other end of what lies inside it.
    End(usize),
    /// The segments after the first `from` up to the first `middle` change places with those up to the first `to`.
    Exchange { from: usize, middle: usize, to: usize },
}

/// A pattern, and moves that do not touch each other; what lies inside another one comes before it.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Neighbourhood {
    segments: Vec<usize>,
    moves: Vec<Move>,
}

impl Neighbourhood {
    /// By itself each move stays within the class; most sets of such moves then do.
    fn draw(class: WindabilityClass, segments: &[usize], random: &mut ChaCha8Rng) -> Self {
        let layers = segments.len();
        let mut all: Vec<Move> = if class == WindabilityClass::Standard {
            (0..layers - 1).map(Move::End).collect()
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
            Move::End(_) => 0,
            Move::Exchange { from, to, .. } => to - from,
        });
        drawn
    }

    fn with(&self, moves: &[Move]) -> Vec<usize> {
        let mut high = None;
        let mut order = vec![0; self.segments.len()];
        for (layer, &segment) in self.segments.iter().enumerate() {
            order[segment - 1] = layer;
        }
        for made in moves {
            match *made {
                Move::Exchange { from, middle, to } => order[from..to].rotate_left(middle - from),
                Move::End(layer) => {
                    let high = high.get_or_insert_with(|| signs_of_segments(&self.segments).unwrap_or_default());
                    if let Some(end) = high.get_mut(layer) {
                        *end = !*end;
                    }
                }
            }
        }
        if let Some(high) = high {
            return segments_of_signs(&high);
        }
        let mut segments = vec![0; order.len()];
        for (at, &layer) in order.iter().enumerate() {
            segments[layer] = at + 1;
        }
        segments
    }

    /// The best of the patterns below the limit that were judged, and what refuted others.
    fn search(&self, judge: &Judge, samples: &[usize], class: WindabilityClass, limit_rad_per_s: f64) -> PassOutcome {
        let mut outcome = PassOutcome::default();
        if self.moves.len() < 2 || limit_rad_per_s == 0.0 {
            return outcome;
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
        let matching = Matching { left: &trees[0], right: &trees[1] };
        let predicted = |number: u64| -> f64 {
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
        for share in SHARES {
            let reach = limit_rad_per_s * share;
            let target = Target::new(samples.iter().map(|_| (-reach, reach)));
            let mut numbers = Vec::new();
            let is_whole = matching.visit_all(&target, &mut outcome.nodes, &mut |step| {
                if let BoxStep::Match { left: l, right: r } = step {
                    numbers.push(u64::from(l) | u64::from(r) << left.len());
                }
                if numbers.len() < MOST_MATCHES { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
            });
            let mut sorted: Vec<(f64, u64)> = numbers.into_iter().map(|number| (predicted(number), number)).collect();
            sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let mut judged = 0;
            for (_, number) in sorted {
                let made: Vec<Move> =
                    self.moves.iter().enumerate().filter(|(k, _)| number >> k & 1 == 1).map(|(_, m)| *m).collect();
                let segments = self.with(&made);
                if judged == MOST_JUDGED || !WindingLimits::from(class).admits(&segments) {
                    continue;
                }
                judged += 1;
                outcome.consider(judge, &segments, limit_rad_per_s);
            }
            if outcome.best.is_some() || is_whole.is_break() {
                break;
            }
        }
        outcome
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
    use crate::search::cost::samples::tests::{model, profiles};
    use crate::search::cost::worst_case::SolvedProfiles;
    use crate::search::proof::Goal;

    #[test]
    fn exchanges_of_runs_add_up_exactly_for_layers_of_different_lengths() {
        let model = model(12, LayerLength::Actual, &["surface_film"]);
        let solved = SolvedProfiles::new(&model, &profiles()).unwrap();
        let class = WindabilityClass::Any;
        let judge = checked_judge(&Task { model: &model, solved: &solved, class, goal: Goal::Pointing }).unwrap();
        let samples: Vec<usize> = (0..judge.matrix().samples()).collect();
        for stream in 0..20 {
            let mut random = generator(1, stream);
            let start = crate::search::anneal::limits::draw(class, 12, &mut random);
            let drawn = Neighbourhood::draw(class, &start, &mut random);
            assert_eq!(drawn.moves.len(), 11, "a fibre of twelve segments has eleven cuts");
            let here = judge.values_at(&samples, &start);
            let made: Vec<Move> = drawn.moves.iter().copied().filter(|_| pick(&mut random, 2) == 1).collect();
            let mut expected = here.clone();
            for a_move in &made {
                let there = judge.values_at(&samples, &drawn.with(&[*a_move]));
                expected.iter_mut().zip(there.iter().zip(&here)).for_each(|(e, (t, h))| *e += t - h);
            }
            let found = judge.values_at(&samples, &drawn.with(&made));
            let scale = expected.iter().chain(&here).fold(0.0_f64, |most, v| most.max(v.abs()));
            for (e, f) in expected.iter().zip(&found) {
                assert!((e - f).abs() < 1e-10 * scale, "{e} {f} of {scale}");
            }
        }
    }
}
