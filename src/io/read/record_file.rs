//! Record files (CSV): a header with units in its names, one row a time, comments after `#`.
//!
//! Every number must be there and finite, and the times must increase strictly: a sensor that failed is a row that is
//! left out, which the rest of the program sees as a gap. Gross errors that are numbers are read as they are.

use std::io::Read;
use std::ops::Range;
use std::path::Path;

use crate::io::fault::{Fault, Faults};
use crate::io::files::read_text_up_to;
use crate::numeric::statistics::median;
use crate::record::{Channel, MIN_ROWS, Record, RecordError, TABLE_RATE};
use crate::units::{celsius_from_kelvin, deg_per_h_from_rad_per_s};

use super::averaging::{self, average};
use super::csv_rows::{CsvPiece, CsvRows};
use super::record_columns::{ColumnQuantity, FLAGS, RecordColumn, RecordFormat, read_header};
use super::record_rows::{Cells, CellsRead, NO_HEADER, PLAUSIBLE_C, assumptions, implausible, suspicions};
use super::table_file::Source;

/// Ten million rows of three columns or so.
const LARGEST_RECORD_BYTES: u64 = 512 * 1024 * 1024;
/// More faults than this are counted, not drawn.
const MOST_FAULTS: usize = 50;
/// A record, and what was noticed while reading it.
#[derive(Debug)]
pub struct ReadRecord {
    /// In SI units.
    pub record: Record,
    /// Rows that were skipped: a cell without a number, a stamp that repeats or jumps back.
    pub skipped_rows: usize,
    /// What was assumed or looks odd, in words.
    pub(crate) remarks: Vec<String>,
}

/// Reads and checks a record.
///
/// # Errors
/// All faults of the file at once, with line and column.
pub fn read_record(path: &Path) -> Result<Record, Faults> {
    Ok(read_record_as(path, &RecordFormat::default())?.record)
}

/// As [`read_record`], with columns, units and policies as stated; `-` is standard input.
///
/// # Errors
/// All faults of the file at once, with line and column.
pub(crate) fn read_record_as(path: &Path, format: &RecordFormat) -> Result<ReadRecord, Faults> {
    read_record_named(path, &path.display().to_string(), format)
}

/// As [`read_record_as`], of a file that faults call otherwise than by its path.
///
/// # Errors
/// All faults of the file at once, with line or row, and column.
pub(crate) fn read_record_named(path: &Path, name: &str, format: &RecordFormat) -> Result<ReadRecord, Faults> {
    let Some(table) = Source::open_other(path)? else {
        return parse_record_as(name, &read_text_up_to(path, LARGEST_RECORD_BYTES)?, format);
    };
    let (remarks, is_table) = (table.remarks().to_vec(), table.is_table());
    let mut text = String::new();
    let read = table.take(LARGEST_RECORD_BYTES + 1).read_to_string(&mut text);
    read.map_err(|e| Faults::of_file(name, format!("cannot be read: {e}")))?;
    if text.len() as u64 > LARGEST_RECORD_BYTES {
        let message = format!("expected a record of at most {LARGEST_RECORD_BYTES} bytes as CSV, found more");
        return Err(Faults::of_file(name, message));
    }
    let mut read = Reading { is_table, ..Reading::new(name, &text, format) }.record()?;
    read.remarks.splice(0..0, remarks);
    Ok(read)
}

/// As [`read_record_as`], of a text that was read already.
///
/// # Errors
/// All faults of the text at once.
pub fn parse_record_as(file: &str, source: &str, format: &RecordFormat) -> Result<ReadRecord, Faults> {
    Reading::new(file, source, format).record()
}

/// As [`read_record`], of a text that was read already.
///
/// # Errors
/// All faults of the text at once.
pub fn parse_record(file: &str, source: &str) -> Result<Record, Faults> {
    Ok(parse_record_as(file, source, &RecordFormat::default())?.record)
}

struct Reading<'s> {
    file: &'s str,
    source: &'s str,
    format: &'s RecordFormat,
    faults: Vec<Fault>,
    uncounted: usize,
    skipped: usize,
    /// Another program's, of which the text is only what was made of it.
    is_table: bool,
}

impl<'s> Reading<'s> {
    fn new(file: &'s str, source: &'s str, format: &'s RecordFormat) -> Self {
        Self { file, source, format, faults: Vec::new(), uncounted: 0, skipped: 0, is_table: false }
    }

    fn fault(&mut self, fault: Fault) {
        if self.faults.len() < MOST_FAULTS {
            self.faults.push(fault);
        } else {
            self.uncounted += 1;
        }
    }

    /// Whether further columns may hold words.
    fn lax(&self) -> bool {
        self.format.has_mapping() || self.is_table
    }

    #[expect(clippy::too_many_lines, reason = "head, rows and what is said of the whole, each of which may end it")]
    fn record(mut self) -> Result<ReadRecord, Faults> {
        let mut rows = CsvRows::new(self.source.as_bytes());
        if self.is_table {
            rows.number_rows();
        }
        // A text in memory does not fail.
        let Ok(Some(head)) = rows.record_head(self.format, |_| {}) else {
            return self.end(None, NO_HEADER);
        };
        let header_span = rows.span();
        if let CsvPiece::Broken(why) = head.piece {
            self.fault(Fault::new(format!("line {}: {why}", rows.line()), Some(header_span)));
            return self.end(None, "");
        }
        let fields: Vec<&str> = rows.names().collect();
        let columns = match read_header(&fields, &head.units, self.format, head.division) {
            Ok(columns) => columns,
            Err(faults) => {
                for (message, note) in faults {
                    self.fault(Fault { message, span: Some(header_span.clone()), note });
                }
                return self.end(None, "");
            }
        };
        let _ = rows.units_row(&head);
        rows.expect(columns.iter().map(|c| c.quantity == ColumnQuantity::Channel));
        let mut values: Vec<Vec<f64>> = vec![Vec::new(); columns.len()];
        let mut cells = Cells::new(&columns, self.format);
        while let Ok(Some(piece)) = rows.next() {
            if piece == CsvPiece::Aside {
                continue;
            }
            match cells.read(piece, &rows) {
                CellsRead::Row => values.iter_mut().zip(cells.numbers()).for_each(|(column, v)| column.push(*v)),
                CellsRead::Skipped => self.skipped += 1,
                CellsRead::Faults(faults) => {
                    for fault in faults {
                        let span = match fault.place {
                            Some(place) => rows.span_of_cell(place),
                            None => rows.span(),
                        };
                        self.fault(Fault {
                            message: fault.message,
                            span: Some(span),
                            note: fault.note.map(str::to_owned),
                        });
                    }
                    values.iter_mut().zip(cells.numbers()).for_each(|(column, v)| column.push(*v));
                }
            }
        }
        self.check_temperatures(&columns, &values, &header_span);
        self.gather_empty_columns(&columns, &values, &header_span);
        let rows = values.first().map_or(0, Vec::len);
        if self.faults.is_empty() && rows < MIN_ROWS {
            let skipped =
                if self.skipped > 0 { format!(" and {} that were skipped", self.skipped) } else { String::new() };
            self.fault(Fault::new(
                format!("expected at least {MIN_ROWS} rows of numbers, found {rows}{skipped}"),
                None,
            ));
        }
        if !self.faults.is_empty() {
            return self.end(None, "");
        }
        let mut remarks = head.remarks();
        remarks.extend(assumptions(&columns, head.division));
        let averaged = average(&columns, values, self.format.average_rows);
        remarks.extend(averaging::remark(self.format.average_rows, rows, averaged.first().map_or(0, Vec::len)));
        let skipped_rows = self.skipped;
        let built = build(self.file, self.lax(), &columns, averaged);
        match built {
            Ok(record) => {
                remarks.extend(suspicions(record.times_s(), record.temperature_k()));
                Ok(ReadRecord { record, skipped_rows, remarks })
            }
            Err(error) => self.end(Some(error), ""),
        }
    }

    fn check_temperatures(&mut self, columns: &[RecordColumn], values: &[Vec<f64>], header: &Range<usize>) {
        for (column, values) in columns.iter().zip(values) {
            let is_temperature = column.is_temperature();
            let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
            let middle_c = celsius_from_kelvin(median(&finite));
            if is_temperature && !finite.is_empty() && !PLAUSIBLE_C.contains(&middle_c) {
                self.fault(implausible(column, middle_c, Some(header.clone())));
            }
        }
    }

    /// A column that holds no number at all is one fault, not one a row.
    fn gather_empty_columns(&mut self, columns: &[RecordColumn], values: &[Vec<f64>], header: &Range<usize>) {
        for (column, values) in columns.iter().zip(values) {
            let may_hold_words = column.quantity == ColumnQuantity::Channel && (self.lax() || column.name == FLAGS);
            if values.len() < MIN_ROWS || values.iter().any(|v| v.is_finite()) || may_hold_words {
                continue;
            }
            let own = format!(", column {}: {}", column.name, column.expected());
            let before = self.faults.len();
            self.faults.retain(|f| !f.message.contains(&own));
            let shown = before - self.faults.len();
            self.uncounted = self.uncounted.saturating_sub(values.len() - shown);
            let what = if column.quantity == ColumnQuantity::Date {
                "date that is understood"
            } else if column.holds_stamps() {
                "stamp that is understood"
            } else {
                "finite number"
            };
            let message = format!("column {} holds no {what} in any of its {} rows", column.name, values.len());
            let note = match column.quantity {
                ColumnQuantity::Date | ColumnQuantity::Time if column.holds_stamps() => column.expected(),
                ColumnQuantity::Time | ColumnQuantity::Temperature | ColumnQuantity::Rate => {
                    "the sensor failed: measure again"
                }
                _ => "leave the column out",
            };
            self.fault(Fault::new(message, Some(header.clone())).with_note(note));
        }
    }

    fn end(mut self, error: Option<RecordError>, message: &str) -> Result<ReadRecord, Faults> {
        if let Some(error) = error {
            self.faults.push(Fault::new(error.to_string(), None));
        }
        if !message.is_empty() && self.faults.is_empty() {
            self.faults.push(Fault::new(message, None));
        }
        if self.uncounted > 0 {
            self.faults.push(Fault::new(format!("{} further faults of the same kinds", self.uncounted), None));
        }
        if self.is_table {
            self.faults.iter_mut().for_each(|fault| fault.span = None);
        }
        let source = if self.is_table { String::new() } else { self.source.to_owned() };
        Err(Faults { file: self.file.to_owned(), source, faults: self.faults })
    }
}

fn build(file: &str, lax: bool, columns: &[RecordColumn], mut values: Vec<Vec<f64>>) -> Result<Record, RecordError> {
    let mut take = |quantity: ColumnQuantity| {
        columns.iter().position(|c| c.quantity == quantity).map(|place| std::mem::take(&mut values[place]))
    };
    let needed =
        [ColumnQuantity::Time, ColumnQuantity::Temperature, ColumnQuantity::Rate].map(|q| take(q).unwrap_or_default());
    let (inner, ambient) = (take(ColumnQuantity::InnerTemperature), take(ColumnQuantity::AmbientTemperature));
    let table = take(ColumnQuantity::Table);
    let [times_s, temperature_k, mut rate_rad_per_s] = needed;
    if let Some(table) = &table {
        rate_rad_per_s.iter_mut().zip(table).for_each(|(rate, table)| *rate -= table);
    }
    let mut record = Record::new(file, times_s, temperature_k, rate_rad_per_s)?;
    if let Some(inner_k) = inner {
        record = record.with_inner_k(inner_k)?;
    }
    if let Some(ambient_k) = ambient {
        record = record.with_ambient_k(ambient_k)?;
    }
    if let Some(table) = table {
        let values = table.into_iter().map(deg_per_h_from_rad_per_s).collect();
        record = record.with_channel(Channel { name: TABLE_RATE.to_owned(), values })?;
    }
    for (column, values) in columns.iter().zip(values) {
        let holds_words = (lax || column.name == FLAGS) && values.iter().all(|v| !v.is_finite());
        if let Some(name) = column.channel().filter(|_| column.is_temperature() || !holds_words) {
            let values = values.into_iter().map(|value| column.in_channel(value)).collect();
            record = record.with_channel(Channel { name, values })?;
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
        let faults = parse_record("x.csv", "time_s,temperature_r,rate_deg_per_h,v,v\n").unwrap_err();
        let messages: Vec<&str> = faults.faults.iter().map(|f| f.message.as_str()).collect();
        assert_eq!(
            messages,
            [
                "column v is there twice: give each column a name of its own",
                "column temperature_c is missing: expected one of temperature_c, temperature_k, temperature_f, found temperature_r",
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
    fn a_file_of_comments_is_named_as_such() {
        assert!(parse_record("x", "# only\n").unwrap_err().faults[0].message.contains("comments only"));
    }

    /// The same record as loggers of other habits write it.
    #[test]
    fn other_separators_units_stamps_and_names_give_the_same_record() {
        let plain =
            parse_record("x", "time_s,temperature_c,rate_deg_per_h\n0,20,3.6\n60,21.5,7.2\n180,25,-3.6\n").unwrap();
        let cases = [
            ("", "time_min;temperature_k;rate_deg_per_s\n0;293,15;0,001\n1;294,65;0,002\n3;298,15;-0,001\n"),
            ("", "time_s\ttemperature_f\trate_arcsec_per_s\n0\t68\t3.6\n60\t70.7\t7.2\n180\t77\t-3.6\n"),
            (
                "time=Zeit,temperature=T1,rate=Omega",
                "Status;Zeit;T1;Omega\nOK;0;20;3,6\nOK;60;21,5;7,2\nAUS;180;25;-3,6\n",
            ),
            (
                "time=stamp:iso,temperature=T [K],rate=F:counts,scale=10",
                "stamp,T [K],F\n2026-03-01T10:00:00Z,293.15,36\n2026-03-01T10:01:00Z,294.65,72\n2026-03-01T10:03:00Z,298.15,-36\n",
            ),
            (
                "time=t:epoch_ms,temperature=T1:c,rate=w:rad_per_s",
                "t,T1,w\n1760000000000,20,1.7453292519943295e-5\n1760000060000,21.5,3.490658503988659e-5\n1760000180000,25,-1.7453292519943295e-5\n",
            ),
            ("rate=u:mv,scale=0.5", "time_h,temperature_c,u\n0,20,1.8\n0.016666666666666666,21.5,3.6\n0.05,25,-1.8\n"),
        ];
        for (mapping, text) in cases {
            let mut format = RecordFormat::default();
            format.map_all(mapping).unwrap();
            let read = parse_record_as("x", text, &format).unwrap().record;
            let columns = [
                (read.times_s(), plain.times_s()),
                (read.temperature_k(), plain.temperature_k()),
                (read.rate_rad_per_s(), plain.rate_rad_per_s()),
            ];
            for (found, expected) in columns {
                for (a, b) in found.iter().zip(expected) {
                    assert!((a - b).abs() <= 1e-9 * b.abs().max(1e-12), "{text}: {a} {b}");
                }
            }
            assert!(read.channels().is_empty(), "{text}");
        }
    }

    #[test]
    fn averaged_rows_end_at_the_last_stamp_and_leave_out_what_spans_a_gap() {
        let mut text = "time_s,temperature_c,rate_deg_per_h\n".to_owned();
        for i in (0..12).filter(|i| *i != 5) {
            text += &format!("{i},20,{i}\n");
        }
        let format = RecordFormat { average_rows: 2, ..RecordFormat::default() };
        let record = parse_record_as("x", &text, &format).unwrap().record;
        assert_eq!(record.times_s(), [1.0, 3.0, 8.0, 10.0]);
    }
}
