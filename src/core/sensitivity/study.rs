//! A whole study of one model as one document, method by method.

use serde::Serialize;

use crate::sensitivity::error::check_count;
use crate::sensitivity::factor::Factor;
use crate::sensitivity::features::{OUTPUTS, Output};
use crate::sensitivity::subject::Subject;
use crate::sensitivity::{SensitivityError, Tick, levels, map, morris, sobol};

/// Results of all methods.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Study {
    /// Name of the rig.
    pub rig: String,
    /// Effects of the model.
    pub effects: Vec<String>,
    /// The sensor.
    pub sensor: String,
    /// Reaches of the grid.
    pub reaches: usize,
    /// Theoretical period `4L/a` at the values under study, s.
    pub period_s: f64,
    /// The values under study, by name.
    pub values: Vec<(String, f64)>,
    /// Seed of the random draws.
    pub seed: u64,
    /// One-way analysis of variance.
    pub anova: Option<levels::Study>,
    /// Elementary effects.
    pub morris: Option<Table<morris::Effects>>,
    /// Shares of the variance.
    pub sobol: Option<Table<sobol::Indices>>,
    /// Maps.
    pub maps: Vec<map::Map>,
}

/// One number, or a few, for each parameter and output.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Table<T> {
    /// The parameters with the ranges over which they varied.
    pub factors: Vec<Factor>,
    /// One row per output.
    pub outputs: Vec<Column<T>>,
    /// Number of simulations.
    pub runs: usize,
    /// Number of simulations that failed.
    pub failed: usize,
    /// Reason of the first failure.
    pub why: Option<String>,
}

/// One output's row of a table.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Column<T> {
    /// The output.
    pub output: Output,
    /// One entry per parameter, in the order of [`Table::factors`].
    pub parameters: Vec<T>,
    /// Share of the simulations that have the output.
    pub defined: f64,
}

/// The outputs of Morris and Sobol: peaks, their times, phase and damping.
pub fn outputs() -> Vec<usize> {
    let names = ["peak", "time", "phase", "damping"];
    (0..OUTPUTS.len()).filter(|&i| names.iter().any(|n| OUTPUTS[i].name.starts_with(n))).collect()
}

/// Elementary effects of each parameter.
///
/// # Errors
/// Nothing varies, a count out of range; if all simulations fail.
pub fn elementary_effects(
    subject: &Subject,
    factors: &[Factor],
    trajectories: usize,
    seed: u64,
    tick: Tick,
) -> Result<Table<morris::Effects>, SensitivityError> {
    check_count("trajectories", trajectories, 2..=100_000)?;
    if factors.is_empty() {
        return Err(SensitivityError::NothingVaries);
    }
    let design = morris::design(factors.len(), trajectories, seed);
    table(subject, factors, &design.points, tick, |values| design.effects(values))
}

/// Shares of the variance of each parameter.
///
/// # Errors
/// Nothing varies, a count out of range; if all simulations fail.
pub fn variance_shares(
    subject: &Subject,
    factors: &[Factor],
    rows: usize,
    seed: u64,
    tick: Tick,
) -> Result<Table<sobol::Indices>, SensitivityError> {
    let design = sobol::design(factors.len(), rows, seed)?;
    table(subject, factors, &design.points, tick, |values| design.shares(values).parameters)
}

fn table<T>(
    subject: &Subject,
    factors: &[Factor],
    points: &[Vec<f64>],
    tick: Tick,
    of: impl Fn(&[f64]) -> Vec<T>,
) -> Result<Table<T>, SensitivityError> {
    let ran = subject.run_cube(factors, points, tick)?;
    let column = |o: usize| {
        let values: Vec<f64> = ran.outputs.iter().map(|v| v[o]).collect();
        let defined = values.iter().filter(|v| v.is_finite()).count() as f64 / values.len() as f64;
        Column { output: OUTPUTS[o], parameters: of(&values), defined }
    };
    Ok(Table {
        factors: factors.to_vec(),
        outputs: outputs().into_iter().map(column).collect(),
        runs: points.len(),
        failed: ran.failed,
        why: ran.why.map(|e| e.to_string()),
    })
}
