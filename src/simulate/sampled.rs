//! What the sensors of a scenario show at given times, in their units, as an instrument without errors would.

use std::error::Error;

use crate::model::trace::{Probe, Trace};
use crate::rig::SensorKind;
use crate::simulate::scenario::Scenario;

/// A row of values for each of these sensors of the rig; times are after the start of the closure, s, up to `after_s`.
/// `pressures` are the traces that the scenario gives until then.
///
/// # Errors
/// A model that cannot be simulated.
pub(crate) fn sampled(
    scenario: &Scenario,
    pressures: &[Trace],
    sensors: &[usize],
    times: &[f64],
    after_s: f64,
) -> Result<Vec<Vec<f64>>, Box<dyn Error + Send + Sync>> {
    let rig = &scenario.rig;
    let density = scenario.water.density_kg_m3;
    let of_pressure: Vec<usize> = rig.pressure_sensors().map(|(i, _)| i).collect();
    let meters = || sensors.iter().filter(|&&i| rig.sensors[i].kind == SensorKind::Flow);
    let probes: Vec<Probe> = meters().map(|&i| Probe::flow(rig.sensors[i].place())).collect();
    let flows = if probes.is_empty() { Vec::new() } else { scenario.probe(&probes, after_s)? };
    let mut flows = flows.into_iter();
    let row = |&index: &usize| {
        let sensor = &rig.sensors[index];
        let at_each =
            |value: &dyn Fn(f64) -> f64| times.iter().map(|&t| sensor.unit.from_si(value(t), density)).collect();
        Ok(match sensor.kind {
            SensorKind::Pressure => {
                let trace = of_pressure.iter().position(|&i| i == index).and_then(|k| pressures.get(k));
                let trace = trace.ok_or("a pressure sensor was not simulated")?;
                times.iter().map(|&t| scenario.displayed(index, trace.at(t))).collect()
            }
            SensorKind::Flow => {
                let trace = flows.next().ok_or("a flow sensor was not simulated")?;
                at_each(&|t| trace.at(t))
            }
            SensorKind::Temperature => at_each(&|_| rig.fluid.temperature_degc),
            SensorKind::ValvePosition => {
                at_each(&|t| (1.0 - t.max(0.0) / scenario.run.closing_time_s.max(1e-9)).max(0.0))
            }
            SensorKind::Trigger => at_each(&|t| f64::from(t >= 0.0)),
        })
    };
    sensors.iter().map(row).collect()
}

/// Standard normal numbers by the polar method (Marsaglia & Bray 1964).
pub(crate) struct Gauss(pub(crate) fastrand::Rng);

impl Gauss {
    pub(crate) fn next(&mut self) -> f64 {
        loop {
            let (x, y) = (2.0 * self.0.f64() - 1.0, 2.0 * self.0.f64() - 1.0);
            let r = x * x + y * y;
            if r > 0.0 && r < 1.0 {
                return x * (-2.0 * r.ln() / r).sqrt();
            }
        }
    }
}
