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
            all.extend(problem.rows.samples_of(r, s).map(|(time_s, measured)| Observation {
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

/// The model's values at places, with `values` of all parameters, on the problem's grid.
///
/// # Errors
/// If one of the runs cannot be simulated.
pub fn modelled(problem: &FitProblem, values: &[f64], places: &[Place]) -> Result<Vec<f64>, ModelError> {
    let runs: Vec<Modelled> = (0..problem.runs.len())
        .map(|r| problem.modelled(r, values, problem.window().reaches))
        .collect::<Result<_, _>>()?;
    let at = |place: &Place| {
        let Modelled { traces, meter_flow_m3_s } = &runs[place.run];
        match place.gauge {
            Gauge::Meter => meter_flow_m3_s.unwrap_or(f64::NAN),
            Gauge::Sensor(s) => {
                let since_s = place.time_s - problem.closure_start_s(place.run, values);
                traces[s].at(since_s) + problem.offset_m(place.run, s, values)
            }
        }
    };
    Ok(places.iter().map(at).collect())
}
