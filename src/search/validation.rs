//! Patterns judged on profiles that no search has seen.
//!
//! A search makes use of whatever its profiles have in common by chance. What it found is judged here on sets of
//! profiles drawn with another seed, each as large as the searched one, so that what is left of a gain shows, and how
//! much it depends on the draw.

use super::cost::objective::Objective;
use super::cost::pointing::pointing_as_rate;
use super::cost::worst_case::{SearchError, SolvedProfiles, WorstCase};
use super::evaluator::Evaluator;
use super::weighing::ratio_over;
use crate::pattern::Pattern;
use crate::profile::{Profile, ProfileSpec};

/// Sets that are drawn.
const SETS: usize = 8;

/// Profiles of a set: as many as were searched, within these.
const FEWEST_PROFILES: usize = 32;
const MOST_PROFILES: usize = 64;

/// From the searched profiles' seed to the unseen ones'.
const SEED_STEP: u64 = 1_000_003;

/// What profiles are drawn for, besides the search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Draw {
    /// To judge what was found: nothing was chosen by them.
    Validation,
    /// To search what is nowhere far behind.
    Rehearsal,
}

/// The best pattern and QUA on unseen profiles.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Validation {
    /// Unseen ones; the listed profiles count besides.
    pub(crate) profiles: usize,
    pub(crate) seed: u64,
    pub(crate) best_rad_per_s: f64,
    /// None where QUA does not fit the layer count.
    pub(crate) qua_rad_per_s: Option<f64>,
    /// None unless the search was for the pointing error.
    pub(crate) pointing: Option<UnseenPointing>,
}

/// The pointing errors of the best pattern and of QUA on the same profiles, as the rates that make them in one hour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct UnseenPointing {
    pub(crate) best_rad_per_s: f64,
    /// None where QUA does not fit the layer count.
    pub(crate) qua_rad_per_s: Option<f64>,
}

/// The worst rate of patterns, or their worst pointing error, on each set of unseen profiles and the listed ones.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Unseen {
    pub(crate) profiles: usize,
    pub(crate) seed: u64,
    /// # Shapes
    /// Patterns × sets.
    worst_rad_per_s: Vec<Vec<f64>>,
}

impl Unseen {
    /// The worst rate of a pattern over all sets.
    pub(crate) fn worst_rad_per_s(&self, pattern: usize) -> f64 {
        self.worst_rad_per_s[pattern].iter().copied().fold(0.0, f64::max)
    }

    /// The largest worst rate of a pattern over that of the best of others on the same set; what exceeds that by no more
    /// than `same_rad_per_s` is the same.
    pub(crate) fn largest_ratio(&self, pattern: usize, others: &[usize], same_rad_per_s: f64) -> Option<f64> {
        let sets = 0..self.worst_rad_per_s[pattern].len();
        let ratio = |set: usize| {
            let least = others.iter().map(|&o| self.worst_rad_per_s[o][set]).reduce(f64::min)?;
            Some(ratio_over(self.worst_rad_per_s[pattern][set], least, same_rad_per_s).unwrap_or(f64::INFINITY))
        };
        sets.filter_map(ratio).reduce(f64::max)
    }
}

impl Evaluator<'_> {
    /// Sets of profiles as the model's own, drawn with another seed.
    pub(super) fn drawn_spec(&self, sets: usize, draw: Draw) -> ProfileSpec {
        let of_set = self.profiles.count.clamp(FEWEST_PROFILES, MOST_PROFILES);
        let steps = match draw {
            Draw::Validation => 1,
            Draw::Rehearsal => 2,
        };
        // Seeds stay numbers that JSON can hold.
        let seed = (self.profiles.seed % (1 << 52)) + steps * SEED_STEP;
        ProfileSpec { count: sets * of_set, seed, ..self.profiles.clone() }
    }

    /// The worst rates, and where the pointing error is the objective those.
    ///
    /// # Errors
    /// None that a model which could be solved would cause.
    pub(crate) fn unseen(&self, patterns: &[Pattern]) -> Result<(Unseen, Option<Unseen>), SearchError> {
        let spec = self.drawn_spec(SETS, Draw::Validation);
        let profiles = spec.profiles();
        let (listed, drawn) = profiles.split_at(spec.listed.len());
        let is_for_pointing = self.objective == Objective::Pointing;
        // Of each pattern the rate, and the pointing error where that is asked for.
        let worst_of = |profiles: &[Profile]| -> Result<Vec<[f64; 2]>, SearchError> {
            if profiles.is_empty() {
                return Ok(vec![[0.0; 2]; patterns.len()]);
            }
            let solved = SolvedProfiles::new(self.model, profiles)?;
            let worst = |(pattern, worst): (&Pattern, WorstCase)| {
                let pointing = is_for_pointing.then(|| pointing_as_rate(self.model, &solved, pattern)).transpose()?;
                Ok([worst.rate_rad_per_s.abs(), pointing.map_or(0.0, |worst| worst.rate_rad_per_s.abs())])
            };
            patterns.iter().zip(solved.worst_cases(self.model, patterns)?).map(worst).collect()
        };
        let on_listed = worst_of(listed)?;
        let sets: Vec<Vec<[f64; 2]>> = drawn.chunks(drawn.len() / SETS).map(worst_of).collect::<Result<_, _>>()?;
        let of = |figure: usize| Unseen {
            profiles: spec.count,
            seed: spec.seed,
            worst_rad_per_s: (0..patterns.len())
                .map(|p| sets.iter().map(|set| set[p][figure].max(on_listed[p][figure])).collect())
                .collect(),
        };
        Ok((of(0), is_for_pointing.then(|| of(1))))
    }
}
