//! Calibration of a model: from coarse to fine, from the first cycles to the whole record.
//!
//! A wave speed a few percent off is half a period late after twenty cycles, where least squares sees no way back. So the
//! fit starts with the first cycle and a half on a coarse grid, then takes in more of the record as the phase locks. Then the
//! grid is refined until halving its step changes less than the noise does.

use std::sync::atomic::{AtomicUsize, Ordering};

use super::compare::{Pair, mape_percent, rmse};
use super::data::RunData;
use super::least_squares::{Limits, Problem, Solution, Stop, jacobian, minimise};
use super::outcome::{Fit, FittedParameter, RunFit, SensorFit};
use super::problem::{Calibration, Window};
use super::sensor_choice::with_sensors;
use super::starts::{differing, starts_from, starts_of, take_over, vanish};
use super::uncertainty::{correlation, correlation_inflation, gauss_newton_step, standard_errors};
use crate::model::constraint::Constraint;
use crate::model::effects::Chosen;
use crate::model::{Model, ModelError};
use crate::rig::Rig;

/// Why a fit cannot be had.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the sentences say it
pub enum FitError {
    #[error("there is no run to fit")]
    NoRun,
    #[error(
        "{file}: no pressure sample lies after the start of the closure; check the closure's time with `surgescope inspect`"
    )]
    NoSample { file: String },
    #[error("the model has no parameter '{name}' to hold or to bound; it has {known}")]
    NoSuchParameter { name: String, known: String },
    #[error(transparent)]
    Model(#[from] ModelError),
}

/// What a fit is doing.
#[derive(Debug, Clone, PartialEq)]
pub struct Progress {
    /// The stage, in words.
    pub stage: String,
    /// Simulated reaches.
    pub reaches: usize,
    /// Iteration within the stage.
    pub iteration: usize,
    /// Root mean square of the weighted residuals: 1 is the noise.
    pub error_over_noise: f64,
}

/// How far a fit may go.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Most reaches of the grid.
    pub most_reaches: usize,
    /// Share of the noise that the grid's own error may have.
    pub grid_error_over_noise: f64,
    /// What has been settled about parameters.
    pub constraints: Vec<Constraint>,
}

impl Default for Options {
    fn default() -> Self {
        Options { most_reaches: 512, grid_error_over_noise: 0.3, constraints: Vec::new() }
    }
}

/// Reaches while the phase locks, and while models are chosen.
const LOCKING_REACHES: usize = 32;
const FIRST_REACHES: usize = 48;
const FINAL_REACHES: usize = 64;
/// How many of the places where an effect was tried are followed further.
const LET_GO: usize = 4;
/// Samples a sensor in the early stages.
const EARLY_SAMPLES: usize = 2500;
/// Half the mean square, in units of the noise's, above which a fit is too poor to grow a richer one from.
const POOR: f64 = 2.0;
/// Evidence (difference of BIC) that one more element must bring: "strong" on the scale of Kass & Raftery (1995).
const EVIDENCE: f64 = 6.0;

const GLANCE: Limits = Limits { iterations: 6, cost_tolerance: 1e-2, step_tolerance: 1e-7 };
const EARLY: Limits = Limits { iterations: 30, cost_tolerance: 3e-4, step_tolerance: 1e-7 };
const LATE: Limits = Limits { iterations: 60, cost_tolerance: 1e-5, step_tolerance: 1e-9 };

/// Pull of the grid on a parameter, in standard errors, that sends the fit to a finer one.
const MOST_PULL: f64 = 2.0;

/// What a finer grid changes.
struct Pull {
    /// At the samples, in units of their noise, rms.
    error_over_noise: f64,
    /// The same in m.
    error_m: f64,
    /// In the variables.
    shifts: Vec<f64>,
    /// Half the sum of squares that the unmoved variables leave on the finer grid.
    finer_cost: f64,
    /// The largest of these, in standard errors.
    over_errors: f64,
}

/// Where a fit of one model stands.
pub(super) struct State {
    pub(super) values: Vec<f64>,
    pub(super) cost: f64,
}

/// Fits the base model with `effects` to all `runs` at once.
///
/// Where an effect has elements and their number is not fixed, they are added one by one while the evidence asks for it. Where one
/// concerns a pressure sensor and none is named, it goes to the sensor at which a coarse fit is best.
///
/// # Errors
/// No run, a run without samples after its closure, a model that cannot be simulated at its start.
pub fn calibrate(
    rig: &Rig,
    runs: &[RunData],
    effects: &[Chosen],
    options: &Options,
    progress: &(dyn Fn(&Progress) + Sync),
) -> Result<Fit, FitError> {
    let first = runs.first().ok_or(FitError::NoRun)?;
    for run in runs {
        let any = run.sensors.iter().any(|s| s.time_s.last().is_some_and(|&t| t > run.start.closure_s.0));
        if !any {
            return Err(FitError::NoSample { file: run.file.clone() });
        }
    }
    let water = &first.conditions.water;
    let evaluations = AtomicUsize::new(0);
    let model_of = |effects: &[Chosen]| Model::new(rig, water, effects).constrained(&options.constraints);
    let model = model_of(effects);
    let starts: Vec<f64> = model.shared.iter().map(|p| p.start).collect();
    let fitter =
        Fitter { runs, options, progress, evaluations: &evaluations, least_reaches: model.least_reaches(&starts) };
    let mut chosen =
        with_sensors(rig, effects, |trial| Ok::<_, FitError>(fitter.approach(&model_of(trial), None)?.cost))?;
    // An effect with elements grows from one: a fit of many from scratch ends in poorer places.
    let growing = effects.iter().position(|c| c.effect.elements().is_some_and(|r| r.contains(&2)));
    let asked = growing.and_then(|i| effects[i].elements);
    if let Some(i) = growing {
        chosen[i] = chosen[i].with_elements(1);
    }
    let mut model = model_of(&chosen);
    let mut state = fitter.approach(&model, None)?;
    let most = growing.map_or(1, |i| asked.or(effects[i].effect.elements().map(|r| *r.end())).unwrap_or(1));
    let mut leftover = fitter.leftover(&model, &state)?;
    for elements in 2..=most {
        let Some(i) = growing else { break };
        let mut more = chosen.clone();
        more[i] = more[i].with_elements(elements);
        let bigger = model_of(&more);
        let trial = fitter.approach(&bigger, Some((&model, &state)))?;
        let trial_leftover = fitter.leftover(&bigger, &trial)?;
        if asked.is_none() && trial_leftover.evidence_over(&leftover) < EVIDENCE {
            break;
        }
        (chosen, model, state, leftover) = (more, bigger, trial, trial_leftover);
    }
    fitter.finish(&model, state)
}

/// Fits a model on from `values` of all its variables (shared ones, then each run's): to all samples, on as fine a grid as it takes.
///
/// # Errors
/// As [`calibrate`].
pub fn refine(
    rig: &Rig,
    runs: &[RunData],
    effects: &[Chosen],
    values: &[f64],
    options: &Options,
    progress: &(dyn Fn(&Progress) + Sync),
) -> Result<Fit, FitError> {
    let water = &runs.first().ok_or(FitError::NoRun)?.conditions.water;
    let model = Model::new(rig, water, effects).constrained(&options.constraints);
    let evaluations = AtomicUsize::new(0);
    let least_reaches = model.least_reaches(&values[..model.shared.len()]);
    let fitter = Fitter { runs, options, progress, evaluations: &evaluations, least_reaches };
    fitter.finish(&model, State { values: values.to_vec(), cost: f64::NAN })
}

/// What a fit leaves over.
struct Leftover {
    /// Samples.
    n: f64,
    /// Mean square of the weighted residuals: 1 is the noise.
    mean_square: f64,
    /// See [`correlation_inflation`].
    inflation: f64,
    /// Shared parameters of the model.
    parameters: f64,
}

impl Leftover {
    /// Fall of the Bayesian information criterion from `before`, with this (richer) model's effective number of samples.
    fn evidence_over(&self, before: &Leftover) -> f64 {
        let effective = self.n / self.inflation;
        effective * (before.mean_square / self.mean_square).ln()
            - (self.parameters - before.parameters) * effective.ln()
    }
}

struct Fitter<'a> {
    runs: &'a [RunData],
    options: &'a Options,
    progress: &'a (dyn Fn(&Progress) + Sync),
    evaluations: &'a AtomicUsize,
    /// What the pipes need at the least.
    least_reaches: usize,
}

impl Fitter<'_> {
    fn window(&self, reaches: usize, horizon_s: f64) -> Window {
        let reaches = reaches.max(self.least_reaches);
        let samples = self.runs.iter().flat_map(|r| &r.sensors).map(|s| {
            let (a, b) = (s.time_s.first().copied().unwrap_or(0.0), s.time_s.last().copied().unwrap_or(0.0));
            let share = (horizon_s / (b - a).max(1e-9)).min(1.0);
            (s.time_s.len() as f64 * share) as usize
        });
        let stride = (samples.max().unwrap_or(0) / EARLY_SAMPLES).max(1);
        Window { reaches, horizon_s, stride }
    }

    fn whole(&self, reaches: usize) -> Window {
        Window { stride: 1, ..self.window(reaches, f64::INFINITY) }
    }

    fn minimise(
        &self,
        problem: &Calibration,
        values: &[f64],
        limits: Limits,
        stage: &str,
    ) -> Result<Solution, ModelError> {
        let n = problem.samples().max(1) as f64;
        let reaches = problem.window().reaches;
        let solution = minimise(problem, &problem.variables(values), limits, |iteration, cost| {
            (self.progress)(&Progress {
                stage: stage.to_owned(),
                reaches,
                iteration,
                error_over_noise: (2.0 * cost / n).sqrt(),
            });
        })?;
        self.evaluations.fetch_add(solution.evaluations * self.runs.len(), Ordering::Relaxed);
        Ok(solution)
    }

    /// Fits a model on a coarse grid: from the signals, or from a smaller model that is already fitted.
    fn approach(&self, model: &Model, smaller: Option<(&Model, &State)>) -> Result<State, FitError> {
        let mut problem = Calibration::new(model, self.runs, self.window(FIRST_REACHES, f64::INFINITY));
        let base: Vec<f64> = problem.parameters.iter().map(|p| p.start).collect();
        let period_s = model.period_s(&base[..model.shared.len()]);
        let label = model.effects.iter().map(Chosen::label).collect::<Vec<_>>().join(" + ");
        let label = if label.is_empty() { "base model".to_owned() } else { label };
        let attempt = |problem: &mut Calibration, values: &[f64], horizon_s: f64, limits: Limits| {
            let reaches = if horizon_s.is_finite() { LOCKING_REACHES } else { FIRST_REACHES };
            let reaches = model.fitting_reaches(&values[..model.shared.len()], reaches);
            problem.set_window(self.window(reaches, horizon_s));
            let solution = self.minimise(problem, values, limits, &label)?;
            Ok::<State, ModelError>(State { values: problem.values(&solution.x), cost: solution.cost })
        };
        let mut candidates = Vec::new();
        if let Some((small, state)) = smaller {
            candidates.extend(starts_from(model, small, state, &base));
        }
        // A good smaller model is the best start; a poor one has its parameters in the wrong places.
        if smaller.is_none_or(|(_, state)| state.cost > POOR * problem.samples() as f64) {
            let (scanned, few): (Vec<_>, Vec<_>) = starts_of(model, &base).into_iter().partition(|s| s.of_many);
            let scanned = if smaller.is_none() { scanned } else { Vec::new() };
            let places = differing(&scanned, &base);
            let mut locked = Vec::new();
            for mut start in few {
                // The phase locks without what may be anywhere: in the wrong place it would draw all else with it.
                let still = match smaller {
                    Some((small, state)) => {
                        take_over(&mut start.values, model, small, state);
                        Vec::new()
                    }
                    None => vanish(&mut start.values, &scanned, model),
                };
                problem.hold(&still, &start.values);
                let first = attempt(&mut problem, &start.values, 1.5 * period_s, EARLY)?;
                locked.push(attempt(&mut problem, &first.values, 5.0 * period_s, EARLY)?);
            }
            locked.sort_by(|a, b| a.cost.total_cmp(&b.cost));
            // An effect that may be anywhere is held in one place after the other, with all else free; then the best are let go.
            let mut glimpsed = vec![];
            for start in &scanned {
                let mut values = locked[0].values.clone();
                values[start.effect.clone()].copy_from_slice(&start.values[start.effect.clone()]);
                problem.hold(&places, &values);
                glimpsed.push(attempt(&mut problem, &values, 1.5 * period_s, GLANCE)?);
            }
            glimpsed.sort_by(|a, b| a.cost.total_cmp(&b.cost));
            problem.hold(&[], &base);
            if !places.is_empty() {
                glimpsed.truncate(LET_GO);
                glimpsed.extend(locked.drain(..1));
                locked.clear();
            }
            for glimpse in &glimpsed {
                let first = attempt(&mut problem, &glimpse.values, 1.5 * period_s, EARLY)?;
                locked.push(attempt(&mut problem, &first.values, 5.0 * period_s, EARLY)?);
            }
            locked.sort_by(|a, b| a.cost.total_cmp(&b.cost));
            // The best two by the first cycles see the whole record.
            candidates.extend(locked.into_iter().take(2).map(|s| s.values));
        }
        // A few iterations each, then the best goes on.
        let mut best: Option<State> = None;
        for values in candidates {
            let state = attempt(&mut problem, &values, f64::INFINITY, GLANCE)?;
            if best.as_ref().is_none_or(|b| state.cost < b.cost) {
                best = Some(state);
            }
        }
        let best = best.ok_or(FitError::NoRun)?;
        Ok(attempt(&mut problem, &best.values, f64::INFINITY, EARLY)?)
    }

    /// What a coarse fit leaves over.
    fn leftover(&self, model: &Model, state: &State) -> Result<Leftover, ModelError> {
        let reaches = model.fitting_reaches(&state.values[..model.shared.len()], FIRST_REACHES);
        let problem = Calibration::new(model, self.runs, self.window(reaches, f64::INFINITY));
        let residuals = problem.residuals(&problem.variables(&state.values))?;
        let samples = &residuals[..problem.samples()];
        let n = samples.len().max(1) as f64;
        Ok(Leftover {
            n,
            mean_square: samples.iter().map(|r| r * r).sum::<f64>() / n,
            inflation: correlation_inflation(samples),
            parameters: model.shared.len() as f64,
        })
    }

    /// Refines the grid until its error is small against the noise and its pull on the parameters against their standard errors,
    /// then fits all samples on a grid of half that step and puts the result together.
    fn finish(&self, model: &Model, state: State) -> Result<Fit, FitError> {
        let mut values = state.values;
        let mut reaches = FINAL_REACHES.max(self.least_reaches);
        let (fine, pull) = loop {
            let fitting = |n: usize| model.fitting_reaches(&values[..model.shared.len()], n);
            let (coarse, fine) = (fitting(reaches), fitting(2 * reaches));
            let problem = Calibration::new(model, self.runs, self.window(coarse, f64::INFINITY));
            let solution = self.minimise(&problem, &values, LATE, &format!("{coarse} reaches"))?;
            values = problem.values(&solution.x);
            let pull = self.grid_pull(&problem, &solution, fine)?;
            // A second order scheme's own limit lies a third further on than half the step. Where the data hardly tell two
            // parameters apart the step may lead astray: the finer grid decides.
            let mut further = values.clone();
            for (j, value) in further.iter_mut().enumerate() {
                let by = pull.shifts[j] * 4.0 / 3.0;
                *value = (*value + problem.stretch(j, *value) * by)
                    .clamp(problem.parameters[j].lower, problem.parameters[j].upper);
            }
            let finer = Calibration::new(model, self.runs, self.window(fine, f64::INFINITY));
            let moved = finer.residuals(&finer.variables(&further)).map(|r| 0.5 * r.iter().map(|r| r * r).sum::<f64>());
            self.evaluations.fetch_add(self.runs.len(), Ordering::Relaxed);
            if moved.is_ok_and(|cost| cost < pull.finer_cost) {
                values = further;
            }
            let settled = pull.error_over_noise <= self.options.grid_error_over_noise && pull.over_errors <= MOST_PULL;
            if settled || 4 * reaches > self.options.most_reaches {
                break (fine, pull);
            }
            reaches *= 2;
        };
        // What is held stands under its own name.
        if model.constraints.is_empty() {
            model.put_in_order(&mut values);
        }
        let problem = Calibration::new(model, self.runs, self.whole(fine));
        problem.know(&model.constraints)?;
        let solution = self.minimise(&problem, &values, LATE, "all samples")?;
        self.outcome(&problem, &solution, &pull)
    }

    /// What a finer grid would change: at the samples, and by one Gauss-Newton step in the parameters.
    fn grid_pull(&self, problem: &Calibration, solution: &Solution, fine: usize) -> Result<Pull, ModelError> {
        let mut finer = Calibration::new(problem.model, self.runs, problem.window());
        finer.set_window(Window { reaches: fine, ..problem.window() });
        let residuals = finer.residuals(&solution.x)?;
        let columns = jacobian(problem, &solution.x, &solution.residuals)?;
        self.evaluations.fetch_add((columns.len() + 1) * self.runs.len(), Ordering::Relaxed);
        let errors = standard_errors(&columns, &solution.residuals, problem.samples(), &solution.at_bound);
        let change: Vec<f64> = residuals.iter().zip(&solution.residuals).map(|(f, c)| f - c).collect();
        let shifts = gauss_newton_step(&columns, &change, &solution.at_bound);
        let n = problem.samples().max(1);
        let over_errors =
            shifts.iter().zip(&errors).filter(|(_, e)| e.is_finite()).map(|(s, e)| s.abs() / e).fold(0.0, f64::max);
        let square = |weights: &dyn Fn(usize) -> f64| {
            (change[..n].iter().enumerate().map(|(i, c)| (c * weights(i)).powi(2)).sum::<f64>() / n as f64).sqrt()
        };
        let noise = problem.sample_noise();
        let finer_cost = 0.5 * residuals.iter().map(|r| r * r).sum::<f64>();
        let (error_over_noise, error_m) = (square(&|_| 1.0), square(&|i| noise[i]));
        Ok(Pull { error_over_noise, error_m, shifts, finer_cost, over_errors })
    }

    fn outcome(&self, problem: &Calibration, solution: &Solution, pull: &Pull) -> Result<Fit, FitError> {
        let values = problem.values(&solution.x);
        let start_values: Vec<f64> = problem.parameters.iter().map(|p| p.start).collect();
        let columns = jacobian(problem, &solution.x, &solution.residuals)?;
        self.evaluations.fetch_add(columns.len() * self.runs.len(), Ordering::Relaxed);
        let errors = standard_errors(&columns, &solution.residuals, problem.samples(), &solution.at_bound);
        let model = problem.model;
        let parameters = problem
            .parameters
            .iter()
            .enumerate()
            .map(|(j, p)| FittedParameter {
                name: p.name.clone(),
                about: p.about,
                run: problem.run_of(j).map(|r| self.runs[r].file.clone()),
                value: values[j],
                // A quarter of the pull is left on the last grid; half of it allows for schemes of first order.
                standard_error: if p.lower < p.upper {
                    errors[j].hypot(0.5 * pull.shifts[j]) * problem.stretch(j, values[j])
                } else {
                    0.0
                },
                unit: p.unit,
                at_bound: solution.at_bound[j] && p.lower < p.upper,
                lower: p.lower,
                upper: p.upper,
                held: p.lower == p.upper,
            })
            .collect();
        let period_s = model.period_s(&values[..model.shared.len()]);
        let reaches = problem.window().reaches;
        let runs = (0..self.runs.len())
            .map(|r| self.run_fit(problem, r, &values, &start_values, reaches, period_s))
            .collect::<Result<_, _>>()?;
        Ok(Fit {
            effects: model.effects.iter().map(Chosen::label).collect(),
            runs,
            parameters,
            correlation: correlation(&columns, &solution.at_bound),
            reaches,
            grid_error_m: 0.25 * pull.error_m,
            evaluations: self.evaluations.load(Ordering::Relaxed),
            seconds: f64::NAN,
            stopped_because: solution.stop.describe().to_owned(),
            converged: solution.stop != Stop::IterationsSpent,
        })
    }

    fn run_fit(
        &self,
        problem: &Calibration,
        r: usize,
        values: &[f64],
        start_values: &[f64],
        reaches: usize,
        period_s: f64,
    ) -> Result<RunFit, ModelError> {
        let run = &self.runs[r];
        let traces = problem.modelled(r, values, reaches)?.traces;
        let first_traces = problem.modelled(r, start_values, reaches)?.traces;
        let start = problem.closure_start_s(r, values);
        let first_start = problem.closure_start_s(r, start_values);
        let mut sensors = Vec::new();
        for (s, sensor) in run.sensors.iter().enumerate() {
            let offset = problem.offset_m(r, s, values);
            let from = sensor.time_s.partition_point(|&t| t < start);
            let time_s: Vec<f64> = sensor.time_s[from..].iter().map(|t| t - start).collect();
            let measured_m = sensor.head_m[from..].to_vec();
            let model_m: Vec<f64> = time_s.iter().map(|&t| offset + traces[s].at(t)).collect();
            let before: Vec<f64> = time_s.iter().map(|&t| first_traces[s].at(t + start - first_start)).collect();
            let found: Vec<_> = run.extrema[s].iter().map(|&(t, cycle, peak)| (t - start, cycle, peak)).collect();
            let pair =
                Pair { time_s: &time_s, measured_m: &measured_m, model_m: &model_m, noise_m: sensor.noise_m, period_s };
            let extrema = pair.extrema(&found);
            sensors.push(SensorFit {
                name: sensor.sensor.name.clone(),
                position_m: sensor.sensor.position_m,
                noise_m: sensor.noise_m,
                rmse_m: rmse(&measured_m, &model_m),
                start_rmse_m: rmse(&measured_m, &before),
                extrema,
                time_s,
                measured_m,
                model_m,
            });
        }
        // Over all samples of all sensors: each sensor's mean square weighs as its number of samples.
        let total = sensors.iter().map(|s| s.time_s.len()).sum::<usize>().max(1) as f64;
        let pooled = |f: &dyn Fn(&SensorFit) -> f64| {
            (sensors.iter().map(|s| f(s).powi(2) * s.time_s.len() as f64).sum::<f64>() / total).sqrt()
        };
        Ok(RunFit {
            file: run.file.clone(),
            rmse_m: pooled(&|s| s.rmse_m),
            noise_m: pooled(&|s| s.noise_m),
            mape_extrema_percent: mape_percent(sensors.iter().flat_map(|s| &s.extrema)),
            sensors,
        })
    }
}
