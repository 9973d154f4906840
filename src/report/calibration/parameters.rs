//! What was fitted, with its uncertainty and its meaning.

use crate::fit::outcome::fit::Fit;
use crate::report::Stage;
use crate::report::html::page::{minus, table};
use crate::report::text::escape::escape;
use crate::report::text::number::interval;
use crate::report::text::value::fitted;

/// How to read errors; and why there are none.
const ERRORS: &str = "<p class=\"note\">395.1(4) stands for 395.1 ± 0.4, one standard error in the last digits. At a bound the standard error means little: the data pull the value beyond it.</p>\n";
const NO_ERRORS: &str =
    "<p class=\"note\">The fit did not reach an optimum, so its values have no standard errors and no intervals.</p>\n";

pub(crate) fn section(stages: &[Stage]) -> String {
    let Some((last, earlier)) = stages.split_last() else { return String::new() };
    let mut out = format!("<section id=\"parameters\"><h2>Parameters</h2>\n{}", of(last.fit, &last.title));
    out.push_str(if last.fit.converged { ERRORS } else { NO_ERRORS });
    if !last.fit.unidentifiable.is_empty() {
        let items: String =
            last.fit.unidentifiable.iter().map(|u| format!("<li>{}</li>\n", escape(&u.in_words))).collect();
        out.push_str(&format!("<h3>What the recordings do not show</h3>\n<ul>\n{items}</ul>\n"));
    }
    out.push_str(&crate::report::calibration::profiles::section(last.fit));
    out.push_str(&crate::report::calibration::posterior::section(last.fit));
    for stage in earlier {
        out.push_str(&format!(
            "<details><summary>Parameters of: {}</summary>\n{}</details>\n",
            escape(&stage.title),
            of(stage.fit, &stage.title)
        ));
    }
    out.push_str("</section>\n");
    out
}

fn of(fit: &Fit, title: &str) -> String {
    if fit.parameters.is_empty() {
        return "<p>Nothing was fitted.</p>\n".into();
    }
    let per_run = fit.runs.len() > 1;
    let rows = fit.parameters.iter().map(|p| {
        let flag = match (p.held, p.at_bound) {
            (true, _) => r#" <span class="flag">held</span>"#,
            (_, true) => r#" <span class="flag">at its bound</span>"#,
            _ => "",
        };
        let mut row = vec![
            format!("<code>{}</code>", escape(&p.name)),
            format!(
                "<span class=\"nowrap\">{} {}</span>{flag}",
                minus(&fitted(fit, p)),
                if p.unit == "1" { String::new() } else { escape(p.unit) }
            ),
            format!("<span class=\"nowrap\">{}</span>", minus(&interval(p.interval_95))),
            format!("<span class=\"prose\">{}</span>", p.about),
        ];
        if per_run {
            row.insert(1, p.run.as_deref().map_or("all".into(), escape));
        }
        row
    });
    let headings: &[&str] = if per_run {
        &["parameter", "run", "value", "95% interval", "meaning"]
    } else {
        &["parameter", "value", "95% interval", "meaning"]
    };
    table(&format!("Parameters of {title}"), headings, &[], rows)
}
