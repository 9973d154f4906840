//! The `frames` wire protocol: bytes to frames and back, without any I/O.
//!
//! | file | what it does |
//! | --- | --- |
//! | `frame` | one frame and its bytes on the wire |
//! | `event` | what the decoder hands on |
//! | `resequencer` | valid frames in their order: repeated, missing, restarted, or with a false stamp |
//! | `timestamp_filter` | where the next frame should stand, by the stamps before it |
//! | `period` | whether the stated sample period is that of the stamps |

pub(crate) mod event;
pub(crate) mod frame;
pub(crate) mod period;
pub(crate) mod resequencer;
pub(crate) mod timestamp_filter;

pub use crate::record::wire::frames::event::{Event, FrameCounts, Sent, Taken};
pub use crate::record::wire::frames::frame::{Frame, MAX_ENCODED};

use crate::record::wire::frames::frame::{Parsed, parse};
use crate::record::wire::frames::resequencer::Resequencer;
use crate::record::wire::pieces::Pieces;

/// Incremental decoder: takes bytes in any split, finds the frames. Memory stays below [`MAX_ENCODED`].
#[derive(Debug, Default)]
pub struct Decoder {
    pieces: Pieces<0, MAX_ENCODED>,
    resequencer: Resequencer,
}

impl Decoder {
    /// A decoder at the start of a stream.
    pub fn new() -> Decoder {
        Decoder::default()
    }

    /// What was seen so far; a frame in doubt is a bad one until it is believed.
    pub fn counts(&self) -> FrameCounts {
        self.resequencer.counts()
    }

    /// Standard deviation of the device's stamps, s; `None` where they hold as they are.
    pub fn stamps_scatter_s(&self) -> Option<f64> {
        self.resequencer.stamps_scatter_s()
    }

    /// How much longer the device's frames are by its stamps than they say, and the time over which that was seen, s; 0
    /// where jitter may be all.
    pub fn period_off_s(&self) -> (f64, f64) {
        self.resequencer.period_off_s()
    }

    /// Frames that were counted as lost were none: the device has restarted.
    pub fn not_lost(&mut self, frames: u32) {
        let counts = &mut self.resequencer.counts;
        counts.lost = counts.lost.saturating_sub(u64::from(frames));
    }

    /// No more will come: hands on what was held until more would have come, and can only be behind a hole.
    pub fn finish(&mut self, events: &mut Vec<Event>) {
        self.resequencer.finish(events);
    }

    /// Takes the next bytes of the stream, which arrived at `at_ns` on any clock, and appends what they complete to
    /// `events`.
    pub fn feed(&mut self, at_ns: i64, mut bytes: &[u8], events: &mut Vec<Event>) {
        while let Some(piece) = self.pieces.next(at_ns, &mut bytes) {
            let began_ns = piece.began_ns;
            match piece.bytes.map(parse) {
                Some(Parsed::Good(frame)) => self.resequencer.accept(frame, began_ns, events),
                Some(Parsed::Nothing) => {}
                Some(Parsed::Fragment) if piece.maybe_rest => {}
                Some(Parsed::Damaged | Parsed::Fragment) | None => self.resequencer.counts.bad += 1,
            }
        }
    }

    /// Another stream begins, which we hear from its first byte on: its sequence and its clock begin anew.
    pub fn begin_anew(&mut self) {
        self.pieces = Pieces::default();
        self.resequencer.begin_anew();
    }

    /// The stream was cut off: a frame cut with it is a bad one, and what comes next may begin within a frame.
    pub fn cut(&mut self) {
        self.resequencer.counts.bad += u64::from(self.pieces.cut());
    }
}

#[cfg(test)]
mod tests;
