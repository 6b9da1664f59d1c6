//! What makes each built coil another one: standard normal deviates from one stream of random numbers, in which every coil has its place.
//!
//! A coil's deviates stand at its own position of the stream, so a part of the coils is drawn without those before it.

use std::ops::Range;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use statrs::distribution::{ContinuousCDF, Normal};

/// One coil's standard normal deviates.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Deviates {
    pub turns: Vec<f64>,
    /// In the order of [`super::tolerance::Spread::ALL`]; the first is not used.
    pub others: [f64; OTHERS],
}

/// Deviates beside those of the turns.
const OTHERS: usize = 6;

/// Words of the stream that a deviate takes.
const WORDS_PER_DEVIATE: u128 = 2;

impl Deviates {
    /// Of those coils, counted from 0.
    pub fn of(seed: u64, layers: usize, coils: Range<u64>) -> Vec<Self> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let normal = Normal::standard();
        let words_per_coil = (layers + OTHERS) as u128 * WORDS_PER_DEVIATE;
        random.set_word_pos(u128::from(coils.start) * words_per_coil);
        let mut draw = || normal.inverse_cdf(random.random::<f64>().max(f64::MIN_POSITIVE));
        let drawn = |_| Self { turns: (0..layers).map(|_| draw()).collect(), others: std::array::from_fn(|_| draw()) };
        coils.map(drawn).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_is_what_stands_there_in_the_whole() {
        for layers in [4, 7] {
            let whole = Deviates::of(9, layers, 0..40);
            for part in [0..1, 3..17, 17..40] {
                assert_eq!(Deviates::of(9, layers, part.clone()), whole[part.start as usize..part.end as usize]);
            }
        }
    }
}
