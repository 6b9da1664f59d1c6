//! `schedule`: the order of work at the winding machine.

use std::path::PathBuf;

use super::pattern_asked::pattern_asked;
use super::screen::{Screen, held, table};
use super::{CliError, Ending, offered};
use crate::io::folder::{Replacement, check_read};
use crate::io::json::schedule::{ScheduleJson, crossover_words};
use crate::io::read::model_file::read_design;
use crate::schedule::Schedule;
use crate::task::schedule::{FILES, Request, run as plan};

/// The winding of a coil step by step, from the inside out
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  coilwright schedule examples/paper-200m.toml --pattern qua\n  coilwright schedule examples/paper-200m.toml --pattern patterns/qua-12.toml -o results/paper-200m"
)]
pub(crate) struct Arguments {
    /// The model file
    model: PathBuf,
    /// A winding's name or a pattern file; without it, the model's own
    #[arg(long, short, value_name = "PATTERN", value_parser = offered::patterns(), hide_possible_values = true)]
    pattern: Option<String>,
    /// Writes the schedule (CSV, JSON), the traveller (HTML, CSV, JSON), the winder's program (G-code, CSV) and the
    /// cross-section (SVG) into this folder
    #[arg(long, short, value_name = "DIR")]
    output: Option<PathBuf>,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let file = read_design(&arguments.model)?;
    let pattern = pattern_asked(&file, arguments.pattern.as_deref())?;
    let answer = plan(&Request { model: &file, pattern: pattern.as_ref() })?;
    if let Some(folder) = &arguments.output {
        check_read(folder, &FILES, screen.named().chain(file.files()))?;
        let _held = held(folder, "schedule")?;
        let files = answer.files(&file)?;
        Replacement::all(folder, &files)?;
        files.iter().for_each(|(name, _)| screen.note(&format!("wrote {}", folder.join(name).display())));
    }
    screen.document(&answer.document, |document| text(&answer.schedule, document))?;
    Ok(Ending::Done)
}

fn text(schedule: &Schedule, document: &ScheduleJson) -> String {
    let reels = document.reels.iter().map(|reel| {
        let source = match &reel.taken_from {
            Some(name) => format!(", spooled over from reel {name} before step {}", reel.prepared_before_step),
            None => String::new(),
        };
        format!(
            "reel {}: {:.3} m ({:.3} m to {:.3} m){source}\n",
            reel.name,
            reel.to_m - reel.from_m,
            reel.from_m,
            reel.to_m
        )
    });
    let head = format!(
        "{}, {}: {} layers, {:.3} m, class {}, worst rate error {:.4} °/h\nstart: fix {:.3} m from end A at the first flange\n",
        document.model,
        document.pattern,
        document.steps.len(),
        document.length_m,
        document.windability.class,
        document.worst_rate_deg_per_h,
        document.start_mark_m,
    );
    let rows = document.steps.iter().zip(schedule.steps()).map(|(row, step)| {
        vec![
            row.step.to_string(),
            row.half.clone(),
            row.segment.to_string(),
            row.supply_reel.clone(),
            row.direction.clone(),
            format!("{:.2}", row.turns),
            format!("{:.3}", row.fibre_from_m),
            format!("{:.3}", row.fibre_to_m),
            format!("{:.3}", row.length_m),
            format!("{:.4}", row.radius_mm),
            row.climb.to_string(),
            format!("{:.3}", row.cumulative_m),
            crossover_words(step),
        ]
    });
    let header = [
        "layer",
        "half",
        "segment",
        "reel",
        "direction",
        "turns",
        "from m",
        "to m",
        "length m",
        "radius mm",
        "climb",
        "cumulative m",
        "crossover",
    ];
    head + &reels.collect::<String>() + "\n" + &table(&header, rows)
}
