//! A model's prediction beside measured records, and where it fails.

use crate::compare::{Comparison, compare, compare_under, suspicion};
use crate::io::json::comparison::{CompareJson, RecordComparisonJson};
use crate::io::json::inputs::InputsJson;
use crate::io::model::{ModelFile, NamedPattern};
use crate::record::Record;

use super::measurement::{GrossErrors, Measurement, Noticed};
use super::under_fields::FieldFile;
use super::{Observer, TaskError, pattern_or_own};

/// What is to be compared.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// The coil, its settings and how its records are read.
    pub model: &'a ModelFile,
    /// The winding that was measured; none for the model's own.
    pub pattern: Option<&'a NamedPattern>,
    /// In the order in which they are shown.
    pub measurements: &'a [Measurement],
    /// Whether such rows are left out.
    pub gross_errors: GrossErrors,
    /// The layers' temperatures of each record in turn; empty where the records' own sensors tell.
    pub fields: &'a [FieldFile],
}

impl<'a> Request<'a> {
    /// With the model's own pattern, gross errors kept.
    pub fn new(model: &'a ModelFile, measurements: &'a [Measurement]) -> Self {
        Self { model, pattern: None, measurements, gross_errors: GrossErrors::Keep, fields: &[] }
    }
}

/// The document, and what it was made from.
#[derive(Debug)]
#[non_exhaustive]
pub struct Answer {
    /// As the program prints it.
    pub document: CompareJson,
    /// As they were used.
    pub records: Vec<Record>,
    /// One a measurement.
    pub comparisons: Vec<Comparison>,
}

/// Compares.
///
/// # Errors
/// No pattern, columns that the model reads and a record lacks, a record that cannot be predicted.
pub fn run(request: &Request, observer: &dyn Observer) -> Result<Answer, TaskError> {
    let file = request.model;
    let named = pattern_or_own(file, request.pattern)?;
    let count = request.measurements.len();
    if !request.fields.is_empty() && request.fields.len() != count {
        let message =
            format!("expected one for each of the {count} records, in their order, found {}", request.fields.len());
        return Err(TaskError::Option { option: "--field", message });
    }
    request.fields.iter().for_each(|field| field.say(observer));
    let (mut records, mut comparisons) = (Vec::with_capacity(count), Vec::with_capacity(count));
    let mut shown = Vec::with_capacity(count);
    for (index, measurement) in request.measurements.iter().enumerate() {
        observer.at(index as f64 / count as f64, &measurement.file);
        let Noticed { record, gross_errors, gaps } = measurement.noticed(request.gross_errors, Some(file), observer)?;
        check_columns(file, &measurement.file, &record, &[])?;
        let field = request.fields.get(index);
        let found = match field {
            Some(given) => compare_under(&file.model, &named.pattern, &record, &given.field)?,
            None => compare(&file.model, &named.pattern, &record)?,
        };
        let mut compared = RecordComparisonJson::new(&measurement.file, &found, gross_errors, gaps);
        compared.field = field.map(|given| given.file.clone());
        let suspected = suspicion::of_record(&record, file.model.rate_mean_s);
        compared.findings.extend(suspected.iter().map(ToString::to_string));
        shown.push(compared);
        records.push(record);
        comparisons.push(found);
    }
    let fields = request.fields.iter().map(FieldFile::input);
    let inputs = request.measurements.iter().map(|m| m.input("compared")).chain(fields).collect();
    let document = CompareJson::new(&file.model.name, &named.name, shown, InputsJson::new(Some(file), inputs));
    Ok(Answer { document, records, comparisons })
}

/// Whether a record has the columns that a model's effects read, and further ones.
pub(super) fn check_columns(
    model: &ModelFile,
    file: &str,
    record: &Record,
    further: &[String],
) -> Result<(), TaskError> {
    let names: Vec<String> = record.channels().iter().map(|c| c.name.clone()).collect();
    let mut columns = model.model.missing_channels(&names);
    columns.extend(further.iter().filter(|c| !names.contains(c)).cloned());
    if columns.is_empty() { Ok(()) } else { Err(TaskError::ColumnsMissing { file: file.to_owned(), columns }) }
}

#[cfg(feature = "report")]
mod folder {
    use std::path::Path;

    use super::{Answer, ModelFile, TaskError};
    use crate::io::write::comparison_rows::comparison_rows;
    use crate::io::write::measurement_folder::{COMPARISON_FILE, MeasurementFiles, table_name};
    use crate::report::comparison::pictures;
    use crate::task::page::{REPORT_FILE, write_report};

    impl Answer {
        /// Writes comparison.json, a table and pictures for each record, and the page.
        ///
        /// # Errors
        /// Files that cannot be written.
        pub fn write(&self, folder: &Path, model: &ModelFile) -> Result<(), TaskError> {
            let mut files = MeasurementFiles::new(folder, Some(model))?;
            let parts = self.records.iter().zip(&self.comparisons).zip(&self.document.records);
            for (index, ((record, found), shown)) in parts.enumerate() {
                let rows = comparison_rows(record, found);
                files.table(&table_name(index + 1), &rows)?;
                for picture in pictures(index + 1, shown, &rows) {
                    files.add(&picture.file, picture.svg.as_bytes())?;
                }
            }
            files.document(COMPARISON_FILE, &self.document)?;
            files.commit(COMPARISON_FILE)?;
            write_report(folder, &folder.join(REPORT_FILE))?;
            Ok(())
        }
    }
}
