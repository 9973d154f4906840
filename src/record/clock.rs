//! From the device's clock to the recording's: sample times come from the device, never from the moment of arrival.

use super::frames::Frame;
use crate::recording::Gap;

/// Where a frame stands in the recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placed {
    /// Time of its first sample, ns on the recording's clock.
    pub first_ns: i64,
    /// What is missing before it.
    pub gap: Option<Gap>,
}

/// Time 0 is the device time of the first sample of the first frame.
#[derive(Debug, Clone, Copy)]
pub struct DeviceClock {
    origin_us: u64,
    /// Time of the last sample placed and the period in force there, ns.
    last: Option<(i64, i64)>,
}

impl DeviceClock {
    /// A clock that shows 0 at the frame's first sample.
    pub fn starting_at(frame: &Frame) -> DeviceClock {
        DeviceClock { origin_us: frame.first_us(), last: None }
    }

    /// Time just after the last sample, ns: one period behind it; 0 before the first.
    pub fn end_ns(&self) -> i64 {
        self.last.map_or(0, |(last_ns, period_ns)| last_ns + period_ns)
    }

    /// Places the next frame (with at least one sample) behind those before it. `lost_frames` are missing by its sequence number; a
    /// jump of the device time by a whole sample or more is a gap even where the sequence does not jump.
    pub fn place(&mut self, frame: &Frame, lost_frames: u32) -> Placed {
        let period_ns = i64::from(frame.period_ns());
        let device_ns = (frame.first_us() as i64 - self.origin_us as i64) * 1000;
        let mut placed = Placed { first_ns: device_ns, gap: None };
        if let Some((last_ns, _)) = self.last {
            let expected_ns = last_ns + period_ns;
            // A device whose µs clock jitters by more than a period: its samples stay in order, a period apart.
            if device_ns <= last_ns {
                placed.first_ns = expected_ns;
            }
            let missing = (placed.first_ns - expected_ns + period_ns / 2).div_euclid(period_ns);
            if missing > 0 || lost_frames > 0 {
                let samples = u64::try_from(missing).ok().filter(|&n| n > 0);
                placed.gap = Some(Gap { from_s: seconds(last_ns), to_s: seconds(placed.first_ns), samples });
            }
        }
        let steps = frame.samples().saturating_sub(1) as i64;
        self.last = Some((placed.first_ns + steps * period_ns, period_ns));
        placed
    }
}

/// Seconds of a time in ns.
pub fn seconds(time_ns: i64) -> f64 {
    time_ns as f64 / 1e9
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(first_us: u64, samples: usize) -> Frame {
        Frame::new(0, first_us, 500_000, 1, vec![0; samples]).unwrap()
    }

    #[test]
    fn times_are_the_devices_from_its_first_sample() {
        let mut clock = DeviceClock::starting_at(&frame(7_000_000, 4));
        assert_eq!(clock.end_ns(), 0);
        assert_eq!(clock.place(&frame(7_000_000, 4), 0), Placed { first_ns: 0, gap: None });
        // 1 µs of rounding in the device's time is no gap and is not smoothed away.
        assert_eq!(clock.place(&frame(7_002_001, 4), 0), Placed { first_ns: 2_001_000, gap: None });
        assert_eq!(clock.end_ns(), 4_001_000);
    }

    #[test]
    fn a_jump_is_a_gap_between_its_neighbours() {
        let mut clock = DeviceClock::starting_at(&frame(0, 4));
        clock.place(&frame(0, 4), 0);
        let gap = Gap { from_s: 0.0015, to_s: 0.010, samples: Some(16) };
        assert_eq!(clock.place(&frame(10_000, 4), 4).gap, Some(gap));
        // Without a jump of the sequence the device's own clock tells.
        let gap = Gap { from_s: 0.0115, to_s: 0.013, samples: Some(2) };
        assert_eq!(clock.place(&frame(13_000, 4), 0).gap, Some(gap));
        // A lost frame that left no hole in time: how much is missing is unknown.
        let gap = Gap { from_s: 0.0145, to_s: 0.015, samples: None };
        assert_eq!(clock.place(&frame(15_000, 4), 1).gap, Some(gap));
    }

    #[test]
    fn a_jittering_clock_keeps_the_samples_in_order() {
        let mut clock = DeviceClock::starting_at(&frame(0, 4));
        clock.place(&frame(0, 4), 0);
        assert_eq!(clock.place(&frame(1_400, 4), 0), Placed { first_ns: 2_000_000, gap: None });
    }
}
