//! The table beside a comparison: one row a row of the record, as CSV, written and read back.

use serde::{Deserialize, Serialize};

use crate::compare::Comparison;
use crate::record::Record;
use crate::units::{c_per_min_from_k_per_s, celsius_from_kelvin, deg_per_h_from_rad_per_s};

/// One instant of a record beside its prediction; temperatures are those of the outermost layer in the model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct ComparisonRow {
    pub(crate) time_s: f64,
    pub(crate) rate_deg_per_h: f64,
    pub(crate) predicted_deg_per_h: f64,
    pub(crate) residual_deg_per_h: f64,
    pub(crate) temperature_c: f64,
    pub(crate) temperature_rate_c_per_min: f64,
    /// As in [`crate::compare::regimes::Regime::key`].
    pub(crate) regime: String,
}

/// Digits after the point: finer than any record's resolution.
const DECIMALS: i32 = 7;

fn rounded(value: f64) -> f64 {
    crate::io::json::schedule::rounded(value, DECIMALS)
}

/// The whole table.
pub(crate) fn comparison_rows(record: &Record, found: &Comparison) -> Vec<ComparisonRow> {
    let pack = &found.prediction.pack;
    (0..record.rows())
        .map(|row| ComparisonRow {
            time_s: record.times_s()[row],
            rate_deg_per_h: rounded(deg_per_h_from_rad_per_s(record.rate_rad_per_s()[row])),
            predicted_deg_per_h: rounded(deg_per_h_from_rad_per_s(found.prediction.rate_rad_per_s[row])),
            residual_deg_per_h: rounded(deg_per_h_from_rad_per_s(found.residual_rad_per_s[row])),
            temperature_c: rounded(celsius_from_kelvin(pack[row].outer_k)),
            temperature_rate_c_per_min: rounded(c_per_min_from_k_per_s(pack[row].outer_rate_k_per_s)),
            regime: found.regime_of_row[row].key().to_owned(),
        })
        .collect()
}
