//! One frame, and its bytes on the wire.
//!
//! A frame is COBS-encoded and ended by a zero byte. Inside, little endian: u8 version (1), u8 channels n, u16 sequence
//! (wraps), u64 device time of the first sample (µs), u32 sample period (ns), u16 samples m, m × n i16 interleaved by
//! channel, u16 CRC-16/IBM-3740 over all before it.

use crc::{CRC_16_IBM_3740, Crc};

const VERSION: u8 = 1;
const HEADER: usize = 18;
const CRC_BYTES: usize = 2;
const CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_IBM_3740);

/// Longest encoded frame taken, bytes. A stream without a zero for longer than this is no `frames` stream.
pub const MAX_ENCODED: usize = 1 << 20;

/// Device times beyond this, µs (146 000 years), would not fit the recording's i64 nanoseconds.
pub(super) const MAX_DEVICE_US: u64 = (i64::MAX / 2000) as u64;

/// One frame: `samples()` samples of each of `channels()` channels, `period_ns()` apart.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    pub(super) sequence: u16,
    pub(super) first_us: u64,
    pub(super) period_ns: u32,
    pub(super) channels: u8,
    pub(super) counts: Vec<i16>,
}

impl Frame {
    /// A frame of `counts` interleaved by channel; `None` where the wire format cannot hold it (no channels, a ragged
    /// or too long block, a period of 0, a time beyond what a recording can hold).
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
    pub(super) fn length_us(&self) -> f64 {
        f64::from(self.period_ns) * self.samples() as f64 / 1e3
    }

    /// How far its stamp may lie from where the samples before it end, without a hole and without a step of the clock,
    /// before more is known: three periods, and never less than 2 ms, as clocks that tick are off. µs.
    pub(super) fn most_jitter_us(&self) -> f64 {
        (3.0 * f64::from(self.period_ns) / 1e3).max(2_000.0)
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
pub(super) enum Parsed {
    Good(Frame),
    /// A frame's header with its length right, but the wrong CRC or an impossible value.
    Damaged,
    /// Not even the length of a frame: damaged, or joined in its middle.
    Fragment,
    /// Zeros may stand one behind the other.
    Nothing,
}

/// Reads the bytes between two zeros.
pub(super) fn parse(encoded: &[u8]) -> Parsed {
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
