//! All runs at once: each run's shared parameters are what the laws make of its temperature, the rest is its own.
//!
//! Variables are the laws', then each run's own as in [`Calibration`], the last of them what its thermometer is off by: a wave speed told to a
//! hundred-thousandth knows temperature better than any thermometer. Residuals are the samples of all runs, then each run's priors and meter.

pub(crate) mod said;
pub(crate) mod squares;

use std::collections::BTreeMap;
use std::ops::Range;

use crate::fit::inference::errors::{Common, Errors, Linearised};
use crate::fit::numeric::least_squares::{Limits, Problem, Solution, jacobian, minimise};
use crate::fit::numeric::uncertainty::{correlation, gauss_newton_step};
use crate::fit::outcome::fit::Fit;
use crate::fit::problem::fit_problem::{Calibration, Window};
use crate::fit::search::calibrate::Progress;
use crate::model::parameter::Parameter;
use crate::model::{Model, ModelError};
use crate::rig::Rig;
use crate::temperature::apart::Quantity;
use crate::temperature::compare::{Comparison, Verdict, compare};
use crate::temperature::joint::said::{lines, parameter, run_errors};
use crate::temperature::joint::squares::{noise_a_parameter, sums};
use crate::temperature::law::{LawModel, Laws};
use crate::temperature::start::{bounds_of, from_apart, step_of, to_value, to_variable};
use crate::temperature::{FamilyError, Member};

const LIMITS: Limits = Limits { iterations: 60, cost_tolerance: 1e-6, step_tolerance: 1e-9, thorough: true };
/// Points of a law's line.
const POINTS: usize = 41;
/// Most that a thermometer may be off by, in its standard deviations.
const MOST_OFF: f64 = 20.0;

/// A fitted parameter of the laws.
#[derive(Debug, Clone, PartialEq)]
pub struct LawParameter {
    /// Name with its unit.
    pub name: String,
    /// Unit as displayed.
    pub unit: &'static str,
    /// What it is, in plain words.
    pub about: &'static str,
    /// Value, at the reference temperature where it depends on it.
    pub value: f64,
    /// Standard error; widened by what the laws leave where they do not describe the runs.
    pub standard_error: f64,
    /// 95% interval; of the logarithm for what is moved as one.
    pub interval: (f64, f64),
    /// It ended at one of its bounds.
    pub at_bound: bool,
}

/// Error of one run, over the samples of all its pressure sensors.
#[derive(Debug, Clone, PartialEq)]
pub struct RunError {
    /// File name.
    pub file: String,
    /// Fitted by itself, m.
    pub apart_m: f64,
    /// Under the laws, m.
    pub together_m: f64,
    /// Noise, m.
    pub noise_m: f64,
    /// Temperature that suits the laws best, as far as its standard deviation lets it move, °C.
    pub temperature_degc: f64,
}

/// The runs fitted together.
#[derive(Debug, Clone)]
pub struct Together {
    /// The laws.
    pub laws: Laws,
    /// Their parameters.
    pub parameters: Vec<LawParameter>,
    /// Each run.
    pub runs: Vec<RunError>,
    /// Against the fits apart; none where the laws save no parameter.
    pub comparison: Option<Comparison>,
    /// Why the fit stopped, in words.
    pub stopped_because: &'static str,
    /// It stopped because it was done.
    pub converged: bool,
}

impl Together {
    /// What a reader has to know of it.
    pub(crate) fn remarks(&self) -> Vec<String> {
        let mut out = Vec::new();
        if let Some(c) = self.comparison.filter(|c| c.verdict != Verdict::Describe) {
            let verdict = match c.verdict {
                Verdict::Fail => "the laws do not describe the runs: trust the values apart",
                _ => "the laws describe the runs nearly: what they leave is more than noise, but little",
            };
            out.push(format!(
                "{verdict} (F = {:.2}, chance {:.1e}, BIC {:+.0}); intervals of the laws are widened by the root of F",
                c.f, c.chance, c.bic_difference
            ));
        }
        if self.comparison.is_none() {
            out.push("these laws have as many parameters as the runs apart, so the runs cannot contradict them".into());
        }
        for p in self.parameters.iter().filter(|p| p.at_bound) {
            out.push(format!("{} ended at its bound", p.name));
        }
        if self.parameters.iter().any(|p| p.name == "activation_kJ_mol" && p.interval.1 < 0.0) {
            out.push("the warmer the slower, say these runs: check which temperature belongs to which".into());
        }
        if !self.converged {
            out.push(format!("the fit together is not finished: {}", self.stopped_because));
        }
        out
    }
}

pub(crate) struct Joint<'a> {
    law: &'a LawModel<'a>,
    members: &'a [Member],
    calibrations: Vec<Calibration<'a>>,
    shared: usize,
    /// Standard deviation of the runs' temperatures, K.
    temperature_sd_k: f64,
    /// First variable of each run's own.
    own: Vec<usize>,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

impl<'a> Joint<'a> {
    fn new(
        law: &'a LawModel<'a>,
        members: &'a [Member],
        models: &'a [Model<'a>],
        reaches: &[usize],
        temperature_sd_k: f64,
    ) -> Self {
        let calibrations: Vec<Calibration> = members
            .iter()
            .zip(models)
            .zip(reaches)
            .map(|((member, model), &reaches)| {
                let window = Window { reaches, horizon_s: f64::INFINITY, stride: 1 };
                Calibration::new(model, std::slice::from_ref(&member.data), window)
            })
            .collect();
        let shared = models.first().map_or(0, |m| m.shared.len());
        let (mut lower, mut upper) = bounds_of(&law.parameters);
        let mut own = Vec::new();
        for calibration in &calibrations {
            own.push(lower.len());
            let (low, high) = calibration.bounds();
            lower.extend(&low[shared..]);
            lower.push(-MOST_OFF * temperature_sd_k);
            upper.extend(&high[shared..]);
            upper.push(MOST_OFF * temperature_sd_k);
        }
        Joint { law, members, calibrations, shared, temperature_sd_k, own, lower, upper }
    }

    fn law_values(&self, x: &[f64]) -> Vec<f64> {
        self.law.parameters.iter().zip(x).map(|(p, &v)| to_value(p, v)).collect()
    }

    /// Variables of one run's calibration.
    fn of_run(&self, r: usize, x: &[f64]) -> Vec<f64> {
        let (member, calibration) = (&self.members[r], &self.calibrations[r]);
        let water = &member.data.conditions.water;
        let degc = member.temperature_degc + x[self.thermometer(r)];
        let (shared, _) = self.law.shared(&self.law_values(x), degc, water, Some(r));
        let kept = |(p, v): (&Parameter, f64)| to_variable(p, v.clamp(p.lower, p.upper));
        let mut out: Vec<f64> = calibration.parameters.iter().zip(shared).map(kept).collect();
        let own = calibration.parameters.len() - self.shared;
        out.extend(&x[self.own[r]..self.own[r] + own]);
        out
    }

    /// The variable of what a run's thermometer is off by.
    fn thermometer(&self, r: usize) -> usize {
        self.own[r] + self.calibrations[r].parameters.len() - self.shared
    }

    /// Residuals of one run: samples, priors, meter, thermometer.
    fn run_residuals(&self, r: usize, x: &[f64]) -> Result<Vec<f64>, ModelError> {
        let mut out = self.calibrations[r].residuals(&self.of_run(r, x))?;
        out.push(x[self.thermometer(r)] / self.temperature_sd_k);
        Ok(out)
    }

    fn samples(&self) -> usize {
        self.calibrations.iter().map(Calibration::samples).sum()
    }

    /// Where a run's samples, and where its priors and meter, stand among the residuals.
    fn places(&self, r: usize) -> [Range<usize>; 2] {
        let rest = |c: &Calibration| {
            1 + c.parameters.iter().filter(|p| p.prior.is_some()).count() + usize::from(c.runs[0].meter.is_some())
        };
        let before = &self.calibrations[..r];
        let first: usize = before.iter().map(Calibration::samples).sum();
        let last = self.samples() + before.iter().map(rest).sum::<usize>();
        let own = &self.calibrations[r];
        [first..first + own.samples(), last..last + rest(own)]
    }

    /// Where each sensor's samples of each run stand among the residuals, those together that were sampled together.
    fn records(&self) -> Vec<Vec<Range<usize>>> {
        let of_run = |(r, c): (usize, &Calibration)| {
            let first = self.places(r)[0].start;
            let moved = |own: Range<usize>| first + own.start..first + own.end;
            c.record_rows().into_iter().map(|group| group.into_iter().map(moved).collect()).collect::<Vec<Vec<_>>>()
        };
        self.calibrations.iter().enumerate().flat_map(of_run).collect()
    }

    /// What one standard deviation of each sensor's gain does to the residuals of all runs.
    fn gain_errors(&self) -> Vec<Common> {
        let mut by_sensor: BTreeMap<&str, Common> = BTreeMap::new();
        for (r, calibration) in self.calibrations.iter().enumerate() {
            let first = self.places(r)[0].start;
            for (sensor, moved) in calibration.gain_errors() {
                by_sensor.entry(sensor).or_default().extend(moved.into_iter().map(|(at, by)| (first + at, by)));
            }
        }
        by_sensor.into_values().collect()
    }

    /// Residuals in order, from those of each run.
    fn ordered(&self, each: &[Vec<f64>]) -> Vec<f64> {
        let parts = || each.iter().zip(&self.calibrations).map(|(r, c)| r.split_at(c.samples()));
        parts().flat_map(|p| p.0).chain(parts().flat_map(|p| p.1)).copied().collect()
    }
}

impl Problem for Joint<'_> {
    type Error = ModelError;

    fn residuals(&self, x: &[f64]) -> Result<Vec<f64>, ModelError> {
        let each: Result<Vec<_>, _> = (0..self.own.len()).map(|r| self.run_residuals(r, x)).collect();
        Ok(self.ordered(&each?))
    }

    fn residuals_moved(&self, x: &[f64], j: usize, base: &[f64]) -> Result<Vec<f64>, ModelError> {
        let Some(r) = self.own.iter().rposition(|&first| j >= first) else { return self.residuals(x) };
        let [samples, rest] = self.places(r);
        let moved = if j == self.thermometer(r) {
            self.run_residuals(r, x)?
        } else {
            let own = [&base[samples.clone()], &base[rest.start..rest.end - 1]].concat();
            let local = self.shared + j - self.own[r];
            let mut moved = self.calibrations[r].residuals_moved(&self.of_run(r, x), local, &own)?;
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
            Some(r) => self.calibrations[r].difference_step(self.shared + j - self.own[r]),
            None => step_of(&self.law.parameters[j]),
        }
    }
}

/// Fits all runs under the laws, and writes what they say into the `quantities`.
///
/// # Errors
/// A model that cannot be simulated at its start.
pub(crate) fn together(
    rig: &Rig,
    members: &[Member],
    fits: &[Fit],
    (laws, reference_degc, temperature_sd_k): (Laws, f64, f64),
    quantities: &mut [Quantity],
    progress: &(dyn Fn(&str, &Progress) + Sync),
) -> Result<Together, FamilyError> {
    let effects = &fits[0].effects;
    let models: Vec<Model> = members.iter().map(|m| Model::new(rig, &m.data.conditions.water, effects)).collect();
    let runs: Vec<(f64, String)> = members.iter().map(|m| (m.temperature_degc, m.data.file.clone())).collect();
    let law = LawModel::new(rig, &models[0].shared, laws, reference_degc, &runs);
    let fine: Vec<usize> = fits.iter().map(|f| f.reaches).collect();
    let joint = Joint::new(&law, members, &models, &fine, temperature_sd_k);

    let apart_values: Vec<Vec<f64>> =
        fits.iter().zip(&joint.calibrations).map(|(f, c)| c.variables(&f.values())).collect();
    let each = joint.calibrations.iter().zip(&apart_values).map(|(c, x)| {
        let residuals = c.residuals(x)?;
        // Apart, no thermometer is asked.
        Ok([&residuals[..], &[0.0]].concat())
    });
    let apart = joint.ordered(&each.collect::<Result<Vec<_>, ModelError>>()?);

    let mut start = from_apart(&law, &models[0].shared, members, fits);
    apart_values.iter().for_each(|x| start.extend(x[joint.shared..].iter().chain(&[0.0])));
    let samples = joint.samples();
    let shown = |iteration, cost: f64| {
        let error_over_noise = (2.0 * cost / samples.max(1) as f64).sqrt();
        let reaches = fine.iter().copied().max().unwrap_or(0);
        progress("all runs", &Progress { stage: "together".into(), reaches, iteration, error_over_noise });
    };
    let solution = minimise(&joint, &start, LIMITS, shown)?;

    let columns = jacobian(&joint, &solution.x, &solution.residuals)?;
    let of_noise = noise_a_parameter(&joint, fits, (&apart_values, &apart), (&solution, &columns))?;
    let comparison = compare(&sums(&joint, fits, &apart, &solution, of_noise));
    let widening = comparison.filter(|c| c.verdict != Verdict::Describe).map_or(1.0, |c| c.f.max(1.0).sqrt());
    let pull = grid_pull(&joint, &models, &solution, &columns)?;
    // As in a fit of one run: half of what the last halving of the grid's step moved.
    let left: Vec<f64> = pull.iter().map(|p| 0.5 * p).collect();
    let errors = Errors::of(Linearised {
        columns: &columns,
        residuals: &solution.residuals,
        records: &joint.records(),
        common: &joint.gain_errors(),
        at_bound: &solution.at_bound,
        in_time: None,
        elsewhere: None,
    })
    .and(&left);
    let errors: Vec<f64> = (0..columns.len()).map(|j| widening * errors.of_variable(j)).collect();
    let alike = correlation(&columns, &solution.at_bound);
    lines(&joint, &solution.x, &errors, &alike, quantities);

    Ok(Together {
        laws,
        parameters: law.parameters.iter().enumerate().map(|(j, p)| parameter(p, &solution, &errors, j)).collect(),
        runs: run_errors(&joint, &apart, &solution),
        comparison,
        stopped_because: solution.stop.describe(),
        converged: solution.stop.converged(),
    })
}

/// What a grid of half the step moved the variables by, by one Gauss-Newton step.
fn grid_pull(
    joint: &Joint,
    models: &[Model],
    solution: &Solution,
    columns: &[Vec<f64>],
) -> Result<Vec<f64>, ModelError> {
    let coarse: Vec<usize> = (0..models.len())
        .map(|r| {
            let calibration = &joint.calibrations[r];
            let values = calibration.values(&joint.of_run(r, &solution.x));
            models[r].fitting_reaches(&values[..joint.shared], (calibration.window().reaches / 2).max(1))
        })
        .collect();
    let coarser =
        Joint::new(joint.law, joint.members, models, &coarse, joint.temperature_sd_k).residuals(&solution.x)?;
    let change: Vec<f64> = solution.residuals.iter().zip(&coarser).map(|(f, c)| f - c).collect();
    Ok(gauss_newton_step(columns, &change, &solution.at_bound))
}
