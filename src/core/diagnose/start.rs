//! The start model of a diagnosis: fitted to the records as far as it can follow them.
//!
//! A model that lacks an effect leaves errors that are no noise. Weighed as noise, they outvote everything that the instruments know: velocity, head and
//! places go wherever they make up for the missing effect, and every candidate starts from there. So a model that cannot follow the records
//! is fitted again with weights that say so: the error of a sample is what the model leaves, and samples whose errors are alike count once.

use crate::diagnose::candidate_fit::{evidence_scale, over_noise};
use crate::diagnose::circumstances::features;
use crate::diagnose::limits::START_DOUBTFUL;
use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::problem::error::FitError;
use crate::fit::progress::{OnProgress, Progress};
use crate::fit::search::calibrate::calibrate;
use crate::fit::search::options::Options;
use crate::model::effects::Chosen;
use crate::rig::Rig;

/// Fits the start model.
///
/// # Errors
/// As [`calibrate`].
pub(crate) fn start_model(
    rig: &Rig,
    runs: &[RunData],
    effects: &[Chosen],
    options: &Options,
    progress: &OnProgress<'_>,
) -> Result<Fit, FitError> {
    let fitted = |runs: &[RunData]| {
        calibrate(rig, runs, effects, options, &|p: &Progress| progress(&p.within("the start model")))
    };
    let fit = fitted(runs)?;
    if over_noise(&fit, runs) < START_DOUBTFUL {
        return Ok(fit);
    }
    let unit = evidence_scale(&fit, features(runs)).unit;
    let mut doubtful = fitted(&louder(runs, unit.sqrt()))?;
    for (run, own) in doubtful.runs.iter_mut().zip(runs) {
        for (sensor, own) in run.sensors.iter_mut().zip(&own.sensors) {
            sensor.white_noise_m = own.noise_m;
        }
    }
    Ok(doubtful)
}

/// The runs with `times` the noise.
fn louder(runs: &[RunData], times: f64) -> Vec<RunData> {
    let mut runs = runs.to_vec();
    runs.iter_mut().flat_map(|r| &mut r.sensors).for_each(|s| s.noise_m *= times);
    runs
}
