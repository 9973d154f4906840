//! What the program prints as JSON, as objects of Python.

use pyo3::prelude::*;
use serde::Serialize;

/// By way of its text, as a script that calls the program would read it.
///
/// # Errors
/// None in practice: all values can be written.
pub fn object<'py>(py: Python<'py>, value: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(value).map_err(std::io::Error::from)?;
    py.import("json")?.call_method1("loads", (text,))
}
