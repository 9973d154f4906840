//! A table of named columns, for pandas and, by Arrow's C interface, for polars, pyarrow and whatever else reads it.

use numpy::PyArray1;
use pyo3::exceptions::PyModuleNotFoundError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::error::sentence;

/// The values of a column.
pub enum Values {
    /// Numbers; one that is not known is not a number, and null in Arrow.
    Numbers(Vec<f64>),
    /// Texts; one that is not there is None in pandas, and null in Arrow.
    Texts(Vec<Option<String>>),
    /// Yes or no.
    Flags(Vec<bool>),
}

/// Columns of one length.
pub struct Table(pub Vec<(&'static str, Values)>);

impl Table {
    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.0.first().map_or(0, |(_, values)| match values {
            Values::Numbers(numbers) => numbers.len(),
            Values::Texts(texts) => texts.len(),
            Values::Flags(flags) => flags.len(),
        })
    }

    /// As a DataFrame of pandas.
    ///
    /// # Errors
    /// Where pandas is not installed.
    pub fn into_pandas<'py>(self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let pandas = py.import("pandas").map_err(|error| match error.is_instance_of::<PyModuleNotFoundError>(py) {
            true => sentence("to_pandas needs pandas, which is not installed: pip install pandas"),
            false => error,
        })?;
        let columns = PyDict::new(py);
        for (name, values) in self.0 {
            match values {
                Values::Numbers(numbers) => columns.set_item(name, PyArray1::from_vec(py, numbers))?,
                Values::Texts(texts) => columns.set_item(name, texts)?,
                Values::Flags(flags) => columns.set_item(name, PyArray1::from_vec(py, flags))?,
            }
        }
        pandas.call_method1("DataFrame", (columns,))
    }
}
