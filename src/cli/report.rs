//! `report`: the page of a search.

use std::path::{Path, PathBuf};

use super::screen::Screen;
use super::{CliError, Ending};
use crate::io::files::write_atomically;
use crate::io::json::ReportJson;
use crate::io::run_reader::read_run;
use crate::report::search_run::search_page;

/// One self-contained page about a search, written to report.html in its folder
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  coilwright report results/paper-200m")]
pub struct Arguments {
    /// The folder that `optimise -o` wrote
    folder: PathBuf,
    /// Where the page goes; without it, report.html in the folder
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
}

pub fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let path = arguments.output.clone().unwrap_or_else(|| arguments.folder.join("report.html"));
    let bytes = write_report(&arguments.folder, &path)?;
    let report = path.display().to_string();
    screen.answer(ReportJson { report, bytes }, |body| format!("{}\n", body.report))?;
    Ok(Ending::Done)
}

/// Makes the page of a search's folder; its size in bytes.
pub(super) fn write_report(folder: &Path, path: &Path) -> Result<usize, CliError> {
    let page = search_page(&read_run(folder)?)?;
    write_atomically(path, page.as_bytes())?;
    Ok(page.len())
}
