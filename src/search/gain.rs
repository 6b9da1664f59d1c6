//! What one pattern gains over another where the model's parameters are known with errors.
//!
//! ```text
//! gain_k = cost_k(old) / cost_k(new)   in each of the models k drawn within the errors
//! ```
//!
//! The cost is the guaranteed worst rate where the models have one, else the worst over the profiles. Both patterns see
//! the same draws, so that what they have in common cancels.

use super::cost::guaranteed::UnitStep;
use super::cost::sampled_coils::quantile;
use super::cost::worst_case::{SearchError, SolvedProfiles};
use crate::pattern::Pattern;
use crate::profile::ProfileSpec;
use crate::rate::CoilModel;

/// How many times smaller the new pattern's error is than the old one's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gain {
    /// Under the model as it is.
    pub value: f64,
    /// 5 and 95 % of the drawn models lie below.
    pub low: f64,
    pub high: f64,
}

/// The worst rate of patterns under a model.
fn costs(model: &CoilModel, profiles: &ProfileSpec, patterns: &[&Pattern]) -> Result<Vec<f64>, SearchError> {
    let bounds: Option<Vec<f64>> = UnitStep::new(model, profiles.max_rate_k_per_s).ok().and_then(|step| {
        patterns.iter().map(|pattern| step.guaranteed(model, pattern).ok().map(|bound| bound.rate_rad_per_s)).collect()
    });
    if let Some(bounds) = bounds {
        return Ok(bounds);
    }
    let solved = SolvedProfiles::new(model, &profiles.profiles())?;
    patterns.iter().map(|pattern| Ok(solved.worst_case(model, pattern)?.rate_rad_per_s.abs())).collect()
}

/// The gain under the model, and its spread over drawn ones.
///
/// # Errors
/// Models that cannot be solved.
pub fn predicted_gain(
    model: &CoilModel,
    drawn: &[CoilModel],
    profiles: &ProfileSpec,
    old: &Pattern,
    new: &Pattern,
) -> Result<Gain, SearchError> {
    let of = |model: &CoilModel| -> Result<f64, SearchError> {
        let costs = costs(model, profiles, &[old, new])?;
        Ok(costs[0] / costs[1])
    };
    let value = of(model)?;
    let mut gains = drawn.iter().map(of).collect::<Result<Vec<f64>, SearchError>>()?;
    if gains.is_empty() {
        return Ok(Gain { value, low: value, high: value });
    }
    gains.sort_by(f64::total_cmp);
    Ok(Gain { value, low: quantile(&gains, 0.05).min(value), high: quantile(&gains, 0.95).max(value) })
}
