//! What commands that take records share: how their columns are named, reading them, and what to do about odd rows.

use std::path::Path;

use clap::ValueEnum;

use super::CliError;
use super::screen::Screen;
use crate::io::json::metrics::GrossErrorJson;
use crate::io::model::ModelFile;
use crate::io::read::record_columns::RecordFormat;
use crate::io::read::record_file::read_record_as;
use crate::io::read::record_rows::contradicts_mean;
use crate::record::Record;

/// What to do with values that stand alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum GrossErrors {
    /// Report them and use them
    Keep,
    /// Report them and leave their rows out
    Drop,
}

/// What to do with rows that are none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum BadRows {
    /// A missing cell, or a stamp that repeats or jumps back, is an error
    Refuse,
    /// Such rows are skipped and counted
    Skip,
}

/// How a record file is to be read.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Record files")]
pub struct RecordArguments {
    /// Which column is which, and its unit: time=Zeit:min,temperature=T1,rate=Omega:deg_per_s; roles are time, temperature,
    /// rate, inner, ambient; scale=N raw units a degree an hour
    #[arg(long, value_name = "ROLE=COLUMN[:UNIT],...")]
    columns: Option<String>,
    /// What to do with rows that lack a number or go back in time; without it, refuse
    #[arg(long, value_enum)]
    bad_rows: Option<BadRows>,
    /// Averages so many rows into one; its stamp is that of the last
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    average_rows: Option<u32>,
}

impl RecordArguments {
    /// As the model's [record] says, and over it as the command line says.
    pub fn format(&self, model: Option<&ModelFile>) -> Result<RecordFormat, CliError> {
        let mut format = model.map_or_else(RecordFormat::default, |m| m.record.clone());
        if let Some(columns) = &self.columns {
            format.map_all(columns).map_err(|message| CliError::Columns { message })?;
        }
        if let Some(wish) = self.bad_rows {
            format.skips_bad_rows = wish == BadRows::Skip;
        }
        if let Some(rows) = self.average_rows {
            format.average_rows = rows as usize;
        }
        Ok(format)
    }
}

/// A record and what was noticed while reading it.
#[derive(Debug)]
pub struct Noticed {
    pub record: Record,
    pub gross_errors: Vec<GrossErrorJson>,
    pub gaps: usize,
}

/// Says what was skipped, assumed or looks odd.
pub fn remark(path: &Path, skipped_rows: usize, remarks: &[String], screen: &Screen) {
    for remark in remarks {
        screen.note(&format!("note: {}: {remark}", path.display()));
    }
    if skipped_rows > 0 {
        screen.note(&format!(
            "note: {}: {skipped_rows} rows skipped: a cell without a number, or a stamp that repeats or jumps back",
            path.display()
        ));
    }
}

/// Reads a record and says what was noticed.
pub fn read_remarked(
    path: &Path,
    format: &RecordFormat,
    model: Option<&ModelFile>,
    screen: &Screen,
) -> Result<Record, CliError> {
    let mut read = read_record_as(path, format)?;
    read.remarks.extend(model.and_then(|m| contradicts_mean(read.record.interval_s(), m.model.rate_mean_s)));
    remark(path, read.skipped_rows, &read.remarks, screen);
    Ok(read.record)
}

/// Says how many gross errors there are and what becomes of them.
pub fn remark_gross(path: &Path, found: &[GrossErrorJson], dropped: bool, screen: &Screen) {
    let Some(first) = found.first() else { return };
    let fate = if dropped { "left out" } else { "used all the same: --gross-errors drop leaves them out" };
    screen.note(&format!(
        "note: {}: {} gross errors, the first in {} at {} s; {fate}",
        path.display(),
        found.len(),
        first.column,
        first.time_s
    ));
}

/// Reads a record, finds its gross errors and does with them what the user said.
pub fn read_noticed(
    path: &Path,
    wish: GrossErrors,
    format: &RecordFormat,
    model: Option<&ModelFile>,
    screen: &Screen,
) -> Result<Noticed, CliError> {
    let record = read_remarked(path, format, model, screen)?;
    let found = record.gross_errors();
    let dropped = wish == GrossErrors::Drop;
    let gross_errors: Vec<GrossErrorJson> = found
        .iter()
        .map(|e| GrossErrorJson { time_s: record.times_s()[e.row], column: e.column.to_owned(), dropped })
        .collect();
    remark_gross(path, &gross_errors, dropped, screen);
    let rows: Vec<usize> = found.iter().map(|e| e.row).collect();
    let record = if dropped && !rows.is_empty() { record.without_rows(&rows)? } else { record };
    let gaps = record.gaps().len();
    Ok(Noticed { record, gross_errors, gaps })
}
