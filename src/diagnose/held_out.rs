//! Whether a model predicts what it was not fitted to: it is fitted to the first part of each record and predicts the rest.

use crate::fit::calibrate::{FitError, Options, refine};
use crate::fit::data::RunData;
use crate::fit::outcome::Fit;
use crate::fit::problem::{Calibration, Window};
use crate::model::Model;
use crate::rig::Rig;

/// Share of each record that is fitted.
const FITTED_SHARE: f64 = 0.6;
/// Iterations: the model has been fitted to the whole before.
const PATIENCE: usize = 8;

/// RMSE over the last part of the records of a model that was fitted to the first, m; infinite where there is no last part.
///
/// # Errors
/// As [`refine`].
pub fn held_out_m(rig: &Rig, runs: &[RunData], fit: &Fit, options: &Options) -> Result<f64, FitError> {
    let ends: Vec<f64> = runs.iter().map(end_of_first_part_s).collect();
    let first: Vec<RunData> = runs.iter().zip(&ends).map(|(run, &end)| until(run, end)).collect();
    let options = Options { patience: PATIENCE, most_reaches: fit.reaches, ..options.clone() };
    let fitted = refine(rig, &first, &fit.effects, &fit.values(), &options, &|_| {})?;
    let values = fitted.values();
    let water = &runs.first().ok_or(FitError::NoRun)?.conditions.water;
    let model = Model::new(rig, water, &fit.effects).constrained(&options.constraints).informed(&options.priors);
    let window = Window { reaches: fitted.reaches, horizon_s: f64::INFINITY, stride: 1 };
    let problem = Calibration::new(&model, runs, window);
    let (mut square, mut n) = (0.0, 0usize);
    for (r, run) in runs.iter().enumerate() {
        let traces = problem.modelled(r, &values, fitted.reaches)?.traces;
        let start = problem.closure_start_s(r, &values);
        for (s, (sensor, trace)) in run.sensors.iter().zip(&traces).enumerate() {
            let from = sensor.time_s.partition_point(|&t| t <= ends[r]);
            let offset = problem.offset_m(r, s, &values);
            for (&t, &head) in sensor.time_s[from..].iter().zip(&sensor.head_m[from..]) {
                square += (head - offset - trace.at(t - start)).powi(2);
                n += 1;
            }
        }
    }
    Ok(if n == 0 { f64::INFINITY } else { (square / n as f64).sqrt() })
}

fn end_of_first_part_s(run: &RunData) -> f64 {
    let start = run.start.closure_s.0;
    let last = run.sensors.iter().filter_map(|s| s.time_s.last().copied()).fold(start, f64::max);
    start + FITTED_SHARE * (last - start)
}

fn until(run: &RunData, end_s: f64) -> RunData {
    let mut first = run.clone();
    for sensor in &mut first.sensors {
        let n = sensor.time_s.partition_point(|&t| t <= end_s);
        sensor.time_s.truncate(n);
        sensor.head_m.truncate(n);
    }
    for found in &mut first.extrema {
        found.retain(|(t, ..)| *t <= end_s);
    }
    first
}
