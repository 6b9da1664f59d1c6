//! What commands that take records share: how their columns are named, reading them, and what to do about odd rows.

use std::path::PathBuf;

use clap::ValueEnum;

use super::CliError;
use crate::io::model::ModelFile;
use crate::io::read::record_columns::RecordFormat;
use crate::task::measurement::{self, Measurement};

/// What to do with values that stand alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum GrossErrorChoice {
    /// Report them and use them
    Keep,
    /// Report them and leave their rows out
    Drop,
}

impl From<GrossErrorChoice> for measurement::GrossErrors {
    fn from(wish: GrossErrorChoice) -> Self {
        match wish {
            GrossErrorChoice::Keep => Self::Keep,
            GrossErrorChoice::Drop => Self::Drop,
        }
    }
}

/// What to do with rows that are none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum BadRows {
    /// A missing cell, or a stamp that repeats or jumps back, is an error
    Refuse,
    /// Such rows are skipped and counted
    Skip,
}

/// How a record file is to be read.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Record files")]
pub(crate) struct RecordArguments {
    /// Which column is which, and its unit: time=Zeit:min,temperature=T1,rate=Omega:deg_per_s; roles are time, temperature,
    /// rate, inner, ambient, table, date (beside a time of day), layer_1, layer_2 and so on, flange, spool, electronics, source;
    /// scale=N raw units a degree an hour
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
    pub(crate) fn format(&self, model: Option<&ModelFile>) -> Result<RecordFormat, CliError> {
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

    /// Reads records.
    pub(crate) fn read(&self, paths: &[PathBuf], model: Option<&ModelFile>) -> Result<Vec<Measurement>, CliError> {
        let format = self.format(model)?;
        Ok(paths.iter().map(|path| Measurement::read(path, &format)).collect::<Result<_, _>>()?)
    }
}
