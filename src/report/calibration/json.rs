//! The document of `calibrate --json`. Keys are part of the program's contract: add, never rename.

use serde::Serialize;

use crate::fit::outcome::fit::{Fit, FittedParameter, RunFit, SensorFit, StepTaken};
use crate::fit::outcome::unidentifiable::Unidentifiable;

/// A calibration as scripts see it. Numbers that are not finite become `null`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FitProblem<'a> {
    /// Each run.
    pub runs: Vec<Run<'a>>,
    /// How the model was searched for: `least-squares`, `global`, `micro-ga`, `global-local` or `stepwise`.
    pub method: &'a str,
    /// Effects of the model.
    pub effects: Vec<String>,
    /// Fitted parameters.
    pub parameters: Vec<Parameter<'a>>,
    /// Simulations that the fit took.
    pub evaluations: usize,
    /// Wall time, s.
    pub seconds: f64,
    /// Combinations of parameters that the recordings do not see.
    pub unseen: &'a [Unidentifiable],
    /// It ended at an optimum. Where it did not, `standard_error` and the ends of `interval_95` are `null`, and `unseen` is empty.
    pub converged: bool,
    /// Fall of the sum of squares that a step of a descent promises from its end, in units of what one sample leaves.
    pub promised_fall: f64,
    /// The steps of a stepwise calibration; left out of any other.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    pub steps: &'a [StepTaken],
    /// Why it stopped, in words.
    pub stopped_because: &'a str,
    /// What contradicts what was known before the fit, ended at a bound, or makes errors too wide.
    pub warnings: &'a [String],
}

/// One run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Run<'a> {
    /// File name.
    pub file: &'a str,
    /// RMSE over all samples of all pressure sensors, m.
    pub rmse_m: f64,
    /// Noise, m.
    pub noise_m: f64,
    /// Mean absolute error over the extrema, percent.
    pub mape_extrema_percent: f64,
    /// Each pressure sensor.
    pub sensors: Vec<Sensor<'a>>,
}

/// One pressure sensor of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Sensor<'a> {
    /// Name.
    pub name: &'a str,
    /// RMSE, m.
    pub rmse_m: f64,
    /// Noise, m.
    pub noise_m: f64,
    /// Share of the samples inside the 95% band of model and noise; left out where there is no band.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inside_band_95: Option<f64>,
}

/// One fitted parameter; the same in `calibrate --json` and `diagnose --json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Parameter<'a> {
    /// Name.
    pub name: &'a str,
    /// The run it belongs to; left out where all runs share it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub run: Option<&'a str>,
    /// Value in `unit`.
    pub value: f64,
    /// Standard error in `unit`; `null` where the data do not determine it, or the fit ended at no optimum.
    pub standard_error: f64,
    /// 95% interval in `unit`; `null` for an end that the data leave open, and for both where the fit ended at no optimum. By its profile where there is one.
    pub interval_95: [f64; 2],
    /// Value and rise of the sum of squares (3.84 is the threshold) along the parameter, others following; left out where it was not asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub profile: Option<&'a [(f64, f64)]>,
    /// Display unit.
    pub unit: &'a str,
    /// It ended at one of its bounds.
    pub at_bound: bool,
    /// It was held at its value.
    pub held: bool,
}

impl<'a> From<&'a Fit> for FitProblem<'a> {
    fn from(fit: &'a Fit) -> Self {
        Self {
            runs: fit.runs.iter().map(Run::from).collect(),
            method: fit.method.name(),
            effects: fit.labels(),
            parameters: fit.parameters.iter().map(Parameter::from).collect(),
            evaluations: fit.evaluations,
            seconds: fit.seconds,
            unseen: &fit.unidentifiable,
            converged: fit.converged,
            promised_fall: fit.predicted_reduction,
            steps: &fit.steps,
            stopped_because: &fit.stopped_because,
            warnings: &[],
        }
    }
}

impl<'a> From<&'a RunFit> for Run<'a> {
    fn from(run: &'a RunFit) -> Self {
        Self {
            file: &run.file,
            rmse_m: run.rmse_m,
            noise_m: run.noise_m,
            mape_extrema_percent: run.mape_extrema_percent,
            sensors: run.sensors.iter().map(Sensor::from).collect(),
        }
    }
}

impl<'a> From<&'a SensorFit> for Sensor<'a> {
    fn from(sensor: &'a SensorFit) -> Self {
        Self {
            name: &sensor.name,
            rmse_m: sensor.rmse_m,
            noise_m: sensor.noise_m,
            inside_band_95: sensor.inside_band(),
        }
    }
}

impl<'a> From<&'a FittedParameter> for Parameter<'a> {
    fn from(p: &'a FittedParameter) -> Self {
        Self {
            name: &p.name,
            run: p.run.as_deref(),
            value: p.value,
            standard_error: p.standard_error(),
            interval_95: [p.interval_95.0, p.interval_95.1],
            profile: p.profile.as_ref().map(|profile| &profile.points[..]),
            unit: p.unit,
            at_bound: p.at_bound,
            held: p.held,
        }
    }
}

/// The document of `calibrate --json` as text, one line; `warnings` are about the fit.
///
/// # Errors
/// Only what [`serde_json`] may report; plain data like this gives it no cause.
pub fn calibration(fit: &Fit, warnings: &[String]) -> serde_json::Result<String> {
    serde_json::to_string(&FitProblem { warnings, ..FitProblem::from(fit) })
}
