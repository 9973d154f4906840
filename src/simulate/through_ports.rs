//! Simulated or played data recorded through pseudo-terminals, as from real ports.

use std::error::Error;
use std::sync::atomic::AtomicBool;

use crate::record::devices::simulated::{Faults, Playback, Script, SimulatedDevice};
use crate::record::devices::source::Sources;
use crate::record::health::snapshot::Snapshot;
use crate::record::session::live_test::{Options, live_devices, record};
use crate::record::session::output::Summary;
use crate::rig::{Device, Port, Protocol, Rig};
use crate::simulate::playback::{Timing, USUAL_SEED, of_scenario};
use crate::simulate::scenario::Scenario;
use crate::simulate::wiring::wired;

/// Steady time before the closure of a simulated test, s.
pub const LEAD_S: f64 = 1.0;

/// Records a simulated test, each device sending through a pseudo-terminal: until `stop`, telling where it stands and
/// what to look out for.
///
/// # Errors
/// A model that cannot be simulated, and as [`record_playbacks`].
pub fn record_scenario(
    scenario: &Scenario,
    timing: &Timing,
    how: (f64, Faults),
    options: &Options,
    (stop, report): (&AtomicBool, &mut dyn FnMut(Snapshot)),
    warn: &dyn Fn(&str),
) -> Result<Summary, Box<dyn Error + Send + Sync>> {
    let rig = &wired(scenario, timing)?;
    let scenario = scenario.on(rig.clone());
    let mut played = Vec::new();
    for device in live_devices(rig, &[])? {
        let playback = of_scenario(&scenario, &device, timing, USUAL_SEED)?;
        played.push((device, playback));
    }
    clipped(rig, &played).iter().for_each(|warning| warn(warning));
    record_playbacks(rig, played, how, options, stop, report)
}

/// Samples of a device that lie outside the range of its counts; what to tell of them.
pub fn clipped(rig: &Rig, played: &[(Device, Playback)]) -> Vec<String> {
    let of = |(device, playback): &(Device, Playback)| {
        let clipped = Script::new(playback, rig, device).map_or(0, |script| script.clipped);
        let name = &device.name;
        (clipped > 0).then(|| {
            format!("{clipped} samples are outside the range of the counts of '{name}': check scale and offset")
        })
    };
    played.iter().filter_map(of).collect()
}

/// Plays data on simulated devices, so many times faster than real time and with such faults, and records it.
///
/// # Errors
/// No pseudo-terminal, data that a device cannot send, or any error of a recording.
pub fn record_playbacks(
    rig: &Rig,
    played: Vec<(Device, Playback)>,
    (speed, faults): (f64, Faults),
    options: &Options,
    stop: &AtomicBool,
    report: &mut dyn FnMut(Snapshot),
) -> Result<Summary, Box<dyn Error + Send + Sync>> {
    let is_asked = |device: &Device| matches!(device.protocol, Protocol::ModbusRtu { .. });
    if let Some(fault) = faults.of_asked().filter(|_| !played.iter().any(|(device, _)| is_asked(device))) {
        return Err(format!(
            "only a device that is asked for its values (protocol = \"modbus-rtu\") can have the fault '{fault}', and the rig has none: leave it out of option `faults`"
        )
        .into());
    }
    let mut devices = Vec::new();
    // Lines by the port that stands in the rig file: Modbus slaves may share one.
    let mut simulated: Vec<(Port, SimulatedDevice, Vec<Script>)> = Vec::new();
    for (mut device, playback) in played {
        let script = Script::new(&playback, rig, &device)?;
        let shared = |port: &Port| device.port.command().is_none() && *port == device.port;
        let at = match simulated.iter().position(|(port, ..)| shared(port)) {
            Some(at) => at,
            None => {
                simulated.push((device.port.clone(), SimulatedDevice::open()?, Vec::new()));
                simulated.len() - 1
            }
        };
        let (_, line, scripts) = &mut simulated[at];
        device = device.on_pseudoterminal(&line.path().display().to_string());
        scripts.push(script);
        devices.push(device);
    }
    // A simulated device that hangs up has played everything.
    let sources = Sources::open(rig, &devices, false)?;
    for (_, line, scripts) in &mut simulated {
        line.start_line(std::mem::take(scripts), speed, faults)?;
    }
    let options = Options { real_time: speed == 1.0, ..options.clone() };
    let summary = record(rig, &sources, &options, stop, report)?;
    for (_, line, _) in simulated {
        line.stop()?;
    }
    Ok(summary)
}
