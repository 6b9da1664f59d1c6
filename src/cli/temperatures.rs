//! `temperatures`: what the layers do under a profile or a record.

use std::path::PathBuf;

use super::records::{GrossErrors, RecordArguments, read_noticed};
use super::screen::{Screen, held};
use super::{CliError, Ending};
use crate::io::files::write_atomically;
use crate::io::json::temperatures::TemperaturesJson;
use crate::io::model::ModelFile;
use crate::io::read::model_file::read_model;
use crate::io::read::profile_file::read_profile_file;
use crate::pattern::classic::Classic;
use crate::predict::predict;
use crate::report::temperatures::{rate_chart, temperature_chart};
use crate::search::cost::worst_case::SearchError;
use crate::thermal::{Drive, Instant, ThermalHistory, solve};
use crate::units::REFERENCE_TEMPERATURE_K;

/// Temperature and rate of every layer, as CSV and pictures
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  coilwright temperatures my-coil.toml --profile warm-up > layers.csv\n  \
    coilwright temperatures my-coil.toml record.csv -o results/layers")]
pub struct Arguments {
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
    /// Writes temperatures.csv, temperatures.svg and rates.svg into this folder, instead of CSV to stdout
    #[arg(long, short, value_name = "DIR")]
    output: Option<PathBuf>,
    #[command(flatten)]
    reading: RecordArguments,
}

pub fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let mut file = read_model(&arguments.model)?;
    if let Some(path) = &arguments.profiles {
        file.profiles = read_profile_file(path)?;
    }
    for advice in &file.advice {
        screen.note(&format!("note: {advice}"));
    }
    let (name, history) = match &arguments.record {
        Some(path) => {
            let noticed =
                read_noticed(path, GrossErrors::Keep, &arguments.reading.format(Some(&file))?, Some(&file), screen)?;
            let layers = file.model.coil.layers();
            let own = file.pattern.as_ref().map(|named| named.pattern.clone());
            // Temperatures don't depend on the pattern; the boundary's estimate weighs the layers by it.
            let pattern = own.or_else(|| Classic::Zyl.pattern(layers).ok());
            let pattern = pattern.expect("every even layer count has a cylindrical winding");
            (noticed.record.name().to_owned(), predict(&file.model, &pattern, &noticed.record)?.history)
        }
        None => of_profile(arguments, &file)?,
    };
    let body = TemperaturesJson::new(&file.model.name, &name, &history);
    if let Some(folder) = &arguments.output {
        let _held = held(folder, "temperatures")?;
        for (file, content) in [
            ("temperatures.csv", body.csv()),
            ("temperatures.svg", temperature_chart(&body).svg()),
            ("rates.svg", rate_chart(&body).svg()),
        ] {
            write_atomically(&folder.join(file), content.as_bytes())?;
        }
        screen.note(&format!("wrote temperatures.csv, temperatures.svg and rates.svg into {}", folder.display()));
        if !screen.is_json() {
            return Ok(Ending::Done);
        }
    }
    screen.answer(body, TemperaturesJson::csv)?;
    Ok(Ending::Done)
}

fn of_profile(arguments: &Arguments, file: &ModelFile) -> Result<(String, ThermalHistory), CliError> {
    let profiles = file.profiles.profiles();
    let chosen = match &arguments.profile {
        None => profiles.first(),
        Some(name) => profiles.iter().find(|p| p.name() == name),
    };
    let Some(profile) = chosen else {
        let stated = arguments.profile.clone().unwrap_or_default();
        let known = profiles.iter().take(8).map(|p| p.name().to_owned()).collect::<Vec<_>>().join(", ");
        return Err(CliError::UnknownProfile { stated, known });
    };
    let path = file.model.heat_path().map_err(SearchError::from)?;
    let drive = Drive::boundary(profile.temperature(REFERENCE_TEMPERATURE_K));
    let field = solve(&path, &drive).map_err(SearchError::from)?;
    let last = f64::from(arguments.rows - 1);
    let instants: Vec<Instant> =
        (0..arguments.rows).map(|i| Instant::after(profile.duration_s() * f64::from(i) / last)).collect();
    Ok((profile.name().to_owned(), field.at(&instants)))
}
