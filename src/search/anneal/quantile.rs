//! The search for the pattern that is best when it is built imperfectly.
//!
//! ```text
//! minimise P95(P) over the patterns of a class, the coils drawn once for all of them ([`SampledCoils`])
//! ```
//!
//! A move is judged coil by coil, those first that are worst now, and refused as soon as so many coils are above the
//! Metropolis limit that the quantile must be. Rounds run on coils of every kind that stand for all; descents on those that are worst with
//! patterns like theirs, of which the quantile is that of all. All coils have the last word.
//!
//! The same cost serves the guaranteed worst case of a coil whose bore is heated: one coil, and no sum over samples; and
//! any search that limits how far a crossover may climb.
//!
//! # Source
//! Sample average approximation: Kleywegt, Shapiro, Homem-de-Mello, SIAM J. Optim. 12, 479 (2002).

use rand_chacha::ChaCha8Rng;

use super::limits::{WindingLimits, draw, neighbour};
use super::restart::generator;
use super::rounds;
use crate::pattern::windability::WindabilityClass;
use crate::search::cost::columns::Work;
use crate::search::cost::objective::Objective;
use crate::search::cost::sampled_coils::{QuantileWorst, SampledCoils};
use crate::search::cost::{Cost, InFull, MoveProposal, Pace, Position};

/// Coils that the rounds of a search run on; what they find is refined and judged on all of them.
const COILS_THAT_TELL: usize = 40;

/// Moves of a restart for a layer count.
pub(crate) fn default_moves_per_restart(layers: usize) -> u64 {
    ((layers as u64).pow(2) * 16).max(1000)
}

impl Objective {
    /// Moves of a restart for a layer count.
    pub(crate) fn default_moves_per_restart(self, layers: usize) -> u64 {
        match self {
            Objective::P95 => default_moves_per_restart(layers),
            _ => rounds::default_moves_per_restart(layers),
        }
    }
}

/// The quantile of the worst case over sampled coils, within limits.
#[derive(Debug, Clone)]
pub(crate) struct QuantileCost {
    coils: SampledCoils,
    limits: WindingLimits,
}

impl QuantileCost {
    pub(crate) fn new(coils: SampledCoils, limits: impl Into<WindingLimits>) -> Self {
        Self { coils, limits: limits.into() }
    }
}

/// A pattern, the worst case of every coil with it, and the pattern proposed last.
#[derive(Debug, Clone)]
pub(crate) struct QuantilePosition {
    segments: Vec<usize>,
    candidate: Vec<usize>,
    worst: QuantileWorst,
    moves: u64,
    accepted: u64,
}

impl Position<QuantileCost> for QuantilePosition {
    fn cost(&self) -> f64 {
        self.worst.cost()
    }

    fn segments(&self) -> Vec<usize> {
        self.segments.clone()
    }

    fn propose(&mut self, cost: &QuantileCost, random: &mut ChaCha8Rng, limit: f64) -> MoveProposal {
        self.moves += 1;
        let Some(candidate) = neighbour(cost.limits, &self.segments, random) else { return MoveProposal::Outside };
        let proposed = self.worst.propose(&cost.coils, &candidate, limit);
        self.candidate = candidate;
        proposed.map_or(MoveProposal::Refused, MoveProposal::Within)
    }

    fn cost_of(&mut self, cost: &QuantileCost, segments: &[usize], limit: f64) -> Option<f64> {
        self.worst.propose(&cost.coils, segments, limit)
    }

    fn accept(&mut self, _cost: &QuantileCost) {
        self.worst.accept();
        self.accepted += 1;
        std::mem::swap(&mut self.segments, &mut self.candidate);
    }

    fn refuse(&mut self, _cost: &QuantileCost) {}

    fn work(&self) -> Work {
        Work { moves: self.moves, accepted: self.accepted, samples: self.worst.judged }
    }
}

impl Cost for QuantileCost {
    type Position = QuantilePosition;

    /// A move costs about a hundred times one over samples.
    const PACE: Pace = Pace { slice_moves: 512, moves_per_temperature: 16, probed_patterns: 4, probed_moves: 16 };

    fn layers(&self) -> usize {
        self.coils.layers()
    }

    fn samples(&self) -> usize {
        self.coils.count()
    }

    fn admits(&self, segments: &[usize]) -> bool {
        self.limits.admits(segments)
    }

    fn is_of_permutations(&self) -> bool {
        self.limits.class != WindabilityClass::Standard
    }

    fn draw(&self, random: &mut ChaCha8Rng) -> Vec<usize> {
        draw(self.limits, self.layers(), random)
    }

    fn at(&self, segments: &[usize]) -> QuantilePosition {
        QuantilePosition {
            segments: segments.to_vec(),
            candidate: segments.to_vec(),
            worst: QuantileWorst::new(&self.coils, segments),
            moves: 0,
            accepted: 0,
        }
    }

    fn in_full(&self, segments: &[usize], _working: &[usize]) -> InFull {
        InFull { cost: self.coils.cost(segments), segments: segments.to_vec(), joining: Vec::new() }
    }

    fn select(&self, working: &[usize]) -> Self {
        Self { coils: self.coils.telling(working), ..*self }
    }

    /// Where there are many coils, every so many-th of them in the order of how badly a typical pattern does in them:
    /// their quantile then follows that of all, which has the last word.
    fn first_working_set(&self, seed: u64, starts: &[Vec<usize>]) -> Vec<usize> {
        let stride = self.coils.count() / COILS_THAT_TELL;
        if stride < 2 {
            return Vec::new();
        }
        let mut random = generator(seed, 0);
        let typical = starts.first().cloned().unwrap_or_else(|| self.draw(&mut random));
        let mut working: Vec<usize> =
            self.coils.by_worst(&typical).into_iter().skip(stride / 2).step_by(stride).collect();
        working.sort_unstable();
        working
    }

    fn that_tell(&self, near: &[Vec<usize>]) -> Option<Self> {
        Some(Self { coils: self.coils.worst_with(near)?, ..*self })
    }

    fn order_working_set(&self, _best: &[&[usize]], _working: &mut [usize]) {}
}
