//! A model file with one more effect, fitted to records.

use std::path::Path;

use crate::compare::compare;
use crate::diagnose::{self, Finding};
use crate::effect::custom::{Formula, FormulaError};
use crate::effect::{CATALOGUE, CHANNEL, CUSTOM, DeclaredEffect, set_elsewhere};
use crate::io::fault::{Fault, Faults};
use crate::io::files::write_atomically;
use crate::io::json::boundary::BoundaryJson;
use crate::io::json::comparison::{CompareJson, RecordComparisonJson};
use crate::io::json::diagnosis::FindingJson;
use crate::io::json::extend::ExtendJson;
use crate::io::json::inputs::{InputsJson, RecordInputJson};
use crate::io::model::{ModelFile, NamedPattern};
use crate::io::read::effect_tables::channel_fault;
use crate::io::write::boundary_edit::with_boundary;
use crate::io::write::model_edit::with_effect;
use crate::rate::CoilModel;
use crate::record::Record;

use super::compare::check_columns;
use super::measurement::{GrossErrors, Measurement, Noticed};
use super::remarks::remarks;
use super::{Observer, TaskError, pattern_or_own};

/// What is to be added, and what it is fitted to.
#[derive(Debug, Clone)]
pub struct Request<'a> {
    /// The coil, its settings and how its records are read.
    pub model: &'a ModelFile,
    /// None for the model's own.
    pub pattern: Option<&'a NamedPattern>,
    /// What is added, with the parameters that are fixed.
    pub effect: DeclaredEffect,
    /// Records to fit to; without any the effect keeps its values.
    pub fit: &'a [Measurement],
    /// Records that are only shown before and after.
    pub holdout: &'a [Measurement],
}

/// The extended model's text, and the document but for where it was written.
#[derive(Debug)]
pub struct Answer {
    /// With the file's comments and layout kept.
    pub source: String,
    pub(crate) effect: FindingJson,
    /// What the records said of film, offset and chamber; none without a record to fit to.
    pub(crate) boundary: Option<BoundaryJson>,
    pub(crate) before: CompareJson,
    pub(crate) after: CompareJson,
}

impl Answer {
    /// As the program prints it.
    pub fn document(self, written: &Path) -> ExtendJson {
        let Self { effect, boundary, before, after, .. } = self;
        ExtendJson { written: written.display().to_string(), effect, boundary, before, after }
    }

    /// Writes the extended model.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), TaskError> {
        Ok(write_atomically(path, self.source.as_bytes())?)
    }
}

/// Extends.
///
/// # Errors
/// No pattern, columns that a record lacks, a fit that says nothing.
pub fn run(request: &Request, observer: &dyn Observer) -> Result<Answer, TaskError> {
    let (file, wanted) = (request.model, &request.effect);
    let named = pattern_or_own(file, request.pattern)?;
    let mut given: Vec<(Noticed, RecordInputJson)> = Vec::new();
    for (measurements, role) in [(request.fit, "fitted"), (request.holdout, "held out")] {
        for measurement in measurements {
            let noticed = measurement.noticed(GrossErrors::Drop, Some(file), observer)?;
            check_columns(file, &measurement.file, &noticed.record, &wanted.channels())?;
            given.push((noticed, measurement.input(role)));
        }
    }
    let records: Vec<Record> = given[..request.fit.len()].iter().map(|(n, _)| n.record.clone()).collect();
    let (finding, extended, learned) = if records.is_empty() {
        let mut model = file.model.clone();
        model.effects.retain(|e| e.kind() != wanted.kind());
        model.effects.push(wanted.clone());
        (Finding::unfitted(wanted.clone()), model, None)
    } else {
        let terms = diagnose::Terms::None;
        let asked =
            diagnose::Request { model: &file.model, pattern: &named.pattern, records: &records, holdout: &[], terms };
        let extension = diagnose::extend(&asked, wanted)?;
        (extension.finding, extension.extended, Some(extension.boundary))
    };
    let compared = |model: &CoilModel| -> Result<CompareJson, TaskError> {
        let mut shown = Vec::with_capacity(given.len());
        for (noticed, input) in &given {
            let found = compare(model, &named.pattern, &noticed.record)?;
            let gross_errors = noticed.gross_errors.clone();
            shown.push(RecordComparisonJson::new(&input.file, &found, gross_errors, noticed.gaps));
        }
        let inputs = given.iter().map(|(_, input)| input.clone()).collect();
        Ok(CompareJson::new(&model.name, &named.name, shown, InputsJson::new(Some(file), inputs)))
    };
    let (before, after) = (compared(&file.model)?, compared(&extended)?);
    let effect = FindingJson::new(&finding);
    let name = file.path.display().to_string();
    let mut source = with_effect(&name, &file.source, &finding.effect, &remarks(&effect))?;
    if let Some(learned) = &learned {
        source = with_boundary(&name, &source, learned)?;
    }
    Ok(Answer { source, effect, boundary: learned.as_ref().map(BoundaryJson::new), before, after })
}

/// An effect by its name in files, at its start; `custom` takes a formula and its parameters.
///
/// # Errors
/// A name that no effect has, a formula that cannot be read.
pub fn effect_of(
    kind: &str,
    formula: Option<&str>,
    parameters: &[(String, f64)],
    file: &ModelFile,
) -> Result<DeclaredEffect, TaskError> {
    if kind == CUSTOM.kind {
        let Some(formula) = formula else { return Err(TaskError::FormulaMissing) };
        let names = parameters.iter().map(|(name, _)| name.clone()).collect();
        let layers = file.model.coil.layers();
        let read = Formula::new(formula, names).and_then(|read| read.check_layers(layers).map(|()| read));
        let formula = read.map_err(|error: FormulaError| {
            let at = error.at();
            // At the end of the text there is no character to mark: the last one is.
            let at = at.map(|at| at.start.min(formula.len().saturating_sub(1))..at.end.min(formula.len()));
            Faults::one("--formula", formula, Fault::new(error.to_string(), at))
        })?;
        let values = parameters.iter().map(|(_, value)| *value).collect();
        return Ok(DeclaredEffect::custom(formula, values)?);
    }
    if let Some(channel) = kind.strip_prefix("channel:") {
        return match channel_fault(channel) {
            Some(message) => Err(TaskError::Option { option: "--effect", message }),
            None => Ok(DeclaredEffect::channel(channel, 0.0)),
        };
    }
    let declared = file.model.effects.iter().find(|e| e.kind() == kind);
    match (crate::effect::find(kind), declared) {
        (Some(_), Some(declared)) => Ok(declared.clone()),
        (Some(spec), None) => Ok(DeclaredEffect::at_start(spec)),
        (None, _) => Err(unknown_effect(kind)),
    }
}

/// Names less alike than this are hardly mistaken for one another.
const LIKE_ENOUGH: f64 = 0.75;

/// The complaint about an effect that does not exist, with the nearest that does.
/// As an error: where it is stated if it is known, else the effect that was probably meant.
pub fn unknown_effect(stated: &str) -> TaskError {
    if let Some(place) = set_elsewhere(stated) {
        return TaskError::SetElsewhere { stated: stated.to_owned(), place };
    }
    let nearest = CATALOGUE
        .iter()
        .copied()
        .chain([CHANNEL, CUSTOM])
        // A part of a name, such as "film", means it more surely than letters that resemble.
        .map(|spec| {
            let is_part = stated.len() > 2 && spec.kind.contains(stated);
            (strsim::jaro_winkler(spec.kind, stated) + f64::from(u8::from(is_part)), spec.kind)
        })
        .filter(|(likeness, _)| *likeness > LIKE_ENOUGH)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, kind)| kind);
    TaskError::UnknownEffect { stated: stated.to_owned(), nearest }
}
