//! How good patterns are where the model itself is not known for certain.
//!
//! ```text
//! E(P) = mean_k W_k(P),   P95(P) = 95 % quantile of W_k(P),   W_k: worst rate under the model k
//! ```
//!
//! The models are drawn by whoever knows how certain what is (a diagnosis: every set of explanations by its posterior
//! probability, its parameters by their joint covariance). All patterns see the same models, so that what they have in
//! common cancels. W is the guaranteed worst rate where the model has one, else the worst over the profiles.
//!
//! # Source
//! Berger, Statistical Decision Theory (1985), section 1.3 (expected loss under a posterior).

use super::anneal::quantile::{QuantileCost, default_moves_per_restart};
use super::anneal::rounds::{DEFAULT_RESTARTS_PER_ROUND, Optimisation, Plan, Rounds, Rules};
use super::cost::guaranteed::{GuaranteedError, UnitStep};
use super::cost::sampled_coils::SampledCoils;
use super::cost::tolerance::SHARE;
use super::cost::worst_case::{SearchError, SolvedProfiles};
use super::evaluator::{Evaluator, JudgeError};
use crate::numeric::statistics::quantile;
use crate::parallel::InParallel;
use crate::pattern::Pattern;
use crate::pattern::windability::WindabilityClass;
use crate::profile::ProfileSpec;
use crate::rate::CoilModel;

/// Rounds of the search for the pattern that is best over all models, and patterns of it that are handed on.
const ROUNDS: u64 = 2;
const HANDED_ON: usize = 3;

/// A pattern's worst rate over the models that may be the true one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Prospect {
    pub(crate) expected_rad_per_s: f64,
    pub(crate) p95_rad_per_s: f64,
}

/// How many times smaller the new pattern's error is than the old one's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Gain {
    /// Under the model as it is.
    pub(crate) value: f64,
    /// 5 and 95 % of the drawn models lie below.
    pub(crate) low: f64,
    pub(crate) high: f64,
}

/// What patterns promise where the model is not known for certain.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Outlook {
    /// Models that may be the true one.
    pub(crate) models: usize,
    /// By their names; the best first.
    pub(crate) prospects: Vec<(String, Prospect)>,
    /// Of the recommended pattern over the former one, or over QUA where there is none.
    pub(crate) gain: Option<Gain>,
}

/// The worst rate of each pattern under a model: guaranteed where it has that, else over the profiles.
///
/// # Errors
/// A model that cannot be solved.
pub(crate) fn worst_rates_rad_per_s(
    model: &CoilModel,
    profiles: &ProfileSpec,
    patterns: &[Pattern],
) -> Result<Vec<f64>, SearchError> {
    let bounds = UnitStep::new(model, profiles.max_rate_k_per_s).and_then(|step| {
        let bound = |pattern: &Pattern| Ok(step.guaranteed(model, pattern)?.rate_rad_per_s);
        patterns.iter().map(bound).collect::<Result<Vec<f64>, GuaranteedError>>()
    });
    match bounds {
        Ok(bounds) => Ok(bounds),
        Err(GuaranteedError::Search(error)) => Err(error),
        Err(GuaranteedError::Effect { .. }) => {
            let solved = SolvedProfiles::new(model, &profiles.profiles())?;
            Ok(solved.worst_cases(model, patterns)?.iter().map(|worst| worst.rate_rad_per_s.abs()).collect())
        }
    }
}

/// # Shapes
/// Models × patterns.
fn under_each(
    models: &[CoilModel],
    profiles: &ProfileSpec,
    patterns: &[Pattern],
) -> Result<Vec<Vec<f64>>, SearchError> {
    models.iter().in_parallel().map(|model| worst_rates_rad_per_s(model, profiles, patterns)).collect()
}

/// What patterns promise over models that may be the true one; empty without models.
///
/// # Errors
/// Models that cannot be solved.
pub(crate) fn prospects(
    models: &[CoilModel],
    profiles: &ProfileSpec,
    patterns: &[Pattern],
) -> Result<Vec<Prospect>, SearchError> {
    if models.is_empty() {
        return Ok(Vec::new());
    }
    let worst = under_each(models, profiles, patterns)?;
    let of = |p: usize| {
        let mut ascending: Vec<f64> = worst.iter().map(|model| model[p]).collect();
        ascending.sort_by(f64::total_cmp);
        Prospect {
            expected_rad_per_s: ascending.iter().sum::<f64>() / ascending.len() as f64,
            p95_rad_per_s: quantile(&ascending, SHARE),
        }
    };
    Ok((0..patterns.len()).map(of).collect())
}

/// What one pattern gains over another under the model, and the spread over drawn ones.
///
/// # Errors
/// Models that cannot be solved.
pub(crate) fn predicted_gain(
    model: &CoilModel,
    drawn: &[CoilModel],
    profiles: &ProfileSpec,
    old: &Pattern,
    new: &Pattern,
) -> Result<Gain, SearchError> {
    let pair = [old.clone(), new.clone()];
    let ratio = |costs: &Vec<f64>| if costs[0] == costs[1] { 1.0 } else { costs[0] / costs[1] };
    let value = ratio(&worst_rates_rad_per_s(model, profiles, &pair)?);
    let mut gains: Vec<f64> = under_each(drawn, profiles, &pair)?.iter().map(ratio).collect();
    if gains.is_empty() {
        return Ok(Gain { value, low: value, high: value });
    }
    gains.sort_by(f64::total_cmp);
    Ok(Gain { value, low: quantile(&gains, 1.0 - SHARE).min(value), high: quantile(&gains, SHARE).max(value) })
}

impl Evaluator<'_> {
    /// Patterns with a small 95 % quantile over models that may be the true one; best first.
    ///
    /// # Errors
    /// Models that cannot be solved.
    pub(super) fn hedged(
        &self,
        class: WindabilityClass,
        models: &[CoilModel],
        starts: &[Pattern],
        seed: u64,
    ) -> Result<Vec<Pattern>, JudgeError> {
        if models.is_empty() {
            return Ok(Vec::new());
        }
        let coils = SampledCoils::of_models(models, self.profiles, starts)?;
        let admitted = starts.iter().filter(|p| class.admits(p));
        let plan = Plan {
            seed,
            restarts_per_round: DEFAULT_RESTARTS_PER_ROUND,
            moves_per_restart: default_moves_per_restart(self.model.coil.layers()),
            rules: Rules { rounds: ROUNDS, patience: ROUNDS, moves: None, target: None },
            starts: admitted.map(|p| p.segments().to_vec()).collect(),
        };
        let mut search = Optimisation::new(QuantileCost::new(coils, class), plan);
        while search.advance() {}
        let found = search.state().found.iter().take(HANDED_ON);
        Ok(found.filter_map(|f| Pattern::new(f.segments.clone()).ok()).collect())
    }
}
