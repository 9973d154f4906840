//! What a simulated device plays: a model run, or a recording made earlier, sampled for each channel of the device.

use std::error::Error;

use crate::model::trace::{Probe, Trace};
use crate::record::devices::simulated::Playback;
use crate::recording::Recording;
use crate::rig::{Device, Rig, Sensor, SensorKind};
use crate::simulate::scenario::Scenario;

type AnyError = Box<dyn Error + Send + Sync>;

/// How a model run is played.
pub struct Timing {
    /// Samples a second and channel.
    pub rate_hz: f64,
    /// Steady time before the closure, s.
    pub lead_s: f64,
    /// Time after the start of the closure, s.
    pub after_s: f64,
}

/// Noise of a simulated pressure sensor, as a share of its range; of the steady pressure where it has none.
const NOISE_SHARE: f64 = 1e-4;
/// Most values that a device may be given to play: what they take in memory is counted in GiB.
const MOST_VALUES: f64 = 2e8;
/// The noise is the same at every run: a demonstration should be one that can be repeated.
const NOISE_SEED: u64 = 1;

/// Plays a model run on a device: pressures with a little noise, flow, temperature, valve position and trigger.
///
/// # Errors
/// A model that cannot be simulated, a sensor the device cannot carry.
pub fn of_scenario(scenario: &Scenario, device: &Device, timing: &Timing) -> Result<Playback, AnyError> {
    let rig = &scenario.rig;
    let period_ns = (1e9 / timing.rate_hz).round();
    let samples = ((timing.lead_s + timing.after_s) * timing.rate_hz).floor() + 1.0;
    check_size(samples, wired(rig, device).count())?;
    let samples = samples as usize;
    let times: Vec<f64> = (0..samples).map(|i| i as f64 * period_ns * 1e-9 - timing.lead_s).collect();
    let pressures = scenario.simulate(timing.after_s)?;
    let flows: Vec<Probe> = wired(rig, device)
        .filter(|(_, s)| s.kind == SensorKind::Flow)
        .map(|(_, s)| Probe::Flow(s.position_m))
        .collect();
    let mut flows = scenario.probe(&flows, timing.after_s)?.into_iter();
    let pressure_sensors: Vec<usize> = rig.pressure_sensors().map(|(i, _)| i).collect();
    let mut noise = Gauss(fastrand::Rng::with_seed(NOISE_SEED));
    let density = scenario.water.density_kg_m3;
    let mut sensors = Vec::new();
    for (index, sensor) in wired(rig, device) {
        let values: Vec<f64> = match sensor.kind {
            SensorKind::Pressure => {
                let trace = pressure_sensors.iter().position(|&i| i == index).and_then(|k| pressures.get(k));
                let trace: &Trace = trace.ok_or("a pressure sensor was not simulated")?;
                let steady = scenario.displayed(index, trace.at(0.0));
                let sd = NOISE_SHARE * sensor.range.map_or(steady.abs(), |[low, high]| high - low);
                times.iter().map(|&t| scenario.displayed(index, trace.at(t)) + sd * noise.next()).collect()
            }
            SensorKind::Flow => {
                let trace = flows.next().ok_or("a flow sensor was not simulated")?;
                times.iter().map(|&t| sensor.unit.from_si(trace.at(t), density)).collect()
            }
            SensorKind::Temperature => vec![sensor.unit.from_si(rig.fluid.temperature_degc, density); samples],
            SensorKind::ValvePosition => {
                let opening = |t: f64| (1.0 - t.max(0.0) / scenario.run.closing_time_s.max(1e-9)).max(0.0);
                times.iter().map(|&t| sensor.unit.from_si(opening(t), density)).collect()
            }
            SensorKind::Trigger => times.iter().map(|&t| sensor.unit.from_si(f64::from(t >= 0.0), density)).collect(),
        };
        sensors.push((index, values));
    }
    playback(period_ns, sensors)
}

/// Plays a recording on a device, its sensors found by name: each channel shows the latest sample at every tick of the most
/// often sampled one.
///
/// # Errors
/// A sensor of the device that the recording lacks.
pub fn of_recording(recording: &Recording, rig: &Rig, device: &Device) -> Result<Playback, AnyError> {
    let fastest = recording.series.iter().max_by_key(|s| s.time_s.len()).filter(|s| s.time_s.len() > 1);
    let fastest = fastest.ok_or("the recording has no samples to play")?;
    let (first, last) = (fastest.time_s[0], fastest.time_s[fastest.time_s.len() - 1]);
    let period_ns = (1e9 * (last - first) / (fastest.time_s.len() - 1) as f64).round();
    let mut sensors = Vec::new();
    for (index, sensor) in wired(rig, device) {
        let found = recording.rig.sensors.iter().position(|s| s.name == sensor.name && s.unit == sensor.unit);
        let series = found.and_then(|i| recording.series.get(i)).filter(|s| !s.value.is_empty());
        let series =
            series.ok_or_else(|| format!("the recording has no samples of '{}' in {}", sensor.name, sensor.unit))?;
        let latest = |t: f64| series.value[series.time_s.partition_point(|&x| x <= t + 1e-9).saturating_sub(1)];
        let values = (0..fastest.time_s.len()).map(|i| latest(first + i as f64 * period_ns * 1e-9)).collect();
        sensors.push((index, values));
    }
    playback(period_ns, sensors)
}

/// The sensors on a device, with their index in the rig.
fn wired<'a>(rig: &'a Rig, device: &'a Device) -> impl Iterator<Item = (usize, &'a Sensor)> {
    let on_device = |sensor: &Sensor| sensor.wiring.as_ref().is_some_and(|wiring| wiring.device == device.name);
    rig.sensors.iter().enumerate().filter(move |(_, sensor)| on_device(sensor))
}

fn check_size(samples: f64, channels: usize) -> Result<(), AnyError> {
    let values = samples * channels as f64;
    if values <= MOST_VALUES {
        return Ok(());
    }
    let gib = values * size_of::<f64>() as f64 / f64::from(1u32 << 30);
    Err(format!(
        "{samples:.3e} samples of {channels} channels would need {gib:.1} GiB; shorten the duration or lower the rate"
    )
    .into())
}

fn playback(period_ns: f64, sensors: Vec<(usize, Vec<f64>)>) -> Result<Playback, AnyError> {
    if !(period_ns >= 1.0 && period_ns <= f64::from(u32::MAX)) {
        return Err(format!("a sample period of {period_ns} ns does not fit the frames' 32 bits").into());
    }
    check_size(sensors.first().map_or(0, |(_, values)| values.len()) as f64, sensors.len())?;
    Ok(Playback { sample_period_ns: period_ns as u32, sensors })
}

/// Standard normal numbers by the polar method (Marsaglia & Bray 1964).
struct Gauss(fastrand::Rng);

impl Gauss {
    fn next(&mut self) -> f64 {
        loop {
            let (x, y) = (2.0 * self.0.f64() - 1.0, 2.0 * self.0.f64() - 1.0);
            let r = x * x + y * y;
            if r > 0.0 && r < 1.0 {
                return x * (-2.0 * r.ln() / r).sqrt();
            }
        }
    }
}
