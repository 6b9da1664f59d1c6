//! Campaign files: a grid of searches, and its cells with their identifiers.

use std::collections::BTreeSet;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::io::fault::{Fault, Faults};
use crate::io::files::{read_text, sha256_hex};
use crate::io::model::ModelFile;
use crate::pattern::windability::WindabilityClass;
use crate::search::cost::objective::Objective;

use super::model_file::parse_model;
use super::pattern_file::states_any;
use super::toml_reader::{TomlReader, parse};

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
    /// What the search depends on, as [`ID_DIGITS`] hexadecimal digits: the model as far as it matters, the settings, and the program's
    /// version. What has changed nothing here need not be searched again.
    pub id: String,
    pub file: Arc<ModelFile>,
    pub class: WindabilityClass,
    pub objective: Objective,
    pub seed: u64,
}

/// Digits of an identifier: among a million cells two agree with a probability below 1e-7.
pub const ID_DIGITS: usize = 16;

/// The only kind of cell so far.
pub const KIND: &str = "search";

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
    /// All cells in their order: models outermost, seeds innermost. A search that the grid holds twice is one cell.
    ///
    /// # Errors
    /// The faults of a model file, also those that another layer count causes.
    pub fn cells(&self) -> Result<Vec<Cell>, Faults> {
        let mut cells = Vec::new();
        let mut seen = BTreeSet::new();
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

    fn append_cells(&self, file: Arc<ModelFile>, seen: &mut BTreeSet<String>, cells: &mut Vec<Cell>) {
        let addresses = [false, true].map(|with_tolerance| model_address(&file.source, with_tolerance));
        for &class in &self.classes {
            for &objective in &self.objectives {
                for &seed in &self.seeds {
                    let settings =
                        format!("{class} {} {seed} {:?} {:?}", objective.key(), self.rounds, self.moves_per_restart);
                    let model = &addresses[usize::from(objective == Objective::P95)];
                    let id = sha256_hex(&format!("{}\n{KIND}\n{model}\n{settings}", env!("CARGO_PKG_VERSION")));
                    let id = id[..ID_DIGITS].to_owned();
                    if seen.insert(id.clone()) {
                        cells.push(Cell { id, file: Arc::clone(&file), class, objective, seed });
                    }
                }
            }
        }
    }
}

/// SHA-256 of what a search reads of a model file, whatever its layout, comments and order of keys. The cell states the search,
/// the production is for the shop floor, and the model's own pattern is not searched from.
fn model_address(source: &str, with_tolerance: bool) -> String {
    // The text was understood as a model before.
    let mut model: serde_json::Value = toml_edit::de::from_str(source).unwrap_or_default();
    if let Some(tables) = model.as_object_mut() {
        let unread: &[&str] = if with_tolerance { &UNREAD } else { &[&UNREAD[..], &["tolerance"]].concat() };
        tables.retain(|name, _| !unread.contains(&name.as_str()));
        if let Some(winding) = tables.get_mut("winding").and_then(serde_json::Value::as_object_mut) {
            winding.remove("pattern");
        }
    }
    model.sort_all_objects();
    sha256_hex(&model.to_string())
}

/// Tables of a model file that no cell depends on.
const UNREAD: [&str; 3] = ["search", "production", "record"];

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

#[cfg(test)]
mod tests {
    use super::*;

    const MODEL: &str = "name = \"m\"\n[fibre]\nrefractive_index = 1.45\n[winding]\nlayers = 8\npattern = \"qua\"\n[tolerance]\nsamples = 8\n[search]\nseed = 1\n";

    #[test]
    fn what_a_search_does_not_read_leaves_the_address_and_anything_else_changes_it() {
        let address = |source: &str| model_address(source, false);
        let same = [
            "# a comment\n".to_owned() + MODEL,
            MODEL.replace("seed = 1", "seed = 2"),
            MODEL.replace("pattern = \"qua\"\n", ""),
            MODEL.replace("samples = 8", "samples = 9"),
            MODEL.replace("layers = 8\npattern = \"qua\"", "pattern = \"dip\"\nlayers  =  8"),
            MODEL.to_owned() + "[production]\nspool = \"x\"\n",
        ];
        for source in same {
            assert_eq!(address(&source), address(MODEL), "{source}");
        }
        for source in
            [MODEL.replace("1.45", "1.46"), MODEL.replace("\"m\"", "\"n\""), MODEL.to_owned() + "[sensor]\nx = 1\n"]
        {
            assert_ne!(address(&source), address(MODEL), "{source}");
        }
        let built = |source: &str| model_address(source, true);
        assert_ne!(built(MODEL), built(&MODEL.replace("samples = 8", "samples = 9")));
    }
}
