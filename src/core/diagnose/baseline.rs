//! The baseline of a diagnosis: the fitted start model, and its residuals on a coarse grid that errs like a fine one.
//!
//! All candidates are refitted from here, so a refit must be cheap. Samples are averaged into a few thousand bins per
//! sensor, which loses nothing that is slower than a bin, and the model runs on a coarse grid. The start model's fit
//! used the fine grid and all samples, so the difference that the bins and the coarse grid make is known there. The
//! binned data are shifted by that difference: at the start model's fit, coarse residuals are the bin means of the fine
//! ones (defect correction: Stetter 1978, Numer. Math. 29, 425).

use nalgebra::{DMatrix, DVector};

use crate::diagnose::circumstances::{circumstances, features};
use crate::diagnose::limits::UNSEEN_COLUMN;
use crate::fit::data::run_data::{RunData, SensorData};
use crate::fit::numeric::least_squares::{Problem, jacobian};
use crate::fit::numeric::uncertainty::determined_inverse;
use crate::fit::outcome::fit::{Fit, FittedParameter};
use crate::fit::problem::fit_problem::{FitProblem, Window};
use crate::fit::problem::thresholds::LEAD_OF_PERIOD;
use crate::fit::search::options::Options;
use crate::fit::search::thresholds::{COARSE_REACHES, COARSE_SAMPLES};
use crate::model::effects::{Chosen, Circumstances};
use crate::model::{Model, ModelError};
use crate::product::{along, dot, gram};
use crate::rig::Rig;

/// See the module.
pub struct Baseline<'a> {
    /// The rig.
    pub rig: &'a Rig,
    /// The runs, binned and corrected.
    pub runs: Vec<RunData>,
    /// What speaks for or against an effect before any fit.
    pub known: Circumstances<'a>,
    /// Options of the fit: constraints and priors.
    options: Options,
    /// The start model's effects, their open choices decided.
    pub effects: Vec<Chosen>,
    /// Values of the start model's variables: shared ones first, then each run's.
    pub values: Vec<f64>,
    /// How many of them are shared.
    pub shared: usize,
    /// Reaches of the coarse grid.
    pub reaches: usize,
    /// Residuals of samples, then of flow meters.
    pub residuals: Vec<f64>,
    /// Sum of squares of all residuals, priors included.
    pub square: f64,
    /// Number of residuals that are samples.
    pub samples: usize,
    /// Mean number of recorded samples in a bin.
    bin_size: f64,
    fitted: Fitted,
}

/// What the fitted parameters can absorb: Jacobian columns (of parameters not at a bound) and the inverse of their
/// normal matrix.
struct Fitted {
    /// Which variables these are.
    which: Vec<usize>,
    columns: Vec<Vec<f64>>,
    inverse: DMatrix<f64>,
}

impl<'a> Baseline<'a> {
    /// Builds the baseline from a fit of the start model to `runs`.
    ///
    /// # Errors
    /// As [`Model::simulate`].
    pub fn new(rig: &'a Rig, runs: &[RunData], fit: &Fit, options: &Options) -> Result<Self, ModelError> {
        Self::at(rig, runs, fit.effects.clone(), fit.parameters.iter().collect(), fit.reaches, options)
    }

    /// The same from where a fit would stand without its effect `i`, if nothing else moved.
    ///
    /// # Errors
    /// As [`Model::simulate`].
    pub fn without(rig: &'a Rig, runs: &[RunData], fit: &Fit, i: usize, options: &Options) -> Result<Self, ModelError> {
        let own = Model::new(rig, &runs[0].conditions.water, &fit.effects).parameters_of(i);
        let mut effects = fit.effects.clone();
        effects.remove(i);
        let rest = fit.parameters.iter().enumerate().filter(|(j, _)| !own.contains(j)).map(|(_, p)| p).collect();
        Self::at(rig, runs, effects, rest, fit.reaches, options)
    }

    /// At these values of all variables, shared ones first, as seen on a grid of `fine` reaches.
    fn at(
        rig: &'a Rig,
        runs: &[RunData],
        effects: Vec<Chosen>,
        parameters: Vec<&FittedParameter>,
        fine: usize,
        options: &Options,
    ) -> Result<Self, ModelError> {
        let model = Model::new(rig, &runs[0].conditions.water, &effects);
        let model = model.constrained(&options.constraints).informed(&options.priors);
        let values: Vec<f64> = parameters.iter().map(|p| p.value).collect();
        let shared = model.shared.len();
        let reaches =
            model.fitting_reaches(&values[..shared], COARSE_REACHES.max(model.least_reaches(&values[..shared])));
        let recorded = runs;
        let runs = binned(&model, recorded, &values, fine, reaches)?;
        let sizes = recorded.iter().zip(&runs).flat_map(|(a, b)| a.sensors.iter().zip(&b.sensors));
        let sizes: Vec<f64> = sizes.map(|(a, b)| (a.noise_m / b.noise_m).powi(2)).collect();
        let problem = FitProblem::new(&model, &runs, window(reaches));
        let x = problem.variables(&values);
        let all = problem.residuals(&x)?;
        let at_bound: Vec<bool> = parameters.iter().map(|p| p.at_bound || p.held).collect();
        let (which, columns): (Vec<usize>, Vec<Vec<f64>>) = jacobian(&problem, &x, &all)?
            .into_iter()
            .enumerate()
            .filter(|(j, column)| !at_bound[*j] && dot(column, column) > UNSEEN_COLUMN.powi(2))
            .unzip();
        let samples = problem.samples();
        let meters = runs.iter().filter(|r| r.meter.is_some()).count();
        // In units of each column's norm, and without the combinations that the data hardly show: neighbouring elements
        // of a wall's creep are nearly parallel.
        let products = gram(&columns);
        let norms: Vec<f64> = products.diagonal().iter().map(|s| s.sqrt()).collect();
        let n = columns.len();
        let normal = DMatrix::from_fn(n, n, |a, b| products[(a, b)] / (norms[a] * norms[b]));
        let (inverse, _) = determined_inverse(normal);
        let inverse = DMatrix::from_fn(n, n, |a, b| inverse[(a, b)] / (norms[a] * norms[b]));
        let columns = columns.iter().map(|c| seen(c, samples, meters)).collect();
        Ok(Baseline {
            rig,
            known: circumstances(rig, recorded),
            options: options.clone(),
            effects,
            shared,
            reaches,
            square: dot(&all, &all),
            residuals: seen(&all, samples, meters),
            samples,
            bin_size: sizes.iter().sum::<f64>() / sizes.len().max(1) as f64,
            fitted: Fitted { which, columns, inverse },
            values,
            runs,
        })
    }

    /// See [`features`].
    pub fn features(&self) -> f64 {
        features(&self.runs)
    }

    /// Number of recorded samples behind the bins.
    pub fn run_samples(&self) -> usize {
        (self.samples as f64 * self.bin_size).round() as usize
    }

    /// Noise of one recorded sample, rms over the bins, m.
    pub fn noise_m(&self) -> f64 {
        let sensors = self.runs.iter().flat_map(|r| &r.sensors);
        let (sum, n) = sensors.fold((0.0, 0.0), |(sum, n), s| {
            let bins = s.time_s.len() as f64;
            (sum + bins * s.noise_m.powi(2), n + bins)
        });
        (sum / f64::max(n, 1.0) * self.bin_size).sqrt()
    }

    /// Mean square of single samples, in units of their noise, from residuals of bins, in units of the bins' noise.
    pub fn mean_square(&self, residuals: &[f64]) -> f64 {
        let bins = &residuals[..self.samples];
        let mean = dot(bins, bins) / self.samples.max(1) as f64;
        // Noise averages out in a bin; model error does not.
        (1.0 + (mean - 1.0) / self.bin_size).max(mean / self.bin_size)
    }

    /// The start model with other effects.
    pub fn model(&self, effects: &[Chosen]) -> Model<'a> {
        let model = Model::new(self.rig, &self.runs[0].conditions.water, effects);
        model.constrained(&self.options.constraints).informed(&self.options.priors)
    }

    /// The problem of fitting a model to the binned data.
    pub fn problem<'m>(&'m self, model: &'m Model<'m>) -> FitProblem<'m> {
        FitProblem::new(model, &self.runs, window(self.reaches.max(model.effects_reaches(&self.shared_of(model)))))
    }

    /// The same for a descent that moves all parameters: a coarser grid shows the way.
    pub(crate) fn passing<'m>(&'m self, model: &'m Model<'m>) -> FitProblem<'m> {
        self.problem(model).with_coarse_slopes(model.least_reaches(&self.shared_of(model)))
    }

    /// The start model's shared values, with the starts of those that a model of further effects adds.
    fn shared_of(&self, model: &Model) -> Vec<f64> {
        let added = model.shared.iter().skip(self.shared).map(|p| p.start);
        self.values[..self.shared].iter().copied().chain(added).collect()
    }

    /// The residuals of samples and flow meters, without those of priors.
    pub fn seen(&self, all: &[f64]) -> Vec<f64> {
        seen(all, self.samples, self.runs.iter().filter(|r| r.meter.is_some()).count())
    }

    /// All variables of a model with `added` values of further effects.
    pub fn values_with(&self, added: &[f64]) -> Vec<f64> {
        let (shared, own) = self.values.split_at(self.shared);
        [shared, added, own].concat()
    }

    /// `a·b` after removing from both what the fitted parameters can absorb.
    pub fn projected_dot(&self, a: &[f64], b: &[f64]) -> f64 {
        dot(a, b) - self.along(a).dot(&(&self.fitted.inverse * self.along(b)))
    }

    /// Residuals minus what the fitted parameters can absorb of them.
    pub fn projected(&self, residuals: &[f64]) -> Vec<f64> {
        let step = &self.fitted.inverse * self.along(residuals);
        let mut left = residuals.to_vec();
        for (column, by) in self.fitted.columns.iter().zip(&step) {
            left.iter_mut().zip(column).for_each(|(l, c)| *l -= by * c);
        }
        left
    }

    /// Moves the start model's variables in `x` so that they absorb `residuals`. `x` may hold variables of further
    /// effects, after the shared ones; these stay.
    pub fn moved(&self, x: &[f64], residuals: &[f64]) -> Vec<f64> {
        let added = x.len() - self.values.len();
        let step = &self.fitted.inverse * self.along(residuals);
        let mut moved = x.to_vec();
        for (&j, by) in self.fitted.which.iter().zip(&step) {
            moved[if j < self.shared { j } else { j + added }] -= by;
        }
        moved
    }

    fn along(&self, v: &[f64]) -> DVector<f64> {
        along(&self.fitted.columns, v)
    }
}

/// All of every record on a grid of so many reaches.
pub(crate) fn window(reaches: usize) -> Window {
    Window { reaches, horizon_s: f64::INFINITY, stride: 1 }
}

/// Samples and flow meters among all residuals; the priors stand between them.
fn seen(all: &[f64], samples: usize, meters: usize) -> Vec<f64> {
    [&all[..samples], &all[all.len() - meters..]].concat()
}

/// Averages the samples of the runs and shifts them by the change in the model at `values` from `fine` to `coarse`
/// reaches.
fn binned(
    model: &Model,
    runs: &[RunData],
    values: &[f64],
    fine: usize,
    coarse: usize,
) -> Result<Vec<RunData>, ModelError> {
    let problem = FitProblem::new(model, runs, window(fine));
    runs.iter()
        .enumerate()
        .map(|(r, run)| {
            let fine_traces = problem.modelled(r, values, fine)?.traces;
            let coarse_traces = problem.modelled(r, values, coarse)?.traces;
            let start = problem.closure_start_s(r, values);
            let lead = LEAD_OF_PERIOD * model.period_s(&values[..model.shared.len()]);
            let sensors = run.sensors.iter().enumerate().map(|(s, sensor)| {
                let (fine, coarse) = (&fine_traces[s], &coarse_traces[s]);
                let from = sensor.time_s.partition_point(|&t| t < start - lead);
                let (time_s, head_m) = (&sensor.time_s[from..], &sensor.head_m[from..]);
                let size = time_s.len().div_ceil(COARSE_SAMPLES).max(1);
                let mut bins = (Vec::new(), Vec::new());
                for (times, heads) in time_s.chunks_exact(size).zip(head_m.chunks_exact(size)) {
                    let centre = times.iter().sum::<f64>() / size as f64;
                    let excess: f64 = times.iter().zip(heads).map(|(t, h)| h - fine.at(t - start)).sum();
                    bins.0.push(centre);
                    bins.1.push(excess / size as f64 + coarse.at(centre - start));
                }
                SensorData {
                    time_s: bins.0,
                    head_m: bins.1,
                    noise_m: sensor.noise_m / (size as f64).sqrt(),
                    total_noise_m: sensor.total_noise_m,
                    hum: sensor.hum.clone(),
                    lines: sensor.lines.clone(),
                    sensor: sensor.sensor.clone(),
                    offset_sd_m: sensor.offset_sd_m,
                    saturated: 0,
                }
            });
            Ok(RunData { sensors: sensors.collect(), ..run.clone() })
        })
        .collect()
}
