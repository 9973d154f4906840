//! What is known of one device of a session.

use std::time::{Duration, Instant};

use crate::record::devices::poll::PollCounts;
use crate::record::devices::queue::Polled;
use crate::record::error::RecordError;
use crate::record::session::session_log::Live;
use crate::record::session::stream::said::Said;
use crate::record::session::stream::timing::Timing;
use crate::record::wire::frames;
use crate::record::wire::lines;
use crate::rig::{Device, Protocol, Rig};

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
    /// Bytes that came from it.
    pub bytes: u64,
    /// When what it sent was measured, and when it came.
    pub timing: Timing,
    pub(super) taps: Vec<Tap>,
    pub(super) codec: Codec,
    pub(super) columns: Option<usize>,
    pub(super) reconnects: u64,
    /// Samples or polls are known to be missing.
    pub(super) holes: u64,
    /// Messages that were bad and that were lost by the time at which it had come to the end of the recording.
    pub(super) bad_and_lost: Option<(u64, u64)>,
    /// What was seen of one that is polled before the recording began.
    pub(super) before: PollCounts,
    pub(super) values: Vec<f64>,
    /// Since when it was away, and why.
    pub(super) away: Option<(Instant, String)>,
    /// What it said to people.
    pub(super) said: Said,
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
            Protocol::Lines { time_unit } => Codec::Lines(lines::Decoder::of(time_unit)),
            Protocol::ModbusRtu { .. } => Codec::Polled(None),
        };
        let mut stream = Stream {
            device,
            state: State::Open,
            bytes: 0,
            timing: Timing::new(device),
            taps: wired.collect(),
            codec,
            columns: None,
            reconnects: 0,
            holes: 0,
            bad_and_lost: None,
            before: PollCounts::default(),
            values: Vec::new(),
            away: None,
            said: Said::of(&device.name),
        };
        if device.port.command().is_some() {
            stream.begin_anew();
        }
        stream
    }

    /// A process has started: what it sends is heard from its first byte on, and has nothing to do with what another
    /// one sent before.
    pub(super) fn begin_anew(&mut self) {
        match &mut self.codec {
            Codec::Frames(decoder) => decoder.begin_anew(),
            Codec::Lines(decoder) => decoder.begin_anew(),
            Codec::Polled(_) => {}
        }
        self.timing.restarted = !self.is_empty();
    }

    /// True for a device that says its samples' times; one that is asked has none of its own.
    pub fn has_clock(&self) -> bool {
        !matches!(self.codec, Codec::Polled(_))
    }

    /// Sensors wired to it, by their place in the rig.
    pub fn sensors(&self) -> impl Iterator<Item = usize> + '_ {
        self.taps.iter().map(|tap| tap.sensor)
    }

    /// True while what it sends is recorded: with the duration over, until the others are there, for clocks move when
    /// they are fitted anew.
    pub(crate) fn is_recorded(&self) -> bool {
        matches!(self.state, State::Open | State::Reached)
    }

    /// True if nothing it sent could be used.
    pub fn is_empty(&self) -> bool {
        self.timing.stretches.is_empty()
    }

    /// As [`Timing::silent_since`], of a device whose port is open: it owes what it did not send.
    pub fn silent_since(&self, moment: Instant, silence: Duration) -> Option<(i64, Duration)> {
        if self.state == State::Open { self.timing.silent_since(moment, silence) } else { None }
    }

    /// Looks whether the columns are those that the rig file counts on; false where the device can no longer be
    /// recorded.
    pub(crate) fn check_columns(&mut self, columns: usize, live: &Live<'_>) -> Result<bool, RecordError> {
        if !self.is_recorded() {
            return Ok(false);
        }
        let expected = *self.columns.get_or_insert(columns);
        let problem = if expected != columns {
            format!("it changed from {expected} to {columns} channels, so their meaning is unknown")
        } else if let Some(tap) = self.taps.iter().find(|tap| tap.column >= columns) {
            let error = RecordError::NoChannel {
                sensor: live.rig.sensors[tap.sensor].name.clone(),
                channel: tap.column,
                device: self.device.name.clone(),
                channels: columns,
            };
            if !live.has_begun() {
                return Err(error);
            }
            error.to_string()
        } else {
            return Ok(true);
        };
        self.holes += 1;
        self.state = State::Ended(problem);
        Ok(false)
    }
}
