//! A campaign's gyros: what each costs, and what its records say.

use crate::io::json::campaign::GyroJson;
use crate::io::json::inputs::RecordInputJson;
use crate::io::read::campaign_file::CampaignKind;
use crate::io::read::campaign_file::fleet::{Gyro, StatedFile};
use crate::io::read::table_file::Source;
use crate::task::measurement::GrossErrors;
use crate::task::metrics::{self, Settings, measure_stream};
use crate::task::{Observer, TaskError};

/// Seconds of one thread for a byte of a record: metrics of a million rows take about two seconds.
const METRICS_BYTE_S: f64 = 5e-8;
/// Seconds of one thread for a diagnosis, of a few hundred rows or of thousands.
const DIAGNOSIS_S: f64 = 60.0;

pub(super) fn estimated_s(gyro: &Gyro) -> f64 {
    let size = |file: &StatedFile| std::fs::metadata(&file.path).map_or(0, |found| found.len());
    let bytes: u64 = gyro.records.iter().chain(&gyro.holdout).map(size).sum();
    bytes as f64 * METRICS_BYTE_S + if gyro.file.is_some() { DIAGNOSIS_S } else { 0.0 }
}

fn nothing(id: &str, kind: &str, gyro: &Gyro) -> GyroJson {
    let (id, kind, gyro) = (id.to_owned(), kind.to_owned(), gyro.name.clone());
    GyroJson { id, kind, gyro, metrics: None, diagnosis: None, failure: None }
}

/// The data sheet of one gyro. What its records do not permit is a result as well: its failure.
///
/// # Errors
/// A record that cannot be opened.
pub(crate) fn measure_gyro(id: &str, gyro: &Gyro, observer: &dyn Observer) -> Result<GyroJson, TaskError> {
    let settings = Settings { average_s: gyro.settings.average_s, gross_errors: GrossErrors::Keep, attitude: None };
    let mut measured = Vec::with_capacity(gyro.records.len());
    for file in &gyro.records {
        let source = Source::open(&file.path)?;
        let input =
            RecordInputJson { file: file.stated.clone(), sha256: file.sha256.clone(), role: "measured".to_owned() };
        match measure_stream(input, &file.stated, source, &gyro.format, &settings, observer) {
            Ok(found) => measured.push(found),
            Err(error) => return Ok(failed(id, CampaignKind::METRICS, gyro, &error)),
        }
    }
    Ok(match metrics::document(measured) {
        Ok(metrics) => GyroJson { metrics: Some(metrics), ..nothing(id, CampaignKind::METRICS, gyro) },
        Err(error) => failed(id, CampaignKind::METRICS, gyro, &error),
    })
}

fn failed(id: &str, kind: &str, gyro: &Gyro, error: &TaskError) -> GyroJson {
    // Drawn faults are several lines; the first says what.
    let words = error.to_string();
    let first = words.lines().next().unwrap_or_default().trim_start_matches("error: ").to_owned();
    GyroJson { failure: Some(first), ..nothing(id, kind, gyro) }
}

#[cfg(feature = "report")]
mod diagnosed {
    use super::{CampaignKind, GyroJson, Observer, TaskError, failed, nothing};
    use crate::diagnose::Terms;
    use crate::io::read::campaign_file::fleet::{Gyro, StatedFile};
    use crate::io::read::record_file::read_record_named;
    use crate::io::read::table_file::Source;
    use crate::task::diagnose::{Request, run};
    use crate::task::measurement::Measurement;

    /// The diagnosis of one gyro. What its records do not permit is a result as well: its failure.
    ///
    /// # Errors
    /// A record that cannot be opened; a gyro without a model.
    pub(crate) fn diagnose_gyro(id: &str, gyro: &Gyro, observer: &dyn Observer) -> Result<GyroJson, TaskError> {
        let Some(file) = &gyro.file else { return Err(TaskError::PatternMissing) };
        for file in gyro.records.iter().chain(&gyro.holdout) {
            Source::open(&file.path)?;
        }
        let understood = |files: &[StatedFile]| {
            let measurement = |file: &StatedFile| {
                let read = read_record_named(&file.path, &file.stated, &gyro.format)?;
                let (skipped_rows, remarks) = (read.skipped_rows, read.remarks);
                let (file, sha256) = (file.stated.clone(), file.sha256.clone());
                Ok(Measurement { record: read.record, file, sha256, skipped_rows, remarks })
            };
            files.iter().map(measurement).collect::<Result<Vec<_>, TaskError>>()
        };
        let found = understood(&gyro.records).and_then(|measurements| {
            let holdout = understood(&gyro.holdout)?;
            let terms = match gyro.settings.terms.as_deref() {
                None => Terms::All,
                Some([none]) if none == "none" => Terms::None,
                Some([all]) if all == "all" => Terms::All,
                Some(words) => Terms::Among(words),
            };
            run(&Request { holdout: &holdout, terms, ..Request::new(file, &measurements) }, observer)
        });
        Ok(match found {
            Ok(answer) => GyroJson { diagnosis: Some(answer.document), ..nothing(id, CampaignKind::DIAGNOSE, gyro) },
            Err(error) => failed(id, CampaignKind::DIAGNOSE, gyro, &error),
        })
    }
}
#[cfg(feature = "report")]
pub(crate) use diagnosed::diagnose_gyro;
