//! Numbers of the library as arrays that look at its memory, and back.

use numpy::ndarray::ArrayView;
use numpy::{Element, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

/// A read-only array over memory that `owner` keeps: nothing is copied.
///
/// `owner` must own `values` and never change or free them while it lives: all handles of this module are frozen and hold their
/// numbers behind an `Arc`.
pub fn view1<'py, T: Element>(owner: Bound<'py, PyAny>, values: &[T]) -> Bound<'py, PyArray1<T>> {
    let view = ArrayView::from(values);
    // SAFETY: the base object keeps the memory alive, and nothing of this module writes to it.
    let array = unsafe { PyArray1::borrow_from_array(&view, owner) };
    locked1(array)
}

/// As [`view1`], of rows one behind the other.
pub fn view2<'py>(owner: Bound<'py, PyAny>, values: &[f64], columns: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let rows = values.len() / columns.max(1);
    let view = ArrayView::from_shape((rows, columns), values)
        .map_err(|e| pyo3::exceptions::PyValueError::new_err(e.to_string()))?;
    // SAFETY: as in `view1`.
    let array = unsafe { PyArray2::borrow_from_array(&view, owner) };
    Ok(array.readwrite().make_nonwriteable().as_ref().clone())
}

fn locked1<T: Element>(array: Bound<PyArray1<T>>) -> Bound<PyArray1<T>> {
    array.readwrite().make_nonwriteable().as_ref().clone()
}
