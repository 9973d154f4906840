//! The page of the next test: what each sensor would show under both answers.

use std::fmt::Write;

use crate::diagnose::next::Separation;
use crate::report::html::figures::plates;
use crate::report::html::page::{CSS, STILL, footer, minus, opening, table};
use crate::report::next::text::{HEADINGS, NARROWING, Narrowing, legend, rows, title};
use crate::report::svg::{LineChart, Series, Style};
use crate::report::text::escape::escape;
use crate::study::next::Contest;

/// What the table of narrowing tests means.
const NARROWED: &str = "<p class=\"note\">Standard error that the parameter is expected to have after one such test, fitted together with the records so far.</p>\n";
/// Points of a curve.
const POINTS: usize = 1500;

/// The page as one HTML document, without scripts; `only` names the answer that stands alone.
pub fn html(rig: &str, only: Option<&str>, contests: &[Contest], narrowing: Option<&Narrowing>) -> String {
    let mut out = opening(&format!("Rig {rig}"), "the next test", "data-page=\"next\"", STILL, CSS);
    let telling = contests.iter().find_map(|c| Some((c, c.tests.first().filter(|t| t.repeats.is_some())?)));
    let best = match (telling, narrowing) {
        (Some((of, test)), _) => format!("{}: {}.", title(&of.between), test.instruction),
        (None, Some(narrowing)) => match narrowing.tests.first() {
            Some(test) => format!("What narrows {} most: {}.", narrowing.parameter, test.instruction),
            None => format!("{}.", narrowing.heading()),
        },
        (None, None) => "No test of this rig tells the answers apart.".to_owned(),
    };
    let said = only.map_or(best.clone(), |only| format!("{only} {best}"));
    let _ = writeln!(out, "<p class=\"verdict\"><span>{}</span></p>\n</header>", escape(&said));
    for (n, of) in contests.iter().enumerate() {
        let _ = writeln!(out, "<section id=\"answers-{n}\"><h2>{}</h2>", escape(&title(&of.between)));
        let rows = rows(of);
        if rows.is_empty() {
            out.push_str("<p>No test of this rig tells them apart in twenty repeats.</p>\n");
        } else {
            let cells = rows.into_iter().map(|row| row.map(|cell| minus(&escape(&cell))).to_vec());
            out.push_str(&table("Tests", &HEADINGS, &[1, 2, 3], cells));
            let _ = writeln!(out, "<p class=\"note\">{}</p>", escape(&legend(of)));
        }
        if let Some(test) = of.tests.first() {
            let _ = writeln!(out, "<h3>{}</h3>", escape(&test.instruction));
            let names = of.between.each_ref().map(|s| s.answer.name.as_str());
            out.push_str(&plates(&charts(names, test)));
        }
        out.push_str("</section>\n");
    }
    if let Some(narrowing) = narrowing {
        let _ = writeln!(out, "<section id=\"narrowing\"><h2>{}</h2>", escape(&narrowing.heading()));
        if !narrowing.tests.is_empty() {
            let cells = narrowing.rows().into_iter().map(|row| row.map(|cell| minus(&escape(&cell))).to_vec());
            out.push_str(&table("Tests", &NARROWING, &[1, 2], cells));
            out.push_str(NARROWED);
        }
        out.push_str("</section>\n");
    }
    out.push_str(&footer(""));
    out.push_str("</body>\n</html>\n");
    out
}

/// A chart for each sensor.
fn charts(names: [&str; 2], test: &Separation) -> Vec<(String, LineChart)> {
    let of = |curve: &crate::diagnose::next::Curve| {
        let step = curve.time_s.len().div_ceil(POINTS).max(1);
        let line = |label: &str, heads: &[f64], style: Style| {
            let points = curve.time_s.iter().zip(heads).step_by(step).map(|(t, h)| (*t, *h)).collect();
            Series { label: label.to_owned(), points, style }
        };
        let chart = LineChart {
            x_label: "time after the start of the closure, s".into(),
            y_label: "head, m".into(),
            series: vec![
                line(&format!("if {}", names[0]), &curve.one_m, Style::line(0)),
                line(&format!("if {}", names[1]), &curve.other_m, Style::line(1)),
            ],
            ..LineChart::default()
        };
        (curve.sensor.clone(), chart)
    };
    test.curves.iter().map(of).collect()
}
