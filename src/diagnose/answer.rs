//! From posterior masses to a verdict, and everything that is said with it.
//!
//! *Adequate*: the declared model holds the mass. *Missing*: one set holds 95 % of it. *Indistinguishable*: the smallest
//! family that reaches 95 %, all of it. *Unexplained*: sets with wander, a cycle or an estimate beyond what is physical
//! hold half, or the coil is wound or connected otherwise: sets that say so hold 95 %, or half beside none of effects.

use std::collections::BTreeSet;

use super::caution::shared_rows;
use super::describe::{ScoredExplanation, contenders, driven, findings, ladder, names, unexplained};
use super::joint::{Explanation, Found, Member, Question, on_the_way};
use super::standing::CERTAIN;
use super::switched_film::film_switches;
use super::{Caution, DiagnoseError, Diagnosis, Hypothesis, OffsetStep, RecordNoise, Refitted, Share, Verdict};
use crate::chamber::{Chamber, Place};
use crate::record::Record;

/// What sets with something unknown in them must hold for that to be the answer.
const HALF: f64 = 0.5;

/// The whole answer; what is left of records is said by the chamber with `timed` kinks.
///
/// # Errors
/// A model that cannot be solved any more.
pub(super) fn answer(
    asked: &Question,
    timed: &Chamber,
    found: &Found,
    records: &[&Record],
) -> Result<Diagnosis, DiagnoseError> {
    let question = &Question { chamber: timed, ..asked.clone() };
    let declared = found.declared().ok_or(DiagnoseError::Unsolvable)?;
    let outside: f64 = found.explanations.iter().filter(|e| e.is_outside()).map(|e| e.probability).sum();
    let family = family(found);
    let top = family.first().copied().unwrap_or(declared);
    let (verdict, named) = match outside >= HALF {
        true => (Verdict::Unexplained, declared),
        false => verdict(question, found, &family, top),
    };
    let likeliest =
        if outside >= HALF { found.explanations.iter().find(|e| e.is_outside()).unwrap_or(top) } else { top };
    let between = on_the_way(asked, named)?;
    let to = (!std::ptr::eq(named, declared)).then_some(named);
    let steps = ScoredExplanation::all(question, std::iter::once(declared).chain(&between).chain(to))?;
    let (first, scored) = (&steps[0], &steps[steps.len() - 1]);
    let noise = noises(question, likeliest)?;
    let squares: f64 = noise.iter().take(question.fitted.len()).map(|n| n.noise.white_rad_per_s.powi(2)).sum();
    let noise_floor = (squares / question.fitted.len().max(1) as f64).sqrt();
    let equals: &[&Explanation] = if verdict == Verdict::Indistinguishable { &family } else { &[] };
    let effects = findings(question, scored, first, equals)?;
    let hypothesis = hypothesis(question, found, named);
    let film_switches = film_switches(question, named);
    let mut cautions = cautions(question.chamber, records);
    cautions.extend(film_switches.iter().cloned().map(Caution::FilmSwitched));
    let winding = hypothesis.as_ref().and_then(|h| h.winding);
    cautions.extend(winding.map(|winding| Caution::OtherWinding { winding }));
    cautions.extend(question.held_out.is_empty().then_some(Caution::NoHoldout));
    let suggested_experiment = experiment(verdict, &effects);
    Ok(Diagnosis {
        verdict,
        ladder: ladder(question, &steps, &noise)?,
        candidates: contenders(question, found, declared),
        noise_floor_rad_per_s: noise_floor,
        unexplained: match verdict {
            Verdict::Unexplained => Some(unexplained(question, first, likeliest)?),
            _ => None,
        },
        suggested_experiment,
        cautions,
        extended: named.fit.assumed.model.clone(),
        boundary: question.chamber.learned(&named.fit)?,
        driven: driven(question, [first, scored])?,
        posterior: posterior(question, found),
        refitted: refitted(question, named),
        hypothesis,
        film_switches,
        noise,
        effects,
        proposals: Vec::new(),
    })
}

/// The verdict where no half of the mass is with something unknown, and the set that is named.
fn verdict<'e>(
    question: &Question,
    found: &Found,
    family: &[&'e Explanation],
    top: &'e Explanation,
) -> (Verdict, &'e Explanation) {
    let rewound = |e: &Explanation| e.members.iter().any(|m| matches!(m, Member::Winding(_)));
    let wound: f64 = found.explanations.iter().filter(|e| rewound(e) && !e.is_outside()).map(|e| e.probability).sum();
    // Where effects may explain the records none the less, the likeliest of them is named, and the winding beside them.
    let by_effects = family.iter().find(|e| !rewound(e) && !e.effects(question).is_empty());
    if wound >= HALF {
        let is_certain = wound >= CERTAIN * known(found).map(|e| e.probability).sum::<f64>();
        match by_effects {
            Some(effects) if !is_certain => (Verdict::Indistinguishable, *effects),
            _ => (Verdict::Unexplained, top),
        }
    } else if top.members.is_empty() {
        (Verdict::Adequate, top)
    } else if family.len() > 1 && distinct(question, family) > 1 {
        (Verdict::Indistinguishable, if rewound(top) { by_effects.copied().unwrap_or(top) } else { top })
    } else if top.members.iter().all(|m| matches!(m, Member::Step { .. })) {
        (Verdict::Unexplained, top)
    } else {
        (Verdict::Missing, top)
    }
}

/// Sets without anything unknown.
fn known(found: &Found) -> impl Iterator<Item = &Explanation> {
    found.explanations.iter().filter(|e| !e.is_outside() || e.members.is_empty())
}

/// The smallest family of sets without anything unknown that holds 95 % of what such sets hold.
fn family(found: &Found) -> Vec<&Explanation> {
    let total: f64 = known(found).map(|e| e.probability).sum();
    let mut sum = 0.0;
    let mut family = Vec::new();
    for explanation in known(found) {
        if sum >= CERTAIN * total && !family.is_empty() {
            break;
        }
        sum += explanation.probability;
        family.push(explanation);
    }
    family
}

/// How many sets of effects a family holds, whatever parameters are free in them.
fn distinct(question: &Question, family: &[&Explanation]) -> usize {
    let seen: BTreeSet<Vec<String>> = family.iter().map(|e| sorted(names(question, e))).collect();
    seen.len()
}

pub(super) fn posterior(question: &Question, found: &Found) -> Vec<Share> {
    let mut shares: Vec<Share> = Vec::new();
    for explanation in found.explanations.iter().filter(|e| e.probability > 1e-6) {
        let effects = names(question, explanation);
        let named = sorted(effects.clone());
        match shares.iter_mut().find(|s| sorted(s.effects.clone()) == named) {
            Some(share) => share.probability += explanation.probability,
            None => shares.push(Share {
                effects,
                probability: explanation.probability,
                hypothesis: hypothesis(question, found, explanation),
                members: explanation.fit.assumed.model.effects.clone(),
                estimates: explanation.fit.effect_estimates(),
            }),
        }
    }
    shares
}

/// A set's names, whatever order they joined it in.
fn sorted(mut names: Vec<String>) -> Vec<String> {
    names.sort();
    names
}

/// Declared numbers that were fitted anew.
fn refitted(question: &Question, named: &Explanation) -> Vec<Refitted> {
    let places = named.fit.parameters.iter().filter_map(|p| match p.place {
        Place::Effect { effect, parameter } if effect < question.model.effects.len() => {
            Some((p.place, effect, parameter))
        }
        _ => None,
    });
    places
        .filter_map(|(place, effect, parameter)| {
            let declared = &question.model.effects[effect];
            let own = &declared.parameters()[parameter];
            let (value, error) = named.fit.value(place)?;
            Some(Refitted {
                kind: declared.kind(),
                parameter: own.key.clone(),
                unit: own.unit,
                declared: declared.values()[parameter],
                value,
                standard_error: error.is_finite().then_some(error),
            })
        })
        .collect()
}

/// What is no effect and yet explains the records.
pub(super) fn hypothesis(question: &Question, found: &Found, named: &Explanation) -> Option<Hypothesis> {
    let mut said = Hypothesis::default();
    let mut steps = 0;
    for member in &named.members {
        match member {
            Member::Winding(place) => {
                let winding = &found.windings[*place];
                said.winding = winding.classic;
                said.reversed = winding.reversed;
                said.exchanged = winding.exchanged.map(|(a, b)| (a + 1, b + 1));
            }
            Member::Step { record, row } => {
                let size = named.fit.assumed.inputs.get(steps).map_or(0.0, |i| i.amplitude);
                steps += 1;
                said.offset_steps.push(OffsetStep {
                    record: question.chamber.record(*record).name().to_owned(),
                    time_s: question.chamber.times_s(*record)[*row],
                    size_rad_per_s: size,
                });
            }
            _ => {}
        }
    }
    (said != Hypothesis::default()).then_some(said)
}

pub(super) fn noises(question: &Question, explanation: &Explanation) -> Result<Vec<RecordNoise>, DiagnoseError> {
    let chamber = question.chamber;
    let mut all = Vec::new();
    for &record in &question.fitted {
        all.push(RecordNoise {
            record: chamber.record(record).name().to_owned(),
            noise: chamber.noise(&explanation.fit, record)?,
        });
    }
    for &record in &question.held_out {
        let fit = chamber.held_out(&explanation.fit, record)?;
        all.push(RecordNoise { record: chamber.record(record).name().to_owned(), noise: chamber.noise(&fit, record)? });
    }
    Ok(all)
}

fn cautions(chamber: &Chamber, records: &[&Record]) -> Vec<Caution> {
    let mut cautions = shared_rows(records);
    for (place, record) in records.iter().enumerate() {
        let name = record.name().to_owned();
        if chamber.spikes(place) > 0 {
            cautions.push(Caution::Outliers { record: name.clone(), rows: chamber.spikes(place) });
        }
        for channel in record.channels().iter().filter(|c| c.values.iter().any(|v| !v.is_finite())) {
            cautions.push(Caution::ChannelIncomplete { record: name.clone(), channel: channel.name.clone() });
        }
    }
    cautions
}

/// What to measure next.
fn experiment(verdict: Verdict, effects: &[super::Finding]) -> Option<String> {
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
