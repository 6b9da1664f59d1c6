//! Numbers of the library as arrays that look at its memory.

use numpy::ndarray::ArrayView;
use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// A read-only array over memory that `owner` keeps: nothing is copied.
///
/// `owner` must own `values` and never change or free them while it lives: all handles of this module are frozen and hold their
/// numbers behind an `Arc`.
pub fn view1<'py>(owner: Bound<'py, PyAny>, values: &[f64]) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let view = ArrayView::from(values);
    // SAFETY: the base object keeps the memory alive, and nothing of this module writes to it.
    let array = unsafe { PyArray1::borrow_from_array(&view, owner) };
    lock(&array)?;
    Ok(array)
}

/// As [`view1`], of rows one behind the other.
pub fn view2<'py>(owner: Bound<'py, PyAny>, values: &[f64], columns: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let rows = values.len() / columns.max(1);
    let view = ArrayView::from_shape((rows, columns), values).map_err(|e| PyValueError::new_err(e.to_string()))?;
    // SAFETY: as in `view1`.
    let array = unsafe { PyArray2::borrow_from_array(&view, owner) };
    lock(&array)?;
    Ok(array)
}

fn lock(array: &Bound<PyAny>) -> PyResult<()> {
    array.getattr("flags")?.setattr("writeable", false)
}
