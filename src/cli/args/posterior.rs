//! The joint posterior of a fit, as the command line asks for it.

use crate::cli::console::print::tell_warning;
use crate::cli::console::progress::progress_bar;
use crate::fit::outcome::fit::Fit;
use crate::fit::posterior::doubt::find_doubts;
use crate::fit::posterior::sample::sample;
use crate::fit::problem::objective::Objective;
use crate::fit::progress::Progress;
use crate::fit::search::options::Options;
use crate::report::calibration::posterior;
use crate::study::Study;

/// How many draws are wanted.
#[derive(Debug, clap::Args)]
pub struct Sampling {
    /// Take the 95% intervals from the joint posterior, sampled until each parameter has this many independent draws.
    #[arg(long, value_name = "N", conflicts_with = "names", value_parser = clap::value_parser!(u32).range(100..=100_000),
          allow_negative_numbers = true)]
    posterior: Option<u32>,
}

impl Sampling {
    /// Refuses a fit that has no posterior.
    ///
    /// # Errors
    /// Frequencies are compared.
    pub fn check(&self, options: &Options) -> Result<(), String> {
        match (self.posterior, options.objective) {
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
    pub fn apply(
        &self,
        study: &Study,
        fit: &mut Fit,
        options: &Options,
    ) -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
        let Some(wanted) = self.posterior else { return Ok(()) };
        let began = std::time::Instant::now();
        let bar = progress_bar();
        find_doubts(study.rig(), study.runs(), fit, options)?;
        let shown = |p: &Progress| bar.set_message(p.stage.clone());
        sample(study.rig(), study.runs(), fit, wanted as usize, options, &shown)?;
        bar.finish_and_clear();
        fit.seconds += began.elapsed().as_secs_f64();
        if let Some(sampled) = fit.posterior.as_ref().filter(|sampled| !sampled.converged) {
            tell_warning!("{}", posterior::not_converged(sampled));
        } else if fit.posterior.is_none() {
            tell_warning!("the fit has no posterior: its noise or its slopes are not finite");
        }
        Ok(())
    }
}
