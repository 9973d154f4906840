//! The front door: recordings, ready to be calibrated and diagnosed.

use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use surgescope::cli::args::values;
use surgescope::fit::outcome::fit::Fit as Fitted;
use surgescope::fit::problem::method::Method;
use surgescope::fit::search::options::Options;
use surgescope::fit::validate::conflict::warnings;
use surgescope::model::effects::Chosen;
use surgescope::recording::Recording as Recorded;
use surgescope::study::Study as Opened;
use surgescope::study::hold::{Hold, beyond, constraints};
use surgescope::study::search::Search;

use crate::call::{Progress, on_all_cores};
use crate::diagnosis::Diagnosis;
use crate::error::{AnyError, refused, sentence, warn};
use crate::fit::Fit;
use crate::recording::Recording;
use crate::rig::Rig;
use crate::simulate::{Effects, pairs};
use crate::watch::watcher;

/// Where a study comes from, so that another process can open it again.
enum Source {
    /// Files, as they were given, and from the root; the rig file that replaces the stored one.
    Files { given: Vec<PathBuf>, absolute: Vec<PathBuf>, rig: Option<PathBuf> },
    /// Recordings at hand.
    Recordings(Vec<(String, Arc<Recorded>)>),
}

/// A study that is opened when it is first needed.
pub struct Origin {
    source: Source,
    ignore: Vec<String>,
    opened: OnceLock<Opened>,
}

impl Origin {
    fn open(&self) -> Result<Opened, AnyError> {
        match &self.source {
            Source::Files { given, rig, .. } => Ok(Opened::open_without(rig.as_deref(), given, &self.ignore)?),
            Source::Recordings(recordings) => {
                let without = |(name, recorded): &(String, Arc<Recorded>)| {
                    Ok((name.clone(), (**recorded).clone().without(&self.ignore)?))
                };
                Ok(Opened::from_recordings(recordings.iter().map(without).collect::<Result<Vec<_>, AnyError>>()?)?)
            }
        }
    }

    /// The study, opened.
    ///
    /// # Errors
    /// Recordings that cannot be read or show no closure.
    pub fn study(self: &Arc<Self>, py: Python<'_>) -> PyResult<Opened> {
        if let Some(opened) = self.opened.get() {
            return Ok(opened.clone());
        }
        let own = self.clone();
        let opened = on_all_cores(py, None, None, move |_| own.open())?;
        Ok(self.opened.get_or_init(|| opened).clone())
    }

    /// What a computation of the study finds, on all cores.
    ///
    /// # Errors
    /// Those of the work, an interruption.
    pub fn computed<T: Send + 'static>(
        self: &Arc<Self>,
        py: Python<'_>,
        call: Call<'_>,
        work: impl FnOnce(&Opened) -> Result<T, AnyError> + Send + 'static,
    ) -> PyResult<T> {
        let mut study = self.study(py)?;
        let watcher = watcher(py, call.progress, None)?;
        let done = on_all_cores(py, call.threads, watcher.called(), move |told| {
            let told = told.clone();
            study.on_progress(move |progress| told.tell(Progress::from(progress.clone())));
            work(&study)
        });
        watcher.close()?;
        done
    }
}

/// How a long call is run.
pub struct Call<'py> {
    /// At most so many cores.
    pub threads: Option<usize>,
    /// What `progress=` was given.
    pub progress: Option<Bound<'py, PyAny>>,
}

/// Recordings of one rig, ready to be calibrated and diagnosed. It does not change, and can be pickled: files are then
/// opened again by their path.
#[pyclass(frozen, module = "surgescope")]
pub struct Study(pub Arc<Origin>);

/// A recording at hand, or the path of one.
#[derive(FromPyObject)]
enum Given<'py> {
    #[pyo3(annotation = "Recording")]
    Recording(Bound<'py, Recording>),
    #[pyo3(annotation = "path")]
    Path(PathBuf),
}

/// One recording or several.
#[derive(FromPyObject)]
enum OneOrMore<'py> {
    #[pyo3(annotation = "Recording or path")]
    One(Given<'py>),
    #[pyo3(annotation = "list")]
    More(Vec<Given<'py>>),
}

fn origin(recordings: OneOrMore<'_>, rig: Option<PathBuf>, ignore: Vec<String>) -> PyResult<Origin> {
    let all = match recordings {
        OneOrMore::One(one) => vec![one],
        OneOrMore::More(more) => more,
    };
    let (mut given, mut at_hand) = (Vec::new(), Vec::new());
    for one in all {
        match one {
            Given::Path(path) => given.push(path),
            Given::Recording(recording) => {
                at_hand.push((recording.get().file.clone(), recording.get().recorded.clone()))
            }
        }
    }
    let source = match (given.is_empty(), at_hand.is_empty()) {
        (_, true) => {
            let absolute = given.iter().map(std::path::absolute).collect::<Result<_, _>>()?;
            Source::Files { given, absolute, rig: rig.map(std::path::absolute).transpose()? }
        }
        (true, false) if rig.is_none() => Source::Recordings(at_hand),
        (true, false) => {
            return Err(sentence("rig= replaces the rig of files; give it to read() for recordings at hand"));
        }
        (false, false) => return Err(sentence("give paths alone, or recordings alone")),
    };
    Ok(Origin { source, ignore, opened: OnceLock::new() })
}

/// Parameters that are held, at a value or between two.
fn held(given: Option<&Bound<'_, PyDict>>) -> PyResult<Vec<Hold>> {
    let Some(given) = given else { return Ok(Vec::new()) };
    let of = |(name, value): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
        let name: String = name.extract()?;
        let (lower, upper) = match value.extract::<f64>() {
            Ok(value) => (value, value),
            Err(_) => value.extract::<(f64, f64)>().map_err(|_| {
                sentence(format!("hold {name}: give a number, or the least and the greatest of two, not {value}"))
            })?,
        };
        match lower <= upper && lower.is_finite() && upper.is_finite() {
            true => Ok(Hold { name, lower, upper }),
            false => Err(sentence(format!(
                "hold {name}: give a finite value, or the least and the greatest of two, not {value}"
            ))),
        }
    };
    given.iter().map(of).collect()
}

fn method(name: &str) -> PyResult<Method> {
    let known = || Method::ALL.map(Method::name).join(", ");
    let found = Method::ALL.into_iter().find(|method| method.name() == name);
    found.ok_or_else(|| sentence(format!("method = '{name}' is none of {}", known())))
}

/// The finest grid, where one is given.
fn reaches(given: Option<usize>) -> PyResult<Option<usize>> {
    let checked = given.map(|given| values::reaches(&given.to_string())).transpose();
    checked.map_err(|words| sentence(format!("most_reaches {words}")))
}

/// A number of independent draws of a posterior.
///
/// # Errors
/// Too few or too many.
pub fn draws(given: usize) -> PyResult<usize> {
    values::draws(&given.to_string()).map_err(|words| sentence(format!("the number of draws {words}")))
}

/// Warns of values that no fit would take.
fn warn_beyond(
    py: Python<'_>,
    what: &str,
    study: &Opened,
    effects: &[Chosen],
    values: &[(String, f64)],
) -> PyResult<()> {
    beyond(study.rig(), study.runs(), effects, values)
        .iter()
        .try_for_each(|beyond| warn(py, &format!("{what} {beyond}")))
}

/// The same of values that are held.
fn warn_held(py: Python<'_>, study: &Opened, effects: &[Chosen], hold: &[Hold]) -> PyResult<()> {
    let fixed: Vec<(String, f64)> = hold.iter().filter(|h| h.fixed()).map(|h| (h.name.clone(), h.lower)).collect();
    warn_beyond(py, "hold", study, effects, &fixed)
}

#[pymethods]
impl Study {
    /// Reads, inspects and prepares recordings of one rig: paths, or recordings at hand.
    ///
    /// `rig` is a rig file that replaces the stored rig; `ignore` names sensors that are left out, as if they had not
    /// been recorded. Warns of what in the recordings should make a user look twice (`warnings`).
    ///
    /// Raises Error: no file, one that cannot be read or shows no closure, one given twice, recordings of different
    /// rigs, a sensor at fault.
    #[new]
    #[pyo3(signature = (recordings, rig = None, *, ignore = Vec::new()))]
    fn new(py: Python<'_>, recordings: OneOrMore<'_>, rig: Option<PathBuf>, ignore: Vec<String>) -> PyResult<Study> {
        let origin = Arc::new(origin(recordings, rig, ignore)?);
        origin.study(py)?.warnings().iter().try_for_each(|warning| warn(py, warning))?;
        Ok(Study(origin))
    }

    /// The rig.
    #[getter]
    fn rig(&self, py: Python<'_>) -> PyResult<Rig> {
        Ok(Rig(Arc::new(self.0.study(py)?.rig().clone())))
    }

    /// The recordings, each on the rig in force; of a long one the part that is used.
    #[getter]
    fn recordings(&self, py: Python<'_>) -> PyResult<Vec<Recording>> {
        let study = self.0.study(py)?;
        let of = |loaded: &surgescope::study::open::Loaded| {
            Recording::new(loaded.file.clone(), Arc::new(loaded.recording.clone()), Vec::new())
        };
        Ok(study.recordings().iter().map(of).collect())
    }

    /// What in the recordings should make a user look twice, a sentence each.
    #[getter]
    fn warnings(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        Ok(self.0.study(py)?.warnings())
    }

    /// Fits a model.
    ///
    /// `effects` are added to the base model: ["viscoelastic-wall:2", "leak"], or "none". `hold` holds parameters at a
    /// value, or keeps them between two: {"wave_speed_m_s": 360.0, "leak_position_m": (50.0, 70.0)}; `start` says where
    /// the search starts. `method` is least-squares, global, micro-ga, global-local or stepwise; `starts` are random
    /// starts of least-squares, `budget` simulations of a global search, `steps` those of stepwise, `seed` that of all
    /// random draws, `most_reaches` the finest grid. With `posterior` the joint posterior of the values is sampled until
    /// each parameter has so many independent draws, as `Fit.sample` does. `threads` limits the cores; `progress` is a
    /// callable that takes a Progress, by default a bar of tqdm in a notebook, False for none.
    ///
    /// Raises Error: effects that do not exist or exclude each other, a parameter that the model does not have, a model
    /// that cannot be simulated.
    #[pyo3(signature = (
        effects = Effects::default(), *, hold = None, start = None, method = "least-squares", starts = None, budget = None, steps = None, seed = None,
        most_reaches = None, posterior = None, threads = None, progress = None
    ))]
    #[allow(clippy::too_many_arguments)] // they are keywords
    fn calibrate<'py>(
        &self,
        py: Python<'py>,
        effects: Effects,
        hold: Option<Bound<'py, PyDict>>,
        start: Option<Bound<'py, PyDict>>,
        method: &str,
        starts: Option<usize>,
        budget: Option<usize>,
        steps: Option<usize>,
        seed: Option<u64>,
        most_reaches: Option<usize>,
        posterior: Option<usize>,
        threads: Option<usize>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Fit> {
        let (effects, hold, start) = (effects.chosen(py)?, held(hold.as_ref())?, pairs(start.as_ref())?);
        let (most_reaches, posterior) = (reaches(most_reaches)?, posterior.map(draws).transpose()?);
        let search = Search { method: self::method(method)?, starts, budget, steps, seed, start };
        let options = search.options(None).map_err(|error| refused(py, &error))?;
        search
            .check_held(hold.iter().filter(|h| h.fixed()).map(|h| h.name.as_str()))
            .map_err(|error| refused(py, &error))?;
        let study = self.0.study(py)?;
        warn_held(py, &study, &effects, &hold)?;
        warn_beyond(py, "start", &study, &effects, &search.start)?;
        let call = Call { threads, progress };
        let (fit, warnings) = self.0.computed(py, call, move |study| {
            let most_reaches = most_reaches.unwrap_or(options.most_reaches);
            let models = [effects];
            let held = constraints(study.rig(), study.runs(), &models, &hold).concat();
            let options = Options { most_reaches, constraints: held, ..options };
            let seed = options.seed;
            let mut fit = study.calibrate(&models[0]).options(options).run()?;
            search.check(fit.parameters.iter().map(|p| p.name.as_str()))?;
            if let Some(wanted) = posterior {
                study.sample(&mut fit, wanted, seed)?;
            }
            Ok(with_warnings(study, fit))
        })?;
        match posterior {
            Some(_) => Fit::sampled(py, fit, self.0.clone(), None, warnings),
            None => Ok(Fit::new(fit, self.0.clone(), None, warnings)),
        }
    }

    /// Fits a model and says what it lacks.
    ///
    /// Arguments as in `calibrate`; a number of elements that `effects` leave open is open for all models that are
    /// compared.
    ///
    /// Raises Error as `calibrate` does; also for a sensor at fault (`sensor_faults`), for an effect would only stand
    /// in for the fault.
    #[pyo3(signature = (effects = Effects::default(), *, hold = None, most_reaches = None, threads = None, progress = None))]
    fn diagnose<'py>(
        &self,
        py: Python<'py>,
        effects: Effects,
        hold: Option<Bound<'py, PyDict>>,
        most_reaches: Option<usize>,
        threads: Option<usize>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Diagnosis> {
        let (effects, hold, most_reaches) = (effects.chosen(py)?, held(hold.as_ref())?, reaches(most_reaches)?);
        warn_held(py, &self.0.study(py)?, &effects, &hold)?;
        let found = self.0.computed(py, Call { threads, progress }, move |study| {
            let usual = Options::default();
            let models = [effects];
            let held = constraints(study.rig(), study.runs(), &models, &hold).concat();
            let options =
                Options { most_reaches: most_reaches.unwrap_or(usual.most_reaches), constraints: held, ..usual };
            Ok(study.diagnose_model(&models[0], &options)?)
        })?;
        Ok(Diagnosis::new(found, self.0.clone()))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let study = self.0.study(py)?;
        let files: Vec<&str> = study.recordings().iter().map(|loaded| loaded.file.as_str()).collect();
        Ok(format!("<surgescope.Study of {} on {}>", files.join(", "), study.rig().name))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (recordings, rig) = match &self.0.source {
            Source::Files { absolute, rig, .. } => (absolute.into_pyobject(py)?.into_any(), rig.clone()),
            Source::Recordings(recordings) => {
                let of = |(name, recorded): &(String, Arc<Recorded>)| {
                    Recording::new(name.clone(), recorded.clone(), Vec::new())
                };
                (recordings.iter().map(of).collect::<Vec<_>>().into_pyobject(py)?.into_any(), None)
            }
        };
        let state = (recordings, rig, self.0.ignore.clone()).into_pyobject(py)?;
        Ok((py.get_type::<Study>().getattr("_later")?, state))
    }

    /// A study that is opened when it is first needed, as pickles make one.
    #[staticmethod]
    fn _later(recordings: OneOrMore<'_>, rig: Option<PathBuf>, ignore: Vec<String>) -> PyResult<Study> {
        Ok(Study(Arc::new(origin(recordings, rig, ignore)?)))
    }
}

/// A fit with what there is to warn of.
pub fn with_warnings(study: &Opened, fit: Fitted) -> (Fitted, Vec<String>) {
    let warned = warnings(&fit, study.runs());
    (fit, warned)
}
