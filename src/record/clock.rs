//! From the device's clock to the recording's: sample times come from the device, never from the moment of arrival.

use crate::recording::Gap;

/// Where rows of samples stand in the recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placed {
    /// Time of the first, ns on the recording's clock.
    pub first_ns: i64,
    /// What is missing before it.
    pub gap: Option<Gap>,
}

/// A device time and the recording time that it stands for.
#[derive(Debug, Clone, Copy)]
pub struct DeviceClock {
    device_ns: i64,
    recording_ns: i64,
    /// Time of the last sample placed and the period in force there, ns.
    last: Option<(i64, i64)>,
    /// The clock began anew: how much is missing before the next sample is unknown.
    anew: bool,
}

impl DeviceClock {
    /// A clock that shows `recording_ns` at the device time `device_ns`.
    pub fn starting_at(device_ns: i64, recording_ns: i64) -> DeviceClock {
        DeviceClock { device_ns, recording_ns, last: None, anew: false }
    }

    /// The device's clock began anew: `device_ns` is now `recording_ns`, or just after the last sample where that is later.
    /// Returns the recording time.
    pub fn restart(&mut self, device_ns: i64, recording_ns: i64) -> i64 {
        self.device_ns = device_ns;
        self.recording_ns = recording_ns.max(self.end_ns());
        self.anew = true;
        self.recording_ns
    }

    /// Time just after the last sample, ns: one period behind it; the start before the first.
    pub fn end_ns(&self) -> i64 {
        self.last.map_or(self.recording_ns, |(last_ns, period_ns)| last_ns + period_ns)
    }

    /// Time of the last sample, ns.
    pub fn last_ns(&self) -> Option<i64> {
        self.last.map(|(last_ns, _)| last_ns)
    }

    /// Places rows, `period_ns` apart, behind those before them. `lost` rows or frames are known to be missing; a jump of the
    /// device time by a whole sample or more is a gap even where nothing is known to be.
    pub fn place(&mut self, device_ns: i64, period_ns: u32, rows: usize, lost: bool) -> Placed {
        let period_ns = i64::from(period_ns);
        let time_ns = device_ns.saturating_sub(self.device_ns).saturating_add(self.recording_ns);
        let mut placed = Placed { first_ns: time_ns, gap: None };
        if let Some((last_ns, _)) = self.last {
            let expected_ns = last_ns + period_ns;
            // A device whose µs clock jitters by more than a period: its samples stay in order, a period apart.
            if time_ns <= last_ns {
                placed.first_ns = expected_ns;
            }
            let missing = (placed.first_ns - expected_ns + period_ns / 2).div_euclid(period_ns);
            if missing > 0 || lost || self.anew {
                let known = u64::try_from(missing).ok().filter(|&n| n > 0 && !self.anew);
                placed.gap = Some(Gap { from_s: seconds(last_ns), to_s: seconds(placed.first_ns), samples: known });
            }
        }
        self.anew = false;
        let steps = rows.saturating_sub(1) as i64;
        self.last = Some((placed.first_ns + steps * period_ns, period_ns));
        placed
    }

    /// Places one row of a device without a fixed period: only a known hole is a gap. `None` for a time that is not after the
    /// last one.
    pub fn place_row(&mut self, device_ns: i64, hole: bool) -> Option<Placed> {
        let first_ns = device_ns.saturating_sub(self.device_ns).saturating_add(self.recording_ns);
        let mut placed = Placed { first_ns, gap: None };
        let mut step_ns = 1;
        if let Some((last_ns, _)) = self.last {
            if first_ns <= last_ns {
                return None;
            }
            if hole || self.anew {
                placed.gap = Some(Gap { from_s: seconds(last_ns), to_s: seconds(first_ns), samples: None });
            } else {
                step_ns = first_ns - last_ns;
            }
        }
        self.anew = false;
        self.last = Some((first_ns, step_ns));
        Some(placed)
    }
}

/// Seconds of a time in ns.
pub fn seconds(time_ns: i64) -> f64 {
    time_ns as f64 / 1e9
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_NS: u32 = 500_000;

    fn place(clock: &mut DeviceClock, first_us: i64, lost: bool) -> Placed {
        clock.place(first_us * 1000, PERIOD_NS, 4, lost)
    }

    #[test]
    fn times_are_the_devices_from_its_first_sample() {
        let mut clock = DeviceClock::starting_at(7_000_000_000, 0);
        assert_eq!(clock.end_ns(), 0);
        assert_eq!(place(&mut clock, 7_000_000, false), Placed { first_ns: 0, gap: None });
        // 1 µs of rounding in the device's time is no gap and is not smoothed away.
        assert_eq!(place(&mut clock, 7_002_001, false), Placed { first_ns: 2_001_000, gap: None });
        assert_eq!(clock.end_ns(), 4_001_000);
    }

    #[test]
    fn a_jump_is_a_gap_between_its_neighbours() {
        let mut clock = DeviceClock::starting_at(0, 0);
        place(&mut clock, 0, false);
        let gap = Gap { from_s: 0.0015, to_s: 0.010, samples: Some(16) };
        assert_eq!(place(&mut clock, 10_000, true).gap, Some(gap));
        // Without a jump of the sequence the device's own clock tells.
        let gap = Gap { from_s: 0.0115, to_s: 0.013, samples: Some(2) };
        assert_eq!(place(&mut clock, 13_000, false).gap, Some(gap));
        // A lost frame that left no hole in time: how much is missing is unknown.
        let gap = Gap { from_s: 0.0145, to_s: 0.015, samples: None };
        assert_eq!(place(&mut clock, 15_000, true).gap, Some(gap));
    }

    #[test]
    fn a_jittering_clock_keeps_the_samples_in_order() {
        let mut clock = DeviceClock::starting_at(0, 0);
        place(&mut clock, 0, false);
        assert_eq!(place(&mut clock, 1_400, false), Placed { first_ns: 2_000_000, gap: None });
    }

    #[test]
    fn a_clock_that_began_anew_goes_on_behind_the_last_sample() {
        let mut clock = DeviceClock::starting_at(9_000_000_000, 0);
        place(&mut clock, 9_000_000, false);
        assert_eq!(clock.restart(5_000, 300_000_000), 300_000_000);
        let gap = Gap { from_s: 0.0015, to_s: 0.3, samples: None };
        assert_eq!(place(&mut clock, 5, false), Placed { first_ns: 300_000_000, gap: Some(gap) });
        assert_eq!(clock.restart(0, 1), 302_000_000, "no time comes twice");
    }

    #[test]
    fn rows_stand_at_their_own_times() {
        let mut clock = DeviceClock::starting_at(1_000, 0);
        assert_eq!(clock.place_row(1_000, false), Some(Placed { first_ns: 0, gap: None }));
        assert_eq!(clock.place_row(1_000, false), None);
        assert_eq!(clock.place_row(9_000, false), Some(Placed { first_ns: 8_000, gap: None }));
        assert_eq!(clock.end_ns(), 16_000);
        let gap = Gap { from_s: 8e-6, to_s: 29e-6, samples: None };
        assert_eq!(clock.place_row(30_000, true), Some(Placed { first_ns: 29_000, gap: Some(gap) }));
    }
}
