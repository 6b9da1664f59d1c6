//! Patterns followed through neighbourhoods that are too large to be walked: what is drawn around each, and how it goes on.
//!
//! A neighbourhood is a set of patterns whose values at samples are sums of two parts, so that those under a limit are found by two
//! sets of sums ([`box_join`](super::box_join)) without looking at all of them. The most promising are judged in full, the best takes the
//! place of the pattern around which it was found, and what refuted the others joins the samples.
//!
//! | neighbourhood | of |
//! |---|---|
//! | moves that do not touch each other, made or left | [`compound`](super::compound) |
//! | stretches of the fibre in every order | [`stretches`](super::stretches) |

use std::ops::ControlFlow;

use rand_chacha::ChaCha8Rng;

use super::box_join::{BoxStep, Matching, Target};
use super::candidates::{Judge, PatternCandidate};
use super::sampling::neighbours;
use super::{PassOutcome, Task, checked_judge, first_best};
use crate::parallel::InParallel;
use crate::pattern::Pattern;
use crate::pattern::windability::WindabilityClass;
use crate::search::anneal::restart::generator;
use crate::search::cost::worst_case::SearchError;

/// Samples by which patterns are refuted at first, and at most.
const FIRST_SAMPLES: usize = 16;
const MOST_SAMPLES: usize = 32;

/// Matches of a neighbourhood that are looked at under one limit.
const MOST_MATCHES: usize = 4096;

/// Matches under one limit that are asked whether they are of the class.
const MOST_LOOKED_AT: usize = 1 << 20;

/// Streams of random numbers that a round has to itself at least.
const FEWEST_STREAMS: usize = 8;

/// Patterns around a given one.
pub(super) trait Neighbourhood: Sync + Sized {
    /// The limits over a pattern's own value that are tried in turn: the smallest under which there is something is searched.
    const SHARES: &'static [f64];
    /// Patterns that are judged of those under a limit, the most promising.
    const MOST_JUDGED: usize;

    /// The same random numbers draw the same one.
    fn draw(class: WindabilityClass, segments: &[usize], random: &mut ChaCha8Rng) -> Self;

    /// The best of the patterns below the limit that were judged, and what refuted others.
    fn search(&self, judge: &Judge, samples: &[usize], class: WindabilityClass, limit_rad_per_s: f64) -> PassOutcome;
}

/// How far patterns are followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Following {
    /// Patterns that are followed, each on its own.
    pub(super) chains: usize,
    /// Neighbourhoods that are looked at in a round, shared out over the chains.
    pub(super) drawn: usize,
    /// Rounds without a better pattern after which the search ends, and rounds at most.
    pub(super) patience: usize,
    pub(super) most_rounds: usize,
    pub(super) seed: u64,
    /// The first stream of random numbers, far from those of the annealing and of other neighbourhoods.
    pub(super) first_stream: u64,
}

/// The best pattern that comes of given ones, at worst the best of them. The same patterns and seed give the same one, at
/// any number of threads.
///
/// # Errors
/// As [`super::prove`].
pub(super) fn followed<N: Neighbourhood>(
    task: &Task,
    starts: &[Pattern],
    following: Following,
) -> Result<Pattern, SearchError> {
    let mut judge = checked_judge(task)?;
    let best = first_best(&mut judge, task.class, starts)?;
    let admitted: Vec<Pattern> = starts.iter().filter(|p| task.class.admits(p)).cloned().collect();
    let mut chains = vec![best];
    for start in admitted.iter() {
        if chains.iter().all(|known| known.segments != start.segments()) && chains.len() < following.chains {
            chains.push(judge.candidate_and_witness(start)?.0);
        }
    }
    let mut samples = judge.binding_samples(&neighbours(task.class, &admitted), FIRST_SAMPLES);
    let mut idle = 0;
    for round in 0..following.most_rounds {
        chains.sort_by(|a, b| a.rate_rad_per_s.total_cmp(&b.rate_rad_per_s).then_with(|| a.segments.cmp(&b.segments)));
        if idle == following.patience {
            break;
        }
        // Where nothing has come of all, the better half has the whole effort.
        chains.truncate((following.chains >> idle).max(1));
        let before_rad_per_s = chains[0].rate_rad_per_s;
        judge.try_first(&samples);
        let streams = following.drawn.max(FEWEST_STREAMS);
        let drawn: Vec<(usize, N)> = (0..following.drawn)
            .map(|index| {
                let stream = following.first_stream + (round * streams + index) as u64;
                let mut random = generator(following.seed, stream);
                let chain = index % chains.len();
                (chain, N::draw(task.class, &chains[chain].segments, &mut random))
            })
            .collect();
        let found: Vec<PassOutcome> = drawn
            .iter()
            .in_parallel()
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
    chains.sort_by(|a, b| a.rate_rad_per_s.total_cmp(&b.rate_rad_per_s).then_with(|| a.segments.cmp(&b.segments)));
    let best = chains.swap_remove(0);
    Ok(Pattern::new(best.segments).expect("moves make permutations only"))
}

/// What refuted patterns that had stayed under the limit at the samples so far, as often as it did. A norm has samples without
/// end: the first to come are the first to go.
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
    if judge.is_of_norm() {
        joining.truncate(FIRST_SAMPLES);
        samples.drain(..(samples.len() + joining.len()).saturating_sub(MOST_SAMPLES).min(samples.len()));
    }
    let room = (samples.len() + FIRST_SAMPLES).min(MOST_SAMPLES).saturating_sub(samples.len());
    samples.extend(joining.into_iter().take(room));
}

/// The patterns of two sets of sums that stay under a limit at the samples.
pub(super) struct Matches<'a> {
    pub(super) matching: Matching<'a>,
    pub(super) samples: usize,
    pub(super) limit_rad_per_s: f64,
    /// The pattern of a pair of points; `None` where it is no pattern of the class.
    pub(super) pattern: &'a (dyn Fn(u32, u32) -> Option<Vec<usize>> + Sync),
    /// The largest size over the samples of a pair of points.
    pub(super) predicted: &'a (dyn Fn(u32, u32) -> f64 + Sync),
}

impl Matches<'_> {
    /// Judges the most promising under the smallest limit under which there are any.
    pub(super) fn judged<N: Neighbourhood>(&self, judge: &Judge) -> PassOutcome {
        let mut outcome = PassOutcome::default();
        for share in N::SHARES {
            let reach = self.limit_rad_per_s * share;
            let target = Target::new((0..self.samples).map(|_| (-reach, reach)));
            let (mut found, mut looked_at): (Vec<(f64, u32, u32)>, usize) = (Vec::new(), 0);
            let is_whole = self.matching.visit_all(&target, &mut outcome.nodes, &mut |step| {
                if let BoxStep::Match { left, right } = step {
                    looked_at += 1;
                    if (self.pattern)(left, right).is_some() {
                        found.push(((self.predicted)(left, right), left, right));
                    }
                }
                let is_enough = found.len() == MOST_MATCHES || looked_at == MOST_LOOKED_AT;
                if is_enough { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            });
            found.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| (a.1, a.2).cmp(&(b.1, b.2))));
            let judged = found.iter().take(N::MOST_JUDGED).filter_map(|&(_, left, right)| (self.pattern)(left, right));
            for segments in judged {
                outcome.consider(judge, &segments, self.limit_rad_per_s);
            }
            if outcome.best.is_some() || is_whole.is_break() {
                break;
            }
        }
        outcome
    }
}
