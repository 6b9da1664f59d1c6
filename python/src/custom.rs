//! Searches for what a caller brings: an array of sensitivities, a temperature field, any function of the pattern.

use std::sync::{Arc, Mutex};
use std::time::Instant;

use coilwright::pattern::windability::WindabilityClass;
use coilwright::search::anneal::rounds::Plan;
use coilwright::search::anneal::sample_cost::SampleCost;
use coilwright::search::cost::Cost;
use coilwright::search::cost::columns::Norm;
use coilwright::search::cost::samples::SampleMatrix;
use coilwright::search::custom::{CustomAnswer, FunctionCost, default_function_plan, search, sensitivity_matrix};
use coilwright::search::run::Unobserved;
use coilwright::task::TaskError;
use coilwright::task::field;
use coilwright::units::deg_per_h_from_rad_per_s;
use numpy::{PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use serde_json::{Value, json};

use crate::error::{raise, wrong};
use crate::field::FieldHandle;
use crate::model::{ModelHandle, option};
use crate::search::{SearchOptions, SearchWatch, class_of, duration_of};
use crate::tasks::Answered;
use crate::worker::{Failure, Watcher, work};

/// The plan of a search over layers, as the options say; costs keep the caller's unit.
fn planned(py: Python, usual: Plan, options: &SearchOptions, init: Option<Vec<usize>>) -> PyResult<Plan> {
    let wishes = options.wishes(py)?;
    let mut plan = usual;
    plan.restarts_per_round = wishes.restarts_per_round.unwrap_or(plan.restarts_per_round);
    plan.moves_per_restart = wishes.moves_per_restart.unwrap_or(plan.moves_per_restart);
    plan.rules.rounds = wishes.rounds.unwrap_or(plan.rules.rounds);
    plan.rules.patience = wishes.patience.unwrap_or(plan.rules.patience);
    plan.rules.moves = wishes.moves;
    plan.rules.target = wishes.target_deg_per_h;
    plan.starts = init.into_iter().collect();
    Ok(plan)
}

/// max |v| or the root of the mean square.
fn norm_of(py: Python, stated: Option<&str>) -> PyResult<Norm> {
    match stated {
        None | Some("worst-rate") => Ok(Norm::Largest),
        Some("rms") => Ok(Norm::RootMeanSquare),
        Some(found) => {
            let message = format!("expected worst-rate or rms, found \"{found}\"");
            Err(raise(py, option("objective", message)))
        }
    }
}

fn class(py: Python, options: &SearchOptions, usual: WindabilityClass) -> PyResult<WindabilityClass> {
    Ok(class_of(py, options.windability.as_deref())?.unwrap_or(usual))
}

/// What was found, in the shape of the other searches' documents.
fn told(answer: &CustomAnswer, shown: fn(f64) -> f64, class: WindabilityClass, seed: u64, seconds: f64) -> Value {
    let found =
        |f: &coilwright::search::anneal::rounds::FoundPattern| json!({"cost": shown(f.cost), "segments": f.segments});
    json!({
        "windability": class.to_string(),
        "seed": seed,
        "best": answer.found.first().map(found),
        "found": answer.found.iter().map(found).collect::<Vec<_>>(),
        "evaluations": answer.evaluations,
        "evaluations_per_s": answer.evaluations as f64 / seconds,
        "seconds": seconds,
        "rounds": answer.rounds,
        "stopped_by": answer.ended.key(),
    })
}

fn admitted(py: Python, class: WindabilityClass, layers: usize, init: Option<&Vec<usize>>) -> PyResult<()> {
    let Some(segments) = init else { return Ok(()) };
    let pattern = coilwright::Pattern::new(segments.clone()).map_err(|e| wrong(py, e.to_string()))?;
    if pattern.layers() != layers {
        return Err(wrong(py, format!("init has {} layers where the array has {layers}", pattern.layers())));
    }
    if class.admits(&pattern) {
        return Ok(());
    }
    let message = format!("the pattern is not of the class {class}: choose a wider class");
    Err(raise(py, option("init", message)))
}

fn run<C: Cost + 'static>(
    watcher: &Watcher,
    cost: C,
    plan: Plan,
    budget: Option<std::time::Duration>,
) -> Result<CustomAnswer, Failure> {
    let mut watch = SearchWatch::new(watcher, budget, |cost| format!("{cost:.6e}"));
    let answer = search(cost, plan, &mut watch);
    answer.filter(|_| !watcher.is_stopped()).ok_or(Failure::Stopped)
}

/// The array of sensitivities as a matrix, read where NumPy keeps it; and that place.
fn matrix_of(
    py: Python,
    sensitivities: &PyReadonlyArray2<f64>,
    constant: Option<&PyReadonlyArray1<f64>>,
) -> PyResult<(SampleMatrix, usize)> {
    let layers = sensitivities.shape()[1];
    let contiguous = |_| wrong(py, "expected an array that is contiguous, row by row, found another layout");
    let values = sensitivities.as_slice().map_err(contiguous)?;
    let constant = constant.map(|c| c.as_slice()).transpose().map_err(contiguous)?.unwrap_or(&[]);
    let matrix = py.detach(|| sensitivity_matrix(layers, values, constant)).map_err(|e| raise(py, e))?;
    Ok((matrix, values.as_ptr() as usize))
}

/// Besides the document: where the array was read.
#[pyfunction]
#[pyo3(signature = (sensitivities, options, constant=None, init=None, progress=None))]
pub fn search_matrix(
    py: Python,
    sensitivities: PyReadonlyArray2<f64>,
    options: SearchOptions,
    constant: Option<PyReadonlyArray1<f64>>,
    init: Option<Vec<usize>>,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<(Answered, usize)> {
    let started = Instant::now();
    let (matrix, read_at) = matrix_of(py, &sensitivities, constant.as_ref())?;
    let (class, norm) = (class(py, &options, WindabilityClass::Standard)?, norm_of(py, options.objective.as_deref())?);
    admitted(py, class, matrix.layers(), init.as_ref())?;
    let plan = planned(py, Plan::usual(matrix.layers(), options.seed.unwrap_or(1)), &options, init)?;
    let (budget, seed) = (duration_of(py, "budget_s", options.budget_s)?, plan.seed);
    let worked = work(py, progress, move |watcher| {
        let answer = run(&watcher, SampleCost::new(matrix, class, norm), plan, budget)?;
        Ok(told(&answer, |cost| cost, class, seed, started.elapsed().as_secs_f64()).to_string())
    })?;
    Ok(((worked.answer, worked.notes), read_at))
}

/// The same search without anything of Python around it: its seconds and its document, for comparisons of speed.
#[pyfunction]
pub fn time_search_matrix(
    py: Python,
    sensitivities: PyReadonlyArray2<f64>,
    options: SearchOptions,
) -> PyResult<(f64, String)> {
    let layers = sensitivities.shape()[1];
    let values = sensitivities.as_slice().map_err(|_| wrong(py, "expected a contiguous array"))?.to_vec();
    let (class, norm) = (class(py, &options, WindabilityClass::Standard)?, norm_of(py, options.objective.as_deref())?);
    let plan = planned(py, Plan::usual(layers, options.seed.unwrap_or(1)), &options, None)?;
    let seed = plan.seed;
    py.detach(|| {
        let started = Instant::now();
        let matrix = sensitivity_matrix(layers, &values, &[])?;
        let answer = search(SampleCost::new(matrix, class, norm), plan, &mut Unobserved)
            .ok_or_else(|| TaskError::Unprintable("a search that nobody stopped has found nothing".to_owned()))?;
        let seconds = started.elapsed().as_secs_f64();
        Ok((seconds, told(&answer, |cost| cost, class, seed, seconds).to_string()))
    })
    .map_err(|e: TaskError| raise(py, e))
}

#[pyfunction]
#[pyo3(signature = (model, field, options, init=None, progress=None))]
pub fn search_field(
    py: Python,
    model: &ModelHandle,
    field: &FieldHandle,
    options: SearchOptions,
    init: Option<Vec<usize>>,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<Answered> {
    let (file, history) = (Arc::clone(&model.file), Arc::clone(&field.answer));
    let (class, norm) = (class(py, &options, file.search.windability)?, norm_of(py, options.objective.as_deref())?);
    let layers = file.model.coil.layers();
    admitted(py, class, layers, init.as_ref())?;
    let mut plan = planned(py, Plan::usual(layers, options.seed.unwrap_or(file.search.seed)), &options, init)?;
    plan.rules.target = plan.rules.target.map(coilwright::units::rad_per_s_from_deg_per_h);
    let (budget, seed) = (duration_of(py, "budget_s", options.budget_s)?, plan.seed);
    let worked = work(py, progress, move |watcher| {
        let started = Instant::now();
        let matrix = field::matrix(&file, &history.history)?;
        let answer = run(&watcher, SampleCost::new(matrix, class, norm), plan, budget)?;
        Ok(told(&answer, deg_per_h_from_rad_per_s, class, seed, started.elapsed().as_secs_f64()).to_string())
    })?;
    Ok((worked.answer, worked.notes))
}

#[pyfunction]
#[pyo3(signature = (cost, layers, options, init=None, progress=None))]
pub fn search_function(
    py: Python,
    cost: Py<PyAny>,
    layers: usize,
    options: SearchOptions,
    init: Option<Vec<usize>>,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<Answered> {
    let class = class(py, &options, WindabilityClass::Standard)?;
    admitted(py, class, layers, init.as_ref())?;
    let plan = planned(py, default_function_plan(layers, options.seed.unwrap_or(1)), &options, init)?;
    let (budget, seed) = (duration_of(py, "budget_s", options.budget_s)?, plan.seed);
    let failed: Arc<Mutex<Option<PyErr>>> = Arc::default();
    let seen = Arc::clone(&failed);
    let has_failed = Arc::clone(&failed);
    let function = move |segments: &[usize]| -> f64 {
        let failed_already = || has_failed.lock().is_ok_and(|kept| kept.is_some());
        if failed_already() {
            return f64::INFINITY;
        }
        let found = Python::attach(|py| -> PyResult<f64> {
            let whole: Vec<i64> = segments.iter().map(|s| *s as i64).collect();
            let value: f64 = cost.bind(py).call1((PyArray1::from_vec(py, whole),))?.extract()?;
            if value.is_finite() {
                return Ok(value);
            }
            Err(wrong(py, format!("the cost of {segments:?} is {value}: expected a finite number")))
        });
        found.unwrap_or_else(|error| {
            if let Ok(mut kept) = seen.lock() {
                kept.get_or_insert(error);
            }
            f64::INFINITY
        })
    };
    let cost = FunctionCost::new(layers, class, function).map_err(|e| raise(py, e))?;
    let broken = Arc::clone(&failed);
    let worked = work(py, progress, move |watcher| {
        let started = Instant::now();
        let mut watch =
            Failing { inner: SearchWatch::new(&watcher, budget, |cost| format!("{cost:.6e}")), failed: &broken };
        let answer = search(cost, plan, &mut watch);
        let is_broken = broken.lock().is_ok_and(|kept| kept.is_some());
        let answer = answer.filter(|_| !watcher.is_stopped() && !is_broken);
        Ok(answer.map(|answer| told(&answer, |c| c, class, seed, started.elapsed().as_secs_f64()).to_string()))
    })?;
    let error = failed.lock().ok().and_then(|mut kept| kept.take());
    match (error, worked.answer) {
        (Some(error), _) => Err(error),
        (None, Some(text)) => Ok((text, worked.notes)),
        (None, None) => Err(wrong(py, "the search ended before anything was found: give it more time")),
    }
}

/// Ends a search with the first error of the caller's function.
struct Failing<'a> {
    inner: SearchWatch<'a>,
    failed: &'a Mutex<Option<PyErr>>,
}

impl coilwright::search::Observer for Failing<'_> {
    fn advanced(
        &mut self,
        search: &dyn coilwright::search::anneal::rounds::Rounds,
    ) -> std::ops::ControlFlow<coilwright::search::run::Halt> {
        if self.failed.lock().is_ok_and(|kept| kept.is_some()) {
            return std::ops::ControlFlow::Break(coilwright::search::run::Halt::Signal);
        }
        self.inner.advanced(search)
    }

    fn goes_on(&self) -> bool {
        self.inner.goes_on()
    }
}
