//! What commands that take records share: reading them, and what to do about gross errors.

use std::path::Path;

use clap::ValueEnum;

use super::CliError;
use super::screen::Screen;
use crate::io::json::metrics::GrossErrorJson;
use crate::io::read::record_file::read_record;
use crate::record::Record;

/// What to do with values that stand alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum GrossErrors {
    /// Report them and use them
    Keep,
    /// Report them and leave their rows out
    Drop,
}

/// A record and what was noticed while reading it.
#[derive(Debug)]
pub struct Noticed {
    pub record: Record,
    pub gross_errors: Vec<GrossErrorJson>,
    pub gaps: usize,
}

/// Reads a record, finds its gross errors and does with them what the user said.
pub fn read_noticed(path: &Path, wish: GrossErrors, screen: &Screen) -> Result<Noticed, CliError> {
    let record = read_record(path)?;
    let found = record.gross_errors();
    let dropped = wish == GrossErrors::Drop;
    let gross_errors: Vec<GrossErrorJson> = found
        .iter()
        .map(|e| GrossErrorJson { time_s: record.times_s()[e.row], column: e.column.to_owned(), dropped })
        .collect();
    if !found.is_empty() {
        let first = &gross_errors[0];
        let fate = if dropped { "left out" } else { "used all the same: --gross-errors drop leaves them out" };
        screen.note(&format!(
            "note: {}: {} gross errors, the first in {} at {} s; {fate}",
            path.display(),
            found.len(),
            first.column,
            first.time_s
        ));
    }
    let rows: Vec<usize> = found.iter().map(|e| e.row).collect();
    let record = if dropped && !rows.is_empty() { record.without_rows(&rows)? } else { record };
    let gaps = record.gaps().len();
    Ok(Noticed { record, gross_errors, gaps })
}
