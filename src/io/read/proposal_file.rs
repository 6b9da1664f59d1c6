//! Diagnoses as files: the proposals that `diagnose --format json` or `diagnose -o` wrote, read back to be declared.

use crate::effect::custom::Formula;
use crate::effect::{self, DeclaredEffect};
use crate::io::json::diagnosis::{DiagnosisJson, FindingJson};
use crate::io::json::proposals::TermJson;

/// # Errors
/// Text that is no diagnosis, in words with the line.
pub(crate) fn parse_proposal(source: &str) -> Result<DiagnosisJson, String> {
    serde_json::from_str(source)
        .map_err(|error| format!("line {}: cannot be understood as a diagnosis: {error}", error.line()))
}

impl TermJson {
    /// As a custom effect at the proposed values.
    ///
    /// # Errors
    /// A text that is no formula of these parameters, or one of layers that the coil lacks; in words.
    pub(crate) fn declared(&self, layers: usize) -> Result<DeclaredEffect, String> {
        let (names, values): (Vec<String>, Vec<f64>) =
            self.parameters.iter().map(|(name, p)| (name.clone(), p.value)).unzip();
        let words = |error: String| format!("proposals: the term {:?}: {error}", self.text);
        let formula = Formula::new(&self.text, names).map_err(|e| words(e.to_string()))?;
        formula.check_layers(layers).map_err(|e| words(e.to_string()))?;
        DeclaredEffect::custom(formula, values).map_err(|e| words(e.to_string()))
    }
}

impl FindingJson {
    /// The listed effect at its values.
    ///
    /// # Errors
    /// A kind, parameter or choice that is not known; in words.
    pub(crate) fn declared(&self) -> Result<DeclaredEffect, String> {
        let value = |key: &str| self.parameters.get(key).map(|p| p.value);
        if let Some(channel) = self.kind.strip_prefix("channel:") {
            let parameter = effect::CHANNEL.parameters[0];
            let gain = value(parameter.key).ok_or_else(|| missing(&self.kind, parameter.key))?;
            return Ok(DeclaredEffect::channel(channel, parameter.unit.to_si(gain)));
        }
        let spec =
            effect::find(&self.kind).ok_or_else(|| format!("effects: {:?} is not in the catalogue", self.kind))?;
        let mut values = Vec::with_capacity(spec.parameters.len());
        for parameter in spec.parameters {
            let stated = value(parameter.key).ok_or_else(|| missing(&self.kind, parameter.key))?;
            values.push(parameter.unit.to_si(stated));
        }
        let mut choices = Vec::with_capacity(spec.choices.len());
        for choice in spec.choices {
            let stated = self.choices.get(choice.key).and_then(|c| choice.options.iter().position(|o| o == c));
            choices.push(stated.ok_or_else(|| missing(&self.kind, choice.key))?);
        }
        DeclaredEffect::new(spec, values, choices).map_err(|e| e.to_string())
    }
}

fn missing(kind: &str, key: &str) -> String {
    format!("effects: {kind} lacks {key}")
}
