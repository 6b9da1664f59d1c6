//! Records whose film between air and pack changes while they run, as where a fan is switched.
//!
//! To a model with one film such a record lacks something, or its air jumps. When the film is switched and what is missing in the coil
//! are found in turns: each by what the other is so far, for as long as the records are explained better.
//!
//! ```text
//! M(set, switches) = M(set) − Σ ln(rows) a switch − ln 50 a record that has any
//! ```

use super::DiagnoseError;
use super::joint::{self, Explanation, Found, Question};
use crate::chamber::{Assumption, Chamber, ChamberError, Effort, FilmSwitches, Films, Fit};
use crate::record::Record;

/// Turns, and what a further one must gain.
const MOST_TURNS: usize = 3;
const LEAST_GAIN: f64 = 3.0;
/// What a switch gains in one record, its air not looked through, is known to so much: sets that are further behind are no use.
const NEARLY: f64 = 20.0;

/// What was found behind one film, or, where a film that is switched explains the records better, the chamber with it and what is found
/// there.
///
/// # Errors
/// A model that cannot be solved for these records.
pub(super) fn in_turns<'a>(
    question: &Question,
    records: &[&'a Record],
    mut found: Found,
) -> Result<(Option<Chamber<'a>>, Found), DiagnoseError> {
    let whole = Chamber::new(question.model, records)?;
    let mut switched: Option<Chamber> = None;
    for _ in 0..MOST_TURNS {
        let here = Question { chamber: switched.as_ref().unwrap_or(question.chamber), ..question.clone() };
        let mut best: Option<(f64, Chamber, Found)> = None;
        for (chamber, null) in better(&whole, &here, &found)? {
            let there = Question { chamber: &chamber, ..question.clone() };
            let found = joint::ranked(&there, null, &|_| ())?;
            let merit = there.most(&found);
            if best.as_ref().is_none_or(|best| merit > best.0) {
                best = Some((merit, chamber, found));
            }
        }
        let Some((_, chamber, there)) = best else { break };
        (switched, found) = (Some(chamber), there);
    }
    Ok((switched, found))
}

/// The chamber in which the film of some record is switched otherwise than in that of the question, and the fit of the declared model
/// there, if that, or the best set, explains the records better than any set has so far; where the model states one of the two films,
/// also the chamber in which that is the other. None where nothing is better.
fn better<'a>(
    whole: &Chamber<'a>,
    question: &Question,
    found: &Found,
) -> Result<Vec<(Chamber<'a>, Fit)>, ChamberError> {
    let mut asked: Vec<&Explanation> = found.explanations.first().into_iter().chain(found.declared()).collect();
    asked.dedup_by(|a, b| a.members == b.members);
    let (price, most) = (question.chamber.film_price(&question.fitted), question.most(found));
    let mut better: Option<(f64, Chamber, Fit)> = None;
    for explanation in asked {
        let Some((switched, gain)) = whole.with_switched_film(&explanation.fit)? else { continue };
        if explanation.merit - price + gain < most - NEARLY {
            continue;
        }
        let usual = whole.switched_like(question.chamber, Films::Same);
        let Some((chamber, fit)) = with_shocks_where_needed(&switched, &usual, &explanation.fit, &question.fitted)?
        else {
            continue;
        };
        let there = Question { chamber: &chamber, ..question.clone() };
        let there = Explanation::new(&there, &found.windings, explanation.members.clone(), fit);
        let merit = there.merit - chamber.film_price(&question.fitted);
        if merit > better.as_ref().map_or(most + LEAST_GAIN, |best| best.0) {
            better = Some((merit, chamber, there.fit));
        }
    }
    let Some((_, chamber, fit)) = better else { return Ok(Vec::new()) };
    let declared = Assumption::new(question.model.clone(), question.pattern.clone());
    let of_declared = |chamber: Chamber<'a>, fit: &Fit| -> Result<(Chamber<'a>, Fit), ChamberError> {
        let null = chamber.fit(&declared, &[], &question.fitted, Some(fit), Effort::FULL)?;
        Ok((chamber, null))
    };
    let states_a_film = !question.model.heat_path()?.film_is_unknown();
    let exchanged = states_a_film.then(|| {
        let exchanged = whole.switched_like(&chamber, Films::Exchanged);
        let (exchanged, there) = exchanged.with_shocks_by(fit.clone(), &question.fitted)?;
        of_declared(exchanged, &there)
    });
    std::iter::once(of_declared(chamber, &fit)).chain(exchanged).collect()
}

/// The records with those switches that explain one better than it is explained without them, and a fit there; None where none does.
/// Shocks of either chamber are found by the same fit, because being looked through once more explains a record better by itself.
fn with_shocks_where_needed<'a>(
    switched: &Chamber<'a>,
    usual: &Chamber<'a>,
    fit: &Fit,
    fitted: &[usize],
) -> Result<Option<(Chamber<'a>, Fit)>, ChamberError> {
    let shocked = |chamber: &Chamber<'a>| chamber.clone().with_shocks_by(fit.clone(), fitted);
    let (with, without) = crate::parallel::join(|| shocked(switched), || shocked(usual));
    let ((with, with_fit), (without, without_fit)) = (with?, without?);
    let changed: Vec<usize> =
        (0..with.records()).filter(|&r| with.film_switches_s(r) != without.film_switches_s(r)).collect();
    let mut needless = Vec::new();
    for &r in &changed {
        if with.gain_over(&with_fit, (&without, &without_fit), r)? < 0.0 {
            needless.push(r);
        }
    }
    if needless.is_empty() {
        return Ok(Some((with, with_fit)));
    }
    if needless.len() == changed.len() {
        return Ok(None);
    }
    shocked(&switched.with_films_of(usual, &needless)).map(Some)
}

/// Records of the question's chamber whose film is switched, with what a set found it to be.
pub(super) fn film_switches(question: &Question, named: &Explanation) -> Vec<FilmSwitches> {
    let of = |&r: &usize| {
        let day = std::iter::once(&named.fit).chain(&*named.fit.days).find(|fit| fit.records.contains(&r));
        question.chamber.film_switches(r, day)
    };
    question.fitted.iter().chain(&question.held_out).filter_map(of).collect()
}
