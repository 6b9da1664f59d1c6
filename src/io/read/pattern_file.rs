//! Pattern files, and patterns by name.

use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::io::fault::{Fault, Faults};
use crate::io::files::read_text;
use crate::io::model::NamedPattern;
use crate::pattern::classic::{Classic, ClassicError};
use crate::pattern::{EndTurns, Pattern};
use crate::text::sink::TomlComment;

use super::kind_of_file::{FileKind, states_any};
use super::toml_reader::{TomlReader, parse};

/// Why a name leads to no pattern.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "its messages say what each means")]
#[non_exhaustive]
pub enum ResolveError {
    #[error(transparent)]
    Classic(#[from] ClassicError),
    #[error("the pattern file {path} has {found} layers where the coil has {expected}", path = .path.display())]
    Layers { path: PathBuf, expected: usize, found: usize },
    #[error("{path} is no pattern file: expected TOML with name, layers and segments", path = .path.display())]
    NoPattern { path: PathBuf },
    /// One of the program's own, of another kind.
    #[error("{path} {words}", path = .path.display())]
    Other { path: PathBuf, words: String },
    #[error("the pattern file has faults:\n{0}")]
    File(Faults),
}

/// No layer has more turns.
const MOST_END_TURNS: i64 = 1_000_000;

/// The file that [`resolve_pattern`] reads; none for a winding's name.
pub fn file_of_pattern(stated: &str, base: Option<&Path>) -> Option<PathBuf> {
    if Classic::from_key(stated).is_ok() {
        return None;
    }
    let beside = base.map(|b| b.join(stated)).filter(|p| p.is_file());
    Some(beside.unwrap_or_else(|| PathBuf::from(stated)))
}

/// A pattern by the name of a classic winding or by the path of a pattern file.
///
/// A path is tried from `base` (the model file's folder), then from the working directory.
///
/// # Errors
/// A name that is neither, a winding that does not fit the layer count, a faulty file.
pub fn resolve_pattern(stated: &str, layers: usize, base: Option<&Path>) -> Result<NamedPattern, ResolveError> {
    if let Ok(classic) = Classic::from_key(stated) {
        return Ok(NamedPattern { name: classic.key().to_owned(), pattern: classic.pattern(layers)? });
    }
    let path = file_of_pattern(stated, base).unwrap_or_default();
    let looks_like_a_path = stated.ends_with(".toml") || stated.contains(std::path::MAIN_SEPARATOR);
    if !path.exists() && !looks_like_a_path {
        return Err(ClassicError::Unknown { found: format!("\"{stated}\"") }.into());
    }
    let source = read_text(&path).map_err(ResolveError::File)?;
    if let Some(words) = FileKind::Pattern.instead(&source) {
        return Err(ResolveError::Other { path, words });
    }
    // What is something else altogether is named, not shown: it may be any file of the system.
    if !looks_like_a_pattern(&source) {
        return Err(ResolveError::NoPattern { path });
    }
    let named = parse_pattern(&path.display().to_string(), &source).map_err(ResolveError::File)?;
    if named.pattern.layers() != layers {
        return Err(ResolveError::Layers { path, expected: layers, found: named.pattern.layers() });
    }
    Ok(named)
}

/// Whether a text says at least one of the things that a pattern file says, on a line of its own.
fn looks_like_a_pattern(source: &str) -> bool {
    states_any(source, &["layers", "segments"])
}

/// Reads and checks a pattern file.
///
/// # Errors
/// All faults of the file at once.
pub fn read_pattern(path: &Path) -> Result<NamedPattern, Faults> {
    let source = read_text(path)?;
    parse_pattern(&path.display().to_string(), &source)
}

/// As [`read_pattern`], of a text that was read already.
///
/// # Errors
/// All faults of the text at once.
pub fn parse_pattern(file: &str, source: &str) -> Result<NamedPattern, Faults> {
    let document = parse(file, source)?;
    let mut reader = TomlReader::new(file, source);
    let r = &mut reader;
    let mut root = r.root(&document);
    let name = root.needed_name(r, "name").map(str::to_owned);
    let layers = root.needed_integer(r, "layers", 2, 10_000);
    let segments = root.needed_integers(r, "segments");
    let segments_span = root.span_of("segments");
    let layers_span = root.span_of("layers");
    let [a, b] = ["end_a_turns", "end_b_turns"]
        .map(|key| root.integer(r, key, -MOST_END_TURNS, MOST_END_TURNS).unwrap_or(0) as i32);
    let ends_span = root.span_of("end_a_turns").or(root.span_of("end_b_turns"));
    root.finish(r);
    if let (Some(layers), Some(segments)) = (layers, &segments)
        && layers as usize != segments.len()
    {
        let message = format!("layers is {layers}, but segments lists {}: correct one of them", segments.len());
        r.fault(Fault::new(message, layers_span));
    }
    let pattern = segments.and_then(|stated| {
        let mut clean = true;
        for (i, (segment, span)) in stated.iter().enumerate() {
            let message = if *segment < 1 || *segment > stated.len() as i64 {
                format!("segment {segment} on layer {} is outside 1 … {}", i + 1, stated.len())
            } else if let Some(first) = stated[..i].iter().position(|(s, _)| s == segment) {
                format!(
                    "segment {segment} lies on layer {} and again on layer {}: each segment lies on exactly one layer",
                    first + 1,
                    i + 1
                )
            } else {
                continue;
            };
            clean = false;
            r.fault(Fault::new(message, span.clone()));
        }
        if !clean {
            return None;
        }
        let whole = Pattern::new(stated.into_iter().map(|(s, _)| s as usize).collect());
        let whole = whole.map_err(|error| (error, segments_span));
        let built = whole.and_then(|p| p.with_end_turns(EndTurns { a, b }).map_err(|error| (error, ends_span)));
        match built {
            Ok(pattern) => Some(pattern),
            Err((error, span)) => {
                r.fault(Fault::new(error.to_string(), span));
                None
            }
        }
    });
    let value = name.zip(pattern).map(|(name, pattern)| NamedPattern { name, pattern });
    reader.finish(value)
}

/// A pattern file's text; `comments` are written above it, one a line.
pub fn print_pattern(named: &NamedPattern, comments: &[TomlComment]) -> String {
    let mut document = toml_edit::DocumentMut::new();
    document["name"] = toml_edit::value(&named.name);
    document["layers"] = toml_edit::value(named.pattern.layers() as i64);
    let segments: toml_edit::Array = named.pattern.segments().iter().map(|&s| s as i64).collect();
    let mut segments = toml_edit::Value::from(segments);
    segments.decor_mut().set_suffix("   # innermost layer first");
    document["segments"] = toml_edit::Item::Value(segments);
    let EndTurns { a, b } = named.pattern.end_turns();
    for (key, turns) in [("end_a_turns", a), ("end_b_turns", b)] {
        if turns != 0 {
            document[key] = toml_edit::value(i64::from(turns));
        }
    }
    let head: String = comments.iter().map(|c| format!("# {c}\n")).collect();
    head + &document.to_string()
}
