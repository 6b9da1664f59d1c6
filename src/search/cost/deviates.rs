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
    pub(crate) turns: Vec<f64>,
    /// In the order of [`super::tolerance::Spread::ALL`]; the first is not used.
    pub(crate) others: [f64; OTHERS],
    /// Of each layer, even between 0 and 1; empty where nothing asks for it, as the next.
    pub(crate) lost: Vec<f64>,
    pub(crate) pitches: Vec<f64>,
    pub(crate) flanges: [f64; 2],
    /// Even between −1 and 1.
    pub(crate) trim: f64,
}

/// Deviates beside those of the turns.
const OTHERS: usize = 6;

/// Further deviates of a coil beside two a layer, and the stream that they stand in.
const FURTHER: usize = 3;
const FURTHER_STREAM: u64 = 1;

/// Words of the stream that a deviate takes.
const WORDS_PER_DEVIATE: u128 = 2;

impl Deviates {
    /// Of those coils, counted from 0. What is further stands in a stream of its own, so that the others are the same without it.
    pub(crate) fn of(seed: u64, layers: usize, coils: Range<u64>, is_further: bool) -> Vec<Self> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let normal = Normal::standard();
        let words_per_coil = (layers + OTHERS) as u128 * WORDS_PER_DEVIATE;
        random.set_word_pos(u128::from(coils.start) * words_per_coil);
        let mut further = ChaCha8Rng::seed_from_u64(seed);
        further.set_stream(FURTHER_STREAM);
        let further_words_per_coil = (2 * layers + FURTHER) as u128 * WORDS_PER_DEVIATE;
        further.set_word_pos(u128::from(coils.start) * further_words_per_coil);
        let of_even = |u: f64| normal.inverse_cdf(u.max(f64::MIN_POSITIVE));
        let mut draw = || of_even(random.random::<f64>());
        let drawn = |_| {
            let (turns, others) = ((0..layers).map(|_| draw()).collect(), std::array::from_fn(|_| draw()));
            let mut coil = Self { turns, others, lost: Vec::new(), pitches: Vec::new(), flanges: [0.0; 2], trim: 0.0 };
            if is_further {
                coil.lost = (0..layers).map(|_| further.random::<f64>()).collect();
                coil.pitches = (0..layers).map(|_| of_even(further.random::<f64>())).collect();
                coil.flanges = std::array::from_fn(|_| of_even(further.random::<f64>()));
                coil.trim = 2.0 * further.random::<f64>() - 1.0;
            }
            coil
        };
        coils.map(drawn).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_is_what_stands_there_in_the_whole() {
        for layers in [4, 7] {
            let whole = Deviates::of(9, layers, 0..40, true);
            for part in [0..1, 3..17, 17..40] {
                let drawn = Deviates::of(9, layers, part.clone(), true);
                assert_eq!(drawn, whole[part.start as usize..part.end as usize]);
                let without = Deviates::of(9, layers, part, false);
                assert!(drawn.iter().zip(&without).all(|(a, b)| (&a.turns, a.others) == (&b.turns, b.others)));
            }
        }
    }
}
