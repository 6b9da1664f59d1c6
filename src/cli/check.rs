//! `check`: all faults of a model file at once.

use std::path::PathBuf;

use super::screen::Screen;
use super::{CliError, Ending};
use crate::io::json::{CheckJson, FaultJson};
use crate::io::read::model_file::read_model;
use crate::io::read::plausibility::advice;
use crate::text::sink::Line;

/// All faults of a model file at once
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  coilwright check examples/paper-200m.toml")]
pub(crate) struct Arguments {
    /// The model file
    model: PathBuf,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let file = arguments.model.display().to_string();
    match read_model(&arguments.model) {
        Ok(found) => {
            let advice = advice(&found).iter().map(ToString::to_string).collect();
            screen.answer(CheckJson { file, faults: Vec::new(), advice }, |body| {
                let notes: String = body.advice.iter().map(|a| format!("note: {a}\n")).collect();
                format!("{}: no faults\n{notes}", Line::of(&body.file))
            })?;
            Ok(Ending::Done)
        }
        Err(faults) if screen.is_json() => {
            screen
                .answer(CheckJson { file, faults: FaultJson::all(&faults), advice: Vec::new() }, |_| String::new())?;
            Err(faults.into())
        }
        Err(faults) => Err(faults.into()),
    }
}
