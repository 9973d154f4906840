//! Whether a device's times are in the unit that they are taken for: against their arrival they then run at the right
//! pace.

use crate::rig::TimeUnit;

/// Arrivals that are kept; of more, every other one.
const MOST: usize = 64;
/// Two that are nearer to each other than this are one, ns; more where there are many.
const FIRST_SPACING_NS: i64 = 1_000_000;
/// The recorder judges no shorter stretch while the device goes on, ns: what was in a buffer when its port was opened
/// comes at once.
const SHORTEST_NS: i64 = 2_000_000_000;
/// Nor of fewer arrivals.
const FEWEST: usize = 8;
/// The stretch is cut into so many pieces, which must all agree: a burst and the pause behind it do not.
const PIECES: usize = 4;
/// By so many powers of ten: within a factor of two.
const ALIKE: f64 = 0.3;
/// An arrival is not known better than this, ns: computers and USB adapters hand on what came once a millisecond.
const ARRIVAL_NS: f64 = 1e6;
/// No device's clock is off by more than this share: what shows more is no clock in that unit.
const MOST_OFF: f64 = 0.05;
/// Student's t that chance exceeds once in a thousand times, for two, three and four pieces.
const STUDENT_T: [f64; 3] = [318.0, 22.3, 10.2];

/// How a device's times run against their arrival.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Runs {
    /// So few arrivals, or such uneven ones, that not even a factor of ten would show.
    Unknown,
    /// As fast as they arrive, as far as the arrivals tell.
    Evenly,
    /// So many times as fast as they arrive, and by which factor that may be wrong. The mean of the pieces' paces, as
    /// powers of ten, is further from 0 than chance puts it once in a thousand times (Student's t over the pieces), and
    /// than a clock may drift.
    Off {
        /// Device seconds in one of ours.
        times: f64,
        /// One standard error, as a factor.
        within: f64,
    },
}

/// Arrivals of a device, as far as they tell its pace.
#[derive(Debug, Default)]
pub struct Pace {
    /// Arrival and device time, ns.
    points: Vec<(i64, i64)>,
    spacing_ns: i64,
}

impl Pace {
    /// What the device sent at `device_ns` of its clock came at `host_ns` of ours; true where it is kept. A clock that
    /// goes back began anew.
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

    /// The clock began anew, or was set: what was before says nothing of what comes.
    pub fn begin_anew(&mut self) {
        self.points.clear();
    }

    /// The unit that the device's times are more likely in than the one they are read as; `is_over` where no more will
    /// come.
    pub fn likely(&self, read_as: TimeUnit, is_over: bool) -> Option<TimeUnit> {
        let (paces, piece_ns) = self.pieces()?;
        let is_known = match is_over {
            true => matches!(self.runs(), Runs::Off { .. }),
            false => self.points.len() >= FEWEST && piece_ns * PIECES as f64 >= SHORTEST_NS as f64,
        };
        let is = |unit: &TimeUnit| {
            let expected = (unit.seconds() / read_as.seconds()).log10();
            paces.iter().all(|pace| (pace - expected).abs() < ALIKE)
        };
        TimeUnit::ALL.into_iter().filter(|unit| is_known && *unit != read_as).find(is)
    }

    /// How the times run against their arrival, by all that came.
    pub fn runs(&self) -> Runs {
        let Some((paces, piece_ns)) = self.pieces() else { return Runs::Unknown };
        let n = paces.len() as f64;
        let mean = paces.iter().sum::<f64>() / n;
        let variance = paces.iter().map(|pace| (pace - mean).powi(2)).sum::<f64>() / (n - 1.0);
        // as a power of ten
        let arrival = (1.0 + ARRIVAL_NS / piece_ns).log10();
        let error = variance.sqrt().max(arrival) / n.sqrt();
        let by_chance = STUDENT_T[paces.len() - 2] * error;
        match mean.abs() {
            off if off > by_chance.max((1.0 + MOST_OFF).log10()) => {
                Runs::Off { times: 10_f64.powf(-mean), within: 10_f64.powf(error) }
            }
            _ if by_chance < 1.0 => Runs::Evenly,
            _ => Runs::Unknown,
        }
    }

    /// How many of our seconds pass in one of the device's, as a power of ten, in each of equal pieces of the time, and
    /// how long one is, ns. None where one of them holds no arrival.
    fn pieces(&self) -> Option<(Vec<f64>, f64)> {
        let (first, last) = (self.points.first()?, self.points.last()?);
        let pieces = (self.points.len() - 1).min(PIECES);
        if pieces < 2 {
            return None;
        }
        let span_ns = last.0 - first.0;
        let edge = |piece: usize| {
            let at_ns = first.0 + (span_ns as i128 * piece as i128 / pieces as i128) as i64;
            let next = self.points.partition_point(|point| point.0 < at_ns).clamp(1, self.points.len() - 1);
            let (before, after) = (self.points[next - 1], self.points[next]);
            if at_ns - before.0 < after.0 - at_ns { before } else { after }
        };
        let pace = |piece: usize| {
            let (from, to) = (edge(piece), edge(piece + 1));
            ((to.0 - from.0) as f64 / (to.1 - from.1) as f64).log10()
        };
        let paces: Vec<f64> = (0..pieces).map(pace).collect();
        paces.iter().all(|pace| pace.is_finite()).then_some((paces, span_ns as f64 / pieces as f64))
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

    /// How a device whose clock is `times` as fast as ours runs that sends every `step_ms` for so long, each line up to
    /// `late_ms` late.
    fn runs(step_ms: f64, lasts_s: f64, times: f64, late_ms: f64, seed: u64) -> Runs {
        let mut dice = fastrand::Rng::with_seed(seed);
        let (mut pace, mut before) = (Pace::default(), 0);
        for i in 0..=(1e3 * lasts_s / step_ms).round() as usize {
            let sent_ms = i as f64 * step_ms;
            before = before.max((1e6 * (sent_ms + late_ms * dice.f64())) as i64);
            pace.arrived(5_000_000_000 + (1e6 * sent_ms * times) as i64, before);
        }
        pace.runs()
    }

    #[test]
    fn a_clock_that_is_off_is_known_at_the_end_however_short() {
        for (step_ms, lasts_s) in [(5.0, 0.1), (5.0, 10.0), (1.0, 0.05), (100.0, 1.0), (1000.0, 4.0)] {
            for times in [1e-6, 1e-3, 0.1, 10.0, 1e3] {
                for seed in 0..20 {
                    let found = runs(step_ms, lasts_s, times, 0.5, seed);
                    let Runs::Off { times: found, within } = found else {
                        panic!("{step_ms} ms, {lasts_s} s, {times}: {found:?}")
                    };
                    let off = (found / times).log10().abs();
                    assert!(off < 4.0 * within.log10(), "{step_ms} ms, {lasts_s} s, {times}: {found} within {within}");
                }
            }
        }
        // in ten seconds even a tenth shows
        assert!(matches!(runs(5.0, 10.0, 1.1, 0.5, 1), Runs::Off { .. }));
        assert_eq!(runs(1000.0, 1.0, 1e3, 0.0, 1), Runs::Unknown, "two arrivals");
    }

    #[test]
    fn chance_makes_no_clock_off() {
        for (step_ms, late_ms) in [(1.0, 16.0), (5.0, 4.0), (10.0, 30.0), (100.0, 80.0)] {
            for lasts_s in [0.5, 2.0, 20.0] {
                let off = |seed| matches!(runs(step_ms, lasts_s, 1.0001, late_ms, seed), Runs::Off { .. });
                let alarms = (0..500).filter(|seed| off(*seed)).count();
                assert!(alarms <= 2, "{step_ms} ms, {late_ms} ms late, {lasts_s} s: {alarms} of 500");
            }
        }
    }
}
