//! Built coils in blocks: how many of each model are drawn, and which of them a cell judges.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::io::fault::Faults;
use crate::io::model::{ModelFile, NamedPattern};
use crate::io::read::model_file::parse_model;
use crate::io::read::pattern_file::{ResolveError, resolve_pattern};
use crate::io::read::toml_reader::{Limits, TableReader, TomlReader};
use crate::pattern::classic::Classic;
use crate::search::cost::tolerance::ToleranceSpec;
use crate::units::rad_per_s_from_deg_per_h;

use super::{ARRAY_OF_STRINGS, CampaignCell, CampaignKind, CellWork, id_of, model_address, model_text, read_models};

/// Coils to draw of each model, in blocks.
#[derive(Debug, Clone)]
pub(crate) struct CoilStudy {
    pub(crate) models: Vec<PathBuf>,
    /// Windings' names or pattern files beside the campaign file; empty for the model's own. QUA always joins where it fits.
    pub(crate) patterns: Vec<String>,
    base: PathBuf,
    /// None for the model's own.
    pub(crate) samples: Option<u64>,
    pub(crate) seed: Option<u64>,
    pub(crate) limit_rad_per_s: Option<f64>,
    pub(crate) coils_per_cell: u64,
}

/// Some of the coils of one model, judged with each pattern.
#[derive(Debug, Clone)]
pub(crate) struct CoilBlock {
    pub(crate) file: Arc<ModelFile>,
    pub(crate) patterns: Arc<[NamedPattern]>,
    /// How much is built apart; its number of samples is that of the whole study.
    pub(crate) spec: Arc<ToleranceSpec>,
    /// Counted from 0.
    pub(crate) coils: Range<u64>,
}

/// A block of the 998 m coil takes about 20 s of one thread.
const COILS_PER_CELL: i64 = 10_000;

/// What the file says of a study.
pub(super) fn read(r: &mut TomlReader, root: &mut TableReader, base: &Path) -> Option<CoilStudy> {
    let models = read_models(r, root, base);
    let patterns = if root.states("patterns") { root.needed_texts(r, "patterns", ARRAY_OF_STRINGS) } else { None };
    let samples = root.integer(r, "samples", 2, 1_000_000_000);
    let coils_per_cell = root.integer(r, "coils_per_cell", 1, 1_000_000).unwrap_or(COILS_PER_CELL);
    let seed = root.integer(r, "seed", 0, i64::MAX);
    let limit = root.number(r, "limit_deg_per_h", Limits::between(1e-12, 1e9));
    models.map(|models| CoilStudy {
        models,
        patterns: patterns.unwrap_or_default().into_iter().map(|(pattern, _)| pattern).collect(),
        base: base.to_owned(),
        samples: samples.map(|n| n as u64),
        seed: seed.map(|n| n as u64),
        limit_rad_per_s: limit.map(rad_per_s_from_deg_per_h),
        coils_per_cell: coils_per_cell as u64,
    })
}

impl CoilStudy {
    /// The blocks of each model in their order.
    pub(super) fn cells(&self) -> Result<Vec<CampaignCell>, Faults> {
        let mut cells = Vec::new();
        for path in &self.models {
            let file = parse_model(path, &model_text(path)?)?.for_search();
            let patterns = self.patterns_of(path, &file)?;
            let Some(declared) = &file.tolerance else {
                let message = "has no [tolerance]: state how much what is built spreads";
                return Err(Faults::of_file(path.display().to_string(), message));
            };
            let spec = ToleranceSpec {
                samples: self.samples.unwrap_or(declared.samples as u64) as usize,
                seed: self.seed.unwrap_or(declared.seed),
                limit_rad_per_s: self.limit_rad_per_s.or(declared.limit_rad_per_s),
                ..declared.clone()
            };
            let address = model_address(&file.source, false);
            // A block is the same one however many follow it.
            let spreads = ToleranceSpec { samples: 0, ..spec.clone() };
            let (file, patterns, spec) = (Arc::new(file), Arc::from(patterns), Arc::new(spec));
            let all = spec.samples as u64;
            for first in (0..all).step_by(self.coils_per_cell as usize) {
                let coils = first..(first + self.coils_per_cell).min(all);
                let id = id_of(CampaignKind::TOLERANCE, &address, &format!("{spreads:?} {patterns:?} {coils:?}"));
                let (file, patterns, spec) = (Arc::clone(&file), Arc::clone(&patterns), Arc::clone(&spec));
                cells.push(CampaignCell { id, work: CellWork::Tolerance(CoilBlock { file, patterns, spec, coils }) });
            }
        }
        Ok(cells)
    }

    fn patterns_of(&self, path: &Path, file: &ModelFile) -> Result<Vec<NamedPattern>, Faults> {
        let layers = file.model.coil.layers();
        let resolved = |stated: &String| match resolve_pattern(stated, layers, Some(&self.base)) {
            Ok(named) => Ok(named),
            Err(ResolveError::File(faults)) => Err(faults),
            Err(other) => Err(Faults::of_file(path.display().to_string(), other.to_string())),
        };
        let mut named: Vec<NamedPattern> = if self.patterns.is_empty() {
            file.pattern.iter().cloned().collect()
        } else {
            self.patterns.iter().map(resolved).collect::<Result<_, _>>()?
        };
        // As `tolerance` does: what wins only on paper loses against it.
        if let Ok(pattern) = Classic::Qua.pattern(layers)
            && !named.iter().any(|n| n.pattern == pattern)
        {
            named.push(NamedPattern { name: Classic::Qua.key().to_owned(), pattern });
        }
        if named.is_empty() {
            let message = "states no pattern and QUA does not fit it: give patterns in the campaign file";
            return Err(Faults::of_file(path.display().to_string(), message));
        }
        Ok(named)
    }

    pub(super) fn inputs(&self) -> Vec<PathBuf> {
        let patterns = self.patterns.iter().map(|stated| self.base.join(stated)).filter(|path| path.is_file());
        self.models.iter().cloned().chain(patterns).collect()
    }
}
