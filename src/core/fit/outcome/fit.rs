//! The result of a calibration: plain data for tables, JSON and pages.

use crate::fit::outcome::doubt::Doubt;
use crate::fit::outcome::posterior::{Marginal, Posterior};
use crate::fit::outcome::profile::Profile;
use crate::fit::outcome::residual_summary::ResidualSummary;
use crate::fit::outcome::uncertainty::Uncertainty;
use crate::fit::outcome::unidentifiable::Unidentifiable;
use crate::fit::problem::compare::ExtremumError;
use crate::fit::problem::method::Method;
use crate::interned::Text;
use crate::model::constraint::Given;
use crate::model::effects::Chosen;
use crate::model::parameter::Scale;

/// One fitted parameter.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct FittedParameter {
    /// Name; a per-run parameter carries its run's file name in `run`.
    pub name: String,
    /// What it is, in plain words.
    #[serde(deserialize_with = "crate::interned::text")]
    pub about: Text,
    /// The run it belongs to where it is not shared by all.
    pub run: Option<String>,
    /// Value in `unit`.
    pub value: f64,
    /// How well it is known, in `unit`.
    pub uncertainty: Uncertainty,
    /// 95% interval in `unit`: linear, or by its profile or its posterior where there is one. An end that the data
    /// leave open is infinite; both are not a number where the fit ended at no optimum.
    pub interval_95: (f64, f64),
    /// How the fit gets worse along it, where a profile was asked for.
    pub profile: Option<Profile>,
    /// What sampling shows of it, where that was asked for.
    #[serde(default)]
    pub posterior: Option<Marginal>,
    /// Why its interval from a standard error is in doubt, where that was asked for and it is.
    #[serde(default)]
    pub doubt: Option<Doubt>,
    /// What the rig file's tolerances add, the same for every run of the rig: a standard deviation in `unit`, where
    /// they reach it.
    pub rig_error: Option<f64>,
    /// Display unit.
    #[serde(deserialize_with = "crate::interned::text")]
    pub unit: Text,
    /// It ended at one of its bounds.
    pub at_bound: bool,
    /// Least value that the fit could take, in `unit`.
    pub lower: f64,
    /// Greatest value that the fit could take, in `unit`.
    pub upper: f64,
    /// It was held at its value.
    pub held: bool,
    /// What was known of it from elsewhere (a creep test): mean in `unit`, and a relative standard deviation.
    pub prior: Option<(f64, f64)>,
    /// How the fit moved it.
    pub scale: Scale,
    /// All that was known of it before the fit, from whatever source (meter, rig, signals, creep test): mean in `unit`,
    /// and a standard deviation that is relative on a log scale.
    pub belief: Option<(f64, f64)>,
}

impl FittedParameter {
    /// Its standard error where the fit knows one: it is neither held, nor at a bound, nor left open by the data.
    pub fn known_error(&self) -> Option<f64> {
        match self.uncertainty {
            Uncertainty::Known(error) => Some(error),
            _ => None,
        }
    }

    /// See [`Uncertainty::standard_error`].
    pub fn standard_error(&self) -> f64 {
        self.uncertainty.standard_error()
    }
}

/// Measurement and model at one pressure sensor, heads in m, all vectors of one length.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SensorFit {
    /// Sensor name.
    pub name: String,
    /// Distance from the supply, m.
    pub position_m: f64,
    /// Sample times after the start of the closure, s (all ≥ 0).
    pub time_s: Vec<f64>,
    /// Measured head, m, without hum.
    pub measured_m: Vec<f64>,
    /// Fitted head, m.
    pub model_m: Vec<f64>,
    /// Half the width of the band around the model that holds a sample with 95% probability, m; empty where it is not
    /// known.
    pub band_m: Vec<f64>,
    /// Standard deviation of all disturbances of the sensor while the flow is steady, m.
    pub noise_m: f64,
    /// The same of its white part, which sets a sample's weight in the fit, m.
    pub white_noise_m: f64,
    /// Root mean square of measured − model over all samples, m.
    pub rmse_m: f64,
    /// The same with the parameters that the fit started from, m.
    pub start_rmse_m: f64,
    /// Mean of measured − model over the last period before the closure, m; none where it has no sample.
    pub before_m: Option<f64>,
    /// Each peak and trough.
    pub extrema: Vec<ExtremumError>,
}

impl SensorFit {
    /// Share of the samples inside the band; none where there is no band.
    pub fn inside_band(&self) -> Option<f64> {
        let all = self.measured_m.iter().zip(&self.model_m).zip(&self.band_m);
        let inside = all.filter(|((y, m), half)| (*y - *m).abs() <= **half).count();
        (!self.band_m.is_empty()).then(|| inside as f64 / self.band_m.len() as f64)
    }
}

/// One run under the fitted model.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct RunFit {
    /// File name.
    pub file: String,
    /// RMSE over all samples of all pressure sensors, m.
    pub rmse_m: f64,
    /// Noise over the same samples, m.
    pub noise_m: f64,
    /// Mean absolute percentage error over the extrema (paper's eq. 19), percent.
    pub mape_extrema_percent: f64,
    /// Its noise dies away after the closure: errors and intervals take it as it was before, for it disturbs the first
    /// rise.
    pub noise_dies_away: bool,
    /// The model's flow before the closure at the flow meter, m³/s, where there is a meter.
    pub meter_flow_m3_s: Option<f64>,
    /// Each pressure sensor.
    pub sensors: Vec<SensorFit>,
}

/// One step of a stepwise calibration.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct StepTaken {
    /// The round it belongs to, from 1.
    pub round: usize,
    /// What it moved, and to where.
    pub parameters: Vec<(String, f64)>,
    /// The feature of the record that it looked at.
    pub feature: String,
    /// The reason.
    pub why: String,
    /// Error over the noise, over all samples, before it.
    pub before_over_noise: f64,
    /// The same after it.
    pub after_over_noise: f64,
    /// It was kept, not taken back because the whole record became worse by it.
    pub kept: bool,
}

/// A name that no parameter of a fit has.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("the fit has no parameter '{name}'; it has {known}")]
pub struct UnknownParameter {
    /// The name.
    pub name: String,
    /// The names that there are.
    pub known: String,
}

/// A calibrated model of one run or of several.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Fit {
    /// The method of search.
    pub method: Method,
    /// Effects of the model, their open choices decided.
    pub effects: Vec<Chosen>,
    /// Each run.
    pub runs: Vec<RunFit>,
    /// Shared and per-run parameters.
    pub parameters: Vec<FittedParameter>,
    /// Correlation between the errors of each two parameters, in the order of `parameters`; NaN for what is at a bound.
    pub correlation: Vec<Vec<f64>>,
    /// Combinations of parameters that the recordings do not determine.
    pub unidentifiable: Vec<Unidentifiable>,
    /// Reaches of the grid of the final fit.
    pub reaches: usize,
    /// Change that halving the grid's step would still make, rms over all samples, m.
    pub grid_error_m: f64,
    /// Simulations that the fit took.
    pub evaluations: usize,
    /// Wall time, s.
    pub seconds: f64,
    /// The steps of a stepwise calibration; none of any other.
    pub steps: Vec<StepTaken>,
    /// Names of the features that were still to be used when a stepwise calibration stopped.
    #[serde(deserialize_with = "crate::interned::texts")]
    pub features_left: Vec<&'static str>,
    /// Why it stopped, in words.
    pub stopped_because: String,
    /// It ended at an optimum, as far as a descent can tell. Otherwise no error, interval or band is given.
    pub converged: bool,
    /// Half the sum of squares that it minimised: of the residuals over their noise (or of their transform, where
    /// frequencies are compared), from a little before the closure on, and of what is known beforehand.
    pub cost: f64,
    /// Reduction of the sum of squares that an undamped step predicts from its end, in units of what one sample leaves.
    pub predicted_reduction: f64,
    /// The joint posterior of its values, where that was asked for.
    #[serde(default)]
    pub posterior: Option<Posterior>,
}

impl Fit {
    /// The parameter of this name; of one that each run has of its own, the first run's.
    ///
    /// # Errors
    /// A name that no parameter has.
    pub fn parameter(&self, name: &str) -> Result<&FittedParameter, UnknownParameter> {
        let known = || {
            let mut names: Vec<&str> = self.parameters.iter().map(|p| p.name.as_str()).collect();
            names.sort_unstable();
            names.dedup();
            names.join(", ")
        };
        let found = self.parameters.iter().find(|p| p.name == name);
        found.ok_or_else(|| UnknownParameter { name: name.to_owned(), known: known() })
    }

    /// Values of all parameters: shared ones first, then each run's.
    pub fn values(&self) -> Vec<f64> {
        self.parameters.iter().map(|p| p.value).collect()
    }

    /// The same, each with its name and run.
    pub fn given(&self) -> Vec<Given> {
        let of = |p: &FittedParameter| Given { name: p.name.clone(), run: p.run.clone(), value: p.value };
        self.parameters.iter().map(of).collect()
    }

    /// Its effects as on the command line (`viscoelastic-wall:2`).
    pub fn labels(&self) -> Vec<String> {
        self.effects.iter().map(Chosen::label).collect()
    }

    /// Evidence over a simpler model's fit to the same recordings, natural logarithm of odds: half the fall of the
    /// Bayesian information criterion; samples that repeat each other count once.
    pub fn evidence_over(&self, simpler: &Fit) -> f64 {
        let summary = |fit: &Fit| {
            let sensors = fit.runs.iter().flat_map(|r| &r.sensors);
            let weighted = sensors.flat_map(|s| s.measured_m.iter().zip(&s.model_m).map(|(h, m)| (h - m) / s.noise_m));
            let shared = fit.parameters.iter().filter(|p| p.run.is_none()).count();
            ResidualSummary::of(&weighted.collect::<Vec<_>>(), shared)
        };
        summary(self).evidence_over(&summary(simpler))
    }

    /// Samples of all pressure sensors of all runs.
    pub fn samples(&self) -> usize {
        self.runs.iter().flat_map(|run| &run.sensors).map(|sensor| sensor.time_s.len()).sum()
    }

    /// Mean square of what it leaves, in units of the sensors' noise.
    pub fn mean_square(&self) -> f64 {
        let sensors = || self.runs.iter().flat_map(|r| &r.sensors);
        let samples = |s: &SensorFit| s.time_s.len() as f64;
        let square: f64 = sensors().map(|s| samples(s) * (s.rmse_m / s.noise_m).powi(2)).sum();
        square / self.samples().max(1) as f64
    }

    /// Error over noise: the root of [`Fit::mean_square`].
    pub fn over_noise(&self) -> f64 {
        self.mean_square().sqrt()
    }

    /// RMSE and noise over all runs, m: weighted by their numbers of samples; NaN where there are none.
    pub fn pooled(&self) -> (f64, f64) {
        let weight = |r: &RunFit| r.sensors.iter().map(|s| s.time_s.len()).sum::<usize>() as f64;
        let runs = || self.runs.iter().filter(|&r| weight(r) > 0.0);
        let total: f64 = runs().map(weight).sum();
        let mean = |f: &dyn Fn(&RunFit) -> f64| (runs().map(|r| weight(r) * f(r).powi(2)).sum::<f64>() / total).sqrt();
        (mean(&|r| r.rmse_m), mean(&|r| r.noise_m))
    }

    /// Deviation of the measured heads from each sensor's mean, rms over all samples, m: what a model that is a
    /// constant leaves.
    pub fn signal_m(&self) -> f64 {
        let (mut square, mut n) = (0.0, 0usize);
        for sensor in self.runs.iter().flat_map(|r| &r.sensors) {
            let mean = sensor.measured_m.iter().sum::<f64>() / sensor.measured_m.len().max(1) as f64;
            square += sensor.measured_m.iter().map(|h| (h - mean).powi(2)).sum::<f64>();
            n += sensor.measured_m.len();
        }
        (square / n.max(1) as f64).sqrt()
    }
}
