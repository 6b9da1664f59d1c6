//! Temperature fields: solved by the library or computed elsewhere; what windings make of them.

use std::sync::Arc;

use coilwright::task::measurement::Measurement;
use coilwright::task::temperatures::{Answer, Driver, Request, run};
use coilwright::task::{TaskError, field as task};
use coilwright::thermal::ThermalHistory;
use coilwright::units::{deg_per_h_from_rad_per_s, k_per_s_from_c_per_h, kelvin_from_celsius};
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use serde_json::json;

use crate::arrays::{view1, view2};
use crate::error::raise;
use crate::model::{ModelHandle, option};
use crate::pattern::{PatternArgument, all_named};
use crate::record::RecordArgument;
use crate::tasks::{Answered, document};
use crate::worker::work;

/// Temperatures and rates of the layers over time.
#[pyclass(frozen, module = "coilwright._coilwright")]
pub struct FieldHandle {
    pub answer: Arc<Answer>,
}

#[pyfunction]
#[pyo3(signature = (model, record=None, profile=None, rows=601))]
pub fn temperatures(
    py: Python,
    model: &ModelHandle,
    record: Option<RecordArgument>,
    profile: Option<String>,
    rows: u32,
) -> PyResult<(FieldHandle, Vec<String>)> {
    if !(2..=1_000_000).contains(&rows) {
        return Err(raise(py, option("rows", format!("expected a number from 2 to 1000000, found {rows}"))));
    }
    let file = Arc::clone(&model.file);
    let record: Option<Measurement> = record.map(|r| r.measurement(py, &file.record)).transpose()?;
    let worked = work(py, None, move |watcher| {
        let driver = match &record {
            Some(measurement) => Driver::Measurement(measurement),
            None => Driver::Profile { name: profile.as_deref(), rows },
        };
        Ok(run(&Request { model: &file, driver }, &watcher)?)
    })?;
    Ok((FieldHandle { answer: Arc::new(worked.answer) }, worked.notes))
}

type Column<'py> = PyReadonlyArray1<'py, f64>;
type Rows<'py> = PyReadonlyArray2<'py, f64>;

/// Of arrays in °C and °C/h, or with `si` in K and K/s: rows are times, columns layers, innermost first.
#[pyfunction]
#[pyo3(signature = (name, time_s, temperature, rate, ambient, ambient_rate, moment_k=None, moment_rate=None, si=false))]
#[allow(clippy::too_many_arguments)]
pub fn field_of(
    name: String,
    time_s: Column,
    temperature: Rows,
    rate: Rows,
    ambient: Column,
    ambient_rate: Column,
    moment_k: Option<Rows>,
    moment_rate: Option<Rows>,
    si: bool,
) -> FieldHandle {
    let same = |v: f64| v;
    let kelvin: fn(f64) -> f64 = if si { same } else { kelvin_from_celsius };
    let per_s: fn(f64) -> f64 = if si { same } else { k_per_s_from_c_per_h };
    let plain = |rows: Option<Rows>, to_si: fn(f64) -> f64| -> Vec<f64> {
        rows.map_or_else(Vec::new, |rows| rows.as_array().iter().copied().map(to_si).collect())
    };
    let column =
        |values: &Column, to_si: fn(f64) -> f64| -> Vec<f64> { values.as_array().iter().copied().map(to_si).collect() };
    let history = ThermalHistory {
        layers: temperature.shape()[1],
        times_s: column(&time_s, same),
        ambient_k: column(&ambient, kelvin),
        ambient_rate_k_per_s: column(&ambient_rate, per_s),
        temperature_k: plain(Some(temperature), kelvin),
        rate_k_per_s: plain(Some(rate), per_s),
        axial_moment_k: plain(moment_k, same),
        axial_moment_k_per_s: plain(moment_rate, per_s),
    };
    FieldHandle { answer: Arc::new(Answer { model: String::new(), drive: name, history }) }
}

#[pymethods]
impl FieldHandle {
    #[getter]
    fn model(&self) -> &str {
        &self.answer.model
    }

    #[getter]
    fn name(&self) -> &str {
        &self.answer.drive
    }

    #[getter]
    fn layers(&self) -> usize {
        self.answer.history.layers
    }

    #[getter]
    fn time_s<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        view1(this.clone().into_any(), &this.get().answer.history.times_s)
    }

    #[getter]
    fn temperature_k<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let history = &this.get().answer.history;
        view2(this.clone().into_any(), &history.temperature_k, history.layers)
    }

    #[getter]
    fn rate_k_per_s<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let history = &this.get().answer.history;
        view2(this.clone().into_any(), &history.rate_k_per_s, history.layers)
    }

    #[getter]
    fn ambient_k<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        view1(this.clone().into_any(), &this.get().answer.history.ambient_k)
    }

    #[getter]
    fn ambient_rate_k_per_s<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        view1(this.clone().into_any(), &this.get().answer.history.ambient_rate_k_per_s)
    }

    /// Empty where nothing varies along the axis.
    #[getter]
    fn axial_moment_k<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let history = &this.get().answer.history;
        view2(this.clone().into_any(), &history.axial_moment_k, history.layers)
    }

    #[getter]
    fn axial_moment_rate_k_per_s<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let history = &this.get().answer.history;
        view2(this.clone().into_any(), &history.axial_moment_k_per_s, history.layers)
    }

    /// As the command `temperatures` prints it.
    fn document(&self, py: Python) -> PyResult<String> {
        document(self.answer.document()).map_err(|e| raise(py, e))
    }
}

/// Besides the document: the rates of each pattern at the field's times, in °/h.
#[pyfunction]
pub fn evaluate_field<'py>(
    py: Python<'py>,
    model: &ModelHandle,
    field: &FieldHandle,
    patterns: Vec<PatternArgument>,
) -> PyResult<(Answered, Vec<Bound<'py, PyArray1<f64>>>)> {
    let (file, answer) = (Arc::clone(&model.file), Arc::clone(&field.answer));
    let patterns = all_named(py, &patterns, file.model.coil.layers())?;
    let worked = work(py, None, move |watcher| {
        let request = task::Request { model: &file, field: &answer.history, patterns: &patterns };
        let found = task::run(&request, &watcher)?;
        let shown = |p: &task::PatternUnderField| -> Result<serde_json::Value, TaskError> {
            Ok(json!({
                "name": p.named.name,
                "segments": p.named.pattern.segments(),
                "worst_rate_deg_per_h": p.worst_rate_deg_per_h(),
                "worst_phase_rad": p.worst_phase_rad,
                "worst_time_s": answer.history.times_s[p.worst_row],
                "windability": serde_json::to_value(&p.windability)?,
            }))
        };
        let all = found.iter().map(shown).collect::<Result<Vec<_>, _>>()?;
        let body = json!({"model": file.model.name, "field": answer.drive, "patterns": all});
        let rates: Vec<Vec<f64>> =
            found.into_iter().map(|p| p.rate_rad_per_s.into_iter().map(deg_per_h_from_rad_per_s).collect()).collect();
        Ok((body.to_string(), rates))
    })?;
    let (text, rates) = worked.answer;
    Ok(((text, worked.notes), rates.into_iter().map(|r| PyArray1::from_vec(py, r)).collect()))
}

type Linear<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>);

/// Sensitivities (samples × layers) and the constant, in °/h; None where the error is not linear in the segments.
#[pyfunction]
pub fn sensitivities<'py>(py: Python<'py>, model: &ModelHandle, field: &FieldHandle) -> PyResult<Option<Linear<'py>>> {
    let (file, answer) = (Arc::clone(&model.file), Arc::clone(&field.answer));
    let found = py.detach(|| task::sensitivities(&file, &answer.history)).map_err(|e| raise(py, e))?;
    let Some(found) = found else { return Ok(None) };
    let (rows, layers) = (answer.history.len(), answer.history.layers);
    let array = PyArray1::from_vec(py, found.layers_deg_per_h).reshape([rows, layers])?;
    Ok(Some((array, PyArray1::from_vec(py, found.constant_deg_per_h))))
}
