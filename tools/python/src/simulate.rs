//! The model alone.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use surgescope::model::effects::{Chosen, parse_list};
use surgescope::model::stop;
use surgescope::model::trace::Trace;
use surgescope::rig;
use surgescope::simulate::cavities::unmodelled;
use surgescope::simulate::scenario::{Scenario, ValveForm};

use crate::arrays::numbers;
use crate::call::{Progress, on_all_cores, on_one};
use crate::error::{AnyError, refused, sentence, warn};
use crate::rig::GivenRig;

/// Effects of a model: a list, or the text of one as on the command line.
#[derive(FromPyObject)]
pub enum Effects {
    /// `"viscoelastic-wall:2,leak"`, or `"none"`.
    #[pyo3(annotation = "str")]
    Text(String),
    /// `["viscoelastic-wall:2", "leak"]`.
    #[pyo3(annotation = "list[str]")]
    List(Vec<String>),
}

impl Default for Effects {
    fn default() -> Self {
        Effects::List(Vec::new())
    }
}

impl Effects {
    /// The effects.
    ///
    /// # Errors
    /// One that does not exist, or that excludes another.
    pub fn chosen(&self, py: Python<'_>) -> PyResult<Vec<Chosen>> {
        let text = match self {
            Effects::Text(text) => text.clone(),
            Effects::List(list) => list.join(","),
        };
        parse_list(&text).map_err(|error| refused(py, &error))
    }
}

/// Names and values, in their order.
///
/// # Errors
/// A value that is no number.
pub fn pairs(given: Option<&Bound<'_, PyDict>>) -> PyResult<Vec<(String, f64)>> {
    let Some(given) = given else { return Ok(Vec::new()) };
    given.iter().map(|(name, value)| Ok((name.extract()?, number(&name, &value)?))).collect()
}

/// A finite number.
fn number(name: &Bound<'_, PyAny>, value: &Bound<'_, PyAny>) -> PyResult<f64> {
    let number: f64 = value.extract().map_err(|_| sentence(format!("{name} = {value} is not a number")))?;
    if number.is_finite() { Ok(number) } else { Err(sentence(format!("{name} = {number} is not a finite number"))) }
}

/// How the valve closes.
fn valve_form(name: &str) -> PyResult<ValveForm> {
    match name {
        "linear" => Ok(ValveForm::Linear),
        "flow-ramp" => Ok(ValveForm::FlowRamp),
        "flow-cycloid" => Ok(ValveForm::FlowCycloid),
        _ => Err(sentence(format!("valve = '{name}' is none of linear, flow-ramp, flow-cycloid"))),
    }
}

/// Times that a model can be asked for.
fn checked(times_s: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let times_s = numbers("times_s", times_s)?;
    match times_s.iter().find(|t| !t.is_finite()) {
        Some(strange) => Err(sentence(format!("times_s has {strange}: give finite times, s"))),
        None => Ok(times_s),
    }
}

/// What each pressure sensor shows at each time: its head, or its reading in its unit.
fn shown(scenario: &Scenario, traces: &[Trace], times_s: &[f64], readings: bool) -> Vec<Vec<f64>> {
    let of = |((index, _), trace): ((usize, &rig::Sensor), &Trace)| {
        let value = |&t: &f64| if readings { scenario.displayed(index, trace.at(t)) } else { trace.at(t) };
        times_s.iter().map(value).collect()
    };
    scenario.rig.pressure_sensors().zip(traces).map(of).collect()
}

/// Until when to simulate.
fn duration_s(times_s: &[f64]) -> f64 {
    times_s.iter().copied().fold(0.0, f64::max)
}

fn names(rig: &rig::Rig) -> Vec<String> {
    rig.pressure_sensors().map(|(_, sensor)| sensor.name.clone()).collect()
}

/// The head at each pressure sensor of a rig, m, for a closure that is only simulated.
///
/// `effects` are added to the base model; `set` gives values to parameters by name, in the units of their names, and to
/// the settings friction_factor, initial_velocity_m_s, valve_head_m, closing_time_s and reaches; what is not set is as
/// `defaults` says. `times_s` are seconds after the start of the closure, shape (n,). `valve` is linear, flow-ramp or
/// flow-cycloid. With `readings` the values are in each sensor's unit, as `surgescope simulate` writes them.
///
/// Returns {sensor: array of shape (n,)}. Warns where the water would boil in a model that does not let it.
///
/// Raises Error: an effect or a setting that does not exist, a value out of range, a model that cannot be simulated.
#[pyfunction]
#[pyo3(signature = (rig, effects = Effects::default(), set = None, *, times_s, valve = "linear", readings = false))]
pub fn simulate<'py>(
    py: Python<'py>,
    rig: GivenRig<'py>,
    effects: Effects,
    set: Option<Bound<'py, PyDict>>,
    times_s: &Bound<'py, PyAny>,
    valve: &str,
    readings: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let (rig, effects, settings, valve) = (rig.rig(py)?, effects.chosen(py)?, pairs(set.as_ref())?, valve_form(valve)?);
    let times_s = checked(times_s)?;
    let names = names(&rig);
    let (values, cavities) = on_one(py, move || {
        let scenario = Scenario::new((*rig).clone(), &effects, valve, &settings)?;
        let traces = scenario.simulate(duration_s(&times_s))?;
        Ok((shown(&scenario, &traces, &times_s, readings), unmodelled(&scenario, &traces)))
    })?;
    cavities.iter().try_for_each(|cavity| warn(py, cavity))?;
    let heads = PyDict::new(py);
    for (name, values) in names.into_iter().zip(values) {
        heads.set_item(name, PyArray1::from_vec(py, values))?;
    }
    Ok(heads)
}

/// A column of a table of parameters.
type Column = (String, Vec<f64>);

/// The columns of a dict of arrays, or of a DataFrame of pandas or polars.
fn columns(table: &Bound<'_, PyAny>) -> PyResult<Vec<Column>> {
    let names = match table.getattr_opt("columns")? {
        Some(names) => names,
        None => table.call_method0("keys")?,
    };
    let column = |key: Bound<'_, PyAny>| {
        let name: String = key.extract()?;
        let values = numbers(&name, &table.get_item(&key)?)?;
        Ok((name, values))
    };
    names.try_iter()?.map(|key| column(key?)).collect()
}

/// `simulate` for each row of a table of parameters, on all cores.
///
/// `table` is {parameter: values} or a DataFrame, all columns of one length; `set` gives the values that all rows
/// share. `threads` limits the cores. `failed` says what becomes of a row that cannot be simulated: "raise", or "nan"
/// for a row of NaN. `progress` is a callable that takes a Progress; by default a bar of tqdm in a notebook; False for
/// none.
///
/// Returns {sensor: array of shape (rows, n)}.
///
/// Raises Error as `simulate` does, with the number of the row, from 0.
#[pyfunction]
#[pyo3(signature = (
    rig, effects, table, set = None, *, times_s, valve = "linear", readings = false, threads = None, failed = "raise", progress = None
))]
#[allow(clippy::too_many_arguments)] // they are keywords
pub fn simulate_many<'py>(
    py: Python<'py>,
    rig: GivenRig<'py>,
    effects: Effects,
    table: &Bound<'py, PyAny>,
    set: Option<Bound<'py, PyDict>>,
    times_s: &Bound<'py, PyAny>,
    valve: &str,
    readings: bool,
    threads: Option<usize>,
    failed: &str,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let (rig, effects, shared, valve) = (rig.rig(py)?, effects.chosen(py)?, pairs(set.as_ref())?, valve_form(valve)?);
    let times_s = checked(times_s)?;
    let keeps_failed = match failed {
        "raise" => false,
        "nan" => true,
        _ => return Err(sentence(format!("failed = '{failed}' is none of raise, nan"))),
    };
    let columns = columns(table)?;
    let rows = columns.first().map_or(0, |(_, values)| values.len());
    if let Some((name, values)) = columns.iter().find(|(_, values)| values.len() != rows) {
        let (first, own) = (&columns[0].0, values.len());
        return Err(sentence(format!("the table has {rows} values of {first} and {own} of {name}: give each as many")));
    }
    let row = |i: usize| -> Vec<(String, f64)> {
        let own = columns.iter().map(|(name, values)| (name.clone(), values[i]));
        own.chain(shared.iter().cloned()).collect()
    };
    let settings: Vec<Vec<(String, f64)>> = (0..rows).map(row).collect();
    let (sensors, samples) = (names(&rig), times_s.len());
    let watcher = crate::watch::watcher(py, progress, Some(rows))?;
    let done = on_all_cores(py, threads, watcher.called(), move |told| {
        let (counted, times_s) = (AtomicUsize::new(0), Arc::new(times_s));
        let until_s = duration_s(&times_s);
        let scenario = |settings: &Vec<(String, f64)>| {
            stop::check()?;
            Scenario::new((*rig).clone(), &effects, valve, settings)
        };
        // Names and ranges first: a slip in the last row need not wait for the others. None is kept, for each holds a
        // rig.
        checked_rows(settings.par_iter().map(|row| scenario(row).map(drop)).collect(), keeps_failed)?;
        let run = |settings: &Vec<(String, f64)>| {
            let scenario = scenario(settings)?;
            let traces = scenario.simulate(until_s)?;
            told.tell(Progress::counted(counted.fetch_add(1, Ordering::Relaxed) + 1, rows));
            Ok(shown(&scenario, &traces, &times_s, readings))
        };
        let simulated: Vec<Result<_, AnyError>> = settings.par_iter().map(run).collect();
        let simulated = checked_rows(simulated, keeps_failed)?;
        let mut heads: Vec<Vec<f64>> = sensors.iter().map(|_| Vec::with_capacity(rows * samples)).collect();
        for row in simulated {
            let mut row = row.unwrap_or_default().into_iter();
            for all in &mut heads {
                let before = all.len();
                all.extend(row.next().unwrap_or_default());
                all.resize(before + samples, f64::NAN);
            }
        }
        Ok(sensors.into_iter().zip(heads).collect::<Vec<_>>())
    });
    watcher.close()?;
    let heads = PyDict::new(py);
    for (name, values) in done? {
        let table: Bound<'py, PyArray2<f64>> = PyArray1::from_vec(py, values).reshape([rows, samples])?;
        heads.set_item(name, table)?;
    }
    Ok(heads)
}

/// The rows; one that failed is none where that is wanted, otherwise the first such is an error.
fn checked_rows<T>(rows: Vec<Result<T, AnyError>>, keeps_failed: bool) -> Result<Vec<Option<T>>, AnyError> {
    let numbered = rows.into_iter().enumerate();
    numbered
        .map(|(i, row)| match row {
            Ok(row) => Ok(Some(row)),
            Err(_) if keeps_failed => Ok(None),
            Err(error) => Err(format!("row {i}: {error}").into()),
        })
        .collect()
}

/// What a simulation uses where nothing else is set: {name: value} of all parameters and settings that are not in
/// `set`, in the units of their names. `friction_factor` is the one at the initial flow.
///
/// Raises Error as `simulate` does.
#[pyfunction]
#[pyo3(signature = (rig, effects = Effects::default(), set = None, *, valve = "linear"))]
pub fn defaults<'py>(
    py: Python<'py>,
    rig: GivenRig<'py>,
    effects: Effects,
    set: Option<Bound<'py, PyDict>>,
    valve: &str,
) -> PyResult<Bound<'py, PyDict>> {
    let (rig, effects, settings, valve) = (rig.rig(py)?, effects.chosen(py)?, pairs(set.as_ref())?, valve_form(valve)?);
    let scenario =
        Scenario::new((*rig).clone(), &effects, valve, &settings).map_err(|error| refused(py, error.as_ref()))?;
    let unset = PyDict::new(py);
    for (name, value) in scenario.not_set(&settings) {
        unset.set_item(name, value)?;
    }
    unset.set_item("temperature_degC", scenario.rig.fluid.temperature_degc)?;
    Ok(unset)
}
