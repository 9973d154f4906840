//! The time stamp of a message.

use crate::record::wire::frames::Sent;

/// What a message says of its time.
pub(crate) struct Stamp {
    /// Device time of its first sample, and that at which it was sent, ns.
    pub(crate) device_ns: i64,
    pub(crate) sent_ns: i64,
    /// When its first byte arrived, ns on the host's clock.
    pub(crate) began_ns: i64,
    /// Stated period, ns; 0 where there is none.
    pub(crate) period_ns: i64,
    pub(crate) rows: usize,
    /// Messages missing before it, by their sequence.
    pub(crate) lost: u32,
    /// It is off its place, and so are those behind it: of them, the one that came earliest.
    pub(crate) jump: Option<Sent>,
}
