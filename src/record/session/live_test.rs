//! One live test: from what devices send to a finished recording.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant};

use crate::record::clock::align;
use crate::record::clock::device_clock::seconds;
use crate::record::clock::time_unit::Runs;
use crate::record::devices::queue::Input;
use crate::record::devices::source::Sources;
use crate::record::error::RecordError;
use crate::record::health::snapshot::{Reports, SensorView, Snapshot};
pub use crate::record::session::options::{Options, SILENCE_S};
use crate::record::session::output::{DeviceCount, Summary};
use crate::record::session::session_log::Live;
use crate::record::session::stream::line::{check_unit, clock_is_off};
use crate::record::session::stream::{self, ON_ITS_WAY, State, Stream, count};
use crate::recording::Gap;
use crate::rig::{Device, Port, Protocol, Rig};
use crate::storage::Retimer;

/// How long the session waits for input before it looks at the clock and the stop flag, and flushes.
const WAIT: Duration = Duration::from_millis(10);
/// When the user stops, what came until so much later is recorded, ns, but for no longer than this: a disk that stands
/// still does not keep the program from its end.
const ON_ITS_WAY_NS: i64 = 10_000_000;
const MOST_WAITING: Duration = Duration::from_secs(2);
/// How often the relation of the clocks is written to the log.
const CLOCKS_EVERY: Duration = Duration::from_secs(5);

/// Clocks are known to so much: a device that ended so shortly before the duration has sent all of it, ns.
const END_NS: i64 = 10_000_000;

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
        let device = devices.iter_mut().find(|device| device.name == *name).ok_or(unknown)?;
        let no_baud = || RecordError::NoBaud { device: name.clone(), path: path.clone() };
        device.port = match Port::tcp(path) {
            Some(tcp) => tcp.map_err(RecordError::BadAddress)?,
            None => device.port.at_path(path).ok_or_else(no_baud)?,
        };
    }
    for (index, device) in devices.iter().enumerate() {
        for other in &devices[..index] {
            check_shared(other, device)?;
        }
    }
    Ok(devices)
}

/// Modbus slaves share a line where each has a number of its own; nothing else shares a port. A command may be started
/// twice.
fn check_shared(first: &Device, second: &Device) -> Result<(), RecordError> {
    let (one, other) = match (&first.port, &second.port) {
        (Port::Serial(one), Port::Serial(other)) if one.path == other.path => (one.speed(), other.speed()),
        (Port::Tcp(one), Port::Tcp(other)) if one == other => (String::new(), String::new()),
        _ => return Ok(()),
    };
    let (first_name, second_name, port) = (first.name.clone(), second.name.clone(), second.port.to_string());
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

/// Records what `sources` send until the duration is reached, `stop` is set or the streams end. The file is created
/// with the first valid sample: devices that never speak leave nothing behind.
pub fn record(
    rig: &Rig,
    sources: &Sources,
    options: &Options,
    stop: &AtomicBool,
    on_report: &mut dyn FnMut(Snapshot),
) -> Result<Summary, RecordError> {
    options.check()?;
    let mut streams = streams_of(rig, &sources.devices);
    if !options.real_time {
        streams.iter_mut().for_each(|stream| stream.timing.pace = None);
    }
    let expected = streams.iter().enumerate().flat_map(|(device, stream)| count::expected(stream, device)).collect();
    let mut live = Live::new(rig, options, describe(&sources.devices), expected, sources.host);
    let mut reports = Reports::to(on_report);
    let mut clocks_written = Instant::now();
    let ended = loop {
        if stop.load(Ordering::Relaxed) {
            take_waiting(sources, &mut streams, &mut live)?;
            break BY_USER.to_owned();
        }
        match sources.next(WAIT) {
            Ok((device, input)) => {
                take(device, input, &mut streams, &mut live)?;
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) if streams.iter().all(|s| over(s, options).is_some()) => {}
            Err(RecvTimeoutError::Disconnected) => break "the reading threads ended".to_owned(),
        }
        let now_ns = sources.host.now_ns();
        end_by_duration(now_ns, &mut streams, &mut live)?;
        if let Some(ended) = all_over(&streams, options) {
            write_clocks(&mut live, &mut streams)?;
            reopen(now_ns, &mut streams, &live);
            if all_over(&streams, options).is_some() {
                break ended;
            }
        }
        if live.has_begun() {
            let due = clocks_written.elapsed() >= CLOCKS_EVERY;
            if due {
                clocks_written = Instant::now();
            }
            if let Some(ended) = keep_up(due, &mut streams, &mut live)? {
                break ended.to_owned();
            }
        }
        reports.when_due(|| snapshot(&streams, &live, sources, options));
    };
    finish(&mut streams, live, sources, options, ended)
}

fn streams_of<'a>(rig: &Rig, devices: &'a [Device]) -> Vec<Stream<'a>> {
    let mut streams: Vec<Stream<'_>> = devices.iter().map(|device| Stream::new(rig, device)).collect();
    streams.iter_mut().for_each(|stream| stream.timing.shared = devices.len() > 1);
    streams
}

/// Records what came from a device.
fn take(device: usize, input: Input, streams: &mut [Stream<'_>], live: &mut Live<'_>) -> Result<(), RecordError> {
    let Some(stream) = streams.get_mut(device) else { return Ok(()) };
    let at_ns = match &input {
        Input::Bytes { at_ns, .. } => Some(*at_ns),
        _ => None,
    };
    stream::take(stream, input, live)?;
    end_by_duration(at_ns.unwrap_or(i64::MIN), streams, live)
}

/// Ends the part of devices that have recorded for the duration, at a time on the host's clock. Their clocks as they
/// are known now decide.
fn end_by_duration(host_ns: i64, streams: &mut [Stream<'_>], live: &mut Live<'_>) -> Result<(), RecordError> {
    let (now_ns, end_ns) = (live.recording_ns(host_ns), live.end_ns);
    let is_through = |stream: &Stream<'_>| stream.state == State::Open && stream.timing.is_through(end_ns, now_ns);
    if end_ns < i64::MAX && live.has_begun() && streams.iter().any(is_through) {
        write_clocks(live, streams)?;
        streams.iter_mut().filter(|stream| is_through(stream)).for_each(count::reached);
    }
    Ok(())
}

/// Records what had come when the user stopped, and what is in the queue of it: that the disk was slow loses nothing.
fn take_waiting(sources: &Sources, streams: &mut [Stream<'_>], live: &mut Live<'_>) -> Result<(), RecordError> {
    let (stopped_ns, deadline) = (sources.host.now_ns(), Instant::now() + MOST_WAITING);
    while Instant::now() < deadline
        && let Ok((device, input)) = sources.next(WAIT)
    {
        let at_ns = match &input {
            Input::Bytes { at_ns, .. } => *at_ns,
            Input::Polled(polled) => polled.at_ns,
            Input::Said { at_ns, .. } => *at_ns,
            Input::Vanished(_) | Input::Back | Input::Ended(_) => stopped_ns,
        };
        if at_ns > stopped_ns + ON_ITS_WAY_NS {
            break;
        }
        take(device, input, streams, live)?;
    }
    Ok(())
}

/// Writes the relation of the clocks, as well as it is known by now, to the log and to the devices.
fn write_clocks(live: &mut Live<'_>, streams: &mut [Stream<'_>]) -> Result<(), RecordError> {
    let name = |sensor: usize| live.rig.sensors[sensor].name.clone();
    let devices: Vec<_> =
        streams.iter().map(|stream| (stream.sensors().map(name).collect(), stream.timing.stretches.clone())).collect();
    let own: Vec<bool> = streams.iter().map(Stream::has_clock).collect();
    let fixes = align::fixes(&devices, &own);
    let retimer = Retimer::new(fixes.clone());
    for (stream, (sensors, _)) in streams.iter_mut().zip(&devices) {
        let moves = sensors.first().map(|sensor| retimer.of(sensor)).unwrap_or_default();
        stream.timing.set_moves(moves);
    }
    let several = streams.len() > 1;
    live.write_clocks(fixes, || streams.iter().flat_map(|stream| count::clock_notes(stream, several)).collect())
}

/// Writes the relation of the clocks to the log, when it is `due` or wanted, and flushes. Returns why the recording
/// ends, if it does.
fn keep_up(due: bool, streams: &mut [Stream<'_>], live: &mut Live<'_>) -> Result<Option<&'static str>, RecordError> {
    let several = streams.len() > 1 || streams.iter().any(|stream| stream.timing.stretches.len() > 1);
    if several && (live.take_clocks_changed() || due || live.output()?.wants_clocks()) {
        write_clocks(live, streams)?;
    }
    let output = live.output()?;
    output.tick()?;
    Ok(match () {
        () if output.refused() => Some("the disk takes no more"),
        () if output.is_over() => Some("all shots were recorded"),
        () => None,
    })
}

/// By the clocks as they are known now, a device that had come to the end may have not.
fn reopen(host_ns: i64, streams: &mut [Stream<'_>], live: &Live<'_>) {
    let (now_ns, end_ns) = (live.recording_ns(host_ns), live.end_ns);
    let short = |stream: &&mut Stream<'_>| stream.state == State::Reached && !stream.timing.is_through(end_ns, now_ns);
    // what is no longer there can send no more
    for stream in streams.iter_mut().filter(short).filter(|stream| stream.timing.last_message.elapsed() < ON_ITS_WAY) {
        stream.state = State::Open;
    }
}

/// Where the session stands.
fn snapshot(streams: &[Stream<'_>], live: &Live<'_>, sources: &Sources, options: &Options) -> Snapshot {
    let mut snapshot = live.snapshot();
    let view = |(device, stream): (usize, &Stream<'_>)| {
        let own: Vec<&SensorView> = snapshot.sensors.iter().filter(|sensor| sensor.device == Some(device)).collect();
        count::view(stream, &own, options, sources.waited(device), sources.queued(device))
    };
    snapshot.devices = streams.iter().enumerate().map(view).collect();
    snapshot
}

fn finish(
    streams: &mut [Stream<'_>],
    mut live: Live<'_>,
    sources: &Sources,
    options: &Options,
    mut ended: String,
) -> Result<Summary, RecordError> {
    streams.iter_mut().try_for_each(|stream| stream::finish(stream, &mut live))?;
    if !live.has_begun() {
        return Err(streams.first().map_or(RecordError::NotBegun, |stream| count::nothing(stream, ended)));
    }
    streams.iter().try_for_each(|stream| check_unit(stream, true, &mut live))?;
    live.output()?.monitor.last_look();
    write_clocks(&mut live, streams)?;
    let all_shots = live.output()?.is_over();
    let by_user = ended == BY_USER;
    // A device that falls silent while another goes on owes what it did not send. Where nothing comes any more that is
    // the streams' end, whether the session waited it out or the user was faster; of a duration asked for, what did not
    // come until then is owed.
    let (now, last) = (Instant::now(), streams.iter().map(|stream| stream.timing.last_message).max());
    let last = last.unwrap_or(now);
    let last_sent = streams.iter().map(|stream| stream.timing.sent_by()).max().unwrap_or(now);
    let moment = if by_user && options.duration_s.is_some() { now } else { last_sent };
    if by_user && streams.iter().all(|stream| stream.silent_since(now, options.silence).is_some()) {
        ended += &format!("; nothing had come for {:.1} s", now.saturating_duration_since(last).as_secs_f64());
    }
    let devices: Vec<DeviceCount> = streams
        .iter()
        .enumerate()
        .map(|(index, stream)| {
            let mut count = count::count(stream, sources.waited(index));
            // What ended before the duration, vanished for good or never spoke owes what it did not send; a device that
            // ends by itself, or that the user stops, does not.
            // That it had reached the end was by its clock as it was known then.
            let runs = stream.timing.runs();
            let came = match runs {
                Runs::Off { .. } => stream.state == State::Reached,
                Runs::Evenly | Runs::Unknown => stream.timing.has_come_to(live.end_ns.saturating_sub(END_NS)),
            };
            let early = options.duration_s.is_some() && !came && !by_user && !all_shots;
            let left = match stream.state {
                State::Vanished(..) => true,
                State::Ended(_) => count::left_before(stream, moment),
                State::Open | State::Reached => false,
            };
            count.off = clock_is_off(stream, runs);
            let is_off = matches!(runs, Runs::Off { .. });
            count.clock.iter_mut().for_each(|clock| clock.is_real_time &= !is_off);
            count.warn(streams.len() > 1);
            let silent = stream.silent_since(moment, options.silence).is_some();
            count.incomplete = early || stream.is_empty() || left || silent;
            count.began_late_s = stream.timing.begins_late().map(|(_, late_s)| late_s);
            count
        })
        .collect();
    for stream in streams.iter() {
        let Some((first_ns, _)) = stream.timing.begins_late() else { continue };
        for sensor in stream.sensors() {
            let gap = Gap { from_s: stream.timing.logged_s(0), to_s: seconds(first_ns), samples: None };
            live.output()?.never_came(sensor, gap)?;
        }
    }
    for (stream, count) in streams.iter().zip(&devices) {
        let limit_s = stream.timing.logged_s(live.end_ns);
        let gap = match stream.silent_since(moment, options.silence) {
            Some((since_ns, silent)) => (seconds(since_ns), (seconds(since_ns) + silent.as_secs_f64()).min(limit_s)),
            None if count.incomplete && stream.state != State::Open => {
                let Some(last) = stream.timing.stretches.last() else { continue };
                let last_s = seconds(last.last_ns);
                match stream.state {
                    State::Reached => (last_s, limit_s),
                    // others went on without it
                    _ => (
                        last_s,
                        (last_s + moment.saturating_duration_since(stream.timing.last_message).as_secs_f64())
                            .min(limit_s),
                    ),
                }
            }
            None => continue,
        };
        if gap.1 <= gap.0 {
            continue;
        }
        for sensor in stream.sensors() {
            live.output()?.never_came(sensor, Gap { from_s: gap.0, to_s: gap.1, samples: None })?;
        }
    }
    if options.duration_s.is_some() {
        let is_off = |stream: &&Stream<'_>| matches!(stream.timing.runs(), Runs::Off { .. });
        for stream in streams.iter().filter(|stream| !is_off(stream)) {
            for sensor in stream.sensors() {
                let end_ns = live.end_ns;
                live.output()?.keep_until(sensor, end_ns);
            }
        }
    }
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
        State::Open if stream.timing.last_message.elapsed() >= options.silence => {
            let what = match stream.device.protocol {
                Protocol::Frames => "valid frame",
                Protocol::Lines { .. } => "valid line",
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
            Protocol::Lines { .. } => "lines",
            Protocol::ModbusRtu { .. } => "modbus-rtu",
        };
        let way = if device.port.command().is_some() { "by the command" } else { "on" };
        format!("{protocol} from device '{}' {way} {}", device.name, device.port)
    };
    devices.iter().map(one).collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests;
