//! A cost over samples as the annealer sees it: walks that change few columns, and a working set of samples that bind.
//!
//! Under a largest-value objective the restarts run on a working set of samples: a thinned grid and whatever was seen
//! to bind. What a restart found is judged on all samples; every sample that exceeds the working set's value joins the
//! set for the next rounds. The working set's cost is never above the true one, so nothing good is lost by it, and
//! nothing is reported that was not judged in full.

use rand_chacha::ChaCha8Rng;

use super::restart::generator;
use super::walk::{Space, Walk};
use crate::pattern::windability::WindabilityClass;
use crate::rate::LayerWeights;
use crate::search::cost::columns::{BLOCK, Norm, SampleValues, Work};
use crate::search::cost::samples::SampleMatrix;
use crate::search::cost::{Cost, InFull, MoveProposal, Pace, Position};

/// A norm of all samples.
#[derive(Debug, Clone)]
pub struct SampleCost {
    space: Space,
    norm: Norm,
    /// What the rounds run on instead, where it costs a dozen times less to walk over.
    frozen: Option<SampleMatrix>,
}

impl SampleCost {
    /// Of a compiled objective, over the patterns of a class.
    pub fn new(matrix: SampleMatrix, class: WindabilityClass, norm: Norm) -> Self {
        Self { space: Space::new(matrix, class), norm, frozen: None }
    }

    /// Where the class is `standard` but the error is not linear in its signs, lets the rounds run on what it is near a
    /// pattern, where it is linear. What they find is refined and judged as it is.
    #[must_use]
    pub(crate) fn frozen_at(mut self, weights: &LayerWeights) -> Self {
        let layout = self.space.matrix().layout;
        let is_curved = !layout.halves_alike || layout.axial;
        if self.space.class() == WindabilityClass::Standard && is_curved {
            self.frozen = Some(self.space.matrix().frozen_at(weights));
        }
        self
    }

    /// Puts those samples first that have most to do with the cost of given patterns.
    fn sort_by_share(&self, patterns: &[&[usize]], samples: &mut [usize]) {
        // The largest one alone makes the cost, and a near one that of a pattern near by.
        let power = match self.norm {
            Norm::Largest => 8,
            Norm::RootMeanSquare => 2,
            Norm::Sum => 1,
        };
        let mut scores = vec![0.0; self.samples()];
        for segments in patterns {
            let values = self.values(segments);
            let largest = Norm::Largest.of(&values);
            if largest > 0.0 {
                scores.iter_mut().zip(&values).for_each(|(score, v)| *score += (v / largest).abs().powi(power));
            }
        }
        samples.sort_by(|&a, &b| scores[b].total_cmp(&scores[a]).then(a.cmp(&b)));
    }

    fn values(&self, segments: &[usize]) -> Vec<f64> {
        self.space.columns().values(self.space.walk(segments.to_vec()).coefficients())
    }
}

/// Where a walk stands, and the values of all samples there.
#[derive(Debug, Clone)]
pub struct SamplePosition {
    walk: Walk,
    values: SampleValues,
}

impl Position<SampleCost> for SamplePosition {
    fn cost(&self) -> f64 {
        self.values.cost()
    }

    fn segments(&self) -> Vec<usize> {
        self.walk.segments()
    }

    fn propose(&mut self, cost: &SampleCost, random: &mut ChaCha8Rng, limit: f64) -> MoveProposal {
        let Some(changes) = self.walk.propose(&cost.space, random) else { return MoveProposal::Outside };
        match self.values.propose(cost.space.columns(), changes, limit) {
            Some(proposed) => MoveProposal::Within(proposed),
            None => {
                self.walk.refuse(&cost.space);
                MoveProposal::Refused
            }
        }
    }

    fn cost_of(&mut self, cost: &SampleCost, segments: &[usize], limit: f64) -> Option<f64> {
        let changes = self.walk.propose_pattern(&cost.space, segments);
        let found = self.values.propose(cost.space.columns(), changes, limit);
        self.walk.refuse(&cost.space);
        found
    }

    fn accept(&mut self, cost: &SampleCost) {
        self.values.accept();
        self.walk.accept(&cost.space);
    }

    fn refuse(&mut self, cost: &SampleCost) {
        self.walk.refuse(&cost.space);
    }

    fn work(&self) -> Work {
        self.values.work
    }
}

impl Cost for SampleCost {
    type Position = SamplePosition;

    const PACE: Pace = Pace { slice_moves: 1 << 15, moves_per_temperature: 32, probed_patterns: 8, probed_moves: 32 };

    fn layers(&self) -> usize {
        self.space.layers()
    }

    fn samples(&self) -> usize {
        self.space.matrix().samples()
    }

    fn admits(&self, segments: &[usize]) -> bool {
        self.space.admits(segments)
    }

    fn is_of_permutations(&self) -> bool {
        self.space.class() != WindabilityClass::Standard
    }

    fn draw(&self, random: &mut ChaCha8Rng) -> Vec<usize> {
        self.space.draw(random)
    }

    fn at(&self, segments: &[usize]) -> SamplePosition {
        let walk = self.space.walk(segments.to_vec());
        let values = SampleValues::new(self.space.columns(), walk.coefficients(), self.norm);
        SamplePosition { walk, values }
    }

    fn in_full(&self, segments: &[usize], working: &[usize]) -> InFull {
        let values = self.values(segments);
        let cost = self.norm.of(&values);
        // Of a pattern and its mirror image, if both cost the same, the one that comes first.
        let mirrored: Vec<usize> = segments.iter().map(|s| segments.len() + 1 - s).collect();
        let mirrored_cost = self.norm.of(&self.values(&mirrored));
        let same = (mirrored_cost - cost).abs() <= 1e-12 * cost;
        let kept = if same && mirrored.as_slice() < segments { mirrored } else { segments.to_vec() };
        let joining = if self.norm == Norm::Largest {
            let reached = working.iter().map(|&s| values[s].abs()).fold(0.0, f64::max);
            peaks(&values, reached * (1.0 + 1e-9))
        } else {
            Vec::new()
        };
        InFull { cost, segments: kept, joining }
    }

    fn select(&self, working: &[usize]) -> Self {
        let matrix = self.frozen.as_ref().unwrap_or(self.space.matrix()).select(working);
        Self { space: Space::new(matrix, self.space.class()), norm: self.norm, frozen: None }
    }

    fn narrowed(&self, working: &[usize]) -> Self {
        let matrix = self.space.matrix().select(working);
        Self { space: Space::new(matrix, self.space.class()), norm: self.norm, frozen: None }
    }

    fn refusing_soon(&self, near: &[Vec<usize>]) -> Self {
        let patterns: Vec<&[usize]> = near.iter().map(Vec::as_slice).collect();
        let mut order: Vec<usize> = (0..self.samples()).collect();
        self.sort_by_share(&patterns, &mut order);
        self.narrowed(&order)
    }

    fn is_approximated(&self) -> bool {
        self.frozen.is_some()
    }

    /// A thinned grid and the samples that bind random patterns; all samples where they are few or all of them count.
    fn first_working_set(&self, seed: u64, starts: &[Vec<usize>]) -> Vec<usize> {
        let samples = self.samples();
        if self.norm != Norm::Largest {
            return (0..samples).collect();
        }
        let mut random = generator(seed, 0);
        let drawn: Vec<Vec<usize>> = (0..PROBED_PATTERNS).map(|_| self.draw(&mut random)).collect();
        let mut working: Vec<usize> = if samples <= THINNING * BLOCK {
            (0..samples).collect()
        } else {
            let binding = drawn.iter().chain(starts).flat_map(|segments| {
                let values = self.values(segments);
                peaks(&values, 0.9 * self.norm.of(&values))
            });
            binding.chain((0..samples).step_by(THINNING)).collect()
        };
        working.sort_unstable();
        working.dedup();
        let patterns: Vec<&[usize]> = drawn.iter().map(Vec::as_slice).collect();
        self.order_working_set(&patterns, &mut working);
        working
    }

    /// Puts first the samples that come nearest to the largest value under given patterns.
    fn order_working_set(&self, best: &[&[usize]], working: &mut [usize]) {
        if self.norm != Norm::Largest {
            return;
        }
        self.sort_by_share(best, working);
    }
}

/// The local maxima of |v| above a limit.
fn peaks(values: &[f64], limit: f64) -> Vec<usize> {
    let size = |i: usize| values[i].abs();
    (0..values.len())
        .filter(|&i| {
            size(i) > limit && (i == 0 || size(i) >= size(i - 1)) && (i + 1 == values.len() || size(i) >= size(i + 1))
        })
        .collect()
}

/// Every so many-th sample is in the first working set.
const THINNING: usize = 8;
const PROBED_PATTERNS: usize = 64;
