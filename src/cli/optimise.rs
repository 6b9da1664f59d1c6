//! `optimise`: searches the winding pattern with the smallest error.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::budget::parse_duration;
use super::former::former_pattern;
use super::optimise_field;
use super::pattern_asked::pattern_asked;
use super::progress::StopFlag;
use super::screen::{Screen, held, table};
use super::watch::Watch;
use super::{CliError, Ending, offered};
use crate::io::fault::Faults;
use crate::io::files::read_text;
use crate::io::json::diagnosis::DiagnosisJson;
use crate::io::json::search::OptimiseJson;
use crate::io::model::ModelFile;
use crate::io::read::model_file::read_design;
use crate::io::read::posterior::drawn_models;
use crate::io::write::checkpoint::{BROKEN_FILE, CHECKPOINT_FILE, read_checkpoint, set_broken_aside};
use crate::io::write::run_directory::{Request, check_kept};
use crate::pattern::windability::WindabilityClass;
use crate::rate::CoilModel;
use crate::search;
use crate::search::anneal::rounds::{DEFAULT_RESTARTS_PER_ROUND, State};
use crate::search::answer::Ended;
use crate::search::cost::objective::Objective;
use crate::search::end_turns::EndChoice;
use crate::search::run::RunError;
use crate::task::optimise::{self, DRAWN_MODELS, Wishes};

/// Search the winding pattern with the smallest error
#[derive(Debug, Clone, clap::Args)]
#[command(
    alias = "optimize",
    after_help = "The search ends with the first rule that fires: rounds without improvement, rounds, moves, target, or the clock.\n\
    With equal layers, up to 16 of them, a search over permutations also ends once its best pattern is proved to be the best.\n\
    Without a clock the same seed gives the same bytes at any number of threads.\n\n\
    Examples:\n  coilwright optimise examples/paper-200m.toml -o results/paper-200m\n  \
    coilwright optimise examples/paper-200m.toml --windability any --seed 7 --budget 30s\n  \
    coilwright optimise my-coil.toml --objective p95       the winding that is best when it is built imperfectly\n  \
    coilwright optimise my-coil.toml --cutting-planes      the worst admissible profiles join the searched ones\n  \
    coilwright optimise examples/paper-200m.toml -o results/paper-200m --resume\n  \
    coilwright optimise extended.toml --compare-with results/paper-200m\n  \
    coilwright optimise my-coil.toml --field warm-up.csv   temperatures from a finite-element program"
)]
pub(crate) struct Arguments {
    /// The model file
    pub(super) model: PathBuf,
    #[command(flatten)]
    pub(super) search: SearchOptions,
    /// Writes the run's results and checkpoints into this folder
    #[arg(long, short, value_name = "DIR")]
    pub(super) output: Option<PathBuf>,
    /// Takes up the interrupted run in the output folder; begins one if there is none
    #[arg(long, requires = "output", conflicts_with = "fresh")]
    pub(super) resume: bool,
    /// Begins again although the output folder holds an unfinished run
    #[arg(long, requires = "output")]
    fresh: bool,
    /// Says whether the best pattern differs from a former one and what that costs under this model: a winding's name, a
    /// pattern file, or the folder of a search; without it, the pattern of --init
    #[arg(long, value_name = "PATTERN", value_parser = offered::patterns(), hide_possible_values = true)]
    compare_with: Option<String>,
    /// Lets the worst admissible profiles of what is found join the searched ones until sampled and guaranteed worst rate
    /// agree; for the objectives worst-rate and worst-phase
    #[arg(long)]
    cutting_planes: bool,
    /// Chooses up to so many whole turns that are left off at an end of the fibre, beside the order of whole layers
    #[arg(long, value_name = "TURNS", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    trim_turns: Option<u32>,
    /// Lets the outermost layer be split between the two ends of the fibre: turns that one end leaves there are wound with the
    /// other end
    #[arg(long)]
    split_layer: bool,
    /// The diagnosis that the model comes from (diagnosis.json): every set of explanations counts by its probability and
    /// every parameter with its error, and the recommended winding is the one that is best over all of them
    #[arg(long, value_name = "FILE")]
    diagnosis: Option<PathBuf>,
    /// Temperatures of the layers that were computed elsewhere (CSV: time_s, layer_1_c, …, or time_s, layer, temperature_c), used
    /// instead of the profiles; may be repeated, each file is a case. What is found, and what --prove proves, is about the rows
    /// of these files
    #[arg(long, value_name = "FILE", conflicts_with_all = ["compare_with", "cutting_planes", "diagnosis", "trim_turns", "split_layer"])]
    pub(super) field: Vec<PathBuf>,
    /// Tries for so long to prove that the best pattern is the best of its class
    #[arg(long, value_name = "TIME", value_parser = parse_duration)]
    pub(super) prove: Option<Duration>,
    /// Writes a checkpoint when the last one is older than this
    #[arg(long, value_name = "TIME", default_value = "1s", value_parser = parse_duration)]
    pub(super) checkpoint_every: Duration,
    /// Threads to use; without it, as many as there are processors
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

/// What is searched for and how long; shared with commands that run searches.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct SearchOptions {
    /// Seed of everything random; without it, the model's own
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// What can be wound: standard, captive:K or any; without it, the model's own
    #[arg(long, value_name = "CLASS", value_parser = offered::classes(), hide_possible_values = true)]
    pub(crate) windability: Option<WindabilityClass>,
    /// What is made small: worst-rate, worst-phase, rms, guaranteed-rate or p95 (the 95 % quantile of the worst rate over
    /// coils built with the model's [tolerance]); without it, the model's own
    #[arg(long, value_name = "WHAT", value_parser = offered::objectives(), hide_possible_values = true)]
    pub(crate) objective: Option<Objective>,
    /// Ends after this time, e.g. 30s or 5m (the result then depends on the machine)
    #[arg(long, value_name = "TIME")]
    pub(crate) budget: Option<String>,
    /// Ends after so many rounds
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) rounds: Option<u64>,
    /// Ends after the round in which so many moves have been judged
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) moves: Option<u64>,
    /// Ends after so many rounds without a better pattern
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) patience: Option<u64>,
    /// Ends when the objective is this small; a proof is not begun or not finished then
    #[arg(long, value_name = "DEG_PER_H")]
    pub(crate) target: Option<f64>,
    /// Restarts in a round
    #[arg(long, value_name = "N", default_value_t = DEFAULT_RESTARTS_PER_ROUND as u16, value_parser = clap::value_parser!(u16).range(1..=4096))]
    pub(crate) restarts: u16,
    /// Moves of one restart; without it, 128 N² for N layers, at most a million (p95: 16 N², each over many coils)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) moves_per_restart: Option<u64>,
    /// The pattern to begin with: a winding's name or a pattern file
    #[arg(long, value_name = "PATTERN", value_parser = offered::patterns(), hide_possible_values = true)]
    pub(crate) init: Option<String>,
}

pub(super) fn parse_class(text: &str) -> Result<WindabilityClass, String> {
    WindabilityClass::parse(text)
        .ok_or_else(|| format!("expected standard, captive:K with a number K, or any, found \"{text}\""))
}

pub(super) fn parse_objective(text: &str) -> Result<Objective, String> {
    Objective::from_key(text).ok_or_else(|| {
        let keys: Vec<&str> = Objective::ALL.iter().map(|o| o.key()).collect();
        format!("expected one of {}, found \"{text}\"", keys.join(", "))
    })
}

impl SearchOptions {
    pub(super) fn budget(&self) -> Result<Option<Duration>, CliError> {
        let parse = |stated: &String| {
            parse_duration(stated).map_err(|message| CliError::Option { option: "--budget", message })
        };
        self.budget.as_ref().map(parse).transpose()
    }

    pub(super) fn wishes(&self, file: &ModelFile) -> Result<Wishes, CliError> {
        Ok(Wishes {
            seed: self.seed,
            class: self.windability,
            objective: self.objective,
            has_budget: self.budget.is_some(),
            rounds: self.rounds,
            moves: self.moves,
            patience: self.patience,
            target_deg_per_h: self.target,
            restarts_per_round: Some(self.restarts.into()),
            moves_per_restart: self.moves_per_restart,
            start: pattern_asked(file, self.init.as_deref())?,
            cutting_planes: false,
            ends: EndChoice::default(),
        })
    }
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    if let Some(threads) = arguments.threads {
        // Fails only where a pool exists already, which then serves as well: results don't depend on it.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(threads.into()).build_global();
    }
    let stop = StopFlag::listen();
    let file = read_design(&arguments.model)?;
    if !arguments.field.is_empty() {
        return optimise_field::run(arguments, &file, &stop, screen);
    }
    for advice in &file.advice {
        screen.note(&format!("note: {advice}"));
    }
    let options = &arguments.search;
    let budget = options.budget()?;
    let ends = EndChoice { most_left_off: arguments.trim_turns.unwrap_or(0), shares_outermost: arguments.split_layer };
    let wishes = Wishes { cutting_planes: arguments.cutting_planes, ends, ..options.wishes(&file)? };
    let former = arguments.compare_with.as_ref().or(options.init.as_ref());
    let former = former.map(|stated| former_pattern(stated, file.model.coil.layers())).transpose()?;
    let mut searched = wishes.request(&file, arguments.prove.is_some(), former)?;
    let plan = searched.plan.clone();
    let (class, objective) = (searched.class, searched.objective);
    let request = Request {
        file: &file,
        class,
        objective,
        plan: &plan,
        budget: options.budget.as_deref(),
        cutting_planes: arguments.cutting_planes,
        fields: &[],
    };
    let uncertain = models_of(arguments.diagnosis.as_deref(), &file, plan.seed)?;
    searched.uncertain = &uncertain;
    let folder = arguments.output.as_deref();
    folder.map_or(Ok(()), |folder| check_kept(folder, screen.named().chain(file.files())))?;
    let _held = folder.map(|folder| held(folder, "optimise")).transpose()?;
    searched.saved = match folder {
        Some(folder) => saved_state(arguments, folder, &request, screen)?,
        None => None,
    };

    let started = Instant::now();
    let is_taken_up = folder.is_some_and(|f| arguments.resume && f.join(CHECKPOINT_FILE).exists());
    let mut watch = Watch::new(arguments, &request, budget, started, &stop, screen, is_taken_up);
    let answer = search::run(&searched, &mut watch);
    watch.fault.take().map_or(Ok(()), Err)?;
    let (found_s, seconds) = (watch.found_s, started.elapsed().as_secs_f64());
    let Some(answer) = answer.map_err(|error| of_run(error, folder))? else {
        screen.note("interrupted before anything was found");
        return Ok(Ending::Interrupted);
    };
    let document = OptimiseJson::of(&file.model.name, &searched, &answer, seconds, found_s);
    if let Some(folder) = folder {
        optimise::write(folder, &file, &document, &answer)?;
        screen.note(&format!("wrote {}", folder.display()));
    }
    screen.answer(document, text)?;
    Ok(if answer.ended == Ended::Signal { Ending::Interrupted } else { Ending::Done })
}

/// Models that may be the true one by a diagnosis; none without one.
fn models_of(diagnosis: Option<&Path>, file: &ModelFile, seed: u64) -> Result<Vec<CoilModel>, CliError> {
    let Some(path) = diagnosis else { return Ok(Vec::new()) };
    let found = read_diagnosis(path)?;
    Ok(drawn_models(&file.model, &found.posterior, &found.refitted, DRAWN_MODELS, seed))
}

/// A saved state that fits no search is the checkpoint's fault.
pub(super) fn of_run(error: RunError, folder: Option<&Path>) -> CliError {
    match error {
        RunError::Judge(error) => error.into(),
        RunError::Resume => CliError::Checkpoint { path: folder.map(|f| f.join(CHECKPOINT_FILE)).unwrap_or_default() },
    }
}

/// The state to go on from; refuses to write over an unfinished run unasked.
pub(super) fn saved_state(
    arguments: &Arguments,
    folder: &Path,
    request: &Request,
    screen: &Screen,
) -> Result<Option<State>, CliError> {
    if arguments.fresh {
        if set_broken_aside(folder)? {
            screen.note(&format!("the broken checkpoint is kept as {BROKEN_FILE}"));
        }
        return Ok(None);
    }
    let found = read_checkpoint(folder, &request.fingerprint());
    if arguments.resume {
        let state = found.map_err(|faults| with_note(faults, &request.differences(folder)))?;
        screen.note(&match &state {
            Some(state) => format!("resuming after {} rounds", state.round),
            None => format!("nothing to resume in {}: beginning a new run", folder.display()),
        });
        return Ok(state);
    }
    let unfinished = match found {
        Ok(state) => state.is_some_and(|s| s.stop.is_none()),
        // Of another request, or no checkpoint at all: not ours to write over either.
        Err(_) => !folder.join("summary.json").exists(),
    };
    if unfinished {
        let path = folder.join(CHECKPOINT_FILE).display().to_string();
        return Err(Faults::of_file(
            path,
            "belongs to an unfinished run: go on with --resume, or begin again with --fresh",
        )
        .into());
    }
    Ok(None)
}

/// What of the request is another one than the folder's.
fn with_note(mut faults: Faults, differences: &[String]) -> Faults {
    if let (Some(fault), false) = (faults.faults.first_mut(), differences.is_empty()) {
        fault.note = Some(differences.join("; "));
    }
    faults
}

fn read_diagnosis(path: &Path) -> Result<DiagnosisJson, CliError> {
    let text = read_text(path)?;
    serde_json::from_str(&text).map_err(|error| {
        let message = format!(
            "line {}: cannot be understood: {error}; give the diagnosis.json that `coilwright diagnose … -o DIR` writes",
            error.line()
        );
        Faults::of_file(path.display().to_string(), message).into()
    })
}

/// Shown only where the search was over built coils.
const P95_COLUMN: usize = 3;

fn text(answer: &OptimiseJson) -> String {
    let rows = answer.baselines.iter().chain(std::iter::once(&answer.best)).map(|p| {
        vec![
            p.name.clone(),
            format!("{:.4}", p.worst_rate_deg_per_h),
            p.guaranteed_worst_rate_deg_per_h.map_or_else(|| "–".to_owned(), |g| format!("{g:.4}")),
            p.p95_rate_deg_per_h.map_or_else(|| "–".to_owned(), |g| format!("{g:.4}")),
            p.worst_profile.clone(),
            format!("{:.2}", p.worst_time_s),
            p.windability.class.clone(),
            p.windability.reels.to_string(),
            p.windability.max_climb.to_string(),
        ]
    });
    let header = ["pattern", "worst °/h", "guaranteed °/h", "P95 °/h", "profile", "at s", "class", "reels", "climb"];
    let is_over_coils = answer.best.p95_rate_deg_per_h.is_some();
    let shown = |columns: Vec<String>| -> Vec<String> {
        columns.into_iter().enumerate().filter(|(i, _)| is_over_coils || *i != P95_COLUMN).map(|(_, c)| c).collect()
    };
    let header = shown(header.map(str::to_owned).to_vec());
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    let rows = rows.map(shown);
    let joined = |segments: &[usize]| segments.iter().map(ToString::to_string).collect::<Vec<String>>().join(" ");
    let recommendation = answer.recommendation.as_ref().map_or_else(String::new, |recommendation| {
        let reasons: String = recommendation.reasons.iter().map(|reason| format!("  {reason}\n")).collect();
        let segments = joined(&recommendation.segments);
        format!("{}\n{reasons}  segments, innermost layer first: {segments}\n\n", recommendation.sentence)
    });
    let ends = answer.ends.as_ref().map_or_else(String::new, |ends| format!("{}\n", ends.statement));
    format!(
        "{recommendation}{}{}\n{ends}{}\n{}\nbest pattern, innermost layer first: {}\n{} moves judged in {} rounds, ended by: {}{}\n",
        answer.predicted_gain.as_ref().map_or_else(String::new, |gain| gain.words() + "\n"),
        answer.statement,
        answer.compared_with.as_ref().map_or_else(String::new, |former| former.statement.clone() + "\n"),
        table(&header, rows),
        joined(&answer.best.segments),
        answer.evaluations,
        answer.rounds,
        answer.stopped_by,
        if answer.reproducible { "" } else { " (another machine may end elsewhere)" },
    )
}
