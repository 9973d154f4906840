//! One live test: from what devices send to a finished recording.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant};

use super::RecordError;
use super::live::Live;
use super::output::{ClockSummary, DeviceCount, Summary, check_folder, check_path};
use super::shots::Plan;
use super::snapshot::{Reports, SensorView, Snapshot};
use super::source::Sources;
use super::stream::{State, Stream};
use crate::rig::{Device, Protocol, Rig};

/// How long the session waits for input before it looks at the clock and the stop flag, and flushes.
const WAIT: Duration = Duration::from_millis(10);
/// How often the log is told how the clocks lie to each other.
const CLOCKS_EVERY: Duration = Duration::from_secs(5);

/// What a session is asked for.
#[derive(Debug, Clone)]
pub struct Options {
    /// The recording to write; must not exist.
    pub file: PathBuf,
    /// Stop after so much recorded time, s.
    pub duration_s: Option<f64>,
    /// A stream has ended when nothing valid came for so long.
    pub silence: Duration,
    /// A device whose port has vanished is waited for so long.
    pub wait: Duration,
    /// Free notes to keep with the run.
    pub notes: Vec<(String, String)>,
    /// Record shots around what a trigger sees, each in a file of its own, instead of everything in `file`.
    pub shots: Option<Plan>,
}

impl Options {
    /// Refuses early what the log would refuse at the first sample.
    pub(super) fn check(&self) -> Result<(), RecordError> {
        self.shots.as_ref().map_or_else(|| check_path(&self.file), |plan| check_folder(&plan.folder))
    }

    /// End of the recording on its own clock, ns, for one that starts at `first_ns`.
    pub(super) fn end_ns(&self, first_ns: i64) -> i64 {
        self.duration_s.map_or(i64::MAX, |s| first_ns.saturating_add((s * 1e9).round() as i64))
    }
}

/// The devices that the rig's sensors are wired to, in the order of the file, on the ports that `ports` names instead.
pub fn live_devices(rig: &Rig, ports: &[(String, String)]) -> Result<Vec<Device>, RecordError> {
    let wired = |name: &str| {
        let mut wiring = rig.sensors.iter().filter_map(|sensor| sensor.wiring.as_ref());
        wiring.any(|wiring| wiring.device == name)
    };
    let mut devices: Vec<Device> = rig.devices.iter().filter(|device| wired(&device.name)).cloned().collect();
    if devices.is_empty() {
        return Err(RecordError::NothingWired { rig: rig.name.clone() });
    }
    for (name, path) in ports {
        let known = || devices.iter().map(|device| device.name.clone()).collect::<Vec<_>>().join(", ");
        let unknown = RecordError::UnknownPort { name: name.clone(), known: known() };
        devices.iter_mut().find(|device| device.name == *name).ok_or(unknown)?.port.clone_from(path);
    }
    for (index, device) in devices.iter().enumerate() {
        for other in devices[..index].iter().filter(|other| other.port == device.port) {
            check_shared(other, device)?;
        }
    }
    Ok(devices)
}

/// Modbus slaves share a line where each has a number of its own.
fn check_shared(first: &Device, second: &Device) -> Result<(), RecordError> {
    let (one, other) = (first.speed(), second.speed());
    let (first_name, second_name, port) = (first.name.clone(), second.name.clone(), second.port.clone());
    match (&first.protocol, &second.protocol) {
        (Protocol::ModbusRtu { unit_id: unit, .. }, Protocol::ModbusRtu { unit_id, .. }) if unit == unit_id => {
            Err(RecordError::SameUnit { first: first_name, second: second_name, port, unit: *unit })
        }
        (Protocol::ModbusRtu { .. }, Protocol::ModbusRtu { .. }) if one == other => Ok(()),
        (Protocol::ModbusRtu { .. }, Protocol::ModbusRtu { .. }) => {
            Err(RecordError::UnlikeLine { first: first_name, second: second_name, port, one, other })
        }
        _ => Err(RecordError::SamePort { first: first_name, second: second_name, port }),
    }
}

/// Records what `sources` send until the duration is reached, `stop` is set or the streams end. The file is created with the
/// first valid sample: devices that never speak leave nothing behind.
pub fn record(
    rig: &Rig,
    sources: &Sources,
    options: &Options,
    stop: &AtomicBool,
    on_report: &mut dyn FnMut(Snapshot),
) -> Result<Summary, RecordError> {
    options.check()?;
    let mut streams: Vec<Stream<'_>> = sources.devices.iter().map(|device| Stream::new(rig, device)).collect();
    let expected = streams.iter().enumerate().flat_map(|(device, stream)| stream.expected(device)).collect();
    let mut live = Live::new(rig, options, describe(&sources.devices), expected, sources.host);
    let mut reports = Reports::to(on_report);
    let mut clocks_written = Instant::now();
    let ended = loop {
        if stop.load(Ordering::Relaxed) {
            break BY_USER.to_owned();
        }
        match sources.next(WAIT) {
            Ok((device, input)) => {
                if let Some(stream) = streams.get_mut(device) {
                    stream.take(input, &mut live)?;
                }
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) if streams.iter().all(|s| over(s, options).is_some()) => {}
            Err(RecvTimeoutError::Disconnected) => break "the reading threads ended".to_owned(),
        }
        if let Some(ended) = all_over(&streams, options) {
            break ended;
        }
        if live.has_begun() {
            let several = streams.len() > 1 || streams.iter().any(|stream| stream.stretches.len() > 1);
            if several && (live.take_clocks_changed() || clocks_written.elapsed() >= CLOCKS_EVERY) {
                live.write_clocks(&streams)?;
                clocks_written = Instant::now();
            }
            let output = live.output()?;
            output.tick()?;
            if output.refused() {
                break "the disk takes no more".to_owned();
            }
            if output.is_over() {
                break "all shots were recorded".to_owned();
            }
        }
        reports.when_due(|| snapshot(&streams, &live, sources, options));
    };
    for stream in &mut streams {
        stream.finish(&mut live)?;
    }
    finish(&streams, live, sources, options, ended)
}

/// Where the session stands.
fn snapshot(streams: &[Stream<'_>], live: &Live<'_>, sources: &Sources, options: &Options) -> Snapshot {
    let mut snapshot = live.snapshot();
    let view = |(device, stream): (usize, &Stream<'_>)| {
        let own: Vec<&SensorView> = snapshot.sensors.iter().filter(|sensor| sensor.device == Some(device)).collect();
        stream.view(&own, options, sources.waited(device), sources.queued(device))
    };
    snapshot.devices = streams.iter().enumerate().map(view).collect();
    snapshot
}

fn finish(
    streams: &[Stream<'_>],
    mut live: Live<'_>,
    sources: &Sources,
    options: &Options,
    ended: String,
) -> Result<Summary, RecordError> {
    if !live.has_begun() {
        return Err(streams.first().map_or(RecordError::NotBegun, |stream| stream.nothing(ended)));
    }
    live.write_clocks(streams)?;
    let all_shots = live.output()?.is_over();
    let by_user = ended == BY_USER;
    let devices: Vec<DeviceCount> = streams
        .iter()
        .enumerate()
        .map(|(index, stream)| {
            let mut count = stream.count(sources.waited(index));
            // What ended before the duration, vanished for good or never spoke owes what it did not send; a device that ends by
            // itself, or that the user stops, does not.
            let early = options.duration_s.is_some() && stream.state != State::Reached && !by_user && !all_shots;
            let left = match stream.state {
                State::Vanished(..) => true,
                State::Ended(_) => streams.len() > 1,
                State::Open | State::Reached => false,
            };
            if streams.len() > 1 || count.restarts > 0 {
                count.clock_warning = count.clock.as_ref().and_then(ClockSummary::warning);
            }
            count.incomplete = early || stream.is_empty() || left;
            count
        })
        .collect();
    let listed: Vec<usize> = streams.iter().flat_map(|stream| stream.sensors().collect::<Vec<_>>()).collect();
    let Some(mut output) = live.into_output() else { return Err(RecordError::NotBegun) };
    for device in &devices {
        for (what, text) in device.notes() {
            output.note(&format!("{}.{what}", device.name), &text)?;
        }
    }
    output.note("ended", &ended)?;
    output.finish(0, |sensor| listed.contains(&sensor), devices, ended)
}

const BY_USER: &str = "stopped by the user";

/// Why a device sends no more, where it does not.
fn over(stream: &Stream<'_>, options: &Options) -> Option<String> {
    match &stream.state {
        State::Reached => Some("the duration was reached".to_owned()),
        State::Ended(why) => Some(why.clone()),
        State::Vanished(since, why) if since.elapsed() >= options.wait => {
            Some(format!("{why} and did not come back within {} s", options.wait.as_secs_f64()))
        }
        State::Vanished(..) => None,
        State::Open if stream.heard.elapsed() >= options.silence => {
            let what = match stream.device.protocol {
                Protocol::Frames => "valid frame",
                Protocol::Lines => "valid line",
                Protocol::ModbusRtu { .. } => "answer",
            };
            Some(format!("no {what} for {} s", options.silence.as_secs_f64()))
        }
        State::Open => None,
    }
}

/// Why the session ends, where no device sends more.
fn all_over(streams: &[Stream<'_>], options: &Options) -> Option<String> {
    let reasons: Vec<String> = streams.iter().map(|stream| over(stream, options)).collect::<Option<_>>()?;
    match &reasons[..] {
        [only] => Some(only.clone()),
        all if all.iter().all(|reason| *reason == all[0]) => Some(all[0].clone()),
        all => {
            let named = streams.iter().zip(all).map(|(stream, why)| format!("{}: {why}", stream.device.name));
            Some(named.collect::<Vec<_>>().join("; "))
        }
    }
}

/// Where the samples come from, for the run's notes.
fn describe(devices: &[Device]) -> String {
    let one = |device: &Device| {
        let protocol = match device.protocol {
            Protocol::Frames => "frames",
            Protocol::Lines => "lines",
            Protocol::ModbusRtu { .. } => "modbus-rtu",
        };
        format!("{protocol} from device '{}' on {}", device.name, device.port)
    };
    devices.iter().map(one).collect::<Vec<_>>().join("; ")
}
