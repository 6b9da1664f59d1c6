//! Record files (CSV): a header with units in its names, one row a time, comments after `#`.
//!
//! Every number must be there and finite, and the times must increase strictly: a sensor that failed is a row that is
//! left out, which the rest of the program sees as a gap. Gross errors that are numbers are read as they are.

use std::ops::Range;
use std::path::Path;

use csv::{ReaderBuilder, StringRecord, Trim};

use crate::io::fault::{Fault, Faults};
use crate::io::files::read_text_up_to;
use crate::numeric::statistics::median;
use crate::record::{Channel, MIN_ROWS, Record, RecordError};
use crate::units::{
    celsius_from_kelvin, kelvin_from_celsius, rad_per_s_from_deg_per_h, rad_per_s_from_deg_per_s, s_from_h, s_from_min,
};

use super::toml_reader::nearest;

/// Ten million rows of three columns or so.
const LARGEST_RECORD_BYTES: u64 = 512 * 1024 * 1024;
/// More faults than this are counted, not drawn.
const MOST_FAULTS: usize = 50;
/// A coil that is mostly outside of this is in other units than its header says.
const PLAUSIBLE_C: Range<f64> = -150.0..200.0;

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    Time,
    Temperature,
    Rate,
    InnerTemperature,
    AmbientTemperature,
    /// Anything else, by its name.
    Channel,
}

/// A name that a header may have, and how its numbers become SI.
struct ColumnName {
    name: &'static str,
    quantity: Quantity,
    to_si: fn(f64) -> f64,
}

const fn column(name: &'static str, quantity: Quantity, to_si: fn(f64) -> f64) -> ColumnName {
    ColumnName { name, quantity, to_si }
}

fn as_it_is(value: f64) -> f64 {
    value
}

const NAMES: &[ColumnName] = &[
    column("time_s", Quantity::Time, as_it_is),
    column("time_min", Quantity::Time, s_from_min),
    column("time_h", Quantity::Time, s_from_h),
    column("temperature_c", Quantity::Temperature, kelvin_from_celsius),
    column("temperature_k", Quantity::Temperature, as_it_is),
    column("rate_deg_per_h", Quantity::Rate, rad_per_s_from_deg_per_h),
    column("rate_deg_per_s", Quantity::Rate, rad_per_s_from_deg_per_s),
    column("rate_rad_per_s", Quantity::Rate, as_it_is),
    column("temperature_inner_c", Quantity::InnerTemperature, kelvin_from_celsius),
    column("temperature_inner_k", Quantity::InnerTemperature, as_it_is),
    column("temperature_ambient_c", Quantity::AmbientTemperature, kelvin_from_celsius),
    column("temperature_ambient_k", Quantity::AmbientTemperature, as_it_is),
];

/// One column of a record file.
#[derive(Debug, Clone)]
pub struct Column {
    pub name: String,
    pub quantity: Quantity,
    to_si: fn(f64) -> f64,
}

impl Column {
    fn named(name: &str) -> Self {
        let known = NAMES.iter().find(|n| n.name == name);
        Self {
            name: name.to_owned(),
            quantity: known.map_or(Quantity::Channel, |n| n.quantity),
            to_si: known.map_or(as_it_is, |n| n.to_si),
        }
    }

    /// A field as a number in SI.
    ///
    /// # Errors
    /// What was found instead, in words.
    pub fn value(&self, field: &str) -> Result<f64, String> {
        match field.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok((self.to_si)(value)),
            _ if field.is_empty() => Err("nothing".to_owned()),
            _ => Err(format!("\"{}\"", field.chars().take(40).collect::<String>())),
        }
    }
}

/// What the header of a record says, faults included.
///
/// # Errors
/// Every fault of the header, as a message and a remedy.
pub fn read_header(fields: &[&str]) -> Result<Vec<Column>, Vec<(String, Option<String>)>> {
    let columns: Vec<Column> = fields.iter().map(|f| Column::named(f)).collect();
    let mut faults = Vec::new();
    if columns.len() == 1 && fields[0].contains([';', '\t']) {
        let remedy = "separate the columns with commas and write decimals with a point";
        return Err(vec![(
            "the header is one column: expected commas between columns".to_owned(),
            Some(remedy.into()),
        )]);
    }
    for (i, column) in columns.iter().enumerate() {
        if column.name.is_empty() {
            faults.push((format!("column {} has no name: expected one such as supply_v", i + 1), None));
        } else if columns[..i].iter().any(|c| c.name == column.name) {
            faults.push((format!("column {} is there twice: give each column a name of its own", column.name), None));
        } else if column.quantity != Quantity::Channel
            && let Some(other) = columns[..i].iter().find(|c| c.quantity == column.quantity)
        {
            faults.push((format!("columns {} and {} hold the same: leave one out", other.name, column.name), None));
        }
    }
    for (quantity, wanted) in
        [(Quantity::Time, "time_s"), (Quantity::Temperature, "temperature_c"), (Quantity::Rate, "rate_deg_per_h")]
    {
        if columns.iter().any(|c| c.quantity == quantity) {
            continue;
        }
        let accepted: Vec<&str> = NAMES.iter().filter(|n| n.quantity == quantity).map(|n| n.name).collect();
        let stem = wanted.split('_').next().unwrap_or(wanted);
        let others = columns.iter().filter(|c| c.quantity == Quantity::Channel);
        let meant = others.map(|c| c.name.as_str()).find(|n| n.starts_with(stem) || nearest(n, &accepted).is_some());
        let found = meant.map_or_else(|| "none of them".to_owned(), str::to_owned);
        let message = format!("column {wanted} is missing: expected one of {}, found {found}", accepted.join(", "));
        faults.push((message, meant.map(|name| format!("rename {name} and convert it if need be"))));
    }
    if faults.is_empty() { Ok(columns) } else { Err(faults) }
}

/// Reads and checks a record.
///
/// # Errors
/// All faults of the file at once, with line and column.
pub fn read_record(path: &Path) -> Result<Record, Faults> {
    let source = read_text_up_to(path, LARGEST_RECORD_BYTES)?;
    parse_record(&path.display().to_string(), &source)
}

/// As [`read_record`], of a text that was read already.
///
/// # Errors
/// All faults of the text at once.
pub fn parse_record(file: &str, source: &str) -> Result<Record, Faults> {
    Reading::new(file, source).record()
}

struct Reading<'s> {
    file: &'s str,
    source: &'s str,
    faults: Vec<Fault>,
    uncounted: usize,
}

impl<'s> Reading<'s> {
    fn new(file: &'s str, source: &'s str) -> Self {
        Self { file, source, faults: Vec::new(), uncounted: 0 }
    }

    fn fault(&mut self, fault: Fault) {
        if self.faults.len() < MOST_FAULTS {
            self.faults.push(fault);
        } else {
            self.uncounted += 1;
        }
    }

    fn record(mut self) -> Result<Record, Faults> {
        // A byte-order mark belongs to no column's name.
        let start = if self.source.starts_with('\u{feff}') { '\u{feff}'.len_utf8() } else { 0 };
        let mut reader = ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .comment(Some(b'#'))
            .trim(Trim::All)
            .from_reader(&self.source.as_bytes()[start..]);
        let mut row = StringRecord::new();
        if !self.next(&mut reader, &mut row) {
            return self.end(
                None,
                "the file holds comments only: expected a header such as time_s,temperature_c,rate_deg_per_h",
            );
        }
        let header_span = self.line_span(start, &row);
        let fields: Vec<&str> = row.iter().collect();
        let columns = match read_header(&fields) {
            Ok(columns) => columns,
            Err(faults) => {
                for (message, note) in faults {
                    self.fault(Fault { message, span: Some(header_span.clone()), note });
                }
                return self.end(None, "");
            }
        };
        let mut values: Vec<Vec<f64>> = vec![Vec::new(); columns.len()];
        let mut last_s: Option<f64> = None;
        while self.next(&mut reader, &mut row) {
            if row.len() != columns.len() {
                let line = self.line_span(start, &row);
                let message = format!(
                    "line {}: expected {} columns as in the header, found {}",
                    row.position().map_or(0, csv::Position::line),
                    columns.len(),
                    row.len()
                );
                self.fault(Fault::new(message, Some(line)));
                continue;
            }
            for (place, (column, field)) in columns.iter().zip(row.iter()).enumerate() {
                match column.value(field) {
                    Ok(value) => {
                        if column.quantity == Quantity::Time {
                            if let Some(before_s) = last_s.filter(|before| value <= *before) {
                                let line = row.position().map_or(0, csv::Position::line);
                                let message = format!(
                                    "line {line}, column {}: times must increase strictly, found {field} after {before_s} s",
                                    column.name
                                );
                                let span = self.field_span(start, &row, place);
                                self.fault(
                                    Fault::new(message, Some(span))
                                        .with_note("sort the rows, or leave out those that are there twice"),
                                );
                            }
                            last_s = Some(value);
                        }
                        values[place].push(value);
                    }
                    Err(found) => {
                        let line = row.position().map_or(0, csv::Position::line);
                        let message =
                            format!("line {line}, column {}: expected a finite number, found {found}", column.name);
                        let span = self.field_span(start, &row, place);
                        self.fault(
                            Fault::new(message, Some(span))
                                .with_note("leave out rows in which a sensor failed; a gap in time is no fault"),
                        );
                        values[place].push(f64::NAN);
                    }
                }
            }
        }
        self.check_temperatures(&columns, &values, &header_span);
        self.gather_empty_columns(&columns, &values, &header_span);
        let rows = values.first().map_or(0, Vec::len);
        if self.faults.is_empty() && rows < MIN_ROWS {
            self.fault(Fault::new(format!("expected at least {MIN_ROWS} rows of numbers, found {rows}"), None));
        }
        if !self.faults.is_empty() {
            return self.end(None, "");
        }
        let built = build(self.file, &columns, values);
        match built {
            Ok(record) => Ok(record),
            Err(error) => self.end(Some(error), ""),
        }
    }

    /// Reads on; a row that is no CSV at all is a fault and ends the reading.
    fn next(&mut self, reader: &mut csv::Reader<&[u8]>, row: &mut StringRecord) -> bool {
        match reader.read_record(row) {
            Ok(more) => more,
            Err(error) => {
                self.fault(Fault::new(format!("no CSV: {error}"), None));
                false
            }
        }
    }

    fn check_temperatures(&mut self, columns: &[Column], values: &[Vec<f64>], header: &Range<usize>) {
        for (column, values) in columns.iter().zip(values) {
            let is_temperature = matches!(
                column.quantity,
                Quantity::Temperature | Quantity::InnerTemperature | Quantity::AmbientTemperature
            );
            let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
            let middle_c = celsius_from_kelvin(median(&finite));
            if is_temperature && !finite.is_empty() && !PLAUSIBLE_C.contains(&middle_c) {
                let message = format!(
                    "column {}: expected a coil's temperature between {} and {} °C, found a median of {middle_c:.2} °C",
                    column.name, PLAUSIBLE_C.start, PLAUSIBLE_C.end
                );
                self.fault(
                    Fault::new(message, Some(header.clone()))
                        .with_note("a name that ends in _c holds degrees Celsius, one that ends in _k kelvin"),
                );
            }
        }
    }

    /// A column that holds no number at all is one fault, not one a row.
    fn gather_empty_columns(&mut self, columns: &[Column], values: &[Vec<f64>], header: &Range<usize>) {
        for (column, values) in columns.iter().zip(values) {
            if values.len() < MIN_ROWS || values.iter().any(|v| v.is_finite()) {
                continue;
            }
            let own = format!(", column {}: expected a finite number", column.name);
            let before = self.faults.len();
            self.faults.retain(|f| !f.message.contains(&own));
            let shown = before - self.faults.len();
            self.uncounted = self.uncounted.saturating_sub(values.len() - shown);
            let message = format!("column {} holds no finite number in any of its {} rows", column.name, values.len());
            let note = match column.quantity {
                Quantity::Time | Quantity::Temperature | Quantity::Rate => "the sensor failed: measure again",
                _ => "leave the column out",
            };
            self.fault(Fault::new(message, Some(header.clone())).with_note(note));
        }
    }

    fn end(mut self, error: Option<RecordError>, message: &str) -> Result<Record, Faults> {
        if let Some(error) = error {
            self.faults.push(Fault::new(error.to_string(), None));
        }
        if !message.is_empty() && self.faults.is_empty() {
            self.faults.push(Fault::new(message, None));
        }
        if self.uncounted > 0 {
            self.faults.push(Fault::new(format!("{} further faults of the same kinds", self.uncounted), None));
        }
        Err(Faults { file: self.file.to_owned(), source: self.source.to_owned(), faults: self.faults })
    }

    /// The source line that a row came from.
    fn line_span(&self, start: usize, row: &StringRecord) -> Range<usize> {
        let from = start + row.position().map_or(0, |p| p.byte() as usize);
        let skipped = self.source[from..].len() - self.source[from..].trim_start_matches(['\n', '\r']).len();
        let from = from + skipped;
        let line = self.source[from..].lines().next().unwrap_or("");
        from..from + line.len()
    }

    /// The field of a row in the source; the whole line where quotes hide the commas.
    fn field_span(&self, start: usize, row: &StringRecord, place: usize) -> Range<usize> {
        let line = self.line_span(start, row);
        let text = &self.source[line.clone()];
        if text.contains('"') {
            return line;
        }
        let before: usize = text.split(',').take(place).map(|f| f.len() + 1).sum();
        let length = text.split(',').nth(place).map_or(0, str::len);
        line.start + before..line.start + before + length
    }
}

fn build(file: &str, columns: &[Column], mut values: Vec<Vec<f64>>) -> Result<Record, RecordError> {
    let mut take = |quantity: Quantity| {
        columns.iter().position(|c| c.quantity == quantity).map(|place| std::mem::take(&mut values[place]))
    };
    let needed = [Quantity::Time, Quantity::Temperature, Quantity::Rate].map(|q| take(q).unwrap_or_default());
    let (inner, ambient) = (take(Quantity::InnerTemperature), take(Quantity::AmbientTemperature));
    let [times_s, temperature_k, rate_rad_per_s] = needed;
    let mut record = Record::new(file, times_s, temperature_k, rate_rad_per_s)?;
    if let Some(inner_k) = inner {
        record = record.with_inner_k(inner_k)?;
    }
    if let Some(ambient_k) = ambient {
        record = record.with_ambient_k(ambient_k)?;
    }
    for (column, values) in columns.iter().zip(values) {
        if column.quantity == Quantity::Channel {
            record = record.with_channel(Channel { name: column.name.clone(), values })?;
        }
    }
    Ok(record)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_in_the_header_are_converted_and_other_columns_become_channels() {
        let source = "# a chamber\ntime_min, temperature_k ,rate_deg_per_s,supply_v\n0,293.15,0.001,5\n# pause\n\n1,294.15,0.002,5.1\n3,295.15,-1e-3,5.2\n";
        let record = parse_record("x.csv", source).unwrap();
        assert_eq!(record.times_s(), [0.0, 60.0, 180.0]);
        assert_eq!(record.temperature_k()[0], 293.15);
        assert!((record.rate_rad_per_s()[0] - 0.001_f64.to_radians()).abs() < 1e-18);
        assert_eq!(record.channels()[0], Channel { name: "supply_v".into(), values: vec![5.0, 5.1, 5.2] });
    }

    #[test]
    fn all_faults_come_at_once_with_line_and_column() {
        let source = "time_s,temperature_c,rate_deg_per_h\n0,20,0.1\n10,NaN,0.1\n5,20,\n20,20,inf\n30,20\n";
        let faults = parse_record("x.csv", source).unwrap_err();
        let messages: Vec<&str> = faults.faults.iter().map(|f| f.message.as_str()).collect();
        assert_eq!(
            messages,
            [
                "line 3, column temperature_c: expected a finite number, found \"NaN\"",
                "line 4, column time_s: times must increase strictly, found 5 after 10 s",
                "line 4, column rate_deg_per_h: expected a finite number, found nothing",
                "line 5, column rate_deg_per_h: expected a finite number, found \"inf\"",
                "line 6: expected 3 columns as in the header, found 2",
            ]
        );
        assert_eq!(&source[faults.faults[0].span.clone().unwrap()], "NaN");
    }

    #[test]
    fn a_header_with_a_wrong_unit_or_a_name_twice_says_what_was_expected() {
        let faults = parse_record("x.csv", "time_s,temperature_f,rate_deg_per_h,v,v\n").unwrap_err();
        let messages: Vec<&str> = faults.faults.iter().map(|f| f.message.as_str()).collect();
        assert_eq!(
            messages,
            [
                "column v is there twice: give each column a name of its own",
                "column temperature_c is missing: expected one of temperature_c, temperature_k, found temperature_f",
            ]
        );
    }

    #[test]
    fn kelvins_under_a_header_of_celsius_are_refused() {
        let faults =
            parse_record("x.csv", "time_s,temperature_c,rate_deg_per_h\n0,293,1\n1,293,1\n2,293,1\n").unwrap_err();
        assert!(faults.faults[0].message.contains("found a median of 293.00 °C"));
    }

    #[test]
    fn a_file_of_comments_and_one_of_semicolons_are_named_as_such() {
        assert!(parse_record("x", "# only\n").unwrap_err().faults[0].message.contains("comments only"));
        let semicolons = parse_record("x", "time_s;temperature_c;rate_deg_per_h\n0;1;2\n").unwrap_err();
        assert!(semicolons.faults[0].note.as_deref().unwrap().contains("commas"));
    }
}
