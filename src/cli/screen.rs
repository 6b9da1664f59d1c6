//! Where commands write: the answer to stdout, notes to stderr.

use std::ffi::OsString;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};

use comfy_table::{CellAlignment, ContentArrangement, Table, presets};
use serde::Serialize;

use super::progress::{ProgressMode, TaskProgress};
use super::{CliError, Format, OutputOptions};
use crate::io::folder::HeldFolder;
use crate::io::json::Document;
use crate::text::sink::{Block, JsonText, Line};

/// The program's two outlets, with the options that the user gave.
#[derive(Debug, Clone)]
pub(crate) struct Screen {
    format: Format,
    quiet: bool,
    progress: ProgressMode,
    /// The program's name or place, as it was called.
    pub(crate) program: PathBuf,
    /// Files that the command line names.
    named: Vec<PathBuf>,
}

impl Screen {
    /// `words` are those of the command line, the program's name first.
    pub(crate) fn new(options: &OutputOptions, words: &[OsString]) -> Self {
        let program = words.first().map_or_else(PathBuf::new, PathBuf::from);
        // An option may hold its value behind a sign of equality.
        let value = |word: &OsString| word.to_str().and_then(|word| Some(PathBuf::from(word.split_once('=')?.1)));
        let words = words.iter().skip(1).flat_map(|word| [Some(PathBuf::from(word)), value(word)]);
        let named = words.flatten().filter(|path| path.is_file()).collect();
        Self { format: options.format, quiet: options.quiet, progress: options.progress, program, named }
    }

    /// Files that the command line names: what a command reads must not be among what it writes over.
    pub(crate) fn named(&self) -> impl Iterator<Item = &Path> {
        self.named.iter().map(PathBuf::as_path)
    }

    pub(crate) fn is_json(&self) -> bool {
        self.format == Format::Json
    }

    /// The answer as one JSON document, or as the text that `text` makes.
    ///
    /// # Errors
    /// A stdout that cannot be written.
    pub(crate) fn answer<T: Serialize>(&self, body: T, text: impl FnOnce(&T) -> String) -> Result<(), CliError> {
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
    pub(crate) fn document<T: Serialize>(&self, document: &T, text: impl FnOnce(&T) -> String) -> Result<(), CliError> {
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
    pub(crate) fn write(&self, text: &str) -> Result<(), CliError> {
        let has_colours = may_colour(&std::io::stdout());
        let block = Block::of(text);
        let lines = block.as_str().split_inclusive('\n').map(|line| match line.strip_prefix(HEAD) {
            Some(head) if has_colours => format!("{BOLD}{}{PLAIN}\n", head.trim_end()),
            Some(head) => head.to_owned(),
            None => line.to_owned(),
        });
        self.own(&lines.collect::<String>())
    }

    /// Writes to stdout, as it is, what holds nothing from outside: scripts for a shell, manual pages.
    ///
    /// # Errors
    /// A stdout that cannot be written.
    pub(crate) fn own(&self, text: &str) -> Result<(), CliError> {
        let mut stdout = std::io::stdout().lock();
        stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()).map_err(CliError::Stdout)
    }

    /// Shows the progress of a task; see [`TaskProgress::new`].
    pub(crate) fn progress(&self, task: &str, total: Option<u64>) -> TaskProgress {
        TaskProgress::new(self.progress, self.quiet, task, total)
    }

    /// A note to the person at the terminal: one line, which a terminal gets broken between words.
    pub(crate) fn note(&self, text: &str) {
        if !self.quiet {
            eprintln!("{}", fitted(Line::of(text).as_str()));
        }
    }
}

/// The folder that a command writes into, held until it has ended.
///
/// # Errors
/// A folder that cannot be written, or that another run holds.
pub(crate) fn held(folder: &Path, command: &str) -> Result<HeldFolder, CliError> {
    Ok(HeldFolder::take(folder, &run_of(command))?)
}

/// What another run is told of this one.
pub(crate) fn run_of(command: &str) -> String {
    format!("coilwright {command} (process {})", std::process::id())
}

/// Begins the head of a table until it is written: a character of private use, which no font and no keyboard has.
const HEAD: char = '\u{f8ff}';
const BOLD: &str = "\u{1b}[1m";
const RED: &str = "\u{1b}[1;31m";
const PLAIN: &str = "\u{1b}[0m";
/// Lines of an error are not made shorter than this.
const LEAST_WIDTH: usize = 24;

/// Whether colours are wanted where `outlet` goes: on a terminal that has some, unless NO_COLOR says otherwise.
fn may_colour(outlet: &impl IsTerminal) -> bool {
    let is_set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    outlet.is_terminal() && !is_set("NO_COLOR") && std::env::var_os("TERM").is_none_or(|term| term != "dumb")
}

/// Writes an error to stderr; on a terminal its first word is coloured, and what is one line is broken between words.
pub(crate) fn complain(words: &Block) {
    let words = words.as_str().trim_end();
    let shown = if words.contains('\n') { words.to_owned() } else { fitted(words) };
    if may_colour(&std::io::stderr()) {
        let coloured = |line: &str| match line.strip_prefix("error") {
            Some(rest) => format!("{RED}error{PLAIN}{rest}"),
            None => line.to_owned(),
        };
        eprintln!("{}", shown.lines().map(coloured).collect::<Vec<_>>().join("\n"));
    } else {
        eprintln!("{shown}");
    }
}

/// One line for stderr: on a terminal broken between words where its window is narrower.
fn fitted(line: &str) -> String {
    match Table::new().use_stderr().width() {
        Some(width) => broken(line, usize::from(width).max(LEAST_WIDTH)),
        None => line.to_owned(),
    }
}

/// The words in lines that are no longer than `width`, as far as words are not.
fn broken(words: &str, width: usize) -> String {
    let mut lines = vec![String::new()];
    for word in words.split(' ') {
        let last = lines.last_mut().expect("there is a first line");
        if !last.is_empty() && last.chars().count() + 1 + word.chars().count() > width {
            lines.push(word.to_owned());
        } else {
            if !last.is_empty() {
                last.push(' ');
            }
            last.push_str(word);
        }
    }
    lines.join("\n")
}

/// A plain table: first column to the left, the others to the right. In a window that is narrower, each row is a list.
pub(crate) fn table(header: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    // A cell's own line break would look like a row of its own.
    let shown = |cell: &dyn std::fmt::Display| Line::of(cell).into_string();
    let header: Vec<String> = header.iter().map(|cell| shown(cell)).collect();
    let rows: Vec<Vec<String>> = rows.into_iter().map(|row| row.iter().map(|cell| shown(cell)).collect()).collect();
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_content_arrangement(ContentArrangement::Disabled).set_header(header.clone());
    for row in &rows {
        table.add_row(row.clone());
    }
    for (i, column) in table.column_iter_mut().enumerate() {
        column.set_padding((0, 2));
        if i > 0 {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    let lines: Vec<String> = table.lines().map(|line| line.trim_end().to_owned() + "\n").collect();
    let widest = lines.iter().map(|line| line.chars().count() - 1).max().unwrap_or(0);
    if table.width().is_some_and(|width| usize::from(width) < widest) {
        return as_lists(&header, &rows);
    }
    format!("{HEAD}{}", lines.concat())
}

/// The first cell of each row, and below it the others with the names of their columns.
fn as_lists(header: &[String], rows: &[Vec<String>]) -> String {
    let widest = header.iter().skip(1).map(|name| name.chars().count()).max().unwrap_or(0);
    let list = |row: &Vec<String>| {
        let cells = header.iter().zip(row).skip(1).map(|(name, cell)| format!("  {name:<widest$}  {cell}\n"));
        format!("{HEAD}{}\n{}", row.first().map_or("", String::as_str), cells.collect::<String>())
    };
    rows.iter().map(list).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_in_a_narrow_window_is_a_list_of_its_cells() {
        let words = |of: &[&str]| of.iter().map(|word| (*word).to_owned()).collect::<Vec<String>>();
        let header = words(&["pattern", "worst °/h", "class"]);
        let shown = as_lists(&header, &[words(&["qua", "4.3366", "standard"])]);
        assert_eq!(shown, format!("{HEAD}qua\n  worst °/h  4.3366\n  class      standard\n"));
    }

    #[test]
    fn an_error_is_broken_between_words_and_words_stay_whole() {
        let said = broken("error: a/very/long/name/of/a/file cannot be read", 24);
        assert_eq!(said, "error:\na/very/long/name/of/a/file\ncannot be read");
    }
}
