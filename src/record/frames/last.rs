//! What the last frame says of the next one: where its time should stand, and whether frames are missing between.

use super::Frame;
use crate::record::clock::most_jitter_ns;

/// Where frames are missing by the sequence, a time further ahead than it and the host's clock allow, by this share and this much, is
/// doubted: µs.
const DOUBT: (u64, u64) = (2, 50_000);

/// The last frame taken.
#[derive(Debug, Clone, Copy)]
pub(super) struct Last {
    pub(super) sequence: u16,
    pub(super) first_us: u64,
    /// Length of a frame, µs.
    pub(super) length_us: u64,
    /// How far the next stamp may be off from its end, µs.
    pub(super) jitter_us: u64,
    /// When the frame that `first_us` is of began to arrive, ns.
    pub(super) began_ns: i64,
}

impl Last {
    pub(super) fn of(frame: &Frame, began_ns: i64) -> Last {
        let length_us = u64::from(frame.period_ns) * frame.samples() as u64 / 1000;
        let jitter_us = most_jitter_ns(i64::from(frame.period_ns), frame.samples()) as u64 / 1000;
        Last { sequence: frame.sequence, first_us: frame.first_us, length_us, jitter_us, began_ns }
    }

    /// Time on the host's clock since it came, µs.
    pub(super) fn elapsed_us(&self, began_ns: i64) -> u64 {
        u64::try_from(began_ns.saturating_sub(self.began_ns)).unwrap_or(0) / 1000
    }

    /// True for the frame that comes behind this one by the sequence.
    pub(super) fn goes_on_with(&self, next: &Frame) -> bool {
        self.length_us > 0 && next.sequence == self.sequence.wrapping_add(1)
    }

    /// True for a later frame whose time is ahead of both what the sequence and what the host's clock say, or that begins within this one.
    pub(super) fn jumps_to(&self, next: &Frame, began_ns: i64) -> bool {
        let step_us = next.first_us - self.first_us;
        let elapsed_us = self.elapsed_us(began_ns);
        if self.goes_on_with(next) {
            let most_us = elapsed_us.max(self.length_us).saturating_add(self.jitter_us);
            return step_us > most_us || step_us < self.length_us.saturating_sub(self.jitter_us);
        }
        let step = u64::from(next.sequence.wrapping_sub(self.sequence));
        let allowed_us = elapsed_us.max(step.saturating_mul(self.length_us));
        step_us > DOUBT.0.saturating_mul(allowed_us) + DOUBT.1
    }

    /// True where the sequence went back, and more frames would be missing by it than fit into the hole.
    pub(super) fn begins_anew_with(&self, next: &Frame) -> bool {
        let missing = u64::from(next.sequence.wrapping_sub(self.sequence)) - 1;
        let hole_us = next.first_us.saturating_sub(self.first_us + self.length_us);
        next.sequence < self.sequence && missing.saturating_mul(self.length_us) > DOUBT.0 * hole_us + DOUBT.1
    }
}

/// Frames missing between two, by the sequence; where it wrapped unseen in a long hole, the device's time tells how often, unless the
/// sequence goes on and the arrivals know of no such hole: then its clock was set.
pub(super) fn missing(last: &Last, next: &Frame, began_ns: i64) -> u32 {
    let by_sequence = u64::from(next.sequence.wrapping_sub(last.sequence) - 1);
    let mut hole_us = next.first_us.saturating_sub(last.first_us + last.length_us);
    if last.goes_on_with(next) {
        hole_us = hole_us.min(last.elapsed_us(began_ns));
    }
    let by_time = hole_us.checked_div(last.length_us).unwrap_or(0);
    let wraps = (by_time.saturating_sub(by_sequence) + (1 << 15)) >> 16;
    u32::try_from(by_sequence + (wraps << 16)).unwrap_or(u32::MAX)
}
