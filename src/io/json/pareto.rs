//! The front of error against windability, as JSON and CSV.

use serde::Serialize;

use crate::io::table::Table;
use crate::search::pareto::ParetoPoint;
use crate::text::sink::Cell;

use super::PatternJson;

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct PointJson {
    #[serde(flatten)]
    pub(crate) pattern: PatternJson,
    pub(crate) long_crossovers: usize,
    /// Whether its error is well below that of every point that is easier to wind.
    pub(crate) knee: bool,
    /// The pattern file, where one was written.
    pub(crate) file: Option<String>,
}

/// The answer of `pareto`.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct ParetoJson {
    pub(crate) model: String,
    pub(crate) seed: u64,
    /// "best found": no point is proved to be the best of its kind.
    pub(crate) status: &'static str,
    /// Knees first, each part smallest error first.
    pub(crate) points: Vec<PointJson>,
}

impl PointJson {
    pub(crate) fn of(point: &ParetoPoint, knee: bool, file: Option<String>) -> Self {
        let long_crossovers = point.windability.long_crossovers;
        Self { pattern: PatternJson::of(&point.judged), long_crossovers, knee, file }
    }
}

/// One row a point.
pub(crate) fn front_csv(points: &[PointJson]) -> Vec<u8> {
    let mut table = Table::with_header([
        "name",
        "worst_rate_deg_per_h",
        "p95_rate_deg_per_h",
        "class",
        "captive",
        "reels",
        "max_climb",
        "long_crossovers",
        "file",
        "segments",
    ]);
    for point in points {
        let segments: Vec<String> = point.pattern.segments.iter().map(ToString::to_string).collect();
        let cells = [
            point.pattern.name.clone(),
            point.pattern.worst_rate_deg_per_h.to_string(),
            point.pattern.p95_rate_deg_per_h.map(|p| p.to_string()).unwrap_or_default(),
            point.pattern.windability.class.clone(),
            point.pattern.windability.captive.to_string(),
            point.pattern.windability.reels.to_string(),
            point.pattern.windability.max_climb.to_string(),
            point.long_crossovers.to_string(),
            point.file.clone().unwrap_or_default(),
            segments.join(" "),
        ];
        table.row(cells.iter().map(|text| Cell::text(text)));
    }
    table.into_bytes()
}
