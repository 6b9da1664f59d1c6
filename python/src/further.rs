//! Campaigns, publications, pages and templates: what is neither design nor measurement of one coil.

use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use coilwright::io::files::write_atomically;
use coilwright::io::folder::check_file;
use coilwright::io::json::campaign::WorkflowJson;
use coilwright::io::json::further_schemas::{campaign_schema, compensation_schema};
use coilwright::io::json::schema::{model_schema, pattern_schema, record_schema, schedule_schema};
use coilwright::io::json::{ReportJson, SchemaJson};
use coilwright::io::read::campaign_file::read_campaign;
use coilwright::io::write::model_edit::with_ramps;
use coilwright::io::write::model_template;
use coilwright::io::write::workflow::{Engine, Workflow};
use coilwright::report::yan1998::ReproductionFile;
use coilwright::report::{thesis2021 as thesis_page, yan1998 as paper_page};
use coilwright::reproduce::thesis2021::ThesisError;
use coilwright::reproduce::{thesis2021, yan1998};
use coilwright::task::campaign::CampaignPart;
use coilwright::task::campaign::carrying_out::{Face, compute, merge};
use coilwright::task::page::{REPORT_FILE, is_in, write_report};
use coilwright::task::{self, Observer, TaskError};
use pyo3::prelude::*;

use crate::error::raise;
use crate::model::{ModelHandle, option};
use crate::pattern::{PatternArgument, all_named};
use crate::reads::Reads;
use crate::search::duration_of;
use crate::tasks::{Answered, answered, document, held};
use crate::worker::{Failure, Watcher, work};

/// A campaign's watcher: long cells keep their state from time to time.
struct Carrying {
    watcher: Watcher,
    every: Duration,
    last: Mutex<Instant>,
}

impl Observer for Carrying {
    fn note(&self, words: &str) {
        self.watcher.note(words);
    }

    fn at(&self, share_done: f64, words: &str) {
        self.watcher.at(share_done, words);
    }

    fn goes_on(&self) -> bool {
        self.watcher.goes_on()
    }
}

impl Face for Carrying {
    fn keeps_state(&self) -> bool {
        let Ok(mut last) = self.last.lock() else { return false };
        let is_due = last.elapsed() >= self.every;
        if is_due {
            *last = Instant::now();
        }
        is_due
    }
}

/// Computes a campaign, the cells named, or a share of it that is one of so many; without a folder it lists the cells.
#[pyfunction]
#[pyo3(signature = (campaign, output=None, cells=Vec::new(), shard=None, merges=false, lists=false, checkpoint_every_s=None, progress=None))]
#[allow(clippy::too_many_arguments)]
pub fn campaign(
    py: Python,
    campaign: PathBuf,
    output: Option<PathBuf>,
    cells: Vec<String>,
    shard: Option<(usize, usize)>,
    merges: bool,
    lists: bool,
    checkpoint_every_s: Option<f64>,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<Answered> {
    /// As of the command without the option.
    const CHECKPOINT_EVERY: Duration = Duration::from_secs(10);
    if let Some((index, count)) = shard.filter(|(index, count)| !(1..=*count).contains(index)) {
        let message = format!("expected (i, n) with 1 ≤ i ≤ n, such as (1, 4), found ({index}, {count})");
        return Err(raise(py, option("shard", message)));
    }
    let every = duration_of(py, "checkpoint_every_s", checkpoint_every_s)?.unwrap_or(CHECKPOINT_EVERY);
    let worked = work(py, progress, move |watcher| {
        let read = read_campaign(&campaign)?;
        let all = read.cells()?;
        let whole = CampaignPart::whole(&read, &all);
        let folder = match &output {
            Some(folder) if !lists => folder,
            folder => return Ok(document(whole.answer(folder.as_deref(), 0))?),
        };
        if merges {
            let _held = held(Some(folder), "campaign")?;
            return Ok(document(merge(&whole, folder, 0, &watcher)?)?);
        }
        let part = match shard {
            Some((index, count)) => CampaignPart::dealt(&read, &all, index, count),
            None if !cells.is_empty() => CampaignPart::of_ids(&read, &all, &cells)?,
            None => whole,
        };
        let is_whole = shard.is_none() && cells.is_empty();
        // Parts of one campaign may work in one folder at once; they write different files.
        let _held = if is_whole { held(Some(folder), "campaign")? } else { None };
        let carrying = Carrying { watcher, every, last: Mutex::new(Instant::now()) };
        let Some(searched) = compute(&part, folder, &carrying)? else { return Err(Failure::Stopped) };
        let answer =
            if is_whole { merge(&part, folder, searched, &carrying)? } else { part.answer(Some(folder), searched) };
        Ok(document(answer)?)
    })?;
    Ok(answered(worked))
}

/// Writes a workflow that runs a campaign on an engine; `program` is the command's place.
#[pyfunction]
pub fn campaign_workflow(
    py: Python,
    campaign: PathBuf,
    engine: &str,
    output: PathBuf,
    program: PathBuf,
    job_time_s: f64,
    threads: u16,
) -> PyResult<Answered> {
    let engine = match engine {
        "snakemake" => Engine::Snakemake,
        "slurm" => Engine::Slurm,
        found => return Err(raise(py, option("engine", format!("expected snakemake or slurm, found \"{found}\"")))),
    };
    duration_of(py, "job_time_s", Some(job_time_s))?;
    if !(1..=1024).contains(&threads) {
        return Err(raise(py, option("threads", format!("expected a number from 1 to 1024, found {threads}"))));
    }
    let worked = work(py, None, move |_| {
        let read = read_campaign(&campaign)?;
        let all = read.cells()?;
        let whole = CampaignPart::whole(&read, &all);
        let workflow = Workflow {
            engine,
            program: &program,
            campaign: &campaign,
            inputs: &read.inputs(),
            ids: all.iter().map(|cell| cell.id.as_str()).collect(),
            estimated_s: whole.estimated_s(),
            part_s: job_time_s,
            threads,
        };
        let _held = held(Some(&output), "campaign")?;
        let files = workflow.write(&output)?.into_iter().map(str::to_owned).collect();
        let campaign = whole.answer(Some(&output.join("results")), 0);
        let (engine, parts) = (workflow.engine.key().to_owned(), workflow.parts());
        Ok(document(WorkflowJson { campaign, engine, parts, files })?)
    })?;
    Ok(answered(worked))
}

fn of_thesis(error: ThesisError) -> TaskError {
    match error {
        ThesisError::Record(error) => error.into(),
        ThesisError::Compensate(error) => error.into(),
        ThesisError::Metrics(error) => error.into(),
    }
}

fn written(folder: Option<&PathBuf>, files: &[ReproductionFile]) -> Result<Vec<String>, Failure> {
    let Some(path) = folder else { return Ok(Vec::new()) };
    let _held = held(folder, "reproduce")?;
    Ok(task::reproduce::write(path, files)?)
}

/// A publication's results beside the computed ones; files only where a folder is given.
#[pyfunction]
#[pyo3(signature = (publication, output=None))]
pub fn reproduce(py: Python, publication: String, output: Option<PathBuf>) -> PyResult<Answered> {
    let worked = work(py, None, move |_| {
        let command = format!("coilwright reproduce {publication}");
        match publication.as_str() {
            "yan1998" => {
                let found = yan1998::reproduce()?;
                let files = written(output.as_ref(), &paper_page::files(&found, &command))?;
                Ok(document(paper_page::PaperReproductionJson::new(&found, files))?)
            }
            "thesis2021" => {
                let found = thesis2021::reproduce().map_err(of_thesis)?;
                let files = written(output.as_ref(), &thesis_page::files(&found, &command))?;
                Ok(document(thesis_page::ThesisReproductionJson::new(&found, files))?)
            }
            found => {
                let message = format!("expected yan1998 or thesis2021, found \"{found}\"");
                Err(option("publication", message).into())
            }
        }
    })?;
    Ok(answered(worked))
}

/// The page of a folder of results.
#[pyfunction]
#[pyo3(signature = (folder, output=None))]
pub fn report(py: Python, folder: PathBuf, output: Option<PathBuf>) -> PyResult<Answered> {
    let worked = work(py, None, move |_| {
        let path = output.unwrap_or_else(|| folder.join(REPORT_FILE));
        let _held = if is_in(&folder, &path) { held(Some(&folder), "report")? } else { None };
        let bytes = write_report(&folder, &path)?;
        Ok(document(ReportJson { report: path.display().to_string(), bytes })?)
    })?;
    Ok(answered(worked))
}

/// The page in which windings are tried by hand.
#[pyfunction]
pub fn explore(py: Python, model: &ModelHandle, patterns: Vec<PatternArgument>, output: PathBuf) -> PyResult<Answered> {
    let file = Arc::clone(&model.file);
    let reads = Reads::of(&file).patterns(&patterns);
    let patterns = all_named(py, &patterns, file.model.coil.layers())?;
    let worked = work(py, None, move |watcher| {
        check_file(&output, reads.paths())?;
        file.advice.iter().for_each(|advice| watcher.note(&format!("note: {advice}")));
        Ok(document(task::explore_page::write(&file, &patterns, &output)?)?)
    })?;
    Ok(answered(worked))
}

/// The text of the model in which the profiles that attain the guaranteed worst cases are listed, also as a file.
#[pyfunction]
#[pyo3(signature = (model, patterns, output=None))]
pub fn bang_bang(
    py: Python,
    model: &ModelHandle,
    patterns: Vec<PatternArgument>,
    output: Option<PathBuf>,
) -> PyResult<String> {
    let file = Arc::clone(&model.file);
    let reads = Reads::of(&file).patterns(&patterns);
    let patterns = all_named(py, &patterns, file.model.coil.layers())?;
    let worked = work(py, None, move |watcher| {
        output.as_ref().map_or(Ok(()), |path| check_file(path, reads.paths()))?;
        let design = (*file).clone().for_search();
        let request = task::evaluate::Request { model: &design, patterns: &patterns };
        let extremes = task::evaluate::run(&request, &watcher)?.extremes?;
        let listed = with_ramps(&file.path.display().to_string(), &file.source, &extremes)?;
        output.as_ref().map_or(Ok(()), |path| write_atomically(path, listed.as_bytes()))?;
        Ok(listed)
    })?;
    Ok(worked.answer)
}

/// The JSON Schema of a file format.
#[pyfunction]
pub fn schema(py: Python, kind: String) -> PyResult<String> {
    let schema = match kind.as_str() {
        "model" => model_schema(),
        "pattern" => pattern_schema(),
        "record" => record_schema(),
        "schedule" => schedule_schema(),
        "campaign" => campaign_schema(),
        "compensation" => compensation_schema(),
        found => {
            let message =
                format!("expected model, pattern, record, schedule, campaign or compensation, found \"{found}\"");
            return Err(raise(py, option("kind", message)));
        }
    };
    document(SchemaJson { kind, schema }).map_err(|e| raise(py, e))
}

/// The text of a commented model file to start from.
#[pyfunction]
pub fn template(name: &str) -> String {
    model_template::template(name)
}
