//! The folder of a comparison, a diagnosis or measures: what commands on records write with `-o`, and read back for reports.
//!
//! One folder may hold all three; each is a JSON document beside tables and pictures, which follow from it.

use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::io::fault::{Fault, Faults};
use crate::io::files::{WriteError, read_text, read_text_up_to, write_atomically};
use crate::io::folder::{Replacement, check_ours, check_read, remove_kinds};
use crate::io::json::Document;
use crate::io::json::comparison::CompareJson;
use crate::io::json::diagnosis::{DiagnosisJson, DiagnosisRow};
use crate::io::json::metrics::MetricsJson;
use crate::io::model::ModelFile;

use super::comparison_rows::ComparisonRow;
use crate::io::table::{rows_as_csv, rows_of_csv};

/// The document of `compare` in a folder of pages.
pub const COMPARISON_FILE: &str = "comparison.json";
/// The document of `diagnose` in a folder of pages.
pub const DIAGNOSIS_FILE: &str = "diagnosis.json";
/// The document of `metrics` in a folder of pages.
pub const METRICS_FILE: &str = "metrics.json";
/// The model with the listed effects and the proposed terms.
pub(crate) const PROPOSED_FILE: &str = "proposed.toml";
/// A copy of the model file that was asked about.
pub(crate) const MODEL_FILE: &str = "model.toml";

const LARGEST_TABLE_BYTES: u64 = 2 * 1024 * 1024 * 1024;

/// Everything that a folder holds.
#[derive(Debug, Clone, Default)]
pub(crate) struct Measurements {
    /// With one table a record.
    pub(crate) comparison: Option<(CompareJson, Vec<Vec<ComparisonRow>>)>,
    /// With one table a record, where effects were found.
    pub(crate) diagnosis: Option<(DiagnosisJson, Vec<Vec<DiagnosisRow>>)>,
    pub(crate) metrics: Option<MetricsJson>,
    /// The text of the model file.
    pub(crate) model_source: Option<String>,
}

/// Whether a folder holds measurements rather than a search.
pub(crate) fn holds_measurements(folder: &Path) -> bool {
    [COMPARISON_FILE, DIAGNOSIS_FILE, METRICS_FILE].iter().any(|name| folder.join(name).is_file())
}

/// Refuses a folder that holds a search, whose files have the same names.
///
/// # Errors
/// As said.
pub fn check_free(folder: &Path) -> Result<(), Faults> {
    if folder.join("run.toml").is_file() {
        let message = "holds a search: choose another folder for what concerns records";
        return Err(Faults::of_file(folder.display().to_string(), message));
    }
    Ok(())
}

/// Refuses a folder in which the files of the command that writes `document` would take the place of what it reads, or of a
/// model file that no run left there.
///
/// # Errors
/// As said.
pub fn check_kept<'a>(
    folder: &Path,
    document: &str,
    read: impl IntoIterator<Item = &'a Path>,
) -> Result<(), WriteError> {
    let has_model = document != METRICS_FILE;
    // With another model all of it goes.
    let kinds: Vec<&str> =
        KINDS.iter().filter(|kinds| has_model || kinds[0] == document).copied().flatten().copied().collect();
    // The copy of its own model that a run left may be read.
    let marks = [COMPARISON_FILE, DIAGNOSIS_FILE];
    let is_left = marks.iter().any(|mark| folder.join(mark).is_file());
    let of_all: &[&str] = if has_model && !is_left { &OF_ALL } else { &["report.html"] };
    check_read(folder, &[&kinds, of_all].concat(), read)?;
    if !has_model {
        return Ok(());
    }
    check_ours(folder, MODEL_FILE, &marks)
}

/// # Errors
/// Files that are missing, damaged or of another program.
pub(crate) fn read_measurements(folder: &Path) -> Result<Measurements, Faults> {
    let comparison = match read_document::<CompareJson>(folder, COMPARISON_FILE, "comparison")? {
        None => None,
        Some(document) => {
            let tables = (1..=document.records.len())
                .map(|number| read_table(&folder.join(table_name(number))))
                .collect::<Result<_, _>>()?;
            Some((document, tables))
        }
    };
    let diagnosis = match read_document::<DiagnosisJson>(folder, DIAGNOSIS_FILE, "diagnosis")? {
        None => None,
        Some(document) => {
            let without = document.effects.is_empty() && document.proposals.is_empty();
            let count = if without { 0 } else { document.inputs.records.len() };
            let tables = (1..=count)
                .map(|number| read_table(&folder.join(before_and_after_name(number))))
                .collect::<Result<_, _>>()?;
            Some((document, tables))
        }
    };
    let model = folder.join(MODEL_FILE);
    Ok(Measurements {
        comparison,
        diagnosis,
        metrics: read_document(folder, METRICS_FILE, "set of measures")?,
        model_source: if model.is_file() { Some(read_text(&model)?) } else { None },
    })
}

/// The name of the `number`-th record's table, counted from 1.
pub(crate) fn table_name(number: usize) -> String {
    format!("record-{number}.csv")
}

/// The name of the `number`-th record's table of a diagnosis, counted from 1.
pub(crate) fn before_and_after_name(number: usize) -> String {
    format!("before-after-{number}.csv")
}

/// What each command may leave in such a folder; `#` stands for a number.
const KINDS: [&[&str]; 3] = [
    &[
        COMPARISON_FILE,
        "record-#.csv",
        "record-#-prediction.svg",
        "record-#-residual.svg",
        "record-#-temperature.svg",
        "record-#-shares.svg",
        "record-#-states.svg",
        "record-#-autocorrelation.svg",
    ],
    &[
        DIAGNOSIS_FILE,
        "ladder.svg",
        "noise.svg",
        "extended.toml",
        "proposed.toml",
        "before-after-#.csv",
        "before-after-#.svg",
    ],
    &[METRICS_FILE, "allan-#.svg"],
];
const OF_ALL: [&str; 2] = [MODEL_FILE, "report.html"];

/// The files of one command on their way into a folder that it may share with the others about the same model.
#[derive(Debug)]
pub(crate) struct MeasurementFiles<'a> {
    folder: &'a Path,
    files: Replacement<'a>,
    model_source: Option<&'a str>,
}

impl<'a> MeasurementFiles<'a> {
    /// `model` is none for documents that no model was asked about.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub(crate) fn new(folder: &'a Path, model: Option<&'a ModelFile>) -> Result<Self, WriteError> {
        let mut files = Replacement::of(folder);
        let model_source = model.map(|m| m.source.as_str());
        if let Some(source) = model_source {
            files.add(MODEL_FILE, source.as_bytes())?;
        }
        Ok(Self { folder, files, model_source })
    }

    /// # Errors
    /// A file that cannot be written.
    pub(crate) fn add(&mut self, name: &str, contents: &[u8]) -> Result<(), WriteError> {
        self.files.add(name, contents)
    }

    /// # Errors
    /// A file that cannot be written.
    pub(crate) fn document<T: Serialize>(&mut self, name: &str, document: &T) -> Result<(), WriteError> {
        // A number that is not finite becomes null, which is no error.
        let json = serde_json::to_string_pretty(&Document::new(document)).expect("keys are texts");
        self.add(name, (json + "\n").as_bytes())
    }

    /// Rows as CSV.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub(crate) fn table<T: Serialize>(&mut self, name: &str, rows: &[T]) -> Result<(), WriteError> {
        self.add(name, &rows_as_csv(rows).expect("rows are flat and a buffer in memory takes every one"))
    }

    /// Takes the place of what the command that writes `document` left there, and of everything about another model.
    ///
    /// # Errors
    /// A file that cannot be written, removed or renamed.
    pub(crate) fn commit(self, document: &str) -> Result<(), WriteError> {
        let former = std::fs::read_to_string(self.folder.join(MODEL_FILE)).ok();
        let is_other = self.model_source.zip(former.as_deref()).is_some_and(|(new, old)| new != old);
        let replaced = KINDS.iter().filter(|kinds| is_other || kinds[0] == document).copied().flatten();
        let of_all = OF_ALL.iter().filter(|name| self.model_source.is_some() || **name != MODEL_FILE);
        let kinds: Vec<&str> = replaced.chain(of_all).copied().collect();
        self.files.commit(&kinds)
    }
}

/// Takes away what commands on records left in a folder.
///
/// # Errors
/// A file that cannot be removed.
pub(crate) fn clear(folder: &Path) -> Result<(), WriteError> {
    let kinds: Vec<&str> = KINDS.iter().copied().flatten().chain(&OF_ALL).copied().collect();
    remove_kinds(folder, &kinds)
}

/// Writes rows as CSV under a name.
///
/// # Errors
/// A folder that cannot be written.
pub(crate) fn write_table<T: Serialize>(folder: &Path, name: &str, rows: &[T]) -> Result<(), WriteError> {
    let table = rows_as_csv(rows).expect("rows are flat and a buffer in memory takes every one");
    write_atomically(&folder.join(name), &table)
}

fn read_document<T: DeserializeOwned>(folder: &Path, name: &str, what: &str) -> Result<Option<T>, Faults> {
    let path = folder.join(name);
    if !path.is_file() {
        return Ok(None);
    }
    let text = read_text(&path)?;
    let document = serde_json::from_str(&text).map_err(|error| {
        let message = format!("line {}: cannot be understood as a {what}: {error}", error.line());
        Faults::one(path.display().to_string(), &text, Fault::new(message, None))
    })?;
    Ok(Some(document))
}

fn read_table<T: DeserializeOwned>(path: &Path) -> Result<Vec<T>, Faults> {
    let text = read_text_up_to(path, LARGEST_TABLE_BYTES)?;
    rows_of_csv(&text).map_err(|error| Faults::of_file(path.display().to_string(), error.to_string()))
}
