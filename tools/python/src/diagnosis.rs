//! What a model lacks.

use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyCapsule, PyTuple};
use surgescope::diagnose::{Candidate as Rival, Diagnosis as Found};
use surgescope::report::diagnosis::text;

use crate::arrow;
use crate::error::sentence;
use crate::fit::{Fit, parameters};
use crate::json;
use crate::pickled::{packed, unpacked};
use crate::study::{Origin, Study};
use crate::table::{Table, Values};

/// Where a model fails, and which effect is missing. It does not change, and can be pickled.
#[pyclass(frozen, module = "surgescope")]
pub struct Diagnosis {
    found: Arc<Found>,
    origin: Arc<Origin>,
}

/// An effect that may be missing.
#[pyclass(frozen, module = "surgescope")]
pub struct Candidate {
    found: Arc<Found>,
    origin: Arc<Origin>,
    place: usize,
}

impl Candidate {
    fn own(&self) -> &Rival {
        &self.found.candidates[self.place]
    }
}

#[pymethods]
impl Candidate {
    /// The effect's name.
    #[getter]
    fn effect(&self) -> &'static str {
        self.own().effect
    }

    /// The form of it that fits best, with its elements or sensor, as `grow` takes it.
    #[getter]
    fn label(&self) -> &str {
        &self.own().label
    }

    /// Probability that it is the one that is missing.
    #[getter]
    fn probability(&self) -> f64 {
        self.own().probability
    }

    /// Evidence for it over the start model, natural logarithm of the odds.
    #[getter]
    fn evidence(&self) -> f64 {
        self.own().evidence
    }

    /// Root mean square of measured - model with it, m.
    #[getter]
    fn rmse_m(&self) -> f64 {
        self.own().rmse_m
    }

    /// Effects that these recordings cannot tell from it.
    #[getter]
    fn indistinguishable_from(&self) -> Vec<&'static str> {
        self.own().indistinguishable_from.clone()
    }

    /// Its own parameters by name.
    #[getter]
    #[pyo3(name = "parameters")]
    fn by_name<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        parameters(py, &self.own().parameters)
    }

    /// The whole model with it, fitted; None where it was not worth a full fit.
    #[getter]
    fn fit(&self) -> Option<Fit> {
        let fit = self.own().fit.clone()?;
        Some(Fit::new(fit, self.origin.clone(), Some(self.own().evidence), Vec::new()))
    }

    fn __repr__(&self) -> String {
        let (label, probability) = (&self.own().label, surgescope::number::probability(self.own().probability));
        format!(
            "<surgescope.Candidate {label}: probability {probability}, RMSE {} m>",
            surgescope::number::error_m(self.own().rmse_m)
        )
    }
}

impl Diagnosis {
    /// With what it was made of.
    pub fn new(found: Found, origin: Arc<Origin>) -> Self {
        Diagnosis { found: Arc::new(found), origin }
    }

    fn fit(&self, fit: &surgescope::Fit) -> Fit {
        Fit::new(fit.clone(), self.origin.clone(), None, Vec::new())
    }

    fn table(&self) -> Table {
        let all = &self.found.candidates;
        let numbers = |of: &dyn Fn(&Rival) -> f64| Values::Numbers(all.iter().map(of).collect());
        let texts = |of: &dyn Fn(&Rival) -> String| Values::Texts(all.iter().map(|c| Some(of(c))).collect());
        Table(vec![
            ("effect", texts(&|c| c.effect.to_owned())),
            ("label", texts(&|c| c.label.clone())),
            ("probability", numbers(&|c| c.probability)),
            ("evidence", numbers(&|c| c.evidence)),
            ("rmse_m", numbers(&|c| c.rmse_m)),
            ("indistinguishable_from", texts(&|c| c.indistinguishable_from.join(", "))),
        ])
    }
}

#[pymethods]
impl Diagnosis {
    /// missing-effect, nothing-missing (the residual is noise) or unknown-effect (something is missing that no effect
    /// of the catalogue explains).
    #[getter]
    fn verdict(&self) -> &'static str {
        self.found.verdict.name()
    }

    /// Probability that the verdict is right.
    #[getter]
    fn probability(&self) -> f64 {
        self.found.probability
    }

    /// Effects that could be missing, best first.
    #[getter]
    fn candidates(&self) -> Vec<Candidate> {
        let of = |place| Candidate { found: self.found.clone(), origin: self.origin.clone(), place };
        (0..self.found.candidates.len()).map(of).collect()
    }

    /// The two effects that are missing together, where no single one is the answer; None otherwise.
    #[getter]
    fn pair(&self) -> Option<(String, String)> {
        self.found.pair.as_ref().map(|pair| (pair.labels[0].clone(), pair.labels[1].clone()))
    }

    /// The start model, fitted.
    #[getter]
    fn start(&self) -> Fit {
        self.fit(&self.found.start)
    }

    /// The start model with what is missing, fitted; None where nothing is, or where it could not be fitted.
    #[getter]
    fn answer(&self) -> Option<Fit> {
        self.found.answer().map(|fit| self.fit(fit))
    }

    /// Where the start model fails, a sentence each.
    #[getter]
    fn residual_patterns(&self) -> Vec<String> {
        self.found.residual_patterns.clone()
    }

    /// The test that would tell the best candidates apart, where these recordings cannot; empty otherwise.
    #[getter]
    fn next_test(&self) -> &str {
        self.found.next_test.as_deref().unwrap_or("")
    }

    /// Reasons to doubt the rest, a sentence each.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.found.warnings.clone()
    }

    /// The study that was diagnosed.
    #[getter]
    fn study(&self) -> Study {
        Study(self.origin.clone())
    }

    /// All about it, with the keys of `surgescope diagnose --json`.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let study = self.origin.study(py)?;
        let faults: Vec<_> = study.recordings().iter().flat_map(|loaded| loaded.faults.iter().cloned()).collect();
        let value =
            text::value(std::slice::from_ref(&*self.found), &faults).map_err(|error| sentence(error.to_string()))?;
        json::object(py, &value)
    }

    /// The candidates as a DataFrame of pandas: effect, label, probability, evidence, rmse_m, indistinguishable_from.
    ///
    /// Raises Error where pandas is not installed.
    fn to_pandas<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.table().into_pandas(py)
    }

    /// The same table for polars, pyarrow and others that read Arrow.
    #[pyo3(signature = (requested_schema = None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        drop(requested_schema); // a request that a producer may leave unheeded
        arrow::stream(py, self.table())
    }

    fn _repr_html_(&self) -> String {
        surgescope::report::notebook::diagnosis(&self.found)
    }

    fn __repr__(&self) -> String {
        let best = self.found.answer_label();
        let best = if best.is_empty() { best } else { format!(", best candidate {best}") };
        format!("<surgescope.Diagnosis {}{best}>", self.verdict())
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let state = (PyBytes::new(py, &packed(&*self.found)?), self.study());
        Ok((py.get_type::<Diagnosis>().getattr("_of")?, state.into_pyobject(py)?))
    }

    /// From the parts that a pickle holds.
    #[staticmethod]
    fn _of(found: &[u8], study: &Bound<'_, Study>) -> PyResult<Diagnosis> {
        Ok(Diagnosis::new(unpacked(found).map_err(sentence)?, study.get().0.clone()))
    }
}
