//! How one sensor does: its last seconds in bins, of which each sample only moves a few sums. Times are the
//! recording's.
//!
//! *Noise* is what moves faster than the pipe can: the scatter about a straight line in stretches that are short
//! against the pipe's period, the median over the last of them, so that neither a surge nor its fronts are taken for
//! noise.

use std::collections::VecDeque;

use crate::rig::limits::Ends;

/// Length of a bin, ns, and how many of them are kept: ten seconds.
pub const BIN_NS: i64 = 100_000_000;
/// See [`BIN_NS`].
pub const BINS: usize = 100;
/// Bins of the last second.
const SECOND: i64 = 1_000_000_000 / BIN_NS;
/// Stretches over which the noise's median is taken; fewer samples in one than this say nothing.
const STRETCHES: usize = 32;
const LEAST_SAMPLES: u32 = 8;
/// Stretches are a bin's length divided by a power of two up to this.
const FINEST: i64 = 256;

/// What fell into a bin.
#[derive(Debug, Clone, Copy)]
struct Bin {
    number: i64,
    samples: u32,
    least: f64,
    most: f64,
    sum: f64,
    at_low: u32,
    at_high: u32,
}

/// A stretch of the noise: sums of (value − first value) for the scatter about a straight line.
#[derive(Debug, Clone, Copy, Default)]
struct Stretch {
    number: i64,
    samples: u32,
    first: f64,
    sum: f64,
    square: f64,
    moment: f64,
}

impl Stretch {
    fn add(&mut self, values: &[f64]) {
        if self.samples == 0 {
            self.first = values.first().copied().unwrap_or_default();
        }
        for value in values {
            let x = value - self.first;
            self.sum += x;
            self.square += x * x;
            self.moment += x * f64::from(self.samples);
            self.samples += 1;
        }
    }

    /// Standard deviation about the least-squares line through evenly spaced samples.
    fn scatter(&self) -> Option<f64> {
        if self.samples < LEAST_SAMPLES {
            return None;
        }
        let n = f64::from(self.samples);
        let along = self.moment - self.sum * (n - 1.0) / 2.0;
        let left = self.square - self.sum * self.sum / n - along * along / (n * (n * n - 1.0) / 12.0);
        Some((left.max(0.0) / (n - 2.0)).sqrt())
    }
}

/// The last seconds of one sensor.
#[derive(Debug, Clone)]
pub struct SensorHealth {
    /// Where it saturates.
    pub ends: Ends,
    /// Samples so far.
    pub samples: u64,
    /// Gaps so far.
    pub gaps: u64,
    bins: VecDeque<Bin>,
    stretch: Stretch,
    stretch_ns: i64,
    scatter: VecDeque<f64>,
    last: Option<(i64, f64)>,
    /// Since when, and for how many samples, the value has not moved at all.
    still: (i64, u64),
}

impl SensorHealth {
    /// A sensor in a pipe of this period (4L/a).
    pub fn new(ends: Ends, period_s: f64) -> SensorHealth {
        // a sixteenth of a sine is a straight line but for 1% of its amplitude
        let wanted_ns = period_s * 1e9 / 16.0;
        let parts = (BIN_NS as f64 / wanted_ns).ceil().clamp(1.0, FINEST as f64) as u64;
        SensorHealth {
            ends,
            samples: 0,
            gaps: 0,
            bins: VecDeque::with_capacity(BINS + 1),
            stretch: Stretch::default(),
            stretch_ns: BIN_NS / parts.next_power_of_two() as i64,
            scatter: VecDeque::with_capacity(STRETCHES + 1),
            last: None,
            still: (0, 0),
        }
    }

    /// Takes samples, `period_ns` apart, the first at `first_ns`.
    pub fn take(&mut self, first_ns: i64, period_ns: f64, values: &[f64]) {
        let (mut taken, mut at_ns) = (0, first_ns);
        while let Some(rest) = values.get(taken..).filter(|rest| !rest.is_empty()) {
            let number = at_ns.div_euclid(self.stretch_ns);
            let left_ns = (number + 1) * self.stretch_ns - at_ns;
            let count = if period_ns >= 1.0 { (left_ns as f64 / period_ns).ceil() as usize } else { rest.len() };
            let count = count.clamp(1, rest.len());
            let last_ns = at_ns + ((count - 1) as f64 * period_ns) as i64;
            self.piece(number, last_ns, &rest[..count]);
            taken += count;
            at_ns = first_ns + (taken as f64 * period_ns).round() as i64;
        }
        self.samples += values.len() as u64;
    }

    /// Samples are missing: what comes next does not go on from the last one.
    pub fn gap(&mut self) {
        self.gaps += 1;
        self.stretch.samples = 0;
        self.still.1 = 0;
    }

    /// Samples within one stretch.
    fn piece(&mut self, number: i64, last_ns: i64, values: &[f64]) {
        if number != self.stretch.number || self.stretch.samples == 0 {
            if let Some(scatter) = self.stretch.scatter() {
                self.scatter.truncate(STRETCHES - 1);
                self.scatter.push_front(scatter);
            }
            self.stretch = Stretch { number, ..Stretch::default() };
        }
        self.stretch.add(values);
        let ends = self.ends;
        let bin = self.bin(last_ns.div_euclid(BIN_NS));
        for &value in values {
            bin.least = bin.least.min(value);
            bin.most = bin.most.max(value);
            bin.sum += value;
            bin.at_low += u32::from(value <= ends.low);
            bin.at_high += u32::from(value >= ends.high);
        }
        bin.samples += values.len() as u32;
        let Some(&value) = values.last() else { return };
        let moved = self.last.is_none_or(|(_, before)| values.iter().any(|v| *v != before));
        self.still =
            if moved || self.still.1 == 0 { (last_ns, 1) } else { (self.still.0, self.still.1 + values.len() as u64) };
        self.last = Some((last_ns, value));
    }

    fn bin(&mut self, number: i64) -> &mut Bin {
        if self.bins.back().is_none_or(|bin| bin.number < number) {
            if self.bins.len() == BINS {
                self.bins.pop_front();
            }
            let (least, most) = (f64::INFINITY, f64::NEG_INFINITY);
            self.bins.push_back(Bin { number, samples: 0, least, most, sum: 0.0, at_low: 0, at_high: 0 });
        }
        let last = self.bins.len() - 1;
        &mut self.bins[last]
    }

    /// Mean of the newest bin.
    pub fn level(&self) -> Option<f64> {
        self.bins.back().map(|bin| bin.sum / f64::from(bin.samples))
    }

    /// Largest magnitude of the last seconds.
    pub fn magnitude(&self) -> f64 {
        self.bins.iter().map(|bin| bin.least.abs().max(bin.most.abs())).fold(0.0, f64::max)
    }

    /// Samples a second: over the last two full seconds, or as far back as it takes for a slow sensor.
    pub fn rate_hz(&self) -> Option<f64> {
        let (newest, oldest) = (self.bins.back()?.number, self.bins.front()?.number);
        // the first and the newest bin are not full
        let over = |bins: i64| {
            let from = (newest - bins).max(oldest + 1);
            let within = self.bins.iter().filter(|bin| (from..newest).contains(&bin.number));
            let samples: u32 = within.map(|bin| bin.samples).sum();
            let span_s = (newest - from) as f64 * BIN_NS as f64 * 1e-9;
            (samples >= 1 && span_s > 0.0).then(|| (samples, f64::from(samples) / span_s))
        };
        match over(2 * SECOND) {
            Some((samples, rate)) if samples >= 20 => Some(rate),
            _ => over(BINS as i64).map(|(_, rate)| rate),
        }
    }

    /// Samples of the last second at the lower and at the upper end, and how many there were.
    pub fn at_ends(&self) -> (u32, u32, u32) {
        let newest = self.bins.back().map_or(0, |bin| bin.number);
        let recent = self.bins.iter().filter(|bin| bin.number > newest - SECOND);
        recent.fold((0, 0, 0), |sum, bin| (sum.0 + bin.at_low, sum.1 + bin.at_high, sum.2 + bin.samples))
    }

    /// For how long, ns, and how many samples the value has not moved at all.
    pub fn still(&self) -> (i64, u64) {
        (self.last.map_or(0, |(last_ns, _)| last_ns - self.still.0), self.still.1)
    }

    /// Standard deviation of the noise; `None` where too few samples fall into a stretch.
    pub fn noise(&self) -> Option<f64> {
        let mut scatter: Vec<f64> = self.scatter.iter().copied().collect();
        let middle = scatter.len() / 2;
        (scatter.len() >= STRETCHES / 4).then(|| *scatter.select_nth_unstable_by(middle, f64::total_cmp).1)
    }

    /// Least and most value of the [`BINS`] bins up to the one that holds `newest_ns`; `None` where there is no sample.
    pub fn trace(&self, newest_ns: i64) -> Vec<Option<[f64; 2]>> {
        let newest = newest_ns.div_euclid(BIN_NS);
        let mut trace = vec![None; BINS];
        for bin in &self.bins {
            if let Some(slot) =
                usize::try_from(bin.number - newest + BINS as i64 - 1).ok().and_then(|i| trace.get_mut(i))
            {
                *slot = Some([bin.least, bin.most]);
            }
        }
        trace
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: Ends = Ends { low: f64::NEG_INFINITY, high: f64::INFINITY };
    const S: i64 = 1_000_000_000;

    /// Samples at 1 kHz for `seconds`, in frames of 7.
    fn played(period_s: f64, seconds: f64, value: impl Fn(f64) -> f64) -> SensorHealth {
        let mut health = SensorHealth::new(NONE, period_s);
        let values: Vec<f64> = (0..(seconds * 1e3) as usize).map(|i| value(i as f64 * 1e-3)).collect();
        for (i, frame) in values.chunks(7).enumerate() {
            health.take(i as i64 * 7_000_000, 1e6, frame);
        }
        health
    }

    fn gauss(dice: &std::cell::RefCell<fastrand::Rng>) -> f64 {
        (0..12).map(|_| dice.borrow_mut().f64()).sum::<f64>() - 6.0
    }

    #[test]
    fn noise_is_found_under_a_surge_and_a_surge_is_none() {
        let dice = std::cell::RefCell::new(fastrand::Rng::with_seed(1));
        // a square wave that rings for good, and the smooth rest of one
        let surge = |t: f64| if (t / 0.35).fract() < 0.5 { 300.0 } else { 700.0 };
        let smooth = |t: f64| 500.0 + 200.0 * (t * std::f64::consts::TAU / 0.35).sin();
        for (what, quiet) in [("steady", &(|_| 300.0) as &dyn Fn(f64) -> f64), ("square", &surge), ("smooth", &smooth)]
        {
            let still = played(0.35, 5.0, quiet).noise().unwrap();
            assert!(still < 2.0, "{what}: {still}, 1% of the surge");
            let noise = played(0.35, 5.0, |t| quiet(t) + 5.0 * gauss(&dice)).noise().unwrap();
            assert!((noise / 5.0 - 1.0).abs() < 0.25, "{what}: {noise}");
        }
        // mains hum is noise
        let hum = played(1.4, 3.0, |t| 300.0 + 10.0 * (t * std::f64::consts::TAU * 50.0).sin()).noise().unwrap();
        assert!((hum / 10.0 * 2f64.sqrt() - 1.0).abs() < 0.1, "{hum}");
        assert_eq!(played(1e-4, 3.0, |_| 1.0).noise(), None, "no sample in between");
    }

    #[test]
    fn a_spike_of_one_sample_stays_in_the_trace() {
        let health = played(1.0, 20.0, |t| if (t - 13.0).abs() < 1e-6 { 9.0 } else { 1.0 });
        let trace = health.trace(20 * S - 1);
        assert_eq!(trace.len(), BINS);
        let spikes: Vec<usize> = (0..BINS).filter(|&i| trace[i] == Some([1.0, 9.0])).collect();
        assert_eq!(spikes, [30], "the trace begins at 10 s");
        assert!(trace.iter().all(Option::is_some));
        assert_eq!(health.rate_hz(), Some(1000.0));
        assert_eq!((health.samples, health.level()), (20_000, Some(1.0)));
    }

    #[test]
    fn samples_at_the_ends_are_counted_for_a_second_and_what_does_not_move_is_timed() {
        let mut health = played(1.0, 5.0, |t| if t < 4.5 { 100.0 } else { 1.0 });
        assert_eq!(health.at_ends(), (0, 0, 1000));
        assert_eq!(health.still(), (499_000_000, 500));
        health.ends = Ends { low: 1.0, high: 99.0 };
        health.take(5 * S, 1e6, &[100.0, 1.0, 50.0]);
        assert_eq!((health.at_ends().0, health.at_ends().1), (1, 1));
        assert_eq!(health.still().1, 1);
        health.gap();
        health.take(9 * S, 0.0, &[50.0]);
        assert_eq!((health.still(), health.gaps), ((0, 1), 1), "nothing is known of the time of a gap");
        // a sample every two seconds has a rate, too
        (5..9).for_each(|i| health.take(2 * i * S, 0.0, &[50.0]));
        assert!((health.rate_hz().unwrap() / 0.5 - 1.0).abs() < 0.3, "{:?}", health.rate_hz());
    }
}
