//! `--hold NAME=VALUE`: parameters that a fit does not touch, or keeps between two values.

use crate::cli::args::values::{number, pair};
use crate::cli::console::print::tell_warning;
use crate::model::constraint::Constraint;
use crate::model::effects::Chosen;
use crate::results::model_file::Entry;
use crate::study::Study;
use crate::study::hold::{self, Hold};

/// `NAME=VALUE` or `NAME=LEAST:MOST`.
///
/// # Errors
/// See [`pair`] and [`number`]; a range that is none.
pub fn held(text: &str) -> Result<Hold, String> {
    let (name, value) = pair(text).map_err(|e| format!("{e}, and name files before this option"))?;
    let (lower, upper) = match value.split_once(':') {
        None => (number(&value)?, number(&value)?),
        Some((lower, upper)) => (number(lower)?, number(upper)?),
    };
    match lower <= upper {
        true => Ok(Hold { name, lower, upper }),
        false => Err(format!("{lower} is above {upper}: write the range as {name}=LEAST:MOST")),
    }
}

/// Refuses two values for one parameter.
///
/// # Errors
/// The first parameter that is held twice.
pub fn check<'a>(names: impl Iterator<Item = &'a String> + Clone) -> Result<(), String> {
    let twice = names.clone().enumerate().find(|&(i, name)| names.clone().take(i).any(|n| n == name));
    twice.map_or(Ok(()), |(_, name)| Err(format!("--hold names {name} twice: give it one value")))
}

/// Warns of values of an `option` that lie outside the bounds of a fit.
pub fn warn_beyond(option: &str, study: &Study, effects: &[Chosen], values: &[(String, f64)]) {
    for beyond in hold::beyond(study.rig(), study.runs(), effects, values) {
        tell_warning!("{option} {beyond}");
    }
}

/// What holds mean for each of several models; warns of values outside the bounds of the last one.
pub fn constraints(study: &Study, models: &[Vec<Chosen>], hold: &[Hold]) -> Vec<Vec<Constraint>> {
    if let Some(last) = models.last() {
        let fixed: Vec<(String, f64)> = hold.iter().filter(|h| h.fixed()).map(|h| (h.name.clone(), h.lower)).collect();
        warn_beyond("--hold", study, last, &fixed);
    }
    hold::constraints(study.rig(), study.runs(), models, hold)
}

/// Adds what a model of a file settles where `held` says nothing else; with `warn`, names the held parameters that the
/// model with these `effects` does not have.
pub fn settle(held: &mut Vec<Constraint>, from: &Entry, study: &Study, effects: &[Chosen], warn: bool) {
    for name in hold::settle(held, from, study.rig(), study.runs(), effects) {
        if warn {
            tell_warning!("the file given with --from holds {name}, and this model has no such parameter");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_or_a_range_is_held() {
        assert_eq!(held("a=3").unwrap(), Hold { name: "a".to_owned(), lower: 3.0, upper: 3.0 });
        assert_eq!(held("offset_m[P1]=-0.5:2e-1").unwrap().to_string(), "offset_m[P1]=-0.5:0.2");
        assert!(held("a=3:1").unwrap_err().contains("a=LEAST:MOST") && held("a=1:x").is_err());
        let names = ["a".to_owned(), "b".to_owned(), "a".to_owned()];
        assert!(check(names[..2].iter()).is_ok() && check(names.iter()).unwrap_err().contains("names a twice"));
    }
}
