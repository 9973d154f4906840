//! What came from a device, and why nothing did.

use std::time::{Duration, Instant};

use crate::record::clock::align::Stretch;
use crate::record::clock::summary::ClockSummary;
use crate::record::devices::device_count::DeviceCount;
use crate::record::devices::poll::forgotten_after;
use crate::record::devices::queue::Polled;
use crate::record::error::RecordError;
use crate::record::health::alert::SensorFault;
use crate::record::health::monitor::Expected;
use crate::record::health::snapshot::{DeviceView, SensorView};
use crate::record::session::options::Options;
use crate::record::session::stream::state::{Codec, State, Stream};
use crate::record::wire::modbus::exception;
use crate::rig::{Port, Protocol, TimeUnit};

/// A device that says nothing for so long is silent; one that is polled, for so many polls.
const SILENT_AFTER: Duration = Duration::from_secs(2);
const SILENT_POLLS: f64 = 4.0;

/// Why nothing it sent could be used.
pub fn nothing(stream: &Stream<'_>, ended: String) -> RecordError {
    let (device, port) = (stream.device.name.clone(), &stream.device.port);
    let speed = if let Port::Serial(serial) = port { serial.speed() } else { String::new() };
    let ended = ended + &stream.said.ending();
    match &stream.codec {
        Codec::Polled(Some(Polled { refused: Some(code), .. })) => {
            RecordError::Refused { device, why: exception(*code) }
        }
        Codec::Polled(_) => RecordError::NoAnswer { device, port: port.to_string(), speed, ended },
        _ if stream.bytes == 0 => {
            let ended_by_itself = matches!(stream.state, State::Ended(_)) && port.command().is_some();
            let by_itself = || format!("start {port} by itself in the rig file's folder to see why");
            let advice = if ended_by_itself { by_itself() } else { if_silent(port) };
            RecordError::Silent { device, ended, advice }
        }
        Codec::Frames(_) => {
            RecordError::NoFrame { device, bytes: stream.bytes, what: if_wrong(port), speaks: "frames", ended }
        }
        Codec::Lines(decoder) => match decoder.decimal_times() {
            Some(unit) => RecordError::DecimalTimes { device, what: decimals(unit) },
            None => RecordError::NoFrame { device, bytes: stream.bytes, what: if_wrong(port), speaks: "lines", ended },
        },
    }
}

/// What to look at where not one byte comes.
fn if_silent(port: &Port) -> String {
    match port {
        Port::Serial(serial) => format!("is it switched on and started, and is {} its port?", serial.path),
        Port::Tcp(_) => format!("is it started, and does it send by itself to whoever connects to {port}?"),
        Port::Command(_) => {
            format!("does {port} print its samples on its standard output, and at once (print(…, flush=True), fflush)?")
        }
    }
}

/// What may be wrong where nothing valid comes.
fn if_wrong(port: &Port) -> String {
    match port {
        Port::Serial(serial) => format!("baud rate and format ({} in the rig file)", serial.speed()),
        Port::Tcp(_) => format!("that {port} is its address"),
        Port::Command(_) => format!("what {port} prints on its standard output"),
    }
}

/// What to do where times have decimals, which those in microseconds do not.
fn decimals(unit: Option<TimeUnit>) -> String {
    let remedy = match unit {
        Some(unit) if unit != TimeUnit::Microseconds => {
            format!("they run as {0} do: set time_unit = \"{0}\" in its [[device]]", unit.symbol())
        }
        Some(_) => "let it send whole microseconds".to_owned(),
        None => "set time_unit = \"s\" (or \"ms\") in its [[device]], whichever they are in".to_owned(),
    };
    format!("its times have decimals and are read as whole microseconds; {remedy}")
}

/// What is done, and what to do, where it is gone.
fn if_gone(port: &Port, options: &Options) -> String {
    let wait_s = options.wait.as_secs_f64();
    match port {
        Port::Serial(serial) => format!("plug {} in again within {wait_s} s", serial.path),
        Port::Tcp(_) => format!("{port} is tried again for {wait_s} s"),
        Port::Command(_) => format!("{port} is started again, for {wait_s} s at most without a sample"),
    }
}

/// What came from it; `waited` is how often and how long its thread waited for the session.
pub fn count(stream: &Stream<'_>, waited: (u64, f64)) -> DeviceCount {
    let mut count = tally(stream, waited);
    if stream.has_clock() {
        let lines = stream.timing.stretches.iter().filter_map(Stretch::line);
        count.clock = lines.map(|line| ClockSummary::of(&line)).reduce(ClockSummary::and);
    }
    count
}

/// What is known of its clock by now, for a recording that ends before the session; `several` devices have theirs
/// compared.
pub fn clock_notes(stream: &Stream<'_>, several: bool) -> impl Iterator<Item = (String, String)> {
    let mut count = count(stream, (0, 0.0));
    count.warn(several);
    let of_clock = count.notes().into_iter().filter(|(what, _)| what.starts_with("clock"));
    of_clock.map(|(what, text)| (format!("{}.{what}", stream.device.name), text))
}

/// It has come to the end of the recording: what is bad or lost from here on is not the recording's.
pub fn reached(stream: &mut Stream<'_>) {
    let count = tally(stream, (0, 0.0));
    stream.bad_and_lost = Some((count.bad_frames, count.lost_frames));
    stream.state = State::Reached;
}

/// As [`count`], but for its clock, which takes a fit.
fn tally(stream: &Stream<'_>, waited: (u64, f64)) -> DeviceCount {
    let mut count = DeviceCount {
        name: stream.device.name.clone(),
        holes: stream.holes,
        reconnects: stream.reconnects,
        restarts: stream.timing.stretches.len().saturating_sub(1) as u64,
        clock_steps: stream.timing.steps,
        squeezed_frames: stream.timing.clock.map_or(0, |clock| clock.squeezed()),
        queue_waits: waited.0,
        queue_waited_s: waited.1,
        stderr: stream.said.last.iter().cloned().collect(),
        said: stream.said.lines,
        said_more: stream.said.left_out(),
        ..DeviceCount::default()
    };
    match &stream.codec {
        Codec::Frames(decoder) => {
            let counts = decoder.counts();
            (count.frames, count.bad_frames) = (counts.frames, counts.bad);
            (count.lost_frames, count.duplicated_frames) = (counts.lost, counts.duplicated);
            (count.restamped_frames, count.stamps_scatter_s) = (counts.restamped, decoder.stamps_scatter_s());
            count.period_off_s = decoder.period_off_s();
        }
        Codec::Lines(decoder) => {
            let counts = decoder.counts();
            (count.frames, count.bad_frames) = (counts.lines, counts.bad);
            count.duplicated_frames = counts.stale;
        }
        Codec::Polled(polled) => {
            let counts = polled.as_ref().map(|polled| polled.counts).unwrap_or_default();
            (count.frames, count.bad_frames) = (counts.answers, counts.bad + counts.refused);
            (count.lost_frames, count.late_answers) = (counts.missed.saturating_sub(stream.before.missed), counts.late);
            count.returned_requests = counts.returned;
            count.skipped_polls = counts.skipped.saturating_sub(stream.before.skipped);
            count.poll_warning = poll_warning(stream, &count, counts.unproven > 0 && counts.answers > 0);
        }
    }
    if let (State::Reached, Some((bad, lost))) = (&stream.state, stream.bad_and_lost) {
        (count.bad_frames, count.lost_frames) = (bad, lost);
    }
    count
}

/// Why polls fell out, and what to do about it; one that is read though it `ignores` echoes is left alone after each
/// late answer.
fn poll_warning(stream: &Stream<'_>, count: &DeviceCount, ignores: bool) -> Option<String> {
    let Protocol::ModbusRtu { poll_interval_s, timeout_s, .. } = stream.device.protocol else { return None };
    let (lost, skipped) = (count.lost_frames, count.skipped_polls);
    let left_alone_s = forgotten_after(Duration::try_from_secs_f64(timeout_s).unwrap_or(Duration::MAX)).as_secs_f64();
    match ignores {
        true if lost + skipped > 0 => Some(format!(
            "it ignores echoes (diagnostics, function 8), which tell late answers from new ones, so it is left alone for {left_alone_s} s \
             after each answer that does not come in time, and 20 ms between requests of equal length: {skipped} polls fell out and {lost} \
             had no answer; let it answer function 8 or refuse it by an exception, or raise timeout_s (now {timeout_s}) above its slowest \
             answer and poll_interval_s (now {poll_interval_s})"
        )),
        false if skipped > 0 => Some(format!(
            "{skipped} polls fell out because the one before took too long: raise poll_interval_s (now {poll_interval_s}), or the baud rate"
        )),
        _ => None,
    }
}

/// Others went on at a moment at which more was due from it, so that it ended before them.
pub fn left_before(stream: &Stream<'_>, moment: Instant) -> bool {
    moment.saturating_duration_since(stream.timing.last_message)
        > stream.timing.patience(stream.timing.pause.unwrap_or_default())
}

/// The sensors that will come from it, as the `device`-th of the session.
pub fn expected(stream: &Stream<'_>, device: usize) -> impl Iterator<Item = Expected> {
    let silent_after = Some(silent_after(stream));
    stream.sensors().map(move |sensor| Expected { sensor, device: Some(device), silent_after })
}

fn silent_after(stream: &Stream<'_>) -> Duration {
    let polls_s = match stream.device.protocol {
        Protocol::Frames | Protocol::Lines { .. } => 0.0,
        Protocol::ModbusRtu { poll_interval_s, .. } => SILENT_POLLS * poll_interval_s,
    };
    SILENT_AFTER.max(Duration::try_from_secs_f64(polls_s).unwrap_or(Duration::MAX))
}

/// How it stands; `own` are its sensors, `waited` and `queue` as in [`DeviceView`].
pub fn view(stream: &Stream<'_>, own: &[&SensorView], options: &Options, waited: (u64, f64), queue: f64) -> DeviceView {
    let silent = match own {
        [] => stream.timing.last_message.elapsed() >= silent_after(stream),
        sensors => sensors.iter().all(|sensor| sensor.fault == Some(SensorFault::Silent)),
    };
    let trouble = match &stream.state {
        State::Vanished(_, why) if options.wait > Duration::ZERO => {
            Some(format!("{why}: {}", if_gone(&stream.device.port, options)))
        }
        State::Vanished(_, why) | State::Ended(why) => Some(why.clone()),
        // its port is there again, and it has sent nothing yet
        State::Open if stream.timing.returned => {
            stream.away.as_ref().map(|(_, why)| format!("{why}: {}", if_gone(&stream.device.port, options)))
        }
        State::Open if silent => Some(silence(stream)),
        State::Open | State::Reached => None,
    };
    let samples = own.iter().map(|sensor| sensor.samples).sum();
    DeviceView { count: tally(stream, waited), samples, samples_per_s: 0.0, queue, trouble }
}

/// What to do about a device that sends nothing that can be used.
fn silence(stream: &Stream<'_>) -> String {
    let port = &stream.device.port;
    match (&stream.codec, port) {
        (Codec::Lines(decoder), _) if let Some(unit) = decoder.decimal_times().filter(|_| stream.is_empty()) => {
            decimals(unit)
        }
        (Codec::Polled(_), Port::Serial(serial)) => {
            let speed = serial.speed();
            format!("no answer on {port}: is it powered and set to {speed}, and are unit_id and wiring (A, B) right?")
        }
        (_, Port::Serial(_)) if stream.bytes == 0 => {
            format!("not one byte arrives on {port}: is it powered, started and on this port?")
        }
        (_, Port::Serial(serial)) => {
            let speed = serial.speed();
            format!("nothing valid arrives on {port}: has it stopped, or is its line not set to {speed}?")
        }
        _ if stream.bytes == 0 => format!("not one byte arrives: {}", if_silent(port)),
        _ => format!("nothing valid arrives: has it stopped? Check {}", if_wrong(port)),
    }
}
