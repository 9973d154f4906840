//! A pressure sensor, or its tapping line, with dynamics of its own: a low-pass of second order on one sensor.

use crate::model::effect::{Effect, check};
use crate::model::error::ModelError;
use crate::model::oscillator::Oscillator;
use crate::model::parameter::Parameter;
use crate::model::scene::Site;
use crate::model::trace::Trace;

/// See the module.
///
/// The parameters are the lag `T = 2ζ/ω`, which shifts and smooths, and the damping ratio, which shapes. They are
/// nearly independent, as frequency and damping would not be. A large `ζ` gives the first-order lag `T y' + y = x`. The
/// natural frequency is `ζ/(πT)`.
pub struct SensorLag;

/// A lag below this share of a time step has no effect.
const NO_LAG_STEPS: f64 = 1e-9;

impl Effect for SensorLag {
    fn name(&self) -> &'static str {
        "sensor-lag"
    }
    fn summary(&self) -> &'static str {
        "a pressure sensor or its tapping line with dynamics of its own"
    }
    fn equation(&self) -> &'static str {
        "y'' + 2ζω y' + ω² y = ω² H,  ω = 2ζ/T"
    }
    fn source(&self) -> &'static str {
        "a tapping line and its sensor as one oscillator: Doebelin (2003), Measurement Systems, ch. 6; exact for a head linear over each \
         step"
    }
    fn trace(&self) -> &'static str {
        "smooth, late or ringing fronts at one sensor only, whatever the pipe's length"
    }
    fn at_sensor(&self) -> bool {
        true
    }
    fn remedy(&self, _place: Option<&str>, sensor: Option<&str>) -> Option<String> {
        sensor.map(|sensor| format!("put another sensor in the place of {sensor} and repeat the test"))
    }
    fn parameters(&self, site: &Site, _elements: usize) -> Vec<Parameter> {
        let lag_s = 0.02 * site.period_s;
        vec![
            Parameter::log(
                "lag_time_s",
                "s",
                "delay with which the sensor shows a steady rise",
                lag_s,
                1e-4 * lag_s,
                100.0 * lag_s,
            )
            .vanishing_at(0.0),
            Parameter::log(
                "lag_damping_ratio",
                "1",
                "damping of the sensor: below 0.7 it rings, 1 is critical, large values are a lag of first order",
                1.0,
                0.02,
                20.0,
            ),
        ]
    }
    fn other_starts(&self, _elements: usize) -> Vec<Vec<f64>> {
        vec![vec![0.2, 0.3], vec![5.0, 1.0]]
    }
    fn sense(&self, values: &[f64], _elevation_m: f64, mut trace: Trace) -> Result<Trace, ModelError> {
        let (lag_s, damping) = (values[0], values[1]);
        check("lag_time_s", lag_s, lag_s >= 0.0, "zero or more")?;
        check("lag_damping_ratio", damping, damping > 0.0, "more than zero")?;
        if lag_s < NO_LAG_STEPS * trace.dt_s {
            return Ok(trace);
        }
        let mut before = trace.values[0];
        let mut sensor = Oscillator::new(2.0 * damping / lag_s, damping, trace.dt_s, before);
        for value in &mut trace.values {
            let head = *value;
            sensor.advance(before, head);
            (before, *value) = (head, sensor.position);
        }
        Ok(trace)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(lag_s: f64, damping: f64, head: impl Fn(f64) -> f64) -> Trace {
        let dt_s = 1e-3;
        let values = (0..8000).map(|i| head(dt_s * f64::from(i))).collect();
        SensorLag.sense(&[lag_s, damping], 3.0, Trace { dt_s, values, late_s: 0.0 }).unwrap()
    }

    /// Amplitude of the response to a sine: `1/√((1-r²)² + (2ζr)²)`, `r = f/f_n` (Doebelin).
    #[test]
    fn a_sine_comes_out_as_high_as_the_textbook_says() {
        for (natural_hz, damping) in [(8.0, 0.2), (5.0, 0.7), (20.0, 1.5)] {
            let lag_s = damping / (std::f64::consts::PI * natural_hz);
            for hz in [2.0, 5.0, 9.0] {
                let trace = seen(lag_s, damping, |t| 10.0 + (std::f64::consts::TAU * hz * t).sin());
                // A whole number of cycles at the end, when the start has died away.
                let end = &trace.values[6000..];
                let amplitude = (2.0 * end.iter().map(|y| (y - 10.0).powi(2)).sum::<f64>() / end.len() as f64).sqrt();
                let r = hz / natural_hz;
                let exact = 1.0 / ((1.0 - r * r).powi(2) + (2.0 * damping * r).powi(2)).sqrt();
                assert!((amplitude / exact - 1.0).abs() < 2e-3, "{natural_hz} {damping} {hz}: {amplitude} {exact}");
            }
        }
    }

    #[test]
    fn with_strong_damping_it_is_the_first_order_lag() {
        let trace = seen(0.1, 50.0, |t| if t > 0.0 { 1.0 } else { 0.0 });
        for i in [100, 200, 500] {
            let exact = 1.0 - (-(f64::from(i) - 0.5) * 1e-3 / 0.1).exp();
            assert!((trace.values[i as usize] - exact).abs() < 1e-3);
        }
    }

    #[test]
    fn without_lag_nothing_changes_and_the_way_there_is_smooth() {
        let head = |t: f64| 20.0 + 5.0 * (40.0 * t).sin();
        let plain = seen(0.0, 1.0, head);
        assert_eq!(plain.values[123], head(0.123));
        let slight = seen(1e-7, 1.0, head);
        let worst = slight.values.iter().zip(&plain.values).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 200.0 * 1.1e-7 && worst > 0.0, "late by the lag: {worst}");
    }

    #[test]
    fn impossible_values_are_refused() {
        for bad in [[-1e-3, 1.0], [1e-3, 0.0], [f64::NAN, 1.0], [1e-3, f64::INFINITY]] {
            let trace = Trace { dt_s: 0.1, values: vec![1.0; 4], late_s: 0.0 };
            assert!(SensorLag.sense(&bad, 0.0, trace).is_err(), "{bad:?}");
        }
    }
}
