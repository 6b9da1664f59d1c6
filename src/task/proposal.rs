//! A model file with what a diagnosis proposed, as it stands there or fitted to further records.

use std::path::Path;

use crate::compare::compare;
use crate::diagnose::{self, Finding, Terms, declared_with};
use crate::effect::DeclaredEffect;
use crate::io::fault::{Fault, Faults};
use crate::io::files::{read_text, write_atomically};
use crate::io::json::comparison::{CompareJson, RecordComparisonJson};
use crate::io::json::diagnosis::FindingJson;
use crate::io::json::inputs::{InputsJson, RecordInputJson};
use crate::io::json::proposals::ProposalExtendJson;
use crate::io::model::{ModelFile, NamedPattern};
use crate::io::read::proposal_file::parse_proposal;
use crate::io::write::model_edit::{Remark, with_effect};
use crate::rate::CoilModel;
use crate::record::Record;

use super::compare::check_columns;
use super::measurement::{GrossErrors, Measurement, Noticed};
use super::remarks::{remarks, term_remarks};
use super::{Observer, TaskError, pattern_or_own};

/// An effect to declare, with what stands behind its values.
#[derive(Debug, Clone)]
pub struct Proposed {
    pub(crate) effect: DeclaredEffect,
    pub(crate) remarks: Vec<Remark>,
}

/// What is to be added, and what it is fitted to.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// The coil, its settings and how its records are read.
    pub model: &'a ModelFile,
    /// None for the model's own.
    pub pattern: Option<&'a NamedPattern>,
    /// What the experiment is to tell apart.
    pub proposed: &'a [Proposed],
    /// Records to fit to; without any the effects keep their values.
    pub fit: &'a [Measurement],
    /// Records that are only shown before and after.
    pub holdout: &'a [Measurement],
}

/// The extended model's text, and the document but for where it was written.
#[derive(Debug)]
pub struct Answer {
    /// The file's text, with comments.
    pub source: String,
    pub(crate) effects: Vec<FindingJson>,
    pub(crate) before: CompareJson,
    pub(crate) after: CompareJson,
}

impl Answer {
    /// As the program prints it.
    pub fn document(self, written: &Path) -> ProposalExtendJson {
        let Self { effects, before, after, .. } = self;
        ProposalExtendJson { written: written.display().to_string(), effects, before, after }
    }

    /// Writes the extended model.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), TaskError> {
        Ok(write_atomically(path, self.source.as_bytes())?)
    }
}

/// What a diagnosis proposed, listed effects first.
///
/// # Errors
/// A file that is no diagnosis, one that proposes nothing, effects or formulas that cannot be declared for this model.
pub fn read_proposal(path: &Path, file: &ModelFile) -> Result<Vec<Proposed>, TaskError> {
    let source = read_text(path)?;
    let name = path.display().to_string();
    let fault = |message: String| TaskError::from(Faults::one(&name, &source, Fault::new(message, None)));
    let document = parse_proposal(&source).map_err(fault)?;
    let Some(best) = document.proposals.first() else {
        let message = "proposes nothing: expected `proposals` of a diagnosis that sought formulas, found none";
        return Err(fault(message.to_owned()));
    };
    let mut all = Vec::new();
    for listed in &document.effects {
        all.push(Proposed { effect: listed.declared().map_err(fault)?, remarks: remarks(listed) });
    }
    for term in &best.terms {
        let effect = term.declared(file.model.coil.layers()).map_err(fault)?;
        all.push(Proposed { effect, remarks: term_remarks(term) });
    }
    Ok(all)
}

/// Extends.
///
/// # Errors
/// No pattern, columns that a record lacks, a fit that says nothing.
pub fn run(request: &Request, observer: &dyn Observer) -> Result<Answer, TaskError> {
    let file = request.model;
    let named = pattern_or_own(file, request.pattern)?;
    let effects: Vec<DeclaredEffect> = request.proposed.iter().map(|p| p.effect.clone()).collect();
    let columns: Vec<String> = effects.iter().flat_map(DeclaredEffect::channels).collect();
    let mut given: Vec<(Noticed, RecordInputJson)> = Vec::new();
    for (measurements, role) in [(request.fit, "fitted"), (request.holdout, "held out")] {
        for measurement in measurements {
            let noticed = measurement.noticed(GrossErrors::Drop, Some(file), observer)?;
            check_columns(file, &measurement.file, &noticed.record, &columns)?;
            given.push((noticed, measurement.input(role)));
        }
    }
    let records: Vec<Record> = given[..request.fit.len()].iter().map(|(n, _)| n.record.clone()).collect();
    let is_fitted = !records.is_empty();
    let (findings, extended) = if is_fitted {
        let asked = diagnose::Request {
            model: &file.model,
            pattern: &named.pattern,
            records: &records,
            holdout: &[],
            terms: Terms::None,
        };
        let together = diagnose::extend_together(&asked, &effects)?;
        (together.findings, together.extended)
    } else {
        (effects.iter().cloned().map(Finding::unfitted).collect(), declared_with(&file.model, &effects))
    };
    let mut source = file.source.clone();
    let mut shown = Vec::with_capacity(findings.len());
    for (finding, proposed) in findings.iter().zip(request.proposed) {
        let effect = FindingJson::new(finding);
        // Without a fit, the errors are those of the diagnosis.
        let remarks = if is_fitted { remarks(&effect) } else { proposed.remarks.clone() };
        source = with_effect(&file.path.display().to_string(), &source, &finding.effect, &remarks)?;
        shown.push(effect);
    }
    let compared = |model: &CoilModel| -> Result<CompareJson, TaskError> {
        let mut shown = Vec::with_capacity(given.len());
        for (noticed, input) in &given {
            let found = compare(model, &named.pattern, &noticed.record)?;
            shown.push(RecordComparisonJson::new(&input.file, &found, noticed.gross_errors.clone(), noticed.gaps));
        }
        let inputs = given.iter().map(|(_, input)| input.clone()).collect();
        Ok(CompareJson::new(&model.name, &named.name, shown, InputsJson::new(Some(file), inputs)))
    };
    let (before, after) = (compared(&file.model)?, compared(&extended)?);
    Ok(Answer { source, effects: shown, before, after })
}
