//! A campaign's blocks of built coils: what each costs, what is drawn in one, and all of them together.

use std::path::Path;

use crate::io::json::built_coils::{Blocks, BuiltCoilsJson};
use crate::io::json::campaign::{BlockJson, BlockPatternJson};
use crate::io::read::campaign_file::coils::CoilBlock;
use crate::io::read::campaign_file::{CampaignCell, CampaignKind};
use crate::io::write::campaign_cells::read_cell;
use crate::numeric::quantiles::QuantileSketch;
use crate::pattern::Pattern;
use crate::search::cost::tolerance::{Coils, Measure, ToleranceError};
use crate::units::deg_per_h_from_rad_per_s;

/// Seconds of one thread for a coil and layer: 1.7 ms for the 40 layers of the 998 m coil, whose field is solved anew for each.
const COIL_S: f64 = 4e-5;

pub(super) fn estimated_s(block: &CoilBlock) -> f64 {
    (block.coils.end - block.coils.start) as f64 * block.file.model.coil.layers() as f64 * COIL_S
}

/// The worst cases of one block's coils. What a model itself does not permit is a result as well: the block's failure.
pub(crate) fn judge_block(id: &str, block: &CoilBlock) -> BlockJson {
    match judged(block) {
        Ok((measure, patterns)) => BlockJson { measure, patterns, ..nothing(id, block) },
        Err(failure) => BlockJson { failure: Some(failure), ..nothing(id, block) },
    }
}

fn judged(block: &CoilBlock) -> Result<(String, Vec<BlockPatternJson>), String> {
    let in_words = |error: ToleranceError| error.to_string();
    let file = &block.file;
    let patterns: Vec<Pattern> = block.patterns.iter().map(|named| named.pattern.clone()).collect();
    let coils = Coils::among(&file.model, &file.profiles, &block.spec, block.coils.clone()).map_err(in_words)?;
    let nominal = coils.nominal_rad_per_s(&patterns).map_err(|error| in_words(error.into()))?;
    let worst = coils.worst_rad_per_s(&patterns).map_err(|error| in_words(error.into()))?;
    let of = |(place, named): (usize, &crate::io::model::NamedPattern)| {
        let values: Vec<f64> = worst.iter().map(|coil| coil[place]).collect();
        let sketch =
            QuantileSketch::of(&values).ok_or_else(|| format!("{}: a coil has no finite worst case", named.name))?;
        let within = |limit: f64| values.iter().filter(|worst| **worst <= limit).count() as u64;
        Ok(BlockPatternJson {
            name: named.name.clone(),
            segments: named.pattern.segments().to_vec(),
            nominal_rad_per_s: nominal[place],
            within_limit: block.spec.limit_rad_per_s.map(within),
            steps: sketch.steps().collect(),
            largest_rad_per_s: sketch.largest().to_vec(),
        })
    };
    let measure = match coils.measure() {
        Measure::Guaranteed => "guaranteed",
        Measure::Sampled => "sampled",
    };
    Ok((measure.to_owned(), block.patterns.iter().enumerate().map(of).collect::<Result<_, String>>()?))
}

fn nothing(id: &str, block: &CoilBlock) -> BlockJson {
    BlockJson {
        id: id.to_owned(),
        kind: CampaignKind::TOLERANCE.to_owned(),
        model: block.file.model.name.clone(),
        layers: block.file.model.coil.layers(),
        seed: block.spec.seed,
        first_coil: block.coils.start + 1,
        coils: block.coils.end - block.coils.start,
        measure: String::new(),
        limit_deg_per_h: block.spec.limit_rad_per_s.map(deg_per_h_from_rad_per_s),
        patterns: Vec::new(),
        failure: None,
    }
}

/// Each model over all its blocks, which are read one after the other; none where blocks failed.
pub(super) fn merged(folder: &Path, cells: &[&CampaignCell]) -> Vec<BuiltCoilsJson> {
    let mut found = Vec::new();
    let mut open: Option<Blocks> = None;
    for cell in cells {
        let Some(block) = read_cell::<BlockJson>(folder, &cell.id).filter(|block| block.failure.is_none()) else {
            continue;
        };
        // A model's blocks stand one behind the other, and begin with its first coil.
        match &mut open {
            Some(blocks) if block.first_coil != 1 => blocks.add(block),
            _ => found.extend(open.replace(Blocks::of(block)).map(Blocks::finish)),
        }
    }
    found.extend(open.map(Blocks::finish));
    found
}
