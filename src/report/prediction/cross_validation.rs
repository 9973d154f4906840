//! Cross-validations as text and JSON: whether a model predicts what it was not fitted to, and which of two does so
//! better.

use serde::Serialize;

use crate::fit::validate::cross_validate::{By, CrossValidation, Fold, Pooled};
use crate::model::effects::name_of;
use crate::report::text::number::{error_m, times};
use crate::report::text::table::Table;
use crate::report::view::summary::DOWN_TO_NOISE;

/// Error held out, over that in the fit, up to which a model predicts as well as it fits.
const AS_WELL: f64 = 1.25;

/// What a kind of data left out says of a model, in a sentence.
pub fn verdict(by: By, pooled: &Pooled) -> String {
    let Pooled { held_out_m, in_fit_m, noise_m, held_out_over_noise, in_fit_over_noise } = *pooled;
    // Runs and sensors of unlike noise count alike.
    let over_fit = held_out_over_noise / in_fit_over_noise;
    let (what, error) = (word(by), format!("{} m", error_m(held_out_m)));
    let against = format!("in the fit {} m, noise {} m", error_m(in_fit_m), error_m(noise_m));
    let meaning = match (held_out_over_noise, over_fit) {
        (over_noise, _) if over_noise <= DOWN_TO_NOISE => "it predicts down to the noise".to_owned(),
        (_, over_fit) if over_fit <= AS_WELL => {
            format!(
                "it predicts as well as it fits, {}× the noise: it lacks physics, not data",
                times(held_out_over_noise, 1.0)
            )
        }
        _ if in_fit_over_noise <= DOWN_TO_NOISE => format!(
            "it fits down to the noise but errs {}× as much on data that it was not fitted to: its parameters are overfitted",
            times(over_fit, 1.0)
        ),
        _ => format!(
            "it errs {}× as much on data that it was not fitted to: it lacks physics, and its parameters compensate for that",
            times(over_fit, 1.0)
        ),
    };
    format!("{what} left out: {error} ({against}): {meaning}.")
}

fn word(by: By) -> &'static str {
    match by {
        By::Sensors => "Sensors",
        By::Runs => "Runs",
        By::Time => "The end of the record",
    }
}

/// Which of two models predicts better, in a sentence a kind.
pub fn comparison(first: &CrossValidation, second: &CrossValidation) -> Vec<String> {
    let (a, b) = (name_of(&first.fit.effects), name_of(&second.fit.effects));
    let both = first.kinds().into_iter().filter_map(|by| Some((by, first.pooled(by)?, second.pooled(by)?)));
    both.map(|(by, one, two)| {
        let (better, worse, by_m, to_m) = if one.held_out_m <= two.held_out_m {
            (&a, &b, two.held_out_m, one.held_out_m)
        } else {
            (&b, &a, one.held_out_m, two.held_out_m)
        };
        let what = word(by);
        if by_m / to_m < 1.05 {
            format!(
                "{what} left out: {a} and {b} predict alike ({} m, {} m).",
                error_m(one.held_out_m),
                error_m(two.held_out_m)
            )
        } else {
            format!(
                "{what} left out: {better} predicts better than {worse}, {} m against {} m.",
                error_m(to_m),
                error_m(by_m)
            )
        }
    })
    .collect()
}

/// Everything `cross-validate` prints.
pub fn text(models: &[CrossValidation]) -> String {
    let mut out = String::new();
    for model in models {
        out += &format!("{}:\n", name_of(&model.fit.effects));
        for (by, pooled) in model.kinds().into_iter().filter_map(|by| Some((by, model.pooled(by)?))) {
            out += &format!("  {}\n", verdict(by, &pooled));
        }
        for skipped in &model.skipped {
            out += &format!("  ({skipped})\n");
        }
        out += &format!("\n{}\n", table(&model.folds));
    }
    if let [first, .., last] = models {
        out += &comparison(first, last).join("\n");
        out += "\n";
    }
    out
}

fn table(folds: &[Fold]) -> Table {
    let mut table = Table::new(&[
        "left out",
        "<samples",
        "<held out, m",
        "<in the fit, m",
        "<noise, m",
        "<held out/noise",
        "<held out/fit",
    ]);
    for fold in folds {
        table.row([
            fold.left_out.clone(),
            fold.samples.to_string(),
            error_m(fold.held_out_m),
            error_m(fold.in_fit_m),
            error_m(fold.noise_m),
            times(fold.held_out_m, fold.noise_m),
            times(fold.held_out_m, fold.in_fit_m),
        ]);
    }
    table
}

/// The document of `cross-validate --json`.
#[derive(Debug, Serialize)]
pub struct Document<'a> {
    /// Each model, the one asked for first.
    pub models: Vec<Model<'a>>,
    /// Which predicts better, in words; empty of one model.
    pub comparison: Vec<String>,
}

/// One model.
#[derive(Debug, Serialize)]
pub struct Model<'a> {
    /// Its effects.
    pub effects: Vec<String>,
    /// Error of the fit to all, m.
    pub rmse_m: f64,
    /// Noise, m.
    pub noise_m: f64,
    /// Each fold.
    pub folds: &'a [Fold],
    /// The folds of each kind together.
    pub pooled: Vec<Kind>,
    /// What could not be left out, in words.
    pub skipped: &'a [String],
}

/// The folds of a kind.
#[derive(Debug, Serialize)]
pub struct Kind {
    /// The kind.
    pub by: By,
    /// Their errors together.
    #[serde(flatten)]
    pub errors: Pooled,
    /// In a sentence.
    pub verdict: String,
}

/// Cross-validations as scripts see them.
pub fn document(models: &[CrossValidation]) -> Document<'_> {
    let of = |model: &CrossValidation, by| {
        let errors = model.pooled(by)?;
        Some(Kind { by, errors, verdict: verdict(by, &errors) })
    };
    let comparison = if let [first, .., last] = models { comparison(first, last) } else { Vec::new() };
    let models = models.iter().map(|model| {
        let (rmse_m, noise_m) = model.fit.pooled();
        let pooled = model.kinds().into_iter().filter_map(|by| of(model, by)).collect();
        Model { effects: model.fit.labels(), rmse_m, noise_m, folds: &model.folds, pooled, skipped: &model.skipped }
    });
    Document { models: models.collect(), comparison }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_verdict_tells_overfitting_from_missing_physics() {
        let say = |held_out_m, in_fit_m| {
            let (held_out_over_noise, in_fit_over_noise) = (held_out_m / 0.03, in_fit_m / 0.03);
            verdict(
                By::Sensors,
                &Pooled { held_out_m, in_fit_m, noise_m: 0.03, held_out_over_noise, in_fit_over_noise },
            )
        };
        assert!(say(0.031, 0.029).contains("down to the noise"));
        assert!(say(1.1, 1.0).contains("as well as it fits"));
        assert!(say(0.3, 0.03).contains("its parameters are overfitted"));
        assert!(say(3.0, 1.0).contains("its parameters compensate"));
    }
}
