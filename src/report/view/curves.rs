//! The curves of one sensor under all stages, on one time axis, few enough points for a page.

use crate::fit::outcome::fit::{Fit, SensorFit};
use crate::report::Stage;
use crate::report::view::decimate;

/// Traces up to this many samples are shown whole.
pub const WHOLE_UP_TO: usize = 4000;
/// Stretches into which a longer trace is cut; each keeps the extremes of every curve.
pub const BUCKETS: usize = 1000;
/// A step of the time axis this many times the median one is drawn as a gap, not bridged by a line.
const GAP_STEPS: f64 = 8.0;

/// Measurement and models at one sensor; all vectors of one length, NaN where there is nothing to draw.
#[derive(Debug, Clone, PartialEq)]
pub struct Curves {
    /// Times after the start of the closure in the last stage, s, ascending.
    pub time_s: Vec<f64>,
    /// Measured head, m.
    pub measured_m: Vec<f64>,
    /// Head of each stage's model, m.
    pub models_m: Vec<Vec<f64>>,
    /// Half the width of the 95% band around the last stage's model, m; empty where it is not known.
    pub band_m: Vec<f64>,
    /// Samples of the trace before any were left out.
    pub samples: usize,
    /// Some were left out.
    pub decimated: bool,
}

impl Curves {
    /// The curves of sensor `sensor` in run `file`, as the last stage that knows them measured it.
    ///
    /// `None` if no stage does. Each stage calibrates its own start of the closure, so its times are shifted against
    /// those of the last; the common end of the recording aligns them. At most [`WHOLE_UP_TO`] samples are kept whole;
    /// of longer traces each of `buckets` stretches keeps the extremes of measurement, models and residuals.
    pub fn of(stages: &[Stage], file: &str, sensor: &str, buckets: usize) -> Option<Self> {
        let reference = stages.iter().rev().find_map(|s| find(s.fit, file, sensor))?;
        let samples = reference.time_s.len().min(reference.measured_m.len());
        let (time_s, measured_m) = with_gaps(&reference.time_s[..samples], &reference.measured_m[..samples]);
        let models_m: Vec<Vec<f64>> = stages
            .iter()
            .map(|stage| match find(stage.fit, file, sensor) {
                Some(fit) => blank_gaps(on_times(fit, &fit.model_m, reference, &time_s), &measured_m),
                None => vec![f64::NAN; time_s.len()],
            })
            .collect();
        let band_m = match stages.last().and_then(|last| find(last.fit, file, sensor)) {
            Some(fit) if !fit.band_m.is_empty() => {
                blank_gaps(on_times(fit, &fit.band_m, reference, &time_s), &measured_m)
            }
            _ => Vec::new(),
        };
        let whole = Self { time_s, measured_m, models_m, band_m, samples, decimated: false };
        Some(if samples > WHOLE_UP_TO { whole.decimated(buckets) } else { whole })
    }

    /// Model − measured of each stage, m.
    pub fn residuals_m(&self) -> Vec<Vec<f64>> {
        let minus = |model: &Vec<f64>| self.measured_m.iter().zip(model).map(|(y, m)| m - y).collect();
        self.models_m.iter().map(minus).collect()
    }

    fn decimated(self, buckets: usize) -> Self {
        let residuals = self.residuals_m();
        let all: Vec<&[f64]> = std::iter::once(&self.measured_m)
            .chain(&self.models_m)
            .chain(&residuals)
            .map(Vec::as_slice)
            .filter(|c| c.iter().any(|v| v.is_finite()))
            .collect();
        let kept = decimate::keep(&all, self.time_s.len(), buckets);
        let pick = |from: &Vec<f64>| kept.iter().map(|&i| from[i]).collect::<Vec<_>>();
        Self {
            time_s: pick(&self.time_s),
            measured_m: pick(&self.measured_m),
            models_m: self.models_m.iter().map(pick).collect(),
            band_m: if self.band_m.is_empty() { Vec::new() } else { pick(&self.band_m) },
            samples: self.samples,
            decimated: kept.len() < self.time_s.len(),
        }
    }
}

/// The fit of a sensor in a run.
pub fn find<'a>(fit: &'a Fit, file: &str, sensor: &str) -> Option<&'a SensorFit> {
    fit.runs.iter().find(|r| r.file == file)?.sensors.iter().find(|s| s.name == sensor)
}

/// Copies a trace, dropping samples without a time and putting one empty sample into each gap.
fn with_gaps(time_s: &[f64], value: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let samples: Vec<(f64, f64)> =
        time_s.iter().copied().zip(value.iter().copied()).filter(|(t, _)| t.is_finite()).collect();
    let mut steps: Vec<f64> = samples.windows(2).map(|w| w[1].0 - w[0].0).collect();
    steps.sort_unstable_by(f64::total_cmp);
    let longest = steps.get(steps.len() / 2).map_or(f64::INFINITY, |median| median * GAP_STEPS);
    let (mut times, mut values) = (Vec::with_capacity(samples.len()), Vec::with_capacity(samples.len()));
    let mut before: Option<f64> = None;
    for (t, v) in samples {
        if let Some(last) = before.filter(|last| t - last > longest) {
            times.push(0.5 * (last + t));
            values.push(f64::NAN);
        }
        times.push(t);
        values.push(v);
        before = Some(t);
    }
    (times, values)
}

fn blank_gaps(mut model: Vec<f64>, measured: &[f64]) -> Vec<f64> {
    for (m, y) in model.iter_mut().zip(measured) {
        if y.is_nan() {
            *m = f64::NAN;
        }
    }
    model
}

/// Values at the samples of `fit` (its model, its band) at times of `reference`, linear between its samples, NaN
/// outside them.
fn on_times(fit: &SensorFit, values: &[f64], reference: &SensorFit, time_s: &[f64]) -> Vec<f64> {
    let shift = shift_s(fit, reference);
    let len = fit.time_s.len().min(values.len());
    let (times, model) = (&fit.time_s[..len], &values[..len]);
    // Sample times that agree up to rounding are the same sample.
    let slack = 1e-9 * time_s.last().map_or(1.0, |t| t.abs().max(1.0));
    let mut next = 0;
    time_s
        .iter()
        .map(|t| {
            let t = t - shift;
            while next < len && times[next] < t - slack {
                next += 1;
            }
            match (next.checked_sub(1), times.get(next)) {
                (_, Some(&at)) if (at - t).abs() <= slack => model[next],
                (Some(before), Some(&after)) => {
                    let part = (t - times[before]) / (after - times[before]);
                    model[before] + part * (model[next] - model[before])
                }
                _ => f64::NAN,
            }
        })
        .collect()
}

/// What to add to a stage's times to get the reference's: their starts of the closure differ, the recording's end does
/// not.
fn shift_s(fit: &SensorFit, reference: &SensorFit) -> f64 {
    let ends = |s: &SensorFit| Some((*s.time_s.last()?, *s.measured_m.last()?));
    match (ends(fit), ends(reference)) {
        (Some((t, y)), Some((to, same))) if (y - same).abs() <= 1e-9 * same.abs().max(1.0) => to - t,
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::outcome::fit::RunFit;

    fn fit(time_s: Vec<f64>, measured_m: Vec<f64>, model_m: Vec<f64>) -> Fit {
        let sensor = SensorFit {
            name: "P1".into(),
            position_m: 1.0,
            time_s,
            measured_m,
            model_m,
            band_m: Vec::new(),
            noise_m: 0.1,
            white_noise_m: 0.1,
            rmse_m: 1.0,
            start_rmse_m: 2.0,
            before_m: None,
            extrema: vec![],
        };
        let run = RunFit {
            file: "a".into(),
            rmse_m: 1.0,
            noise_m: 0.1,
            mape_extrema_percent: 1.0,
            noise_dies_away: false,
            meter_flow_m3_s: None,
            sensors: vec![sensor],
        };
        Fit {
            effects: vec![],
            runs: vec![run],
            parameters: vec![],
            correlation: vec![],
            unidentifiable: vec![],
            reaches: 64,
            grid_error_m: 0.001,
            evaluations: 1,
            seconds: 1.0,
            steps: vec![],
            stopped_because: String::new(),
            converged: true,
            cost: 0.0,
            predicted_reduction: 0.0,
            posterior: None,
            features_left: vec![],
            method: crate::fit::problem::method::Method::default(),
        }
    }

    #[test]
    fn stages_with_another_start_of_the_closure_are_aligned_by_the_recordings_end() {
        let measured: Vec<f64> = (0..10).map(|i| (i as f64).sin()).collect();
        let times = |start: f64, from: usize| (from..10).map(|i| i as f64 - start).collect::<Vec<_>>();
        let early = fit(times(0.5, 1), measured[1..].to_vec(), measured[1..].to_vec());
        let late = fit(times(2.25, 3), measured[3..].to_vec(), vec![0.0; 7]);
        let stages = [Stage { title: "a".into(), fit: &early }, Stage { title: "b".into(), fit: &late }];
        let curves = Curves::of(&stages, "a", "P1", 10).unwrap();
        assert_eq!(curves.time_s, times(2.25, 3));
        assert_eq!(curves.models_m[0], measured[3..]);
        assert!(!curves.decimated);
        assert_eq!(curves.residuals_m()[0], [0.0; 7]);
        let below: Vec<f64> = measured[3..].iter().map(|y| 0.0 - y).collect();
        assert_eq!(curves.residuals_m()[1], below, "model − measured, as in the tables");
    }

    #[test]
    fn a_gap_in_time_is_not_bridged() {
        let times = vec![0.0, 1.0, 2.0, 3.0, 50.0, 51.0];
        let one = fit(times, vec![1.0; 6], vec![2.0; 6]);
        let curves = Curves::of(&[Stage { title: "a".into(), fit: &one }], "a", "P1", 10).unwrap();
        assert_eq!(curves.time_s.len(), 7);
        assert!(curves.measured_m[4].is_nan() && curves.models_m[0][4].is_nan());
        assert_eq!(curves.measured_m.iter().filter(|v| v.is_nan()).count(), 1);
    }

    #[test]
    fn long_traces_keep_the_extremes_of_every_curve() {
        let n = 40_000;
        let times: Vec<f64> = (0..n).map(|i| i as f64 * 1e-3).collect();
        let mut measured: Vec<f64> = times.iter().map(|t| (t * 3.0).cos() * (-t / 10.0).exp()).collect();
        measured[12_345] = 9.0;
        let mut model = measured.clone();
        model[30_001] = -7.0;
        let one = fit(times, measured, model);
        let curves = Curves::of(&[Stage { title: "a".into(), fit: &one }], "a", "P1", BUCKETS).unwrap();
        assert!(curves.decimated && curves.samples == n && curves.time_s.len() < 7 * BUCKETS);
        let spike = curves.time_s.iter().position(|&t| t == 12.345).unwrap();
        assert_eq!(curves.measured_m[spike], 9.0);
        assert!(curves.models_m[0].contains(&-7.0));
    }

    #[test]
    fn what_a_stage_does_not_know_is_left_empty() {
        let one = fit(vec![0.0, 1.0], vec![1.0, 2.0], vec![1.0, 2.0]);
        let mut other = one.clone();
        other.runs[0].sensors[0].name = "P2".into();
        let stages = [Stage { title: "a".into(), fit: &other }, Stage { title: "b".into(), fit: &one }];
        let curves = Curves::of(&stages, "a", "P1", 10).unwrap();
        assert!(curves.models_m[0].iter().all(|v| v.is_nan()));
        assert_eq!(curves.models_m[1], [1.0, 2.0]);
        assert!(Curves::of(&stages, "b", "P1", 10).is_none());
    }
}
