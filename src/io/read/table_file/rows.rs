//! Columns of a table as CSV text, block by block.

use std::fmt::Write as _;
use std::io::{self, Read};

/// Rows that are turned into text at once.
pub(super) const BLOCK_ROWS: usize = 16_384;

/// Some rows of one column.
#[derive(Debug)]
pub(super) enum ColumnValues {
    /// NaN is a missing value.
    Numbers(Vec<f64>),
    Texts(Vec<String>),
}

impl ColumnValues {
    fn len(&self) -> usize {
        match self {
            ColumnValues::Numbers(numbers) => numbers.len(),
            ColumnValues::Texts(texts) => texts.len(),
        }
    }
}

/// A table that is read from its beginning to its end.
pub(super) trait TableColumns {
    fn names(&self) -> Vec<String>;

    /// The next rows, column by column; none at the end.
    ///
    /// # Errors
    /// A file that is damaged, in words.
    fn block(&mut self) -> Result<Option<Vec<ColumnValues>>, String>;
}

/// The text of a table.
pub(super) struct TableText<C> {
    columns: C,
    has_begun: bool,
    text: String,
    taken: usize,
}

impl<C: TableColumns> TableText<C> {
    pub(super) fn new(columns: C) -> Self {
        Self { columns, has_begun: false, text: String::new(), taken: 0 }
    }

    /// Whether there was more.
    fn fill(&mut self) -> io::Result<bool> {
        (self.taken, self.text) = (0, std::mem::take(&mut self.text));
        self.text.clear();
        if !std::mem::replace(&mut self.has_begun, true) {
            for (i, name) in self.columns.names().iter().enumerate() {
                push_text(&mut self.text, i, name);
            }
            self.text.push('\n');
            return Ok(true);
        }
        let Some(block) = self.columns.block().map_err(io::Error::other)? else { return Ok(false) };
        let rows = block.iter().map(ColumnValues::len).min().unwrap_or(0);
        for row in 0..rows {
            for (i, values) in block.iter().enumerate() {
                match values {
                    ColumnValues::Numbers(numbers) => {
                        if i > 0 {
                            self.text.push(',');
                        }
                        if !numbers[row].is_nan() {
                            // The shortest digits that are read again as the same number.
                            write!(self.text, "{:?}", numbers[row]).map_err(io::Error::other)?;
                        }
                    }
                    ColumnValues::Texts(texts) => push_text(&mut self.text, i, &texts[row]),
                }
            }
            self.text.push('\n');
        }
        Ok(rows > 0)
    }
}

/// In quotes, on one line: so that rows are counted as the file has them.
fn push_text(line: &mut String, place: usize, text: &str) {
    if place > 0 {
        line.push(',');
    }
    line.push('"');
    for c in text.chars() {
        match c {
            '"' => line.push_str("\"\""),
            '\n' | '\r' => line.push(' '),
            other => line.push(other),
        }
    }
    line.push('"');
}

impl<C: TableColumns> Read for TableText<C> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.taken == self.text.len() && !self.fill()? {
            return Ok(0);
        }
        let left = &self.text.as_bytes()[self.taken..];
        let count = left.len().min(buffer.len());
        buffer[..count].copy_from_slice(&left[..count]);
        self.taken += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Two(usize);

    impl TableColumns for Two {
        fn names(&self) -> Vec<String> {
            vec!["#a;\"b\"".to_owned(), "c".to_owned()]
        }

        fn block(&mut self) -> Result<Option<Vec<ColumnValues>>, String> {
            self.0 += 1;
            let numbers = ColumnValues::Numbers(vec![0.1, f64::NAN, 1e-9]);
            let texts = ColumnValues::Texts(vec!["x\ny".into(), "a,b".into(), String::new()]);
            match self.0 {
                1 => Ok(Some(vec![numbers, texts])),
                2 => Ok(None),
                _ => Err("read beyond its end".to_owned()),
            }
        }
    }

    #[test]
    fn a_table_is_written_as_the_rows_that_a_text_would_hold() {
        let mut text = String::new();
        TableText::new(Two(0)).read_to_string(&mut text).unwrap();
        assert_eq!(text, "\"#a;\"\"b\"\"\",\"c\"\n0.1,\"x y\"\n,\"a,b\"\n1e-9,\"\"\n");
    }
}
