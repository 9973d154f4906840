//! A sensor whose clock is shifted against those of the others.

use crate::model::effect::{Circumstances, Effect, check};
use crate::model::error::ModelError;
use crate::model::parameter::Parameter;
use crate::model::scene::Site;
use crate::model::trace::Trace;

/// See the module.
///
/// A positive skew is a clock that is ahead: `y(t) = H(t - s)`. Everything at this sensor carries a later time than it
/// happened, and fronts seem to arrive late by `s`.
pub struct ClockSkew;

impl Effect for ClockSkew {
    fn name(&self) -> &'static str {
        "clock-skew"
    }
    fn summary(&self) -> &'static str {
        "a sensor whose clock is shifted against the others"
    }
    fn equation(&self) -> &'static str {
        "y(t) = H(t - s), s > 0 where the sensor's times are later than the others'"
    }
    fn source(&self) -> &'static str {
        "devices without a common clock; the shift is exact, by cubic interpolation between time steps"
    }
    fn trace(&self) -> &'static str {
        "all arrivals at one sensor off by the same time, shapes unchanged"
    }
    fn at_sensor(&self) -> bool {
        true
    }
    fn remedy(&self, _place: Option<&str>, sensor: Option<&str>) -> Option<String> {
        sensor.map(|sensor| format!("record {sensor} with the clock of the other sensors and repeat the test"))
    }
    fn parameters(&self, site: &Site, _elements: usize) -> Vec<Parameter> {
        let about = "how much later the sensor's times are than the others'";
        let t = site.period_s;
        vec![Parameter::linear("clock_skew_s", "s", about, 0.01 * t, -t, t).vanishing_at(0.0)]
    }
    /// Both directions, as far as fronts of other reflections.
    fn other_starts(&self, _elements: usize) -> Vec<Vec<f64>> {
        [-1.0, 10.0, -10.0].iter().map(|&by| vec![by]).collect()
    }
    fn beyond_s(&self, values: &[f64]) -> f64 {
        (-values[0]).max(0.0)
    }
    /// A logger that scans its channels reads each at another time within a sample.
    fn noteworthy(&self, values: &[f64], known: &Circumstances) -> bool {
        values.iter().any(|skew_s| skew_s.abs() > known.sample_s)
    }
    fn sense(&self, values: &[f64], _elevation_m: f64, trace: Trace) -> Result<Trace, ModelError> {
        check("clock_skew_s", values[0], true, "a number")?;
        Ok(Trace { late_s: trace.late_s + values[0], ..trace })
    }
}
