//! The ranking: every effect that could be missing, with its probability.

use crate::diagnose::{Candidate, Diagnosis, Pair, Verdict};
use crate::fit::outcome::fit::FittedParameter;
use crate::report::diagnosis::words::{evidence, start_model};
use crate::report::html::page::{minus, table};
use crate::report::text::escape::escape;
use crate::report::text::number::{error_m, grouped, probability, significant, times, with_error};
use crate::report::view::summary::overall;

/// Candidates that are shown at once; the others fold away.
const SHOWN: usize = 6;

/// One ranking a diagnosis.
pub(crate) fn section(diagnoses: &[Diagnosis]) -> String {
    let mut out = String::from("<section class=\"ranking\" id=\"ranking\"><h2>Which effect is missing</h2>\n");
    for diagnosis in diagnoses {
        out.push_str(&format!("<h3>Effects added to the {}</h3>\n", escape(&start_model(diagnosis))));
        out.push_str(&candidates(diagnosis));
        out.push_str(&held_out(diagnosis));
        out.push_str(&least_visible(diagnosis));
        out.push_str(&left_out(diagnosis));
        out.push_str(&next_test(diagnosis));
    }
    out.push_str("<p class=\"note\">The probability that an effect is the one that is missing follows from how likely it is before any fit and from the evidence, the natural logarithm of its odds against the model without it, a quarter of which counts because models err in ways that noise does not know of; “none of these”, that nothing is missing or that it is something else, has evidence 0; evidence “none” is that of effects smaller than what is worth a model, however sure their size. 0.1321(6) stands for 0.1321 ± 0.0006, one standard error; candidates that were not worth a full fit have none.</p>\n</section>\n");
    out
}

/// What was tried; folded away where nothing of it is worth adding.
fn candidates(diagnosis: &Diagnosis) -> String {
    let all = &diagnosis.candidates;
    if all.is_empty() {
        return "<p>No effect was left to try.</p>\n".into();
    }
    if diagnosis.verdict == Verdict::NothingMissing {
        return format!(
            "<p>None of the {} effects that were tried is worth adding.</p>\n<details><summary>What was tried</summary>\n{}</details>\n",
            all.len(),
            rows(diagnosis, all, true)
        );
    }
    let (shown, folded) = all.split_at(all.len().min(SHOWN));
    let mut out = rows(diagnosis, shown, true);
    if !folded.is_empty() {
        let rest = rows(diagnosis, folded, false);
        out += &format!("<details><summary>{} less likely</summary>\n{rest}</details>\n", folded.len());
    }
    out
}

/// How well the end of the records is predicted from their beginning, with the effect and without.
fn held_out(diagnosis: &Diagnosis) -> String {
    match (diagnosis.held_out_m, diagnosis.candidates.first().and_then(|c| Some((c, c.held_out_m?)))) {
        (Some(without), Some((_, with))) => format!(
            "<p>Refitted to the first three fifths of the record, the model misses the rest by {} m with <code>{}</code>, by {} m without.</p>\n",
            error_m(with),
            escape(&diagnosis.answer_label()),
            error_m(without)
        ),
        _ => String::new(),
    }
}

/// What could not have been seen.
fn least_visible(diagnosis: &Diagnosis) -> String {
    if diagnosis.visible.is_empty() {
        return String::new();
    }
    let rows = diagnosis.visible.iter().map(|v| {
        vec![
            format!("<code>{}</code>", escape(&v.effect)),
            escape(&v.parameter),
            escape(&crate::report::diagnosis::text::least_visible(v)),
        ]
    });
    let caption = "Effects too small to be seen in these recordings";
    format!("<h4>{caption}</h4>\n{}", table(caption, &["effect", "parameter", "not to be seen"], &[], rows))
}

/// What was not tried, and why.
fn left_out(diagnosis: &Diagnosis) -> String {
    let each = diagnosis.left_out.iter().map(|(effect, why)| format!("<code>{effect}</code>: {}", escape(why)));
    let effects: Vec<String> = each.collect();
    if effects.is_empty() {
        String::new()
    } else {
        format!("<p class=\"note\">Not tried: {}.</p>\n", effects.join("; "))
    }
}

/// The test that would tell the best candidates apart, or why there is none to make.
fn next_test(diagnosis: &Diagnosis) -> String {
    let test = match (&diagnosis.next_test, diagnosis.verdict) {
        (Some(test), _) => escape(test),
        (None, Verdict::NothingMissing) => "none is needed: nothing is missing".into(),
        (None, Verdict::UnknownEffect) => "none can be named: no effect of the catalogue explains the residual".into(),
        (None, Verdict::MissingEffect) => match diagnosis.candidates.first().map(|c| c.indistinguishable_from.len()) {
            Some(0) | None => "none is needed: these recordings distinguish the candidates".into(),
            Some(_) => "none was found that would distinguish these candidates".into(),
        },
    };
    format!("<p class=\"next\"><strong>Next test:</strong> {test}.</p>\n")
}

fn rows(diagnosis: &Diagnosis, candidates: &[Candidate], with_none: bool) -> String {
    let start = overall(&diagnosis.start);
    let row = |name: String, p: String, evidence: String, rmse_m: f64, parameters: String| {
        vec![name, p, evidence, error_m(rmse_m), times(rmse_m, start.noise_m), parameters]
    };
    // Two effects found together stand above both, for neither explains the records alone.
    let pair = diagnosis.pair.as_ref().filter(|_| with_none).map(|pair| {
        vec![
            format!("<strong class=\"pair\">{}</strong>", escape(&pair.labels.join(" and "))),
            bar(pair.probability),
            grouped(pair.evidence),
            error_m(pair.fit.pooled().0),
            times(pair.fit.pooled().0, start.noise_m),
            parameters(diagnosis.answer_parameters()),
        ]
    });
    let rows = candidates.iter().map(|c| {
        row(name(c), likely(c, diagnosis.pair.as_ref()), minus(&evidence(c)), c.rmse_m, parameters(&c.parameters))
    });
    let none = diagnosis.none_of_these();
    let last = with_none
        .then(|| row("none of these".into(), bar(none.clamp(0.0, 1.0)), "0".into(), start.rmse_m, String::new()));
    let headings = ["effect", "probability", "evidence", "RMSE, m", "× noise", "its parameters"];
    let caption = format!("Effects added to the {}", start_model(diagnosis));
    table(&caption, &headings, &[2, 3, 4], pair.into_iter().chain(rows).chain(last))
}

fn name(candidate: &Candidate) -> String {
    let name = format!("<code class=\"nowrap\">{}</code>", escape(&candidate.label));
    match candidate.indistinguishable_from.as_slice() {
        [] => name,
        others => {
            format!("{name}<small class=\"alike\">cannot be distinguished from {}</small>", escape(&others.join(", ")))
        }
    }
}

/// How likely an effect is to be the one that is missing; of one that the pair above holds, to be missing without the
/// other.
fn likely(candidate: &Candidate, pair: Option<&Pair>) -> String {
    match pair.filter(|pair| pair.effects.contains(&candidate.effect)) {
        Some(pair) => {
            let alone = (candidate.probability - pair.probability).max(0.0);
            format!("{}<small class=\"alike\">without the other of the pair</small>", bar(alone))
        }
        None => bar(candidate.probability),
    }
}

fn bar(p: f64) -> String {
    format!(
        r#"<span class="probability" data-probability="{p:.9}"><span class="track"><i style="width:{:.1}%"></i></span>{}</span>"#,
        100.0 * p,
        probability(p).replace('>', "&gt;").replace('<', "&lt;")
    )
}

fn parameters(fitted: &[FittedParameter]) -> String {
    let each = fitted.iter().map(|p| {
        let value =
            if p.standard_error().is_nan() { significant(p.value, 3) } else { with_error(p.value, p.standard_error()) };
        let flag = if p.at_bound { r#" <span class="flag">at its bound</span>"# } else { "" };
        let unit = if p.unit == "1" { String::new() } else { format!(" {}", escape(p.unit)) };
        format!("<span class=\"nowrap\">{} = {}{unit}{flag}</span>", escape(&p.name), minus(&value))
    });
    each.collect::<Vec<_>>().join("<br>")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_probability_is_certain() {
        assert!(bar(0.99999).contains("&gt; 0.99") && bar(0.99999).contains("width:100.0%"));
        assert!(bar(0.873).ends_with("0.87</span>"));
        assert!(bar(1e-9).contains("&lt; 0.01"));
    }
}
