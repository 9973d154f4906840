//! One device of a session: what it sends becomes samples and gaps of the sensors wired to it.

mod count;

use std::time::Instant;

use super::RecordError;
use super::align::Stretch;
use super::clock::{DeviceClock, seconds};
use super::frames::{self, Frame};
use super::lines::{self, Line};
use super::live::Live;
use super::polling::Polled;
use super::source::Input;
use crate::recording::Gap;
use crate::rig::{Device, Protocol, Rig};

/// After a port came back, a device whose time is further off than this from where its clock should be has restarted: s, and
/// share of the time since.
const RESTART_S: (f64, f64) = (0.5, 1e-3);
/// Where its sequence began anew, too: s, and times what 95% of the arrivals were off.
const ANEW_S: (f64, f64) = (0.1, 4.0);

/// What speaks for a restart, so that the device's time is looked at.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Sign {
    None,
    /// Its sequence began anew.
    Sequence,
    /// Lines are missing: here late arrivals alone say something, for a jump of the time comes early.
    Hole,
}

/// A sensor fed by the device.
struct Tap {
    sensor: usize,
    column: usize,
    scale: f64,
    offset: f64,
    /// Time of the last sample, ns, and whether a poll or a line since brought none; not for frames.
    last_ns: Option<i64>,
    missed: bool,
}

/// What turns a device's bytes into samples.
enum Codec {
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
    pub heard: Instant,
    /// Bytes that came from it.
    pub bytes: u64,
    /// What it recorded, from restart to restart.
    pub stretches: Vec<Stretch>,
    taps: Vec<Tap>,
    codec: Codec,
    clock: Option<DeviceClock>,
    columns: Option<usize>,
    restarted: bool,
    returned: bool,
    reconnects: u64,
    /// Samples or polls are known to be missing.
    holes: u64,
    /// Polls without an answer before the recording began.
    unheard: u64,
    values: Vec<f64>,
}

impl<'a> Stream<'a> {
    /// A device of the rig, before it has said anything.
    pub fn new(rig: &Rig, device: &'a Device) -> Stream<'a> {
        let wired = rig.sensors.iter().enumerate().filter_map(|(sensor, described)| {
            let wiring = described.wiring.as_ref().filter(|wiring| wiring.device == device.name)?;
            let column = usize::from(wiring.channel);
            Some(Tap { sensor, column, scale: wiring.scale, offset: wiring.offset, last_ns: None, missed: false })
        });
        let codec = match device.protocol {
            Protocol::Frames => Codec::Frames(frames::Decoder::new()),
            Protocol::Lines => Codec::Lines(lines::Decoder::new()),
            Protocol::ModbusRtu { .. } => Codec::Polled(None),
        };
        Stream {
            device,
            state: State::Open,
            heard: Instant::now(),
            bytes: 0,
            stretches: Vec::new(),
            taps: wired.collect(),
            codec,
            clock: None,
            columns: None,
            restarted: false,
            returned: false,
            reconnects: 0,
            holes: 0,
            unheard: 0,
            values: Vec::new(),
        }
    }

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
                if matches!(self.state, State::Open) {
                    self.decode(at_ns, &bytes, live)?;
                }
            }
            Input::Polled(polled) => {
                if matches!(self.state, State::Open) {
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
                    self.heard = Instant::now();
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

    /// No more will come: records what was held back until more would have come.
    ///
    /// # Errors
    /// As [`Stream::take`].
    pub fn finish(&mut self, live: &mut Live<'_>) -> Result<(), RecordError> {
        let mut events = Vec::new();
        if let Codec::Lines(decoder) = &mut self.codec {
            decoder.finish(&mut events);
        }
        self.lines(events, live)
    }

    fn lines(&mut self, events: Vec<lines::Event>, live: &mut Live<'_>) -> Result<(), RecordError> {
        for event in events {
            match event {
                lines::Event::Restarted => self.restarted = true,
                lines::Event::Line(line) => self.line(&line, live)?,
            }
        }
        Ok(())
    }

    /// The line was cut: what was on it is lost.
    fn cut(&mut self) {
        match &mut self.codec {
            Codec::Frames(decoder) => decoder.cut(),
            Codec::Lines(decoder) => decoder.cut(),
            Codec::Polled(_) => self.taps.iter_mut().for_each(|tap| tap.missed = true),
        }
    }

    fn decode(&mut self, at_ns: i64, bytes: &[u8], live: &mut Live<'_>) -> Result<(), RecordError> {
        match &mut self.codec {
            Codec::Frames(decoder) => {
                let mut events = Vec::new();
                decoder.feed(at_ns, bytes, &mut events);
                for event in events {
                    match event {
                        frames::Event::Restarted => self.restarted = true,
                        frames::Event::Frame { frame, lost_before, began_ns, anew } => {
                            let sign = if anew { Sign::Sequence } else { Sign::None };
                            let restarts = self.stretches.len();
                            self.frame(&frame, (lost_before, sign), began_ns, live)?;
                            if restarts > 0 && self.stretches.len() > restarts {
                                self.not_lost(lost_before);
                            }
                        }
                    }
                }
            }
            Codec::Lines(decoder) => {
                let mut events = Vec::new();
                let held = decoder.held();
                decoder.feed(at_ns, bytes, &mut events);
                if decoder.held() > held {
                    self.heard = Instant::now();
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
        if !matches!(self.state, State::Open) {
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

    fn frame(
        &mut self,
        frame: &Frame,
        (lost, sign): (u32, Sign),
        began_ns: i64,
        live: &mut Live<'_>,
    ) -> Result<(), RecordError> {
        self.heard = Instant::now();
        if !self.check_columns(usize::from(frame.channels()), live)? {
            return Ok(());
        }
        let (period_ns, rows) = (frame.period_ns(), frame.samples());
        let device_ns = (frame.first_us() * 1000) as i64;
        let span_ns = i64::from(period_ns).saturating_mul(rows as i64);
        // A frame is sent when its last sample was taken; its first is that much older.
        let end_before_ns = self.clock.map_or(0, |clock| clock.end_ns());
        let sent_ns = device_ns.saturating_add(span_ns);
        let clock = self.begin((device_ns, sent_ns), began_ns, sign, live)?;
        let placed = clock.place(device_ns, period_ns, rows, lost > 0);
        let (last_ns, now_ns) = (clock.last_ns().unwrap_or_default(), clock.end_ns());
        self.arrived(sent_ns, began_ns, last_ns);
        let left_ns = live.end_ns.saturating_sub(placed.first_ns).max(0) as u64;
        let wanted = left_ns.div_ceil(u64::from(period_ns)).min(rows as u64) as usize;
        let gap = placed.gap.filter(|_| end_before_ns < live.end_ns);
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
                output.samples(tap.sensor, placed.first_ns, f64::from(period_ns), &self.values)?;
            }
        }
        if now_ns >= live.end_ns {
            self.state = State::Reached;
        }
        Ok(())
    }

    fn line(&mut self, line: &Line, live: &mut Live<'_>) -> Result<(), RecordError> {
        self.heard = Instant::now();
        if !self.check_columns(line.values.len(), live)? {
            return Ok(());
        }
        let device_ns = (line.time_us * 1000) as i64;
        let sign = if line.hole_before { Sign::Hole } else { Sign::None };
        let clock = self.begin((device_ns, device_ns), line.began_ns, sign, live)?;
        let Some(placed) = clock.place_row(device_ns, line.hole_before) else { return Ok(()) };
        self.arrived(device_ns, line.began_ns, placed.first_ns);
        self.holes += u64::from(placed.gap.is_some());
        if placed.first_ns >= live.end_ns {
            self.state = State::Reached;
            return Ok(());
        }
        let output = live.output()?;
        let now_ns = placed.first_ns;
        for tap in &mut self.taps {
            let value = line.values.get(tap.column).copied().flatten().map(|value| tap.scale * value + tap.offset);
            let Some(value) = value.filter(|value| value.is_finite()) else {
                tap.missed = true;
                self.holes += 1;
                continue;
            };
            let missed = std::mem::take(&mut tap.missed);
            if let Some(last_ns) = tap.last_ns.filter(|_| missed || placed.gap.is_some()) {
                output.gap(tap.sensor, Gap { from_s: seconds(last_ns), to_s: seconds(now_ns), samples: None })?;
            }
            output.samples(tap.sensor, now_ns, 0.0, &[value])?;
            tap.last_ns = Some(now_ns);
        }
        Ok(())
    }

    fn polled(&mut self, polled: Polled, live: &mut Live<'_>) -> Result<(), RecordError> {
        if polled.values.iter().any(|(_, value)| value.is_some()) {
            self.heard = Instant::now();
            live.begin(polled.at_ns)?;
        } else if !live.has_begun() {
            // Nothing is recorded yet, so nothing is lost.
            self.unheard = polled.counts.missed;
            // A refusal says more of why nothing comes than the silence after it.
            let before = if let Codec::Polled(Some(before)) = &self.codec { before.refused } else { None };
            self.codec = Codec::Polled(Some(Polled { refused: polled.refused.or(before), ..polled }));
            return Ok(());
        }
        for &(index, number) in &polled.values {
            let Some(tap) = self.taps.get_mut(index) else { continue };
            let Some(number) = number else {
                tap.missed = true;
                self.holes += 1;
                continue;
            };
            let time_ns = live.recording_ns(polled.at_ns);
            if time_ns >= live.end_ns {
                self.state = State::Reached;
                break;
            }
            let output = live.output()?;
            if let Some(last_ns) = tap.last_ns.filter(|_| tap.missed) {
                let gap = Gap { from_s: seconds(last_ns), to_s: seconds(time_ns), samples: None };
                output.gap(tap.sensor, gap)?;
            }
            output.samples(tap.sensor, time_ns, 0.0, &[tap.scale * number + tap.offset])?;
            (tap.last_ns, tap.missed) = (Some(time_ns), false);
            match self.stretches.last_mut() {
                Some(stretch) => stretch.last_ns = time_ns,
                None => self.stretches.push(Stretch::of_host(time_ns, time_ns, live.zero_ns())),
            }
        }
        self.codec = Codec::Polled(Some(polled));
        Ok(())
    }

    /// The device's clock for samples from `device_ns` on, sent at `sent_ns` by it: a new one at the beginning, set anew after a
    /// restart.
    fn begin(
        &mut self,
        (device_ns, sent_ns): (i64, i64),
        began_ns: i64,
        sign: Sign,
        live: &mut Live<'_>,
    ) -> Result<&mut DeviceClock, RecordError> {
        let host_ns = began_ns.saturating_sub(sent_ns - device_ns);
        live.begin(host_ns)?;
        let returned = std::mem::take(&mut self.returned);
        let elsewhere = (returned || sign != Sign::None) && self.is_elsewhere(sent_ns, began_ns, returned, sign);
        let restarted = std::mem::take(&mut self.restarted) || elsewhere;
        let recording_ns = live.recording_ns(host_ns);
        let from_ns = match &mut self.clock {
            None => Some(recording_ns),
            Some(clock) if restarted => Some(clock.restart(device_ns, recording_ns)),
            Some(_) => None,
        };
        if let Some(from_ns) = from_ns {
            if let Some(last) = self.stretches.last_mut() {
                last.close();
            }
            self.stretches.push(Stretch::new(from_ns, device_ns));
            live.clocks_changed();
        }
        Ok(self.clock.get_or_insert_with(|| DeviceClock::starting_at(device_ns, recording_ns)))
    }

    /// True for a device whose clock cannot have run on until here.
    fn is_elsewhere(&self, sent_ns: i64, began_ns: i64, returned: bool, sign: Sign) -> bool {
        let Some((stretch, line)) = self.stretches.last().and_then(|s| Some((s, s.line()?))) else { return false };
        let away_s = (sent_ns - stretch.device_ns) as f64 / 1e9;
        let late_s = (began_ns as f64 - line.host_at(sent_ns)) / 1e9;
        let off_s = if sign == Sign::Hole && !returned { late_s } else { late_s.abs() };
        let least_s = if sign == Sign::Sequence { ANEW_S.0 + ANEW_S.1 * line.residual_ns.1 / 1e9 } else { RESTART_S.0 };
        off_s > least_s + RESTART_S.1 * away_s.abs()
    }

    fn arrived(&mut self, sent_ns: i64, began_ns: i64, last_ns: i64) {
        if let Some(stretch) = self.stretches.last_mut() {
            stretch.arrived(sent_ns, began_ns);
            stretch.last_ns = last_ns;
        }
    }
}
