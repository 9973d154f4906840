//! What a fitted model leaves of one run, in cells of time that are even from the closure on, with the errors of each.
//!
//! A cell holds the mean of the samples in it. Its error is their noise, averaged where it is white, and whole where it
//! is slow; and the share of the surge by which two right solvers differ.

use crate::diagnose::limits::MODEL_ERROR;
use crate::diagnose::rest::pulse::REACH;
use crate::extent::ends;
use crate::fit::data::run_data::RunData;
use crate::fit::numeric::least_squares::Problem;
use crate::fit::outcome::fit::Fit;
use crate::fit::problem::fit_problem::{FitProblem, Window};
use crate::fit::problem::hum::without_hum;
use crate::model::parameter::Scale;
use crate::model::{Model, ModelError};

/// Even times: `CELLS` cells a knot.
pub(crate) const CELLS: usize = 3;

/// The times of a forcing: knots from a little before the closure on, and the cells between them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Times {
    /// Between knots, s.
    pub(crate) knot_s: f64,
    /// Knots before the closure: they make up for what moves in the pipe when it begins.
    pub(crate) before: usize,
    /// All knots.
    pub(crate) knots: usize,
}

impl Times {
    /// Cell width, s.
    pub(crate) fn cell_s(&self) -> f64 {
        self.knot_s / CELLS as f64
    }

    /// Cells after the closure.
    pub(crate) fn cells(&self) -> usize {
        (self.knots - self.before) * CELLS
    }

    /// Time of a knot after the start of the closure, s.
    pub(crate) fn knot_at_s(&self, knot: usize) -> f64 {
        (knot as f64 - self.before as f64) * self.knot_s
    }

    /// Cells from the beginning of the pulse at a knot to a cell: where in its answer that is. None of earlier ones.
    pub(crate) fn since(&self, cell: usize, knot: usize) -> Option<usize> {
        (cell + CELLS * (self.before + REACH)).checked_sub(CELLS * knot)
    }

    /// End of the last cell, s.
    pub(crate) fn end_s(&self) -> f64 {
        self.cells() as f64 * self.cell_s()
    }
}

/// A row of the linear problem.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Row {
    /// Index of the sensor among the run's.
    pub(crate) sensor: usize,
    /// Its cell after the closure; none of the level before it.
    pub(crate) cell: Option<usize>,
    /// Standard deviation of its error, m.
    pub(crate) sd_m: f64,
}

/// One run under a fitted model.
pub(crate) struct Run<'a> {
    pub(crate) problem: FitProblem<'a>,
    /// Variables that the records may move: those that are not held. One that a fit has moved to a bound may come back.
    pub(crate) free: Vec<usize>,
    /// What was known of each variable before the fit: mean and standard deviation.
    pub(crate) beliefs: Vec<Option<(f64, f64)>>,
    /// Variables of the fit.
    pub(crate) x: Vec<f64>,
    /// Heads without hum, m.
    heads_m: Vec<Vec<f64>>,
    fine: usize,
    pub(crate) coarse: usize,
    grid_error_m: f64,
}

impl<'a> Run<'a> {
    /// Of the only one of `runs`, under a model that was fitted to it, perhaps together with others.
    ///
    /// # Errors
    /// As [`Model::simulate`].
    pub(crate) fn new(model: &'a Model<'a>, runs: &'a [RunData], fit: &Fit, coarse: usize) -> Result<Self, ModelError> {
        let file = &runs[0].file;
        let own: Vec<_> = fit.parameters.iter().filter(|p| p.run.as_ref().is_none_or(|run| run == file)).collect();
        let problem = FitProblem::new(model, runs, Window { reaches: coarse, horizon_s: f64::INFINITY, stride: 1 });
        let values: Vec<f64> = own.iter().map(|p| p.value).collect();
        let x = problem.variables(&values);
        let free = (0..own.len()).filter(|&j| !own[j].held).collect();
        // What a flow meter shows of the velocity, as the fit has the one go with the other.
        let [velocity, ..] = problem.run_variables(0);
        let modelled_m3_s = fit.runs.iter().find(|run| run.file == *file).and_then(|run| run.meter_flow_m3_s);
        let metered = runs[0]
            .meter
            .zip(modelled_m3_s)
            .map(|(meter, flow_m3_s)| (values[velocity] * meter.flow_m3_s / flow_m3_s, meter.relative_sd));
        let beliefs = (0..own.len())
            .map(|j| {
                let variable = |mean: f64| if own[j].scale == Scale::Log { mean.ln() } else { mean };
                let belief = own[j].belief.or(metered.filter(|_| j == velocity));
                belief.map(|(mean, sd)| (variable(mean), sd)).or(problem.known(j))
            })
            .collect();
        let mut run = Run {
            problem,
            free,
            beliefs,
            heads_m: runs[0].sensors.iter().map(|s| s.head_m.clone()).collect(),
            fine: fit.reaches,
            coarse,
            grid_error_m: fit.grid_error_m,
            x,
        };
        let left = run.left_m(&run.x.clone(), run.fine)?;
        for ((sensor, heads), left) in runs[0].sensors.iter().zip(&mut run.heads_m).zip(left) {
            if !sensor.hum.is_empty() {
                let rest = without_hum(sensor, &sensor.time_s, left.clone());
                heads.iter_mut().zip(left.iter().zip(&rest)).for_each(|(h, (with, without))| *h -= with - without);
            }
        }
        Ok(run)
    }

    /// Its data.
    pub(crate) fn data(&self) -> &'a RunData {
        &self.problem.runs[0]
    }

    /// Start of the closure on the record's clock, s.
    pub(crate) fn start_s(&self) -> f64 {
        self.problem.closure_start_s(0, &self.problem.values(&self.x))
    }

    /// How long the record lasts after that, s.
    pub(crate) fn duration_s(&self) -> f64 {
        self.problem.rows.last_s(0, self.start_s()) - self.start_s()
    }

    /// The theoretical period, s.
    pub(crate) fn period_s(&self) -> f64 {
        let values = self.problem.values(&self.x);
        self.problem.model.period_s(&values[..self.problem.model.shared.len()])
    }

    /// Measured minus modelled heads of all samples, m.
    fn left_m(&self, x: &[f64], reaches: usize) -> Result<Vec<Vec<f64>>, ModelError> {
        let values = self.problem.values(x);
        let traces = self.problem.modelled(0, &values, reaches)?.traces;
        let start_s = self.problem.closure_start_s(0, &values);
        let of = |(s, trace): (usize, crate::model::trace::Trace)| {
            let (sensor, offset_m) = (&self.data().sensors[s], self.problem.offset_m(0, s, &values));
            let mut left = vec![0.0; sensor.time_s.len()];
            trace.read(start_s, &sensor.time_s, &mut left);
            left.iter_mut().zip(&self.heads_m[s]).for_each(|(l, head)| *l = head - offset_m - *l);
            left
        };
        Ok(traces.into_iter().enumerate().map(of).collect())
    }

    /// The rows over `times`, and the samples that each is the mean of.
    pub(crate) fn rows(&self, times: &Times) -> (Vec<Row>, Vec<std::ops::Range<usize>>) {
        let (start_s, period_s) = (self.start_s(), self.period_s());
        let (mut rows, mut samples) = (Vec::new(), Vec::new());
        for (s, sensor) in self.data().sensors.iter().enumerate() {
            let white = sensor.noise_m.powi(2);
            let slow = (sensor.total_noise_m.powi(2) - white).max(0.0);
            let (low, high) = ends(&sensor.head_m);
            let of_model = (MODEL_ERROR * 0.5 * (high - low)).powi(2) + self.grid_error_m.powi(2);
            let at = |t: f64| sensor.time_s.partition_point(|&time| time < start_s + t);
            let before = at(-period_s)..at(-0.02 * period_s);
            if !before.is_empty() {
                // Slow noise and what oscillates hardly average out over a period.
                let variance = white / before.len() as f64 + slow + sensor.oscillation_m().powi(2) + of_model;
                rows.push(Row { sensor: s, cell: None, sd_m: variance.sqrt() });
                samples.push(before);
            }
            for cell in 0..times.cells() {
                let own = at(cell as f64 * times.cell_s())..at((cell + 1) as f64 * times.cell_s());
                if !own.is_empty() {
                    let variance = white / own.len() as f64 + slow + of_model;
                    rows.push(Row { sensor: s, cell: Some(cell), sd_m: variance.sqrt() });
                    samples.push(own);
                }
            }
        }
        (rows, samples)
    }

    /// What the model at `x` leaves in each row, m.
    ///
    /// # Errors
    /// As [`Model::simulate`].
    pub(crate) fn left_in(
        &self,
        x: &[f64],
        cells: &(Vec<Row>, Vec<std::ops::Range<usize>>),
        is_fine: bool,
    ) -> Result<Vec<f64>, ModelError> {
        let left = self.left_m(x, if is_fine { self.fine } else { self.coarse })?;
        Ok(means(&left, cells))
    }

    /// One standard deviation of each error of the model in each row, m. Two right solvers differ by a share of the
    /// surge that keeps time with it: at each sensor a little larger, and a little later.
    pub(crate) fn errors_of_model(
        &self,
        times: &Times,
        cells: &(Vec<Row>, Vec<std::ops::Range<usize>>),
        left_m: &[f64],
    ) -> Vec<Vec<f64>> {
        let rows = &cells.0;
        let modelled: Vec<f64> =
            means(&self.heads_m, cells).iter().zip(left_m).map(|(head, left)| head - left).collect();
        let angle = std::f64::consts::TAU * times.cell_s() / self.period_s();
        let of = |s: usize| {
            let own: Vec<usize> = (0..rows.len()).filter(|&i| rows[i].sensor == s).collect();
            let (mut larger, mut later) = (vec![0.0; rows.len()], vec![0.0; rows.len()]);
            own.iter().for_each(|&i| larger[i] = MODEL_ERROR * (modelled[i] - modelled[own[0]]));
            for near in own.windows(3) {
                if let (Some(from), Some(to)) = (rows[near[0]].cell, rows[near[2]].cell) {
                    let rise_m = modelled[near[2]] - modelled[near[0]];
                    later[near[1]] = MODEL_ERROR * rise_m / (angle * (to - from) as f64);
                }
            }
            [larger, later]
        };
        (0..self.heads_m.len()).flat_map(of).collect()
    }

    /// How the heads change in each row with each free variable, m: the model's, and what else is `done` to each row.
    ///
    /// # Errors
    /// As [`Model::simulate`].
    pub(crate) fn slopes(
        &self,
        rows: &(Vec<Row>, Vec<std::ops::Range<usize>>),
        done: impl Fn(&[f64]) -> Result<Vec<f64>, ModelError> + Sync,
    ) -> Result<Vec<Vec<f64>>, ModelError> {
        use rayon::prelude::*;
        let left_in = |x: &[f64]| -> Result<Vec<f64>, ModelError> {
            let mut left = self.left_in(x, rows, false)?;
            left.iter_mut().zip(done(x)?).for_each(|(l, d)| *l -= d);
            Ok(left)
        };
        let base = left_in(&self.x)?;
        let (_, upper) = self.problem.bounds();
        let slope = |&j: &usize| {
            let step = self.problem.difference_step(j);
            let step = if self.x[j] + step > upper[j] { -step } else { step };
            let mut moved = self.x.clone();
            moved[j] += step;
            let left = left_in(&moved)?;
            Ok(base.iter().zip(&left).map(|(b, l)| (b - l) / step).collect())
        };
        self.free.par_iter().map(slope).collect()
    }

    /// Moves the free variables, within their bounds; not to where there is no model, such as where friction takes more
    /// than the grid resolves.
    pub(crate) fn step(&mut self, by: &[f64]) {
        let (lower, upper) = self.problem.bounds();
        let mut moved = self.x.clone();
        self.free.iter().zip(by).for_each(|(&j, by)| moved[j] = (moved[j] + by).clamp(lower[j], upper[j]));
        if [self.fine, self.coarse].iter().all(|&reaches| self.left_m(&moved, reaches).is_ok()) {
            self.x = moved;
        }
    }
}

/// Mean of the samples of each row.
fn means(series: &[Vec<f64>], (rows, samples): &(Vec<Row>, Vec<std::ops::Range<usize>>)) -> Vec<f64> {
    let mean = |(row, own): (&Row, &std::ops::Range<usize>)| {
        series[row.sensor][own.clone()].iter().sum::<f64>() / own.len() as f64
    };
    rows.iter().zip(samples).map(mean).collect()
}
