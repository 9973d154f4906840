//! The joint posterior of a fit, as the command line asks for it.

use crate::cli::args::values;
use crate::cli::console::print::tell_warning;
use crate::cli::console::progress::shown;
use crate::fit::outcome::fit::Fit;
use crate::fit::problem::objective::Objective;
use crate::fit::search::options::Options;
use crate::report::calibration::posterior;
use crate::study::Study;
use crate::study::error::Error;

/// How many draws are wanted.
#[derive(Debug, clap::Args)]
pub struct Sampling {
    /// Take the 95% intervals from the joint posterior, sampled until each parameter has this many independent draws;
    /// of a diagnosis those of its final model.
    #[arg(long = "posterior", value_name = "N", value_parser = values::draws, allow_negative_numbers = true)]
    wanted: Option<usize>,
}

impl Sampling {
    /// Whether that was asked for.
    pub fn is_wanted(&self) -> bool {
        self.wanted.is_some()
    }

    /// Refuses a fit that has no posterior.
    ///
    /// # Errors
    /// Frequencies are compared.
    pub fn check(&self, options: &Options) -> Result<(), String> {
        match (self.wanted, options.objective) {
            (Some(_), Objective::Frequency) => {
                Err("a posterior is that of the samples: leave out --posterior, or --misfit frequency".to_owned())
            }
            _ => Ok(()),
        }
    }

    /// Where that was asked for, samples the fit's posterior and says which intervals are in doubt. Warns where the
    /// chains have not met.
    ///
    /// # Errors
    /// A model that cannot be simulated.
    pub fn apply(&self, study: &mut Study, fit: &mut Fit, seed: u64) -> Result<(), Error> {
        let Some(wanted) = self.wanted else { return Ok(()) };
        shown(study, "", |study| study.sample(fit, wanted, seed))?;
        posterior::reservation(fit).iter().for_each(|reservation| tell_warning!("{reservation}"));
        Ok(())
    }
}
