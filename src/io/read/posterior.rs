//! Models that may be the true one, drawn from what a diagnosis says: every set of explanations by its posterior
//! probability, its parameters by their joint covariance.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use statrs::distribution::{ContinuousCDF, Normal};

use crate::effect::{self, DeclaredEffect};
use crate::io::json::diagnosis::{MemberJson, PosteriorShareJson, RefittedJson};
use crate::rate::CoilModel;

/// What is left out of sets that hold less than this of the probability.
const LEAST_PROBABILITY: f64 = 0.01;

/// Models drawn from a posterior; none where nothing in it is uncertain. `design` is what is searched, the boundary that
/// the records showed included; `refitted` are declared or learned numbers with errors of their own. The same seed gives
/// the same models.
pub fn drawn_models(
    design: &CoilModel,
    posterior: &[PosteriorShareJson],
    refitted: &[RefittedJson],
    count: usize,
    seed: u64,
) -> Vec<CoilModel> {
    let shares: Vec<&PosteriorShareJson> = posterior.iter().filter(|s| s.probability >= LEAST_PROBABILITY).collect();
    let total: f64 = shares.iter().map(|s| s.probability).sum();
    let learned: Vec<&RefittedJson> = refitted.iter().filter(|r| r.standard_error.is_some()).collect();
    let is_uncertain = shares.len() > 1 || shares.iter().any(|s| !s.estimates.is_empty()) || !learned.is_empty();
    if !is_uncertain {
        return Vec::new();
    }
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let normal = Normal::standard();
    let mut draw = || normal.inverse_cdf(random.random::<f64>().clamp(f64::MIN_POSITIVE, 1.0 - f64::EPSILON));
    (0..count)
        .filter_map(|k| {
            // Sets share the models by their probabilities, without chance.
            let place = (k as f64 + 0.5) / count as f64 * total;
            let mut sum = 0.0;
            let share = shares.iter().find(|s| {
                sum += s.probability;
                place <= sum
            });
            let mut effects = match share {
                Some(share) => drawn_effects(share, design, &mut draw)?,
                None => design.effects.clone(),
            };
            for number in &learned {
                let already = share.is_some_and(|s| {
                    s.estimates.iter().any(|e| {
                        s.members.get(e.member).is_some_and(|m| m.kind == number.kind)
                            && e.parameter == number.parameter
                    })
                });
                if !already {
                    move_by_error(&mut effects, number, draw());
                }
            }
            Some(CoilModel { effects, ..design.clone() })
        })
        .collect()
}

/// The effects of one set at values drawn from their covariance. What the design has beside the set, such as a film that
/// was learned or the stress of its materials, stays; what it has in the place of another member of the set does not.
fn drawn_effects(
    share: &PosteriorShareJson,
    design: &CoilModel,
    draw: &mut impl FnMut() -> f64,
) -> Option<Vec<DeclaredEffect>> {
    let mut effects: Vec<DeclaredEffect> = Vec::with_capacity(share.members.len());
    for member in &share.members {
        effects.push(effect_of(member, design)?);
    }
    for (estimate, shift) in share.estimates.iter().zip(correlated(&share.correlation, draw)) {
        let effect = effects.get_mut(estimate.member)?;
        let parameters = effect.parameters();
        let at = parameters.iter().position(|p| p.key == estimate.parameter)?;
        let drawn = if estimate.logarithmic {
            estimate.value * (shift * estimate.standard_error / estimate.value).exp()
        } else {
            estimate.value + shift * estimate.standard_error
        };
        *effect = at_value(effect, at, parameters[at].unit.to_si(drawn));
    }
    if let Some(film) = design.effects.iter().find(|e| e.is_at(effect::FILM))
        && !effects.iter().any(|e| e.is_at(effect::FILM))
    {
        effects.push(film.clone());
    }
    let of_materials = |e: &&DeclaredEffect| e.spec().kind == effect::THERMAL_STRESS.kind;
    if let Some(stress) = design.effects.iter().find(of_materials)
        && !effects.iter().any(|e| of_materials(&e))
    {
        effects.push(stress.clone());
    }
    Some(effects)
}

fn effect_of(member: &MemberJson, design: &CoilModel) -> Option<DeclaredEffect> {
    let declared = design.effects.iter().find(|e| e.kind() == member.kind);
    let start = match (declared, effect::find(&member.kind)) {
        (Some(declared), _) => declared.clone(),
        (None, Some(spec)) => {
            let choices = spec.choices.iter().map(|choice| {
                let stated = member.choices.get(choice.key)?;
                choice.options.iter().position(|option| option == stated)
            });
            let values = DeclaredEffect::at_start(spec).values().to_vec();
            DeclaredEffect::new(spec, values, choices.collect::<Option<_>>()?).ok()?
        }
        (None, None) => DeclaredEffect::channel(member.kind.strip_prefix("channel:")?, 0.0),
    };
    let values = start.parameters().into_iter().zip(start.values());
    let values = values.map(|(p, &si)| member.values.get(&p.key).map_or(si, |v| p.unit.to_si(*v))).collect();
    start.with_values(values).ok()
}

/// The effect with one value changed, as far as its bounds allow.
fn at_value(effect: &DeclaredEffect, at: usize, si: f64) -> DeclaredEffect {
    let mut values = effect.values().to_vec();
    let parameter = &effect.parameters()[at];
    values[at] = si.clamp(parameter.lower, parameter.upper);
    effect.with_values(values).unwrap_or_else(|_| effect.clone())
}

fn move_by_error(effects: &mut [DeclaredEffect], number: &RefittedJson, shift: f64) {
    let Some(effect) = effects.iter_mut().find(|e| e.kind() == number.kind) else { return };
    let parameters = effect.parameters();
    if let Some(at) = parameters.iter().position(|p| p.key == number.parameter) {
        let drawn = number.value + shift * number.standard_error.unwrap_or(0.0);
        *effect = at_value(effect, at, parameters[at].unit.to_si(drawn));
    }
}

/// Standard normal deviates with a correlation: its Cholesky factor times independent ones. Where the correlation is none,
/// independent ones.
fn correlated(correlation: &[Vec<f64>], draw: &mut impl FnMut() -> f64) -> Vec<f64> {
    let count = correlation.len();
    let independent: Vec<f64> = (0..count).map(|_| draw()).collect();
    let mut factor = vec![vec![0.0_f64; count]; count];
    for i in 0..count {
        for k in 0..=i {
            let entry = correlation[i].get(k).copied().unwrap_or(0.0);
            let sum: f64 = entry - (0..k).map(|m| factor[i][m] * factor[k][m]).sum::<f64>();
            factor[i][k] = if i == k {
                sum.max(0.0).sqrt()
            } else if factor[k][k] > 0.0 {
                sum / factor[k][k]
            } else {
                0.0
            };
        }
    }
    factor.iter().map(|row| row.iter().zip(&independent).map(|(f, z)| f * z).sum()).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::io::json::diagnosis::PosteriorEstimateJson;
    use crate::units::Unit;

    fn design() -> CoilModel {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/coil-998m.toml");
        crate::io::read::model_file::read_model(&path).unwrap().model
    }

    fn mismatch(value: f64) -> MemberJson {
        let values = BTreeMap::from([("mismatch".to_owned(), value)]);
        MemberJson { kind: "strain_mismatch".to_owned(), choices: BTreeMap::new(), values }
    }

    fn share(members: Vec<MemberJson>, probability: f64, error: Option<f64>) -> PosteriorShareJson {
        let estimate = |standard_error| PosteriorEstimateJson {
            member: 0,
            parameter: "mismatch".to_owned(),
            value: 0.004,
            standard_error,
            unit: Unit::One.symbol().to_owned(),
            logarithmic: false,
        };
        PosteriorShareJson {
            effects: members.iter().map(|m| m.kind.clone()).collect(),
            probability,
            hypothesis: None,
            members,
            estimates: error.into_iter().map(estimate).collect(),
            correlation: if error.is_some() { vec![vec![1.0]] } else { Vec::new() },
        }
    }

    #[test]
    fn models_are_drawn_by_probability_and_by_error_behind_the_design_s_film() {
        let with = share(vec![mismatch(0.004)], 0.75, Some(0.001));
        let models = drawn_models(&design(), &[with, share(Vec::new(), 0.25, None)], &[], 400, 1);
        let mismatches: Vec<f64> = models
            .iter()
            .filter_map(|m| m.effects.iter().find(|e| e.kind() == "strain_mismatch"))
            .map(|e| e.values()[0])
            .collect();
        assert_eq!((models.len(), mismatches.len()), (400, 300));
        let mean = mismatches.iter().sum::<f64>() / 300.0;
        let variance = mismatches.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / 299.0;
        assert!((mean - 0.004).abs() < 3.0 * 0.001 / 300f64.sqrt(), "{mean}");
        assert!((variance.sqrt() / 0.001 - 1.0).abs() < 0.15, "{variance}");
        assert!(models.iter().all(|m| m.effects.iter().any(|e| e.is_at(effect::FILM))));
    }

    #[test]
    fn what_is_certain_is_not_drawn() {
        assert!(drawn_models(&design(), &[share(Vec::new(), 1.0, None)], &[], 8, 1).is_empty());
    }

    #[test]
    fn deviates_have_the_correlation_that_is_asked_for() {
        let mut random = ChaCha8Rng::seed_from_u64(4);
        let normal = Normal::standard();
        let mut draw = || normal.inverse_cdf(random.random::<f64>().max(f64::MIN_POSITIVE));
        let correlation = vec![vec![1.0, -0.8], vec![-0.8, 1.0]];
        let pairs: Vec<Vec<f64>> = (0..4000).map(|_| correlated(&correlation, &mut draw)).collect();
        let mean = pairs.iter().map(|p| p[0] * p[1]).sum::<f64>() / 4000.0;
        assert!((mean + 0.8).abs() < 0.06, "{mean}");
    }
}
