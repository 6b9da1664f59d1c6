//! `report`: the page of a search or of a comparison with records.

use std::path::{Path, PathBuf};

use super::screen::Screen;
use super::{CliError, Ending};
use crate::io::files::write_atomically;
use crate::io::json::ReportJson;
use crate::io::read::run_reader::read_run;
use crate::io::write::measurement_folder::{holds_measurements, read_measurements};
use crate::report::measurement::measurement_page;
use crate::report::search_run::search_page;
use crate::text::sink::Line;

/// One self-contained page about a search, a comparison, a diagnosis or measures, written to report.html in their folder
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  coilwright report results/paper-200m\n  coilwright report results/day-1")]
pub struct Arguments {
    /// The folder that `optimise -o`, `compare -o`, `diagnose -o` or `metrics -o` wrote
    folder: PathBuf,
    /// Where the page goes; without it, report.html in the folder
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
}

pub fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let path = arguments.output.clone().unwrap_or_else(|| arguments.folder.join(REPORT_FILE));
    let bytes = write_report(&arguments.folder, &path)?;
    let report = path.display().to_string();
    screen.answer(ReportJson { report, bytes }, |body| format!("{}\n", Line::of(&body.report)))?;
    Ok(Ending::Done)
}

/// The page's name in its folder.
pub(super) const REPORT_FILE: &str = "report.html";

/// Makes the page of a folder; its size in bytes.
pub(super) fn write_report(folder: &Path, path: &Path) -> Result<usize, CliError> {
    let page = if holds_measurements(folder) {
        measurement_page(&read_measurements(folder)?)
    } else {
        search_page(&read_run(folder)?)?
    };
    write_atomically(path, page.as_bytes())?;
    Ok(page.len())
}
