//! What patterns err by under temperature fields, row by row: `rates.csv` in the folder of a search, and read again for its page.

use std::collections::BTreeMap;
use std::path::Path;

use crate::io::fault::Faults;
use crate::io::files::read_text;
use crate::io::table::{Table, rows_of_csv};
use crate::text::sink::Cell;
use crate::thermal::ThermalHistory;
use crate::units::celsius_from_kelvin;

pub(crate) const RATES_FILE: &str = "rates.csv";
const FIELD: &str = "field";
const TIME: &str = "time_s";
const UNIT: &str = "_deg_per_h";

/// A pattern under one field.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PatternRates {
    pub(crate) name: String,
    /// One a row.
    pub(crate) rates_deg_per_h: Vec<f64>,
}

/// One field: some of its layers' temperatures, and what patterns err by.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct FieldRates {
    pub(crate) times_s: Vec<f64>,
    /// Layers counted from 1, innermost first, with a temperature a row.
    pub(crate) layers_c: Vec<(usize, Vec<f64>)>,
    pub(crate) patterns: Vec<PatternRates>,
}

impl FieldRates {
    /// The innermost, the middle and the outermost layer of a field, no pattern yet.
    pub(crate) fn of(states: &ThermalHistory) -> Self {
        let mut shown = vec![0, states.layers / 2, states.layers.saturating_sub(1)];
        shown.dedup();
        let course = |layer: usize| {
            states
                .temperature_k
                .chunks(states.layers.max(1))
                .map(|row| celsius_from_kelvin(row[layer]))
                .collect::<Vec<f64>>()
        };
        Self {
            times_s: states.times_s.clone(),
            layers_c: shown.into_iter().map(|layer| (layer + 1, course(layer))).collect(),
            patterns: Vec::new(),
        }
    }
}

/// One line a row of a field; fields are counted from 1 in the order in which they were given.
pub(crate) fn rates_csv(fields: &[FieldRates]) -> Vec<u8> {
    let Some(first) = fields.first() else { return Vec::new() };
    let layers = first.layers_c.iter().map(|(layer, _)| format!("layer_{layer}_c"));
    let patterns = first.patterns.iter().map(|pattern| pattern.name.clone() + UNIT);
    let header: Vec<String> = [FIELD, TIME].map(str::to_owned).into_iter().chain(layers).chain(patterns).collect();
    let mut table = Table::with_header(header.iter().map(String::as_str));
    for (number, field) in fields.iter().enumerate() {
        for (row, time_s) in field.times_s.iter().enumerate() {
            let layers = field.layers_c.iter().map(|(_, course)| course[row]);
            let rates = field.patterns.iter().map(|pattern| pattern.rates_deg_per_h[row]);
            let values = std::iter::once(*time_s).chain(layers).chain(rates).map(|v| v.to_string());
            table.row(std::iter::once((number + 1).to_string()).chain(values).map(Cell::plain));
        }
    }
    table.into_bytes()
}

/// # Errors
/// A file that is missing, or is no such table.
pub(crate) fn read_rates(folder: &Path, patterns: &[&str]) -> Result<Vec<FieldRates>, Faults> {
    let path = folder.join(RATES_FILE);
    let fault = |message: String| Faults::of_file(path.display().to_string(), message);
    let rows: Vec<BTreeMap<String, f64>> = rows_of_csv(&read_text(&path)?).map_err(|error| fault(error.to_string()))?;
    let mut layers: Vec<usize> = rows.first().map_or_else(Vec::new, |row| {
        row.keys().filter_map(|key| key.strip_prefix("layer_")?.strip_suffix("_c")?.parse().ok()).collect()
    });
    layers.sort_unstable();
    let mut fields: Vec<FieldRates> = Vec::new();
    let mut number = f64::NAN;
    for row in &rows {
        let value =
            |key: &str| row.get(key).copied().ok_or_else(|| fault(format!("expected a column {key}, found none")));
        if value(FIELD)? != number {
            number = value(FIELD)?;
            fields.push(FieldRates {
                times_s: Vec::new(),
                layers_c: layers.iter().map(|layer| (*layer, Vec::new())).collect(),
                patterns: patterns
                    .iter()
                    .map(|name| PatternRates { name: (*name).to_owned(), rates_deg_per_h: Vec::new() })
                    .collect(),
            });
        }
        let Some(field) = fields.last_mut() else { continue };
        field.times_s.push(value(TIME)?);
        for (layer, course) in &mut field.layers_c {
            course.push(value(&format!("layer_{layer}_c"))?);
        }
        for pattern in &mut field.patterns {
            pattern.rates_deg_per_h.push(value(&(pattern.name.clone() + UNIT))?);
        }
    }
    Ok(fields)
}
