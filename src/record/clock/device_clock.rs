//! From the device's clock to the recording's: sample times come from the device, never from the moment of arrival.

use crate::recording::Gap;

/// Whether samples are missing before some that are placed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Missing {
    /// Where their time jumps by at least this, ns, and by half a sample.
    From(i64),
    /// Rows or frames are known to be.
    Surely,
}

/// Where rows of samples stand in the recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placed {
    /// Time of the first, ns on the recording's clock.
    pub first_ns: i64,
    /// From one to the next, ns.
    pub period_ns: f64,
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
    /// Frames that began before the one before them ended.
    squeezed: u64,
}

impl DeviceClock {
    /// A clock that shows `recording_ns` at the device time `device_ns`.
    pub fn starting_at(device_ns: i64, recording_ns: i64) -> DeviceClock {
        DeviceClock { device_ns, recording_ns, last: None, anew: false, squeezed: 0 }
    }

    /// The device's clock began anew: `device_ns` is now `recording_ns`, or just after the last sample where that is
    /// later. Returns the recording time.
    pub fn restart(&mut self, device_ns: i64, recording_ns: i64) -> i64 {
        self.recording_ns = recording_ns.max(self.end_ns());
        self.device_ns = device_ns;
        self.anew = true;
        self.recording_ns
    }

    /// The device's clock was set forward by so much, ns; nothing is missing.
    pub fn step(&mut self, by_ns: i64) {
        self.recording_ns = self.recording_ns.saturating_sub(by_ns);
    }

    /// Recording time of a device time, ns.
    pub fn at_ns(&self, device_ns: i64) -> i64 {
        device_ns.saturating_sub(self.device_ns).saturating_add(self.recording_ns)
    }

    /// Time just after the last sample, ns: one period behind it; the start before the first.
    pub fn end_ns(&self) -> i64 {
        self.last.map_or(self.recording_ns, |(last_ns, period_ns)| last_ns + period_ns)
    }

    /// Time of the last sample, ns.
    pub fn last_ns(&self) -> Option<i64> {
        self.last.map(|(last_ns, _)| last_ns)
    }

    /// Frames that began before the one before them ended.
    pub fn squeezed(&self) -> u64 {
        self.squeezed
    }

    /// Places rows, `period_ns` apart, behind those before them.
    ///
    /// The stamp holds. Where a frame begins before the last one ends its samples share the time that is left until its
    /// own end, so that neither a stated period that is too long nor a stamp that was late once moves what comes later.
    pub fn place(&mut self, device_ns: i64, period_ns: u32, rows: usize, missing: Missing) -> Placed {
        let period_ns = i64::from(period_ns);
        let stated_ns = period_ns.saturating_mul(rows as i64);
        let time_ns = self.at_ns(device_ns);
        let mut placed = Placed { first_ns: time_ns, period_ns: period_ns as f64, gap: None };
        if let Some((last_ns, _)) = self.last {
            if time_ns <= last_ns {
                self.squeezed += 1;
                let left_ns = (time_ns + stated_ns - period_ns - last_ns) as f64 / rows.max(1) as f64;
                placed.period_ns = left_ns.clamp(period_ns as f64 / 2.0, period_ns as f64).max(1.0);
                placed.first_ns = last_ns + placed.period_ns.round() as i64;
            }
            let ahead_ns = placed.first_ns - last_ns - period_ns;
            let is_hole = matches!(missing, Missing::From(least_ns) if ahead_ns >= least_ns);
            let jumped = (ahead_ns + period_ns / 2).div_euclid(period_ns);
            if (jumped > 0 && is_hole) || missing == Missing::Surely || self.anew {
                let known = u64::try_from(jumped).ok().filter(|&n| n > 0 && !self.anew);
                placed.gap = Some(Gap { from_s: seconds(last_ns), to_s: seconds(placed.first_ns), samples: known });
            }
        }
        self.anew = false;
        let steps = rows.saturating_sub(1) as f64;
        self.last = Some((placed.first_ns + (steps * placed.period_ns).round() as i64, period_ns));
        placed
    }

    /// Places one row of a device without a fixed period: only a known hole is a gap. `None` for a time that is not
    /// after the last one.
    pub fn place_row(&mut self, device_ns: i64, hole: bool) -> Option<Placed> {
        let first_ns = self.at_ns(device_ns);
        let mut placed = Placed { first_ns, period_ns: 0.0, gap: None };
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
        clock.place(first_us * 1000, PERIOD_NS, 4, if lost { Missing::Surely } else { Missing::From(0) })
    }

    fn placed(first_ns: i64, gap: Option<Gap>) -> Placed {
        Placed { first_ns, period_ns: f64::from(PERIOD_NS), gap }
    }

    #[test]
    fn times_are_the_devices_from_its_first_sample() {
        let mut clock = DeviceClock::starting_at(7_000_000_000, 0);
        assert_eq!(clock.end_ns(), 0);
        assert_eq!(place(&mut clock, 7_000_000, false), placed(0, None));
        // 1 µs of rounding in the device's time is no gap and is not smoothed away.
        assert_eq!(place(&mut clock, 7_002_001, false), placed(2_001_000, None));
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
    fn a_jittering_clock_keeps_the_samples_in_order_and_the_stamps_hold() {
        let mut clock = DeviceClock::starting_at(0, 0);
        place(&mut clock, 0, false);
        // the stamp is 0.6 ms early: four samples share the time from 1.5 ms to 2.9 ms
        assert_eq!(place(&mut clock, 1_400, false), Placed { first_ns: 1_850_000, period_ns: 350_000.0, gap: None });
        assert_eq!(clock.last_ns(), Some(2_900_000));
        assert_eq!(place(&mut clock, 4_000, false).first_ns, 4_000_000, "the next stamp holds again");
        assert_eq!(clock.squeezed(), 1);
    }

    /// Frames of 500 samples that say 1 ms, and are 0.997 ms by their stamps.
    #[test]
    fn a_wrong_period_does_not_run_away_from_the_stamps() {
        for stated_ns in [1_000_000, 997_000, 996_999] {
            let mut clock = DeviceClock::starting_at(0, 0);
            for frame in 0..40 {
                let placed = clock.place(frame * 498_500_000, stated_ns, 500, Missing::From(0));
                let ahead_ns = placed.first_ns - frame * 498_500_000;
                assert!((0..2_000_000).contains(&ahead_ns) && placed.gap.is_none(), "frame {frame}: {placed:?}");
            }
        }
    }

    /// One stamp in a hundred is 4 ms late, and the next true again.
    #[test]
    fn a_stamp_that_was_late_once_does_not_move_what_comes_later() {
        let mut clock = DeviceClock::starting_at(0, 0);
        for frame in 0..100 {
            let late_ns = if frame == 50 { 4_000_000 } else { 0 };
            let placed = clock.place(frame * 10_000_000 + late_ns, 1_000_000, 10, Missing::From(0));
            let ahead_ns = placed.first_ns - frame * 10_000_000;
            let most_ns = if (50..52).contains(&frame) { 5_000_000 } else { 0 };
            assert!((0..=most_ns).contains(&ahead_ns), "frame {frame}: {ahead_ns}");
        }
        assert_eq!(clock.squeezed(), 1);
    }

    #[test]
    fn a_step_of_the_clock_is_taken_out() {
        let mut clock = DeviceClock::starting_at(9_000_000_000, 0);
        place(&mut clock, 9_000_000, false);
        clock.step(3_000_000_000);
        assert_eq!(place(&mut clock, 12_002_000, false), placed(2_000_000, None));
        assert_eq!(clock.at_ns(12_002_000_000), 2_000_000);
    }

    #[test]
    fn a_clock_that_began_anew_goes_on_behind_the_last_sample() {
        let mut clock = DeviceClock::starting_at(9_000_000_000, 0);
        place(&mut clock, 9_000_000, false);
        assert_eq!(clock.restart(5_000, 300_000_000), 300_000_000);
        let gap = Gap { from_s: 0.0015, to_s: 0.3, samples: None };
        assert_eq!(place(&mut clock, 5, false), placed(300_000_000, Some(gap)));
        assert_eq!(clock.restart(0, 1), 302_000_000, "no time comes twice");
    }

    #[test]
    fn rows_stand_at_their_own_times() {
        let row = |first_ns, gap| Placed { first_ns, period_ns: 0.0, gap };
        let mut clock = DeviceClock::starting_at(1_000, 0);
        assert_eq!(clock.place_row(1_000, false), Some(row(0, None)));
        assert_eq!(clock.place_row(1_000, false), None);
        assert_eq!(clock.place_row(9_000, false), Some(row(8_000, None)));
        assert_eq!(clock.end_ns(), 16_000);
        let gap = Gap { from_s: 8e-6, to_s: 29e-6, samples: None };
        assert_eq!(clock.place_row(30_000, true), Some(row(29_000, Some(gap))));
    }
}
