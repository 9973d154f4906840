//! All runs as one least-squares problem.
//!
//! Variables are the laws', then each run's own as in [`FitProblem`], the last of them the error of its thermometer: a
//! wave speed known to a hundred-thousandth shows the temperature better than any thermometer. Residuals are the
//! samples of all runs, then each run's priors and meter.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::fit::numeric::least_squares::Problem;
use crate::fit::problem::fit_problem::{FitProblem, Window};
use crate::fit::problem::rows::CommonError;
use crate::model::parameter::Parameter;
use crate::model::{Model, ModelError};
use crate::temperature::law::LawModel;
use crate::temperature::member::Member;
use crate::temperature::start::{bounds_of, step_of, to_value, to_variable};
use crate::temperature::thresholds::MAX_THERMOMETER_ERROR;

/// The problem of fitting all runs under the laws.
pub(crate) struct JointProblem<'a> {
    pub(crate) law: &'a LawModel<'a>,
    pub(crate) members: &'a [Member],
    pub(crate) problems: Vec<FitProblem<'a>>,
    pub(crate) shared: usize,
    /// Standard deviation of the runs' temperatures, K.
    pub(crate) temperature_sd_k: f64,
    /// First variable of each run's own.
    pub(crate) own: Vec<usize>,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

impl<'a> JointProblem<'a> {
    pub(crate) fn new(
        law: &'a LawModel<'a>,
        members: &'a [Member],
        models: &'a [Model<'a>],
        reaches: &[usize],
        temperature_sd_k: f64,
    ) -> Self {
        let problems: Vec<FitProblem> = members
            .iter()
            .zip(models)
            .zip(reaches)
            .map(|((member, model), &reaches)| {
                let window = Window { reaches, horizon_s: f64::INFINITY, stride: 1 };
                FitProblem::new(model, std::slice::from_ref(&member.data), window)
            })
            .collect();
        let shared = models.first().map_or(0, |m| m.shared.len());
        let (mut lower, mut upper) = bounds_of(&law.parameters);
        let mut own = Vec::new();
        for problem in &problems {
            own.push(lower.len());
            let (low, high) = problem.bounds();
            lower.extend(&low[shared..]);
            lower.push(-MAX_THERMOMETER_ERROR * temperature_sd_k);
            upper.extend(&high[shared..]);
            upper.push(MAX_THERMOMETER_ERROR * temperature_sd_k);
        }
        JointProblem { law, members, problems, shared, temperature_sd_k, own, lower, upper }
    }

    pub(crate) fn law_values(&self, x: &[f64]) -> Vec<f64> {
        self.law.parameters.iter().zip(x).map(|(p, &v)| to_value(p, v)).collect()
    }

    /// Variables of one run's problem.
    pub(crate) fn of_run(&self, r: usize, x: &[f64]) -> Vec<f64> {
        let (member, problem) = (&self.members[r], &self.problems[r]);
        let water = &member.data.conditions.water;
        let degc = member.temperature_degc + x[self.thermometer(r)];
        let (shared, _) = self.law.shared(&self.law_values(x), degc, water, Some(r));
        let kept = |(p, v): (&Parameter, f64)| to_variable(p, v.clamp(p.lower, p.upper));
        let mut out: Vec<f64> = problem.parameters.iter().zip(shared).map(kept).collect();
        let own = problem.parameters.len() - self.shared;
        out.extend(&x[self.own[r]..self.own[r] + own]);
        out
    }

    /// The variable of the error of a run's thermometer.
    pub(crate) fn thermometer(&self, r: usize) -> usize {
        self.own[r] + self.problems[r].parameters.len() - self.shared
    }

    /// Residuals of one run: samples, priors, meter, thermometer; with `keep`, its simulation is stored for later
    /// differences.
    fn run_residuals(&self, r: usize, x: &[f64], keep: bool) -> Result<Vec<f64>, ModelError> {
        let mut out = self.problems[r].all_residuals(&self.of_run(r, x), keep)?;
        out.push(x[self.thermometer(r)] / self.temperature_sd_k);
        Ok(out)
    }

    /// Residuals of all runs, likewise.
    fn all_residuals(&self, x: &[f64], keep: bool) -> Result<Vec<f64>, ModelError> {
        let each: Result<Vec<_>, _> = (0..self.own.len()).map(|r| self.run_residuals(r, x, keep)).collect();
        Ok(self.ordered(&each?))
    }

    pub(crate) fn samples(&self) -> usize {
        self.problems.iter().map(FitProblem::samples).sum()
    }

    /// Where a run's samples, and where its priors and meter, stand among the residuals.
    pub(crate) fn places(&self, r: usize) -> [Range<usize>; 2] {
        let rest = |c: &FitProblem| {
            1 + c.parameters.iter().filter(|p| p.prior.is_some()).count() + usize::from(c.runs[0].meter.is_some())
        };
        let before = &self.problems[..r];
        let first: usize = before.iter().map(FitProblem::samples).sum();
        let last = self.samples() + before.iter().map(rest).sum::<usize>();
        let own = &self.problems[r];
        [first..first + own.samples(), last..last + rest(own)]
    }

    /// Where each sensor's samples of each run stand among the residuals, those together that were sampled together.
    pub(crate) fn records(&self) -> Vec<Vec<Range<usize>>> {
        let of_run = |(r, c): (usize, &FitProblem)| {
            let first = self.places(r)[0].start;
            let moved = |own: Range<usize>| first + own.start..first + own.end;
            c.rows
                .record_rows()
                .into_iter()
                .map(|group| group.into_iter().map(moved).collect())
                .collect::<Vec<Vec<_>>>()
        };
        self.problems.iter().enumerate().flat_map(of_run).collect()
    }

    /// What one standard deviation of each sensor's gain does to the residuals of all runs.
    pub(crate) fn gain_errors(&self) -> Vec<CommonError> {
        let mut by_sensor: BTreeMap<&str, CommonError> = BTreeMap::new();
        for (r, problem) in self.problems.iter().enumerate() {
            let first = self.places(r)[0].start;
            for (sensor, moved) in problem.rows.gain_errors() {
                by_sensor.entry(sensor).or_default().extend(moved.into_iter().map(|(at, by)| (first + at, by)));
            }
        }
        by_sensor.into_values().collect()
    }

    /// Residuals in order, from those of each run.
    pub(crate) fn ordered(&self, each: &[Vec<f64>]) -> Vec<f64> {
        let parts = || each.iter().zip(&self.problems).map(|(r, c)| r.split_at(c.samples()));
        parts().flat_map(|p| p.0).chain(parts().flat_map(|p| p.1)).copied().collect()
    }
}

impl Problem for JointProblem<'_> {
    type Error = ModelError;

    fn residuals(&self, x: &[f64]) -> Result<Vec<f64>, ModelError> {
        self.all_residuals(x, true)
    }

    fn residuals_moved(&self, x: &[f64], j: usize, base: &[f64]) -> Result<Vec<f64>, ModelError> {
        let Some(r) = self.own.iter().rposition(|&first| j >= first) else { return self.all_residuals(x, false) };
        let [samples, rest] = self.places(r);
        let moved = if j == self.thermometer(r) {
            self.run_residuals(r, x, false)?
        } else {
            let own = [&base[samples.clone()], &base[rest.start..rest.end - 1]].concat();
            let local = self.shared + j - self.own[r];
            let mut moved = self.problems[r].residuals_moved(&self.of_run(r, x), local, &own)?;
            moved.push(base[rest.end - 1]);
            moved
        };
        let mut out = base.to_vec();
        let (of_samples, of_rest) = moved.split_at(samples.len());
        out[samples].copy_from_slice(of_samples);
        out[rest].copy_from_slice(of_rest);
        Ok(out)
    }

    fn bounds(&self) -> (&[f64], &[f64]) {
        (&self.lower, &self.upper)
    }

    fn difference_step(&self, j: usize) -> f64 {
        match self.own.iter().rposition(|&first| j >= first) {
            Some(r) if j == self.thermometer(r) => 1e-4 * self.temperature_sd_k,
            Some(r) => self.problems[r].difference_step(self.shared + j - self.own[r]),
            None => step_of(&self.law.parameters[j]),
        }
    }
}
