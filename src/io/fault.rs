//! Faults of an input file: all of them at once, each with the source line drawn.

use std::ops::Range;

use codespan_reporting::diagnostic::{Diagnostic, Label};
use codespan_reporting::files::SimpleFile;
use codespan_reporting::term::{self, Config};

/// One fault: what was expected, what was found, what to do; and where.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    pub message: String,
    /// Bytes of the source; none for a fault of the file as a whole.
    pub span: Option<Range<usize>>,
    pub note: Option<String>,
}

impl Fault {
    pub fn new(message: impl Into<String>, span: Option<Range<usize>>) -> Self {
        Self { message: message.into(), span, note: None }
    }

    pub fn with_note(mut self, note: impl Into<String>) -> Self {
        self.note = Some(note.into());
        self
    }
}

/// All faults of one file; never empty.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Faults {
    pub file: String,
    pub source: String,
    pub faults: Vec<Fault>,
}

impl Faults {
    /// A file that could not be read as text at all.
    pub fn of_file(file: impl Into<String>, message: impl Into<String>) -> Self {
        Self { file: file.into(), source: String::new(), faults: vec![Fault::new(message, None)] }
    }

    /// One fault in a source text that is known.
    pub fn one(file: impl Into<String>, source: impl Into<String>, fault: Fault) -> Self {
        Self { file: file.into(), source: source.into(), faults: vec![fault] }
    }
}

impl std::error::Error for Faults {}

impl std::fmt::Display for Faults {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let file = SimpleFile::new(&self.file, &self.source);
        for fault in &self.faults {
            let drawable = fault.span.clone().filter(|s| s.start <= s.end && s.end <= self.source.len());
            let Some(span) = drawable else {
                writeln!(f, "error: {}: {}", self.file, fault.message)?;
                if let Some(note) = &fault.note {
                    writeln!(f, "  = {note}")?;
                }
                continue;
            };
            let diagnostic = Diagnostic::error()
                .with_message(&fault.message)
                .with_labels(vec![Label::primary((), span)])
                .with_notes(fault.note.iter().cloned().collect());
            let drawn = term::emit_into_string(&Config::default(), &file, &diagnostic).map_err(|_| std::fmt::Error)?;
            writeln!(f, "{}", drawn.trim_end())?;
        }
        if self.faults.len() > 1 {
            writeln!(f, "{} faults in {}", self.faults.len(), self.file)?;
        }
        Ok(())
    }
}
