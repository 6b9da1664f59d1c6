//! Campaigns: a grid of searches as a file, one result file a cell, and the table of them all.

use std::ops::Range;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::io::fault::{Fault, Faults};
use crate::io::files::{read_text, sha256_hex};
use crate::io::model::ModelFile;
use crate::pattern::windability::WindabilityClass;
use crate::search::cost::objective::Objective;

use super::model_file::parse_model;
use super::pattern_file::states_any;
use super::toml_reader::{TomlReader, parse};
use crate::io::table::Table;
use crate::text::sink;

/// A campaign file, understood: the grid is the product of its lists.
#[derive(Debug, Clone)]
pub struct CampaignFile {
    pub name: String,
    pub models: Vec<PathBuf>,
    /// Layer counts that stand in for the models' own; empty: as the models say.
    pub layers: Vec<usize>,
    pub classes: Vec<WindabilityClass>,
    pub objectives: Vec<Objective>,
    pub seeds: Vec<u64>,
    pub rounds: Option<u64>,
    pub moves_per_restart: Option<u64>,
}

/// One search of a campaign.
#[derive(Debug, Clone)]
pub struct Cell {
    pub file: ModelFile,
    pub class: WindabilityClass,
    pub objective: Objective,
    pub seed: u64,
}

/// What a cell found; its file depends on nothing but the cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CellJson {
    pub cell: usize,
    pub fingerprint: String,
    pub model: String,
    pub layers: usize,
    pub windability: String,
    pub objective: String,
    pub seed: u64,
    pub worst_rate_deg_per_h: f64,
    /// Null for the phase, which is no rate.
    pub objective_deg_per_h: Option<f64>,
    /// QUA's objective over the best pattern's.
    pub improvement_over_qua: Option<f64>,
    pub evaluations: u64,
    pub stopped_by: String,
    pub segments: Vec<usize>,
}

/// The answer of `campaign`.
#[derive(Debug, Serialize)]
pub struct CampaignJson {
    pub campaign: String,
    pub cells: usize,
    /// Searched by this call; the others of its shard were there already.
    pub searched: usize,
    /// Not there yet: of other shards, or interrupted.
    pub missing: usize,
    pub results: Vec<CellJson>,
}

/// Reads and checks a campaign file; model paths are relative to its folder.
///
/// # Errors
/// All faults of the file at once.
pub fn read_campaign(path: &Path) -> Result<CampaignFile, Faults> {
    parse_campaign(path, &read_text(path)?)
}

/// As [`read_campaign`], of a text that was read already.
///
/// # Errors
/// All faults of the text at once.
pub fn parse_campaign(path: &Path, source: &str) -> Result<CampaignFile, Faults> {
    let shown = path.display().to_string();
    let document = parse(&shown, source)?;
    let mut reader = TomlReader::new(&shown, source);
    let r = &mut reader;
    let mut root = r.root(&document);
    let name = root.needed_name(r, "name").map(str::to_owned);
    let models = root.needed_texts(r, "models", "an array of model files");
    let classes = if root.states("classes") { root.needed_texts(r, "classes", ARRAY_OF_STRINGS) } else { None };
    let objectives =
        if root.states("objectives") { root.needed_texts(r, "objectives", ARRAY_OF_STRINGS) } else { None };
    let layers = if root.states("layers") { root.needed_integers(r, "layers") } else { None };
    let seeds = if root.states("seeds") { root.needed_integers(r, "seeds") } else { None };
    let rounds = root.integer(r, "rounds", 1, 1_000_000);
    let moves_per_restart = root.integer(r, "moves_per_restart", 1, 1_000_000_000);
    let classes = match classes {
        None => vec![WindabilityClass::Standard],
        Some(stated) => understood(r, stated, WindabilityClass::parse, |word| {
            format!("classes: expected standard, captive:K or any, found \"{word}\"")
        }),
    };
    let objectives = match objectives {
        None => vec![Objective::WorstRate],
        Some(stated) => understood(r, stated, Objective::from_key, |word| {
            let keys: Vec<&str> = Objective::ALL.iter().map(|o| o.key()).collect();
            format!("objectives: expected one of {}, found \"{word}\"", keys.join(", "))
        }),
    };
    let mut whole_numbers = |key: &'static str, stated: Option<Vec<(i64, _)>>, least: i64| -> Vec<u64> {
        let numbers = stated.unwrap_or_default();
        for (number, span) in &numbers {
            if *number < least {
                r.fault(Fault::new(format!("{key}: expected at least {least}, found {number}"), Clone::clone(span)));
            }
        }
        numbers.into_iter().map(|(number, _)| number.max(0) as u64).collect()
    };
    let layers = whole_numbers("layers", layers, 2).into_iter().map(|n| n as usize).collect();
    let mut seeds = whole_numbers("seeds", seeds, 0);
    if seeds.is_empty() {
        seeds.push(1);
    }
    root.finish(r);
    let base = path.parent().unwrap_or(Path::new("."));
    let value = name.zip(models).map(|(name, models)| CampaignFile {
        name,
        models: models.into_iter().map(|(model, _)| base.join(model)).collect(),
        layers,
        classes,
        objectives,
        seeds,
        rounds: rounds.map(|n| n as u64),
        moves_per_restart: moves_per_restart.map(|n| n as u64),
    });
    reader.finish(value)
}

const ARRAY_OF_STRINGS: &str = "an array of strings";

/// Words with what they mean; a fault for each that means nothing.
fn understood<T>(
    reader: &mut TomlReader,
    stated: Vec<(String, Option<Range<usize>>)>,
    meaning: fn(&str) -> Option<T>,
    complaint: impl Fn(&str) -> String,
) -> Vec<T> {
    let mut known = Vec::with_capacity(stated.len());
    for (word, span) in stated {
        match meaning(&word) {
            Some(value) => known.push(value),
            None => reader.fault(Fault::new(complaint(&word), span)),
        }
    }
    known
}

impl CampaignFile {
    /// All cells in their order: models outermost, seeds innermost.
    ///
    /// # Errors
    /// The faults of a model file, also those that another layer count causes.
    pub fn cells(&self) -> Result<Vec<Cell>, Faults> {
        let mut cells = Vec::new();
        for path in &self.models {
            let source = read_text(path)?;
            // What is something else altogether is named, not shown: it may be any file of the system.
            if !looks_like_a_model(&source) {
                let message = "is no model file: expected TOML with name, fibre, winding and thermal";
                return Err(Faults::of_file(path.display().to_string(), message));
            }
            let files = if self.layers.is_empty() {
                vec![parse_model(path, &source)?]
            } else {
                let with = |&layers: &usize| parse_model(path, &with_layers(path, &source, layers)?);
                self.layers.iter().map(with).collect::<Result<_, _>>()?
            };
            for file in files {
                for &class in &self.classes {
                    for &objective in &self.objectives {
                        for &seed in &self.seeds {
                            cells.push(Cell { file: file.clone(), class, objective, seed });
                        }
                    }
                }
            }
        }
        Ok(cells)
    }

    /// What a cell's result must agree with to be kept.
    pub fn fingerprint(&self, cell: &Cell) -> String {
        sha256_hex(&format!(
            "{}\n{} {} {} {:?} {:?}",
            cell.file.source,
            cell.class,
            cell.objective.key(),
            cell.seed,
            self.rounds,
            self.moves_per_restart
        ))
    }
}

/// Whether a text says at least one of the things that only a model file says.
fn looks_like_a_model(source: &str) -> bool {
    states_any(source, &["fibre", "winding", "thermal"])
}

/// The model with another layer count; its own pattern would no longer fit.
fn with_layers(path: &Path, source: &str, layers: usize) -> Result<String, Faults> {
    parse(&path.display().to_string(), source)?;
    let mut document: toml_edit::DocumentMut =
        source.parse().map_err(|_| Faults::of_file(path.display().to_string(), "is no TOML"))?;
    if let Some(winding) = document.get_mut("winding").and_then(toml_edit::Item::as_table_like_mut) {
        winding.insert("layers", toml_edit::value(layers as i64));
        winding.remove("pattern");
    }
    Ok(document.to_string())
}

/// The place of a cell's result under a campaign's folder.
pub fn cell_path(folder: &Path, index: usize) -> PathBuf {
    folder.join("cells").join(format!("{:05}.json", index + 1))
}

/// A cell's result, if it is there and is of this cell.
pub fn read_cell(folder: &Path, index: usize, fingerprint: &str) -> Option<CellJson> {
    let text = std::fs::read_to_string(cell_path(folder, index)).ok()?;
    serde_json::from_str::<CellJson>(&text).ok().filter(|found| found.fingerprint == fingerprint)
}

/// The table of all cells.
pub fn summary_csv(results: &[CellJson]) -> Vec<u8> {
    let mut table = Table::with_header([
        "cell",
        "model",
        "layers",
        "class",
        "objective",
        "seed",
        "worst_rate_deg_per_h",
        "objective_deg_per_h",
        "improvement_over_qua",
        "evaluations",
        "segments",
    ]);
    for found in results {
        let segments: Vec<String> = found.segments.iter().map(ToString::to_string).collect();
        let cells = [
            found.cell.to_string(),
            found.model.clone(),
            found.layers.to_string(),
            found.windability.clone(),
            found.objective.clone(),
            found.seed.to_string(),
            found.worst_rate_deg_per_h.to_string(),
            found.objective_deg_per_h.map(|o| o.to_string()).unwrap_or_default(),
            found.improvement_over_qua.map(|f| f.to_string()).unwrap_or_default(),
            found.evaluations.to_string(),
            segments.join(" "),
        ];
        table.row(cells.iter().map(|text| sink::Cell::text(text)));
    }
    table.into_bytes()
}
