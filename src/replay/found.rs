//! The quantities of a recording as they are now, each with the tolerance that it deserves.
//!
//! A run of the same samples through the same code gives the same numbers, so a tolerance is for changed code: a change
//! that stays within what the recording's own noise would do is none, one beyond it wants a look.

use crate::fit::outcome::fit::{Fit, FittedParameter, RunFit};
use crate::replay::quantity;
use crate::replay::quantity::{Quantity, Table};
use crate::signal::{Estimate, Features};

/// Standard errors within which an estimate may move.
const STANDARD_ERRORS: f64 = 3.0;
/// Share of its value by which any estimate may move: rounding, another order of summing.
const SHARE: f64 = 0.001;
/// Share by which an RMSE may move.
const RMSE_SHARE: f64 = 0.02;
/// Share by which a noise, and so a ratio to it, may move: it is estimated from a stretch that is chosen.
const NOISE_SHARE: f64 = 0.05;
/// Share by which the error over the extrema may move, and the percentage points that it always may.
const MAPE_SHARE: f64 = 0.1;
const MAPE_POINTS: f64 = 0.02;
/// How many times the sensor's noise its first peak may move.
const PEAK_NOISES: f64 = 2.0;
/// Noise below which there is none, m.
const NO_NOISE_M: f64 = 1e-6;

/// One quantity as it is now.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// Which.
    pub quantity: Quantity,
    /// Its value.
    pub value: f64,
    /// How far it may move, or why it is no use to hold it to its value.
    pub tolerance: Result<f64, &'static str>,
}

/// Everything that can be compared of one recording, and of the model fitted to it.
pub fn found(features: &Features, fit: Option<&Fit>) -> Vec<Found> {
    let sample_s = features.sensors.get(features.reference).map_or(0.0, |s| s.interval_s);
    let mut all = inspected(features, sample_s);
    if let Some(fit) = fit {
        all.extend(fit.runs.first().into_iter().flat_map(closeness));
        all.extend(fit.parameters.iter().map(|p| parameter(p, sample_s)));
    }
    all
}

fn inspected(features: &Features, sample_s: f64) -> Vec<Found> {
    let here = |name: &str, value, tolerance| Found { quantity: Quantity::new(Table::Inspect, name), value, tolerance };
    let closure = &features.closure;
    let start_tolerance = (STANDARD_ERRORS * closure.start_se_s).max(sample_s);
    let mut all = vec![here(quantity::CLOSURE_START, closure.start_s, finite(start_tolerance))];
    all.extend(features.period.map(|p| here(quantity::PERIOD, p.value, positive(p))));
    all.extend(features.wave_speed.crossings.map(|c| {
        let estimate = Estimate { value: c.value, standard_error: c.standard_error };
        here(quantity::WAVE_SPEED_CROSSINGS, c.value, positive(estimate))
    }));
    for sensor in &features.sensors {
        let here = |name, value, tolerance| Found {
            quantity: Quantity::new(Table::Sensor(sensor.name.clone()), name),
            value,
            tolerance,
        };
        let noise_m = sensor.noise.white_sd_m;
        let tolerance = if noise_m > NO_NOISE_M { finite(NOISE_SHARE * noise_m) } else { Err("there is none") };
        all.push(here(quantity::NOISE, noise_m, tolerance));
        all.extend(sensor.first_peak.map(|peak| {
            let tolerance = (PEAK_NOISES * noise_m).max(SHARE * peak.head_m.abs());
            here(quantity::FIRST_PEAK, peak.head_m, finite(tolerance))
        }));
    }
    all
}

fn closeness(run: &RunFit) -> [Found; 3] {
    let here = |name, value, tolerance| Found { quantity: Quantity::new(Table::Calibrate, name), value, tolerance };
    let ratio = run.rmse_m / run.noise_m;
    let mape = run.mape_extrema_percent;
    let ratio_tolerance =
        if run.noise_m > NO_NOISE_M { finite(NOISE_SHARE * ratio) } else { Err("there is no noise to be seen") };
    [
        here(quantity::RMSE, run.rmse_m, finite(RMSE_SHARE * run.rmse_m)),
        here(quantity::RMSE_OVER_NOISE, ratio, ratio_tolerance),
        here(quantity::MAPE, mape, finite((MAPE_SHARE * mape).max(MAPE_POINTS))),
    ]
}

fn parameter(p: &FittedParameter, sample_s: f64) -> Found {
    let error = STANDARD_ERRORS * p.standard_error();
    let tolerance = match p {
        _ if p.at_bound => Err("it ended at its bound"),
        _ if !p.standard_error().is_finite() => Err("the recording does not determine it"),
        // a time on the recording's clock, whose zero means nothing
        _ if p.name == quantity::CLOSURE_START => finite(error.max(sample_s)),
        _ => finite(error.max(SHARE * p.value.abs())),
    };
    Found { quantity: Quantity::new(Table::Parameter, &p.name), value: p.value, tolerance }
}

/// Of something that cannot be zero or below.
fn positive(e: Estimate) -> Result<f64, &'static str> {
    let tolerance = finite((STANDARD_ERRORS * e.standard_error).max(SHARE * e.value.abs()))?;
    if tolerance < 0.5 * e.value { Ok(tolerance) } else { Err("the recording hardly determines it") }
}

fn finite(tolerance: f64) -> Result<f64, &'static str> {
    if tolerance.is_finite() { Ok(tolerance) } else { Err("the recording does not determine it") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::outcome::uncertainty::Uncertainty;

    fn fitted(name: &str, value: f64, standard_error: f64, at_bound: bool) -> Found {
        let p = FittedParameter {
            name: name.into(),
            about: "",
            run: None,
            value,
            uncertainty: Uncertainty::of(standard_error),
            unit: "",
            at_bound,
            ..FittedParameter::default()
        };
        parameter(&p, 0.002)
    }

    #[test]
    fn tolerances_follow_the_standard_errors() {
        assert_eq!(fitted("tau3_s", 1.5, 0.2, false).tolerance, Ok(0.2 * STANDARD_ERRORS));
        assert_eq!(fitted("wave_speed_m_s", 1000.0, 0.01, false).tolerance, Ok(1.0));
        assert_eq!(fitted(quantity::CLOSURE_START, 1000.0, 1e-5, false).tolerance, Ok(0.002));
    }

    #[test]
    fn what_cannot_fail_is_left_out() {
        assert!(fitted("friction_scale", 5.0, f64::NAN, true).tolerance.is_err());
        assert!(fitted("friction_scale", 2.0, f64::INFINITY, false).tolerance.is_err());
        assert!(positive(Estimate { value: 0.045, standard_error: 0.034 }).is_err());
        assert!(positive(Estimate { value: 1.7557, standard_error: 0.0022 }).is_ok());
    }
}
