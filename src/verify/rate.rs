//! The claimed rate error, worked out again.
//!
//! Twice: the worst over all profiles from this folder's own temperatures ([`super::heat`]) and optics
//! ([`super::optics`]), as closely as two discretisations of the pack agree; and at the claimed profile and time to the
//! last printed digit, from the program's temperatures and this folder's optics. Left out are models with an effect
//! that [`super::physics`] does not know, which are compared with the reference model only, and the temperatures of a
//! pack whose flange is heated while its conductivity depends on temperature.

use super::expected::{layer_lengths_m, runs_outbound};
use super::heat::{Heat, State};
use super::optics::Optics;
use super::physics::{Physics, wound_turns};
use super::{Claim, Findings, Printed, RateCheck, Truth};
use crate::pattern::Pattern;
use crate::profile::Profile;
use crate::rate::RateModel;
use crate::thermal::{Drive, Instant, ThermalHistory, solve};
use crate::units::REFERENCE_TEMPERATURE_K;

const NOT_THE_WORST: &str = "the rate error is not as claimed: emit the schedule again";
/// How closely two discretisations of the pack agree, as a share of the worst rate error and of what one layer alone
/// could make: where a pattern cancels nearly everything, the discretisations' own errors are left. The half space
/// has only this folder's time grid between.
const PACK_AGREEMENT: [f64; 2] = [0.01, 1e-4];
const HALF_SPACE_AGREEMENT: [f64; 2] = [1e-3, 1e-6];

/// The last digit of a printed time.
const PRINTED_TIME_S: f64 = 1e-6;
const TIME_PARTS: i32 = 5;

pub(super) fn check(truth: &Truth, claim: &Claim, segments: &[usize], findings: &mut Findings) -> RateCheck {
    let Some(claimed) = claim.worst_rate_rad_per_s else { return RateCheck::None };
    let profiles = truth.profiles.profiles();
    let known = Physics::read(truth.model).map(|physics| {
        let optics = Optics::new(
            &truth.model.coil,
            &physics,
            segments,
            &wound_turns(truth.model),
            &layer_lengths_m(truth),
            &runs_outbound(segments),
        );
        (physics, optics)
    });
    let named = claim.worst_profile.as_ref().map(|name| (name, profiles.iter().find(|p| p.name() == name)));
    match named {
        Some((name, None)) => {
            findings.checks += 1;
            findings.add(None, "worst_profile", "a profile of the model".to_owned(), name.clone(), NOT_THE_WORST);
        }
        Some((_, Some(profile))) => {
            if let Some(time_s) = claim.worst_time_s {
                let rates = |history: &ThermalHistory| match &known {
                    Some((_, optics)) => own_rates(optics, history),
                    None => reference_rates(truth, segments, history),
                };
                check_at(truth, claimed, profile, time_s, &rates, findings);
            }
        }
        None => {}
    }
    let Some((physics, optics)) = known.filter(|(physics, _)| Heat::knows(physics)) else {
        return RateCheck::ReferenceOnly;
    };
    let longest_s = profiles.iter().map(Profile::duration_s).fold(1.0, f64::max);
    let height_m = truth.model.coil.axial_pitch_m() * wound_turns(truth.model).iter().copied().fold(0.0, f64::max);
    let heat = Heat::new(truth.model, &physics, height_m, longest_s);
    let worst_of = |profile: &Profile| {
        let sizes = heat.states(profile).into_iter().map(|state| optics.rate_rad_per_s(&state).abs());
        sizes.fold(0.0, f64::max)
    };
    let worst = profiles.iter().map(worst_of).fold(0.0, f64::max);
    let [of_worst, of_layer] = if physics.is_pack { PACK_AGREEMENT } else { HALF_SPACE_AGREEMENT };
    let steepest = profiles.iter().map(Profile::max_rate_k_per_s).fold(0.0, f64::max);
    let slack = of_worst * worst.max(claimed.abs()) + of_layer * optics.largest_layer_rad_per_k() * steepest;
    findings.checks += 1;
    if !((worst - claimed).abs() <= slack) {
        let (expected, found) = (Printed::DegPerHour.show(worst), Printed::DegPerHour.show(claimed));
        findings.add(None, "worst_rate_deg_per_h", expected, found, NOT_THE_WORST);
    }
    RateCheck::Independent { worst_rad_per_s: worst }
}

/// The claim at its own profile and time, under the program's temperatures.
fn check_at(
    truth: &Truth,
    claimed: f64,
    profile: &Profile,
    time_s: f64,
    rates: &dyn Fn(&ThermalHistory) -> Vec<f64>,
    findings: &mut Findings,
) {
    findings.checks += 1;
    if !(time_s >= 0.0 && time_s <= profile.duration_s() + 1e-6) {
        let expected = format!("from 0 to {:.3} s", profile.duration_s());
        findings.add(None, "worst_time_s", expected, format!("{time_s} s"), NOT_THE_WORST);
        return;
    }
    let Ok(path) = truth.model.heat_path() else { return };
    let Ok(field) = solve(&path, &Drive::boundary(profile.temperature(REFERENCE_TEMPERATURE_K))) else { return };
    // The time is printed with few digits: a break point is meant where one is near.
    let knots = profile.pieces().iter().scan(0.0, |t, piece| {
        *t += piece.duration_s;
        Some(*t)
    });
    let near = std::iter::once(0.0).chain(knots).find(|t| (t - time_s).abs() < 1e-6).unwrap_or(time_s);
    // A rate may also jump where the pack's mean rate changes its sign, to either side of the printed digits.
    let around =
        (-TIME_PARTS..=TIME_PARTS).map(|i| time_s + 0.5 * PRINTED_TIME_S * f64::from(i) / f64::from(TIME_PARTS));
    let instants = [Instant::before(near), Instant::after(near)].into_iter().chain(around.map(Instant::after));
    let history = field.at(&instants.collect::<Vec<_>>());
    let sizes = rates(&history).into_iter().map(f64::abs);
    let nearest = sizes.min_by(|a, b| (a - claimed).abs().total_cmp(&(b - claimed).abs()));
    let Some(expected) = nearest else { return };
    findings.near(
        None,
        "worst_rate_deg_per_h at worst_profile and worst_time_s",
        expected,
        claimed,
        Printed::DegPerHour,
    );
}

fn own_rates(optics: &Optics, history: &ThermalHistory) -> Vec<f64> {
    let above = |t: &f64| t - REFERENCE_TEMPERATURE_K;
    (0..history.len())
        .map(|row| {
            optics.rate_rad_per_s(&State {
                time_s: history.times_s[row],
                rise_k: history.temperatures_k(row).iter().map(above).collect(),
                rate_k_per_s: history.rates_k_per_s(row).to_vec(),
                moment_k_per_s: history.axial_moments_k_per_s(row).to_vec(),
                ambient_rise_k: above(&history.ambient_k[row]),
                ambient_rate_k_per_s: history.ambient_rate_k_per_s[row],
            })
        })
        .collect()
}

fn reference_rates(truth: &Truth, segments: &[usize], history: &ThermalHistory) -> Vec<f64> {
    let model = Pattern::new(segments.to_vec()).ok().and_then(|p| RateModel::new(truth.model, &p, &[]).ok());
    model.map_or_else(Vec::new, |model| model.series_rad_per_s(history))
}
