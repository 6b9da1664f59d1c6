//! The front of error against windability, as JSON and CSV.

use serde::Serialize;

use crate::search::pareto::Point;

use super::PatternJson;

#[derive(Debug, Serialize)]
pub struct PointJson {
    #[serde(flatten)]
    pub pattern: PatternJson,
    pub long_crossovers: usize,
    /// The pattern file, where one was written.
    pub file: Option<String>,
}

/// The answer of `pareto`.
#[derive(Debug, Serialize)]
pub struct ParetoJson {
    pub model: String,
    pub seed: u64,
    pub points: Vec<PointJson>,
}

impl PointJson {
    pub fn of(point: &Point, file: Option<String>) -> Self {
        Self { pattern: PatternJson::of(&point.judged), long_crossovers: point.windability.long_crossovers, file }
    }
}

/// One row a point.
///
/// # Errors
/// A row that cannot be encoded.
pub fn front_csv(points: &[PointJson]) -> Result<Vec<u8>, csv::Error> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    csv.write_record([
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
    ])?;
    for point in points {
        let segments: Vec<String> = point.pattern.segments.iter().map(ToString::to_string).collect();
        csv.write_record([
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
        ])?;
    }
    csv.into_inner().map_err(|e| e.into_error().into())
}
