//! Where the energy of a run goes in a model as fitted.

use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::problem::fit_problem::{FitProblem, Window};
use crate::model::energy::Energy;
use crate::model::{Model, ModelError};
use crate::rig::Rig;

/// The energy book of run `r` of those that were fitted, on the fit's own grid, to the end of the recording.
///
/// # Errors
/// As [`Model::simulate`].
pub fn energy_of(rig: &Rig, runs: &[RunData], fit: &Fit, r: usize) -> Result<Option<Energy>, ModelError> {
    let Some(first) = runs.first().filter(|_| r < runs.len()) else { return Ok(None) };
    let model = Model::new(rig, &first.conditions.water, &fit.effects);
    let problem = FitProblem::new(&model, runs, Window { reaches: fit.reaches, horizon_s: f64::INFINITY, stride: 1 });
    problem.energy(r, &fit.values(), fit.reaches)
}
