//! Tables as CSV that a person may open in a spreadsheet: every cell is one, none is a formula.

use serde::Serialize;

use crate::text::sink::Cell;

/// A table in memory, row by row.
#[derive(Debug)]
pub struct Table {
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
    pub fn with_header<'h>(header: impl IntoIterator<Item = &'h str>) -> Self {
        let mut table = Self::default();
        table.row(header.into_iter().map(Cell::plain));
        table
    }

    /// # Panics
    /// Where a row has another number of cells than the ones before.
    pub fn row(&mut self, cells: impl IntoIterator<Item = Cell>) {
        self.writer.write_record(cells).expect(IN_MEMORY);
    }

    pub fn into_bytes(self) -> Vec<u8> {
        self.writer.into_inner().expect(IN_MEMORY)
    }
}

/// Rows of one shape with their header.
///
/// # Errors
/// Rows that are no flat records.
pub fn rows_as_csv<T: Serialize>(rows: impl IntoIterator<Item = T>) -> Result<Vec<u8>, csv::Error> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_of_a_row_is_no_formula_and_its_numbers_stay_as_they_are() {
        #[derive(Serialize)]
        struct Row(f64, &'static str);
        let bytes = rows_as_csv([Row(-1.5, "=1+1"), Row(2.0, "a,b")]).unwrap();
        assert_eq!(String::from_utf8(bytes).unwrap(), "-1.5,'=1+1\n2.0,\"a,b\"\n");
    }
}
