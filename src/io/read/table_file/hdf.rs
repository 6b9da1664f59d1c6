//! HDF5 files, and MAT files of version 7.3, which are such: data sets, and the fields of compound ones, as columns.
//!
//! MATLAB's arrays stand transposed, its structures are groups, and what it keeps in `#refs#` belongs to cells and objects. Data sets
//! `…_values` beside `…_items` are pandas' and have their columns' names there.

use std::path::Path;
use std::sync::Arc;

use hdf5_reader::group::Group;
use hdf5_reader::{Dataset, Datatype, H5Type, Hdf5File, OpenOptions, SliceInfo, SliceInfoElem, dtype_element_size};

use super::Source;
use super::layout::{Placed, VariableLayout, VariableShape, laid_out};
use super::rows::{BLOCK_ROWS, ColumnValues, TableColumns};

/// Groups in groups; links may go round.
const DEEPEST: usize = 8;
const MOST_SETS: usize = 4096;
/// What is read at once of a data set: of texts and compounds all, of numbers a block.
const LARGEST_READ_BYTES: usize = 512 * 1024 * 1024;
const CACHE_BYTES: usize = 128 * 1024 * 1024;

pub(super) fn open(path: &Path) -> Result<Source<'static>, String> {
    let options = OpenOptions::default()
        .with_max_read_bytes(LARGEST_READ_BYTES)
        .with_max_chunk_bytes(LARGEST_READ_BYTES)
        .with_chunk_cache_bytes(CACHE_BYTES);
    let file = Hdf5File::open_with_options(path, options).map_err(said)?;
    let mut found = Found::default();
    found.group(&file.root_group().map_err(said)?, &[])?;
    let layout = laid_out(&found.shapes, &found.unread)?;
    let remarks = layout.remarks.clone();
    Ok(Source::table(Table { holds: found.holds, layout, at: 0 }, remarks))
}

fn said(error: hdf5_reader::error::Error) -> String {
    format!("is an HDF5 file that cannot be read: {error}")
}

/// Where the values of a variable are.
enum Holds {
    Numbers(Box<Dataset>),
    /// A field of each element, as the machine has it.
    Field {
        bytes: Arc<Vec<u8>>,
        stride: usize,
        offset: usize,
        of: Datatype,
    },
    Texts(Vec<String>),
}

#[derive(Default)]
struct Found {
    shapes: Vec<VariableShape>,
    holds: Vec<Holds>,
    unread: Vec<String>,
    sets: usize,
}

impl Found {
    fn group(&mut self, group: &Group, path: &[String]) -> Result<(), String> {
        let (groups, sets) = group.members().map_err(said)?;
        let texts_of = |name: &str| sets.iter().find(|s| s.name() == name).and_then(|s| s.read_strings().ok());
        for set in &sets {
            self.sets += 1;
            if self.sets > MOST_SETS {
                return Err(format!("expected at most {MOST_SETS} data sets, found more"));
            }
            let items = set.name().strip_suffix("_values").and_then(|stem| texts_of(&format!("{stem}_items")));
            let path: Vec<String> = path.iter().cloned().chain([set.name().to_owned()]).collect();
            self.set(set, path, items.unwrap_or_default())?;
        }
        for inner in groups.iter().filter(|g| !g.name().starts_with('#')) {
            let path: Vec<String> = path.iter().cloned().chain([inner.name().to_owned()]).collect();
            if path.len() <= DEEPEST {
                self.group(inner, &path)?;
            } else {
                self.unread.push(path.join("."));
            }
        }
        Ok(())
    }

    fn set(&mut self, set: &Dataset, path: Vec<String>, names: Vec<String>) -> Result<(), String> {
        let dims = set.shape().to_vec();
        let class = set.attribute("MATLAB_class").ok().and_then(|a| a.read_string().ok());
        let is_matlabs_text = class.as_deref() == Some("char");
        let is_vector = dims.iter().filter(|n| **n > 1).count() == 1;
        match set.dtype() {
            Datatype::FixedPoint { .. } | Datatype::FloatingPoint { size: 4 | 8, .. } if !is_matlabs_text => {
                self.push(VariableShape { path, dims, names }, Holds::Numbers(Box::new(set.clone())));
            }
            Datatype::Enum { base, .. } if is_vector => {
                let (of, bytes) = (base.as_ref().clone(), Arc::new(set.read_native_bytes().map_err(said)?));
                let stride = dtype_element_size(&of).map_err(said)?;
                self.push(VariableShape { path, dims, names }, Holds::Field { bytes, stride, offset: 0, of });
            }
            Datatype::Compound { size, fields } if is_vector && !is_complex(fields.iter().map(|f| f.name.as_str())) => {
                let bytes = Arc::new(set.read_native_bytes().map_err(said)?);
                for field in fields {
                    let path: Vec<String> = path.iter().cloned().chain([field.name.clone()]).collect();
                    let is_number = matches!(
                        field.datatype,
                        Datatype::FixedPoint { .. }
                            | Datatype::FloatingPoint { size: 4 | 8, .. }
                            | Datatype::Enum { .. }
                    );
                    if is_number {
                        let (stride, offset) = (*size as usize, field.byte_offset as usize);
                        let of = field.datatype.clone();
                        let shape = VariableShape { path, dims: dims.clone(), names: Vec::new() };
                        self.push(shape, Holds::Field { bytes: bytes.clone(), stride, offset, of });
                    } else {
                        self.unread.push(path.join("."));
                    }
                }
            }
            Datatype::String { .. } | Datatype::VarLen { .. } if is_vector => match set.read_strings() {
                Ok(texts) => self.push(VariableShape { path, dims, names }, Holds::Texts(texts)),
                Err(_) => self.unread.push(path.join(".")),
            },
            _ => self.unread.push(path.join(".")),
        }
        Ok(())
    }

    fn push(&mut self, shape: VariableShape, holds: Holds) {
        self.shapes.push(shape);
        self.holds.push(holds);
    }
}

/// How MATLAB and h5py keep complex numbers.
fn is_complex<'n>(fields: impl Iterator<Item = &'n str>) -> bool {
    let fields: Vec<&str> = fields.collect();
    matches!(fields.as_slice(), ["real", "imag"] | ["r", "i"])
}

struct Table {
    holds: Vec<Holds>,
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
        if from >= to {
            return Ok(None);
        }
        let column = |place: &Placed| {
            let rows = (from as usize)..(to as usize);
            match &self.holds[place.variable] {
                Holds::Numbers(set) => numbers(set, place, from, to).map(ColumnValues::Numbers),
                Holds::Field { bytes, stride, offset, of } => {
                    let value = |row: usize| bytes.get(row * stride + offset..).and_then(|b| number(b, of));
                    Ok(ColumnValues::Numbers(rows.map(|row| value(row).unwrap_or(f64::NAN)).collect()))
                }
                Holds::Texts(texts) => {
                    Ok(ColumnValues::Texts(rows.map(|row| texts.get(row).cloned().unwrap_or_default()).collect()))
                }
            }
        };
        self.layout.columns.iter().map(column).collect::<Result<_, _>>().map(Some)
    }
}

/// A number in the machine's own order of bytes.
fn number(bytes: &[u8], of: &Datatype) -> Option<f64> {
    macro_rules! first {
        ($number:ty) => {
            <$number>::from_ne_bytes(bytes.get(..size_of::<$number>())?.try_into().ok()?) as f64
        };
    }
    Some(match of {
        Datatype::FloatingPoint { size: 4, .. } => first!(f32),
        Datatype::FloatingPoint { .. } => first!(f64),
        Datatype::FixedPoint { size: 1, signed: true, .. } => first!(i8),
        Datatype::FixedPoint { size: 1, .. } => first!(u8),
        Datatype::FixedPoint { size: 2, signed: true, .. } => first!(i16),
        Datatype::FixedPoint { size: 2, .. } => first!(u16),
        Datatype::FixedPoint { size: 4, signed: true, .. } => first!(i32),
        Datatype::FixedPoint { size: 4, .. } => first!(u32),
        Datatype::FixedPoint { signed: true, .. } => first!(i64),
        Datatype::FixedPoint { .. } => first!(u64),
        Datatype::Enum { base, .. } => number(bytes, base)?,
        _ => return None,
    })
}

/// Some rows of a column.
fn numbers(set: &Dataset, place: &Placed, from: u64, to: u64) -> Result<Vec<f64>, String> {
    let along = |axis| match axis == place.axis {
        true => SliceInfoElem::Slice { start: from, end: to, step: 1 },
        false => SliceInfoElem::Index(place.index),
    };
    let slice = SliceInfo { selections: (0..set.ndim()).map(along).collect() };
    fn each<T: H5Type + Copy>(set: &Dataset, slice: &SliceInfo, to_f64: fn(T) -> f64) -> Result<Vec<f64>, String> {
        Ok(set.read_slice::<T>(slice).map_err(said)?.iter().map(|v| to_f64(*v)).collect())
    }
    match set.dtype() {
        Datatype::FloatingPoint { size: 4, .. } => each::<f32>(set, &slice, f64::from),
        Datatype::FloatingPoint { .. } => each::<f64>(set, &slice, |v| v),
        Datatype::FixedPoint { size: 1, signed: true, .. } => each::<i8>(set, &slice, f64::from),
        Datatype::FixedPoint { size: 1, .. } => each::<u8>(set, &slice, f64::from),
        Datatype::FixedPoint { size: 2, signed: true, .. } => each::<i16>(set, &slice, f64::from),
        Datatype::FixedPoint { size: 2, .. } => each::<u16>(set, &slice, f64::from),
        Datatype::FixedPoint { size: 4, signed: true, .. } => each::<i32>(set, &slice, f64::from),
        Datatype::FixedPoint { size: 4, .. } => each::<u32>(set, &slice, f64::from),
        Datatype::FixedPoint { signed: true, .. } => each::<i64>(set, &slice, |v| v as f64),
        _ => each::<u64>(set, &slice, |v| v as f64),
    }
}
