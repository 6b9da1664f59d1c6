//! Power spectral density of a sequence at chosen frequencies, from overlapping windowed stretches.
//!
//! ```text
//! S(f) = 2 τ0 ⟨ |Σ_k w_k (y_k − ȳ) e^{−2πi f k τ0}|² ⟩ / Σ_k w_k²        one-sided, in y² a hertz
//! ```
//!
//! | symbol | meaning |
//! |---|---|
//! | w | Hann's window over a stretch; stretches overlap by half |
//! | ȳ | the stretch's mean |
//!
//! White noise of variance σ² a value has S = 2 σ² τ0.
//!
//! # Source
//! Welch, IEEE Trans. Audio Electroacoust. 15 (1967) 70.

use std::f64::consts::PI;

/// One frequency's density.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Density {
    pub(crate) frequency_hz: f64,
    pub(crate) density: f64,
}

/// At `count` frequencies, evenly spaced in their logarithm from one cycle in a third of a stretch to half the sampling rate.
///
/// Empty where the values do not fill a stretch.
pub(crate) fn power_spectral_density(values: &[f64], interval_s: f64, stretch: usize, count: usize) -> Vec<Density> {
    if values.len() < stretch || stretch < 8 || count < 2 {
        return Vec::new();
    }
    let window: Vec<f64> =
        (0..stretch).map(|k| 0.5 - 0.5 * (2.0 * PI * (k as f64 + 0.5) / stretch as f64).cos()).collect();
    let power: f64 = window.iter().map(|w| w * w).sum();
    let starts: Vec<usize> = (0..=values.len() - stretch).step_by(stretch / 2).collect();
    let (low, high) = (3.0 / (stretch as f64 * interval_s), 0.5 / interval_s);
    (0..count)
        .map(|i| {
            let frequency_hz = low * (high / low).powf(i as f64 / (count - 1) as f64);
            let turn = 2.0 * PI * frequency_hz * interval_s;
            let sum: f64 = starts
                .iter()
                .map(|&start| {
                    let part = &values[start..start + stretch];
                    let mean = part.iter().sum::<f64>() / stretch as f64;
                    let (mut real, mut imaginary) = (0.0, 0.0);
                    for (k, (value, w)) in part.iter().zip(&window).enumerate() {
                        let (sine, cosine) = (turn * k as f64).sin_cos();
                        real += w * (value - mean) * cosine;
                        imaginary += w * (value - mean) * sine;
                    }
                    real * real + imaginary * imaginary
                })
                .sum();
            Density { frequency_hz, density: 2.0 * interval_s * sum / (power * starts.len() as f64) }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn white_noise_has_twice_its_variance_times_the_interval_at_every_frequency() {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        // Uniform in a unit: variance 1/12.
        let values: Vec<f64> = (0..40_000).map(|_| random.random::<f64>()).collect();
        let found = power_spectral_density(&values, 0.5, 512, 20);
        let mean = found[..19].iter().map(|d| d.density).sum::<f64>() / 19.0;
        println!("{mean:.5} of {:.5}", 1.0 / 12.0);
        assert!((mean * 12.0 - 1.0).abs() < 0.05);
    }
}
