//! Searches, proofs and fronts.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use coilwright::io::files::WriteError;
use coilwright::io::json::diagnosis::DiagnosisJson;
use coilwright::io::json::search::OptimiseJson;
use coilwright::io::read::pattern_file::resolve_pattern;
use coilwright::io::read::posterior::drawn_models;
use coilwright::io::write::checkpoint::write_checkpoint;
use coilwright::io::write::pareto_parts;
use coilwright::io::write::run_directory::{self, Request as Run, write_request};
use coilwright::pattern::windability::WindabilityClass;
use coilwright::search;
use coilwright::search::anneal::rounds::Rounds;
use coilwright::search::cost::objective::Objective;
use coilwright::search::end_turns::EndChoice;
use coilwright::search::proof;
use coilwright::search::run::Halt;
use coilwright::task::optimise::{DRAWN_MODELS, Wishes};
use coilwright::task::{self, Observer, TaskError};
use coilwright::units::deg_per_h_from_rad_per_s;
use pyo3::prelude::*;

use crate::error::raise;
use crate::model::{ModelHandle, option};
use crate::pattern::{PatternArgument, all_named};
use crate::reads::Reads;
use crate::tasks::{Answered, answered, document, held, one_pattern};
use crate::worker::{Failure, Watcher, work};

pub fn class_of(py: Python, stated: Option<&str>) -> PyResult<Option<WindabilityClass>> {
    let parsed = |text: &str| {
        WindabilityClass::parse(text).ok_or_else(|| {
            let message = format!("expected standard, captive:K with a number K, or any, found \"{text}\"");
            raise(py, option("windability", message))
        })
    };
    stated.map(parsed).transpose()
}

fn objective_of(py: Python, stated: Option<&str>) -> PyResult<Option<Objective>> {
    let parsed = |text: &str| {
        Objective::from_key(text).ok_or_else(|| {
            let keys: Vec<&str> = Objective::ALL.iter().map(|o| o.key()).collect();
            raise(py, option("objective", format!("expected one of {}, found \"{text}\"", keys.join(", "))))
        })
    };
    stated.map(parsed).transpose()
}

pub fn duration_of(py: Python, name: &'static str, stated: Option<f64>) -> PyResult<Option<Duration>> {
    let parsed = |seconds: f64| match Duration::try_from_secs_f64(seconds) {
        Ok(duration) if seconds > 0.0 => Ok(duration),
        _ => Err(raise(py, option(name, format!("expected seconds above zero, found {seconds}")))),
    };
    stated.map(parsed).transpose()
}

/// What a search is asked for, as keyword arguments.
#[derive(Debug, Clone, FromPyObject)]
#[pyo3(from_item_all)]
pub struct SearchOptions {
    pub seed: Option<u64>,
    pub windability: Option<String>,
    pub objective: Option<String>,
    pub budget_s: Option<f64>,
    pub rounds: Option<u64>,
    pub moves: Option<u64>,
    pub patience: Option<u64>,
    pub target: Option<f64>,
    pub restarts: Option<usize>,
    pub moves_per_restart: Option<u64>,
}

/// A part of a budget that work besides the search's own slices may take.
const SIDE_WORK: u32 = 4;

/// Told how a search goes.
pub struct SearchWatch<'a> {
    watcher: &'a Watcher,
    started: Instant,
    budget: Option<Duration>,
    prove: Option<Duration>,
    proof_began: OnceLock<Instant>,
    best_cost: f64,
    /// Seconds until the best pattern was found.
    found_s: f64,
    /// How a cost is shown.
    shown: fn(f64) -> String,
    kept: Option<(PathBuf, Run<'a>)>,
    fault: Option<WriteError>,
}

impl<'a> SearchWatch<'a> {
    pub fn new(watcher: &'a Watcher, budget: Option<Duration>, shown: fn(f64) -> String) -> Self {
        Self {
            watcher,
            started: Instant::now(),
            budget,
            prove: None,
            proof_began: OnceLock::new(),
            best_cost: f64::INFINITY,
            found_s: 0.0,
            shown,
            kept: None,
            fault: None,
        }
    }

    fn keep(&mut self, write: impl FnOnce(&PathBuf, &Run) -> Result<(), WriteError>) {
        if let Some(Err(error)) = self.kept.as_ref().map(|(folder, run)| write(folder, run)) {
            self.fault.get_or_insert(error);
        }
    }
}

/// How much of its patience a search has used up, or of its other limits.
fn share_done(search: &dyn Rounds, elapsed: Duration, budget: Option<Duration>) -> f64 {
    let (state, rules) = (search.state(), &search.plan().rules);
    let share = |done: f64, all: f64| if all > 0.0 { (done / all).min(1.0) } else { 1.0 };
    let patience = share(state.rounds_without_improvement as f64, rules.patience as f64);
    let rounds = share(state.round as f64, rules.rounds as f64);
    let moves = rules.moves.map_or(0.0, |most| share(search.evaluations() as f64, most as f64));
    let clock = budget.map_or(0.0, |budget| share(elapsed.as_secs_f64(), budget.as_secs_f64()));
    [patience, rounds, moves, clock].into_iter().fold(0.0, f64::max)
}

impl search::Observer for SearchWatch<'_> {
    fn begun(&mut self, search: &dyn Rounds) {
        self.keep(|folder, run| {
            write_request(folder, run).and_then(|()| write_checkpoint(folder, &run.fingerprint(), search.state()))
        });
    }

    fn advanced(&mut self, search: &dyn Rounds) -> ControlFlow<Halt> {
        if let Some(best) = search.best().filter(|best| best.cost < self.best_cost) {
            (self.best_cost, self.found_s) = (best.cost, self.started.elapsed().as_secs_f64());
        }
        let words = search.best().map_or_else(String::new, |best| {
            format!("round {}, best {}", search.state().round + 1, (self.shown)(best.cost))
        });
        if self.watcher.is_stopped() || self.fault.is_some() {
            return ControlFlow::Break(Halt::Signal);
        }
        self.watcher.at(share_done(search, self.started.elapsed(), self.budget), &words);
        if self.budget.is_some_and(|budget| self.started.elapsed() >= budget) {
            return ControlFlow::Break(Halt::Clock);
        }
        ControlFlow::Continue(())
    }

    fn ended(&mut self, search: &dyn Rounds) {
        self.keep(|folder, run| write_checkpoint(folder, &run.fingerprint(), search.state()));
    }

    fn goes_on(&self) -> bool {
        !self.watcher.is_stopped() && self.budget.is_none_or(|budget| self.started.elapsed() < budget / SIDE_WORK)
    }

    fn proving(&self, at: proof::Progress) -> ControlFlow<()> {
        let began = self.proof_began.get_or_init(Instant::now);
        let over = self.watcher.is_stopped() || self.prove.is_some_and(|time| began.elapsed() >= time);
        if over {
            return ControlFlow::Break(());
        }
        let shown = |rate| format!("{:.4} °/h", deg_per_h_from_rad_per_s(rate));
        let words = format!("best {}, none below {}", shown(at.best_rad_per_s), shown(at.lower_bound_rad_per_s));
        self.watcher.at(at.share_done, &words);
        ControlFlow::Continue(())
    }
}

impl SearchOptions {
    pub fn wishes(&self, py: Python) -> PyResult<Wishes> {
        let positive = |name: &'static str, value: Option<u64>| match value {
            Some(0) => Err(raise(py, option(name, "expected a number from 1, found 0".to_owned()))),
            value => Ok(value),
        };
        if let Some(found) = self.restarts.filter(|n| !(1..=4096).contains(n)) {
            return Err(raise(py, option("restarts", format!("expected a number from 1 to 4096, found {found}"))));
        }
        Ok(Wishes {
            seed: self.seed,
            class: class_of(py, self.windability.as_deref())?,
            objective: objective_of(py, self.objective.as_deref())?,
            has_budget: self.budget_s.is_some(),
            rounds: positive("rounds", self.rounds)?,
            moves: positive("moves", self.moves)?,
            patience: positive("patience", self.patience)?,
            target_deg_per_h: self.target,
            restarts_per_round: self.restarts,
            moves_per_restart: positive("moves_per_restart", self.moves_per_restart)?,
            start: None,
            cutting_planes: false,
            ends: EndChoice::default(),
        })
    }
}

#[pyfunction]
#[pyo3(signature = (model, options, init=None, compare_with=None, prove_s=None, output=None, cutting_planes=false, diagnosis=None, ends=(0, false), progress=None))]
#[allow(clippy::too_many_arguments)]
pub fn optimise(
    py: Python,
    model: &ModelHandle,
    options: SearchOptions,
    init: Option<PatternArgument>,
    compare_with: Option<PatternArgument>,
    prove_s: Option<f64>,
    output: Option<PathBuf>,
    cutting_planes: bool,
    diagnosis: Option<String>,
    ends: (u32, bool),
    progress: Option<&Bound<PyAny>>,
) -> PyResult<Answered> {
    let file = Arc::new((*model.file).clone().for_search());
    let diagnosis =
        diagnosis.map(|text| serde_json::from_str::<DiagnosisJson>(&text)).transpose().map_err(|error| {
            let message = format!("line {}: cannot be understood: {error}; give what diagnose answers", error.line());
            raise(py, option("diagnosis", message))
        })?;
    let reads = Reads::of(&file).patterns(init.iter().chain(&compare_with));
    let start = one_pattern(py, init.as_ref(), &file)?;
    let former = match &compare_with {
        // The folder of a search stands for its best pattern.
        Some(PatternArgument::Stated(stated)) if std::path::Path::new(stated).is_dir() => {
            let best = std::path::Path::new(stated).join("best.toml").display().to_string();
            Some(resolve_pattern(&best, file.model.coil.layers(), None).map_err(|e| raise(py, e))?)
        }
        other => one_pattern(py, other.as_ref(), &file)?.or_else(|| start.clone()),
    };
    let (budget, prove) = (duration_of(py, "budget_s", options.budget_s)?, duration_of(py, "prove_s", prove_s)?);
    let ends = EndChoice { most_left_off: ends.0, shares_outermost: ends.1 };
    let wishes = Wishes { start, cutting_planes, ends, ..options.wishes(py)? };
    let worked = work(py, progress, move |watcher| {
        for advice in &file.advice {
            watcher.note(&format!("note: {advice}"));
        }
        output.as_ref().map_or(Ok(()), |folder| run_directory::check_kept(folder, reads.paths()))?;
        let _held = held(output.as_ref(), "optimise")?;
        let mut request = wishes.request(&file, prove.is_some(), former)?;
        let plan = request.plan.clone();
        let uncertain = diagnosis.as_ref().map_or_else(Vec::new, |found| {
            drawn_models(&file.model, &found.posterior, &found.refitted, DRAWN_MODELS, plan.seed)
        });
        request.uncertain = &uncertain;
        let (class, objective) = (request.class, request.objective);
        let stated = budget.map(|budget| format!("{}s", budget.as_secs_f64()));
        let budget_stated = stated.as_deref();
        let run =
            Run { file: &file, class, objective, plan: &plan, budget: budget_stated, cutting_planes, fields: &[] };
        let mut watch = SearchWatch {
            prove,
            kept: output.clone().map(|folder| (folder, run)),
            ..SearchWatch::new(&watcher, budget, |cost| format!("{:.4} °/h", deg_per_h_from_rad_per_s(cost)))
        };
        let answer = search::run(&request, &mut watch)?;
        watch.fault.take().map_or(Ok(()), |error| Err(TaskError::from(error)))?;
        let (found_s, seconds) = (watch.found_s, watch.started.elapsed().as_secs_f64());
        let Some(answer) = answer.filter(|_| !watcher.is_stopped()) else { return Err(Failure::Stopped) };
        let body = OptimiseJson::of(&file.model.name, &request, &answer, seconds, found_s);
        if let Some(folder) = &output {
            task::optimise::write(folder, &file, &body, &answer)?;
        }
        Ok(document(body)?)
    })?;
    Ok(answered(worked))
}

#[pyfunction]
#[pyo3(signature = (model, patterns, windability=None, objective=None, budget_s=None, seed=None, progress=None))]
#[allow(clippy::too_many_arguments)]
pub fn exact(
    py: Python,
    model: &ModelHandle,
    patterns: Vec<PatternArgument>,
    windability: Option<&str>,
    objective: Option<&str>,
    budget_s: Option<f64>,
    seed: Option<u64>,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<Answered> {
    let file = Arc::clone(&model.file);
    let starts = all_named(py, &patterns, file.model.coil.layers())?;
    let class = class_of(py, windability)?.unwrap_or(file.search.windability);
    let objective = objective_of(py, objective)?.unwrap_or(file.search.objective);
    let budget = duration_of(py, "budget_s", budget_s)?;
    let worked = work(py, progress, move |watcher| {
        let started = Instant::now();
        let watcher = watcher.within(budget);
        let request = task::exact::Request {
            class,
            objective,
            starts: starts.into_iter().map(|named| named.pattern).collect(),
            seed: seed.unwrap_or(file.search.seed),
            ..task::exact::Request::new(&file)
        };
        let answer = task::exact::run(&request, &watcher)?;
        Ok(document(answer.document(started.elapsed().as_secs_f64()))?)
    })?;
    Ok(answered(worked))
}

#[pyfunction]
#[pyo3(signature = (model, seed=None, most_captive=None, rounds=None, output=None, progress=None))]
pub fn pareto(
    py: Python,
    model: &ModelHandle,
    seed: Option<u64>,
    most_captive: Option<u8>,
    rounds: Option<u64>,
    output: Option<PathBuf>,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<Answered> {
    if let Some(found) = most_captive.filter(|k| *k > 16) {
        return Err(raise(py, option("most_captive", format!("expected a number from 0 to 16, found {found}"))));
    }
    let file = Arc::clone(&model.file);
    let worked = work(py, progress, move |watcher| {
        output.as_ref().map_or(Ok(()), |folder| pareto_parts::check_kept(folder, file.files()))?;
        let _held = held(output.as_ref(), "pareto")?;
        let usual = task::pareto::Request::new(&file);
        let request = task::pareto::Request {
            seed: seed.unwrap_or(usual.seed),
            most_captive: most_captive.unwrap_or(usual.most_captive),
            rounds: rounds.unwrap_or(usual.rounds).max(1),
            kept_in: output.as_deref(),
            ..usual
        };
        let Some(answer) = task::pareto::run(&request, &watcher)? else { return Err(Failure::Stopped) };
        let body = match &output {
            Some(folder) => answer.write(folder, &file)?,
            None => answer.document(None),
        };
        Ok(document(body)?)
    })?;
    Ok(answered(worked))
}
