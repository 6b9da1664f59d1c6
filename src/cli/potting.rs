//! `potting`: which adhesive and spool suit a coil's winding.

use std::path::PathBuf;

use super::pattern_asked::patterns_asked;
use super::screen::{Screen, table};
use super::watching::Watching;
use super::{CliError, Ending, offered};
use crate::io::json::stress::PottingJson;
use crate::io::read::model_file::read_model;
use crate::task::stress::{PottingRequest, potting};

/// Adhesives and spools in the order of the worst rate error that the best winding has with them
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  coilwright potting potted.toml\n  coilwright potting potted.toml --spools --pattern qua"
)]
pub(crate) struct Arguments {
    /// The model file, with [materials]
    model: PathBuf,
    /// A winding's name or a pattern file; may be repeated. Without it: the model's own and all classics that fit
    #[arg(long, short, value_name = "PATTERN", value_parser = offered::patterns(), hide_possible_values = true)]
    pattern: Vec<String>,
    /// Every spool of the library too, as thick as the declared one
    #[arg(long)]
    spools: bool,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let file = read_model(&arguments.model)?;
    let patterns = patterns_asked(&file, &arguments.pattern)?;
    let request = PottingRequest { model: &file, patterns: &patterns, with_spools: arguments.spools };
    let watching = Watching::quiet(screen);
    let body = potting(&request, &watching)?;
    screen.answer(body, text)?;
    Ok(Ending::Done)
}

fn text(body: &PottingJson) -> String {
    let rows = body.choices.iter().map(|choice| {
        vec![
            if choice.is_declared { format!("{} (declared)", choice.adhesive) } else { choice.adhesive.clone() },
            choice.spool.clone().unwrap_or_else(|| "-".to_owned()),
            choice.best_pattern.clone(),
            format!("{:.4}", choice.worst_rate_deg_per_h),
            choice.guaranteed_worst_rate_deg_per_h.map_or("-".to_owned(), |g| format!("{g:.4}")),
            format!("{:.4e}", choice.path_per_k),
            format!("{:.6}", choice.equivalent_mismatch),
        ]
    });
    let heads = ["adhesive", "spool", "pattern", "worst °/h", "guaranteed °/h", "κ 1/K", "mismatch"];
    table(&heads, rows)
}
