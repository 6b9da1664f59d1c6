//! `optimise`: searches the winding pattern with the smallest error.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::budget::parse_duration;
use super::former::{compare_with_former, former_pattern};
use super::progress::StopFlag;
use super::prove::{prove_best, words};
use super::screen::{Screen, table};
use super::{CliError, Ending, report, schedule};
use crate::io::fault::Faults;
use crate::io::files::write_atomically;
use crate::io::json::{PatternJson, ProofJson};
use crate::io::model::{ModelFile, NamedPattern};
use crate::io::read::model_file::read_model;
use crate::io::read::pattern_file::resolve_pattern;
use crate::io::write::checkpoint::{CHECKPOINT_FILE, read_checkpoint, write_checkpoint};
use crate::io::write::run_directory::{
    BestFoundJson, GridCheckJson, OptimiseJson, Request, write_request, write_results,
};
use crate::pattern::windability::WindabilityClass;
use crate::search::anneal::rounds::{DEFAULT_PATIENCE, DEFAULT_RESTARTS_PER_ROUND, Plan, Rounds, Rules, Stop};
use crate::search::cost::guaranteed::UnitStep;
use crate::search::cost::objective::Objective;
use crate::search::cost::worst_case::SolvedProfiles;
use crate::search::evaluator::{Evaluator, Judged, improvement_over_qua};
use crate::units::{deg_per_h_from_rad_per_s, rad_per_s_from_deg_per_h};

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
    coilwright optimise examples/paper-200m.toml -o results/paper-200m --resume\n  \
    coilwright optimise extended.toml --compare-with results/paper-200m"
)]
pub struct Arguments {
    /// The model file
    pub(super) model: PathBuf,
    #[command(flatten)]
    pub(super) search: SearchOptions,
    /// Writes the run's results and checkpoints into this folder
    #[arg(long, short, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Takes up the interrupted run in the output folder; begins one if there is none
    #[arg(long, requires = "output", conflicts_with = "fresh")]
    resume: bool,
    /// Begins again although the output folder holds an unfinished run
    #[arg(long, requires = "output")]
    fresh: bool,
    /// Says whether the best pattern differs from a former one and what that costs under this model: a winding's name, a
    /// pattern file, or the folder of a search; without it, the pattern of --init
    #[arg(long, value_name = "PATTERN")]
    compare_with: Option<String>,
    /// Tries for so long to prove that the best pattern is the best of its class
    #[arg(long, value_name = "TIME", value_parser = parse_duration)]
    prove: Option<Duration>,
    /// Writes a checkpoint when the last one is older than this
    #[arg(long, value_name = "TIME", default_value = "1s", value_parser = parse_duration)]
    checkpoint_every: Duration,
    /// Threads to use; without it, as many as there are processors
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

/// What is searched for and how long; shared with commands that run searches.
#[derive(Debug, Clone, clap::Args)]
pub struct SearchOptions {
    /// Seed of everything random; without it, the model's own
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// What can be wound: standard, captive:K or any; without it, the model's own
    #[arg(long, value_name = "CLASS", value_parser = parse_class)]
    pub windability: Option<WindabilityClass>,
    /// What is made small: worst-rate, worst-phase, rms, guaranteed-rate or p95 (the 95 % quantile of the worst rate over
    /// coils built with the model's [tolerance]); without it, the model's own
    #[arg(long, value_name = "WHAT", value_parser = parse_objective)]
    pub objective: Option<Objective>,
    /// Ends after this time, e.g. 30s or 5m (the result then depends on the machine)
    #[arg(long, value_name = "TIME")]
    pub budget: Option<String>,
    /// Ends after so many rounds
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub rounds: Option<u64>,
    /// Ends after the round in which so many moves have been judged
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub moves: Option<u64>,
    /// Ends after so many rounds without a better pattern
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub patience: Option<u64>,
    /// Ends when the objective is this small; a proof is not begun or not finished then
    #[arg(long, value_name = "DEG_PER_H")]
    pub target: Option<f64>,
    /// Restarts in a round
    #[arg(long, value_name = "N", default_value_t = DEFAULT_RESTARTS_PER_ROUND as u16, value_parser = clap::value_parser!(u16).range(1..=4096))]
    pub restarts: u16,
    /// Moves of one restart; without it, 128 N² for N layers, at most a million (p95: 16 N², each over many coils)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub moves_per_restart: Option<u64>,
    /// The pattern to begin with: a winding's name or a pattern file
    #[arg(long, value_name = "PATTERN")]
    pub init: Option<String>,
}

fn parse_class(text: &str) -> Result<WindabilityClass, String> {
    WindabilityClass::parse(text)
        .ok_or_else(|| format!("expected standard, captive:K with a number K, or any, found \"{text}\""))
}

fn parse_objective(text: &str) -> Result<Objective, String> {
    Objective::from_key(text).ok_or_else(|| {
        let keys: Vec<&str> = Objective::ALL.iter().map(|o| o.key()).collect();
        format!("expected one of {}, found \"{text}\"", keys.join(", "))
    })
}

/// Patience where a budget of time says that the search may take long.
const PATIENCE_WITH_BUDGET: u64 = 4 * DEFAULT_PATIENCE;

impl SearchOptions {
    pub(super) fn class(&self, file: &ModelFile) -> WindabilityClass {
        self.windability.unwrap_or(file.search.windability)
    }

    pub(super) fn objective(&self, file: &ModelFile) -> Objective {
        self.objective.unwrap_or(file.search.objective)
    }

    pub(super) fn budget(&self) -> Result<Option<Duration>, CliError> {
        let parse = |stated: &String| {
            parse_duration(stated).map_err(|message| CliError::Option { option: "--budget", message })
        };
        self.budget.as_ref().map(parse).transpose()
    }

    /// The plan of a search of a model.
    pub(super) fn plan(&self, file: &ModelFile) -> Result<Plan, CliError> {
        let layers = file.model.coil.layers();
        let class = self.class(file);
        let starts = match &self.init {
            None => Vec::new(),
            Some(stated) => {
                let NamedPattern { name, pattern } = resolve_pattern(stated, layers, None)?;
                if !class.admits(&pattern) {
                    let message = format!("the pattern {name} is not of the class {class}: choose a wider class");
                    return Err(CliError::Option { option: "--init", message });
                }
                vec![pattern.segments().to_vec()]
            }
        };
        if let Some(target) = self.target.filter(|t| !(*t >= 0.0 && t.is_finite())) {
            let message = format!("expected a rate error of zero or more in °/h, found {target}");
            return Err(CliError::Option { option: "--target", message });
        }
        let objective = self.objective(file);
        let patience = if self.budget.is_some() { PATIENCE_WITH_BUDGET } else { DEFAULT_PATIENCE };
        Ok(Plan {
            seed: self.seed.unwrap_or(file.search.seed),
            restarts_per_round: self.restarts.into(),
            moves_per_restart: self.moves_per_restart.unwrap_or_else(|| objective.default_moves_per_restart(layers)),
            rules: Rules {
                rounds: self.rounds.unwrap_or(u64::MAX),
                patience: self.patience.unwrap_or(patience),
                moves: self.moves,
                target: self.target.map(rad_per_s_from_deg_per_h),
            },
            starts,
        })
    }
}

pub fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    if let Some(threads) = arguments.threads {
        // Fails only where a pool exists already, which then serves as well: results don't depend on it.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(threads.into()).build_global();
    }
    let stop = StopFlag::listen();
    let file = read_model(&arguments.model)?;
    for advice in &file.advice {
        screen.note(&format!("note: {advice}"));
    }
    let options = &arguments.search;
    let (class, objective) = (options.class(&file), options.objective(&file));
    let budget = options.budget()?;
    let plan = options.plan(&file)?;
    let former = arguments.compare_with.as_ref().or(options.init.as_ref());
    let former = former.map(|stated| former_pattern(stated, file.model.coil.layers())).transpose()?;
    let request = Request { file: &file, class, objective, plan: &plan, budget: options.budget.as_deref() };
    if arguments.prove.is_some() && !matches!(objective, Objective::WorstRate | Objective::WorstPhase) {
        let message = format!("proofs are of the worst rate and the worst phase, not of {}", objective.key());
        return Err(CliError::Option { option: "--prove", message });
    }
    let folder = arguments.output.as_deref();
    let saved = match folder {
        Some(folder) => saved_state(arguments, folder, &request, screen)?,
        None => None,
    };

    let started = Instant::now();
    let solved = SolvedProfiles::new(&file.model, &file.profiles.profiles())?;
    let unit_step = UnitStep::new(&file.model, file.profiles.max_rate_k_per_s).ok();
    let evaluator = evaluator_of(&file, &solved, objective, unit_step.as_ref());
    let baselines = evaluator.baselines()?;
    let mut search = evaluator
        .search(class, plan.clone(), saved)?
        .ok_or_else(|| CliError::Checkpoint { path: folder.map(|f| f.join(CHECKPOINT_FILE)).unwrap_or_default() })?;
    if let Some(folder) = folder.filter(|f| !(arguments.resume && f.join(CHECKPOINT_FILE).exists())) {
        write_request(folder, &request)?;
        write_checkpoint(folder, &request.fingerprint(), search.state())?;
    }
    let evaluated_before = search.evaluations();
    let checkpoint = folder.map(|folder| Checkpointing {
        folder,
        fingerprint: request.fingerprint(),
        every: arguments.checkpoint_every,
    });
    let target = plan.rules.target;
    let is_good_enough = |judged: &Judged| target.is_some_and(|target| judged.objective_rad_per_s <= target);
    let mut concluded = None;
    let mut conclusion = |search: &dyn Rounds| -> Result<Option<Stop>, CliError> {
        let found = &search.state().found;
        let Some(best) = evaluator.best(class, found, &baselines)?.filter(|_| evaluator.is_provable(class)) else {
            return Ok(None);
        };
        let (best, is_optimal) = evaluator.improved(class, best, found, target)?;
        let stop = if is_optimal { Some(Stop::Proved) } else { is_good_enough(&best).then_some(Stop::Target) };
        concluded = stop.map(|_| best);
        Ok(stop)
    };
    let (ended, found_s) = anneal(search.as_mut(), &mut conclusion, budget, started, &stop, checkpoint, screen)?;

    let Some(best) = evaluator.best(class, &search.state().found, &baselines)? else {
        screen.note("interrupted before anything was found");
        return Ok(Ending::Interrupted);
    };
    // A target may have been reached at the samples and not between them.
    let is_unhurried = ended == Ended::Rule && !is_good_enough(&best);
    let annealed = best.pattern.clone();
    let best = match concluded {
        Some(concluded) => concluded,
        None if is_unhurried => evaluator.improved(class, best, &search.state().found, target)?.0,
        None => best,
    };
    let seconds = started.elapsed().as_secs_f64();
    let best_found = if best.pattern != annealed {
        BestFoundJson { by: "bounds", evaluations: search.evaluations(), seconds: Some(seconds) }
    } else if baselines.iter().any(|b| b.pattern == best.pattern) {
        BestFoundJson { by: "classic", evaluations: 0, seconds: Some(0.0) }
    } else {
        let evaluations = search.state().first_with_best().map_or(0, |record| record.evaluations);
        BestFoundJson { by: "annealing", evaluations, seconds: Some(found_s) }
    };
    let nothing_proved = (ProofJson::none(), false);
    let (best, (proof, proof_cut_short)) = match arguments.prove.filter(|_| ended != Ended::Signal) {
        None => (best, nothing_proved),
        Some(time) => {
            let (best, proof, cut) = prove_best(&evaluator, class, best, &baselines, time, &stop, screen)?;
            (best, (proof, cut))
        }
    };
    let grid_check = if ended == Ended::Signal { None } else { evaluator.grid_check(&best, &baselines)? };
    let grid_check = grid_check.as_ref().map(GridCheckJson::of);
    let caution = grid_check.as_ref().and_then(|check| check.caution.clone());
    let compared_with = former.map(|f| compare_with_former(&evaluator, class, &best, &f)).transpose()?;
    let judged_now = (search.evaluations() - evaluated_before) as f64;
    let answer = OptimiseJson {
        model: file.model.name.clone(),
        objective: objective.key().to_owned(),
        windability: class.to_string(),
        seed: plan.seed,
        best: PatternJson::of(&best),
        baselines: baselines.iter().map(PatternJson::of).collect(),
        improvement_over_qua: improvement_over_qua(&best, &baselines),
        statement: evaluator.statement(&best, &baselines, class)
            + &words(&proof)
            + &caution.map_or_else(String::new, |caution| format!(" {caution}")),
        grid_check,
        compared_with,
        proof,
        evaluations: search.evaluations(),
        evaluations_per_s: Some(judged_now / seconds),
        seconds: Some(seconds),
        best_found,
        rounds: search.state().round,
        stopped_by: ended.words(search.as_ref()).to_owned(),
        reproducible: ended == Ended::Rule && !proof_cut_short,
    };
    if let Some(folder) = folder {
        write_folder(folder, &file, &answer, &best, search.as_ref(), screen)?;
    }
    screen.answer(answer, text)?;
    Ok(if ended == Ended::Signal { Ending::Interrupted } else { Ending::Done })
}

/// What patterns of a model are judged by.
pub(super) fn evaluator_of<'a>(
    file: &'a ModelFile,
    solved: &'a SolvedProfiles,
    objective: Objective,
    unit_step: Option<&'a UnitStep>,
) -> Evaluator<'a> {
    let ModelFile { model, profiles, tolerance, .. } = file;
    Evaluator { model, solved, objective, unit_step, profiles, tolerance: tolerance.as_ref() }
}

/// The state to go on from; refuses to write over an unfinished run unasked.
fn saved_state(
    arguments: &Arguments,
    folder: &Path,
    request: &Request,
    screen: &Screen,
) -> Result<Option<crate::search::anneal::rounds::State>, CliError> {
    if arguments.fresh {
        return Ok(None);
    }
    let found = read_checkpoint(folder, &request.fingerprint());
    if arguments.resume {
        let state = found?;
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

/// How a search came to its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Ended {
    Rule,
    Clock,
    Signal,
}

impl Ended {
    fn words(self, search: &dyn Rounds) -> &'static str {
        match self {
            Ended::Rule => search.state().stop.map_or("rounds", |stop| stop.key()),
            Ended::Clock => "clock",
            Ended::Signal => "interrupted",
        }
    }
}

/// Where checkpoints go, what they belong to, and how often they are written.
struct Checkpointing<'a> {
    folder: &'a Path,
    fingerprint: String,
    every: Duration,
}

/// Advances a search to its end, writing checkpoints and showing progress. After its first round `conclusion` is asked
/// whether what was found can be made good enough or the best there is. Also answers the seconds until the best was found.
fn anneal(
    search: &mut dyn Rounds,
    conclusion: &mut impl FnMut(&dyn Rounds) -> Result<Option<Stop>, CliError>,
    budget: Option<Duration>,
    started: Instant,
    stop: &StopFlag,
    checkpoint: Option<Checkpointing>,
    screen: &Screen,
) -> Result<(Ended, f64), CliError> {
    let total = search.plan().rules.moves;
    let progress = screen.progress("optimise", total);
    let mut last_checkpoint = Instant::now();
    let mut asked = false;
    let (mut best_cost, mut found_s) = (f64::INFINITY, 0.0);
    let ended = loop {
        let goes_on = search.advance();
        if let Some(best) = search.best().filter(|best| best.cost < best_cost) {
            (best_cost, found_s) = (best.cost, started.elapsed().as_secs_f64());
        }
        if !goes_on {
            break Ended::Rule;
        }
        if search.state().round == 1
            && !std::mem::replace(&mut asked, true)
            && let Some(stop) = conclusion(search)?
        {
            search.conclude(stop);
            break Ended::Rule;
        }
        if let Some(Checkpointing { folder, fingerprint, every }) = &checkpoint
            && last_checkpoint.elapsed() >= *every
        {
            write_checkpoint(folder, fingerprint, search.state())?;
            last_checkpoint = Instant::now();
        }
        let message = search.best().map_or_else(String::new, |best| {
            format!("round {}, best {:.4} °/h", search.state().round + 1, deg_per_h_from_rad_per_s(best.cost))
        });
        progress.at(search.evaluations(), &message);
        if stop.is_set() {
            break Ended::Signal;
        }
        if budget.is_some_and(|budget| started.elapsed() >= budget) {
            break Ended::Clock;
        }
    };
    if let Some(Checkpointing { folder, fingerprint, .. }) = &checkpoint {
        write_checkpoint(folder, fingerprint, search.state())?;
    }
    search.gather();
    Ok((ended, found_s))
}

fn write_folder(
    folder: &Path,
    file: &ModelFile,
    answer: &OptimiseJson,
    best: &Judged,
    search: &dyn Rounds,
    screen: &Screen,
) -> Result<(), CliError> {
    let named = NamedPattern { name: best.name.clone(), pattern: best.pattern.clone() };
    let (_, document) = schedule::plan(file, &named)?;
    let json = serde_json::to_string_pretty(&document).map_err(|e| CliError::Stdout(e.into()))? + "\n";
    let csv = document.csv().map_err(|e| CliError::Stdout(e.into()))?;
    write_atomically(&folder.join("schedule.csv"), csv.as_bytes())?;
    write_atomically(&folder.join("schedule.json"), json.as_bytes())?;
    write_results(folder, answer, best, search.state())?;
    report::write_report(folder, &folder.join("report.html"))?;
    screen.note(&format!("wrote {}", folder.display()));
    Ok(())
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
    let segments: Vec<String> = answer.best.segments.iter().map(ToString::to_string).collect();
    format!(
        "{}\n{}\n{}\nbest pattern, innermost layer first: {}\n{} moves judged in {} rounds, ended by: {}{}\n",
        answer.statement,
        answer.compared_with.as_ref().map_or_else(String::new, |former| former.statement.clone() + "\n"),
        table(&header, rows),
        segments.join(" "),
        answer.evaluations,
        answer.rounds,
        answer.stopped_by,
        if answer.reproducible { "" } else { " (another machine may end elsewhere)" },
    )
}
