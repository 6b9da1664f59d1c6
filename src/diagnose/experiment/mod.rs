//! Which profile would tell candidates apart, and how surely.
//!
//! ```text
//! profile = argmax over profiles of  min over (i, j)  χ²_ij − χ²_needed,ij
//! ```
//!
//! χ²_ij is by how much j is expected to be refused if i is true, after everything that is free in j is fitted again to the
//! experiment and the records at hand together (`plan`). What is needed is what the diagnosis itself asks for before it
//! calls two candidates different. What is found differs from what is expected by chance:
//!
//! ```text
//! χ²_found ~ N(χ²_ij, (2 √χ²_experiment)²)
//! ```
//!
//! The profiles are a few that a chamber operator would think of and sampled ones, all within the temperatures, the rate
//! and the duration that the records show the chamber to be capable of. They are courses of the chamber's air; the pack
//! follows through the film that the records showed.
//!
//! Leaves out: further columns, which count as zero; what is wrong with all candidates. The course of the air is not known
//! beforehand: every candidate makes its own of what the sensor and the gyro would show, behind a film of its own.
//!
//! # Source
//! Hunter and Reiner, Technometrics 7 (1965) 307, and Box and Hill, ibid. 9 (1967) 57: the experiment at which rival models
//! differ most, and what refitting takes of that.

mod alternatives;
mod chamber;
mod plan;

use statrs::distribution::{ContinuousCDF, Normal};

use crate::chamber::Refit;
use crate::numeric::order::sort_descending;
use crate::parallel::InParallel;
use crate::profile::Profile;
use crate::units::REFERENCE_TEMPERATURE_K;
use chamber::profiles;
use plan::{Difference, ExperimentPlan};

pub(crate) use alternatives::ModelComparison;
pub(crate) use chamber::ChamberCapability;
pub(crate) use plan::ExpectedRefusal;

#[cfg(test)]
pub(super) use alternatives::tests as fixtures;

/// Candidates that differ by less than this share of what they explain explain it equally well: no effect's equation is
/// more accurate than that.
const EQUAL_SHARE: f64 = 0.01;
/// Candidates whose χ² differ by less explain the records equally well (odds of 400 at best).
const EQUAL: f64 = 12.0;

/// A profile, and how surely it tells the candidates apart.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Experiment {
    pub(crate) profile: Profile,
    /// The candidates' names, and the experiments of another kind that would isolate what they add.
    pub(crate) alternatives: Vec<(String, Vec<&'static str>)>,
    pub(crate) separations: Vec<Separation>,
    /// Profiles that it was chosen from.
    pub(crate) tried: usize,
}

/// Two candidates under a profile.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Separation {
    pub(crate) first: usize,
    pub(crate) second: usize,
    /// Root mean square of the difference of their predictions, the mean taken out, nothing fitted again.
    pub(crate) rms_rad_per_s: f64,
    /// If the first is true and if the second is; one where the first is a special case of the second.
    pub(crate) outcomes: Vec<ExpectedOutcome>,
    /// Whether some profile was found that tells the two apart, be it not the one that was chosen.
    pub(crate) possible: bool,
}

/// What is expected if one candidate is true.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ExpectedOutcome {
    pub(crate) refusal: ExpectedRefusal,
    pub(crate) needed_alone: f64,
    pub(crate) needed_with_records: f64,
    /// That what is found with the records exceeds what is needed.
    pub(crate) chance: f64,
    /// Repetitions of the profile after which the chance is at least [`SURE`]; None if more than [`MOST_RUNS`].
    pub(crate) runs: Option<usize>,
}

/// What can be said of a pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Promise {
    ToldApart,
    Perhaps,
    NotToldApart,
}

/// From this chance on candidates count as told apart, and below one less this as not.
pub(crate) const SURE: f64 = 0.9;
pub(crate) const MOST_RUNS: usize = 10;
const MOST_ROWS: f64 = 1500.0;
/// Profiles that are the best to first order and are judged in full.
const JUDGED_IN_FULL: usize = 3;

impl Separation {
    /// The less sure of the outcomes.
    pub(crate) fn least(&self) -> Option<&ExpectedOutcome> {
        self.outcomes.iter().min_by(|a, b| a.chance.total_cmp(&b.chance).then(a.margin().total_cmp(&b.margin())))
    }

    pub(crate) fn promise(&self) -> Promise {
        match self.least() {
            Some(least) if least.chance >= SURE => Promise::ToldApart,
            Some(least) if least.chance > 1.0 - SURE => Promise::Perhaps,
            _ => Promise::NotToldApart,
        }
    }
}

impl ExpectedOutcome {
    fn new(refusal: ExpectedRefusal, variance: f64) -> Self {
        let needed = |explained: f64| (EQUAL * variance).max(EQUAL_SHARE.powi(2) * explained);
        let needed_with_records = needed(refusal.explained_alone + refusal.explained_of_records);
        let chance = |runs: usize| {
            let found = (runs as f64 * refusal.chi_square_alone)
                .max(refusal.chi_square_with_records - refusal.chi_square_of_records);
            let needed = needed(runs as f64 * refusal.explained_alone + refusal.explained_of_records);
            chance_of_more(found, needed - refusal.chi_square_of_records, variance)
        };
        Self {
            refusal,
            needed_alone: needed(refusal.explained_alone),
            needed_with_records,
            chance: chance(1),
            runs: (1..=MOST_RUNS).find(|&runs| chance(runs) >= SURE),
        }
    }

    fn margin(&self) -> f64 {
        self.refusal.chi_square_with_records - self.needed_with_records
    }
}

/// That a χ² of `expected` is found to be more than `needed`: what the noise adds to it has twice its root as deviation.
fn chance_of_more(expected: f64, needed: f64, variance: f64) -> f64 {
    let deviation = 2.0 * (expected.max(0.0) * variance).sqrt();
    match Normal::new(expected, deviation.max(f64::MIN_POSITIVE)) {
        Ok(normal) => 1.0 - normal.cdf(needed),
        Err(_) => f64::from(expected > needed),
    }
}

/// What was judged under one profile.
struct Judged {
    profile: usize,
    outcomes: Vec<ExpectedOutcome>,
    differences: Vec<Difference>,
}

/// The profile that tells the candidates apart most surely; None where there is nothing to tell apart, and where no profile
/// can be solved for all of them.
pub(crate) fn design(comparison: &ModelComparison, chamber: &ChamberCapability, seed: u64) -> Option<Experiment> {
    if comparison.alternatives.len() < 2 {
        return None;
    }
    let profiles = profiles(chamber, seed);
    let judge = |profile: usize, refit: Refit| -> Option<Judged> {
        let step_s = chamber.interval_s.max(profiles[profile].duration_s() / MOST_ROWS);
        let plan = ExperimentPlan::new(comparison, &profiles[profile], REFERENCE_TEMPERATURE_K, step_s);
        let foreseen = plan.judge(refit)?;
        let outcomes = foreseen.refusals.into_iter().map(|r| ExpectedOutcome::new(r, comparison.variance)).collect();
        Some(Judged { profile, outcomes, differences: foreseen.differences })
    };
    let mut screened: Vec<Judged> = (0..profiles.len()).in_parallel().filter_map(|p| judge(p, Refit::Linear)).collect();
    let outcomes = screened.first()?.outcomes.len();
    let best = |outcome: usize| screened.iter().map(|j| j.outcomes[outcome].margin()).fold(f64::NEG_INFINITY, f64::max);
    let possible: Vec<bool> = (0..outcomes).map(|outcome| best(outcome) > 0.0).collect();
    // What no profile can do is no reason to leave undone what one can.
    let wanted: Vec<usize> = (0..outcomes).filter(|&o| possible[o] || !possible.contains(&true)).collect();
    let hopeless = !possible.contains(&true);
    let merit = |judged: &Judged| {
        let merit = |&outcome: &usize| {
            let outcome = &judged.outcomes[outcome];
            if hopeless { outcome.refusal.chi_square_alone } else { outcome.margin() }
        };
        wanted.iter().map(merit).fold(f64::INFINITY, f64::min)
    };
    // The first of equals stays.
    sort_descending(&mut screened, merit);
    let foremost: Vec<usize> = screened.iter().take(JUDGED_IN_FULL).map(|j| j.profile).collect();
    let in_full: Vec<Judged> = foremost.in_parallel().filter_map(|p| judge(p, Refit::Full)).collect();
    let chosen = in_full.into_iter().reduce(|best, next| if merit(&next) > merit(&best) { next } else { best })?;
    let separations = chosen
        .differences
        .iter()
        .map(|&Difference { first, second, rms_rad_per_s }| {
            let of_pair = |o: &ExpectedOutcome| {
                [o.refusal.truth, o.refusal.refused] == [first, second]
                    || [o.refusal.refused, o.refusal.truth] == [first, second]
            };
            let places: Vec<usize> = (0..outcomes).filter(|&o| of_pair(&chosen.outcomes[o])).collect();
            Separation {
                first,
                second,
                rms_rad_per_s,
                possible: places.iter().all(|&o| possible[o]),
                outcomes: places.into_iter().map(|o| chosen.outcomes[o]).collect(),
            }
        })
        .collect();
    let alternatives = comparison.alternatives.iter().map(|r| (r.name.clone(), r.isolating())).collect();
    Some(Experiment { profile: profiles[chosen.profile].clone(), alternatives, separations, tried: profiles.len() })
}

#[cfg(test)]
mod tests {
    use super::alternatives::FittedAlternative;
    use super::alternatives::tests::{alternative, comparison, effect, model};
    use super::*;

    const CHAMBER: ChamberCapability = ChamberCapability {
        coldest_k: 253.0,
        warmest_k: 333.0,
        rate_k_per_s: 0.025,
        duration_s: 5000.0,
        interval_s: 10.0,
    };

    fn mismatch() -> FittedAlternative {
        alternative("mismatch", model(vec![effect("strain_mismatch", &[0.008])]))
    }

    #[test]
    #[ignore = "long: --include-ignored"]
    fn rivals_that_are_the_same_but_for_their_size_are_told_apart_by_no_profile_and_by_no_number_of_runs() {
        let larger = alternative("larger", model(vec![effect("strain_mismatch", &[0.012])]));
        let found = design(&comparison(vec![mismatch(), larger]), &CHAMBER, 1).unwrap();
        let pair = &found.separations[0];
        println!("{pair:?}");
        assert!(pair.rms_rad_per_s > 1e-8 && !pair.possible && pair.promise() == Promise::NotToldApart);
        assert!(pair.outcomes.iter().all(|o| o.refusal.chi_square_alone.abs() < 0.1 && o.runs.is_none()));
        assert_eq!(found.alternatives[1].1, vec![effect("strain_mismatch", &[0.0]).spec().experiment]);
    }

    #[test]
    #[ignore = "long: --include-ignored"]
    fn a_profile_that_tells_rivals_apart_is_found_where_there_is_one() {
        let bias = alternative("bias", model(vec![effect("bias_temperature", &[5e-9, 0.0])]));
        let found = design(&comparison(vec![mismatch(), bias]), &CHAMBER, 1).unwrap();
        let pair = &found.separations[0];
        println!("{} {pair:?}", found.profile.name());
        assert!(pair.possible && pair.promise() == Promise::ToldApart);
        assert_eq!(pair.outcomes.len(), 2);
        assert!(pair.outcomes.iter().all(|o| o.runs == Some(1) && o.chance >= SURE));
    }

    #[test]
    fn the_chance_that_more_is_found_than_needed_is_half_where_just_that_is_expected() {
        assert!((chance_of_more(12.0, 12.0, 1.0) - 0.5).abs() < 1e-12);
        // Two deviations of 2 √36 above what is needed.
        assert!((chance_of_more(36.0, 12.0, 1.0) - 0.977_249_868).abs() < 1e-6);
        assert!(chance_of_more(0.0, 12.0, 1.0) < 1e-12 && chance_of_more(0.0, -1.0, 1.0) > 0.999);
    }
}
