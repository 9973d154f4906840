//! The model under study: from values of its parameters to features of the head at one sensor.

use rayon::prelude::*;

use crate::model::parameter::Parameter;
use crate::model::trace::Probe;
use crate::model::{Conditions, Model, ModelError, Resolution, RunValues};
use crate::rig::{Rig, Sensor};
use crate::sensitivity::factor::{Factor, Range, Reach, factors, known};
use crate::sensitivity::features::Features;
use crate::sensitivity::{SensitivityError, Tick};

/// Simulated periods: five for four peaks and their troughs, one for the mean level behind them.
const PERIODS: f64 = 6.0;
/// A period may be this many times `4L/a` before the head is given up.
const MOST_STRETCH: f64 = 4.0;

/// A model with the values around which it is studied.
#[derive(Debug, Clone)]
pub struct Subject<'a> {
    /// The model.
    pub model: Model<'a>,
    /// Its water.
    pub conditions: Conditions,
    /// Values of all parameters: shared ones, then the run's.
    pub values: Vec<f64>,
    /// Reaches of the grid.
    pub reaches: usize,
    /// The sensor whose head is read.
    pub sensor: &'a Sensor,
}

/// Results of many simulations.
#[derive(Debug, Clone, PartialEq)]
pub struct Runs {
    /// The outputs of each point, in the order of the points; NaN if the simulation failed.
    pub outputs: Vec<Vec<f64>>,
    /// Number of failures.
    pub failed: usize,
    /// Reason of the first failure.
    pub why: Option<ModelError>,
}

/// The pressure sensor with a name, or the one nearest to the valve.
///
/// # Errors
/// If there is none.
pub fn sensor<'a>(rig: &'a Rig, name: Option<&str>) -> Result<&'a Sensor, SensitivityError> {
    let mut sensors = rig.pressure_sensors().map(|(_, s)| s);
    match name {
        None => sensors
            .max_by(|a, b| rig.on_way_m(a.place()).total_cmp(&rig.on_way_m(b.place())))
            .ok_or(SensitivityError::NoSensor),
        Some(name) => sensors.find(|s| s.name == name).ok_or_else(|| SensitivityError::UnknownSensor {
            name: name.to_owned(),
            known: rig.pressure_sensors().map(|(_, s)| s.name.as_str()).collect::<Vec<_>>().join(", "),
        }),
    }
}

impl Subject<'_> {
    /// All parameters, in the order of the values.
    pub fn parameters(&self) -> Vec<Parameter> {
        self.model.shared.iter().chain(&self.model.per_run).cloned().collect()
    }

    /// The parameters named by `only`, or all, with their ranges.
    ///
    /// # Errors
    /// As [`factors`]; a name that no parameter has.
    pub fn factors(&self, reach: Reach, ranges: &[Range], only: &[String]) -> Result<Vec<Factor>, SensitivityError> {
        let parameters = self.parameters();
        for name in only {
            known(name, &parameters)?;
        }
        let all = factors(&parameters, &self.values, RunValues::COUNT, reach, ranges)?;
        Ok(all.into_iter().filter(|f| only.is_empty() || only.contains(&f.name)).collect())
    }

    /// Index of a parameter's value.
    ///
    /// # Errors
    /// If there is no such parameter.
    pub fn slot(&self, name: &str) -> Result<usize, SensitivityError> {
        known(name, &self.parameters())
    }

    /// Theoretical period `4L/a` at the values under study, s.
    pub fn period_s(&self) -> f64 {
        self.model.period_s(&self.values)
    }

    /// Simulates one closure, long enough for four peaks if it has so many, and reads its features.
    ///
    /// # Errors
    /// As [`Model::simulate`].
    pub fn features(&self, values: &[f64]) -> Result<Features, ModelError> {
        let (shared, own) = values.split_at(self.model.shared.len());
        let run = RunValues {
            initial_velocity_m_s: own[0],
            valve_head_m: own[1],
            closing_time_s: own[2],
            friction_scale: own[3],
        };
        let period_s = self.model.period_s(shared);
        let needed = self.model.resolving_reaches(&self.conditions, shared, &run)?;
        let reaches = self.model.fitting_reaches(shared, self.reaches.max(needed));
        let probe = [Probe::head(self.sensor.place())];
        let mut stretch = 1.0;
        loop {
            let resolution = Resolution { reaches, duration_s: PERIODS * stretch * period_s + run.closing_time_s };
            let mut traces = self.model.simulate(&self.conditions, shared, &run, resolution, &probe)?.traces;
            let trace = self.model.sensed(shared, self.sensor, traces.swap_remove(0))?;
            let features = Features::of(&trace, period_s);
            if features.complete() || stretch >= MOST_STRETCH {
                return Ok(features);
            }
            stretch *= 2.0;
        }
    }

    /// The values under study with those of some factors replaced.
    pub fn with(&self, factors: &[Factor], values: impl IntoIterator<Item = f64>) -> Vec<f64> {
        let mut all = self.values.clone();
        for (factor, value) in factors.iter().zip(values) {
            all[factor.slot] = value;
        }
        all
    }

    /// Simulates many sets of values in parallel.
    ///
    /// # Errors
    /// If all of them fail.
    pub fn run(&self, points: &[Vec<f64>], tick: Tick) -> Result<Runs, SensitivityError> {
        let results: Vec<Result<Vec<f64>, ModelError>> = points
            .par_iter()
            .map(|values| {
                let result = self.features(values).map(|f| f.values());
                tick();
                result
            })
            .collect();
        let failed = results.iter().filter(|r| r.is_err()).count();
        let why = results.iter().find_map(|r| r.as_ref().err().cloned());
        if let (true, Some(why)) = (failed == points.len(), &why) {
            return Err(SensitivityError::AllFailed { runs: failed, why: why.clone() });
        }
        let none = vec![f64::NAN; crate::sensitivity::features::OUTPUTS.len()];
        let outputs = results.into_iter().map(|r| r.unwrap_or_else(|_| none.clone())).collect();
        Ok(Runs { outputs, failed, why })
    }

    /// Simulates points of the unit cube over the ranges of factors.
    ///
    /// # Errors
    /// If all of them fail.
    pub fn run_cube(&self, factors: &[Factor], points: &[Vec<f64>], tick: Tick) -> Result<Runs, SensitivityError> {
        let at = |point: &Vec<f64>| self.with(factors, factors.iter().zip(point).map(|(f, &place)| f.at(place)));
        self.run(&points.iter().map(at).collect::<Vec<_>>(), tick)
    }
}
