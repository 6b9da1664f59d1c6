//! Whether a declared model is adequate: one definition for every command.
//!
//! ```text
//! adequate ⇔ p(declared model | records) ≥ 0.95, and |ln σ/σ_declared| ≤ 2 se(ln σ) where a white noise is declared
//! ```
//!
//! p is the declared model's share of the posterior mass among itself, it with any one effect of the catalogue, a refitted
//! number, a step of the offset, and wander or a cycle that nothing explains ([`super::joint`]).

use super::joint::{self, Found, Question};
use super::{DiagnoseError, Share, answer, candidate};
use crate::chamber::{Assumption, Chamber, Fit, Noise};
use crate::pattern::Pattern;
use crate::rate::CoilModel;
use crate::record::Record;

/// What the declared model must hold of the posterior mass.
pub const CERTAIN: f64 = 0.95;
/// Standard errors by which a white noise may differ from the declared one: 95 % of them.
const WITHIN_ERRORS: f64 = 2.0;

/// How a declared model stands beside everything else that may be.
#[derive(Debug, Clone)]
pub struct Standing {
    pub adequate: bool,
    /// Of the declared model.
    pub probability: f64,
    /// Sets of explanations and what they hold, largest first.
    pub posterior: Vec<Share>,
    /// Of each fitted record.
    pub noise: Vec<Noise>,
}

/// The definition. `declared_white_rad_per_s`: white noise of one rate by the gyro's angle random walk, where it is declared.
pub fn is_adequate(probability: f64, noise: &[Noise], declared_white_rad_per_s: Option<f64>) -> bool {
    let white = declared_white_rad_per_s.is_none_or(|declared| {
        noise.iter().all(|n| {
            let relative = n.white_standard_error_rad_per_s / n.white_rad_per_s;
            !((n.white_rad_per_s / declared).ln().abs() > WITHIN_ERRORS * relative)
        })
    });
    probability >= CERTAIN && white
}

/// How the declared model stands, by a fit of it ([`Chamber::settled`]) to records of a chamber: one round of the search
/// that a diagnosis goes on with.
///
/// # Errors
/// A model that cannot be solved.
pub fn standing(
    model: &CoilModel,
    pattern: &Pattern,
    chamber: &Chamber,
    fit: &Fit,
    declared_white_rad_per_s: Option<f64>,
) -> Result<Standing, DiagnoseError> {
    let records: Vec<&Record> = (0..chamber.records()).map(|r| chamber.record(r)).collect();
    let candidates = candidate::candidates(model, &records);
    let question = Question {
        chamber,
        model,
        pattern,
        candidates: &candidates,
        fitted: fit.records.clone(),
        held_out: Vec::new(),
        depth: 1,
    };
    let declared = Assumption::new(model.clone(), pattern.clone());
    let null = chamber.fit(&declared, &[], &question.fitted, Some(fit), crate::chamber::Effort::FULL)?;
    let found = joint::search(&question, null, &|_| ())?;
    let declared = found.declared().ok_or(DiagnoseError::Unsolvable)?;
    let noise: Result<Vec<Noise>, _> = question.fitted.iter().map(|&r| chamber.noise(&declared.fit, r)).collect();
    let noise = noise?;
    let probability = share_of_declared(&found);
    Ok(Standing {
        adequate: is_adequate(probability, &noise, declared_white_rad_per_s),
        probability,
        posterior: answer::posterior(&question, &found),
        noise,
    })
}

pub(super) fn share_of_declared(found: &Found) -> f64 {
    found.declared().map_or(0.0, |e| e.probability)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(white: f64, error: f64) -> Noise {
        Noise {
            white_rad_per_s: white,
            white_standard_error_rad_per_s: error,
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
