//! `evaluate`: what the rate error of given windings is at worst.

use std::path::{Path, PathBuf};

use super::pattern_asked::patterns_asked;
use super::screen::{Screen, table};
use super::watching::Watching;
use super::{CliError, Ending, offered};
use crate::io::files::write_atomically;
use crate::io::folder::check_file;
use crate::io::json::EvaluateJson;
use crate::io::read::model_file::read_design;
use crate::io::read::profile_file::read_profile_file;
use crate::io::write::model_edit::with_ramps;
use crate::task::evaluate::{Answer, COLUMNS, Request, cells, run as evaluate};
use crate::task::under_fields::{self, FieldFile};

/// Worst rate error of windings over a model's profiles
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  coilwright evaluate examples/paper-200m.toml --pattern qua --pattern patterns/qua-12.toml\n  \
    coilwright evaluate my-coil.toml --field warm-up.csv --field sun-side.csv     temperatures from a finite-element program"
)]
pub(crate) struct Arguments {
    /// The model file
    model: PathBuf,
    /// A winding's name (zyl, sym, sym-text, dip, qua, oct, hex) or a pattern file; may be repeated. Without it: the
    /// model's own and all classics that fit
    #[arg(long, short, value_name = "PATTERN", value_parser = offered::patterns(), hide_possible_values = true)]
    pattern: Vec<String>,
    /// A file with a [profiles] table, used instead of the model's
    #[arg(long, value_name = "FILE")]
    profiles: Option<PathBuf>,
    /// Temperatures of the layers that were computed elsewhere (CSV: time_s, layer_1_c, …, or time_s, layer, temperature_c), used
    /// instead of the profiles; may be repeated, each file is a case
    #[arg(long, value_name = "FILE", conflicts_with_all = ["profiles", "bang_bang"])]
    field: Vec<PathBuf>,
    /// Write a copy of the model file in which the profiles that attain the guaranteed worst cases are listed
    #[arg(long, value_name = "FILE")]
    bang_bang: Option<PathBuf>,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let mut file = read_design(&arguments.model)?;
    if let Some(written) = &arguments.bang_bang {
        let further = arguments.profiles.iter().map(PathBuf::as_path);
        check_file(written, file.files().chain(further).chain(arguments.pattern.iter().map(Path::new)))?;
    }
    if let Some(path) = &arguments.profiles {
        file.profiles = read_profile_file(path)?;
    }
    let patterns = patterns_asked(&file, &arguments.pattern)?;
    if !arguments.field.is_empty() {
        let fields = arguments.field.iter().map(|path| FieldFile::read(path)).collect::<Result<Vec<_>, _>>()?;
        let body = under_fields::evaluate(&file, &fields, &patterns, &Watching::quiet(screen))?;
        screen.answer(body, text)?;
        return Ok(Ending::Done);
    }
    let request = Request { model: &file, patterns: &patterns };
    let Answer { document: body, extremes } = evaluate(&request, &Watching::quiet(screen))?;
    if let Some(path) = &arguments.bang_bang {
        let extremes = extremes?;
        let listed = with_ramps(&arguments.model.display().to_string(), &file.source, &extremes)?;
        write_atomically(path, listed.as_bytes())?;
        screen.note(&format!("{} profiles listed in {}", extremes.len(), path.display()));
    }
    screen.answer(body, text)?;
    Ok(Ending::Done)
}

fn text(body: &EvaluateJson) -> String {
    table(&COLUMNS, body.patterns.iter().map(|p| cells(p).to_vec()))
}
