//! The way to a fit: from the signals or from a smaller model, on a coarse grid, from the first cycles to the whole record.

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use crate::fit::data::run_data::RunData;
use crate::fit::numeric::least_squares::{Limits, Problem, Solution, minimise};
use crate::fit::numeric::uncertainty::correlation_inflation;
use crate::fit::problem::fit_problem::{Calibration, Window};
use crate::fit::search::calibrate::{FitError, Options, Progress};
use crate::fit::search::starts::{differing, drawn, starts_from, starts_of, take_over, vanish};
use crate::model::effects::Chosen;
use crate::model::{Model, ModelError};
use crate::rig::{Rig, WaterProperties};

/// Reaches while the phase locks, and while models are chosen.
const LOCKING_REACHES: usize = 32;
pub(crate) const FIRST_REACHES: usize = 48;
/// How many of the places where an effect was tried are followed further.
const LET_GO: usize = 4;
/// Samples a sensor in the early stages.
const EARLY_SAMPLES: usize = 2500;
/// Half the mean square, in units of the noise's, above which a fit is too poor to grow a richer one from.
const POOR: f64 = 2.0;

/// How many times the best fit's sum of squares a start may leave to be worth a descent.
const HOPELESS: f64 = 30.0;

const STILL: Limits = Limits { iterations: 0, ..GLANCE };
const GLANCE: Limits = Limits { iterations: 6, cost_tolerance: 1e-2, step_tolerance: 1e-7, thorough: false };
const EARLY: Limits = Limits { iterations: 30, cost_tolerance: 3e-4, step_tolerance: 1e-7, thorough: false };

/// Where a fit of one model stands.
pub(crate) struct State {
    pub(crate) values: Vec<f64>,
    pub(crate) cost: f64,
}

fn sorted(mut states: Vec<State>) -> Vec<State> {
    states.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    states
}

/// What a fit leaves over.
pub(crate) struct Leftover {
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
    /// Of weighted residuals that a model with so many shared parameters leaves.
    pub(crate) fn of(samples: &[f64], parameters: usize) -> Self {
        let n = samples.len().max(1) as f64;
        let mean_square = samples.iter().map(|r| r * r).sum::<f64>() / n;
        Leftover { n, mean_square, inflation: correlation_inflation(samples), parameters: parameters as f64 }
    }

    /// Fall of the Bayesian information criterion from `before`, with this (richer) model's effective number of samples.
    pub(crate) fn evidence_over(&self, before: &Leftover) -> f64 {
        let effective = self.n / self.inflation;
        effective * (before.mean_square / self.mean_square).ln()
            - (self.parameters - before.parameters) * effective.ln()
    }
}

/// Fits models to runs.
pub(crate) struct Fitter<'a> {
    pub(crate) rig: &'a Rig,
    pub(crate) water: &'a WaterProperties,
    pub(crate) runs: &'a [RunData],
    pub(crate) options: &'a Options,
    pub(crate) progress: &'a (dyn Fn(&Progress) + Sync),
    /// Simulations so far.
    pub(crate) evaluations: AtomicUsize,
    /// What the pipes need at the least.
    pub(crate) least_reaches: usize,
}

impl Fitter<'_> {
    pub(crate) fn window(&self, reaches: usize, horizon_s: f64) -> Window {
        let reaches = reaches.max(self.least_reaches);
        let samples = self.runs.iter().flat_map(|r| &r.sensors).map(|s| {
            let (a, b) = (s.time_s.first().copied().unwrap_or(0.0), s.time_s.last().copied().unwrap_or(0.0));
            let share = (horizon_s / (b - a).max(1e-9)).min(1.0);
            (s.time_s.len() as f64 * share) as usize
        });
        let stride = (samples.max().unwrap_or(0) / EARLY_SAMPLES).max(1);
        Window { reaches, horizon_s, stride }
    }

    /// Counts evaluations of all runs.
    pub(crate) fn count(&self, evaluations: usize) {
        self.evaluations.fetch_add(evaluations * self.runs.len(), Ordering::Relaxed);
    }

    pub(crate) fn whole(&self, reaches: usize) -> Window {
        Window { stride: 1, ..self.window(reaches, f64::INFINITY) }
    }

    pub(crate) fn minimise(
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
        self.count(solution.evaluations);
        Ok(solution)
    }

    /// Fits a model on a coarse grid: from the signals, or from a smaller model that is already fitted.
    pub(crate) fn approach(&self, model: &Model, smaller: Option<(&Model, &State)>) -> Result<State, FitError> {
        let problem = Calibration::new(model, self.runs, self.window(FIRST_REACHES, f64::INFINITY));
        let base: Vec<f64> = problem.parameters.iter().map(|p| p.start).collect();
        let mut candidates = Vec::new();
        // A good smaller model is the best start; a poor one has its parameters in the wrong places.
        if smaller.is_none_or(|(_, state)| state.cost > POOR * problem.samples() as f64) {
            // The best by the first cycles see the whole record.
            let locked = self.locked(model, smaller, &base)?;
            candidates.extend(locked.into_iter().take(2 + self.options.starts / 4).map(|s| s.values));
        }
        if let Some((small, state)) = smaller {
            candidates.extend(starts_from(model, small, state, &base));
        }
        self.best_of(model, &candidates)
    }

    /// Fits of the first cycles from all that signals, effects and chance propose, the best first.
    fn locked(&self, model: &Model, smaller: Option<(&Model, &State)>, base: &[f64]) -> Result<Vec<State>, ModelError> {
        let period_s = model.period_s(&base[..model.shared.len()]);
        let random = drawn(model, base, self.options.starts, self.options.seed);
        let (scanned, few): (Vec<_>, Vec<_>) =
            starts_of(model, base).into_iter().chain(random).partition(|s| s.of_many);
        let scanned = if smaller.is_none() { scanned } else { Vec::new() };
        let places = differing(&scanned, base);
        let from = few.into_par_iter().map(|mut start| {
            // The phase locks without what may be anywhere: in the wrong place it would draw all else with it.
            let still = match smaller {
                Some((small, state)) => {
                    take_over(&mut start.values, model, small, state);
                    Vec::new()
                }
                None => vanish(&mut start.values, &scanned, model),
            };
            self.lock(model, &still, &start.values, period_s)
        });
        let mut locked = sorted(from.collect::<Result<_, _>>()?);
        if places.is_empty() {
            return Ok(locked);
        }
        // An effect that may be anywhere is held in one place after the other, with all else free; then the best are let go.
        locked.truncate(1);
        let glimpsed = scanned.par_iter().map(|start| {
            let mut values = locked[0].values.clone();
            values[start.effect.clone()].copy_from_slice(&start.values[start.effect.clone()]);
            self.attempt(model, &places, &values, 1.5 * period_s, GLANCE)
        });
        let mut glimpsed = sorted(glimpsed.collect::<Result<_, _>>()?);
        glimpsed.truncate(LET_GO);
        glimpsed.append(&mut locked);
        let let_go = glimpsed.par_iter().map(|glimpse| self.lock(model, &[], &glimpse.values, period_s));
        Ok(sorted(let_go.collect::<Result<_, _>>()?))
    }

    /// Fits a model on a coarse grid from one with an element less alone.
    pub(crate) fn grow(&self, model: &Model, smaller: &Model, state: &State) -> Result<State, FitError> {
        let problem = Calibration::new(model, self.runs, self.window(FIRST_REACHES, f64::INFINITY));
        let base: Vec<f64> = problem.parameters.iter().map(|p| p.start).collect();
        self.best_of(model, &starts_from(model, smaller, state, &base))
    }

    /// A few iterations from each start that is not hopeless, then the best goes on.
    fn best_of(&self, model: &Model, starts: &[Vec<f64>]) -> Result<State, FitError> {
        let mut best: Option<State> = None;
        for values in starts {
            let still = best.as_ref().map(|_| self.attempt(model, &[], values, f64::INFINITY, STILL)).transpose()?;
            let hopeless = still.zip(best.as_ref()).is_some_and(|(still, best)| still.cost > HOPELESS * best.cost);
            if hopeless {
                continue;
            }
            let state = self.attempt(model, &[], values, f64::INFINITY, GLANCE)?;
            if best.as_ref().is_none_or(|b| state.cost < b.cost) {
                best = Some(state);
            }
        }
        let best = best.ok_or(FitError::NoRun)?;
        Ok(self.attempt(model, &[], &best.values, f64::INFINITY, EARLY)?)
    }

    /// Fits the first cycle and a half, then more, so that the phase locks; `held` stay as they are.
    fn lock(&self, model: &Model, held: &[usize], values: &[f64], period_s: f64) -> Result<State, ModelError> {
        let first = self.attempt(model, held, values, 1.5 * period_s, EARLY)?;
        self.attempt(model, held, &first.values, 5.0 * period_s, EARLY)
    }

    fn attempt(
        &self,
        model: &Model,
        held: &[usize],
        values: &[f64],
        horizon_s: f64,
        limits: Limits,
    ) -> Result<State, ModelError> {
        let reaches = if horizon_s.is_finite() { LOCKING_REACHES } else { FIRST_REACHES };
        let reaches = model.fitting_reaches(&values[..model.shared.len()], reaches);
        let mut problem = Calibration::new(model, self.runs, self.window(reaches, horizon_s));
        problem.hold(held, values);
        let label = model.effects.iter().map(Chosen::label).collect::<Vec<_>>().join(" + ");
        let label = if label.is_empty() { "base model" } else { &label };
        let solution = self.minimise(&problem, values, limits, label)?;
        Ok(State { values: problem.values(&solution.x), cost: solution.cost })
    }

    /// Mean square of what a coarse fit leaves, in units of the noise's, priors among it.
    pub(crate) fn mean_square(&self, model: &Model, state: &State) -> f64 {
        let problem = Calibration::new(model, self.runs, self.window(FIRST_REACHES, f64::INFINITY));
        2.0 * state.cost / problem.samples().max(1) as f64
    }

    /// What a coarse fit leaves over.
    pub(crate) fn leftover(&self, model: &Model, state: &State) -> Result<Leftover, ModelError> {
        let reaches = model.fitting_reaches(&state.values[..model.shared.len()], FIRST_REACHES);
        let problem = Calibration::new(model, self.runs, self.window(reaches, f64::INFINITY));
        let residuals = problem.residuals(&problem.variables(&state.values))?;
        Ok(Leftover::of(&residuals[..problem.samples()], model.shared.len()))
    }
}
