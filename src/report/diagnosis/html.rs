//! The pieces of a page that only a diagnosis has: the models compared, and the verdict.

use crate::diagnose::{Candidate, Diagnosis, Verdict};
use crate::report::Page;
use crate::report::Stage;
use crate::report::calibration::{correlation, energy, heatmap, spectrum, stages};
use crate::report::diagnosis::words::{rival_pairs, start_model};
use crate::report::diagnosis::{ranking, rest, signature};
use crate::report::text::escape::escape;
use crate::report::text::number::{error_m, probability, times_noise};
use crate::report::view::summary;
use crate::report::view::summary::overall;

/// What comes before the curves of the sensors: how far the models err, what is missing, and where that shows.
pub(crate) fn before(page: &Page) -> String {
    let models = compared(page);
    [
        stages::staircase(&models, &stages::errors(&models)),
        ranking::section(page.diagnoses),
        rest::section(page.diagnoses),
        failings(page.diagnoses),
        heatmap::section(&models),
        spectrum::section(&models),
        signature::section(page.diagnoses),
    ]
    .concat()
}

/// What comes after the parameters.
pub(crate) fn after(page: &Page) -> String {
    correlation::section(&page.stages) + &energy::section(page)
}

/// The models to compare: the stages and, where no effect explains what is left, that with the nearest one.
fn compared<'a>(page: &Page<'a>) -> Vec<Stage<'a>> {
    let mut models = page.stages.clone();
    if let Some(last) = page.diagnoses.last().filter(|d| d.verdict == Verdict::UnknownEffect)
        && let Some(best) = last.candidates.first()
        && let Some(fit) = &best.fit
    {
        models.push(Stage { title: format!("+ {} (the nearest)", best.label), fit });
    }
    models
}

/// Mark, class and sentence of the verdict of all diagnoses together.
pub(crate) fn verdict(stages: &[Stage], diagnoses: &[Diagnosis]) -> (&'static str, &'static str, String) {
    let Some(last) = diagnoses.last() else { return ("?", "unknown", String::new()) };
    let missing: Vec<_> = diagnoses.iter().filter(|d| d.verdict == Verdict::MissingEffect).collect();
    let found: Vec<&Candidate> = missing.iter().filter_map(|d| d.candidates.first()).collect();
    let names: Vec<String> =
        missing.iter().map(|d| format!("{} (probability {})", d.answer_label(), probability(d.probability))).collect();
    let missing = match names.as_slice() {
        [] => String::new(),
        names => {
            let sure = missing.iter().all(|d| d.probability >= 0.5);
            let head = if sure { "Missing" } else { "Something is missing; most likely" };
            format!("{head}: {}. {} ", names.join(", then "), summary::verdict(stages))
        }
    };
    let missing = missing + &unsure(diagnoses);
    let (error, model) = (overall(&last.start), start_model(last));
    let (rmse, noise) = (error_m(error.rmse_m), times_noise(error.rmse_m, error.noise_m));
    match last.verdict {
        Verdict::MissingEffect => ("✗", "missing", missing.trim_end().into()),
        Verdict::NothingMissing if found.is_empty() => {
            let sentence = format!(
                "Nothing is missing from the {model}: no effect of the catalogue is worth adding. RMSE {rmse} m, {noise}."
            );
            ("✓", "good", sentence)
        }
        Verdict::NothingMissing => ("✓", "good", format!("{missing}Nothing more is missing.")),
        Verdict::UnknownEffect => {
            let nearest = last.candidates.first().map_or(String::new(), |best| {
                format!(" The nearest, {}, leaves {} m.", best.label, error_m(best.rmse_m))
            });
            let more = if found.is_empty() { "Something" } else { "Something more" };
            let sentence = format!(
                "{missing}{more} is missing that no effect of the catalogue explains: the {model} has RMSE {rmse} m, {noise}.{nearest}"
            );
            ("?", "missing", sentence)
        }
    }
}

/// What the record cannot distinguish from the last answer.
fn unsure(diagnoses: &[Diagnosis]) -> String {
    let Some(last) = diagnoses.iter().rev().find(|d| d.verdict == Verdict::MissingEffect) else { return String::new() };
    let others = match (&last.pair, last.candidates.first()) {
        (Some(_), _) => rival_pairs(&last.rival_pairs),
        (None, best) => best.map_or(String::new(), |best| best.indistinguishable_from.join(", ")),
    };
    if others.is_empty() {
        return others;
    }
    format!("These recordings cannot distinguish {} from {others}. ", last.answer_label())
}

/// Where each start model fails, in words.
fn failings(diagnoses: &[Diagnosis]) -> String {
    let mut out = String::from("<section class=\"failings\" id=\"failings\"><h2>Where the models fail</h2>\n");
    for diagnosis in diagnoses {
        out.push_str(&format!("<h3>The {}</h3>\n", escape(&start_model(diagnosis))));
        if diagnosis.residual_patterns.is_empty() {
            out.push_str("<p>Nowhere: its residual is noise.</p>\n");
        } else {
            let items: Vec<String> =
                diagnosis.residual_patterns.iter().map(|f| format!("<li>{}</li>\n", escape(f))).collect();
            out.push_str(&format!("<ul>\n{}</ul>\n", items.concat()));
        }
        for doubt in &diagnosis.warnings {
            out.push_str(&format!("<p class=\"note\"><strong>Doubtful:</strong> {}.</p>\n", escape(doubt)));
        }
    }
    out.push_str("</section>\n");
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::outcome::fit::{Fit, RunFit, SensorFit};
    use crate::report::page::html;
    use crate::rig::Rig;

    const RIG: &str = include_str!("../../../rigs/imperial-pe.toml");

    /// A model 0.3 m off where the noise is 0.03 m.
    fn fit(effects: &[&str], off_m: f64) -> Fit {
        let time_s: Vec<f64> = (0..500).map(|i| f64::from(i) * 0.01).collect();
        let sensor = SensorFit {
            name: "P1".into(),
            position_m: 1.0,
            measured_m: time_s.iter().map(|t| t.sin()).collect(),
            model_m: time_s.iter().map(|t| t.sin() + off_m).collect(),
            band_m: Vec::new(),
            noise_m: 0.03,
            white_noise_m: 0.03,
            rmse_m: off_m,
            start_rmse_m: 1.0,
            before_m: None,
            extrema: vec![],
            time_s,
        };
        Fit {
            effects: crate::model::effects::parse_list(&effects.join(",")).unwrap(),
            runs: vec![RunFit {
                file: "a".into(),
                rmse_m: off_m,
                noise_m: 0.03,
                mape_extrema_percent: 0.0,
                noise_dies_away: false,
                meter_flow_m3_s: None,
                sensors: vec![sensor],
            }],
            parameters: vec![],
            correlation: vec![],
            unidentifiable: vec![],
            reaches: 64,
            grid_error_m: 0.0,
            evaluations: 1,
            seconds: 0.0,
            steps: vec![],
            stopped_because: "done".into(),
            converged: true,
            cost: 0.0,
            predicted_reduction: 0.0,
            posterior: None,
            features_left: vec![],
            method: crate::fit::problem::method::Method::default(),
        }
    }

    fn candidate(effect: &'static str, probability: f64, rmse_m: f64, alike: &[&'static str]) -> Candidate {
        Candidate {
            held_out_m: None,
            over_noise: 1.0,
            within_class: false,
            effect,
            label: effect.into(),
            probability,
            evidence: 5.0,
            rmse_m,
            parameters: vec![],
            indistinguishable_from: alike.to_vec(),
            fit: Some(fit(&[effect], rmse_m)),
        }
    }

    fn page_of(verdict: Verdict, candidates: Vec<Candidate>, next_test: Option<&str>) -> String {
        let diagnosis = Diagnosis {
            warnings: Vec::new(),
            held_out_m: None,
            probability: candidates.first().map_or(0.9, |c| c.probability),
            visible: Vec::new(),
            verdict,
            start: fit(&[], 0.3),
            pair: None,
            rival_pairs: Vec::new(),
            left_out: vec![("moving-valve", "for a <reason>".into())],
            residual_patterns: vec!["P1: <much> too high".into()],
            next_test: next_test.map(str::to_owned),
            is_held: false,
            rest: Vec::new(),
            candidates,
        };
        let rig = Rig::from_toml(RIG, "rig.toml").unwrap();
        let mut stages = vec![Stage { title: "base model".into(), fit: &diagnosis.start }];
        if verdict == Verdict::MissingEffect {
            stages.push(Stage { title: "+ it".into(), fit: diagnosis.candidates[0].fit.as_ref().unwrap() });
        }
        let diagnoses = std::slice::from_ref(&diagnosis);
        html(&Page { title: "t".into(), stages, diagnoses, ..Page::of(&rig) })
    }

    #[test]
    fn what_no_effect_explains_is_said_with_the_nearest() {
        let page = page_of(Verdict::UnknownEffect, vec![candidate("leak", 0.4, 0.27, &[])], None);
        assert!(page.contains("Something is missing that no effect of the catalogue explains: the base model has RMSE 0.30 m, 10× noise. The nearest, leak, leaves 0.27 m."));
        assert!(page.contains("+ leak (the nearest)") && page.matches("class=\"dot\"").count() == 2);
        assert!(
            page.contains("none can be named") && page.contains("<code>leak</code> (the nearest) over the residual")
        );
        assert!(page.contains("P1: &lt;much&gt; too high"));
        assert!(page.contains("Not tried: <code>moving-valve</code>: for a &lt;reason&gt;."));
    }

    #[test]
    fn what_cannot_be_told_apart_is_said_with_the_test_that_would() {
        let rivals = vec![candidate("leak", 0.6, 0.031, &["blockage"]), candidate("blockage", 0.3, 0.032, &["leak"])];
        let page = page_of(Verdict::MissingEffect, rivals, Some("halve the flow"));
        assert!(
            page.contains("Missing: leak (probability 0.60).")
                && page.contains("cannot distinguish leak from blockage.")
        );
        assert!(
            page.contains("<strong>Next test:</strong> halve the flow.")
                && page.contains(">leak</code><small class=\"alike\">cannot be distinguished from blockage</small>")
        );
    }

    #[test]
    fn without_a_candidate_the_page_still_stands() {
        let page = page_of(Verdict::UnknownEffect, vec![], None);
        assert!(page.contains("No effect was left to try.") && !page.contains("id=\"signature\""));
        assert!(page.contains("no effect of the catalogue explains") && page.ends_with("</html>\n"));
    }
}
