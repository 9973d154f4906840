//! How well a model describes samples that it was not fitted to, and whether it predicts the last part of each record
//! from the first.

use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::problem::error::FitError;
use crate::fit::problem::fit_problem::{FitProblem, Window};
use crate::fit::problem::hum::without_hum;
use crate::fit::search::calibrator::Calibrator;
use crate::fit::search::finish::last_descent;
use crate::fit::search::options::{Effort, Options};
use crate::fit::validate::thresholds::FITTED_SHARE;
use crate::model::{Model, ModelError};
use crate::rig::Rig;

/// Squared errors of some samples.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Tally {
    /// Their sum, m².
    pub square: f64,
    /// Their number.
    pub n: usize,
}

impl Tally {
    /// Root mean square, m; infinite where there are none.
    pub fn rms_m(self) -> f64 {
        if self.n == 0 { f64::INFINITY } else { (self.square / self.n as f64).sqrt() }
    }

    /// Both together.
    pub fn with(self, other: Tally) -> Tally {
        Tally { square: self.square + other.square, n: self.n + other.n }
    }

    /// One more sample.
    pub fn add(&mut self, error: f64) {
        self.square += error * error;
        self.n += 1;
    }
}

/// The problem of all samples of `runs` on a fit's own grid.
pub fn problem_of<'a>(model: &'a Model<'a>, runs: &'a [RunData], reaches: usize) -> FitProblem<'a> {
    FitProblem::new(model, runs, Window { reaches, horizon_s: f64::INFINITY, stride: 1 })
}

/// Values of a problem's variables: those of `fit` where it has a parameter of that name and run, the start elsewhere.
pub fn carried(problem: &FitProblem, fit: &Fit) -> Vec<f64> {
    let file = |j: usize| problem.run_of(j).map(|r| problem.runs[r].file.as_str());
    let known = |j: usize, name: &str| fit.parameters.iter().find(|p| p.name == name && p.run.as_deref() == file(j));
    problem.parameters.iter().enumerate().map(|(j, p)| known(j, &p.name).map_or(p.start, |p| p.value)).collect()
}

/// Errors of a run's sensors after the start of the closure, from `after_s[r]` on the recording's clock, at values of
/// all variables.
///
/// # Errors
/// As [`Model::simulate`].
pub fn errors(problem: &FitProblem, r: usize, values: &[f64], after_s: f64) -> Result<Vec<Tally>, ModelError> {
    let traces = problem.modelled(r, values, problem.window().reaches)?.traces;
    let start = problem.closure_start_s(r, values);
    let sensors = problem.runs[r].sensors.iter().zip(&traces).enumerate();
    let tally = sensors.map(|(s, (sensor, trace))| {
        let from = sensor.time_s.partition_point(|&t| t <= after_s.max(start));
        let offset = problem.offset_m(r, s, values);
        let time_s = &sensor.time_s[from..];
        let left = time_s.iter().zip(&sensor.head_m[from..]).map(|(&t, &head)| head - offset - trace.at(t - start));
        let mut tally = Tally::default();
        without_hum(sensor, time_s, left.collect()).into_iter().for_each(|error| tally.add(error));
        tally
    });
    Ok(tally.collect())
}

/// RMSE over the last part of the records of a model that was fitted to the first, from where it stands and on its grid,
/// m; infinite where there is no last part.
///
/// # Errors
/// As [`refine`](crate::fit::search::calibrate::refine).
pub fn held_out_m(rig: &Rig, runs: &[RunData], fit: &Fit, options: &Options) -> Result<f64, FitError> {
    let ends: Vec<f64> = runs.iter().map(end_of_first_part_s).collect();
    let first: Vec<RunData> = runs.iter().zip(&ends).map(|(run, &end)| until(run, end)).collect();
    let options = Options { effort: Effort::Brief, ..options.clone() };
    let ctx = Calibrator::new(rig, &first, &options, &|_| {}, &fit.effects, Some(&fit.values()))?;
    let model = ctx.model(&fit.effects);
    let (fitted, end) = last_descent(&ctx, &model, fit.values(), fit.reaches)?;
    let (problem, values) = (problem_of(&model, runs, fit.reaches), fitted.values(&end.x));
    let mut all = Tally::default();
    for (r, &end) in ends.iter().enumerate() {
        all = errors(&problem, r, &values, end)?.into_iter().fold(all, Tally::with);
    }
    Ok(all.rms_m())
}

/// Where the part of a record that is fitted ends, on its clock, s.
pub fn end_of_first_part_s(run: &RunData) -> f64 {
    let start = run.start.closure_s.0;
    let last = run.sensors.iter().filter_map(|s| s.time_s.last().copied()).fold(start, f64::max);
    start + FITTED_SHARE * (last - start)
}

/// A run up to a time on its clock.
pub fn until(run: &RunData, end_s: f64) -> RunData {
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

/// A run without one of its sensors.
pub fn without(run: &RunData, sensor: &str) -> RunData {
    let kept = |i: usize| run.sensors[i].sensor.name != sensor;
    let indices: Vec<usize> = (0..run.sensors.len()).filter(|&i| kept(i)).collect();
    RunData {
        sensors: indices.iter().map(|&i| run.sensors[i].clone()).collect(),
        extrema: indices.iter().map(|&i| run.extrema[i].clone()).collect(),
        ..run.clone()
    }
}
