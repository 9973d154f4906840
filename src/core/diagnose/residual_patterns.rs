//! Where a model fails, in words: for each sensor its peaks, phase, mean level and cycles.

use crate::diagnose::limits::{DESCRIBED_EXTREMA, DESCRIBED_OVER_NOISE};
use crate::fit::outcome::fit::{Fit, SensorFit};
use crate::number::{error_m, significant, times};

/// One sentence for each sensor whose residual is more than noise; empty if there is none.
pub fn residual_patterns(fit: &Fit) -> Vec<String> {
    let mut sentences = Vec::new();
    for run in &fit.runs {
        let prefix = if fit.runs.len() > 1 { format!("{}, ", run.file) } else { String::new() };
        for sensor in &run.sensors {
            if sensor.rmse_m > DESCRIBED_OVER_NOISE * sensor.noise_m {
                sentences.push(format!(
                    "{prefix}{}: RMSE {} m, {} times the noise; {}",
                    sensor.name,
                    error_m(sensor.rmse_m),
                    times(sensor.rmse_m, sensor.noise_m),
                    shape(sensor)
                ));
            }
        }
    }
    sentences
}

fn shape(sensor: &SensorFit) -> String {
    let mut parts = Vec::new();
    for (peak, name) in [(true, "peaks"), (false, "troughs")] {
        let errors: Vec<f64> =
            sensor.extrema.iter().filter(|e| e.peak == peak).map(|e| e.model_m - e.measured_m).collect();
        if let Some(mean) = mean(&errors)
            && mean.abs() > DESCRIBED_EXTREMA * sensor.noise_m
        {
            parts.push(format!(
                "modelled {name} {} m too {}",
                error_m(mean.abs()),
                if mean > 0.0 { "high" } else { "low" }
            ));
        }
    }
    let phases: Vec<(f64, f64)> =
        sensor.extrema.iter().filter(|e| e.phase_s.is_finite()).map(|e| (e.cycle as f64, e.phase_s)).collect();
    if let Some((offset, slope)) = line(&phases) {
        let step = sensor.time_s.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
        let (late, by) =
            if slope.abs() * phases.len() as f64 > offset.abs() { (slope, " a cycle") } else { (offset, "") };
        if late.abs() > if by.is_empty() { step } else { step / phases.len() as f64 } {
            let word = if late > 0.0 { "late" } else { "early" };
            parts.push(format!("the model {} ms {word}{by}", significant(1e3 * late.abs(), 2)));
        }
    }
    let residual: Vec<f64> = sensor.measured_m.iter().zip(&sensor.model_m).map(|(a, b)| a - b).collect();
    let third = residual.len() / 3;
    if let (Some(first), Some(last)) = (mean(&residual[..third]), mean(&residual[residual.len() - third..]))
        && (last - first).abs() > sensor.noise_m
    {
        let word = if last > first { "rises" } else { "falls" };
        parts.push(format!("the measured mean level {word} by {} m against the model", error_m((last - first).abs())));
    }
    let cycles = by_cycle(sensor, &residual);
    if let Some((cycle, rms)) = cycles.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1)) {
        parts.push(format!("worst in cycle {cycle} ({} m)", error_m(rms)));
    }
    parts.join(", ")
}

/// Root mean square of the residual in each cycle, m. Cycles are counted from the measured peaks.
pub fn by_cycle(sensor: &SensorFit, residual: &[f64]) -> Vec<(usize, f64)> {
    let peaks: Vec<_> = sensor.extrema.iter().filter(|e| e.peak).collect();
    let mut from = 0;
    let mut cycles = Vec::new();
    for (i, peak) in peaks.iter().enumerate() {
        let until = peaks.get(i + 1).map_or(f64::INFINITY, |next| 0.5 * (peak.time_s + next.time_s));
        let to = sensor.time_s.partition_point(|&t| t < until);
        let square: f64 = residual[from..to].iter().map(|r| r * r).sum();
        if to > from {
            cycles.push((peak.cycle, (square / (to - from) as f64).sqrt()));
        }
        from = to;
    }
    cycles
}

fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// Value at the first abscissa and slope of a straight line through points.
fn line(points: &[(f64, f64)]) -> Option<(f64, f64)> {
    let (x, y) = (points.iter().map(|p| p.0), points.iter().map(|p| p.1));
    let n = points.len() as f64;
    if points.len() < 3 {
        return None;
    }
    let (mx, my) = (x.sum::<f64>() / n, y.sum::<f64>() / n);
    let spread: f64 = points.iter().map(|p| (p.0 - mx).powi(2)).sum();
    let slope = points.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum::<f64>() / spread.max(f64::MIN_POSITIVE);
    Some((my + slope * (points[0].0 - mx), slope))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::problem::compare::ExtremumError;

    fn sensor(late_s: f64, high_m: f64) -> SensorFit {
        let time_s: Vec<f64> = (0..5000).map(|i| f64::from(i) * 1e-3).collect();
        let wave = |t: f64| (std::f64::consts::TAU * t).sin();
        SensorFit {
            name: "P1".into(),
            position_m: 1.0,
            measured_m: time_s.iter().map(|&t| wave(t)).collect(),
            model_m: time_s.iter().map(|&t| wave(t) + high_m).collect(),
            band_m: Vec::new(),
            noise_m: 0.01,
            white_noise_m: 0.01,
            rmse_m: high_m,
            start_rmse_m: 1.0,
            extrema: (1..=5)
                .map(|cycle| ExtremumError {
                    cycle,
                    peak: true,
                    time_s: cycle as f64 - 0.75,
                    measured_m: 1.0,
                    model_m: 1.0 + high_m,
                    phase_s: late_s * cycle as f64,
                })
                .collect(),
            time_s,
        }
    }

    #[test]
    fn lateness_and_height_are_said() {
        let said = shape(&sensor(0.004, 0.5));
        assert!(said.contains("4.0 ms late a cycle") && said.contains("peaks 0.50 m too high"), "{said}");
        let said = shape(&sensor(-0.004, -0.5));
        assert!(said.contains("4.0 ms early a cycle") && said.contains("peaks 0.50 m too low"), "{said}");
    }

    #[test]
    fn cycles_share_the_record() {
        let sensor = sensor(0.0, 0.5);
        let cycles = by_cycle(&sensor, &vec![0.5; 5000]);
        assert_eq!(cycles.len(), 5);
        assert!(cycles.iter().all(|(_, rms)| (rms - 0.5).abs() < 1e-12));
    }
}
