//! Rows of a CSV text one by one: the one parser of records, as files and as streams.
//!
//! A row is what the CSV grammar takes for one (RFC 4180: cells in quotes may hold separators, quotes and line breaks), and it
//! keeps its text as it stands, so that it can be passed on. A line that begins with `#`, and an empty one, is no row. A quote
//! that is not closed within `MOST_LINES` does not swallow what follows: its line is broken, and reading goes on behind it. So is one
//! that only a stray quote further down closes: what both make is no row of the columns that are expected.

use std::collections::VecDeque;
use std::io::{self, BufRead};
use std::ops::Range;

use csv_core::{ReadRecordResult, ReaderBuilder};

use super::record_columns::Division;
use crate::text::is_unseen;
use crate::text::sink::Cell;

/// A longer line is no row of a record.
const LONGEST_LINE_BYTES: usize = 1 << 20;
/// Lines that one row may span.
const MOST_LINES: usize = 64;
/// Bytes that one row may span where it has several lines.
const MOST_BYTES: usize = 1 << 16;

/// What stands at one place of the text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum CsvPiece {
    /// A comment or an empty line.
    Aside,
    Row,
    /// A line that is none, in words.
    Broken(&'static str),
}

const UNCLOSED: &str = "a quote opens that is not closed";
const TOO_LONG: &str = "the line is longer than a million bytes";
const NO_TEXT: &str = "expected text in UTF-8, found other bytes: is it the right file?";

/// A line with what ended it.
#[derive(Debug, Clone)]
pub(super) struct PhysicalLine {
    pub(super) bytes: Vec<u8>,
    pub(super) is_whole: bool,
}

/// Goes through a text; what was read last is asked for by [`CsvRows::text`] and [`CsvRows::cells`].
pub(crate) struct CsvRows<R> {
    input: R,
    grammar: csv_core::Reader,
    separator: u8,
    /// Lines that were read on the search for a closing quote.
    ahead: VecDeque<PhysicalLine>,
    after_carriage_return: bool,
    inside_long_line: bool,
    is_text: bool,
    text: String,
    line: u64,
    lines_of_piece: u64,
    start: usize,
    bytes_of_piece: usize,
    numbers_rows: bool,
    /// Of each column whether a cell of it may be words, and so hold a line break; empty where nothing is known of them yet.
    may_hold_words: Vec<bool>,
    buffer: Vec<u8>,
    cells: String,
    ends: Vec<usize>,
    count: usize,
}

#[allow(clippy::len_without_is_empty)]
impl<R: BufRead> CsvRows<R> {
    pub(crate) fn new(input: R) -> Self {
        Self {
            input,
            grammar: csv_core::Reader::new(),
            separator: b',',
            ahead: VecDeque::new(),
            after_carriage_return: false,
            inside_long_line: false,
            is_text: true,
            text: String::new(),
            line: 1,
            lines_of_piece: 0,
            start: 0,
            bytes_of_piece: 0,
            numbers_rows: false,
            may_hold_words: Vec::new(),
            buffer: Vec::new(),
            cells: String::new(),
            ends: vec![0; 16],
            count: 0,
        }
    }

    /// Reads the header: the first piece that is a row, by whose separators the rest is divided.
    ///
    /// `aside` gets the lines before it. None where there is no header.
    ///
    /// # Errors
    /// An input that fails.
    pub(crate) fn header(&mut self, mut aside: impl FnMut(&str)) -> io::Result<Option<(CsvPiece, Division)>> {
        while let Some(first) = self.next_line()? {
            let line = String::from_utf8_lossy(&first.bytes);
            let line = line.trim_start_matches('\u{feff}');
            if is_aside(line) {
                self.begin_piece();
                self.take(&first);
                aside(line.trim_end_matches(['\r', '\n']));
                continue;
            }
            let division = Division::of_header(line.lines().next().unwrap_or_default());
            self.separator = division.separator;
            self.grammar = ReaderBuilder::new().delimiter(division.separator).build();
            self.ahead.push_front(first);
            return Ok(self.next()?.map(|piece| (piece, division)));
        }
        Ok(None)
    }

    /// Says what follows the header: of each column whether its cells may be words.
    pub(crate) fn expect(&mut self, may_hold_words: impl Iterator<Item = bool>) {
        self.may_hold_words = may_hold_words.collect();
    }

    /// Reads on; none at the end.
    ///
    /// # Errors
    /// An input that fails.
    #[allow(clippy::should_implement_trait, reason = "what it gives borrows from it and may fail")]
    pub(crate) fn next(&mut self) -> io::Result<Option<CsvPiece>> {
        self.begin_piece();
        let Some(first) = self.next_line()? else { return Ok(None) };
        let is_first = self.start == 0;
        self.take(&first);
        if is_first && self.text.starts_with('\u{feff}') {
            // A byte-order mark belongs to no column's name.
            self.text.drain(..'\u{feff}'.len_utf8());
            self.start += '\u{feff}'.len_utf8();
            self.bytes_of_piece -= '\u{feff}'.len_utf8();
        }
        if !first.is_whole || self.inside_long_line {
            self.inside_long_line = !first.is_whole;
            return Ok(Some(self.broken(TOO_LONG)));
        }
        if is_aside(&self.text) {
            self.end_text();
            return Ok(Some(CsvPiece::Aside));
        }
        self.count = 0;
        let mut further = Vec::new();
        loop {
            let is_closed = self.parse();
            if is_closed && (further.is_empty() || self.is_expected()) {
                break;
            }
            let next = match !is_closed && further.len() + 1 < MOST_LINES && self.text.len() < MOST_BYTES {
                true => self.next_line()?,
                false => None,
            };
            let next = match next {
                Some(next) if next.is_whole => next,
                unread => {
                    // What the quote would have swallowed is read again, line by line.
                    let swallowed: usize = further.iter().map(|line: &PhysicalLine| line.bytes.len()).sum();
                    self.bytes_of_piece -= swallowed;
                    self.lines_of_piece -= further.len() as u64;
                    self.text = String::from_utf8_lossy(&first.bytes).into_owned();
                    further.into_iter().chain(unread).rev().for_each(|line| self.ahead.push_front(line));
                    return Ok(Some(self.broken(UNCLOSED)));
                }
            };
            self.take(&next);
            further.push(next);
        }
        if !self.is_text {
            return Ok(Some(self.broken(NO_TEXT)));
        }
        self.end_text();
        Ok(Some(CsvPiece::Row))
    }

    /// As it stands, without its line break.
    pub(crate) fn text(&self) -> &str {
        &self.text
    }

    /// The number of the line that it begins in, counted from 1.
    pub(crate) fn line(&self) -> u64 {
        self.line
    }

    /// Rows are told by their numbers from here on, each being a line behind a header of one.
    pub(crate) fn number_rows(&mut self) {
        self.numbers_rows = true;
    }

    /// Whether it is another program's table, of which it is known what holds words.
    pub(crate) fn numbers_rows(&self) -> bool {
        self.numbers_rows
    }

    /// Where it stands, for a reader.
    pub(crate) fn place(&self) -> String {
        match self.numbers_rows {
            true => format!("row {}", self.line - 1),
            false => format!("line {}", self.line),
        }
    }

    /// Where it stands, in bytes from the text's beginning (of an input that is in memory).
    pub(crate) fn span(&self) -> Range<usize> {
        self.start..self.start + self.text.len()
    }

    /// How many cells the row has; 0 where it is none.
    #[allow(clippy::len_without_is_empty)] // Asked of rows only.
    pub(crate) fn len(&self) -> usize {
        self.count
    }

    /// The cells without their quotes, the spaces around them, and what keeps a spreadsheet from calculating them.
    pub(crate) fn cells(&self) -> impl Iterator<Item = &str> + Clone {
        self.bare_cells().map(|cell| Cell::read(cell.trim()))
    }

    /// As [`CsvRows::cells`] of a header: what is not seen around a name is left for whoever checks names.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> + Clone {
        self.bare_cells().map(|cell| Cell::read(cell.trim_matches(|c: char| c.is_whitespace() && !is_unseen(c))))
    }

    fn bare_cells(&self) -> impl Iterator<Item = &str> + Clone {
        (0..self.count).map(|i| {
            let from = if i == 0 { 0 } else { self.ends[i - 1] };
            self.cells.get(from..self.ends[i]).unwrap_or_default()
        })
    }

    /// Whether a row of several lines is one of the columns that are expected.
    fn is_expected(&self) -> bool {
        let holds_break = |cell: &str| cell.trim().contains(['\n', '\r']);
        self.may_hold_words.is_empty()
            || (self.count == self.may_hold_words.len()
                && self.bare_cells().zip(&self.may_hold_words).all(|(cell, words)| *words || !holds_break(cell)))
    }

    /// The place of a cell in the text; all of it where quotes hide the separators.
    pub(crate) fn span_of_cell(&self, place: usize) -> Range<usize> {
        let separator = char::from(self.separator);
        if self.text.contains('"') {
            return self.span();
        }
        let before: usize = self.text.split(separator).take(place).map(|cell| cell.len() + 1).sum();
        let length = self.text.split(separator).nth(place).map_or(0, str::len);
        self.start + before..self.start + before + length
    }

    /// Whether whoever feeds the input has sent nothing more so far.
    pub(crate) fn waits(&mut self) -> bool
    where
        R: Buffered,
    {
        self.ahead.is_empty() && self.input.is_drained()
    }

    /// Lines that were looked at are still to be read.
    pub(super) fn put_back(&mut self, lines: Vec<PhysicalLine>) {
        lines.into_iter().rev().for_each(|line| self.ahead.push_front(line));
    }

    pub(super) fn begin_piece(&mut self) {
        self.line += self.lines_of_piece;
        self.start += self.bytes_of_piece;
        self.lines_of_piece = 0;
        self.bytes_of_piece = 0;
        self.text.clear();
        self.is_text = true;
        self.count = 0;
    }

    pub(super) fn take(&mut self, line: &PhysicalLine) {
        self.bytes_of_piece += line.bytes.len();
        self.lines_of_piece += u64::from(line.is_whole);
        match std::str::from_utf8(&line.bytes) {
            Ok(text) => self.text.push_str(text),
            Err(_) => {
                self.text.push_str(&String::from_utf8_lossy(&line.bytes));
                self.is_text = false;
            }
        }
    }

    fn end_text(&mut self) {
        let length = self.text.trim_end_matches(['\r', '\n']).len();
        self.text.truncate(length);
    }

    fn broken(&mut self, why: &'static str) -> CsvPiece {
        self.end_text();
        self.count = 0;
        CsvPiece::Broken(why)
    }

    /// Whether the text so far is a whole row; its cells are then there.
    fn parse(&mut self) -> bool {
        // A last line needs no line break of its own to be whole.
        let has_end = self.text.ends_with(['\r', '\n']);
        let (text, end): (&[u8], &[u8]) = (self.text.as_bytes(), if has_end { b"" } else { b"\n" });
        self.grammar.reset();
        self.buffer.resize((text.len() + 1).max(self.buffer.len()), 0);
        let (mut written, mut count) = (0, 0);
        for mut input in [text, end] {
            while !input.is_empty() {
                let (result, read, wrote, ended) =
                    self.grammar.read_record(input, &mut self.buffer[written..], &mut self.ends[count..]);
                input = &input[read..];
                written += wrote;
                count += ended;
                match result {
                    ReadRecordResult::InputEmpty => {}
                    ReadRecordResult::OutputFull => self.buffer.resize(2 * self.buffer.len(), 0),
                    ReadRecordResult::OutputEndsFull => self.ends.resize(2 * self.ends.len(), 0),
                    ReadRecordResult::Record | ReadRecordResult::End => {
                        self.count = count;
                        self.cells.clear();
                        match std::str::from_utf8(&self.buffer[..written]) {
                            Ok(cells) => self.cells.push_str(cells),
                            Err(_) => self.count = 0,
                        }
                        return true;
                    }
                }
            }
        }
        false
    }

    /// The next line with its line break; a carriage return alone is one, too.
    pub(super) fn next_line(&mut self) -> io::Result<Option<PhysicalLine>> {
        if let Some(line) = self.ahead.pop_front() {
            return Ok(Some(line));
        }
        let mut bytes = Vec::new();
        loop {
            let available = match self.input.fill_buf() {
                Ok(available) => available,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => return Err(error),
            };
            if available.is_empty() {
                return Ok((!bytes.is_empty()).then_some(PhysicalLine { bytes, is_whole: true }));
            }
            if std::mem::take(&mut self.after_carriage_return) && available[0] == b'\n' {
                // The line before was whole already.
                self.input.consume(1);
                continue;
            }
            let mut room = LONGEST_LINE_BYTES - bytes.len();
            // Not within a character.
            while room > 0 && available.get(room).is_some_and(|byte| byte & 0xc0 == 0x80) {
                room -= 1;
            }
            let within = &available[..available.len().min(room)];
            match within.iter().position(|b| matches!(b, b'\n' | b'\r')) {
                Some(at) => {
                    // Its line feed may not have come yet, and nobody waits for it.
                    let pair = available[at] == b'\r' && available.get(at + 1) == Some(&b'\n');
                    self.after_carriage_return = available[at] == b'\r' && at + 1 == available.len();
                    let length = at + 1 + usize::from(pair);
                    bytes.extend_from_slice(&available[..length]);
                    self.input.consume(length);
                    return Ok(Some(PhysicalLine { bytes, is_whole: true }));
                }
                None => {
                    let length = within.len();
                    bytes.extend_from_slice(within);
                    self.input.consume(length);
                    if length == room {
                        return Ok(Some(PhysicalLine { bytes, is_whole: false }));
                    }
                }
            }
        }
    }
}

/// An input that knows whether it holds bytes that nobody has read.
pub(crate) trait Buffered {
    fn is_drained(&self) -> bool;
}

impl<R: io::Read> Buffered for io::BufReader<R> {
    fn is_drained(&self) -> bool {
        self.buffer().is_empty()
    }
}

pub(super) fn is_aside(line: &str) -> bool {
    line.starts_with('#') || line.trim().is_empty()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pieces(text: &[u8]) -> Vec<(u64, String, Option<Vec<String>>)> {
        let mut rows = CsvRows::new(text);
        let mut found = Vec::new();
        while let Some(piece) = rows.next().unwrap() {
            let cells = (piece == CsvPiece::Row).then(|| rows.cells().map(str::to_owned).collect());
            found.push((rows.line(), rows.text().to_owned(), cells));
        }
        found
    }

    #[test]
    fn cells_in_quotes_hold_separators_quotes_and_line_breaks_and_the_text_stays_as_it_is() {
        let text = "\u{feff}a,\"b,c\", d \r\n# no row, \"\n\n1,\"x\n\"\"y\",'=z\r2,3";
        let found = pieces(text.as_bytes());
        let cells = |cells: &[&str]| Some(cells.iter().map(|c| (*c).to_owned()).collect::<Vec<_>>());
        assert_eq!(
            found,
            [
                (1, "a,\"b,c\", d ".to_owned(), cells(&["a", "b,c", "d"])),
                (2, "# no row, \"".to_owned(), None),
                (3, String::new(), None),
                (4, "1,\"x\n\"\"y\",'=z".to_owned(), cells(&["1", "x\n\"y", "=z"])),
                (6, "2,3".to_owned(), cells(&["2", "3"])),
            ]
        );
    }

    #[test]
    fn a_quote_that_is_never_closed_breaks_its_own_line_only() {
        for rows in [3, 2 * MOST_LINES] {
            let rest: String = (0..rows).map(|i| format!("{i},x\n")).collect();
            let found = pieces(format!("1,\"a\n{rest}").as_bytes());
            assert_eq!(found.len(), 1 + rows);
            assert_eq!((&found[0].1, &found[0].2), (&"1,\"a".to_owned(), &None));
            assert!(found[1..].iter().enumerate().all(|(i, (line, _, cells))| {
                *line == i as u64 + 2 && cells.as_ref().is_some_and(|c| c[0] == i.to_string())
            }));
        }
    }

    #[test]
    fn a_stray_quote_does_not_swallow_rows_up_to_the_next_one() {
        for (text, broken) in [
            ("a,b,note\n1,2,\"\n3,4,x\n5,\",6\n", 2),
            ("a,b,note\n1,\"\n3,4,x\n5,\",6\n7,8,y\n", 2),
            ("a,b,note\n1,2,\"two\nlines\"\n3,4,x\n", 0),
        ] {
            let mut rows = CsvRows::new(text.as_bytes());
            rows.header(|_| {}).unwrap().unwrap();
            rows.expect([false, false, true].into_iter());
            let (mut found, mut passed) = (Vec::new(), Vec::new());
            while let Some(piece) = rows.next().unwrap() {
                found.push(piece);
                passed.push(rows.text().to_owned());
            }
            assert_eq!(found.iter().filter(|piece| **piece != CsvPiece::Row).count(), broken, "{text}");
            assert_eq!(passed.join("\n"), text.split_once('\n').unwrap().1.trim_end());
        }
    }

    #[test]
    fn a_line_of_megabytes_is_broken_to_its_end_and_takes_little_room() {
        let text = format!("{}1,2,3\n4,5\n", "x".repeat(5 * LONGEST_LINE_BYTES / 2));
        let found = pieces(text.as_bytes());
        assert_eq!(found.iter().filter(|(_, _, cells)| cells.is_none()).count(), 3);
        assert_eq!(found[3].2.as_ref().unwrap(), &["4", "5"]);
    }

    /// The same as the whole at once, however the input comes.
    #[test]
    fn an_input_in_small_pieces_is_read_as_the_whole() {
        let text = "a;\"b\r\nc\";d\r\n\r\n1;2\r3;\"4\"\"\"\r\n#x\n";
        let whole = pieces(text.as_bytes());
        for size in 1..9 {
            let mut rows = CsvRows::new(io::BufReader::with_capacity(size, text.as_bytes()));
            let mut found = Vec::new();
            while let Some(piece) = rows.next().unwrap() {
                let cells: Option<Vec<String>> =
                    (piece == CsvPiece::Row).then(|| rows.cells().map(str::to_owned).collect());
                found.push((rows.line(), rows.text().replace('\r', ""), cells.map(|c| c.join("|").replace('\r', ""))));
            }
            let expected: Vec<_> = whole
                .iter()
                .map(|(line, text, cells)| {
                    (*line, text.replace('\r', ""), cells.as_ref().map(|c| c.join("|").replace('\r', "")))
                })
                .collect();
            assert_eq!(found, expected, "{size}");
        }
    }
}
