//! Robust and ordinary statistics of a sequence.

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Makes a median absolute deviation the standard deviation of a Gaussian: 1/Φ⁻¹(¾).
const GAUSSIAN_PER_MAD: f64 = 1.482_602_218_505_602;

pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Root mean square.
pub fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// With n − 1; NaN for fewer than two values.
pub(crate) fn standard_deviation(values: &[f64]) -> f64 {
    if values.len() < 2 {
        return f64::NAN;
    }
    let mean = mean(values);
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (values.len() - 1) as f64).sqrt()
}

/// A standard deviation in constant memory.
///
/// # Source
/// Welford, Technometrics 4 (1962) 419.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct RunningDeviation {
    count: f64,
    mean: f64,
    square: f64,
}

impl RunningDeviation {
    pub(crate) fn push(&mut self, value: f64) {
        self.count += 1.0;
        let from_mean = value - self.mean;
        self.mean += from_mean / self.count;
        self.square += from_mean * (value - self.mean);
    }

    /// With n − 1; None for fewer than two values.
    pub(crate) fn deviation(&self) -> Option<f64> {
        (self.count > 1.5).then(|| (self.square / (self.count - 1.0)).sqrt())
    }
}

/// The mean of the middle two where their number is even; NaN of nothing.
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    median_in_place(&mut sorted)
}

/// As [`median`]; the values are then in another order.
pub(crate) fn median_in_place(values: &mut [f64]) -> f64 {
    let n = values.len();
    if n == 0 {
        return f64::NAN;
    }
    let (below, &mut upper, _) = values.select_nth_unstable_by(n / 2, f64::total_cmp);
    if n % 2 == 1 { upper } else { 0.5 * (upper + below.iter().copied().fold(f64::NEG_INFINITY, f64::max)) }
}

/// The value that a share of ascending values does not exceed, between the order statistics.
pub(crate) fn quantile(ascending: &[f64], share: f64) -> f64 {
    let place = share.clamp(0.0, 1.0) * (ascending.len() - 1) as f64;
    let (below, above) = (place.floor() as usize, place.ceil() as usize);
    let (a, b) = (ascending[below], ascending[above]);
    a + (b - a) * (place - below as f64)
}

/// Median absolute deviation about the median, scaled to a Gaussian's standard deviation.
pub(crate) fn robust_deviation(values: &[f64]) -> f64 {
    let centre = median(values);
    let mut sizes: Vec<f64> = values.iter().map(|v| (v - centre).abs()).collect();
    GAUSSIAN_PER_MAD * median_in_place(&mut sizes)
}

/// Pearson's correlation over the places where both are finite; None where one of them does not vary.
pub(crate) fn correlation(a: &[f64], b: &[f64]) -> Option<f64> {
    let pairs: Vec<(f64, f64)> =
        a.iter().copied().zip(b.iter().copied()).filter(|(x, y)| x.is_finite() && y.is_finite()).collect();
    let n = pairs.len() as f64;
    if pairs.len() < 3 {
        return None;
    }
    let (mean_a, mean_b) = (pairs.iter().map(|p| p.0).sum::<f64>() / n, pairs.iter().map(|p| p.1).sum::<f64>() / n);
    let (mut aa, mut bb, mut ab) = (0.0, 0.0, 0.0);
    for (x, y) in pairs {
        aa += (x - mean_a).powi(2);
        bb += (y - mean_b).powi(2);
        ab += (x - mean_a) * (y - mean_b);
    }
    // What rounding leaves of a constant's variance is no variance.
    let varies = |square: f64, mean: f64| square > n * (1e-12 * mean).powi(2) && square > 0.0;
    (varies(aa, mean_a) && varies(bb, mean_b)).then(|| (ab / (aa * bb).sqrt()).clamp(-1.0, 1.0))
}

/// Autocorrelation at lags 0 … `lags`, about the mean.
pub(crate) fn autocorrelation(values: &[f64], lags: usize) -> Vec<f64> {
    let mean = mean(values);
    let centred: Vec<f64> = values.iter().map(|v| v - mean).collect();
    let square: f64 = centred.iter().map(|v| v * v).sum();
    (0..=lags.min(values.len().saturating_sub(1)))
        .map(|lag| {
            let product: f64 = centred.iter().zip(&centred[lag..]).map(|(a, b)| a * b).sum();
            if square > 0.0 { product / square } else { f64::from(lag == 0) }
        })
        .collect()
}

/// Half width of the band that 99 % of the autocorrelations of `n` white values keep to: Φ⁻¹(0.995)/√n.
pub(crate) fn autocorrelation_band_99(n: usize) -> f64 {
    2.575_829_303_548_901 / (n.max(1) as f64).sqrt()
}

/// The Ljung–Box test of whiteness.
///
/// ```text
/// Q = n (n + 2) Σ_{k=1..h} ρ_k²/(n − k)  ~  χ²_h for white values
/// ```
///
/// # Source
/// Ljung and Box, Biometrika 65 (1978) 297.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LjungBox {
    pub(crate) statistic: f64,
    pub(crate) lags: usize,
    /// The probability of so large a statistic from white values.
    pub(crate) p_value: f64,
}

impl LjungBox {
    /// `correlations` at lags 0, 1, …, of `n` values.
    pub(crate) fn new(correlations: &[f64], n: usize) -> Self {
        let n = n as f64;
        let tail = correlations.get(1..).unwrap_or(&[]);
        let sum: f64 = tail.iter().enumerate().map(|(i, r)| r * r / (n - (i + 1) as f64)).sum();
        let statistic = n * (n + 2.0) * sum;
        Self { statistic, lags: tail.len(), p_value: chi_square_tail(statistic, tail.len() as f64) }
    }
}

/// P(χ²_ν > x); 1 for a ν that is no number of degrees of freedom.
pub(crate) fn chi_square_tail(x: f64, degrees_of_freedom: f64) -> f64 {
    ChiSquared::new(degrees_of_freedom).map_or(1.0, |distribution| distribution.sf(x.max(0.0)))
}

/// Values that stand alone: further from the median of their neighbourhood than `factor` times its robust deviation
/// and than `floor`.
///
/// A step or a corner of a signal is not flagged: the median of a neighbourhood follows it. Near the ends, where it cannot,
/// a value must stand as far from each of its neighbours, and twice as far as these from each other: it may be where a
/// signal sets out from.
///
/// # Source
/// Hampel, J. Am. Stat. Assoc. 69 (1974) 383; the running form after Pearson, IEEE Trans. Control Syst. 10 (2002) 55.
pub(crate) fn gross_errors(values: &[f64], half_width: usize, factor: f64, floor: f64) -> Vec<usize> {
    let mut window = Vec::with_capacity(2 * half_width + 1);
    (0..values.len())
        .filter(|&i| {
            let from = i.saturating_sub(half_width).min(values.len().saturating_sub(2 * half_width + 1));
            let to = (from + 2 * half_width + 1).min(values.len());
            window.clear();
            window.extend_from_slice(&values[from..to]);
            let centre = median_in_place(&mut window);
            let at_an_end = i < half_width || i + half_width >= values.len();
            window.iter_mut().for_each(|v| *v = (*v - centre).abs());
            let spread = GAUSSIAN_PER_MAD * median_in_place(&mut window);
            let least = (factor * spread).max(floor);
            let alone = || {
                let nearest =
                    (from..to).filter(|&j| j != i).map(|j| (values[j] - values[i]).abs()).fold(f64::INFINITY, f64::min);
                let others = (from + 1..to).filter(|&j| j != i && j != i + 1);
                let step = others.map(|j| (values[j] - values[j - 1]).abs()).fold(0.0, f64::max);
                nearest > least.max(2.0 * step)
            };
            (values[i] - centre).abs() > least && (!at_an_end || alone())
        })
        .collect()
}

/// A straight line through points by least squares: intercept and slope; None where the points are all at one place.
pub(crate) fn line(points: impl Iterator<Item = (f64, f64)>) -> Option<(f64, f64)> {
    let points: Vec<(f64, f64)> = points.collect();
    let n = points.len() as f64;
    let (mean_x, mean_y) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
    let xx: f64 = points.iter().map(|p| (p.0 - mean_x).powi(2)).sum();
    let xy: f64 = points.iter().map(|p| (p.0 - mean_x) * (p.1 - mean_y)).sum();
    (xx > 0.0).then(|| (mean_y - xy / xx * mean_x, xy / xx))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_of_even_and_odd_numbers_of_values_is_the_middle() {
        assert_eq!(median(&[3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&[4.0, 1.0, 3.0, 2.0]), 2.5);
        assert!(median(&[]).is_nan());
    }

    #[test]
    fn at_an_end_a_spike_is_flagged_and_where_a_signal_sets_out_from_is_not() {
        let quiet = |i: i32| 0.01 * f64::from(i * 7 % 5);
        let sets_out: Vec<f64> = (0..40).map(|i| quiet(i) - 1.5 * (1.0 - (-0.5 * f64::from(i)).exp())).collect();
        assert_eq!(gross_errors(&sets_out, 3, 6.0, 0.2), Vec::<usize>::new());
        let returns: Vec<f64> = sets_out.iter().rev().copied().collect();
        assert_eq!(gross_errors(&returns, 3, 6.0, 0.2), Vec::<usize>::new());
        for at in [0, 1, 38, 39] {
            let mut spoilt: Vec<f64> = (0..40).map(quiet).collect();
            spoilt[at] += 4.0;
            assert_eq!(gross_errors(&spoilt, 3, 6.0, 0.2), vec![at]);
        }
        let mut stepped: Vec<f64> = (0..40).map(quiet).collect();
        stepped[..2].iter_mut().for_each(|v| *v -= 5.0);
        assert_eq!(gross_errors(&stepped, 3, 6.0, 0.2), Vec::<usize>::new());
    }

    #[test]
    fn a_spike_is_flagged_and_a_step_a_corner_and_a_ramp_are_not() {
        let mut values: Vec<f64> = (0..60).map(|i| if i < 20 { 0.0 } else { 5.0 + 0.3 * f64::from(i - 20) }).collect();
        values[40] += 9.0;
        assert_eq!(gross_errors(&values, 3, 6.0, 1.0), vec![40]);
    }

    #[test]
    fn ljung_box_of_known_correlations_is_the_sum_worked_out_by_hand() {
        let found = LjungBox::new(&[1.0, 0.1, -0.2], 100);
        let by_hand = 100.0 * 102.0 * (0.01 / 99.0 + 0.04 / 98.0);
        assert!((found.statistic - by_hand).abs() < 1e-12);
        // χ² with two degrees of freedom: P(> x) = exp(−x/2).
        assert!((found.p_value - (-0.5 * by_hand).exp()).abs() < 1e-12);
    }

    #[test]
    fn a_constant_correlates_with_nothing() {
        assert_eq!(correlation(&[1.0, 1.0, 1.0], &[1.0, 2.0, 3.0]), None);
        assert!((correlation(&[1.0, 2.0, 3.0], &[-2.0, -4.0, -6.0]).unwrap() + 1.0).abs() < 1e-15);
    }
}
