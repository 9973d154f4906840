//! The `frames` wire protocol: bytes to frames and back, without any I/O.
//!
//! A frame is COBS-encoded and ended by a zero byte. Inside, little endian: u8 version (1), u8 channels n, u16 sequence
//! (wraps), u64 device time of the first sample (µs), u32 sample period (ns), u16 samples m, m × n i16 interleaved by
//! channel, u16 CRC-16/IBM-3740 over all before it.

pub(crate) mod order;
pub(crate) mod period;
pub(crate) mod rhythm;

use crc::{CRC_16_IBM_3740, Crc};

use crate::record::wire::frames::order::Order;
use crate::record::wire::pieces::Pieces;

const VERSION: u8 = 1;
const HEADER: usize = 18;
const CRC_BYTES: usize = 2;
const CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_IBM_3740);

/// Longest encoded frame taken, bytes. A stream without a zero for longer than this is no `frames` stream.
pub const MAX_ENCODED: usize = 1 << 20;

/// Device times beyond this, µs (146 000 years), would not fit the recording's i64 nanoseconds.
const MAX_DEVICE_US: u64 = (i64::MAX / 2000) as u64;

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

    /// Its length as it says, µs.
    fn length_us(&self) -> f64 {
        f64::from(self.period_ns) * self.samples() as f64 / 1e3
    }

    /// How far its stamp may lie from where the samples before it end, without a hole and without a step of the clock: three periods, half a
    /// frame up to 20 ms, a twentieth of a frame (of whose period the device may be wrong), and never less than 2 ms, as clocks that tick
    /// are off. µs.
    fn most_jitter_us(&self) -> f64 {
        let (period_us, length_us) = (f64::from(self.period_ns) / 1e3, self.length_us());
        (3.0 * period_us).max((length_us / 2.0).min(20_000.0)).max(length_us / 20.0).max(2_000.0)
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
    pub(crate) fn encode_with_wrong_crc(&self) -> Vec<u8> {
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
    Frame(Taken),
    /// The device started again: its clock and its sequence began anew with the next frame.
    Restarted,
}

/// A frame in its place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Taken {
    /// The frame.
    pub frame: Frame,
    /// How many frames are missing before it, by its sequence number.
    pub lost_before: u32,
    /// When its first byte arrived, ns on the clock of [`Decoder::feed`].
    pub began_ns: i64,
    /// Its sequence went back while its time went on too little for so many frames to be missing: none is counted as lost, and the device may
    /// have restarted.
    pub anew: bool,
    /// Its stamp is off from the place that its sequence gives it, and those behind it agree: it is behind a hole, or its clock was set. Of
    /// those that agree, the one that came earliest.
    pub jump: Option<Sent>,
    /// From which jump of its time on samples are missing before it though no frame is, ns: by how much the stamps of late were off.
    pub hole_from_ns: i64,
}

/// When a frame was sent, by the device, and when it came.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sent {
    /// Device time of its end, ns.
    pub sent_ns: i64,
    /// When its first byte arrived, ns on the clock of [`Decoder::feed`].
    pub began_ns: i64,
}

impl Sent {
    fn of(frame: &Frame, began_ns: i64) -> Sent {
        let length_ns = i64::from(frame.period_ns).saturating_mul(frame.samples() as i64);
        Sent { sent_ns: ((frame.first_us * 1000) as i64).saturating_add(length_ns), began_ns }
    }

    fn early_ns(&self) -> i64 {
        self.sent_ns.saturating_sub(self.began_ns)
    }
}

/// What the decoder has seen.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct FrameCounts {
    /// Frames taken.
    pub frames: u64,
    /// Pieces between zeros that were no valid frame (COBS, version, length, CRC), and frames whose time and place in the sequence the ones
    /// around them refute.
    pub bad: u64,
    /// Frames missing by the jumps of the sequence; a bad frame is missing too.
    pub lost: u64,
    /// Frames that came again, or late; dropped.
    pub duplicated: u64,
    /// Frames taken whose time the ones around them refute: they stand where the sequence puts them.
    pub restamped: u64,
}

/// Incremental decoder: takes bytes in any split, finds the frames. Memory stays below [`MAX_ENCODED`].
#[derive(Debug, Default)]
pub struct Decoder {
    pieces: Pieces<0, MAX_ENCODED>,
    order: Order,
}

impl Decoder {
    /// A decoder at the start of a stream.
    pub fn new() -> Decoder {
        Decoder::default()
    }

    /// What was seen so far; a frame in doubt is a bad one until it is believed.
    pub fn counts(&self) -> FrameCounts {
        self.order.counts()
    }

    /// Standard deviation of the device's stamps, s; `None` where they hold as they are.
    pub fn stamps_scatter_s(&self) -> Option<f64> {
        self.order.stamps_scatter_s()
    }

    /// How much longer the device's frames are by its stamps than they say, and the time over which that was seen, s; 0 where jitter may be all.
    pub fn period_off_s(&self) -> (f64, f64) {
        self.order.period_off_s()
    }

    /// Frames that were counted as lost were none: the device has restarted.
    pub fn not_lost(&mut self, frames: u32) {
        let counts = &mut self.order.counts;
        counts.lost = counts.lost.saturating_sub(u64::from(frames));
    }

    /// No more will come: hands on what was held until more would have come, and can only be behind a hole.
    pub fn finish(&mut self, events: &mut Vec<Event>) {
        self.order.finish(events);
    }

    /// Takes the next bytes of the stream, which arrived at `at_ns` on any clock, and appends what they complete to `events`.
    pub fn feed(&mut self, at_ns: i64, mut bytes: &[u8], events: &mut Vec<Event>) {
        while let Some(piece) = self.pieces.next(at_ns, &mut bytes) {
            let began_ns = piece.began_ns;
            match piece.bytes.map(parse) {
                Some(Parsed::Good(frame)) => self.order.accept(frame, began_ns, events),
                Some(Parsed::Nothing) => {}
                Some(Parsed::Fragment) if piece.maybe_rest => {}
                Some(Parsed::Damaged | Parsed::Fragment) | None => self.order.counts.bad += 1,
            }
        }
    }

    /// The stream was cut off: a frame cut with it is a bad one, and what comes next may begin within a frame.
    pub fn cut(&mut self) {
        self.order.counts.bad += u64::from(self.pieces.cut());
    }
}

#[cfg(test)]
mod tests;
