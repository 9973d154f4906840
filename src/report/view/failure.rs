//! Where a model fails, in words: too high or too low, early or late, and from which cycle on.

use std::fmt::Write as _;

use crate::fit::outcome::fit::{Fit, SensorFit};
use crate::fit::problem::compare::ExtremumError;

/// A sensor whose error is within this factor of its noise has nothing to say.
const WITHIN_NOISE: f64 = 1.5;

/// One line a sensor and run, or one sentence where nothing is wrong.
pub fn describe(fit: &Fit) -> String {
    let mut text = String::new();
    for run in &fit.runs {
        for sensor in &run.sensors {
            if sensor.rmse_m > WITHIN_NOISE * sensor.noise_m {
                let _ = writeln!(text, "{}, {}: {}", run.file, sensor.name, of_sensor(sensor));
            }
        }
    }
    if text.is_empty() { "no sensor shows more than its noise\n".into() } else { text }
}

fn of_sensor(sensor: &SensorFit) -> String {
    let mut parts = vec![format!("error {:.1} x the noise", sensor.rmse_m / sensor.noise_m)];
    parts.extend(size(sensor, true));
    parts.extend(size(sensor, false));
    parts.extend(phase(sensor));
    parts.join("; ")
}

fn of_kind(sensor: &SensorFit, peak: bool) -> Vec<&ExtremumError> {
    sensor.extrema.iter().filter(|e| e.peak == peak).collect()
}

/// How the peaks (or troughs) miss, first and last: decay that is too slow or too fast shows as a change of sign.
fn size(sensor: &SensorFit, peak: bool) -> Option<String> {
    let extrema = of_kind(sensor, peak);
    let (first, last) = (extrema.first()?, extrema.last()?);
    let error = |e: &ExtremumError| e.model_m - e.measured_m;
    let worst = extrema.iter().max_by(|a, b| error(a).abs().total_cmp(&error(b).abs()))?;
    if error(worst).abs() < 3.0 * sensor.noise_m {
        return None;
    }
    let name = if peak { "peaks" } else { "troughs" };
    let words = |e: f64| format!("{:.2} m too {}", e.abs(), if e > 0.0 { "high" } else { "low" });
    Some(if first.cycle == last.cycle {
        format!("the {} of cycle {} is {}", name.trim_end_matches('s'), first.cycle, words(error(first)))
    } else if worst.cycle == first.cycle || worst.cycle == last.cycle {
        format!(
            "{name} from {} in cycle {} to {} in cycle {}",
            words(error(first)),
            first.cycle,
            words(error(last)),
            last.cycle
        )
    } else {
        format!("{name} up to {} in cycle {}", words(error(worst)), worst.cycle)
    })
}

/// How the phase drifts: the slope of a straight line through the phase errors, where it stands out from their scatter.
fn phase(sensor: &SensorFit) -> Option<String> {
    let points: Vec<(f64, f64)> = sensor
        .extrema
        .iter()
        .filter(|e| e.phase_s.is_finite())
        .map(|e| (e.cycle as f64 + if e.peak { 0.0 } else { 0.5 }, e.phase_s))
        .collect();
    let n = points.len() as f64;
    if points.len() < 4 {
        return None;
    }
    let (mx, my) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
    let sxx: f64 = points.iter().map(|p| (p.0 - mx).powi(2)).sum();
    let slope = points.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum::<f64>() / sxx;
    let scatter: f64 = points.iter().map(|p| (p.1 - my - slope * (p.0 - mx)).powi(2)).sum();
    let error = (scatter / (n - 2.0) / sxx).sqrt();
    (slope.abs() > 3.0 * error && slope.abs() > 1e-5).then(|| {
        format!(
            "the model runs {} by {:.1} ms per cycle",
            if slope > 0.0 { "late" } else { "early" },
            1e3 * slope.abs()
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sensor(rmse_m: f64, errors: &[(f64, f64)]) -> SensorFit {
        let extrema = errors
            .iter()
            .enumerate()
            .map(|(i, &(error_m, phase_s))| ExtremumError {
                cycle: i + 1,
                peak: true,
                time_s: i as f64,
                measured_m: 20.0,
                model_m: 20.0 + error_m,
                phase_s,
            })
            .collect();
        SensorFit {
            name: "P1".into(),
            position_m: 1.0,
            time_s: vec![],
            measured_m: vec![],
            model_m: vec![],
            band_m: Vec::new(),
            noise_m: 0.03,
            white_noise_m: 0.03,
            rmse_m,
            start_rmse_m: 1.0,
            extrema,
        }
    }

    #[test]
    fn slow_decay_and_drift_are_put_into_words() {
        let text = of_sensor(&sensor(0.9, &[(-0.8, 0.001), (0.1, 0.005), (0.9, 0.0091), (1.4, 0.0130)]));
        assert!(text.contains("error 30.0 x the noise"), "{text}");
        assert!(text.contains("peaks from 0.80 m too low in cycle 1 to 1.40 m too high in cycle 4"), "{text}");
        assert!(text.contains("late by 4.0 ms per cycle"), "{text}");
    }

    #[test]
    fn noise_has_nothing_to_say() {
        let text = of_sensor(&sensor(0.03, &[(0.01, 0.0), (-0.02, 1e-4), (0.01, -1e-4), (0.0, 1e-4)]));
        assert_eq!(text, "error 1.0 x the noise");
    }
}
