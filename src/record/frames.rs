//! The `frames` wire protocol: bytes to frames and back, without any I/O.
//!
//! A frame is COBS-encoded and ended by a zero byte. Inside, little endian: u8 version (1), u8 channels n, u16 sequence
//! (wraps), u64 device time of the first sample (µs), u32 sample period (ns), u16 samples m, m × n i16 interleaved by
//! channel, u16 CRC-16/IBM-3740 over all before it.

mod last;

use std::collections::VecDeque;

use crc::{CRC_16_IBM_3740, Crc};

use super::pieces::Pieces;
use last::{Last, missing};

const VERSION: u8 = 1;
const HEADER: usize = 18;
const CRC_BYTES: usize = 2;
const CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_IBM_3740);

/// Longest encoded frame taken, bytes. A stream without a zero for longer than this is no `frames` stream.
pub const MAX_ENCODED: usize = 1 << 20;

/// Device times beyond this, µs (146 000 years), would not fit the recording's i64 nanoseconds.
const MAX_DEVICE_US: u64 = (i64::MAX / 2000) as u64;

/// So many consecutive frames from the past, in sequence among themselves, are a device that restarted.
const RESTART_FRAMES: usize = 3;

/// So many of the last frames are remembered, to know them when they come again.
const RECENT: usize = 64;

/// One frame: `samples()` samples of each of `channels()` channels, `period_ns()` apart.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    sequence: u16,
    first_us: u64,
    period_ns: u32,
    channels: u8,
    counts: Vec<i16>,
}

impl Frame {
    /// A frame of `counts` interleaved by channel; `None` where the wire format cannot hold it (no channels, a ragged or
    /// too long block, a period of 0, a time beyond what a recording can hold).
    pub fn new(sequence: u16, first_us: u64, period_ns: u32, channels: u8, counts: Vec<i16>) -> Option<Frame> {
        let width = usize::from(channels);
        let whole = width > 0 && counts.len().is_multiple_of(width) && counts.len() / width <= usize::from(u16::MAX);
        let encoded = HEADER + 2 * counts.len() + CRC_BYTES;
        let fits = cobs::max_encoding_length(encoded) <= MAX_ENCODED;
        (whole && fits && period_ns > 0 && first_us <= MAX_DEVICE_US).then_some(Frame {
            sequence,
            first_us,
            period_ns,
            channels,
            counts,
        })
    }

    /// Sequence number of the frame; wraps after 65535.
    pub fn sequence(&self) -> u16 {
        self.sequence
    }

    /// Device time of the first sample, µs since the device started.
    pub fn first_us(&self) -> u64 {
        self.first_us
    }

    /// Time between samples of a channel, ns; never 0.
    pub fn period_ns(&self) -> u32 {
        self.period_ns
    }

    /// Number of channels; never 0.
    pub fn channels(&self) -> u8 {
        self.channels
    }

    /// Number of samples of each channel.
    pub fn samples(&self) -> usize {
        self.counts.len() / usize::from(self.channels)
    }

    /// The counts of one channel, in time order; empty for a channel that the frame does not have.
    pub fn channel(&self, channel: usize) -> impl Iterator<Item = i16> + '_ {
        let width = usize::from(self.channels);
        let skip = if channel < width { channel } else { self.counts.len() };
        self.counts.iter().skip(skip).step_by(width).copied()
    }

    /// The bytes on the wire, with the closing zero.
    pub fn encode(&self) -> Vec<u8> {
        self.sealed_by(|sum| sum)
    }

    /// The bytes of a device whose check sums are wrong.
    pub(super) fn encode_with_wrong_crc(&self) -> Vec<u8> {
        self.sealed_by(|sum| !sum)
    }

    fn sealed_by(&self, seal: impl FnOnce(u16) -> u16) -> Vec<u8> {
        let mut raw = Vec::with_capacity(HEADER + 2 * self.counts.len() + CRC_BYTES);
        raw.extend([VERSION, self.channels]);
        raw.extend(self.sequence.to_le_bytes());
        raw.extend(self.first_us.to_le_bytes());
        raw.extend(self.period_ns.to_le_bytes());
        raw.extend((self.samples() as u16).to_le_bytes());
        raw.extend(self.counts.iter().flat_map(|count| count.to_le_bytes()));
        raw.extend(seal(CRC.checksum(&raw)).to_le_bytes());
        let mut encoded = cobs::encode_vec(&raw);
        encoded.push(0);
        encoded
    }
}

/// What became of the bytes between two zeros.
enum Parsed {
    Good(Frame),
    /// A frame's header with its length right, but the wrong CRC or an impossible value.
    Damaged,
    /// Not even the length of a frame: damaged, or joined in its middle.
    Fragment,
    /// Zeros may stand one behind the other.
    Nothing,
}

fn parse(encoded: &[u8]) -> Parsed {
    if encoded.is_empty() {
        return Parsed::Nothing;
    }
    let Ok(raw) = cobs::decode_vec(encoded) else { return Parsed::Fragment };
    match parse_raw(&raw) {
        None => Parsed::Fragment,
        Some(None) => Parsed::Damaged,
        Some(Some(frame)) => Parsed::Good(frame),
    }
}

/// `None` where the bytes do not have the shape of a frame, `Some(None)` where they have it but are damaged.
fn parse_raw(raw: &[u8]) -> Option<Option<Frame>> {
    let (body, crc) = raw.split_last_chunk::<CRC_BYTES>()?;
    let (&[version, channels], rest) = body.split_first_chunk()?;
    let (sequence, rest) = rest.split_first_chunk()?;
    let (first_us, rest) = rest.split_first_chunk()?;
    let (period_ns, rest) = rest.split_first_chunk()?;
    let (samples, data) = rest.split_first_chunk()?;
    let counts = usize::from(u16::from_le_bytes(*samples)) * usize::from(channels);
    if version != VERSION || data.len() != 2 * counts {
        return None;
    }
    if CRC.checksum(body) != u16::from_le_bytes(*crc) {
        return Some(None);
    }
    let counts = data.chunks_exact(2).map(|b| i16::from_le_bytes([b[0], b[1]])).collect();
    Some(Frame::new(
        u16::from_le_bytes(*sequence),
        u64::from_le_bytes(*first_us),
        u32::from_le_bytes(*period_ns),
        channels,
        counts,
    ))
}

/// What the decoder hands on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Event {
    /// A whole frame with at least one sample, later than the one before it.
    Frame {
        /// The frame.
        frame: Frame,
        /// How many frames are missing before it, by its sequence number.
        lost_before: u32,
        /// When its first byte arrived, ns on the clock of [`Decoder::feed`].
        began_ns: i64,
        /// Its sequence went back while its time went on too little for so many frames to be missing: none is counted as lost, and
        /// the device may have restarted.
        anew: bool,
    },
    /// The device started again: its clock and its sequence began anew with the next frame.
    Restarted,
}

/// What the decoder has seen.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct FrameCounts {
    /// Frames taken.
    pub frames: u64,
    /// Pieces between zeros that were no valid frame (COBS, version, length, CRC), frames with a time that the next one refuted, and
    /// frames from the past, none of the last ones come again, behind which neither the stream nor a restart went on.
    pub bad: u64,
    /// Frames missing by the jumps of the sequence; a bad frame is missing too.
    pub lost: u64,
    /// Frames that came again, or late; dropped.
    pub duplicated: u64,
}

/// Incremental decoder: takes bytes in any split, finds the frames. Memory stays below [`MAX_ENCODED`].
#[derive(Debug, Default)]
pub struct Decoder {
    pieces: Pieces<0, MAX_ENCODED>,
    last: Option<Last>,
    /// Where the last frame would have stood by the one before it, or the one that refuted its time.
    line: Option<Last>,
    /// A frame whose time is off from what its sequence and its arrival say, until the next one confirms it; with its arrival.
    doubtful: Option<(Frame, i64)>,
    /// Frames from the past, in sequence among themselves: late ones, or a device that restarted. Each with its arrival.
    stale: Vec<(Frame, i64)>,
    /// Sequence and time of the last frames taken.
    recent: VecDeque<(u16, u64)>,
    /// Frames missing since the last one handed on, and whether the sequence began anew since.
    lost_before: u32,
    anew: bool,
    counts: FrameCounts,
}

impl Decoder {
    /// A decoder at the start of a stream.
    pub fn new() -> Decoder {
        Decoder::default()
    }

    /// What was seen so far; a frame in doubt is a bad one until it is confirmed, and so is one of a restart.
    pub fn counts(&self) -> FrameCounts {
        let held = self.unrepeated();
        let bad = self.counts.bad + u64::from(self.doubtful.is_some()) + held;
        FrameCounts { bad, duplicated: self.counts.duplicated - held, ..self.counts }
    }

    /// Frames from the past that are none of the last ones come again.
    fn unrepeated(&self) -> u64 {
        let is_new = |(frame, _): &&(Frame, i64)| !self.recent.contains(&(frame.sequence, frame.first_us));
        self.stale.iter().filter(is_new).count() as u64
    }

    /// Frames that were counted as lost were none: the device has restarted.
    pub fn not_lost(&mut self, frames: u32) {
        self.counts.lost = self.counts.lost.saturating_sub(u64::from(frames));
    }

    /// Takes the next bytes of the stream, which arrived at `at_ns` on any clock, and appends what they complete to `events`.
    pub fn feed(&mut self, at_ns: i64, mut bytes: &[u8], events: &mut Vec<Event>) {
        while let Some(piece) = self.pieces.next(at_ns, &mut bytes) {
            let began_ns = piece.began_ns;
            match piece.bytes.map(parse) {
                Some(Parsed::Good(frame)) => self.accept(frame, began_ns, events),
                Some(Parsed::Nothing) => {}
                Some(Parsed::Fragment) if piece.maybe_rest => {}
                Some(Parsed::Damaged | Parsed::Fragment) | None => self.counts.bad += 1,
            }
        }
    }

    /// The stream was cut off: a frame cut with it is a bad one, and what comes next may begin within a frame.
    pub fn cut(&mut self) {
        self.counts.bad += u64::from(self.pieces.cut());
    }

    /// Puts a valid frame in its place behind the last one, or keeps it aside as one from the past or with a doubtful time.
    fn accept(&mut self, frame: Frame, began_ns: i64, events: &mut Vec<Event>) {
        if self.settle(&frame, began_ns, events) {
            self.counts.duplicated += 1;
            return;
        }
        let Some(last) = self.last else {
            self.take(frame, began_ns, events);
            return;
        };
        if frame.first_us <= last.first_us && self.refutes(&frame, began_ns) {
            self.counts.bad += 1;
            return;
        }
        let repeated = frame.sequence == last.sequence;
        if repeated || frame.first_us <= last.first_us {
            self.stale(frame, began_ns, repeated, events);
        } else if last.jumps_to(&frame, began_ns) {
            self.doubtful = Some((frame, began_ns));
        } else {
            self.take(frame, began_ns, events);
        }
    }

    /// True for a frame from before the last one that goes on where that one should have ended: its time was false, though it came late
    /// enough for it to be true. Nothing behind it can be taken until that time has passed.
    fn refutes(&mut self, next: &Frame, began_ns: i64) -> bool {
        let refutes = self.line.is_some_and(|line| {
            let ends_us = line.first_us + line.length_us;
            line.goes_on_with(next) && next.first_us.abs_diff(ends_us) <= line.jitter_us
        });
        if refutes {
            self.line = Some(Last::of(next, began_ns));
        }
        refutes
    }

    /// The frame behind one with a doubtful time goes on from there, or from before it: then the doubtful one is dropped. One from the
    /// past says nothing. True for the doubtful one come again.
    fn settle(&mut self, next: &Frame, next_began_ns: i64, events: &mut Vec<Event>) -> bool {
        let Some((doubtful, began_ns)) = self.doubtful.take() else { return false };
        let Some(last) = self.last else { return false };
        let last_us = last.first_us;
        let again = next.sequence == doubtful.sequence && next.first_us == doubtful.first_us;
        if again || next.first_us <= last_us {
            self.doubtful = Some((doubtful, began_ns));
            return again;
        }
        let (jumped, jump_us) = (Last::of(&doubtful, began_ns), doubtful.first_us - last_us);
        let goes_on = if last.goes_on_with(&doubtful) && jumped.goes_on_with(next) {
            // Nothing is missing: it stands where the doubtful one ends, or where it would end had its time not jumped.
            let true_us = last_us + last.length_us + jumped.length_us;
            let (jumped_us, true_us) =
                (next.first_us.abs_diff(doubtful.first_us + jumped.length_us), next.first_us.abs_diff(true_us));
            next.first_us > doubtful.first_us && jumped_us <= true_us
        } else {
            // A device that samples now and then jumps again and again.
            next.first_us > doubtful.first_us
                && (!jumped.jumps_to(next, next_began_ns) || next.first_us - doubtful.first_us <= jump_us + jump_us / 2)
        };
        if goes_on {
            self.take(doubtful, began_ns, events);
        } else {
            self.counts.bad += 1;
        }
        false
    }

    /// Hands on a frame that is later than the last one.
    fn take(&mut self, frame: Frame, began_ns: i64, events: &mut Vec<Event>) {
        if let Some(last) = self.last {
            if last.begins_anew_with(&frame) {
                self.anew = true;
            } else {
                let lost = missing(&last, &frame, began_ns);
                self.counts.lost += u64::from(lost);
                self.lost_before = self.lost_before.saturating_add(lost);
            }
        }
        self.stale.clear();
        self.recent.push_back((frame.sequence, frame.first_us));
        if self.recent.len() > RECENT {
            self.recent.pop_front();
        }
        self.counts.frames += 1;
        let here = Last::of(&frame, began_ns);
        if frame.samples() == 0 {
            // A sign of life: it has a sequence number, but no sample that its time would be of.
            let before = self.last.unwrap_or(Last { first_us: frame.first_us.saturating_sub(1), ..here });
            self.last = Some(Last { sequence: frame.sequence, length_us: 0, ..before });
            return;
        }
        let before = self.last.filter(|last| last.goes_on_with(&frame));
        self.line = before.map(|last| Last { first_us: last.first_us + last.length_us, ..here });
        self.last = Some(here);
        let lost_before = std::mem::take(&mut self.lost_before);
        events.push(Event::Frame { frame, lost_before, began_ns, anew: std::mem::take(&mut self.anew) });
    }

    /// A frame from the past: late, or sent again; enough of them in sequence are a device that restarted, and none of them is lost.
    fn stale(&mut self, frame: Frame, began_ns: i64, repeated: bool, events: &mut Vec<Event>) {
        self.counts.duplicated += 1;
        if repeated {
            return;
        }
        let follows = |(last, _): &(Frame, i64)| {
            frame.sequence == last.sequence.wrapping_add(1) && frame.first_us > last.first_us
        };
        if !self.stale.last().is_some_and(follows) {
            let lost = self.unrepeated();
            (self.counts.bad, self.counts.duplicated) = (self.counts.bad + lost, self.counts.duplicated - lost);
            self.stale.clear();
        }
        self.stale.push((frame, began_ns));
        if self.stale.len() < RESTART_FRAMES {
            return;
        }
        events.push(Event::Restarted);
        self.counts.bad += u64::from(self.doubtful.take().is_some());
        (self.last, self.line) = (None, None);
        self.recent.clear();
        (self.lost_before, self.anew) = (0, false);
        self.counts.duplicated -= RESTART_FRAMES as u64;
        for (frame, began_ns) in std::mem::take(&mut self.stale) {
            self.take(frame, began_ns, events);
        }
    }
}

#[cfg(test)]
#[path = "frames_tests.rs"]
mod tests;
