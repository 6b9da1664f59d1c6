//! A grid of searches: the product of models, layer counts, classes, objectives and seeds.

use std::collections::BTreeSet;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::io::fault::{Fault, Faults};
use crate::io::model::ModelFile;
use crate::io::read::model_file::parse_model;
use crate::io::read::toml_reader::{TableReader, TomlReader, parse};
use crate::pattern::windability::WindabilityClass;
use crate::search::cost::objective::Objective;

use super::{ARRAY_OF_STRINGS, CampaignCell, CampaignKind, CellWork, id_of, model_address, model_text, read_models};

/// A grid of searches.
#[derive(Debug, Clone)]
pub(crate) struct SearchGrid {
    pub(crate) models: Vec<PathBuf>,
    /// Layer counts that stand in for the models' own; empty: as the models say.
    pub(crate) layers: Vec<usize>,
    pub(crate) classes: Vec<WindabilityClass>,
    pub(crate) objectives: Vec<Objective>,
    pub(crate) seeds: Vec<u64>,
    pub(crate) rounds: Option<u64>,
    pub(crate) moves_per_restart: Option<u64>,
}

/// One search of a grid.
#[derive(Debug, Clone)]
pub(crate) struct GridSearch {
    pub(crate) file: Arc<ModelFile>,
    pub(crate) class: WindabilityClass,
    pub(crate) objective: Objective,
    pub(crate) seed: u64,
}

/// What the file says of a grid.
pub(super) fn read(r: &mut TomlReader, root: &mut TableReader, base: &Path) -> Option<SearchGrid> {
    let models = read_models(r, root, base);
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
    models.map(|models| SearchGrid {
        models,
        layers,
        classes,
        objectives,
        seeds,
        rounds: rounds.map(|n| n as u64),
        moves_per_restart: moves_per_restart.map(|n| n as u64),
    })
}

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

impl SearchGrid {
    /// All cells in their order: models outermost, seeds innermost. A search that the grid holds twice is one cell.
    ///
    /// # Errors
    /// The faults of a model file, also those that another layer count causes.
    pub(super) fn cells(&self) -> Result<Vec<CampaignCell>, Faults> {
        let mut cells = Vec::new();
        let mut seen = BTreeSet::new();
        for path in &self.models {
            let source = model_text(path)?;
            let files = if self.layers.is_empty() {
                vec![parse_model(path, &source)?.for_search()]
            } else {
                let with = |&layers: &usize| {
                    parse_model(path, &with_layers(path, &source, layers)?).map(ModelFile::for_search)
                };
                self.layers.iter().map(with).collect::<Result<_, _>>()?
            };
            for file in files {
                if file.tolerance.is_none() && self.objectives.contains(&Objective::P95) {
                    let message =
                        "has no [tolerance], which the objective p95 needs: state how much what is built spreads";
                    return Err(Faults::of_file(path.display().to_string(), message));
                }
                self.append_cells(Arc::new(file), &mut seen, &mut cells);
            }
        }
        Ok(cells)
    }

    fn append_cells(&self, file: Arc<ModelFile>, seen: &mut BTreeSet<String>, cells: &mut Vec<CampaignCell>) {
        let addresses = [false, true].map(|with_tolerance| model_address(&file.source, with_tolerance));
        for &class in &self.classes {
            for &objective in &self.objectives {
                for &seed in &self.seeds {
                    let settings =
                        format!("{class} {} {seed} {:?} {:?}", objective.key(), self.rounds, self.moves_per_restart);
                    let model = &addresses[usize::from(objective == Objective::P95)];
                    let id = id_of(CampaignKind::SEARCH, model, &settings);
                    if seen.insert(id.clone()) {
                        let search = GridSearch { file: Arc::clone(&file), class, objective, seed };
                        cells.push(CampaignCell { id, work: CellWork::Search(search) });
                    }
                }
            }
        }
    }
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
