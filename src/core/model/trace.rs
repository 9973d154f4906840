//! Result of a simulation at a probe: head or flow step by step, and its value at any time.

use crate::rig::Place;
use crate::wide::widened;

/// Head or flow at one place.
#[derive(Debug, Clone, PartialEq)]
pub struct Trace {
    /// Time step, s.
    pub dt_s: f64,
    /// Head (m) or flow (m³/s) at `0, dt, 2dt, …` after the start of the closure; the first is the steady value, which
    /// also holds before.
    pub values: Vec<f64>,
    /// Delay of the trace against the true time, s: the skew of a sensor's clock.
    pub late_s: f64,
}

impl Trace {
    /// An empty trace with room for `values` values.
    pub fn with_capacity(dt_s: f64, values: usize) -> Trace {
        Trace { dt_s, values: Vec::with_capacity(values), late_s: 0.0 }
    }

    /// Value at a time after the start of the closure, by a monotone cubic between steps; the steady value before the
    /// closure, the last value after the end.
    ///
    /// It never leaves the range of the two steps around it, so a front neither overshoots nor falls below vapour
    /// pressure. Where the curve rises or falls smoothly it is of third order; a peak or trough between two steps is
    /// cut off, by `dt² H''/8` at most.
    pub fn at(&self, time_s: f64) -> f64 {
        let last = self.values.len() - 1;
        let (four, s) = about(&self.values, ((time_s - self.late_s) / self.dt_s).clamp(0.0, last as f64));
        monotone(four, s)
    }

    /// The values at times of a clock on which the closure starts at `start_s`, each as [`Trace::at`] has it.
    pub fn read(&self, start_s: f64, time_s: &[f64], values: &mut [f64]) {
        interpolate(&self.values, start_s + self.late_s, 1.0 / self.dt_s, time_s, values);
    }
}

/// The four steps about `x`, and how far beyond the second of them it lies; steps are constant beyond their ends.
#[inline(always)]
fn about(steps: &[f64], x: f64) -> ([f64; 4], f64) {
    let i = x as u32 as usize;
    let four = match steps.get(i.wrapping_sub(1)..i.saturating_add(3)) {
        Some(&[a, b, c, d]) => [a, b, c, d],
        _ => [i.saturating_sub(1), i, i + 1, i + 2].map(|i| steps[i.min(steps.len() - 1)]),
    };
    (four, x - i as f64)
}

/// The cubic between the values at 0 and 1, of those at -1, 0, 1 and 2: it rises and falls as they do (Fritsch &
/// Carlson 1980, SIAM J. Numer. Anal. 17, 238). Its slopes are the central differences, no more than thrice the smaller
/// neighbouring one, and none at a peak; so the curve has no kinks, which a fit needs.
///
/// Comparisons, not `f64::min`: they are one instruction each.
#[inline(always)]
pub(crate) fn monotone([a, b, c, d]: [f64; 4], s: f64) -> f64 {
    let rise = c - b;
    let (at_0, at_1) = (slope(b - a, rise), slope(rise, d - c));
    let (from, to) = (at_0 - rise, rise - at_1);
    let value = b + s * (rise + (1.0 - s) * (from - s * (from - to)));
    // Only rounding may lead out of the range.
    let (low, high) = if rise > 0.0 { (b, c) } else { (c, b) };
    let least = if value < low { low } else { value };
    if least > high { high } else { least }
}

/// The slope where a curve has risen by `before` and will rise by `behind`.
#[inline(always)]
fn slope(before: f64, behind: f64) -> f64 {
    let (low, high) = if before < behind { (before, behind) } else { (behind, before) };
    let mean = 0.5 * (before + behind);
    let most = if low > 0.0 { 3.0 * low } else { 0.0 };
    let least = if high < 0.0 { 3.0 * high } else { 0.0 };
    let mean = if mean < most { mean } else { most };
    if mean > least { mean } else { least }
}

/// Times that are looked up together.
const BLOCK: usize = 64;

widened! {
    /// The values at the times, where `steps` stand at `from_s` and then `per_s` a second.
    fn interpolate(steps: &[f64], from_s: f64, per_s: f64, time_s: &[f64], values: &mut [f64]) {
        let last = (steps.len() - 1) as f64;
        let (mut x, mut fours) = ([0.0; BLOCK], [[0.0; BLOCK]; 4]);
        for (time_s, values) in time_s.chunks(BLOCK).zip(values.chunks_mut(BLOCK)) {
            for (x, time_s) in x.iter_mut().zip(time_s) {
                *x = ((time_s - from_s) * per_s).clamp(0.0, last);
            }
            for (k, x) in x[..time_s.len()].iter_mut().enumerate() {
                let (four, s) = about(steps, *x);
                (0..4).for_each(|i| fours[i][k] = four[i]);
                *x = s;
            }
            let [a, b, c, d] = &fours;
            for (k, value) in values.iter_mut().enumerate() {
                *value = monotone([a[k], b[k], c[k], d[k]], x[k]);
            }
        }
    }
}

/// A quantity and its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Probe {
    /// Head, m.
    Head(Place),
    /// Flow, m³/s, from the line's beginning to its end.
    Flow(Place),
}

impl Probe {
    /// The head at a place; in a rig in series, m from the supply.
    pub fn head(place: impl Into<Place>) -> Probe {
        Probe::Head(place.into())
    }

    /// The flow at a place; in a rig in series, m from the supply.
    pub fn flow(place: impl Into<Place>) -> Probe {
        Probe::Flow(place.into())
    }

    /// Its place.
    pub fn place(self) -> Place {
        let (Probe::Head(place) | Probe::Flow(place)) = self;
        place
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A parabola that falls all the way.
    #[test]
    fn smooth_between_steps_and_steady_outside() {
        let f = |t: f64| 3.0 - t - 0.5 * t * t;
        let trace = Trace { dt_s: 0.5, values: (0..20).map(|i| f(0.5 * i as f64)).collect(), late_s: 0.0 };
        for t in [0.5, 0.77, 3.17, 8.9] {
            assert!((trace.at(t) - f(t)).abs() < 1e-12, "{t}");
        }
        let times: Vec<f64> = (0..150).map(|i| 0.1 * i as f64 - 1.0).collect();
        let mut read = vec![0.0; times.len()];
        trace.read(0.25, &times, &mut read);
        for (t, value) in times.iter().zip(&read) {
            assert!((trace.at(t - 0.25) - value).abs() < 1e-12, "{t}");
        }
        assert_eq!(trace.at(-1.0), f(0.0));
        assert_eq!(trace.at(100.0), f(9.5));
    }

    proptest::proptest! {
        /// Whatever the steps, no value between two of them leaves their range; both ways of reading agree.
        #[test]
        fn no_value_leaves_the_range_of_the_steps_around_it(
            values in proptest::collection::vec(-1e3..1e3f64, 1..40),
            places in proptest::collection::vec(-2.0..42.0f64, 100),
            late_s in -0.01..0.01f64,
        ) {
            let dt_s = 3e-3;
            let trace = Trace { dt_s, values, late_s };
            let time_s: Vec<f64> = places.iter().map(|x| late_s + x * dt_s).collect();
            let mut read = vec![0.0; time_s.len()];
            trace.read(0.0, &time_s, &mut read);
            for (&t, &value) in time_s.iter().zip(&read) {
                // Rounding may take a time that lies on a step to either side of it.
                let x = ((t - late_s) / dt_s).clamp(0.0, (trace.values.len() - 1) as f64);
                let around = &trace.values[(x - 1e-9).max(0.0) as usize..=((x + 1e-9).ceil() as usize).min(trace.values.len() - 1)];
                let (low, high) = around.iter().fold((f64::MAX, f64::MIN), |(l, h), &v| (l.min(v), h.max(v)));
                proptest::prop_assert!((low..=high).contains(&value), "{value} at {x} is beyond {low} to {high}");
                proptest::prop_assert!((trace.at(t) - value).abs() < 1e-6, "{} and {value} at {x}", trace.at(t));
            }
        }

        /// From one step to the next the curve only rises, or only falls.
        #[test]
        fn it_turns_nowhere_but_at_a_step(four in proptest::array::uniform4(-1e3..1e3f64)) {
            let curve: Vec<f64> = (0..=100).map(|i| monotone(four, 0.01 * f64::from(i))).collect();
            let way = (four[2] - four[1]).signum();
            proptest::prop_assert!(curve.windows(2).all(|w| way * (w[1] - w[0]) >= -1e-9), "{four:?}");
            proptest::prop_assert!((curve[0] - four[1]).abs() + (curve[100] - four[2]).abs() < 1e-9, "{four:?}");
        }
    }

    /// `exp` rises everywhere; halving the step divides the largest error by `2³`.
    #[test]
    fn it_is_of_third_order_where_the_curve_rises() {
        let error = |n: usize| {
            let dt_s = 1.0 / n as f64;
            let trace = Trace { dt_s, values: (0..=2 * n).map(|i| (i as f64 * dt_s).exp()).collect(), late_s: 0.0 };
            let off = |i: usize| (trace.at(0.5 + 1e-3 * i as f64) - (0.5 + 1e-3 * i as f64).exp()).abs();
            (0..1000).map(off).fold(0.0, f64::max)
        };
        let order = (error(20) / error(40)).log2();
        assert!((order - 3.0).abs() < 0.1, "order {order}");
    }
}
