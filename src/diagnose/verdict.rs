//! From fitted sets of effects to an answer that can be defended.

use super::candidate::Candidate;
use super::confirm::confirmation;
use super::evidence::{Evidence, Role, dot, sum_of_squares};
use super::hypothesis::{Hypothesis, Trial};
use super::plain::{Plain, compete};
use super::prune::{Bar, prune, settled_and_pruned};
use super::search::{Found, all_singles, fit_swap, settle, settle_contenders, settled, without};
use super::stranger::{other_winding, strangers};
use super::{
    Caution, Contender, DiagnoseError, Diagnosis, Equivalent, Extension, Finding, FittedParameter, Rung, Unexplained,
    Verdict,
};
use crate::fit::Effort;
use crate::rate::CoilModel;

/// Sets that differ by less than this share of what they explain explain it equally well: no effect's equation is more
/// accurate than that.
pub(super) const EQUAL_SHARE: f64 = 0.01;
/// Sets whose χ² differ by less explain the records equally well (odds of 400 at best).
pub(super) const EQUAL: f64 = 12.0;
const MAX_EQUIVALENTS: usize = 2;
/// Times that boundaries are estimated again because an effect went that they depend on.
pub(super) const MOST_ROUNDS: usize = 3;
/// Kinds that are tried in the place of an accepted one.
const RIVALS: usize = 6;
/// Reduced χ² beyond 1 that noise floor and boundary may make, besides chance.
const TOLERATED_EXCESS: f64 = 0.12;
/// A plain function of time is there if it lowers χ² by this much, and by this share of the rows.
const PLAIN_GAIN: f64 = 40.0;
const PLAIN_SHARE_OF_ROWS: f64 = 0.02;
/// Share of the declared model's excess that accepted effects may leave, unless that is more than the model's inaccuracy.
const TOLERATED_REST: f64 = 0.05;

/// Judges what the search found.
pub(super) fn judge(
    evidence: &mut Evidence,
    model: &CoilModel,
    candidates: &[Candidate],
    found: Found,
) -> Result<Diagnosis, DiagnoseError> {
    let Found { base, singles, mut best, variance } = found;
    let rows = evidence.rows(Role::Fit);
    let mut cautions = cautions_of(evidence);
    let freedom = |h: &Hypothesis| (rows as f64 - h.parameters as f64 - 1.0).max(1.0);
    let excess = |h: &Hypothesis| h.chi_square - freedom(h);
    let tolerated = TOLERATED_EXCESS + 3.0 * (2.0 / rows as f64).sqrt();
    let signal = evidence.of(Role::Fit).map(|c| c.signal_square(model, evidence.pattern)).sum();
    let bar = Bar { base: &base, variance, signal, tolerated };
    best = settled_and_pruned(evidence, model, candidates, best, &bar, &mut cautions)?;
    let trial = Trial { evidence, model, candidates };
    let stranger = other_winding(&trial, &base, &best, 1.0 + tolerated);
    if stranger.is_some() {
        best = base.clone();
    }
    let mut reasons: Vec<Vec<Equivalent>> = Vec::new();
    let mut effects = Vec::new();
    for _ in 0..MOST_ROUNDS {
        reasons.clear();
        for place in 0..best.members.len() {
            let (main, equivalents) = settle_equivalents(evidence, model, candidates, best, place, variance)?;
            best = main;
            reasons.push(equivalents);
        }
        best = settled(evidence, model, candidates, best)?;
        // On the boundaries that the last comparison led to, something may have become needless.
        let trial = Trial { evidence, model, candidates };
        let members = best.members.len();
        best = prune(&trial, best, &bar, &mut cautions);
        if best.members.len() == members {
            break;
        }
        best = settled_and_pruned(evidence, model, candidates, best, &bar, &mut cautions)?;
        reasons = vec![Vec::new(); best.members.len()];
    }
    let trial = Trial { evidence, model, candidates };
    let errors = trial.fit(&best.members, Effort { standard_errors: true, ..Effort::QUICK });
    if let Some(with_errors) = errors {
        best = with_errors;
    }
    let extended = trial.model_of(&best.members).ok_or(DiagnoseError::Unsolvable)?;
    let inflation = inflation(&trial, &extended, &best, rows);
    for (place, equivalents) in reasons.into_iter().enumerate() {
        effects.push(finding(&trial, &best, place, equivalents, inflation));
    }
    let plain = compete(trial.evidence, &extended, &best.residuals);
    let is_plain = |p: &Plain, least: f64| p.gain > least.max(PLAIN_GAIN).max(PLAIN_SHARE_OF_ROWS * rows as f64);
    let left = excess(&best) / excess(&base).max(1.0);
    let verdict = if best.members.is_empty() {
        let quiet = base.chi_square / freedom(&base) < 1.0 + tolerated && !plain.iter().any(|p| is_plain(p, 0.0));
        if quiet { Verdict::Adequate } else { Verdict::Unexplained }
    } else {
        let gained = base.chi_square - best.chi_square;
        let beyond = left > TOLERATED_REST || excess(&best) > bar.accuracy();
        let rest = best.chi_square / freedom(&best) > 1.0 + tolerated && beyond;
        let plain_rest = plain.iter().any(|p| is_plain(p, TOLERATED_REST * gained));
        if rest || plain_rest {
            Verdict::Unexplained
        } else if effects.iter().any(|e| !e.equivalents.is_empty()) {
            Verdict::Indistinguishable
        } else {
            Verdict::Missing
        }
    };
    if let Some(winding) = stranger {
        cautions.push(Caution::OtherWinding { winding });
    } else if verdict == Verdict::Unexplained {
        cautions.extend(strangers(trial.evidence, model));
    }
    let unexplained = (verdict == Verdict::Unexplained).then(|| describe(&trial, &extended, plain, left));
    let ladder = ladder(&trial, &base, &best);
    let suggested_experiment = experiment(verdict, &effects);
    let mut contenders: Vec<Contender> = Vec::new();
    for single in &singles {
        let Some(with) = trial.model_of(&single.members) else { continue };
        let Some(effect) = with.effects.last().cloned() else { continue };
        if contenders.iter().any(|c| c.effect.kind() == effect.kind()) {
            continue;
        }
        contenders.push(Contender {
            effect,
            reduced_chi_square: single.chi_square / freedom(single),
            bic: bic(single, rows),
            chi_square_less: base.chi_square - single.chi_square,
        });
    }
    let [given, _] = trial.evidence.roles();
    let squares: f64 = trial.evidence.of(given).map(|c| c.noise_rad_per_s.powi(2) * c.record.rows() as f64).sum();
    Ok(Diagnosis {
        verdict,
        effects,
        ladder,
        candidates: contenders,
        noise_floor_rad_per_s: (squares / trial.evidence.rows(given) as f64).sqrt(),
        unexplained,
        suggested_experiment,
        cautions,
        extended,
    })
}

/// The best fit of one kind of effect, with its errors; None where none can be fitted.
pub(super) fn settle_one(
    evidence: &mut Evidence,
    model: &CoilModel,
    candidates: &[Candidate],
) -> Result<Option<Extension>, DiagnoseError> {
    let rows = evidence.rows(Role::Fit);
    let base = (Trial { evidence, model, candidates }).fit(&[], Effort::QUICK).ok_or(DiagnoseError::Unsolvable)?;
    let singles = all_singles(evidence, model, candidates, &base)?;
    let least = singles.into_iter().min_by(|a, b| bic(a, rows).total_cmp(&bic(b, rows)));
    let Some(mut best) = least else { return Ok(None) };
    let candidate = &candidates[best.members[0].candidate];
    if candidate.moves_heat() || candidate.moves_sensor() {
        best = settle(evidence, model, candidates, best, f64::INFINITY)?;
    }
    let trial = Trial { evidence, model, candidates };
    let Some(best) = trial.fit(&best.members, Effort { standard_errors: true, ..Effort::QUICK }) else {
        return Ok(None);
    };
    let Some(extended) = trial.model_of(&best.members) else { return Ok(None) };
    let inflation = inflation(&trial, &extended, &best, rows);
    let freedom = |h: &Hypothesis| (rows as f64 - h.parameters as f64 - 1.0).max(1.0);
    Ok(Some(Extension {
        finding: finding(&trial, &best, 0, Vec::new(), inflation),
        extended,
        reduced_chi_square_before: base.chi_square / freedom(&base),
        reduced_chi_square_after: best.chi_square / freedom(&best),
    }))
}

fn bic(hypothesis: &Hypothesis, rows: usize) -> f64 {
    hypothesis.chi_square + hypothesis.parameters as f64 * (rows as f64).ln()
}

fn cautions_of(evidence: &Evidence) -> Vec<Caution> {
    let mut cautions = Vec::new();
    for case in &evidence.cases {
        let record = case.record.name().to_owned();
        if case.outliers > 0 {
            cautions.push(Caution::Outliers { record: record.clone(), rows: case.outliers });
        }
        for channel in case.record.channels().iter().filter(|c| c.values.iter().any(|v| !v.is_finite())) {
            cautions.push(Caution::ChannelIncomplete { record: record.clone(), channel: channel.name.clone() });
        }
    }
    if evidence.rows(Role::Holdout) == 0 {
        cautions.push(Caution::NoHoldout);
    }
    cautions
}

/// What else would do in one member's place; a physical effect is preferred to an empirical one that does as well.
fn settle_equivalents(
    evidence: &mut Evidence,
    model: &CoilModel,
    candidates: &[Candidate],
    best: Hypothesis,
    place: usize,
    variance: f64,
) -> Result<(Hypothesis, Vec<Equivalent>), DiagnoseError> {
    // The boundaries may be those of the last one's equivalents.
    let best = settled(evidence, model, candidates, best)?;
    let trial = Trial { evidence, model, candidates };
    let Some(rest) = without(&trial, &best, place) else { return Ok((best, Vec::new())) };
    let rows = evidence.rows(Role::Fit);
    let mut others = fit_swap(&trial, &best, place, RIVALS);
    settle_contenders(evidence, model, candidates, &rest, &mut others)?;
    let trial = Trial { evidence, model, candidates };
    let total = |h: &Hypothesis| h.total() + h.parameters as f64 * (rows as f64).ln() * variance;
    let mut rivals: Vec<(f64, Hypothesis)> =
        std::iter::once(best).chain(others).map(|rival| (total(&rival), rival)).collect();
    let least = rivals.iter().map(|r| r.0).fold(f64::INFINITY, f64::min);
    let explained = rest.total() - rivals.iter().map(|r| r.1.total()).fold(f64::INFINITY, f64::min);
    let equal = (EQUAL * variance).max(EQUAL_SHARE.powi(2) * explained);
    rivals.retain(|(value, _)| *value < least + equal);
    // The closest make the set; within it a physical effect goes before an empirical one.
    rivals.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut closest: Vec<String> = Vec::new();
    rivals.retain(|(_, h)| {
        let kind = trial.candidates[h.members[place].candidate].kind();
        let new = closest.len() <= MAX_EQUIVALENTS && !closest.contains(&kind);
        if new {
            closest.push(kind);
        }
        new
    });
    let empirical = |h: &Hypothesis| trial.candidates[h.members[place].candidate].is_empirical();
    rivals.sort_by(|a, b| empirical(&a.1).cmp(&empirical(&b.1)).then(a.0.total_cmp(&b.0)));
    let mut rivals = rivals.into_iter();
    let Some((value, main)) = rivals.next() else { return Ok((rest, Vec::new())) };
    let response =
        |h: &Hypothesis| -> Vec<f64> { rest.residuals.iter().zip(&h.residuals).map(|(a, b)| a - b).collect() };
    let own = response(&main);
    let mut kinds = vec![trial.candidates[main.members[place].candidate].kind()];
    let mut equivalents = Vec::new();
    for (other, rival) in rivals {
        let member = &rival.members[place];
        let candidate = &trial.candidates[member.candidate];
        if kinds.contains(&candidate.kind()) || equivalents.len() == MAX_EQUIVALENTS {
            continue;
        }
        let Ok(effect) = candidate.effect.with_values(member.values.clone()) else { continue };
        let Some(extended) = trial.model_of(&rival.members) else { continue };
        kinds.push(candidate.kind());
        let theirs = response(&rival);
        let correlation =
            dot(&own, &theirs) / (sum_of_squares(&own) * sum_of_squares(&theirs)).sqrt().max(f64::MIN_POSITIVE);
        equivalents.push(Equivalent { effect, chi_square_more: other - value, correlation, extended });
    }
    Ok((main, equivalents))
}

/// By how much standard errors grow: residuals beyond the noise, and their autocorrelation.
fn inflation(trial: &Trial, model: &CoilModel, best: &Hypothesis, rows: usize) -> f64 {
    let Some(fit) = &best.fit else { return 1.0 };
    let mut correlated = 0.0;
    for case in trial.evidence.of(Role::Fit) {
        if let Some((residuals, _)) = case.plain_residuals(model, trial.evidence.pattern) {
            correlated += variance_inflation(&residuals) * case.record.rows() as f64 / rows as f64;
        }
    }
    let reduced = (best.chi_square / (rows as f64 - best.parameters as f64 - 1.0).max(1.0)).max(1.0);
    // The fit divided by the number of whitened values, which is larger than that of rows.
    let counted = fit.sum_of_squares / fit.degrees_of_freedom as f64;
    (correlated.max(1.0) * reduced / counted.max(f64::MIN_POSITIVE)).sqrt()
}

/// 1 + 2 Σ (1 − k/n) ρ_k up to the first lag that does not differ from zero.
fn variance_inflation(residuals: &[f64]) -> f64 {
    let n = residuals.len();
    let total = sum_of_squares(residuals);
    if total <= 0.0 {
        return 1.0;
    }
    let mut sum = 1.0;
    for lag in 1..n / 4 {
        let rho = dot(&residuals[lag..], &residuals[..n - lag]) / total;
        if rho < 2.0 / (n as f64).sqrt() {
            break;
        }
        sum += 2.0 * (1.0 - lag as f64 / n as f64) * rho;
    }
    sum
}

fn finding(trial: &Trial, best: &Hypothesis, place: usize, equivalents: Vec<Equivalent>, inflation: f64) -> Finding {
    let member = &best.members[place];
    let candidate = &trial.candidates[member.candidate];
    let before: usize = best.members[..place].iter().map(|m| trial.candidates[m.candidate].free.len()).sum();
    let parameters = candidate
        .effect
        .parameters()
        .into_iter()
        .enumerate()
        .map(|(i, declared)| {
            let fitted = candidate.free.iter().position(|&f| f == i).map(|k| before + k);
            let fit = best.fit.as_ref().zip(fitted);
            FittedParameter {
                key: declared.key,
                unit: declared.unit,
                value: member.values[i],
                standard_error: fit.and_then(|(f, k)| f.standard_errors[k]).map(|e| e * inflation),
                at_bound: fit.is_some_and(|(f, k)| f.at_bound[k]),
                fitted: fitted.is_some(),
            }
        })
        .collect();
    let effect = candidate.effect.with_values(member.values.clone()).unwrap_or_else(|_| candidate.effect.clone());
    let rest = without(trial, best, place);
    Finding {
        effect,
        parameters,
        equivalents,
        chi_square_less: rest.as_ref().map_or(0.0, |r| r.chi_square - best.chi_square),
        confirmed_by: rest.and_then(|r| confirmation(trial, best, &r)).unwrap_or(0.0),
    }
}

/// The errors after each accepted effect, the most effective first.
fn ladder(trial: &Trial, base: &Hypothesis, best: &Hypothesis) -> Vec<Rung> {
    let rows = |role: Role| trial.evidence.rows(role);
    let [given, held_out] = trial.evidence.roles();
    let chi_square = |h: &Hypothesis, role: Role| match role {
        Role::Fit => h.chi_square,
        Role::Holdout => h.unseen,
    };
    let reduced = |h: &Hypothesis, role: Role| {
        let fitted = match role {
            Role::Fit => h.parameters + 1,
            Role::Holdout => trial.evidence.of(role).count(),
        };
        chi_square(h, role) / (rows(role) as f64 - fitted as f64).max(1.0)
    };
    let rung = |h: &Hypothesis| -> Option<Rung> {
        let model = trial.model_of(&h.members)?;
        let rmse = |role: Role| -> Option<f64> {
            let mut squares = 0.0;
            for case in trial.evidence.of(role) {
                squares += sum_of_squares(&case.plain_residuals(&model, trial.evidence.pattern)?.0);
            }
            (rows(role) > 0).then(|| (squares / rows(role) as f64).sqrt())
        };
        Some(Rung {
            effects: h.members.iter().map(|m| trial.candidates[m.candidate].kind()).collect(),
            rmse_rad_per_s: rmse(given)?,
            holdout_rmse_rad_per_s: rmse(held_out),
            reduced_chi_square: reduced(h, given),
            holdout_reduced_chi_square: (rows(held_out) > 0).then(|| reduced(h, held_out)),
            bic: chi_square(h, given) + h.parameters as f64 * (rows(given) as f64).ln(),
        })
    };
    let mut rungs: Vec<Rung> = rung(base).into_iter().collect();
    let mut so_far: Vec<usize> = Vec::new();
    while so_far.len() + 1 < best.members.len() {
        let next = (0..best.members.len())
            .filter(|place| !so_far.contains(place))
            .filter_map(|place| {
                let chosen: Vec<_> = so_far.iter().chain([&place]).map(|&i| best.members[i].clone()).collect();
                Some((place, trial.fit(&chosen, Effort::QUICK)?))
            })
            .min_by(|a, b| a.1.chi_square.total_cmp(&b.1.chi_square));
        let Some((place, hypothesis)) = next else { break };
        so_far.push(place);
        rungs.extend(rung(&hypothesis));
    }
    if !best.members.is_empty() {
        rungs.extend(rung(best));
    }
    rungs
}

/// What is left over: how much, and what it goes with.
fn describe(trial: &Trial, model: &CoilModel, plain: Vec<Plain>, share_of_excess: f64) -> Unexplained {
    let (mut squares, mut noise, mut count) = (0.0, 0.0, 0);
    let mut sums: Vec<(String, f64, f64, f64)> = Vec::new();
    for case in trial.evidence.of(Role::Fit) {
        let Some((residuals, history)) = case.plain_residuals(model, trial.evidence.pattern) else { continue };
        squares += sum_of_squares(&residuals);
        noise += case.noise_rad_per_s.powi(2) * residuals.len() as f64;
        count += residuals.len();
        let layers = history.layers;
        let row = |f: &dyn Fn(usize) -> f64| (0..residuals.len()).map(f).collect::<Vec<f64>>();
        let mut columns = vec![
            ("time".to_owned(), case.record.times_s().to_vec()),
            ("temperature".to_owned(), row(&|i| history.temperatures_k(i)[layers - 1])),
            ("temperature rate".to_owned(), row(&|i| history.rates_k_per_s(i)[layers - 1])),
            (
                "rate of outer less inner temperature".to_owned(),
                row(&|i| history.rates_k_per_s(i)[layers - 1] - history.rates_k_per_s(i)[0]),
            ),
        ];
        columns.extend(
            case.record
                .channels()
                .iter()
                .filter(|c| c.values.iter().all(|v| v.is_finite()))
                .map(|c| (format!("channel:{}", c.name), c.values.clone())),
        );
        for (name, mut column) in columns {
            let mean = column.iter().sum::<f64>() / column.len() as f64;
            column.iter_mut().for_each(|v| *v -= mean);
            let found = sums.iter().position(|s| s.0 == name).unwrap_or_else(|| {
                sums.push((name, 0.0, 0.0, 0.0));
                sums.len() - 1
            });
            let entry = &mut sums[found];
            entry.1 += dot(&column, &residuals);
            entry.2 += sum_of_squares(&column);
            entry.3 += sum_of_squares(&residuals);
        }
    }
    let mut correlations: Vec<(String, f64)> = sums
        .into_iter()
        .filter(|(_, _, column, rest)| *column > 0.0 && *rest > 0.0)
        .map(|(name, cross, column, rest)| (name, cross / (column * rest).sqrt()))
        .collect();
    correlations.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
    Unexplained {
        excess_rad_per_s: ((squares - noise) / count.max(1) as f64).max(0.0).sqrt(),
        share_of_excess,
        correlations,
        plain,
    }
}

/// What to measure next.
fn experiment(verdict: Verdict, effects: &[Finding]) -> Option<String> {
    match verdict {
        Verdict::Adequate => None,
        Verdict::Unexplained => Some(
            "repeat the record with the disturbance that its period or time constant suggests switched off, and log what correlates with it"
                .to_owned(),
        ),
        Verdict::Missing => effects.first().map(|e| format!("to confirm {}: {}", e.effect.kind(), e.effect.spec().experiment)),
        Verdict::Indistinguishable => effects.iter().find(|e| !e.equivalents.is_empty()).map(|e| {
            let others = e.equivalents.iter().map(|o| format!("for {}: {}", o.effect.kind(), o.effect.spec().experiment));
            let own = format!("for {}: {}", e.effect.kind(), e.effect.spec().experiment);
            std::iter::once(own).chain(others).collect::<Vec<_>>().join("; ")
        }),
    }
}
