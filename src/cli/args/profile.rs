//! Profile likelihood intervals, as the command line asks for them.

use crate::cli::console::print::{tell, tell_warning};
use crate::cli::console::progress::progress_bar;
use crate::fit::outcome::fit::Fit;
use crate::fit::problem::error::FitError;
use crate::fit::progress::Progress;
use crate::fit::search::options::Options;
use crate::fit::validate::profile::profiles;
use crate::report::text::number::{interval, significant};
use crate::study::Study;

/// Which parameters to profile.
#[derive(Debug, clap::Args)]
pub struct Profiles {
    /// Parameters whose 95% intervals come from profile likelihood: each is varied while all others are refitted. `all`
    /// takes all of them; a parameter of each run is profiled in all runs.
    #[arg(long = "profile", value_name = "NAME,…|all", value_delimiter = ',', conflicts_with = "wanted")]
    names: Vec<String>,
}

/// Fall of the sum of squares, in units of what one sample leaves, above which a profile's centre counts as below the
/// fit.
const BELOW: f64 = 1.0;

impl Profiles {
    /// Refuses a parameter that is held: it does not move.
    ///
    /// # Errors
    /// The first such.
    pub fn check<'a>(&self, mut held: impl Iterator<Item = &'a str>) -> Result<(), String> {
        match held.find(|held| self.names.iter().any(|n| n == held)) {
            None => Ok(()),
            Some(name) => {
                Err(format!("{name} is held, so it has no profile: leave it out of --profile, or do not hold it"))
            }
        }
    }

    /// Refuses a name that the fit does not have.
    ///
    /// # Errors
    /// The first such.
    fn which(&self, fit: &Fit) -> Result<Vec<usize>, String> {
        let all = self.names.iter().any(|n| n == "all");
        let has = |name: &String| fit.parameters.iter().any(|p| p.name == *name);
        if let Some(unknown) = self.names.iter().find(|n| *n != "all" && !has(n)) {
            let known: std::collections::BTreeSet<&str> = fit.parameters.iter().map(|p| p.name.as_str()).collect();
            let known = known.into_iter().collect::<Vec<_>>().join(", ");
            return Err(format!("the model has no parameter '{unknown}' to profile; it has {known}"));
        }
        let parameters = fit.parameters.iter().enumerate();
        let asked = parameters.filter(|(_, p)| !p.held && (all || self.names.contains(&p.name)));
        Ok(asked.map(|(j, _)| j).collect())
    }

    /// Profiles what was asked for; the fit's intervals become the profiles'. Warns where a profile disagrees with the
    /// linear interval.
    ///
    /// # Errors
    /// A name that the fit does not have, a model that cannot be simulated.
    pub fn apply(
        &self,
        study: &Study,
        fit: &mut Fit,
        options: &Options,
    ) -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
        let which = self.which(fit)?;
        if which.is_empty() {
            return Ok(());
        }
        let began = std::time::Instant::now();
        let bar = progress_bar();
        let shown = |p: &Progress| bar.set_message(p.stage.clone());
        let found: Result<_, FitError> = profiles(study.rig(), study.runs(), fit, &which, options, &shown);
        bar.finish_and_clear();
        let found = found?;
        fit.evaluations += found.evaluations;
        fit.seconds += began.elapsed().as_secs_f64();
        let below = found.below_fit > BELOW;
        if below {
            tell_warning!(
                "the fit is not at its optimum: the profiles found one with a χ² lower by {}, and are centred there",
                significant(found.below_fit, 3)
            );
        }
        for (j, profile) in which.into_iter().zip(found.of_each) {
            let parameter = &mut fit.parameters[j];
            let run = parameter.run.as_ref().map_or(String::new(), |r| format!(" of {r}"));
            if below {
                tell!(
                    "{}{run}: {}, the fit has {}",
                    parameter.name,
                    significant(profile.best, 5),
                    significant(parameter.value, 5)
                );
            }
            for (side, last) in ["below", "above"].into_iter().zip(profile.unknown_beyond) {
                if let Some(last) = last {
                    tell_warning!(
                        "{}{run}: the end of its profile {side} is unknown: beyond {}, no refit of the other parameters reached an optimum",
                        parameter.name,
                        significant(last, 4)
                    );
                }
            }
            let known = profile.unknown_beyond == [None; 2];
            if known && profile.disagrees() {
                tell_warning!(
                    "{}{run}: the profile's 95% interval, {}, differs from the linear one, {}: {}",
                    parameter.name,
                    interval(profile.interval_95),
                    interval(profile.linear_95),
                    match profile.unresolved {
                        0 => "trust the profile".to_owned(),
                        n => format!(
                            "{n} of its points are not optima and were left out; check it with --method global-local"
                        ),
                    }
                );
            }
            if profile.fell_by > 1.0 {
                tell_warning!(
                    "{}{run}: its profile contains a better fit, by {} in χ²; check it with --start",
                    parameter.name,
                    significant(profile.fell_by, 3)
                );
            }
            parameter.interval_95 = profile.interval_95;
            parameter.profile = Some(profile);
        }
        Ok(())
    }
}
