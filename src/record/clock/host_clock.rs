//! The host's clock.

use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// A clock that shows an earlier day than this was never set: 2026-01-01, when this program was written, ns since 1970
/// UTC. Computers without a battery, such as a Raspberry Pi, begin in 1970.
const NEVER_SET_BEFORE_NS: u64 = 1_767_225_600_000_000_000;

/// The host's clock: runs evenly whatever happens to the time of day.
#[derive(Debug, Clone, Copy)]
pub struct HostClock {
    started: Instant,
    /// None where the time of day is not known.
    started_unix_ns: Option<u64>,
}

impl HostClock {
    /// A clock that shows 0 now.
    pub fn start() -> HostClock {
        HostClock::showing(SystemTime::now())
    }

    fn showing(now: SystemTime) -> HostClock {
        let since = now.duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos() as u64;
        HostClock { started: Instant::now(), started_unix_ns: Some(since).filter(|ns| *ns >= NEVER_SET_BEFORE_NS) }
    }

    /// Whether the time of day is known.
    pub fn is_set(&self) -> bool {
        self.started_unix_ns.is_some()
    }

    /// The time of an instant, ns.
    pub fn at_ns(&self, instant: Instant) -> i64 {
        instant.saturating_duration_since(self.started).as_nanos() as i64
    }

    /// The time now, ns.
    pub fn now_ns(&self) -> i64 {
        self.at_ns(Instant::now())
    }

    /// The time of day of a time of this clock, ns since 1970 UTC; 0 where it is not known.
    pub fn unix_ns(&self, host_ns: i64) -> u64 {
        self.started_unix_ns.map_or(0, |started| started.saturating_add_signed(host_ns))
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn a_clock_that_was_never_set_gives_no_date() {
        for seconds in [0, 86_400, 1_700_000_000] {
            let clock = HostClock::showing(UNIX_EPOCH + Duration::from_secs(seconds));
            assert!(!clock.is_set() && clock.unix_ns(1_000_000_000) == 0);
        }
        let clock = HostClock::showing(UNIX_EPOCH + Duration::from_secs(1_800_000_000));
        assert!(clock.is_set());
        assert_eq!(clock.unix_ns(5), 1_800_000_000_000_000_005);
    }
}
