//! One self-contained HTML page of a calibration, or of a diagnosis: no network, light and dark, readable in print and without scripts.

use std::fmt::Write;

use crate::diagnose::Diagnosis;
use crate::fit::validate::predict::Prediction;
use crate::model::energy::Energy;
use crate::report::html::escape::{escape, json_in_script};
use crate::report::prediction::text as prediction;
use crate::report::view::curves::{BUCKETS, Curves, find};
use crate::report::view::summary;
use crate::report::view::summary::Closeness;
use crate::report::{Overlay, Stage};
use crate::rig::Rig;

/// What a page is about.
#[derive(Debug, Clone)]
pub struct Page<'a> {
    /// Heading of the page.
    pub title: String,
    /// The rig the runs were made on.
    pub rig: &'a Rig,
    /// The models in the order in which they were tried; the last one is the result.
    pub stages: Vec<Stage<'a>>,
    /// Curves from elsewhere.
    pub overlays: Vec<Overlay>,
    /// What is to be said of the result beside its numbers.
    pub warnings: &'a [String],
    /// The diagnoses that led from stage to stage, the first one first; none on the page of a calibration.
    pub diagnoses: &'a [Diagnosis],
    /// The last stage predicts: its samples after a time were not seen by any fit.
    pub prediction: Option<&'a Prediction>,
    /// Where the energy of the last stage's first run went, if that is known.
    pub energy: Option<Energy>,
}

impl<'a> Page<'a> {
    /// An empty page about a rig.
    pub fn of(rig: &'a Rig) -> Self {
        Page {
            title: String::new(),
            rig,
            stages: Vec::new(),
            overlays: Vec::new(),
            warnings: &[],
            diagnoses: &[],
            prediction: None,
            energy: None,
        }
    }
}

pub(crate) const CSS: &str = include_str!("assets/page.css");
const JS: &str = include_str!("assets/page.js");
const UPLOT_JS: &str = include_str!("assets/uplot/uPlot.iife.min.js");
const UPLOT_LICENCE: &str = include_str!("assets/uplot/LICENSE");
const UPLOT_CSS: &str = include_str!("assets/uplot/uPlot.min.css");

/// The page as one HTML document.
///
/// Never fails: without stages or sensors the page says so; numbers that are not finite are left out of the curves.
pub fn html(page: &Page) -> String {
    let panels = panels(page);
    let (kind, (mark, class, verdict)) = match page.prediction {
        _ if !page.diagnoses.is_empty() => ("diagnosis", crate::report::diagnosis::html::verdict(page)),
        Some(ahead) => ("prediction", judged(prediction::judge(ahead), prediction::verdict(ahead))),
        None => {
            let judgement = page.stages.last().map_or(Closeness::Unknown, |s| summary::judge(s.fit));
            ("calibration", judged(judgement, summary::verdict(&page.stages)))
        }
    };
    let named = page.diagnoses.last().map_or(String::new(), |d| format!(" data-verdict=\"{}\"", d.verdict.name()));
    let mut out = head(&page.title, kind, &named);
    let _ = write!(
        out,
        r#"<p class="verdict {class}"><span class="mark" aria-hidden="true">{mark}</span> <span>{}</span></p>
</header>
"#,
        escape(&verdict)
    );
    for warning in page.warnings {
        let _ = writeln!(out, "<p class=\"note\"><strong>Warning:</strong> {}.</p>", escape(warning));
    }
    let diagnosed = !page.diagnoses.is_empty();
    let mut body = if diagnosed {
        crate::report::diagnosis::html::before(page)
    } else {
        crate::report::calibration::stages::staircase(&page.stages, "")
    };
    sensors(&mut body, page, &panels);
    body.push_str(&crate::report::calibration::parameters::section(&page.stages));
    if diagnosed {
        body.push_str(&crate::report::diagnosis::html::after(page));
    }
    body.push_str(&crate::report::calibration::stages::computation(&page.stages));
    body.push_str(&crate::report::calibration::rig::section(page.rig));
    out.push_str(&contents(&body));
    out.push_str(&body);
    out.push_str(&footer(" Charts: uPlot (MIT licence)."));
    if !panels.is_empty() {
        let data = json_in_script(&crate::report::html::data::json(
            &page.stages,
            &panels,
            page.prediction.map(|p| p.known_until_s),
        ));
        let _ = write!(
            out,
            "<script type=\"application/json\" id=\"data\">{data}</script>\n<script>/*!\n{UPLOT_LICENCE}*/\n{UPLOT_JS}</script>\n<script>{JS}</script>\n"
        );
    }
    out.push_str("</body>\n</html>\n");
    out
}

/// What a page with charts to zoom into may load and run.
const LIVE: &str = "style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:";
/// The same of a page of still pictures.
pub(crate) const STILL: &str = "style-src 'unsafe-inline'; img-src data:";

/// The beginning of a page up to its heading, inside `<header>`.
pub(crate) fn head(title: &str, kind: &str, attributes: &str) -> String {
    opening(
        title,
        &format!("{kind} report"),
        &format!("data-page=\"{kind}\"{attributes}"),
        LIVE,
        &format!("{UPLOT_CSS}\n{CSS}"),
    )
}

/// The beginning of a page of still pictures, with its verdict: a mark, the verdict's class, and its words.
pub(crate) fn still_head(title: &str, kind: &str, kicker: &str, (mark, class): (&str, &str), verdict: &str) -> String {
    let head = opening(title, &escape(kicker), &format!("data-page=\"{kind}\""), STILL, CSS);
    format!(
        "{head}<p class=\"verdict {class}\"><span class=\"mark\" aria-hidden=\"true\">{mark}</span> <span>{}</span></p>\n</header>\n",
        escape(verdict)
    )
}

/// A page's beginning, `attributes` those of its body, `allowed` what it may load and run.
pub(crate) fn opening(title: &str, kicker: &str, attributes: &str, allowed: &str, style: &str) -> String {
    format!(
        r#"<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<meta name="generator" content="surgescope {version}">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; {allowed}">
<title>{title}</title>
<style>{style}</style>
</head>
<body {attributes}>
<main>
<header>
<p class="kicker">surgescope {kicker}</p>
<h1>{title}</h1>
"#,
        version = env!("CARGO_PKG_VERSION"),
        title = escape(title),
    )
}

/// What to know beside the results, where there is anything.
pub(crate) fn remarks(remarks: &[String]) -> String {
    if remarks.is_empty() {
        return String::new();
    }
    let items: String = remarks.iter().map(|remark| format!("<li>{}</li>\n", escape(remark))).collect();
    format!("<section id=\"remarks\"><h2>What to know</h2>\n<ul class=\"failings\">\n{items}</ul></section>\n")
}

/// The end of a page's text.
pub(crate) fn footer(more: &str) -> String {
    format!(
        "<footer>Written by surgescope {}. The page holds its own data and needs no network.{more}</footer>\n</main>\n",
        env!("CARGO_PKG_VERSION")
    )
}

/// Links to the chapters that a body has: headings right after an `id`.
pub(crate) fn contents(body: &str) -> String {
    let chapters: Vec<String> = body
        .split(r#" id=""#)
        .skip(1)
        .filter_map(|rest| {
            let (id, rest) = rest.split_once(r#""><h2>"#)?;
            let (heading, _) = rest.split_once("</h2>")?;
            (!id.contains('<')).then(|| format!(r##"<li><a href="#{id}">{heading}</a></li>"##))
        })
        .collect();
    format!("<nav class=\"contents\" aria-label=\"Contents\"><ul>{}</ul></nav>\n", chapters.concat())
}

/// Mark, class and sentence of a judgement.
fn judged(closeness: Closeness, sentence: String) -> (&'static str, &'static str, String) {
    let (mark, class) = match closeness {
        Closeness::Noise => ("✓", "good"),
        Closeness::Near => ("≈", "near"),
        Closeness::Missing => ("✗", "missing"),
        Closeness::Unknown => ("?", "unknown"),
    };
    (mark, class, sentence)
}

/// What one sensor in one run shows.
pub(crate) struct Panel<'a> {
    /// The last stage's fit of it, whose numbers the text gives.
    pub(crate) fit: &'a crate::fit::outcome::fit::SensorFit,
    pub(crate) file: &'a str,
    pub(crate) curves: Curves,
    pub(crate) overlays: Vec<&'a Overlay>,
    /// Stages whose residual is shown from the start: the last, and those not so much larger that it would vanish.
    pub(crate) residual_shown: Vec<bool>,
}

/// A residual this many times the last stage's is left out until the reader asks for it.
const DWARFS: f64 = 4.0;

fn panels<'a>(page: &'a Page) -> Vec<Panel<'a>> {
    let Some(last) = page.stages.last() else { return Vec::new() };
    let mut panels = Vec::new();
    for run in &last.fit.runs {
        for fit in &run.sensors {
            let Some(curves) = Curves::of(&page.stages, &run.file, &fit.name, BUCKETS) else { continue };
            let residual_shown = page.stages.iter().enumerate().map(|(i, stage)| {
                let rmse_m = find(stage.fit, &run.file, &fit.name).map_or(f64::INFINITY, |s| s.rmse_m);
                i + 1 == page.stages.len() || rmse_m <= DWARFS * fit.rmse_m
            });
            panels.push(Panel {
                fit,
                file: &run.file,
                residual_shown: residual_shown.collect(),
                curves,
                overlays: page.overlays.iter().filter(|o| o.sensor == fit.name).collect(),
            });
        }
    }
    panels
}

fn sensors(out: &mut String, page: &Page, panels: &[Panel]) {
    let Some(last) = page.stages.last() else { return };
    if panels.is_empty() {
        out.push_str("<section id=\"sensors\"><h2>Measurement and model</h2><p>No pressure sensor was calibrated.</p></section>\n");
        return;
    }
    out.push_str("<section id=\"sensors\"><h2>Measurement and model</h2>\n");
    if panels.len() > 1 {
        out.push_str(r#"<nav aria-label="Sensors"><ul>"#);
        for (i, panel) in panels.iter().enumerate() {
            let run = if last.fit.runs.len() > 1 { format!(" · {}", escape(panel.file)) } else { String::new() };
            let _ = write!(out, r##"<li><a href="#sensor-{i}">{}{run}</a></li>"##, escape(&panel.fit.name));
        }
        out.push_str("</ul></nav>\n");
    }
    for (i, panel) in panels.iter().enumerate() {
        // The page of a diagnosis has more to say than numbers of peaks: there they fold away.
        out.push_str(&crate::report::calibration::sensor::section(i, panel, page, page.diagnoses.is_empty()));
    }
    out.push_str("</section>\n");
}

/// Number of the colour of a stage: the result is always 0; those before it take 1 to 4 in turn.
pub(crate) fn colour(stage: usize, stages: usize) -> usize {
    if stage + 1 == stages { 0 } else { 1 + stage % 4 }
}

/// A table in which the columns of `numbers` hold numbers; cells and headings are HTML. Where there is no room for columns, each cell brings
/// its heading along.
pub(crate) fn table(
    caption: &str,
    headings: &[&str],
    numbers: &[usize],
    rows: impl Iterator<Item = Vec<String>>,
) -> String {
    let mut out = format!(
        r#"<div class="scroll" tabindex="0" role="region" aria-label="{0}"><table><caption class="hidden">{0}</caption><thead><tr>"#,
        escape(caption)
    );
    let class = |column: usize| if numbers.contains(&column) { r#" class="number""# } else { "" };
    for (column, heading) in headings.iter().enumerate() {
        let _ = write!(out, r#"<th scope="col"{}>{heading}</th>"#, class(column));
    }
    out.push_str("</tr></thead><tbody>\n");
    for row in rows {
        out.push_str("<tr>");
        for (column, cell) in row.iter().enumerate() {
            let label = headings.get(column).copied().unwrap_or_default();
            let _ = write!(out, r#"<td{} data-label="{label}">{cell}</td>"#, class(column));
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</tbody></table></div>\n");
    out
}

/// A number with a true minus sign.
pub(crate) fn minus(text: &str) -> String {
    text.replace('-', "−")
}
