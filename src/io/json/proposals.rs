//! Formulas that a diagnosis proposes for what no listed effect explains.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::comparison::CompareJson;
use super::diagnosis::FindingJson;
use crate::diagnose::discover::{FormulaProposal, NO_WINDING, ProposedTerm, Shown, TermParameter};
use crate::units::deg_per_h_from_rad_per_s;

/// One proposal; the formula's values are in °/h.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct ProposalJson {
    pub(crate) formula: String,
    pub(crate) terms: Vec<TermJson>,
    pub(crate) alternatives: Vec<AlternativeJson>,
    /// False: it only describes these records.
    pub(crate) predicts: bool,
    /// Why it only describes; null where it predicts.
    #[serde(default)]
    pub(crate) only_describes: Option<String>,
    pub(crate) probability: f64,
    pub(crate) rmse_deg_per_h: f64,
    pub(crate) holdout_rmse_deg_per_h: Option<f64>,
    /// What would tell it from its alternatives.
    #[serde(default)]
    pub(crate) experiment: Option<String>,
    /// What it means for the winding.
    #[serde(default)]
    pub(crate) advice: String,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct TermJson {
    /// As the formula of a custom effect.
    pub(crate) text: String,
    pub(crate) form: String,
    pub(crate) variables: Vec<String>,
    pub(crate) parameters: BTreeMap<String, TermParameterJson>,
    pub(crate) reading: String,
    /// What is left of each record without the term, against its variable.
    #[serde(default)]
    pub(crate) shown: Vec<ShownJson>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct TermParameterJson {
    pub(crate) value: f64,
    pub(crate) standard_error: Option<f64>,
    pub(crate) unit: String,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct AlternativeJson {
    pub(crate) formula: String,
    pub(crate) probability: f64,
}

/// Points of a picture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct ShownJson {
    pub(crate) record: String,
    pub(crate) variable: String,
    pub(crate) x: Vec<f64>,
    pub(crate) left_deg_per_h: Vec<f64>,
    pub(crate) term_deg_per_h: Vec<f64>,
}

/// Points that a picture needs of a record.
const SHOWN_POINTS: usize = 400;

impl ProposalJson {
    pub(crate) fn new(proposal: &FormulaProposal) -> Self {
        Self {
            formula: proposal.formula.clone(),
            terms: proposal.terms.iter().map(TermJson::new).collect(),
            alternatives: proposal
                .alternatives
                .iter()
                .map(|a| AlternativeJson { formula: a.formula.clone(), probability: a.probability })
                .collect(),
            predicts: proposal.predicts,
            only_describes: proposal.only_describes.clone(),
            probability: proposal.probability,
            rmse_deg_per_h: deg_per_h_from_rad_per_s(proposal.rmse_rad_per_s),
            holdout_rmse_deg_per_h: proposal.holdout_rmse_rad_per_s.map(deg_per_h_from_rad_per_s),
            experiment: proposal.experiment.clone(),
            advice: NO_WINDING.to_owned(),
        }
    }
}

impl TermJson {
    fn new(term: &ProposedTerm) -> Self {
        let parameter = |p: &TermParameter| {
            let shown = TermParameterJson { value: p.value, standard_error: p.standard_error, unit: p.unit.clone() };
            (p.key.clone(), shown)
        };
        Self {
            text: term.text.clone(),
            form: term.form.to_owned(),
            variables: term.variables.clone(),
            parameters: term.parameters.iter().map(parameter).collect(),
            reading: term.reading.clone(),
            shown: term.shown.iter().map(ShownJson::new).collect(),
        }
    }
}

impl ShownJson {
    fn new(shown: &Shown) -> Self {
        let every = shown.x.len().div_ceil(SHOWN_POINTS).max(1);
        // Means over a few rows: the picture is of what is left, not of its noise.
        let thin = |values: &[f64]| -> Vec<f64> {
            values.chunks(every).map(|c| c.iter().sum::<f64>() / c.len() as f64).map(short).collect()
        };
        let rates = |values: &[f64]| {
            let shown: Vec<f64> = values.iter().map(|v| deg_per_h_from_rad_per_s(*v)).collect();
            thin(&shown)
        };
        Self {
            record: shown.record.clone(),
            variable: shown.variable.clone(),
            x: thin(&shown.x),
            left_deg_per_h: rates(&shown.left_rad_per_s),
            term_deg_per_h: rates(&shown.term_rad_per_s),
        }
    }
}

/// Five digits are more than a picture shows.
fn short(value: f64) -> f64 {
    format!("{value:.4e}").parse().unwrap_or(value)
}

/// As [`super::extend::ExtendJson`], of a proposal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct ProposalExtendJson {
    /// The new model file.
    pub(crate) written: String,
    /// Listed effects, then the terms as custom effects.
    pub(crate) effects: Vec<FindingJson>,
    pub(crate) before: CompareJson,
    pub(crate) after: CompareJson,
}
