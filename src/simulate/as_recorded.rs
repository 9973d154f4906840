//! A model beside recordings: at their temperatures and supplies, at the times of their samples.

use std::collections::BTreeSet;

use crate::fit::data::run_data::RunData;
use crate::fit::problem::fit_problem::{FitProblem, Window};
use crate::fit::problem::observed::{Place, Shown, observations};
use crate::model::constraint::Given;
use crate::model::effects::Chosen;
use crate::model::{Model, ModelError};
use crate::rig::Rig;
use crate::simulate::memory;

/// Reaches unless `reaches` is set.
const REACHES: usize = 240;

/// A parameter and its value.
pub type Setting = (String, f64);

/// A model beside recordings.
pub struct AsRecorded {
    /// Effects, as on the command line.
    pub effects: Vec<String>,
    /// Values of the parameters that the runs share.
    pub settings: Vec<Setting>,
    /// Parameters that nobody set, at the values where a fit would start.
    pub not_set: Vec<Setting>,
    /// Reaches of the grid.
    pub reaches: usize,
    /// Where the model was read: run, sensor and time.
    pub places: Vec<Place>,
    /// What it shows there: the head in m; of a flow meter, the flow before the closure.
    pub values: Vec<f64>,
}

/// A model that cannot be shown beside these recordings.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the sentences say it
pub enum AsRecordedError {
    #[error("the model has no parameter '{name}'{of}; of {files} it has {known}")]
    NoSuchParameter { name: String, of: String, files: String, known: String },
    #[error(transparent)]
    Model(#[from] ModelError),
}

/// Simulates `runs` with `effects` at the `given` values, the first that concerns a parameter counting; at `places`, or
/// else at every sample from shortly before the closure.
///
/// # Errors
/// Values of parameters that the model does not have, a model that cannot be simulated.
pub fn as_recorded(
    rig: &Rig,
    runs: &[RunData],
    effects: &[Chosen],
    given: &[Given],
    reaches: Option<usize>,
    places: Option<Vec<Place>>,
) -> Result<AsRecorded, AsRecordedError> {
    let mut model = Model::new(rig, &runs[0].conditions.water, effects);
    model.memory_limit_bytes = memory::limit_bytes();
    let window = Window { reaches: reaches.unwrap_or(REACHES), horizon_s: f64::INFINITY, stride: 1 };
    let mut problem = FitProblem::new(&model, runs, window);
    let (values, not_set) = values(&problem, given)?;
    let shared = &values[..model.shared.len()];
    if reaches.is_none() {
        let fitting = model.fitting_reaches(shared, REACHES.max(model.least_reaches(shared)));
        problem.set_window(Window { reaches: fitting, ..window });
    }
    let places = places.unwrap_or_else(|| observations(&problem).iter().map(|o| o.place).collect());
    let shown = Shown::of(&problem, &values)?;
    Ok(AsRecorded {
        effects: model.effects.iter().map(Chosen::label).collect(),
        settings: problem.parameters.iter().zip(shared).map(|(p, v)| (p.name.clone(), *v)).collect(),
        not_set,
        reaches: problem.window().reaches,
        values: places.iter().map(|place| shown.at(place)).collect(),
        places,
    })
}

/// A value for each of the problem's parameters: as given, or where a fit would start; and those that were not given.
pub(crate) fn values(problem: &FitProblem, given: &[Given]) -> Result<(Vec<f64>, Vec<Setting>), AsRecordedError> {
    let run = |j: usize| problem.run_of(j).map(|r| problem.runs[r].file.as_str());
    let own = || problem.parameters.iter().enumerate();
    let strange = |g: &&Given| !own().any(|(j, p)| g.concerns(&p.name, run(j)));
    if let Some(g) = given.iter().find(strange) {
        let known: BTreeSet<&str> = own().map(|(_, p)| p.name.as_str()).collect();
        return Err(AsRecordedError::NoSuchParameter {
            name: g.name.clone(),
            of: g.run.as_ref().map_or(String::new(), |run| format!(" of {run}")),
            files: problem.runs.iter().map(|run| run.file.as_str()).collect::<Vec<_>>().join(", "),
            known: known.into_iter().collect::<Vec<_>>().join(", "),
        });
    }
    let mut missing = Vec::new();
    let values = own()
        .map(|(j, p)| match given.iter().find(|g| g.concerns(&p.name, run(j))) {
            Some(g) => g.value,
            None => {
                missing.push((p.name.clone(), p.start));
                p.start
            }
        })
        .collect();
    Ok((values, missing))
}
