//! Who hears how far a computation has come: a callable, or a bar of tqdm.

use pyo3::prelude::*;

/// A watcher as the Python side makes it.
pub struct Watcher<'py>(Option<Bound<'py, PyAny>>);

impl<'py> Watcher<'py> {
    /// What is called with each progress.
    pub fn called(&self) -> Option<&Bound<'py, PyAny>> {
        self.0.as_ref()
    }

    /// Ends a bar that this package has opened.
    ///
    /// # Errors
    /// What closing it raises.
    pub fn close(&self) -> PyResult<()> {
        let Some(called) = &self.0 else { return Ok(()) };
        let own = called.py().import("surgescope._progress")?.getattr("Bar")?;
        if called.is_instance(&own)? { called.call_method0("close").map(drop) } else { Ok(()) }
    }
}

/// The watcher that `progress=` asks for.
///
/// # Errors
/// Neither a callable nor a bool.
pub fn watcher<'py>(py: Python<'py>, asked: Option<Bound<'py, PyAny>>, total: Option<usize>) -> PyResult<Watcher<'py>> {
    let made = py.import("surgescope._progress")?.call_method1("watcher", (asked, total))?;
    Ok(Watcher(Some(made).filter(|made| !made.is_none())))
}
