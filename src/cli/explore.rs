//! `explore`: a page in which windings of a model can be tried by hand.

use std::path::{Path, PathBuf};

use super::pattern_asked::patterns_asked;
use super::screen::Screen;
use super::{CliError, Ending, offered};
use crate::io::folder::check_file;
use crate::io::read::model_file::read_model;
use crate::task::explore_page::{EXPLORER_FILE, write};
use crate::text::sink::Line;

/// One self-contained page that holds the model: move layers and see at once what evaluate says of them
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  coilwright explore examples/paper-200m.toml\n  coilwright explore my-coil.toml results/my-coil/best.toml qua -o my-coil.html\n\nThe page opens in a browser without network; it can be sent to others, who need nothing else."
)]
pub(crate) struct Arguments {
    /// The model file
    model: PathBuf,
    /// Windings to begin with, the first of them shown: names such as qua, or pattern files; the model's own comes after them
    #[arg(value_name = "PATTERN", value_parser = offered::patterns(), hide_possible_values = true)]
    patterns: Vec<String>,
    /// Where the page goes
    #[arg(long, short, value_name = "FILE", default_value = EXPLORER_FILE)]
    output: PathBuf,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let file = read_model(&arguments.model)?;
    check_file(&arguments.output, file.files().chain(arguments.patterns.iter().map(Path::new)))?;
    for advice in &file.advice {
        screen.note(&format!("note: {advice}"));
    }
    let patterns = patterns_asked(&file, &arguments.patterns)?;
    let answer = write(&file, &patterns, &arguments.output)?;
    screen.answer(answer, |body| format!("{}\n", Line::of(&body.page)))?;
    Ok(Ending::Done)
}
