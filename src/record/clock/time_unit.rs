//! Whether a device's times are in the unit that they are taken for: against their arrival they then run at the right pace.

use crate::rig::TimeUnit;

/// Arrivals that are kept; of more, every other one.
const MOST: usize = 64;
/// Two that are nearer to each other than this are one, ns; more where there are many.
const FIRST_SPACING_NS: i64 = 1_000_000;
/// The recorder judges no shorter stretch while the device goes on, ns: what was in a buffer when its port was opened comes at once.
const SHORTEST_NS: i64 = 2_000_000_000;
/// Nor of fewer arrivals.
const FEWEST: usize = 8;
/// The stretch is cut into so many pieces, which must all agree: a burst and the pause behind it do not.
const PIECES: usize = 4;
/// By so many powers of ten: within a factor of two.
const ALIKE: f64 = 0.3;

/// Arrivals of a device, as far as they tell its pace.
#[derive(Debug, Default)]
pub struct Pace {
    /// Arrival and device time, ns.
    points: Vec<(i64, i64)>,
    spacing_ns: i64,
}

impl Pace {
    /// What the device sent at `device_ns` of its clock came at `host_ns` of ours; true where it is kept. A clock that goes back began anew.
    pub fn arrived(&mut self, device_ns: i64, host_ns: i64) -> bool {
        if self.points.last().is_some_and(|last| device_ns < last.1) {
            self.points.clear();
        }
        self.spacing_ns = self.spacing_ns.max(FIRST_SPACING_NS);
        if self.points.last().is_some_and(|last| host_ns.saturating_sub(last.0) < self.spacing_ns) {
            return false;
        }
        self.points.push((host_ns, device_ns));
        if self.points.len() > MOST {
            let mut at = 0;
            self.points.retain(|_| {
                at += 1;
                at % 2 == 1
            });
            self.spacing_ns *= 2;
        }
        true
    }

    /// The unit that the device's times are more likely in than the one they are read as; `is_over` where no more will come.
    pub fn likely(&self, read_as: TimeUnit, is_over: bool) -> Option<TimeUnit> {
        let (first, last) = (self.points.first()?, self.points.last()?);
        let span_ns = last.0 - first.0;
        if self.points.len() < FEWEST || (span_ns < SHORTEST_NS && !is_over) {
            return None;
        }
        let edge = |piece: usize| {
            let at_ns = first.0 + (span_ns as i128 * piece as i128 / PIECES as i128) as i64;
            self.points.partition_point(|point| point.0 < at_ns).min(self.points.len() - 1)
        };
        // how many of our seconds pass in one of the device's, as a power of ten
        let pace = |piece: usize| {
            let (from, to) = (self.points[edge(piece)], self.points[edge(piece + 1)]);
            ((to.0 - from.0) as f64 / (to.1 - from.1) as f64).log10()
        };
        let is = |unit: &TimeUnit| {
            let expected = (unit.seconds() / read_as.seconds()).log10();
            (0..PIECES).all(|piece| (pace(piece) - expected).abs() < ALIKE)
        };
        TimeUnit::ALL.into_iter().filter(|unit| *unit != read_as).find(is)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a device sends every `step_ms` for so long, in a unit: `came_ms` of the time it was sent at.
    fn judged(step_ms: f64, lasts_s: f64, unit: TimeUnit, came_ms: impl Fn(f64) -> f64) -> Option<TimeUnit> {
        let mut pace = Pace::default();
        let ticks = |ms: f64| (ms * 1e-3 / unit.seconds()).round() as i64;
        let mut found = None;
        for i in 0..(1e3 * lasts_s / step_ms) as usize {
            let sent_ms = i as f64 * step_ms;
            pace.arrived(7_000_000 + 1000 * ticks(sent_ms), (1e6 * came_ms(sent_ms)) as i64);
            found = found.or(pace.likely(TimeUnit::Microseconds, false));
        }
        found
    }

    #[test]
    fn a_wrong_unit_is_known_within_seconds() {
        for unit in [TimeUnit::Milliseconds, TimeUnit::Nanoseconds] {
            for step_ms in [1.0, 10.0, 100.0] {
                assert_eq!(judged(step_ms, 2.6, unit, |ms| ms), Some(unit), "{step_ms} ms");
                assert_eq!(
                    judged(step_ms, 4.0, unit, |ms| (ms / 16.0).ceil() * 16.0),
                    Some(unit),
                    "over USB, {step_ms} ms"
                );
            }
        }
        for unit in [TimeUnit::Seconds, TimeUnit::Milliseconds, TimeUnit::Nanoseconds] {
            assert_eq!(judged(1000.0, 10.0, unit, |ms| ms), Some(unit), "once a second");
        }
    }

    #[test]
    fn a_device_that_is_well_is_not_suspected() {
        let well = |step_ms: f64, came_ms: &dyn Fn(f64) -> f64| {
            assert_eq!(judged(step_ms, 300.0, TimeUnit::Microseconds, came_ms), None, "{step_ms} ms");
        };
        for step_ms in [1.0, 10.0, 1000.0] {
            well(step_ms, &|ms| ms);
            well(step_ms, &|ms| (ms / 16.0).ceil() * 16.0);
            // in bursts of a second, of ten and of a minute, drained at a line's pace
            for burst_ms in [1e3, 1e4, 6e4] {
                for drained in [1e-5, 1e-3, 0.1] {
                    well(step_ms, &|ms| (ms / burst_ms).ceil() * burst_ms + drained * (ms % burst_ms));
                }
            }
            // a buffer of a minute, emptied when the port was opened
            well(step_ms, &|ms| if ms < 6e4 { 1e-3 * ms } else { ms - 6e4 + 60.0 });
        }
    }

    #[test]
    fn a_clock_that_began_anew_is_looked_at_anew() {
        let mut pace = Pace::default();
        let kept = (0..2000).filter(|i| pace.arrived(1_000_000_000 + i * 1_000, i * 1_000_000)).count();
        assert!((MOST..4 * MOST).contains(&kept), "{kept}");
        assert_eq!(pace.likely(TimeUnit::Microseconds, true), Some(TimeUnit::Milliseconds));
        pace.arrived(0, 2_000_000_000);
        assert_eq!(pace.likely(TimeUnit::Microseconds, true), None);
    }
}
