//! One device of a session: what it sends becomes samples and gaps of the sensors wired to it.

pub(crate) mod count;
pub(crate) mod line;
pub(crate) mod polled;
pub(crate) mod stamp;
pub(crate) mod state;
pub(crate) mod timing;

use std::time::Instant;

use crate::record::clock::device_clock::Missing;
use crate::record::devices::queue::Input;
use crate::record::error::RecordError;
use crate::record::session::session_log::Live;
use crate::record::session::stream::stamp::Stamp;
use crate::record::session::stream::state::{Codec, Sign};
use crate::record::wire::frames;
use crate::record::wire::frames::Taken;

pub use crate::record::session::stream::state::{ON_ITS_WAY, State, Stream};

impl Stream<'_> {
    /// True for a device that says its samples' times; one that is asked has none of its own.
    pub fn has_clock(&self) -> bool {
        !matches!(self.codec, Codec::Polled(_))
    }

    /// Sensors wired to it, by their place in the rig.
    pub fn sensors(&self) -> impl Iterator<Item = usize> + '_ {
        self.taps.iter().map(|tap| tap.sensor)
    }

    /// Records what came.
    ///
    /// # Errors
    /// What makes a recording impossible before it has begun: a sensor on a column that the device lacks. Later it ends this device's part.
    pub fn take(&mut self, input: Input, live: &mut Live<'_>) -> Result<(), RecordError> {
        match input {
            Input::Bytes { at_ns, bytes } => {
                self.bytes += bytes.len() as u64;
                if self.is_recorded() {
                    self.decode(at_ns, &bytes, live)?;
                }
            }
            Input::Polled(polled) => {
                if self.is_recorded() {
                    self.polled(polled, live)?;
                }
            }
            Input::Vanished(why) => {
                self.cut();
                if matches!(self.state, State::Open) {
                    self.state = State::Vanished(Instant::now(), why);
                }
            }
            Input::Back => {
                self.reconnects += 1;
                self.returned = true;
                if matches!(self.state, State::Vanished(..)) {
                    self.state = State::Open;
                    self.last_message = Instant::now();
                }
            }
            Input::Ended(why) => {
                self.finish(live)?;
                self.cut();
                if self.state != State::Reached {
                    self.state = State::Ended(why);
                }
            }
        }
        Ok(())
    }

    /// True while what it sends is recorded: with the duration over, until the others are there, for clocks move when they are fitted anew.
    fn is_recorded(&self) -> bool {
        matches!(self.state, State::Open | State::Reached)
    }

    /// No more will come: records what was held back until more would have come.
    ///
    /// # Errors
    /// As [`Stream::take`].
    pub fn finish(&mut self, live: &mut Live<'_>) -> Result<(), RecordError> {
        let last_message = self.last_message;
        self.hand_on_what_is_held(live)?;
        // It came when it came.
        self.last_message = last_message;
        Ok(())
    }

    fn hand_on_what_is_held(&mut self, live: &mut Live<'_>) -> Result<(), RecordError> {
        match &mut self.codec {
            Codec::Frames(decoder) => {
                let mut events = Vec::new();
                decoder.finish(&mut events);
                self.frames(events, live)
            }
            Codec::Lines(decoder) => {
                let mut events = Vec::new();
                decoder.finish(&mut events);
                self.lines(events, live)
            }
            Codec::Polled(_) => Ok(()),
        }
    }

    fn frames(&mut self, events: Vec<frames::Event>, live: &mut Live<'_>) -> Result<(), RecordError> {
        for event in events {
            match event {
                frames::Event::Restarted => self.restarted = true,
                frames::Event::Frame(taken) => {
                    let restarts = self.stretches.len();
                    self.frame(&taken, live)?;
                    if restarts > 0 && self.stretches.len() > restarts {
                        self.not_lost(taken.lost_before);
                    }
                }
            }
        }
        Ok(())
    }

    /// The line was cut: what was on it is lost.
    fn cut(&mut self) {
        match &mut self.codec {
            Codec::Frames(decoder) => decoder.cut(),
            Codec::Lines(decoder) => decoder.cut(),
            Codec::Polled(_) => self.taps.iter_mut().for_each(|tap| tap.away = true),
        }
    }

    fn decode(&mut self, at_ns: i64, bytes: &[u8], live: &mut Live<'_>) -> Result<(), RecordError> {
        match &mut self.codec {
            Codec::Frames(decoder) => {
                let mut events = Vec::new();
                decoder.feed(at_ns, bytes, &mut events);
                self.frames(events, live)?;
            }
            Codec::Lines(decoder) => {
                let mut events = Vec::new();
                let held = decoder.held();
                decoder.feed(at_ns, bytes, &mut events);
                // A line that is held back is a sign of life, and with the next one shows the device's rhythm as any other.
                if held > 0 && (decoder.held() > held || !events.is_empty()) {
                    self.pause = self.pause.max(Some(self.last_message.elapsed()));
                }
                if decoder.held() > held {
                    self.last_message = Instant::now();
                }
                self.lines(events, live)?;
            }
            Codec::Polled(_) => {}
        }
        Ok(())
    }

    /// What the sequence says is missing before a restart is another sequence's.
    fn not_lost(&mut self, frames: u32) {
        if let Codec::Frames(decoder) = &mut self.codec {
            decoder.not_lost(frames);
        }
    }

    /// Looks whether the columns are those that the rig file counts on; false where the device can no longer be recorded.
    fn check_columns(&mut self, columns: usize, live: &Live<'_>) -> Result<bool, RecordError> {
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

    fn frame(&mut self, taken: &Taken, live: &mut Live<'_>) -> Result<(), RecordError> {
        let &Taken { ref frame, lost_before: lost, began_ns, anew, jump, hole_from_ns } = taken;
        let sign = if anew { Sign::Sequence } else { Sign::None };
        self.sent_something(lost == 0);
        if !self.check_columns(usize::from(frame.channels()), live)? {
            return Ok(());
        }
        let (period_ns, rows) = (frame.period_ns(), frame.samples());
        let device_ns = (frame.first_us() * 1000) as i64;
        // A frame is sent when its last sample was taken; its first is that much older.
        let sent_ns = device_ns.saturating_add(i64::from(period_ns).saturating_mul(rows as i64));
        let end_before_ns = self.clock.map_or(0, |clock| clock.end_ns());
        let stamp = Stamp { device_ns, sent_ns, began_ns, period_ns: i64::from(period_ns), rows, lost, jump };
        let clock = self.begin(&stamp, sign, live)?;
        let missing = if lost > 0 { Missing::Surely } else { Missing::From(hole_from_ns) };
        let placed = clock.place(device_ns, period_ns, rows, missing);
        let (last_ns, now_ns) = (clock.last_ns().unwrap_or_default(), clock.end_ns());
        self.arrived(&stamp, last_ns, now_ns);
        let limit_ns = self.limit_ns(live);
        let left_ns = limit_ns.saturating_sub(placed.first_ns).max(0) as f64;
        let wanted = ((left_ns / placed.period_ns).ceil() as usize).min(rows);
        let gap = placed.gap.filter(|_| self.is_wanted(end_before_ns, live));
        self.holes += u64::from(gap.is_some());
        let output = live.output()?;
        for tap in &self.taps {
            if let Some(gap) = gap {
                output.gap(tap.sensor, gap)?;
            }
            self.values.clear();
            let counts = frame.channel(tap.column).take(wanted);
            self.values.extend(counts.map(|count| tap.scale * f64::from(count) + tap.offset));
            if wanted > 0 {
                output.samples(tap.sensor, placed.first_ns, placed.period_ns, &self.values)?;
            }
        }
        Ok(())
    }
}
