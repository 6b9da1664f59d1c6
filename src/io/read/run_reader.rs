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
pub struct RunSummary {
    pub model: String,
    pub objective: String,
    pub windability: String,
    pub seed: u64,
    pub best: RunPattern,
    pub baselines: Vec<RunPattern>,
    pub improvement_over_qua: Option<f64>,
    #[serde(default)]
    pub statement: String,
    #[serde(default)]
    pub recommendation: Option<RunRecommendation>,
    #[serde(default)]
    pub compared_with: Option<RunFormer>,
    pub proof: RunProof,
    pub evaluations: u64,
    #[serde(default)]
    pub rounds: u64,
    #[serde(default)]
    pub stopped_by: String,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct RunRecommendation {
    pub sentence: String,
    /// Empty where an older version wrote the summary.
    #[serde(default)]
    pub pattern: String,
    #[serde(default)]
    pub segments: Vec<usize>,
    #[serde(default)]
    pub reasons: Vec<String>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct RunFormer {
    pub statement: String,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct RunPattern {
    pub name: String,
    pub segments: Vec<usize>,
    pub worst_rate_deg_per_h: f64,
    pub worst_profile: String,
    pub worst_time_s: f64,
    pub guaranteed_worst_rate_deg_per_h: Option<f64>,
    /// Of the coils as built, where the search was over them.
    #[serde(default)]
    pub p95_rate_deg_per_h: Option<f64>,
    pub windability: RunWindability,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct RunWindability {
    pub class: String,
    pub reels: usize,
    pub captive: usize,
    pub max_climb: usize,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct RunProof {
    pub status: String,
    pub lower_bound_deg_per_h: Option<f64>,
}

/// One row of `history.csv`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct HistoryRow {
    pub evaluations: u64,
    pub best_deg_per_h: f64,
}

/// A search's folder, read.
#[derive(Debug, Clone)]
pub struct Run {
    pub summary: RunSummary,
    pub history: Vec<HistoryRow>,
    pub run_toml: String,
    pub file: ModelFile,
    /// Where `pareto -o` wrote into the same folder.
    pub front: Option<Vec<FrontPoint>>,
}

/// A point of a searched front of error against winding effort.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct FrontPoint {
    pub name: String,
    pub worst_rate_deg_per_h: f64,
    pub captive: usize,
    pub max_climb: usize,
}

/// # Errors
/// A folder that is none of a search, or in which a file is missing or damaged.
pub fn read_run(folder: &Path) -> Result<Run, Faults> {
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
