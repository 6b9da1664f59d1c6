//! The page of a folder of results.

use std::path::Path;

use crate::io::files::write_atomically;
use crate::io::model::NamedPattern;
use crate::io::read::run_reader::{Run, read_run};
use crate::io::write::measurement_folder::{holds_measurements, read_measurements};
use crate::pattern::Pattern;
use crate::report::measurement::measurement_page;
use crate::report::search_run::{ReportError, search_page};

use super::TaskError;
use super::explore_page::{self, EXPLORER_FILE};

/// The page's name in its folder.
pub const REPORT_FILE: &str = "report.html";

/// The recommended pattern first, then the best.
fn tried(run: &Run) -> Result<Vec<NamedPattern>, ReportError> {
    let (summary, named) = (&run.summary, |name: &str, segments: &[usize]| {
        let pattern = Pattern::new(segments.to_vec())?;
        Ok(NamedPattern { name: name.to_owned(), pattern })
    });
    let recommended = summary.recommendation.iter().filter(|r| !r.segments.is_empty());
    let stated = recommended.map(|r| (&r.pattern, &r.segments)).chain([(&summary.best.name, &summary.best.segments)]);
    stated.map(|(name, segments)| named(name, segments)).collect()
}

/// Makes the page of a folder, and with a search's page, where it goes into that folder, the explorer's; the page's size in
/// bytes.
///
/// # Errors
/// A folder that holds no results, or cannot be read or written.
pub fn write_report(folder: &Path, path: &Path) -> Result<usize, TaskError> {
    let page = if holds_measurements(folder) {
        measurement_page(&read_measurements(folder)?)
    } else {
        let run = read_run(folder)?;
        let beside = path.parent() == Some(folder);
        if beside {
            explore_page::write(&run.file, &tried(&run)?, &folder.join(EXPLORER_FILE))?;
        }
        search_page(&run, beside.then_some(EXPLORER_FILE))?
    };
    write_atomically(path, page.as_bytes())?;
    Ok(page.len())
}
