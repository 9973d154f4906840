//! The page of a sensitivity study.

use std::fmt::Write as _;

use crate::report::html::page::{contents, footer, head, minus, table};
use crate::report::sensitivity::{f_value, failures, range, repeats, share, undefined};
use crate::report::svg::bars::{Bar, BarChart};
use crate::report::svg::heat::HeatMap;
use crate::report::text::escape::escape;
use crate::report::text::number::significant;
use crate::sensitivity::factor::Factor;
use crate::sensitivity::features::Output;
use crate::sensitivity::levels;
use crate::sensitivity::map::{Axis, Layer, Map, RAISED_BY};
use crate::sensitivity::morris::Effects;
use crate::sensitivity::sobol::Indices;
use crate::sensitivity::study::{Column, Study, Table};

/// Size of a chart, px.
const WIDTH: f64 = 460.0;
const HEIGHT: f64 = 340.0;
/// Layers of a map that are drawn; the others are in its CSV and JSON.
const DRAWN: [&str; 6] =
    ["peak2_m", "phase_cycles", "damping_per_cycle", "peak2_percent", "phase_percent", "damping_change"];

/// The page as one HTML document. What was not asked for is not on it.
pub fn html(study: &Study) -> String {
    let mut out = head(&format!("{}: which parameter affects what", study.rig), "sensitivity", "");
    let model = if study.effects.is_empty() { "the base model".to_owned() } else { study.effects.join(", ") };
    let _ = write!(
        out,
        "<p class=\"facts\">Simulated closures with <strong>{}</strong>, read at sensor <strong>{}</strong>; 4L/a = {} s, {} reaches, seed {}.</p>\n</header>\n",
        escape(&model),
        escape(&study.sensor),
        significant(study.period_s, 4),
        study.reaches,
        study.seed
    );
    let mut body = String::new();
    if let Some(sobol) = &study.sobol {
        body += &of_sobol(sobol);
    }
    if let Some(morris) = &study.morris {
        body += &of_morris(morris);
    }
    if let Some(anova) = &study.anova {
        body += &of_anova(anova);
    }
    for (i, map) in study.maps.iter().enumerate() {
        body += &of_map(map, i);
    }
    body += &values(study);
    out.push_str(&contents(&body, ("", "")));
    out.push_str(&body);
    out.push_str(&footer(""));
    out.push_str("</body>\n</html>\n");
    out
}

fn values(study: &Study) -> String {
    let varied = study.sobol.as_ref().map(|t| &t.factors).or(study.morris.as_ref().map(|t| &t.factors));
    let rows = study.values.iter().map(|(name, value)| {
        let factor = varied.and_then(|all| all.iter().find(|f| f.name == *name));
        vec![
            format!("<code>{}</code>", escape(name)),
            minus(&significant(*value, 4)),
            factor.map_or(String::new(), |f| minus(&range(f)).replace('−', "–")),
            factor.map_or(String::new(), |f| if f.even_in_ratio { "in ratio" } else { "in difference" }.into()),
        ]
    });
    let headings = ["parameter", "value", "range", "even"];
    format!(
        "<section id=\"values\"><h2>Values and ranges</h2>\n{}</section>\n",
        table("Values around which the model was studied", &headings, &[1, 2], rows)
    )
}

fn of_sobol(sobol: &Table<Indices>) -> String {
    let bar = |i: crate::sensitivity::sobol::Index| Bar { value: i.value, low: i.low, high: i.high };
    let chart = |o: &Column<Indices>| BarChart {
        title: o.output.about.into(),
        x_label: "share of the variance".into(),
        series: vec!["first order".into(), "total".into()],
        groups: groups(&sobol.factors, &o.parameters, |i| vec![bar(i.first), bar(i.total)]),
    };
    let cell =
        |i: &Indices| format!("{} <small>{}–{}</small>", share(i.total.value), share(i.total.low), share(i.total.high));
    format!(
        "<section id=\"sobol\"><h2>Shares of the variance (Sobol)</h2>\n<p class=\"note\">First order: share explained by the parameter alone; total: with all its interactions. Whiskers: 95 % of bootstrap samples. The shares hold for the ranges below, over which all parameters vary at once.</p>\n{}<details><summary>Total indices as a table</summary>\n{}</details>\n{}</section>\n",
        charts(&sobol.outputs, chart),
        indices("Total indices with 95 % intervals", sobol, cell),
        notes(sobol)
    )
}

fn of_morris(morris: &Table<Effects>) -> String {
    let bar = |e: &Effects| Bar {
        value: e.mu_star,
        low: e.mu_star - 1.96 * e.mu_star_error,
        high: e.mu_star + 1.96 * e.mu_star_error,
    };
    let sigma = |e: &Effects| Bar { value: e.sigma, low: f64::NAN, high: f64::NAN };
    let chart = |o: &Column<Effects>| BarChart {
        title: o.output.about.into(),
        x_label: format!("{}for a step over the whole range", with_comma(o.output.unit, "", ", ")),
        series: vec!["mean absolute effect μ*".into(), "spread σ".into()],
        groups: groups(&morris.factors, &o.parameters, |e| vec![bar(e), sigma(e)]),
    };
    let cell = |e: &Effects| {
        minus(&format!(
            "{} <small>μ* {}, σ {}</small>",
            significant(e.mu, 2),
            significant(e.mu_star, 2),
            significant(e.sigma, 2)
        ))
    };
    format!(
        "<section id=\"morris\"><h2>Elementary effects (Morris)</h2>\n<p class=\"note\">One parameter at a time takes a step, from many points of the ranges: μ* is the mean absolute effect, σ how much the effect varies between points (curvature, interaction). Whiskers: 95 % of μ*.</p>\n{}<details><summary>Effects with their sign (μ) as a table</summary>\n{}</details>\n{}</section>\n",
        charts(&morris.outputs, chart),
        indices("Mean effects", morris, cell),
        notes(morris)
    )
}

fn groups<T>(factors: &[Factor], values: &[T], bars: impl Fn(&T) -> Vec<Bar>) -> Vec<(String, Vec<Bar>)> {
    factors.iter().zip(values).map(|(f, v)| (f.name.clone(), bars(v))).collect()
}

fn charts<T>(outputs: &[Column<T>], chart: impl Fn(&Column<T>) -> BarChart) -> String {
    let figures: Vec<String> = outputs.iter().map(|o| figure(&caption(&o.output), &chart(o).to_svg(WIDTH))).collect();
    format!("<div class=\"plates\">\n{}</div>\n", figures.concat())
}

fn figure(caption: &str, svg: &str) -> String {
    format!("<figure><figcaption>{}</figcaption>{svg}</figure>\n", escape(caption))
}

fn caption(output: &Output) -> String {
    format!("{} ({})", output.about, output.name)
}

/// A unit with what joins it to its neighbours; nothing where there is none.
fn with_comma(unit: &str, before: &str, after: &str) -> String {
    if unit == "1" { String::new() } else { format!("{before}{unit}{after}") }
}

fn indices<T>(title: &str, of: &Table<T>, cell: impl Fn(&T) -> String) -> String {
    let mut headings = vec!["parameter"];
    headings.extend(of.outputs.iter().map(|o| o.output.name));
    let numbers: Vec<usize> = (1..headings.len()).collect();
    let rows = of.factors.iter().enumerate().map(|(i, factor)| {
        let first = format!("<code>{}</code>", escape(&factor.name));
        std::iter::once(first).chain(of.outputs.iter().map(|o| cell(&o.parameters[i]))).collect()
    });
    table(title, &headings, &numbers, rows)
}

fn notes<T>(of: &Table<T>) -> String {
    let text = failures(of.failed, of.runs, of.why.as_deref()) + &undefined(of);
    format!("<p class=\"note\">{}</p>\n", escape(text.trim_end()))
}

fn of_anova(study: &levels::Study) -> String {
    let mut headings = vec!["parameter", "levels"];
    headings.extend(study.outputs.iter().map(|o| o.name));
    let numbers: Vec<usize> = (2..headings.len()).collect();
    let rows = study.analyses.iter().map(|a| {
        let levels: Vec<String> = a.levels.iter().map(|l| significant(*l, 2)).collect();
        let mut row = vec![
            format!("<code>{}</code>", escape(&a.parameter)),
            format!("<span class=\"nowrap\">{}</span>", levels.join(", ")),
        ];
        row.extend(a.outputs.iter().map(|o| {
            let p = o.map_or("–".into(), |o| significant(o.p, 2));
            format!("{} <small>p {}</small>", f_value(o), minus(&p))
        }));
        row
    });
    format!(
        "<section id=\"anova\"><h2>One-way analysis of variance</h2>\n{}<p class=\"note\">F (** where p &lt; 0.01, * where p &lt; 0.05). {} {}</p>\n</section>\n",
        table("F and p of each parameter", &headings, &numbers, rows),
        escape(&repeats(study)),
        escape(failures(study.failed, study.runs, None).trim_end())
    )
}

fn of_map(map: &Map, number: usize) -> String {
    let shown = |l: &&Layer| DRAWN.contains(&l.output.name);
    let figures: Vec<String> = map.layers.iter().filter(shown).map(|layer| layered(map, layer)).collect();
    format!(
        "<section id=\"map-{number}\"><h2>{} and {}</h2>\n<p class=\"note\">T = 4L/a = {} s. “Raising J”: from its value to {RAISED_BY} times that; contribution to pressure damping (P − P′)/P, equation 21 of the source paper. Empty: no such peak.</p>\n<div class=\"plates\">\n{}</div>\n<p class=\"note\">{}</p>\n</section>\n",
        escape(&map.x.name),
        escape(&map.y.name),
        significant(map.period_s, 4),
        figures.concat(),
        escape(failures(map.failed, map.runs, None).trim_end())
    )
}

fn layered(map: &Map, layer: &Layer) -> String {
    let title = match &layer.raised {
        None => caption(&layer.output),
        Some(raised) => format!("raising {raised}: {}{}", layer.output.about, with_comma(layer.output.unit, ", ", "")),
    };
    // Times in periods: the rules are rules about τ/T.
    let in_periods = |axis: &Axis| if axis.unit == "s" { map.period_s } else { 1.0 };
    let label = |axis: &Axis| match axis.unit {
        "s" => format!("{}/T", axis.name.trim_end_matches("_s")),
        unit => format!("{}, {unit}", axis.name),
    };
    let scaled = |axis: &Axis| axis.values.iter().map(|v| v / in_periods(axis)).collect();
    let heat = HeatMap {
        title: title.clone(),
        x_label: label(&map.x),
        y_label: label(&map.y),
        x: scaled(&map.x),
        y: scaled(&map.y),
        log_x: map.x.even_in_ratio,
        log_y: map.y.even_in_ratio,
        values: layer.values.clone(),
    };
    figure(&title, &heat.to_svg(WIDTH, HEIGHT))
}
