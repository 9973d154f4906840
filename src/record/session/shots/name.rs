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

/// The file name of a shot, but for its ending: rig, start (UTC), number.
pub fn stem(rig: &str, start_unix_ns: u64, number: usize) -> String {
    let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '-' };
    let rig: String = rig.chars().map(plain).collect();
    let when =
        DateTime::from_timestamp_nanos(i64::try_from(start_unix_ns).unwrap_or(i64::MAX)).format("%Y%m%dT%H%M%SZ");
    format!("{}-{when}-{number:03}", rig.trim_start_matches('.'))
}
