//! One restart of simulated annealing: Metropolis acceptance under a geometric cooling schedule.
//!
//! ```text
//! accept when cost(new) ≤ cost(now) − T ln u,   u uniform in (0, 1],   T = T_hot (T_cold/T_hot)^(k/K)
//! ```
//!
//! The right-hand side is drawn before the move is judged, so that judging can end with the first sample above it.
//!
//! A restart is cut into slices. At the start of each slice its values are computed from nothing, so rounding does not
//! build up, and a restart that is taken up from a checkpoint between slices goes on exactly as it would have.
//!
//! # Source
//! Kirkpatrick, Gelatt, Vecchi, Science 220, 671 (1983).

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::limits::uniform;
use crate::search::cost::columns::Work;
use crate::search::cost::{Cost, MoveProposal, Position};

/// A geometric cooling schedule; temperatures in the unit of the cost.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cooling {
    /// In the cost's unit, at the first move.
    pub hot: f64,
    /// In the cost's unit, at the last move.
    pub cold: f64,
    pub(crate) moves: u64,
}

impl Cooling {
    pub(super) fn temperature(&self, done: u64) -> f64 {
        self.hot * libm::pow(self.cold / self.hot, done as f64 / self.moves as f64)
    }
}

/// The generator of a restart: its stream is its index, so restarts are independent of each other and of threads.
pub fn generator(seed: u64, stream: u64) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(stream);
    random
}

/// Everything that a restart needs to go on.
#[derive(Debug, Clone, PartialEq)]
pub struct Restart {
    pub(crate) index: u64,
    pub(crate) moves: u64,
    pub(crate) segments: Vec<usize>,
    pub(crate) best_segments: Vec<usize>,
    /// The smallest on its way.
    pub best_cost: f64,
    pub(crate) random: ChaCha8Rng,
    /// What judging its moves has cost.
    pub work: Work,
}

impl Restart {
    /// A restart from a given pattern, or from one that its own generator draws.
    pub fn new<C: Cost>(cost: &C, seed: u64, index: u64, start: Option<&[usize]>) -> Self {
        let mut random = generator(seed, index + 1);
        let segments = start.map_or_else(|| cost.draw(&mut random), <[usize]>::to_vec);
        Self {
            index,
            moves: 0,
            best_segments: segments.clone(),
            segments,
            best_cost: f64::INFINITY,
            random,
            work: Work::default(),
        }
    }

    /// Whether the schedule is at its end.
    pub fn is_done(&self, cooling: &Cooling) -> bool {
        self.moves >= cooling.moves
    }

    /// Goes on for a slice, or to the end of the schedule if that comes first.
    pub fn advance<C: Cost>(&mut self, cost: &C, cooling: &Cooling) {
        let mut position = cost.at(&self.segments);
        if position.cost() < self.best_cost {
            (self.best_cost, self.best_segments) = (position.cost(), position.segments());
        }
        let until = cooling.moves.min(self.moves + C::PACE.slice_moves);
        while self.moves < until {
            let temperature = cooling.temperature(self.moves);
            let pause = until.min(self.moves + C::PACE.moves_per_temperature);
            while self.moves < pause {
                self.moves += 1;
                let limit = position.cost() - temperature * libm::log(uniform(&mut self.random));
                if let MoveProposal::Within(_) = position.propose(cost, &mut self.random, limit) {
                    position.accept(cost);
                    if position.cost() < self.best_cost {
                        (self.best_cost, self.best_segments) = (position.cost(), position.segments());
                    }
                }
            }
        }
        self.segments = position.segments();
        self.work += position.work();
    }
}

/// A schedule for a cost: as hot as a typical move is large, cooled until no such move passes.
///
/// Measured on random patterns and moves from stream 0 of the seed.
pub fn cooling_for<C: Cost>(cost: &C, seed: u64, moves: u64) -> Cooling {
    let mut random = generator(seed, 0);
    let (mut total, mut count) = (0.0, 0usize);
    for _ in 0..C::PACE.probed_patterns {
        let mut position = cost.at(&cost.draw(&mut random));
        for _ in 0..C::PACE.probed_moves {
            let changed = match position.propose(cost, &mut random, f64::INFINITY) {
                MoveProposal::Outside => continue,
                // A cost that is no number changes nothing.
                MoveProposal::Refused => position.cost(),
                MoveProposal::Within(changed) => {
                    position.refuse(cost);
                    changed
                }
            };
            total += (changed - position.cost()).abs();
            count += 1;
        }
    }
    let typical = total / count.max(1) as f64;
    // A cost that no move changes still needs a positive temperature.
    let hot = if typical > 0.0 { HOT * typical } else { f64::MIN_POSITIVE.sqrt() };
    Cooling { hot, cold: hot * COLD_OVER_HOT, moves }
}

/// Start of cooling over the mean change of cost by a random move at a random pattern.
const HOT: f64 = 0.3;
const COLD_OVER_HOT: f64 = 1e-3;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coil::LayerLength;
    use crate::pattern::windability::WindabilityClass;
    use crate::search::anneal::sample_cost::SampleCost;
    use crate::search::cost::columns::Norm;
    use crate::search::cost::samples::SampleMatrix;
    use crate::search::cost::samples::tests::{model, profiles};
    use crate::search::cost::worst_case::SolvedProfiles;

    fn cost(class: WindabilityClass) -> SampleCost {
        let model = model(10, LayerLength::Actual, &[]);
        let solved = SolvedProfiles::new(&model, &profiles()).unwrap();
        SampleCost::new(SampleMatrix::of_profiles(&model, &solved).unwrap().0, class, Norm::Largest)
    }

    #[test]
    fn a_restart_that_is_cut_and_taken_up_again_ends_as_the_unbroken_one() {
        let cost = cost(WindabilityClass::Any);
        let cooling = cooling_for(&cost, 5, 3 * SampleCost::PACE.slice_moves);
        let mut unbroken = Restart::new(&cost, 5, 2, None);
        let mut broken = unbroken.clone();
        while !unbroken.is_done(&cooling) {
            unbroken.advance(&cost, &cooling);
        }
        while !broken.is_done(&cooling) {
            let saved = broken.clone();
            broken.advance(&cost, &cooling);
            broken = saved;
            broken.advance(&cost, &cooling);
        }
        assert_eq!(unbroken, broken);
    }

    #[test]
    fn most_moves_are_refused_after_one_block_of_samples() {
        let cost = cost(WindabilityClass::Any);
        let cooling = cooling_for(&cost, 1, SampleCost::PACE.slice_moves);
        let mut restart = Restart::new(&cost, 1, 0, None);
        restart.advance(&cost, &cooling);
        let Work { moves, accepted, samples } = restart.work;
        assert_eq!(moves, SampleCost::PACE.slice_moves);
        assert!(accepted > 0 && accepted < moves / 4, "{accepted} of {moves}");
        assert!(samples < moves * cost.samples() as u64 / 2, "{samples} of {moves}");
    }
}
