//! What a fit leaves, in units of the noise, and the least of it that is worth a model.

use crate::diagnose::evidence::EvidenceScale;
use crate::diagnose::limits::{ERROR_OF_EFFECT, LEAST_FALL, MODEL_ERROR};
use crate::extent::ends;
use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;

/// Sum over all samples of (residual / noise)².
pub(crate) fn square(fit: &Fit) -> f64 {
    let sensors = fit.runs.iter().flat_map(|r| &r.sensors);
    sensors.map(|s| s.time_s.len() as f64 * (s.rmse_m / s.white_noise_m).powi(2)).sum()
}

/// The square of the error over noise of a fit beyond what every model of a closure leaves: noise, and what oscillates
/// in the pipe before the closure.
pub(crate) fn beyond(fit: &Fit, runs: &[RunData]) -> f64 {
    let (mut sum, mut n) = (0.0, 0.0);
    for (fitted, run) in fit.runs.iter().zip(runs) {
        for (sensor, data) in fitted.sensors.iter().zip(&run.sensors) {
            let samples = sensor.time_s.len() as f64;
            let square_m2 = sensor.rmse_m.powi(2) - data.oscillation_m().powi(2);
            sum += samples * (square_m2 / data.total_noise_m.powi(2) - 1.0);
            n += samples;
        }
    }
    sum / f64::max(n, 1.0)
}

/// By how much the square of the error over noise falls from a sum of squares to another, both over the samples of a
/// start model.
pub(crate) fn fall(start: &Fit, from: f64, to: f64) -> f64 {
    start.mean_square() * (from - to) / square(start)
}

/// The least fall of the squared error over noise that is worth a model: more than noise does, and more than solvers
/// differ by.
pub(crate) fn least_fall(runs: &[RunData]) -> f64 {
    let (mut square, mut n) = (0.0, 0.0);
    for sensor in runs.iter().flat_map(|run| &run.sensors) {
        let (low, high) = ends(&sensor.head_m);
        let samples = sensor.head_m.len() as f64;
        square += samples * (MODEL_ERROR * 0.5 * (high - low) / sensor.total_noise_m).powi(2);
        n += samples;
    }
    (square / f64::max(n, 1.0)).max(LEAST_FALL.powi(2))
}

/// What two right models of effects differ by, of the squared error over noise, where these effects have `taken` so
/// much of it.
pub(crate) fn error_of_effects(taken: f64) -> f64 {
    ERROR_OF_EFFECT.powi(2) * taken.max(0.0)
}

/// What a fit would leave at the optimum that its linearised problem predicts, without the error of its grid.
pub(crate) fn square_at_optimum(fit: &Fit) -> f64 {
    let sensors = fit.runs.iter().flat_map(|r| &r.sensors);
    let of_grid: f64 = sensors.map(|s| s.time_s.len() as f64 * (fit.grid_error_m / s.white_noise_m).powi(2)).sum();
    (square(fit) * (1.0 - fit.predicted_reduction / fit.samples().max(1) as f64) - of_grid).max(0.0)
}

/// The scale of evidence that the residuals of a fit set.
pub(crate) fn evidence_scale(fit: &Fit, features: f64) -> EvidenceScale {
    let residuals: Vec<f64> = fit
        .runs
        .iter()
        .flat_map(|r| &r.sensors)
        .flat_map(|s| s.measured_m.iter().zip(&s.model_m).map(|(a, b)| (a - b) / s.white_noise_m))
        .collect();
    EvidenceScale::of(&residuals, features)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::problem::test_record::{HDPE, record};
    use crate::fit::search::calibrate::calibrate;
    use crate::fit::search::options::Options;
    use crate::model::RunValues;
    use crate::rig::Rig;
    use crate::signal::Tone;

    /// A pump that pulsates in one run excuses that run, by its share of the samples that are compared, and no other.
    #[test]
    fn what_oscillates_before_the_closure_is_not_held_against_a_model() {
        let rig = Rig::from_toml(HDPE, "rig.toml").unwrap();
        let run =
            RunValues { initial_velocity_m_s: 0.5, valve_head_m: 20.0, closing_time_s: 0.05, friction_scale: 1.0 };
        let mut runs = [1.0, 3.0].map(|duration_s| record(&rig, &[], &[380.0], run, 0.05, duration_s));
        let options = Options { most_reaches: 64, ..Options::default() };
        let fit = calibrate(&rig, &runs, &[], &options, &|_| {}).unwrap();
        let quiet = beyond(&fit, &runs);
        assert!(quiet.abs() < 0.1, "{quiet}");
        runs[0].sensors[0].lines = vec![Tone { hz: 3.0, amplitude_m: 3.0 * 2f64.sqrt() * 0.05 }];
        let [short, long] = [0, 1].map(|r: usize| fit.runs[r].sensors[0].time_s.len() as f64);
        let excused = 9.0 * short / (short + long);
        assert!(excused > 1.0 && (quiet - beyond(&fit, &runs) - excused).abs() < 1e-9, "{}", beyond(&fit, &runs));
    }
}
