//! What a user gets of an unlisted effect: the formula with its numbers, what it is likely to be, whether it predicts.

use super::grammar::{Class, Family, Term};
use super::search::Set;
use super::{Discovered, Question};
use crate::chamber::Fit;
use crate::diagnose::answer::{hypothesis, noises};
use crate::diagnose::describe::{ScoredExplanation, driven, findings, names, unexplained};
use crate::diagnose::joint::{Explanation, Found};
use crate::diagnose::standing::CERTAIN;
use crate::diagnose::{DiagnoseError, Diagnosis, Rung, Share, Verdict};
use crate::effect::DeclaredEffect;
use crate::numeric::order::sort_descending;
use crate::numeric::statistics::rms;
use crate::rate::CoilModel;

/// A formula that explains what no listed effect does.
#[derive(Debug, Clone)]
pub struct FormulaProposal {
    /// With its numbers, in °/h.
    pub formula: String,
    pub terms: Vec<ProposedTerm>,
    /// Other formulas that do nearly as well.
    pub alternatives: Vec<Alternative>,
    /// Whether it may be used on another record; otherwise it describes these.
    pub predicts: bool,
    /// Why it only describes.
    pub(crate) only_describes: Option<String>,
    pub(crate) probability: f64,
    pub(crate) rmse_rad_per_s: f64,
    pub(crate) holdout_rmse_rad_per_s: Option<f64>,
    /// What would tell it from its alternatives.
    pub(crate) experiment: Option<String>,
    /// The declared model with the listed effects and the terms.
    pub proposed: CoilModel,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Alternative {
    pub(crate) formula: String,
    pub(crate) probability: f64,
}

/// One term of a proposal.
#[derive(Debug, Clone)]
pub struct ProposedTerm {
    /// With its parameters by name.
    pub(crate) text: String,
    pub form: &'static str,
    pub(crate) variables: Vec<String>,
    pub parameters: Vec<TermParameter>,
    pub(crate) reading: String,
    /// As a custom effect at the fitted values.
    pub(crate) effect: DeclaredEffect,
    /// What is left of each fitted record without the term, against its first variable.
    pub(crate) shown: Vec<Shown>,
}

/// A parameter of a formula, as the formula states it.
#[derive(Debug, Clone, PartialEq)]
pub struct TermParameter {
    pub key: String,
    pub value: f64,
    pub(crate) standard_error: Option<f64>,
    pub(crate) unit: String,
}

/// One record for a picture: rows of what is left and of the term.
///
/// # Shapes
/// One entry a row that has a rate.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Shown {
    pub(crate) record: String,
    pub(crate) variable: String,
    pub(crate) x: Vec<f64>,
    /// Measured less everything but the term [rad/s].
    pub(crate) left_rad_per_s: Vec<f64>,
    pub(crate) term_rad_per_s: Vec<f64>,
}

/// What stands behind every proposal of a bias.
pub(crate) const NO_WINDING: &str =
    "it does not come from the coil's own thermal error: no winding changes it; compensate it";

impl Term {
    fn effect(&self, amplitude: f64) -> Option<DeclaredEffect> {
        let values = std::iter::once(amplitude).chain(self.inner.iter().copied()).collect();
        DeclaredEffect::custom(self.formula()?, values).ok()
    }

    /// In plain words, and where that is said.
    fn reading(&self) -> String {
        match self.family.form.source {
            Some(source) => format!("{} ({source})", self.family.form.reading),
            None => format!("{} (a guess)", self.family.form.reading),
        }
    }
}

fn formula_in_numbers(set: &Set) -> String {
    let mut text = String::new();
    for (place, term) in set.terms.iter().enumerate() {
        let amplitude = set.amplitude(place);
        if place == 0 {
            text += &term.in_numbers(amplitude);
        } else {
            text += if amplitude < 0.0 { " - " } else { " + " };
            text += &term.in_numbers(amplitude.abs());
        }
    }
    text
}

/// Puts what was discovered in the place of what the listed effects said.
///
/// # Errors
/// A model that cannot be solved any more.
pub(in crate::diagnose) fn amend(
    question: &Question,
    found: &Found,
    discovered: &Discovered,
    diagnosis: &mut Diagnosis,
) -> Result<(), DiagnoseError> {
    let Some(declared) = found.declared() else { return Ok(()) };
    let best = &discovered.best;
    // Amplitudes as they were fitted wherever a record is only judged by.
    let mut frozen = best.explanation.clone();
    frozen.fit.assumed.inputs.iter_mut().for_each(|input| input.deviation = 0.0);
    let refined = ScoredExplanation { explanation: &frozen, held_out: discovered.days().to_vec() };
    let first = ScoredExplanation::new(question, declared)?;
    // Sets that do as well with another listed effect in the place of one.
    let equals: Vec<&Explanation> = discovered.alternatives.iter().map(|(set, _)| &set.explanation).collect();
    diagnosis.effects = findings(question, &refined, &first, &equals)?;
    diagnosis.verdict = Verdict::Unexplained;
    diagnosis.suggested_experiment = None;
    let noise = noises(question, &best.explanation)?;
    let white: f64 = noise.iter().take(question.fitted.len()).map(|n| n.noise.white_rad_per_s.powi(2)).sum();
    diagnosis.noise_floor_rad_per_s = (white / question.fitted.len().max(1) as f64).sqrt();
    diagnosis.noise = noise;
    diagnosis.unexplained = Some(unexplained(question, &first, &best.explanation)?);
    let proposal = proposal(question, discovered, diagnosis)?;
    let mut posterior = vec![share(question, found, best, proposal.formula.clone(), discovered.probability)];
    let others = discovered.alternatives.iter();
    posterior
        .extend(others.map(|(set, probability)| share(question, found, set, formula_in_numbers(set), *probability)));
    let left: f64 = (1.0 - posterior.iter().map(|s| s.probability).sum::<f64>()).max(0.0);
    posterior.extend(
        diagnosis
            .posterior
            .iter()
            .map(|s| Share { probability: s.probability * left, ..s.clone() })
            .filter(|s| s.probability > 1e-6),
    );
    diagnosis.posterior = posterior;
    diagnosis.extended = best.explanation.fit.assumed.model.clone();
    diagnosis.driven = driven(question, [&first, &refined])?;
    diagnosis.proposals = vec![proposal];
    Ok(())
}

fn share(question: &Question, found: &Found, set: &Set, formula: String, probability: f64) -> Share {
    Share {
        effects: names(question, &set.explanation).into_iter().chain([formula]).collect(),
        probability,
        hypothesis: hypothesis(question, found, &set.explanation),
        members: set.explanation.fit.assumed.model.effects.clone(),
        estimates: set.explanation.fit.effect_estimates(),
    }
}

/// Puts formulas beside the listed effects that do no better than they.
pub(in crate::diagnose) fn share_with(
    question: &Question,
    found: &Found,
    alike: &[(Set, f64)],
    diagnosis: &mut Diagnosis,
) {
    let left = 1.0 - alike.iter().map(|(_, probability)| probability).sum::<f64>();
    let named = diagnosis.posterior.first().map_or(0.0, |s| s.probability) * left;
    diagnosis.posterior.iter_mut().for_each(|s| s.probability *= left);
    let shares =
        alike.iter().map(|(set, probability)| share(question, found, set, formula_in_numbers(set), *probability));
    diagnosis.posterior.extend(shares);
    sort_descending(&mut diagnosis.posterior, |item| item.probability);
    if diagnosis.verdict == Verdict::Missing && named < CERTAIN {
        diagnosis.verdict = Verdict::Indistinguishable;
    }
}

/// What a fit leaves of a record, and how much of it is a term.
fn left(question: &Question, fit: &Fit, record: usize) -> Result<Vec<f64>, DiagnoseError> {
    let prediction = question.chamber.prediction(fit, record)?;
    Ok(prediction.residual_rad_per_s)
}

fn size(values: &[f64]) -> f64 {
    let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    rms(&finite)
}

#[expect(clippy::too_many_lines, reason = "an answer field by field")]
fn proposal(
    question: &Question,
    discovered: &Discovered,
    diagnosis: &mut Diagnosis,
) -> Result<FormulaProposal, DiagnoseError> {
    let (best, refined) = (&discovered.best, &discovered.refined);
    let over = |fits: &[(&Fit, usize)]| -> Result<f64, DiagnoseError> {
        let (mut squares, mut rows) = (0.0, 0.0);
        for (fit, record) in fits {
            let residuals = left(question, fit, *record)?;
            let count = residuals.iter().filter(|v| v.is_finite()).count() as f64;
            squares += size(&residuals).powi(2) * count;
            rows += count;
        }
        Ok((squares / f64::max(rows, 1.0)).sqrt())
    };
    let errors = |set: &Set, days: &[Fit]| -> Result<(f64, Option<f64>), DiagnoseError> {
        let fitted: Vec<(&Fit, usize)> = question.fitted.iter().map(|&r| (&set.explanation.fit, r)).collect();
        let unseen: Vec<(&Fit, usize)> = days.iter().zip(&question.held_out).map(|(f, &r)| (f, r)).collect();
        Ok((over(&fitted)?, if unseen.is_empty() { None } else { Some(over(&unseen)?) }))
    };
    let kinds: Vec<String> = diagnosis.effects.iter().map(|f| f.effect.kind()).collect();
    let expected = |place: usize| {
        diagnosis.noise.get(place).map_or(f64::NAN, |n| {
            n.noise.white_rad_per_s.hypot(n.noise.wander_rad_per_s).hypot(n.noise.unresolved_air_rad_per_s)
        })
    };
    let (noise, unseen_noise) = (expected(0), expected(question.fitted.len()));
    let mut ladder: Vec<Rung> = diagnosis.ladder.first().cloned().into_iter().collect();
    let from = usize::from(kinds.is_empty());
    for (set, days) in discovered.steps.iter().filter(|(set, _)| set.terms.len() >= from) {
        let (rmse, holdout) = errors(set, days)?;
        let named = set.terms.iter().map(|t| t.family.text.clone());
        ladder.push(Rung {
            effects: kinds.iter().cloned().chain(named).collect(),
            rmse_rad_per_s: rmse,
            holdout_rmse_rad_per_s: holdout,
            reduced_chi_square: (rmse / noise).powi(2),
            holdout_reduced_chi_square: holdout.map(|h| (h / unseen_noise).powi(2)),
            bic: bic(set),
        });
    }
    let (rmse_rad_per_s, holdout_rmse_rad_per_s) = errors(best, discovered.days())?;
    diagnosis.ladder = ladder;
    let mut terms = Vec::new();
    let mut proposed = refined.explanation.fit.assumed.model.clone();
    for (place, term) in refined.terms.iter().enumerate() {
        let amplitude = refined.amplitude(place);
        let Some(effect) = term.effect(amplitude) else { continue };
        proposed.effects.push(effect.clone());
        terms.push(ProposedTerm {
            text: term.formula_text(),
            form: term.family.form.key,
            variables: term.family.variables(),
            parameters: parameters(refined, place, &discovered.errors[place]),
            reading: term.reading(),
            shown: shown(question, discovered, place)?,
            effect,
        });
    }
    let only_describes = only_describes(question, best);
    let alternatives: Vec<Alternative> = discovered
        .alternatives
        .iter()
        .map(|(set, probability)| Alternative { formula: formula_in_numbers(set), probability: *probability })
        .collect();
    Ok(FormulaProposal {
        formula: formula_in_numbers(refined),
        experiment: experiment(refined, &discovered.alternatives),
        terms,
        alternatives,
        predicts: only_describes.is_none(),
        only_describes,
        probability: discovered.probability,
        rmse_rad_per_s,
        holdout_rmse_rad_per_s,
        proposed,
    })
}

fn bic(set: &Set) -> f64 {
    let fit = &set.explanation.fit;
    let rows: usize = fit.records.iter().filter_map(|&r| fit.course(r)).map(|c| c.air_k.len()).sum();
    let inner: usize = set.terms.iter().map(|t| t.inner.len()).sum();
    -2.0 * fit.log_likelihood + (fit.parameters.len() + inner) as f64 * (rows.max(2) as f64).ln()
}

fn only_describes(question: &Question, best: &Set) -> Option<String> {
    if best.terms.iter().any(|t| t.family.is_of_time_alone()) {
        return Some("it depends on the time since the record began: another record begins otherwise".to_owned());
    }
    if question.held_out.is_empty() {
        return Some("no record was held out to confirm it: give one with --holdout".to_owned());
    }
    if best.explanation.is_outside() {
        return Some("beside it something is left that neither it nor a listed effect explains".to_owned());
    }
    None
}

fn parameters(set: &Set, place: usize, errors: &[f64]) -> Vec<TermParameter> {
    let term = &set.terms[place];
    let error = |i: usize| errors.get(i).copied().filter(|e| e.is_finite());
    let amplitude = TermParameter {
        key: "a".to_owned(),
        value: set.amplitude(place),
        standard_error: error(0),
        unit: match term.family.unit().as_str() {
            "1" => "°/h".to_owned(),
            unit => format!("°/h per {unit}"),
        },
    };
    let inner = term.inner.iter().enumerate().map(|(i, &value)| TermParameter {
        key: term.family.form.inner[i].key().to_owned(),
        value,
        standard_error: error(1 + i),
        unit: term.family.inner_unit(i),
    });
    std::iter::once(amplitude).chain(inner).collect()
}

/// What is left without a term against its variable, on the fitted records.
fn shown(question: &Question, discovered: &Discovered, place: usize) -> Result<Vec<Shown>, DiagnoseError> {
    let set = &discovered.refined;
    let fit = &set.explanation.fit;
    let term = &set.terms[place];
    let column = set.grounds.courses.column(term);
    let name = term.family.x.name.clone();
    let mut all = Vec::new();
    for record in question.fitted.iter().chain(&question.held_out).copied() {
        let residual = left(question, fit, record)?;
        let of = |row: usize| set.amplitude(place) * column.rate_rad_per_s[record][row];
        let x = |row: usize| match name.split_once(" - ") {
            Some((a, b)) => set.grounds.courses.of(a, record)[row] - set.grounds.courses.of(b, record)[row],
            None => set.grounds.courses.of(&name, record)[row],
        };
        let rows: Vec<usize> = (1..residual.len()).filter(|&k| residual[k].is_finite()).collect();
        all.push(Shown {
            record: question.chamber.record(record).name().to_owned(),
            variable: name.clone(),
            x: rows.iter().map(|&k| x(k)).collect(),
            left_rad_per_s: rows.iter().map(|&k| residual[k] + of(k)).collect(),
            term_rad_per_s: rows.iter().map(|&k| of(k)).collect(),
        });
    }
    Ok(all)
}

/// The experiment that tells the first term from what does nearly as well.
fn experiment(set: &Set, alternatives: &[(Set, f64)]) -> Option<String> {
    let own = &set.terms.first()?.family;
    let other = alternatives.iter().map(|(s, _)| s).find_map(|s| {
        let alternative = s.terms.iter().find(|t| !set.terms.iter().any(|o| o.is_sister_of(t)))?;
        Some(&alternative.family)
    });
    let text = match other {
        Some(alternative) => apart(own, alternative),
        None => alone(own),
    };
    Some(text)
}

fn apart(own: &Family, alternative: &Family) -> String {
    let (a, b) = (own.variables().join(" and "), alternative.variables().join(" and "));
    if a != b {
        let how = match (own.x.class, alternative.x.class) {
            (Class::Temperature, Class::Temperature) => {
                "a steep ramp after a long soak, in which the inner layers follow late"
            }
            (Class::Column | Class::Centred, _) | (_, Class::Column | Class::Centred) => {
                "a record at one temperature in which the column is switched by hand"
            }
            (Class::Time, _) | (_, Class::Time) => "the same cycle begun an hour after switch-on",
            _ => "ramps of several rates at several temperatures",
        };
        return format!("to tell {} from {}: {how}", own.text, alternative.text);
    }
    format!("to tell {} from {}: {}", own.text, alternative.text, alone(own))
}

fn alone(own: &Family) -> String {
    match own.form.key {
        "relaxation" | "one_sided_relaxation" | "lagged" | "lagged_size" | "lagged_square" => {
            "a step, then a soak of several time constants: what remembers goes on after the step".to_owned()
        }
        "hysteresis" => {
            "small cycles within the width and large ones beyond it: play shows nothing in the former".to_owned()
        }
        "threshold" | "softening" | "saturation" => {
            "a slow ramp through the threshold in both directions, and one that stays on one side of it".to_owned()
        }
        "settling" | "decay" | "drift" => {
            "the same cycle begun an hour after switch-on: what follows time stays behind".to_owned()
        }
        _ => format!("a record in which {} takes three levels while everything else stands still", own.x.name),
    }
}
