//! Use cases: what the program is asked for. Each has a `Request`, an `Answer` with the document that the program prints, and a
//! `run` that an [`Observer`] watches; the faces (command line, Python) parse, call and show.
//!
//! The search's own is [`crate::search::run()`].

pub mod campaign;
pub mod compare;
pub mod compensate;
pub mod evaluate;
pub mod exact;
pub mod explore;
pub mod field;
mod leave_one_out;
pub mod measurement;
pub mod metrics;
pub mod optimise;
pub mod pareto;
pub mod schedule;
pub(crate) mod stress;
pub mod temperatures;
pub mod tolerance;
pub mod trim;
pub(crate) mod under_fields;

// They leave pages, pictures and words that pages share.
#[cfg(feature = "report")]
pub mod diagnose;
#[cfg(feature = "report")]
pub mod explore_page;
#[cfg(feature = "report")]
pub mod extend;
#[cfg(feature = "report")]
pub mod improve;
#[cfg(feature = "report")]
pub mod page;
#[cfg(feature = "report")]
pub mod proposal;
#[cfg(feature = "report")]
mod remarks;
#[cfg(feature = "report")]
pub mod reproduce;
#[cfg(feature = "report")]
mod steps;
#[cfg(feature = "report")]
mod under_fields_folder;
#[cfg(feature = "report")]
pub mod verify;

use thiserror::Error;

use crate::compensate::CompensateError;
use crate::diagnose::DiagnoseError;
use crate::effect::EffectError;
use crate::effect::custom::FormulaError;
use crate::io::fault::Faults;
use crate::io::files::WriteError;
use crate::io::model::{ModelFile, NamedPattern};
use crate::io::read::pattern_file::ResolveError;
use crate::metrics::MetricsError;
use crate::pattern::classic::Classic;
use crate::predict::PredictError;
use crate::rate::RateError;
use crate::record::RecordError;
use crate::search::cost::guaranteed::GuaranteedError;
use crate::search::cost::tolerance::ToleranceError;
use crate::search::cost::worst_case::SearchError;
use crate::search::custom::CustomError;
use crate::search::evaluator::JudgeError;
use crate::search::run::RunError;

/// Told how a use case goes. Every method's default is to let it go on unseen.
pub trait Observer: Sync {
    /// Something that a reader of the answer should know, in one line.
    fn note(&self, _words: &str) {}

    /// From time to time: the share that is done, and where the work stands.
    fn at(&self, _share_done: f64, _words: &str) {}

    /// Whether the work may go on.
    fn goes_on(&self) -> bool {
        true
    }
}

/// Lets everything go on to its end.
#[derive(Debug, Clone, Copy, Default)]
pub struct Unobserved;

impl Observer for Unobserved {}

/// Why a request cannot be answered.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "its messages say what each means")]
#[non_exhaustive]
pub enum TaskError {
    #[error(transparent)]
    Faults(#[from] Faults),
    #[error(transparent)]
    Write(#[from] WriteError),
    #[error(transparent)]
    Resolve(#[from] ResolveError),
    #[error(transparent)]
    Search(#[from] SearchError),
    #[error(transparent)]
    Guaranteed(#[from] GuaranteedError),
    #[error(transparent)]
    Rate(#[from] RateError),
    #[error(transparent)]
    Predict(#[from] PredictError),
    #[error(transparent)]
    Tolerance(#[from] ToleranceError),
    #[error(transparent)]
    Judge(#[from] JudgeError),
    #[error(transparent)]
    Run(#[from] RunError),
    #[error(transparent)]
    Custom(#[from] CustomError),
    #[error(transparent)]
    Compensate(#[from] CompensateError),
    #[error(transparent)]
    Metrics(#[from] MetricsError),
    #[error(transparent)]
    Record(#[from] RecordError),
    #[error(transparent)]
    Diagnose(#[from] DiagnoseError),
    #[error(transparent)]
    Formula(#[from] FormulaError),
    #[error(transparent)]
    Effect(#[from] EffectError),
    #[cfg(feature = "report")]
    #[error(transparent)]
    Report(#[from] crate::report::search_run::ReportError),
    #[error("{path} has no [tolerance]: state at least one spread there, such as turns_per_layer_sd = 0.3")]
    NoTolerance { path: String },
    #[error(
        "{path} has no [materials]: state there what fibre, adhesive and spool are made of; `coilwright materials` lists what there is"
    )]
    NoMaterials { path: String },
    #[error("the model has no profile called \"{stated}\": its profiles are {known}")]
    UnknownProfile { stated: String, known: String },
    #[error(
        "there is no effect {stated}: {}`coilwright effects` lists all",
        .nearest.map_or_else(String::new, |nearest| format!("did you mean {nearest}? "))
    )]
    UnknownEffect { stated: String, nearest: Option<&'static str> },
    #[error("{stated} is no effect: {place}")]
    SetElsewhere { stated: String, place: &'static str },
    #[error("--effect custom needs --formula: give a formula in t, T, dT_dt, T_inner, mean rate or further columns")]
    FormulaMissing,
    #[error("{file}: the model's effects read {}, which the record lacks: add the columns or leave the effects out", .columns.join(", "))]
    ColumnsMissing { file: String, columns: Vec<String> },
    #[error("no pattern is stated: give --pattern, or winding.pattern in the model file")]
    PatternMissing,
    #[error("{option}: {message}")]
    Option { option: &'static str, message: String },
    #[error("the temperature field does not fit: {message}")]
    Field { message: String },
    #[error(
        "methods are tried on a record that they were not fitted to: give one, or several to fit to, of which each is left out in turn"
    )]
    NoHoldout,
    #[error("the answer cannot be written down: {0}")]
    Unprintable(String),
}

impl TaskError {
    /// Whether it is shown as several lines of its own making, with the source lines drawn.
    pub(crate) fn is_drawn(&self) -> bool {
        matches!(self, TaskError::Faults(_) | TaskError::Resolve(ResolveError::File(_)))
    }
}

impl From<serde_json::Error> for TaskError {
    fn from(error: serde_json::Error) -> Self {
        TaskError::Unprintable(error.to_string())
    }
}

/// The pattern that was asked for, else the model's own.
///
/// # Errors
/// Neither is there.
pub(crate) fn pattern_or_own(model: &ModelFile, stated: Option<&NamedPattern>) -> Result<NamedPattern, TaskError> {
    stated.or(model.pattern.as_ref()).cloned().ok_or(TaskError::PatternMissing)
}

/// The model's own pattern first, unless it is a classic anyway; then the classics that fit.
pub(crate) fn own_and_classics(file: &ModelFile) -> Vec<NamedPattern> {
    let layers = file.model.coil.layers();
    let classics = Classic::ALL.into_iter().filter_map(|classic| {
        let pattern = classic.pattern(layers).ok()?;
        Some(NamedPattern { name: classic.key().to_owned(), pattern })
    });
    let own = file.pattern.iter().filter(|named| Classic::from_key(&named.name).is_err()).cloned();
    own.chain(classics).collect()
}

/// What a model file advises, said.
fn advise(model: &ModelFile, observer: &dyn Observer) {
    for advice in &model.advice {
        observer.note(&format!("note: {advice}"));
    }
}
