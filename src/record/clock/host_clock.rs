//! The host's clock.

use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// The host's clock: runs evenly whatever happens to the time of day.
#[derive(Debug, Clone, Copy)]
pub struct HostClock {
    started: Instant,
    started_unix_ns: u64,
}

impl HostClock {
    /// A clock that shows 0 now.
    pub fn start() -> HostClock {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        HostClock { started: Instant::now(), started_unix_ns: since.as_nanos() as u64 }
    }

    /// The time of an instant, ns.
    pub fn at_ns(&self, instant: Instant) -> i64 {
        instant.saturating_duration_since(self.started).as_nanos() as i64
    }

    /// The time now, ns.
    pub fn now_ns(&self) -> i64 {
        self.at_ns(Instant::now())
    }

    /// The time of day of a time of this clock, ns since 1970 UTC.
    pub fn unix_ns(&self, host_ns: i64) -> u64 {
        self.started_unix_ns.saturating_add_signed(host_ns)
    }
}
