//! Records: read, made of arrays, looked at without copies.

use std::path::PathBuf;
use std::sync::Arc;

use coilwright::Record;
use coilwright::io::read::record_columns::RecordFormat;
use coilwright::record::Channel;
use coilwright::task::measurement::{GrossErrors, Measurement};
use coilwright::units::{kelvin_from_celsius, rad_per_s_from_deg_per_h};
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;

use crate::arrays::view1;
use crate::error::{raise, wrong};
use crate::model::{ModelHandle, option};

/// A record and where it came from.
#[pyclass(frozen, module = "coilwright._coilwright")]
pub struct RecordHandle {
    pub measurement: Arc<Measurement>,
}

/// A record as an argument: a file to be read as the model says, or one that is held.
#[derive(FromPyObject)]
pub enum RecordArgument<'py> {
    Held(PyRef<'py, RecordHandle>),
    File(PathBuf),
}

impl RecordArgument<'_> {
    pub fn measurement(&self, py: Python, format: &RecordFormat) -> PyResult<Measurement> {
        match self {
            RecordArgument::Held(record) => Ok((*record.measurement).clone()),
            RecordArgument::File(path) => py.detach(|| Measurement::read(path, format)).map_err(|e| raise(py, e)),
        }
    }
}

pub fn measurements(py: Python, all: &[RecordArgument], format: &RecordFormat) -> PyResult<Vec<Measurement>> {
    all.iter().map(|one| one.measurement(py, format)).collect()
}

/// "keep" or "drop".
pub fn gross_errors(py: Python, wish: &str) -> PyResult<GrossErrors> {
    match wish {
        "keep" => Ok(GrossErrors::Keep),
        "drop" => Ok(GrossErrors::Drop),
        found => Err(wrong(py, format!("gross_errors: expected \"keep\" or \"drop\", found \"{found}\""))),
    }
}

#[pyfunction]
#[pyo3(signature = (path, model=None, columns=None, bad_rows=None, average_rows=None, compensated=false))]
pub fn read_record(
    py: Python,
    path: PathBuf,
    model: Option<&ModelHandle>,
    columns: Option<&str>,
    bad_rows: Option<&str>,
    average_rows: Option<usize>,
    compensated: bool,
) -> PyResult<RecordHandle> {
    let mut format = model.map_or_else(RecordFormat::default, |m| m.file.record.clone());
    if let Some(columns) = columns {
        format.map_all(columns).map_err(|message| raise(py, option("--columns", message)))?;
    }
    match bad_rows {
        None => {}
        Some("refuse") => format.skips_bad_rows = false,
        Some("skip") => format.skips_bad_rows = true,
        Some(found) => {
            return Err(wrong(py, format!("bad_rows: expected \"refuse\" or \"skip\", found \"{found}\"")));
        }
    }
    if let Some(rows) = average_rows {
        if !(1..=1_000_000).contains(&rows) {
            return Err(wrong(py, format!("average_rows: expected a number from 1 to 1000000, found {rows}")));
        }
        format.average_rows = rows;
    }
    format.compensated = compensated;
    let measurement = py.detach(|| Measurement::read(&path, &format)).map_err(|e| raise(py, e))?;
    Ok(RecordHandle { measurement: Arc::new(measurement) })
}

type Column<'py> = PyReadonlyArray1<'py, f64>;

/// Of arrays in °C and °/h, or with `si` in K and rad/s.
#[pyfunction]
#[pyo3(signature = (name, time_s, temperature, rate, inner=None, ambient=None, channels=Vec::new(), si=false))]
#[allow(clippy::too_many_arguments)]
pub fn record_of(
    py: Python,
    name: &str,
    time_s: Column,
    temperature: Column,
    rate: Column,
    inner: Option<Column>,
    ambient: Option<Column>,
    channels: Vec<(String, Column)>,
    si: bool,
) -> PyResult<RecordHandle> {
    let plain = |column: &Column| -> PyResult<Vec<f64>> { Ok(column.as_array().iter().copied().collect()) };
    let kelvin = |column: &Column| -> PyResult<Vec<f64>> {
        let values = plain(column)?;
        Ok(if si { values } else { values.into_iter().map(kelvin_from_celsius).collect() })
    };
    let rates = plain(&rate)?;
    let rates = if si { rates } else { rates.into_iter().map(rad_per_s_from_deg_per_h).collect() };
    let mut record = Record::new(name, plain(&time_s)?, kelvin(&temperature)?, rates).map_err(|e| raise(py, e))?;
    if let Some(inner) = &inner {
        record = record.with_inner_k(kelvin(inner)?).map_err(|e| raise(py, e))?;
    }
    if let Some(ambient) = &ambient {
        record = record.with_ambient_k(kelvin(ambient)?).map_err(|e| raise(py, e))?;
    }
    for (name, values) in &channels {
        let channel = Channel { name: name.clone(), values: plain(values)? };
        record = record.with_channel(channel).map_err(|e| raise(py, e))?;
    }
    Ok(RecordHandle { measurement: Arc::new(Measurement::of(record)) })
}

#[pymethods]
impl RecordHandle {
    #[getter]
    fn name(&self) -> &str {
        self.measurement.record.name()
    }

    #[getter]
    fn file(&self) -> &str {
        &self.measurement.file
    }

    #[getter]
    fn sha256(&self) -> Option<&str> {
        self.measurement.sha256.as_deref()
    }

    #[getter]
    fn rows(&self) -> usize {
        self.measurement.record.rows()
    }

    #[getter]
    fn interval_s(&self) -> f64 {
        self.measurement.record.interval_s()
    }

    #[getter]
    fn skipped_rows(&self) -> usize {
        self.measurement.skipped_rows
    }

    #[getter]
    fn remarks(&self) -> Vec<String> {
        self.measurement.remarks.clone()
    }

    #[getter]
    fn time_s<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        view1(this.clone().into_any(), this.get().measurement.record.times_s())
    }

    #[getter]
    fn temperature_k<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        view1(this.clone().into_any(), this.get().measurement.record.temperature_k())
    }

    #[getter]
    fn rate_rad_per_s<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        view1(this.clone().into_any(), this.get().measurement.record.rate_rad_per_s())
    }

    #[getter]
    fn inner_k<'py>(this: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyArray1<f64>>>> {
        let found = this.get().measurement.record.inner_k();
        found.map(|values| view1(this.clone().into_any(), values)).transpose()
    }

    #[getter]
    fn ambient_k<'py>(this: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyArray1<f64>>>> {
        let found = this.get().measurement.record.ambient_k();
        found.map(|values| view1(this.clone().into_any(), values)).transpose()
    }

    #[getter]
    fn channel_names(&self) -> Vec<String> {
        self.measurement.record.channels().iter().map(|c| c.name.clone()).collect()
    }

    fn channel<'py>(this: &Bound<'py, Self>, name: &str) -> PyResult<Option<Bound<'py, PyArray1<f64>>>> {
        let channel = this.get().measurement.record.channels().iter().find(|c| c.name == name);
        channel.map(|channel| view1(this.clone().into_any(), &channel.values)).transpose()
    }

    /// Rows after which the interval is at least twice the usual one, and its length.
    fn gaps(&self) -> Vec<(usize, f64)> {
        self.measurement.record.gaps()
    }

    /// Rows with a value that stands alone, and its column.
    fn gross_errors(&self) -> Vec<(usize, &'static str)> {
        self.measurement.record.gross_errors().into_iter().map(|e| (e.row, e.column)).collect()
    }

    /// Where the numbers are: what a view of them must point at.
    #[getter]
    fn address(&self) -> usize {
        self.measurement.record.times_s().as_ptr() as usize
    }
}
