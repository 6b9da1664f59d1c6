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

/// One point of the Allan deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AllanPoint {
    /// Averaging time.
    pub tau_s: f64,
    /// σ(τ), in the units of y.
    pub deviation: f64,
    /// How many pairs of means it was estimated from.
    pub pairs: usize,
    /// One standard error, from the degrees of freedom of independent pairs.
    pub(crate) standard_error: f64,
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
    of_angles(&angle, 1, rates.len(), interval_s, factors)
}

/// Of angles `stride` values apart, at factors that count these.
fn of_angles(angle: &[f64], stride: usize, values: usize, interval_s: f64, factors: &[usize]) -> Vec<AllanPoint> {
    factors
        .iter()
        .filter(|&&m| m > 0 && 2 * m < angle.len())
        .map(|&m| {
            let pairs = angle.len() - 2 * m;
            let square: f64 = (0..pairs).map(|k| (angle[k + 2 * m] - 2.0 * angle[k + m] + angle[k]).powi(2)).sum();
            point(square, pairs, m * stride, values, interval_s)
        })
        .collect()
}

fn point(square: f64, pairs: usize, m: usize, values: usize, interval_s: f64) -> AllanPoint {
    let deviation = (square / (2.0 * pairs as f64)).sqrt() / m as f64;
    let standard_error = deviation / (2.0 * degrees_of_freedom(values + 1, m)).sqrt();
    AllanPoint { tau_s: m as f64 * interval_s, deviation, pairs, standard_error }
}

/// Of the overlapping estimator for white noise of the rate (NIST SP 1065, Table 5), `n` points of the angle.
fn degrees_of_freedom(n: usize, m: usize) -> f64 {
    let (n, m) = (n as f64, m as f64);
    let freedom = (3.0 * (n - 1.0) / (2.0 * m) - 2.0 * (n - 2.0) / n) * 4.0 * m * m / (4.0 * m * m + 5.0);
    freedom.max(1.0)
}

/// Averaging factors in steps of about a tenth of a decade, up to a third of the values.
pub(crate) fn factors(values: usize) -> Vec<usize> {
    let mut factors: Vec<usize> = (0..)
        .map(|i| 10f64.powf(0.1 * f64::from(i)).round() as usize)
        .take_while(|&m| 3 * m <= values.max(3))
        .collect();
    factors.dedup();
    factors
}

/// The strengths of the five noises; zero where a noise does not show.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct NoiseModel {
    pub(crate) quantisation: f64,
    pub(crate) white: f64,
    pub(crate) flicker: f64,
    pub(crate) random_walk: f64,
    pub(crate) ramp: f64,
}

/// σ² of a unit of each noise, in the order of [`NoiseModel`]'s fields.
fn unit_variances(tau_s: f64) -> [f64; 5] {
    use std::f64::consts::{LN_2, PI};
    [3.0 / (tau_s * tau_s), 1.0 / tau_s, 2.0 * LN_2 / PI, tau_s / 3.0, 0.5 * tau_s * tau_s]
}

impl NoiseModel {
    /// σ(τ) of the model.
    pub(crate) fn deviation(&self, tau_s: f64) -> f64 {
        let strengths = [self.quantisation, self.white, self.flicker, self.random_walk, self.ramp];
        strengths.iter().zip(unit_variances(tau_s)).map(|(s, unit)| s * s * unit).sum::<f64>().sqrt()
    }
}

/// The Allan deviation of a sequence that is too long to be kept.
///
/// Up to [`MOST_ANGLES`] values it is [`overlapping`] itself. Beyond, every second angle is forgotten, again and again: averaging
/// factors up to [`MOST_NEAR`] are still taken at every value, the longer ones at every `stride`-th, which costs nothing that
/// overlapping had won.
#[derive(Debug, Clone)]
pub(crate) struct RunningAllan {
    interval_s: f64,
    /// Taken off each value before it is summed: it cancels, but not in rounding.
    level: f64,
    angle: f64,
    values: usize,
    stride: usize,
    angles: Vec<f64>,
    /// The last 2 `MOST_NEAR` + 1 angles, as a ring.
    ring: Vec<f64>,
    near: Vec<(usize, f64)>,
}

/// Angles that are kept: 16 MB.
pub(crate) const MOST_ANGLES: usize = 1 << 21;
/// The longest averaging factor that is taken at every value of a long sequence.
pub(crate) const MOST_NEAR: usize = 1024;

impl RunningAllan {
    /// `level` is about the mean of what will come.
    pub(crate) fn new(interval_s: f64, level: f64) -> Self {
        let near = factors(3 * MOST_NEAR).into_iter().map(|m| (m, 0.0)).collect();
        let ring = vec![0.0; 2 * MOST_NEAR + 1];
        Self { interval_s, level, angle: 0.0, values: 0, stride: 1, angles: vec![0.0], ring, near }
    }

    pub(crate) fn values(&self) -> usize {
        self.values
    }

    pub(crate) fn push(&mut self, value: f64) {
        self.angle += value - self.level;
        self.values += 1;
        let size = self.ring.len();
        self.ring[self.values % size] = self.angle;
        for (m, sum) in &mut self.near {
            if self.values >= 2 * *m {
                let back = |k: usize| self.ring[(self.values - k) % size];
                *sum += (self.angle - 2.0 * back(*m) + back(2 * *m)).powi(2);
            }
        }
        if self.values.is_multiple_of(self.stride) {
            self.angles.push(self.angle);
            if self.angles.len() > MOST_ANGLES {
                self.stride *= 2;
                self.angles = self.angles.iter().copied().step_by(2).collect();
            }
        }
    }

    /// The points at [`factors`] of all values.
    pub(crate) fn points(&self) -> Vec<AllanPoint> {
        let factors = factors(self.values);
        if self.stride == 1 {
            return of_angles(&self.angles, 1, self.values, self.interval_s, &factors);
        }
        let mut points = Vec::with_capacity(factors.len());
        for (m, sum) in self.near.iter().filter(|(m, _)| *m <= self.values / 3) {
            points.push(point(*sum, self.values + 1 - 2 * m, *m, self.values, self.interval_s));
        }
        let mut far: Vec<usize> = factors.iter().filter(|m| **m > MOST_NEAR).map(|m| m.div_ceil(self.stride)).collect();
        far.dedup();
        points.extend(of_angles(&self.angles, self.stride, self.values, self.interval_s, &far));
        points
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_ramp_has_the_deviation_of_a_ramp() {
        let rates: Vec<f64> = (0..100).map(f64::from).collect();
        for point in overlapping(&rates, 1.0, &[1, 7, 20]) {
            assert!((point.deviation - point.tau_s / 2f64.sqrt()).abs() < 1e-12);
        }
    }

    #[test]
    fn a_running_deviation_is_that_of_the_whole_sequence_and_close_to_it_once_angles_are_forgotten() {
        let rates: Vec<f64> = (0u64..3000).map(|i| 5.0 + (i * i * 7919 % 1009) as f64).collect();
        let mut running = RunningAllan::new(2.0, 500.0);
        rates.iter().for_each(|r| running.push(*r));
        for (a, b) in running.points().iter().zip(overlapping(&rates, 2.0, &factors(3000))) {
            assert_eq!((a.tau_s, a.pairs), (b.tau_s, b.pairs));
            assert!((a.deviation / b.deviation - 1.0).abs() < 1e-9);
        }
        let mut random = 1u64;
        let mut long = RunningAllan::new(1.0, 0.0);
        let mut rates = Vec::new();
        for _ in 0..MOST_ANGLES + 9000 {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            rates.push((random >> 40) as f64);
            long.push(*rates.last().unwrap());
        }
        let all = overlapping(&rates, 1.0, &factors(rates.len()));
        let found = long.points();
        assert_eq!(found.len(), all.len());
        for (a, b) in found.iter().zip(all) {
            let tolerance =
                if b.tau_s <= MOST_NEAR as f64 { 1e-9 } else { 0.05 * b.standard_error / b.deviation + 2e-3 };
            assert!((a.tau_s / b.tau_s - 1.0).abs() < 2e-3);
            assert!((a.deviation / b.deviation - 1.0).abs() < tolerance, "{a:?} {b:?}");
        }
    }
}
