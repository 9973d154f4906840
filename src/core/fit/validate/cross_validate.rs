//! Cross-validation: a model is fitted without one sensor, one run, or the last part of the time, and predicts what was
//! left out.
//!
//! Stone (1974), *J. R. Stat. Soc. B* 36, 111. The zero of a sensor left out comes from its samples before the closure;
//! the values of a run left out come from its signals, as in [`crate::fit::validate::predict`].

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::{Fit, SensorFit};
use crate::fit::problem::error::FitError;
use crate::fit::problem::fit_problem::FitProblem;
use crate::fit::search::calibrate::{calibrate, refine};
use crate::fit::search::options::Options;
use crate::fit::validate::held_out::{Tally, carried, end_of_first_part_s, errors, problem_of, until, without};
use crate::fit::validate::predict::{Known, predict};
use crate::model::Model;
use crate::model::constraint::Constraint;
use crate::model::effects::Chosen;
use crate::rig::Rig;

/// The kind of data that is left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum By {
    /// One pressure sensor, in all runs.
    Sensors,
    /// One run.
    Runs,
    /// The last 40% of each record.
    Time,
}

/// One fit without some of the data.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Fold {
    /// What kind of data is left out.
    pub by: By,
    /// What is left out: a sensor, a run, a stretch of time.
    pub left_out: String,
    /// Samples left out.
    pub samples: usize,
    /// Error over them of the model that was fitted without them, m.
    pub held_out_m: f64,
    /// Error over the same samples of the model that was fitted to all, m.
    pub in_fit_m: f64,
    /// Noise of the same samples, m.
    pub noise_m: f64,
}

/// A model cross-validated.
#[derive(Debug, Clone, PartialEq)]
pub struct CrossValidation {
    /// The model fitted to all.
    pub fit: Fit,
    /// Each fold.
    pub folds: Vec<Fold>,
    /// What could not be left out, and why.
    pub skipped: Vec<String>,
}

/// The folds of one kind, or all, together.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Pooled {
    /// Error held out, m.
    pub held_out_m: f64,
    /// Error of the same samples in the fit to all, m.
    pub in_fit_m: f64,
    /// Their noise, m.
    pub noise_m: f64,
    /// Error held out over the noise, each sample in units of its own.
    pub held_out_over_noise: f64,
    /// The same of the error in the fit.
    pub in_fit_over_noise: f64,
}

impl CrossValidation {
    /// The folds of a kind, each weighing as its samples; none where there is no fold of it.
    pub fn pooled(&self, by: By) -> Option<Pooled> {
        let folds: Vec<&Fold> = self.folds.iter().filter(|f| f.by == by && f.samples > 0).collect();
        let samples: f64 = folds.iter().map(|f| f.samples as f64).sum();
        let mean = |of: &dyn Fn(&Fold) -> f64| {
            (folds.iter().map(|f| f.samples as f64 * of(f).powi(2)).sum::<f64>() / samples).sqrt()
        };
        (!folds.is_empty()).then(|| Pooled {
            held_out_m: mean(&|f| f.held_out_m),
            in_fit_m: mean(&|f| f.in_fit_m),
            noise_m: mean(&|f| f.noise_m),
            held_out_over_noise: mean(&|f| f.held_out_m / f.noise_m),
            in_fit_over_noise: mean(&|f| f.in_fit_m / f.noise_m),
        })
    }

    /// The kinds that there are folds of.
    pub fn kinds(&self) -> Vec<By> {
        [By::Sensors, By::Runs, By::Time].into_iter().filter(|by| self.folds.iter().any(|f| f.by == *by)).collect()
    }
}

/// Fits a model to all, then without each part of the data in turn; `progress` receives how many of the folds are done.
///
/// # Errors
/// As [`calibrate`].
pub fn cross_validate(
    rig: &Rig,
    runs: &[RunData],
    effects: &[Chosen],
    by: &[By],
    options: &Options,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<CrossValidation, FitError> {
    progress("the fit to all");
    let fit = calibrate(rig, runs, effects, options, &|_| {})?;
    let (plans, skipped) = plans(runs, &fit, by);
    let done = AtomicUsize::new(0);
    let options = Options { most_reaches: fit.reaches.max(8), ..options.clone() };
    let folds = plans.par_iter().map(|plan| {
        let fold = plan.fold(rig, runs, &fit, &options);
        progress(&format!("{} of {} folds", 1 + done.fetch_add(1, Ordering::Relaxed), plans.len()));
        fold
    });
    let folds = folds.collect::<Result<Vec<Fold>, FitError>>()?;
    Ok(CrossValidation { fit, folds, skipped })
}

/// What one fold leaves out.
enum Plan {
    Sensor(String),
    Run(usize),
    Time,
}

/// The folds that are possible, and why others are not.
fn plans(runs: &[RunData], fit: &Fit, by: &[By]) -> (Vec<Plan>, Vec<String>) {
    let (mut plans, mut skipped) = (Vec::new(), Vec::new());
    for kind in by {
        match kind {
            By::Sensors if runs.iter().any(|r| r.sensors.len() < 2) => {
                skipped.push("no sensor can be left out: a run has a single pressure sensor".to_owned());
            }
            By::Sensors => {
                let mut names: Vec<&str> = Vec::new();
                for sensor in runs.iter().flat_map(|r| &r.sensors) {
                    if !names.contains(&sensor.sensor.name.as_str()) {
                        names.push(&sensor.sensor.name);
                    }
                }
                for name in names {
                    match fit.effects.iter().find(|c| c.sensor.as_deref() == Some(name)) {
                        Some(effect) => {
                            skipped.push(format!("{name} is not left out: {} is at this sensor", effect.label()))
                        }
                        None => plans.push(Plan::Sensor(name.to_owned())),
                    }
                }
            }
            By::Runs if runs.len() < 2 => {
                skipped.push("no run can be left out: there is a single recording".to_owned());
            }
            By::Runs => plans.extend((0..runs.len()).map(Plan::Run)),
            By::Time => plans.push(Plan::Time),
        }
    }
    (plans, skipped)
}

impl Plan {
    fn fold(&self, rig: &Rig, runs: &[RunData], fit: &Fit, options: &Options) -> Result<Fold, FitError> {
        match self {
            Plan::Sensor(name) => without_sensor(name, rig, runs, fit, options),
            Plan::Run(r) => without_run(*r, rig, runs, fit, options),
            Plan::Time => without_end(rig, runs, fit, options),
        }
    }
}

/// The model on some runs, with the fit's constraints.
fn model_of<'a>(rig: &'a Rig, runs: &[RunData], effects: &[Chosen], options: &Options) -> Result<Model<'a>, FitError> {
    let water = &runs.first().ok_or(FitError::NoRun)?.conditions.water;
    Ok(Model::new(rig, water, effects).constrained(&options.constraints).informed(&options.priors))
}

/// Fits again without some of the data, from the values that fitted all.
fn refitted(rig: &Rig, runs: &[RunData], fit: &Fit, options: &Options) -> Result<Fit, FitError> {
    // Constraints on a sensor or a run that is left out do not apply.
    let model = model_of(rig, runs, &fit.effects, &Options::default())?;
    let problem = problem_of(&model, runs, fit.reaches);
    let has = |c: &&Constraint| {
        let run = |j: usize| problem.run_of(j).map(|r| runs[r].file.as_str());
        problem.parameters.iter().enumerate().any(|(j, p)| c.concerns(&p.name, run(j)))
    };
    let constraints = options.constraints.iter().filter(has).cloned().collect();
    refine(rig, runs, &fit.effects, &carried(&problem, fit), &Options { constraints, ..options.clone() }, &|_| {})
}

fn fold(by: By, left_out: String, held_out: Tally, in_fit: Tally, noise: Tally) -> Fold {
    Fold {
        by,
        left_out,
        samples: held_out.n,
        held_out_m: held_out.rms_m(),
        in_fit_m: in_fit.rms_m(),
        noise_m: noise.rms_m(),
    }
}

/// Errors in the fit to all, and noise, of the samples of a sensor more than `after_s` after the start of the closure.
fn known_of(sensor: &SensorFit, after_s: f64) -> (Tally, Tally) {
    let from = sensor.time_s.partition_point(|&t| t <= after_s);
    let (mut in_fit, mut noise) = (Tally::default(), Tally::default());
    for (measured, model) in sensor.measured_m[from..].iter().zip(&sensor.model_m[from..]) {
        in_fit.add(measured - model);
        noise.add(sensor.noise_m);
    }
    (in_fit, noise)
}

fn without_sensor(name: &str, rig: &Rig, runs: &[RunData], fit: &Fit, options: &Options) -> Result<Fold, FitError> {
    let fewer: Vec<RunData> = runs.iter().map(|run| without(run, name)).collect();
    let fitted = refitted(rig, &fewer, fit, options)?;
    let model = model_of(rig, runs, &fit.effects, &Options::default())?;
    let problem = problem_of(&model, runs, fitted.reaches);
    let mut values = carried(&problem, &fitted);
    let [mut held_out, mut in_fit, mut noise] = [Tally::default(); 3];
    for (r, run) in runs.iter().enumerate() {
        let Some(s) = run.sensors.iter().position(|s| s.sensor.name == name) else { continue };
        values[problem.offset_variable(r, s)] = zero_before(&problem, r, s, &values)?;
        held_out = held_out.with(errors(&problem, r, &values, f64::NEG_INFINITY)?[s]);
        let (of_fit, of_noise) = known_of(&fit.runs[r].sensors[s], 0.0);
        (in_fit, noise) = (in_fit.with(of_fit), noise.with(of_noise));
    }
    Ok(fold(By::Sensors, name.to_owned(), held_out, in_fit, noise))
}

/// Zero error of a sensor from the samples before the closure, m.
fn zero_before(problem: &FitProblem, r: usize, s: usize, values: &[f64]) -> Result<f64, FitError> {
    let steady_m = problem.modelled(r, values, problem.window().reaches)?.traces[s].values[0];
    let (sensor, start) = (&problem.runs[r].sensors[s], problem.closure_start_s(r, values));
    let n = sensor.time_s.partition_point(|&t| t < start);
    Ok(if n == 0 { 0.0 } else { sensor.head_m[..n].iter().map(|h| h - steady_m).sum::<f64>() / n as f64 })
}

fn without_run(r: usize, rig: &Rig, runs: &[RunData], fit: &Fit, options: &Options) -> Result<Fold, FitError> {
    let others: Vec<RunData> = runs.iter().enumerate().filter(|(i, _)| *i != r).map(|(_, run)| run.clone()).collect();
    let fitted = refitted(rig, &others, fit, options)?;
    // Constraints on the run itself still hold.
    let own: Vec<Constraint> =
        options.constraints.iter().filter(|c| c.holds() && c.run.as_ref() == Some(&runs[r].file)).cloned().collect();
    let predicted = predict(rig, &runs[r..=r], &Known::of(&fitted), &own, options, &|_| {})?;
    let [mut held_out, mut in_fit, mut noise] = [Tally::default(); 3];
    for (sensor, known) in predicted.fit.runs[0].sensors.iter().zip(&fit.runs[r].sensors) {
        held_out = held_out.with(known_of(sensor, predicted.known_until_s).0);
        let (of_fit, of_noise) = known_of(known, predicted.known_until_s);
        (in_fit, noise) = (in_fit.with(of_fit), noise.with(of_noise));
    }
    Ok(fold(By::Runs, runs[r].file.clone(), held_out, in_fit, noise))
}

fn without_end(rig: &Rig, runs: &[RunData], fit: &Fit, options: &Options) -> Result<Fold, FitError> {
    let ends: Vec<f64> = runs.iter().map(end_of_first_part_s).collect();
    let first: Vec<RunData> = runs.iter().zip(&ends).map(|(run, &end)| until(run, end)).collect();
    let fitted = refitted(rig, &first, fit, options)?;
    let model = model_of(rig, runs, &fit.effects, &Options::default())?;
    let problem = problem_of(&model, runs, fitted.reaches);
    let (values, at_all) = (carried(&problem, &fitted), carried(&problem, fit));
    let [mut held_out, mut in_fit, mut noise] = [Tally::default(); 3];
    for (r, &end) in ends.iter().enumerate() {
        held_out = errors(&problem, r, &values, end)?.into_iter().fold(held_out, Tally::with);
        for sensor in &fit.runs[r].sensors {
            let (of_fit, of_noise) = known_of(sensor, end - problem.closure_start_s(r, &at_all));
            (in_fit, noise) = (in_fit.with(of_fit), noise.with(of_noise));
        }
    }
    let from = ends.iter().zip(runs).map(|(end, run)| end - run.start.closure_s.0);
    let from: Vec<String> = from.map(|s| format!("{s:.3} s")).collect();
    Ok(fold(By::Time, format!("after {}", from.join(", ")), held_out, in_fit, noise))
}
