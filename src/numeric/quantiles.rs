//! Quantiles of many values that are never in one place: each part keeps counts on a fixed grid and its largest values, and parts add up.
//!
//! The largest values are kept as they are, so quantiles of the upper tail are exact: each part keeps twice the share that
//! [`EXACT_SHARE`] leaves above it and 50 values more, and the quantile's place lies among what no part has left out. (That a part of
//! independent values holds more than that above the quantile of all is 16 standard deviations away for parts of ten thousand, and
//! more for larger ones; of a small part everything is kept.) Below, a quantile is read from the counts, off by at most
//! 2⁻¹⁰ of itself. How values are split into parts changes nothing of either.
//!
//! # Source
//! Distribution-free interval of a quantile between order statistics: David, Nagaraja, Order Statistics (2003), section 7.1.

use std::collections::BTreeMap;

/// Quantiles above this are exact: P99 and, of some thousand values, the lower end of its interval.
pub(crate) const EXACT_SHARE: f64 = 0.985;

/// Bits of a value's fraction that tell the steps of the grid apart: a step is at most 2⁻¹⁰ wide, over its values.
const GRID_BITS: u32 = 10;

/// What each part keeps of its largest values, at the least.
const FURTHER: u64 = 50;

/// Values of which the largest and the counts are kept.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct QuantileSketch {
    count: u64,
    steps: BTreeMap<u64, u64>,
    /// Descending.
    largest: Vec<f64>,
    /// All values above this are among the largest.
    complete_above: f64,
}

impl QuantileSketch {
    /// Of a part's values, which must be finite and not negative; none if one is not.
    pub(crate) fn of(values: &[f64]) -> Option<Self> {
        if values.iter().any(|v| !v.is_finite() || *v < 0.0) {
            return None;
        }
        let mut steps = BTreeMap::new();
        for value in values {
            *steps.entry(step(*value)).or_insert(0) += 1;
        }
        let mut largest = values.to_vec();
        largest.sort_by(|a, b| b.total_cmp(a));
        largest.truncate(kept(values.len() as u64) as usize);
        Some(Self::from_parts(steps.into_iter(), largest))
    }

    /// As it was written down.
    pub(crate) fn from_parts(steps: impl Iterator<Item = (u64, u64)>, largest: Vec<f64>) -> Self {
        let steps: BTreeMap<u64, u64> = steps.collect();
        let count = steps.values().sum();
        let is_all = largest.len() as u64 == count;
        let complete_above = if is_all { -1.0 } else { largest.last().copied().unwrap_or(f64::INFINITY) };
        Self { count, steps, largest, complete_above }
    }

    pub(crate) fn count(&self) -> u64 {
        self.count
    }

    /// Step of the grid and how many values lie in it, ascending.
    pub(crate) fn steps(&self) -> impl Iterator<Item = (u64, u64)> {
        self.steps.iter().map(|(step, count)| (*step, *count))
    }

    /// Descending.
    pub(crate) fn largest(&self) -> &[f64] {
        &self.largest
    }

    /// Takes another part in.
    pub(crate) fn add(&mut self, other: &Self) {
        if self.count == 0 {
            *self = other.clone();
            return;
        }
        self.count += other.count;
        for (step, count) in &other.steps {
            *self.steps.entry(*step).or_insert(0) += count;
        }
        self.complete_above = self.complete_above.max(other.complete_above);
        self.largest.extend_from_slice(&other.largest);
        self.largest.retain(|v| *v >= self.complete_above);
        self.largest.sort_by(|a, b| b.total_cmp(a));
    }

    /// The value that a share of all does not exceed, between the order statistics.
    pub(crate) fn quantile(&self, share: f64) -> f64 {
        let place = share.clamp(0.0, 1.0) * (self.count - 1) as f64;
        let (below, above) = (place.floor(), place.ceil());
        let (a, b) = (self.ordered(below as u64), self.ordered(above as u64));
        a + (b - a) * (place - below)
    }

    /// Between which values the quantile of what was drawn from lies with a probability of at least `confidence`, whatever the
    /// distribution; none where there are too few values for a bound.
    pub(crate) fn interval(&self, share: f64, confidence: f64) -> (Option<f64>, Option<f64>) {
        let (low, high) = binomial_range(self.count, share, 0.5 * (1.0 - confidence));
        let low = (low > 0).then(|| self.ordered(low - 1));
        let high = (high < self.count).then(|| self.ordered(high));
        (low, high)
    }

    /// The value at a place of the ascending order, counted from 0.
    fn ordered(&self, place: u64) -> f64 {
        // Whether a value is taken exactly must not depend on how much the parts happen to have kept.
        let is_exact = place >= (EXACT_SHARE * (self.count - 1) as f64) as u64;
        if let Some(exact) = self.largest.get((self.count - 1 - place) as usize).filter(|_| is_exact) {
            return *exact;
        }
        let mut before = 0;
        for (&step, &count) in &self.steps {
            if place < before + count {
                let (low, high) = (lower_end(step), lower_end(step + 1));
                return low + (high - low) * ((place - before) as f64 + 0.5) / count as f64;
            }
            before += count;
        }
        f64::INFINITY
    }
}

/// How many of a part's largest values it keeps.
fn kept(count: u64) -> u64 {
    (2.0 * (1.0 - EXACT_SHARE) * count as f64).ceil() as u64 + FURTHER
}

/// The step of the grid that a value lies in: the first bits of the number, so that steps are equally wide within an octave.
fn step(value: f64) -> u64 {
    value.to_bits() >> (f64::MANTISSA_DIGITS - 1 - GRID_BITS)
}

fn lower_end(step: u64) -> f64 {
    f64::from_bits(step << (f64::MANTISSA_DIGITS - 1 - GRID_BITS))
}

/// The smallest numbers k of n draws at which the binomial distribution function reaches `outside` and `1 − outside`.
///
/// Its weights are counted from the most likely number to both sides, where none of them is too small to be told from zero.
fn binomial_range(n: u64, share: f64, outside: f64) -> (u64, u64) {
    let odds = share / (1.0 - share);
    let mode = (((n + 1) as f64 * share) as u64).min(n);
    let (mut below, mut above) = (Vec::new(), Vec::new());
    let (mut weight, mut k) = (1.0, mode);
    while k > 0 && weight > LEAST_WEIGHT {
        weight *= k as f64 / ((n - k + 1) as f64 * odds);
        k -= 1;
        below.push(weight);
    }
    (weight, k) = (1.0, mode);
    while k < n && weight > LEAST_WEIGHT {
        weight *= (n - k) as f64 * odds / (k + 1) as f64;
        k += 1;
        above.push(weight);
    }
    let first = mode - below.len() as u64;
    let weights: Vec<f64> = below.into_iter().rev().chain([1.0]).chain(above).collect();
    let sum: f64 = weights.iter().sum();
    let reached = |share: f64| {
        let mut so_far = 0.0;
        let found = weights.iter().position(|w| {
            so_far += w;
            so_far >= share * sum
        });
        first + found.unwrap_or(weights.len() - 1) as u64
    };
    (reached(outside), reached(1.0 - outside))
}

/// Of the largest one: what is left out is below the rounding of the sum.
const LEAST_WEIGHT: f64 = 1e-20;

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn drawn(count: usize) -> Vec<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        (0..count).map(|_| -random.random::<f64>().ln()).collect()
    }

    fn of_parts(values: &[f64], size: usize) -> QuantileSketch {
        values.chunks(size).fold(QuantileSketch::default(), |mut all, part| {
            all.add(&QuantileSketch::of(part).unwrap());
            all
        })
    }

    #[test]
    fn parts_of_any_size_say_the_same_exactly_in_the_tail_and_within_a_step_elsewhere() {
        let values = drawn(30_000);
        let mut ascending = values.clone();
        ascending.sort_by(f64::total_cmp);
        let exact = |share: f64| {
            let place = share * (ascending.len() - 1) as f64;
            let (a, b) = (ascending[place.floor() as usize], ascending[place.ceil() as usize]);
            a + (b - a) * (place - place.floor())
        };
        let whole = of_parts(&values, values.len());
        for share in [0.99, 0.995, 0.999, 1.0] {
            assert_eq!(whole.quantile(share), exact(share), "{share}");
        }
        for share in [0.01, 0.5, 0.95] {
            assert!((whole.quantile(share) / exact(share) - 1.0).abs() < f64::from(1 << GRID_BITS).recip(), "{share}");
        }
        for size in [7, 1000, 10_000] {
            let parts = of_parts(&values, size);
            for share in [0.5, 0.9, 0.95, 0.97, 0.98, 0.985, 0.99, 0.999] {
                assert_eq!(parts.quantile(share), whole.quantile(share), "{size} {share}");
                assert_eq!(parts.interval(share, 0.95), whole.interval(share, 0.95), "{size} {share}");
            }
        }
        assert!(QuantileSketch::of(&[1.0, f64::INFINITY]).is_none());
    }

    #[test]
    fn an_interval_of_a_quantile_holds_as_often_as_it_says_and_few_values_have_no_upper_bound() {
        // Of exponential draws the quantile is known: -ln(1 - share).
        let (share, runs) = (0.99f64, 400);
        let quantile = -(1.0 - share).ln();
        let values = drawn(2000 * runs);
        let held = values.chunks(2000).filter(|part| {
            let (low, high) = QuantileSketch::of(part).unwrap().interval(share, 0.95);
            low.unwrap() <= quantile && quantile < high.unwrap()
        });
        // At the least 95 %, and the interval is no wider than it must be; three standard errors of 400 runs are 3.3 %.
        let held = held.count() as f64 / runs as f64;
        assert!((0.92..0.99).contains(&held), "{held}");
        let few = QuantileSketch::of(&values[..100]).unwrap();
        assert_eq!(few.interval(0.999, 0.95).1, None);
        assert_eq!(binomial_range(2, 0.5, 0.25), (0, 1));
        // By the normal distribution: 1e6 × 0.001 ± 1.96 √999.
        let (low, high) = binomial_range(1_000_000, 0.999, 0.025);
        assert!((low as i64 - 998_938).abs() < 5 && (high as i64 - 999_061).abs() < 5, "{low} {high}");
    }
}
