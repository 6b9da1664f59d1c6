//! Where commands write: the answer to stdout, notes to stderr.

use std::io::Write;

use comfy_table::{CellAlignment, ContentArrangement, Table, presets};
use serde::Serialize;

use super::progress::{Progress, ProgressMode};
use super::{CliError, Format, OutputOptions};
use crate::io::json::Document;

/// The program's two outlets, with the options that the user gave.
#[derive(Debug, Clone)]
pub struct Screen {
    format: Format,
    quiet: bool,
    progress: ProgressMode,
    is_silent: bool,
}

impl Screen {
    pub fn new(options: &OutputOptions) -> Self {
        Self { format: options.format, quiet: options.quiet, progress: options.progress, is_silent: false }
    }

    /// Shows nothing at all.
    pub fn silent() -> Self {
        Self { format: Format::Json, quiet: true, progress: ProgressMode::None, is_silent: true }
    }

    pub fn is_json(&self) -> bool {
        self.format == Format::Json
    }

    pub fn is_quiet(&self) -> bool {
        self.quiet
    }

    /// The answer as one JSON document, or as the text that `text` makes.
    ///
    /// # Errors
    /// A stdout that cannot be written.
    pub fn answer<T: Serialize>(&self, body: T, text: impl FnOnce(&T) -> String) -> Result<(), CliError> {
        if self.is_json() {
            let document = Document::new(body);
            let json = serde_json::to_string_pretty(&document).map_err(|e| CliError::Stdout(e.into()))?;
            self.write(&(json + "\n"))
        } else {
            self.write(&text(&body))
        }
    }

    /// As [`Screen::answer`], for a document that holds its schema version itself because it is also a file.
    ///
    /// # Errors
    /// A stdout that cannot be written.
    pub fn document<T: Serialize>(&self, document: &T, text: impl FnOnce(&T) -> String) -> Result<(), CliError> {
        if self.is_json() {
            let json = serde_json::to_string_pretty(document).map_err(|e| CliError::Stdout(e.into()))?;
            self.write(&(json + "\n"))
        } else {
            self.write(&text(document))
        }
    }

    /// Writes to stdout as it is.
    ///
    /// # Errors
    /// A stdout that cannot be written.
    pub fn write(&self, text: &str) -> Result<(), CliError> {
        if self.is_silent {
            return Ok(());
        }
        let mut stdout = std::io::stdout().lock();
        stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()).map_err(CliError::Stdout)
    }

    /// Shows the progress of a task; see [`Progress::new`].
    pub fn progress(&self, task: &str, total: Option<u64>) -> Progress {
        Progress::new(self.progress, self.quiet, task, total)
    }

    /// A note to the person at the terminal.
    pub fn note(&self, text: &str) {
        if !self.quiet {
            eprintln!("{text}");
        }
    }
}

/// A plain table: first column to the left, the others to the right.
pub fn table(header: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_content_arrangement(ContentArrangement::Disabled).set_header(header);
    for row in rows {
        table.add_row(row);
    }
    for (i, column) in table.column_iter_mut().enumerate() {
        column.set_padding((0, 2));
        if i > 0 {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table.lines().map(|line| line.trim_end().to_owned() + "\n").collect()
}
