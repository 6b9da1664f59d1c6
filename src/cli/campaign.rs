//! `campaign`: searches, built coils or the gyros of a fleet, in parts and with interruptions, with one table at the end.

use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use clap::ValueEnum;

use super::budget::parse_duration;
use super::progress::{StopFlag, TaskProgress};
use super::screen::{Screen, held, table};
use super::watching::Watching;
use super::{CliError, Ending};
use crate::io::json::campaign::{CampaignJson, WorkflowJson};
use crate::io::read::campaign_file::read_campaign;
use crate::io::write::workflow::{self, Workflow};
use crate::report::built_coils::built_coils_table;
use crate::report::campaign::recommendations;
use crate::task::Observer;
use crate::task::campaign::CampaignPart;
use crate::task::campaign::carrying_out::{Face, compute, merge, missing_words};

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
pub(crate) struct Arguments {
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

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    if let Some(threads) = arguments.threads {
        // Fails only where a pool exists already, which then serves as well: results don't depend on it.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(threads.into()).build_global();
    }
    let campaign = read_campaign(&arguments.campaign)?;
    let cells = campaign.cells()?;
    let whole = CampaignPart::whole(&campaign, &cells);
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
        Some(Shard { index, count }) => CampaignPart::dealt(&campaign, &cells, index, count),
        None if !arguments.cell.is_empty() => CampaignPart::of_ids(&campaign, &cells, &arguments.cell)?,
        None => whole,
    };
    let is_whole = arguments.shard.is_none() && arguments.cell.is_empty();
    // Parts of one campaign may work in one folder at once; they write different files.
    let _held = if is_whole { Some(held(folder, "campaign")?) } else { None };
    let stop = StopFlag::listen();
    let carrying = Carrying {
        screen,
        progress: screen.progress("campaign", Some(part.cells.len() as u64)),
        cells: part.cells.len(),
        stop: &stop,
        every: arguments.checkpoint_every,
        last: Mutex::new(Instant::now()),
    };
    let Some(searched) = compute(&part, folder, &carrying)? else {
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

fn list(whole: &CampaignPart, folder: Option<&Path>, screen: &Screen) -> Result<Ending, CliError> {
    screen.answer(whole.answer(folder, 0), listed)?;
    Ok(Ending::Done)
}

/// The program, as it was called where that is its place: called from Python, this process is another's.
fn program_of(screen: &Screen) -> Result<PathBuf, CliError> {
    if screen.program.is_absolute() && screen.program.is_file() {
        return Ok(screen.program.clone());
    }
    std::env::current_exe().map_err(|error| CliError::Option { option: "--emit", message: error.to_string() })
}

fn emit(
    arguments: &Arguments,
    engine: Engine,
    whole: &CampaignPart,
    folder: &Path,
    screen: &Screen,
) -> Result<Ending, CliError> {
    let workflow = Workflow {
        engine: match engine {
            Engine::Snakemake => workflow::Engine::Snakemake,
            Engine::Slurm => workflow::Engine::Slurm,
        },
        program: &program_of(screen)?,
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

/// The table of a whole campaign, unless something is missing.
fn merged(whole: &CampaignPart, folder: &Path, searched: usize, screen: &Screen) -> Result<Ending, CliError> {
    let answer = merge(whole, folder, searched, &Watching::quiet(screen))?;
    let is_complete = answer.missing.is_empty();
    screen.answer(answer, |answer| text(answer, true))?;
    Ok(if is_complete { Ending::Done } else { Ending::No })
}

/// Shows how many cells are done, and lets the state of a long one be kept from time to time.
struct Carrying<'a> {
    screen: &'a Screen,
    progress: TaskProgress,
    cells: usize,
    stop: &'a StopFlag,
    every: Duration,
    last: Mutex<Instant>,
}

impl Observer for Carrying<'_> {
    fn note(&self, words: &str) {
        self.screen.note(words);
    }

    fn at(&self, share_done: f64, _words: &str) {
        // What is done are whole cells; a rounding must not take one away.
        self.progress.at((share_done * self.cells as f64 + 1e-6) as u64, "");
    }

    fn goes_on(&self) -> bool {
        !self.stop.is_set()
    }
}

impl Face for Carrying<'_> {
    fn keeps_state(&self) -> bool {
        let Ok(mut last) = self.last.lock() else { return false };
        let is_due = last.elapsed() >= self.every;
        if is_due {
            *last = Instant::now();
        }
        is_due
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
