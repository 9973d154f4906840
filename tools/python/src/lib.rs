//! surgescope for Python: the front door of the library, `study`, as classes, with arrays of numpy. No physics is in
//! here, and nothing is printed.
//!
//! The package `surgescope` (`python/surgescope`) hands on what this module has.

mod arrays;
mod arrow;
mod call;
mod diagnosis;
mod error;
mod fit;
mod json;
mod pickled;
mod recording;
mod rig;
mod simulate;
mod study;
mod table;
mod watch;

use std::ffi::OsString;

use pyo3::prelude::*;

/// Runs the program with its arguments, the script that calls it first, and returns the exit code.
#[pyfunction]
fn run_program(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    if let Some(script) = arguments.first() {
        surgescope::cli::console::own_program::called_by(script.into());
    }
    py.detach(|| surgescope::cli::run(&arguments))
}

#[pymodule]
mod _native {
    #[pymodule_export]
    use crate::call::Progress;
    #[pymodule_export]
    use crate::diagnosis::{Candidate, Diagnosis};
    #[pymodule_export]
    use crate::error::{Error, SurgescopeWarning};
    #[pymodule_export]
    use crate::fit::{Fit, FittedRun, FittedSensor, Parameter, Posterior};
    #[pymodule_export]
    use crate::recording::{Recording, Sensor, read};
    #[pymodule_export]
    use crate::rig::{Pipe, Rig, RigSensor};
    #[pymodule_export]
    use crate::run_program;
    #[pymodule_export]
    use crate::simulate::{defaults, simulate, simulate_many};
    #[pymodule_export]
    use crate::study::Study;
    use pyo3::prelude::*;

    /// What only some errors have, all have empty.
    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.getattr("Error")?.setattr("sensor_faults", ())
    }
}
