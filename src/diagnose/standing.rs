//! Whether a declared model is adequate: one definition for every command.
//!
//! ```text
//! adequate ⇔ p(declared model | records) ≥ 0.95, and |ln σ/σ_declared| ≤ 2 se(ln σ) where a white noise is declared
//! ```
//!
//! p is the declared model's share of the posterior mass ([`super::joint`]). A diagnosis has it from its search over sets; a
//! comparison from that search's first round: the effects for which the score test promises more than they cost, as they are
//! fitted, and wander that nothing explains. What is better by less than 19 to 1 gives its mass to the declared model in both.

use super::candidate;
use super::joint::{self, Question};
use crate::chamber::{Chamber, ChamberError, Fit, Noise};
use crate::pattern::Pattern;
use crate::rate::CoilModel;
use crate::record::Record;

/// What the declared model must hold of the posterior mass.
pub(crate) const CERTAIN: f64 = 0.95;
/// Standard errors by which a white noise may differ from the declared one: 95 % of them.
const WITHIN_ERRORS: f64 = 2.0;

/// How a declared model stands beside everything else that may be.
#[derive(Debug, Clone)]
pub(crate) struct Standing {
    pub(crate) adequate: bool,
    /// What the effect that is worth most gains in log likelihood, where no wander shows already that something is missing. Which
    /// one that is takes a whole search.
    pub(crate) wanted: Option<f64>,
    /// Whether the rate wanders more than gyros do.
    pub(crate) wanders: bool,
    /// Of each fitted record.
    pub(crate) noise: Vec<Noise>,
}

/// The definition. `declared_white_rad_per_s`: white noise of one rate by the gyro's angle random walk, where it is declared.
pub(crate) fn is_adequate(probability: f64, noise: &[Noise], declared_white_rad_per_s: Option<f64>) -> bool {
    let white = declared_white_rad_per_s.is_none_or(|declared| {
        noise.iter().all(|n| {
            let relative = n.white_fit_error_rad_per_s / n.white_rad_per_s;
            !((n.white_rad_per_s / declared).ln().abs() > WITHIN_ERRORS * relative)
        })
    });
    probability >= CERTAIN && white
}

/// How the declared model stands, by a fit of it ([`Chamber::with_shocks`]) to records of a chamber and one with a wander beside it.
///
/// # Errors
/// A model that cannot be solved.
pub(crate) fn standing(
    model: &CoilModel,
    pattern: &Pattern,
    chamber: &Chamber,
    fit: &Fit,
    wandering: &Fit,
    declared_white_rad_per_s: Option<f64>,
) -> Result<Standing, ChamberError> {
    let records: Vec<&Record> = fit.records.iter().map(|&r| chamber.record(r)).collect();
    let candidates = candidate::candidates(model, &records);
    let fitted = fit.records.clone();
    let question =
        Question { chamber, model, pattern, candidates: &candidates, fitted, held_out: Vec::new(), depth: 1 };
    let beside = joint::beside(&question, fit, wandering)?;
    let most = beside.iter().map(|b| b.merit).fold(0.0, f64::max);
    let mass: f64 = beside.iter().map(|b| (b.merit - most).exp()).sum();
    let own = (-most).exp();
    let probability = own / (own + mass);
    let best = beside.iter().filter(|b| b.candidate.is_some()).max_by(|a, b| a.merit.total_cmp(&b.merit));
    let noise: Result<Vec<Noise>, _> = question.fitted.iter().map(|&r| chamber.noise(fit, r)).collect();
    let noise = noise?;
    Ok(Standing {
        adequate: is_adequate(probability, &noise, declared_white_rad_per_s),
        wanted: best.map(|b| b.gain),
        wanders: beside.iter().any(|b| b.candidate.is_none()),
        noise,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(white: f64, error: f64) -> Noise {
        Noise {
            white_rad_per_s: white,
            white_fit_error_rad_per_s: error,
            wander_rad_per_s: 0.0,
            unresolved_air_rad_per_s: 0.0,
            model_error_rad_per_s: 0.0,
            whiteness: 1.0,
            remedies: Vec::new(),
        }
    }

    #[test]
    fn both_the_mass_and_the_declared_noise_are_asked_for() {
        let own = [noise(1.0e-7, 3e-9)];
        assert!(is_adequate(0.96, &own, None) && !is_adequate(0.94, &own, None));
        assert!(is_adequate(0.96, &own, Some(1.05e-7)) && !is_adequate(0.96, &own, Some(1.2e-7)));
        assert!(!is_adequate(0.96, &own, Some(0.8e-7)));
    }
}
