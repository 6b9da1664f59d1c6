//! The tables of campaigns, a kind each: searches, built coils, data sheets, diagnoses.

use crate::io::json::built_coils::{BuiltCoilsJson, SHARES};
use crate::io::json::campaign::{CellJson, GyroJson};
use crate::io::table::Table;
use crate::text::sink;

/// The table of all cells, in the grid's order.
pub(crate) fn searches(results: &[CellJson]) -> Vec<u8> {
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
        "id",
        "failure",
    ]);
    for (index, found) in results.iter().enumerate() {
        let segments: Vec<String> = found.segments.iter().map(ToString::to_string).collect();
        let number = |value: Option<f64>| value.map(|v| v.to_string()).unwrap_or_default();
        let cells = [
            (index + 1).to_string(),
            found.model.clone(),
            found.layers.to_string(),
            found.windability.clone(),
            found.objective.clone(),
            found.seed.to_string(),
            number(found.worst_rate_deg_per_h),
            number(found.objective_deg_per_h),
            number(found.improvement_over_qua),
            found.evaluations.to_string(),
            segments.join(" "),
            found.id.clone(),
            found.failure.clone().unwrap_or_default(),
        ];
        table.row(cells.iter().map(|text| sink::Cell::text(text)));
    }
    table.into_bytes()
}

fn joined<T: ToString>(items: &[T]) -> String {
    items.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ")
}

fn row(table: &mut Table, cells: &[String]) {
    table.row(cells.iter().map(|text| sink::Cell::text(text)));
}

fn number(value: Option<f64>) -> String {
    value.map(|v| v.to_string()).unwrap_or_default()
}

/// One row a model and pattern.
pub(crate) fn built_coils(models: &[BuiltCoilsJson]) -> Vec<u8> {
    let mut header: Vec<String> =
        ["model", "layers", "pattern", "coils", "seed", "measure", "nominal_deg_per_h"].map(str::to_owned).to_vec();
    for share in SHARES {
        let name = format!("p{}", (1000.0 * share).round() / 10.0).replace('.', "_");
        header.extend(["", "_low", "_high"].map(|end| format!("{name}{end}_deg_per_h")));
    }
    header.extend(["largest_deg_per_h", "limit_deg_per_h", "yield", "segments"].map(str::to_owned));
    let mut table = Table::with_header(header.iter().map(String::as_str));
    for model in models {
        for pattern in &model.patterns {
            let mut cells = vec![
                model.model.clone(),
                model.layers.to_string(),
                pattern.name.clone(),
                model.samples.to_string(),
                model.seed.to_string(),
                model.measure.clone(),
                pattern.nominal_deg_per_h.to_string(),
            ];
            for quantile in &pattern.quantiles {
                cells.push(quantile.value_deg_per_h.to_string());
                cells.extend([quantile.low_deg_per_h, quantile.high_deg_per_h].map(number));
            }
            cells.push(pattern.largest_deg_per_h.to_string());
            cells.extend([model.limit_deg_per_h, pattern.yield_share].map(number));
            cells.push(joined(&pattern.segments));
            row(&mut table, &cells);
        }
    }
    table.into_bytes()
}

/// One row a gyro.
pub(crate) fn gyros(found: &[GyroJson]) -> Vec<u8> {
    let is_diagnosis = found.iter().any(|gyro| gyro.diagnosis.is_some());
    let header: &[&str] = if is_diagnosis {
        &["gyro", "verdict", "effects", "noise_floor_deg_per_h", "records", "id", "failure"]
    } else {
        &[
            "gyro",
            "bias_deg_per_h",
            "bias_stability_deg_per_h",
            "bias_instability_deg_per_h",
            "repeatability_deg_per_h",
            "temperature_sensitivity_deg_per_h_per_c",
            "angle_random_walk_deg_per_sqrt_h",
            "peak_to_peak_deg_per_h",
            "records",
            "id",
            "failure",
        ]
    };
    let mut table = Table::with_header(header.iter().copied());
    for gyro in found {
        let mut cells = vec![gyro.gyro.clone()];
        let mut records = 0;
        if let Some(diagnosis) = &gyro.diagnosis {
            let effects: Vec<&str> = diagnosis.effects.iter().map(|effect| effect.kind.as_str()).collect();
            cells.extend([diagnosis.verdict.clone(), effects.join(" "), diagnosis.noise_floor_deg_per_h.to_string()]);
            records = diagnosis.inputs.records.len();
        } else if let Some(metrics) = &gyro.metrics {
            let numbers = [
                Some(metrics.bias_deg_per_h),
                metrics.bias_stability_deg_per_h,
                metrics.bias_instability_deg_per_h,
                metrics.repeatability_deg_per_h,
                metrics.temperature_sensitivity_deg_per_h_per_c,
                metrics.angle_random_walk_deg_per_sqrt_h,
                Some(metrics.peak_to_peak_deg_per_h),
            ];
            cells.extend(numbers.map(number));
            records = metrics.records.len();
        } else {
            cells.resize(header.len() - 3, String::new());
        }
        cells.extend([records.to_string(), gyro.id.clone(), gyro.failure.clone().unwrap_or_default()]);
        row(&mut table, &cells);
    }
    table.into_bytes()
}
