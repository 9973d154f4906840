//! The design that an analysis of variance is made of: each parameter at some levels, several runs a level.
//!
//! A simulation is deterministic: the same values give the same head, so that runs which repeat them have no variance within a level, F is
//! infinite and p is 0 for whatever matters at all. Repeats mean something only where something else varies between them. Here they are the other
//! parameters: each run draws them anew, evenly over their ranges. F then asks whether a parameter is seen through the doubt about the others, and
//! grows with the inverse square of how wide those ranges are.

use serde::Serialize;

use crate::sensitivity::anova::{OneWay, one_way};
use crate::sensitivity::error::check_count;
use crate::sensitivity::factor::Factor;
use crate::sensitivity::features::{OUTPUTS, Output};
use crate::sensitivity::subject::Subject;
use crate::sensitivity::{SensitivityError, Tick};

/// What to run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Plan {
    /// Levels of each parameter.
    pub levels: usize,
    /// Runs a level.
    pub repeats: usize,
    /// Where the random draws start.
    pub seed: u64,
}

/// One parameter's analysis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Analysis {
    /// The parameter.
    pub parameter: String,
    /// Its levels, in its unit.
    pub levels: Vec<f64>,
    /// Each output's, in the order of [`Study::outputs`]; none where too few runs have the output.
    pub outputs: Vec<Option<OneWay>>,
}

/// All of them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Study {
    /// What was run.
    pub plan: Plan,
    /// What varied between repeats, and how far.
    pub drawn: Vec<Factor>,
    /// What was looked at.
    pub outputs: Vec<Output>,
    /// One a parameter.
    pub analyses: Vec<Analysis>,
    /// Simulations.
    pub runs: usize,
    /// Those that failed.
    pub failed: usize,
}

/// The outputs that the source paper looks at (differences of peaks and of their times), and phase and damping.
pub fn outputs() -> Vec<usize> {
    let names = ["drop", "lag", "phase", "damping"];
    (0..OUTPUTS.len()).filter(|&i| names.iter().any(|n| OUTPUTS[i].name.starts_with(n))).collect()
}

/// Simulations that a study of so many parameters takes.
pub fn runs(plan: Plan, parameters: usize) -> usize {
    plan.levels * plan.repeats * parameters
}

/// Analyses each of the `studied` parameters over its range; at each level the `drawn` parameters but itself are drawn anew for each run.
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
