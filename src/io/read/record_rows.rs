//! Rows of a record file one by one: what a row must be, what is skipped, what looks odd; and a record that passes by as a stream.

use std::io::{BufRead, BufReader, Read};
use std::ops::Range;

use crate::io::fault::{Fault, Faults};
use crate::numeric::statistics::median;
use crate::record::{LEAST_INTERVAL_S, MIN_ROWS, RecordError, RecordRow, usual_interval_s};
use crate::units::celsius_from_kelvin;

use super::averaging::{self, Averager};
use super::csv_rows::{CsvPiece, CsvRows};
use super::record_columns::{ColumnQuantity, Division, FLAGS, RecordColumn, RecordFormat, SensorPlace, read_header};
use super::record_head::Head;
use super::table_file::Source;

/// A coil that is mostly outside of this is in other units than its header says.
pub(super) const PLAUSIBLE_C: Range<f64> = -150.0..200.0;
/// Room temperature as °F, when °C is stated.
const ROOM_AS_FAHRENHEIT: Range<f64> = 62.0..86.0;
/// No chamber is faster: 30 °C/min.
const FASTEST_K_PER_S: f64 = 0.5;
/// Of temperature, below which nothing is said of how fast it changes.
const LEAST_SWING_K: f64 = 5.0;
/// Times above this are seconds of a calendar; they count from the first row.
const CALENDAR_S: f64 = 1e8;
/// Of a day, with what a clock's change and a leap second may add.
const DAY_S: Range<f64> = 0.0..90_001.0;
/// Rows of a stream that are handed on together.
pub(crate) const CHUNK: usize = 65_536;
const MOST_FAULTS: usize = 50;

/// What is wrong with a row, or with one of its cells.
#[derive(Debug)]
pub(super) struct CellFault {
    pub(crate) message: String,
    pub(crate) place: Option<usize>,
    pub(crate) note: Option<&'static str>,
}

/// What became of a row; its numbers are in [`Cells::numbers`].
#[derive(Debug)]
pub(super) enum CellsRead {
    Row,
    Skipped,
    Faults(Vec<CellFault>),
}

/// Turns the cells of each row into numbers in SI.
#[derive(Debug)]
pub(super) struct Cells<'c> {
    columns: &'c [RecordColumn],
    skips: bool,
    /// Further columns may hold words.
    lax: bool,
    numbers: Vec<f64>,
    last_s: Option<f64>,
    /// Of the times, and the date where they have one.
    origin_s: Option<(f64, f64)>,
}

impl<'c> Cells<'c> {
    pub(super) fn new(columns: &'c [RecordColumn], format: &RecordFormat) -> Self {
        let is_compensated = format.compensated && columns.iter().any(|c| c.name == FLAGS);
        Self {
            columns,
            skips: format.skips_bad_rows || is_compensated,
            lax: format.has_mapping() || format.skips_bad_rows,
            numbers: Vec::with_capacity(columns.len()),
            last_s: None,
            origin_s: None,
        }
    }

    /// Of the row that was read last; NaN where there is no number.
    pub(super) fn numbers(&self) -> &[f64] {
        &self.numbers
    }

    /// What was read last of a text.
    #[expect(clippy::too_many_lines, reason = "each kind of cell beside what is said where it is wrong")]
    pub(super) fn read(&mut self, piece: CsvPiece, row: &CsvRows<impl BufRead>) -> CellsRead {
        self.numbers.clear();
        if let CsvPiece::Broken(why) = piece {
            if self.skips {
                return CellsRead::Skipped;
            }
            let fault = CellFault { message: format!("{}: {why}", row.place()), place: None, note: None };
            return CellsRead::Faults(vec![fault]);
        }
        if row.len() != self.columns.len() {
            if self.skips {
                return CellsRead::Skipped;
            }
            let (place, wanted) = (row.place(), self.columns.len());
            let message = format!("{place}: expected {wanted} columns as in the header, found {}", row.len());
            return CellsRead::Faults(vec![CellFault { message, place: None, note: None }]);
        }
        let mut faults = Vec::new();
        let date_s = self.date_of(row.cells());
        for (place, (column, field)) in self.columns.iter().zip(row.cells()).enumerate() {
            let number = match column.value(field) {
                // Without its date no time of day is one; the date's own cell is the fault.
                Ok(_) if column.quantity == ColumnQuantity::Time && date_s == Some(Err(())) => f64::NAN,
                Ok(value) if column.quantity == ColumnQuantity::Time && date_s.is_some() && !DAY_S.contains(&value) => {
                    faults.push(CellFault {
                        message: format!(
                            "{}, column {}: expected a time of day beside the date, found {field}",
                            row.place(),
                            column.name
                        ),
                        place: Some(place),
                        note: Some("a column that holds date and time needs no other for the date"),
                    });
                    f64::NAN
                }
                Ok(value) if column.quantity == ColumnQuantity::Time => {
                    match self.time(value, date_s.and_then(Result::ok)) {
                        Ok(value) => value,
                        Err(before_s) => {
                            faults.push(CellFault {
                                message: format!(
                                    "{}, column {}: times must increase strictly, found {field} after {before_s} s",
                                    row.place(),
                                    column.name
                                ),
                                place: Some(place),
                                note: Some("sort the rows, or skip those that repeat or jump back: --bad-rows skip"),
                            });
                            value
                        }
                    }
                }
                Ok(value) => value,
                Err(_)
                    if column.quantity == ColumnQuantity::Channel
                        && (self.lax || row.numbers_rows() || column.name == FLAGS) =>
                {
                    f64::NAN
                }
                Err(found) => {
                    faults.push(CellFault {
                        message: format!(
                            "{}, column {}: {}, found {found}",
                            row.place(),
                            column.name,
                            column.expected()
                        ),
                        place: Some(place),
                        note: Some(column.remedy(field)),
                    });
                    f64::NAN
                }
            };
            self.numbers.push(number);
        }
        if !faults.is_empty() {
            return if self.skips { CellsRead::Skipped } else { CellsRead::Faults(faults) };
        }
        if let Some(place) = self.columns.iter().position(|c| c.quantity == ColumnQuantity::Time) {
            self.last_s = Some(self.numbers[place]);
        }
        CellsRead::Row
    }

    /// Seconds since 1970 at the midnight of the row's date; none where dates have no column of their own.
    fn date_of<'r>(&self, mut cells: impl Iterator<Item = &'r str>) -> Option<Result<f64, ()>> {
        let (place, column) = self.columns.iter().enumerate().find(|(_, c)| c.quantity == ColumnQuantity::Date)?;
        Some(column.value(cells.nth(place)?).map_err(|_| ()))
    }

    /// Since the first row where it is a calendar's; the time before where it does not increase.
    fn time(&mut self, value: f64, date_s: Option<f64>) -> Result<f64, f64> {
        let calendar = if value > CALENDAR_S { value } else { 0.0 };
        let (origin_s, first_date_s) =
            *self.origin_s.get_or_insert(date_s.map_or((calendar, 0.0), |date_s| (value, date_s)));
        // Whole days first, so that the fractions of a second stay what they are.
        let value = date_s.map_or(0.0, |date_s| date_s - first_date_s) + value - origin_s;
        let before = self.last_s.filter(|before| value <= *before);
        if !self.skips {
            self.last_s = Some(value);
        }
        before.map_or(Ok(value), Err)
    }
}

/// Units that nothing stated, and how cells are divided where that is not by commas.
pub(super) fn assumptions(columns: &[RecordColumn], division: Division) -> Vec<String> {
    let mut said = Vec::new();
    if division.separator != b',' {
        let name = match division.separator {
            b';' => "semicolons",
            b'|' => "bars",
            _ => "tabs",
        };
        said.push(format!("{name} between columns; a comma inside a number is a decimal comma"));
    }
    if let Some(table) = columns.iter().find(|c| c.quantity == ColumnQuantity::Table) {
        said.push(format!(
            "column {} is the table's rate and is taken off: what is left is the gyro's error",
            table.name
        ));
    }
    for column in columns {
        if let (ColumnQuantity::Sensor(place), Some(name)) = (column.quantity, column.channel()) {
            let use_of_it = match place {
                SensorPlace::Layer(_) => "`compare` sets it beside the model's layer",
                _ => "the model's heat does not read it",
            };
            said.push(format!(
                "column {} is a further thermometer, {name} to effects and formulas; {use_of_it}",
                column.name
            ));
        }
        if let Some(unit) = column.assumed_unit() {
            let of = if column.quantity == ColumnQuantity::Time { "numbers in it, not stamps, are " } else { "" };
            said.push(format!("column {} states no unit: {of}taken as {unit}", column.name));
        }
    }
    said
}

/// What does not look like what it is said to be.
pub(super) fn suspicions(times_s: &[f64], temperature_k: &[f64]) -> Vec<String> {
    let mut said = Vec::new();
    let (Some(first), Some(last)) = (times_s.first(), times_s.last()) else { return said };
    let first_c = temperature_k.first().map_or(f64::NAN, |k| celsius_from_kelvin(*k));
    if ROOM_AS_FAHRENHEIT.contains(&first_c) {
        said.push(format!(
            "the record begins at {first_c:.1} °C: if that is room temperature, the column is in °F (temperature_f, or --columns temperature=NAME:f)"
        ));
    }
    let (low, high) = temperature_k.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    let duration_s = last - first;
    if high - low > LEAST_SWING_K && high - low > FASTEST_K_PER_S * duration_s {
        said.push(format!(
            "the temperature changes by {:.0} °C within {duration_s} s: if times are in minutes or hours, say so (time_min, time_h, or --columns time=NAME:h)",
            high - low
        ));
    }
    said
}

/// A stamp that contradicts what the model says of how rates are averaged; None where it does not.
pub(crate) fn contradicts_mean(interval_s: f64, rate_mean_s: f64) -> Option<String> {
    let is_odd = rate_mean_s > 0.0 && (rate_mean_s > 1.01 * interval_s || rate_mean_s < 0.5 * interval_s);
    is_odd.then(|| {
        format!(
            "rows are {interval_s} s apart, but sensor.rate_mean_s = {rate_mean_s}: is each rate really the mean over {rate_mean_s} s before its stamp?"
        )
    })
}

/// What a stream was, beside its rows.
#[derive(Debug, Default)]
pub struct StreamNoticed {
    pub(crate) rows: usize,
    /// Rows without a number where one is needed.
    pub skipped_rows: usize,
    pub(crate) remarks: Vec<String>,
}

/// Reads a record row by row and hands them on in chunks, in memory that does not grow.
///
/// # Errors
/// All faults of the input at once, with line and column.
pub fn stream_rows(
    name: &str,
    input: impl Read,
    format: &RecordFormat,
    sink: impl FnMut(&[RecordRow]),
) -> Result<StreamNoticed, Faults> {
    stream_source(name, Source::text(input), format, sink)
}

/// As [`stream_rows`], of a text or of another program's table.
///
/// # Errors
/// All faults of the input at once, with line or row, and column.
#[expect(clippy::too_many_lines, reason = "one loop over rows whose state nothing else has")]
pub(crate) fn stream_source(
    name: &str,
    source: Source<'_>,
    format: &RecordFormat,
    mut sink: impl FnMut(&[RecordRow]),
) -> Result<StreamNoticed, Faults> {
    let (is_table, remarks) = (source.is_table(), source.remarks().to_vec());
    let mut rows = CsvRows::new(BufReader::with_capacity(1 << 18, source));
    if is_table {
        rows.number_rows();
    }
    let unreadable = |e: std::io::Error| Faults::of_file(name, format!("cannot be read: {e}"));
    let Some(head) = rows.record_head(format, |_| {}).map_err(unreadable)? else {
        return Err(Faults::of_file(name, NO_HEADER));
    };
    let columns = header_columns(name, &head, &rows, format)?;
    rows.units_row(&head).map_err(unreadable)?;
    rows.expect(columns.iter().map(|c| c.quantity == ColumnQuantity::Channel));
    let place = |quantity: ColumnQuantity| columns.iter().position(|c| c.quantity == quantity).unwrap_or(0);
    let (time, temperature, rate) =
        (place(ColumnQuantity::Time), place(ColumnQuantity::Temperature), place(ColumnQuantity::Rate));
    let table = columns.iter().position(|c| c.quantity == ColumnQuantity::Table);
    let mut cells = Cells::new(&columns, format);
    let remarks = remarks.into_iter().chain(head.remarks()).chain(assumptions(&columns, head.division)).collect();
    let mut noticed = StreamNoticed { remarks, ..StreamNoticed::default() };
    let (mut faults, mut uncounted) = (Vec::new(), 0);
    let mut chunk: Vec<RecordRow> = Vec::with_capacity(CHUNK);
    let mut averager = Averager::new(format.average_rows);
    loop {
        let piece = match rows.next().map_err(unreadable)? {
            Some(CsvPiece::Aside) => continue,
            Some(piece) => piece,
            None => break,
        };
        match cells.read(piece, &rows) {
            CellsRead::Row if faults.is_empty() => {
                let numbers = cells.numbers();
                let table_rad_per_s = table.map(|place| numbers[place]);
                chunk.push(RecordRow {
                    time_s: numbers[time],
                    temperature_k: numbers[temperature],
                    rate_rad_per_s: numbers[rate] - table_rad_per_s.unwrap_or(0.0),
                    table_rad_per_s,
                });
                noticed.rows += 1;
                if chunk.len() == CHUNK {
                    look(&chunk, noticed.rows == CHUNK, &columns[temperature], &mut noticed.remarks, &mut faults);
                    sink(averager.averaged(&chunk));
                    chunk.clear();
                }
            }
            CellsRead::Row => {}
            CellsRead::Skipped => noticed.skipped_rows += 1,
            CellsRead::Faults(found) if faults.len() < MOST_FAULTS => {
                faults.extend(found.into_iter().map(|f| Fault {
                    message: f.message,
                    span: None,
                    note: f.note.map(str::to_owned),
                }));
            }
            CellsRead::Faults(found) => uncounted += found.len(),
        }
    }
    if faults.is_empty() && noticed.rows < MIN_ROWS {
        let message = format!("expected at least {MIN_ROWS} rows of numbers, found {}", noticed.rows);
        faults.push(Fault::new(message, None));
    }
    look(
        &chunk,
        noticed.rows <= CHUNK && noticed.rows == chunk.len(),
        &columns[temperature],
        &mut noticed.remarks,
        &mut faults,
    );
    if !faults.is_empty() {
        if uncounted > 0 {
            faults.push(Fault::new(format!("{uncounted} further faults of the same kinds"), None));
        }
        return Err(Faults { file: name.to_owned(), source: String::new(), faults });
    }
    if !chunk.is_empty() {
        sink(averager.averaged(&chunk));
    }
    noticed.remarks.extend(averaging::remark(format.average_rows, noticed.rows, averager.made()));
    Ok(noticed)
}

/// The first rows show whether the units are what they are said to be.
fn look(
    chunk: &[RecordRow],
    is_first: bool,
    temperature: &RecordColumn,
    remarks: &mut Vec<String>,
    faults: &mut Vec<Fault>,
) {
    if !is_first || chunk.is_empty() {
        return;
    }
    let times_s: Vec<f64> = chunk.iter().map(|r| r.time_s).collect();
    let temperature_k: Vec<f64> = chunk.iter().map(|r| r.temperature_k).collect();
    remarks.extend(suspicions(&times_s, &temperature_k));
    if times_s.len() >= MIN_ROWS {
        let found_s = usual_interval_s(&times_s);
        if found_s < LEAST_INTERVAL_S {
            faults.push(Fault::new(RecordError::Interval { found_s }.to_string(), None));
        }
    }
    let middle_c = celsius_from_kelvin(median(&temperature_k));
    if !PLAUSIBLE_C.contains(&middle_c) {
        faults.push(implausible(temperature, middle_c, None));
    }
}

/// A column whose numbers are no coil's temperature in its unit.
pub(super) fn implausible(column: &RecordColumn, middle_c: f64, span: Option<Range<usize>>) -> Fault {
    let message = format!(
        "column {}: expected a coil's temperature between {} and {} °C, found a median of {middle_c:.2} °C",
        column.name, PLAUSIBLE_C.start, PLAUSIBLE_C.end
    );
    Fault::new(message, span).with_note("a name that ends in _c holds degrees Celsius, one that ends in _k kelvin")
}

/// What is said of a text without a header.
pub(in crate::io) const NO_HEADER: &str =
    "the file holds comments only: expected a header such as time_s,temperature_c,rate_deg_per_h";

/// The columns that a header says, which was read last.
///
/// # Errors
/// All faults of the header at once.
pub(in crate::io) fn header_columns(
    name: &str,
    head: &Head,
    header: &CsvRows<impl BufRead>,
    format: &RecordFormat,
) -> Result<Vec<RecordColumn>, Faults> {
    let source = header.text();
    let fault = |(message, note)| Fault { message, span: Some(0..source.len()), note };
    let all = |faults: Vec<Fault>| Faults { file: name.to_owned(), source: source.to_owned(), faults };
    if let CsvPiece::Broken(why) = head.piece {
        return Err(all(vec![fault((format!("line {}: {why}", header.line()), None))]));
    }
    let fields: Vec<&str> = header.names().collect();
    read_header(&fields, &head.units, format, head.division)
        .map_err(|faults| all(faults.into_iter().map(fault).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(text: &str, format: &RecordFormat) -> Result<(Vec<RecordRow>, StreamNoticed), Faults> {
        let mut found = Vec::new();
        let noticed = stream_rows("x", text.as_bytes(), format, |chunk| found.extend_from_slice(chunk))?;
        Ok((found, noticed))
    }

    #[test]
    fn bad_rows_are_refused_with_their_lines_or_skipped_and_counted() {
        let text =
            "# a\ntime_s,temperature_c,rate_deg_per_h\n0,20,1\n1,,1\n2,20,1\n2,20,1\n1,20,1\n3,20,1\n4,20\n5,20,1\n";
        let faults = rows(text, &RecordFormat::default()).unwrap_err();
        let messages: Vec<&str> = faults.faults.iter().map(|f| f.message.as_str()).collect();
        assert_eq!(messages[0], "line 4, column temperature_c: expected a finite number, found nothing");
        assert_eq!(messages.len(), 4, "{messages:?}");
        let format = RecordFormat { skips_bad_rows: true, ..RecordFormat::default() };
        let (found, noticed) = rows(text, &format).unwrap();
        assert_eq!(found.iter().map(|r| r.time_s).collect::<Vec<_>>(), [0.0, 2.0, 3.0, 5.0]);
        assert_eq!(noticed.skipped_rows, 4);
    }

    #[test]
    fn what_looks_like_other_units_is_said() {
        let times: Vec<f64> = (0..100).map(|i| 0.01 * f64::from(i)).collect();
        let ramp: Vec<f64> = (0..100).map(|i| 341.0 + 0.4 * f64::from(i)).collect();
        let said = suspicions(&times, &ramp).join("\n");
        assert!(said.contains("°F") && said.contains("time_h"), "{said}");
        assert!(suspicions(&[0.0, 3600.0], &[293.0, 333.0]).is_empty());
        assert!(contradicts_mean(1.0, 10.0).is_some() && contradicts_mean(10.0, 10.0).is_none());
    }
}
