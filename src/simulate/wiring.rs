//! Wiring for a rig that has none, so that a test can be simulated on it as if it were recorded live.

use crate::extent::ends;
use crate::rig::{Device, Framing, Port, Protocol, Rig, Serial, Wiring};
use crate::simulate::playback::{Timing, USUAL_SEED, of_scenario};
use crate::simulate::scenario::Scenario;

/// Room above and below what a sensor without a range will show, as a share of it.
const ROOM: f64 = 0.5;
/// Counts of a channel from its least to its greatest.
const COUNTS: f64 = 65_535.0;
/// The device that carries all sensors.
const DEVICE: &str = "simulated";

/// The scenario's rig with every sensor wired to one device; as it is where one is wired already.
///
/// # Errors
/// A model that cannot be simulated.
pub fn wired(scenario: &Scenario, timing: &Timing) -> Result<Rig, Box<dyn std::error::Error + Send + Sync>> {
    let mut rig = scenario.rig.clone();
    if rig.sensors.iter().any(|s| s.wiring.is_some()) {
        return Ok(rig);
    }
    let device = Device {
        name: DEVICE.into(),
        port: Port::Serial(Serial { path: DEVICE.into(), baud: 921_600, framing: Framing::default() }),
        protocol: Protocol::Frames,
    };
    for (channel, sensor) in (0u16..).zip(&mut rig.sensors) {
        sensor.wiring = Some(Wiring { device: DEVICE.into(), channel, scale: 1.0, offset: 0.0, register: None });
    }
    rig.devices.push(device.clone());
    let playback = of_scenario(&scenario.on(rig.clone()), &device, timing, USUAL_SEED)?;
    for (index, values) in playback.sensors {
        let sensor = &mut rig.sensors[index];
        let [low, high] = sensor.range.unwrap_or_else(|| around(&values));
        let scale = (high - low) / COUNTS;
        if let Some(wiring) = &mut sensor.wiring {
            (wiring.scale, wiring.offset) = (scale, low + (COUNTS + 1.0) / 2.0 * scale);
        }
    }
    Ok(rig)
}

/// A range with room for all values.
fn around(values: &[f64]) -> [f64; 2] {
    let (low, high) = ends(values);
    let room = (ROOM * (high - low)).max(0.01 * high.abs()).max(1e-3);
    [low - room, high + room]
}
