//! The JSON document of `diagnose`, which is also read back for reports.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::chamber::EffectEstimate;
use crate::diagnose::experiment::Experiment;
use crate::diagnose::{
    Contender, Diagnosis, Equivalent, Finding, FittedParameter, Plain, Refitted, ResidualShape, Rung, Share,
    Unexplained, Verdict,
};
use crate::effect::DeclaredEffect;
use crate::units::deg_per_h_from_rad_per_s;

use super::boundary::BoundaryJson;
use super::experiment::ExperimentJson;
use super::hypothesis::{FilmSwitchesJson, HypothesisJson};
use super::inputs::InputsJson;
pub(crate) use super::noise::RecordNoiseJson;
use super::proposals::ProposalJson;

/// The answer of `diagnose`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct DiagnosisJson {
    pub(crate) model: String,
    pub(crate) verdict: String,
    pub(crate) effects: Vec<FindingJson>,
    pub(crate) ladder: Vec<RungJson>,
    pub(crate) candidates: Vec<ContenderJson>,
    pub(crate) noise_floor_deg_per_h: f64,
    /// Null where no record was held out.
    pub(crate) holdout_noise_floor_deg_per_h: Option<f64>,
    /// What each step of the ladder bought, in words.
    pub(crate) ladder_in_words: Vec<String>,
    /// Null unless the verdict is `unexplained`.
    pub(crate) unexplained: Option<UnexplainedJson>,
    pub(crate) suggested_experiment: Option<String>,
    /// The profile that would tell the candidates apart; null unless it was asked for and there is something to tell apart.
    pub(crate) experiment: Option<ExperimentJson>,
    pub(crate) cautions: Vec<String>,
    /// Sets of explanations with their posterior probability, largest first.
    #[serde(default)]
    pub posterior: Vec<PosteriorShareJson>,
    /// Declared numbers that the records contradict.
    #[serde(default)]
    pub refitted: Vec<RefittedJson>,
    /// Another winding, a coil connected the other way round, steps of the offset; null where none of these won.
    #[serde(default)]
    pub(crate) hypothesis: Option<HypothesisJson>,
    /// Records in which the film between air and pack changes to another one and back.
    #[serde(default)]
    pub(crate) film_switches: Vec<FilmSwitchesJson>,
    /// White noise, wander and unresolved air of each record, fitted ones first.
    #[serde(default)]
    pub(crate) noise: Vec<RecordNoiseJson>,
    /// Formulas for what no listed effect explains, best first.
    #[serde(default)]
    pub(crate) proposals: Vec<ProposalJson>,
    /// What the records showed of film, offset and chamber, with the accepted effects.
    pub(crate) boundary: BoundaryJson,
    pub(crate) inputs: InputsJson,
}

/// One set of effects and its probability.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct PosteriorShareJson {
    pub(crate) effects: Vec<String>,
    pub(crate) probability: f64,
    /// Which winding, which way round, which steps of the offset: of a set that has one of these.
    #[serde(default)]
    pub(crate) hypothesis: Option<HypothesisJson>,
    /// All effects of the model that the set makes of the declared one, the declared ones first.
    #[serde(default)]
    pub(crate) members: Vec<MemberJson>,
    /// What the records say of the members' parameters.
    #[serde(default)]
    pub(crate) estimates: Vec<PosteriorEstimateJson>,
    /// Of the estimates, or of their logarithms where that is what is normal.
    #[serde(default)]
    pub(crate) correlation: Vec<Vec<f64>>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct MemberJson {
    pub(crate) kind: String,
    pub(crate) choices: BTreeMap<String, String>,
    pub(crate) values: BTreeMap<String, f64>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct PosteriorEstimateJson {
    /// Place among the members, counted from 0.
    pub(crate) member: usize,
    pub(crate) parameter: String,
    pub(crate) value: f64,
    pub(crate) standard_error: f64,
    pub(crate) unit: String,
    /// Whether the logarithm of the value is what is normal; its error is then that over the value.
    pub(crate) logarithmic: bool,
}

/// A declared number that was fitted anew.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct RefittedJson {
    pub(crate) kind: String,
    pub(crate) parameter: String,
    pub(crate) declared: f64,
    pub(crate) value: f64,
    pub(crate) standard_error: Option<f64>,
    pub(crate) unit: String,
}

/// One row of a record: what the declared model and the one with the accepted effects leave.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct DiagnosisRow {
    pub(crate) time_s: f64,
    pub(crate) residual_declared_deg_per_h: f64,
    pub(crate) residual_extended_deg_per_h: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct FindingJson {
    pub(crate) kind: String,
    pub(crate) parameters: BTreeMap<String, FittedParameterJson>,
    /// The words among which the effect lets one choose, such as `lead`.
    pub(crate) choices: BTreeMap<String, String>,
    /// Kinds that explain the records equally well.
    pub(crate) equivalents: Vec<String>,
    pub(crate) equivalents_in_detail: Vec<EquivalentJson>,
    /// By how much χ² rises without it, on fitted and on unseen data.
    pub(crate) chi_square_less: f64,
    pub(crate) confirmed_by: f64,
    /// What happens in the coil, and what to do about it; empty in documents of older versions.
    #[serde(default)]
    pub(crate) happens: String,
    #[serde(default)]
    pub(crate) remedy: String,
    pub(crate) experiment: String,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct FittedParameterJson {
    pub(crate) value: f64,
    /// Null where the records do not determine it, at a bound, or where it was held.
    pub(crate) standard_error: Option<f64>,
    pub(crate) unit: String,
    pub(crate) fitted: bool,
    pub(crate) at_bound: bool,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct EquivalentJson {
    pub(crate) kind: String,
    pub(crate) choices: BTreeMap<String, String>,
    pub(crate) chi_square_more: f64,
    /// Of the two predicted responses in these records.
    pub(crate) correlation: f64,
    #[serde(default)]
    pub(crate) happens: String,
    #[serde(default)]
    pub(crate) remedy: String,
    pub(crate) experiment: String,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct RungJson {
    pub(crate) effects: Vec<String>,
    pub(crate) rmse_deg_per_h: f64,
    pub(crate) holdout_rmse_deg_per_h: Option<f64>,
    pub(crate) reduced_chi_square: f64,
    pub(crate) holdout_reduced_chi_square: Option<f64>,
    pub(crate) bic: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct ContenderJson {
    pub(crate) kind: String,
    pub(crate) choices: BTreeMap<String, String>,
    pub(crate) reduced_chi_square: f64,
    pub(crate) bic: f64,
    pub(crate) chi_square_less: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct UnexplainedJson {
    pub(crate) excess_deg_per_h: f64,
    pub(crate) share_of_excess: f64,
    pub(crate) correlations: Vec<UnexplainedCorrelationJson>,
    pub(crate) plain: Vec<PlainJson>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct UnexplainedCorrelationJson {
    pub(crate) with: String,
    pub(crate) correlation: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct PlainJson {
    pub(crate) shape: String,
    pub(crate) period_s: Option<f64>,
    pub(crate) time_constant_s: Option<f64>,
    pub(crate) rms_deg_per_h: f64,
    pub(crate) chi_square_less: f64,
}

fn choices(effect: &DeclaredEffect) -> BTreeMap<String, String> {
    let specs = effect.spec().choices.iter().zip(effect.choices());
    specs.map(|(choice, &index)| (choice.key.to_owned(), choice.options[index].to_owned())).collect()
}

impl DiagnosisJson {
    /// `holdout_noise_rad_per_s` is that of the records that were held out, if there are any.
    pub(crate) fn new(
        model: &str,
        diagnosis: &Diagnosis,
        holdout_noise_rad_per_s: Option<f64>,
        experiment: Option<&Experiment>,
        inputs: InputsJson,
    ) -> Self {
        let mut document = Self {
            model: model.to_owned(),
            verdict: match diagnosis.verdict {
                Verdict::Adequate => "adequate",
                Verdict::Missing => "missing",
                Verdict::Indistinguishable => "indistinguishable",
                Verdict::Unexplained => "unexplained",
            }
            .to_owned(),
            effects: diagnosis.effects.iter().map(FindingJson::new).collect(),
            ladder: diagnosis.ladder.iter().map(RungJson::new).collect(),
            candidates: diagnosis.candidates.iter().map(ContenderJson::new).collect(),
            noise_floor_deg_per_h: deg_per_h_from_rad_per_s(diagnosis.noise_floor_rad_per_s),
            unexplained: diagnosis.unexplained.as_ref().map(UnexplainedJson::new),
            suggested_experiment: diagnosis.suggested_experiment.clone(),
            cautions: diagnosis.cautions.iter().map(ToString::to_string).collect(),
            holdout_noise_floor_deg_per_h: holdout_noise_rad_per_s.map(deg_per_h_from_rad_per_s),
            experiment: experiment.map(|e| ExperimentJson::new(e, diagnosis.noise_floor_rad_per_s)),
            ladder_in_words: Vec::new(),
            posterior: diagnosis.posterior.iter().map(PosteriorShareJson::new).collect(),
            refitted: diagnosis.refitted.iter().map(RefittedJson::new).collect(),
            hypothesis: diagnosis.hypothesis.as_ref().map(HypothesisJson::new),
            film_switches: diagnosis.film_switches.iter().map(FilmSwitchesJson::new).collect(),
            noise: diagnosis.noise.iter().map(RecordNoiseJson::new).collect(),
            proposals: diagnosis.proposals.iter().map(ProposalJson::new).collect(),
            boundary: BoundaryJson::new(&diagnosis.boundary),
            inputs,
        };
        document.ladder_in_words = document.steps_in_words();
        document
    }

    /// A value as a multiple of the noise of the fitted records, or of those held out.
    pub(crate) fn multiple_of_noise(&self, value_deg_per_h: f64, holdout: bool) -> f64 {
        let noise = self.holdout_noise_floor_deg_per_h.filter(|_| holdout).unwrap_or(self.noise_floor_deg_per_h);
        value_deg_per_h / noise.max(f64::MIN_POSITIVE)
    }

    /// What each rung adds to the one before.
    pub(crate) fn steps(&self) -> Vec<Vec<&str>> {
        (0..self.ladder.len())
            .map(|i| {
                let before: &[String] = if i > 0 { &self.ladder[i - 1].effects } else { &[] };
                self.ladder[i].effects.iter().filter(|e| !before.contains(e)).map(String::as_str).collect()
            })
            .collect()
    }

    fn steps_in_words(&self) -> Vec<String> {
        self.ladder
            .iter()
            .zip(self.steps())
            .enumerate()
            .map(|(i, (rung, added))| {
                let error = |value: f64, holdout: bool| {
                    format!("{value:.4} °/h ({:.2} times the noise)", self.multiple_of_noise(value, holdout))
                };
                let model = match i {
                    0 => "as declared".to_owned(),
                    _ if added.len() == rung.effects.len() => format!("with {}", added.join(" and ")),
                    // All that is in the model, and what of it is new.
                    _ => format!("with {} ({} added)", rung.effects.join(", "), added.join(" and ")),
                };
                let unseen = rung
                    .holdout_rmse_deg_per_h
                    .map_or_else(String::new, |h| format!(", on the hold-out {}", error(h, true)));
                format!("{model} the error is {} on the fitted records{unseen}", error(rung.rmse_deg_per_h, false))
            })
            .collect()
    }
}

impl PosteriorShareJson {
    fn new(share: &Share) -> Self {
        let member = |effect: &DeclaredEffect| {
            let values = effect.parameters().into_iter().zip(effect.values());
            MemberJson {
                kind: effect.kind(),
                choices: choices(effect),
                values: values.map(|(p, &si)| (p.key, p.unit.from_si(si))).collect(),
            }
        };
        let (of, covariance) = (&share.estimates.of, &share.estimates.covariance);
        let count = of.len();
        let deviation = |i: usize| covariance[i * count + i].sqrt();
        let estimate = |(i, estimate): (usize, &EffectEstimate)| {
            let effect = &share.members[estimate.effect];
            let parameter = &effect.parameters()[estimate.parameter];
            let si = effect.values()[estimate.parameter];
            let error = if estimate.is_logarithmic { deviation(i) * si } else { deviation(i) };
            PosteriorEstimateJson {
                member: estimate.effect,
                parameter: parameter.key.clone(),
                value: parameter.unit.from_si(si),
                standard_error: parameter.unit.difference_from_si(error),
                unit: parameter.unit.symbol().to_owned(),
                logarithmic: estimate.is_logarithmic,
            }
        };
        let correlation = |i: usize| -> Vec<f64> {
            (0..count).map(|k| covariance[i * count + k] / (deviation(i) * deviation(k))).collect()
        };
        Self {
            effects: share.effects.clone(),
            probability: share.probability,
            hypothesis: share.hypothesis.as_ref().map(HypothesisJson::new),
            members: share.members.iter().map(member).collect(),
            estimates: of.iter().enumerate().map(estimate).collect(),
            correlation: (0..count).map(correlation).collect(),
        }
    }
}

impl RefittedJson {
    fn new(refitted: &Refitted) -> Self {
        let unit = refitted.unit;
        Self {
            kind: refitted.kind.clone(),
            parameter: refitted.parameter.clone(),
            declared: unit.from_si(refitted.declared),
            value: unit.from_si(refitted.value),
            standard_error: refitted.standard_error.map(|e| unit.difference_from_si(e)),
            unit: unit.symbol().to_owned(),
        }
    }
}

impl FindingJson {
    pub(crate) fn new(finding: &Finding) -> Self {
        Self {
            kind: finding.effect.kind(),
            parameters: finding.parameters.iter().map(|p| (p.key.clone(), FittedParameterJson::new(p))).collect(),
            choices: choices(&finding.effect),
            equivalents: finding.equivalents.iter().map(|e| e.effect.kind()).collect(),
            equivalents_in_detail: finding.equivalents.iter().map(EquivalentJson::new).collect(),
            chi_square_less: finding.chi_square_less,
            confirmed_by: finding.confirmed_by,
            happens: finding.effect.spec().happens.to_owned(),
            remedy: finding.effect.spec().remedy.to_owned(),
            experiment: finding.effect.spec().experiment.to_owned(),
        }
    }
}

impl FittedParameterJson {
    fn new(parameter: &FittedParameter) -> Self {
        Self {
            value: parameter.unit.from_si(parameter.value),
            standard_error: parameter.standard_error.map(|e| parameter.unit.difference_from_si(e)),
            unit: parameter.unit.symbol().to_owned(),
            fitted: parameter.fitted,
            at_bound: parameter.at_bound,
        }
    }
}

impl EquivalentJson {
    fn new(equivalent: &Equivalent) -> Self {
        Self {
            kind: equivalent.effect.kind(),
            choices: choices(&equivalent.effect),
            chi_square_more: equivalent.chi_square_more,
            correlation: equivalent.correlation,
            happens: equivalent.effect.spec().happens.to_owned(),
            remedy: equivalent.effect.spec().remedy.to_owned(),
            experiment: equivalent.effect.spec().experiment.to_owned(),
        }
    }
}

impl RungJson {
    fn new(rung: &Rung) -> Self {
        Self {
            effects: rung.effects.clone(),
            rmse_deg_per_h: deg_per_h_from_rad_per_s(rung.rmse_rad_per_s),
            holdout_rmse_deg_per_h: rung.holdout_rmse_rad_per_s.map(deg_per_h_from_rad_per_s),
            reduced_chi_square: rung.reduced_chi_square,
            holdout_reduced_chi_square: rung.holdout_reduced_chi_square,
            bic: rung.bic,
        }
    }
}

impl ContenderJson {
    fn new(contender: &Contender) -> Self {
        Self {
            kind: contender.effect.kind(),
            choices: choices(&contender.effect),
            reduced_chi_square: contender.reduced_chi_square,
            bic: contender.bic,
            chi_square_less: contender.chi_square_less,
        }
    }
}

impl UnexplainedJson {
    fn new(unexplained: &Unexplained) -> Self {
        let correlations = unexplained.correlations.iter();
        Self {
            excess_deg_per_h: deg_per_h_from_rad_per_s(unexplained.excess_rad_per_s),
            share_of_excess: unexplained.share_of_excess,
            correlations: correlations
                .map(|(with, correlation)| UnexplainedCorrelationJson { with: with.clone(), correlation: *correlation })
                .collect(),
            plain: unexplained.plain.iter().map(PlainJson::new).collect(),
        }
    }
}

impl PlainJson {
    fn new(plain: &Plain) -> Self {
        let (shape, period_s, time_constant_s) = match plain.shape {
            ResidualShape::Drift { time_constant_s } => ("drift", None, Some(time_constant_s)),
            ResidualShape::Sinusoid { period_s } => ("sinusoid", Some(period_s), None),
        };
        Self {
            shape: shape.to_owned(),
            period_s,
            time_constant_s,
            rms_deg_per_h: deg_per_h_from_rad_per_s(plain.rms_rad_per_s),
            chi_square_less: plain.gain,
        }
    }
}

#[cfg(test)]
mod tests;
