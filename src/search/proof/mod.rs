//! The best pattern of a class with a proof: branch and bound for the largest |Ω| over all profiles and times.
//!
//! ```text
//! min over P of sup over t of |Ω(P, t)|
//! ```
//!
//! What is proved is about the supremum itself and not about its samples. A lower bound over some instants is a lower
//! bound over all of them, so parts of the space are refuted on a few samples; every pattern that is not refuted so is
//! judged by the reference worst case, refined in time ([`worst_case`](crate::search::cost::worst_case)). `Optimal` therefore
//! means: no pattern of the class has a refined worst rate below the best one's by more than one part in 10⁹.
//!
//! The proof is built in passes. Each refutes every pattern whose worst rate is below a share of the best known rate;
//! a share that was refuted in whole is a lower bound, also if the next pass is stopped. Work is cut into pieces in a
//! fixed order, each with the limit that held at the start of the pass, so the pattern found, the bound and the nodes
//! counted depend neither on the number of threads nor, unless a pass is stopped, on time.
//!
//! | class | space | method |
//! |---|---|---|
//! | `standard` | 2^(N−1) choices of ends | [`sign_search`]: two sets of sums and pairs of boxes |
//! | `captive:K`, `any` | permutations | [`descent`]: outermost layer first, bounded by blends of samples ([`surrogates`]) |
//!
//! Where nothing tells the halves of the fibre apart and nothing is added outside the coil, a pattern and its mirror
//! image s → N+1−s have opposite errors and one of the two is searched.
//!
//! Holds for the worst rate (and so the worst phase, a fixed multiple of it), the pointing error, whose samples are those of
//! its own, and the rms rate and the guaranteed worst rate, which are largest values of samples too ([`support`]). Leaves
//! out the quantile over built coils.

pub(crate) mod beam;
pub(crate) mod box_join;
pub(crate) mod candidates;
pub(crate) mod compound;
mod course;
pub(crate) mod descent;
pub(crate) mod matrix_game;
mod neighbourhood;
pub(crate) mod permutation_tree;
pub(crate) mod rows;
mod sampling;
pub(crate) mod sign_search;
pub(crate) mod simd_bounds;
mod starts;
pub(crate) mod stretches;
pub(crate) mod support;
pub(crate) mod surrogates;
#[cfg(test)]
mod tests;

pub(crate) use starts::quickly_found;
pub use starts::starting_patterns;

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};

use candidates::{Judge, PatternCandidate, Witness};
use rows::SampleRow;
use sampling::SampledProof;

use crate::pattern::Pattern;
use crate::pattern::windability::WindabilityClass;
use crate::rate::CoilModel;
use crate::search::cost::columns::Norm;
use crate::search::cost::guaranteed::UnitStep;
use crate::search::cost::samples::SampleMatrix;
use crate::search::cost::worst_case::{SearchError, SolvedProfiles};

/// What is to be made small.
#[derive(Debug, Clone, Copy)]
pub enum Goal<'a> {
    /// The largest |Ω| over all profiles and times.
    WorstRate,
    /// √(mean Ω²) over time and profiles.
    RootMeanSquare,
    /// The largest |Ω| over all profiles within the largest rate.
    Guaranteed(&'a UnitStep),
    /// The largest |∫ Ω dt| over all profiles and times, as the rate that makes it in one hour.
    Pointing,
}

/// What is to be proved.
#[derive(Debug, Clone, Copy)]
pub struct Task<'a> {
    /// The coil.
    pub model: &'a CoilModel,
    /// Its temperatures under the profiles.
    pub solved: &'a SolvedProfiles,
    /// The patterns among which the best is sought.
    pub class: WindabilityClass,
    /// What is made small.
    pub goal: Goal<'a>,
}

/// How much of the proof is done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// The best worst rate known.
    pub best_rad_per_s: f64,
    /// No pattern is below this.
    pub lower_bound_rad_per_s: f64,
    /// The limit of the present pass over the best worst rate.
    pub(crate) pass: f64,
    /// How much of the present pass is done, from 0 to 1.
    pub share_done: f64,
}

/// How far a proof went.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// No pattern of the class is better.
    Optimal,
    /// Patterns between the lower bound and the best rate have not been ruled out.
    Gap,
    /// Nothing better than zero is known as a lower bound.
    None,
}

impl std::fmt::Display for Status {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(match self {
            Status::Optimal => "optimal",
            Status::Gap => "gap",
            Status::None => "none",
        })
    }
}

/// The best pattern known and what is known about all others.
#[derive(Debug, Clone, PartialEq)]
pub struct Certificate {
    pub(crate) pattern: Pattern,
    /// Its worst rate, refined in time.
    pub best_rad_per_s: f64,
    /// No pattern of the class has a smaller worst rate.
    pub(crate) lower_bound_rad_per_s: f64,
    /// Whether it is a whole proof.
    pub status: Status,
    /// Nodes whose bound was computed.
    pub nodes: u64,
    /// Patterns judged on all samples.
    pub judged: u64,
    /// Samples that the last pass refuted by.
    pub(crate) rows: Vec<SampleRow>,
}

/// Told from time to time; answers whether to go on.
pub(crate) type Watcher<'a> = &'a (dyn Fn(Progress) -> ControlFlow<()> + Sync);

/// Limits of the passes over the best known rate.
const LIMITS: [f64; 11] = [0.25, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 0.998, 1.0];

/// What a pass may cost that only raises the lower bound, while the last one has not been tried.
const CHEAP_NODES: u64 = 1 << 18;

/// What the last pass may cost before lower bounds are worth their own effort.
const DEAR_NODES: u64 = 1 << 28;

/// One pass: its limit over the best known rate, and the nodes that it may look at.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Pass {
    over_best: f64,
    most_nodes: u64,
}

/// Which pass comes next: cheap ones until one costs too much, the last one, and after that, if even that costs too
/// much, the others in their order for as long as it takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Passes {
    index: usize,
    spend: Spend,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Spend {
    #[default]
    Cheap,
    Dear,
    Unlimited,
}

impl Passes {
    fn next(&self) -> Pass {
        let last = LIMITS[LIMITS.len() - 1];
        match self.spend {
            Spend::Cheap if self.index + 1 < LIMITS.len() => {
                Pass { over_best: LIMITS[self.index], most_nodes: CHEAP_NODES }
            }
            Spend::Cheap | Spend::Dear => Pass { over_best: last, most_nodes: DEAR_NODES },
            Spend::Unlimited => Pass { over_best: LIMITS[self.index], most_nodes: u64::MAX },
        }
    }

    fn advance(&mut self, complete: bool) {
        let tried_last = self.next().over_best == 1.0;
        match self.spend {
            Spend::Cheap | Spend::Dear if tried_last => self.spend = Spend::Unlimited,
            Spend::Cheap if !complete => self.spend = Spend::Dear,
            _ => self.index = (self.index + 1).min(LIMITS.len() - 1),
        }
    }
}

/// Two rates closer than this count as equal.
pub(crate) const RELATIVE_TOLERANCE: f64 = 1e-9;

/// Proves which pattern is best, beginning with the best of given patterns.
///
/// # Errors
/// A model that cannot be solved, a start that does not fit it; more than [`permutation_tree::MOST_LAYERS`] layers, or none
/// of the class among the starts.
pub fn prove(task: &Task, starts: &[Pattern], watcher: Watcher) -> Result<Certificate, SearchError> {
    proved(begin(task, starts, 0.0)?, watcher)
}

/// The same of a norm of samples that are all there is: of the rows of temperatures from elsewhere, say.
///
/// # Errors
/// As [`prove`].
pub(crate) fn prove_samples(
    model: &CoilModel,
    samples: SampleMatrix,
    norm: Norm,
    class: WindabilityClass,
    starts: &[Pattern],
    watcher: Watcher,
) -> Result<Certificate, SearchError> {
    check_layers(model)?;
    proved(begin_with(Judge::of_samples(model, samples, norm)?, class, starts, 0.0)?, watcher)
}

fn proved(begun: Begun, watcher: Watcher) -> Result<Certificate, SearchError> {
    let Begun { mut judge, mut best, mut proof } = begun;
    let mut lower_bound_rad_per_s = 0.0;
    let mut closed = best.rate_rad_per_s == 0.0;
    let (mut nodes, mut judged) = (0, 0);
    let stop = AtomicBool::new(false);
    let mut passes = Passes::default();
    while !closed {
        let Pass { over_best, most_nodes } = passes.next();
        let at =
            Progress { best_rad_per_s: best.rate_rad_per_s, lower_bound_rad_per_s, pass: over_best, share_done: 0.0 };
        let mut watch =
            StopWish { stop: &stop, watcher, at, most_nodes, good_enough_rad_per_s: 0.0, may_overflow: true };
        let limit = best.rate_rad_per_s * over_best * (1.0 - RELATIVE_TOLERANCE);
        let outcome = proof.pass(&mut judge, limit, best.rate_rad_per_s, &mut watch);
        nodes += outcome.nodes;
        judged += outcome.judged;
        if let Some(candidate) = outcome.best {
            best = best.better(candidate);
            // Everything below the limit was judged: the best of it is the best of all.
            closed = outcome.complete;
            if !closed {
                proof.renew(&mut judge, &mut best, 0.0);
            }
        } else if outcome.complete {
            lower_bound_rad_per_s = limit;
            closed = over_best == 1.0;
        }
        if watch.is_stopped() {
            break;
        }
        passes.advance(outcome.complete);
    }
    let status = if closed {
        lower_bound_rad_per_s = best.rate_rad_per_s * (1.0 - RELATIVE_TOLERANCE);
        Status::Optimal
    } else if lower_bound_rad_per_s > 0.0 {
        Status::Gap
    } else {
        Status::None
    };
    Ok(Certificate {
        pattern: Pattern::new(best.segments).expect("a search makes permutations only"),
        best_rad_per_s: best.rate_rad_per_s,
        lower_bound_rad_per_s,
        status,
        nodes,
        judged,
        rows: proof.rows(&judge),
    })
}

/// A search that has not made a pass yet.
struct Begun<'a> {
    judge: Judge<'a>,
    best: PatternCandidate,
    proof: SampledProof,
}

fn begin<'a>(task: &Task<'a>, starts: &[Pattern], good_enough_rad_per_s: f64) -> Result<Begun<'a>, SearchError> {
    begin_with(checked_judge(task)?, task.class, starts, good_enough_rad_per_s)
}

/// The judge of a task whose layers are not too many.
fn checked_judge<'a>(task: &Task<'a>) -> Result<Judge<'a>, SearchError> {
    check_layers(task.model)?;
    Judge::new(task)
}

fn check_layers(model: &CoilModel) -> Result<(), SearchError> {
    let (found, most) = (model.coil.layers(), permutation_tree::MOST_LAYERS);
    if found > most { Err(SearchError::TooManyLayers { found, most }) } else { Ok(()) }
}

fn begin_with<'a>(
    mut judge: Judge<'a>,
    class: WindabilityClass,
    starts: &[Pattern],
    good_enough_rad_per_s: f64,
) -> Result<Begun<'a>, SearchError> {
    let mut best = first_best(&mut judge, class, starts)?;
    let proof = SampledProof::new(class, &mut judge, starts, &mut best, good_enough_rad_per_s);
    Ok(Begun { judge, best, proof })
}

/// The best of the starts; the judge then knows where they are worst.
fn first_best(judge: &mut Judge, class: WindabilityClass, starts: &[Pattern]) -> Result<PatternCandidate, SearchError> {
    let mut best: Option<PatternCandidate> = None;
    let mut witnesses = Vec::new();
    for start in starts.iter().filter(|p| class.admits(p)) {
        let (candidate, witness) = judge.candidate_and_witness(start)?;
        witnesses.push(witness);
        // Of starts that are equally good, the first: it may be one that has a name.
        let is_better = |b: &PatternCandidate| candidate.rate_rad_per_s < b.rate_rad_per_s * (1.0 - RELATIVE_TOLERANCE);
        if best.as_ref().is_none_or(is_better) {
            best = Some(candidate);
        }
    }
    let best = best.ok_or(SearchError::NoStart { class })?;
    judge.add_witnesses(&witnesses);
    Ok(best)
}

/// What a short search by bounds made of its starts.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Improvement {
    /// At worst the best start.
    pub(crate) pattern: Pattern,
    /// No pattern of the class is better.
    pub(crate) is_optimal: bool,
}

/// How much a short search by bounds may do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ProofEffort {
    pub(crate) most_nodes: u64,
    /// Nodes of a level that a last look ahead keeps ([`beam`]); zero for none.
    pub(crate) beam_width: usize,
    /// A worst rate at which it ends, proved or not; zero for none.
    pub(crate) good_enough_rad_per_s: f64,
}

/// The best pattern that a short search by bounds comes upon: what an annealer needs to end on the very best of many
/// patterns that are nearly alike. Its effort is counted in nodes, so that the same starts give the same pattern.
///
/// # Errors
/// As [`prove`].
pub(crate) fn improve(task: &Task, starts: &[Pattern], effort: ProofEffort) -> Result<Improvement, SearchError> {
    let ProofEffort { most_nodes, beam_width, good_enough_rad_per_s } = effort;
    let Begun { mut judge, mut best, mut proof } = begin(task, starts, good_enough_rad_per_s)?;
    let stop = AtomicBool::new(false);
    let go_on = |_: Progress| ControlFlow::Continue(());
    let (mut nodes, mut is_optimal) = (0, false);
    while !is_optimal && nodes < most_nodes && best.rate_rad_per_s > good_enough_rad_per_s {
        let rate_rad_per_s = best.rate_rad_per_s;
        let at = Progress { best_rad_per_s: rate_rad_per_s, lower_bound_rad_per_s: 0.0, pass: 1.0, share_done: 0.0 };
        let most_nodes = most_nodes - nodes;
        let mut watch =
            StopWish { stop: &stop, watcher: &go_on, at, most_nodes, good_enough_rad_per_s, may_overflow: true };
        let limit = rate_rad_per_s * (1.0 - RELATIVE_TOLERANCE);
        let outcome = proof.pass(&mut judge, limit, rate_rad_per_s, &mut watch);
        nodes += outcome.nodes;
        is_optimal = outcome.complete;
        let Some(candidate) = outcome.best else { break };
        best = best.better(candidate);
        if !is_optimal {
            proof.renew(&mut judge, &mut best, good_enough_rad_per_s);
        }
    }
    if !is_optimal && beam_width > 0 {
        proof.look_ahead(&mut judge, &mut best, beam_width, good_enough_rad_per_s);
    }
    let pattern = Pattern::new(best.segments).expect("a search makes permutations only");
    Ok(Improvement { pattern, is_optimal })
}

/// What a pass, or a piece of one, found.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PassOutcome {
    /// Everything below the limit was judged.
    pub(crate) complete: bool,
    /// Too many patterns could not be refuted by the samples.
    pub(crate) overflowed: bool,
    pub(crate) nodes: u64,
    pub(crate) judged: u64,
    pub(crate) best: Option<PatternCandidate>,
    /// Samples that refuted what was judged.
    pub(crate) refuting: Vec<usize>,
    /// Instants between samples that refuted what no sample did.
    pub(crate) between: Vec<Witness>,
}

impl Default for PassOutcome {
    fn default() -> Self {
        Self {
            complete: true,
            overflowed: false,
            nodes: 0,
            judged: 0,
            best: None,
            refuting: Vec::new(),
            between: Vec::new(),
        }
    }
}

impl PassOutcome {
    /// Adds what the next piece found.
    pub(crate) fn absorb(&mut self, other: Self) {
        self.complete &= other.complete;
        self.overflowed |= other.overflowed;
        self.nodes += other.nodes;
        self.judged += other.judged;
        self.refuting.extend(other.refuting);
        self.between.extend(other.between);
        self.best = match (self.best.take(), other.best) {
            (Some(a), Some(b)) => Some(a.better(b)),
            (a, b) => a.or(b),
        };
    }
}

/// The caller's wish to stop, seen by every piece of work.
pub(crate) struct StopWish<'a> {
    stop: &'a AtomicBool,
    watcher: Watcher<'a>,
    at: Progress,
    /// The pass ends incomplete beyond so many.
    pub(crate) most_nodes: u64,
    /// The pass ends with a rate that is good enough; zero for none.
    pub(crate) good_enough_rad_per_s: f64,
    /// A piece of work gives up where too much is left to be judged in full, so that samples can be added.
    pub(crate) may_overflow: bool,
}

impl StopWish<'_> {
    /// Asks whether to go on, without news.
    pub(crate) fn pause(&self) -> ControlFlow<()> {
        self.report(self.at.share_done)
    }

    pub(crate) fn report(&self, share_done: f64) -> ControlFlow<()> {
        if (self.watcher)(Progress { share_done, ..self.at }).is_break() {
            self.stop.store(true, Ordering::Relaxed);
        }
        if self.is_stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    pub(crate) fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}
