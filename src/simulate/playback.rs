//! What a simulated device plays: a model run, or a recording made earlier, sampled for each channel of the device.

use std::error::Error;

use crate::record::devices::simulated::Playback;
use crate::recording::Recording;
use crate::rig::{Device, Rig, Sensor, SensorKind};
use crate::simulate::sampled::{Gauss, sampled};
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
pub(crate) const MOST_VALUES: f64 = 2e8;
/// Seed of the noise where none is given: a demonstration should be one that can be repeated.
pub const USUAL_SEED: u64 = 1;

/// Plays a model run on a device: pressures with a little noise of this `seed`, flow, temperature, valve position and
/// trigger.
///
/// # Errors
/// A model that cannot be simulated, a sensor the device cannot carry.
pub fn of_scenario(scenario: &Scenario, device: &Device, timing: &Timing, seed: u64) -> Result<Playback, AnyError> {
    let rig = &scenario.rig;
    let period_ns = (1e9 / timing.rate_hz).round();
    let samples = ((timing.lead_s + timing.after_s) * timing.rate_hz).floor() + 1.0;
    check_size(samples, wired(rig, device).count())?;
    let samples = samples as usize;
    let times: Vec<f64> = (0..samples).map(|i| i as f64 * period_ns * 1e-9 - timing.lead_s).collect();
    let wired: Vec<usize> = wired(rig, device).map(|(i, _)| i).collect();
    let rows = sampled(scenario, &scenario.simulate(timing.after_s)?, &wired, &times, timing.after_s)?;
    let mut noise = Gauss(fastrand::Rng::with_seed(seed));
    let at_rest = times.iter().position(|&t| t >= 0.0).unwrap_or(0);
    let mut sensors = Vec::new();
    for (index, mut values) in wired.into_iter().zip(rows) {
        let sensor = &rig.sensors[index];
        if sensor.kind == SensorKind::Pressure {
            let sd = NOISE_SHARE * sensor.range.map_or(values[at_rest].abs(), |[low, high]| high - low);
            values.iter_mut().for_each(|v| *v += sd * noise.next());
        }
        sensors.push((index, values));
    }
    playback(period_ns, sensors)
}

/// Plays a recording on a device, its sensors found by name: each channel shows the latest sample at every tick of the
/// most often sampled one.
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
