//! A device's clock against the host's: the line below all arrivals.
//!
//! Bytes never arrive before they are sent, but often later. So the true relation of the clocks is the line that lies
//! below every arrival and as near to them as it can: the edge of their lower convex hull over the mean device time
//! minimises the sum of the distances (Moon, Skelly & Towsley 1999, "Estimation and removal of clock skew from network
//! delay measurements", IEEE INFOCOM). A constant delay between sample and arrival cannot be seen; bursts of delay,
//! however many and long, do no harm.

use crate::robust::{median, sd_about};

/// Most points kept; when there are more, neighbours become one.
const MOST_POINTS: usize = 1024;
/// First width of the stretch that a point stands for, ns.
const FIRST_WIDTH_NS: i64 = 10_000_000;
/// Below this span of device time the drift is not known well enough to use.
const SPAN_FOR_DRIFT_NS: i64 = 5_000_000_000;
/// A drift is known where it is this many times its standard error, or where that is below [`SURE_DRIFT`].
const DRIFT_ERRORS: f64 = 3.0;
/// No quartz is further off than this: what shows more must be this many times its error, in so many of the pieces, and
/// make more of a difference over the span, by this much, than half of the arrivals scatter and than a frame. For where
/// a device's frames and a line that is asked for them in a rhythm of its own beat, delays slide by up to a frame.
const QUARTZ_DRIFT: f64 = 1e-4;
const LARGE_DRIFT: (f64, usize) = (10.0, 8);
const LARGE_SLIDE: f64 = 2.0;
/// Better than crystals keep among themselves.
const SURE_DRIFT: f64 = 2e-6;
/// The span is cut into so many pieces, and the least delay of each looked at, to know how well the drift is known.
const PIECES: usize = 16;
/// A piece of which nothing came sooner after the line is late, and a half of which nothing did belongs to no stream in
/// real time, unless the largest drift explains it, ns.
const LATE_NS: f64 = 50e6;
/// A burst is shorter than this, ns, and a piece of fewer arrivals says nothing.
const SHORTEST_PIECE_NS: i64 = 1_000_000_000;
const IN_A_PIECE: u64 = 8;
/// No device clock is this far off: what shows more is no stream in real time.
const MOST_DRIFT: f64 = 0.05;

/// Arrivals of one device, as few as the fit needs.
#[derive(Debug, Clone)]
pub struct ClockFit {
    /// Device time and delay against it (arrival − device time), ns, from the first arrival's.
    points: Vec<(i64, i64)>,
    origin: Option<(i64, i64)>,
    width_ns: i64,
    seen: u64,
}

/// Host time = `host_ns` + `rate` × (device time − `device_ns`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClockLine {
    /// A device time, ns.
    pub device_ns: i64,
    /// The host time then, ns.
    pub host_ns: f64,
    /// Host seconds a device second.
    pub rate: f64,
    /// Whether the drift is the fit's; else the span was too short for the scatter of the arrivals, or the stream ran
    /// not in real time, and the rate is 1.
    pub drift_known: bool,
    /// How far the arrivals lie above the line, ns: their median, and the value that 95% do not exceed.
    pub residual_ns: (f64, f64),
    /// False for a stream that is played faster or slower than in real time, or whose clock was set and nobody noticed:
    /// the line says nothing of when its samples were taken. Bursts and stalls do no harm.
    pub is_real_time: bool,
    /// The least that a sixteenth of the time (a second at least) came late after the line, ns, for the worst of them,
    /// and the share of those that came more than 50 ms late: bursts come on time with their ends, a clock that was set
    /// does not.
    pub late: (f64, f64),
}

impl ClockLine {
    /// Host time of a device time, ns.
    pub fn host_at(&self, device_ns: i64) -> f64 {
        self.host_ns + self.rate * (device_ns - self.device_ns) as f64
    }
}

impl Default for ClockFit {
    fn default() -> ClockFit {
        ClockFit { points: Vec::new(), origin: None, width_ns: FIRST_WIDTH_NS, seen: 0 }
    }
}

impl ClockFit {
    /// Takes an arrival: what was sent at `device_ns` came at `host_ns`. One from before the last, as a stamp that
    /// scatters, says nothing.
    pub fn add(&mut self, device_ns: i64, host_ns: i64) {
        self.seen += 1;
        let (device_0, host_0) = *self.origin.get_or_insert((device_ns, host_ns));
        if self.points.last().is_some_and(|last| device_ns.saturating_sub(device_0) < last.0) {
            return;
        }
        let device = device_ns.saturating_sub(device_0);
        let point = (device, host_ns.saturating_sub(host_0).saturating_sub(device));
        match self.points.last_mut() {
            Some(last) if last.0.div_euclid(self.width_ns) == device.div_euclid(self.width_ns) => {
                keep_least(last, point)
            }
            _ => self.points.push(point),
        }
        if self.points.len() > MOST_POINTS {
            self.width_ns *= 2;
            let width = self.width_ns;
            self.points.dedup_by(|next, kept| {
                let same = next.0.div_euclid(width) == kept.0.div_euclid(width);
                if same {
                    keep_least(kept, *next);
                }
                same
            });
        }
    }

    /// The line; `None` before the first arrival.
    pub fn line(&self) -> Option<ClockLine> {
        let (device_ns, host_0) = self.origin?;
        let (first, last) = (self.points.first()?, self.points.last()?);
        let hull = lower_hull(&self.points);
        let mean = self.points.iter().map(|p| p.0 as f64).sum::<f64>() / self.points.len() as f64;
        let edge = hull.windows(2).find(|edge| edge[1].0 as f64 >= mean);
        let drift = edge.map_or(0.0, |e| (e[1].1 - e[0].1) as f64 / (e[1].0 - e[0].0) as f64);
        let span_ns = last.0 - first.0;
        let frame_ns = span_ns as f64 / self.seen as f64;
        let slides = || drift.abs() * span_ns as f64 > LARGE_SLIDE * frame_ns.max(residuals_ns(&self.points, drift).0);
        let pieces =
            (span_ns / SHORTEST_PIECE_NS).min((self.seen / IN_A_PIECE) as i64).clamp(1, PIECES as i64) as usize;
        let drift_known = span_ns >= SPAN_FOR_DRIFT_NS
            && drift.abs() <= MOST_DRIFT
            && is_sure(&self.points, drift)
            && (drift.abs() <= QUARTZ_DRIFT || slides());
        let drift = if drift_known { drift } else { 0.0 };
        let above = |p: &(i64, i64)| p.1 as f64 - drift * p.0 as f64;
        let offset = self.points.iter().map(above).fold(f64::INFINITY, f64::min);
        let nearest = |half: &[(i64, i64)]| half.iter().map(above).fold(f64::INFINITY, f64::min) - offset;
        let (early, late) = self.points.split_at(self.points.partition_point(|p| p.0 <= first.0 + span_ns / 2));
        let near_ns = LATE_NS.max(MOST_DRIFT * span_ns as f64 / 2.0);
        let is_real_time = [early, late].iter().all(|half| half.is_empty() || nearest(half) <= near_ns);
        let late: Vec<f64> = least_delays(&self.points, drift, pieces).iter().map(|delay| delay - offset).collect();
        let share_late = late.iter().filter(|late| **late > LATE_NS).count() as f64 / late.len() as f64;
        Some(ClockLine {
            device_ns,
            host_ns: host_0 as f64 + offset,
            rate: 1.0 + drift,
            drift_known,
            residual_ns: residuals_ns(&self.points, drift),
            is_real_time,
            late: (late.into_iter().fold(0.0, f64::max), share_late),
        })
    }

    /// Arrivals taken.
    pub fn seen(&self) -> u64 {
        self.seen
    }
}

/// How far points lie above the lowest line of a drift, ns: their median, and the value that 95% do not exceed.
fn residuals_ns(points: &[(i64, i64)], drift: f64) -> (f64, f64) {
    let mut above: Vec<f64> = points.iter().map(|p| p.1 as f64 - drift * p.0 as f64).collect();
    above.sort_by(f64::total_cmp);
    let share = |q: f64| above[((above.len() - 1) as f64 * q).round() as usize] - above[0];
    (share(0.5), share(0.95))
}

/// Whether a drift is known. Its standard error is that of a straight line through the least delays of as many pieces
/// of the span, whose scatter is taken from their median distance to their median, so that a piece in which everything
/// was late says nothing.
fn is_sure(points: &[(i64, i64)], drift: f64) -> bool {
    let (Some(first), Some(last)) = (points.first(), points.last()) else { return false };
    let mut least = least_delays(points, drift, PIECES);
    let middle = median(&mut least);
    let scatter = sd_about(middle, &least);
    // evenly spaced points: the variance of their places is span²/12
    let error = scatter * (12.0 / least.len() as f64).sqrt() / (last.0 - first.0) as f64;
    let (times, pieces) = if drift.abs() > QUARTZ_DRIFT { LARGE_DRIFT } else { (DRIFT_ERRORS, 1) };
    least.len() >= pieces && error <= SURE_DRIFT.max(drift.abs() / times)
}

/// The least delay in each of so many equal pieces of the span that something came in.
fn least_delays(points: &[(i64, i64)], drift: f64, pieces: usize) -> Vec<f64> {
    let (Some(first), Some(last)) = (points.first(), points.last()) else { return Vec::new() };
    let mut least = vec![f64::INFINITY; pieces];
    for point in points {
        let piece = ((point.0 - first.0) as i128 * pieces as i128 / (last.0 - first.0 + 1) as i128) as usize;
        least[piece] = least[piece].min(point.1 as f64 - drift * point.0 as f64);
    }
    least.retain(|delay| delay.is_finite());
    least
}

/// The earlier of two arrivals stands for both.
fn keep_least(kept: &mut (i64, i64), next: (i64, i64)) {
    if next.1 < kept.1 {
        *kept = next;
    }
}

/// Lower convex hull of points in the order of their first number (Andrew 1979).
fn lower_hull(points: &[(i64, i64)]) -> Vec<(i64, i64)> {
    let mut hull: Vec<(i64, i64)> = Vec::new();
    for &point in points {
        while let [.., a, b] = hull[..] {
            let cross =
                i128::from(b.0 - a.0) * i128::from(point.1 - a.1) - i128::from(b.1 - a.1) * i128::from(point.0 - a.0);
            if cross > 0 {
                break;
            }
            hull.pop();
        }
        if hull.last().is_none_or(|last| last.0 < point.0) {
            hull.push(point);
        }
    }
    hull
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Arrivals of a device with a drift: each delayed at random (exponentially, 0.3 ms), one in `burst` by up to 200
    /// ms.
    fn arrivals(seconds: u32, drift: f64, burst: u32, seed: u64) -> ClockFit {
        let mut dice = fastrand::Rng::with_seed(seed);
        let mut fit = ClockFit::default();
        for index in 0..100 * i64::from(seconds) {
            let device_ns = 7_000_000_000 + index * 10_000_000;
            let delay = -300_000.0 * (1.0 - dice.f64()).ln();
            let stall = if dice.u32(..burst) == 0 { dice.f64() * 200e6 } else { 0.0 };
            let true_ns = 55e9 + (1.0 + drift) * (device_ns - 7_000_000_000) as f64;
            fit.add(device_ns, (true_ns + delay + stall) as i64);
        }
        fit
    }

    #[test]
    fn offset_and_drift_are_found_under_delays_and_stalls() {
        for (seed, drift, burst) in [(1, 80e-6, 50), (2, -90e-6, 3), (3, 5e-3, 10), (4, 0.0, 2)] {
            let line = arrivals(60, drift, burst, seed).line().unwrap();
            assert!(line.drift_known);
            assert!((line.rate - 1.0 - drift).abs() < 2e-6, "seed {seed}: drift {} for {drift}", line.rate - 1.0);
            for at_s in [0.0, 30.0, 60.0] {
                let truth = 55e9 + (1.0 + drift) * at_s * 1e9;
                let error_us = (line.host_at(7_000_000_000 + (at_s * 1e9) as i64) - truth) / 1e3;
                assert!(error_us.abs() < 50.0, "seed {seed}, {at_s} s: {error_us} µs");
            }
            assert!(line.residual_ns.0 > 0.0 && line.residual_ns.0 < line.residual_ns.1);
        }
    }

    /// Frames every 10 ms that come late by 4 ms on average, as over a busy USB hub: a few seconds cannot tell tens of
    /// millionths.
    fn late(seconds: i64, drift: f64, seed: u64) -> ClockLine {
        let mut dice = fastrand::Rng::with_seed(seed);
        let mut fit = ClockFit::default();
        let mut before = 0;
        for index in 0..100 * seconds {
            let delay = -4e6 * (1.0 - dice.f64()).ln() + 0.2e6 * dice.f64();
            // one frame after the other
            before = before.max((index as f64 * 1e7 * (1.0 + drift) + delay) as i64);
            fit.add(index * 10_000_000, before);
        }
        fit.line().unwrap()
    }

    #[test]
    fn a_drift_within_its_own_error_is_not_known() {
        let taken = (0..200).filter(|&seed| late(6, 0.0, seed).rate != 1.0 && late(6, 0.0, seed).drift_known).count();
        assert!(taken <= 20, "{taken} of 200 perfect clocks seemed to drift");
        for seed in 0..50 {
            let line = late(60, 2e-3, seed);
            assert!(line.drift_known && (line.rate - 1.002).abs() < 2e-5, "seed {seed}: {line:?}");
            let line = late(600, 50e-6, seed);
            assert!(line.drift_known && (line.rate - 1.00005).abs() < 5e-6, "seed {seed}: {line:?}");
        }
    }

    #[test]
    fn a_day_takes_no_more_memory_than_a_minute() {
        let mut fit = ClockFit::default();
        for index in 0..86_400 * 20 {
            let device_ns = index * 50_000_000;
            fit.add(device_ns, device_ns + device_ns / 50_000 + (index * 7919) % 400_000);
        }
        assert!(fit.points.len() <= MOST_POINTS + 1 && fit.seen() == 86_400 * 20);
        let line = fit.line().unwrap();
        assert!((line.rate - 1.0 - 20e-6).abs() < 1e-8, "{}", line.rate - 1.0);
    }

    /// Frames of 10 ms fetched every 20.01 ms, and of 16 ms fetched every 16.003 ms: a beat, and no drift.
    #[test]
    fn a_line_that_is_asked_in_a_rhythm_of_its_own_is_no_drift() {
        for (frame_us, fetched_us) in [(10_000, 20_010), (16_000, 16_003), (10_000, 9_993)] {
            let mut fit = ClockFit::default();
            for index in 1..=20_000_000 / frame_us {
                let came_us: i64 = (index * frame_us + fetched_us - 1) / fetched_us * fetched_us;
                fit.add(index * frame_us * 1000, came_us * 1000 + (index * 7919) % 97_000);
            }
            let line = fit.line().unwrap();
            assert!((line.rate - 1.0).abs() < 1e-4, "{frame_us}, {fetched_us}: {line:?}");
        }
    }

    #[test]
    fn a_stamp_from_before_the_last_says_nothing() {
        let mut fit = arrivals(20, 0.0, 50, 1);
        let line = fit.line().unwrap();
        fit.add(7_000_000_000 + 5_000_000_000, 0);
        assert_eq!((fit.line().unwrap().host_ns, fit.line().unwrap().rate), (line.host_ns, line.rate));
    }

    #[test]
    fn a_short_stream_and_one_out_of_real_time_have_no_drift() {
        assert_eq!(ClockFit::default().line(), None);
        let line = arrivals(2, 80e-6, 50, 1).line().unwrap();
        assert!(!line.drift_known && line.rate == 1.0);
        let mut fit = ClockFit::default();
        (0..1000).for_each(|i| fit.add(i * 10_000_000, i * 1_000_000));
        assert_eq!(fit.line().unwrap().rate, 1.0, "ten times as fast as real time");
    }
}
