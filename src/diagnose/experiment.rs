//! Which profile would tell candidates apart, and by how much.
//!
//! ```text
//! profile = argmax over profiles of  min over pairs (i, j)  rms_t { Ω_i − Ω_j − mean(Ω_i − Ω_j) }
//! ```
//!
//! The profiles are a few that a chamber operator would think of and sampled ones, all within the temperatures, the rate
//! and the duration that the records show the chamber to be capable of; each candidate predicts by its own model, with
//! its fitted parameters.
//!
//! Leaves out what a profile does not say: further columns count as zero, and what a candidate could make up for by being
//! fitted again.
//!
//! # Source
//! Hunter and Reiner, Technometrics 7 (1965) 307: the experiment at which rival models differ most.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::{Diagnosis, Verdict};
use crate::pattern::Pattern;
use crate::profile::{Piece, Profile};
use crate::rate::{CoilModel, RateModel};
use crate::record::Record;
use crate::thermal::{Drive, solve};
use crate::units::REFERENCE_TEMPERATURE_K;

/// A profile, and how far apart the candidates are under it.
#[derive(Debug, Clone, PartialEq)]
pub struct Experiment {
    pub profile: Profile,
    /// Names of the candidates.
    pub rivals: Vec<String>,
    pub separations: Vec<Separation>,
    /// Profiles that it was chosen from.
    pub tried: usize,
}

/// Two candidates' predictions: root mean square of their difference, the mean taken out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Separation {
    pub first: usize,
    pub second: usize,
    pub rms_rad_per_s: f64,
}

/// What the records show the chamber to be capable of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chamber {
    pub coldest_k: f64,
    pub warmest_k: f64,
    pub rate_k_per_s: f64,
    pub duration_s: f64,
    pub interval_s: f64,
}

/// Over this time a rate of the chamber is told from noise.
const RATE_WINDOW_S: f64 = 300.0;
const SAMPLED: usize = 48;
/// Nonlinear fields take a hundred times as long.
const SAMPLED_NONLINEAR: usize = 6;
const MOST_LEGS: usize = 8;
const MOST_ROWS: f64 = 4000.0;

impl Chamber {
    /// None where the records hold no change of temperature.
    pub fn of(records: &[&Record]) -> Option<Self> {
        let temperatures = || records.iter().flat_map(|r| r.temperature_k().iter().copied());
        let duration_s = |r: &&Record| r.times_s()[r.rows() - 1] - r.times_s()[0];
        let rate = records.iter().flat_map(|r| slopes_k_per_s(r)).fold(0.0, f64::max);
        (rate > 0.0).then(|| Self {
            coldest_k: temperatures().fold(REFERENCE_TEMPERATURE_K, f64::min),
            warmest_k: temperatures().fold(REFERENCE_TEMPERATURE_K, f64::max),
            rate_k_per_s: rate,
            duration_s: records.iter().map(duration_s).fold(0.0, f64::max),
            interval_s: records.iter().map(|r| r.interval_s()).fold(f64::INFINITY, f64::min),
        })
    }
}

/// Sizes of the rates over windows.
fn slopes_k_per_s(record: &Record) -> Vec<f64> {
    let (times_s, values) = (record.times_s(), record.temperature_k());
    let mut from = 0;
    (0..record.rows())
        .filter_map(|to| {
            while from + 1 < to && times_s[to] - times_s[from + 1] >= RATE_WINDOW_S {
                from += 1;
            }
            let span_s = times_s[to] - times_s[from];
            (span_s >= RATE_WINDOW_S).then(|| (values[to] - values[from]).abs() / span_s)
        })
        .collect()
}

/// What a diagnosis leaves to be told apart: an effect and its equivalents, or the model with and without what is missing.
pub fn rivals(declared: &CoilModel, diagnosis: &Diagnosis) -> Vec<(String, CoilModel)> {
    let all = || diagnosis.effects.iter().map(|e| e.effect.kind()).collect::<Vec<_>>().join(" + ");
    match diagnosis.verdict {
        Verdict::Indistinguishable => {
            let open = diagnosis.effects.iter().find(|e| !e.equivalents.is_empty());
            let own = open.map(|e| (e.effect.kind(), diagnosis.extended.clone()));
            let others = open.into_iter().flat_map(|e| &e.equivalents);
            own.into_iter().chain(others.map(|o| (o.effect.kind(), o.extended.clone()))).collect()
        }
        Verdict::Missing => {
            vec![("the declared model".to_owned(), declared.clone()), (all(), diagnosis.extended.clone())]
        }
        Verdict::Adequate | Verdict::Unexplained => Vec::new(),
    }
}

/// The profile under which the candidates are furthest apart; None where no profile can be solved for all of them.
pub fn design(rivals: &[(String, CoilModel)], pattern: &Pattern, chamber: &Chamber, seed: u64) -> Option<Experiment> {
    if rivals.len() < 2 {
        return None;
    }
    let nonlinear = rivals.iter().any(|(_, m)| m.heat_path().map_or(true, |path| path.conductivity_slope_per_k != 0.0));
    let profiles = profiles(chamber, if nonlinear { SAMPLED_NONLINEAR } else { SAMPLED }, seed);
    let tried = profiles.len();
    let judged: Vec<Option<Vec<Separation>>> =
        profiles.par_iter().map(|profile| separations(rivals, pattern, profile, chamber)).collect();
    let least = |found: &[Separation]| found.iter().map(|s| s.rms_rad_per_s).fold(f64::INFINITY, f64::min);
    let mut best: Option<(Profile, Vec<Separation>)> = None;
    for (profile, found) in profiles.into_iter().zip(judged) {
        let Some(found) = found else { continue };
        // The first of equals stays.
        if best.as_ref().is_none_or(|(_, known)| least(&found) > least(known)) {
            best = Some((profile, found));
        }
    }
    let (profile, separations) = best?;
    Some(Experiment { profile, rivals: rivals.iter().map(|r| r.0.clone()).collect(), separations, tried })
}

/// Every pair under one profile.
fn separations(
    rivals: &[(String, CoilModel)],
    pattern: &Pattern,
    profile: &Profile,
    chamber: &Chamber,
) -> Option<Vec<Separation>> {
    let step_s = chamber.interval_s.max(profile.duration_s() / MOST_ROWS);
    let rows = (profile.duration_s() / step_s) as usize;
    let times_s: Vec<f64> = (1..=rows).map(|i| step_s * i as f64).collect();
    let series = rivals.iter().map(|(_, model)| rates_rad_per_s(model, pattern, profile, &times_s));
    let series = series.collect::<Option<Vec<Vec<f64>>>>()?;
    let mut found = Vec::new();
    for first in 0..series.len() {
        for second in first + 1..series.len() {
            let difference: Vec<f64> = series[first].iter().zip(&series[second]).map(|(a, b)| a - b).collect();
            let rms_rad_per_s = crate::numeric::statistics::standard_deviation(&difference);
            found.push(Separation { first, second, rms_rad_per_s });
        }
    }
    found.iter().all(|s| s.rms_rad_per_s.is_finite()).then_some(found)
}

fn rates_rad_per_s(model: &CoilModel, pattern: &Pattern, profile: &Profile, times_s: &[f64]) -> Option<Vec<f64>> {
    let drive = Drive::boundary(profile.temperature(REFERENCE_TEMPERATURE_K));
    let history = solve(&model.heat_path().ok()?, &drive).ok()?.means(times_s, model.rate_mean_s);
    Some(RateModel::new(model, pattern, &[]).ok()?.series_rad_per_s(&history))
}

/// A ramp to a temperature and a soak there.
#[derive(Debug, Clone, Copy)]
struct Leg {
    to_k: f64,
    /// Of the chamber's largest.
    rate_share: f64,
    /// Of the chamber's duration.
    soak_share: f64,
}

fn profiles(chamber: &Chamber, sampled: usize, seed: u64) -> Vec<Profile> {
    let (cold, warm) = (chamber.coldest_k, chamber.warmest_k);
    let leg = |to_k: f64, rate_share: f64, soak_share: f64| Leg { to_k, rate_share, soak_share };
    let between = |share: f64| cold + share * (warm - cold);
    let mut named: Vec<(String, Vec<Leg>)> = vec![
        ("ramp-and-soak".to_owned(), vec![leg(warm, 1.0, 1.0)]),
        ("up-and-down".to_owned(), vec![leg(warm, 1.0, 0.2), leg(cold, 1.0, 0.2), leg(between(0.5), 1.0, 0.2)]),
        ("triangles".to_owned(), [warm, cold].repeat(6).into_iter().map(|t| leg(t, 1.0, 0.0)).collect()),
        (
            "slow-up-fast-down".to_owned(),
            [(warm, 0.2), (cold, 1.0)].repeat(3).into_iter().map(|(t, r)| leg(t, r, 0.05)).collect(),
        ),
        ("staircase".to_owned(), [0.25, 0.5, 0.75, 1.0, 0.0].map(|s| leg(between(s), 1.0, 0.12)).into()),
        ("warm-triangles".to_owned(), [1.0, 0.7].repeat(8).into_iter().map(|s| leg(between(s), 1.0, 0.01)).collect()),
        ("cold-triangles".to_owned(), [0.0, 0.3].repeat(8).into_iter().map(|s| leg(between(s), 1.0, 0.01)).collect()),
    ];
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    for i in 0..sampled {
        let legs = 2 + (random.random::<f64>() * (MOST_LEGS - 1) as f64) as usize;
        let share = 1.0 / legs as f64;
        let legs = (0..legs).map(|_| {
            let to_k = between(random.random::<f64>());
            leg(to_k, 0.2 + 0.8 * random.random::<f64>(), share * random.random::<f64>())
        });
        named.push((format!("sampled-{}", i + 1), legs.collect()));
    }
    named.into_iter().filter_map(|(name, legs)| profile_of(&name, &legs, chamber)).collect()
}

/// The legs as far as the duration goes; a last soak fills it.
fn profile_of(name: &str, legs: &[Leg], chamber: &Chamber) -> Option<Profile> {
    let (mut at_k, mut left_s) = (REFERENCE_TEMPERATURE_K, chamber.duration_s);
    let mut pieces = Vec::new();
    let mut add = |rate_k_per_s: f64, wanted_s: f64| {
        // Whole seconds, which an operator can set.
        let duration_s = wanted_s.min(left_s).floor();
        if duration_s >= 1.0 {
            left_s -= duration_s;
            pieces.push(Piece { rate_k_per_s, duration_s });
        }
        duration_s.max(0.0)
    };
    for leg in legs {
        let rate_k_per_s = leg.rate_share * chamber.rate_k_per_s * (leg.to_k - at_k).signum();
        at_k += rate_k_per_s * add(rate_k_per_s, (leg.to_k - at_k).abs() / rate_k_per_s.abs());
        add(0.0, leg.soak_share * chamber.duration_s);
    }
    add(0.0, f64::INFINITY);
    Profile::new(name, pieces).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHAMBER: Chamber = Chamber {
        coldest_k: 253.0,
        warmest_k: 333.0,
        rate_k_per_s: 1.0 / 60.0,
        duration_s: 20_000.0,
        interval_s: 10.0,
    };

    #[test]
    fn every_profile_stays_within_what_the_chamber_can_do() {
        let profiles = profiles(&CHAMBER, 40, 3);
        assert_eq!(profiles.len(), 47);
        for profile in &profiles {
            let course = profile.temperature(REFERENCE_TEMPERATURE_K);
            assert!(course.values().iter().all(|t| (252.9..=333.1).contains(t)), "{}", profile.name());
            assert!(profile.max_rate_k_per_s() <= CHAMBER.rate_k_per_s * (1.0 + 1e-12));
            assert!((profile.duration_s() - CHAMBER.duration_s).abs() <= 1.0);
        }
    }

    #[test]
    fn the_largest_rate_of_a_ramp_is_found_through_its_noise() {
        let times_s: Vec<f64> = (0..400).map(|i| 10.0 * f64::from(i)).collect();
        let temperature_k =
            times_s.iter().enumerate().map(|(i, t)| 300.0 + 0.02 * t + 0.004 * (i % 2) as f64).collect();
        let record = Record::new("x", times_s, temperature_k, vec![0.0; 400]).unwrap();
        let chamber = Chamber::of(&[&record]).unwrap();
        assert!((chamber.rate_k_per_s / 0.02 - 1.0).abs() < 0.01);
        assert_eq!(chamber.coldest_k, REFERENCE_TEMPERATURE_K);
    }
}
