//! Recordings and the samples of their sensors.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::{PyCapsule, PyDict, PyMappingProxy};
use surgescope::cli::console::understood;
use surgescope::draft::answers::flow;
use surgescope::draft::reading::Reading;
use surgescope::recording::{CsvFormat, Gap, Recording as Recorded, RunInfo, Series};
use surgescope::rig::{self, SensorKind};
use surgescope::signal::heads;
use surgescope::signal::levels::temperature_degc;
use surgescope::storage::LogError;
use surgescope::storage::import::{ImportOptions, Imported, SourceOptions};
use surgescope::study::import::{ImportError, import};

use crate::arrays::view;
use crate::arrow;
use crate::call::on_all_cores;
use crate::error::{AnyError, sentence, warn};
use crate::rig::{GivenRig, Rig};
use crate::table::{Table, Values};

/// A recorded test: the samples of each sensor, and the rig that it was made on. It does not change, and can be
/// pickled.
#[pyclass(frozen, module = "surgescope")]
pub struct Recording {
    /// Its name in tables and messages.
    pub file: String,
    /// What was recorded.
    pub recorded: Arc<Recorded>,
    repairs: Vec<String>,
}

/// The samples of one sensor, as they were recorded.
#[pyclass(frozen, module = "surgescope")]
pub struct Sensor {
    recorded: Arc<Recorded>,
    index: usize,
    heads_m: OnceLock<Vec<f64>>,
}

impl Sensor {
    fn of_rig(&self) -> &rig::Sensor {
        &self.recorded.rig.sensors[self.index]
    }

    fn series(&self) -> &Series {
        &self.recorded.series[self.index]
    }

    /// The head of each sample; not a number where the sample is none.
    fn heads_m(&self) -> Option<&[f64]> {
        (self.of_rig().kind == SensorKind::Pressure).then(|| {
            self.heads_m
                .get_or_init(|| {
                    let mut finite = heads(&self.recorded, self.index, temperature_degc(&self.recorded)).1.into_iter();
                    let of = |reading: &f64| reading.is_finite().then(|| finite.next()).flatten().unwrap_or(f64::NAN);
                    self.series().value.iter().map(of).collect()
                })
                .as_slice()
        })
    }
}

#[pymethods]
impl Sensor {
    /// Its name.
    #[getter]
    fn name(&self) -> &str {
        &self.of_rig().name
    }

    /// pressure, flow, temperature, valve-position or trigger.
    #[getter]
    fn kind(&self) -> &'static str {
        self.of_rig().kind.name()
    }

    /// Unit of `reading`, as in the rig file.
    #[getter]
    fn unit(&self) -> &'static str {
        self.of_rig().unit.symbol
    }

    /// Distance from the supply along the pipe, m.
    #[getter]
    fn position_m(&self) -> f64 {
        self.of_rig().position_m
    }

    /// Times of the samples on the recording's clock, s; read-only, strictly increasing, shape (samples,).
    #[getter]
    fn time_s<'py>(this: Bound<'py, Self>) -> Bound<'py, PyArray1<f64>> {
        view(this.clone().into_any(), &this.get().series().time_s)
    }

    /// Readings in `unit`; read-only, shape (samples,).
    #[getter]
    fn reading<'py>(this: Bound<'py, Self>) -> Bound<'py, PyArray1<f64>> {
        view(this.clone().into_any(), &this.get().series().value)
    }

    /// Piezometric heads, m of the fluid column above the rig's datum, at the recording's mean temperature; read-only,
    /// shape (samples,). None for any other sensor than one of pressure.
    #[getter]
    fn head_m<'py>(this: Bound<'py, Self>) -> Option<Bound<'py, PyArray1<f64>>> {
        this.get().heads_m().map(|heads_m| view(this.clone().into_any(), heads_m))
    }

    /// Stretches in which samples are known to be missing: time of the last sample before, time of the first sample
    /// after (s), and how many, or None where that is not known.
    #[getter]
    fn gaps(&self) -> Vec<(f64, f64, Option<u64>)> {
        self.series().gaps.iter().map(|gap| (gap.from_s, gap.to_s, gap.samples)).collect()
    }

    /// Times, readings and, for pressure, heads, with one sample of NaN in the middle of each gap, so that a plotted
    /// line breaks there. Copies.
    #[allow(clippy::type_complexity)] // what a caller unpacks
    fn with_nan_gaps<'py>(
        &self,
        py: Python<'py>,
    ) -> (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>, Option<Bound<'py, PyArray1<f64>>>) {
        let series = self.series();
        let middles: Vec<f64> = series.gaps.iter().map(|gap| 0.5 * (gap.from_s + gap.to_s)).collect();
        let broken = |values: &[f64], in_gap: &dyn Fn(f64) -> f64| {
            let mut out = values.to_vec();
            for (inserted, &middle_s) in middles.iter().enumerate() {
                out.insert(series.time_s.partition_point(|&t| t < middle_s) + inserted, in_gap(middle_s));
            }
            PyArray1::from_vec(py, out)
        };
        let nan = |_: f64| f64::NAN;
        let heads_m = self.heads_m().map(|heads_m| broken(heads_m, &nan));
        (broken(&series.time_s, &|middle_s| middle_s), broken(&series.value, &nan), heads_m)
    }

    fn __len__(&self) -> usize {
        self.series().time_s.len()
    }

    fn __repr__(&self) -> String {
        let series = self.series();
        let gaps = if series.gaps.is_empty() { String::new() } else { format!(", {} gaps", series.gaps.len()) };
        format!(
            "<surgescope.Sensor {}: {} in {}, {} samples{gaps}>",
            self.name(),
            self.kind(),
            self.unit(),
            series.time_s.len()
        )
    }
}

impl Recording {
    /// Under a name.
    pub fn new(file: String, recorded: Arc<Recorded>, repairs: Vec<String>) -> Self {
        Recording { file, recorded, repairs }
    }

    fn sensor(&self, index: usize) -> Sensor {
        Sensor { recorded: self.recorded.clone(), index, heads_m: OnceLock::new() }
    }

    fn table(&self) -> Table {
        let (mut names, mut times, mut readings, mut heads_m, mut units) =
            (Vec::new(), Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for index in 0..self.recorded.series.len() {
            let sensor = self.sensor(index);
            let samples = sensor.series().time_s.len();
            names.extend(std::iter::repeat_n(Some(sensor.name().to_owned()), samples));
            units.extend(std::iter::repeat_n(Some(sensor.unit().to_owned()), samples));
            times.extend_from_slice(&sensor.series().time_s);
            readings.extend_from_slice(&sensor.series().value);
            match sensor.heads_m() {
                Some(own) => heads_m.extend_from_slice(own),
                None => heads_m.extend(std::iter::repeat_n(f64::NAN, samples)),
            }
        }
        Table(vec![
            ("sensor", Values::Texts(names)),
            ("time_s", Values::Numbers(times)),
            ("reading", Values::Numbers(readings)),
            ("unit", Values::Texts(units)),
            ("head_m", Values::Numbers(heads_m)),
        ])
    }
}

/// The series of a pickled recording: times, readings, gaps.
type Pickled<'py> = (PyReadonlyArray1<'py, f64>, PyReadonlyArray1<'py, f64>, Vec<(f64, f64, Option<u64>)>);
/// What a pickled recording knows of its run: start, source, program, notes, format of the imported table.
type PickledRun = (u64, String, String, Vec<(String, String)>, Option<(Option<u8>, Vec<(usize, Option<u8>)>)>);

#[pymethods]
impl Recording {
    /// Name of its file.
    #[getter]
    #[pyo3(name = "file")]
    fn named(&self) -> &str {
        &self.file
    }

    /// The rig that it was made on.
    #[getter]
    fn rig(&self) -> Rig {
        Rig(Arc::new(self.recorded.rig.clone()))
    }

    /// Its sensors by name, those without a sample too.
    #[getter]
    fn sensors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
        let sensors = PyDict::new(py);
        for (index, sensor) in self.recorded.rig.sensors.iter().enumerate() {
            sensors.set_item(&sensor.name, Bound::new(py, self.sensor(index))?)?;
        }
        Ok(PyMappingProxy::new(py, sensors.as_mapping()))
    }

    /// Wall-clock time of the recording's time 0, ns since 1970 UTC; None where it is not known.
    #[getter]
    fn start_unix_ns(&self) -> Option<u64> {
        Some(self.recorded.run.start_unix_ns).filter(|&ns| ns > 0)
    }

    /// Notes of the recording, as pairs of key and text.
    #[getter]
    fn notes(&self) -> Vec<(String, String)> {
        self.recorded.run.notes.clone()
    }

    /// What was repaired or guessed when the file was imported, a sentence each.
    #[getter]
    fn repairs(&self) -> Vec<String> {
        self.repairs.clone()
    }

    /// A DataFrame of pandas: sensor, time_s (s), reading (in unit), unit, head_m (m; NaN where it is no pressure); a
    /// row a sample.
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
        surgescope::report::notebook::recording(&self.file, &self.recorded)
    }

    fn __repr__(&self) -> String {
        let of = |(sensor, series): (&rig::Sensor, &Series)| format!("{} {}", sensor.name, series.time_s.len());
        let samples: Vec<String> = self.recorded.rig.sensors.iter().zip(&self.recorded.series).map(of).collect();
        format!("<surgescope.Recording {} on {}: samples {}>", self.file, self.recorded.rig.name, samples.join(", "))
    }

    fn __reduce__<'py>(this: Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let (py, own) = (this.py(), this.get());
        let of = |index: usize| {
            let sensor = Bound::new(py, own.sensor(index))?;
            Ok((Sensor::time_s(sensor.clone()), Sensor::reading(sensor.clone()), sensor.get().gaps()))
        };
        let series = (0..own.recorded.series.len()).map(of).collect::<PyResult<Vec<_>>>()?;
        let run = &own.recorded.run;
        let csv = run.csv.as_ref().map(|csv| (csv.time_decimals, csv.columns.clone()));
        let run = (run.start_unix_ns, run.source.as_str(), run.program.as_str(), run.notes.clone(), csv);
        let state = (own.file.as_str(), own.rig(), series, run, own.repairs.clone()).into_pyobject(py)?.into_any();
        Ok((py.get_type::<Recording>().getattr("_of")?, state))
    }

    /// From the parts that a pickle holds.
    #[staticmethod]
    fn _of(
        file: String,
        rig: &Bound<'_, Rig>,
        series: Vec<Pickled<'_>>,
        run: PickledRun,
        repairs: Vec<String>,
    ) -> PyResult<Recording> {
        let gap = |(from_s, to_s, samples)| Gap { from_s, to_s, samples };
        let of = |(time_s, value, gaps): &Pickled| {
            Ok(Series {
                time_s: time_s.as_slice()?.to_vec(),
                value: value.as_slice()?.to_vec(),
                gaps: gaps.iter().copied().map(gap).collect(),
            })
        };
        let series = series.iter().map(of).collect::<PyResult<Vec<_>>>()?;
        let (start_unix_ns, source, program, notes, csv) = run;
        let csv = csv.map(|(time_decimals, columns)| CsvFormat { time_decimals, columns });
        let run = RunInfo { start_unix_ns, source, program, notes, csv };
        let recorded = Recorded { rig: (*rig.get().0).clone(), series, run };
        Ok(Recording::new(file, Arc::new(recorded), repairs))
    }
}

/// Reads a recording, or imports a table of samples (CSV, Excel, TDMS, MAT, HDF5, MCAP of other programs) onto a rig.
///
/// With `rig`, a recording is read on that rig instead of its own; a table needs one, as a path or a Rig. `yes` accepts
/// what a file does not say and the importer would guess; without it such a file is refused, and the error shows the
/// guesses. `without` names sensors that were not recorded. The rest says what a file does not say, as the options of
/// `surgescope import` do: `map` {column: sensor}, `ignore` columns, `scale` {sensor: "1..5 -> 0..10 bar"}, `rate`
/// (Hz), `time_unit` ("ms"), `date_order` ("dmy", "mdy"), `zone` ("+01:00"), `encoding`, `flow` ("0.25 L/s").
///
/// Raises Error with the sentence that the program prints: a file that is missing, damaged, cut off, or that
/// contradicts the rig.
#[pyfunction]
#[pyo3(signature = (
    path, rig = None, *, yes = false, without = Vec::new(), map = BTreeMap::new(), ignore = Vec::new(), scale = BTreeMap::new(), rate = None,
    time_unit = None, date_order = None, zone = None, encoding = None, flow = None
))]
#[allow(clippy::too_many_arguments)] // they are keywords
pub fn read(
    py: Python<'_>,
    path: PathBuf,
    rig: Option<GivenRig<'_>>,
    yes: bool,
    without: Vec<String>,
    map: BTreeMap<String, String>,
    ignore: Vec<String>,
    scale: BTreeMap<String, String>,
    rate: Option<f64>,
    time_unit: Option<String>,
    date_order: Option<String>,
    zone: Option<String>,
    encoding: Option<String>,
    flow: Option<String>,
) -> PyResult<Recording> {
    let rig = rig.map(|rig| rig.rig(py)).transpose()?;
    let text = |given: Option<String>| given.unwrap_or_default();
    let reading = Reading {
        rate: rate.map_or(String::new(), |rate| rate.to_string()),
        time_unit: text(time_unit),
        date_order: text(date_order),
        zone: text(zone),
        encoding: text(encoding),
        ..Reading::default()
    };
    let said = said(&reading, map, ignore, scale, flow).map_err(sentence)?;
    let options = ImportOptions { without, ..ImportOptions::default() };
    let file = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let imported = on_all_cores(py, None, None, move |_| taken(&path, rig, &options, &said, yes))?;
    for repair in imported.repairs.iter().filter(|repair| repair.lost) {
        warn(py, &format!("{file}: {}", repair.text))?;
    }
    let repairs = imported.repairs.into_iter().map(|repair| repair.text).collect();
    Ok(Recording::new(file, Arc::new(imported.recording), repairs))
}

/// What a person says of the file.
fn said(
    reading: &Reading,
    map: BTreeMap<String, String>,
    ignore: Vec<String>,
    scale: BTreeMap<String, String>,
    by_hand: Option<String>,
) -> Result<SourceOptions, String> {
    let mut remarks = Vec::new();
    let options = reading.options(&mut remarks);
    if let Some(wrong) = remarks.first() {
        return Err(format!("{}: {}", wrong.field, wrong.says));
    }
    let scales = scale.into_iter().map(|(sensor, line)| Ok((sensor, line.parse()?)));
    Ok(SourceOptions {
        guess: false,
        map: map.into_iter().collect(),
        ignore,
        scales: scales.collect::<Result<_, String>>()?,
        flow: by_hand.map(|text| flow(&text)).transpose()?,
        ..options
    })
}

fn taken(
    path: &std::path::Path,
    rig: Option<Arc<rig::Rig>>,
    options: &ImportOptions,
    said: &SourceOptions,
    yes: bool,
) -> Result<Imported, AnyError> {
    let is_mcap = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("mcap"));
    let as_it_is = |recording: Recorded| Imported {
        recording,
        repairs: Vec::new(),
        start_digit_s: None,
        columns: Vec::new(),
        scaled: Vec::new(),
        names: Vec::new(),
    };
    if path.is_dir() {
        return Err(LogError::Folder(path.into()).into());
    }
    let Some(rig) = rig else {
        if !is_mcap && path.exists() {
            return Err("the rig is missing, which says what each column measures and where: give it as rig=; `surgescope rig new` writes one".into());
        }
        return Ok(as_it_is(surgescope::storage::read(path)?.without(&options.without)?));
    };
    if is_mcap {
        match surgescope::storage::read(path) {
            Err(LogError::NotOurs { .. }) => {}
            own => return Ok(as_it_is(own?.on_rig((*rig).clone())?.without(&options.without)?)),
        }
    }
    match import(path, &rig, options, said, true) {
        Err(error) if yes => Ok(error.accepted()?),
        Err(error) => Err(match &error {
            ImportError::Guessed { imported, .. } => format!("{}\n{error}", understood::text(path, imported)).into(),
            ImportError::Refused { .. } => error.told(),
        }),
        Ok(imported) => Ok(imported),
    }
}
