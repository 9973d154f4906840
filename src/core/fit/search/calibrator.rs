//! What every stage of a fit works with: the runs, the options, and a count of simulations.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use crate::fit::data::run_data::RunData;
use crate::fit::numeric::least_squares::{Limits, Solution, minimise_in_view};
use crate::fit::problem::error::FitError;
use crate::fit::problem::fit_problem::{FitProblem, Window};
use crate::fit::problem::objective::Objective;
use crate::fit::progress::{OnProgress, Progress};
use crate::fit::search::options::Options;
use crate::fit::search::thresholds::{COARSE_SAMPLES, FINAL_REACHES, LOCKING_PER_STEP};
use crate::model::effects::Chosen;
use crate::model::{Model, ModelError, stop};
use crate::rig::{Rig, WaterProperties};

/// Where a fit of one model stands.
#[derive(Clone)]
pub(crate) struct Estimate {
    /// Values of all variables: shared ones first, then each run's.
    pub(crate) values: Vec<f64>,
    /// Half the sum of squares that they leave.
    pub(crate) cost: f64,
    /// The residuals themselves; none where nobody has computed them.
    pub(crate) residuals: Vec<f64>,
}

impl Estimate {
    /// Values whose residuals nobody has computed.
    pub(crate) fn unseen(values: Vec<f64>) -> Self {
        Estimate { values, cost: f64::NAN, residuals: Vec::new() }
    }
}

/// The context of a fit; the stages are functions of it.
pub(crate) struct Calibrator<'a> {
    pub(crate) rig: &'a Rig,
    pub(crate) water: &'a WaterProperties,
    pub(crate) runs: &'a [RunData],
    pub(crate) options: &'a Options,
    pub(crate) progress: &'a OnProgress<'a>,
    /// Simulations so far.
    pub(crate) evaluations: AtomicUsize,
    /// When it began.
    pub(crate) began: Instant,
    /// Reaches that the pipes need at least.
    pub(crate) least_reaches: usize,
    /// Coarse fits from the signals, by the effects of their models: several stages ask for the same.
    from_signals: Mutex<Vec<(Vec<Chosen>, Estimate)>>,
}

impl<'a> Calibrator<'a> {
    /// For models with `effects` or more; the least number of reaches follows from the model's `values`, or from its
    /// start values.
    pub(crate) fn new(
        rig: &'a Rig,
        runs: &'a [RunData],
        options: &'a Options,
        progress: &'a OnProgress<'a>,
        effects: &[Chosen],
        values: Option<&[f64]>,
    ) -> Result<Self, FitError> {
        let water = &runs.first().ok_or(FitError::NoRun)?.conditions.water;
        let (evaluations, began) = (AtomicUsize::new(0), Instant::now());
        let from_signals = Mutex::default();
        let mut calibrator =
            Calibrator { rig, water, runs, options, progress, evaluations, began, least_reaches: 0, from_signals };
        let model = calibrator.model(effects);
        let starts: Vec<f64> = model.shared.iter().map(|p| p.start).collect();
        calibrator.least_reaches = model.least_reaches(values.map_or(&starts[..], |v| &v[..model.shared.len()]));
        Ok(calibrator)
    }

    /// The model with `effects`, under the options' constraints, starts and priors.
    pub(crate) fn model(&self, effects: &[Chosen]) -> Model<'a> {
        Model::new(self.rig, self.water, effects)
            .constrained(&self.options.constraints)
            .starting_at(&self.options.starts_at)
            .informed(&self.options.priors)
    }

    /// The coarse fit from the signals of a model with these effects: the known one, or the one that is `fitted` now.
    pub(crate) fn known_or(
        &self,
        effects: &[Chosen],
        fitted: impl FnOnce() -> Result<Estimate, FitError>,
    ) -> Result<Estimate, FitError> {
        let all = || self.from_signals.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, known)) = all().iter().find(|(known, _)| known == effects) {
            return Ok(known.clone());
        }
        let found = fitted()?;
        all().push((effects.to_vec(), found.clone()));
        Ok(found)
    }

    /// Samples up to `horizon_s` after the closure, thinned to the number that coarse fits look at.
    pub(crate) fn window(&self, reaches: usize, horizon_s: f64) -> Window {
        let reaches = reaches.max(self.least_reaches);
        let samples = self.runs.iter().flat_map(|r| &r.sensors).map(|s| {
            let (a, b) = (s.time_s.first().copied().unwrap_or(0.0), s.time_s.last().copied().unwrap_or(0.0));
            let share = (horizon_s / (b - a).max(1e-9)).min(1.0);
            (s.time_s.len() as f64 * share) as usize
        });
        let stride = (samples.max().unwrap_or(0) / COARSE_SAMPLES).max(1);
        Window { reaches, horizon_s, stride }
    }

    /// The same while the phase locks: a grid shows nothing faster than its step of `step_s`, so more samples than
    /// [`LOCKING_PER_STEP`] of the slowest sensor in each would only take time.
    pub(crate) fn locking(&self, reaches: usize, horizon_s: f64, step_s: f64) -> Window {
        let window = self.window(reaches, horizon_s);
        let intervals = self.runs.iter().flat_map(|r| &r.sensors).filter_map(|s| {
            let (first, last) = (s.time_s.first()?, s.time_s.last()?);
            Some((last - first) / (s.time_s.len().max(2) - 1) as f64)
        });
        let enough = step_s / (LOCKING_PER_STEP * intervals.fold(0.0, f64::max));
        Window { stride: window.stride.max(enough as usize), ..window }
    }

    /// Counts evaluations of all runs.
    pub(crate) fn count(&self, evaluations: usize) {
        self.evaluations.fetch_add(evaluations * self.runs.len(), Ordering::Relaxed);
    }

    /// All samples.
    pub(crate) fn whole(&self, reaches: usize) -> Window {
        Window { stride: 1, ..self.window(reaches, f64::INFINITY) }
    }

    /// Some samples, enough to show the way; all of them where their transform is compared.
    pub(crate) fn compared(&self, reaches: usize) -> Window {
        match self.options.objective {
            Objective::Time => self.window(reaches, f64::INFINITY),
            Objective::Frequency => self.whole(reaches),
        }
    }

    /// Least squares from `values`, with progress under the name of the `stage`.
    ///
    /// # Errors
    /// A model that cannot be simulated at its start, a computation that was stopped.
    pub(crate) fn minimise(
        &self,
        problem: &FitProblem,
        values: &[f64],
        limits: Limits,
        stage: &str,
    ) -> Result<Solution, ModelError> {
        let n = problem.samples().max(1) as f64;
        let reaches = problem.window().reaches;
        let solution = minimise_in_view(problem, &problem.variables(values), limits, |iteration, cost, x| {
            let at = Progress::fitting(stage, reaches, iteration, (2.0 * cost / n).sqrt());
            (self.progress)(&at.passing(problem.passing(x)));
        })?;
        self.count(solution.evaluations);
        stop::check()?;
        Ok(solution)
    }

    /// Where least squares from `values` ends, see [`Calibrator::minimise`].
    pub(crate) fn estimate(
        &self,
        problem: &FitProblem,
        values: &[f64],
        limits: Limits,
        stage: &str,
    ) -> Result<Estimate, ModelError> {
        let solution = self.minimise(problem, values, limits, stage)?;
        Ok(Estimate { values: problem.values(&solution.x), cost: solution.cost, residuals: solution.residuals })
    }

    /// The problem with the objective of the options.
    pub(crate) fn problem<'m>(&'m self, model: &'m Model<'m>, window: Window) -> FitProblem<'m> {
        FitProblem::new(model, self.runs, window).comparing(self.options.objective)
    }

    /// The same for a descent that others follow: on a fine grid, a coarser one shows the way.
    pub(crate) fn passing<'m>(&'m self, model: &'m Model<'m>, window: Window) -> FitProblem<'m> {
        let problem = self.problem(model, window);
        if window.reaches < 2 * FINAL_REACHES { problem } else { problem.with_slopes_of_half(self.least_reaches) }
    }
}
