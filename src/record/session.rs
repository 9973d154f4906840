//! One live test: from the bytes of a device to a finished recording.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use super::RecordError;
use super::clock::DeviceClock;
use super::frames::{Decoder, Event, Frame};
use super::output::{DeviceCount, Progress, Summary, check_path};
use super::port::{Input, Source};
use super::shots::{Plan, Recorder};
use crate::recording::RunInfo;
use crate::rig::{Device, Protocol, Rig, Wiring};

/// How long the session waits for bytes before it looks at the clock and the stop flag.
const WAIT: Duration = Duration::from_millis(50);

/// What a session is asked for.
#[derive(Debug, Clone)]
pub struct Options {
    /// The recording to write; must not exist.
    pub file: PathBuf,
    /// Stop after so much recorded time, s.
    pub duration_s: Option<f64>,
    /// The stream has ended when no valid frame came for so long.
    pub silence: Duration,
    /// Free notes to keep with the run.
    pub notes: Vec<(String, String)>,
    /// Record shots around what a trigger sees, each in a file of its own, instead of everything in `file`.
    pub shots: Option<Plan>,
}

impl Options {
    /// Refuses early what the log would refuse at the first sample.
    pub(super) fn check(&self) -> Result<(), RecordError> {
        self.shots.as_ref().map_or_else(|| check_path(&self.file), |_| Ok(()))
    }

    /// End of the recording on its own clock, ns, for one that starts at `first_ns`.
    pub(super) fn end_ns(&self, first_ns: i64) -> i64 {
        self.duration_s.map_or(i64::MAX, |s| first_ns.saturating_add((s * 1e9).round() as i64))
    }
}

/// The one device that the rig's sensors are wired to; refuses what this version cannot record.
pub fn live_device(rig: &Rig) -> Result<&Device, RecordError> {
    let mut names: Vec<&str> = Vec::new();
    for wiring in rig.sensors.iter().filter_map(|sensor| sensor.wiring.as_ref()) {
        if !names.contains(&wiring.device.as_str()) {
            names.push(&wiring.device);
        }
    }
    let name = match names[..] {
        [] => return Err(RecordError::NothingWired { rig: rig.name.clone() }),
        [name] => name,
        _ => return Err(RecordError::SeveralDevices(names.into_iter().map(str::to_owned).collect())),
    };
    let device =
        rig.devices.iter().find(|device| device.name == name).ok_or_else(|| RecordError::UnknownDevice(name.into()))?;
    let protocol = match device.protocol {
        Protocol::Frames => return Ok(device),
        Protocol::Lines => "lines",
        Protocol::ModbusRtu { .. } => "modbus-rtu",
    };
    Err(RecordError::Protocol { device: name.into(), protocol })
}

/// Records `source`, the stream of `device`, until the duration is reached, `stop` is set or the stream ends. The file is
/// created with the first frame: a device that never speaks leaves nothing behind.
pub fn record(
    rig: &Rig,
    device: &Device,
    source: &Source,
    options: &Options,
    stop: &AtomicBool,
    on_progress: &mut dyn FnMut(&Progress),
) -> Result<Summary, RecordError> {
    options.check()?;
    let mut session = Session { rig, device, options, live: None };
    let mut decoder = Decoder::new();
    let mut events = Vec::new();
    let mut bytes_seen = 0_u64;
    let mut last_frame = Instant::now();
    let ended = 'session: loop {
        if stop.load(Ordering::Relaxed) {
            break "stopped by the user".to_owned();
        }
        match source.inputs.recv_timeout(WAIT) {
            Ok(Input::Bytes { at, bytes }) => {
                bytes_seen += bytes.len() as u64;
                decoder.feed(&bytes, &mut events);
                for event in events.drain(..) {
                    last_frame = Instant::now();
                    if let Some(ended) = session.take(event, at)? {
                        break 'session ended;
                    }
                }
            }
            Ok(Input::Ended(why)) => {
                decoder.finish();
                break why;
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break "the reading thread ended".to_owned(),
        }
        if last_frame.elapsed() >= options.silence {
            break format!("no valid frame for {} s", options.silence.as_secs_f64());
        }
        if let Some(live) = &mut session.live
            && let Some(progress) = live.output.tick()?
        {
            on_progress(&progress);
        }
    };
    let Some(live) = session.live else {
        let name = device.name.clone();
        return Err(match bytes_seen {
            0 => RecordError::Silent { device: name, port: device.port.clone(), ended },
            bytes => RecordError::NoFrame { device: name, bytes, baud: device.baud, ended },
        });
    };
    let counts = decoder.counts();
    let devices = vec![DeviceCount {
        name: device.name.clone(),
        frames: counts.frames,
        bad_frames: counts.bad,
        lost_frames: counts.lost,
        duplicated_frames: counts.duplicated,
    }];
    live.finish(devices, ended)
}

/// A sensor fed by the device.
struct Tap {
    sensor: usize,
    column: usize,
    scale: f64,
    offset: f64,
}

struct Session<'a> {
    rig: &'a Rig,
    device: &'a Device,
    options: &'a Options,
    live: Option<Live>,
}

/// What exists from the first frame on.
struct Live {
    output: Recorder,
    clock: DeviceClock,
    channels: u8,
    end_ns: i64,
    taps: Vec<Tap>,
    values: Vec<f64>,
}

impl Session<'_> {
    /// Records an event; returns why the session ends, where it does.
    fn take(&mut self, event: Event, at: SystemTime) -> Result<Option<String>, RecordError> {
        let (frame, lost_before) = match event {
            Event::Frame { frame, lost_before } => (frame, lost_before),
            Event::Restarted => {
                return Ok(Some("the device restarted: its clock began anew, so later samples have no place".into()));
            }
        };
        let live = match &mut self.live {
            Some(live) => live,
            empty => empty.insert(Live::start(self.rig, self.device, self.options, &frame, at)?),
        };
        live.take(&frame, lost_before)
    }
}

impl Live {
    fn start(
        rig: &Rig,
        device: &Device,
        options: &Options,
        frame: &Frame,
        at: SystemTime,
    ) -> Result<Live, RecordError> {
        let wired = |wiring: &&Wiring| wiring.device == device.name;
        let mut taps = Vec::new();
        for (sensor, described) in rig.sensors.iter().enumerate() {
            let Some(wiring) = described.wiring.as_ref().filter(wired) else { continue };
            if wiring.channel >= u16::from(frame.channels()) {
                return Err(RecordError::NoChannel {
                    sensor: described.name.clone(),
                    channel: wiring.channel,
                    device: device.name.clone(),
                    channels: frame.channels(),
                });
            }
            taps.push(Tap { sensor, column: wiring.channel.into(), scale: wiring.scale, offset: wiring.offset });
        }
        // The frame arrived after its last sample was taken; its first is that much older.
        let span_ns = u64::from(frame.period_ns()).saturating_mul(frame.samples() as u64);
        let arrived_ns = at.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos() as u64);
        let run = RunInfo {
            start_unix_ns: arrived_ns.saturating_sub(span_ns),
            source: format!("frames from device '{}' on {}", device.name, device.port),
            program: format!("surgescope {}", env!("CARGO_PKG_VERSION")),
            notes: options.notes.clone(),
            ..RunInfo::default()
        };
        Ok(Live {
            output: Recorder::create(options, rig, &run)?,
            clock: DeviceClock::starting_at(frame),
            channels: frame.channels(),
            end_ns: options.end_ns(0),
            taps,
            values: Vec::new(),
        })
    }

    fn take(&mut self, frame: &Frame, lost_before: u32) -> Result<Option<String>, RecordError> {
        if frame.channels() != self.channels {
            return Ok(Some(format!(
                "the device changed from {} to {} channels, so their meaning is unknown",
                self.channels,
                frame.channels()
            )));
        }
        let end_before_ns = self.clock.end_ns();
        let placed = self.clock.place(frame, lost_before);
        let left_ns = self.end_ns.saturating_sub(placed.first_ns).max(0) as u64;
        let wanted = left_ns.div_ceil(u64::from(frame.period_ns())).min(frame.samples() as u64) as usize;
        for tap in &self.taps {
            if let Some(gap) = placed.gap
                && end_before_ns < self.end_ns
            {
                self.output.gap(tap.sensor, gap)?;
            }
            self.values.clear();
            let counts = frame.channel(tap.column).take(wanted);
            self.values.extend(counts.map(|count| tap.scale * f64::from(count) + tap.offset));
            if wanted > 0 {
                self.output.samples(tap.sensor, placed.first_ns, f64::from(frame.period_ns()), &self.values)?;
            }
        }
        if self.output.is_over() {
            return Ok(Some("all shots were recorded".into()));
        }
        Ok((self.clock.end_ns() >= self.end_ns).then(|| "the duration was reached".into()))
    }

    /// Keeps the counts with the recording and finishes it.
    fn finish(mut self, devices: Vec<DeviceCount>, ended: String) -> Result<Summary, RecordError> {
        for device in &devices {
            let DeviceCount { name, frames, bad_frames, lost_frames, duplicated_frames } = device;
            for (what, count) in [
                ("frames", frames),
                ("bad_frames", bad_frames),
                ("lost_frames", lost_frames),
                ("duplicated_frames", duplicated_frames),
            ] {
                self.output.note(&format!("{name}.{what}"), &count.to_string())?;
            }
        }
        self.output.note("ended", &ended)?;
        let taps = self.taps;
        self.output.finish(0, |sensor| taps.iter().any(|tap| tap.sensor == sensor), devices, ended)
    }
}
