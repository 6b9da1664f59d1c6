//! The claimed rate error, worked out again.
//!
//! ```text
//! Ω(t) = Σ_q (k_q − k_{q−1}) G(t − t_{q−1}),   G(τ) = n κ/(L D) Σ_j w_j g_j(τ)
//! half space:  g_j = erfc(x_j/√(4Kτ))
//! pack:        (1/r) ∂/∂r (r ∂g/∂r) = (1/K) ∂g/∂τ,  ∂g/∂r = 0 at the bore,  g = 1 at the boundary
//! ```
//!
//! The pack is stepped in time by backward Euler with Richardson extrapolation on a grid of its own, four nodes a
//! layer. Holds for models without effects but `finite_pack` and `turn_mismatch`; of others the claim is compared with
//! the reference model only.

use super::expected::{layer_lengths_m, starts_m};
use super::{Claim, Findings, Printed, RateCheck, Truth};
use crate::pattern::Pattern;
use crate::profile::Profile;
use crate::rate::RateModel;
use crate::thermal::{Drive, Extent, Instant, Location, solve};
use crate::units::REFERENCE_TEMPERATURE_K;

const NOT_THE_WORST: &str = "the rate error is not as claimed: emit the schedule again";
/// How closely two discretisations of the pack agree; the half space has only this file's time grid between.
const PACK_AGREEMENT: f64 = 0.01;
const HALF_SPACE_AGREEMENT: f64 = 1e-3;
/// Nodes a layer of this file's own grid.
const NODES: usize = 4;
/// Times of the step response, spaced geometrically.
const RESPONSE_TIMES: usize = 700;

pub(super) fn check(truth: &Truth, claim: &Claim, segments: &[usize], findings: &mut Findings) -> RateCheck {
    let Some(claimed) = claim.worst_rate_rad_per_s else { return RateCheck::None };
    let profiles = truth.profiles.profiles();
    let named = claim.worst_profile.as_ref().map(|name| (name, profiles.iter().find(|p| p.name() == name)));
    match named {
        Some((name, None)) => {
            findings.checks += 1;
            findings.add(None, "worst_profile", "a profile of the model".to_owned(), name.clone(), NOT_THE_WORST);
        }
        Some((_, Some(profile))) => {
            if let Some(time_s) = claim.worst_time_s {
                check_at(truth, claimed, segments, profile, time_s, findings);
            }
        }
        None => {}
    }
    let known = ["finite_pack", "turn_mismatch"];
    if truth.model.effects.iter().any(|e| !known.contains(&e.spec().kind)) {
        return RateCheck::ReferenceOnly;
    }
    let longest_s = profiles.iter().map(Profile::duration_s).fold(1.0, f64::max);
    let response = Response::new(truth, segments, longest_s);
    let worst = profiles.iter().map(|p| response.worst_rad_per_s(p)).fold(0.0, f64::max);
    let agreement = if response.is_exact { HALF_SPACE_AGREEMENT } else { PACK_AGREEMENT };
    // A pattern that cancels everything leaves nothing to compare but the solvers' errors.
    let slack = agreement * worst.max(claimed.abs()) + 1e-3 * agreement * response.scale;
    findings.checks += 1;
    if !((worst - claimed).abs() <= slack) {
        let (expected, found) = (Printed::DegPerHour.show(worst), Printed::DegPerHour.show(claimed));
        findings.add(None, "worst_rate_deg_per_h", expected, found, NOT_THE_WORST);
    }
    RateCheck::Independent { worst_rad_per_s: worst }
}

/// The claim at its own profile and time, against the readable reference model.
fn check_at(truth: &Truth, claimed: f64, segments: &[usize], profile: &Profile, time_s: f64, findings: &mut Findings) {
    findings.checks += 1;
    if !(time_s >= 0.0 && time_s <= profile.duration_s() + 1e-6) {
        let expected = format!("from 0 to {:.3} s", profile.duration_s());
        findings.add(None, "worst_time_s", expected, format!("{time_s} s"), NOT_THE_WORST);
        return;
    }
    let Ok(pattern) = Pattern::new(segments.to_vec()) else { return };
    let (Ok(model), Ok(path)) = (RateModel::new(truth.model, &pattern, &[]), truth.model.heat_path()) else { return };
    let Ok(field) = solve(&path, &Drive::boundary(profile.temperature(REFERENCE_TEMPERATURE_K))) else { return };
    // The time is printed with few digits: a break point is meant where one is near.
    let knots = profile.pieces().iter().scan(0.0, |t, piece| {
        *t += piece.duration_s;
        Some(*t)
    });
    let near = std::iter::once(0.0).chain(knots).find(|t| (t - time_s).abs() < 1e-6).unwrap_or(time_s);
    let history = field.at(&[Instant::before(near), Instant::after(near), Instant::after(time_s)]);
    let rates = model.series_rad_per_s(&history);
    let nearest = rates.iter().map(|r| r.abs()).min_by(|a, b| (a - claimed).abs().total_cmp(&(b - claimed).abs()));
    let Some(expected) = nearest else { return };
    findings.near(
        None,
        "worst_rate_deg_per_h at worst_profile and worst_time_s",
        expected,
        claimed,
        Printed::DegPerHour,
    );
}

/// The rate error's response to a unit step of the boundary's rate.
struct Response {
    times_s: Vec<f64>,
    values: Vec<f64>,
    /// The response that one layer alone could have [rad/s per K/s], times the largest ramp.
    scale: f64,
    is_exact: bool,
}

impl Response {
    fn new(truth: &Truth, segments: &[usize], longest_s: f64) -> Self {
        let model = truth.model;
        let coil = &model.coil;
        let lengths_m = layer_lengths_m(truth);
        let starts_m = starts_m(&lengths_m, segments);
        let length_m = starts_m[segments.len()];
        let fibre = coil.fibre();
        let kappa = fibre.thermo_optic_per_k + fibre.refractive_index * fibre.thermal_expansion_per_k;
        let diameter_m = 2.0 * coil.bore_radius_m() + coil.layers() as f64 * coil.radial_pitch_m();
        let scale = fibre.refractive_index * kappa / (length_m * diameter_m);
        // ∫ (2z − L) dz over a segment is the difference of z² − L z at its ends.
        let primitive = |z_m: f64| z_m * z_m - length_m * z_m;
        let weights: Vec<f64> =
            segments.iter().map(|&s| scale * (primitive(starts_m[s]) - primitive(starts_m[s - 1]))).collect();
        let diffusivity = model.material.diffusivity_m2_per_s();
        let layers = coil.layers();
        let first_s = 0.02 * coil.radial_pitch_m().powi(2) / (4.0 * diffusivity);
        let ratio = (longest_s / first_s).max(2.0).powf(1.0 / (RESPONSE_TIMES - 1) as f64);
        let times_s: Vec<f64> =
            std::iter::once(0.0).chain((0..RESPONSE_TIMES).map(|i| first_s * ratio.powi(i as i32))).collect();
        let pack = model.extent == Extent::Pack || model.effects.iter().any(|e| e.spec().kind == "finite_pack");
        let values = if pack {
            let shares = step_pack(truth, &times_s);
            shares.iter().map(|g| g.iter().zip(&weights).map(|(g, w)| g * w).sum()).collect()
        } else {
            let depth_m = |j: usize| (layers - 1 - j) as f64 * coil.radial_pitch_m();
            let share = |j: usize, t: f64| match (depth_m(j), t) {
                (0.0, _) => 1.0,
                (_, 0.0) => 0.0,
                (x, t) => libm::erfc(x / (2.0 * (diffusivity * t).sqrt())),
            };
            times_s.iter().map(|&t| weights.iter().enumerate().map(|(j, w)| w * share(j, t)).sum()).collect()
        };
        let largest = weights.iter().map(|w| w.abs()).fold(0.0, f64::max);
        let max_rate = truth.profiles.max_rate_k_per_s;
        Self { times_s, values, scale: largest * max_rate, is_exact: !pack }
    }

    fn at(&self, time_s: f64) -> f64 {
        let after = self.times_s.partition_point(|t| *t <= time_s);
        if after == 0 {
            return 0.0;
        }
        if after == self.times_s.len() {
            return self.values[after - 1];
        }
        let (t0, t1) = (self.times_s[after - 1], self.times_s[after]);
        let share = (time_s - t0) / (t1 - t0);
        self.values[after - 1] * (1.0 - share) + self.values[after] * share
    }

    /// Over the profile, both one-sided limits at its break points included.
    fn worst_rad_per_s(&self, profile: &Profile) -> f64 {
        let mut worst: f64 = 0.0;
        let mut jumps: Vec<(f64, f64)> = Vec::new();
        let (mut start_s, mut rate) = (0.0, 0.0);
        for piece in profile.pieces() {
            let end_s = start_s + piece.duration_s;
            let old = jumps.clone();
            jumps.push((start_s, piece.rate_k_per_s - rate));
            rate = piece.rate_k_per_s;
            let sum = |jumps: &[(f64, f64)], t: f64| jumps.iter().map(|(from, k)| k * self.at(t - from)).sum::<f64>();
            worst = worst.max(sum(&old, start_s).abs());
            let within = self.times_s.iter().take_while(|t| start_s + **t <= end_s);
            for &t in within {
                worst = worst.max(sum(&jumps, start_s + t).abs());
            }
            for i in 1..=200 {
                worst = worst.max(sum(&jumps, start_s + piece.duration_s * f64::from(i) / 200.0).abs());
            }
            start_s = end_s;
        }
        jumps.push((start_s, -rate));
        worst.max(jumps.iter().map(|(from, k)| k * self.at(start_s - from)).sum::<f64>().abs())
    }
}

/// Each layer's g at each time. Finite differences in r between the bore and where the boundary is imposed.
fn step_pack(truth: &Truth, times_s: &[f64]) -> Vec<Vec<f64>> {
    let coil = &truth.model.coil;
    let (layers, bore_m, pitch_m) = (coil.layers(), coil.bore_radius_m(), coil.radial_pitch_m());
    let diffusivity = truth.model.material.diffusivity_m2_per_s();
    let at_surface = truth.model.location == Location::Ambient;
    let step_m = pitch_m / NODES as f64;
    // Nodes at the bore, bore + step, …; the last one is the boundary.
    let intervals = if at_surface { layers * NODES } else { (2 * layers - 1) * NODES / 2 };
    let radius_m = |i: usize| bore_m + i as f64 * step_m;
    let coupling = |i: usize, outward: bool| {
        let edge_m = if outward { radius_m(i) + 0.5 * step_m } else { radius_m(i) - 0.5 * step_m };
        diffusivity * edge_m / (radius_m(i) * step_m * step_m)
    };
    let backward_euler = |g: &[f64], dt_s: f64| -> Vec<f64> {
        let mut upper = vec![0.0; intervals];
        let mut right = vec![0.0; intervals];
        for i in 0..intervals {
            // No flux through the bore: the innermost node has half a cell.
            let (inward, outward) = if i == 0 {
                let cell_m2 = (radius_m(0) + 0.25 * step_m) * 0.5 * step_m;
                (0.0, diffusivity * (radius_m(0) + 0.5 * step_m) / step_m / cell_m2)
            } else {
                (coupling(i, false), coupling(i, true))
            };
            let diagonal = 1.0 + dt_s * (inward + outward);
            let mut known = g[i];
            if i + 1 == intervals {
                known += dt_s * outward;
            }
            let below = if i == 0 { 0.0 } else { -dt_s * inward };
            let pivot = diagonal - below * if i == 0 { 0.0 } else { upper[i - 1] };
            upper[i] = if i + 1 == intervals { 0.0 } else { -dt_s * outward / pivot };
            right[i] = (known - below * if i == 0 { 0.0 } else { right[i - 1] }) / pivot;
        }
        let mut next = right;
        for i in (0..intervals - 1).rev() {
            next[i] -= upper[i] * next[i + 1];
        }
        next
    };
    let mut g = vec![0.0; intervals];
    let mut shares = Vec::with_capacity(times_s.len());
    let mut now_s = 0.0;
    for &time_s in times_s {
        let dt_s = time_s - now_s;
        if dt_s > 0.0 {
            let whole = backward_euler(&g, dt_s);
            let halves = backward_euler(&backward_euler(&g, 0.5 * dt_s), 0.5 * dt_s);
            g = halves.iter().zip(&whole).map(|(h, w)| 2.0 * h - w).collect();
            now_s = time_s;
        }
        // A layer's middle lies half a pitch above its inner edge: on a node.
        let layer = |j: usize| {
            let node = j * NODES + NODES / 2;
            if node >= intervals { 1.0 } else { g[node] }
        };
        shares.push((0..layers).map(layer).collect());
    }
    shares
}
