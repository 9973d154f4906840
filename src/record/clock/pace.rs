//! Playing recorded time against the wall clock.

use std::thread;
use std::time::{Duration, Instant};

/// How long a sleeper goes without looking whether it is still wanted.
const NAP: Duration = Duration::from_millis(50);

/// Plays time from now on at a chosen speed.
#[derive(Debug, Clone, Copy)]
pub struct Pace {
    started: Instant,
    speed: f64,
}

impl Pace {
    /// Starts now; `speed` 1 is real time, 2 twice as fast, 0 as fast as possible.
    pub fn start(speed: f64) -> Pace {
        Pace { started: Instant::now(), speed }
    }

    /// Sleeps until `played_ns` have passed at this pace; false as soon as it is no longer wanted.
    pub fn wait_until(&self, played_ns: i64, wanted: impl Fn() -> bool) -> bool {
        let due = match self.speed {
            speed if speed > 0.0 => {
                Duration::try_from_secs_f64(played_ns.max(0) as f64 / 1e9 / speed).unwrap_or(Duration::MAX)
            }
            _ => Duration::ZERO,
        };
        loop {
            if !wanted() {
                return false;
            }
            let left = due.saturating_sub(self.started.elapsed());
            if left.is_zero() {
                return true;
            }
            thread::sleep(left.min(NAP));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pace_keeps_time_and_can_be_left() {
        let started = Instant::now();
        assert!(Pace::start(10.0).wait_until(500_000_000, || true));
        assert!(started.elapsed() >= Duration::from_millis(50));
        assert!(Pace::start(0.0).wait_until(i64::MAX, || true));
        assert!(!Pace::start(1e-300).wait_until(i64::MAX, || false));
    }
}
