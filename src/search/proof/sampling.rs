//! Which samples a proof runs on, and the search over them.
//!
//! Samples at which patterns near the best known ones are worst come first; for permutations, a grid over all samples
//! joins them, and blends of them are learnt ([`surrogates`](super::surrogates)). Where a pass leaves too much to be judged in
//! full, the samples that refuted it join and the pass is repeated.

use super::beam::promising;
use super::candidates::{Judge, PatternCandidate};
use super::descent::search;
use super::permutation_tree::PermutationTree;
use super::rows::SampleRow;
use super::sign_search::SignSearch;
use super::surrogates::{Lesson, Surrogates};
use super::{PassOutcome, RELATIVE_TOLERANCE, StopWish};
use crate::pattern::Pattern;
use crate::pattern::windability::WindabilityClass;
use crate::search::cost::signs::{segments_of_signs, signs_of_segments};

/// Samples that a search over ends begins with, and the most that it may grow to.
const FIRST_ENDS_ROWS: usize = 16;
const MOST_ENDS_ROWS: usize = 64;

/// Samples that a search over permutations begins with, half from near the best patterns and half from a grid, and the
/// most that it may grow to.
const FIRST_ORDERS_ROWS: usize = 160;
const MOST_ORDERS_ROWS: usize = 320;

/// Patterns that are asked for their worst sample.
const NEIGHBOURS: usize = 512;

/// Lessons that learn from the last one's open patterns.
const LESSONS: usize = 24;

/// Nodes of a level that the look ahead of every proof keeps, at most and times the square of the layers.
const MOST_WIDTH: usize = 1 << 12;
const WIDTH_TIMES_LAYERS_SQUARED: usize = MOST_WIDTH * 16 * 16;

fn usual_width(layers: usize) -> usize {
    (WIDTH_TIMES_LAYERS_SQUARED / layers.pow(2)).min(MOST_WIDTH)
}

#[derive(Debug)]
enum Engine {
    SignSearch(Box<SignSearch>),
    /// One search, or two where the first layer's direction matters.
    PermutationTree(Vec<PermutationTree>),
}

/// A search over chosen samples.
#[derive(Debug)]
pub(crate) struct SampledProof {
    class: WindabilityClass,
    mirrored: bool,
    samples: Vec<usize>,
    /// Of these the ones that anything is refuted by.
    used: Vec<usize>,
    engine: Engine,
}

impl SampledProof {
    /// Learning ends with a rate that is good enough; zero for none.
    pub(crate) fn new(
        class: WindabilityClass,
        judge: &mut Judge,
        starts: &[Pattern],
        best: &mut PatternCandidate,
        good_enough_rad_per_s: f64,
    ) -> Self {
        let mirrored = judge.is_mirror_symmetric();
        let near = neighbours(class, starts);
        let samples = if class == WindabilityClass::Standard {
            judge.binding_samples(&near, FIRST_ENDS_ROWS)
        } else {
            let mut samples = judge.binding_samples(&near, FIRST_ORDERS_ROWS / 2);
            let stride = (judge.matrix().samples() / (FIRST_ORDERS_ROWS / 2)).max(1);
            samples.extend((0..judge.matrix().samples()).step_by(stride));
            samples.sort_unstable();
            samples.dedup();
            samples
        };
        judge.try_first(&samples);
        let (engine, lesson) = engine(class, judge, &samples, mirrored, best.rate_rad_per_s);
        let mut proof = Self { class, mirrored, samples, used: lesson.used, engine };
        proof.follow(judge, best, lesson.open, good_enough_rad_per_s);
        proof.look_ahead(judge, best, usual_width(starts[0].layers()), good_enough_rad_per_s);
        proof
    }

    /// Looks for a better pattern where the bounds promise one, for as long as that comes of it; `width` nodes of a level
    /// are kept.
    pub(crate) fn look_ahead(
        &mut self,
        judge: &mut Judge,
        best: &mut PatternCandidate,
        width: usize,
        good_enough_rad_per_s: f64,
    ) {
        while best.rate_rad_per_s > good_enough_rad_per_s {
            let Engine::PermutationTree(directions) = &self.engine else { break };
            let limit_rad_per_s = best.rate_rad_per_s * (1.0 - RELATIVE_TOLERANCE);
            let mut outcome = PassOutcome::default();
            for orders in directions {
                let found = promising(orders, limit_rad_per_s, self.mirrored, width);
                found.iter().for_each(|segments| outcome.consider(judge, segments, limit_rad_per_s));
            }
            let Some(candidate) = outcome.best.take() else { break };
            *best = candidate;
            self.join(judge, &outcome);
            let open = self.make_engine(judge, best.rate_rad_per_s);
            self.follow(judge, best, open, good_enough_rad_per_s);
        }
    }

    /// Learns from patterns that were left open, until nothing comes of it: better ones, and samples that refute them.
    fn follow(
        &mut self,
        judge: &mut Judge,
        best: &mut PatternCandidate,
        mut open: Vec<Vec<usize>>,
        good_enough_rad_per_s: f64,
    ) {
        for _ in 0..LESSONS {
            let mut outcome = PassOutcome::default();
            // The most promising first, so that few are judged by the reference.
            let mut sorted: Vec<(f64, Vec<usize>)> =
                open.into_iter().map(|segments| (judge.sampled_worst_rad_per_s(&segments), segments)).collect();
            sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)));
            sorted.iter().for_each(|(_, segments)| outcome.consider(judge, segments, best.rate_rad_per_s));
            let is_better = outcome.best.is_some();
            if let Some(candidate) = outcome.best.take() {
                *best = candidate;
            }
            if best.rate_rad_per_s <= good_enough_rad_per_s {
                break;
            }
            let has_joined = self.join(judge, &outcome);
            if !is_better && !has_joined {
                break;
            }
            open = self.make_engine(judge, best.rate_rad_per_s);
        }
    }

    /// Makes use of a better rate than the engine was made for.
    pub(crate) fn renew(&mut self, judge: &mut Judge, best: &mut PatternCandidate, good_enough_rad_per_s: f64) {
        let open = self.make_engine(judge, best.rate_rad_per_s);
        self.follow(judge, best, open, good_enough_rad_per_s);
    }

    /// Answers the patterns left open.
    fn make_engine(&mut self, judge: &Judge, best_rad_per_s: f64) -> Vec<Vec<usize>> {
        let (engine, lesson) = engine(self.class, judge, &self.samples, self.mirrored, best_rad_per_s);
        (self.engine, self.used) = (engine, lesson.used);
        lesson.open
    }

    /// Samples in use.
    pub(crate) fn rows(&self, judge: &Judge) -> Vec<SampleRow> {
        self.used.iter().map(|&s| SampleRow::of(judge.matrix(), s)).collect()
    }

    /// Judges every pattern whose worst rate may be below the limit.
    pub(crate) fn pass(
        &mut self,
        judge: &mut Judge,
        limit_rad_per_s: f64,
        best_rad_per_s: f64,
        watch: &mut StopWish,
    ) -> PassOutcome {
        let mut whole = PassOutcome::default();
        loop {
            let outcome = match &self.engine {
                Engine::SignSearch(ends) => ends.search(judge, limit_rad_per_s, watch),
                Engine::PermutationTree(directions) => {
                    let mut outcome = PassOutcome::default();
                    for orders in directions {
                        outcome.absorb(search(orders, judge, limit_rad_per_s, self.mirrored, watch));
                    }
                    outcome
                }
            };
            let complete = outcome.complete;
            let repeat = outcome.overflowed && !watch.is_stopped();
            if repeat {
                if self.join(judge, &outcome) {
                    self.make_engine(judge, best_rad_per_s);
                } else {
                    watch.may_overflow = false;
                }
            }
            whole.absorb(outcome);
            if !repeat {
                whole.complete = complete;
                return whole;
            }
        }
    }

    /// Takes in the samples that refuted most, and the instants at which only the reference could; false if there is
    /// no room or nothing new.
    fn join(&mut self, judge: &mut Judge, outcome: &PassOutcome) -> bool {
        let first_new = judge.matrix().samples();
        let mut joining: Vec<usize> = Vec::new();
        if judge.add_witnesses(&outcome.between) {
            joining.extend(first_new..judge.matrix().samples());
        }
        let has_new_instants = !joining.is_empty();
        let mut sorted = outcome.refuting.clone();
        sorted.sort_unstable();
        let mut counted: Vec<(usize, usize)> = sorted.chunk_by(|a, b| a == b).map(|c| (c.len(), c[0])).collect();
        counted.sort_by_key(|&(count, sample)| (std::cmp::Reverse(count), sample));
        joining.extend(counted.into_iter().map(|(_, sample)| sample));
        let most = if self.class == WindabilityClass::Standard { MOST_ENDS_ROWS } else { MOST_ORDERS_ROWS };
        let room = most.min(2 * self.samples.len());
        let before = self.samples.len();
        for sample in joining {
            if self.samples.len() < room && !self.samples.contains(&sample) {
                self.samples.push(sample);
            }
        }
        if self.samples.len() > before {
            judge.try_first(&self.samples);
        }
        has_new_instants || self.samples.len() > before
    }
}

/// The search over given samples, and which of them it uses.
fn engine(
    class: WindabilityClass,
    judge: &Judge,
    samples: &[usize],
    mirrored: bool,
    best_rad_per_s: f64,
) -> (Engine, Lesson) {
    let rows: Vec<SampleRow> = samples.iter().map(|&s| SampleRow::of(judge.matrix(), s)).collect();
    let lengths_m = judge.lengths_m();
    if class == WindabilityClass::Standard {
        let lesson = Lesson { used: samples.to_vec(), open: Vec::new() };
        return (Engine::SignSearch(Box::new(SignSearch::new(&rows, lengths_m, mirrored))), lesson);
    }
    let layout = judge.matrix().layout;
    let signs: &[Option<f32>] = if layout.axial { &[Some(1.0), Some(-1.0)] } else { &[None] };
    let blender = Surrogates::new(&rows, lengths_m, !layout.halves_alike, layout.axial);
    let mut whole = Lesson::default();
    let directions = signs
        .iter()
        .map(|&sign| {
            let mut orders = PermutationTree::new(lengths_m, class, !layout.halves_alike, sign);
            let lesson = blender.teach(&mut orders, best_rad_per_s, mirrored);
            whole.used.extend(lesson.used.iter().map(|&row| samples[row]));
            whole.open.extend(lesson.open);
            orders
        })
        .collect();
    whole.used.sort_unstable();
    whole.used.dedup();
    (Engine::PermutationTree(directions), whole)
}

/// Patterns one step away from given ones: two layers exchanged, or one or two layers at the other end.
pub(super) fn neighbours(class: WindabilityClass, starts: &[Pattern]) -> Vec<Vec<usize>> {
    let mut found: Vec<Vec<usize>> = starts.iter().map(|p| p.segments().to_vec()).collect();
    for start in starts {
        for a in 0..start.layers() - 1 {
            for b in a..start.layers() {
                let mut segments = start.segments().to_vec();
                match signs_of_segments(&segments) {
                    Some(mut high) if class == WindabilityClass::Standard => {
                        high[a] = !high[a];
                        if b != a && b < high.len() {
                            high[b] = !high[b];
                        }
                        found.push(segments_of_signs(&high));
                    }
                    _ => {
                        segments.swap(a, b);
                        found.push(segments);
                    }
                }
            }
        }
    }
    let stride = found.len().div_ceil(NEIGHBOURS).max(1);
    found.into_iter().step_by(stride).collect()
}
