//! The design behind the analysis of variance: each parameter at some levels, several runs per level.
//!
//! A simulation is deterministic: runs that repeat the same values have no variance within a level, so F is infinite
//! and p is 0 for everything that matters at all. Repeats mean something only if something else varies between them.
//! Here the other parameters do: each run draws them anew, evenly over their ranges. F then tells whether the effect of
//! a parameter stands out from the uncertainty of the others, and grows with the inverse square of the width of those
//! ranges.

use serde::Serialize;

use crate::sensitivity::anova::{OneWay, one_way};
use crate::sensitivity::error::check_count;
use crate::sensitivity::factor::Factor;
use crate::sensitivity::features::{OUTPUTS, Output};
use crate::sensitivity::subject::Subject;
use crate::sensitivity::{SensitivityError, Tick};

/// Size of the study.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Plan {
    /// Levels of each parameter.
    pub levels: usize,
    /// Runs per level.
    pub repeats: usize,
    /// Seed of the random draws.
    pub seed: u64,
}

/// Analysis of one parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Analysis {
    /// The parameter.
    pub parameter: String,
    /// Its levels, in its unit.
    pub levels: Vec<f64>,
    /// Result for each output, in the order of [`Study::outputs`]; none if too few runs have the output.
    pub outputs: Vec<Option<OneWay>>,
}

/// Analyses of all parameters.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Study {
    /// Size of the study.
    pub plan: Plan,
    /// Parameters that varied between repeats, with their ranges.
    pub drawn: Vec<Factor>,
    /// The outputs.
    pub outputs: Vec<Output>,
    /// One analysis per parameter.
    pub analyses: Vec<Analysis>,
    /// Number of simulations.
    pub runs: usize,
    /// Number of simulations that failed.
    pub failed: usize,
}

/// The outputs of the source paper (differences of peaks and of their times), and phase and damping.
pub fn outputs() -> Vec<usize> {
    let names = ["drop", "lag", "phase", "damping"];
    (0..OUTPUTS.len()).filter(|&i| names.iter().any(|n| OUTPUTS[i].name.starts_with(n))).collect()
}

/// Number of simulations that a study of `parameters` parameters takes.
pub fn runs(plan: Plan, parameters: usize) -> usize {
    plan.levels * plan.repeats * parameters
}

/// Analyses each of the `studied` parameters over its range. At each level every run draws the other `drawn` parameters
/// anew.
///
/// # Errors
/// Fewer than two levels or repeats, nothing to study; if all simulations fail.
pub fn study(
    subject: &Subject,
    studied: &[Factor],
    drawn: &[Factor],
    plan: Plan,
    tick: Tick,
) -> Result<Study, SensitivityError> {
    check_count("levels", plan.levels, 2..=1000)?;
    check_count("repeats", plan.repeats, 2..=100_000)?;
    if studied.is_empty() {
        return Err(SensitivityError::NothingVaries);
    }
    let mut rng = fastrand::Rng::with_seed(plan.seed);
    let mut points = Vec::with_capacity(runs(plan, studied.len()));
    for factor in studied {
        for level in factor.levels(plan.levels) {
            for _ in 0..plan.repeats {
                let mut values = subject.values.clone();
                for other in drawn.iter().filter(|o| o.slot != factor.slot) {
                    values[other.slot] = other.at(rng.f64());
                }
                values[factor.slot] = level;
                points.push(values);
            }
        }
    }
    let ran = subject.run(&points, tick)?;
    let chosen = outputs();
    let analyses = studied
        .iter()
        .zip(ran.outputs.chunks(plan.levels * plan.repeats))
        .map(|(factor, own)| {
            let groups =
                |o: usize| own.chunks(plan.repeats).map(|g| g.iter().map(|v| v[o]).collect()).collect::<Vec<_>>();
            Analysis {
                parameter: factor.name.clone(),
                levels: factor.levels(plan.levels),
                outputs: chosen.iter().map(|&o| one_way(&groups(o))).collect(),
            }
        })
        .collect();
    Ok(Study {
        plan,
        drawn: drawn.to_vec(),
        outputs: chosen.iter().map(|&o| OUTPUTS[o]).collect(),
        analyses,
        runs: points.len(),
        failed: ran.failed,
    })
}
