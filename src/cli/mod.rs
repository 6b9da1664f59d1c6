//! The command line: one file a subcommand — parse, call, print. Documents go to stdout, words and progress to stderr.

mod budget;
mod campaign;
mod check;
mod compare;
mod compensate;
mod completions;
mod diagnose;
mod effects;
mod evaluate;
mod exact;
mod explore;
mod extend;
mod fibres;
mod former;
mod improve;
mod man;
mod materials;
mod metrics;
mod new;
mod offered;
mod optimise;
mod optimise_field;
mod pareto;
mod pattern_asked;
mod patterns;
mod potting;
pub(crate) mod progress;
mod records;
mod report;
mod reproduce;
mod schedule;
mod schema;
pub(crate) mod screen;
mod stress;
mod temperatures;
mod terms;
mod tolerance;
mod trim;
mod verify;
mod watch;
mod watching;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{Parser, Subcommand, ValueEnum};
use thiserror::Error;

use crate::io::write::compensation_file::StreamError;
use crate::reproduce::thesis2021::ThesisError;
use crate::task::TaskError;
use crate::text::sink::{Block, Line};
use progress::ProgressMode;
use screen::Screen;

/// Designs winding patterns of fibre-optic-gyroscope coils.
#[derive(Debug, Parser)]
#[command(name = "coilwright", version, max_term_width = 110, after_help = EXAMPLES)]
pub(crate) struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    output: OutputOptions,
}

const EXAMPLES: &str = "\
Examples:
  coilwright new my-coil.toml                    write a commented model file
  coilwright check my-coil.toml                  find all its faults at once
  coilwright evaluate my-coil.toml               the classic windings' worst rate errors
  coilwright optimise my-coil.toml -o results/my-coil

Exit codes: 0 done; 1 the answer is no; 2 the request was wrong; 130 interrupted.
Nothing is coloured but what a terminal shows; NO_COLOR switches colours off.";

#[derive(Debug, Clone, clap::Args)]
pub(crate) struct OutputOptions {
    /// How the answer is written to stdout
    #[arg(long, global = true, value_enum, default_value_t = Format::Text)]
    pub(crate) format: Format,
    /// Nothing on stderr but errors
    #[arg(long, short, global = true)]
    pub(crate) quiet: bool,
    /// Says on stderr which version ran, with how many threads, and how long it took
    #[arg(long, short, global = true, conflicts_with = "quiet")]
    pub(crate) verbose: bool,
    /// How progress is shown on stderr
    #[arg(long, global = true, value_enum, default_value_t = ProgressMode::Auto)]
    pub(crate) progress: ProgressMode,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// Words and tables
    Text,
    /// One JSON document
    Json,
}

#[derive(Debug, Subcommand)]
enum Command {
    Evaluate(evaluate::Arguments),
    Exact(exact::Arguments),
    Explore(explore::Arguments),
    Effects(effects::Arguments),
    Fibres(fibres::Arguments),
    Materials(materials::Arguments),
    Stress(stress::Arguments),
    Potting(potting::Arguments),
    Temperatures(temperatures::Arguments),
    Tolerance(tolerance::Arguments),
    Patterns(patterns::Arguments),
    Check(check::Arguments),
    New(new::Arguments),
    Reproduce(reproduce::Arguments),
    Optimise(optimise::Arguments),
    Campaign(campaign::Arguments),
    Pareto(pareto::Arguments),
    Schedule(schedule::Arguments),
    Compare(compare::Arguments),
    Compensate(compensate::Arguments),
    Metrics(metrics::Arguments),
    Diagnose(diagnose::Arguments),
    Extend(extend::Arguments),
    Trim(trim::Arguments),
    Improve(improve::Arguments),
    Schema(schema::Arguments),
    Completions(completions::Arguments),
    Man(man::Arguments),
    Verify(verify::Arguments),
    Report(report::Arguments),
}

/// How a command ended; errors aside.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Ending {
    Done,
    /// The answer is no: violations found, model not adequate under `--strict`.
    No,
    Interrupted,
}

/// Why a request cannot be carried out; all of them end with exit code 2.
#[derive(Debug, Error)]
pub(crate) enum CliError {
    #[error("error: --columns: {message}")]
    Columns { message: String },
    #[error("{lead}{0}", lead = if .0.is_drawn() { "" } else { "error: " })]
    Task(TaskError),
    #[error(transparent)]
    Stream(StreamError),
    #[error(
        "error: a model with a bias over temperature or further columns has no physical compensator that can be exported (the other methods have), and the interval must be known: give --interval or --fit"
    )]
    NoExport,
    #[error("error: {0}")]
    Thesis(#[from] ThesisError),
    #[error("error: {path} exists already: choose another name or remove it first")]
    Exists { path: String },
    #[error("error: {option}: {message}")]
    Option { option: &'static str, message: String },
    #[error("error: {path} does not fit the model: begin again with --fresh", path = .path.display())]
    Checkpoint { path: std::path::PathBuf },
    #[error("error: cannot write to stdout: {0}")]
    Stdout(std::io::Error),
}

impl CliError {
    /// As a terminal shows it. Faults of a file come as several lines of their own making; anything else is one line.
    fn shown(&self) -> Block {
        let is_drawn = match self {
            CliError::Task(error) => error.is_drawn(),
            CliError::Stream(StreamError::Header(_)) => true,
            _ => false,
        };
        if is_drawn { Block::of(&self.to_string()) } else { Block::of(Line::of(self).as_str()) }
    }
}

impl<E: Into<TaskError>> From<E> for CliError {
    fn from(error: E) -> Self {
        CliError::Task(error.into())
    }
}

impl From<StreamError> for CliError {
    fn from(error: StreamError) -> Self {
        match error {
            // A reader that has seen enough is told apart from a failure by its kind.
            StreamError::Write(source) => CliError::Stdout(source),
            other => CliError::Stream(other),
        }
    }
}

/// Parses the program's arguments, runs the command, and turns its ending into an exit code.
pub fn run() -> ExitCode {
    ExitCode::from(run_with(std::env::args_os()))
}

/// As [`run`], with the words of a command line, the program's name first; the exit code.
pub fn run_with(words: impl IntoIterator<Item = impl Into<OsString>>) -> u8 {
    let words: Vec<OsString> = words.into_iter().map(Into::into).collect();
    let cli = match parsed(&words) {
        Ok(cli) => cli,
        Err(error) => {
            // Help and the version go to stdout, complaints to stderr; where neither can be written nobody reads them.
            let _ = error.print();
            return error.exit_code() as u8;
        }
    };
    let screen = Screen::new(&cli.output, &words);
    let started = std::time::Instant::now();
    let ending = carry_out(&cli.command, &screen);
    if cli.output.verbose {
        let (version, threads) = (env!("CARGO_PKG_VERSION"), rayon::current_num_threads());
        let seconds = started.elapsed().as_secs_f64();
        screen.note(&format!("coilwright {version}, {threads} threads, {seconds:.2} s"));
    }
    match ending {
        Ok(Ending::Done) => 0,
        Ok(Ending::No) => 1,
        Ok(Ending::Interrupted) => 130,
        // A reader that has seen enough (`| head`) is no failure.
        Err(CliError::Stdout(error)) if error.kind() == std::io::ErrorKind::BrokenPipe => 0,
        Err(error) => {
            screen::complain(&error.shown());
            2
        }
    }
}

fn carry_out(command: &Command, screen: &Screen) -> Result<Ending, CliError> {
    match command {
        Command::Evaluate(arguments) => evaluate::run(arguments, screen),
        Command::Exact(arguments) => exact::run(arguments, screen),
        Command::Explore(arguments) => explore::run(arguments, screen),
        Command::Effects(arguments) => effects::run(arguments, screen),
        Command::Fibres(arguments) => fibres::run(arguments, screen),
        Command::Materials(arguments) => materials::run(arguments, screen),
        Command::Stress(arguments) => stress::run(arguments, screen),
        Command::Potting(arguments) => potting::run(arguments, screen),
        Command::Temperatures(arguments) => temperatures::run(arguments, screen),
        Command::Tolerance(arguments) => tolerance::run(arguments, screen),
        Command::Patterns(arguments) => patterns::run(arguments, screen),
        Command::Check(arguments) => check::run(arguments, screen),
        Command::New(arguments) => new::run(arguments, screen),
        Command::Reproduce(arguments) => reproduce::run(arguments, screen),
        Command::Optimise(arguments) => optimise::run(arguments, screen),
        Command::Campaign(arguments) => campaign::run(arguments, screen),
        Command::Pareto(arguments) => pareto::run(arguments, screen),
        Command::Schedule(arguments) => schedule::run(arguments, screen),
        Command::Compare(arguments) => compare::run(arguments, screen),
        Command::Compensate(arguments) => compensate::run(arguments, screen),
        Command::Metrics(arguments) => metrics::run(arguments, screen),
        Command::Diagnose(arguments) => diagnose::run(arguments, screen),
        Command::Extend(arguments) => extend::run(arguments, screen),
        Command::Trim(arguments) => trim::run(arguments, screen),
        Command::Improve(arguments) => improve::run(arguments, screen),
        Command::Schema(arguments) => schema::run(arguments, screen),
        Command::Completions(arguments) => completions::run(arguments, screen),
        Command::Man(arguments) => man::run(arguments, screen),
        Command::Verify(arguments) => verify::run(arguments, screen),
        Command::Report(arguments) => report::run(arguments, screen),
    }
}

/// What was asked for. A complaint about the arguments quotes them, so it is made of their visible form.
fn parsed(words: &[OsString]) -> Result<Cli, clap::Error> {
    Cli::try_parse_from(words).map_err(|error| {
        let shown = words.iter().map(|word| Line::of(word.display()).into_string());
        Cli::try_parse_from(shown).err().unwrap_or(error)
    })
}
