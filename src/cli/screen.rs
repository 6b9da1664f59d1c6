//! Where commands write: the answer to stdout, notes to stderr.

use std::io::Write;
use std::path::{Path, PathBuf};

use comfy_table::{CellAlignment, ContentArrangement, Table, presets};
use serde::Serialize;

use super::progress::{Progress, ProgressMode};
use super::{CliError, Format, OutputOptions};
use crate::io::folder::HeldFolder;
use crate::io::json::Document;
use crate::text::sink::{Block, JsonText, Line};

/// The program's two outlets, with the options that the user gave.
#[derive(Debug, Clone)]
pub struct Screen {
    format: Format,
    quiet: bool,
    progress: ProgressMode,
    /// The program's name or place, as it was called.
    pub program: PathBuf,
}

impl Screen {
    pub fn new(options: &OutputOptions, program: PathBuf) -> Self {
        Self { format: options.format, quiet: options.quiet, progress: options.progress, program }
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
            self.json(&document)
        } else {
            self.write(&text(&body))
        }
    }

    /// As [`Screen::answer`], for a document that holds its schema version itself because it is also a file.
    ///
    /// # Errors
    /// A stdout that cannot be written.
    pub fn document<T: Serialize>(&self, document: &T, text: impl FnOnce(&T) -> String) -> Result<(), CliError> {
        if self.is_json() { self.json(document) } else { self.write(&text(document)) }
    }

    fn json<T: Serialize>(&self, document: &T) -> Result<(), CliError> {
        let json = serde_json::to_string_pretty(document).map_err(|e| CliError::Stdout(e.into()))?;
        self.own(&(JsonText::of(&json).into_string() + "\n"))
    }

    /// Writes to stdout what may hold text from outside: lines that do nothing to a terminal but appear on it.
    ///
    /// # Errors
    /// A stdout that cannot be written.
    pub fn write(&self, text: &str) -> Result<(), CliError> {
        self.own(Block::of(text).as_str())
    }

    /// Writes to stdout, as it is, what holds nothing from outside: scripts for a shell, manual pages.
    ///
    /// # Errors
    /// A stdout that cannot be written.
    pub fn own(&self, text: &str) -> Result<(), CliError> {
        let mut stdout = std::io::stdout().lock();
        stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()).map_err(CliError::Stdout)
    }

    /// Shows the progress of a task; see [`Progress::new`].
    pub fn progress(&self, task: &str, total: Option<u64>) -> Progress {
        Progress::new(self.progress, self.quiet, task, total)
    }

    /// A note to the person at the terminal: one line.
    pub fn note(&self, text: &str) {
        if !self.quiet {
            eprintln!("{}", Line::of(text));
        }
    }
}

/// The folder that a command writes into, held until it has ended.
///
/// # Errors
/// A folder that cannot be written, or that another run holds.
pub fn held(folder: &Path, command: &str) -> Result<HeldFolder, CliError> {
    Ok(HeldFolder::take(folder, &format!("coilwright {command} (process {})", std::process::id()))?)
}

/// A plain table: first column to the left, the others to the right.
pub fn table(header: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let mut table = Table::new();
    table
        .load_style(presets::NOTHING)
        .set_content_arrangement(ContentArrangement::Disabled)
        .set_header(header.iter().map(|cell| Line::of(cell).into_string()));
    for row in rows {
        // A cell's own line break would look like a row of its own.
        table.add_row(row.iter().map(|cell| Line::of(cell).into_string()));
    }
    for (i, column) in table.column_iter_mut().enumerate() {
        column.set_padding((0, 2));
        if i > 0 {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table.lines().map(|line| line.trim_end().to_owned() + "\n").collect()
}
