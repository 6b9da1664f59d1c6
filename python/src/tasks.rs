//! The use cases: arguments in, the command's document out.

use std::path::PathBuf;
use std::sync::Arc;

use coilwright::diagnose::Terms;
use coilwright::io::folder::{HeldFolder, Replacement, check_file, check_read};
use coilwright::io::json::Document;
use coilwright::io::json::inputs::RecordInputJson;
use coilwright::io::model::{ModelFile, NamedPattern};
use coilwright::io::read::schedule_reader::{parse_claim, read_claim};
use coilwright::io::read::table_file::Source;
use coilwright::io::write::measurement_folder::{
    COMPARISON_FILE, DIAGNOSIS_FILE, METRICS_FILE, check_free, check_kept,
};
use coilwright::task::metrics::{Settings, measure, measure_stream};
use coilwright::task::{self, Observer, TaskError};
use coilwright::units::{deg_per_h_from_rad_per_s, rad_per_s_from_deg_per_h};
use numpy::PyArray1;
use pyo3::prelude::*;
use serde::Serialize;

use crate::error::raise;
use crate::model::{ModelHandle, option};
use crate::pattern::{PatternArgument, all_named};
use crate::reads::Reads;
use crate::record::{RecordArgument, gross_errors, measurements};
use crate::worker::{Failure, Worked, work};

/// A document and what was said on the way.
pub type Answered = (String, Vec<String>);

/// A document's text, without the schema version.
pub fn json<T: Serialize>(py: Python, body: &T) -> PyResult<String> {
    text_of(body).map_err(|e| raise(py, e))
}

fn text_of<T: Serialize>(body: &T) -> Result<String, TaskError> {
    Ok(serde_json::to_string(body)?)
}

/// The document as the command prints it.
pub fn document<T: Serialize>(body: T) -> Result<String, TaskError> {
    text_of(&Document::new(body))
}

pub fn answered(worked: Worked<String>) -> Answered {
    (worked.answer, worked.notes)
}

pub fn one_pattern(py: Python, stated: Option<&PatternArgument>, file: &ModelFile) -> PyResult<Option<NamedPattern>> {
    stated.map(|stated| stated.named(py, file.model.coil.layers())).transpose()
}

/// The folder that a call writes into, held until it has ended.
pub fn held(folder: Option<&PathBuf>, call: &str) -> Result<Option<HeldFolder>, TaskError> {
    let holder = format!("coilwright {call} (process {})", std::process::id());
    Ok(folder.map(|folder| HeldFolder::take(folder, &holder)).transpose()?)
}

#[pyfunction]
#[pyo3(signature = (model, patterns, progress=None))]
pub fn evaluate(
    py: Python,
    model: &ModelHandle,
    patterns: Vec<PatternArgument>,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<Answered> {
    let file = Arc::clone(&model.file);
    let patterns = all_named(py, &patterns, file.model.coil.layers())?;
    let worked = work(py, progress, move |watcher| {
        let request = task::evaluate::Request { model: &file, patterns: &patterns };
        Ok(document(task::evaluate::run(&request, &watcher)?.document)?)
    })?;
    Ok(answered(worked))
}

#[pyfunction]
#[pyo3(signature = (model, patterns, samples=None, seed=None, limit_deg_per_h=None, progress=None))]
pub fn tolerance(
    py: Python,
    model: &ModelHandle,
    patterns: Vec<PatternArgument>,
    samples: Option<usize>,
    seed: Option<u64>,
    limit_deg_per_h: Option<f64>,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<Answered> {
    if let Some(found) = samples.filter(|n| !(2..=100_000).contains(n)) {
        return Err(raise(py, option("samples", format!("expected a number from 2 to 100000, found {found}"))));
    }
    let file = Arc::clone(&model.file);
    let patterns = all_named(py, &patterns, file.model.coil.layers())?;
    let worked = work(py, progress, move |watcher| {
        let limit_rad_per_s = limit_deg_per_h.map(rad_per_s_from_deg_per_h);
        let request = task::tolerance::Request { model: &file, patterns: &patterns, samples, seed, limit_rad_per_s };
        Ok(document(task::tolerance::run(&request, &watcher)?)?)
    })?;
    Ok(answered(worked))
}

#[pyfunction]
#[pyo3(signature = (model, pattern=None, output=None))]
pub fn schedule(
    py: Python,
    model: &ModelHandle,
    pattern: Option<PatternArgument>,
    output: Option<PathBuf>,
) -> PyResult<Answered> {
    let file = Arc::clone(&model.file);
    let reads = Reads::of(&file).patterns(&pattern);
    let pattern = one_pattern(py, pattern.as_ref(), &file)?;
    let worked = work(py, None, move |watcher| {
        let answer = task::schedule::run(&task::schedule::Request { model: &file, pattern: pattern.as_ref() })?;
        output.as_ref().map_or(Ok(()), |folder| check_read(folder, &task::schedule::FILES, reads.paths()))?;
        let _held = held(output.as_ref(), "schedule")?;
        if let Some(folder) = &output {
            let files = answer.files(&file)?;
            Replacement::all(folder, &files)?;
            files.iter().for_each(|(name, _)| watcher.note(&format!("wrote {}", folder.join(name).display())));
        }
        // A schedule's document holds its schema version itself, because it is also a file.
        Ok(text_of(&answer.document)?)
    })?;
    Ok(answered(worked))
}

/// `source` is the text of a claim that is not in a file.
#[pyfunction]
#[pyo3(signature = (model, path, source=None))]
pub fn verify(py: Python, model: &ModelHandle, path: PathBuf, source: Option<String>) -> PyResult<Answered> {
    let file = Arc::clone(&model.file);
    let worked = work(py, None, move |_| {
        let claim_name = path.display().to_string();
        let claim = match &source {
            Some(source) => parse_claim(&claim_name, source)?,
            None => read_claim(&path)?,
        };
        let request = task::verify::Request { model: &file, claim: &claim, claim_name: &claim_name };
        Ok(document(task::verify::run(&request).document)?)
    })?;
    Ok(answered(worked))
}

type Curve<'py> = (String, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

/// Besides the document: each record's name, times, measured and predicted rates [°/h].
#[pyfunction]
#[pyo3(signature = (model, records, pattern=None, gross="keep", output=None, progress=None))]
pub fn compare<'py>(
    py: Python<'py>,
    model: &ModelHandle,
    records: Vec<RecordArgument>,
    pattern: Option<PatternArgument>,
    gross: &str,
    output: Option<PathBuf>,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<(Answered, Vec<Curve<'py>>)> {
    let file = Arc::clone(&model.file);
    let stated = pattern.as_ref();
    let pattern = one_pattern(py, stated, &file)?;
    let gross_errors = gross_errors(py, gross)?;
    let taken = measurements(py, &records, &file.record)?;
    let reads = Reads::of(&file).patterns(stated).records(&taken);
    let worked = work(py, progress, move |watcher| {
        output.as_ref().map_or(Ok(()), |folder| check_kept(folder, COMPARISON_FILE, reads.paths()))?;
        let _held = held(output.as_ref(), "compare")?;
        output.as_ref().map_or(Ok(()), |folder| check_free(folder))?;
        let request = task::compare::Request {
            pattern: pattern.as_ref(),
            gross_errors,
            ..task::compare::Request::new(&file, &taken)
        };
        let answer = task::compare::run(&request, &watcher)?;
        if let Some(folder) = &output {
            answer.write(folder, &file)?;
        }
        let shown = |rates: &[f64]| rates.iter().map(|r| deg_per_h_from_rad_per_s(*r)).collect::<Vec<f64>>();
        let curves: Vec<_> = answer
            .records
            .iter()
            .zip(&answer.comparisons)
            .map(|(record, found)| {
                let (times, name) = (record.times_s().to_vec(), record.name().to_owned());
                (name, times, shown(record.rate_rad_per_s()), shown(&found.prediction.rate_rad_per_s))
            })
            .collect();
        Ok((document(answer.document)?, curves))
    })?;
    let (text, curves) = worked.answer;
    let array = |values| PyArray1::from_vec(py, values);
    let curves = curves.into_iter().map(|(name, t, m, p)| (name, array(t), array(m), array(p))).collect();
    Ok(((text, worked.notes), curves))
}

/// Besides the document: the extended model's text, and the next experiment's.
#[pyfunction]
#[pyo3(signature = (model, records, holdout, pattern=None, output=None, experiment_seed=None, terms=None, progress=None))]
#[allow(clippy::too_many_arguments)]
pub fn diagnose(
    py: Python,
    model: &ModelHandle,
    records: Vec<RecordArgument>,
    holdout: Vec<RecordArgument>,
    pattern: Option<PatternArgument>,
    output: Option<PathBuf>,
    experiment_seed: Option<u64>,
    terms: Option<Vec<String>>,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<(Answered, Option<String>, Option<String>)> {
    let file = Arc::clone(&model.file);
    let stated = pattern.as_ref();
    let pattern = one_pattern(py, stated, &file)?;
    let (taken, held_out) = (measurements(py, &records, &file.record)?, measurements(py, &holdout, &file.record)?);
    let reads = Reads::of(&file).patterns(stated).records(taken.iter().chain(&held_out));
    let worked = work(py, progress, move |watcher| {
        output.as_ref().map_or(Ok(()), |folder| check_kept(folder, DIAGNOSIS_FILE, reads.paths()))?;
        let _held = held(output.as_ref(), "diagnose")?;
        output.as_ref().map_or(Ok(()), |folder| check_free(folder))?;
        let request = task::diagnose::Request {
            pattern: pattern.as_ref(),
            holdout: &held_out,
            experiment_seed,
            terms: Terms::asked(terms.as_deref()),
            ..task::diagnose::Request::new(&file, &taken)
        };
        let answer = task::diagnose::run(&request, &watcher)?;
        if let Some(folder) = &output {
            answer.write(folder, &file)?;
        }
        let extended = answer.extended_source(&file)?;
        let experiment = answer.experiment_source(&file);
        Ok((document(answer.document)?, extended, experiment))
    })?;
    let (text, extended, experiment) = worked.answer;
    Ok(((text, worked.notes), extended, experiment))
}

/// An effect by its name, or what the file of a diagnosis proposes; besides the document: the extended model's text.
#[pyfunction]
#[pyo3(signature = (model, effect, fit, holdout, formula=None, parameters=Vec::new(), pattern=None, output=None, proposal=None))]
#[allow(clippy::too_many_arguments)]
pub fn extend(
    py: Python,
    model: &ModelHandle,
    effect: String,
    fit: Vec<RecordArgument>,
    holdout: Vec<RecordArgument>,
    formula: Option<String>,
    parameters: Vec<(String, f64)>,
    pattern: Option<PatternArgument>,
    output: Option<PathBuf>,
    proposal: Option<PathBuf>,
) -> PyResult<(Answered, String)> {
    let file = Arc::clone(&model.file);
    let stated = pattern.as_ref();
    let pattern = one_pattern(py, stated, &file)?;
    let (fit, holdout) = (measurements(py, &fit, &file.record)?, measurements(py, &holdout, &file.record)?);
    let reads = Reads::of(&file).patterns(stated).records(fit.iter().chain(&holdout)).files(&proposal);
    let worked = work(py, None, move |watcher| {
        output.as_ref().map_or(Ok(()), |path| check_file(path, reads.paths()))?;
        let place = output.clone().unwrap_or_default();
        if let Some(path) = &proposal {
            let proposed = task::proposal::read_proposal(path, &file)?;
            let (pattern, proposed) = (pattern.as_ref(), proposed.as_slice());
            let request = task::proposal::Request { model: &file, pattern, proposed, fit: &fit, holdout: &holdout };
            let answer = task::proposal::run(&request, &watcher)?;
            output.as_ref().map_or(Ok(()), |path| answer.write(path))?;
            let source = answer.source.clone();
            return Ok((document(answer.document(&place))?, source));
        }
        let effect = task::extend::effect_of(&effect, formula.as_deref(), &parameters, &file)?;
        let request =
            task::extend::Request { model: &file, pattern: pattern.as_ref(), effect, fit: &fit, holdout: &holdout };
        let answer = task::extend::run(&request, &watcher)?;
        output.as_ref().map_or(Ok(()), |path| answer.write(path))?;
        let source = answer.source.clone();
        Ok((document(answer.document(&place))?, source))
    })?;
    Ok(((worked.answer.0, worked.notes), worked.answer.1))
}

#[pyfunction]
#[pyo3(signature = (model, records, pattern=None))]
pub fn trim(
    py: Python,
    model: &ModelHandle,
    records: Vec<RecordArgument>,
    pattern: Option<PatternArgument>,
) -> PyResult<Answered> {
    let file = Arc::clone(&model.file);
    let pattern = one_pattern(py, pattern.as_ref(), &file)?;
    let taken = measurements(py, &records, &file.record)?;
    let worked = work(py, None, move |watcher| {
        let request = task::trim::Request { model: &file, pattern: pattern.as_ref(), records: &taken };
        Ok(document(task::trim::run(&request, &watcher)?)?)
    })?;
    Ok(answered(worked))
}

#[pyfunction]
#[pyo3(signature = (records, average_s, gross="keep", output=None))]
pub fn metrics(
    py: Python,
    records: Vec<RecordArgument>,
    average_s: f64,
    gross: &str,
    output: Option<PathBuf>,
) -> PyResult<Answered> {
    enum Measured {
        Held(Box<task::measurement::Measurement>),
        File(PathBuf),
    }
    let settings = Settings { average_s, gross_errors: gross_errors(py, gross)?, attitude: None };
    let sources: Vec<Measured> = records
        .iter()
        .map(|record| match record {
            RecordArgument::Held(held) => Measured::Held(Box::new((*held.measurement).clone())),
            RecordArgument::File(path) => Measured::File(path.clone()),
        })
        .collect();
    let worked = work(py, None, move |watcher| {
        let read = |source: &Measured| match source {
            Measured::Held(measurement) => measurement.sha256.is_some().then(|| PathBuf::from(&measurement.file)),
            Measured::File(path) => Some(path.clone()),
        };
        let read: Vec<PathBuf> = sources.iter().filter_map(read).collect();
        let reads = Reads::default().files(&read);
        output.as_ref().map_or(Ok(()), |folder| check_kept(folder, METRICS_FILE, reads.paths()))?;
        let _held = held(output.as_ref(), "metrics")?;
        output.as_ref().map_or(Ok(()), |folder| check_free(folder))?;
        let one = |source: &Measured| -> Result<_, Failure> {
            let path = match source {
                Measured::Held(measurement) => return Ok(measure(measurement, &settings, &watcher)?),
                Measured::File(path) => path,
            };
            // Read as the command reads it: row by row, without holding it.
            let name = path.display().to_string();
            let file = Source::open(path)?;
            let input = RecordInputJson::new(path, "measured")?;
            Ok(measure_stream(input, &name, file, &Default::default(), &settings, &watcher)?)
        };
        let body = task::metrics::document(sources.iter().map(one).collect::<Result<_, _>>()?)?;
        if let Some(folder) = &output {
            task::metrics::write(&body, folder)?;
        }
        Ok(document(body)?)
    })?;
    Ok(answered(worked))
}

#[pyfunction]
#[pyo3(signature = (model, records, holdout, output, pattern=None, seed=None, terms=None, progress=None))]
#[allow(clippy::too_many_arguments)]
pub fn improve(
    py: Python,
    model: &ModelHandle,
    records: Vec<RecordArgument>,
    holdout: Vec<RecordArgument>,
    output: PathBuf,
    pattern: Option<PatternArgument>,
    seed: Option<u64>,
    terms: Option<Vec<String>>,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<Answered> {
    let file = Arc::clone(&model.file);
    let stated = pattern.as_ref();
    let pattern = one_pattern(py, stated, &file)?;
    let (taken, held_out) = (measurements(py, &records, &file.record)?, measurements(py, &holdout, &file.record)?);
    let reads = Reads::of(&file).patterns(stated).records(taken.iter().chain(&held_out));
    let worked = work(py, progress, move |watcher| {
        check_read(&output, &task::improve::FILES, reads.paths())?;
        let _held = held(Some(&output), "improve")?;
        let request = task::improve::Request {
            model: &file,
            pattern: pattern.as_ref(),
            measurements: &taken,
            holdout: &held_out,
            folder: &output,
            seed,
            terms: Terms::asked(terms.as_deref()),
        };
        match task::improve::run(&request, &watcher)? {
            Some(body) => Ok(document(body)?),
            None => Err(Failure::Stopped),
        }
    })?;
    Ok(answered(worked))
}
