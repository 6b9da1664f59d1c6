//! What turbulence and ripple have made of pack and sensor before a record begins: both have always been there.
//!
//! ```text
//! dz = A z dt + dW, ⟨z zᵀ⟩ known;   dx_k = (f_k·(z, x_1 … x_{k−1}) − λ_k x_k) dt
//! ⟨x_k z⟩:   (A − λ_k) ⟨x_k z⟩ = −⟨(f_k·…) z⟩,      ⟨x_k x_j⟩ = (⟨(f_k·…) x_j⟩ + ⟨(f_j·…) x_k⟩)/(λ_k + λ_j)
//! ```
//!
//! Without it a fast mode, that has followed the air all along, would begin apart from it by all that turbulence has: a rate of
//! twenty noises in the first row of a record.
//!
//! # Source
//! The stationary Lyapunov equation of a linear stochastic system, solved from follower to follower; Särkkä and Solin, Applied
//! Stochastic Differential Equations (2019), section 6.5.

use nalgebra::{SMatrix, SVector};

/// Turbulence, the ripple and what drives it.
pub(super) const DRIVING: usize = 5;

/// The covariance that followers have with the drive and with each other, row-major n × n; the drive's own is left out.
///
/// # Shapes
/// `f` row-major n × n; `own` ⟨z zᵀ⟩ in the order of `driving`; `followers`: each follows the drive and those before it only.
pub(super) fn followed(
    f: &[f64],
    n: usize,
    driving: [usize; DRIVING],
    own: &SMatrix<f64, DRIVING, DRIVING>,
    followers: &[usize],
) -> Vec<f64> {
    let mut found = vec![0.0; n * n];
    for (a, &i) in driving.iter().enumerate() {
        driving.iter().enumerate().for_each(|(b, &j)| found[i * n + j] = own[(a, b)]);
    }
    let within = SMatrix::<f64, DRIVING, DRIVING>::from_fn(|a, b| f[driving[a] * n + driving[b]]);
    for (count, &k) in followers.iter().enumerate() {
        let before = &followers[..count];
        // What a follower other than itself follows, with another state.
        let source = |found: &[f64], of: usize, with: usize| -> f64 {
            let sources = driving.iter().chain(before).filter(|&&m| m != of);
            sources.map(|&m| f[of * n + m] * found[m * n + with]).sum()
        };
        let decay = -f[k * n + k];
        let asked = SVector::<f64, DRIVING>::from_fn(|a, _| -source(&found, k, driving[a]));
        let shifted = within - SMatrix::<f64, DRIVING, DRIVING>::identity() * decay;
        let Some(with_drive) = shifted.lu().solve(&asked) else { continue };
        for (a, &i) in driving.iter().enumerate() {
            (found[k * n + i], found[i * n + k]) = (with_drive[a], with_drive[a]);
        }
        for &j in before {
            let both = source(&found, k, j) + source(&found, j, k);
            let value = both / (decay - f[j * n + j]);
            (found[k * n + j], found[j * n + k]) = (value, value);
        }
        found[k * n + k] = source(&found, k, k) / decay;
    }
    for i in driving {
        driving.iter().for_each(|j| found[i * n + j] = 0.0);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::super::discretise::discretise;
    use super::super::system::diagonal;
    use super::*;

    #[test]
    fn what_followers_begin_with_is_what_a_long_time_makes_of_them() {
        // A turbulence, a ripple and its driver; a skin, two modes that follow it and the air, and a sensor that follows a mode.
        let n = 9;
        let mut f = vec![0.0; n * n];
        let mut set = |i: usize, j: usize, v: f64| f[i * n + j] = v;
        let (turbulence_s, coherence_s, omega): (f64, f64, f64) = (40.0, 300.0, 0.05);
        set(0, 0, -1.0 / turbulence_s);
        for (i, driver) in [(1, 3), (2, 4)] {
            set(i, i, -1.0 / coherence_s);
            set(driver, driver, -1.0 / coherence_s);
            set(i, driver, 1.0 / coherence_s);
        }
        for i in [1, 3] {
            set(i, i + 1, omega);
            set(i + 1, i, -omega);
        }
        for (i, decay, sources) in
            [(5, 0.02, vec![0, 1]), (6, 0.1, vec![5]), (7, 0.003, vec![0, 1]), (8, 0.05, vec![6, 7])]
        {
            set(i, i, -decay);
            let share = decay / sources.len() as f64;
            sources.iter().for_each(|&j| set(i, j, if i < 8 { share } else { 1.3 * share }));
        }
        let (turbulence, ripple) = (0.03, 0.07_f64);
        let (squared, driver) = (ripple * ripple, 2.0 * ripple * ripple);
        let mut own = SMatrix::<f64, DRIVING, DRIVING>::zeros();
        own[(0, 0)] = turbulence * turbulence;
        for (i, d) in [(1, 3), (2, 4)] {
            (own[(i, i)], own[(i, d)], own[(d, i)], own[(d, d)]) = (squared, squared, squared, driver);
        }
        let mut noise = vec![0.0; n];
        noise[0] = 2.0 * turbulence * turbulence / turbulence_s;
        (noise[3], noise[4]) = (2.0 * driver / coherence_s, 2.0 * driver / coherence_s);
        let long = &discretise(&f, [&diagonal(&noise), &vec![0.0; n * n]], n, &[2e4])[0];
        let found = followed(&f, n, [0, 1, 2, 3, 4], &own, &[5, 6, 7, 8]);
        for i in 0..n {
            for j in 0..n {
                let exact = long.noises[0][i * n + j];
                let found = if i < DRIVING && j < DRIVING { own[(i, j)] } else { found[i * n + j] };
                assert!((found - exact).abs() < 1e-12, "{i} {j}: {found} for {exact}");
            }
        }
    }
}
