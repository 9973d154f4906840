//! The pieces of a page that only a diagnosis has, and what they share: the models compared, and the verdict.

use super::{Page, correlation, energy, heatmap, ranking, signature, spectrum, stages};
use crate::diagnose::{Candidate, Diagnosis, Verdict};
use crate::report::Stage;
use crate::report::escape::escape;
use crate::report::number::{error_m, times_noise};
use crate::report::summary::{self, overall};

/// What comes before the curves of the sensors: how far the models err, what is missing, and where that shows.
pub(super) fn before(page: &Page) -> String {
    let models = compared(page);
    [
        stages::staircase(&models, &stages::errors(&models)),
        ranking::section(page.diagnoses),
        failings(page.diagnoses),
        heatmap::section(&models),
        spectrum::section(&models),
        signature::section(page.diagnoses),
    ]
    .concat()
}

/// What comes after the parameters.
pub(super) fn after(page: &Page) -> String {
    correlation::section(&page.stages) + &energy::section(page)
}

/// The models to compare: the stages and, where no effect explains what is left, that with the nearest one.
fn compared<'a>(page: &Page<'a>) -> Vec<Stage<'a>> {
    let mut models = page.stages.clone();
    if let Some(last) = page.diagnoses.last().filter(|d| d.verdict == Verdict::UnknownEffect)
        && let Some(best) = last.candidates.first()
        && let Some(fit) = &best.fit
    {
        models.push(Stage { title: format!("+ {} (the nearest)", label(best)), fit });
    }
    models
}

/// How a page calls a candidate: the form that was fitted in the end.
pub(super) fn label(candidate: &Candidate) -> &str {
    candidate.fit.as_ref().and_then(|f| f.effects.last()).unwrap_or(&candidate.label)
}

/// The model that a diagnosis started from.
pub(super) fn start_model(diagnosis: &Diagnosis) -> String {
    match diagnosis.start.effects.as_slice() {
        [] => "base model".into(),
        effects => format!("base model + {}", effects.join(" + ")),
    }
}

/// A probability in words that do not claim more than it can.
pub(super) fn probability(p: f64) -> String {
    match p {
        p if p > 0.995 => "> 0.99".into(),
        p if p < 0.005 => "< 0.01".into(),
        p => format!("{p:.2}"),
    }
}

/// Mark, class and sentence of the verdict of all diagnoses together.
pub(super) fn verdict(page: &Page) -> (&'static str, &'static str, String) {
    let Some(last) = page.diagnoses.last() else { return ("?", "unknown", String::new()) };
    let found: Vec<&Candidate> = page
        .diagnoses
        .iter()
        .filter(|d| d.verdict == Verdict::MissingEffect)
        .filter_map(|d| d.candidates.first())
        .collect();
    let names: Vec<String> =
        found.iter().map(|c| format!("{} (probability {})", label(c), probability(c.probability))).collect();
    let missing = match names.as_slice() {
        [] => String::new(),
        names => format!("Missing: {}. {} ", names.join(", then "), summary::verdict(&page.stages)),
    };
    let unsure = found.last().filter(|c| !c.indistinguishable_from.is_empty()).map_or(String::new(), |c| {
        format!("These recordings cannot tell {} from {}. ", label(c), c.indistinguishable_from.join(", "))
    });
    let missing = missing + &unsure;
    let (error, model) = (overall(&last.start), start_model(last));
    let (rmse, noise) = (error_m(error.rmse_m), times_noise(error.rmse_m, error.noise_m));
    match last.verdict {
        Verdict::MissingEffect => ("✗", "missing", missing.trim_end().into()),
        Verdict::NothingMissing if found.is_empty() => {
            let said = format!(
                "Nothing is missing from the {model}: no effect of the catalogue is worth adding. RMSE {rmse} m, {noise}."
            );
            ("✓", "good", said)
        }
        Verdict::NothingMissing => ("✓", "good", format!("{missing}Nothing more is missing.")),
        Verdict::UnknownEffect => {
            let nearest = last.candidates.first().map_or(String::new(), |best| {
                format!(" The nearest, {}, leaves {} m.", label(best), error_m(best.rmse_m))
            });
            let more = if found.is_empty() { "Something" } else { "Something more" };
            let said = format!(
                "{missing}{more} is missing that no effect of the catalogue explains: the {model} has RMSE {rmse} m, {noise}.{nearest}"
            );
            ("?", "missing", said)
        }
    }
}

/// Where each start model fails, in words.
fn failings(diagnoses: &[Diagnosis]) -> String {
    let mut out = String::from("<section class=\"failings\" id=\"failings\"><h2>Where the models fail</h2>\n");
    for diagnosis in diagnoses {
        out.push_str(&format!("<h3>The {}</h3>\n", escape(&start_model(diagnosis))));
        if diagnosis.failings.is_empty() {
            out.push_str("<p>It fails nowhere: what it leaves is noise.</p>\n");
        } else {
            let items: Vec<String> = diagnosis.failings.iter().map(|f| format!("<li>{}</li>\n", escape(f))).collect();
            out.push_str(&format!("<ul>\n{}</ul>\n", items.concat()));
        }
    }
    out.push_str("</section>\n");
    out
}
