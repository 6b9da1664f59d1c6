//! Columns of numbers through the Arrow C stream interface, out without a copy and in from whatever library speaks it.
//!
//! # Source
//! The Arrow C data and C stream interfaces and their PyCapsule protocol, as specified at arrow.apache.org.

use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::ptr::null_mut;
use std::sync::Arc;

use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyCapsule, PyCapsuleMethods};

use crate::error::wrong;

const STREAM: &CStr = c"arrow_array_stream";

#[repr(C)]
struct Schema {
    format: *const c_char,
    name: *const c_char,
    metadata: *const c_char,
    flags: i64,
    n_children: i64,
    children: *mut *mut Schema,
    dictionary: *mut Schema,
    release: Option<unsafe extern "C" fn(*mut Schema)>,
    private_data: *mut c_void,
}

#[repr(C)]
struct Array {
    length: i64,
    null_count: i64,
    offset: i64,
    n_buffers: i64,
    n_children: i64,
    buffers: *mut *const c_void,
    children: *mut *mut Array,
    dictionary: *mut Array,
    release: Option<unsafe extern "C" fn(*mut Array)>,
    private_data: *mut c_void,
}

#[repr(C)]
struct ArrayStream {
    get_schema: Option<unsafe extern "C" fn(*mut ArrayStream, *mut Schema) -> c_int>,
    get_next: Option<unsafe extern "C" fn(*mut ArrayStream, *mut Array) -> c_int>,
    get_last_error: Option<unsafe extern "C" fn(*mut ArrayStream) -> *const c_char>,
    release: Option<unsafe extern "C" fn(*mut ArrayStream)>,
    private_data: *mut c_void,
}

/// A stream in a capsule: released when nobody took it.
#[repr(transparent)]
struct Capsuled(ArrayStream);

// SAFETY: what the stream points at is behind an `Arc` of parts that any thread may own.
unsafe impl Send for Capsuled {}

impl Drop for Capsuled {
    fn drop(&mut self) {
        if let Some(release) = self.0.release {
            // SAFETY: a stream that still has its release was taken by nobody.
            unsafe { release(&mut self.0) };
        }
    }
}

/// A column that NumPy keeps.
struct Kept {
    name: CString,
    _array: Py<PyArray1<f64>>,
    values: *const f64,
}

struct Columns {
    rows: usize,
    kept: Vec<Kept>,
}

// SAFETY: the arrays are read-only here, and their memory lives as long as the references to them.
unsafe impl Send for Columns {}
unsafe impl Sync for Columns {}

/// What a stream has left to give.
struct Source {
    columns: Arc<Columns>,
    is_given: bool,
}

/// Named columns of one length as a stream of one batch.
#[pyfunction]
pub fn arrow_stream<'py>(
    py: Python<'py>,
    columns: Vec<(String, Bound<'py, PyArray1<f64>>)>,
) -> PyResult<Bound<'py, PyCapsule>> {
    let rows = columns.first().map_or(0, |(_, array)| array.len().unwrap_or(0));
    let kept = columns.into_iter().map(|(name, array)| {
        let read = array.readonly();
        let values =
            read.as_slice().map_err(|_| wrong(py, format!("{name}: expected numbers one behind the other")))?;
        if values.len() != rows {
            return Err(wrong(py, format!("{name}: expected {rows} numbers, found {}", values.len())));
        }
        let values = values.as_ptr();
        let name = CString::new(name).map_err(|_| wrong(py, "a column's name holds a NUL"))?;
        Ok(Kept { name, values, _array: array.unbind() })
    });
    let columns = Arc::new(Columns { rows, kept: kept.collect::<PyResult<_>>()? });
    let source = Box::new(Source { columns, is_given: false });
    let stream = ArrayStream {
        get_schema: Some(give_schema),
        get_next: Some(give_next),
        get_last_error: Some(no_error),
        release: Some(release_stream),
        private_data: Box::into_raw(source).cast(),
    };
    PyCapsule::new_with_value(py, Capsuled(stream), STREAM)
}

unsafe extern "C" fn no_error(_stream: *mut ArrayStream) -> *const c_char {
    std::ptr::null()
}

unsafe extern "C" fn release_stream(stream: *mut ArrayStream) {
    // SAFETY: the interface calls this once, with the stream that `arrow_stream` made.
    unsafe {
        drop(Box::from_raw((*stream).private_data.cast::<Source>()));
        (*stream).private_data = null_mut();
        (*stream).release = None;
    }
}

/// Children of a schema or an array, and what they point into.
struct Held<T> {
    _columns: Arc<Columns>,
    buffers: Vec<[*const c_void; 2]>,
    children: Vec<*mut T>,
}

unsafe extern "C" fn give_schema(stream: *mut ArrayStream, out: *mut Schema) -> c_int {
    // SAFETY: the interface hands over the stream that `arrow_stream` made and room for a schema.
    unsafe {
        let source = &*(*stream).private_data.cast::<Source>();
        let columns = Arc::clone(&source.columns);
        let child = |kept: &Kept| {
            Box::into_raw(Box::new(Schema {
                format: c"g".as_ptr(),
                name: kept.name.as_ptr(),
                metadata: std::ptr::null(),
                flags: 0,
                n_children: 0,
                children: null_mut(),
                dictionary: null_mut(),
                release: Some(release_leaf_schema),
                private_data: Arc::into_raw(Arc::clone(&columns)).cast_mut().cast(),
            }))
        };
        let children: Vec<*mut Schema> = columns.kept.iter().map(child).collect();
        let mut held = Box::new(Held { _columns: columns, buffers: Vec::new(), children });
        out.write(Schema {
            format: c"+s".as_ptr(),
            name: c"".as_ptr(),
            metadata: std::ptr::null(),
            flags: 0,
            n_children: held.children.len() as i64,
            children: held.children.as_mut_ptr(),
            dictionary: null_mut(),
            release: Some(release_schema),
            private_data: Box::into_raw(held).cast(),
        });
    }
    0
}

unsafe extern "C" fn release_leaf_schema(schema: *mut Schema) {
    // SAFETY: its private data is an `Arc` of the columns.
    unsafe {
        drop(Arc::from_raw((*schema).private_data.cast::<Columns>()));
        (*schema).release = None;
    }
}

unsafe extern "C" fn release_schema(schema: *mut Schema) {
    // SAFETY: its private data is what `give_schema` made; children that were moved away have no release left.
    unsafe {
        let held = Box::from_raw((*schema).private_data.cast::<Held<Schema>>());
        for child in &held.children {
            if let Some(release) = (**child).release {
                release(*child);
            }
            drop(Box::from_raw(*child));
        }
        (*schema).release = None;
    }
}

unsafe extern "C" fn give_next(stream: *mut ArrayStream, out: *mut Array) -> c_int {
    // SAFETY: as in `give_schema`.
    unsafe {
        let source = &mut *(*stream).private_data.cast::<Source>();
        if std::mem::replace(&mut source.is_given, true) {
            out.write(ended());
            return 0;
        }
        let columns = Arc::clone(&source.columns);
        let rows = columns.rows as i64;
        let mut buffers: Vec<[*const c_void; 2]> =
            columns.kept.iter().map(|kept| [std::ptr::null(), kept.values.cast()]).collect();
        buffers.push([std::ptr::null(); 2]);
        let mut held = Box::new(Held { _columns: Arc::clone(&columns), buffers, children: Vec::new() });
        held.children = (0..columns.kept.len())
            .map(|index| {
                let buffers = Box::new(held.buffers[index]);
                let leaf = Box::new(Leaf { _columns: Arc::clone(&columns), buffers });
                let leaf = Box::into_raw(leaf);
                Box::into_raw(Box::new(Array {
                    length: rows,
                    null_count: 0,
                    offset: 0,
                    n_buffers: 2,
                    n_children: 0,
                    buffers: (*leaf).buffers.as_mut_ptr(),
                    children: null_mut(),
                    dictionary: null_mut(),
                    release: Some(release_leaf),
                    private_data: leaf.cast(),
                }))
            })
            .collect();
        let last = held.buffers.len() - 1;
        out.write(Array {
            length: rows,
            null_count: 0,
            offset: 0,
            n_buffers: 1,
            n_children: held.children.len() as i64,
            buffers: held.buffers[last].as_mut_ptr(),
            children: held.children.as_mut_ptr(),
            dictionary: null_mut(),
            release: Some(release_array),
            private_data: Box::into_raw(held).cast(),
        });
    }
    0
}

/// The buffers of one column and what keeps them.
struct Leaf {
    _columns: Arc<Columns>,
    buffers: Box<[*const c_void; 2]>,
}

/// What says that a stream has nothing more.
fn ended() -> Array {
    Array {
        length: 0,
        null_count: 0,
        offset: 0,
        n_buffers: 0,
        n_children: 0,
        buffers: null_mut(),
        children: null_mut(),
        dictionary: null_mut(),
        release: None,
        private_data: null_mut(),
    }
}

unsafe extern "C" fn release_leaf(array: *mut Array) {
    // SAFETY: its private data is what `give_next` made.
    unsafe {
        drop(Box::from_raw((*array).private_data.cast::<Leaf>()));
        (*array).release = None;
    }
}

unsafe extern "C" fn release_array(array: *mut Array) {
    // SAFETY: as `release_schema`.
    unsafe {
        let held = Box::from_raw((*array).private_data.cast::<Held<Array>>());
        for child in &held.children {
            if let Some(release) = (**child).release {
                release(*child);
            }
            drop(Box::from_raw(*child));
        }
        (*array).release = None;
    }
}

/// The numeric columns of a stream, missing values as NaN; further columns are left out.
#[pyfunction]
pub fn arrow_columns<'py>(
    py: Python<'py>,
    capsule: &Bound<'py, PyCapsule>,
) -> PyResult<Vec<(String, Bound<'py, PyArray1<f64>>)>> {
    let stream = capsule.pointer_checked(Some(STREAM))?.cast::<ArrayStream>().as_ptr();
    // SAFETY: a capsule of this name holds a stream; whoever made it keeps to the interface.
    unsafe {
        let (Some(get_schema), Some(get_next)) = ((*stream).get_schema, (*stream).get_next) else {
            return Err(wrong(py, "the table's stream has been read already"));
        };
        if (*stream).release.is_none() {
            return Err(wrong(py, "the table's stream has been read already"));
        }
        let mut schema = std::mem::zeroed::<Schema>();
        if get_schema(stream, &mut schema) != 0 {
            return Err(wrong(py, "the table's schema cannot be read"));
        }
        let columns: Vec<(String, String)> = (0..schema.n_children as usize)
            .map(|i| {
                let child = *schema.children.add(i);
                let text = |p: *const c_char| {
                    if p.is_null() { String::new() } else { CStr::from_ptr(p).to_string_lossy().into_owned() }
                };
                (text((*child).name), text((*child).format))
            })
            .collect();
        if let Some(release) = schema.release {
            release(&mut schema);
        }
        let mut found: Vec<Option<Vec<f64>>> =
            columns.iter().map(|(_, format)| is_number(format).then(Vec::new)).collect();
        loop {
            let mut batch = std::mem::zeroed::<Array>();
            if get_next(stream, &mut batch) != 0 {
                return Err(wrong(py, "the table's rows cannot be read"));
            }
            let Some(release) = batch.release else { break };
            for (i, values) in found.iter_mut().enumerate() {
                if let Some(values) = values {
                    append(values, &**batch.children.add(i), &columns[i].1, batch.offset, batch.length);
                }
            }
            release(&mut batch);
        }
        let named = columns.into_iter().zip(found).filter_map(|((name, _), values)| Some((name, values?)));
        Ok(named.map(|(name, values)| (name, PyArray1::from_vec(py, values))).collect())
    }
}

fn is_number(format: &str) -> bool {
    matches!(format, "g" | "f" | "l" | "L" | "i" | "I" | "s" | "S" | "c" | "C")
}

/// # Safety
/// `array` is a primitive array of the format, as long as said.
unsafe fn append(values: &mut Vec<f64>, array: &Array, format: &str, offset: i64, length: i64) {
    let from = (array.offset + offset) as usize;
    let rows = length as usize;
    unsafe {
        let (validity, data) = ((*array.buffers).cast::<u8>(), *array.buffers.add(1));
        macro_rules! taken {
            ($number:ty) => {{
                let data = data.cast::<$number>();
                for row in from..from + rows {
                    let is_valid = validity.is_null() || *validity.add(row / 8) >> (row % 8) & 1 == 1;
                    values.push(if is_valid { *data.add(row) as f64 } else { f64::NAN });
                }
            }};
        }
        match format {
            "g" => taken!(f64),
            "f" => taken!(f32),
            "l" => taken!(i64),
            "L" => taken!(u64),
            "i" => taken!(i32),
            "I" => taken!(u32),
            "s" => taken!(i16),
            "S" => taken!(u16),
            "c" => taken!(i8),
            _ => taken!(u8),
        }
    }
}
