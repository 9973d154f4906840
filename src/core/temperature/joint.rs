//! All runs at once: each run's shared parameters are what the laws make of its temperature, the rest is its own.

pub(crate) mod problem;
pub(crate) mod squares;
pub(crate) mod summary;

use crate::fit::inference::errors::{Errors, Linearised};
use crate::fit::numeric::least_squares::{Problem, Solution, jacobian, minimise};
use crate::fit::numeric::uncertainty::{correlation, gauss_newton_step};
use crate::fit::outcome::fit::Fit;
use crate::fit::progress::Progress;
use crate::model::{Model, ModelError};
use crate::number::significant;
use crate::rig::Rig;
use crate::temperature::apart::Quantity;
use crate::temperature::compare::{Comparison, Verdict, chance, compare};
use crate::temperature::joint::problem::JointProblem;
use crate::temperature::joint::squares::{noise_per_parameter, sums};
use crate::temperature::joint::summary::{LawParameter, RunError, lines, parameter, run_errors};
use crate::temperature::law::{LawModel, Laws};
use crate::temperature::member::{FamilyError, Member};
use crate::temperature::start::from_apart;
use crate::temperature::thresholds::JOINT_LIMITS;

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
    /// Warnings for the reader.
    pub(crate) fn remarks(&self) -> Vec<String> {
        let mut out = Vec::new();
        if let Some(c) = self.comparison.filter(|c| c.verdict != Verdict::Describe) {
            let (verdict, errors) = match c.verdict {
                Verdict::Fail => (
                    "the laws do not describe the runs: trust the separate fits",
                    "the laws' parameters have no intervals, as they mean nothing",
                ),
                _ => (
                    "the laws nearly describe the runs: they leave little more than noise",
                    "intervals of the laws are widened by the root of F",
                ),
            };
            out.push(format!("{verdict} (F = {}, chance {}); {errors}", significant(c.f, 3), chance(c.chance)));
        }
        if self.comparison.is_none() {
            out.push(
                "these laws have as many parameters as the separate fits, so the runs cannot contradict them".into(),
            );
        }
        for p in self.parameters.iter().filter(|p| p.at_bound) {
            out.push(format!("{} ended at its bound", p.name));
        }
        if self.parameters.iter().any(|p| p.name == "activation_kJ_mol" && p.interval.1 < 0.0) {
            out.push(
                "by these runs a warmer wall creeps more slowly: check which temperature belongs to which run".into(),
            );
        }
        if !self.converged {
            out.push(format!("the fit together is not finished: {}", self.stopped_because));
        }
        out
    }
}

/// Fits all runs under the laws, and adds the laws' values to the `quantities`.
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
    let joint = JointProblem::new(&law, members, &models, &fine, temperature_sd_k);

    let apart_values: Vec<Vec<f64>> = fits.iter().zip(&joint.problems).map(|(f, c)| c.variables(&f.values())).collect();
    let each = joint.problems.iter().zip(&apart_values).map(|(c, x)| {
        let residuals = c.residuals(x)?;
        // The separate fits have no thermometer.
        Ok([&residuals[..], &[0.0]].concat())
    });
    let apart = joint.ordered(&each.collect::<Result<Vec<_>, ModelError>>()?);

    let mut start = from_apart(&law, &models[0].shared, members, fits);
    apart_values.iter().for_each(|x| start.extend(x[joint.shared..].iter().chain(&[0.0])));
    let samples = joint.samples();
    let shown = |iteration, cost: f64| {
        let error_over_noise = (2.0 * cost / samples.max(1) as f64).sqrt();
        let reaches = fine.iter().copied().max().unwrap_or(0);
        progress("all runs", &Progress::fitting("together", reaches, iteration, error_over_noise));
    };
    let solution = minimise(&joint, &start, JOINT_LIMITS, shown)?;

    let columns = jacobian(&joint, &solution.x, &solution.residuals)?;
    let of_noise = noise_per_parameter(&joint, fits, (&apart_values, &apart), (&solution, &columns))?;
    let comparison = compare(&sums(&joint, fits, &apart, &solution, of_noise));
    let widening = comparison.map_or(1.0, |c| match c.verdict {
        Verdict::Describe => 1.0,
        Verdict::Nearly => c.f.max(1.0).sqrt(),
        // Parameters of a law that does not hold mean nothing, and no error describes them.
        Verdict::Fail => f64::INFINITY,
    });
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
    })
    .and(&left);
    let errors: Vec<f64> = (0..columns.len()).map(|j| widening * errors.of_variable(j)).collect();
    let correlation = correlation(&columns, &solution.at_bound);
    lines(&joint, &solution.x, &errors, &correlation, quantities);

    Ok(Together {
        laws,
        parameters: law.parameters.iter().enumerate().map(|(j, p)| parameter(p, &solution, &errors, j)).collect(),
        runs: run_errors(&joint, &apart, &solution),
        comparison,
        stopped_because: solution.stop.describe(),
        converged: solution.stop.converged(),
    })
}

/// How far a grid of half the step moved the variables, by one Gauss-Newton step.
fn grid_pull(
    joint: &JointProblem,
    models: &[Model],
    solution: &Solution,
    columns: &[Vec<f64>],
) -> Result<Vec<f64>, ModelError> {
    let coarse: Vec<usize> = (0..models.len())
        .map(|r| {
            let problem = &joint.problems[r];
            let values = problem.values(&joint.of_run(r, &solution.x));
            models[r].fitting_reaches(&values[..joint.shared], (problem.window().reaches / 2).max(1))
        })
        .collect();
    let coarser =
        JointProblem::new(joint.law, joint.members, models, &coarse, joint.temperature_sd_k).residuals(&solution.x)?;
    let change: Vec<f64> = solution.residuals.iter().zip(&coarser).map(|(f, c)| f - c).collect();
    Ok(gauss_newton_step(columns, &change, &solution.at_bound))
}
