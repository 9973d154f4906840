//! One fit as a file: `calibrate -o FIT.toml` or `FIT.json`. The keys are the same in both, and those that `calibrate --json`
//! has too mean the same there; the fields below say what each holds.
//!
//! This is a result: it says all about one fit and is written once. The models that a person edits, and goes on from, are in
//! another file (`calibrate --save MODEL.toml`).

use std::path::Path;

use serde::{Deserialize, Deserializer, Serialize};

use crate::fit::outcome::fit::{Fit, FittedParameter, RunFit, SensorFit};
use crate::recording::Recording;
use crate::rig::Rig;
use crate::signal::Features;

/// What `format` says in a file that this program writes. Keys may be added to it.
pub const FORMAT: &str = "surgescope-fit-1";

/// First line of the TOML form.
const HEADING: &str = "# surgescope fit: a result, not to be edited (keys: docs/src/keys.md in surgescope's guide)";

/// See the module.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FitFile {
    /// [`FORMAT`].
    pub format: String,
    /// The program that made the fit, with its version.
    pub program: String,
    /// When the fit was made, RFC 3339, UTC.
    pub fitted_at: String,
    /// The rig's name.
    pub rig: String,
    /// Effects beside the base model, their elements and sensors decided.
    pub effects: Vec<String>,
    /// How the fit searched: `least-squares`, `global`, `micro-ga`, `global-local` or `stepwise`.
    pub method: String,
    /// Root mean square of measured − model over all samples of all runs from the start of the closure, m.
    pub rmse_m: f64,
    /// Noise over the same samples, m.
    pub noise_m: f64,
    /// Reaches of the grid of the final fit.
    pub reaches: usize,
    /// What halving the grid's step would still change, rms over all samples, m.
    pub grid_error_m: f64,
    /// Simulations that the fit took.
    pub evaluations: usize,
    /// Wall time of the fit, s.
    pub seconds: f64,
    /// It ended at an optimum. Where it did not, errors and intervals are left out.
    pub converged: bool,
    /// Why it stopped, in words.
    pub stopped_because: String,
    /// Each recording.
    pub runs: Vec<Run>,
    /// Fitted parameters: those that all runs share, then each run's own.
    pub parameters: Vec<Parameter>,
}

/// One recording and how the fitted model meets it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// File name.
    pub file: String,
    /// When its clock showed 0, RFC 3339, UTC; left out where it is unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recorded_at: Option<String>,
    /// From the first sample to the last, s.
    pub duration_s: f64,
    /// Water temperature, °C: the sensor's, or the rig file's.
    #[serde(rename = "temperature_degC")]
    pub temperature_degc: f64,
    /// Flow before the closure, m³/s; left out without a flow meter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flow_m3_s: Option<f64>,
    /// Root mean square of measured − model over all samples of all its pressure sensors, m.
    pub rmse_m: f64,
    /// Noise over the same samples, m.
    pub noise_m: f64,
    /// Mean absolute error over the extrema, percent; not a number where there are none.
    #[serde(deserialize_with = "number_or_null")]
    pub mape_extrema_percent: f64,
    /// Each pressure sensor.
    pub sensors: Vec<Sensor>,
}

/// One pressure sensor of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sensor {
    /// Name.
    pub name: String,
    /// Distance from the supply, m.
    pub position_m: f64,
    /// Samples from the start of the closure.
    pub samples: usize,
    /// Root mean square of measured − model, m.
    pub rmse_m: f64,
    /// Standard deviation of its noise, m.
    pub noise_m: f64,
}

/// One parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// Name, with its unit.
    pub name: String,
    /// The file name of the run that it belongs to; left out where all runs share it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub run: Option<String>,
    /// Value in `unit`.
    pub value: f64,
    /// Standard error in `unit`; left out where the data do not determine it or it was held.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub standard_error: Option<f64>,
    /// 95% interval in `unit`, by its profile where there is one; an end that the data leave open is infinite (JSON `null`). Left out where it
    /// was held or the fit ended at no optimum.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "interval_or_null")]
    pub interval_95: Option<[f64; 2]>,
    /// Value and rise of the sum of squares (3.84 is the threshold) along the parameter, others following; left out where it was not asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub profile: Option<Vec<(f64, f64)>>,
    /// Unit.
    pub unit: String,
    /// It ended at one of its bounds.
    pub at_bound: bool,
    /// It was held at its value.
    pub held: bool,
    /// Least value that the fit could take, in `unit`.
    pub lower: f64,
    /// Greatest value that the fit could take, in `unit`.
    pub upper: f64,
    /// How the fit moved it: `linear` or `log`.
    pub scale: String,
    /// What was known before the fit; left out where nothing was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior: Option<Known>,
    /// Correlation of its error with that of each parameter, in the order of `parameters`; not a number (TOML `nan`, JSON `null`)
    /// beside what is held or at a bound.
    #[serde(deserialize_with = "numbers_or_null")]
    pub correlation: Vec<f64>,
}

/// What is known of a parameter before a fit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Known {
    /// Where it is most likely, in the parameter's unit.
    pub mean: f64,
    /// Standard deviation: of the natural logarithm (so: relative) where `scale` is `log`, otherwise in the parameter's unit.
    pub sd: f64,
}

/// What a file of results is written as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// `.toml`
    Toml,
    /// `.json`
    Json,
}

/// A fit on disk that cannot be used.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the sentences say it
pub enum FitFileError {
    #[error("{0}: a fit is written as TOML or JSON: use a name that ends in .toml or .json")]
    Form(String),
    #[error("cannot read the fit in {0}: {1}")]
    Read(String, std::io::Error),
    #[error("{0} is not a surgescope fit (see `calibrate -o`): {1}")]
    Parse(String, String),
    #[error("{0} is a fit in the format '{1}', and this program reads '{FORMAT}'")]
    Format(String, String),
}

impl Form {
    /// By a file's extension.
    ///
    /// # Errors
    /// Any other than `.toml` and `.json`.
    pub fn of(path: &Path) -> Result<Form, FitFileError> {
        match path.extension().and_then(|e| e.to_str()) {
            Some(e) if e.eq_ignore_ascii_case("toml") => Ok(Form::Toml),
            Some(e) if e.eq_ignore_ascii_case("json") => Ok(Form::Json),
            _ => Err(FitFileError::Form(path.display().to_string())),
        }
    }
}

impl FitFile {
    /// All about a fit of recordings, in the order of its runs; `now` is RFC 3339.
    pub fn new(fit: &Fit, rig: &Rig, recordings: &[(&Recording, &Features)], now: String) -> FitFile {
        let (rmse_m, noise_m) = fit.pooled();
        FitFile {
            format: FORMAT.to_owned(),
            program: concat!("surgescope ", env!("CARGO_PKG_VERSION")).to_owned(),
            fitted_at: now,
            rig: rig.name.clone(),
            effects: fit.labels(),
            method: fit.method.name().to_owned(),
            rmse_m,
            noise_m,
            reaches: fit.reaches,
            grid_error_m: fit.grid_error_m,
            evaluations: fit.evaluations,
            seconds: fit.seconds,
            converged: fit.converged,
            stopped_because: fit.stopped_because.clone(),
            runs: fit.runs.iter().zip(recordings).map(|(run, (r, f))| Run::new(run, r, f)).collect(),
            parameters: fit
                .parameters
                .iter()
                .enumerate()
                .map(|(j, p)| Parameter::new(p, fit.correlation.get(j).cloned().unwrap_or_default()))
                .collect(),
        }
    }

    /// Its text.
    ///
    /// # Errors
    /// None in practice: all values can be written.
    pub fn text(&self, form: Form) -> Result<String, Box<dyn std::error::Error + Send + Sync>> {
        Ok(match form {
            Form::Toml => format!("{HEADING}\n\n{}", toml::to_string(self)?),
            Form::Json => serde_json::to_string_pretty(self)? + "\n",
        })
    }

    /// From the text of a file; `name` is for messages.
    ///
    /// # Errors
    /// A text that is no fit, or one of another format.
    pub fn parse(text: &str, form: Form, name: &str) -> Result<FitFile, FitFileError> {
        let parsed: Result<FitFile, String> = match form {
            Form::Toml => toml::from_str(text).map_err(|e| e.message().to_owned()),
            Form::Json => serde_json::from_str(text).map_err(|e| e.to_string()),
        };
        let file = parsed.map_err(|e| FitFileError::Parse(name.to_owned(), e))?;
        if file.format != FORMAT {
            return Err(FitFileError::Format(name.to_owned(), file.format));
        }
        Ok(file)
    }

    /// From a file, whose extension says its form.
    ///
    /// # Errors
    /// One that cannot be read; as [`FitFile::parse`].
    pub fn read(path: &Path) -> Result<FitFile, FitFileError> {
        let name = path.display().to_string();
        let form = Form::of(path)?;
        let text = std::fs::read_to_string(path).map_err(|e| FitFileError::Read(name.clone(), e))?;
        FitFile::parse(&text, form, &name)
    }
}

impl Run {
    fn new(run: &RunFit, recording: &Recording, features: &Features) -> Run {
        let times = || recording.series.iter().filter(|s| !s.time_s.is_empty());
        let first_s = times().map(|s| s.time_s[0]).fold(f64::INFINITY, f64::min);
        let last_s = times().map(|s| s.time_s[s.time_s.len() - 1]).fold(f64::NEG_INFINITY, f64::max);
        Run {
            file: run.file.clone(),
            recorded_at: recorded_at(recording.run.start_unix_ns),
            duration_s: last_s - first_s,
            temperature_degc: features.temperature_degc,
            flow_m3_s: features.flow_m3_s.map(|q| q.value),
            rmse_m: run.rmse_m,
            noise_m: run.noise_m,
            mape_extrema_percent: run.mape_extrema_percent,
            sensors: run.sensors.iter().map(Sensor::new).collect(),
        }
    }
}

impl Sensor {
    fn new(sensor: &SensorFit) -> Sensor {
        Sensor {
            name: sensor.name.clone(),
            position_m: sensor.position_m,
            samples: sensor.time_s.len(),
            rmse_m: sensor.rmse_m,
            noise_m: sensor.noise_m,
        }
    }
}

impl Parameter {
    fn new(p: &FittedParameter, correlation: Vec<f64>) -> Parameter {
        Parameter {
            name: p.name.clone(),
            run: p.run.clone(),
            value: p.value,
            standard_error: Some(p.standard_error()).filter(|e| e.is_finite() && !p.held),
            interval_95: Some([p.interval_95.0, p.interval_95.1])
                .filter(|ends| !p.held && !ends.iter().any(|e| e.is_nan())),
            profile: p.profile.as_ref().map(|profile| profile.points.clone()),
            unit: p.unit.to_owned(),
            at_bound: p.at_bound,
            held: p.held,
            lower: p.lower,
            upper: p.upper,
            scale: p.scale.name().to_owned(),
            prior: p.belief.map(|(mean, sd)| Known { mean, sd }),
            correlation,
        }
    }
}

/// A recording's time 0 as RFC 3339; none where it is not known.
fn recorded_at(start_unix_ns: u64) -> Option<String> {
    let known = i64::try_from(start_unix_ns).ok().filter(|&ns| ns > 0)?;
    Some(chrono::DateTime::from_timestamp_nanos(known).to_rfc3339_opts(chrono::SecondsFormat::Millis, true))
}

/// JSON has no word for what is not a number but `null`.
fn number_or_null<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(from)?.unwrap_or(f64::NAN))
}

fn interval_or_null<'de, D: Deserializer<'de>>(from: D) -> Result<Option<[f64; 2]>, D::Error> {
    let ends = Option::<[Option<f64>; 2]>::deserialize(from)?;
    Ok(ends.map(|[low, high]| [low.unwrap_or(f64::NEG_INFINITY), high.unwrap_or(f64::INFINITY)]))
}

fn numbers_or_null<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<f64>, D::Error> {
    Ok(Vec::<Option<f64>>::deserialize(from)?.into_iter().map(|v| v.unwrap_or(f64::NAN)).collect())
}
