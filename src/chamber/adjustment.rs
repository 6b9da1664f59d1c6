//! How much of a difference in log likelihood is evidence, where the model that it was computed with is not quite true.
//!
//! No chamber's air is what its prior says. The difference of two fits' log likelihoods then varies more than it would if the better
//! of them were true, and counts for as much less (Royall and Tsou's adjustment):
//!
//! ```text
//! ln L_a − ln L_b = Σ m_k,   e_k = m_k − E_a[m_k | past] = ½ (v_a² − S_a)(1/S_b − 1/S_a) + v_a δ/S_b,   δ = v_b − v_a
//! V = Σ ½ S_a² (1/S_b − 1/S_a)² + δ² S_a/S_b²                                     the variance of Σ e if a is true
//! J = Σ_blocks (Σ_block e)²                                                       the same as the records have it
//! ```
//!
//! A block is long beside what makes innovations depend on one another, a ripple or a wave of the controller.
//!
//! # Source
//! Royall and Tsou, J. R. Statist. Soc. B 65 (2003) 391 (robust adjusted likelihood); Vuong, Econometrica 57 (1989) 307 (the difference's
//! own variance); White, Econometrica 50 (1982) 1 (what an information is where the model is wrong).

use super::filter::Innovation;
use super::fit::Fit;
use super::{Chamber, ChamberError};

/// Variances of a difference of log likelihoods: as it should be, and as it is.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct DifferenceVariance {
    expected: f64,
    found: f64,
}

impl DifferenceVariance {
    /// By how much the difference is to be divided; one where it varies as it should, or less.
    pub(crate) fn divisor(&self) -> f64 {
        if self.expected > 0.0 { (self.found / self.expected).max(1.0) } else { 1.0 }
    }

    pub(crate) fn and(self, other: Self) -> Self {
        Self { expected: self.expected + other.expected, found: self.found + other.found }
    }

    /// By the innovations of both and the block of each.
    fn new(a: &[Innovation], b: &[Innovation], blocks: impl Iterator<Item = usize>) -> Self {
        let mut all = Self::default();
        let (mut block, mut sum) = (0, 0.0);
        for ((a, b), own) in a.iter().zip(b).zip(blocks) {
            if own != block {
                all.found += sum * sum;
                (block, sum) = (own, 0.0);
            }
            let (apart, delta) = (1.0 / b.variance - 1.0 / a.variance, b.value - a.value);
            sum += 0.5 * (a.value * a.value - a.variance) * apart + a.value * delta / b.variance;
            all.expected += 0.5 * (a.variance * apart).powi(2) + delta * delta * a.variance / (b.variance * b.variance);
        }
        all.found += sum * sum;
        all
    }
}

impl Chamber<'_> {
    /// How the difference of two fits' log likelihoods varies over a record, if the first is true and as it does.
    ///
    /// # Errors
    /// A model that cannot be solved.
    pub(crate) fn difference_variance(
        &self,
        likelier: &Fit,
        other: &Fit,
        record: usize,
    ) -> Result<DifferenceVariance, ChamberError> {
        let of = |fit: &Fit| self.pass(fit, &self.numbers_for(fit, record), record, true, None);
        let ((places, a), (_, b)) = (of(likelier)?, of(other)?);
        let block_rows = (self.times_s(record).len() as f64).sqrt().ceil() as usize;
        Ok(DifferenceVariance::new(&a, &b, places.iter().map(|(row, _)| row / block_rows)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use statrs::distribution::{ContinuousCDF, Normal};

    const ROWS: usize = 4000;
    const BLOCK: usize = 64;

    /// Innovations of unit variance that remember so much of the one before, and those of a model that also has a slow wave.
    fn divisor(memory: f64) -> f64 {
        let mut random = ChaCha8Rng::seed_from_u64(11);
        let normal = Normal::new(0.0, 1.0).unwrap();
        let mut last = 0.0;
        let mut value = || {
            let new = normal.inverse_cdf(random.random::<f64>());
            last = memory * last + (1.0 - memory * memory).sqrt() * new;
            last
        };
        let a: Vec<Innovation> = (0..ROWS).map(|_| Innovation { value: value(), variance: 1.0 }).collect();
        let wave = |k: usize| 0.2 * (k as f64 / 300.0).sin();
        let b: Vec<Innovation> =
            a.iter().enumerate().map(|(k, i)| Innovation { value: i.value + wave(k), ..*i }).collect();
        DifferenceVariance::new(&a, &b, (0..ROWS).map(|k| k / BLOCK)).divisor()
    }

    #[test]
    fn a_difference_counts_in_full_where_innovations_are_white_and_less_where_they_remember() {
        assert!(divisor(0.0) < 1.5, "{}", divisor(0.0));
        // Sums of an autoregression over long blocks vary (1 + φ)/(1 − φ) times as much.
        let (found, long) = (divisor(0.8), 1.8 / 0.2);
        assert!(0.6 * long < found && found < 1.4 * long, "{found} for {long}");
    }

    #[test]
    fn models_that_foretell_the_same_are_not_divided() {
        let a = [Innovation { value: 1.0, variance: 2.0 }; 8];
        assert!((DifferenceVariance::new(&a, &a, 0..8).divisor() - 1.0).abs() < 1e-15);
    }

    #[test]
    fn records_are_put_together_by_their_variances() {
        let (one, other) =
            (DifferenceVariance { expected: 1.0, found: 4.0 }, DifferenceVariance { expected: 3.0, found: 2.0 });
        assert!((one.and(other).divisor() - 1.5).abs() < 1e-15);
    }
}
