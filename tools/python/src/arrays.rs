//! Arrays for numpy without copies.

use numpy::ndarray::ArrayView1;
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;

/// A view on numbers that `owner` holds; it cannot be written to, for others see the same numbers.
///
/// `owner` must be frozen and must hold `values` as long as it lives.
pub fn view<'py>(owner: Bound<'py, PyAny>, values: &[f64]) -> Bound<'py, PyArray1<f64>> {
    // SAFETY: the owner is kept alive by the array, and a frozen object never moves or frees what it holds.
    let array = unsafe { PyArray1::borrow_from_array(&ArrayView1::from(values), owner) };
    array.readwrite().make_nonwriteable();
    array
}
