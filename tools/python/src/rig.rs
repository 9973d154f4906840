//! A rig.

use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyTuple;
use surgescope::rig;

use crate::error::refused;

/// A test rig: fluid, pipes in series from the supply to the valve, sensors. It does not change, and can be pickled.
#[pyclass(frozen, module = "surgescope")]
pub struct Rig(pub Arc<rig::Rig>);

/// One pipe of a rig.
#[pyclass(frozen, module = "surgescope", get_all)]
pub struct Pipe {
    /// Its name.
    name: String,
    /// Length, m.
    length_m: f64,
    /// Inner diameter, m.
    inner_diameter_m: f64,
    /// Wall thickness, m.
    wall_thickness_m: f64,
    /// Material of the wall.
    material: String,
}

/// A sensor as its rig file describes it.
#[pyclass(frozen, module = "surgescope", get_all)]
pub struct RigSensor {
    /// Its name.
    name: String,
    /// pressure, flow, temperature, valve-position or trigger.
    kind: &'static str,
    /// Distance from the supply along the pipe, m.
    position_m: f64,
    /// Unit of its readings, as in the rig file.
    unit: &'static str,
}

#[pymethods]
impl Rig {
    /// Reads a rig file (TOML).
    ///
    /// Raises Error with every problem in the file: the line, the key, and what to do.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Rig> {
        let rig = py.detach(|| rig::Rig::load(&path)).map_err(|error| refused(py, &error))?;
        Ok(Rig(Arc::new(rig)))
    }

    /// Reads the text of a rig file; `name` is for messages.
    ///
    /// Raises Error as `load` does.
    #[staticmethod]
    #[pyo3(signature = (text, name = "rig.toml"))]
    fn from_toml(py: Python<'_>, text: &str, name: &str) -> PyResult<Rig> {
        Ok(Rig(Arc::new(rig::Rig::from_toml(text, name).map_err(|error| refused(py, &error))?)))
    }

    /// The rig's name.
    #[getter]
    fn name(&self) -> &str {
        &self.0.name
    }

    /// Text of the rig file.
    #[getter]
    fn source(&self) -> &str {
        &self.0.source
    }

    /// Length from the supply to the valve, m.
    #[getter]
    fn length_m(&self) -> f64 {
        self.0.length_m()
    }

    /// Temperature of the water where no sensor reads it, °C.
    #[getter]
    #[pyo3(name = "temperature_degC")]
    fn temperature_degc(&self) -> f64 {
        self.0.fluid.temperature_degc
    }

    /// The pipes, from the supply to the valve.
    #[getter]
    fn pipes(&self) -> Vec<Pipe> {
        let of = |pipe: &rig::Pipe| Pipe {
            name: pipe.name.clone(),
            length_m: pipe.length_m,
            inner_diameter_m: pipe.inner_diameter_m,
            wall_thickness_m: pipe.wall_thickness_m,
            material: pipe.material.clone(),
        };
        self.0.pipes.iter().map(of).collect()
    }

    /// The sensors, in the order of the rig file.
    #[getter]
    fn sensors(&self) -> Vec<RigSensor> {
        let of = |sensor: &rig::Sensor| RigSensor {
            name: sensor.name.clone(),
            kind: sensor.kind.name(),
            position_m: sensor.position_m,
            unit: sensor.unit.symbol,
        };
        self.0.sensors.iter().map(of).collect()
    }

    fn __repr__(&self) -> String {
        let sensors: Vec<&str> = self.0.sensors.iter().map(|sensor| sensor.name.as_str()).collect();
        format!("<surgescope.Rig '{}': {} m, sensors {}>", self.0.name, self.0.length_m(), sensors.join(", "))
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Rig>().is_ok_and(|other| other.get().0.stored_text() == self.0.stored_text())
    }

    fn __hash__(&self) -> u64 {
        use std::hash::{DefaultHasher, Hash, Hasher};
        let mut hasher = DefaultHasher::new();
        self.0.source.hash(&mut hasher);
        hasher.finish()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let stored = py.get_type::<Rig>().getattr("_stored")?;
        Ok((stored, PyTuple::new(py, [self.0.stored_text().as_str(), self.0.name.as_str()])?))
    }

    /// From the text that a recording keeps, as pickles do.
    #[staticmethod]
    fn _stored(py: Python<'_>, text: &str, name: &str) -> PyResult<Rig> {
        Ok(Rig(Arc::new(rig::Rig::from_stored(text, name).map_err(|error| refused(py, &error))?)))
    }
}

/// A rig, or the file of one.
#[derive(FromPyObject)]
pub enum GivenRig<'py> {
    /// A rig at hand.
    #[pyo3(annotation = "Rig")]
    Rig(Bound<'py, Rig>),
    /// The path of a rig file.
    #[pyo3(annotation = "path")]
    Path(PathBuf),
}

impl GivenRig<'_> {
    /// The rig.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn rig(&self, py: Python<'_>) -> PyResult<Arc<rig::Rig>> {
        match self {
            GivenRig::Rig(rig) => Ok(rig.get().0.clone()),
            GivenRig::Path(path) => Ok(Rig::load(py, path.clone())?.0),
        }
    }
}
