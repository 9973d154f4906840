//! A calibrated model.

use std::path::PathBuf;
use std::sync::Arc;

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyCapsule, PyDict, PyMappingProxy, PyTuple};
use surgescope::fit::outcome::doubt::Doubt;
use surgescope::fit::outcome::fit::{Fit as Fitted, FittedParameter, RunFit, SensorFit};
use surgescope::fit::outcome::posterior::{Marginal, Posterior as Sampled};
use surgescope::fit::search::options::Options;
use surgescope::report::calibration::posterior::reservation;
use surgescope::results::fit_file::Form;
use surgescope::storage::output;

use crate::arrays::view;
use crate::arrow;
use crate::diagnosis::Diagnosis;
use crate::error::{fault, refused, sentence, warn};
use crate::json;
use crate::pickled::{packed, unpacked};
use crate::simulate::Effects;
use crate::study::{Call, Origin, Study, draws, with_warnings};
use crate::table::{Table, Values};

/// A calibrated model of one recording or of several. It does not change, and can be pickled.
#[pyclass(frozen, module = "surgescope")]
pub struct Fit {
    /// The fit.
    pub fit: Arc<Fitted>,
    /// What it was fitted to.
    pub origin: Arc<Origin>,
    evidence: Option<f64>,
    warnings: Vec<String>,
}

/// One fitted parameter, in the unit of its name.
#[pyclass(frozen, module = "surgescope", get_all)]
pub struct Parameter {
    /// Its name.
    name: String,
    /// The file of the run that it belongs to; None where all runs share it.
    run: Option<String>,
    /// Fitted value, in `unit`.
    value: f64,
    /// Lower end of the 95% interval, in `unit`; -inf where the data leave it open, NaN where the fit ended at no
    /// optimum.
    low: f64,
    /// Upper end of the 95% interval, in `unit`; inf where the data leave it open, NaN where the fit ended at no
    /// optimum.
    high: f64,
    /// Standard error, in `unit`: 0 of a value that was held, inf where the data leave it open, NaN at a bound or where
    /// the fit ended at no optimum.
    standard_error: f64,
    /// Unit.
    unit: &'static str,
    /// Why the interval that the standard error gives is in doubt: bound, curved (looked for where the posterior is
    /// sampled) or open; None where it is not.
    doubt: Option<&'static str>,
    /// Whether it ended at one of its bounds.
    at_bound: bool,
    /// Whether it was held.
    held: bool,
    /// Least value that the fit could take, in `unit`.
    lower: f64,
    /// Greatest value that the fit could take, in `unit`.
    upper: f64,
    /// What it is, in words.
    about: &'static str,
}

impl From<&FittedParameter> for Parameter {
    fn from(p: &FittedParameter) -> Self {
        Parameter {
            name: p.name.clone(),
            run: p.run.clone(),
            value: p.value,
            low: p.interval_95.0,
            high: p.interval_95.1,
            standard_error: p.standard_error(),
            unit: p.unit,
            doubt: p.doubt.map(Doubt::name),
            at_bound: p.at_bound,
            held: p.held,
            lower: p.lower,
            upper: p.upper,
            about: p.about,
        }
    }
}

#[pymethods]
impl Parameter {
    fn __repr__(&self) -> String {
        let value = surgescope::number::with_error(self.value, self.standard_error);
        let run = self.run.as_ref().map_or(String::new(), |run| format!(" of {run}"));
        format!("<surgescope.Parameter {}{run} = {value} {}>", self.name, self.unit)
    }
}

/// Parameters by name, as Python's `Parameters`.
pub fn parameters<'py>(py: Python<'py>, all: &[FittedParameter]) -> PyResult<Bound<'py, PyAny>> {
    let listed: Vec<Parameter> = all.iter().map(Parameter::from).collect();
    py.import("surgescope._parameters")?.call_method1("Parameters", (listed,))
}

/// Parameters as a table.
pub fn table(all: &[FittedParameter]) -> Table {
    let numbers = |of: &dyn Fn(&FittedParameter) -> f64| Values::Numbers(all.iter().map(of).collect());
    let texts = |of: &dyn Fn(&FittedParameter) -> Option<String>| Values::Texts(all.iter().map(of).collect());
    let flags = |of: &dyn Fn(&FittedParameter) -> bool| Values::Flags(all.iter().map(of).collect());
    Table(vec![
        ("name", texts(&|p| Some(p.name.clone()))),
        ("run", texts(&|p| p.run.clone())),
        ("value", numbers(&|p| p.value)),
        ("low", numbers(&|p| p.interval_95.0)),
        ("high", numbers(&|p| p.interval_95.1)),
        ("standard_error", numbers(&|p| p.standard_error())),
        ("unit", texts(&|p| Some(p.unit.to_owned()))),
        ("at_bound", flags(&|p| p.at_bound)),
        ("held", flags(&|p| p.held)),
    ])
}

/// One recording under a fitted model.
#[pyclass(frozen, module = "surgescope")]
pub struct FittedRun {
    fit: Arc<Fitted>,
    run: usize,
}

/// Measurement and model at one pressure sensor of a run; all arrays have one length and are read-only.
#[pyclass(frozen, module = "surgescope")]
pub struct FittedSensor {
    fit: Arc<Fitted>,
    run: usize,
    sensor: usize,
}

/// The joint posterior of a fit's values, sampled. Its parameters are those that were free, in the order of the fit's;
/// all arrays follow it.
#[pyclass(frozen, module = "surgescope")]
pub struct Posterior {
    fit: Arc<Fitted>,
}

impl Posterior {
    fn own(&self) -> PyResult<&Sampled> {
        self.fit.posterior.as_ref().ok_or_else(fault)
    }

    /// Of each sampled parameter.
    fn each<T>(&self, of: impl Fn(&FittedParameter) -> T) -> PyResult<Vec<T>> {
        Ok(self.own()?.of.iter().map(|&j| of(&self.fit.parameters[j])).collect())
    }

    /// Of the posterior of each sampled parameter.
    fn marginal<T>(&self, of: impl Fn(&Marginal) -> T) -> PyResult<Vec<T>> {
        self.each(|p| p.posterior.as_ref().map(&of))?.into_iter().map(|known| known.ok_or_else(fault)).collect()
    }
}

#[pymethods]
impl Posterior {
    /// Names of the sampled parameters.
    #[getter]
    fn names(&self) -> PyResult<Vec<String>> {
        self.each(|p| p.name.clone())
    }

    /// The file of the run that each of them belongs to; None where all runs share it.
    #[getter]
    fn runs(&self) -> PyResult<Vec<Option<String>>> {
        self.each(|p| p.run.clone())
    }

    /// Draws, evenly from all chains, shape (draws, parameters), in the units of the names: as many as were asked for,
    /// and 1000 or so where those were fewer.
    #[getter]
    fn draws<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        Ok(PyArray2::from_vec2(py, &self.own()?.draws)?)
    }

    /// 95% interval of each parameter, shape (parameters, 2); an end that a bound cuts off where the density is high is
    /// infinite.
    #[getter]
    fn interval_95<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        Ok(PyArray2::from_vec2(py, &self.marginal(|m| vec![m.interval_95.0, m.interval_95.1])?)?)
    }

    /// Median of each parameter's draws, shape (parameters,).
    #[getter]
    fn median<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(PyArray1::from_vec(py, self.marginal(|m| m.median)?))
    }

    /// R-hat of each parameter, shape (parameters,): 1 where all chains show the same.
    #[getter]
    fn r_hat<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(PyArray1::from_vec(py, self.marginal(|m| m.r_hat)?))
    }

    /// Independent draws that say as much of each parameter as all its chains, shape (parameters,).
    #[getter]
    fn effective_draws<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(PyArray1::from_vec(py, self.marginal(|m| m.effective_draws)?))
    }

    /// Whether the chains have met and say as much as was asked for; otherwise no interval of the fit comes from them.
    #[getter]
    fn converged(&self) -> PyResult<bool> {
        Ok(self.own()?.converged)
    }

    fn __repr__(&self) -> PyResult<String> {
        let own = self.own()?;
        let number = |v: f64, digits: usize| format!("{v:.digits$}");
        Ok(format!(
            "<surgescope.Posterior of {} parameters: {} independent draws or more, R-hat {} or less{}>",
            own.of.len(),
            number(own.effective_draws, 0),
            number(own.r_hat, 3),
            if own.converged { "" } else { ", not converged" }
        ))
    }
}

impl FittedRun {
    fn own(&self) -> &RunFit {
        &self.fit.runs[self.run]
    }
}

#[pymethods]
impl FittedRun {
    /// File name.
    #[getter]
    fn file(&self) -> &str {
        &self.own().file
    }

    /// Root mean square of measured - model over all samples of all pressure sensors from the start of the closure, m.
    #[getter]
    fn rmse_m(&self) -> f64 {
        self.own().rmse_m
    }

    /// Noise over the same samples, m.
    #[getter]
    fn noise_m(&self) -> f64 {
        self.own().noise_m
    }

    /// Its pressure sensors by name.
    #[getter]
    fn sensors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
        let sensors = PyDict::new(py);
        for (sensor, own) in self.own().sensors.iter().enumerate() {
            sensors.set_item(&own.name, FittedSensor { fit: self.fit.clone(), run: self.run, sensor })?;
        }
        Ok(PyMappingProxy::new(py, sensors.as_mapping()))
    }

    fn __repr__(&self) -> String {
        let names: Vec<&str> = self.own().sensors.iter().map(|s| s.name.as_str()).collect();
        format!("<surgescope.FittedRun {}: sensors {}>", self.own().file, names.join(", "))
    }
}

impl FittedSensor {
    fn own(&self) -> &SensorFit {
        &self.fit.runs[self.run].sensors[self.sensor]
    }
}

#[pymethods]
impl FittedSensor {
    /// Sensor name.
    #[getter]
    fn name(&self) -> &str {
        &self.own().name
    }

    /// Distance from the supply, m.
    #[getter]
    fn position_m(&self) -> f64 {
        self.own().position_m
    }

    /// Sample times after the start of the closure, s.
    #[getter]
    fn time_s<'py>(this: Bound<'py, Self>) -> Bound<'py, PyArray1<f64>> {
        view(this.clone().into_any(), &this.get().own().time_s)
    }

    /// Measured head, m.
    #[getter]
    fn measured_m<'py>(this: Bound<'py, Self>) -> Bound<'py, PyArray1<f64>> {
        view(this.clone().into_any(), &this.get().own().measured_m)
    }

    /// Fitted head, m.
    #[getter]
    fn model_m<'py>(this: Bound<'py, Self>) -> Bound<'py, PyArray1<f64>> {
        view(this.clone().into_any(), &this.get().own().model_m)
    }

    /// Half the width of the band around the model that holds a sample with 95% probability, m; empty where it is not
    /// known.
    #[getter]
    fn band_m<'py>(this: Bound<'py, Self>) -> Bound<'py, PyArray1<f64>> {
        view(this.clone().into_any(), &this.get().own().band_m)
    }

    /// Standard deviation of the sensor's disturbances while the flow is steady, m.
    #[getter]
    fn noise_m(&self) -> f64 {
        self.own().noise_m
    }

    /// Root mean square of measured - model over all samples, m.
    #[getter]
    fn rmse_m(&self) -> f64 {
        self.own().rmse_m
    }

    fn __repr__(&self) -> String {
        let own = self.own();
        format!(
            "<surgescope.FittedSensor {}: {} samples, RMSE {} m>",
            own.name,
            own.time_s.len(),
            surgescope::number::error_m(own.rmse_m)
        )
    }
}

impl Fit {
    /// With what it was fitted to.
    pub fn new(fit: Fitted, origin: Arc<Origin>, evidence: Option<f64>, warnings: Vec<String>) -> Self {
        Fit { fit: Arc::new(fit), origin, evidence, warnings }
    }

    /// The same of one whose posterior was asked for: warns of what speaks against it.
    ///
    /// # Errors
    /// A warning that Python makes an error.
    pub fn sampled(
        py: Python<'_>,
        fit: Fitted,
        origin: Arc<Origin>,
        evidence: Option<f64>,
        warnings: Vec<String>,
    ) -> PyResult<Self> {
        reservation(&fit).iter().try_for_each(|reservation| warn(py, reservation))?;
        Ok(Fit::new(fit, origin, evidence, warnings))
    }
}

#[pymethods]
impl Fit {
    /// Root mean square of measured - model over all samples of all runs from the start of the closure, m.
    #[getter]
    fn rmse_m(&self) -> f64 {
        self.fit.pooled().0
    }

    /// Noise over the same samples, m: what a model that lacks nothing leaves.
    #[getter]
    fn noise_m(&self) -> f64 {
        self.fit.pooled().1
    }

    /// Effects beside the base model, their elements and sensors decided.
    #[getter]
    fn effects(&self) -> Vec<String> {
        self.fit.labels()
    }

    /// Parameters by name. Of several runs, a run's own parameter is found by its name and its file:
    /// parameters["closing_time_s", "a.mcap"].
    #[getter]
    #[pyo3(name = "parameters")]
    fn by_name<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        parameters(py, &self.fit.parameters)
    }

    /// Correlations between the errors of each two parameters, in their order, shape (parameters, parameters); NaN
    /// beside what is held or at a bound.
    #[getter]
    fn correlation<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        Ok(PyArray2::from_vec2(py, &self.fit.correlation)?)
    }

    /// The joint posterior of its values; None where it was not sampled.
    #[getter]
    fn posterior(&self) -> Option<Posterior> {
        self.fit.posterior.is_some().then(|| Posterior { fit: self.fit.clone() })
    }

    /// The same fit with its joint posterior, sampled until each parameter has `wanted` independent draws, 100 or more:
    /// where the chains have met, the 95% intervals are those of the draws. It may take minutes. `seed` is that of the
    /// draws; `threads` and `progress` as in `Study.calibrate`. Warns where the chains have not met, or where the fit
    /// has no posterior.
    ///
    /// Raises Error: too few draws or too many, a model that cannot be simulated.
    #[pyo3(signature = (wanted, *, seed = None, threads = None, progress = None))]
    fn sample<'py>(
        &self,
        py: Python<'py>,
        wanted: usize,
        seed: Option<u64>,
        threads: Option<usize>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Fit> {
        let (mut fit, wanted) = ((*self.fit).clone(), draws(wanted)?);
        let (fit, warnings) = self.origin.computed(py, Call { threads, progress }, move |study| {
            study.sample(&mut fit, wanted, seed.unwrap_or(Options::default().seed))?;
            Ok(with_warnings(study, fit))
        })?;
        Fit::sampled(py, fit, self.origin.clone(), self.evidence, warnings)
    }

    /// Each recording with its curves.
    #[getter]
    fn runs(&self) -> Vec<FittedRun> {
        (0..self.fit.runs.len()).map(|run| FittedRun { fit: self.fit.clone(), run }).collect()
    }

    /// The study that it was fitted to.
    #[getter]
    fn study(&self) -> Study {
        Study(self.origin.clone())
    }

    /// How it was searched for.
    #[getter]
    fn method(&self) -> &'static str {
        self.fit.method.name()
    }

    /// Reaches of the grid of the final fit.
    #[getter]
    fn reaches(&self) -> usize {
        self.fit.reaches
    }

    /// What halving the grid's step would still change, rms over all samples, m.
    #[getter]
    fn grid_error_m(&self) -> f64 {
        self.fit.grid_error_m
    }

    /// Simulations that it took.
    #[getter]
    fn evaluations(&self) -> usize {
        self.fit.evaluations
    }

    /// Wall time, s.
    #[getter]
    fn seconds(&self) -> f64 {
        self.fit.seconds
    }

    /// Whether it ended at an optimum; otherwise no errors and intervals are known.
    #[getter]
    fn converged(&self) -> bool {
        self.fit.converged
    }

    /// Why it stopped, in words.
    #[getter]
    fn stopped_because(&self) -> &str {
        &self.fit.stopped_because
    }

    /// Evidence for the effect by which it grew, natural logarithm of the odds; None of a fit that has not grown.
    #[getter]
    fn evidence(&self) -> Option<f64> {
        self.evidence
    }

    /// What contradicts what was known before the fit, ended at a bound, or makes errors too narrow; a sentence each.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }

    /// Combinations of parameters that the recordings do not determine, in words.
    #[getter]
    fn unseen(&self) -> Vec<String> {
        self.fit.unidentifiable.iter().map(|unseen| unseen.in_words.clone()).collect()
    }

    /// What this model lacks; nothing is fitted twice. `threads` and `progress` as in `Study.calibrate`.
    ///
    /// Raises Error: a recording with a faulty sensor (`sensor_faults`), a model that cannot be simulated.
    #[pyo3(signature = (*, threads = None, progress = None))]
    fn diagnose<'py>(
        &self,
        py: Python<'py>,
        threads: Option<usize>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Diagnosis> {
        let fit = self.fit.clone();
        let found = self.origin.computed(py, Call { threads, progress }, move |study| Ok(study.diagnose(&fit)?))?;
        Ok(Diagnosis::new(found, self.origin.clone()))
    }

    /// The model with one effect more, fitted; `evidence` says whether the recordings ask for it. `threads` and
    /// `progress` as in `Study.calibrate`.
    ///
    /// Raises Error: an effect that does not exist, that the model has already or that excludes another, a model that
    /// cannot be simulated.
    #[pyo3(signature = (effect, *, threads = None, progress = None))]
    fn grow<'py>(
        &self,
        py: Python<'py>,
        effect: Effects,
        threads: Option<usize>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Fit> {
        let (fit, effect) = (self.fit.clone(), effect.chosen(py)?);
        let (evidence, (fit, warnings)) = self.origin.computed(py, Call { threads, progress }, move |study| {
            let grown = study.grow(&fit, &effect)?;
            Ok((grown.evidence, with_warnings(study, grown.fit)))
        })?;
        Ok(Fit::new(fit, self.origin.clone(), Some(evidence), warnings))
    }

    /// The model without one of its effects, refitted from where the rest stands.
    ///
    /// Raises Error: an effect that the model does not have, a model that cannot be simulated.
    #[pyo3(signature = (effect, *, threads = None, progress = None))]
    fn without<'py>(
        &self,
        py: Python<'py>,
        effect: String,
        threads: Option<usize>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Fit> {
        let fit = self.fit.clone();
        let (fit, warnings) = self.origin.computed(py, Call { threads, progress }, move |study| {
            Ok(with_warnings(study, study.without(&fit, &effect)?))
        })?;
        Ok(Fit::new(fit, self.origin.clone(), None, warnings))
    }

    /// All about it, with the keys of `surgescope calibrate --json`.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::object(py, &self.origin.study(py)?.record(&self.fit, &self.warnings))
    }

    /// Writes a fit file, as `surgescope calibrate -o` does: TOML or JSON, by the ending of the path.
    ///
    /// Raises Error: another ending, a file that cannot be written.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let form = Form::of(&path).map_err(|error| refused(py, &error))?;
        let record = self.origin.study(py)?.record(&self.fit, &self.warnings);
        let text = record.text(form).map_err(|error| refused(py, error.as_ref()))?;
        output::write(&path, &text).map_err(|error| refused(py, &error))
    }

    /// The parameters as a DataFrame of pandas: name, run, value, low, high, standard_error, unit, at_bound, held.
    ///
    /// Raises Error where pandas is not installed.
    fn to_pandas<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        table(&self.fit.parameters).into_pandas(py)
    }

    /// The same table for polars, pyarrow and others that read Arrow.
    #[pyo3(signature = (requested_schema = None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        drop(requested_schema); // a request that a producer may leave unheeded
        arrow::stream(py, table(&self.fit.parameters))
    }

    fn _repr_html_(&self) -> String {
        surgescope::report::notebook::fit(&self.fit, &self.warnings)
    }

    fn __repr__(&self) -> String {
        let (rmse_m, noise_m) = self.fit.pooled();
        let model = surgescope::model::effects::name_of(&self.fit.effects);
        let error = surgescope::number::error_m(rmse_m);
        format!("<surgescope.Fit {model}: RMSE {error} m, {}>", surgescope::number::times_noise(rmse_m, noise_m))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let state = (PyBytes::new(py, &packed(&*self.fit)?), self.study(), self.evidence, self.warnings.clone());
        Ok((py.get_type::<Fit>().getattr("_of")?, state.into_pyobject(py)?))
    }

    /// From the parts that a pickle holds.
    #[staticmethod]
    fn _of(fit: &[u8], study: &Bound<'_, Study>, evidence: Option<f64>, warnings: Vec<String>) -> PyResult<Fit> {
        let fit = unpacked(fit).map_err(sentence)?;
        Ok(Fit::new(fit, study.get().0.clone(), evidence, warnings))
    }
}
