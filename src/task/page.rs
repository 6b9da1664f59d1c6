//! The page of a folder of results.

use std::path::{Path, PathBuf};

use crate::io::files::{folder_of, write_atomically};
use crate::io::folder::check_file;
use crate::io::model::NamedPattern;
use crate::io::read::run_reader::{Run, read_run};
use crate::io::write::field_rates::{FieldRates, read_rates};
use crate::io::write::measurement_folder::{holds_measurements, read_measurements};
use crate::pattern::Pattern;
use crate::report::field_search::field_page;
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

/// What the patterns of a search under fields err by, the best one last: on top of the others.
fn rates_of(folder: &Path, run: &Run) -> Result<Vec<FieldRates>, TaskError> {
    let best = &run.summary.best;
    let others = run.summary.baselines.iter().filter(|shown| shown.segments != best.segments);
    let names: Vec<&str> = others.chain(std::iter::once(best)).map(|shown| shown.name.as_str()).collect();
    Ok(read_rates(folder, &names)?)
}

/// Whether a file stands, or is to stand, in a folder itself.
pub fn is_in(folder: &Path, path: &Path) -> bool {
    let of = |path: &Path| path.canonicalize().ok();
    of(folder).is_some_and(|folder| of(&folder_of(path)) == Some(folder))
}

/// What stands in a folder and is no page: a page is made of it.
fn results(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    let paths = entries.filter_map(|entry| Some(entry.ok()?.path()));
    paths.filter(|path| path.extension().is_none_or(|extension| extension != "html")).collect()
}

/// Makes the page of a folder, and with a search's page, where it goes into that folder, the explorer's; the page's size in
/// bytes.
///
/// # Errors
/// A folder that holds no results, or cannot be read or written; a page in the place of one of them.
pub fn write_report(folder: &Path, path: &Path) -> Result<usize, TaskError> {
    check_file(path, results(folder).iter().map(PathBuf::as_path))?;
    let page = if holds_measurements(folder) {
        measurement_page(&read_measurements(folder)?)
    } else {
        let run = read_run(folder)?;
        let is_under_fields = !run.summary.fields.is_empty();
        // The explorer tries windings under profiles.
        let beside = is_in(folder, path) && !is_under_fields;
        if beside {
            explore_page::write(&run.file, &tried(&run)?, &folder.join(EXPLORER_FILE))?;
        }
        if is_under_fields {
            field_page(&run, &rates_of(folder, &run)?)?
        } else {
            search_page(&run, beside.then_some(EXPLORER_FILE))?
        }
    };
    write_atomically(path, page.as_bytes())?;
    Ok(page.len())
}
