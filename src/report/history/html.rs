//! The page of a rig's history, and its charts: each parameter over runs and over temperature, with its drift.

use std::fmt::Write;

use crate::report::history::text::{
    DRIFT_HEADINGS, LACKING, drift_notes, drift_rows, headings, headline, marks, rows, slope_text,
};
use crate::report::html::figures::plates;
use crate::report::html::page::{CSS, STILL, footer, minus, opening, table};
use crate::report::svg::{LineChart, Series, Style};
use crate::report::text::escape::escape;
use crate::results::history::drift::{Drift, Point, Slope};
use crate::results::history::{History, ParameterHistory};

/// Size of one chart, px.
const WIDTH: f64 = 480.0;
const HEIGHT: f64 = 260.0;

/// The page as one HTML document, without scripts.
pub fn html(history: &History) -> String {
    let mut out = opening(&format!("Rig {}", history.rig), "history", "data-page=\"history\"", STILL, CSS);
    let _ = writeln!(out, "<p class=\"verdict\"><span>{}</span></p>\n</header>", escape(&headline(history)));
    out.push_str("<section id=\"drift\"><h2>Drift</h2>\n");
    let cells = drift_rows(history).into_iter().map(|row| row.map(|cell| minus(&escape(&cell))).to_vec());
    out.push_str(&table("Drift", &DRIFT_HEADINGS, &[1, 2, 3, 4, 5], cells));
    for note in drift_notes(history) {
        let _ = writeln!(out, "<p class=\"note\">{}</p>", escape(&note));
    }
    if history.parameters.iter().any(|p| p.drift.is_some_and(|d| d.together)) {
        out.push_str("<p class=\"note\">Values over runs are corrected to the mean temperature, values over temperature to the mean run.</p>\n");
    }
    let charts = history.parameters.iter().flat_map(charts).map(|chart| (chart.title.clone(), chart.untitled()));
    out.push_str(&plates(&charts.collect::<Vec<_>>()));
    out.push_str("</section>\n<section id=\"runs\"><h2>Runs</h2>\n");
    let names: Vec<String> = headings(history).iter().map(|h| escape(h).replace("x noise", "× noise")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let numbers: Vec<usize> = std::iter::once(0).chain(3..names.len() - 1).collect();
    let shown = |(c, cell): (usize, &String)| if numbers.contains(&c) { minus(&escape(cell)) } else { escape(cell) };
    let cells = rows(history).into_iter().map(|row| row.iter().enumerate().map(shown).collect());
    out.push_str(&table("Runs", &names, &numbers, cells));
    if marks(history) {
        let _ = writeln!(out, "<p class=\"note\">{LACKING}</p>");
    }
    out.push_str("</section>\n");
    out.push_str(&footer(""));
    out.push_str("</body>\n</html>\n");
    out
}

/// All charts as one picture: a row a parameter, over runs on the left, over temperature on the right.
pub fn svg(history: &History) -> String {
    let rows = history.parameters.len();
    let (width, height) = (2.0 * WIDTH, HEIGHT * rows as f64);
    let mut out = format!(
        r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}"><rect width="100%" height="100%" fill="white"/>"#
    );
    for (row, parameter) in history.parameters.iter().enumerate() {
        for (column, chart) in charts(parameter).iter().enumerate() {
            let place = format!(
                r#"<svg x="{}" y="{}" width="{WIDTH}" height="{HEIGHT}" "#,
                WIDTH * column as f64,
                HEIGHT * row as f64
            );
            out.push_str(&chart.to_svg(WIDTH, HEIGHT).replacen("<svg ", &place, 1));
        }
    }
    out.push_str("</svg>\n");
    out
}

/// A parameter over runs and, where temperatures are known, over temperature.
fn charts(parameter: &ParameterHistory) -> Vec<LineChart> {
    let over_runs = Axis {
        of: |p| Some(p.run),
        label: "run (bars: ± 2 standard errors)",
        slope: |d| d.per_run,
        at: |d| d.mean_run,
        is_run: true,
    };
    let over_kelvin = Axis {
        of: |p| p.temperature_degc,
        label: "temperature, °C (bars: ± 2 standard errors)",
        slope: |d| d.per_kelvin,
        at: |d| d.mean_degc,
        is_run: false,
    };
    let known = parameter.points.iter().chain(&parameter.doubtful).any(|p| p.temperature_degc.is_some());
    let mut charts = vec![chart(parameter, &over_runs)];
    charts.extend(known.then(|| chart(parameter, &over_kelvin)));
    charts
}

/// What a chart is drawn over.
struct Axis {
    of: fn(&Point) -> Option<f64>,
    label: &'static str,
    slope: fn(&Drift) -> Option<Slope>,
    at: fn(&Drift) -> f64,
    is_run: bool,
}

fn chart(parameter: &ParameterHistory, axis: &Axis) -> LineChart {
    let drift = parameter.drift.as_ref();
    let slope = drift.and_then(|d| (axis.slope)(d));
    // Where both drifts are known, what the other one does is taken out of the points.
    let other = drift.filter(|d| d.together).and_then(|d| {
        let slope = if axis.is_run { d.per_kelvin } else { d.per_run };
        slope.map(|s| (s.value, if axis.is_run { d.mean_degc } else { d.mean_run }))
    });
    let taken_out = |p: &Point| {
        let place = if axis.is_run { p.temperature_degc } else { Some(p.run) };
        other.zip(place).map_or(0.0, |((slope, mean), at)| slope * (at - mean))
    };
    let place = |p: &Point| (axis.of)(p).map(|x| (x, p.value - taken_out(p), 2.0 * p.standard_error));
    let mut series = Vec::new();
    for (label, points, n) in [("", &parameter.points, 0), ("something missing", &parameter.doubtful, 1)] {
        let places: Vec<(f64, f64, f64)> = points.iter().filter_map(place).collect();
        if places.is_empty() {
            continue;
        }
        // where something is missing, nobody knows how far the value is off
        if n == 0 {
            let bars = places.iter().flat_map(|&(x, y, e)| [(x, y - e), (x, y + e), (f64::NAN, f64::NAN)]).collect();
            series.push(Series { label: String::new(), points: bars, style: Style { dash: "", ..Style::line(n) } });
        }
        let dots = places.iter().map(|&(x, y, _)| (x, y)).collect();
        series.push(Series { label: label.to_owned(), points: dots, style: Style::points(n) });
    }
    if let (Some(d), Some(slope)) = (drift, slope) {
        let xs: Vec<f64> = parameter.points.iter().filter_map(axis.of).collect();
        let ends =
            [xs.iter().copied().fold(f64::INFINITY, f64::min), xs.iter().copied().fold(f64::NEG_INFINITY, f64::max)];
        let line = ends.map(|x| (x, d.mean + slope.value * (x - (axis.at)(d)))).to_vec();
        let per = if axis.is_run { "per run" } else { "per K" };
        let label = minus(&format!("{} {per}", slope_text(&slope)));
        series.push(Series { label, points: line, style: Style::line(2) });
    }
    let held = match other {
        Some((_, degc)) if axis.is_run => format!(" at {degc:.1} °C"),
        Some((_, run)) => format!(" at run {run:.1}"),
        None => String::new(),
    };
    LineChart {
        title: format!("{}{held}", parameter.name),
        x_label: axis.label.into(),
        y_label: parameter.unit.clone(),
        series,
        whole_x: axis.is_run,
        room_x: true,
        ..LineChart::default()
    }
}
