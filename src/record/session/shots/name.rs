//! File names of shots, and errors when one cannot be made.

use chrono::DateTime;

use crate::storage::LogError;

/// Names that are tried for a shot.
pub(crate) const MOST_COPIES: u32 = 1000;

/// Another file has the name.
pub(crate) fn is_taken(error: &LogError) -> bool {
    match error {
        LogError::Exists(_) => true,
        LogError::Io { source, .. } => source.kind() == std::io::ErrorKind::AlreadyExists,
        _ => false,
    }
}

/// An error with its causes.
pub(crate) fn with_causes(error: &dyn std::error::Error) -> String {
    let causes = std::iter::successors(Some(error), |error| error.source());
    causes.map(ToString::to_string).collect::<Vec<_>>().join(": ")
}

/// The file name of a shot, but for its ending: rig, start (UTC) where it is known, number.
pub fn stem(rig: &str, start_unix_ns: u64, number: usize) -> String {
    let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '-' };
    let rig: String = rig.chars().map(plain).collect();
    let date = |ns| DateTime::from_timestamp_nanos(ns).format("%Y%m%dT%H%M%SZ").to_string();
    let when = match i64::try_from(start_unix_ns).unwrap_or(i64::MAX) {
        0 => "undated".to_owned(),
        ns => date(ns),
    };
    format!("{}-{when}-{number:03}", rig.trim_start_matches('.'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shot_is_named_by_its_start_where_that_is_known() {
        assert_eq!(stem("a rig", 1_800_000_000_000_000_000, 7), "a-rig-20270115T080000Z-007");
        assert_eq!(stem("rig", 0, 12), "rig-undated-012");
    }
}
