//! A model on recordings that it was not fitted to: what is known of these runs.

use std::path::{Path, PathBuf};

use crate::cli::args::{hold, recordings};
use crate::cli::console::outcome::AnyError;
use crate::cli::console::progress::shown;
use crate::study::Study;
use crate::study::error::Error;
use crate::study::predict::{Predicted, Question, predicted};

/// Values of the predicted runs that are known better than from their signals.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct Own {
    /// Closing time of the runs [default: read from the first rise].
    #[arg(long, value_name = "SECONDS", value_parser = crate::cli::args::values::positive, allow_negative_numbers = true)]
    closing_time: Option<f64>,
    /// Other known values of the runs, such as initial_velocity_m_s=0.4.
    #[arg(long, value_name = "NAME=VALUE", value_parser = crate::cli::args::values::setting, num_args = 1..)]
    hold: Vec<(String, f64)>,
    /// Read the recordings with this rig instead of the stored one.
    #[arg(long, value_name = "RIG")]
    pub rig: Option<PathBuf>,
    /// Predict although pipes, supply or fluid differ from the model's.
    #[arg(long)]
    other_rig: bool,
}

impl Own {
    /// What the model in force in a file predicts of recordings.
    ///
    /// # Errors
    /// A model or a recording that cannot be read, another pipeline than the model's, a value that is none of a run's.
    pub fn predicted(&self, model: &Path, files: &[PathBuf]) -> Result<(Study, Predicted), AnyError> {
        hold::check(self.hold.iter().map(|(name, _)| name))?;
        let mut study = recordings::open(files, self.rig.as_deref())?;
        let mut held = self.hold.clone();
        if let Some(seconds) = self.closing_time {
            held.retain(|(name, _)| name != "closing_time_s");
            held.push(("closing_time_s".to_owned(), seconds));
        }
        let asked = Question { model, recordings: files, hold: &held, other_pipeline: self.other_rig };
        let found = shown(&mut study, "", |study| predicted(study, &asked)).map_err(|error| match error {
            Error::OtherPipeline(_) | Error::UnknownPipeline(_) => {
                format!("{error}; add --other-rig to predict all the same").into()
            }
            other => AnyError::from(other),
        })?;
        Ok((study, found))
    }
}
