//! MAT files of versions 5 to 7: numeric variables, and those in structures, as columns.
//!
//! An element is a tag (type, bytes; together in four bytes where it is small) and its data, padded to eight bytes; a variable is
//! an element of elements: flags, dimensions, name, values. Integers that fit are stored in fewer bytes than their class has.
//!
//! # Source
//! MathWorks, *MAT-File Format* (R2019b), chapter 1.

use std::io::Read;
use std::path::Path;

use flate2::read::ZlibDecoder;

use super::Source;
use super::layout::{VariableLayout, VariableShape, laid_out};
use super::rows::{BLOCK_ROWS, ColumnValues, TableColumns};

/// As large as a text may be.
const LARGEST_BYTES: u64 = 512 * 1024 * 1024;
const HEAD_BYTES: usize = 128;
/// Structures in structures.
const DEEPEST: usize = 8;

// Types of elements.
const COMPRESSED: u32 = 15;
const MATRIX: u32 = 14;
// Classes of variables.
const STRUCTURE: u32 = 2;
const NUMERIC: std::ops::RangeInclusive<u32> = 6..=15;
const IS_COMPLEX: u32 = 0x0800;

pub(super) fn open(path: &Path) -> Result<Source<'static>, String> {
    let unreadable = |e: std::io::Error| format!("cannot be read: {e}");
    let length = std::fs::metadata(path).map_err(unreadable)?.len();
    if length > LARGEST_BYTES {
        return Err(format!("expected a MAT file of at most {LARGEST_BYTES} bytes, found {length}"));
    }
    let bytes = std::fs::read(path).map_err(unreadable)?;
    let mut found = Found { is_big_endian: bytes.get(126..128) == Some(b"MI"), ..Found::default() };
    found.elements(bytes.get(HEAD_BYTES..).unwrap_or_default(), true)?;
    let shapes: Vec<VariableShape> = found.variables.iter().map(|v| v.shape.clone()).collect();
    let layout = laid_out(&shapes, &found.unread)?;
    let remarks = layout.remarks.clone();
    Ok(Source::table(Table { variables: found.variables, layout, at: 0 }, remarks))
}

#[derive(Debug)]
struct Variable {
    shape: VariableShape,
    /// Column by column.
    values: Vec<f64>,
}

/// What a file holds.
#[derive(Debug, Default)]
struct Found {
    is_big_endian: bool,
    variables: Vec<Variable>,
    /// Names of what holds no numbers, or complex ones.
    unread: Vec<String>,
    unpacked_bytes: u64,
}

/// An element: its type and data.
struct Element<'b> {
    kind: u32,
    data: &'b [u8],
}

const DAMAGED: &str = "is a MAT file that ends early or is damaged";

impl Found {
    fn word(&self, bytes: &[u8]) -> Option<u32> {
        let four: [u8; 4] = bytes.get(..4)?.try_into().ok()?;
        Some(if self.is_big_endian { u32::from_be_bytes(four) } else { u32::from_le_bytes(four) })
    }

    /// The first element of some bytes, which go on behind it.
    fn element<'b>(&self, bytes: &mut &'b [u8]) -> Result<Element<'b>, String> {
        let first = self.word(bytes).ok_or(DAMAGED)?;
        let (kind, length, from): (u32, usize, usize) = match first >> 16 {
            0 => (first, self.word(&bytes[4..]).ok_or(DAMAGED)? as usize, 8),
            small => (first & 0xffff, small as usize, 4),
        };
        let is_small = from == 4;
        let data = bytes.get(from..from.saturating_add(length)).filter(|_| !is_small || length <= 4).ok_or(DAMAGED)?;
        // Compressed ones are not padded.
        let padded = if kind == COMPRESSED { from + length } else { (from + length).next_multiple_of(8) };
        *bytes = bytes.get(padded..).unwrap_or_default();
        Ok(Element { kind, data })
    }

    fn elements(&mut self, mut bytes: &[u8], may_be_packed: bool) -> Result<(), String> {
        while !bytes.is_empty() {
            let Element { kind, data } = self.element(&mut bytes)?;
            match kind {
                MATRIX => self.variable(data, &[], None)?,
                COMPRESSED if may_be_packed => {
                    let left = LARGEST_BYTES.saturating_sub(self.unpacked_bytes);
                    let mut unpacked = Vec::new();
                    let unpacking = ZlibDecoder::new(data).take(left + 1).read_to_end(&mut unpacked);
                    unpacking.map_err(|e| format!("{DAMAGED}: {e}"))?;
                    self.unpacked_bytes += unpacked.len() as u64;
                    if self.unpacked_bytes > LARGEST_BYTES {
                        return Err(format!("expected a MAT file of at most {LARGEST_BYTES} bytes unpacked"));
                    }
                    self.elements(&unpacked, false)?;
                }
                _ => return Err(DAMAGED.to_owned()),
            }
        }
        Ok(())
    }

    /// A variable that stands in `path`; a field has its name from the structure.
    fn variable(&mut self, mut bytes: &[u8], path: &[String], field: Option<&str>) -> Result<(), String> {
        if bytes.is_empty() {
            // A field that was never set.
            return Ok(());
        }
        let flags = self.word(self.element(&mut bytes)?.data).ok_or(DAMAGED)?;
        let class = flags & 0xff;
        // Of what the format does not say (tables, dates, functions) there is nothing to be read but a name.
        let is_plain = class == STRUCTURE || NUMERIC.contains(&class) || (1..=5).contains(&class);
        let dims = if is_plain { self.element(&mut bytes)?.data } else { &[] };
        let dims: Vec<u64> = dims.chunks_exact(4).filter_map(|d| self.word(d)).map(u64::from).collect();
        let own = String::from_utf8_lossy(self.element(&mut bytes)?.data).into_owned();
        if own.is_empty() && field.is_none() {
            // What MATLAB keeps for its own objects.
            return Ok(());
        }
        let path: Vec<String> = path.iter().cloned().chain([field.map_or(own, str::to_owned)]).collect();
        let count = dims.iter().try_fold(1u64, |product, n| product.checked_mul(*n)).ok_or(DAMAGED)?;
        if NUMERIC.contains(&class) && flags & IS_COMPLEX == 0 {
            let values = self.numbers(&self.element(&mut bytes)?)?;
            if values.len() as u64 != count {
                return Err(DAMAGED.to_owned());
            }
            self.variables.push(Variable { shape: VariableShape { path, dims, names: Vec::new() }, values });
        } else if class == STRUCTURE && path.len() <= DEEPEST {
            self.structure(bytes, &path, count)?;
        } else {
            self.unread.push(path.join("."));
        }
        Ok(())
    }

    fn structure(&mut self, mut bytes: &[u8], path: &[String], count: u64) -> Result<(), String> {
        let width = self.word(self.element(&mut bytes)?.data).ok_or(DAMAGED)? as usize;
        let names = self.element(&mut bytes)?.data;
        if width == 0 || count.saturating_mul((names.len() / width) as u64) > bytes.len() as u64 {
            return Err(DAMAGED.to_owned());
        }
        let name =
            |field: &[u8]| String::from_utf8_lossy(field.split(|b| *b == 0).next().unwrap_or_default()).into_owned();
        let names: Vec<String> = names.chunks_exact(width).map(name).collect();
        let before = self.variables.len();
        for _ in 0..count {
            for name in &names {
                let field = self.element(&mut bytes)?;
                if field.kind != MATRIX {
                    return Err(DAMAGED.to_owned());
                }
                self.variable(field.data, path, Some(name))?;
            }
        }
        if count > 1 {
            self.gather(before, count);
        }
        Ok(())
    }

    /// Fields of one number each, in an array of structures, are columns.
    fn gather(&mut self, before: usize, count: u64) {
        let mut columns: Vec<Variable> = Vec::new();
        for part in self.variables.split_off(before) {
            match columns.iter_mut().find(|c| c.shape.path == part.shape.path) {
                Some(column) => column.values.extend(part.values),
                None => columns.push(part),
            }
        }
        for mut column in columns {
            if column.values.len() as u64 == count {
                column.shape.dims = vec![count];
                self.variables.push(column);
            } else {
                self.unread.push(column.shape.path.join("."));
            }
        }
    }

    fn numbers(&self, element: &Element) -> Result<Vec<f64>, String> {
        macro_rules! each {
            ($number:ty) => {{
                let whole = element.data.chunks_exact(size_of::<$number>());
                let number = |bytes: &[u8]| {
                    let bytes = bytes.try_into().unwrap_or_default();
                    let big = self.is_big_endian;
                    (if big { <$number>::from_be_bytes(bytes) } else { <$number>::from_le_bytes(bytes) }) as f64
                };
                Ok(whole.map(number).collect())
            }};
        }
        match element.kind {
            1 => each!(i8),
            2 => each!(u8),
            3 => each!(i16),
            4 => each!(u16),
            5 => each!(i32),
            6 => each!(u32),
            7 => each!(f32),
            9 => each!(f64),
            12 => each!(i64),
            13 => each!(u64),
            _ => Err(DAMAGED.to_owned()),
        }
    }
}

struct Table {
    variables: Vec<Variable>,
    layout: VariableLayout,
    at: u64,
}

impl TableColumns for Table {
    fn names(&self) -> Vec<String> {
        self.layout.columns.iter().map(|c| c.name.clone()).collect()
    }

    fn block(&mut self) -> Result<Option<Vec<ColumnValues>>, String> {
        let (from, to) = (self.at, self.layout.rows.min(self.at + BLOCK_ROWS as u64));
        self.at = to;
        let column = |place: &super::layout::Placed| {
            let variable = &self.variables[place.variable];
            let high = variable.shape.dims.first().copied().unwrap_or(1);
            let at = |row: u64| if place.axis == 0 { row + place.index * high } else { place.index + row * high };
            let value = |row| usize::try_from(at(row)).ok().and_then(|i| variable.values.get(i)).copied();
            ColumnValues::Numbers((from..to).map(|row| value(row).unwrap_or(f64::NAN)).collect())
        };
        Ok((from < to).then(|| self.layout.columns.iter().map(column).collect()))
    }
}
