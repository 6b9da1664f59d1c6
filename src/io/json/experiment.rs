//! The next experiment as `diagnose` says it: the profile, and what is to be expected of it.

use serde::{Deserialize, Serialize};

use crate::diagnose::experiment::{ExpectedOutcome, Experiment, MOST_RUNS, Promise, Separation};
use crate::units::{c_per_h_from_k_per_s, deg_per_h_from_rad_per_s, h_from_s, percent_from_fraction};

/// A profile of the chamber's air, and how surely it tells the candidates apart.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct ExperimentJson {
    pub(crate) profile: String,
    pub(crate) pieces: Vec<PieceJson>,
    pub(crate) duration_s: f64,
    /// How many profiles it was chosen from.
    pub(crate) profiles_tried: usize,
    pub(crate) separations: Vec<SeparationJson>,
    pub(crate) statement: String,
    /// What is to be expected of each pair, in words.
    pub(crate) expectations: Vec<String>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct PieceJson {
    pub(crate) rate_c_per_h: f64,
    pub(crate) duration_s: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct SeparationJson {
    pub(crate) first: String,
    pub(crate) second: String,
    /// Root mean square of the difference of the two predictions as fitted to the records, their offsets taken out.
    pub(crate) rms_deg_per_h: f64,
    pub(crate) multiple_of_noise: f64,
    /// By how much χ² one is expected to be refused if the other is true, after it is fitted again: to the experiment alone,
    /// and to the records at hand too; the less of the two directions.
    pub(crate) expected_chi_square_alone: f64,
    pub(crate) expected_chi_square_with_records: f64,
    /// `yes`, `perhaps` or `no`.
    pub(crate) told_apart: String,
    /// Whether a profile was found that tells the two apart, be it another one.
    pub(crate) possible: bool,
    /// Runs of the profile after which they are told apart; null if more than ten.
    pub(crate) runs_needed: Option<usize>,
    pub(crate) directions: Vec<DirectionJson>,
}

/// What is expected if one of two candidates is true.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct DirectionJson {
    pub(crate) truth: String,
    pub(crate) refused: String,
    pub(crate) expected_chi_square_alone: f64,
    /// Of which the records have said `chi_square_of_records` already.
    pub(crate) expected_chi_square_with_records: f64,
    pub(crate) chi_square_of_records: f64,
    /// From which on a diagnosis calls the two different.
    pub(crate) needed_chi_square_alone: f64,
    pub(crate) needed_chi_square_with_records: f64,
    /// That what is found with the records is more than needed.
    pub(crate) chance: f64,
}

impl ExperimentJson {
    pub(super) fn new(experiment: &Experiment, noise_rad_per_s: f64) -> Self {
        let profile = &experiment.profile;
        let name = |alternative: usize| experiment.alternatives[alternative].0.clone();
        let separations: Vec<SeparationJson> =
            experiment.separations.iter().map(|s| SeparationJson::new(s, name, noise_rad_per_s)).collect();
        let pairs = experiment.separations.iter().zip(&separations);
        let apart: Vec<String> = separations
            .iter()
            .map(|s| {
                format!(
                    "{} and {} would be {:.4} °/h rms apart, {:.2} times the noise of one row",
                    s.first, s.second, s.rms_deg_per_h, s.multiple_of_noise
                )
            })
            .collect();
        Self {
            profile: profile.name().to_owned(),
            pieces: profile
                .pieces()
                .iter()
                .map(|p| PieceJson { rate_c_per_h: c_per_h_from_k_per_s(p.rate_k_per_s), duration_s: p.duration_s })
                .collect(),
            duration_s: profile.duration_s(),
            profiles_tried: experiment.tried,
            statement: format!(
                "with the chamber's air on the profile {} ({} ramps and soaks from 20 °C, {:.1} h, at most {:.0} °C/h) {}",
                profile.name(),
                profile.pieces().len(),
                h_from_s(profile.duration_s()),
                c_per_h_from_k_per_s(profile.max_rate_k_per_s()),
                apart.join("; ")
            ),
            expectations: pairs.map(|(pair, shown)| expectation(experiment, pair, shown)).collect(),
            separations,
        }
    }
}

impl SeparationJson {
    fn new(separation: &Separation, name: impl Fn(usize) -> String, noise_rad_per_s: f64) -> Self {
        let least = |of: fn(&ExpectedOutcome) -> f64| separation.outcomes.iter().map(of).fold(f64::INFINITY, f64::min);
        Self {
            first: name(separation.first),
            second: name(separation.second),
            rms_deg_per_h: deg_per_h_from_rad_per_s(separation.rms_rad_per_s),
            multiple_of_noise: separation.rms_rad_per_s / noise_rad_per_s.max(f64::MIN_POSITIVE),
            expected_chi_square_alone: least(|o| o.refusal.chi_square_alone),
            expected_chi_square_with_records: least(|o| o.refusal.chi_square_with_records),
            told_apart: match separation.promise() {
                Promise::ToldApart => "yes",
                Promise::Perhaps => "perhaps",
                Promise::NotToldApart => "no",
            }
            .to_owned(),
            possible: separation.possible,
            runs_needed: separation.outcomes.iter().map(|o| o.runs).try_fold(1, |most, runs| Some(most.max(runs?))),
            directions: separation
                .outcomes
                .iter()
                .map(|outcome| DirectionJson {
                    truth: name(outcome.refusal.truth),
                    refused: name(outcome.refusal.refused),
                    expected_chi_square_alone: outcome.refusal.chi_square_alone,
                    expected_chi_square_with_records: outcome.refusal.chi_square_with_records,
                    chi_square_of_records: outcome.refusal.chi_square_of_records,
                    needed_chi_square_alone: outcome.needed_alone,
                    needed_chi_square_with_records: outcome.needed_with_records,
                    chance: outcome.chance,
                })
                .collect(),
        }
    }
}

/// What is to be expected of a pair.
fn expectation(experiment: &Experiment, pair: &Separation, shown: &SeparationJson) -> String {
    let Some(least) = pair.least() else { return String::new() };
    let (alone, together) = (number(least.refusal.chi_square_alone), number(least.refusal.chi_square_with_records));
    let needed = number(least.needed_with_records);
    let (first, second) = (&shown.first, &shown.second);
    let size = format!("a χ² of {alone} alone and of {together} with the records, {needed} needed");
    let runs = match shown.runs_needed {
        Some(runs) if runs > 1 => format!("; {runs} runs of this profile should do"),
        Some(_) => String::new(),
        None => format!("; nor would {MOST_RUNS} runs of this profile"),
    };
    let otherwise = || {
        let isolating = [pair.first, pair.second].map(|alternative| &experiment.alternatives[alternative]);
        let ways = isolating.iter().filter(|(_, ways)| !ways.is_empty());
        ways.map(|(name, ways)| format!("for {name}: {}", ways.join("; "))).collect::<Vec<_>>().join("; ")
    };
    match pair.promise() {
        Promise::ToldApart => format!("{first} and {second} would be told apart ({size})"),
        Promise::Perhaps => {
            let percent = percent_from_fraction(least.chance);
            format!("{first} and {second} may be told apart, with a chance of {percent:.0} % ({size}){runs}")
        }
        Promise::NotToldApart if pair.possible || shown.runs_needed.is_some() => {
            format!("{first} and {second} would not be told apart by one run ({size}){runs}")
        }
        Promise::NotToldApart => format!(
            "none of the {} profiles tried that this chamber can do tells {first} from {second} ({size}){runs}: use another experiment: {}",
            experiment.tried,
            otherwise()
        ),
    }
}

fn number(chi_square: f64) -> String {
    // Rounding, and what a boundary made of readings leaves, may be below zero.
    let chi_square = chi_square.max(0.0);
    if chi_square < 10.0 { format!("{chi_square:.1}") } else { format!("{chi_square:.0}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::experiment::ExpectedRefusal;
    use crate::profile::{Piece, Profile};

    /// Two alternatives, each refused by as much if the other is true.
    fn shown(chi_square: f64, chance: f64, runs: Option<usize>, possible: bool) -> ExperimentJson {
        let outcome = |truth: usize, refused: usize| ExpectedOutcome {
            refusal: ExpectedRefusal {
                truth,
                refused,
                chi_square_alone: chi_square,
                chi_square_with_records: chi_square + 2.0,
                chi_square_of_records: 2.0,
                explained_alone: 0.0,
                explained_of_records: 0.0,
            },
            needed_alone: 12.0,
            needed_with_records: 12.0,
            chance,
            runs,
        };
        let outcomes = vec![outcome(0, 1), outcome(1, 0)];
        let profile = Profile::new("p", vec![Piece { rate_k_per_s: 0.01, duration_s: 3600.0 }]).unwrap();
        let alternatives = vec![("lead".to_owned(), vec!["heat it"]), ("bias".to_owned(), vec!["flip the coil"])];
        let separations = vec![Separation { first: 0, second: 1, rms_rad_per_s: 1e-8, outcomes, possible }];
        ExperimentJson::new(&Experiment { profile, alternatives, separations, tried: 60 }, 2e-8)
    }

    #[test]
    fn what_no_profile_can_do_is_said_and_the_experiments_that_can_are_named() {
        let found = shown(0.4, 0.0, None, false);
        assert_eq!(
            found.expectations[0],
            "none of the 60 profiles tried that this chamber can do tells lead from bias (a χ² of 0.4 alone and of 2.4 with the records, 12 needed); nor would 10 runs of this profile: use another experiment: for lead: heat it; for bias: flip the coil"
        );
        let pair = &found.separations[0];
        assert_eq!((pair.told_apart.as_str(), pair.runs_needed, pair.directions.len()), ("no", None, 2));
        assert_eq!((pair.expected_chi_square_alone, pair.expected_chi_square_with_records), (0.4, 2.4));
    }

    #[test]
    fn what_several_runs_can_do_is_not_called_impossible() {
        let found = shown(6.0, 0.04, Some(4), false);
        assert!(found.expectations[0].ends_with("; 4 runs of this profile should do"), "{}", found.expectations[0]);
        let found = shown(14.0, 0.6, Some(3), true);
        assert!(found.expectations[0].starts_with("lead and bias may be told apart, with a chance of 60 %"));
        assert_eq!(found.separations[0].told_apart, "perhaps");
        let found = shown(90.0, 0.999, Some(1), true);
        assert_eq!((found.separations[0].told_apart.as_str(), found.separations[0].runs_needed), ("yes", Some(1)));
    }
}
