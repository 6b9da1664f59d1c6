//! The JSON documents of `diagnose` and `extend`.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::diagnose::{
    Contender, Diagnosis, Equivalent, Finding, FittedParameter, Plain, Rung, Shape, Unexplained, Verdict,
};
use crate::effect::DeclaredEffect;
use crate::predict::Prediction;
use crate::record::Record;
use crate::units::deg_per_h_from_rad_per_s;

#[derive(Debug, Serialize)]
pub struct DiagnosisJson {
    pub model: String,
    pub verdict: &'static str,
    pub effects: Vec<FindingJson>,
    pub ladder: Vec<RungJson>,
    pub candidates: Vec<ContenderJson>,
    pub noise_floor_deg_per_h: f64,
    /// Null unless the verdict is `unexplained`.
    pub unexplained: Option<UnexplainedJson>,
    pub suggested_experiment: Option<String>,
    pub cautions: Vec<String>,
}

#[derive(Debug, Serialize)]
pub struct FindingJson {
    pub kind: String,
    pub parameters: BTreeMap<String, ParameterJson>,
    /// The words among which the effect lets one choose, such as `lead`.
    pub choices: BTreeMap<String, String>,
    /// Kinds that explain the records equally well.
    pub equivalents: Vec<String>,
    pub equivalents_in_detail: Vec<EquivalentJson>,
    /// By how much χ² rises without it, on fitted and on unseen data.
    pub chi_square_less: f64,
    pub confirmed_by: f64,
    pub experiment: &'static str,
}

#[derive(Debug, Serialize)]
pub struct ParameterJson {
    pub value: f64,
    /// Null where the records do not determine it, at a bound, or where it was held.
    pub standard_error: Option<f64>,
    pub unit: &'static str,
    pub fitted: bool,
    pub at_bound: bool,
}

#[derive(Debug, Serialize)]
pub struct EquivalentJson {
    pub kind: String,
    pub choices: BTreeMap<String, String>,
    pub chi_square_more: f64,
    /// Of the two predicted responses in these records.
    pub correlation: f64,
    pub experiment: &'static str,
}

#[derive(Debug, Serialize)]
pub struct RungJson {
    pub effects: Vec<String>,
    pub rmse_deg_per_h: f64,
    pub holdout_rmse_deg_per_h: Option<f64>,
    pub reduced_chi_square: f64,
    pub holdout_reduced_chi_square: Option<f64>,
    pub bic: f64,
}

#[derive(Debug, Serialize)]
pub struct ContenderJson {
    pub kind: String,
    pub choices: BTreeMap<String, String>,
    pub reduced_chi_square: f64,
    pub bic: f64,
    pub chi_square_less: f64,
}

#[derive(Debug, Serialize)]
pub struct UnexplainedJson {
    pub excess_deg_per_h: f64,
    pub share_of_excess: f64,
    pub correlations: Vec<CorrelationJson>,
    pub plain: Vec<PlainJson>,
}

#[derive(Debug, Serialize)]
pub struct CorrelationJson {
    pub with: String,
    pub correlation: f64,
}

#[derive(Debug, Serialize)]
pub struct PlainJson {
    pub shape: &'static str,
    pub period_s: Option<f64>,
    pub time_constant_s: Option<f64>,
    pub rms_deg_per_h: f64,
    pub chi_square_less: f64,
}

fn choices(effect: &DeclaredEffect) -> BTreeMap<String, String> {
    let specs = effect.spec().choices.iter().zip(effect.choices());
    specs.map(|(choice, &index)| (choice.key.to_owned(), choice.options[index].to_owned())).collect()
}

impl DiagnosisJson {
    pub fn new(model: &str, diagnosis: &Diagnosis) -> Self {
        Self {
            model: model.to_owned(),
            verdict: match diagnosis.verdict {
                Verdict::Adequate => "adequate",
                Verdict::Missing => "missing",
                Verdict::Indistinguishable => "indistinguishable",
                Verdict::Unexplained => "unexplained",
            },
            effects: diagnosis.effects.iter().map(FindingJson::new).collect(),
            ladder: diagnosis.ladder.iter().map(RungJson::new).collect(),
            candidates: diagnosis.candidates.iter().map(ContenderJson::new).collect(),
            noise_floor_deg_per_h: deg_per_h_from_rad_per_s(diagnosis.noise_floor_rad_per_s),
            unexplained: diagnosis.unexplained.as_ref().map(UnexplainedJson::new),
            suggested_experiment: diagnosis.suggested_experiment.clone(),
            cautions: diagnosis.cautions.iter().map(ToString::to_string).collect(),
        }
    }
}

impl FindingJson {
    pub fn new(finding: &Finding) -> Self {
        Self {
            kind: finding.effect.kind(),
            parameters: finding.parameters.iter().map(|p| (p.key.clone(), ParameterJson::new(p))).collect(),
            choices: choices(&finding.effect),
            equivalents: finding.equivalents.iter().map(|e| e.effect.kind()).collect(),
            equivalents_in_detail: finding.equivalents.iter().map(EquivalentJson::new).collect(),
            chi_square_less: finding.chi_square_less,
            confirmed_by: finding.confirmed_by,
            experiment: finding.effect.spec().experiment,
        }
    }
}

impl ParameterJson {
    fn new(parameter: &FittedParameter) -> Self {
        Self {
            value: parameter.unit.from_si(parameter.value),
            standard_error: parameter.standard_error.map(|e| parameter.unit.difference_from_si(e)),
            unit: parameter.unit.symbol(),
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
            experiment: equivalent.effect.spec().experiment,
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
                .map(|(with, correlation)| CorrelationJson { with: with.clone(), correlation: *correlation })
                .collect(),
            plain: unexplained.plain.iter().map(PlainJson::new).collect(),
        }
    }
}

impl PlainJson {
    fn new(plain: &Plain) -> Self {
        let (shape, period_s, time_constant_s) = match plain.shape {
            Shape::Drift => ("drift", None, None),
            Shape::Exponential { time_constant_s } => ("exponential", None, Some(time_constant_s)),
            Shape::Sinusoid { period_s } => ("sinusoid", Some(period_s), None),
        };
        Self {
            shape,
            period_s,
            time_constant_s,
            rms_deg_per_h: deg_per_h_from_rad_per_s(plain.rms_rad_per_s),
            chi_square_less: plain.gain,
        }
    }
}

/// How well a model predicts a record.
#[derive(Debug, Serialize)]
pub struct AgreementJson {
    pub file: String,
    pub rows: usize,
    pub rmse_deg_per_h: f64,
    pub nrmse_fit_percent: f64,
    pub noise_floor_deg_per_h: f64,
    pub reduced_chi_square: f64,
    pub offset_deg_per_h: f64,
}

impl AgreementJson {
    pub fn new(record: &Record, prediction: &Prediction) -> Self {
        let agreement = prediction.agreement(record);
        Self {
            file: record.name().to_owned(),
            rows: record.rows(),
            rmse_deg_per_h: deg_per_h_from_rad_per_s(agreement.rmse_rad_per_s),
            nrmse_fit_percent: agreement.nrmse_fit_percent,
            noise_floor_deg_per_h: deg_per_h_from_rad_per_s(prediction.noise_rad_per_s),
            reduced_chi_square: agreement.reduced_chi_square,
            offset_deg_per_h: deg_per_h_from_rad_per_s(prediction.offset_rad_per_s),
        }
    }
}

#[derive(Debug, Serialize)]
pub struct ExtendJson {
    /// The new model file.
    pub written: String,
    pub effect: FindingJson,
    pub before: Vec<AgreementJson>,
    pub after: Vec<AgreementJson>,
}
