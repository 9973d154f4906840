//! Whether the period that a device states is that of its stamps.

use crate::record::wire::frames::frame::Frame;

/// A stated period is reported as wrong from one part in so many on.
const SURE: f64 = 2000.0;

/// The steps between stamps beside the lengths that frames say to have.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct StatedPeriod {
    /// The last stamp and the length stated with it, µs.
    last: Option<(f64, f64)>,
    /// How far off a stamp may be, µs.
    jitter_us: f64,
    /// Sums of the steps and of the lengths stated for them, µs.
    sums_us: (f64, f64),
}

impl StatedPeriod {
    /// Takes a frame that stands by its stamp; `follows` where none is missing before it.
    pub(crate) fn add(&mut self, frame: &Frame, follows: bool) {
        let stamp_us = frame.first_us as f64;
        self.jitter_us = frame.most_jitter_us();
        if let Some((last_us, stated_us)) = self.last.filter(|_| follows) {
            let step_us = stamp_us - last_us;
            if (step_us - stated_us).abs() <= 2.0 * self.jitter_us {
                self.sums_us = (self.sums_us.0 + step_us, self.sums_us.1 + stated_us);
            }
        }
        self.last = Some((stamp_us, frame.length_us()));
    }

    /// What comes next says nothing of the period together with what came last.
    pub(crate) fn interrupt(&mut self) {
        self.last = None;
    }

    /// How much longer frames are by their stamps than they say, and the time over which that was seen, s; 0 where
    /// jitter may be all.
    pub(crate) fn off_s(&self) -> (f64, f64) {
        let (stamped_us, stated_us) = self.sums_us;
        let off_us = stamped_us - stated_us;
        let doubtful = off_us.abs() <= self.jitter_us + stated_us / SURE;
        (if doubtful { 0.0 } else { off_us / 1e6 }, stated_us / 1e6)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames of so many samples with these stamps.
    fn seen(stamps_us: impl Iterator<Item = u64>, stated_ns: u32, samples: usize) -> (f64, f64) {
        let mut period = StatedPeriod::default();
        for stamp_us in stamps_us {
            period.add(&Frame::new(0, stamp_us, stated_ns, 1, vec![0; samples]).unwrap(), true);
        }
        period.off_s()
    }

    /// Frames of 500 samples that say 1 ms, and are 0.997 ms by their stamps.
    #[test]
    fn a_wrong_period_is_told() {
        for (stated_ns, off_s) in [(1_000_000, -39.0 * 1.5e-3), (997_000, 0.0), (996_999, 0.0)] {
            let (found_s, over_s) = seen((0..40).map(|frame| frame * 498_500), stated_ns, 500);
            assert!((found_s - off_s).abs() < 1e-9, "{stated_ns}: {found_s}");
            assert!((over_s - 39.0 * 500.0 * f64::from(stated_ns) / 1e9).abs() < 1e-9);
        }
    }

    #[test]
    fn one_late_stamp_and_a_hole_are_no_wrong_period() {
        let late = |frame: u64| if frame == 50 { 4_000 } else { 0 };
        assert_eq!(seen((0..100).map(|frame| frame * 10_000 + late(frame)), 1_000_000, 10).0, 0.0);
        let hole = |frame: u64| if frame >= 50 { 400_000 } else { 0 };
        assert_eq!(seen((0..100).map(|frame| frame * 10_000 + hole(frame)), 1_000_000, 10), (0.0, 0.98));
    }
}
