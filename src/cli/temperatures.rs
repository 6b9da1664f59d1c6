//! `temperatures`: what the layers do under a profile or a record.

use std::path::PathBuf;

use super::records::RecordArguments;
use super::screen::{Screen, held};
use super::watching::Watching;
use super::{CliError, Ending};
use crate::io::folder::{Replacement, check_read};
use crate::io::read::model_file::read_model;
use crate::io::read::profile_file::read_profile_file;
use crate::io::write::field_table::field_table;
use crate::report::temperatures::{rate_chart, temperature_chart};
use crate::task::measurement::Measurement;
use crate::task::temperatures::{Driver, Request, run as solve};

/// Temperature and rate of every layer, as CSV and pictures
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  coilwright temperatures my-coil.toml --profile warm-up > layers.csv\n  \
    coilwright temperatures my-coil.toml record.csv -o results/layers\n  \
    coilwright temperatures my-coil.toml --as-judged > field.csv\n  \
    coilwright evaluate my-coil.toml --field field.csv     the same worst case")]
pub(crate) struct Arguments {
    /// The model file
    model: PathBuf,
    /// A record whose temperature drives the pack; without it, a profile of the model
    record: Option<PathBuf>,
    /// The profile's name; without it, the model's first
    #[arg(long, value_name = "NAME", conflicts_with = "record")]
    profile: Option<String>,
    /// A file with a [profiles] table, used instead of the model's
    #[arg(long, value_name = "FILE", conflicts_with = "record")]
    profiles: Option<PathBuf>,
    /// Rows of the table for a profile, evenly spaced; a record's rows are its own
    #[arg(long, value_name = "N", default_value_t = 601, value_parser = clap::value_parser!(u32).range(2..=1_000_000), conflicts_with = "record")]
    rows: u32,
    /// At the instants at which windings are judged instead, both sides of every kink among them, in K and K/s with every digit:
    /// `evaluate --field` finds the same worst case in it
    #[arg(long, conflicts_with_all = ["record", "rows"])]
    as_judged: bool,
    /// Writes temperatures.csv, temperatures.svg and rates.svg into this folder, instead of CSV to stdout
    #[arg(long, short, value_name = "DIR")]
    output: Option<PathBuf>,
    #[command(flatten)]
    reading: RecordArguments,
}

const FILES: [&str; 3] = ["temperatures.csv", "temperatures.svg", "rates.svg"];

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let mut file = read_model(&arguments.model)?;
    if let Some(folder) = &arguments.output {
        check_read(folder, &FILES, screen.named().chain(file.files()))?;
    }
    if let Some(path) = &arguments.profiles {
        file.profiles = read_profile_file(path)?;
    }
    let format = arguments.reading.format(Some(&file))?;
    let measurement = arguments.record.as_ref().map(|path| Measurement::read(path, &format)).transpose()?;
    let driver = match &measurement {
        Some(measurement) => Driver::Measurement(measurement),
        None if arguments.as_judged => Driver::Judged { name: arguments.profile.as_deref() },
        None => Driver::Profile { name: arguments.profile.as_deref(), rows: arguments.rows },
    };
    let answer = solve(&Request { model: &file, driver }, &Watching::quiet(screen))?;
    let body = answer.document();
    let csv = if arguments.as_judged { field_table(&answer.history) } else { body.csv() };
    if let Some(folder) = &arguments.output {
        let _held = held(folder, "temperatures")?;
        let mut files = Replacement::of(folder);
        let contents = [csv.clone(), temperature_chart(&body).svg(), rate_chart(&body).svg()];
        FILES.iter().zip(&contents).try_for_each(|(name, content)| files.add(name, content.as_bytes()))?;
        files.commit(&FILES)?;
        screen.note(&format!("wrote temperatures.csv, temperatures.svg and rates.svg into {}", folder.display()));
        if !screen.is_json() {
            return Ok(Ending::Done);
        }
    }
    screen.answer(body, |_| csv)?;
    Ok(Ending::Done)
}
