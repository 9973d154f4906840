//! `--misfit`: what of a record a calibration compares.

use clap::ValueEnum;

use crate::fit::problem::objective as misfit;
use crate::fit::search::options::Options;

/// Option of commands that fit.
#[derive(Debug, Clone, Copy, clap::Args)]
pub struct CompareBy {
    /// What to compare once the phase fits: all samples, or the spectrum around the odd harmonics.
    #[arg(long, value_enum, default_value_t = Misfit::Time)]
    misfit: Misfit,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Misfit {
    /// All samples, weighted by their noise.
    Time,
    /// The complex spectrum around the odd harmonics above the noise, and the levels before and after.
    Frequency,
}

impl CompareBy {
    /// The options with what is compared.
    ///
    /// # Errors
    /// Frequencies with a search that no descent follows: it would not see them.
    pub fn options(self, options: Options) -> Result<Options, String> {
        match self.misfit {
            Misfit::Time => Ok(options),
            Misfit::Frequency if !options.method.descends() => {
                Err("--misfit frequency needs a search that descends: --method least-squares or global-local"
                    .to_owned())
            }
            Misfit::Frequency => Ok(Options { objective: misfit::Objective::Frequency, ..options }),
        }
    }
}
