//! Whether a record belongs to the declared coil at all.

use super::Caution;
use super::evidence::{Case, Evidence, Role, sum_of_squares};
use super::field::Keep;
use super::hypothesis::{Hypothesis, Trial};
use crate::pattern::classic::Classic;
use crate::rate::CoilModel;

/// χ² by which another winding may be worse than a set of effects and still be the simpler answer.
const NO_WORSE: f64 = 12.0;

/// Records that the declared model predicts no better than a constant does.
pub(super) fn strangers(evidence: &Evidence, model: &CoilModel) -> Vec<Caution> {
    let is_strange = |case: &&Case| {
        let rates = case.record.rate_rad_per_s();
        let mean = rates.iter().sum::<f64>() / rates.len() as f64;
        let spread: f64 = rates.iter().map(|r| (r - mean).powi(2)).sum();
        let residuals = case.plain_residuals(model, evidence.pattern);
        residuals.is_some_and(|(residuals, _)| sum_of_squares(&residuals) >= spread)
    };
    let strange = evidence.cases.iter().filter(is_strange);
    strange.map(|case| Caution::WrongCoil { record: case.record.name().to_owned() }).collect()
}

/// A standard winding that explains the records to the noise without any effect, where the declared one needs effects.
pub(super) fn other_winding(
    trial: &Trial,
    base: &Hypothesis,
    best: &Hypothesis,
    adequate: f64,
) -> Option<&'static str> {
    let (evidence, model) = (trial.evidence, trial.model);
    let rows = evidence.rows(Role::Fit) as f64;
    if base.chi_square < adequate * rows {
        return None;
    }
    let with = |classic: Classic| {
        let pattern = classic.pattern(model.coil.layers()).ok().filter(|p| p != evidence.pattern)?;
        let chi_square = |role: Role| -> Option<f64> {
            evidence.of(role).map(|case| Some(sum_of_squares(&case.residuals(model, &pattern, Keep::Recent)?))).sum()
        };
        let (fitted, unseen) = (chi_square(Role::Fit)?, chi_square(Role::Holdout)?);
        (fitted < adequate * rows && fitted + unseen < best.total() + NO_WORSE).then_some(classic.key())
    };
    Classic::ALL.into_iter().find_map(with)
}
