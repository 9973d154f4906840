//! The one error of the package.

use std::error::Error as Cause;

use pyo3::create_exception;
use pyo3::exceptions::{PyUserWarning, PyValueError};
use pyo3::prelude::*;
use surgescope::Error as StudyError;
use surgescope::cli::console::refusal::in_words;

/// Any error of the library.
pub type AnyError = Box<dyn Cause + Send + Sync>;

create_exception!(
    surgescope,
    Error,
    PyValueError,
    "Any error of the package, with the sentence that the program prints: what is wrong, where, and what to do.\n\n\
     `sensor_faults` lists the sensors at fault, each a dict of sensor, fault and says; it is empty for any other error."
);
create_exception!(surgescope, SurgescopeWarning, PyUserWarning, "What should make a user look twice, one sentence.");

/// An error as the program prints it.
pub fn refused(py: Python<'_>, error: &(dyn Cause + 'static)) -> PyErr {
    let raised = Error::new_err(in_words(error));
    if let Some(StudyError::Faulty { faults, .. }) = error.downcast_ref() {
        let listed = faults.iter().map(|fault| crate::json::object(py, fault)).collect::<PyResult<Vec<_>>>();
        if let Err(other) = listed.and_then(|listed| raised.value(py).setattr("sensor_faults", listed)) {
            return other;
        }
    }
    raised
}

/// A sentence of this package's own.
pub fn sentence(words: impl Into<String>) -> PyErr {
    Error::new_err(words.into())
}

/// What a panic becomes.
pub fn fault() -> PyErr {
    sentence("this failed by a fault of surgescope; please report it with what you called")
}

/// Warns once from a line of the caller's code, as Python's filters say.
///
/// # Errors
/// Where the filters turn warnings into errors.
pub fn warn(py: Python<'_>, words: &str) -> PyResult<()> {
    let warning = py.get_type::<SurgescopeWarning>();
    py.import("warnings")?.call_method1("warn", (words, warning, 2))?;
    Ok(())
}
