//! A scenario as a laboratory would have recorded it: noise, resolution, steady seconds before the closure. No device
//! is needed.

use std::error::Error;

use crate::model::trace::Trace;
use crate::recording::{Recording, RunInfo, Series};
use crate::rig::{Sensor, SensorKind};
use crate::simulate::playback::{MOST_VALUES, Timing};
use crate::simulate::sampled::{Gauss, sampled};
use crate::simulate::scenario::Scenario;
use crate::units::{GRAVITY_M_S2, Quantity};

/// Noise of a pressure sensor unless one is given, as a share of the Joukowsky head `a V/g`.
const NOISE_SHARE: f64 = 1e-3;
/// Counts of a pressure sensor over its range: a converter of 16 bit.
const COUNTS: f64 = 65_536.0;
/// Samples per second of flow and temperature, and what they scatter by: a share of the flow, and °C.
const SLOW_HZ: f64 = 10.0;
const FLOW_SHARE: f64 = 1e-3;
const TEMPERATURE_SD_DEGC: f64 = 0.02;

/// How a scenario is recorded.
pub struct Instruments {
    /// Rate, and times before and after the start of the closure.
    pub timing: Timing,
    /// Standard deviation of the noise of pressures, m; 0.1% of the Joukowsky head if not given.
    pub noise_m: Option<f64>,
    /// Seed of the noise.
    pub seed: u64,
}

/// Records a scenario whose traces at the pressure sensors are known.
///
/// # Errors
/// A model that cannot be simulated; more samples than memory should hold.
pub fn recording_of(
    scenario: &Scenario,
    pressures: &[Trace],
    instruments: &Instruments,
) -> Result<Recording, Box<dyn Error + Send + Sync>> {
    let Timing { rate_hz, lead_s, after_s } = instruments.timing;
    let rig = &scenario.rig;
    let samples = ((lead_s + after_s) * rate_hz).floor() + 1.0;
    if samples * rig.sensors.len() as f64 > MOST_VALUES {
        return Err(format!(
            "{samples:.3e} samples of {} sensors are too many; shorten the duration or lower the rate",
            rig.sensors.len()
        )
        .into());
    }
    let clock_s: Vec<f64> = (0..samples as usize).map(|i| i as f64 / rate_hz).collect();
    let times: Vec<f64> = clock_s.iter().map(|t| t - lead_s).collect();
    let all: Vec<usize> = (0..rig.sensors.len()).collect();
    let rows = sampled(scenario, pressures, &all, &times, after_s)?;
    let density = scenario.water.density_kg_m3;
    let joukowsky_m = scenario.shared[rig.pipes.len() - 1] * scenario.run.initial_velocity_m_s.abs() / GRAVITY_M_S2;
    let noise_m = instruments.noise_m.unwrap_or(NOISE_SHARE * joukowsky_m);
    let noise_pa = noise_m * density * GRAVITY_M_S2;
    let mut random = Gauss(fastrand::Rng::with_seed(instruments.seed));
    let mut series = Vec::new();
    for (sensor, row) in rig.sensors.iter().zip(rows) {
        let of_si = |si: f64| (sensor.unit.from_si(si, density) - sensor.unit.from_si(0.0, density)).abs();
        let (sd, step, every) = match sensor.unit.quantity {
            Quantity::Pressure => {
                let counts = sensor.range.map(|[low, high]| (high - low) / COUNTS);
                (of_si(noise_pa), counts.unwrap_or(of_si(noise_pa) / 3.0), 1)
            }
            Quantity::Flow => (FLOW_SHARE * row[0].abs(), 0.0, slow(sensor, rate_hz)),
            Quantity::Temperature => (of_si(TEMPERATURE_SD_DEGC), 0.0, slow(sensor, rate_hz)),
            Quantity::Ratio => (0.0, 0.0, 1),
        };
        let value = |v: f64, random: &mut Gauss| {
            let noisy = if sd > 0.0 { v + sd * random.next() } else { v };
            let counted = if step > 0.0 { (noisy / step).round() * step } else { noisy };
            sensor.range.map_or(counted, |[low, high]| counted.clamp(low, high))
        };
        series.push(Series {
            time_s: clock_s.iter().copied().step_by(every).collect(),
            value: row.into_iter().step_by(every).map(|v| value(v, &mut random)).collect(),
            gaps: Vec::new(),
        });
    }
    let run = RunInfo {
        source: "simulate".into(),
        notes: vec![("simulated".into(), format!("noise {noise_m:.3} m, seed {}", instruments.seed))],
        ..RunInfo::default()
    };
    Ok(Recording { rig: rig.clone(), series, run })
}

/// Every how many samples a slow instrument gives one.
fn slow(sensor: &Sensor, rate_hz: f64) -> usize {
    let is_slow = matches!(sensor.kind, SensorKind::Flow | SensorKind::Temperature);
    if is_slow { ((rate_hz / SLOW_HZ).round() as usize).max(1) } else { 1 }
}
