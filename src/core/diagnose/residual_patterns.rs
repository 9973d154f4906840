//! Where a model fails, in words: for each sensor its peaks, phase, mean level and cycles.

use crate::diagnose::limits::{DESCRIBED_EXTREMA, LATENESS_ERRORS, LEAST_PHASES};
use crate::fit::outcome::fit::{Fit, SensorFit};
use crate::fit::problem::compare::{ExtremumError, rmse};
use crate::fit::search::thresholds::NOISE_LIKE;
use crate::number::{error_m, significant, times};

/// How a model fails at one sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct Pattern {
    /// Index of the run.
    pub run: usize,
    /// Index of the sensor among the run's.
    pub sensor: usize,
    /// Its name and its error.
    pub error: String,
    /// What is wrong, clause by clause.
    pub clauses: Vec<String>,
    /// The cycle that the model misses most, where there are cycles.
    pub worst: Option<Cycle>,
}

impl Pattern {
    /// It in one sentence.
    pub fn sentence(&self) -> String {
        format!("{}; {}", self.error, self.clauses.join(", "))
    }
}

/// The residual in one cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cycle {
    /// Number of the cycle, from 1.
    pub cycle: usize,
    /// Its first sample, s after the start of the closure.
    pub from_s: f64,
    /// Its last.
    pub to_s: f64,
    /// Root mean square of the residual, m.
    pub rms_m: f64,
}

/// A pattern for each sensor whose residual is more than noise, or whose head before the closure is missed.
pub fn residual_patterns(fit: &Fit) -> Vec<Pattern> {
    let mut patterns = Vec::new();
    for (r, run) in fit.runs.iter().enumerate() {
        let prefix = if fit.runs.len() > 1 { format!("{}, ", run.file) } else { String::new() };
        for (s, sensor) in run.sensors.iter().enumerate() {
            if sensor.rmse_m > NOISE_LIKE * sensor.noise_m || before(sensor).is_some() {
                let worst = worst(sensor);
                let (rmse, over_noise) = (error_m(sensor.rmse_m), times(sensor.rmse_m, sensor.noise_m));
                let error = format!("{prefix}{}: RMSE {rmse} m, {over_noise} times the noise", sensor.name);
                patterns.push(Pattern { run: r, sensor: s, error, clauses: clauses(sensor, worst), worst });
            }
        }
    }
    patterns
}

/// Mean of measured − model before the closure, m, where it stands out. An RMSE counts what follows the closure.
fn before(sensor: &SensorFit) -> Option<f64> {
    sensor.before_m.filter(|level| level.abs() > DESCRIBED_EXTREMA * sensor.noise_m)
}

fn worst(sensor: &SensorFit) -> Option<Cycle> {
    by_cycle(sensor).into_iter().max_by(|a, b| a.rms_m.total_cmp(&b.rms_m))
}

fn clauses(sensor: &SensorFit, worst: Option<Cycle>) -> Vec<String> {
    let mut parts = Vec::new();
    let residual: Vec<f64> = sensor.measured_m.iter().zip(&sensor.model_m).map(|(a, b)| a - b).collect();
    if let Some(level) = before(sensor) {
        let word = if level > 0.0 { "low" } else { "high" };
        parts.push(format!("the modelled head before the closure {} m too {word}", error_m(level.abs())));
    }
    for (peak, name) in [(true, "peaks"), (false, "troughs")] {
        let errors: Vec<f64> =
            sensor.extrema.iter().filter(|e| e.peak == peak).map(|e| e.model_m - e.measured_m).collect();
        let told = |mean: f64| format!("{} m too {}", error_m(mean.abs()), if mean > 0.0 { "high" } else { "low" });
        let noteworthy = |errors: &[f64]| mean(errors).filter(|mean| mean.abs() > DESCRIBED_EXTREMA * sensor.noise_m);
        // A mean over all would hide that the error turns over.
        let (early, late) = errors.split_at(errors.len() / 2);
        match (noteworthy(early), noteworthy(late)) {
            (Some(a), Some(b)) if a * b < 0.0 => {
                parts.push(format!("modelled {name} {} at first, {} later", told(a), told(b)));
            }
            _ => parts.extend(noteworthy(&errors).map(|mean| format!("modelled {name} {}", told(mean)))),
        }
        // A mean would hide how much the first one misses, which rigs are built for.
        let usual = errors.iter().map(|e| e.abs()).sum::<f64>() / errors.len().max(1) as f64;
        let first = errors.first().filter(|first| first.abs() > DESCRIBED_EXTREMA * sensor.noise_m.max(usual));
        parts.extend(first.map(|first| format!("the first {} {}", name.trim_end_matches('s'), told(*first))));
    }
    if let Some((late_s, by)) = lateness(&sensor.extrema) {
        let word = if late_s > 0.0 { "late" } else { "early" };
        parts.push(format!("the model {} ms {word}{by}", significant(1e3 * late_s.abs(), 2)));
    }
    if let Some(level) = mean(&residual).filter(|level| level.abs() > DESCRIBED_EXTREMA * sensor.noise_m) {
        let word = if level > 0.0 { "above" } else { "below" };
        parts.push(format!("the measured mean level {} m {word} the model", error_m(level.abs())));
    }
    let third = residual.len() / 3;
    if let (Some(first), Some(last)) = (mean(&residual[..third]), mean(&residual[residual.len() - third..]))
        && (last - first).abs() > sensor.noise_m
    {
        let word = if last > first { "rises" } else { "falls" };
        parts.push(format!("the measured mean level {word} by {} m against the model", error_m((last - first).abs())));
    }
    if let Some(worst) = worst {
        parts.push(format!("worst in cycle {} ({} m)", worst.cycle, error_m(worst.rms_m)));
    }
    parts
}

/// The residual in each cycle. Cycles are counted from the measured peaks.
pub fn by_cycle(sensor: &SensorFit) -> Vec<Cycle> {
    let peaks: Vec<_> = sensor.extrema.iter().filter(|e| e.peak).collect();
    let mut from = 0;
    let mut cycles = Vec::new();
    for (i, peak) in peaks.iter().enumerate() {
        let until = peaks.get(i + 1).map_or(f64::INFINITY, |next| 0.5 * (peak.time_s + next.time_s));
        let to = sensor.time_s.partition_point(|&t| t < until);
        if to > from {
            let rms_m = rmse(&sensor.measured_m[from..to], &sensor.model_m[from..to]);
            cycles.push(Cycle { cycle: peak.cycle, from_s: sensor.time_s[from], to_s: sensor.time_s[to - 1], rms_m });
        }
        from = to;
    }
    cycles
}

fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// How late the model is, s: a cycle, or else throughout, where that stands out from the scatter of the extrema. On a
/// plateau at the mean level, where no front leads to an extremum, the phases are noise.
fn lateness(extrema: &[ExtremumError]) -> Option<(f64, &'static str)> {
    let at = |e: &ExtremumError| e.cycle as f64 + if e.peak { 0.0 } else { 0.5 };
    let points: Vec<(f64, f64)> =
        extrema.iter().filter(|e| e.phase_s.is_finite()).map(|e| (at(e), e.phase_s)).collect();
    if points.len() < LEAST_PHASES {
        return None;
    }
    let n = points.len() as f64;
    let (mx, my) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
    let sxx: f64 = points.iter().map(|p| (p.0 - mx).powi(2)).sum();
    let slope = points.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum::<f64>() / sxx;
    let scatter = |slope: f64, free: f64| {
        (points.iter().map(|p| (p.1 - my - slope * (p.0 - mx)).powi(2)).sum::<f64>() / (n - free)).sqrt()
    };
    let stands_out = |value: f64, error: f64| value.abs() > (LATENESS_ERRORS * error).max(1e-5);
    if stands_out(slope, scatter(slope, 2.0) / sxx.sqrt()) {
        Some((slope, " a cycle"))
    } else {
        stands_out(my, scatter(0.0, 1.0) / n.sqrt()).then_some((my, ""))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::problem::test_record::{HDPE, record};
    use crate::fit::search::calibrate::calibrate;
    use crate::fit::search::options::Options;
    use crate::model::RunValues;
    use crate::model::constraint::Constraint;
    use crate::rig::Rig;

    fn shape(sensor: &SensorFit, worst: Option<Cycle>) -> String {
        clauses(sensor, worst).join(", ")
    }

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
            before_m: None,
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
        let said = shape(&sensor(0.004, 0.5), None);
        assert!(said.contains("4.0 ms late a cycle") && said.contains("peaks 0.50 m too high"), "{said}");
        let said = shape(&sensor(-0.004, -0.5), None);
        assert!(said.contains("4.0 ms early a cycle") && said.contains("peaks 0.50 m too low"), "{said}");
    }

    #[test]
    fn an_error_that_turns_over_and_a_level_are_named() {
        let mut turning = sensor(0.0, 0.0);
        for (e, error_m) in turning.extrema.iter_mut().zip([0.5, 0.4, 0.0, -0.4, -0.5]) {
            e.model_m = e.measured_m + error_m;
        }
        let said = shape(&turning, None);
        assert!(said.contains("modelled peaks 0.45 m too high at first, 0.30 m too low later"), "{said}");
        assert!(!said.contains("level"), "{said}");
        let mut first = sensor(0.0, 0.0);
        for (e, error_m) in first.extrema.iter_mut().zip([-3.0, -0.1, -0.1, 0.0, 0.0]) {
            e.model_m = e.measured_m + error_m;
        }
        assert!(shape(&first, None).contains("the first peak 3.00 m too low"), "{}", shape(&first, None));
        assert!(!said.contains("the first peak"), "{said}");
        assert!(shape(&sensor(0.0, 0.5), None).contains("the measured mean level 0.50 m below the model"));
        turning.before_m = Some(0.25);
        assert!(
            shape(&turning, None).starts_with("the modelled head before the closure 0.25 m too low, modelled peaks")
        );
    }

    /// No error counts the heads before the closure, so a sentence of its own reports a model that misses them.
    #[test]
    fn a_fit_that_misses_the_steady_head_is_described() {
        let rig = Rig::from_toml(HDPE, "rig.toml").unwrap();
        let run =
            RunValues { initial_velocity_m_s: 0.5, valve_head_m: 20.0, closing_time_s: 0.05, friction_scale: 1.0 };
        let runs = [record(&rig, &[], &[380.0], run, 0.05, 3.0)];
        let held = |name: &str, at: f64| Constraint {
            name: name.to_owned(),
            run: Some("run".to_owned()),
            lower: at,
            upper: at,
        };
        let held = [held("valve_head_m", 23.0), held("offset_m[P1]", 0.0)];
        for (constraints, missed) in [(Vec::new(), false), (held.to_vec(), true)] {
            let options = Options { constraints, most_reaches: 64, ..Options::default() };
            let fit = calibrate(&rig, &runs, &[], &options, &|_| {}).unwrap();
            let said: Vec<String> = residual_patterns(&fit).into_iter().map(|pattern| pattern.sentence()).collect();
            let says_so = said.iter().any(|s| s.contains("the modelled head before the closure 3.00 m too high"));
            assert_eq!(says_so, missed, "{said:?}");
        }
    }

    #[test]
    fn scattered_phases_are_not_lateness() {
        let mut scattered = sensor(0.0, 0.5);
        for (e, phase_s) in scattered.extrema.iter_mut().zip([0.03, -0.02, 0.04, -0.05, 0.06]) {
            e.phase_s = phase_s;
        }
        let said = shape(&scattered, None);
        assert!(!said.contains(" ms "), "{said}");
    }

    #[test]
    fn cycles_share_the_record() {
        let sensor = sensor(0.0, 0.5);
        let cycles = by_cycle(&sensor);
        assert_eq!(cycles.len(), 5);
        assert!(cycles.iter().all(|c| (c.rms_m - 0.5).abs() < 1e-12));
        assert_eq!((cycles[0].from_s, cycles[4].to_s), (0.0, 4.999));
        assert!(cycles.windows(2).all(|w| w[0].to_s < w[1].from_s));
        let both = shape(&sensor, worst(&sensor));
        assert!(both.contains("worst in cycle"), "{both}");
    }
}
