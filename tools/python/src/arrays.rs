//! Arrays for numpy without copies.

use numpy::ndarray::ArrayView1;
use numpy::{AllowTypeChange, PyArray1, PyArrayLike1, PyArrayMethods};
use pyo3::prelude::*;

use crate::error::sentence;

/// A view on numbers that `owner` holds; it cannot be written to, for others see the same numbers.
///
/// `owner` must be frozen and must hold `values` as long as it lives.
pub fn view<'py>(owner: Bound<'py, PyAny>, values: &[f64]) -> Bound<'py, PyArray1<f64>> {
    // SAFETY: the owner is kept alive by the array, and a frozen object never moves or frees what it holds.
    let array = unsafe { PyArray1::borrow_from_array(&ArrayView1::from(values), owner) };
    array.readwrite().make_nonwriteable();
    array
}

/// The numbers of a list, an array or a column.
///
/// # Errors
/// One number, a table, or what is no number.
pub fn numbers(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let array: PyResult<PyArrayLike1<'_, f64, AllowTypeChange>> = given.extract();
    let array =
        array.map_err(|_| sentence(format!("{name}: give numbers in a list or in an array of one dimension")))?;
    Ok(array.as_array().to_vec())
}
