//! What a chamber can do, and the profiles that it is asked for.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::profile::{Piece, Profile};
use crate::record::Record;
use crate::units::REFERENCE_TEMPERATURE_K;

/// What the records show the chamber to be capable of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ChamberCapability {
    pub(crate) coldest_k: f64,
    pub(crate) warmest_k: f64,
    pub(crate) rate_k_per_s: f64,
    pub(crate) duration_s: f64,
    pub(crate) interval_s: f64,
}

/// A profile begins with a soak of this length, or this share of its duration.
const START_S: f64 = 600.0;
const START_SHARE: f64 = 0.1;
/// Over this time a rate of the chamber is told from noise.
const RATE_WINDOW_S: f64 = 300.0;
/// No leg is shorter than the time over which the chamber's rate was seen, and there are no more than can be found again in
/// a record.
const SHORTEST_LEG_S: f64 = RATE_WINDOW_S;
const MOST_LEGS: usize = 60;
/// Where in the chamber's range swings are tried.
const MIDDLES: [(&str, f64); 3] = [("middle", 0.5), ("cold", 0.0), ("warm", 1.0)];
const SAMPLED: usize = 40;
/// Legs of the swings that are tried.
const SWINGS_S: [f64; 5] = [300.0, 450.0, 700.0, 1100.0, 1800.0];

impl ChamberCapability {
    /// None where the records hold no change of temperature.
    pub(crate) fn of(records: &[&Record]) -> Option<Self> {
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

/// A ramp to a temperature and a soak there.
#[derive(Debug, Clone, Copy)]
struct Leg {
    to_k: f64,
    /// Of the chamber's largest.
    rate_share: f64,
    /// Of the chamber's duration.
    soak_share: f64,
}

pub(super) fn profiles(chamber: &ChamberCapability, seed: u64) -> Vec<Profile> {
    let (cold, warm) = (chamber.coldest_k, chamber.warmest_k);
    let leg = |to_k: f64, rate_share: f64, soak_share: f64| Leg { to_k, rate_share, soak_share };
    let between = |share: f64| cold + share * (warm - cold);
    let shortest_leg_s = SHORTEST_LEG_S.max(chamber.duration_s / MOST_LEGS as f64);
    let mut named: Vec<(String, Vec<Leg>)> = vec![
        ("ramp-and-soak".to_owned(), vec![leg(warm, 1.0, 1.0)]),
        ("up-and-down".to_owned(), vec![leg(warm, 1.0, 0.2), leg(cold, 1.0, 0.2), leg(between(0.5), 1.0, 0.2)]),
        ("triangles".to_owned(), [warm, cold].repeat(6).into_iter().map(|t| leg(t, 1.0, 0.0)).collect()),
        (
            "slow-up-fast-down".to_owned(),
            [(warm, 0.2), (cold, 1.0)].repeat(3).into_iter().map(|(t, r)| leg(t, r, 0.05)).collect(),
        ),
        ("staircase".to_owned(), [0.25, 0.5, 0.75, 1.0, 0.0].map(|s| leg(between(s), 1.0, 0.12)).into()),
    ];
    for (name, middle) in MIDDLES {
        for leg_s in SWINGS_S.map(|s| s.max(shortest_leg_s)) {
            let swing = (leg_s * chamber.rate_k_per_s / (warm - cold)).min(1.0);
            let low = (middle - 0.5 * swing).clamp(0.0, 1.0 - swing);
            let legs = [low + swing, low].repeat(MOST_LEGS).into_iter().map(|s| leg(between(s), 1.0, 0.0)).collect();
            named.push((format!("{name}-swings-of-{leg_s:.0}-s"), legs));
        }
    }
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    for i in 0..SAMPLED {
        // Lengths from the shortest to half of the duration, evenly by their logarithm.
        let longest = (0.5 * chamber.duration_s / shortest_leg_s).max(1.0);
        let scale_s = shortest_leg_s * longest.powf(random.random::<f64>());
        let mut at = random.random::<f64>();
        let mut upwards = random.random::<f64>() < 0.5;
        let mut legs = vec![leg(between(at), 1.0, 0.0)];
        let mut spent_s = 0.0;
        while spent_s < chamber.duration_s && legs.len() < MOST_LEGS {
            let leg_s = (scale_s * (0.5 + random.random::<f64>())).max(shortest_leg_s);
            let share = if random.random::<f64>() < 0.6 { 1.0 } else { 0.2 + 0.8 * random.random::<f64>() };
            let soak_s = if random.random::<f64>() < 0.25 { leg_s } else { 0.0 };
            let swing = share * leg_s * chamber.rate_k_per_s / (warm - cold);
            at = if upwards { at + swing } else { at - swing }.clamp(0.0, 1.0);
            legs.push(leg(between(at), share, soak_s / chamber.duration_s));
            upwards = if random.random::<f64>() < 0.85 { !upwards } else { upwards };
            spent_s += leg_s + soak_s;
        }
        named.push((format!("sampled-{}", i + 1), legs));
    }
    named.into_iter().filter_map(|(name, legs)| profile_of(&name, &legs, chamber)).collect()
}

/// A record that begins at rest says what rest is; then the legs as far as the duration goes; a last soak fills it.
fn profile_of(name: &str, legs: &[Leg], chamber: &ChamberCapability) -> Option<Profile> {
    let (mut at_k, mut left_s) = (REFERENCE_TEMPERATURE_K, chamber.duration_s);
    let mut pieces: Vec<Piece> = Vec::new();
    let mut add = |rate_k_per_s: f64, wanted_s: f64| {
        // Whole seconds, which an operator can set.
        let duration_s = wanted_s.min(left_s).floor();
        if duration_s >= 1.0 {
            left_s -= duration_s;
            match pieces.last_mut().filter(|last| last.rate_k_per_s == rate_k_per_s) {
                Some(last) => last.duration_s += duration_s,
                None => pieces.push(Piece { rate_k_per_s, duration_s }),
            }
        }
        duration_s.max(0.0)
    };
    add(0.0, START_S.min(START_SHARE * chamber.duration_s));
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

    const CHAMBER: ChamberCapability = ChamberCapability {
        coldest_k: 253.0,
        warmest_k: 333.0,
        rate_k_per_s: 1.0 / 60.0,
        duration_s: 20_000.0,
        interval_s: 10.0,
    };

    #[test]
    fn every_profile_stays_within_what_the_chamber_can_do() {
        let profiles = profiles(&CHAMBER, 3);
        assert_eq!(profiles.len(), 60);
        for profile in &profiles {
            let course = profile.temperature(REFERENCE_TEMPERATURE_K);
            assert!(course.values().iter().all(|t| (252.9..=333.1).contains(t)), "{}", profile.name());
            let (first, last) = (profile.pieces()[0], profile.pieces().len() - 1);
            assert!(first.rate_k_per_s == 0.0 && first.duration_s >= 600.0 && last <= 2 * MOST_LEGS);
            assert!(profile.pieces().windows(2).all(|w| w[0].rate_k_per_s != w[1].rate_k_per_s));
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
        let chamber = ChamberCapability::of(&[&record]).unwrap();
        assert!((chamber.rate_k_per_s / 0.02 - 1.0).abs() < 0.01);
        assert_eq!(chamber.coldest_k, REFERENCE_TEMPERATURE_K);
    }
}
