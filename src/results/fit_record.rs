//! One fit as a record: what a fit file (`calibrate -o`), `calibrate --json` and, of its parameters, every other
//! document hold.
//!
//! One rule for what is not known: a number that is not known is `null` in JSON; in TOML it is left out, or `nan` and
//! `inf` within a list. What does not exist at all, such as the run of a shared parameter, is left out of both. Keys
//! are part of the program's contract: they may be added, never renamed.

use serde::{Deserialize, Deserializer, Serialize};

use crate::fit::outcome::doubt::Doubt;
use crate::fit::outcome::fit::{Fit, FittedParameter, RunFit, SensorFit, StepTaken};
use crate::fit::outcome::posterior::{self, Posterior};
use crate::fit::outcome::unidentifiable::Unidentifiable;
use crate::recording::Recording;
use crate::rig::Rig;
use crate::signal::Features;

/// What `format` says in a record that this program writes. Keys may be added to it.
pub const FORMAT: &str = "surgescope-fit-1";

/// See the module.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FitRecord {
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
    #[serde(deserialize_with = "number_or_null")]
    pub rmse_m: f64,
    /// Noise over the same samples, m.
    #[serde(deserialize_with = "number_or_null")]
    pub noise_m: f64,
    /// Reaches of the grid of the final fit.
    pub reaches: usize,
    /// What halving the grid's step would still change, rms over all samples, m.
    #[serde(deserialize_with = "number_or_null")]
    pub grid_error_m: f64,
    /// Simulations that the fit took.
    pub evaluations: usize,
    /// Wall time of the fit, s.
    pub seconds: f64,
    /// It ended at an optimum. Where it did not, errors and intervals are not known, and `unseen` is empty.
    pub converged: bool,
    /// Why it stopped, in words.
    pub stopped_because: String,
    /// Half the sum of squares that the fit minimised, in units of the noise's.
    #[serde(default = "not_known", deserialize_with = "number_or_null")]
    pub cost: f64,
    /// Fall of the sum of squares that a step of a descent promises from its end, in units of what one sample leaves.
    #[serde(default = "not_known", deserialize_with = "number_or_null")]
    pub promised_fall: f64,
    /// What contradicts what was known before the fit, ended at a bound, or makes errors too wide.
    #[serde(default)]
    pub warnings: Vec<String>,
    /// Combinations of parameters that the recordings do not see.
    #[serde(default)]
    pub unseen: Vec<Unidentifiable>,
    /// The steps of a stepwise calibration; left out of any other.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub steps: Vec<StepTaken>,
    /// How the joint posterior of the values was sampled; left out where it was not asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub posterior: Option<Sampled>,
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
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub duration_s: Option<f64>,
    /// Water temperature, °C: the sensor's, or the rig file's.
    #[serde(default, rename = "temperature_degC", skip_serializing_if = "Option::is_none")]
    pub temperature_degc: Option<f64>,
    /// Flow before the closure, m³/s; left out without a flow meter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flow_m3_s: Option<f64>,
    /// Root mean square of measured − model over all samples of all its pressure sensors, m.
    #[serde(deserialize_with = "number_or_null")]
    pub rmse_m: f64,
    /// Noise over the same samples, m.
    #[serde(deserialize_with = "number_or_null")]
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
    /// Root mean square of measured − model at the start values, before any fit, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start_rmse_m: Option<f64>,
    /// Root mean square of measured − model, m.
    #[serde(deserialize_with = "number_or_null")]
    pub rmse_m: f64,
    /// Standard deviation of its noise, m.
    #[serde(deserialize_with = "number_or_null")]
    pub noise_m: f64,
    /// Share of the samples inside the 95% band of model and noise; left out where there is no band.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inside_band_95: Option<f64>,
}

/// One parameter; the same in every document of the program.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// Name, with its unit.
    pub name: String,
    /// The file name of the run that it belongs to; left out where all runs share it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub run: Option<String>,
    /// Value in `unit`.
    #[serde(deserialize_with = "number_or_null")]
    pub value: f64,
    /// Standard error in `unit`; not known where the data do not determine it, at a bound, or where the fit ended at no
    /// optimum; 0 where it was held.
    #[serde(default)]
    pub standard_error: Option<f64>,
    /// 95% interval in `unit`, by its profile or a converged posterior where there is one; an end that the data leave
    /// open is infinite. Neither end is a number where the fit ended at no optimum.
    #[serde(default = "no_interval", deserialize_with = "interval_or_null")]
    pub interval_95: [f64; 2],
    /// What the rig file's tolerances add, the same for every run of the rig: a standard deviation in `unit`; left out
    /// where they do not reach it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rig_error: Option<f64>,
    /// Value and rise of the sum of squares (3.84 is the threshold) along the parameter, others following; left out
    /// where it was not asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub profile: Option<Vec<(f64, f64)>>,
    /// What sampling shows of it; left out where the posterior was not asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub posterior: Option<Marginal>,
    /// Why its interval from the standard error is in doubt: `bound`, `curved` or `open`; left out where it is not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub doubt: Option<Doubt>,
    /// Unit.
    pub unit: String,
    /// It ended at one of its bounds.
    pub at_bound: bool,
    /// It was held at its value.
    pub held: bool,
    /// Least value that the fit could take, in `unit`.
    #[serde(deserialize_with = "number_or_null")]
    pub lower: f64,
    /// Greatest value that the fit could take, in `unit`.
    #[serde(deserialize_with = "number_or_null")]
    pub upper: f64,
    /// How the fit moved it: `linear` or `log`.
    pub scale: String,
    /// What was known before the fit; left out where nothing was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior: Option<Known>,
    /// Correlation of its error with that of each parameter, in the order of `parameters`; not a number beside what is
    /// held or at a bound. Left out of documents that list parameters of several models.
    #[serde(default, skip_serializing_if = "Vec::is_empty", deserialize_with = "numbers_or_null")]
    pub correlation: Vec<f64>,
}

/// How a joint posterior was sampled.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sampled {
    /// The chains have met, and say as much as was asked for; otherwise no interval comes from them.
    pub converged: bool,
    /// Largest R̂ of a parameter.
    #[serde(deserialize_with = "number_or_null")]
    pub r_hat: f64,
    /// Fewest independent draws of a parameter that say as much as its chains.
    pub effective_draws: f64,
    /// The same that were asked for.
    pub wanted: usize,
    /// Chains.
    pub chains: usize,
    /// Draws of each chain that count.
    pub sweeps: usize,
    /// Share of the moves that were made.
    pub acceptance: f64,
}

/// What sampling shows of a parameter, in its unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Marginal {
    /// Half the draws lie below it.
    pub median: f64,
    /// 95% interval of the draws; an open end is infinite.
    #[serde(deserialize_with = "interval_or_null")]
    pub interval_95: [f64; 2],
    /// R̂: 1 where all chains show the same.
    #[serde(deserialize_with = "number_or_null")]
    pub r_hat: f64,
    /// Independent draws that say as much.
    pub effective_draws: f64,
}

/// What is known of a parameter before a fit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Known {
    /// Where it is most likely, in the parameter's unit.
    pub mean: f64,
    /// Standard deviation: of the natural logarithm (so: relative) where `scale` is `log`, otherwise in the parameter's
    /// unit.
    pub sd: f64,
}

impl FitRecord {
    /// All about a fit of recordings, in the order of its runs; `warnings` are about the fit.
    pub fn new(fit: &Fit, rig: &Rig, recordings: &[(&Recording, &Features)], warnings: &[String]) -> FitRecord {
        let (rmse_m, noise_m) = fit.pooled();
        let correlation = |j: usize| fit.correlation.get(j).cloned().unwrap_or_default();
        FitRecord {
            format: FORMAT.to_owned(),
            program: concat!("surgescope ", env!("CARGO_PKG_VERSION")).to_owned(),
            fitted_at: now(),
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
            cost: fit.cost,
            promised_fall: fit.predicted_reduction,
            warnings: warnings.to_vec(),
            unseen: fit.unidentifiable.clone(),
            steps: fit.steps.clone(),
            posterior: fit.posterior.as_ref().map(Sampled::from),
            runs: fit.runs.iter().enumerate().map(|(i, run)| Run::from(run).recorded(recordings.get(i))).collect(),
            parameters: fit
                .parameters
                .iter()
                .enumerate()
                .map(|(j, p)| Parameter { correlation: correlation(j), ..Parameter::from(p) })
                .collect(),
        }
    }
}

impl Run {
    /// With what its recording says.
    fn recorded(self, recording: Option<&(&Recording, &Features)>) -> Run {
        let Some((recording, features)) = recording else { return self };
        let times = || recording.series.iter().filter(|s| !s.time_s.is_empty());
        let first_s = times().map(|s| s.time_s[0]).fold(f64::INFINITY, f64::min);
        let last_s = times().map(|s| s.time_s[s.time_s.len() - 1]).fold(f64::NEG_INFINITY, f64::max);
        Run {
            recorded_at: recorded_at(recording.run.start_unix_ns),
            duration_s: Some(last_s - first_s).filter(|d| d.is_finite()),
            temperature_degc: Some(features.temperature_degc),
            flow_m3_s: features.flow_m3_s.map(|q| q.value),
            ..self
        }
    }
}

impl From<&RunFit> for Run {
    fn from(run: &RunFit) -> Self {
        Run {
            file: run.file.clone(),
            recorded_at: None,
            duration_s: None,
            temperature_degc: None,
            flow_m3_s: None,
            rmse_m: run.rmse_m,
            noise_m: run.noise_m,
            mape_extrema_percent: run.mape_extrema_percent,
            sensors: run.sensors.iter().map(Sensor::from).collect(),
        }
    }
}

impl From<&SensorFit> for Sensor {
    fn from(sensor: &SensorFit) -> Self {
        Sensor {
            name: sensor.name.clone(),
            position_m: sensor.position_m,
            samples: sensor.time_s.len(),
            start_rmse_m: Some(sensor.start_rmse_m).filter(|e| e.is_finite()),
            rmse_m: sensor.rmse_m,
            noise_m: sensor.noise_m,
            inside_band_95: sensor.inside_band(),
        }
    }
}

impl From<&Posterior> for Sampled {
    fn from(sampled: &Posterior) -> Self {
        let Posterior { converged, r_hat, effective_draws, wanted, chains, sweeps, acceptance, .. } = *sampled;
        Sampled { converged, r_hat, effective_draws, wanted, chains, sweeps, acceptance }
    }
}

impl From<&posterior::Marginal> for Marginal {
    fn from(of: &posterior::Marginal) -> Self {
        let (low, high) = of.interval_95;
        Marginal { median: of.median, interval_95: [low, high], r_hat: of.r_hat, effective_draws: of.effective_draws }
    }
}

impl From<&FittedParameter> for Parameter {
    fn from(p: &FittedParameter) -> Self {
        Parameter {
            name: p.name.clone(),
            run: p.run.clone(),
            value: p.value,
            standard_error: Some(p.standard_error()).filter(|e| e.is_finite()),
            interval_95: [p.interval_95.0, p.interval_95.1],
            rig_error: p.rig_error,
            profile: p.profile.as_ref().map(|profile| profile.points.clone()),
            posterior: p.posterior.as_ref().map(Marginal::from),
            doubt: p.doubt,
            unit: p.unit.to_owned(),
            at_bound: p.at_bound,
            held: p.held,
            lower: p.lower,
            upper: p.upper,
            scale: p.scale.name().to_owned(),
            prior: p.belief.map(|(mean, sd)| Known { mean, sd }),
            correlation: Vec::new(),
        }
    }
}

/// Now, as RFC 3339, UTC.
pub fn now() -> String {
    chrono::Utc::now().to_rfc3339_opts(chrono::SecondsFormat::Secs, true)
}

/// A recording's time 0 as RFC 3339; none where it is not known.
/// When a recording started, RFC 3339, where that is known.
pub fn recorded_at(start_unix_ns: u64) -> Option<String> {
    let known = i64::try_from(start_unix_ns).ok().filter(|&ns| ns > 0)?;
    Some(chrono::DateTime::from_timestamp_nanos(known).to_rfc3339_opts(chrono::SecondsFormat::Millis, true))
}

fn not_known() -> f64 {
    f64::NAN
}

fn no_interval() -> [f64; 2] {
    [f64::NAN; 2]
}

/// JSON has no word for what is not a number but `null`.
fn number_or_null<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(from)?.unwrap_or(f64::NAN))
}

/// JSON has no word for infinity but `null`; two of them are an interval that is not known.
fn interval_or_null<'de, D: Deserializer<'de>>(from: D) -> Result<[f64; 2], D::Error> {
    Ok(match Option::<[Option<f64>; 2]>::deserialize(from)? {
        None | Some([None, None]) => no_interval(),
        Some([low, high]) => [low.unwrap_or(f64::NEG_INFINITY), high.unwrap_or(f64::INFINITY)],
    })
}

fn numbers_or_null<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<f64>, D::Error> {
    Ok(Vec::<Option<f64>>::deserialize(from)?.into_iter().map(|v| v.unwrap_or(f64::NAN)).collect())
}
