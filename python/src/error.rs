//! Errors of the library as exceptions of the package's one hierarchy, with the command line's words.

use coilwright::io::fault::Faults;
use coilwright::io::read::pattern_file::ResolveError;
use coilwright::task::TaskError;
use pyo3::prelude::*;

/// What `coilwright._errors.made` makes an exception of.
fn made(py: Python, kind: &str, message: String, faults: Option<&Faults>) -> PyErr {
    let fault_list: Vec<(String, Option<usize>, Option<String>)> = faults.map_or_else(Vec::new, |faults| {
        let line = |start: usize| faults.source.get(..start).map(|before| before.matches('\n').count() + 1);
        let told = |f: &coilwright::io::fault::Fault| {
            (f.message.clone(), f.span.as_ref().and_then(|s| line(s.start)), f.note.clone())
        };
        faults.faults.iter().map(told).collect()
    });
    let file = faults.map(|f| f.file.clone());
    let error = py
        .import("coilwright._errors")
        .and_then(|module| module.getattr("made"))
        .and_then(|make| make.call1((kind, message, file, fault_list)));
    match error {
        Ok(error) => PyErr::from_value(error),
        Err(error) => error,
    }
}

/// The exception for an error.
pub fn raised(py: Python, error: &TaskError) -> PyErr {
    let message = error.to_string().trim_end().to_owned();
    match error {
        TaskError::Faults(faults) | TaskError::Resolve(ResolveError::File(faults)) => {
            made(py, "file", message, Some(faults))
        }
        TaskError::Write(_) => made(py, "write", message, None),
        TaskError::Resolve(_)
        | TaskError::NoTolerance { .. }
        | TaskError::UnknownProfile { .. }
        | TaskError::UnknownEffect { .. }
        | TaskError::FormulaMissing
        | TaskError::ColumnsMissing { .. }
        | TaskError::PatternMissing
        | TaskError::Option { .. }
        | TaskError::Field { .. }
        | TaskError::Record(_)
        | TaskError::Formula(_)
        | TaskError::Effect(_)
        | TaskError::Custom(_) => made(py, "request", message, None),
        _ => made(py, "model", message, None),
    }
}

/// As [`raised`], for anything that becomes an error of a use case.
pub fn raise(py: Python, error: impl Into<TaskError>) -> PyErr {
    raised(py, &error.into())
}

/// A request that makes no sense, in words.
pub fn wrong(py: Python, message: impl Into<String>) -> PyErr {
    made(py, "request", message.into(), None)
}
