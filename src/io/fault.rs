//! Faults of an input file: all of them at once, each with the source line drawn.

use std::borrow::Cow;
use std::ops::Range;

use codespan_reporting::diagnostic::{Diagnostic, Label};
use codespan_reporting::files::SimpleFile;
use codespan_reporting::term::{self, Config};

use crate::text::sink::Line;
use crate::text::{is_unseen, visible};

/// One fault: what was expected, what was found, what to do; and where.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// What is wrong, expected and found.
    pub message: String,
    /// Bytes of the source; none for a fault of the file as a whole.
    pub span: Option<Range<usize>>,
    /// The remedy.
    pub note: Option<String>,
}

impl Fault {
    pub(crate) fn new(message: impl Into<String>, span: Option<Range<usize>>) -> Self {
        Self { message: message.into(), span, note: None }
    }

    pub(crate) fn with_note(mut self, note: impl Into<String>) -> Self {
        self.note = Some(note.into());
        self
    }
}

/// All faults of one file; never empty.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Faults {
    /// Its path, as the user gave it.
    pub file: String,
    /// Its text, for the lines that are shown.
    pub source: String,
    /// All of them, in the source's order.
    pub faults: Vec<Fault>,
}

impl Faults {
    /// A file that could not be read as text at all.
    pub(crate) fn of_file(file: impl Into<String>, message: impl Into<String>) -> Self {
        Self { file: file.into(), source: String::new(), faults: vec![Fault::new(message, None)] }
    }

    /// One fault in a source text that is known.
    pub(crate) fn one(file: impl Into<String>, source: impl Into<String>, fault: Fault) -> Self {
        Self { file: file.into(), source: source.into(), faults: vec![fault] }
    }
}

impl std::error::Error for Faults {}

impl std::fmt::Display for Faults {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // Whatever the file, its name and the faults hold is text on a terminal's lines from here on.
        let name = Line::of(&self.file);
        let source = Shown::of(&self.source);
        let file = SimpleFile::new(name.as_str(), &*source.text);
        for fault in &self.faults {
            let (message, note) = (Line::of(&fault.message), fault.note.as_ref().map(Line::of));
            let Some(span) = fault.span.clone().and_then(|span| source.span(&self.source, span)) else {
                writeln!(f, "error: {name}: {message}")?;
                if let Some(note) = &note {
                    writeln!(f, "  = {note}")?;
                }
                continue;
            };
            let diagnostic = Diagnostic::error()
                .with_message(message)
                .with_labels(vec![Label::primary((), span)])
                .with_notes(note.into_iter().map(Line::into_string).collect());
            let drawn = term::emit_into_string(&Config::default(), &file, &diagnostic).map_err(|_| std::fmt::Error)?;
            writeln!(f, "{}", drawn.trim_end())?;
        }
        if self.faults.len() > 1 {
            writeln!(f, "{} faults in {name}", self.faults.len())?;
        }
        Ok(())
    }
}

/// A line that is longer is not drawn: it would fill the screen.
const LONGEST_DRAWN_LINE: usize = 2_000;

/// A source as a terminal may show it.
struct Shown<'s> {
    text: Cow<'s, str>,
}

impl<'s> Shown<'s> {
    fn of(source: &'s str) -> Self {
        let clean = !source.contains(|c| is_unseen(c) && !KEPT.contains(&c)) && !source.contains('\r');
        Self { text: if clean { Cow::Borrowed(source) } else { Cow::Owned(shown(source)) } }
    }

    /// Where a part of the source is in what is shown; none where it cannot be drawn.
    fn span(&self, source: &str, span: Range<usize>) -> Option<Range<usize>> {
        let (before, part) = (source.get(..span.start)?, source.get(span.clone())?);
        let line = source[span.start..].lines().next().map_or(0, str::len) + before.len()
            - before.rfind('\n').map_or(0, |i| i + 1);
        if line > LONGEST_DRAWN_LINE {
            return None;
        }
        match self.text {
            Cow::Borrowed(_) => Some(span),
            Cow::Owned(_) => {
                let start = shown(before).len();
                Some(start..start + shown(part).len())
            }
        }
    }
}

/// Tabs are drawn as spaces; a line's own end stays.
const KEPT: [char; 2] = ['\n', '\t'];

fn shown(source: &str) -> String {
    visible(&source.replace("\r\n", "\n"), &KEPT)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_file_holds_neither_moves_the_cursor_nor_forges_a_line() {
        let source = "name = \"a\u{1b}[2J\u{202e}\" \r x\nlayers = 0\r\n";
        let at = source.find("layers").unwrap();
        let fault = Fault::new("layers must be even,\nverify: no violations", Some(at..at + 6)).with_note("a\u{9b}b");
        let first = Fault::new("the name", Some(0..4));
        let faults = Faults { file: "x\n\u{7f}.toml".into(), source: source.into(), faults: vec![fault, first] };
        let text = faults.to_string();
        assert!(!text.contains(|c| is_unseen(c) && c != '\n'), "{text:?}");
        assert!(text.contains("layers must be even,\\nverify: no violations\n"), "{text}");
        assert!(text.contains("\\u{1b}[2J\\u{202e}") && text.contains("^^^^^^"), "{text}");
    }

    #[test]
    fn a_line_of_a_million_characters_is_named_and_not_drawn() {
        let source = format!("name = \"{}\"", "x".repeat(1_000_000));
        let faults = Faults::one("m.toml", source, Fault::new("too long", Some(0..4)));
        assert_eq!(faults.to_string(), "error: m.toml: too long\n");
    }
}
