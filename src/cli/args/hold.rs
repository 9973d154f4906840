//! `--hold NAME=VALUE`: parameters that a fit does not touch.

use crate::cli::console::print::tell;
use crate::model::constraint::Constraint;
use crate::model::effects::Chosen;
use crate::report::text::number::significant;
use crate::results::model_file::Entry;
use crate::study::Study;
use crate::study::hold;

/// Refuses two values for one parameter.
///
/// # Errors
/// The first parameter that is held twice.
pub fn check(hold: &[(String, f64)]) -> Result<(), String> {
    let twice = hold.iter().enumerate().find(|(i, (name, _))| hold[..*i].iter().any(|(n, _)| n == name));
    twice.map_or(Ok(()), |(_, (name, _))| Err(format!("--hold names {name} twice: give it one value")))
}

/// Warns of values of an `option` that lie outside the bounds of a fit.
pub fn warn_beyond(option: &str, study: &Study, effects: &[Chosen], values: &[(String, f64)]) {
    for hold::Beyond { name, value, lower, upper } in hold::beyond(study.rig(), study.runs(), effects, values) {
        let [lower, upper] = [lower, upper].map(|bound| significant(bound, 3));
        let value = if (1e-4..1e9).contains(&value.abs()) { value.to_string() } else { format!("{value:e}") };
        tell!("warning: {option} {name}={value} lies outside the bounds of a fit, {lower} to {upper}: check its unit");
    }
}

/// What holds mean for each of several models; warns of values outside the bounds of the last one.
pub fn constraints(study: &Study, models: &[Vec<Chosen>], hold: &[(String, f64)]) -> Vec<Vec<Constraint>> {
    if let Some(last) = models.last() {
        warn_beyond("--hold", study, last, hold);
    }
    hold::constraints(study.rig(), study.runs(), models, hold)
}

/// Adds what a model of a file settles where `held` says nothing else; with `warn`, names the held parameters that the model with these
/// `effects` does not have.
pub fn settle(held: &mut Vec<Constraint>, from: &Entry, study: &Study, effects: &[Chosen], warn: bool) {
    for name in hold::settle(held, from, study.rig(), study.runs(), effects) {
        if warn {
            tell!("warning: the file given with --from holds {name}, and this model has no such parameter");
        }
    }
}
