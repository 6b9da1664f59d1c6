//! Campaign files: what is to be computed on many machines, and its cells with their identifiers.

use std::path::{Path, PathBuf};

use crate::io::fault::Faults;
use crate::io::files::{read_text, sha256_hex};
use crate::io::json::campaign::KINDS;

use super::kind_of_file::{FileKind, states_any};
use super::model_file::looks_like_a_record;
use super::toml_reader::{TableReader, TomlReader, parse};

pub(crate) mod coils;
pub(crate) mod fleet;
pub(crate) mod grid;

use coils::{CoilBlock, CoilStudy};
use fleet::{Fleet, Gyro};
use grid::{GridSearch, SearchGrid};

/// A campaign file, understood.
#[derive(Debug, Clone)]
pub struct CampaignFile {
    pub(crate) name: String,
    pub(crate) kind: CampaignKind,
}

/// What its cells are.
#[derive(Debug, Clone)]
pub(crate) enum CampaignKind {
    /// Searches, the product of lists.
    Search(SearchGrid),
    /// Blocks of built coils.
    Tolerance(CoilStudy),
    /// The data sheet of each gyro of a fleet.
    Metrics(Fleet),
    /// The diagnosis of each gyro of a fleet.
    Diagnose(Fleet),
}

impl CampaignKind {
    pub(crate) const SEARCH: &'static str = KINDS[0];
    pub(crate) const TOLERANCE: &'static str = KINDS[1];
    pub(crate) const METRICS: &'static str = KINDS[2];
    pub(crate) const DIAGNOSE: &'static str = KINDS[3];

    pub(crate) fn key(&self) -> &'static str {
        match self {
            CampaignKind::Search(_) => Self::SEARCH,
            CampaignKind::Tolerance(_) => Self::TOLERANCE,
            CampaignKind::Metrics(_) => Self::METRICS,
            CampaignKind::Diagnose(_) => Self::DIAGNOSE,
        }
    }
}

/// One piece of a campaign that is computed by itself.
#[derive(Debug, Clone)]
pub struct CampaignCell {
    /// What the result depends on, as [`ID_DIGITS`] hexadecimal digits: models and records as far as they matter, the settings, and
    /// the program's version. What has changed nothing here need not be computed again.
    pub id: String,
    pub(crate) work: CellWork,
}

#[derive(Debug, Clone)]
pub(crate) enum CellWork {
    Search(GridSearch),
    Tolerance(CoilBlock),
    Metrics(Gyro),
    Diagnose(Gyro),
}

/// Digits of an identifier: among a million cells two agree with a probability below 1e-7.
pub(crate) const ID_DIGITS: usize = 16;

/// Reads and checks a campaign file; paths in it are relative to its folder.
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
    let document = parse(&shown, source).map_err(|faults| match looks_like_a_record(source) {
        true => {
            Faults::of_file(&shown, "is a table of rows, no campaign file: a campaign names its records under [[gyro]]")
        }
        false => faults,
    })?;
    FileKind::Campaign.check(&shown, source)?;
    let mut reader = TomlReader::new(&shown, source);
    let r = &mut reader;
    let mut root = r.root(&document);
    let base = path.parent().unwrap_or(Path::new("."));
    let name = root.needed_name(r, "name").map(str::to_owned);
    let kind = match root.word(r, "kind", &KINDS).map_or(CampaignKind::SEARCH, |place| KINDS[place]) {
        CampaignKind::TOLERANCE => coils::read(r, &mut root, base).map(CampaignKind::Tolerance),
        CampaignKind::METRICS => fleet::read(r, &mut root, base, false).map(CampaignKind::Metrics),
        CampaignKind::DIAGNOSE => fleet::read(r, &mut root, base, true).map(CampaignKind::Diagnose),
        _ => grid::read(r, &mut root, base).map(CampaignKind::Search),
    };
    root.finish(r);
    let value = name.zip(kind).map(|(name, kind)| CampaignFile { name, kind });
    reader.finish(value)
}

const ARRAY_OF_STRINGS: &str = "an array of strings";

fn read_models(r: &mut TomlReader, root: &mut TableReader, base: &Path) -> Option<Vec<PathBuf>> {
    let stated = root.needed_texts(r, "models", "an array of model files")?;
    Some(stated.into_iter().map(|(model, _)| base.join(model)).collect())
}

impl CampaignFile {
    /// All cells in their order.
    ///
    /// # Errors
    /// The faults of a model or pattern file, a record that cannot be read.
    pub fn cells(&self) -> Result<Vec<CampaignCell>, Faults> {
        match &self.kind {
            CampaignKind::Search(grid) => grid.cells(),
            CampaignKind::Tolerance(study) => study.cells(),
            CampaignKind::Metrics(fleet) => fleet.cells(false),
            CampaignKind::Diagnose(fleet) => fleet.cells(true),
        }
    }

    /// The files that the cells are made from.
    pub fn inputs(&self) -> Vec<PathBuf> {
        match &self.kind {
            CampaignKind::Search(grid) => grid.models.clone(),
            CampaignKind::Tolerance(study) => study.inputs(),
            CampaignKind::Metrics(fleet) | CampaignKind::Diagnose(fleet) => fleet.inputs(),
        }
    }
}

/// The identifier of a cell.
fn id_of(kind: &str, model: &str, settings: &str) -> String {
    let id = sha256_hex(&format!("{}\n{kind}\n{model}\n{settings}", env!("CARGO_PKG_VERSION")));
    id[..ID_DIGITS].to_owned()
}

/// The text of a model file. What is something else altogether is named, not shown: it may be any file of the system.
fn model_text(path: &Path) -> Result<String, Faults> {
    let source = read_text(path)?;
    if !states_any(&source, &["fibre", "winding", "thermal"]) {
        let message = "is no model file: expected TOML with name, fibre, winding and thermal";
        return Err(Faults::of_file(path.display().to_string(), message));
    }
    Ok(source)
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
