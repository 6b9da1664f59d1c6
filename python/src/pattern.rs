//! Winding patterns: checked, named, wound, read and written.

use std::path::PathBuf;

use coilwright::io::files::write_atomically;
use coilwright::io::json::{ClassicJson, WindabilityJson};
use coilwright::io::model::NamedPattern;
use coilwright::io::read::pattern_file;
use coilwright::io::read::pattern_file::resolve_pattern;
use coilwright::pattern::EndTurns;
use coilwright::pattern::windability::WindingGraph;
use coilwright::text::sink::TomlComment;
use coilwright::{Classic, Pattern};
use pyo3::prelude::*;

use crate::error::{raise, wrong};
use crate::tasks::json;

/// A pattern as an argument: a winding's name or a pattern file, or a name with segments and the turns more or fewer at the ends.
#[derive(Debug, FromPyObject)]
pub enum PatternArgument {
    Given(String, Vec<usize>, (i32, i32)),
    Stated(String),
}

impl PatternArgument {
    /// The pattern file, if it is one.
    pub fn file(&self) -> Option<PathBuf> {
        match self {
            PatternArgument::Stated(stated) => pattern_file::file_of_pattern(stated, None),
            PatternArgument::Given(..) => None,
        }
    }

    pub fn named(&self, py: Python, layers: usize) -> PyResult<NamedPattern> {
        match self {
            PatternArgument::Stated(stated) => resolve_pattern(stated, layers, None).map_err(|e| raise(py, e)),
            PatternArgument::Given(name, segments, end_turns) => {
                let pattern = checked(py, segments.clone(), *end_turns)?;
                if pattern.layers() != layers {
                    let found = pattern.layers();
                    return Err(wrong(
                        py,
                        format!("the pattern {name} has {found} layers where the coil has {layers}"),
                    ));
                }
                Ok(NamedPattern { name: name.clone(), pattern })
            }
        }
    }
}

/// All of them.
pub fn all_named(py: Python, stated: &[PatternArgument], layers: usize) -> PyResult<Vec<NamedPattern>> {
    stated.iter().map(|one| one.named(py, layers)).collect()
}

fn checked(py: Python, segments: Vec<usize>, (a, b): (i32, i32)) -> PyResult<Pattern> {
    let whole = Pattern::new(segments);
    whole.and_then(|whole| whole.with_end_turns(EndTurns { a, b })).map_err(|e| wrong(py, e.to_string()))
}

fn ends_of(pattern: &Pattern) -> (i32, i32) {
    let EndTurns { a, b } = pattern.end_turns();
    (a, b)
}

#[pyfunction]
pub fn check_pattern(py: Python, segments: Vec<usize>, end_turns: (i32, i32)) -> PyResult<()> {
    checked(py, segments, end_turns).map(|_| ())
}

#[pyfunction]
pub fn classic(py: Python, name: &str, layers: usize) -> PyResult<Vec<usize>> {
    let named = Classic::from_key(name).and_then(|classic| classic.pattern(layers));
    named.map(|pattern| pattern.segments().to_vec()).map_err(|e| wrong(py, e.to_string()))
}

/// The classics that fit, as the command `patterns` lists them.
#[pyfunction]
pub fn classics(py: Python, layers: usize) -> PyResult<String> {
    let fitting = Classic::ALL.into_iter().filter_map(|classic| {
        let pattern = classic.pattern(layers).ok()?;
        Some(ClassicJson {
            name: classic.key().to_owned(),
            title: classic.title().to_owned(),
            layers,
            segments: pattern.segments().to_vec(),
            windability: WindabilityJson::of(&pattern),
        })
    });
    json(py, &coilwright::io::json::PatternsJson { patterns: fitting.collect() })
}

#[pyfunction]
pub fn windability(py: Python, segments: Vec<usize>, end_turns: (i32, i32)) -> PyResult<String> {
    json(py, &WindabilityJson::of(&checked(py, segments, end_turns)?))
}

type Step = (usize, usize, usize, Option<usize>, Option<usize>);

/// The winding step by step: reels, captive runs, climb, and the layers that the segment's ends are joined to; and in words the
/// first run that is captive.
#[pyfunction]
pub fn winding_graph(py: Python, segments: Vec<usize>, end_turns: (i32, i32)) -> PyResult<(Vec<Step>, Option<String>)> {
    let graph = WindingGraph::new(&checked(py, segments, end_turns)?);
    let steps = graph.steps().into_iter().map(|s| (s.reels, s.captive, s.climb, s.joined_low, s.joined_high)).collect();
    Ok((steps, graph.first_captive_run().map(|run| run.to_string())))
}

#[pyfunction]
pub fn read_pattern(py: Python, path: PathBuf) -> PyResult<(String, Vec<usize>, (i32, i32))> {
    let named = pattern_file::read_pattern(&path).map_err(|e| raise(py, e))?;
    Ok((named.name, named.pattern.segments().to_vec(), ends_of(&named.pattern)))
}

#[pyfunction]
pub fn print_pattern(
    py: Python,
    path: PathBuf,
    name: String,
    segments: Vec<usize>,
    end_turns: (i32, i32),
    comments: Vec<String>,
) -> PyResult<()> {
    let named = NamedPattern { name, pattern: checked(py, segments, end_turns)? };
    let comments: Vec<TomlComment> = comments.iter().map(TomlComment::of).collect();
    let text = pattern_file::print_pattern(&named, &comments);
    write_atomically(&path, text.as_bytes()).map_err(|e| raise(py, e))
}
