//! The observations of a calibration, one number at a time: heads at sample times, and flows before the closure.

use crate::fit::problem::fit_problem::{FitProblem, Modelled};
use crate::model::ModelError;

/// The instrument of an observation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Gauge {
    /// A pressure sensor, by its index in the run's sensors: a head, m.
    Sensor(usize),
    /// The flow meter: the flow before the closure, m³/s.
    Meter,
}

/// Place and time of an observation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Index of the run.
    pub run: usize,
    /// The instrument.
    pub gauge: Gauge,
    /// When, on the recording's clock, s; not a number for the meter, which is read before the closure.
    pub time_s: f64,
}

/// One observation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// Where and when.
    pub place: Place,
    /// What was measured, in the gauge's unit.
    pub measured: f64,
    /// Its standard deviation, in the same.
    pub sd: f64,
}

/// All observations that enter a calibration, run by run, with the run's meter last.
pub fn observations(problem: &FitProblem) -> Vec<Observation> {
    let mut all = Vec::new();
    for (r, run) in problem.runs.iter().enumerate() {
        for (s, sensor) in run.sensors.iter().enumerate() {
            let [time_s, measured] = problem.rows.samples_of(r, s);
            all.extend(time_s.iter().zip(measured).map(|(&time_s, &measured)| Observation {
                place: Place { run: r, gauge: Gauge::Sensor(s), time_s },
                measured,
                sd: sensor.noise_m,
            }));
        }
        all.extend(run.meter.map(|meter| Observation {
            place: Place { run: r, gauge: Gauge::Meter, time_s: f64::NAN },
            measured: meter.flow_m3_s,
            sd: meter.relative_sd * meter.flow_m3_s,
        }));
    }
    all
}

/// A model's runs at given values: what its gauges show at any time.
pub struct Shown {
    runs: Vec<ShownRun>,
}

struct ShownRun {
    modelled: Modelled,
    closure_start_s: f64,
    offsets_m: Vec<f64>,
}

impl Shown {
    /// The model with `values` of all parameters, on the problem's grid.
    ///
    /// # Errors
    /// If one of the runs cannot be simulated.
    pub fn of(problem: &FitProblem, values: &[f64]) -> Result<Shown, ModelError> {
        let run = |r: usize| {
            Ok(ShownRun {
                modelled: problem.modelled(r, values, problem.window().reaches)?,
                closure_start_s: problem.closure_start_s(r, values),
                offsets_m: (0..problem.runs[r].sensors.len()).map(|s| problem.offset_m(r, s, values)).collect(),
            })
        };
        Ok(Shown { runs: (0..problem.runs.len()).map(run).collect::<Result<_, _>>()? })
    }

    /// Start of a run's closure on its clock, s.
    pub fn closure_start_s(&self, run: usize) -> f64 {
        self.runs[run].closure_start_s
    }

    /// Head that a sensor of a run shows at times on the recording's clock, m.
    pub fn head_m(&self, run: usize, sensor: usize) -> impl Fn(f64) -> f64 {
        let ShownRun { modelled, closure_start_s, offsets_m } = &self.runs[run];
        let (trace, offset_m) = (&modelled.traces[sensor], offsets_m[sensor]);
        move |time_s| trace.at(time_s - closure_start_s) + offset_m
    }

    /// What the gauge shows.
    pub fn at(&self, place: &Place) -> f64 {
        match place.gauge {
            Gauge::Meter => self.runs[place.run].modelled.meter_flow_m3_s.unwrap_or(f64::NAN),
            Gauge::Sensor(s) => self.head_m(place.run, s)(place.time_s),
        }
    }
}
