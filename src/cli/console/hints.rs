//! What to try after an error, in the words of the command line: the library names no flags.

use std::error::Error;

use crate::creep::CreepError;
use crate::fit::problem::error::FitError;
use crate::temperature::FamilyError;

/// The command or the option that helps with an error, if one does.
pub fn hint(error: &(dyn Error + 'static)) -> Option<&'static str> {
    if let Some(error) = error.downcast_ref::<FamilyError>() {
        return match error {
            FamilyError::NoTemperature { .. } => Some("name each run's with --temperature-degC, in the files' order"),
            FamilyError::OneTemperature { .. } => Some("`surgescope calibrate` fits runs at one temperature together"),
            FamilyError::Fit(error) => of_fit(error),
            _ => None,
        };
    }
    if let Some(error) = error.downcast_ref::<CreepError>() {
        return match error {
            CreepError::TooManyInReach { .. } => Some("fit the test with --elements N"),
            CreepError::NoWall => Some("add it to --effects"),
            _ => None,
        };
    }
    error.downcast_ref::<FitError>().and_then(of_fit)
}

fn of_fit(error: &FitError) -> Option<&'static str> {
    match error {
        FitError::NoSample { .. } => Some("see the closure's time with `surgescope inspect`"),
        FitError::NoRinging { .. } => Some("use --misfit time"),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hint_names_the_option_that_helps() {
        let short = FitError::NoRinging { file: "a.mcap".into(), sensor: "P1".into() };
        assert_eq!(hint(&FamilyError::Fit(short)), Some("use --misfit time"));
        let boxed: Box<dyn Error + Send + Sync> = CreepError::NoWall.into();
        assert_eq!(hint(boxed.as_ref()), Some("add it to --effects"));
        assert_eq!(hint(&FitError::NoRun), None);
    }
}
