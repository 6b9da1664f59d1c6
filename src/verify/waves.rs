//! Waves along the axis of a pack whose faces exchange heat, and polynomials along its spool.
//!
//! ```text
//! φ = cos bζ + (β₁/b) sin bζ,   (b² − β₁ β₂) tan b = b (β₁ + β₂),   ζ = 0 … 1        β = h H/k of either face
//! ```
//!
//! # Source
//! Carslaw and Jaeger, Conduction of Heat in Solids (1959), section 3.11.

/// Waves along the axis, and how many more per unit of h H/k; their shares fall as the fourth power of their number.
const WAVES: usize = 80;
const WAVES_PER_BIOT: f64 = 0.5;
const MOST_WAVES: usize = 400;
/// Polynomials that hold a spool's temperature along the axis, with no kink in it.
pub(super) const POLYNOMIALS: usize = 24;

/// One wave along the axis.
#[derive(Debug, Clone)]
pub(super) struct Wave {
    pub(crate) decay_per_s: f64,
    pub(crate) ends: [f64; 2],
    pub(crate) norm: f64,
    pub(crate) mean: f64,
    pub(crate) moment: f64,
    /// With each polynomial.
    pub(crate) along: Vec<f64>,
}

impl Wave {
    /// Where nothing varies.
    pub(crate) fn even() -> Self {
        Self { decay_per_s: 0.0, ends: [1.0; 2], norm: 1.0, mean: 1.0, moment: 0.0, along: vec![1.0] }
    }
}

/// All that matter, by β at the first face and at the second.
pub(super) fn waves([at_first, at_second]: [f64; 2], diffusivity_per_s: f64, polynomials: usize) -> Vec<Wave> {
    let count = (WAVES + (WAVES_PER_BIOT * (at_first + at_second)) as usize).min(MOST_WAVES);
    let points = legendre_points();
    (0..count)
        .map(|n| {
            let b = root(n, at_first, at_second);
            let (sine, cosine, tilt) = (b.sin(), b.cos(), at_first / b);
            let twice = (2.0 * b).sin() / (2.0 * b);
            let norm =
                0.5 * (1.0 + twice) + 0.5 * tilt * tilt * (1.0 - twice) + tilt * (1.0 - (2.0 * b).cos()) / (2.0 * b);
            let mean = sine / b + tilt * (1.0 - cosine) / b;
            let first_moment = sine / b + (cosine - 1.0) / (b * b) + tilt * (sine / (b * b) - cosine / b);
            let mut along = vec![0.0; polynomials];
            // Panels of half a wave each, and enough for the polynomials.
            let panels = n + polynomials;
            for panel in 0..panels {
                for &(x, weight) in &points {
                    let zeta = (panel as f64 + 0.5 * (1.0 + x)) / panels as f64;
                    let value = ((b * zeta).cos() + tilt * (b * zeta).sin()) * 0.5 * weight / panels as f64;
                    let legendre = legendre(2.0 * zeta - 1.0, polynomials);
                    along.iter_mut().zip(legendre).for_each(|(sum, p)| *sum += value * p);
                }
            }
            Wave {
                decay_per_s: diffusivity_per_s * b * b,
                ends: [1.0, cosine + tilt * sine],
                norm,
                mean,
                moment: first_moment - 0.5 * mean,
                along,
            }
        })
        .collect()
}

/// P_0 … at x.
fn legendre(x: f64, count: usize) -> Vec<f64> {
    let mut values = vec![1.0, x];
    for n in 1..count {
        let next = ((2 * n + 1) as f64 * x * values[n] - n as f64 * values[n - 1]) / (n + 1) as f64;
        values.push(next);
    }
    values.truncate(count);
    values
}

/// P_k at an end of the axis.
pub(super) fn at_end(k: usize, end: usize) -> f64 {
    if end == 0 && k % 2 == 1 { -1.0 } else { 1.0 }
}

/// ∫ P_k' P_l' over ζ = 0 … 1, of polynomials in 2ζ − 1.
pub(super) fn stiffness(k: usize, l: usize) -> f64 {
    if (k + l) % 2 == 1 {
        return 0.0;
    }
    let least = k.min(l);
    2.0 * (least * (least + 1)) as f64
}

/// Points and weights of Gauss's rule of ten points on −1 … 1.
fn legendre_points() -> Vec<(f64, f64)> {
    const POINTS: usize = 10;
    (0..POINTS)
        .map(|i| {
            let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (POINTS as f64 + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..20 {
                let values = legendre(x, POINTS + 1);
                slope = POINTS as f64 * (x * values[POINTS] - values[POINTS - 1]) / (x * x - 1.0);
                x -= values[POINTS] / slope;
            }
            (x, 2.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}

/// The n-th root of (b² − β₁ β₂) tan b = b (β₁ + β₂), in (nπ, (n + 1)π).
fn root(n: usize, at_first: f64, at_second: f64) -> f64 {
    let start = n as f64 * std::f64::consts::PI;
    // The tangent's period takes the sign of sine and cosine along.
    let (mut low, mut high) = (0.0, std::f64::consts::PI);
    for _ in 0..100 {
        let middle: f64 = 0.5 * (low + high);
        let b = start + middle;
        if (b * b - at_first * at_second) * middle.sin() < b * (at_first + at_second) * middle.cos() {
            low = middle;
        } else {
            high = middle;
        }
    }
    start + 0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waves_are_orthogonal_to_each_other_and_their_sums_are_what_they_stand_for() {
        let all = waves([7.0, 0.4], 1.0, POLYNOMIALS);
        // Σ (∫φ)²/N = 1 and Σ (∫φ)(∫φ P₂)/N = 0: an even temperature is the sum of its waves.
        let sum = |k: usize| all.iter().map(|w| w.along[0] * w.along[k] / w.norm).sum::<f64>();
        // The waves that are left out fall as the fourth power of their number: 1.1e-6 of all.
        assert!((sum(0) - 1.0).abs() < 2e-6 && sum(2).abs() < 2e-6, "{} {}", sum(0), sum(2));
        for wave in &all {
            assert!((wave.along[0] - wave.mean).abs() < 1e-12);
            assert!((0.5 * wave.along[1] - wave.moment).abs() < 1e-12);
        }
    }

    #[test]
    fn stiffness_is_that_of_the_polynomials() {
        let points = legendre_points();
        let slope = |x: f64, k: usize| (legendre(x + 1e-5, 6)[k] - legendre(x - 1e-5, 6)[k]) / 2e-5;
        for (k, l) in [(1, 1), (2, 4), (3, 5), (5, 5), (1, 2)] {
            let sum: f64 = points.iter().map(|(x, weight)| weight * slope(*x, k) * slope(*x, l)).sum();
            assert!((2.0 * sum - stiffness(k, l)).abs() < 1e-6, "{k} {l}");
        }
    }
}
