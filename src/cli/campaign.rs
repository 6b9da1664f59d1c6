//! `campaign`: searches, built coils or the gyros of a fleet, in parts and with interruptions, with one table at the end.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::ValueEnum;

use super::budget::parse_duration;
use super::progress::StopFlag;
use super::screen::{Screen, held, table};
use super::watching::Watching;
use super::{CliError, Ending};
use crate::io::files::WriteError;
use crate::io::json::campaign::{CampaignJson, CellJson, WorkflowJson};
use crate::io::read::campaign_file::grid::{Search, SearchGrid};
use crate::io::read::campaign_file::{Cell, Kind, Work, read_campaign};
use crate::io::write::campaign_cells::{forget_unfinished, is_done, read_cell, state_folder, write_cell, write_table};
use crate::io::write::checkpoint::{read_checkpoint, write_checkpoint};
use crate::io::write::workflow::{self, Workflow};
use crate::report::built_coils::{built_coils_page, built_coils_table};
use crate::report::campaign::{campaign_page, charts, recommendations};
use crate::report::fleet::fleet_page;
use crate::search::Observer;
use crate::search::anneal::rounds::Rounds;
use crate::search::run::Halt;
use crate::task::campaign::coils::judge_block;
use crate::task::campaign::gyros::{diagnose_gyro, measure_gyro};
use crate::task::campaign::search::search_cell;
use crate::task::campaign::{Part, Table};

/// A grid of searches, a million built coils, or the gyros of a fleet, on one machine or many
#[derive(Debug, clap::Args)]
#[command(
    after_help = "A campaign file:\n  name = \"two coils\"\n  models = [\"paper-200m.toml\", \"coil-998m.toml\"]   # beside the campaign file\n  \
    layers = [12, 16]                                 # default: the models' own\n  \
    classes = [\"standard\", \"captive:1\", \"any\"]       # default: standard\n  \
    objectives = [\"worst-rate\", \"p95\"]               # default: worst-rate\n  seeds = [1, 2, 3]                                 # default: 1\n\n\
    Other kinds:\n  kind = \"tolerance\"  built coils in blocks: models, patterns, samples, coils_per_cell, seed, limit_deg_per_h\n  \
    kind = \"metrics\"    the data sheet of each [[gyro]] with its name and records, and what the batch has in common\n  \
    kind = \"diagnose\"   the same with a diagnosis: model, [[gyro]] with name, records, holdout\n\n\
    A cell's identifier is made of what its result depends on: model, settings, version of the program. What is done is\n\
    skipped, so the same command goes on after an interruption, and after a change only what has changed is computed.\n\
    Parts (--shard, --cell) may run at the same time or on other machines; --merge then writes the table, the page and the\n\
    pictures. A part ends with 1 if a cell of its own is missing, --merge and a whole campaign if any is.\n\n\
    Examples:\n  coilwright campaign grid.toml --list\n  \
    coilwright campaign grid.toml -o results/grid --shard 1/2\n  \
    coilwright campaign grid.toml -o results/grid --merge\n  \
    coilwright campaign grid.toml --emit slurm -o results/grid-on-slurm"
)]
pub struct Arguments {
    /// The campaign file
    campaign: PathBuf,
    /// The folder of the cells' results and the table
    #[arg(long, short, value_name = "DIR", required_unless_present = "list")]
    output: Option<PathBuf>,
    /// Computes nothing; lists the cells with their identifiers, what each takes on one thread, and which are done
    #[arg(long, group = "part")]
    list: bool,
    /// Runs only the cell of this identifier; may be repeated
    #[arg(long, value_name = "ID", group = "part")]
    cell: Vec<String>,
    /// Runs only the i-th of n parts that cost about the same
    #[arg(long, value_name = "i/n", value_parser = parse_shard, group = "part")]
    shard: Option<Shard>,
    /// Computes nothing; writes table, page and pictures of what is done, if nothing is missing
    #[arg(long, group = "part")]
    merge: bool,
    /// Computes nothing; writes a workflow that runs the campaign on an engine
    #[arg(long, value_enum, group = "part")]
    emit: Option<Engine>,
    /// With --emit: what a job should take; cells are grouped accordingly
    #[arg(long, value_name = "TIME", default_value = "10m", value_parser = parse_duration)]
    job_time: Duration,
    /// Threads to use; without it, as many as there are processors; with --emit, of each job: 1 without it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Within a long cell, writes a checkpoint when the last one is older than this
    #[arg(long, value_name = "TIME", default_value = "10s", value_parser = parse_duration)]
    checkpoint_every: Duration,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Engine {
    /// Snakefile and profiles for this machine and for Slurm: snakemake --profile profiles/laptop
    Snakemake,
    /// A job array and the job behind it: bash submit.sh
    Slurm,
}

#[derive(Debug, Clone, Copy)]
struct Shard {
    index: usize,
    count: usize,
}

fn parse_shard(text: &str) -> Result<Shard, String> {
    let parts = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
    match parts {
        Some((index, count)) if 1 <= index && index <= count => Ok(Shard { index, count }),
        _ => Err(format!("expected i/n with 1 ≤ i ≤ n, such as 1/4, found \"{text}\"")),
    }
}

pub fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    if let Some(threads) = arguments.threads {
        // Fails only where a pool exists already, which then serves as well: results don't depend on it.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(threads.into()).build_global();
    }
    let campaign = read_campaign(&arguments.campaign)?;
    let cells = campaign.cells()?;
    let whole = Part::whole(&campaign, &cells);
    let folder = match &arguments.output {
        Some(folder) if !arguments.list => folder,
        folder => return list(&whole, folder.as_deref(), screen),
    };
    if let Some(engine) = arguments.emit {
        return emit(arguments, engine, &whole, folder, screen);
    }
    if arguments.merge {
        let _held = held(folder, "campaign")?;
        return merged(&whole, folder, 0, screen);
    }
    let part = match arguments.shard {
        Some(Shard { index, count }) => Part::dealt(&campaign, &cells, index, count),
        None if !arguments.cell.is_empty() => Part::of_ids(&campaign, &cells, &arguments.cell)?,
        None => whole,
    };
    let is_whole = arguments.shard.is_none() && arguments.cell.is_empty();
    // Parts of one campaign may work in one folder at once; they write different files.
    let _held = if is_whole { Some(held(folder, "campaign")?) } else { None };
    let stop = StopFlag::listen();
    let Some(searched) = compute(&part, folder, arguments.checkpoint_every, &stop, screen)? else {
        let answer = part.answer(Some(folder), 0);
        screen.note(&missing_words(&answer));
        screen.answer(answer, |answer| text(answer, false))?;
        return Ok(Ending::Interrupted);
    };
    if is_whole {
        return merged(&part, folder, searched, screen);
    }
    let answer = part.answer(Some(folder), searched);
    let is_complete = answer.missing.is_empty();
    screen.answer(answer, |answer| text(answer, false))?;
    Ok(if is_complete { Ending::Done } else { Ending::No })
}

fn list(whole: &Part, folder: Option<&Path>, screen: &Screen) -> Result<Ending, CliError> {
    screen.answer(whole.answer(folder, 0), listed)?;
    Ok(Ending::Done)
}

fn emit(
    arguments: &Arguments,
    engine: Engine,
    whole: &Part,
    folder: &Path,
    screen: &Screen,
) -> Result<Ending, CliError> {
    let message = |error: std::io::Error| CliError::Option { option: "--emit", message: error.to_string() };
    let workflow = Workflow {
        engine: match engine {
            Engine::Snakemake => workflow::Engine::Snakemake,
            Engine::Slurm => workflow::Engine::Slurm,
        },
        program: &std::env::current_exe().map_err(message)?,
        campaign: &arguments.campaign,
        inputs: &whole.campaign.inputs(),
        ids: whole.cells.iter().map(|cell| cell.id.as_str()).collect(),
        estimated_s: whole.estimated_s(),
        part_s: arguments.job_time.as_secs_f64(),
        threads: arguments.threads.unwrap_or(1),
    };
    let _held = held(folder, "campaign")?;
    let files = workflow.write(folder)?.into_iter().map(str::to_owned).collect();
    let campaign = whole.answer(Some(&folder.join("results")), 0);
    let answer = WorkflowJson { campaign, engine: workflow.engine.key().to_owned(), parts: workflow.parts(), files };
    let start = match engine {
        Engine::Snakemake => "snakemake --profile profiles/laptop",
        Engine::Slurm => "bash submit.sh",
    };
    screen.answer(answer, |answer| {
        let (cells, parts) = (answer.campaign.cells.len(), answer.parts);
        format!(
            "{}: {cells} cells in {parts} jobs\nwrote {} into {}\nrun it there: {start}\n",
            answer.campaign.campaign,
            answer.files.join(", "),
            folder.display()
        )
    })?;
    Ok(Ending::Done)
}

/// Computes the cells of a part that are not done; how many that were, none if a signal came first.
fn compute(
    part: &Part,
    folder: &Path,
    checkpoint_every: Duration,
    stop: &StopFlag,
    screen: &Screen,
) -> Result<Option<usize>, CliError> {
    let progress = screen.progress("campaign", Some(part.cells.len() as u64));
    let watching = Watching::quiet(screen);
    let mut computed = 0;
    for (place, cell) in part.cells.iter().enumerate() {
        if !is_done(folder, cell) {
            match (&cell.work, &part.campaign.kind) {
                (Work::Search(search), Kind::Search(grid)) => {
                    let watch = Watch::new(cell, folder, checkpoint_every, stop);
                    if !searched(grid, cell, search, watch)? {
                        return Ok(None);
                    }
                }
                (Work::Search(_), _) => {}
                _ if stop.is_set() => return Ok(None),
                (Work::Tolerance(block), _) => write_cell(folder, &judge_block(&cell.id, block))?,
                (Work::Metrics(gyro), _) => write_cell(folder, &measure_gyro(&cell.id, gyro, &watching)?)?,
                (Work::Diagnose(gyro), _) => write_cell(folder, &diagnose_gyro(&cell.id, gyro, &watching)?)?,
            }
            computed += 1;
        }
        progress.at(place as u64 + 1, "");
    }
    Ok(Some(computed))
}

/// Searches one cell; false if a signal came first.
fn searched(grid: &SearchGrid, cell: &Cell, search: &Search, mut watch: Watch) -> Result<bool, CliError> {
    // A checkpoint that is damaged is none.
    let saved = read_checkpoint(&watch.state_folder, &cell.id).unwrap_or(None);
    let found = search_cell(grid, &cell.id, search, saved, &mut watch);
    match (found, watch.fault) {
        // Another process has the same cell and was faster.
        _ if is_done(watch.folder, cell) => {}
        (_, Some(fault)) => return Err(fault.into()),
        (None, None) => return Ok(false),
        (Some(found), None) => write_cell(watch.folder, &found)?,
    }
    Ok(true)
}

/// The table of a whole campaign, unless something is missing.
fn merged(whole: &Part, folder: &Path, searched: usize, screen: &Screen) -> Result<Ending, CliError> {
    let (answer, table) = whole.merged(folder, searched);
    let is_complete = table.is_some();
    if let Some(table) = table {
        write_table(folder, &table.csv, &pages(&whole.campaign.kind, &answer, &table))?;
        forget_unfinished(folder);
        screen.note(&format!("wrote {}", folder.join("summary.csv").display()));
    } else {
        screen.note(&missing_words(&answer));
    }
    screen.answer(answer, |answer| text(answer, true))?;
    Ok(if is_complete { Ending::Done } else { Ending::No })
}

/// The page, and the pictures that stand beside it.
fn pages(kind: &Kind, answer: &CampaignJson, table: &Table) -> Vec<(String, String)> {
    let page = match (kind, &answer.fleet) {
        (Kind::Search(_), _) => campaign_page(answer),
        (_, Some(fleet)) => fleet_page(&answer.campaign, fleet, &table.gyros),
        (_, None) => built_coils_page(answer),
    };
    let pictures = charts(&answer.results);
    let pictures = pictures.into_iter().map(|(objective, svg)| (format!("summary-{objective}.svg"), svg));
    std::iter::once(("report.html".to_owned(), page)).chain(pictures).collect()
}

/// More identifiers than these are in the JSON document only.
const MOST_SHOWN: usize = 20;

fn missing_words(answer: &CampaignJson) -> String {
    let shown: Vec<&str> = answer.missing.iter().take(MOST_SHOWN).map(String::as_str).collect();
    let further = answer.missing.len() - shown.len();
    let further = if further > 0 { format!(" and {further} more") } else { String::new() };
    let (missing, all) = (answer.missing.len(), answer.cells.len());
    format!("{missing} of {all} cells are missing: {}{further}", shown.join(", "))
}

/// Ends a search as soon as a signal comes or another process has done it; keeps its state from time to time.
struct Watch<'a> {
    cell: &'a Cell,
    folder: &'a Path,
    state_folder: PathBuf,
    every: Duration,
    last: Instant,
    stop: &'a StopFlag,
    fault: Option<WriteError>,
}

impl<'a> Watch<'a> {
    fn new(cell: &'a Cell, folder: &'a Path, every: Duration, stop: &'a StopFlag) -> Self {
        let state_folder = state_folder(folder, &cell.id);
        Self { cell, folder, state_folder, every, last: Instant::now(), stop, fault: None }
    }
}

impl Observer for Watch<'_> {
    fn advanced(&mut self, search: &dyn Rounds) -> ControlFlow<Halt> {
        let is_stopped = self.stop.is_set();
        if is_stopped || self.last.elapsed() >= self.every {
            if read_cell::<CellJson>(self.folder, &self.cell.id).is_some() {
                return ControlFlow::Break(Halt::Signal);
            }
            self.last = Instant::now();
            self.fault = write_checkpoint(&self.state_folder, &self.cell.id, search.state()).err();
        }
        if is_stopped || self.fault.is_some() { ControlFlow::Break(Halt::Signal) } else { ControlFlow::Continue(()) }
    }

    fn goes_on(&self) -> bool {
        !self.stop.is_set()
    }
}

fn listed(answer: &CampaignJson) -> String {
    let word = |value: &Option<String>| value.clone().unwrap_or_else(|| "–".to_owned());
    let rows = answer.cells.iter().map(|c| {
        let whose = c.coils.map(|[first, last]| format!("coils {first} to {last}")).or_else(|| c.gyro.clone());
        vec![
            c.id.clone(),
            c.kind.clone(),
            word(&c.model),
            word(&c.layers.map(|layers| layers.to_string())),
            whose.unwrap_or_else(|| word(&c.class)),
            word(&c.objective),
            word(&c.seed.map(|seed| seed.to_string())),
            format!("{:.1}", c.estimated_s),
            if c.done { "yes" } else { "no" }.to_owned(),
        ]
    });
    let header = ["id", "kind", "model", "layers", "class", "objective", "seed", "about s", "done"];
    let seconds: f64 = answer.cells.iter().filter(|c| !c.done).map(|c| c.estimated_s).sum();
    let done = answer.cells.len() - answer.missing.len();
    let head = format!(
        "{}: {} cells, {done} done; the others take about {seconds:.0} s on one thread",
        answer.campaign,
        answer.cells.len()
    );
    format!("{head}\n\n{}", table(&header, rows))
}

fn text(answer: &CampaignJson, is_whole: bool) -> String {
    let (cells, searched, missing) = (answer.cells.len(), answer.searched, answer.missing.len());
    let mut head = format!("{}: {cells} cells, {searched} computed now, {missing} missing\n", answer.campaign);
    if !answer.failed.is_empty() {
        head += &format!("{} have no result; the table says why: {}\n", answer.failed.len(), answer.failed.join(", "));
    }
    if !is_whole || missing > 0 {
        return head;
    }
    if let Some(fleet) = &answer.fleet {
        return head + &fleet.sentences.iter().map(|sentence| format!("{sentence}\n")).collect::<String>();
    }
    if !answer.built_coils.is_empty() {
        let (header, rows) = built_coils_table(&answer.built_coils);
        return format!("{head}\n{}", table(&header, rows));
    }
    for sentence in recommendations(&answer.results) {
        head += &format!("{sentence}\n");
    }
    let number = |value: Option<f64>, digits: usize| value.map_or_else(|| "–".to_owned(), |v| format!("{v:.digits$}"));
    let rows = answer.results.iter().map(|r| {
        vec![
            r.model.clone(),
            r.layers.to_string(),
            r.windability.clone(),
            r.objective.clone(),
            r.seed.to_string(),
            number(r.worst_rate_deg_per_h, 4),
            number(r.objective_deg_per_h, 4),
            number(r.improvement_over_qua, 3),
        ]
    });
    let header = ["model", "layers", "class", "objective", "seed", "worst °/h", "objective °/h", "QUA's over it"];
    format!("{head}\n{}", table(&header, rows))
}
