//! Model against measurement: error, extrema, phase.

/// Near the level between two extrema, as a share of their difference.
const NEAR: f64 = 0.1;
/// Share of the time between two extrema that may pass near that level. A straight line spends a fifth of it there. A
/// sensor far from the valve waits there for the next front, and no one instant is the crossing.
const MOST_NEAR: f64 = 0.25;

/// One extremum in measurement and model.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ExtremumError {
    /// Cycle from 1.
    pub cycle: usize,
    /// A peak rather than a trough.
    pub peak: bool,
    /// When it is measured, s after the start of the closure.
    pub time_s: f64,
    /// Measured head, m.
    pub measured_m: f64,
    /// Head of the model's own extremum, m.
    pub model_m: f64,
    /// Model's time minus measured time of the crossing of the mean level that leads to it, s; NaN where none leads to
    /// it, or either head waits at that level.
    pub phase_s: f64,
}

/// Root mean square of the difference of two series.
pub fn rmse(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len()).max(1);
    (a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum::<f64>() / n as f64).sqrt()
}

/// Mean absolute percentage error over extrema, percent (paper's eq. 19); NaN without any.
pub fn mape_percent<'a>(extrema: impl Iterator<Item = &'a ExtremumError>) -> f64 {
    let (sum, n) = extrema
        .filter(|e| e.measured_m != 0.0)
        .fold((0.0, 0usize), |(sum, n), e| (sum + ((e.model_m - e.measured_m) / e.measured_m).abs(), n + 1));
    if n == 0 { f64::NAN } else { 100.0 * sum / n as f64 }
}

/// Measured and modelled series of one sensor at the same times.
pub struct Pair<'a> {
    /// Times, s, increasing.
    pub time_s: &'a [f64],
    /// Measured heads, m.
    pub measured_m: &'a [f64],
    /// Modelled heads, m.
    pub model_m: &'a [f64],
    /// Noise of the measurement, m.
    pub noise_m: f64,
    /// Period of the oscillation, s.
    pub period_s: f64,
}

impl Pair<'_> {
    /// Compares the extrema found at `(time, cycle, is a peak)`: heights within a quarter period of the measured time,
    /// and the phase by the crossing of the level between this extremum and the one before.
    pub fn extrema(&self, found: &[(f64, usize, bool)]) -> Vec<ExtremumError> {
        let mut before: Option<(f64, f64)> = None;
        let mut errors = Vec::new();
        for &(time_s, cycle, peak) in found {
            let (first, last) = self.span(time_s - 0.25 * self.period_s, time_s + 0.25 * self.period_s);
            if last <= first {
                continue;
            }
            let measured_m = self.extreme(self.measured_m, first, last, peak);
            let model_m = self.extreme(self.model_m, first, last, peak);
            let phase_s = before.map_or(f64::NAN, |(t, head)| {
                let level = 0.5 * (head + measured_m);
                let near_m = NEAR * (head - measured_m).abs();
                if [self.measured_m, self.model_m].iter().any(|series| self.waits(series, t, time_s, level, near_m)) {
                    return f64::NAN;
                }
                let crossing = |series: &[f64]| self.crossing(series, t, time_s, level, peak);
                crossing(self.model_m) - crossing(self.measured_m)
            });
            before = Some((time_s, measured_m));
            errors.push(ExtremumError { cycle, peak, time_s, measured_m, model_m, phase_s });
        }
        errors
    }

    /// Whether a series stays within `near_m` of a level for long between two times.
    fn waits(&self, series: &[f64], from_s: f64, to_s: f64, level: f64, near_m: f64) -> bool {
        let (first, last) = self.span(from_s, to_s);
        let near = series[first..last].iter().filter(|head| (**head - level).abs() < near_m).count();
        near as f64 > MOST_NEAR * (last - first) as f64
    }

    fn span(&self, from_s: f64, to_s: f64) -> (usize, usize) {
        (self.time_s.partition_point(|&t| t < from_s), self.time_s.partition_point(|&t| t <= to_s))
    }

    /// Largest (or least) mean over a short window: a single sample would carry the noise's own extreme.
    fn extreme(&self, series: &[f64], first: usize, last: usize, peak: bool) -> f64 {
        let step = (self.time_s[last - 1] - self.time_s[first]) / (last - first).max(2) as f64;
        let half = ((0.01 * self.period_s / step.max(f64::MIN_POSITIVE)) as usize).min((last - first) / 4);
        let sign = if peak { 1.0 } else { -1.0 };
        let mut best = f64::NEG_INFINITY;
        for centre in first..last {
            let (a, b) = (centre.saturating_sub(half).max(first), (centre + half + 1).min(last));
            best = best.max(sign * series[a..b].iter().sum::<f64>() / (b - a) as f64);
        }
        sign * best
    }

    /// Time at which a series crosses a level between two extrema, rising towards a peak; NaN where it does not cross.
    fn crossing(&self, series: &[f64], from_s: f64, to_s: f64, level: f64, rising: bool) -> f64 {
        let margin = 0.1 * (to_s - from_s);
        let (first, last) = self.span(from_s - margin, to_s + margin);
        let mut times = Vec::new();
        for i in first + 1..last {
            let (a, b) = (series[i - 1] - level, series[i] - level);
            if a != b && ((a < 0.0) != (b < 0.0)) && (b > a) == rising {
                times.push(self.time_s[i - 1] + (self.time_s[i] - self.time_s[i - 1]) * a / (a - b));
            }
        }
        // Noise makes several crossings of one front: their middle.
        if times.is_empty() { f64::NAN } else { times[times.len() / 2] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scaled_and_delayed_wave_shows_both_errors() {
        let time_s: Vec<f64> = (0..4000).map(|i| i as f64 * 1e-3).collect();
        let wave = |t: f64| 10.0 + 5.0 * (std::f64::consts::TAU * t).sin();
        let measured_m: Vec<f64> = time_s.iter().map(|&t| wave(t)).collect();
        let model_m: Vec<f64> = time_s.iter().map(|&t| 10.0 + 1.1 * (wave(t - 0.01) - 10.0)).collect();
        let pair = Pair { time_s: &time_s, measured_m: &measured_m, model_m: &model_m, noise_m: 0.0, period_s: 1.0 };
        let errors = pair.extrema(&[(0.25, 1, true), (0.75, 1, false), (1.25, 2, true)]);
        assert_eq!(errors.len(), 3);
        assert!(errors[0].phase_s.is_nan());
        for e in &errors[1..] {
            assert!((e.phase_s - 0.01).abs() < 1e-4, "{e:?}");
        }
        assert!((errors[2].model_m - 15.5).abs() < 2e-2 && (errors[2].measured_m - 15.0).abs() < 2e-2);
        // (0.5/15 + 0.5/5 + 0.5/15) / 3
        assert!((mape_percent(errors.iter()) - 100.0 * (0.5 / 15.0 + 0.1 + 0.5 / 15.0) / 3.0).abs() < 0.1);
    }

    /// At a quarter of the pipe the head returns to the mean level for three quarters of the time, and a small offset
    /// moves the crossing across that plateau.
    #[test]
    fn a_plateau_at_the_mean_level_has_no_phase() {
        let time_s: Vec<f64> = (0..4000).map(|i| i as f64 * 1e-3).collect();
        let wave = |t: f64, at: f64| {
            let in_half = (2.0 * t).rem_euclid(1.0);
            let sign = if t.rem_euclid(1.0) < 0.5 { 5.0 } else { -5.0 };
            10.0 + sign * ((0.5 * at + 0.02 - (in_half - 0.5).abs()) / 0.04).clamp(0.0, 1.0)
        };
        let phase = |at: f64| {
            let measured_m: Vec<f64> = time_s.iter().map(|&t| wave(t, at)).collect();
            let model_m: Vec<f64> = time_s.iter().map(|&t| wave(t, at) + 0.05).collect();
            let pair =
                Pair { time_s: &time_s, measured_m: &measured_m, model_m: &model_m, noise_m: 0.0, period_s: 1.0 };
            pair.extrema(&[(0.25, 1, true), (0.75, 1, false), (1.25, 2, true)])[2].phase_s
        };
        assert!(phase(0.25).is_nan() && phase(1.0).abs() < 1e-3, "{} {}", phase(0.25), phase(1.0));
    }

    #[test]
    fn no_extremum_no_number() {
        assert!(mape_percent([].iter()).is_nan());
        assert_eq!(rmse(&[1.0, 2.0], &[1.0, 4.0]), 2f64.sqrt());
    }
}
