//! What the decoder hands on, and what it counts.

use crate::record::wire::frames::frame::Frame;

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
    /// When its first byte arrived, ns on the clock of [`Decoder::feed`](crate::record::wire::frames::Decoder::feed).
    pub began_ns: i64,
    /// Its sequence went back while its time went on too little for so many frames to be missing: none is counted as
    /// lost, and the device may have restarted.
    pub anew: bool,
    /// Its stamp is off from the place that its sequence gives it, and those behind it agree: it is behind a hole, or
    /// its clock was set. Of those that agree, the one that came earliest.
    pub jump: Option<Sent>,
    /// From which jump of its time on samples are missing before it though no frame is, ns: by how much the stamps of
    /// late were off.
    pub hole_from_ns: i64,
}

/// When a frame was sent, by the device, and when it came.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sent {
    /// Device time of its end, ns.
    pub sent_ns: i64,
    /// When its first byte arrived, ns on the clock of [`Decoder::feed`](crate::record::wire::frames::Decoder::feed).
    pub began_ns: i64,
}

impl Sent {
    pub(super) fn of(frame: &Frame, began_ns: i64) -> Sent {
        let length_ns = i64::from(frame.period_ns).saturating_mul(frame.samples() as i64);
        Sent { sent_ns: ((frame.first_us * 1000) as i64).saturating_add(length_ns), began_ns }
    }

    pub(super) fn early_ns(&self) -> i64 {
        self.sent_ns.saturating_sub(self.began_ns)
    }
}

/// What the decoder has seen.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct FrameCounts {
    /// Frames taken.
    pub frames: u64,
    /// Pieces between zeros that were no valid frame (COBS, version, length, CRC), and frames whose time and place in
    /// the sequence the ones around them refute.
    pub bad: u64,
    /// Frames missing by the jumps of the sequence; a bad frame is missing too.
    pub lost: u64,
    /// Frames that came again, or late; dropped.
    pub duplicated: u64,
    /// Frames taken whose time the ones around them refute: they stand where the sequence puts them.
    pub restamped: u64,
}
