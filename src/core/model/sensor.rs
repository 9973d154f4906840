//! What a sensor makes of the head at its place: nothing, a first-order lag, or the high-pass of a piezoelectric one.

use crate::model::trace::Trace;
use crate::rig::{Coupling, Sensor};

/// The trace as the sensor shows it, about the steady head.
///
/// First-order systems driven by a head linear over each step are solved exactly: with `r = dt/T`,
/// `y⁺ = E y + (1 - (1-E)/r) x⁺ + ((1-E)/r - E) x`, `E = exp(-r)`. An AC-coupled sensor shows what such a lag leaves
/// out.
pub fn seen_by(sensor: &Sensor, trace: Trace) -> Trace {
    let Some(time_constant_s) = sensor.time_constant_s else { return trace };
    let r = trace.dt_s / time_constant_s;
    let decay = (-r).exp();
    let mean = -(-r).exp_m1() / r;
    let (p1, p0) = (1.0 - mean, mean - decay);
    let mut lagged = trace.values[0];
    let mut before = trace.values[0];
    let values = trace
        .values
        .iter()
        .map(|&head| {
            lagged = decay * lagged + p1 * head + p0 * before;
            before = head;
            match sensor.coupling {
                Coupling::Dc => lagged,
                Coupling::Ac => head - lagged,
            }
        })
        .collect();
    Trace { values, ..trace }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::SensorKind;

    fn step_through(coupling: Coupling) -> Trace {
        let sensor = Sensor {
            name: "P".into(),
            kind: SensorKind::Pressure,
            line: 0,
            position_m: 0.0,
            position_sd_m: 0.0,
            unit: "Pa".parse().unwrap(),
            range: None,
            accuracy_percent_fs: None,
            time_constant_s: Some(0.5),
            elevation_m: None,
            coupling,
            wiring: None,
        };
        // A ramp of 2 m/s from 10 m: the lag of a ramp has the closed form used below.
        let values = (0..200).map(|i| 10.0 + 2.0 * 0.01 * i as f64).collect();
        seen_by(&sensor, Trace { dt_s: 0.01, values, late_s: 0.0 })
    }

    #[test]
    fn a_ramp_lags_by_its_closed_form() {
        let (dc, ac) = (step_through(Coupling::Dc), step_through(Coupling::Ac));
        for i in [1, 50, 199] {
            let t = 0.01 * i as f64;
            let behind = 2.0 * 0.5 * (1.0 - (-t / 0.5f64).exp());
            assert!((dc.values[i] - (10.0 + 2.0 * t - behind)).abs() < 1e-9, "{i}");
            assert!((ac.values[i] - behind).abs() < 1e-9, "{i}");
        }
    }
}
