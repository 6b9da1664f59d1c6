//! What a search makes small, compiled for speed: samples, guaranteed worst cases, quantiles over built coils.
//!
//! [`Cost`] is what the annealer sees of it: a position at a pattern, moves from it that stay within what the winding
//! shop puts up with, and which samples are worth running on.

mod coil_worst;
pub mod columns;
mod deviates;
pub mod grid_margin;
pub mod guaranteed;
pub mod objective;
pub mod pointing;
pub mod sampled_coils;
pub mod samples;
pub mod signs;
pub(crate) mod tolerance;
pub mod worst_case;

use rand_chacha::ChaCha8Rng;

use columns::Work;

/// How fast a search over a cost goes: what is drawn and done between two looks at the clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pace {
    /// Moves between two points at which a restart can be stopped, saved and taken up again.
    pub(crate) slice_moves: u64,
    /// The temperature is renewed after so many moves.
    pub(crate) moves_per_temperature: u64,
    /// Random patterns, and moves from each, that show how large a typical move is.
    pub(crate) probed_patterns: usize,
    pub(crate) probed_moves: usize,
}

/// What came of a proposed move.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MoveProposal {
    /// It would leave what is allowed.
    Outside,
    /// Its cost is above the limit.
    Refused,
    /// Its cost, which is within the limit.
    Within(f64),
}

/// A pattern judged on all samples.
#[derive(Debug, Clone, PartialEq)]
pub struct InFull {
    pub(crate) cost: f64,
    /// The pattern, or its mirror image where both cost the same and that comes first.
    pub(crate) segments: Vec<usize>,
    /// Samples that should join the working set.
    pub(crate) joining: Vec<usize>,
}

/// A cost over the patterns of a class.
pub trait Cost: Clone + Send + Sync + std::fmt::Debug {
    /// What moves from pattern to pattern.
    type Position: Position<Self> + Clone + Send + Sync;

    /// How a search over it is paced.
    const PACE: Pace;

    /// Of the patterns.
    fn layers(&self) -> usize;

    /// Numbers of which the cost is made.
    fn samples(&self) -> usize;

    /// Whether the winding shop puts up with P(j).
    fn admits(&self, segments: &[usize]) -> bool;

    /// Whether its patterns are any order of the segments, but for what is not admitted.
    fn is_of_permutations(&self) -> bool;

    /// A pattern drawn at random.
    fn draw(&self, random: &mut ChaCha8Rng) -> Vec<usize>;

    /// A position at a pattern, computed from nothing.
    fn at(&self, segments: &[usize]) -> Self::Position;

    /// A pattern judged on all samples, where the search runs on a working set of them.
    fn in_full(&self, segments: &[usize], working: &[usize]) -> InFull;

    /// The cost on some of the samples only.
    fn select(&self, working: &[usize]) -> Self;

    /// The cost itself on some of its samples, also where rounds run on what is only near it.
    fn narrowed(&self, working: &[usize]) -> Self {
        self.select(working)
    }

    /// The cost itself, its samples so ordered that patterns like the given ones are refused after few of them; the same where its
    /// order has nothing to do with that.
    #[must_use]
    fn refusing_soon(&self, _near: &[Vec<usize>]) -> Self {
        self.clone()
    }

    /// The cost on those samples that tell whether a pattern like the given ones is better, where that takes far less; the cost itself has
    /// the last word.
    fn that_tell(&self, _near: &[Vec<usize>]) -> Option<Self> {
        None
    }

    /// The samples that a search begins with; empty for all of them in their own order.
    fn first_working_set(&self, seed: u64, starts: &[Vec<usize>]) -> Vec<usize>;

    /// Whether what the rounds run on is only near to the cost, so that what they find wants to be refined.
    fn is_approximated(&self) -> bool {
        false
    }

    /// Puts those samples first that bind the best patterns.
    fn order_working_set(&self, best: &[&[usize]], working: &mut [usize]);
}

/// A pattern, its cost, and the proposal made last.
pub trait Position<C> {
    /// Of the pattern that it is at.
    fn cost(&self) -> f64;

    /// P(j), innermost layer first.
    fn segments(&self) -> Vec<usize>;

    /// Draws a move and judges it against a limit that was drawn before.
    fn propose(&mut self, cost: &C, random: &mut ChaCha8Rng, limit: f64) -> MoveProposal;

    /// The cost of another pattern than its own, `None` where that is above a limit; the position stays where it is.
    fn cost_of(&mut self, cost: &C, segments: &[usize], limit: f64) -> Option<f64>;

    /// Goes where the last proposal leads, which must have been within its limit.
    fn accept(&mut self, cost: &C);

    /// Forgets a proposal that was within its limit.
    fn refuse(&mut self, cost: &C);

    /// What judging has cost since the position was made.
    fn work(&self) -> Work;
}
