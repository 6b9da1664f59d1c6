//! Several effects at once, fitted to records: what a proposal adds to a model.

use super::describe::parameters;
use super::{DiagnoseError, Finding, Request, checked};
use crate::chamber::{Assumption, Chamber, Effort, Free};
use crate::effect::DeclaredEffect;
use crate::rate::CoilModel;
use crate::units::Unit;

/// Effects that were fitted together.
#[derive(Debug, Clone)]
pub(crate) struct Together {
    /// In the order in which they were given.
    pub(crate) findings: Vec<Finding>,
    /// The declared model with them.
    pub(crate) extended: CoilModel,
}

/// Declares effects at their values; listed ones in the place of their own kind.
pub(crate) fn declared_with(model: &CoilModel, effects: &[DeclaredEffect]) -> CoilModel {
    let mut with = model.clone();
    let replaces =
        |own: &DeclaredEffect| effects.iter().any(|e| e.kind() == own.kind() && e.subject() == own.subject());
    with.effects.retain(|own| !replaces(own));
    with.effects.extend(effects.iter().cloned());
    with
}

/// Fits all parameters of effects to records, from the values that they have.
///
/// # Errors
/// As [`super::diagnose`]; effects that cannot be fitted to these records.
pub(crate) fn extend_together(request: &Request, effects: &[DeclaredEffect]) -> Result<Together, DiagnoseError> {
    let records = checked(request)?;
    let with = declared_with(request.model, effects);
    let first = with.effects.len() - effects.len();
    let mut without = with.clone();
    without.effects.truncate(first);
    let fitted: Vec<usize> = (0..request.records.len()).collect();
    let declared = Assumption::new(without.clone(), request.pattern.clone());
    let (chamber, mut base) = Chamber::new(&without, &records)?.with_shocks(&declared, &fitted)?;
    base.calm(&fitted);
    let free: Vec<Free> = effects
        .iter()
        .enumerate()
        .flat_map(|(place, effect)| {
            let parameters = effect.parameters().into_iter().enumerate();
            let numbers = parameters.filter(|(_, p)| p.unit != Unit::Layer);
            numbers.map(move |(parameter, _)| Free::again(first + place, parameter, effect))
        })
        .collect();
    let assumed = Assumption::new(with, request.pattern.clone());
    let no_fit =
        || DiagnoseError::NoFit { kind: effects.iter().map(DeclaredEffect::kind).collect::<Vec<_>>().join(", ") };
    let fit = chamber.fit(&assumed, &free, &fitted, Some(&base), Effort::FULL).map_err(|_| no_fit())?;
    let extended = fit.assumed.model.clone();
    let findings = extended.effects[first..]
        .iter()
        .enumerate()
        .map(|(place, effect)| Finding {
            parameters: parameters(&fit, first + place, effect),
            chi_square_less: 2.0 * (fit.log_likelihood - base.log_likelihood),
            ..Finding::unfitted(effect.clone())
        })
        .collect();
    Ok(Together { findings, extended })
}
