//! The page of the next test: what each sensor would show under both answers.

use std::fmt::Write;

use crate::diagnose::next::Separation;
use crate::report::html::figures::plates;
use crate::report::html::page::{CSS, STILL, footer, minus, opening, table};
use crate::report::next::text::{HEADINGS, legend, rows, title};
use crate::report::svg::{LineChart, Series, Style};
use crate::report::text::escape::escape;
use crate::study::next::Contest;

/// Points of a curve.
const POINTS: usize = 1500;

/// The page as one HTML document, without scripts.
pub fn html(rig: &str, contests: &[Contest]) -> String {
    let mut out = opening(&format!("Rig {rig}"), "the next test", "data-page=\"next\"", STILL, CSS);
    let best = contests.first().and_then(|c| Some((c, c.tests.first()?)));
    if let Some((of, test)) = best {
        let what = format!("{}: {}", title(&of.between), test.instruction);
        let _ = writeln!(out, "<p class=\"verdict\"><span>{}</span></p>", escape(&what));
    }
    out.push_str("</header>\n");
    for (n, of) in contests.iter().enumerate() {
        let _ = writeln!(out, "<section id=\"answers-{n}\"><h2>{}</h2>", escape(&title(&of.between)));
        let cells = rows(of).into_iter().map(|row| row.map(|cell| minus(&escape(&cell))).to_vec());
        out.push_str(&table("Tests", &HEADINGS, &[1, 2, 3], cells));
        let _ = writeln!(out, "<p class=\"note\">{}</p>", escape(&legend(of)));
        if let Some(test) = of.tests.first() {
            let _ = writeln!(out, "<h3>{}</h3>", escape(&test.instruction));
            let names = of.between.each_ref().map(|s| s.answer.name.as_str());
            out.push_str(&plates(&charts(names, test)));
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
