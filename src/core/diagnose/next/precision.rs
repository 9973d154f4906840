//! How much a test is expected to narrow a parameter.

use crate::diagnose::baseline::{Baseline, window};
use crate::diagnose::next::answer::{Answer, Known, flat};
use crate::diagnose::next::change::Change;
use crate::diagnose::next::separation::{Informed, prepared, values_of, with_known};
use crate::fit::numeric::least_squares::{Problem, jacobian};
use crate::fit::problem::fit_problem::FitProblem;
use crate::model::RunValues;
use crate::product::gram;

/// A test, and how exactly a parameter would be known after it.
#[derive(Debug, Clone)]
pub struct Precision {
    /// What to do.
    pub instruction: String,
    /// What it changes in the first run.
    pub change: Change,
    /// The settings of the test.
    pub run: RunValues,
    /// The parameter's standard error before the test and after it, in its own unit.
    pub before: f64,
    /// See `before`.
    pub after: f64,
}

/// What a test is expected to do for the known variable `j`; none where it cannot be simulated.
pub(crate) fn of(baseline: &Baseline, answer: &Answer, known: &Known, j: usize, change: Change) -> Option<Precision> {
    let stage = change.stage(baseline.rig, &baseline.runs[0]);
    let runs = [prepared(&stage, known, change)];
    let model = stage.model(&answer.effects);
    let problem = FitProblem::new(&model, &runs, window(baseline.reaches));
    let values = values_of(&problem, known, &known.centre, change);
    let x = problem.variables(&values);
    let informed = Informed::new(&problem, known);
    let at = informed.place[j]?;
    let base = problem.residuals(&x).ok()?;
    let columns: Vec<Vec<f64>> = jacobian(&problem, &x, &base).ok()?.into_iter().map(|c| informed.own(c)).collect();
    let mut information = with_known(gram(&columns), known, &informed.place);
    for k in 0..columns.len() {
        information[(k, k)] += flat(&problem, k);
    }
    let after = information.cholesky()?.inverse()[(at, at)].sqrt();
    let before = (known.root.transpose() * &known.root).cholesky()?.inverse()[(j, j)].sqrt();
    let stretch = problem.stretch(at, values[at]);
    Some(Precision {
        instruction: change.instruction(&known.runs[0], baseline.rig, ""),
        change,
        run: change.of(&known.runs[0]),
        before: before * stretch * known.unit.sqrt(),
        after: after * stretch * known.unit.sqrt(),
    })
}
