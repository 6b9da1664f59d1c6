//! What a gyro's data sheet says, from records.

use crate::io::json::inputs::{InputsJson, RecordInputJson};
use crate::io::json::metrics::{GrossErrorJson, GrossErrorTally as Found, MetricsJson, RecordMetricsJson};
use crate::io::json::scale_factor::PositionsJson;
use crate::io::read::record_columns::RecordFormat;
use crate::io::read::record_rows::{CHUNK, stream_source};
use crate::io::read::table_file::Source;
use crate::metrics::earth::{Attitude, positions};
use crate::metrics::{Meter, Metrics, repeatability_rad_per_s};
use crate::record::{RecordRow, gross_errors_of};

use super::measurement::{GrossErrors, Measurement, say_gross, say_read};
use super::{Observer, TaskError};

/// The averaging time of the bias stability.
pub(crate) const DEFAULT_AVERAGE_S: f64 = 10.0;

/// How records are measured.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// Over which the residual is averaged.
    pub average_s: f64,
    /// Whether such rows are left out.
    pub gross_errors: GrossErrors,
    /// Where the gyro stood and how its axis pointed, where that is known.
    pub attitude: Option<Attitude>,
}

impl Default for Settings {
    fn default() -> Self {
        Self { average_s: DEFAULT_AVERAGE_S, gross_errors: GrossErrors::Keep, attitude: None }
    }
}

/// One record, measured.
#[derive(Debug, Clone)]
pub struct Measured {
    metrics: Metrics,
    shown: RecordMetricsJson,
    input: RecordInputJson,
    earth_rad_per_s: Option<f64>,
}

/// Takes rows as they come.
struct Metering {
    meter: Meter,
    dropped: bool,
    found: Found,
    scale: Option<f64>,
    earth_rad_per_s: Option<f64>,
}

impl Metering {
    fn new(settings: &Settings, scale: Option<f64>) -> Result<Self, TaskError> {
        let meter = Meter::new(settings.average_s)?;
        let dropped = settings.gross_errors == GrossErrors::Drop;
        let earth_rad_per_s = settings.attitude.map(|attitude| attitude.earth_rad_per_s());
        Ok(Self { meter, dropped, found: Found::default(), scale, earth_rad_per_s })
    }

    fn take(&mut self, rows: &[RecordRow]) {
        let temperature_k: Vec<f64> = rows.iter().map(|r| r.temperature_k).collect();
        let rates: Vec<f64> = rows.iter().map(|r| r.rate_rad_per_s).collect();
        let mut gross = gross_errors_of(&temperature_k, &rates).into_iter().peekable();
        for (i, row) in rows.iter().enumerate() {
            let mut alone = false;
            while let Some(error) = gross.next_if(|e| e.row == i) {
                alone = true;
                let (time_s, dropped) = (row.time_s, self.dropped);
                self.found.push(|| GrossErrorJson { time_s, column: error.column.to_owned(), dropped });
            }
            if !(alone && self.dropped) {
                self.meter.push(*row);
            }
        }
    }

    fn finish(self, input: RecordInputJson) -> Result<Measured, TaskError> {
        let metrics = self.meter.finish()?;
        let shown = RecordMetricsJson::new(&input.file, &metrics, self.found, metrics.gaps);
        let shown = shown.taken(&metrics, self.scale, self.earth_rad_per_s);
        Ok(Measured { metrics, shown, input, earth_rad_per_s: self.earth_rad_per_s })
    }
}

/// Measures a record as it passes by, without holding it. `shown_as` names it in faults and notes.
///
/// # Errors
/// All faults of the text at once; a record that is too short.
pub fn measure_stream(
    input: RecordInputJson,
    shown_as: &str,
    source: Source<'_>,
    format: &RecordFormat,
    settings: &Settings,
    observer: &dyn Observer,
) -> Result<Measured, TaskError> {
    let mut format = format.clone();
    format.compensated = true;
    let mut metering = Metering::new(settings, format.scale())?;
    let noticed = stream_source(shown_as, source, &format, |rows: &[RecordRow]| metering.take(rows))?;
    say_read(&input.file, noticed.skipped_rows, &noticed.remarks, observer);
    say_gross(&input.file, metering.found.count, metering.found.first.first(), metering.dropped, observer);
    metering.finish(input)
}

/// Measures a record that is held.
///
/// # Errors
/// A record that is too short.
pub fn measure(measurement: &Measurement, settings: &Settings, observer: &dyn Observer) -> Result<Measured, TaskError> {
    let mut metering = Metering::new(settings, None)?;
    // As a stream hands them on, so that both say the same.
    for rows in measurement.record.each_row().collect::<Vec<RecordRow>>().chunks(CHUNK) {
        metering.take(rows);
    }
    measurement.say(None, observer);
    say_gross(&measurement.file, metering.found.count, metering.found.first.first(), metering.dropped, observer);
    metering.finish(measurement.input("measured"))
}

/// The document about all of them.
///
/// # Errors
/// Records that were averaged over different times.
pub fn document(measured: Vec<Measured>) -> Result<MetricsJson, TaskError> {
    let all: Vec<Metrics> = measured.iter().map(|m| m.metrics.clone()).collect();
    let repeatability = repeatability_rad_per_s(&all)?;
    let attitudes: Option<Vec<f64>> = measured.iter().map(|m| m.earth_rad_per_s).collect();
    let offsets: Vec<f64> = all.iter().map(Metrics::offset_rad_per_s).collect();
    let found = attitudes.and_then(|earth| positions(&earth, &offsets));
    let (shown, inputs) = measured.into_iter().map(|m| (m.shown, m.input)).unzip();
    let document = MetricsJson::new(shown, repeatability, InputsJson::new(None, inputs));
    Ok(MetricsJson { positions: found.as_ref().map(PositionsJson::new), ..document })
}

#[cfg(feature = "report")]
mod folder {
    use std::path::Path;

    use super::{MetricsJson, TaskError};
    use crate::io::write::measurement_folder::{METRICS_FILE, MeasurementFiles};
    use crate::report::allan::allan_chart;
    use crate::task::page::{REPORT_FILE, write_report};

    /// Writes metrics.json, the pictures of the Allan deviation and the page.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn write(document: &MetricsJson, folder: &Path) -> Result<(), TaskError> {
        let mut files = MeasurementFiles::new(folder, None)?;
        for (index, record) in document.records.iter().enumerate() {
            files.add(&format!("allan-{}.svg", index + 1), allan_chart(record).svg().as_bytes())?;
        }
        files.document(METRICS_FILE, document)?;
        files.commit(METRICS_FILE)?;
        write_report(folder, &folder.join(REPORT_FILE))?;
        Ok(())
    }
}
#[cfg(feature = "report")]
pub use folder::write;
