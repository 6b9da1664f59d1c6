//! The Allan deviation: how the mean over a time τ differs from the next such mean, and which noise that is.
//!
//! ```text
//! σ²(τ) = 1/(2 τ² (N − 2m)) Σ_{k=0}^{N−2m−1} (θ_{k+2m} − 2θ_{k+m} + θ_k)²,   τ = m τ0,   θ_k = τ0 Σ_{i<k} y_i
//! σ²(τ) = 3 Q²/τ² + N²/τ + (2 ln 2/π) B² + K² τ/3 + R² τ²/2
//! ```
//!
//! | symbol | meaning | slope of σ | in code |
//! |---|---|---|---|
//! | Q | quantisation of the angle | −1 | `quantisation` |
//! | N | white noise of the rate: random walk of the angle | −½ | `white` |
//! | B | flicker: bias instability | 0 | `flicker` |
//! | K | random walk of the rate | +½ | `random_walk` |
//! | R | ramp of the rate | +1 | `ramp` |
//!
//! All of them are in the units of y times the power of seconds that the equation says.
//!
//! # Source
//! IEEE Std 952, annex C; Riley, Handbook of Frequency Stability Analysis, NIST SP 1065 (2008), section 5.2.4 (overlapping
//! estimator) and 5.4.1 (degrees of freedom).

use nalgebra::{DMatrix, DVector};

/// One point of the Allan deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AllanPoint {
    pub tau_s: f64,
    pub deviation: f64,
    /// How many pairs of means it was estimated from.
    pub pairs: usize,
    /// One standard error, from the degrees of freedom of independent pairs.
    pub standard_error: f64,
}

/// Overlapping Allan deviation at averaging factors `factors` of a rate that is sampled every `interval_s`.
///
/// Factors for which the values do not reach (fewer than 2m + 1 of them) are left out.
pub fn overlapping(rates: &[f64], interval_s: f64, factors: &[usize]) -> Vec<AllanPoint> {
    // The mean is taken off first: it cancels in the sum, but not in its rounding.
    let mean = rates.iter().sum::<f64>() / rates.len().max(1) as f64;
    let mut angle = Vec::with_capacity(rates.len() + 1);
    let mut sum = 0.0;
    angle.push(0.0);
    for rate in rates {
        sum += rate - mean;
        angle.push(sum);
    }
    factors
        .iter()
        .filter(|&&m| m > 0 && 2 * m < angle.len())
        .map(|&m| {
            let pairs = angle.len() - 2 * m;
            let square: f64 = (0..pairs).map(|k| (angle[k + 2 * m] - 2.0 * angle[k + m] + angle[k]).powi(2)).sum();
            let m_real = m as f64;
            let deviation = (square / (2.0 * pairs as f64)).sqrt() / m_real;
            let freedom = degrees_of_freedom(rates.len() + 1, m);
            AllanPoint {
                tau_s: m_real * interval_s,
                deviation,
                pairs,
                standard_error: deviation / (2.0 * freedom).sqrt(),
            }
        })
        .collect()
}

/// Of the overlapping estimator for white noise of the rate (NIST SP 1065, Table 5), `n` points of the angle.
fn degrees_of_freedom(n: usize, m: usize) -> f64 {
    let (n, m) = (n as f64, m as f64);
    let freedom = (3.0 * (n - 1.0) / (2.0 * m) - 2.0 * (n - 2.0) / n) * 4.0 * m * m / (4.0 * m * m + 5.0);
    freedom.max(1.0)
}

/// Averaging factors in steps of about a tenth of a decade, up to a third of the values.
pub fn factors(values: usize) -> Vec<usize> {
    let mut factors: Vec<usize> = (0..)
        .map(|i| 10f64.powf(0.1 * f64::from(i)).round() as usize)
        .take_while(|&m| 3 * m <= values.max(3))
        .collect();
    factors.dedup();
    factors
}

/// N, read off where the curve falls with −½: the strength of white noise and whether such a stretch was found.
///
/// The first stretch with local slopes between −0.65 and −0.35 counts, each point by its degrees of freedom. Without one,
/// something else covers the white noise everywhere, and what is returned is the largest that fits under the curve.
pub fn white_by_slope(points: &[AllanPoint]) -> Option<(f64, bool)> {
    let usable: Vec<&AllanPoint> = points.iter().filter(|p| p.deviation > 0.0).collect();
    let slope = |i: usize| {
        let (a, b) = (usable[i.saturating_sub(1)], usable[(i + 1).min(usable.len() - 1)]);
        (b.deviation / a.deviation).ln() / (b.tau_s / a.tau_s).ln()
    };
    let falls = |i: &usize| (slope(*i) + 0.5).abs() < 0.15;
    let square = |p: &AllanPoint| p.deviation * p.deviation * p.tau_s;
    let least = usable.iter().map(|p| square(p)).min_by(f64::total_cmp)?;
    // Beyond a hump of something slow the curve may fall with -1/2 too, far above the noise.
    let is_low = |i: &usize| square(usable[*i]) < LOW * least;
    let Some(first) = (0..usable.len()).find(|i| falls(i) && is_low(i)) else { return Some((least.sqrt(), false)) };
    let stretch: Vec<&AllanPoint> = (first..usable.len()).take_while(falls).map(|i| usable[i]).collect();
    let freedom: f64 = stretch.iter().map(|p| weight(p) * weight(p)).sum();
    let sum: f64 = stretch.iter().map(|p| weight(p) * weight(p) * square(p)).sum();
    Some(((sum / freedom).sqrt(), true))
}

/// A stretch of white noise has no other point of the curve further below it than this, in σ²τ.
const LOW: f64 = 2.0;

/// A quantised angle falls with −1 where it is seen first; what falls less steeply than this is not quantised.
const QUANTISED_SLOPE: f64 = -0.75;

/// The strengths of the five noises; zero where a noise does not show.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct NoiseModel {
    pub quantisation: f64,
    pub white: f64,
    pub flicker: f64,
    pub random_walk: f64,
    pub ramp: f64,
}

/// σ² of a unit of each noise, in the order of [`NoiseModel`]'s fields.
fn unit_variances(tau_s: f64) -> [f64; 5] {
    use std::f64::consts::{LN_2, PI};
    [3.0 / (tau_s * tau_s), 1.0 / tau_s, 2.0 * LN_2 / PI, tau_s / 3.0, 0.5 * tau_s * tau_s]
}

impl NoiseModel {
    /// The non-negative strengths that fit the points best, each weighted by its own relative uncertainty.
    ///
    /// All 31 sets of noises are tried, and of those whose strengths are all positive the best is kept: exact for five.
    pub fn fit(points: &[AllanPoint]) -> Self {
        let usable: Vec<&AllanPoint> = points.iter().filter(|p| p.deviation > 0.0).collect();
        let mut best = ([0.0; 5], usable.iter().map(|p| weight(p) * weight(p)).sum::<f64>());
        let quantised = match usable[..] {
            [a, b, ..] => (b.deviation / a.deviation).ln() < QUANTISED_SLOPE * (b.tau_s / a.tau_s).ln(),
            _ => false,
        };
        for set in (1usize..32).filter(|set| quantised || set & 1 == 0) {
            let columns: Vec<usize> = (0..5).filter(|c| set >> c & 1 == 1).collect();
            if columns.len() > usable.len() {
                continue;
            }
            // Relative residuals: (model/σ² − 1)·weight.
            let matrix = DMatrix::from_fn(usable.len(), columns.len(), |row, column| {
                let p = usable[row];
                weight(p) * unit_variances(p.tau_s)[columns[column]] / (p.deviation * p.deviation)
            });
            let target = DVector::from_iterator(usable.len(), usable.iter().map(|p| weight(p)));
            let scales: Vec<f64> = matrix.column_iter().map(|c| c.norm().max(f64::MIN_POSITIVE)).collect();
            let scaled = DMatrix::from_fn(usable.len(), columns.len(), |row, c| matrix[(row, c)] / scales[c]);
            let Ok(found) = scaled.clone().svd(true, true).solve(&target, 1e-12) else { continue };
            if found.iter().any(|v| !(*v > 0.0)) {
                continue;
            }
            let misfit = (&scaled * &found - &target).norm_squared();
            if misfit < best.1 {
                let mut variances = [0.0; 5];
                for (place, &column) in columns.iter().enumerate() {
                    variances[column] = found[place] / scales[place];
                }
                best = (variances, misfit);
            }
        }
        let [quantisation, white, flicker, random_walk, ramp] = best.0.map(f64::sqrt);
        Self { quantisation, white, flicker, random_walk, ramp }
    }

    /// σ(τ) of the model.
    pub fn deviation(&self, tau_s: f64) -> f64 {
        let strengths = [self.quantisation, self.white, self.flicker, self.random_walk, self.ramp];
        strengths.iter().zip(unit_variances(tau_s)).map(|(s, unit)| s * s * unit).sum::<f64>().sqrt()
    }
}

/// One over the relative standard error of σ².
fn weight(point: &AllanPoint) -> f64 {
    0.5 * point.deviation / point.standard_error
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_noise_model_is_found_again_from_its_own_curve() {
        let truth = NoiseModel { quantisation: 0.5, white: 2.0, flicker: 0.3, random_walk: 0.01, ramp: 0.0 };
        let points: Vec<AllanPoint> = (0..50)
            .map(|i| {
                let tau_s = 10f64.powf(0.1 * f64::from(i) - 1.0);
                let deviation = truth.deviation(tau_s);
                AllanPoint { tau_s, deviation, pairs: 100, standard_error: 0.1 * deviation }
            })
            .collect();
        let found = NoiseModel::fit(&points);
        assert!((found.quantisation - 0.5).abs() < 1e-6);
        assert!((found.white - 2.0).abs() < 1e-6);
        assert!((found.flicker - 0.3).abs() < 1e-6);
        assert!((found.random_walk - 0.01).abs() < 1e-6);
        assert!(found.ramp < 1e-6);
    }

    #[test]
    fn white_noise_under_a_slow_hump_is_read_off_where_the_curve_falls() {
        let points: Vec<AllanPoint> = (0..40)
            .map(|i| {
                let tau_s = 10f64.powf(0.1 * f64::from(i));
                let hump = 3.0 * (-((tau_s / 500.0).ln()).powi(2)).exp();
                let deviation = (4.0 / tau_s + hump * hump).sqrt();
                AllanPoint { tau_s, deviation, pairs: 100, standard_error: 0.02 * deviation }
            })
            .collect();
        let (white, found) = white_by_slope(&points).unwrap();
        assert!(found && (white - 2.0).abs() < 0.02, "{white}");
    }

    #[test]
    fn a_straight_ramp_has_the_deviation_of_a_ramp() {
        let rates: Vec<f64> = (0..100).map(f64::from).collect();
        for point in overlapping(&rates, 1.0, &[1, 7, 20]) {
            assert!((point.deviation - point.tau_s / 2f64.sqrt()).abs() < 1e-12);
        }
    }
}
