//! A sensor that reads a few percent too high or too low.

use crate::model::effect::{Circumstances, Effect, check};
use crate::model::error::ModelError;
use crate::model::parameter::Parameter;
use crate::model::scene::Site;
use crate::model::trace::Trace;

/// See the module.
///
/// The gain scales the pressure, so the sensor's elevation does not matter. Its zero error is a parameter of every run.
pub struct SensorGain;

/// Least gain error that counts as a fault: an ordinary transducer with its amplifier is good to a percent.
const LEAST_FAULT: f64 = 0.01;

impl Effect for SensorGain {
    fn name(&self) -> &'static str {
        "sensor-gain"
    }
    fn summary(&self) -> &'static str {
        "a sensor that reads a few percent too high or too low"
    }
    fn equation(&self) -> &'static str {
        "y = z + (1 + g)(H - z)"
    }
    fn source(&self) -> &'static str {
        "the definition of a sensitivity (span) error"
    }
    fn trace(&self) -> &'static str {
        "steady and transient pressures too high or too low by one factor, at one sensor"
    }
    fn at_sensor(&self) -> bool {
        true
    }
    fn remedy(&self, _place: Option<&str>, sensor: Option<&str>) -> Option<String> {
        sensor.map(|sensor| format!("put another sensor in the place of {sensor} and repeat the test"))
    }
    fn parameters(&self, _site: &Site, _elements: usize) -> Vec<Parameter> {
        let about = "share by which the sensor reads too high";
        vec![Parameter::linear("gain_error", "1", about, 0.02, -0.3, 0.3).vanishing_at(0.0)]
    }
    fn noteworthy(&self, values: &[f64], _known: &Circumstances) -> bool {
        values.iter().any(|gain| gain.abs() >= LEAST_FAULT)
    }
    fn sense(&self, values: &[f64], elevation_m: f64, mut trace: Trace) -> Result<Trace, ModelError> {
        let gain = values[0];
        check("gain_error", gain, gain > -1.0, "more than -1")?;
        trace.values.iter_mut().for_each(|head| *head += gain * (*head - elevation_m));
        Ok(trace)
    }
}
