//! Walks a TOML document and collects every fault with its place, instead of stopping at the first.
//!
//! A key that is unknown but close to one that is missing is reported once, as a misspelling.

use std::ops::Range;

use toml_edit::{Document, Item, TableLike, Value};

pub(crate) use super::{limits::Limits, nearest::nearest};
use crate::io::fault::{Fault, Faults};
use crate::text;

/// The faults found so far in one document.
#[derive(Debug)]
pub(crate) struct TomlReader {
    file: String,
    source: String,
    faults: Vec<Fault>,
}

/// One table under a reader; `finish` reports what it did not expect.
pub(crate) struct TableReader<'d> {
    /// As in `winding.`; empty for the document itself.
    prefix: String,
    table: Option<&'d dyn TableLike>,
    span: Option<Range<usize>>,
    known: Vec<&'static str>,
    /// Keys with a number in them.
    numbered: Vec<String>,
    missing: Vec<Missing>,
}

struct Missing {
    /// The first is reported; any of them would do.
    keys: Vec<&'static str>,
    expected: String,
}

/// Parses the text.
///
/// # Errors
/// Text that is no TOML: one fault at the place where it stops being so.
pub(crate) fn parse(file: &str, source: &str) -> Result<Document<String>, Faults> {
    Document::parse(source.to_owned()).map_err(|error| {
        let message = error.message().lines().next().unwrap_or("not TOML").to_owned();
        Faults::one(file, source, Fault::new(message, error.span()))
    })
}

impl TomlReader {
    pub(crate) fn new(file: &str, source: &str) -> Self {
        Self { file: file.to_owned(), source: source.to_owned(), faults: Vec::new() }
    }

    pub(crate) fn root<'d>(&self, document: &'d Document<String>) -> TableReader<'d> {
        TableReader {
            prefix: String::new(),
            table: Some(document.as_table()),
            span: None,
            known: Vec::new(),
            numbered: Vec::new(),
            missing: Vec::new(),
        }
    }

    pub(crate) fn fault(&mut self, fault: Fault) {
        self.faults.push(fault);
    }

    /// To be compared before and after reading a part: whether that part has faults.
    pub(crate) fn fault_count(&self) -> usize {
        self.faults.len()
    }

    /// The value if there was no fault, else all faults in the order of the source.
    ///
    /// # Errors
    /// Any fault at all.
    pub(crate) fn finish<T>(mut self, value: Option<T>) -> Result<T, Faults> {
        match value {
            Some(value) if self.faults.is_empty() => Ok(value),
            _ => {
                if self.faults.is_empty() {
                    self.faults.push(Fault::new("the file does not describe what was expected", None));
                }
                self.faults.sort_by_key(|f| f.span.as_ref().map_or(usize::MAX, |s| s.start));
                Err(Faults { file: self.file, source: self.source, faults: self.faults })
            }
        }
    }
}

fn type_name(item: &Item) -> &'static str {
    match item {
        Item::None => "nothing",
        Item::Table(_) => "a table",
        Item::ArrayOfTables(_) => "an array of tables",
        Item::Value(Value::InlineTable(_)) => "a table",
        Item::Value(Value::Array(_)) => "an array",
        Item::Value(Value::String(_)) => "a string",
        Item::Value(Value::Integer(_)) => "an integer",
        Item::Value(Value::Float(_)) => "a number",
        Item::Value(Value::Boolean(_)) => "a boolean",
        Item::Value(Value::Datetime(_)) => "a date",
    }
}

impl<'d> TableReader<'d> {
    /// An absent table: everything asked of it is absent too, without a fault.
    fn absent(prefix: String) -> Self {
        Self { prefix, table: None, span: None, known: Vec::new(), numbered: Vec::new(), missing: Vec::new() }
    }

    /// Nothing left to read.
    pub(crate) fn gone() -> Self {
        Self::absent(String::new())
    }

    pub(crate) fn is_present(&self) -> bool {
        self.table.is_some()
    }

    pub(crate) fn span(&self) -> Option<Range<usize>> {
        self.span.clone()
    }

    /// The place of a key's value, for faults found later.
    pub(crate) fn span_of(&self, key: &str) -> Option<Range<usize>> {
        self.table?.get(key)?.span().or_else(|| self.span.clone())
    }

    pub(crate) fn has(&self, key: &str) -> bool {
        self.table.is_some_and(|t| t.contains_key(key))
    }

    /// Whether an optional key stands here; it is then known, so that a misspelling of it is recognised.
    pub(crate) fn states(&mut self, key: &'static str) -> bool {
        self.known.push(key);
        self.has(key)
    }

    /// What stands behind a key.
    pub(crate) fn raw(&self, key: &str) -> Option<&'d Item> {
        self.table?.get(key)
    }

    pub(crate) fn keys(&self) -> Vec<String> {
        self.table.map(|t| t.iter().map(|(k, _)| k.to_owned()).collect()).unwrap_or_default()
    }

    fn item(&mut self, key: &'static str) -> Option<&'d Item> {
        self.known.push(key);
        self.table?.get(key)
    }

    fn wrong_type(&self, reader: &mut TomlReader, key: &str, expected: &str, item: &Item) {
        let message = format!("{}{key} must be {expected}, found {}", self.prefix, type_name(item));
        reader.fault(Fault::new(message, item.span().or_else(|| self.span.clone())));
    }

    fn note_missing(&mut self, key: &'static str, expected: String) {
        self.note_missing_one_of(&[key], expected);
    }

    /// Reports at the end that the first of `keys` is missing, unless an unknown key seems to be one of them misspelt.
    pub(crate) fn note_missing_one_of(&mut self, keys: &[&'static str], expected: String) {
        if self.table.is_some() {
            self.missing.push(Missing { keys: keys.to_vec(), expected });
        }
    }

    /// A number that may be absent.
    pub(crate) fn number(&mut self, reader: &mut TomlReader, key: &'static str, limits: Limits) -> Option<f64> {
        let item = self.item(key)?;
        let found = match item {
            Item::Value(Value::Float(v)) => *v.value(),
            Item::Value(Value::Integer(v)) => *v.value() as f64,
            _ => {
                self.wrong_type(reader, key, "a number", item);
                return None;
            }
        };
        if !(found >= limits.lower && found <= limits.upper) {
            let message =
                format!("{}{key} must lie between {} and {}, found {found}", self.prefix, limits.lower, limits.upper);
            reader.fault(Fault::new(message, item.span()));
            return None;
        }
        Some(found)
    }

    /// A number that must be there.
    pub(crate) fn needed_number(&mut self, reader: &mut TomlReader, key: &'static str, limits: Limits) -> Option<f64> {
        if !self.has(key) {
            self.note_missing(key, format!("a number between {} and {}", limits.lower, limits.upper));
        }
        self.number(reader, key, limits)
    }

    /// An integer that may be absent.
    pub(crate) fn integer(
        &mut self,
        reader: &mut TomlReader,
        key: &'static str,
        lower: i64,
        upper: i64,
    ) -> Option<i64> {
        let item = self.item(key)?;
        let Item::Value(Value::Integer(value)) = item else {
            self.wrong_type(reader, key, "an integer", item);
            return None;
        };
        let found = *value.value();
        if !(lower..=upper).contains(&found) {
            let message = format!("{}{key} must lie between {lower} and {upper}, found {found}", self.prefix);
            reader.fault(Fault::new(message, item.span()));
            return None;
        }
        Some(found)
    }

    pub(crate) fn needed_integer(
        &mut self,
        reader: &mut TomlReader,
        key: &'static str,
        lower: i64,
        upper: i64,
    ) -> Option<i64> {
        if !self.has(key) {
            self.note_missing(key, format!("an integer between {lower} and {upper}"));
        }
        self.integer(reader, key, lower, upper)
    }

    /// A string that may be absent.
    pub(crate) fn text(&mut self, reader: &mut TomlReader, key: &'static str) -> Option<&'d str> {
        let item = self.item(key)?;
        let Item::Value(Value::String(value)) = item else {
            self.wrong_type(reader, key, "a string", item);
            return None;
        };
        Some(value.value())
    }

    /// A string under a key with a number in it.
    pub(crate) fn numbered_text(&mut self, reader: &mut TomlReader, key: &str) -> Option<&'d str> {
        self.numbered.push(key.to_owned());
        let item = self.table?.get(key)?;
        let found = item.as_str();
        if found.is_none() {
            self.wrong_type(reader, key, "a string", item);
        }
        found
    }

    /// A name that must be there: one that can be seen as it is, of a length that fits on a page.
    pub(crate) fn needed_name(&mut self, reader: &mut TomlReader, key: &'static str) -> Option<&'d str> {
        let name = self.needed_text(reader, key, "a name")?;
        self.without(reader, key, name, text::name_fault)
    }

    /// As [`TableReader::needed_name`], where the name may be absent or empty.
    pub(crate) fn words(&mut self, reader: &mut TomlReader, key: &'static str) -> Option<&'d str> {
        let words = self.text(reader, key)?;
        self.without(reader, key, words, text::words_fault)
    }

    fn without(
        &self,
        reader: &mut TomlReader,
        key: &str,
        found: &'d str,
        fault_of: fn(&str) -> Option<String>,
    ) -> Option<&'d str> {
        let Some(fault) = fault_of(found) else { return Some(found) };
        reader.fault(Fault::new(format!("{}{key} {fault}", self.prefix), self.span_of(key)));
        None
    }

    pub(crate) fn needed_text(
        &mut self,
        reader: &mut TomlReader,
        key: &'static str,
        expected: &str,
    ) -> Option<&'d str> {
        if !self.has(key) {
            self.note_missing(key, expected.to_owned());
        }
        self.text(reader, key)
    }

    /// The index of a string that must be one of a few words, where it is present.
    pub(crate) fn word(&mut self, reader: &mut TomlReader, key: &'static str, words: &[&str]) -> Option<usize> {
        let found = self.text(reader, key)?;
        let index = words.iter().position(|w| *w == found);
        if index.is_none() {
            let message = format!("{}{key} must be {}, found \"{found}\"", self.prefix, one_of(words));
            let mut fault = Fault::new(message, self.span_of(key));
            if let Some(near) = nearest(found, words) {
                fault = fault.with_note(format!("did you mean \"{near}\"?"));
            }
            reader.fault(fault);
        }
        index
    }

    pub(crate) fn needed_word(&mut self, reader: &mut TomlReader, key: &'static str, words: &[&str]) -> Option<usize> {
        if !self.has(key) {
            self.note_missing(key, one_of(words));
        }
        self.word(reader, key, words)
    }

    /// An array of integers that must be there, each with its place.
    /// A non-empty array of strings, each with its place; a single string is no array.
    pub(crate) fn needed_texts(
        &mut self,
        reader: &mut TomlReader,
        key: &'static str,
        expected: &str,
    ) -> Option<Vec<(String, Option<Range<usize>>)>> {
        let Some(item) = self.item(key) else {
            self.note_missing(key, expected.to_owned());
            return None;
        };
        let Item::Value(Value::Array(array)) = item else {
            self.wrong_type(reader, key, expected, item);
            return None;
        };
        if array.is_empty() {
            let message = format!("{}{key} must not be empty: list at least one", self.prefix);
            reader.fault(Fault::new(message, self.span_of(key)));
        }
        let mut texts = Vec::with_capacity(array.len());
        for (i, value) in array.iter().enumerate() {
            match value {
                Value::String(v) => texts.push((v.value().clone(), value.span())),
                other => {
                    let message = format!("{}{key}[{i}] must be a string, found {}", self.prefix, other.type_name());
                    reader.fault(Fault::new(message, value.span()));
                }
            }
        }
        (texts.len() == array.len()).then_some(texts)
    }

    pub(crate) fn needed_integers(
        &mut self,
        reader: &mut TomlReader,
        key: &'static str,
    ) -> Option<Vec<(i64, Option<Range<usize>>)>> {
        let Some(item) = self.item(key) else {
            self.note_missing(key, "an array of integers".to_owned());
            return None;
        };
        let Item::Value(Value::Array(array)) = item else {
            self.wrong_type(reader, key, "an array of integers", item);
            return None;
        };
        let mut integers = Vec::with_capacity(array.len());
        let mut clean = true;
        for (i, value) in array.iter().enumerate() {
            match value {
                Value::Integer(v) => integers.push((*v.value(), value.span())),
                other => {
                    clean = false;
                    let found = other.type_name();
                    let message = format!("{}{key}[{i}] must be an integer, found {found}", self.prefix);
                    reader.fault(Fault::new(message, value.span()));
                }
            }
        }
        clean.then_some(integers)
    }

    /// Every entry of the table as a finite number; none if one is not. For tables whose keys the user chooses.
    pub(crate) fn all_numbers(&mut self, reader: &mut TomlReader) -> Option<Vec<(String, f64)>> {
        let Some(table) = self.table else { return Some(Vec::new()) };
        let mut numbers = Vec::new();
        let mut clean = true;
        for (key, item) in table.iter() {
            let number = match item {
                Item::Value(Value::Float(v)) => *v.value(),
                Item::Value(Value::Integer(v)) => *v.value() as f64,
                _ => f64::NAN,
            };
            if number.is_finite() {
                numbers.push((key.to_owned(), number));
            } else {
                clean = false;
                let message = format!("{}{key} must be a finite number", self.prefix);
                reader.fault(Fault::new(message, item.span().or_else(|| self.span.clone())));
            }
        }
        clean.then_some(numbers)
    }

    /// A table below this one that may be absent.
    pub(crate) fn table(&mut self, reader: &mut TomlReader, key: &'static str) -> TableReader<'d> {
        let prefix = format!("{}{key}.", self.prefix);
        let Some(item) = self.item(key) else { return TableReader::absent(prefix) };
        match item.as_table_like() {
            Some(table) => {
                let span = item.span().or_else(|| self.span.clone());
                TableReader {
                    prefix,
                    table: Some(table),
                    span,
                    known: Vec::new(),
                    numbered: Vec::new(),
                    missing: Vec::new(),
                }
            }
            None => {
                self.wrong_type(reader, key, "a table", item);
                TableReader::absent(prefix)
            }
        }
    }

    pub(crate) fn needed_table(&mut self, reader: &mut TomlReader, key: &'static str) -> TableReader<'d> {
        if !self.has(key) {
            self.note_missing(key, format!("a table [{}{key}]", self.prefix));
        }
        self.table(reader, key)
    }

    /// The tables of an array, `[[key]]` or an array of inline tables; none if absent.
    pub(crate) fn tables(&mut self, reader: &mut TomlReader, key: &'static str) -> Vec<TableReader<'d>> {
        let prefix = format!("{}{key}.", self.prefix);
        let Some(item) = self.item(key) else { return Vec::new() };
        let make = |table: &'d dyn TableLike, span: Option<Range<usize>>| TableReader {
            prefix: prefix.clone(),
            table: Some(table),
            span,
            known: Vec::new(),
            numbered: Vec::new(),
            missing: Vec::new(),
        };
        match item {
            Item::ArrayOfTables(array) => array.iter().map(|t| make(t, t.span())).collect(),
            Item::Value(Value::Array(array)) => {
                let mut tables = Vec::new();
                for value in array {
                    match value.as_inline_table() {
                        Some(table) => tables.push(make(table, value.span())),
                        None => {
                            let message = format!("{}{key} must hold tables, found {}", self.prefix, value.type_name());
                            reader.fault(Fault::new(message, value.span()));
                        }
                    }
                }
                tables
            }
            other => {
                self.wrong_type(reader, key, "an array of tables", other);
                Vec::new()
            }
        }
    }

    /// Reports unknown keys, and missing ones that no unknown key seems to stand for.
    pub(crate) fn finish(mut self, reader: &mut TomlReader) {
        let Some(table) = self.table else { return };
        for (key, item) in table.iter() {
            if self.known.contains(&key) || self.numbered.iter().any(|numbered| numbered == key) {
                continue;
            }
            let span = table.key(key).and_then(|k| k.span()).or_else(|| item.span()).or_else(|| self.span.clone());
            let near = nearest(key, &self.known);
            let mut message = format!("unknown key {}{key}", self.prefix);
            if let Some(near) = near {
                message.push_str(&format!(": did you mean {near}?"));
                self.missing.retain(|m| !m.keys.contains(&near));
            } else if self.known.is_empty() {
                message.push_str(": none is expected here");
            }
            let mut fault = Fault::new(message, span);
            if near.is_none() && !self.known.is_empty() {
                let mut known = self.known.clone();
                known.sort_unstable();
                known.dedup();
                fault = fault.with_note(format!("known here: {}", known.join(", ")));
            }
            reader.fault(fault);
        }
        for missing in &self.missing {
            let message = format!("missing key {}{}: expected {}", self.prefix, missing.keys[0], missing.expected);
            reader.fault(Fault::new(message, self.span.clone()));
        }
    }
}

fn one_of(words: &[&str]) -> String {
    let quoted: Vec<String> = words.iter().map(|w| format!("\"{w}\"")).collect();
    match quoted.as_slice() {
        [one] => one.clone(),
        _ => format!("one of {}", quoted.join(", ")),
    }
}
