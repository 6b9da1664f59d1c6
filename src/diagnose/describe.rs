//! What stands beside a verdict: each effect with its size and its equals, the ladder, the candidates, what is left over.

use super::joint::{Explanation, Found, Member, Question, refit_without};
use super::plain::{Plain, ResidualShape};
use super::{Contender, DiagnoseError, Equivalent, Finding, FittedParameter, RecordNoise, Rung, Unexplained};
use crate::chamber::{Fit, Place, Quantity};
use crate::effect::DeclaredEffect;
use crate::numeric::order::{sort_ascending, sort_descending};
use crate::numeric::statistics::{correlation, rms};
use crate::parallel::InParallel;
use crate::predict::Boundary;

/// An explanation with the fits of the held-out records.
pub(super) struct ScoredExplanation<'e> {
    pub(crate) explanation: &'e Explanation,
    /// One a held-out record, in their order.
    pub(crate) held_out: Vec<Fit>,
}

impl<'e> ScoredExplanation<'e> {
    pub(crate) fn new(question: &Question, explanation: &'e Explanation) -> Result<Self, DiagnoseError> {
        let fits: Result<Vec<Fit>, _> =
            question.held_out.iter().in_parallel().map(|&r| question.chamber.held_out(&explanation.fit, r)).collect();
        Ok(Self { explanation, held_out: fits? })
    }

    pub(crate) fn all(
        question: &Question,
        explanations: impl Iterator<Item = &'e Explanation>,
    ) -> Result<Vec<Self>, DiagnoseError> {
        let explanations: Vec<&Explanation> = explanations.collect();
        explanations.in_parallel().map(|explanation| Self::new(question, explanation)).collect()
    }

    /// What drove each record, as it has it.
    pub(crate) fn driven(&self, question: &Question) -> Result<Vec<Boundary>, DiagnoseError> {
        let of = |record: usize| {
            let place = question.held_out.iter().position(|r| *r == record);
            let day = place.map_or(&self.explanation.fit, |place| &self.held_out[place]);
            Boundary::told(question.chamber, day, record)
        };
        let found: Result<Vec<Boundary>, _> = (0..question.chamber.records()).in_parallel().map(of).collect();
        Ok(found?)
    }
}

/// What drove each record, as two explanations have it.
pub(super) fn driven(
    question: &Question,
    [before, after]: [&ScoredExplanation; 2],
) -> Result<Vec<[Boundary; 2]>, DiagnoseError> {
    let pairs = before.driven(question)?.into_iter().zip(after.driven(question)?);
    Ok(pairs.map(|(before, after)| [before, after]).collect())
}

/// The kinds of a set; of what is no effect, a word.
pub(super) fn names(question: &Question, explanation: &Explanation) -> Vec<String> {
    let word = |m: &Member| match m {
        Member::Effect(candidate) => question.candidates[*candidate].kind(),
        Member::Refitted(effect) => format!("{} (refitted)", question.model.effects[*effect].kind()),
        Member::Winding(_) => "another winding".to_owned(),
        Member::Step { .. } => "offset step".to_owned(),
        Member::Drift => "unexplained wander".to_owned(),
        Member::Cycle => "unexplained cycle".to_owned(),
    };
    explanation.members.iter().map(word).collect()
}

/// Every effect that a set adds.
pub(super) fn findings(
    question: &Question,
    scored: &ScoredExplanation,
    declared: &ScoredExplanation,
    equals: &[&Explanation],
) -> Result<Vec<Finding>, DiagnoseError> {
    let named = scored.explanation;
    let total = |fits: &[Fit]| fits.iter().map(|f| f.evidence).sum::<f64>();
    let effects = named.effects(question);
    let single = named.members.len() == 1;
    let of = |place: usize, candidate: usize, effect: &DeclaredEffect| -> Result<Finding, DiagnoseError> {
        let member = named.members.iter().position(|m| *m == Member::Effect(candidate)).unwrap_or(0);
        // Without this one: the declared model, or the rest fitted again.
        let rest = if single { None } else { refit_without(question, named, member) };
        let (less, confirmed) = match &rest {
            Some(rest) => {
                let again = ScoredExplanation::new(question, rest)?;
                (named.fit.log_likelihood - rest.fit.log_likelihood, total(&scored.held_out) - total(&again.held_out))
            }
            None => (
                named.fit.log_likelihood - declared.explanation.fit.log_likelihood,
                total(&scored.held_out) - total(&declared.held_out),
            ),
        };
        Ok(Finding {
            effect: effect.clone(),
            parameters: parameters(&named.fit, question.model.effects.len() + place, effect),
            equivalents: equivalents(question, named, candidate, equals),
            chi_square_less: 2.0 * less,
            confirmed_by: 2.0 * confirmed,
        })
    };
    effects.iter().enumerate().in_parallel().map(|(place, (candidate, effect))| of(place, *candidate, effect)).collect()
}

/// The only effect of a set.
pub(super) fn alone(question: &Question, best: &Explanation, base: &Fit) -> Finding {
    let effect = best.fit.assumed.model.effects[question.model.effects.len()].clone();
    Finding {
        parameters: parameters(&best.fit, question.model.effects.len(), &effect),
        effect,
        equivalents: Vec::new(),
        chi_square_less: 2.0 * (best.fit.log_likelihood - base.log_likelihood),
        confirmed_by: 0.0,
    }
}

pub(super) fn parameters(fit: &Fit, place: usize, effect: &DeclaredEffect) -> Vec<FittedParameter> {
    let declared = effect.parameters().into_iter().enumerate();
    declared
        .map(|(parameter, own)| {
            let found = fit.value(Place::Effect { effect: place, parameter });
            let value = effect.values()[parameter];
            let near = |bound: f64| (value - bound).abs() < 1e-3 * (own.upper - own.lower).abs().min(value.abs());
            FittedParameter {
                key: own.key,
                unit: own.unit,
                value,
                standard_error: found.map(|(_, e)| e).filter(|e| e.is_finite()),
                at_bound: found.is_some() && (near(own.lower) || near(own.upper)),
                fitted: found.is_some(),
            }
        })
        .collect()
}

/// What stands in the place of one effect in the other sets of a family.
fn equivalents(question: &Question, named: &Explanation, candidate: usize, equals: &[&Explanation]) -> Vec<Equivalent> {
    let own = names(question, named);
    let kind = question.candidates[candidate].kind();
    let mut all: Vec<Equivalent> = Vec::new();
    for other in equals {
        let theirs = names(question, other);
        let gone: Vec<&String> = own.iter().filter(|n| !theirs.contains(n)).collect();
        if !gone.contains(&&kind) {
            continue;
        }
        for (at, effect) in other.effects(question) {
            let name = question.candidates[at].kind();
            if own.contains(&name) || all.iter().any(|e| e.effect.kind() == name) {
                continue;
            }
            let more = 2.0 * (named.fit.log_likelihood - other.fit.log_likelihood);
            let correlation = likeness(question, &named.fit, &other.fit).unwrap_or(0.0);
            all.push(Equivalent {
                effect,
                chi_square_more: more,
                correlation,
                extended: other.fit.assumed.model.clone(),
            });
        }
    }
    all
}

/// Correlation of what two fits add to the declared prediction.
fn likeness(question: &Question, a: &Fit, b: &Fit) -> Option<f64> {
    let record = *question.fitted.first()?;
    let predicted = |fit: &Fit| question.chamber.prediction(fit, record).ok();
    let (a, b) = (predicted(a)?.rate_rad_per_s, predicted(b)?.rate_rad_per_s);
    correlation(&a[1..], &b[1..])
}

/// Root mean square of what readings leave of a record's rates, as if every logged value stood alone.
fn left(question: &Question, fit: &Fit, record: usize) -> Result<(f64, usize), DiagnoseError> {
    let prediction = question.chamber.prediction(fit, record)?;
    let residuals: Vec<f64> = prediction.residual_rad_per_s.into_iter().filter(|r| r.is_finite()).collect();
    let averaged = question.chamber.averaged(record) as f64;
    let white = fit.number(Quantity::RateNoise, record);
    Ok(((rms(&residuals).powi(2) + white * white * (1.0 - 1.0 / averaged)).sqrt(), residuals.len()))
}

/// The errors after each effect, in the order in which the search took them in; `steps`: the declared model, the sets on the way, the
/// set itself.
pub(super) fn ladder(
    question: &Question,
    steps: &[ScoredExplanation],
    noise: &[RecordNoise],
) -> Result<Vec<Rung>, DiagnoseError> {
    let expected = |place: usize| {
        let n = &noise[place].noise;
        n.white_rad_per_s.powi(2) + n.wander_rad_per_s.powi(2) + n.unresolved_air_rad_per_s.powi(2)
    };
    let over = |fits: &[(&Fit, usize, usize)]| -> Result<(f64, f64), DiagnoseError> {
        let (mut squares, mut chi_square, mut rows) = (0.0, 0.0, 0);
        for (fit, record, place) in fits {
            let (error, count) = left(question, fit, *record)?;
            squares += error * error * count as f64;
            chi_square += error * error / expected(*place) * count as f64;
            rows += count;
        }
        Ok(((squares / rows.max(1) as f64).sqrt(), chi_square / rows.max(1) as f64))
    };
    let rung = |step: &ScoredExplanation| -> Result<Rung, DiagnoseError> {
        let fit = &step.explanation.fit;
        let fitted: Vec<(&Fit, usize, usize)> =
            question.fitted.iter().enumerate().map(|(place, &r)| (fit, r, place)).collect();
        let days = question.held_out.iter().zip(&step.held_out).enumerate();
        let unseen: Vec<(&Fit, usize, usize)> =
            days.map(|(place, (&r, day))| (day, r, question.fitted.len() + place)).collect();
        let (rmse, reduced) = over(&fitted)?;
        let held_out = if unseen.is_empty() { None } else { Some(over(&unseen)?) };
        Ok(Rung {
            effects: fit.assumed.model.effects[question.model.effects.len()..].iter().map(|e| e.kind()).collect(),
            rmse_rad_per_s: rmse,
            holdout_rmse_rad_per_s: held_out.map(|h| h.0),
            reduced_chi_square: reduced,
            holdout_reduced_chi_square: held_out.map(|h| h.1),
            bic: -2.0 * fit.log_likelihood + fit.parameters.len() as f64 * (rows(question) as f64).ln(),
        })
    };
    steps.iter().map(rung).collect()
}

impl Rung {
    /// The fitted records' errors for the held-out ones', where there are any.
    pub(super) fn exchange(&mut self) {
        if let Some(other) = &mut self.holdout_rmse_rad_per_s {
            std::mem::swap(&mut self.rmse_rad_per_s, other);
        }
        if let Some(other) = &mut self.holdout_reduced_chi_square {
            std::mem::swap(&mut self.reduced_chi_square, other);
        }
    }
}

fn rows(question: &Question) -> usize {
    question.fitted.iter().map(|&r| question.chamber.times_s(r).len()).sum::<usize>().max(2)
}

/// Each candidate alone: as fitted where it was, as the score test promises elsewhere.
pub(super) fn contenders(question: &Question, found: &Found, declared: &Explanation) -> Vec<Contender> {
    let rows = rows(question) as f64;
    let mut all: Vec<Contender> = Vec::new();
    for &(candidate, promised) in &found.promised {
        let kind = question.candidates[candidate].kind();
        if all.iter().any(|c| c.effect.kind() == kind) {
            continue;
        }
        let fitted = found.explanations.iter().find(|e| names(question, e) == [kind.clone()]);
        let effect = fitted.and_then(|e| e.effects(question).into_iter().next()).map(|e| e.1);
        let gain = fitted.map_or(promised, |e| e.fit.log_likelihood - declared.fit.log_likelihood);
        let free = question.candidates[candidate].free.len() as f64;
        let parameters = declared.fit.parameters.len() as f64 + free;
        all.push(Contender {
            effect: effect.unwrap_or_else(|| question.candidates[candidate].effect.clone()),
            reduced_chi_square: (1.0 - 2.0 * gain / rows).max(0.0),
            bic: -2.0 * (declared.fit.log_likelihood + gain) + parameters * rows.ln(),
            chi_square_less: 2.0 * gain,
        });
    }
    sort_ascending(&mut all, |item| item.bic);
    all
}

/// What the declared model leaves, and what it goes with.
pub(super) fn unexplained(
    question: &Question,
    declared: &ScoredExplanation,
    likeliest: &Explanation,
) -> Result<Unexplained, DiagnoseError> {
    let chamber = question.chamber;
    let fit = &declared.explanation.fit;
    let mut columns: Vec<(String, Vec<f64>)> = Vec::new();
    let mut residuals: Vec<f64> = Vec::new();
    let mut white: f64 = 0.0;
    for &r in &question.fitted {
        let prediction = chamber.prediction(fit, r)?;
        white = white.max(likeliest.fit.number(Quantity::RateNoise, r) / (chamber.averaged(r) as f64).sqrt());
        let course = &prediction.course;
        let place = |k: usize| course.row(k);
        let times = chamber.times_s(r);
        let step = |k: usize, f: &dyn Fn(usize) -> f64| (f(k) - f(k - 1)) / (times[k] - times[k - 1]);
        let outer = |k: usize| place(k)[course.layers - 1];
        let gradient = |k: usize| outer(k) - place(k)[0];
        let mut add = |name: String, values: Vec<f64>| match columns.iter_mut().find(|c| c.0 == name) {
            Some(column) => column.1.extend(values),
            None => columns.push((name, values)),
        };
        let rows: Vec<usize> = (1..times.len()).filter(|&k| prediction.residual_rad_per_s[k].is_finite()).collect();
        add("time".to_owned(), rows.iter().map(|&k| times[k]).collect());
        add("temperature".to_owned(), rows.iter().map(|&k| outer(k)).collect());
        add("temperature rate".to_owned(), rows.iter().map(|&k| step(k, &outer)).collect());
        add("rate of outer less inner temperature".to_owned(), rows.iter().map(|&k| step(k, &gradient)).collect());
        for channel in chamber.record(r).channels().iter().filter(|c| c.values.iter().all(|v| v.is_finite())) {
            let values = rows.iter().map(|&k| channel.values[chamber.span(r, k).1]).collect();
            add(format!("channel:{}", channel.name), values);
        }
        residuals.extend(rows.iter().map(|&k| prediction.residual_rad_per_s[k]));
    }
    let mut correlations: Vec<(String, f64)> = columns
        .into_iter()
        .filter(|(_, values)| values.len() == residuals.len())
        .filter_map(|(name, values)| Some((name, correlation(&values, &residuals)?)))
        .collect();
    sort_descending(&mut correlations, |item| item.1.abs());
    let record = question.fitted.first().copied().unwrap_or(0);
    let number = |q: Quantity| likeliest.fit.number(q, record);
    let gain = 2.0 * (likeliest.fit.log_likelihood - fit.log_likelihood);
    let plain = likeliest.members.iter().filter_map(|m| match m {
        Member::Drift => Some((
            ResidualShape::Drift { time_constant_s: number(Quantity::DriftTime) },
            number(Quantity::DriftSize),
            2,
        )),
        Member::Cycle => {
            Some((ResidualShape::Sinusoid { period_s: number(Quantity::CyclePeriod) }, number(Quantity::CycleSize), 2))
        }
        _ => None,
    });
    let plain = plain.map(|(shape, size, parameters)| Plain { shape, gain, parameters, rms_rad_per_s: size }).collect();
    let total = rms(&residuals);
    let excess = (total * total - white * white).max(0.0).sqrt();
    Ok(Unexplained {
        excess_rad_per_s: excess,
        share_of_excess: if total > 0.0 { excess / total } else { 0.0 },
        correlations,
        plain,
    })
}
