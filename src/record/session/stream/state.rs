//! What is known of one device of a session.

use std::time::{Duration, Instant};

use crate::record::clock::align::Stretch;
use crate::record::clock::device_clock::DeviceClock;
use crate::record::devices::poll::PollCounts;
use crate::record::devices::queue::Polled;
use crate::record::wire::frames;
use crate::record::wire::lines;
use crate::rig::{Device, Protocol, Rig};
use crate::storage::SensorClock;

/// What is on its way when a session ends is not missed, nor what is not due for twice the longest pause.
pub const ON_ITS_WAY: Duration = Duration::from_millis(500);

/// What speaks for a restart, so that the device's time is looked at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Sign {
    None,
    /// Its sequence began anew.
    Sequence,
    /// Lines are missing.
    Hole,
}

/// A sensor fed by the device.
pub(super) struct Tap {
    pub(super) sensor: usize,
    pub(super) column: usize,
    pub(super) scale: f64,
    pub(super) offset: f64,
    /// Time of the last sample, ns, and whether a poll or a line since brought none; not for frames.
    pub(super) last_ns: Option<i64>,
    pub(super) missed: bool,
    /// The port was gone since; of one that is polled.
    pub(super) away: bool,
}

/// What turns a device's bytes into samples.
pub(super) enum Codec {
    Frames(frames::Decoder),
    Lines(lines::Decoder),
    Polled(Option<Polled>),
}

/// How a device stands.
#[derive(Debug, Clone, PartialEq)]
pub enum State {
    /// Its port is open.
    Open,
    /// Its port is gone since then, and why.
    Vanished(Instant, String),
    /// It has recorded for the duration asked for.
    Reached,
    /// No more will come, and why.
    Ended(String),
}

/// One device of a session.
pub struct Stream<'a> {
    /// The device.
    pub device: &'a Device,
    /// How it stands.
    pub state: State,
    /// When it last sent something valid, or the session began.
    pub last_message: Instant,
    /// Bytes that came from it.
    pub bytes: u64,
    /// Others are recorded with it, on one clock.
    pub shared: bool,
    /// What it recorded, from restart to restart.
    pub stretches: Vec<Stretch>,
    pub(super) taps: Vec<Tap>,
    pub(super) codec: Codec,
    pub(super) clock: Option<DeviceClock>,
    /// What puts its logged times on the recording's clock, as well as it is known by now.
    pub(super) moves: SensorClock,
    /// The logged time up to which it has come, ns.
    pub(super) come_ns: Option<i64>,
    /// The longest time between two messages, nothing missing between.
    pub(super) pause: Option<Duration>,
    /// How long its last message was.
    pub(super) span: Duration,
    /// How often its clock was set while it ran.
    pub(super) steps: u64,
    pub(super) columns: Option<usize>,
    pub(super) restarted: bool,
    pub(super) returned: bool,
    pub(super) reconnects: u64,
    /// Samples or polls are known to be missing.
    pub(super) holes: u64,
    /// Messages that were bad and that were lost by the time at which it had come to the end of the recording.
    pub(super) bad_and_lost: Option<(u64, u64)>,
    /// What was seen of one that is polled before the recording began.
    pub(super) before: PollCounts,
    pub(super) values: Vec<f64>,
}

impl<'a> Stream<'a> {
    /// A device of the rig, before its first message.
    pub fn new(rig: &Rig, device: &'a Device) -> Stream<'a> {
        let wired = rig.sensors.iter().enumerate().filter_map(|(sensor, described)| {
            let wiring = described.wiring.as_ref().filter(|wiring| wiring.device == device.name)?;
            let column = usize::from(wiring.channel);
            Some(Tap {
                sensor,
                column,
                scale: wiring.scale,
                offset: wiring.offset,
                last_ns: None,
                missed: false,
                away: false,
            })
        });
        let codec = match device.protocol {
            Protocol::Frames => Codec::Frames(frames::Decoder::new()),
            Protocol::Lines => Codec::Lines(lines::Decoder::new()),
            Protocol::ModbusRtu { .. } => Codec::Polled(None),
        };
        Stream {
            device,
            state: State::Open,
            last_message: Instant::now(),
            bytes: 0,
            shared: false,
            stretches: Vec::new(),
            taps: wired.collect(),
            codec,
            clock: None,
            moves: SensorClock::default(),
            come_ns: None,
            pause: None,
            span: Duration::ZERO,
            steps: 0,
            columns: None,
            restarted: false,
            returned: false,
            reconnects: 0,
            holes: 0,
            bad_and_lost: None,
            before: PollCounts::default(),
            values: Vec::new(),
        }
    }
}
