//! `pareto`: how much error each step of winding effort buys.

use std::path::PathBuf;

use super::progress::StopFlag;
use super::screen::{Screen, held, table};
use super::watching::Watching;
use super::{CliError, Ending};
use crate::io::json::pareto::{ParetoJson, PointJson};
use crate::io::read::model_file::read_design;
use crate::io::write::pareto_parts::check_kept;
use crate::task::pareto::{DEFAULT_MOST_CAPTIVE, DEFAULT_ROUNDS, Request, run as weigh};

/// The front of worst-case error against windability and robustness
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Weighed are the worst rate, captive reels, largest climb, crossovers over other layers and, where the model has a\n\
    [tolerance] table, the 95 % quantile over built coils. Searched are all classes and, within each, climbs of up to 2, 3, 4,\n\
    5, 6, 8 and any number of layers, for the worst rate and for the quantile. Every point is a pattern file that schedule\n\
    takes. With -o what is done is kept in parts/, so the same command goes on after an interruption.\n\n\
    Example:\n  coilwright pareto examples/paper-200m.toml -o results/paper-200m-front"
)]
pub(crate) struct Arguments {
    /// The model file
    model: PathBuf,
    /// Writes pareto.csv, pareto.svg (with tolerances also pareto-p95.svg) and one pattern file a point into this folder
    #[arg(long, short, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Seed of the searches; without it, the model's own
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// The most captive reels that are tried one by one; any number is tried besides
    #[arg(long, value_name = "K", default_value_t = DEFAULT_MOST_CAPTIVE, value_parser = clap::value_parser!(u8).range(0..=16))]
    most_captive: u8,
    /// Rounds of restarts a class
    #[arg(long, value_name = "N", default_value_t = DEFAULT_ROUNDS, value_parser = clap::value_parser!(u64).range(1..))]
    rounds: u64,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let stop = StopFlag::listen();
    let file = read_design(&arguments.model)?;
    let folder = arguments.output.as_deref();
    folder.map_or(Ok(()), |folder| check_kept(folder, screen.named().chain(file.files())))?;
    let _held = folder.map(|folder| held(folder, "pareto")).transpose()?;
    let request = Request {
        model: &file,
        seed: arguments.seed.unwrap_or(file.search.seed),
        most_captive: arguments.most_captive,
        rounds: arguments.rounds,
        kept_in: folder,
    };
    let watching = Watching::new(screen, "pareto").stopped_by(&stop);
    let Some(answer) = weigh(&request, &watching)? else { return Ok(interrupted(&arguments.output, screen)) };
    watching.finish();
    let document = match folder {
        None => answer.document(None),
        Some(folder) => {
            let document = answer.write(folder, &file)?;
            screen.note(&format!("wrote {}", folder.display()));
            document
        }
    };
    screen.answer(document, text)?;
    Ok(Ending::Done)
}

/// Points shown besides the knees.
const MOST_OTHERS: usize = 8;

fn interrupted(output: &Option<PathBuf>, screen: &Screen) -> Ending {
    screen.note(match output {
        Some(_) => "interrupted: the same command goes on from the parts that are done",
        None => "interrupted: with -o DIR the parts that are done would have been kept",
    });
    Ending::Interrupted
}

fn text(answer: &ParetoJson) -> String {
    let (knees, others): (Vec<&PointJson>, Vec<&PointJson>) = answer.points.iter().partition(|point| point.knee);
    let mut shown: Vec<Vec<String>> = Vec::new();
    let row = |p: &PointJson| {
        vec![
            p.pattern.name.clone(),
            format!("{:.4}", p.pattern.worst_rate_deg_per_h),
            p.pattern.p95_rate_deg_per_h.map_or_else(|| "–".to_owned(), |q| format!("{q:.4}")),
            p.pattern.windability.captive.to_string(),
            p.pattern.windability.max_climb.to_string(),
            p.long_crossovers.to_string(),
        ]
    };
    let mut merged = 0;
    for row in knees.iter().map(|p| row(p)).chain(others.iter().take(MOST_OTHERS).map(|p| row(p))) {
        // The same but for the name.
        if shown.iter().any(|known| known[1..] == row[1..]) {
            merged += 1;
        } else {
            shown.push(row);
        }
    }
    let left_out = merged + others.len().saturating_sub(MOST_OTHERS);
    let more = if left_out > 0 {
        format!("\n{left_out} further points are in --format json and, with -o, in pareto.csv\n")
    } else {
        String::new()
    };
    format!(
        "{}: the best found; none of these is beaten in every respect by another known one\n\n{}{more}",
        answer.model,
        table(&["pattern", "worst °/h", "P95 °/h", "captive", "climb", "crossovers > 1"], shown)
    )
}
