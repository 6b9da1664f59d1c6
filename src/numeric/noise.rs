//! White noise under a signal that is smooth nearly everywhere, from the sequence alone.
//!
//! ```text
//! s_w² = |(I − P_w) y|²/ν,   P_w: the quadratic through the W values of window w,   ν = W − 3
//! σ²   = mean of the s_w² that are ≤ σ² q/ν, divided by F_{ν+2}(q)/F_ν(q);   F_ν(q) = 0.98
//! se(σ)/σ = 1.06/√(2 e m)
//! ```
//!
//! | symbol | meaning |
//! |---|---|
//! | W | values in a window, 11; shorter for shorter sequences |
//! | F_ν, q | distribution of χ² with ν degrees of freedom, its quantile at 98 % |
//! | m, e | windows that were kept; how much one of overlapping windows tells, 0.81 for W = 11; 1.06 is what trimming costs |
//!
//! Steep parts that a quadratic follows cancel; windows with a corner, a step or a gross error in them stand above the χ²
//! distribution of the others and are left out, and what that takes from the noise itself is given back.
//!
//! Holds where at least a third of the windows hold nothing but noise and a quadratic. A signal that changes from value to
//! value cannot be told from noise.
//!
//! # Source
//! Residual variances of local polynomials: Gasser, Sroka, Jennen-Steinmetz, Biometrika 73 (1986) 625; trimming with the
//! factor that makes it consistent: Croux, Haesbroeck, J. Multivar. Anal. 71 (1999) 161.

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// The noise that was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WhiteNoise {
    pub deviation: f64,
    pub standard_error: f64,
    /// Of the windows, those that hold nothing but noise and a quadratic.
    pub(crate) kept_share: f64,
}

const WINDOW: usize = 11;
const COEFFICIENTS: usize = 3;
/// What a share of the windows keeps to.
const KEPT: f64 = 0.98;
/// Where the search begins: the quieter windows.
const QUIET: f64 = 0.3;
/// By this the trimming widens the standard error: from 600 sequences of pure noise, a test holds it to 12 %.
const TRIMMING: f64 = 1.06;
const MOST_ROUNDS: usize = 100;

/// White noise of `values` at `places`, which increase.
///
/// Not finite for fewer than three values.
pub(crate) fn white_noise(places: &[f64], values: &[f64]) -> WhiteNoise {
    let n = values.len().min(places.len());
    let window = WINDOW.min(n);
    // Three values leave a straight line one degree of freedom.
    let coefficients = COEFFICIENTS.min(window.saturating_sub(1)).min(if window < 5 { 2 } else { COEFFICIENTS });
    let unknown = WhiteNoise { deviation: f64::NAN, standard_error: f64::NAN, kept_share: 0.0 };
    if n < 3 {
        return unknown;
    }
    let freedom = (window - coefficients) as f64;
    let mut variances: Vec<f64> = (0..=n - window)
        .map(|i| residual_square(&places[i..i + window], &values[i..i + window], coefficients) / freedom)
        .collect();
    variances.sort_by(f64::total_cmp);
    let (Ok(own), Ok(next)) = (ChiSquared::new(freedom), ChiSquared::new(freedom + 2.0)) else { return unknown };
    let limit = own.inverse_cdf(KEPT);
    let shrinkage = next.cdf(limit) / KEPT;
    let mut sums = Vec::with_capacity(variances.len());
    let mut sum = 0.0;
    for variance in &variances {
        sum += variance;
        sums.push(sum);
    }
    let quiet = ((QUIET * variances.len() as f64) as usize).min(variances.len() - 1);
    let mut variance = variances[quiet] * freedom / own.inverse_cdf(QUIET);
    let mut kept = variances.len();
    for _ in 0..MOST_ROUNDS {
        let below = variances.partition_point(|v| *v <= variance * limit / freedom).max(1);
        variance = sums[below - 1] / below as f64 / shrinkage;
        // The same windows give the same variance.
        if std::mem::replace(&mut kept, below) == below {
            break;
        }
    }
    let deviation = variance.sqrt();
    let kept_windows = kept as f64;
    WhiteNoise {
        deviation,
        standard_error: TRIMMING * deviation
            / (2.0 * (efficiency(window, coefficients) * kept_windows).max(freedom)).sqrt(),
        kept_share: (kept_windows / KEPT / variances.len() as f64).min(1.0),
    }
}

/// What a polynomial of so many coefficients leaves of the values: its square sum.
fn residual_square(places: &[f64], values: &[f64], coefficients: usize) -> f64 {
    let (first, last) = (places[0], places[places.len() - 1]);
    let (middle, half) = (0.5 * (first + last), 0.5 * (last - first));
    let mut left: Vec<f64> = values.to_vec();
    let mut basis: Vec<Vec<f64>> = Vec::with_capacity(coefficients);
    for power in 0..coefficients {
        let mut column: Vec<f64> = places.iter().map(|x| ((x - middle) / half).powi(power as i32)).collect();
        for known in &basis {
            let share = dot(&column, known);
            column.iter_mut().zip(known).for_each(|(c, k)| *c -= share * k);
        }
        let norm = dot(&column, &column).sqrt();
        column.iter_mut().for_each(|c| *c /= norm);
        let share = dot(&left, &column);
        left.iter_mut().zip(&column).for_each(|(l, c)| *l -= share * c);
        basis.push(column);
    }
    dot(&left, &left)
}

/// What one of many overlapping windows tells, in independent values: (tr A)²/(n tr A²), A the sum of their quadratic forms.
fn efficiency(window: usize, coefficients: usize) -> f64 {
    let places: Vec<f64> = (0..window).map(|i| i as f64).collect();
    let unit = |i: usize| -> Vec<f64> { (0..window).map(|j| f64::from(i == j)).collect() };
    // Entries of I − P by polarisation.
    let square = |i: usize, j: usize| {
        let both: Vec<f64> = unit(i).iter().zip(unit(j)).map(|(a, b)| a + b).collect();
        residual_square(&places, &both, coefficients)
    };
    let alone: Vec<f64> = (0..window).map(|i| residual_square(&places, &unit(i), coefficients)).collect();
    let diagonals: Vec<f64> = (0..window)
        .map(|offset| {
            let entries = (0..window - offset).map(|i| match offset {
                0 => alone[i],
                _ => 0.5 * (square(i, i + offset) - alone[i] - alone[i + offset]),
            });
            entries.sum()
        })
        .collect();
    let rest: f64 = diagonals[1..].iter().map(|d| d * d).sum();
    diagonals[0] * diagonals[0] / (diagonals[0] * diagonals[0] + 2.0 * rest)
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use statrs::distribution::Normal;

    fn white(seed: u64, n: usize) -> Vec<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let normal = Normal::new(0.0, 1.0).unwrap();
        (0..n).map(|_| normal.inverse_cdf(random.random::<f64>())).collect()
    }

    #[test]
    fn the_standard_error_is_the_spread_over_many_sequences_and_there_is_no_bias() {
        let places: Vec<f64> = (0..600).map(f64::from).collect();
        let found: Vec<WhiteNoise> = (0..400).map(|seed| white_noise(&places, &white(seed, 600))).collect();
        let mean = found.iter().map(|f| f.deviation).sum::<f64>() / 400.0;
        let spread = (found.iter().map(|f| (f.deviation - mean).powi(2)).sum::<f64>() / 399.0).sqrt();
        let stated = found.iter().map(|f| f.standard_error).sum::<f64>() / 400.0;
        println!("mean {mean:.4}, spread {spread:.4}, stated {stated:.4}, efficiency {:.3}", efficiency(11, 3));
        assert!((mean - 1.0).abs() < 0.005);
        assert!((spread / stated - 1.0).abs() < 0.12);
    }

    #[test]
    fn steep_ramps_corners_steps_spikes_and_gaps_do_not_raise_the_noise() {
        let mut found = Vec::new();
        for seed in 0..30 {
            let mut places: Vec<f64> = (0..1500).map(f64::from).collect();
            places.iter_mut().skip(700).for_each(|p| *p += 40.0);
            let mut values = white(seed, 1500);
            for (value, place) in values.iter_mut().zip(&places) {
                // Every 150 values another ramp, settling over 12 of them, a hundred times the noise.
                let (since, sign) = (place % 150.0, if (place / 150.0) as i64 % 2 == 0 { 1.0 } else { -1.0 });
                *value += sign * 100.0 * (1.0 - (-since / 12.0).exp());
            }
            for i in (50..1500).step_by(200) {
                values[i] += 1e4;
            }
            let noise = white_noise(&places, &values);
            assert!((noise.deviation - 1.0).abs() < 4.0 * noise.standard_error, "{noise:?}");
            found.push(noise.deviation);
        }
        let mean = found.iter().sum::<f64>() / found.len() as f64;
        println!("mean {mean:.4}");
        assert!((mean - 1.0).abs() < 0.03);
    }

    #[test]
    fn three_values_give_a_number_and_two_give_none() {
        assert!((white_noise(&[0.0, 1.0, 2.0], &[0.0, 6.0f64.sqrt(), 0.0]).deviation).is_finite());
        assert!(white_noise(&[0.0, 1.0], &[0.0, 1.0]).deviation.is_nan());
    }
}
