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

use super::columns::{Norm, Values, Work};
use super::walk::{Space, Walk, uniform};

/// Moves between two points at which a restart can be stopped, saved and taken up again.
pub const SLICE_MOVES: u64 = 1 << 15;

/// The temperature is renewed after so many moves.
const MOVES_PER_TEMPERATURE: u64 = 32;

/// A geometric cooling schedule; temperatures in the unit of the cost.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cooling {
    pub hot: f64,
    pub cold: f64,
    pub moves: u64,
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
    pub index: u64,
    pub moves: u64,
    pub segments: Vec<usize>,
    pub best_segments: Vec<usize>,
    pub best_cost: f64,
    pub random: ChaCha8Rng,
    pub work: Work,
}

impl Restart {
    /// A restart from a given pattern, or from one that its own generator draws.
    pub fn new(space: &Space, seed: u64, index: u64, start: Option<&[usize]>) -> Self {
        let mut random = generator(seed, index + 1);
        let segments = start.map_or_else(|| space.draw(&mut random), <[usize]>::to_vec);
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

    pub fn is_done(&self, cooling: &Cooling) -> bool {
        self.moves >= cooling.moves
    }

    /// Goes on for a slice, or to the end of the schedule if that comes first.
    pub fn advance(&mut self, space: &Space, norm: Norm, cooling: &Cooling) {
        let mut walk = space.walk(self.segments.clone());
        let mut values = Values::new(space.columns(), walk.coefficients(), norm);
        if values.cost() < self.best_cost {
            (self.best_cost, self.best_segments) = (values.cost(), walk.segments());
        }
        let mut best: Option<Walk> = None;
        let until = cooling.moves.min(self.moves + SLICE_MOVES);
        while self.moves < until {
            let temperature = cooling.temperature(self.moves);
            let pause = until.min(self.moves + MOVES_PER_TEMPERATURE);
            while self.moves < pause {
                self.moves += 1;
                let limit = values.cost() - temperature * libm::log(uniform(&mut self.random));
                let Some(changes) = walk.propose(space, &mut self.random) else { continue };
                if values.propose(space.columns(), changes, limit).is_some() {
                    values.accept();
                    walk.accept(space);
                    if values.cost() < self.best_cost {
                        self.best_cost = values.cost();
                        best = Some(walk.clone());
                    }
                } else {
                    walk.refuse(space);
                }
            }
        }
        if let Some(best) = best {
            self.best_segments = best.segments();
        }
        self.segments = walk.segments();
        self.work += values.work;
    }
}

/// A schedule for a space: as hot as a typical move is large, cooled until no such move passes.
///
/// Measured on random patterns and moves from stream 0 of the seed.
pub fn cooling_for(space: &Space, norm: Norm, seed: u64, moves: u64) -> Cooling {
    const PATTERNS: usize = 8;
    const MOVES: usize = 32;
    let mut random = generator(seed, 0);
    let (mut total, mut count) = (0.0, 0usize);
    for _ in 0..PATTERNS {
        let mut walk = space.walk(space.draw(&mut random));
        let mut values = Values::new(space.columns(), walk.coefficients(), norm);
        for _ in 0..MOVES {
            if let Some(changes) = walk.propose(space, &mut random) {
                let cost = values.propose(space.columns(), changes, f64::INFINITY).unwrap_or(values.cost());
                total += (cost - values.cost()).abs();
                count += 1;
            }
            walk.refuse(space);
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
    use crate::search::samples::SampleMatrix;
    use crate::search::samples::tests::{model, profiles};
    use crate::search::worst_case::SolvedProfiles;

    fn space(class: WindabilityClass) -> Space {
        let model = model(10, LayerLength::Actual, &[]);
        let solved = SolvedProfiles::new(&model, &profiles()).unwrap();
        Space::new(SampleMatrix::of_profiles(&model, &solved).unwrap().0, class)
    }

    #[test]
    fn a_restart_that_is_cut_and_taken_up_again_ends_as_the_unbroken_one() {
        let space = space(WindabilityClass::Any);
        let cooling = cooling_for(&space, Norm::Largest, 5, 3 * SLICE_MOVES);
        let mut unbroken = Restart::new(&space, 5, 2, None);
        let mut broken = unbroken.clone();
        while !unbroken.is_done(&cooling) {
            unbroken.advance(&space, Norm::Largest, &cooling);
        }
        while !broken.is_done(&cooling) {
            let saved = broken.clone();
            broken.advance(&space, Norm::Largest, &cooling);
            broken = saved;
            broken.advance(&space, Norm::Largest, &cooling);
        }
        assert_eq!(unbroken, broken);
    }

    #[test]
    fn most_moves_are_refused_after_one_block_of_samples() {
        let space = space(WindabilityClass::Any);
        let cooling = cooling_for(&space, Norm::Largest, 1, SLICE_MOVES);
        let mut restart = Restart::new(&space, 1, 0, None);
        restart.advance(&space, Norm::Largest, &cooling);
        let Work { moves, accepted, samples } = restart.work;
        assert_eq!(moves, SLICE_MOVES);
        assert!(accepted > 0 && accepted < moves / 4, "{accepted} of {moves}");
        assert!(samples < moves * space.matrix().samples() as u64 / 2, "{samples} of {moves}");
    }
}
