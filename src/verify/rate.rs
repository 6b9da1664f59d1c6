//! The claimed rate error, worked out again from this folder's own temperatures ([`super::heat`]) and optics
//! ([`super::optics`]).
//!
//! Two comparisons: at the stated profile and time, and as the worst over all profiles and times. What is found here has no
//! grid where the pack is linear, and is extrapolated from two grids where its conductivity depends on temperature. The
//! claim stands on a grid of its own and may be off by what that leaves: [`GRID_SHARES`] or [`STEPPED_SHARES`].

use super::along::Along;
use super::heat::{Heat, Moment, State};
use super::optics::Optics;
use super::physics::{Physics, wound_turns};
use super::winding::Winding;
use super::{Claim, Findings, Printed, RateCheck, Truth};
use crate::parallel::InParallel;
use crate::profile::Profile;

const NOT_THE_WORST: &str = "the rate error is not as claimed: emit the schedule again";
const NOT_KNOWN: &str = "the rate error cannot be verified: do not sign it off on this check";

/// What the inversion of a Laplace transform, or the complementary error function, leaves: a share of what one layer
/// alone could make.
const EXACT_SHARE: f64 = 1e-10;
/// How closely a maximum over time is found on either side, a share of the worst rate error: right after a change of
/// ramp the error still grows for an instant, until the next layer feels it.
const MAXIMUM_SHARE: f64 = 1e-6;
/// What the grid of a claim leaves: of the worst rate error, and of what one layer alone could make. A tenth of what is
/// promised of a printed number, and ten times the most that was found (`tests/verify`).
const GRID_SHARES: [f64; 2] = [1e-4, 1e-6];
/// The same where parts differ at the start: in its first instant a claim's grid was found 7e-4 off, a surface being one of its nodes.
const START_SHARES: [f64; 2] = [1e-3, 1e-6];
/// The same where both sides step in time.
const STEPPED_SHARES: [f64; 2] = [1e-3, 1e-5];

/// A place is looked at closely where the rate error exceeds this share of the largest seen.
const CLOSE_TO_LARGEST: f64 = 0.97;
/// A piece is looked at more than a few times where what these show exceeds this share of the largest seen: what stands between two
/// of them is less than twice as large.
const WORTH_A_LOOK: f64 = 0.5;
/// A profile is stepped closely where coarse steps, which are off by a few per cent, show this share of the largest seen.
const WORTH_STEPPING: f64 = 0.8;

/// The last digit of a printed time.
const PRINTED_TIME_S: f64 = 1e-6;
const TIME_PARTS: i32 = 5;

pub(super) fn check(truth: &Truth, claim: &Claim, winding: &Winding, findings: &mut Findings) -> RateCheck {
    let Some(claimed) = claim.worst_rate_rad_per_s else { return RateCheck::None };
    // What a formula remembers is not worked out a second time: the rate error then stands as it is given.
    if truth.model.remembers() {
        return RateCheck::None;
    }
    let physics = match Physics::read(truth.model) {
        Ok(physics) => physics,
        Err(kind) => {
            findings.checks += 1;
            let expected = "effects that the verification knows".to_owned();
            findings.add(None, "worst_rate_deg_per_h", expected, kind.to_owned(), NOT_KNOWN);
            return RateCheck::None;
        }
    };
    if physics.is_beyond {
        return RateCheck::None;
    }
    let optics = Optics::new(&truth.model.coil, &physics, &winding.pieces);
    let profiles = truth.profiles.profiles();
    let longest_s = profiles.iter().map(Profile::duration_s).fold(1.0, f64::max);
    let height_m = truth.model.coil.axial_pitch_m() * wound_turns(truth.model).iter().copied().fold(0.0, f64::max);
    let declared = Heat::new(truth.model, &physics, height_m, longest_s);

    let steepest = profiles.iter().map(Profile::max_rate_k_per_s).fold(0.0, f64::max);
    let of_layer = optics.largest_layer_rad_per_k() * steepest;
    let within = |shares: [f64; 2], size: f64| shares[0] * size + shares[1] * of_layer;
    let by_grid = match (physics.is_pack, declared.is_exact_in_time()) {
        (false, _) => 0.0,
        (true, true) if physics.above_k.is_some() => within(START_SHARES, claimed.abs()),
        (true, true) => within(GRID_SHARES, claimed.abs()),
        (true, false) => within(STEPPED_SHARES, claimed.abs()),
    };
    let at_time = Printed::DegPerHour.tolerance() + EXACT_SHARE * of_layer + by_grid;

    let named = claim.worst_profile.as_ref().map(|name| (name, profiles.iter().find(|p| p.name() == name)));
    match named {
        Some((name, None)) => {
            findings.checks += 1;
            findings.add(None, "worst_profile", "a profile of the model".to_owned(), name.clone(), NOT_THE_WORST);
        }
        Some((_, Some(profile))) => {
            if let Some(time_s) = claim.worst_time_s {
                check_at(claimed, profile, time_s, &declared, &optics, at_time, findings);
            }
        }
        None => {}
    }

    let worst = worst_over(&declared, &optics, &profiles);
    let tolerance = at_time + MAXIMUM_SHARE * worst;
    findings.checks += 1;
    if !((worst - claimed).abs() <= tolerance) {
        let (expected, found) = (Printed::DegPerHour.show(worst), Printed::DegPerHour.show(claimed));
        findings.add(None, "worst_rate_deg_per_h", expected, found, NOT_THE_WORST);
    }
    RateCheck::Independent {
        worst_rad_per_s: worst,
        tolerance_rad_per_s: tolerance,
        finer_rad_per_s: physics.is_pack.then_some(worst),
        profiles: profiles.len(),
    }
}

/// The claim at its own profile and time.
fn check_at(
    claimed: f64,
    profile: &Profile,
    time_s: f64,
    heat: &Heat,
    optics: &Optics,
    tolerance: f64,
    findings: &mut Findings,
) {
    findings.checks += 1;
    if !(time_s >= 0.0 && time_s <= profile.duration_s() + PRINTED_TIME_S) {
        let expected = format!("from 0 to {:.3} s", profile.duration_s());
        findings.add(None, "worst_time_s", expected, format!("{time_s} s"), NOT_THE_WORST);
        return;
    }
    // The time is printed with few digits: a break point is meant where one is near.
    let knots = profile.pieces().iter().scan(0.0, |t, piece| {
        *t += piece.duration_s;
        Some(*t)
    });
    let near = std::iter::once(0.0).chain(knots).find(|t| (t - time_s).abs() < PRINTED_TIME_S).unwrap_or(time_s);
    let mut moments: Vec<Moment> = [false, true].map(|after| Moment { time_s: near, after }).to_vec();
    if heat.is_exact_in_time() {
        // A rate may also jump where the pack's mean rate changes its sign, to either side of the printed digits.
        let part_s = 0.5 * PRINTED_TIME_S / f64::from(TIME_PARTS);
        let around = (-TIME_PARTS..=TIME_PARTS).map(|i| (time_s + part_s * f64::from(i)).max(0.0));
        moments.extend(around.map(|time_s| Moment { time_s, after: true }));
    }
    let sizes = moments.into_iter().map(|moment| optics.rate_rad_per_s(&heat.at(profile, moment)).abs());
    let nearest = sizes.min_by(|a, b| (a - claimed).abs().total_cmp(&(b - claimed).abs()));
    let Some(expected) = nearest else { return };
    findings.checks += 1;
    if !((expected - claimed).abs() <= tolerance) {
        let field = "worst_rate_deg_per_h at worst_profile and worst_time_s";
        let (expected, found) = (Printed::DegPerHour.show(expected), Printed::DegPerHour.show(claimed));
        findings.add(None, field, expected, found, NOT_THE_WORST);
    }
}

/// The largest |Ω| over all profiles.
fn worst_over(heat: &Heat, optics: &Optics, profiles: &[Profile]) -> f64 {
    match heat.is_exact_in_time() {
        true => worst_of_sums(heat, optics, profiles),
        false => worst_of_steps(heat, optics, profiles),
    }
}

/// Every piece is looked at a few times, and closely where that shows that it may hold the largest.
fn worst_of_sums(heat: &Heat, optics: &Optics, profiles: &[Profile]) -> f64 {
    // What a user's formula does between two looks, nobody knows.
    let are_all_close = optics.has_formula();
    let few: Vec<Vec<f64>> = profiles
        .iter()
        .in_parallel()
        .map(|profile| {
            let mut largest = Vec::new();
            let Some(mut along) = Along::new(heat, profile) else { return largest };
            while let Some((_, duration_s)) = along.go_on() {
                let times_s = if are_all_close { Vec::new() } else { heat.few_times_s(duration_s) };
                let size = |time_s: f64| optics.rate_rad_per_s(&along.state(time_s)).abs();
                largest.push(times_s.into_iter().chain([duration_s]).map(size).fold(0.0, f64::max));
            }
            largest
        })
        .collect();
    let seen = few.iter().flatten().copied().fold(0.0, f64::max);
    let is_worth = |few: f64| are_all_close || few >= WORTH_A_LOOK * seen;
    let worst_of = |(profile, few): (&Profile, &Vec<f64>)| -> f64 {
        let mut worst = few.iter().copied().fold(0.0, f64::max);
        let Some(mut along) = Along::new(heat, profile).filter(|_| few.iter().any(|few| is_worth(*few))) else {
            return worst;
        };
        while let Some((piece, duration_s)) = along.go_on() {
            if is_worth(few[piece]) {
                worst = worst.max(worst_in(&along, heat, optics, duration_s, CLOSE_TO_LARGEST * seen));
            }
        }
        worst
    };
    profiles.iter().zip(&few).in_parallel().map(worst_of).fold(0.0, f64::max)
}

/// The largest |Ω| in one piece; `least` is what a peak must reach to be worth its top.
fn worst_in(along: &Along, heat: &Heat, optics: &Optics, duration_s: f64, least: f64) -> f64 {
    let size = |time_s: f64| optics.rate_rad_per_s(&along.state(time_s)).abs();
    let seen: Vec<(f64, f64)> =
        heat.times_s(duration_s).into_iter().chain([duration_s]).map(|time_s| (time_s, size(time_s))).collect();
    let mut worst = seen.iter().map(|(_, size)| *size).fold(0.0, f64::max);
    for peak in seen.windows(3) {
        let [(from_s, before), (_, middle), (to_s, after)] = [peak[0], peak[1], peak[2]];
        if middle >= least && middle >= before && middle >= after && from_s < to_s {
            worst = worst.max(narrowed(size, from_s, to_s));
        }
    }
    worst
}

/// Every profile is stepped coarsely, and closely where that shows that it may hold the largest.
fn worst_of_steps(heat: &Heat, optics: &Optics, profiles: &[Profile]) -> f64 {
    let sizes = |states: Vec<State>| -> Vec<(f64, f64)> {
        states.iter().map(|state| (state.time_s, optics.rate_rad_per_s(state).abs())).collect()
    };
    let largest = |sizes: &[(f64, f64)]| sizes.iter().map(|(_, size)| *size).fold(0.0, f64::max);
    let few: Vec<f64> = profiles.iter().in_parallel().map(|profile| largest(&sizes(heat.few_steps(profile)))).collect();
    let seen = few.iter().copied().fold(0.0, f64::max);
    let is_worth = |few: f64| optics.has_formula() || few >= WORTH_STEPPING * seen;
    let close: Vec<Vec<(f64, f64)>> = profiles
        .iter()
        .zip(&few)
        .filter(|(_, few)| is_worth(**few))
        .in_parallel()
        .map(|(profile, _)| sizes(heat.steps(profile)))
        .collect();
    let worst = close.iter().map(|sizes| largest(sizes)).fold(0.0, f64::max);
    let peaks = close.iter().flat_map(|sizes| sizes.windows(3));
    let tops = peaks.filter(|peak| {
        let [(from_s, before), (_, size), (to_s, after)] = [peak[0], peak[1], peak[2]];
        size >= CLOSE_TO_LARGEST * worst && size >= before && size >= after && from_s < to_s
    });
    tops.map(vertex).fold(worst, f64::max)
}

/// The largest value of a function with one maximum between two points.
fn narrowed(f: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    let mut largest = 0.0_f64;
    for _ in 0..50 {
        let (left, right) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        let (at_left, at_right) = (f(left), f(right));
        largest = largest.max(at_left).max(at_right);
        if at_left < at_right {
            low = left;
        } else {
            high = right;
        }
    }
    largest
}

/// The top of the parabola through three points.
fn vertex(points: &[(f64, f64)]) -> f64 {
    let [(x0, y0), (x1, y1), (x2, y2)] = [points[0], points[1], points[2]];
    if x1 == x0 || x2 == x1 {
        return y1;
    }
    let (first, second) = ((y1 - y0) / (x1 - x0), (y2 - y1) / (x2 - x1));
    let bend = (second - first) / (x2 - x0);
    if !(bend < 0.0) {
        return y1;
    }
    // Newton's form about the middle point.
    let slope = first + bend * (x1 - x0);
    y1 - slope * slope / (4.0 * bend)
}
