//! How a recording lies in an MCAP file.
//!
//! - **Attachment** `rig.toml`: the rig file's text, unchanged.
//! - **Metadata** `surgescope.run`: `format`, `start_unix_ns`, `time_zero_ns` (log time of recording time 0),
//!   `program`, `source`, `time_decimals`, and a check sum, for MCAP gives metadata none; `surgescope.note`: one record
//!   a note, with `key` and `value`. In a file that is not finished, `surgescope.clocks`
//!   ([`ClockFix`](crate::storage::ClockFix)).
//! - **Channels**: `/P1` of [`schema::Sample`](crate::storage::schema::Sample) for each sensor up to
//!   [`BLOCK_ABOVE_HZ`], `/P1/blocks` above it, `/P1/gaps` where samples are known to be lost. Their metadata carry the
//!   sensor's name, kind, unit and position, and how its column of an imported time series was written.
//! - **Times**: log time = `time_zero_ns` + recording time in whole nanoseconds. A time between two nanoseconds is
//!   kept as a number in the message as well.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::storage::schema::Kind;

/// Profile in the file header.
pub const PROFILE: &str = "surgescope";
/// Name of the attachment that holds the rig file.
pub const RIG_ATTACHMENT: &str = "rig.toml";
/// Name of the metadata record on the run.
pub const RUN_METADATA: &str = "surgescope.run";
/// Name of the metadata records that each hold one note.
pub const NOTE_METADATA: &str = "surgescope.note";
/// Version of this layout; a reader refuses a higher one.
pub const FORMAT: u32 = 1;
/// Above this rate a sensor's samples go in blocks: a message for each would cost six times the space.
pub const BLOCK_ABOVE_HZ: f64 = 20_000.0;

/// Keys of the run and channel metadata.
pub(crate) mod key {
    pub const FORMAT: &str = "format";
    pub const START: &str = "start_unix_ns";
    pub const TIME_ZERO: &str = "time_zero_ns";
    pub const PROGRAM: &str = "program";
    pub const SOURCE: &str = "source";
    pub const TIME_DECIMALS: &str = "time_decimals";
    pub const CSV: &str = "csv";
    pub const CHECK: &str = "crc32";
    pub const NOTE: &str = "key";
    pub const VALUE: &str = "value";
    pub const SENSOR: &str = "sensor";
    pub const KIND: &str = "kind";
    pub const UNIT: &str = "unit";
    pub const POSITION: &str = "position_m";
    pub const COLUMN: &str = "column";
    pub const DECIMALS: &str = "decimals";
}

/// Check sum of metadata: every time of a recording hangs on one of its entries.
pub(crate) fn check_sum(entries: &BTreeMap<String, String>) -> String {
    let lines = entries.iter().filter(|(k, _)| *k != key::CHECK).map(|(k, v)| format!("{k}={v}\n"));
    let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(lines.collect::<String>().as_bytes());
    format!("{crc:08x}")
}

/// Log time of recording time 0 while a test runs: its start, or, where that is not known, a day after 1970 began: room
/// for times before 0.
pub(crate) fn live_zero_ns(start_unix_ns: u64) -> u64 {
    if start_unix_ns > 0 { start_unix_ns } else { 86_400_000_000_000 }
}

/// Recording time in whole nanoseconds, if it fits; the nearest where it lies between two.
pub(crate) fn to_ns(time_s: f64) -> Option<i64> {
    let ns = (time_s * 1e9).round();
    (ns.abs() < 9.2e18).then_some(ns as i64)
}

/// Recording time of a whole nanosecond, s. The division rounds correctly, so that a decimal number of seconds with
/// up to nine decimals comes back as the same `f64` that its text parses to, up to some weeks.
pub(crate) fn to_s(ns: i64) -> f64 {
    ns as f64 / 1e9
}

/// How samples that come together are written while a test runs: as a block above [`BLOCK_ABOVE_HZ`], else each as a
/// message.
pub fn kind_of(count: usize, period_ns: f64) -> Kind {
    if count > 1 && period_ns < 1e9 / BLOCK_ABOVE_HZ { Kind::Block } else { Kind::Sample }
}

/// Nanoseconds from the first sample of a regular block to its sample `index`.
pub(crate) fn offset_ns(index: usize, period_ns: f64) -> i64 {
    (index as f64 * period_ns).round() as i64
}

/// Those of the `count` samples of a regular block that lie from one time to another, both included; the block's first
/// is at `first_ns`.
pub(crate) fn within(first_ns: i64, period_ns: f64, count: usize, from_ns: i64, to_ns: i64) -> Range<usize> {
    let at = |i: usize| first_ns.saturating_add(offset_ns(i, period_ns));
    let first = (0..count).find(|&i| at(i) >= from_ns).unwrap_or(count);
    let end = (first..count).find(|&i| at(i) > to_ns).unwrap_or(count);
    first..end
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn samples_within_a_window_are_those_at_its_ends_and_between() {
        assert_eq!(within(100, 10.4, 6, 110, 142), 1..5, "at 100, 110, 121, 131, 142 and 152");
        assert_eq!(within(100, 10.0, 6, 0, 1000), 0..6);
        assert_eq!(
            (within(100, 10.0, 6, 151, 160), within(100, 10.0, 6, 0, 99), within(7, 0.0, 1, 7, 7)),
            (6..6, 0..0, 0..1)
        );
        assert_eq!(within(i64::MAX - 5, 10.0, 3, i64::MAX, i64::MAX), 1..3, "beyond all times is at their end");
    }

    proptest! {
        #[test]
        fn decimal_times_survive_the_way_through_nanoseconds(
            micro in -1_000_000_000_000i64..1_000_000_000_000, decimals in 0usize..=9,
        ) {
            let text = format!("{:.decimals$}", micro as f64 / 1e6);
            let time: f64 = text.parse().unwrap();
            prop_assert_eq!(to_s(to_ns(time).unwrap()), time);
        }
    }
}
