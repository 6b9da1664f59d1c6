//! Parquet files: flat columns of numbers, stamps and texts, a group of rows at a time.

use std::fs::File;
use std::path::Path;

use parquet::basic::{ConvertedType, LogicalType, TimeUnit, Type};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{ByteArray, DataType, FixedLenByteArray};
use parquet::errors::ParquetError;
use parquet::file::reader::FileReader;
use parquet::file::serialized_reader::SerializedFileReader;
use parquet::schema::types::ColumnDescriptor;

use super::Source;
use super::rows::{BLOCK_ROWS, ColumnValues, TableColumns};

pub(super) fn open(path: &Path) -> Result<Source<'static>, String> {
    let file = File::open(path).map_err(|e| format!("cannot be read: {e}"))?;
    let reader = SerializedFileReader::new(file).map_err(said)?;
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let (mut columns, mut left_out) = (Vec::new(), Vec::new());
    for place in 0..schema.num_columns() {
        let column = schema.column(place);
        let name = column.path().string();
        match Meaning::of(&column) {
            Some(meaning) => columns.push(Read { place, name, meaning }),
            None => left_out.push(name),
        }
    }
    if columns.is_empty() {
        return Err("is a Parquet file without a flat column of numbers, stamps or texts".to_owned());
    }
    let remarks = match left_out.as_slice() {
        [] => Vec::new(),
        some => vec![format!("no plain numbers, stamps or texts, and left out: {}", some.join(", "))],
    };
    Ok(Source::table(Table { reader, columns, group: 0, open: Vec::new(), left: 0 }, remarks))
}

fn said(error: ParquetError) -> String {
    format!("is a Parquet file that cannot be read: {error}")
}

/// What the numbers of a column are.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Meaning {
    Plain,
    /// Without its sign.
    Unsigned,
    /// In units of so much.
    Decimal(f64),
    /// Since 1970, so many nanoseconds each.
    Stamp(i64),
    Text,
}

impl Meaning {
    /// None of what is no plain cell.
    fn of(column: &ColumnDescriptor) -> Option<Self> {
        if column.max_rep_level() > 0 {
            return None;
        }
        let unit = match (column.logical_type_ref(), column.converted_type()) {
            (Some(LogicalType::Timestamp(stamp)), _) => Some(match stamp.unit {
                TimeUnit::MILLIS => 1_000_000,
                TimeUnit::MICROS => 1_000,
                TimeUnit::NANOS => 1,
            }),
            (None, ConvertedType::TIMESTAMP_MILLIS) => Some(1_000_000),
            (None, ConvertedType::TIMESTAMP_MICROS) => Some(1_000),
            _ => None,
        };
        let is_decimal = column.converted_type() == ConvertedType::DECIMAL
            || matches!(column.logical_type_ref(), Some(LogicalType::Decimal(_)));
        let is_unsigned = matches!(
            column.converted_type(),
            ConvertedType::UINT_8 | ConvertedType::UINT_16 | ConvertedType::UINT_32 | ConvertedType::UINT_64
        ) || matches!(column.logical_type_ref(), Some(LogicalType::Integer(i)) if !i.is_signed);
        let is_text = matches!(column.converted_type(), ConvertedType::UTF8 | ConvertedType::ENUM)
            || matches!(column.logical_type_ref(), Some(LogicalType::String | LogicalType::Enum));
        match column.physical_type() {
            Type::BOOLEAN | Type::FLOAT | Type::DOUBLE => Some(Meaning::Plain),
            Type::INT32 | Type::INT64 if is_decimal => Some(Meaning::Decimal(10f64.powi(column.type_scale()))),
            Type::INT32 | Type::INT64 if is_unsigned => Some(Meaning::Unsigned),
            Type::INT64 if unit.is_some() => unit.map(Meaning::Stamp),
            Type::INT32 | Type::INT64 => Some(Meaning::Plain),
            Type::INT96 => Some(Meaning::Stamp(1)),
            Type::BYTE_ARRAY => is_text.then_some(Meaning::Text),
            Type::FIXED_LEN_BYTE_ARRAY => None,
        }
    }

    fn number(self, value: i64, unsigned: u64) -> f64 {
        match self {
            Meaning::Unsigned => unsigned as f64,
            Meaning::Decimal(unit) => value as f64 / unit,
            _ => value as f64,
        }
    }

    fn values(self, cells: Vec<Option<i64>>, unsigned: fn(i64) -> u64) -> ColumnValues {
        if let Meaning::Stamp(unit_ns) = self {
            let stamp = |cell: Option<i64>| {
                let nanoseconds = i128::from(cell?) * i128::from(unit_ns);
                jiff::Timestamp::from_nanosecond(nanoseconds).ok().map(|stamp| stamp.to_string())
            };
            return ColumnValues::Texts(cells.into_iter().map(|cell| stamp(cell).unwrap_or_default()).collect());
        }
        let number = |cell: Option<i64>| cell.map_or(f64::NAN, |v| self.number(v, unsigned(v)));
        ColumnValues::Numbers(cells.into_iter().map(number).collect())
    }
}

#[derive(Debug)]
struct Read {
    place: usize,
    name: String,
    meaning: Meaning,
}

struct Table {
    reader: SerializedFileReader<File>,
    columns: Vec<Read>,
    group: usize,
    /// Of the group that is being read.
    open: Vec<ColumnReader>,
    left: usize,
}

impl TableColumns for Table {
    fn names(&self) -> Vec<String> {
        self.columns.iter().map(|c| c.name.clone()).collect()
    }

    fn block(&mut self) -> Result<Option<Vec<ColumnValues>>, String> {
        while self.left == 0 {
            if self.group == self.reader.num_row_groups() {
                return Ok(None);
            }
            let group = self.reader.get_row_group(self.group).map_err(said)?;
            self.group += 1;
            self.left = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
            let opened = self.columns.iter().map(|c| group.get_column_reader(c.place)).collect::<Result<_, _>>();
            self.open = opened.map_err(said)?;
        }
        let rows = self.left.min(BLOCK_ROWS);
        self.left -= rows;
        let read = |(column, reader): (&Read, &mut ColumnReader)| cells(column.meaning, reader, rows);
        let block: Vec<ColumnValues> = self.columns.iter().zip(&mut self.open).map(read).collect::<Result<_, _>>()?;
        Ok(Some(block))
    }
}

fn cells(meaning: Meaning, reader: &mut ColumnReader, rows: usize) -> Result<ColumnValues, String> {
    // What a 32-bit column holds has 32 bits without its sign, too.
    let short = |v: i64| u64::from(v as u32);
    let long = |v: i64| v as u64;
    Ok(match reader {
        ColumnReader::BoolColumnReader(r) => meaning.values(taken(r, rows, |v| i64::from(*v))?, long),
        ColumnReader::Int32ColumnReader(r) => meaning.values(taken(r, rows, |v| i64::from(*v))?, short),
        ColumnReader::Int64ColumnReader(r) => meaning.values(taken(r, rows, |v| *v)?, long),
        ColumnReader::Int96ColumnReader(r) => meaning.values(taken(r, rows, |v| v.to_nanos())?, long),
        ColumnReader::FloatColumnReader(r) => ColumnValues::Numbers(filled(taken(r, rows, |v| f64::from(*v))?)),
        ColumnReader::DoubleColumnReader(r) => ColumnValues::Numbers(filled(taken(r, rows, |v| *v)?)),
        ColumnReader::ByteArrayColumnReader(r) => {
            let texts = taken(r, rows, |v: &ByteArray| String::from_utf8_lossy(v.data()).into_owned())?;
            ColumnValues::Texts(texts.into_iter().map(Option::unwrap_or_default).collect())
        }
        ColumnReader::FixedLenByteArrayColumnReader(r) => {
            ColumnValues::Texts(taken(r, rows, |_: &FixedLenByteArray| String::new())?.into_iter().flatten().collect())
        }
    })
}

fn filled(cells: Vec<Option<f64>>) -> Vec<f64> {
    cells.into_iter().map(|cell| cell.unwrap_or(f64::NAN)).collect()
}

/// So many rows of a column; None where a cell has nothing.
fn taken<T: DataType, V>(
    reader: &mut ColumnReaderImpl<T>,
    rows: usize,
    to: impl Fn(&T::T) -> V,
) -> Result<Vec<Option<V>>, String> {
    let mut found = Vec::with_capacity(rows);
    while found.len() < rows {
        let (mut levels, mut values) = (Vec::new(), Vec::new());
        let asked = rows - found.len();
        let (records, _, _) = reader.read_records(asked, Some(&mut levels), None, &mut values).map_err(said)?;
        if records == 0 {
            return Err("is a Parquet file that ends early".to_owned());
        }
        if levels.is_empty() {
            found.extend(values.iter().map(|v| Some(to(v))));
        } else {
            // A cell that is there has the deepest level of its column.
            let deepest = if values.is_empty() { i16::MAX } else { levels.iter().copied().max().unwrap_or(0) };
            let mut values = values.iter();
            found.extend(levels.iter().map(|level| if *level == deepest { values.next().map(&to) } else { None }));
        }
    }
    Ok(found)
}
