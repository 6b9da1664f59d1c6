//! Temperature fields from elsewhere (CSV): what a finite-element program exports, and what `temperatures` writes.
//!
//! | layout | columns |
//! |---|---|
//! | wide | `time_s`, `layer_1_c` … `layer_N_c`; with them, or not, `layer_J_c_per_h`, `moment_J_k`, `moment_J_c_per_h` |
//! | long | `time_s`, `layer`, `temperature_c`; `turn`, `rate_c_per_h` where known |
//! | either | `ambient_c`, `ambient_c_per_h`; without them the ambient is the outermost layer |
//!
//! Layers count from 1 innermost, turns from 1 at the first flange. With turns a layer's temperature is their mean, and what varies
//! along the axis its first moment. Lines that begin with `#` are comments; where they begin with `%`, the last of those is the header.

use std::collections::BTreeMap;
use std::path::Path;

use crate::io::fault::{Fault, Faults};
use crate::io::files::read_text_up_to;
use crate::numeric::statistics::median;
use crate::record::LEAST_INTERVAL_S;
use crate::thermal::{GivenField, ThermalHistory};
use crate::units::celsius_from_kelvin;

use super::csv_rows::{CsvPiece, CsvRows};
use super::field_columns::{FieldColumn, Holds};
use super::record_rows::PLAUSIBLE_C;

/// As a record's.
const LARGEST_FIELD_BYTES: u64 = 512 * 1024 * 1024;
const MOST_FAULTS: usize = 50;
/// No time, temperature or rate is beyond: arithmetic on what is would end in infinities.
const MOST: f64 = 1e11;

const EXPECTED: &str = "expected time_s with layer_1_c, layer_2_c, … (one row a time), or time_s, layer, temperature_c (one row a time \
                        and layer)";

/// A field, and what was noticed while reading it.
#[derive(Debug)]
pub struct ReadField {
    /// Temperatures and rates of every layer.
    pub field: GivenField,
    /// What was assumed or left out, in words.
    pub(crate) remarks: Vec<String>,
}

/// Reads and checks a field.
///
/// # Errors
/// All faults of the file at once, with line and column.
pub fn read_field(path: &Path) -> Result<ReadField, Faults> {
    let source = read_text_up_to(path, LARGEST_FIELD_BYTES)?;
    let name = path.file_stem().map_or_else(|| "field".to_owned(), |stem| stem.to_string_lossy().into_owned());
    parse_field(&path.display().to_string(), &name, &source)
}

/// As [`read_field`], of a text that was read already.
///
/// # Errors
/// All faults of the text at once.
pub(crate) fn parse_field(file: &str, name: &str, source: &str) -> Result<ReadField, Faults> {
    let ended = |faults: Vec<Fault>| Faults { file: file.to_owned(), source: source.to_owned(), faults };
    let commented = commented(source);
    let table = Table::read(commented.as_deref().unwrap_or(source)).map_err(ended)?;
    let mut remarks = table.remarks();
    let built = if table.has(Holds::Layer) { table.long() } else { table.wide() };
    let history = built.and_then(|history| table.checked(history)).map_err(|fault| ended(vec![fault]))?;
    let has_rates = !history.rate_k_per_s.is_empty();
    if !has_rates {
        remarks.push("temperatures without rates count as straight between their times".to_owned());
    }
    if has_rates && table.has(Holds::Ambient) && !table.has(Holds::AmbientRate) {
        remarks.push("the ambient's rate is not given: it is that of the stretch behind each time".to_owned());
    }
    if !table.has(Holds::Ambient) {
        remarks.push("there is no ambient temperature: the outermost layer's stands for it".to_owned());
    }
    Ok(ReadField { field: GivenField { name: name.to_owned(), history, has_rates }, remarks })
}

/// A text whose head stands behind `%`, with that head as comments and its last line as the header; places stay.
fn commented(source: &str) -> Option<String> {
    let head = source.lines().take_while(|line| line.starts_with('%')).count();
    let mut left = head;
    let lines = source.split_inclusive('\n').map(|line| {
        left = left.wrapping_sub(1);
        match line.strip_prefix('%') {
            Some(rest) if left == 0 => format!(" {rest}"),
            Some(rest) if left < head => format!("#{rest}"),
            _ => line.to_owned(),
        }
    });
    (head > 0).then(|| lines.collect())
}

/// What a file holds, column by column.
struct Table {
    columns: Vec<FieldColumn>,
    /// As the header has them.
    names: Vec<String>,
    /// Names of columns that are no part of a field.
    left_out: Vec<String>,
    /// One a column, in SI.
    values: Vec<Vec<f64>>,
    /// Of each row.
    lines: Vec<u64>,
}

impl Table {
    #[expect(clippy::too_many_lines, reason = "each kind of row beside what is said where it is wrong")]
    fn read(source: &str) -> Result<Self, Vec<Fault>> {
        let mut rows = CsvRows::new(source.as_bytes());
        // A text in memory does not fail.
        let Ok(Some((piece, division))) = rows.header(|_| {}) else {
            return Err(vec![Fault::new(format!("the file is empty or holds comments only: {EXPECTED}"), None)]);
        };
        let header = Some(rows.span());
        if let CsvPiece::Broken(why) = piece {
            return Err(vec![Fault::new(format!("line {}: {why}", rows.line()), header)]);
        }
        let names: Vec<String> = rows.names().map(str::to_owned).collect();
        let found: Vec<Option<FieldColumn>> = names.iter().enumerate().map(|(i, n)| FieldColumn::of(n, i)).collect();
        let left_out = names.iter().zip(&found).filter(|(_, c)| c.is_none()).map(|(n, _)| n.clone()).collect();
        let columns: Vec<FieldColumn> = found.into_iter().flatten().collect();
        let faults = faults_of_header(&columns, &names);
        if !faults.is_empty() {
            return Err(faults.into_iter().map(|message| Fault::new(message, header.clone())).collect());
        }
        let mut table = Self { values: vec![Vec::new(); columns.len()], columns, names, left_out, lines: Vec::new() };
        let (mut faults, mut uncounted) = (Vec::new(), 0);
        while let Ok(Some(piece)) = rows.next() {
            let mut fault = |message: String, span| match faults.len() < MOST_FAULTS {
                true => faults.push(Fault::new(message, Some(span))),
                false => uncounted += 1,
            };
            match piece {
                CsvPiece::Aside => continue,
                CsvPiece::Broken(why) => fault(format!("line {}: {why}", rows.line()), rows.span()),
                CsvPiece::Row if rows.len() != table.names.len() => {
                    let (expected, found) = (table.names.len(), rows.len());
                    let message = format!("expected {expected} columns as in the header, found {found}");
                    fault(format!("line {}: {message}", rows.line()), rows.span());
                }
                CsvPiece::Row => {
                    let cells: Vec<&str> = rows.cells().collect();
                    for (column, values) in table.columns.iter().zip(&mut table.values) {
                        let cell = cells[column.place];
                        let is_comma = division.decimal_comma && cell.matches(',').count() == 1 && !cell.contains('.');
                        let number = if is_comma { cell.replace(',', ".").parse() } else { cell.parse::<f64>() };
                        let si = number.ok().map(|v| column.si(v)).filter(|v| v.abs() <= MOST);
                        values.push(si.unwrap_or(f64::NAN));
                        if si.is_none() {
                            let name = &table.names[column.place];
                            let found = match cell {
                                "" => "nothing".to_owned(),
                                cell => format!("\"{}\"", cell.chars().take(40).collect::<String>()),
                            };
                            let message = format!(
                                "line {}, column {name}: expected a finite number up to {MOST:e}, found {found}",
                                rows.line()
                            );
                            fault(message, rows.span_of_cell(column.place));
                        }
                    }
                    table.lines.push(rows.line());
                }
            }
        }
        if uncounted > 0 {
            faults.push(Fault::new(format!("{uncounted} further faults of the same kinds"), None));
        }
        if faults.is_empty() && table.lines.is_empty() {
            faults.push(Fault::new("expected rows of numbers below the header, found none", header));
        }
        if faults.is_empty() { Ok(table) } else { Err(faults) }
    }

    fn has(&self, holds: Holds) -> bool {
        self.columns.iter().any(|c| c.holds == holds)
    }

    fn column(&self, holds: Holds) -> Option<&[f64]> {
        self.columns.iter().position(|c| c.holds == holds).map(|i| self.values[i].as_slice())
    }

    fn remarks(&self) -> Vec<String> {
        let left_out = (!self.left_out.is_empty())
            .then(|| format!("left out, because they are no part of a field: {}", self.left_out.join(", ")));
        left_out.into_iter().collect()
    }

    /// One row a time, one column a layer.
    fn wide(&self) -> Result<ThermalHistory, Fault> {
        let layers = self.columns.iter().filter(|c| matches!(c.holds, Holds::OfLayer(_))).count();
        let times = self.column(Holds::Time).unwrap_or_default();
        let mut history = ThermalHistory::with_capacity(layers, times.len());
        history.times_s = times.to_vec();
        let grid = |of: fn(usize) -> Holds, what: &str| -> Result<Vec<f64>, Fault> {
            let columns: Vec<Option<&[f64]>> = (0..layers).map(|layer| self.column(of(layer))).collect();
            if columns.iter().all(Option::is_none) && !self.columns.iter().any(|c| is_like(c.holds, of(0))) {
                return Ok(Vec::new());
            }
            if let Some(layer) = columns.iter().position(Option::is_none) {
                let message = format!("layer {} has no column {what}: expected one for each layer from 1", layer + 1);
                return Err(Fault::new(message, None));
            }
            let columns: Vec<&[f64]> = columns.into_iter().flatten().collect();
            Ok((0..times.len()).flat_map(|row| columns.iter().map(move |column| column[row])).collect())
        };
        history.temperature_k = grid(Holds::OfLayer, "of its temperature (layer_J_c)")?;
        history.rate_k_per_s = grid(Holds::RateOfLayer, "of its rate (layer_J_c_per_h)")?;
        history.axial_moment_k = grid(Holds::MomentOfLayer, "of its axial moment (moment_J_k)")?;
        history.axial_moment_k_per_s = grid(Holds::MomentRateOfLayer, "of its moment's rate (moment_J_c_per_h)")?;
        history.ambient_k = self.column(Holds::Ambient).unwrap_or_default().to_vec();
        history.ambient_rate_k_per_s = self.column(Holds::AmbientRate).unwrap_or_default().to_vec();
        Ok(history)
    }

    /// One row a time and layer, or a time, layer and turn.
    #[expect(
        clippy::too_many_lines,
        reason = "two passes over the same order: which places there are, then that each time has them"
    )]
    fn long(&self) -> Result<ThermalHistory, Fault> {
        let column = |holds: Holds| self.column(holds).unwrap_or_default();
        let (times, layers, turns) = (column(Holds::Time), column(Holds::Layer), self.column(Holds::Turn));
        let (temperatures, rates) = (column(Holds::Temperature), self.column(Holds::Rate));
        let turn = |row: usize| turns.map_or(1.0, |turns| turns[row]);
        let mut order: Vec<usize> = (0..times.len()).collect();
        order.sort_by(|&a, &b| {
            times[a].total_cmp(&times[b]).then(layers[a].total_cmp(&layers[b])).then(turn(a).total_cmp(&turn(b)))
        });
        // Layer by layer from 1, in each turn by turn from 1, as at the first time.
        let mut turns_of_layer: BTreeMap<usize, usize> = BTreeMap::new();
        for &row in order.iter().take_while(|&&row| times[row] == times[order[0]]) {
            let (last, count) = turns_of_layer.last_key_value().map_or((0, 0), |(l, c)| (*l, *c));
            match (layers[row], turn(row)) {
                (layer, turn) if layer == last as f64 && turn == (count + 1) as f64 => {
                    turns_of_layer.insert(last, count + 1);
                }
                (layer, 1.0) if layer == (last + 1) as f64 => {
                    turns_of_layer.insert(last + 1, 1);
                }
                (layer, turn) => {
                    let expected = format!("layer {} next", if count == 0 { 1 } else { last + 1 });
                    let of_turn = if turns.is_some() { format!(", turn {turn}") } else { String::new() };
                    let found = format!("layer {layer}{of_turn} behind layer {last}, turn {count}");
                    let (line, time_s) = (self.lines[row], times[row]);
                    let message = format!(
                        "line {line}: at {time_s} s expected {expected}, found {found}: layers and turns count from 1, none left out"
                    );
                    return Err(Fault::new(message, None));
                }
            }
        }
        let places: Vec<(usize, usize, usize)> =
            turns_of_layer.iter().flat_map(|(&layer, &of)| (1..=of).map(move |turn| (layer, turn, of))).collect();
        let mut history = ThermalHistory::with_capacity(turns_of_layer.len(), times.len() / places.len());
        for rows in order.chunks(places.len()) {
            let time_s = times[rows[0]];
            history.times_s.push(time_s);
            let mut sums = vec![[0.0; 4]; turns_of_layer.len()];
            for (i, &(layer, number, of)) in places.iter().enumerate() {
                let row = rows
                    .get(i)
                    .copied()
                    .filter(|&row| times[row] == time_s && layers[row] == layer as f64 && turn(row) == number as f64);
                let Some(row) = row else {
                    let of_turn = if turns.is_some() { format!(", turn {number}") } else { String::new() };
                    let message = format!(
                        "at {time_s} s there is not one row of layer {layer}{of_turn}: every time needs the same layers and turns, each once"
                    );
                    return Err(Fault::new(message, None));
                };
                // ∫ over the turn's share of the height, ζ from −½ to ½.
                let share = 1.0 / of as f64;
                let lever = ((number as f64 - 0.5) * share - 0.5) * share;
                let rate = rates.map_or(0.0, |rates| rates[row]);
                let [mean, moment, mean_rate, moment_rate] = &mut sums[layer - 1];
                *mean += share * temperatures[row];
                *moment += lever * temperatures[row];
                *mean_rate += share * rate;
                *moment_rate += lever * rate;
            }
            history.temperature_k.extend(sums.iter().map(|s| s[0]));
            if rates.is_some() {
                history.rate_k_per_s.extend(sums.iter().map(|s| s[2]));
            }
            if turns.is_some() {
                history.axial_moment_k.extend(sums.iter().map(|s| s[1]));
                if rates.is_some() {
                    history.axial_moment_k_per_s.extend(sums.iter().map(|s| s[3]));
                }
            }
            history.ambient_k.extend(self.column(Holds::Ambient).map(|ambient| ambient[rows[0]]));
            history.ambient_rate_k_per_s.extend(self.column(Holds::AmbientRate).map(|rate| rate[rows[0]]));
        }
        Ok(history)
    }

    /// With an ambient, and times and temperatures that can be.
    fn checked(&self, mut history: ThermalHistory) -> Result<ThermalHistory, Fault> {
        let fault = |message: String| Err(Fault::new(message, None));
        let steps = history.times_s.windows(2).map(|w| w[1] - w[0]);
        if let Some(step_s) = steps.into_iter().find(|step_s| *step_s > 0.0 && *step_s < LEAST_INTERVAL_S) {
            return fault(format!("expected times at least {LEAST_INTERVAL_S} s apart, found {step_s:e} s"));
        }
        let (layers, rows, has_rates) = (history.layers, history.len(), !history.rate_k_per_s.is_empty());
        let times = &history.times_s;
        let at_kink = |row: usize| has_rates && (row < 2 || times[row - 2] < times[row]);
        if let Some(row) = (1..rows).find(|&i| !(times[i] > times[i - 1] || times[i] == times[i - 1] && at_kink(i))) {
            let line = if self.has(Holds::Layer) { String::new() } else { format!("line {}: ", self.lines[row]) };
            return fault(format!(
                "{line}times must increase, found {} s after {} s: only the two sides of a kink, both with their rates, share a time",
                times[row],
                times[row - 1]
            ));
        }
        if !has_rates && rows < 2 {
            return fault("expected at least two times, or rates with the temperatures, found one time".to_owned());
        }
        let middle_c = celsius_from_kelvin(median(&history.temperature_k));
        if !PLAUSIBLE_C.contains(&middle_c) {
            return fault(format!(
                "expected temperatures from {} to {} °C, found a median of {middle_c:.2} °C: is the unit in the columns' names right?",
                PLAUSIBLE_C.start, PLAUSIBLE_C.end
            ));
        }
        let outermost =
            |values: &[f64]| -> Vec<f64> { values.iter().skip(layers - 1).step_by(layers).copied().collect() };
        if history.ambient_k.is_empty() {
            history.ambient_k = outermost(&history.temperature_k);
            history.ambient_rate_k_per_s = outermost(&history.rate_k_per_s);
        } else if has_rates && history.ambient_rate_k_per_s.is_empty() {
            history.ambient_rate_k_per_s = slopes_ahead(times, &history.ambient_k);
        }
        if !has_rates {
            history.ambient_rate_k_per_s.clear();
            history.axial_moment_k_per_s.clear();
        } else if !history.axial_moment_k.is_empty() && history.axial_moment_k_per_s.is_empty() {
            return fault("moments are given without their rates: add the columns moment_J_c_per_h".to_owned());
        }
        Ok(history)
    }
}

/// The slope of each stretch at its beginning; the last time has that before it.
fn slopes_ahead(times_s: &[f64], values: &[f64]) -> Vec<f64> {
    let slope = |row: usize| {
        let step_s = times_s.get(row + 1)? - times_s[row];
        (step_s > 0.0).then(|| (values[row + 1] - values[row]) / step_s)
    };
    let mut slopes: Vec<f64> = Vec::with_capacity(values.len());
    for row in 0..values.len() {
        let before = slopes.last().copied().unwrap_or(0.0);
        slopes.push(slope(row).unwrap_or(before));
    }
    slopes
}

/// Whether two columns hold the same of different layers.
fn is_like(a: Holds, b: Holds) -> bool {
    std::mem::discriminant(&a) == std::mem::discriminant(&b)
}

fn faults_of_header(columns: &[FieldColumn], names: &[String]) -> Vec<String> {
    let mut faults = Vec::new();
    for (i, column) in columns.iter().enumerate() {
        if let Some(other) = columns[..i].iter().find(|c| c.holds == column.holds) {
            let (first, second) = (&names[other.place], &names[column.place]);
            faults.push(format!("columns {first} and {second} hold the same: leave one out"));
        }
    }
    let has = |holds: Holds| columns.iter().any(|c| c.holds == holds);
    let is_wide = columns.iter().any(|c| matches!(c.holds, Holds::OfLayer(_)));
    let shown = names.iter().take(8).map(String::as_str).collect::<Vec<_>>().join(", ");
    if !has(Holds::Time) {
        faults.push(format!("column time_s is missing: {EXPECTED}; found {shown}"));
    }
    match (is_wide, has(Holds::Layer), has(Holds::Temperature)) {
        (true, false, false) | (false, true, true) => {}
        (false, true, false) => faults.push(format!("column temperature_c is missing beside layer; found {shown}")),
        (true, ..) => faults.push(format!(
            "the file has columns layer_J_c and columns layer or temperature: {EXPECTED}; found {shown}"
        )),
        (false, false, _) => faults.push(format!("no column holds a layer's temperature: {EXPECTED}; found {shown}")),
    }
    faults
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(source: &str) -> Result<GivenField, String> {
        parse_field("f.csv", "f", source).map(|read| read.field).map_err(|faults| faults.faults[0].message.clone())
    }

    #[test]
    fn wide_long_other_units_separators_and_a_head_of_percents_hold_the_same_field() {
        let plain =
            read("time_s,ambient_c,layer_1_c,layer_2_c\n0,20,20,20\n60,21,20.5,20.75\n120,22,21,21.5\n").unwrap();
        assert!(!plain.has_rates);
        assert_eq!((plain.history.layers, plain.history.len()), (2, 3));
        let cases = [
            "time_min;ambient_k;layer_2_k;layer_1_k\n0;293,15;293,15;293,15\n1;294,15;293,9;293,65\n2;295,15;294,65;294,15\n",
            "layer,time_s,temperature_c,ambient_c\n1,0,20,20\n1,60,20.5,21\n1,120,21,22\n2,0,20,20\n2,60,20.75,21\n2,120,21.5,22\n",
            "% Model: coil.mph\n% Time (s),Ambient (degC),\"T, layer 1 (degC)\",\"T, layer 2 (degC)\"\n0,20,20,20\n60,21,20.5,20.75\n120,22,21,21.5\n",
            "time_s,layer,turn,temperature_c,ambient_c\n0,1,1,20,20\n0,1,2,20,20\n0,2,1,20,20\n60,1,1,20.5,21\n60,1,2,20.5,21\n60,2,1,20.75,21\n120,1,1,21,22\n120,1,2,21,22\n120,2,1,21.5,22\n",
        ];
        for case in cases {
            let found = read(case).unwrap();
            let off = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert_eq!(found.history.times_s, plain.history.times_s, "{case}");
            assert!(off(&found.history.temperature_k, &plain.history.temperature_k) < 1e-10, "{case}");
            assert!(off(&found.history.ambient_k, &plain.history.ambient_k) < 1e-10, "{case}");
            assert!(found.history.axial_moment_k.iter().all(|m| m.abs() < 1e-10), "{case}");
        }
    }

    #[test]
    fn turns_give_a_layers_mean_and_its_moment_along_the_axis() {
        let mut source = "time_s,layer,turn,temperature_k,rate_k_per_s\n".to_owned();
        for turn in 1..=100 {
            // T = 300 + 2 ζ, whose moment ∫ T ζ dζ is 2/12.
            let zeta = (f64::from(turn) - 0.5) / 100.0 - 0.5;
            source += &format!("0,1,{turn},{},{}\n", 300.0 + 2.0 * zeta, 0.01 * zeta);
        }
        let history = read(&source).unwrap().history;
        assert!((history.temperature_k[0] - 300.0).abs() < 1e-9);
        assert!((history.axial_moment_k[0] - 2.0 / 12.0).abs() < 1e-4);
        assert!((history.axial_moment_k_per_s[0] - 0.01 / 12.0).abs() < 1e-6);
    }

    #[test]
    fn both_sides_of_a_kink_share_a_time_where_rates_are_given() {
        let source = "time_s,layer_1_c,layer_1_k_per_s\n0,20,0.1\n10,21,0.1\n10,21,-0.1\n20,20,-0.1\n";
        assert_eq!(read(source).unwrap().states().rate_k_per_s, [0.1, 0.1, -0.1, -0.1]);
        assert!(read("time_s,layer_1_c\n0,20\n10,21\n10,21\n").unwrap_err().contains("line 4: times must increase"));
    }

    #[test]
    fn what_is_no_field_is_said_with_what_was_expected_and_found() {
        let said = |source: &str| read(source).unwrap_err();
        assert!(said("").contains("empty"));
        assert!(said("t,T\n0,1\n").contains("column time_s is missing"));
        assert!(said("time_s,T\n0,1\n").contains("no column holds a layer's temperature"));
        assert!(
            said("time_s,layer_1_c,layer_3_c\n0,1,2\n1,1,2\n").contains("layer 2 has no column of its temperature")
        );
        assert!(
            said("time_s,layer_1_c\n0,x\n1,1\n")
                .contains("line 2, column layer_1_c: expected a finite number up to 1e11, found \"x\"")
        );
        assert!(said("time_s,layer_1_c\n0,20\n").contains("at least two times"));
        assert!(said("time_s,layer_1_c\n0,20\n4e-11,21\n").contains("at least 0.000001 s apart, found 4e-11 s"));
        assert!(said("time_s,layer_1_c\n0,1e300\n1,21\n").contains("up to 1e11, found \"1e300\""));
        assert!(said("time_s,layer_1_c\n0,293\n1,293\n").contains("found a median of 293.00 °C"));
        assert!(said("time_s,layer,temperature_c\n0,1,20\n0,3,20\n").contains("expected layer 2 next, found layer 3"));
        assert!(
            said("time_s,layer,temperature_c\n0,1,20\n0,2,20\n1,1,20\n")
                .contains("at 1 s there is not one row of layer 2")
        );
        assert!(said("time_s,layer_1_c,layer_1_k\n0,1,2\n").contains("hold the same"));
    }
}
