//! A record as the use cases take it: what was read, what was noticed while reading, and where it came from.

use std::path::Path;

use crate::io::fault::Faults;
use crate::io::json::inputs::RecordInputJson;
use crate::io::json::metrics::GrossErrorJson;
use crate::io::model::ModelFile;
use crate::io::read::record_columns::RecordFormat;
use crate::io::read::record_file::read_record_as;
use crate::io::read::record_rows::contradicts_mean;
use crate::record::Record;

use super::{Observer, TaskError};

/// What to do with values that stand alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum GrossErrors {
    /// They are reported and used.
    #[default]
    Keep,
    /// They are reported, and their rows are left out.
    Drop,
}

/// A record with its origin.
#[derive(Debug, Clone)]
pub struct Measurement {
    /// As it was read.
    pub record: Record,
    /// The file, or what stands for it.
    pub file: String,
    /// Of the file; none for what cannot be read twice or came from no file.
    pub sha256: Option<String>,
    /// Rows without a number, or whose stamps repeat or jump back.
    pub skipped_rows: usize,
    /// What was assumed or looks odd, in words.
    pub remarks: Vec<String>,
}

impl Measurement {
    /// Reads a record.
    ///
    /// # Errors
    /// All faults of the file at once.
    pub fn read(path: &Path, format: &RecordFormat) -> Result<Self, Faults> {
        let read = read_record_as(path, format)?;
        let RecordInputJson { file, sha256, .. } = RecordInputJson::new(path, "")?;
        Ok(Self { record: read.record, file, sha256, skipped_rows: read.skipped_rows, remarks: read.remarks })
    }

    /// A record that was made elsewhere.
    pub fn of(record: Record) -> Self {
        let file = record.name().to_owned();
        Self { record, file, sha256: None, skipped_rows: 0, remarks: Vec::new() }
    }

    /// What a document says of it.
    pub(crate) fn input(&self, role: &str) -> RecordInputJson {
        RecordInputJson { file: self.file.clone(), sha256: self.sha256.clone(), role: role.to_owned() }
    }

    /// Says what was skipped, assumed or looks odd.
    pub(crate) fn say(&self, model: Option<&ModelFile>, observer: &dyn Observer) {
        let contradiction = model.and_then(|m| contradicts_mean(self.record.interval_s(), m.model.rate_mean_s));
        say_read(&self.file, self.skipped_rows, self.remarks.iter().chain(&contradiction), observer);
    }

    /// The record, its gross errors, and its gaps; says what was noticed.
    ///
    /// # Errors
    /// Too few rows left.
    pub(crate) fn noticed(
        &self,
        wish: GrossErrors,
        model: Option<&ModelFile>,
        observer: &dyn Observer,
    ) -> Result<Noticed, TaskError> {
        self.say(model, observer);
        let found = self.record.gross_errors();
        let dropped = wish == GrossErrors::Drop;
        let times_s = self.record.times_s();
        let gross_errors: Vec<GrossErrorJson> = found
            .iter()
            .map(|e| GrossErrorJson { time_s: times_s[e.row], column: e.column.to_owned(), dropped })
            .collect();
        say_gross(&self.file, gross_errors.len(), gross_errors.first(), dropped, observer);
        let rows: Vec<usize> = found.iter().map(|e| e.row).collect();
        let record = if dropped && !rows.is_empty() { self.record.without_rows(&rows)? } else { self.record.clone() };
        let gaps = record.gaps().len();
        Ok(Noticed { record, gross_errors, gaps })
    }
}

/// A record as it is used, and what was noticed.
#[derive(Debug)]
pub(crate) struct Noticed {
    pub(crate) record: Record,
    pub(crate) gross_errors: Vec<GrossErrorJson>,
    pub(crate) gaps: usize,
}

/// Says what reading a record noticed.
pub(crate) fn say_read<'r>(
    file: &str,
    skipped_rows: usize,
    remarks: impl IntoIterator<Item = &'r String>,
    observer: &dyn Observer,
) {
    for remark in remarks {
        observer.note(&format!("note: {file}: {remark}"));
    }
    if skipped_rows > 0 {
        observer.note(&format!(
            "note: {file}: {skipped_rows} rows skipped: a cell without a number, or a stamp that repeats or jumps back"
        ));
    }
}

/// Says how many gross errors there are and what becomes of them.
pub(crate) fn say_gross(
    file: &str,
    count: usize,
    first: Option<&GrossErrorJson>,
    dropped: bool,
    observer: &dyn Observer,
) {
    let Some(first) = first else { return };
    let fate = if dropped { "left out" } else { "used all the same: --gross-errors drop leaves them out" };
    observer.note(&format!(
        "note: {file}: {count} gross errors, the first in {} at {} s; {fate}",
        first.column, first.time_s
    ));
}
