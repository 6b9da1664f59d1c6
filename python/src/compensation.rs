//! Compensators: made once, used on whole records and row by row.

use std::path::PathBuf;
use std::sync::{Arc, Mutex};

use coilwright::compensate::formulas::FormulaColumns;
use coilwright::compensate::stream::{Compensated, Reading, Stream};
use coilwright::compensate::{Compensator, Method};
use coilwright::io::files::NewFile;
use coilwright::io::folder::{HeldFolder, check_file};
use coilwright::io::json::Document;
use coilwright::io::read::table_file::Source;
use coilwright::io::write::compensation_file::{StreamError, compensate_lines};
use coilwright::record::LEAST_INTERVAL_S;
use coilwright::task::compensate::{Answer, LONGEST_S, Request, all_methods, compensate_record, run, write_exported};
use coilwright::task::{self, TaskError};
use coilwright::units::{deg_per_h_from_rad_per_s, kelvin_from_celsius, rad_per_s_from_deg_per_h};
use numpy::PyArray1;
use pyo3::prelude::*;
use self_cell::self_cell;

use crate::error::{raise, wrong};
use crate::model::{ModelHandle, option};
use crate::pattern::PatternArgument;
use crate::reads::Reads;
use crate::record::{RecordArgument, RecordHandle, measurements};
use crate::tasks::{Answered, document, one_pattern};
use crate::worker::work;

/// A compensator, ready for any record of the same gyro.
#[pyclass(frozen, module = "coilwright._coilwright")]
pub struct CompensatorHandle {
    answer: Arc<Answer>,
    compensator: Arc<Compensator>,
    format: coilwright::io::read::record_columns::RecordFormat,
    reads: Arc<Reads>,
}

/// Bounds of an export's interval, as of the command.
fn check_interval(py: Python, interval_s: Option<f64>) -> PyResult<()> {
    match interval_s.filter(|s| !(LEAST_INTERVAL_S..=LONGEST_S).contains(s)) {
        None => Ok(()),
        Some(found) => {
            let message = format!("expected a time in seconds from {LEAST_INTERVAL_S} to {LONGEST_S}, found {found}");
            Err(raise(py, option("interval_s", message)))
        }
    }
}

fn method_of(py: Python, stated: &str) -> PyResult<Method> {
    Method::ALL.into_iter().find(|method| method.key() == stated).ok_or_else(|| {
        let keys: Vec<&str> = Method::ALL.iter().map(|m| m.key()).collect();
        raise(py, option("method", format!("expected one of {}, found \"{stated}\"", keys.join(", "))))
    })
}

#[pyfunction]
#[pyo3(signature = (model, method, fit=Vec::new(), pattern=None, linear=false, delay_s=None))]
pub fn compensator(
    py: Python,
    model: &ModelHandle,
    method: &str,
    fit: Vec<RecordArgument>,
    pattern: Option<PatternArgument>,
    linear: bool,
    delay_s: Option<f64>,
) -> PyResult<(CompensatorHandle, Vec<String>)> {
    let file = Arc::clone(&model.file);
    let stated = pattern.as_ref();
    let (method, pattern) = (method_of(py, method)?, one_pattern(py, stated, &file)?);
    let fit = measurements(py, &fit, &file.record)?;
    let reads = Arc::new(Reads::of(&file).patterns(stated).records(&fit));
    let format = file.record.clone();
    let worked = work(py, None, move |watcher| {
        let request = Request { pattern: pattern.as_ref(), method, fit: &fit, linear, delay_s, ..Request::new(&file) };
        Ok(run(&request, &watcher)?)
    })?;
    let answer = Arc::new(worked.answer);
    let compensator = Arc::new(answer.compensator.clone());
    Ok((CompensatorHandle { answer, compensator, format, reads }, worked.notes))
}

type Batch<'py> = (Bound<'py, PyArray1<f64>>, Vec<(usize, Vec<&'static str>)>, Answered);

#[pymethods]
impl CompensatorHandle {
    #[getter]
    fn method(&self) -> &'static str {
        self.compensator.method().key()
    }

    #[getter]
    fn channel_names(&self) -> Vec<String> {
        self.compensator.channel_names().into_iter().map(str::to_owned).collect()
    }

    fn delay_rows(&self, interval_s: f64) -> usize {
        self.compensator.delay_rows(interval_s)
    }

    /// The compensated rate of every row [°/h], what happened to which rows, and the document.
    fn batch<'py>(&self, py: Python<'py>, record: &RecordHandle) -> PyResult<Batch<'py>> {
        let (answer, measurement) = (Arc::clone(&self.answer), Arc::clone(&record.measurement));
        let worked = work(py, None, move |_| {
            let found = compensate_record(&answer.compensator, &measurement.record)?;
            let rates: Vec<f64> = found.rate_rad_per_s.into_iter().map(deg_per_h_from_rad_per_s).collect();
            let flags: Vec<(usize, Vec<&'static str>)> = found
                .flags
                .into_iter()
                .map(|(row, flags)| (row, flags.into_iter().map(|f| f.word()).collect()))
                .collect();
            Ok((rates, flags, document(answer.document(Some(found.summary)))?))
        })?;
        let (rates, flags, text) = worked.answer;
        Ok((PyArray1::from_vec(py, rates), flags, (text, worked.notes)))
    }

    /// The difference equation, as JSON and as a C header.
    #[pyo3(signature = (interval_s=None))]
    fn difference_equation(&self, py: Python, interval_s: Option<f64>) -> PyResult<(String, String)> {
        check_interval(py, interval_s)?;
        self.answer.check_whole().map_err(|e| raise(py, TaskError::from(e)))?;
        let Some(equation) = self.answer.difference_equation(interval_s) else {
            return Err(wrong(
                py,
                "only the physical compensator of a model without a bias over temperature can be exported, and it needs an \
                 interval: give interval_s or fit",
            ));
        };
        let header = equation.c_header();
        let text = serde_json::to_string_pretty(&Document::new(equation)).map_err(|e| raise(py, TaskError::from(e)))?;
        Ok((text + "\n", header))
    }

    /// Any method, as JSON and as a C header, both of one run.
    #[pyo3(signature = (json, header, interval_s=None))]
    fn export(&self, py: Python, json: PathBuf, header: PathBuf, interval_s: Option<f64>) -> PyResult<()> {
        check_interval(py, interval_s)?;
        let (answer, reads) = (Arc::clone(&self.answer), Arc::clone(&self.reads));
        work(py, None, move |_| {
            let paths = [json, header];
            paths.iter().try_for_each(|path| check_file(path, reads.paths()))?;
            let Some(texts) = answer.exported(interval_s)? else {
                let message = "nothing can be exported without an interval, nor a model with a bias over temperature: give \
                               interval_s or fit";
                return Err(option("interval_s", message.to_owned()).into());
            };
            let holder = format!("coilwright compensate (process {})", std::process::id());
            let _held = HeldFolder::take_prefix(&paths[0], &holder)?;
            Ok(write_exported(&paths, texts)?)
        })?;
        Ok(())
    }

    fn stream(&self) -> StreamHandle {
        let owned = Owned::new(Arc::clone(&self.compensator), |compensator| Stream::new(compensator.as_ref()));
        StreamHandle { compensator: Arc::clone(&self.compensator), owned: Mutex::new(Some(owned)) }
    }
}

type RowStream<'c> = Stream<'c, u64>;

self_cell!(
    struct Owned {
        owner: Arc<Compensator>,
        #[not_covariant]
        dependent: RowStream,
    }
);

/// A compensator at work, row by row.
#[pyclass(frozen, module = "coilwright._coilwright")]
pub struct StreamHandle {
    compensator: Arc<Compensator>,
    owned: Mutex<Option<Owned>>,
}

/// Number of the row as it came in, compensated rate [°/h], and what happened to it.
type Out = (u64, Option<f64>, Vec<&'static str>);

fn out(row: Compensated<u64>) -> Out {
    let rate = row.rate_rad_per_s.map(deg_per_h_from_rad_per_s);
    (row.tag, rate, row.flags.into_iter().map(|f| f.word()).collect())
}

#[pymethods]
impl StreamHandle {
    /// A row in; whatever is ready comes out.
    #[pyo3(signature = (number, time_s, temperature_c=None, rate_deg_per_h=None, inner_c=None, channels=Vec::new()))]
    #[allow(clippy::too_many_arguments)]
    fn push(
        &self,
        py: Python,
        number: u64,
        time_s: f64,
        temperature_c: Option<f64>,
        rate_deg_per_h: Option<f64>,
        inner_c: Option<f64>,
        channels: Vec<Option<f64>>,
    ) -> PyResult<Vec<Out>> {
        let finite = |value: Option<f64>| value.filter(|v| v.is_finite());
        let mut columns = FormulaColumns::default();
        let channel_rad_per_s = match self.compensator.as_ref() {
            Compensator::Physical(physical) => {
                // The columns of formulas stand behind those of the channels' own effects.
                let of_formulas = channels.iter().skip(physical.channel_names().count());
                columns.iter_mut().zip(of_formulas).for_each(|(column, value)| *column = *value);
                physical.channel_bias_rad_per_s(channels.into_iter())
            }
            _ => Some(0.0),
        };
        let reading = time_s.is_finite().then(|| Reading {
            time_s,
            temperature_k: finite(temperature_c).map(kelvin_from_celsius),
            inner_k: finite(inner_c).map(kelvin_from_celsius),
            channel_rad_per_s,
            columns,
            rate_rad_per_s: finite(rate_deg_per_h).map(rad_per_s_from_deg_per_h),
        });
        let mut ready = Vec::new();
        let mut owned = self.owned.lock().map_err(|_| wrong(py, "the stream is broken"))?;
        let Some(owned) = owned.as_mut() else { return Err(wrong(py, "the stream has ended: begin another")) };
        owned.with_dependent_mut(|_, stream| stream.push(number, reading, |row| ready.push(out(row))));
        Ok(ready)
    }

    #[getter]
    fn delay_rows(&self, py: Python) -> PyResult<usize> {
        let owned = self.owned.lock().map_err(|_| wrong(py, "the stream is broken"))?;
        Ok(owned.as_ref().map_or(0, |owned| owned.with_dependent(|_, stream| stream.delay_rows())))
    }

    /// What is left.
    fn finish(&self, py: Python) -> PyResult<Vec<Out>> {
        let mut owned = self.owned.lock().map_err(|_| wrong(py, "the stream is broken"))?;
        let Some(mut owned) = owned.take() else { return Err(wrong(py, "the stream has ended already")) };
        let mut ready = Vec::new();
        owned.with_dependent_mut(|compensator, stream| {
            let whole = std::mem::replace(stream, Stream::new(compensator.as_ref()));
            whole.finish(|row| ready.push(out(row)));
        });
        Ok(ready)
    }
}

/// From file to file, line by line, as the command does it; without an output the lines come back.
#[pyfunction]
#[pyo3(signature = (handle, path, output=None))]
pub fn compensate_file(
    py: Python,
    handle: &CompensatorHandle,
    path: PathBuf,
    output: Option<PathBuf>,
) -> PyResult<(Answered, Option<Vec<u8>>)> {
    let (answer, format, reads) = (Arc::clone(&handle.answer), handle.format.clone(), Arc::clone(&handle.reads));
    let worked = work(py, None, move |_| {
        let name = path.display().to_string();
        let input = Source::open(&path)?;
        let said = |error: StreamError| match error {
            StreamError::Header(faults) => TaskError::Faults(faults),
            other => TaskError::Unprintable(other.to_string()),
        };
        let mut lines = Vec::new();
        let summary = match &output {
            Some(output) => {
                check_file(output, reads.paths().chain([path.as_path()]))?;
                let mut file = NewFile::create(output)?;
                let summary = compensate_lines(&answer.compensator, &format, &name, input, &mut file).map_err(said)?;
                file.finish()?;
                summary
            }
            None => compensate_lines(&answer.compensator, &format, &name, input, &mut lines).map_err(said)?,
        };
        Ok((document(answer.document(Some(summary)))?, output.is_none().then_some(lines)))
    })?;
    let (text, lines) = worked.answer;
    Ok(((text, worked.notes), lines))
}

type Curve<'py> = (&'static str, Bound<'py, PyArray1<f64>>);

/// Every method, fitted to records and tried on another and on each of them, left out in turn; besides the document what each leaves
/// [°/h].
#[pyfunction]
#[pyo3(signature = (model, fit, record=None, pattern=None))]
pub fn compensate_all<'py>(
    py: Python<'py>,
    model: &ModelHandle,
    fit: Vec<RecordArgument>,
    record: Option<RecordArgument>,
    pattern: Option<PatternArgument>,
) -> PyResult<(Answered, Vec<Curve<'py>>)> {
    let file = Arc::clone(&model.file);
    let pattern = one_pattern(py, pattern.as_ref(), &file)?;
    let fit = measurements(py, &fit, &file.record)?;
    let record = record.map(|record| record.measurement(py, &file.record)).transpose()?;
    let worked = work(py, None, move |watcher| {
        let request = Request { pattern: pattern.as_ref(), fit: &fit, ..task::compensate::Request::new(&file) };
        let found = all_methods(&request, record.as_ref(), &watcher)?;
        let shown = |rates: Vec<f64>| rates.into_iter().map(deg_per_h_from_rad_per_s).collect::<Vec<f64>>();
        let curves: Vec<_> = found.curves.into_iter().map(|(name, rates)| (name, shown(rates))).collect();
        Ok((document(found.document)?, curves))
    })?;
    let (text, curves) = worked.answer;
    let curves = curves.into_iter().map(|(name, rates)| (name, PyArray1::from_vec(py, rates))).collect();
    Ok(((text, worked.notes), curves))
}
