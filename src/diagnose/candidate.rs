//! What may be missing: the effects that a model lacks, as things to fit.

use crate::effect::{Acts, CATALOGUE, DeclaredEffect, EffectSpec, NOT_SOUGHT, Subject};
use crate::numeric::statistics::standard_deviation;
use crate::rate::CoilModel;
use crate::record::{Record, TABLE_RATE};
use crate::units::Unit;

/// An effect to try, with the parameters to fit and the points to start from.
#[derive(Debug, Clone)]
pub(crate) struct Candidate {
    pub(crate) effect: DeclaredEffect,
    /// Indices of the fitted parameters; the others keep their values.
    pub(crate) free: Vec<usize>,
    /// All parameters in SI, one vector a start.
    pub(crate) starts: Vec<Vec<f64>>,
    /// Of what is per unit of a column: how large it may be ([`crate::chamber::Free::deviation`]).
    pub(crate) deviation: Option<f64>,
}

/// Starts a candidate has at most.
const MAX_STARTS: usize = 6;

impl Candidate {
    pub(crate) fn kind(&self) -> String {
        self.effect.kind()
    }

    /// Whether it is about one of the coil's layers, and so has a sister for every other one.
    pub(crate) fn is_of_layer(&self) -> bool {
        self.effect.layer().is_some()
    }

    /// Whether it is another with more of its parameters free.
    pub(crate) fn is_fuller_than(&self, other: &Self) -> bool {
        self.free.len() > other.free.len()
            && self.kind() == other.kind()
            && self.effect.choices() == other.effect.choices()
            && self.effect.layer() == other.effect.layer()
    }

    /// Whether it says the same of a neighbouring layer.
    pub(crate) fn is_next_to(&self, other: &Self) -> bool {
        let apart = self.effect.layer().zip(other.effect.layer()).map(|(a, b)| a.abs_diff(b));
        self.kind() == other.kind() && apart == Some(1)
    }
}

/// Everything of the catalogue that the model does not have and that is looked for, and every further column that all
/// records share.
pub(crate) fn candidates(model: &CoilModel, records: &[&Record]) -> Vec<Candidate> {
    let mut all = all_candidates(model, records);
    all.retain(|c| NOT_SOUGHT.iter().all(|spec| spec.kind != c.effect.spec().kind));
    all
}

fn all_candidates(model: &CoilModel, records: &[&Record]) -> Vec<Candidate> {
    let present: Vec<String> = model.effects.iter().map(DeclaredEffect::kind).collect();
    let temperatures = temperature_quartiles_k(records);
    let mut all = Vec::new();
    let is_open = |spec: &EffectSpec| match spec.acts {
        Acts::ScaleFactor => turned(records),
        _ => true,
    };
    for spec in CATALOGUE.iter().filter(|s| is_open(s) && !present.iter().any(|p| p == s.kind)) {
        let count: usize = spec.choices.iter().map(|c| c.options.len()).product();
        for index in 0..count.max(1) {
            for candidate in of_spec(spec, choices_of(spec, index), &temperatures) {
                if candidate.is_of_layer() {
                    all.extend(of_each_layer(&candidate, model.coil.layers()));
                } else {
                    all.push(candidate);
                }
            }
        }
    }
    if let Some((first, others)) = records.split_first() {
        for channel in first.channels() {
            let varies = channel.values.iter().all(|v| v.is_finite())
                && channel.values.iter().any(|v| (v - channel.values[0]).abs() > 1e-9 * channel.values[0].abs());
            let shared = others
                .iter()
                .all(|r| r.channels().iter().any(|c| c.name == channel.name && c.values.iter().all(|v| v.is_finite())));
            let declared = present.contains(&format!("channel:{}", channel.name));
            // What follows the table's rate has effects of its own.
            if varies && shared && !declared && channel.name != TABLE_RATE {
                // As much as would make of the column all that the rate does.
                let Some(gain) = spread(first.rate_rad_per_s()).zip(spread(&channel.values)).map(|(r, c)| r / c) else {
                    continue;
                };
                let effect = DeclaredEffect::channel(channel.name.clone(), gain);
                let starts = vec![effect.values().to_vec()];
                all.push(Candidate { effect, free: vec![0], starts, deviation: Some(gain) });
            }
        }
    }
    all
}

/// Standard deviation of what is finite; None where it does not change.
fn spread(values: &[f64]) -> Option<f64> {
    let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    let spread = standard_deviation(&finite);
    (spread > 0.0).then_some(spread)
}

/// Whether a table turned the gyro at several rates in every record.
fn turned(records: &[&Record]) -> bool {
    let several = |values: &[f64]| {
        let finite = || values.iter().copied().filter(|v| v.is_finite());
        let (low, high) = finite().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        high > low && values.iter().all(|v| v.is_finite())
    };
    let table = |record: &Record| record.channels().iter().any(|c| c.name == TABLE_RATE && several(&c.values));
    !records.is_empty() && records.iter().all(|record| table(record))
}

/// The candidates of one kind; of a custom effect, itself.
pub(super) fn of_kind(model: &CoilModel, records: &[&Record], effect: &DeclaredEffect) -> Vec<Candidate> {
    if let Subject::Formula(_) = effect.subject() {
        let free = (0..effect.values().len()).collect();
        return vec![Candidate {
            effect: effect.clone(),
            free,
            starts: vec![effect.values().to_vec()],
            deviation: None,
        }];
    }
    all_candidates(model, records).into_iter().filter(|c| c.kind() == effect.kind()).collect()
}

/// The `index`-th combination of choices.
fn choices_of(spec: &EffectSpec, mut index: usize) -> Vec<usize> {
    spec.choices
        .iter()
        .map(|choice| {
            let chosen = index % choice.options.len();
            index /= choice.options.len();
            chosen
        })
        .collect()
}

/// The effect with its needed parameters alone, and with the optional ones too.
fn of_spec(spec: &'static EffectSpec, choices: Vec<usize>, temperatures_k: &[f64]) -> Vec<Candidate> {
    // Which layer is nothing to fit: every layer is a candidate of its own.
    let all: Vec<usize> = (0..spec.parameters.len()).filter(|&i| spec.parameters[i].unit != Unit::Layer).collect();
    let mut needed: Vec<usize> = all.iter().copied().filter(|&i| spec.parameters[i].default.is_none()).collect();
    if needed.is_empty() && !all.is_empty() {
        needed.push(0);
    }
    let mut frees = vec![needed];
    if frees[0] != all {
        frees.push(all);
    }
    frees
        .into_iter()
        .filter_map(|free| {
            let values: Vec<f64> = spec
                .parameters
                .iter()
                .enumerate()
                .map(|(i, p)| p.unit.to_si(if free.contains(&i) { p.start } else { p.default.unwrap_or(p.start) }))
                .collect();
            let effect = DeclaredEffect::new(spec, values.clone(), choices.clone()).ok()?;
            let mut starts = vec![values];
            for &parameter in &free {
                let options = starts_of(spec, parameter, temperatures_k);
                starts = starts
                    .iter()
                    .flat_map(|start| {
                        options.iter().map(move |&option| {
                            let mut moved = start.clone();
                            moved[parameter] = option;
                            moved
                        })
                    })
                    .collect();
            }
            starts.truncate(MAX_STARTS);
            Some(Candidate { effect, free, starts, deviation: None })
        })
        .collect()
}

/// The same of every layer that it can be about.
fn of_each_layer(candidate: &Candidate, layers: usize) -> Vec<Candidate> {
    let of_layer = candidate.effect.spec().parameters.iter().position(|p| p.unit == Unit::Layer);
    let Some(place) = of_layer else { return vec![candidate.clone()] };
    (1..=layers)
        .filter_map(|layer| {
            let there = |values: &[f64]| {
                let mut values = values.to_vec();
                values[place] = layer as f64;
                values
            };
            let effect = candidate.effect.with_values(there(candidate.effect.values())).ok()?;
            effect.check_layers(layers).ok()?;
            let starts = candidate.starts.iter().map(|s| there(s)).collect();
            Some(Candidate { effect, free: candidate.free.clone(), starts, deviation: None })
        })
        .collect()
}

/// Where to start a parameter: once if the response is linear in it, else at several points.
fn starts_of(spec: &EffectSpec, parameter: usize, temperatures_k: &[f64]) -> Vec<f64> {
    let p = spec.parameters[parameter];
    let stated: Vec<f64> = match p.unit {
        Unit::Celsius => return temperatures_k.to_vec(),
        // One start says which layer: the size is fitted then.
        _ if spec.parameters.iter().any(|p| p.unit == Unit::Layer) => vec![p.start],
        _ if p.lower > 0.0 && p.upper / p.lower >= 100.0 => vec![p.start, 0.2 * p.start, 5.0 * p.start],
        Unit::Second => vec![p.start, 4.0 * p.start],
        _ => vec![p.start],
    };
    stated.into_iter().map(|v| p.unit.to_si(v.clamp(p.lower, p.upper))).collect()
}

fn temperature_quartiles_k(records: &[&Record]) -> Vec<f64> {
    let mut all: Vec<f64> = records.iter().flat_map(|r| r.temperature_k().iter().copied()).collect();
    all.sort_by(f64::total_cmp);
    let (low, high) = match (all.first(), all.last()) {
        (Some(low), Some(high)) => (*low, *high),
        _ => return Vec::new(),
    };
    [0.5, 0.25, 0.75].iter().map(|share| low + share * (high - low)).collect()
}
