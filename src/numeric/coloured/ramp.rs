//! How large a ramp is, and what it may be as far as a slow walk or flicker could have drawn it.
//!
//! ```text
//! −2 ln L(R) − min ≤ I (ν + 1) ln(1 + t²_ν/ν)
//! f_j = w_j c₀ᵀ X_jᵀX_j c₀/(s_j V),   V = C₀₀,   C = (Σ w_j X_jᵀX_j/s_j + 1/τ²)⁻¹,   c₀ = C e₀
//! I = Σ_jk √(w_j f_j w_k f_k) ρ_jk,   ν = 2/(gᵀ F⁻¹ g),   g_i = Σ_j f_j u_ji/s_j,   F_ik = ½ Σ_j w_j n_j u_ji u_jk/s_j²
//! ```
//!
//! | symbol | meaning | in code |
//! |---|---|---|
//! | R | a slope; s_j are the variances of the noises that fit best beside it | `Tenable::at` |
//! | f_j, V | which part of what is known of the slope comes from octave j; the slope's variance | `shares` |
//! | I, ρ_jk | by how much the octaves say the same of a slope, and how much the sums of their coefficients are correlated: ¾ in a walk, `FLICKER_SUMS` in flicker | `inflation` |
//! | ν, u_ji | degrees of freedom with which V is known; a unit of noise i in octave j | `freedom` |
//! | t_ν | Student's quantile of the interval | |
//!
//! Where the best fit has a ramp and no walk, I and ν of that fit say nothing of a walk: what is asked of a slope is asked with the
//! noises that the record has if that is its slope. A walk that shows in the two or three longest octaves only is known so badly that
//! the slope's distribution is Student's with few degrees of freedom, not a normal one.
//!
//! # Source
//! Degrees of freedom: Satterthwaite, Biometrics Bulletin 2 (1946) 110, as in Fai, Cornelius, J. Stat. Comput. Simul. 54 (1996) 363;
//! I, for a likelihood of parts that are not independent: Varin, Reid, Firth, Statistica Sinica 21 (2011) 5.

use nalgebra::{Matrix4, Vector4};
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::likelihood::{Likelihood, Point};
use super::{CONFIDENCE, Interval, KINDS, MOST_DOUBLINGS};

/// An end is found to this part of its distance.
const FINE: f64 = 1e-2;
/// Correlation of the sum of an octave's coefficients of flicker with the coefficient of all its blocks, by octaves apart.
const FLICKER_SUMS: [f64; 9] = [1.0, 0.3293, 0.2642, 0.2021, 0.1498, 0.1089, 0.0782, 0.0558, 0.0396];
/// … and of a random walk's, however far apart.
const WALK_SUMS: f64 = 0.75;
/// Added to the information on each noise, relatively: noises that no octave tells apart leave none without an inverse.
const TOLD_APART: f64 = 1e-9;

/// In units of y a second; `point` and `best` are where to begin.
pub(super) fn interval(likelihood: &Likelihood, point: &Point, best: &Point) -> Interval {
    let none = Interval { value: 0.0, low: 0.0, high: 0.0 };
    let (Some(ramp), Some(by_best), Some(unit)) =
        (slope(likelihood, point), slope(likelihood, best), likelihood.ramp_scale)
    else {
        return none;
    };
    let unit = likelihood.scale() / unit;
    let beside = |slope: f64, from: &Point| {
        let rest = likelihood.without_ramp(slope);
        let (fresh, near) = (rest.maximised(&rest.start_in(point), None), rest.maximised(from, None));
        if near.minus_two_log_likelihood < fresh.minus_two_log_likelihood { near } else { fresh }
    };
    let middle = beside(ramp.slope, point);
    let other = beside(by_best.slope, best);
    let least = middle.minus_two_log_likelihood.min(other.minus_two_log_likelihood);
    let is_tenable = |at: &Point| at.minus_two_log_likelihood - least <= allowance(likelihood, at);
    let end = |direction: f64| {
        let (mut inside, mut from) = (0.0, middle.clone());
        let mut outside = 2.0 * ramp.error.max(by_best.error).max(f64::MIN_POSITIVE);
        let step = |off: f64, from: &mut Point| {
            let at = beside(ramp.slope + direction * off, from);
            let is_inside = is_tenable(&at);
            if is_inside {
                *from = at;
            }
            is_inside
        };
        for _ in 0..MOST_DOUBLINGS {
            if !step(outside, &mut from) {
                break;
            }
            inside = outside;
            outside *= 2.0;
        }
        while outside - inside > FINE * outside {
            let middle = 0.5 * (inside + outside);
            if step(middle, &mut from) { inside = middle } else { outside = middle }
        }
        ramp.slope + direction * outside
    };
    let (first, last) = (end(-1.0), end(1.0));
    let high = first.abs().max(last.abs());
    // The walk that stands for a ramp grows towards none: a slope on the way may be less tenable than none at all.
    let is_seen = first * last > 0.0 && !is_tenable(&beside(0.0, &middle));
    let low = if is_seen { first.abs().min(last.abs()) } else { 0.0 };
    let value = if is_seen { by_best.slope.abs().clamp(low, high) } else { 0.0 };
    Interval { value: unit * value, low: unit * low, high: unit * high }
}

/// In its own units, with the standard error at given variances.
struct Slope {
    slope: f64,
    error: f64,
}

fn slope(likelihood: &Likelihood, point: &Point) -> Option<Slope> {
    let rest = likelihood.ramp_scale.and(likelihood.rest(&point.variances, &point.group_variances))?;
    Some(Slope { slope: rest.beta[0], error: rest.covariance[(0, 0)].max(0.0).sqrt() })
}

/// By how much −2 ln L may be above its least at a slope beside which the noises are those of `at`.
fn allowance(likelihood: &Likelihood, at: &Point) -> f64 {
    let Some(rest) = likelihood.rest(&at.variances, &at.group_variances) else { return f64::INFINITY };
    let model = likelihood.model(&at.variances);
    let variance = rest.covariance[(0, 0)];
    let column = rest.covariance.column(0);
    let shares: Vec<f64> = likelihood
        .octaves
        .iter()
        .zip(&model)
        .map(|(o, s)| o.weight * column.dot(&(&o.xx * column)) / (s * variance))
        .collect();
    inflation(likelihood, at, &model, &shares) * student_ratio(freedom(likelihood, at, &model, &shares))
}

/// (ν + 1) ln(1 + t²/ν): a likelihood ratio of a mean whose variance is known with ν degrees of freedom.
fn student_ratio(freedom: f64) -> f64 {
    let Ok(student) = StudentsT::new(0.0, 1.0, freedom) else { return super::LIKELIHOOD_RATIO };
    let t = student.inverse_cdf(0.5 * (1.0 + CONFIDENCE));
    (freedom + 1.0) * (t * t / freedom).ln_1p()
}

fn inflation(likelihood: &Likelihood, at: &Point, model: &[f64], shares: &[f64]) -> f64 {
    let of = |kind: usize, j: usize| {
        KINDS[kind].iter().map(|c| at.variances[*c] * likelihood.octaves[j].units[*c]).sum::<f64>() / model[j]
    };
    let said = |j: usize| (shares[j] * likelihood.octaves[j].weight).sqrt();
    let octaves = || 0..shares.len();
    let common: f64 = octaves()
        .flat_map(|j| octaves().map(move |k| (j, k)))
        .map(|(j, k)| {
            let apart = j.abs_diff(k);
            if apart == 0 {
                return said(j).powi(2);
            }
            let flicker = FLICKER_SUMS.get(apart).copied().unwrap_or(0.0) * (of(2, j) * of(2, k)).sqrt();
            let walk = WALK_SUMS * (of(3, j) * of(3, k)).sqrt();
            said(j) * said(k) * (flicker + walk)
        })
        .sum();
    (common / shares.iter().sum::<f64>()).max(1.0)
}

/// With how many degrees of freedom the slope's variance is known; at least one.
fn freedom(likelihood: &Likelihood, at: &Point, model: &[f64], shares: &[f64]) -> f64 {
    let (mut gradient, mut information) = (Vector4::<f64>::zeros(), Matrix4::<f64>::zeros());
    for ((octave, s), share) in likelihood.octaves.iter().zip(model).zip(shares) {
        let of = Vector4::from_fn(|kind, _| unit(&octave.units, at, kind) / s);
        gradient += of * *share;
        information += of * of.transpose() * (0.5 * octave.weight * octave.n);
    }
    // Each noise in units of its own information: they differ by many powers of ten.
    let scale = information.diagonal().map(|i| if i > 0.0 { 1.0 / i.sqrt() } else { 0.0 });
    let scaled = Matrix4::from_diagonal(&scale) * information * Matrix4::from_diagonal(&scale)
        + Matrix4::identity() * TOLD_APART;
    let gradient = gradient.component_mul(&scale);
    let spread = scaled.cholesky().map_or(f64::INFINITY, |root| gradient.dot(&root.solve(&gradient)));
    (2.0 / spread).max(1.0)
}

/// A unit of a kind of noise in an octave: of its components as the point mixes them.
fn unit(units: &[f64], at: &Point, kind: usize) -> f64 {
    let parts = KINDS[kind];
    let sum: f64 = parts.iter().map(|c| at.variances[*c]).sum();
    if sum > 0.0 {
        parts.iter().map(|c| at.variances[*c] / sum * units[*c]).sum()
    } else {
        parts.iter().map(|c| units[*c]).sum::<f64>() / parts.len() as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where the kernel of a sum of Haar coefficients changes, and by how much: blocks of 2^−level, all of [0, 1].
    fn kernel(level: i32) -> Vec<(f64, f64)> {
        let width = 0.5f64.powi(level);
        let block = |b: i32| {
            [(0.0, -1.0), (0.5, 2.0), (1.0, -1.0)].map(|(at, by)| ((f64::from(b) + at) * width, by / width.sqrt()))
        };
        (0..1 << level).flat_map(block).collect()
    }

    #[test]
    fn sums_of_coefficients_are_correlated_as_the_noises_covariance_says() {
        // −ln|t| of flicker and −|t| of a walk, integrated twice.
        let flicker = |t: f64| if t == 0.0 { 0.0 } else { t * t * (0.5 * t.abs().ln() - 0.75) };
        let walk = |t: f64| t.abs().powi(3) / 6.0;
        let covariance = |of: &dyn Fn(f64) -> f64, a: i32, b: i32| -> f64 {
            let (a, b) = (kernel(a), kernel(b));
            a.iter().flat_map(|(x, p)| b.iter().map(move |(y, q)| p * q * of(x - y))).sum()
        };
        for apart in 1..FLICKER_SUMS.len() as i32 {
            let correlation = |of: &dyn Fn(f64) -> f64| {
                covariance(of, 0, apart) / (covariance(of, 0, 0) * covariance(of, apart, apart)).sqrt()
            };
            assert!((correlation(&flicker) - FLICKER_SUMS[apart as usize]).abs() < 1e-4, "{apart}");
            assert!((correlation(&walk) - WALK_SUMS).abs() < 1e-3, "{apart}");
        }
    }

    #[test]
    fn a_mean_with_many_degrees_of_freedom_has_the_quantile_of_chi_squared_and_with_few_a_larger_one() {
        assert!((student_ratio(1e7) / super::super::LIKELIHOOD_RATIO - 1.0).abs() < 1e-3);
        // Student's quantile of 0.99490 with three degrees of freedom is 5.80.
        assert!((student_ratio(3.0) - 4.0 * (1.0f64 + 5.80 * 5.80 / 3.0).ln()).abs() < 0.05, "{}", student_ratio(3.0));
    }
}
