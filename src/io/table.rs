//! Tables as CSV that a person may open in a spreadsheet: every cell is one, none is a formula.

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::text::sink::{Cell, TomlComment};

/// A table in memory, row by row.
#[derive(Debug)]
pub(crate) struct Table {
    writer: csv::Writer<Vec<u8>>,
}

const IN_MEMORY: &str = "a buffer in memory takes every row";

impl Default for Table {
    fn default() -> Self {
        Self { writer: csv::Writer::from_writer(Vec::new()) }
    }
}

impl Table {
    /// The names of the columns, which are the program's own.
    pub(crate) fn with_header<'h>(header: impl IntoIterator<Item = &'h str>) -> Self {
        let mut table = Self::default();
        table.row(header.into_iter().map(Cell::plain));
        table
    }

    /// # Panics
    /// Where a row has another number of cells than the ones before.
    pub(crate) fn row(&mut self, cells: impl IntoIterator<Item = Cell>) {
        self.writer.write_record(cells).expect(IN_MEMORY);
    }

    pub(crate) fn into_bytes(self) -> Vec<u8> {
        self.writer.into_inner().expect(IN_MEMORY)
    }
}

/// Rows of one shape with their header.
///
/// # Errors
/// Rows that are no flat records.
pub(crate) fn rows_as_csv<T: Serialize>(rows: impl IntoIterator<Item = T>) -> Result<Vec<u8>, csv::Error> {
    let mut plain = csv::Writer::from_writer(Vec::new());
    for row in rows {
        plain.serialize(row)?;
    }
    let plain = plain.into_inner().map_err(|e| e.into_error())?;
    let mut table = Table::default();
    for row in csv::ReaderBuilder::new().has_headers(false).from_reader(plain.as_slice()).records() {
        table.row(row?.iter().map(Cell::text));
    }
    Ok(table.into_bytes())
}

/// Rows that the program wrote: every text is what it was before it became a cell.
///
/// # Errors
/// No table of such rows.
pub(crate) fn rows_of_csv<T: DeserializeOwned>(text: &str) -> Result<Vec<T>, csv::Error> {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let header = reader.headers()?.iter().map(Cell::read).collect::<csv::StringRecord>();
    reader
        .records()
        .map(|row| row?.iter().map(Cell::read).collect::<csv::StringRecord>().deserialize(Some(&header)))
        .collect()
}

/// How rows of a table that somebody else wrote are passed on: as they stand, but for what would act.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct PassedRow {
    pub(crate) separator: u8,
    pub(crate) decimal_comma: bool,
}

impl PassedRow {
    /// A row by its text and its cells.
    pub(crate) fn cells<'r>(self, text: &str, cells: impl Iterator<Item = &'r str> + Clone) -> String {
        let passed = |cell: &'r str| if self.is_number(cell) { Cell::plain(cell) } else { Cell::text(cell) };
        if cells.clone().all(|cell| Cell::leaves(cell) || self.is_number(cell)) {
            return text.to_owned();
        }
        let mut writer = csv::WriterBuilder::new().delimiter(self.separator).from_writer(Vec::new());
        writer.write_record(cells.map(passed)).expect(IN_MEMORY);
        let bytes = writer.into_inner().expect(IN_MEMORY);
        String::from_utf8_lossy(&bytes).trim_end_matches('\n').to_owned()
    }

    /// What is no row, as the first of so many cells.
    pub(crate) fn one_cell(self, text: &str, columns: usize) -> String {
        let rest = char::from(self.separator).to_string().repeat(columns.saturating_sub(1));
        format!("\"{}\"{rest}", Cell::text(text).as_str().replace('"', "\"\""))
    }

    /// A comment; a spreadsheet divides it into cells, too.
    pub(crate) fn aside(self, line: &str) -> String {
        let line = TomlComment::of(line).into_string();
        let separator = char::from(self.separator);
        let acts = |part: &str| {
            let part = part.trim_start();
            part.starts_with('"') || !Cell::leaves(part)
        };
        if !line.split(separator).any(acts) {
            return line;
        }
        let parts: Vec<String> = line
            .split(separator)
            .map(|part| if acts(part) { format!("'{}", part.trim_start()) } else { part.to_owned() })
            .collect();
        parts.join(&separator.to_string())
    }

    /// Whether a number of a row is written with a decimal comma.
    pub(crate) fn has_decimal_comma<'r>(self, mut cells: impl Iterator<Item = &'r str>) -> bool {
        cells.any(|cell| cell.contains(',') && self.is_number(cell))
    }

    fn is_number(self, cell: &str) -> bool {
        self.decimal_comma && cell.replacen(',', ".", 1).parse::<f64>().is_ok_and(f64::is_finite)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_that_is_passed_on_stays_as_it_is_unless_a_cell_would_act() {
        let comma = PassedRow { separator: b',', decimal_comma: false };
        let semicolon = PassedRow { separator: b';', decimal_comma: true };
        for (passed, text, cells, expected) in [
            (comma, "1, -2.5,\"a,b\"", vec!["1", "-2.5", "a,b"], "1, -2.5,\"a,b\""),
            (comma, "1,=1+1,\"a,b\"", vec!["1", "=1+1", "a,b"], "1,'=1+1,\"a,b\""),
            (comma, "1,-2,5", vec!["1", "-2", "5"], "1,-2,5"),
            (comma, "\u{1b}[2J,@x", vec!["\u{1b}[2J", "@x"], "\\u{1b}[2J,'@x"),
            (semicolon, "1;-2,5;+x", vec!["1", "-2,5", "+x"], "1;-2,5;'+x"),
            (semicolon, "-1,5;a", vec!["-1,5", "a"], "-1,5;a"),
        ] {
            assert_eq!(passed.cells(text, cells.into_iter()), expected);
        }
        assert_eq!(comma.one_cell("=\"1\",2", 3), "\"'=\"\"1\"\",2\",,");
        assert_eq!(comma.aside("# a, b"), "# a, b");
        assert_eq!(comma.aside("# a, =1+1,\"open\u{9b}"), "# a,'=1+1,'\"open\\u{9b}");
    }

    #[test]
    fn rows_are_read_back_as_they_were_before_they_became_cells() {
        #[derive(Debug, PartialEq, Serialize, serde::Deserialize)]
        struct Row {
            name: String,
            value: f64,
        }
        let rows = |names: [&str; 3]| names.map(|name| Row { name: name.to_owned(), value: -1.5 });
        let written = rows_as_csv(rows(["=1+1", "'=1+1", "a \"b\", c"])).unwrap();
        let read: Vec<Row> = rows_of_csv(std::str::from_utf8(&written).unwrap()).unwrap();
        assert_eq!(read, rows(["=1+1", "'=1+1", "a \"b\", c"]));
    }

    #[test]
    fn text_of_a_row_is_no_formula_and_its_numbers_stay_as_they_are() {
        #[derive(Serialize)]
        struct Row(f64, &'static str);
        let bytes = rows_as_csv([Row(-1.5, "=1+1"), Row(2.0, "a,b")]).unwrap();
        assert_eq!(String::from_utf8(bytes).unwrap(), "-1.5,'=1+1\n2.0,\"a,b\"\n");
    }
}
