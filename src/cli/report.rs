//! `report`: the page of a search or of a comparison with records.

use std::path::PathBuf;

use super::screen::{Screen, held};
use super::{CliError, Ending};
use crate::io::json::ReportJson;
use crate::task::page::{REPORT_FILE, is_in, write_report};
use crate::text::sink::Line;

/// One self-contained page about a search, a comparison, a diagnosis or measures, written to report.html in their folder
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  coilwright report results/paper-200m\n  coilwright report results/day-1")]
pub(crate) struct Arguments {
    /// The folder that `optimise -o`, `compare -o`, `diagnose -o` or `metrics -o` wrote
    folder: PathBuf,
    /// Where the page goes; without it, report.html in the folder
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let path = arguments.output.clone().unwrap_or_else(|| arguments.folder.join(REPORT_FILE));
    // Read and written as a whole: no other run may change what the page is about.
    let _held = is_in(&arguments.folder, &path).then(|| held(&arguments.folder, "report")).transpose()?;
    let bytes = write_report(&arguments.folder, &path)?;
    let report = path.display().to_string();
    screen.answer(ReportJson { report, bytes }, |body| format!("{}\n", Line::of(&body.report)))?;
    Ok(Ending::Done)
}
