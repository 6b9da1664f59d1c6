//! From measured ramps what to cut at which end of the fibre.

use crate::diagnose;
use crate::diagnose::trim::trim;
use crate::io::json::inputs::InputsJson;
use crate::io::json::trim::TrimJson;
use crate::io::model::{ModelFile, NamedPattern};
use crate::record::Record;

use super::compare::check_columns;
use super::measurement::{GrossErrors, Measurement};
use super::{Observer, TaskError, pattern_or_own};

/// What was measured of which coil.
#[derive(Debug, Clone)]
pub struct Request<'a> {
    /// The coil.
    pub model: &'a ModelFile,
    /// None for the model's own.
    pub pattern: Option<&'a NamedPattern>,
    /// With at least one ramp.
    pub records: &'a [Measurement],
}

/// Works out the cut.
///
/// # Errors
/// No pattern, columns that a record lacks, a fit that says nothing.
pub fn run(request: &Request, observer: &dyn Observer) -> Result<TrimJson, TaskError> {
    let file = request.model;
    let named = pattern_or_own(file, request.pattern)?;
    let mut records: Vec<Record> = Vec::with_capacity(request.records.len());
    let mut inputs = Vec::with_capacity(request.records.len());
    for measurement in request.records {
        let record = measurement.noticed(GrossErrors::Drop, Some(file), observer)?.record;
        check_columns(file, &measurement.file, &record, &[])?;
        records.push(record);
        inputs.push(measurement.input("fitted"));
    }
    let terms = diagnose::Terms::None;
    let asked =
        diagnose::Request { model: &file.model, pattern: &named.pattern, records: &records, holdout: &[], terms };
    let found = trim(&asked)?;
    Ok(TrimJson::new(&file.model.name, &named.name, &found, InputsJson::new(Some(file), inputs)))
}
