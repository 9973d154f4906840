//! The start model of a diagnosis: fitted to the records, and where it cannot follow them, a second time for the
//! search.
//!
//! A model that lacks an effect leaves errors that are no noise. Weighed as noise, they outvote everything that the
//! instruments know: velocity, head and places go wherever they make up for the missing effect, and no candidate finds
//! back from there. So a model that cannot follow the records is fitted again with weights that say so: the error of a
//! sample is what the model leaves, and samples whose errors are alike count once. The search for what is missing
//! begins at this second fit. What an effect explains is counted from the first, the best that the model does without
//! it.

use crate::diagnose::circumstances::features;
use crate::diagnose::measures::evidence_scale;
use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::problem::error::FitError;
use crate::fit::progress::{OnProgress, Progress};
use crate::fit::search::calibrate::calibrate;
use crate::fit::search::options::Options;
use crate::fit::search::thresholds::DOUBTFUL_ABOVE;
use crate::model::effects::Chosen;
use crate::rig::Rig;

/// See the module.
pub(crate) struct Start {
    /// The best fit of the model.
    pub(crate) fit: Fit,
    /// The fit that keeps to what the instruments say, where the search begins at that.
    pub(crate) held: Option<Fit>,
}

impl Start {
    /// A model that is fitted already.
    pub(crate) fn of(fit: Fit) -> Start {
        Start { fit, held: None }
    }

    /// Fits the model.
    ///
    /// # Errors
    /// As [`calibrate`].
    pub(crate) fn fitted(
        rig: &Rig,
        runs: &[RunData],
        effects: &[Chosen],
        options: &Options,
        progress: &OnProgress<'_>,
    ) -> Result<Start, FitError> {
        let fitted = |runs: &[RunData]| {
            calibrate(rig, runs, effects, options, &|p: &Progress| progress(&p.within("the start model")))
        };
        let fit = fitted(runs)?;
        if fit.over_noise() < DOUBTFUL_ABOVE {
            return Ok(Start::of(fit));
        }
        let unit = evidence_scale(&fit, features(runs)).unit;
        let mut held = fitted(&louder(runs, unit.sqrt()))?;
        for (run, own) in held.runs.iter_mut().zip(runs) {
            for (sensor, own) in run.sensors.iter_mut().zip(&own.sensors) {
                sensor.white_noise_m = own.noise_m;
            }
        }
        // Where the instruments allow no better than a constant, they do not show where to begin.
        let held = (held.pooled().0 < held.signal_m()).then_some(held);
        Ok(Start { fit, held })
    }
}

/// The runs with `times` the noise.
fn louder(runs: &[RunData], times: f64) -> Vec<RunData> {
    let mut runs = runs.to_vec();
    runs.iter_mut().flat_map(|r| &mut r.sensors).for_each(|s| s.noise_m *= times);
    runs
}
