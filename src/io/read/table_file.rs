//! Record files that are no text in UTF-8: other encodings, and tables of other programs, told by their first bytes and turned into the rows
//! that a text would hold.
//!
//! | file | feature | by |
//! |---|---|---|
//! | MAT of versions 5 to 7 | `mat` | `matlab`, unpacked by flate2 |
//! | HDF5, and so MAT of version 7.3 | `mat` | hdf5-reader |
//! | Parquet | `parquet` | the parquet package of Apache Arrow |
//!
//! What comes of them is a header and rows as CSV has them, in blocks: names, units, mappings and what to do with rows that are none
//! are then the same for all files, and a record that passes by needs no more memory than a block.

mod encoding;
#[cfg(feature = "mat")]
mod hdf;
#[cfg(any(feature = "mat", feature = "parquet"))]
mod layout;
#[cfg(feature = "mat")]
mod matlab;
#[cfg(feature = "parquet")]
mod parquet;
#[cfg(any(feature = "mat", feature = "parquet"))]
mod rows;

use std::fs::File;
use std::io::{Cursor, Read};
use std::path::Path;

use crate::io::fault::Faults;

use encoding::{Decoded, Encoding};

/// Where rows come from, as text.
pub struct Source<'s> {
    reader: Box<dyn Read + 's>,
    is_table: bool,
    remarks: Vec<String>,
}

impl<'s> Source<'s> {
    /// A text, whose rows are told by their lines.
    pub(crate) fn text(reader: impl Read + 's) -> Self {
        Self { reader: Box::new(reader), is_table: false, remarks: Vec::new() }
    }

    #[cfg(any(feature = "mat", feature = "parquet"))]
    fn table(columns: impl rows::TableColumns + 's, remarks: Vec<String>) -> Self {
        Self { reader: Box::new(rows::TableText::new(columns)), is_table: true, remarks }
    }

    /// A file of any kind that can be read.
    ///
    /// # Errors
    /// A file that cannot be opened, or that this build does not read.
    pub fn open(path: &Path) -> Result<Source<'static>, Faults> {
        let name = path.display().to_string();
        let unreadable = |e: std::io::Error| Faults::of_file(&name, format!("cannot be read: {e}"));
        if path.is_dir() {
            return Err(Faults::of_file(&name, "expected a file, found a folder"));
        }
        let mut file = File::open(path).map_err(unreadable)?;
        // Of a pipe nothing may be lost.
        let mut head = Vec::new();
        (&mut file).take(HEAD_BYTES).read_to_end(&mut head).map_err(unreadable)?;
        match Kind::of(&head) {
            Some(kind) => kind.open(path),
            None => Ok(Source::decoded(head, file)),
        }
    }

    /// A text whose first bytes were read already, in UTF-8 whatever it is in.
    fn decoded(head: Vec<u8>, rest: impl Read + 's) -> Self {
        let encoding = Encoding::of(&head);
        let whole = Cursor::new(head).chain(rest);
        let Some(encoding) = encoding else { return Source::text(whole) };
        Source { remarks: vec![encoding.remark()], ..Source::text(Decoded::new(whole, encoding)) }
    }

    /// A table of another program, or a text that is not in UTF-8; none of what is.
    ///
    /// # Errors
    /// A table that cannot be read, or that this build does not read.
    pub(crate) fn open_other(path: &Path) -> Result<Option<Source<'static>>, Faults> {
        let mut head = Vec::new();
        // What cannot be opened or is a pipe is said of when it is read as a text.
        let is_file = std::fs::metadata(path).is_ok_and(|found| found.is_file());
        if is_file && let Ok(file) = File::open(path) {
            let _ = file.take(HEAD_BYTES).read_to_end(&mut head);
        }
        let is_other = Kind::of(&head).is_some() || Encoding::of(&head).is_some();
        is_other.then(|| Source::open(path)).transpose()
    }

    /// Whether its rows have numbers and no lines.
    pub(crate) fn is_table(&self) -> bool {
        self.is_table
    }

    /// What opening it noticed, in words.
    pub(crate) fn remarks(&self) -> &[String] {
        &self.remarks
    }

    /// The same with something between it and whoever reads.
    pub(crate) fn map<R: Read + 's>(self, wrap: impl FnOnce(Box<dyn Read + 's>) -> R) -> Self {
        Self { reader: Box::new(wrap(self.reader)), ..self }
    }
}

impl Read for Source<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        self.reader.read(buffer)
    }
}

/// Within these bytes every kind shows what it is.
const HEAD_BYTES: u64 = 4096;
const HDF_SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";
/// A user's block of the smallest sizes may stand before an HDF5 file, as in MAT files.
const HDF_BEGINNINGS: [usize; 4] = [0, 512, 1024, 2048];

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Matlab,
    Hdf,
    Parquet,
    /// What nothing here reads: what it is, and what to do.
    Foreign(&'static str, &'static str),
}

const AS_CSV: &str = "write the table as CSV, from the program that made it";

/// First bytes of files that people take for records.
const FOREIGN: &[(&[u8], &str, &str)] = &[
    (b"PK\x03\x04", "an Excel workbook or another ZIP archive", "save the sheet as CSV, or unpack the archive"),
    (b"\xd0\xcf\x11\xe0", "an old Excel workbook", "save the sheet as CSV"),
    (b"\x1f\x8b", "compressed by gzip", "unpack it (gunzip), or pipe it: gunzip -c FILE | coilwright metrics -"),
    (b"\x28\xb5\x2f\xfd", "compressed by Zstandard", "unpack it (zstd -d)"),
    (b"BZh", "compressed by bzip2", "unpack it (bunzip2)"),
    (b"\xfd7zXZ", "compressed by xz", "unpack it (unxz)"),
    (b"TDSm", "a LabVIEW TDMS file", AS_CSV),
    (b"ARROW1", "an Arrow (Feather) file", "write the table as Parquet or CSV"),
    (b"\x93NUMPY", "a NumPy array without names for its columns", "write it as CSV with a header (numpy.savetxt)"),
    (b"SQLite format 3", "an SQLite database", "write the table as CSV"),
];

impl Kind {
    /// None of a text.
    fn of(head: &[u8]) -> Option<Self> {
        if HDF_BEGINNINGS.iter().any(|at| head.get(*at..).is_some_and(|rest| rest.starts_with(HDF_SIGNATURE))) {
            return Some(Kind::Hdf);
        }
        // Before the signature of byte order that ends its head it is text.
        if head.starts_with(b"MATLAB 5.0 MAT-file") && matches!(head.get(126..128), Some(b"IM" | b"MI")) {
            return Some(Kind::Matlab);
        }
        if head.starts_with(b"PAR1") {
            return Some(Kind::Parquet);
        }
        let foreign = FOREIGN.iter().find(|(magic, _, _)| head.starts_with(magic));
        foreign.map(|(_, what, remedy)| Kind::Foreign(what, remedy))
    }

    fn open(self, path: &Path) -> Result<Source<'static>, Faults> {
        let name = path.display().to_string();
        let opened = match self {
            #[cfg(feature = "mat")]
            Kind::Matlab => matlab::open(path),
            #[cfg(feature = "mat")]
            Kind::Hdf => hdf::open(path),
            #[cfg(feature = "parquet")]
            Kind::Parquet => parquet::open(path),
            #[cfg(not(feature = "mat"))]
            Kind::Matlab => Err(not_built("a MAT file", "mat")),
            #[cfg(not(feature = "mat"))]
            Kind::Hdf => Err(not_built("an HDF5 file (as MAT files of version 7.3 are)", "mat")),
            #[cfg(not(feature = "parquet"))]
            Kind::Parquet => Err(not_built("a Parquet file", "parquet")),
            Kind::Foreign(what, remedy) => Err(format!("expected a record, found a file that is {what}: {remedy}")),
        };
        opened.map_err(|message| Faults::of_file(name, message))
    }
}

#[cfg(not(all(feature = "mat", feature = "parquet")))]
fn not_built(what: &str, feature: &str) -> String {
    format!(
        "is {what}, which this build does not read: build the program with the feature {feature} (cargo install coilwright --features {feature}), or write the table as CSV"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_told_by_its_first_bytes_and_a_text_is_none_of_them() {
        let mut matlab = b"MATLAB 5.0 MAT-file, Platform: GLNXA64".to_vec();
        matlab.resize(126, b' ');
        assert_eq!(Kind::of(&matlab), None);
        matlab.extend(b"IM");
        assert_eq!(Kind::of(&matlab), Some(Kind::Matlab));
        let mut late = vec![b' '; 512];
        late.extend(HDF_SIGNATURE);
        assert_eq!(Kind::of(&late), Some(Kind::Hdf));
        assert_eq!(Kind::of(b"PAR1\x15"), Some(Kind::Parquet));
        assert_eq!(Kind::of(b"time_s,temperature_c,rate_deg_per_h\n"), None);
        for (magic, _, remedy) in FOREIGN {
            assert!(matches!(Kind::of(magic), Some(Kind::Foreign(_, found)) if found == *remedy));
        }
    }
}
