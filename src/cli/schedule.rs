//! `schedule`: the order of work at the winding machine.

use std::path::PathBuf;

use super::screen::{Screen, held, table};
use super::{CliError, Ending};
use crate::io::files::write_atomically;
use crate::io::json::schedule::{ScheduleJson, crossover_words};
use crate::io::model::{ModelFile, NamedPattern};
use crate::io::read::model_file::read_model;
use crate::io::read::pattern_file::resolve_pattern;
use crate::io::write::machine_program::{gcode, machine_program};
use crate::io::write::traveller::traveller;
use crate::report::cross_section::cross_section;
use crate::report::traveller::traveller_page;
use crate::schedule::Schedule;
use crate::search::cost::worst_case::SolvedProfiles;

/// The winding of a coil step by step, from the inside out
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  coilwright schedule examples/paper-200m.toml --pattern qua\n  coilwright schedule examples/paper-200m.toml --pattern patterns/qua-12.toml -o results/paper-200m"
)]
pub struct Arguments {
    /// The model file
    model: PathBuf,
    /// A winding's name or a pattern file; without it, the model's own
    #[arg(long, short, value_name = "PATTERN")]
    pattern: Option<String>,
    /// Writes the schedule (CSV, JSON), the traveller (HTML, CSV, JSON), the winder's program (G-code, CSV) and the
    /// cross-section (SVG) into this folder
    #[arg(long, short, value_name = "DIR")]
    output: Option<PathBuf>,
}

pub fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let file = read_model(&arguments.model)?;
    let named = pattern_of(&file, arguments.pattern.as_deref())?;
    let (schedule, document) = plan(&file, &named)?;
    if let Some(folder) = &arguments.output {
        let _held = held(folder, "schedule")?;
        for (name, text) in files(&file, &named, &schedule, &document)? {
            let path = folder.join(name);
            write_atomically(&path, text.as_bytes())?;
            screen.note(&format!("wrote {}", path.display()));
        }
    }
    screen.document(&document, |document| text(&schedule, document))?;
    Ok(Ending::Done)
}

/// Everything that leaves for the shop floor, by file name.
fn files(
    file: &ModelFile,
    named: &NamedPattern,
    schedule: &Schedule,
    document: &ScheduleJson,
) -> Result<Vec<(&'static str, String)>, CliError> {
    let axial_pitch_m = file.model.coil.axial_pitch_m();
    let traveller = traveller(document, schedule, &file.production, axial_pitch_m);
    let program = machine_program(document, schedule, &file.production, axial_pitch_m);
    let title = format!("{}, {}", file.model.name, named.name);
    Ok(vec![
        ("schedule.csv", csv(document)?),
        ("schedule.json", json(document)?),
        ("traveller.html", traveller_page(&traveller, &named.pattern)),
        ("traveller.csv", csv(&traveller)?),
        ("traveller.json", json(&traveller)?),
        ("program.gcode", gcode(&program)),
        ("program.csv", csv(&program)?),
        ("cross-section.svg", cross_section(&title, &named.pattern)),
    ])
}

fn csv(document: &ScheduleJson) -> Result<String, CliError> {
    document.csv().map_err(|e| CliError::Stdout(e.into()))
}

fn json(document: &ScheduleJson) -> Result<String, CliError> {
    Ok(serde_json::to_string_pretty(document).map_err(|e| CliError::Stdout(e.into()))? + "\n")
}

/// The pattern that was asked for, else the model's own.
pub(super) fn pattern_of(file: &ModelFile, stated: Option<&str>) -> Result<NamedPattern, CliError> {
    match stated {
        Some(stated) => Ok(resolve_pattern(stated, file.model.coil.layers(), None)?),
        None => file.pattern.clone().ok_or(CliError::PatternMissing),
    }
}

/// The schedule and the document that claims it.
pub(super) fn plan(file: &ModelFile, named: &NamedPattern) -> Result<(Schedule, ScheduleJson), CliError> {
    let coil = file.model.wound_coil().map_err(crate::rate::RateError::from)?;
    let schedule = Schedule::new(&coil, &named.pattern)?;
    let solved = SolvedProfiles::new(&file.model, &file.profiles.profiles())?;
    let worst = solved.worst_case(&file.model, &named.pattern)?;
    let document = ScheduleJson::new(file, named, &schedule, &worst);
    Ok((schedule, document))
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
