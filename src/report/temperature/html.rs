//! The page of a family: each quantity against temperature with its intervals, trend and law; the runs' errors; the
//! laws.

use std::fmt::Write;

use crate::report::html::figures::plates;
use crate::report::html::page::{footer, minus, remarks, still_head, table};
use crate::report::svg::{LineChart, Series, Style};
use crate::report::temperature::text::{
    LAW_HEADINGS, RUN_HEADINGS, TREND_HEADINGS, comparison, degrees, errors, headline, laws, trends, values,
};
use crate::report::text::escape::escape;
use crate::temperature::apart::{Banded, Quantity};
use crate::temperature::{Family, Verdict};

/// The page as one HTML document, without scripts.
pub fn html(family: &Family, rig: &str) -> String {
    let verdict = family.together.as_ref().and_then(|t| t.comparison).map(|c| c.verdict);
    let mark = match verdict {
        Some(Verdict::Fail) => ("✗", "missing"),
        _ if family.remarks.is_empty() => ("✓", "good"),
        _ => ("≈", "near"),
    };
    let title = format!("Rig {rig} over temperature");
    let mut out = still_head(&title, "family", "family of runs", mark, &headline(family));
    out.push_str(&remarks(&family.remarks));
    let charts: Vec<(String, LineChart)> =
        family.quantities.iter().map(|q| (q.name.clone(), chart(family, q))).collect();
    let _ = write!(
        out,
        "<section id=\"temperature\"><h2>Over temperature</h2>\n{}<p class=\"note\">Circles with bars: the runs fitted separately, with their 95% intervals. Dashed: the line through them. {}</p></section>\n",
        plates(&charts),
        if family.together.is_some() {
            "Solid, with its 95% confidence band: the laws, from all runs together."
        } else {
            "The band is its 95% confidence band."
        }
    );
    out.push_str("<section id=\"runs\"><h2>Runs</h2>\n");
    out.push_str(&shown("Runs", &RUN_HEADINGS, errors(family)));
    out.push_str("</section>\n");
    if let Some(together) = &family.together {
        out.push_str("<section id=\"laws\"><h2>Temperature laws</h2>\n");
        out.push_str(&shown("Laws", &LAW_HEADINGS, laws(together)));
        if let Some(line) = comparison(together) {
            let _ = writeln!(out, "<p>{}</p>", minus(&escape(&line)));
        }
        let _ = writeln!(
            out,
            "<p class=\"note\">Values at {} °C. 0.1034(21) stands for 0.1034 ± 0.0021, one standard error in the last digits. The water's bulk modulus and density come from tables.</p></section>",
            family.reference_degc
        );
    }
    let (headings, rows) = values(family);
    out.push_str("<section id=\"apart\"><h2>Runs fitted separately</h2>\n");
    out.push_str(&shown("Values", &headings.iter().map(String::as_str).collect::<Vec<_>>(), rows));
    let _ = writeln!(out, "<h3>Trends, at {} °C</h3>", family.reference_degc);
    out.push_str(&shown("Trends", &TREND_HEADINGS, trends(family)));
    out.push_str(
        "<p class=\"note\">Logarithms of moduli and compliances are linear in temperature, logarithms of retardation times in inverse absolute temperature.</p></section>\n",
    );
    out.push_str(&footer(""));
    out.push_str("</body>\n</html>\n");
    out
}

/// A table of the terminal as one of the page; a `<` before a heading says that its column holds numbers.
fn shown<R: Into<Vec<String>>>(caption: &str, headings: &[&str], rows: Vec<R>) -> String {
    let numbers: Vec<usize> = (0..headings.len()).filter(|&c| headings[c].starts_with('<')).collect();
    let plain: Vec<String> = headings.iter().map(|h| escape(h.trim_start_matches('<'))).collect();
    let plain: Vec<&str> = plain.iter().map(String::as_str).collect();
    let cell = |(c, text): (usize, String)| if numbers.contains(&c) { minus(&escape(&text)) } else { escape(&text) };
    let rows = rows.into_iter().map(|row| row.into().into_iter().enumerate().map(cell).collect());
    table(caption, &plain, &numbers, rows)
}

fn chart(family: &Family, quantity: &Quantity) -> LineChart {
    let trend: Vec<Banded> =
        quantity.trend.map_or(Vec::new(), |t| degrees(family).into_iter().map(|degc| t.at(degc)).collect());
    let is_law = quantity.law.len() > family.members.len();
    let mut series = Vec::new();
    if is_law && quantity.law.iter().all(|b| b.interval.0.is_finite()) {
        series.push(band(&quantity.law));
    } else if family.together.is_none() && !trend.is_empty() {
        series.push(band(&trend));
    }
    let line = |b: &[Banded]| b.iter().map(|b| (b.temperature_degc, b.value)).collect();
    if !trend.is_empty() {
        series.push(Series { label: "trend".into(), points: line(&trend), style: Style::line(1) });
    }
    if is_law {
        series.push(Series { label: "law".into(), points: line(&quantity.law), style: Style::line(0) });
    } else if !quantity.law.is_empty() {
        series.push(Series { label: "together".into(), points: line(&quantity.law), style: Style::points(0) });
        series.push(Series { label: String::new(), points: bars(&quantity.law), style: Style::line(0) });
    }
    let apart: Vec<Banded> = quantity
        .points
        .iter()
        .map(|p| Banded { temperature_degc: p.temperature_degc, value: p.value, interval: p.interval })
        .collect();
    let solid = Style { dash: "", ..Style::line(2) };
    series.push(Series { label: String::new(), points: bars(&apart), style: solid });
    series.push(Series { label: "run".into(), points: line(&apart), style: Style::points(2) });
    LineChart {
        x_label: "temperature, °C".into(),
        y_label: quantity.unit.into(),
        series,
        room_x: true,
        ..LineChart::default()
    }
}

fn band(values: &[Banded]) -> Series {
    let upper = values.iter().map(|b| (b.temperature_degc, b.interval.1));
    let points = upper.chain(values.iter().rev().map(|b| (b.temperature_degc, b.interval.0))).collect();
    Series { label: "95% band".into(), points, style: Style::area(0) }
}

/// Upright bars over the intervals, apart from each other.
fn bars(values: &[Banded]) -> Vec<(f64, f64)> {
    let bar =
        |b: &Banded| [(b.temperature_degc, b.interval.0), (b.temperature_degc, b.interval.1), (f64::NAN, f64::NAN)];
    values.iter().flat_map(bar).collect()
}
