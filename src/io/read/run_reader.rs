//! Reads the folder of a search back, for its report.

use std::path::Path;

use serde::Deserialize;

use crate::io::fault::{Fault, Faults};
use crate::io::files::read_text;
use crate::io::model::ModelFile;
use crate::io::table::rows_of_csv;

use super::model_file::parse_model;
use super::toml_reader::parse;

/// The parts of `summary.json` that a report shows.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(crate) struct RunSummary {
    pub(crate) model: String,
    pub(crate) objective: String,
    pub(crate) windability: String,
    pub(crate) seed: u64,
    pub(crate) best: RunPattern,
    pub(crate) baselines: Vec<RunPattern>,
    pub(crate) improvement_over_qua: Option<f64>,
    #[serde(default)]
    pub(crate) statement: String,
    #[serde(default)]
    pub(crate) recommendation: Option<RunRecommendation>,
    #[serde(default)]
    pub(crate) compared_with: Option<RunFormer>,
    pub(crate) proof: RunProof,
    pub(crate) evaluations: u64,
    #[serde(default)]
    pub(crate) rounds: u64,
    #[serde(default)]
    pub(crate) stopped_by: String,
    /// Of a search under temperatures from elsewhere.
    #[serde(default)]
    pub(crate) fields: Vec<RunField>,
}

/// A file of temperatures that a search ran under.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(crate) struct RunField {
    pub(crate) file: String,
    pub(crate) sha256: Option<String>,
    pub(crate) rows: usize,
    pub(crate) from_s: f64,
    pub(crate) to_s: f64,
    pub(crate) rates: String,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(crate) struct RunRecommendation {
    pub(crate) sentence: String,
    /// Empty where an older version wrote the summary.
    #[serde(default)]
    pub(crate) pattern: String,
    #[serde(default)]
    pub(crate) segments: Vec<usize>,
    #[serde(default)]
    pub(crate) reasons: Vec<String>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(crate) struct RunFormer {
    pub(crate) statement: String,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(crate) struct RunPattern {
    pub(crate) name: String,
    pub(crate) segments: Vec<usize>,
    pub(crate) worst_rate_deg_per_h: f64,
    pub(crate) worst_profile: String,
    pub(crate) worst_time_s: f64,
    pub(crate) guaranteed_worst_rate_deg_per_h: Option<f64>,
    /// Of the coils as built, where the search was over them.
    #[serde(default)]
    pub(crate) p95_rate_deg_per_h: Option<f64>,
    pub(crate) windability: RunWindability,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(crate) struct RunWindability {
    pub(crate) class: String,
    pub(crate) reels: usize,
    pub(crate) captive: usize,
    pub(crate) max_climb: usize,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(crate) struct RunProof {
    pub(crate) status: String,
    pub(crate) lower_bound_deg_per_h: Option<f64>,
}

/// One row of `history.csv`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(crate) struct HistoryRow {
    pub(crate) evaluations: u64,
    pub(crate) best_deg_per_h: f64,
}

/// A search's folder, read.
#[derive(Debug, Clone)]
pub(crate) struct Run {
    pub(crate) summary: RunSummary,
    pub(crate) history: Vec<HistoryRow>,
    pub(crate) run_toml: String,
    pub(crate) file: ModelFile,
    /// Where `pareto -o` wrote into the same folder.
    pub(crate) front: Option<Vec<FrontPoint>>,
}

/// A point of a searched front of error against winding effort.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(crate) struct FrontPoint {
    pub(crate) name: String,
    pub(crate) worst_rate_deg_per_h: f64,
    pub(crate) captive: usize,
    pub(crate) max_climb: usize,
}

/// # Errors
/// A folder that is none of a search, or in which a file is missing or damaged.
pub(crate) fn read_run(folder: &Path) -> Result<Run, Faults> {
    let summary_path = folder.join("summary.json");
    if !summary_path.is_file() {
        let message = "holds no summary.json: is it the folder that `coilwright optimise … -o DIR` wrote?";
        return Err(Faults::of_file(folder.display().to_string(), message));
    }
    let text = read_text(&summary_path)?;
    let summary: RunSummary = serde_json::from_str(&text).map_err(|error| {
        let message = format!("line {}: cannot be understood as a search's summary: {error}", error.line());
        Faults::one(summary_path.display().to_string(), &text, Fault::new(message, None))
    })?;
    let run_toml = read_text(&folder.join("run.toml"))?;
    let run = parse(&folder.join("run.toml").display().to_string(), &run_toml)?;
    // The model's own path places relative pattern files.
    let stated = run.get("model").and_then(|item| item.as_str()).unwrap_or("model.toml").to_owned();
    let source = read_text(&folder.join("model.toml"))?;
    let file = parse_model(Path::new(&stated), &source)?.for_search();
    let layers = file.model.coil.layers();
    for pattern in std::iter::once(&summary.best).chain(&summary.baselines) {
        if pattern.segments.len() != layers {
            let message =
                format!("pattern {} has {} layers and model.toml has {layers}", pattern.name, pattern.segments.len());
            return Err(Faults::of_file(summary_path.display().to_string(), message));
        }
    }
    let front_path = folder.join("pareto.csv");
    let front = if front_path.is_file() { Some(read_rows(&front_path)?) } else { None };
    Ok(Run { summary, history: read_rows(&folder.join("history.csv"))?, run_toml, file, front })
}

fn read_rows<T: serde::de::DeserializeOwned>(path: &Path) -> Result<Vec<T>, Faults> {
    let text = read_text(path)?;
    rows_of_csv(&text).map_err(|error| Faults::of_file(path.display().to_string(), error.to_string()))
}
