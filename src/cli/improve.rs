//! `improve`: from measurements to the next coil, in one command.

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::pattern_asked::pattern_asked;
use super::progress::StopFlag;
use super::screen::{Screen, held};
use super::terms::TermArguments;
use super::watching::Watching;
use super::{CliError, Ending, offered};
use crate::io::folder::check_read;
use crate::io::json::improve::ImproveJson;
use crate::io::read::model_file::read_model;
use crate::report::proposal::proposal_in_words;
use crate::task::improve::{FILES, Request, run as improve};
use crate::task::measurement::Measurement;

/// The whole loop: compares and diagnoses records, extends the model, searches the next winding and writes its schedule
#[derive(Debug, clap::Args)]
#[command(
    after_help = "The folder then holds before/ and after/ (comparisons), diagnosis/, design.toml (the model that was searched), search/,\n\
    recommended.toml, schedule/, predicted-record.csv (what the first record should look like with the new coil),\n\
    next-experiment.toml and index.html. The same command goes on where it was interrupted: a step is\n\
    taken again only where something that it is made of has changed.\n\n\
    Example:\n  coilwright improve coil.toml monday.csv tuesday.csv --holdout friday.csv -o results/next-coil"
)]
pub(crate) struct Arguments {
    /// The model file
    model: PathBuf,
    /// Records of the coil as it is (CSV)
    #[arg(required = true, value_name = "RECORD")]
    records: Vec<PathBuf>,
    /// A record that is only judged by; may be repeated
    #[arg(long, value_name = "RECORD")]
    holdout: Vec<PathBuf>,
    /// The winding that was measured: a winding's name or a pattern file; without it, the model's own
    #[arg(long, short, value_name = "PATTERN", value_parser = offered::patterns(), hide_possible_values = true)]
    pattern: Option<String>,
    /// Everything goes into this folder
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,
    /// Seed of the search; without it, the model's own
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    #[command(flatten)]
    terms: TermArguments,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let stop = StopFlag::listen();
    let file = read_model(&arguments.model)?;
    let pattern = pattern_asked(&file, arguments.pattern.as_deref())?;
    check_read(&arguments.output, &FILES, screen.named().chain(file.files()))?;
    let _held = held(&arguments.output, "improve")?;
    let read = |paths: &[PathBuf]| -> Result<Vec<Measurement>, CliError> {
        paths.iter().map(|path: &PathBuf| Ok(Measurement::read(Path::new(path), &file.record)?)).collect()
    };
    let (measurements, holdout) = (read(&arguments.records)?, read(&arguments.holdout)?);
    let request = Request {
        model: &file,
        pattern: pattern.as_ref(),
        measurements: &measurements,
        holdout: &holdout,
        folder: &arguments.output,
        seed: arguments.seed,
        terms: arguments.terms.asked(),
    };
    let watching = Watching::quiet(screen).stopped_by(&stop);
    match improve(&request, &watching)? {
        Some(body) => {
            screen.answer(body, text)?;
            Ok(Ending::Done)
        }
        None => {
            screen.note("interrupted: the same command goes on from the steps that are done");
            Ok(Ending::Interrupted)
        }
    }
}

fn text(body: &ImproveJson) -> String {
    let words = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let mut text = format!("{}\n", words(&body.recommendation["sentence"]));
    for reason in body.recommendation["reasons"].as_array().into_iter().flatten() {
        text += &format!("  {}\n", words(reason));
    }
    text += &format!("\n{}: {}\n", body.model, words(&body.verdict));
    for effect in body.effects.as_array().into_iter().flatten() {
        text += &format!("  {}\n", words(&effect["kind"]));
    }
    for line in body.proposals.iter().flat_map(proposal_in_words) {
        text += &format!("{line}\n");
    }
    if let Some(film) = body.film_w_per_m2_k {
        text += &format!("film learned from the records: {film:.2} W/(m²K)\n");
    }
    text += &format!("{}\n", words(&body.measured_pattern_under_new_model["statement"]));
    text += &format!("{}\n", body.predicted_gain.words());
    text += &format!("what the first record should show with the new coil: {}\n", body.predicted_record);
    text += &format!("next experiment: {}\n", words(&body.suggested_experiment));
    text + &format!("wrote {}\n", body.page)
}
