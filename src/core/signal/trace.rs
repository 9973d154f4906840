//! A sensor's record as a head on an even time grid. Gaps are marked.

use std::ops::Range;

use crate::robust::median;

/// A sampled head on an even grid. Bridged gaps are marked, so that no feature is read out of them.
#[derive(Debug, Clone)]
pub(crate) struct Trace {
    /// Time of the first sample, s.
    pub start_s: f64,
    /// Sample interval, s.
    pub step_s: f64,
    /// Piezometric head, m.
    pub head_m: Vec<f64>,
    /// Number of bridged samples before each index: a range is intact where it does not grow.
    bridged_before: Vec<usize>,
}

impl Trace {
    /// Interpolates samples (times strictly increasing, s; heads, m) to an even grid of the usual interval. One
    /// missing sample is bridged; more are a gap (declared gaps show in the times as well). `None` below eight samples.
    pub fn new(time_s: &[f64], head_m: &[f64]) -> Option<Trace> {
        if time_s.len() < 8 {
            return None;
        }
        let step_s = step(time_s);
        let (start_s, end_s) = (time_s[0], time_s[time_s.len() - 1]);
        // a record that is nearly all gap would need unbounded memory
        let count = ((end_s - start_s) / step_s + 1e-6).floor();
        if !(step_s > 0.0 && count < 64.0 * time_s.len() as f64 + 1e6) {
            return None;
        }
        let count = count as usize + 1;
        let mut trace =
            Trace { start_s, step_s, head_m: Vec::with_capacity(count), bridged_before: Vec::with_capacity(count + 1) };
        let (mut left, mut bridged) = (0, 0);
        for i in 0..count {
            let time = start_s + i as f64 * step_s;
            while left + 2 < time_s.len() && time_s[left + 1] <= time {
                left += 1;
            }
            let (t0, t1) = (time_s[left], time_s[left + 1]);
            let part = ((time - t0) / (t1 - t0)).clamp(0.0, 1.0);
            trace.head_m.push(head_m[left] + part * (head_m[left + 1] - head_m[left]));
            trace.bridged_before.push(bridged);
            let inside = part > 1e-6 && part < 1.0 - 1e-6;
            let lost = t1 - t0 > 2.5 * step_s;
            bridged += usize::from(inside && lost);
        }
        trace.bridged_before.push(bridged);
        Some(trace)
    }

    /// Number of grid points.
    pub fn len(&self) -> usize {
        self.head_m.len()
    }

    /// Time of a (fractional) grid index, s.
    pub fn time_s(&self, index: f64) -> f64 {
        self.start_s + index * self.step_s
    }

    /// Grid index at or before a time, clamped to the record.
    pub fn index(&self, time_s: f64) -> usize {
        (((time_s - self.start_s) / self.step_s + 1e-6).max(0.0) as usize).min(self.len() - 1)
    }

    /// Whether nothing in the range was bridged; false if the range leaves the record.
    pub fn intact(&self, range: Range<usize>) -> bool {
        range.start <= range.end
            && range.end <= self.len()
            && self.bridged_before[range.end] == self.bridged_before[range.start]
    }

    /// The first and the last point of each stretch that was bridged in a range, clamped to the record.
    pub fn bridged(&self, range: Range<usize>) -> Vec<[usize; 2]> {
        let range = range.start.min(self.len())..range.end.min(self.len());
        let points: Vec<usize> = range.filter(|i| !self.intact(*i..i + 1)).collect();
        points.chunk_by(|a, b| a + 1 == *b).map(|run| [run[0], run[run.len() - 1]]).collect()
    }

    /// Start of the unbroken stretch that ends before `end`.
    pub fn unbroken_from(&self, end: usize) -> usize {
        self.bridged_before.partition_point(|&b| b < self.bridged_before[end.min(self.len())])
    }

    /// The means of blocks of `factor` samples: fewer points, less noise, the same fronts.
    pub fn decimated(&self, factor: usize) -> Trace {
        if factor < 2 {
            return self.clone();
        }
        let blocks = self.len() / factor;
        let mut bridged = 0;
        let mut bridged_before = vec![0];
        for b in 0..blocks {
            bridged += usize::from(!self.intact(b * factor..(b + 1) * factor));
            bridged_before.push(bridged);
        }
        Trace {
            start_s: self.start_s + 0.5 * (factor - 1) as f64 * self.step_s,
            step_s: self.step_s * factor as f64,
            head_m: self.head_m.chunks_exact(factor).map(mean).collect(),
            bridged_before,
        }
    }

    /// Replaces every head by a centred moving mean.
    pub fn averaged(&self, half: usize) -> Trace {
        Trace { head_m: self.smoothed(half), ..self.clone() }
    }

    /// Centred moving mean over `2 × half + 1` samples, narrower towards the ends.
    pub fn smoothed(&self, half: usize) -> Vec<f64> {
        moving_mean(&self.head_m, half)
    }
}

/// Centred moving mean over `2 × half + 1` values; the window shrinks towards both ends so that it stays centred.
pub(crate) fn moving_mean(values: &[f64], half: usize) -> Vec<f64> {
    let mut sums = Vec::with_capacity(values.len() + 1);
    let mut sum = 0.0;
    sums.push(sum);
    // sums about the first value: a large constant head costs no digits
    let origin = values.first().copied().unwrap_or(0.0);
    for v in values {
        sum += v - origin;
        sums.push(sum);
    }
    (0..values.len())
        .map(|i| {
            let h = half.min(i).min(values.len() - 1 - i);
            origin + (sums[i + h + 1] - sums[i - h]) / (2 * h + 1) as f64
        })
        .collect()
}

/// Arithmetic mean; 0 for an empty slice.
pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// The usual interval, s: the mean of those near the median. Loggers round their times; steps of the median would drift
/// off the samples, and interpolation between two of them halves the noise.
fn step(time_s: &[f64]) -> f64 {
    let mut intervals: Vec<f64> = time_s.windows(2).map(|w| w[1] - w[0]).collect();
    let usual = median(&mut intervals);
    let near = || intervals.iter().filter(|i| (0.5 * usual..1.5 * usual).contains(*i));
    let count = near().count();
    if count == 0 { usual } else { near().sum::<f64>() / count as f64 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_is_marked_and_the_rest_is_intact() {
        let time: Vec<f64> = (0..100).filter(|i| !(40..50).contains(i)).map(|i| i as f64 * 0.01).collect();
        let head: Vec<f64> = time.iter().map(|t| 3.0 * t).collect();
        let trace = Trace::new(&time, &head).unwrap();
        assert_eq!(trace.len(), 100);
        assert!(trace.intact(0..40) && trace.intact(50..100) && !trace.intact(30..45));
        assert!((trace.head_m[45] - 1.35).abs() < 1e-9);
        assert_eq!(trace.unbroken_from(100), 50);
        assert_eq!(trace.unbroken_from(40), 0);
    }

    #[test]
    fn one_missing_sample_is_bridged() {
        let time: Vec<f64> = (0..50).filter(|i| *i != 25).map(|i| i as f64 * 0.01).collect();
        let trace = Trace::new(&time, &time).unwrap();
        assert!(trace.intact(0..50) && (trace.head_m[25] - 0.25).abs() < 1e-12);
        assert!(Trace::new(&time[..7], &time[..7]).is_none());
    }

    /// 1700 Hz with times to 0.01 ms: 0.58 and 0.59 ms apart.
    #[test]
    fn rounded_times_leave_the_noise_as_it_is() {
        let mut random = crate::signal::testing::Gauss::new(7);
        let time: Vec<f64> = (0..8000).map(|i| (1e5 * i as f64 / 1700.0).round() / 1e5).collect();
        let head: Vec<f64> = time.iter().map(|_| random.next()).collect();
        let rms = |values: &[f64]| (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt();
        let trace = Trace::new(&time, &head).unwrap();
        assert!((rms(&trace.head_m) / rms(&head) - 1.0).abs() < 0.02, "{}", rms(&trace.head_m) / rms(&head));
    }

    #[test]
    fn a_moving_mean_keeps_a_straight_line() {
        let line: Vec<f64> = (0..30).map(|i| 100.0 + 2.0 * i as f64).collect();
        for (a, b) in moving_mean(&line, 4).iter().zip(&line) {
            assert!((a - b).abs() < 1e-9);
        }
    }
}
