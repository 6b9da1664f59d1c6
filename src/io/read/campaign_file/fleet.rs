//! A fleet of gyros: which records, and for a diagnosis which model, belong to each.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::io::fault::{Fault, Faults};
use crate::io::files::sha256_hex;
use crate::io::json::inputs::RecordInputJson;
use crate::io::model::ModelFile;
use crate::io::read::model_file::parse_model;
use crate::io::read::record_columns::RecordFormat;
use crate::io::read::toml_reader::{Limits, TableReader, TomlReader};

use super::{ARRAY_OF_STRINGS, CampaignCell, CampaignKind, CellWork, id_of, model_text};

/// Gyros with their records, and how those are read.
#[derive(Debug, Clone)]
pub(crate) struct Fleet {
    gyros: Vec<Stated>,
    settings: Arc<FleetSettings>,
}

/// What holds for every gyro of a fleet.
#[derive(Debug, Clone)]
pub(crate) struct FleetSettings {
    /// Averaging time of the bias stability.
    pub(crate) average_s: f64,
    /// As `--columns` says it.
    pub(crate) columns: Option<String>,
    pub(crate) skips_bad_rows: bool,
    /// Forms and variables that formulas may be made of, as `--terms` says it; none for all.
    pub(crate) terms: Option<Vec<String>>,
}

/// A file as the campaign file names it, so that a result is the same wherever the campaign stands, and where it is.
#[derive(Debug, Clone)]
pub(crate) struct StatedFile {
    pub(crate) stated: String,
    pub(crate) path: PathBuf,
    /// None for what cannot be read twice.
    pub(crate) sha256: Option<String>,
}

#[derive(Debug, Clone)]
struct Stated {
    name: String,
    model: Option<StatedFile>,
    records: Vec<StatedFile>,
    holdout: Vec<StatedFile>,
}

/// One gyro of a fleet.
#[derive(Debug, Clone)]
pub(crate) struct Gyro {
    pub(crate) name: String,
    /// None where no model is asked about.
    pub(crate) file: Option<Arc<ModelFile>>,
    pub(crate) records: Vec<StatedFile>,
    /// Only judged by.
    pub(crate) holdout: Vec<StatedFile>,
    pub(crate) format: RecordFormat,
    pub(crate) settings: Arc<FleetSettings>,
}

/// As `metrics` does it.
const DEFAULT_AVERAGE_S: f64 = 10.0;

/// What the file says of a fleet; `with_model`: of each gyro a model is needed, its own or the fleet's.
pub(super) fn read(r: &mut TomlReader, root: &mut TableReader, base: &Path, with_model: bool) -> Option<Fleet> {
    let file = |stated: &str| StatedFile { stated: stated.to_owned(), path: base.join(stated), sha256: None };
    let columns = root.text(r, "columns").map(str::to_owned);
    if let Some(Err(message)) = columns.as_ref().map(|words| RecordFormat::default().map_all(words)) {
        r.fault(Fault::new(format!("columns: {message}"), root.span_of("columns")));
    }
    let skips_bad_rows = root.word(r, "bad_rows", &["refuse", "skip"]) == Some(1);
    let (mut average_s, mut terms, mut common) = (DEFAULT_AVERAGE_S, None, None);
    if with_model {
        common = root.text(r, "model").map(file);
        if root.states("terms") {
            terms = root.needed_texts(r, "terms", ARRAY_OF_STRINGS);
        }
    } else {
        average_s = root.number(r, "average_s", Limits::between(1e-6, 1e9)).unwrap_or(average_s);
    }
    let tables = root.tables(r, "gyro");
    if tables.is_empty() {
        r.fault(Fault::new("a fleet needs at least one [[gyro]] with name and records", None));
    }
    let mut gyros: Vec<Stated> = Vec::with_capacity(tables.len());
    for mut table in tables {
        let name = table.needed_name(r, "name").map(str::to_owned);
        let files = |stated: Option<Vec<(String, _)>>| -> Vec<StatedFile> {
            stated.into_iter().flatten().map(|(stated, _)| file(&stated)).collect()
        };
        let records = files(table.needed_texts(r, "records", "an array of record files"));
        let (mut model, mut holdout) = (None, Vec::new());
        if with_model {
            if table.states("holdout") {
                holdout = files(table.needed_texts(r, "holdout", "an array of record files"));
            }
            model = table.text(r, "model").map(file).or_else(|| common.clone());
            if model.is_none() {
                r.fault(Fault::new("a diagnosis needs a model: state model here or for the whole fleet", table.span()));
            }
        }
        let place = table.span_of("name");
        table.finish(r);
        let Some(name) = name else { continue };
        if gyros.iter().any(|known| known.name == name) {
            r.fault(Fault::new(format!("there are two gyros called \"{name}\""), place));
        }
        gyros.push(Stated { name, model, records, holdout });
    }
    let terms = terms.map(|words: Vec<(String, _)>| words.into_iter().map(|(word, _)| word).collect());
    Some(Fleet { gyros, settings: Arc::new(FleetSettings { average_s, columns, skips_bad_rows, terms }) })
}

impl Fleet {
    /// One cell a gyro, in their order.
    pub(super) fn cells(&self, with_model: bool) -> Result<Vec<CampaignCell>, Faults> {
        let mut models: BTreeMap<PathBuf, Arc<ModelFile>> = BTreeMap::new();
        let mut cells = Vec::with_capacity(self.gyros.len());
        for stated in &self.gyros {
            let file = match &stated.model {
                Some(model) if !models.contains_key(&model.path) => {
                    let mut file = parse_model(&model.path, &model_text(&model.path)?)?;
                    file.path = PathBuf::from(&model.stated);
                    Some(Arc::clone(models.entry(model.path.clone()).or_insert(Arc::new(file))))
                }
                Some(model) => models.get(&model.path).cloned(),
                None => None,
            };
            let gyro = Gyro {
                name: stated.name.clone(),
                records: known(&stated.records)?,
                holdout: known(&stated.holdout)?,
                format: self.format(file.as_deref())?,
                settings: Arc::clone(&self.settings),
                file,
            };
            cells.push(if with_model {
                CampaignCell { id: gyro.id(CampaignKind::DIAGNOSE), work: CellWork::Diagnose(gyro) }
            } else {
                CampaignCell { id: gyro.id(CampaignKind::METRICS), work: CellWork::Metrics(gyro) }
            });
        }
        Ok(cells)
    }

    /// As the model's `[record]` says, and over it as the campaign says.
    fn format(&self, model: Option<&ModelFile>) -> Result<RecordFormat, Faults> {
        let mut format = model.map_or_else(RecordFormat::default, |m| m.record.clone());
        if let Some(columns) = &self.settings.columns {
            format.map_all(columns).map_err(|message| Faults::of_file("columns", message))?;
        }
        format.skips_bad_rows |= self.settings.skips_bad_rows;
        Ok(format)
    }

    pub(super) fn inputs(&self) -> Vec<PathBuf> {
        let of = |gyro: &Stated| -> Vec<PathBuf> {
            let files = gyro.model.iter().chain(&gyro.records).chain(&gyro.holdout);
            files.map(|file| file.path.clone()).collect()
        };
        let mut files: Vec<PathBuf> = self.gyros.iter().flat_map(of).collect();
        files.sort();
        files.dedup();
        files
    }
}

/// The files with what is in them.
fn known(files: &[StatedFile]) -> Result<Vec<StatedFile>, Faults> {
    let read = |file: &StatedFile| -> Result<StatedFile, Faults> {
        let RecordInputJson { sha256, .. } = RecordInputJson::new(&file.path, "")?;
        Ok(StatedFile { sha256, ..file.clone() })
    };
    files.iter().map(read).collect()
}

impl Gyro {
    fn id(&self, kind: &str) -> String {
        let model = self.file.as_ref().map_or_else(String::new, |file| sha256_hex(&file.source));
        let files = |files: &[StatedFile]| -> Vec<(String, Option<String>)> {
            files.iter().map(|file| (file.stated.clone(), file.sha256.clone())).collect()
        };
        let (records, holdout) = (files(&self.records), files(&self.holdout));
        let Self { name, format, settings, .. } = self;
        let path = self.file.as_ref().map(|file| &file.path);
        id_of(kind, &model, &format!("{name:?} {path:?} {records:?} {holdout:?} {format:?} {settings:?}"))
    }
}
