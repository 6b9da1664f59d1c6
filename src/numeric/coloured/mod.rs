//! Strengths of five noises in a rate with intervals: maximum likelihood on the Haar (Allan) variances of all octaves at once.
//!
//! ```text
//! −2 log L = Σ_j w_j [n_j log s_j + Σ (d_j − X_j β)²/s_j],   β ~ N(0, τ_g²)
//! s_j = 3 Q²/(m τ0²) + N²/τ0 + m (2 ln 2/π) B² r_j + K² τ0 (m²/3 … m²/3 + 1/6),   m = 2^(j−1)
//! w_j = 1/(Σ_k C_jk + n_j ε² (share_B² + share_K²)/2),   C_jk = Σ corr(d_j, d_k)²/n_j
//! ```
//!
//! | symbol | meaning | in code |
//! |---|---|---|
//! | d_j, n_j | Haar coefficients of level j ([`crate::numeric::pyramid`]) and their number | `Level` |
//! | X, β, τ_g | what is known to move the rate (a ramp; what follows the temperature), how much it does, and how large that usually is | `columns` |
//! | Q, N, B, K, R | quantisation, white, flicker, random walk; R is the β of the column of time | [`NoiseStrengths`] |
//! | r_j | flicker as sampled (Hosking's) beside flicker as averaged: both, and their mixtures, are allowed; so for the random walk | `HOSKING` |
//! | w_j | a level counts as far as the others don't tell the same: with these the likelihood never claims more than it knows | `weights` |
//! | ε | by how much a real flicker's or random walk's octaves stray from the law | `STRAY` |
//!
//! β is integrated out (restricted likelihood), so that a record that follows its temperature loses exactly the octaves that the
//! temperature explains, and one that doesn't loses nothing: τ_g is estimated with the rest. An interval is where the likelihood,
//! maximised over everything else, stays within the χ² quantile of 98.98 %: all five intervals hold together with 95 %. Of
//! the ramp's, which a slow walk and flicker imitate, see `ramp.rs`.
//! A value is the best fit with those noises that the intervals show not to be zero; one that may be absent is 0.
//!
//! Upper ends are sought with the w_j of the best fit and with those of the end itself, where the noise in question is strongest; the
//! higher one counts. That w_j makes it conservative: Σ_jk a_j a_k w_j w_k C_jk ≤ Σ_j a_j² w_j for every direction a (Gershgorin), so the variance
//! of the score is never more than the curvature says.
//!
//! # Source
//! Wavelet likelihood of long memory: Percival, Walden (2000), chapter 9; Guerrier et al., J. Am. Stat. Assoc. 108 (2013) 1021
//! (wavelet moments of gyro noises); composite likelihood: Varin, Reid, Firth, Statistica Sinica 21 (2011) 5; restricted
//! likelihood by majorising steps: Zhou et al., J. Comput. Graph. Stat. 28 (2019) 350; leaps along them: Varadhan, Roland, Scand. J.
//! Stat. 35 (2008) 335; ends by false position: Dowell, Jarratt, BIT 11 (1971) 168; sampled flicker: Hosking, Biometrika 68
//! (1981) 165; coefficients: IEEE Std 952.

mod likelihood;
mod ramp;

use crate::numeric::pyramid::Level;
use likelihood::{Likelihood, Point};

/// A strength and the interval in which it lies; `low` is 0 where the noise may be absent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// The most likely strength.
    pub value: f64,
    /// Its lower end.
    pub low: f64,
    /// Its upper end.
    pub high: f64,
}

/// In the units of y and seconds, as in [`crate::numeric::allan`].
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseStrengths {
    /// Q.
    pub quantisation: Interval,
    /// N.
    pub white: Interval,
    /// B.
    pub flicker: Interval,
    /// K.
    pub random_walk: Interval,
    pub(crate) ramp: Interval,
    /// Root mean square of what the further columns explain, in units of y.
    pub(crate) explained: f64,
}

/// Each of five intervals, so that all hold with 95 %: 0.95^(1/5).
const CONFIDENCE: f64 = 0.989_793_78;
/// χ² with one degree of freedom at [`CONFIDENCE`].
const LIKELIHOOD_RATIO: f64 = 6.602;
/// Relative, of an octave's variance.
const STRAY: f64 = 0.03;
/// Fewer octaves tell no noise from another.
const LEAST_LEVELS: usize = 3;
/// Rounds in which weights follow the fit.
const WEIGHTINGS: usize = 2;
/// Rounds in which the weights at an upper end follow it.
const DOUBTS: usize = 4;
/// An end of an interval is found to this part of itself.
const FINE: f64 = 2e-3;
const MOST_DOUBLINGS: usize = 80;
/// Of a noise's variance: a lower end that is less than this is none.
const FAINTEST: f64 = 1e-6;
/// Of an end's tolerance: no closer to what is known already is anything tried.
const LEAST_SHARE: f64 = 0.45;

/// Which of the likelihood's components make up each kind: quantisation, white, flicker, random walk.
const KINDS: [&[usize]; 4] = [&[0], &[1], &[2, 3], &[4, 5]];

/// Of `levels` whose columns are: y, time in seconds, and groups of further ones of the given sizes.
///
/// None where there are too few levels or nothing varies.
pub fn noise_strengths(levels: &[(usize, Level)], interval_s: f64, groups: &[usize]) -> Option<NoiseStrengths> {
    if levels.len() < LEAST_LEVELS {
        return None;
    }
    let mut likelihood = Likelihood::new(levels, interval_s, groups)?;
    let mut point = likelihood.best();
    for _ in 0..WEIGHTINGS {
        likelihood.weigh(&point);
        point = likelihood.maximised(&point, None);
    }
    let found: Vec<Interval> = KINDS.iter().map(|parts| interval(&likelihood, &point, parts)).collect();
    let best = parsimonious(&likelihood, &point, &found);
    let scale = likelihood.scale();
    let strength = |kind: usize| {
        let variance: f64 = KINDS[kind].iter().map(|part| best.variances[*part]).sum();
        let Interval { low, high, .. } = found[kind];
        // What no octave shows is none.
        let variance = if variance < likelihood.least_visible(KINDS[kind]) { 0.0 } else { variance };
        Interval { value: scale * variance.clamp(low, high).sqrt(), low: scale * low.sqrt(), high: scale * high.sqrt() }
    };
    Some(NoiseStrengths {
        quantisation: strength(0),
        white: strength(1),
        flicker: strength(2),
        random_walk: strength(3),
        ramp: ramp::interval(&likelihood, &point, &best),
        explained: likelihood.explained(&best),
    })
}

/// In variances, of the likelihood's own units.
fn interval(likelihood: &Likelihood, best: &Point, parts: &[usize]) -> Interval {
    let value: f64 = parts.iter().map(|part| best.variances[*part]).sum();
    let within = value.max(likelihood.least_visible(parts));
    let at_zero = likelihood.maximised(best, Some((parts, 0.0))).minus_two_log_likelihood;
    let low = if at_zero - best.minus_two_log_likelihood <= LIKELIHOOD_RATIO || value <= 0.0 {
        0.0
    } else {
        // Where only none at all is beyond the quantile, and that by a hair, the noise may be absent.
        Some(end(likelihood, best, parts, value, 0.5).0).filter(|low| *low > FAINTEST * value).unwrap_or(0.0)
    };
    let (mut high, mut there) = end(likelihood, best, parts, within, 2.0);
    // With so much of this noise the octaves say more in common than with the best fit's: they count less.
    let mut doubtful = likelihood.clone();
    for _ in 0..DOUBTS {
        doubtful.weigh(&there);
        let best = doubtful.maximised(best, None);
        let (end, at) = end(&doubtful, &best, parts, within, 2.0);
        if end <= high * (1.0 + FINE) {
            break;
        }
        (high, there) = (end, at);
    }
    Interval { value, low, high }
}

/// An end of an interval, sought from a variance `within` it by steps of a `factor` and then between the last two: the first
/// variance beyond the quantile, and the fit nearest to it that is not.
fn end(likelihood: &Likelihood, best: &Point, parts: &[usize], within: f64, factor: f64) -> (f64, Point) {
    // Nearly straight over the logarithm of the variance.
    let above = |from: &Point, logarithm: f64| {
        let at = likelihood.maximised(from, Some((parts, logarithm.exp())));
        let height = (at.minus_two_log_likelihood - best.minus_two_log_likelihood).max(0.0);
        (height.sqrt() - LIKELIHOOD_RATIO.sqrt(), at)
    };
    let step = factor.ln();
    let (mut inside, mut below, mut from) = (within.ln(), -LIKELIHOOD_RATIO.sqrt(), best.clone());
    let (mut outside, mut over) = (inside + step, LIKELIHOOD_RATIO.sqrt());
    for _ in 0..MOST_DOUBLINGS {
        let (height, at) = above(&from, outside);
        over = height;
        if height > 0.0 {
            break;
        }
        (inside, below, from) = (outside, height, at);
        outside += step;
    }
    // False position; a side that stays counts half as much each time.
    while (outside - inside).abs() > FINE {
        let share = (below / (below - over)).clamp(0.0, 1.0);
        let least = LEAST_SHARE * FINE / (outside - inside).abs();
        let between = inside + share.clamp(least, 1.0 - least) * (outside - inside);
        let (height, at) = above(&from, between);
        if height > 0.0 {
            (outside, over, below) = (between, height, 0.5 * below);
        } else {
            (inside, below, from, over) = (between, height, at, 0.5 * over);
        }
    }
    (outside.exp(), from)
}

/// The fit with the noises that cannot be absent, where that is as good as the data can tell.
fn parsimonious(likelihood: &Likelihood, point: &Point, found: &[Interval]) -> Point {
    let mut start = point.clone();
    for (parts, interval) in KINDS.iter().zip(found) {
        if interval.low <= 0.0 {
            parts.iter().for_each(|part| start.variances[*part] = 0.0);
        }
    }
    if start.variances.iter().all(|v| *v <= 0.0) {
        return point.clone();
    }
    let fewer = likelihood.maximised(&start, None);
    let is_as_good = fewer.minus_two_log_likelihood - point.minus_two_log_likelihood <= LIKELIHOOD_RATIO;
    if is_as_good { fewer } else { point.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::pyramid::Pyramid;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use statrs::distribution::{ContinuousCDF, Normal};

    fn gaussians(seed: u64, n: usize) -> Vec<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let normal = Normal::new(0.0, 1.0).unwrap();
        (0..n).map(|_| normal.inverse_cdf(random.random::<f64>())).collect()
    }

    fn found(y: &[f64], interval_s: f64) -> NoiseStrengths {
        let mut pyramid = Pyramid::new(2, 0);
        for (i, value) in y.iter().enumerate() {
            pyramid.push(i as u64, *value, |slow| slow[0] = interval_s * i as f64);
        }
        noise_strengths(&pyramid.finish(), interval_s, &[]).unwrap()
    }

    fn holds(interval: Interval, truth: f64) -> bool {
        interval.low <= truth && truth <= interval.high
    }

    #[test]
    fn white_noise_and_a_random_walk_lie_within_their_intervals_and_flicker_is_not_seen() {
        let (n, step_s) = (20_000, 0.5);
        let mut missed = 0;
        for seed in 0..12 {
            let white = gaussians(2 * seed, n);
            let mut walk = 0.0;
            let y: Vec<f64> = gaussians(2 * seed + 1, n)
                .iter()
                .zip(&white)
                .map(|(step, white)| {
                    walk += 0.01 * step;
                    walk + white
                })
                .collect();
            let strengths = found(&y, step_s);
            println!("{strengths:?}");
            missed += usize::from(!holds(strengths.white, step_s.sqrt()));
            missed += usize::from(!holds(strengths.random_walk, 0.01 / step_s.sqrt()));
            missed += usize::from(!holds(strengths.flicker, 0.0) || !holds(strengths.quantisation, 0.0));
            missed += usize::from(!holds(strengths.ramp, 0.0));
            assert!((strengths.white.value / step_s.sqrt() - 1.0).abs() < 0.05);
            assert!(strengths.random_walk.high < 5.0 * strengths.random_walk.low.max(0.002));
        }
        assert!(missed <= 1, "{missed}");
    }

    #[test]
    fn a_quantised_angle_and_a_ramp_are_found() {
        let n = 4000;
        let (angle, white) = (gaussians(5, n + 1), gaussians(6, n));
        let y: Vec<f64> = (0..n).map(|i| 3.0 * (angle[i + 1] - angle[i]) + white[i] + 2e-3 * i as f64).collect();
        let strengths = found(&y, 1.0);
        println!("{strengths:?}");
        assert!(holds(strengths.quantisation, 3.0) && strengths.quantisation.low > 2.5);
        assert!(holds(strengths.ramp, 2e-3) && strengths.ramp.low > 1e-3);
        assert!(holds(strengths.white, 1.0));
    }

    #[test]
    fn values_that_do_not_vary_but_for_one_step_have_intervals_that_end() {
        // Nothing varies in the finest octaves: no variance is too small to show there.
        for (at, step) in [(64, 1.0), (64, 1e-100), (96, 1e100)] {
            let y: Vec<f64> = (0..160).map(|i| if i < at { 0.0 } else { step }).collect();
            let strengths = found(&y, 10.0);
            for interval in [strengths.quantisation, strengths.white, strengths.flicker, strengths.random_walk] {
                assert!(interval.low <= interval.value && interval.value <= interval.high, "{strengths:?}");
                assert!(interval.high > 0.0 && interval.high.is_finite(), "{strengths:?}");
            }
        }
    }

    #[test]
    fn what_a_further_column_explains_is_not_taken_for_noise() {
        let n = 10_000;
        let white = gaussians(7, n);
        let mut pyramid = Pyramid::new(4, 0);
        for (i, white) in white.iter().enumerate() {
            let cycle = (i as f64 / 500.0).sin();
            pyramid.push(i as u64, white + 5.0 * cycle, |slow| {
                slow.copy_from_slice(&[i as f64, 40.0 * cycle, (i as f64 / 900.0).cos()]);
            });
        }
        let strengths = noise_strengths(&pyramid.finish(), 1.0, &[2]).unwrap();
        println!("{strengths:?}");
        assert!(holds(strengths.white, 1.0) && strengths.white.high < 1.1);
        assert!(holds(strengths.random_walk, 0.0) && holds(strengths.flicker, 0.0));
        assert!((strengths.explained - 5.0 / 2f64.sqrt()).abs() < 0.2);
    }
}
