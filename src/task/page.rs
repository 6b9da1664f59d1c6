//! The page of a folder of results.

use std::path::Path;

use crate::io::files::write_atomically;
use crate::io::read::run_reader::read_run;
use crate::io::write::measurement_folder::{holds_measurements, read_measurements};
use crate::report::measurement::measurement_page;
use crate::report::search_run::search_page;

use super::TaskError;

/// The page's name in its folder.
pub const REPORT_FILE: &str = "report.html";

/// Makes the page of a folder; its size in bytes.
///
/// # Errors
/// A folder that holds no results, or cannot be read or written.
pub fn write_report(folder: &Path, path: &Path) -> Result<usize, TaskError> {
    let page = if holds_measurements(folder) {
        measurement_page(&read_measurements(folder)?)
    } else {
        search_page(&read_run(folder)?)?
    };
    write_atomically(path, page.as_bytes())?;
    Ok(page.len())
}
