//! One self-contained HTML page of a calibration, a prediction, or a diagnosis: no network, light and dark, readable in
//! print and without scripts.

use std::fmt::Write;

use crate::report::Page;
use crate::report::html::data;
use crate::report::html::page::{contents, footer, head};
use crate::report::prediction::text as prediction;
use crate::report::text::escape::{escape, json_in_script};
use crate::report::view::panel::{Panel, panels};
use crate::report::view::summary;
use crate::report::view::summary::Closeness;

const JS: &str = include_str!("html/assets/page.js");
const UPLOT_JS: &str = include_str!("html/assets/uplot/uPlot.iife.min.js");
const UPLOT_LICENCE: &str = include_str!("html/assets/uplot/LICENSE");

/// The page as one HTML document.
///
/// Never fails: without stages or sensors the page says so; numbers that are not finite are left out of the curves.
pub fn html(page: &Page) -> String {
    let panels = panels(page);
    let (kind, (mark, class, verdict)) = match page.prediction {
        _ if !page.diagnoses.is_empty() => {
            ("diagnosis", crate::report::diagnosis::html::verdict(&page.stages, page.diagnoses))
        }
        Some(ahead) => ("prediction", judged(prediction::judge(ahead), prediction::verdict(ahead))),
        None => {
            let judgement = page.stages.last().map_or(Closeness::Unknown, |s| summary::judge(s.fit));
            ("calibration", judged(judgement, summary::verdict(&page.stages)))
        }
    };
    let named = page.diagnoses.last().map_or(String::new(), |d| format!(" data-verdict=\"{}\"", d.verdict.name()));
    let mut out = head(&page.title, kind, &named);
    let _ = writeln!(
        out,
        r#"<p class="verdict {class}"><span class="mark" aria-hidden="true">{mark}</span> <span>{}</span></p>"#,
        escape(&verdict)
    );
    if let Some(advice) = &page.advice {
        out.push_str(&advice.html());
    }
    out.push_str("</header>\n");
    for warning in page.warnings {
        let _ = writeln!(out, "<p class=\"note\"><strong>Warning:</strong> {}.</p>", escape(warning));
    }
    let diagnosed = !page.diagnoses.is_empty();
    let mut body = if diagnosed {
        crate::report::diagnosis::html::before(page)
    } else {
        crate::report::calibration::stages::staircase(&page.stages, "")
    };
    let links = sensor_links(page, &panels);
    sensors(&mut body, page, &panels, &links);
    body.push_str(&crate::report::calibration::parameters::section(&page.stages));
    if diagnosed {
        body.push_str(&crate::report::diagnosis::html::after(page));
    }
    body.push_str(&crate::report::calibration::stages::computation(&page.stages));
    body.push_str(&crate::report::calibration::rig::section(page.rig));
    out.push_str(&contents(&body, ("sensors", &links)));
    out.push_str(&body);
    out.push_str(&footer(" Charts: uPlot (MIT licence)."));
    if !panels.is_empty() {
        let data = json_in_script(&data::json(&page.stages, &panels, page.prediction.map(|p| p.known_until_s)));
        let _ = write!(
            out,
            "<script type=\"application/json\" id=\"data\">{data}</script>\n<script>/*!\n{UPLOT_LICENCE}*/\n{UPLOT_JS}</script>\n<script>{JS}</script>\n"
        );
    }
    out.push_str("</body>\n</html>\n");
    out
}

/// Mark, class and sentence of a judgement.
pub(crate) fn judged(closeness: Closeness, sentence: String) -> (&'static str, &'static str, String) {
    let (mark, class) = match closeness {
        Closeness::Noise => ("✓", "good"),
        Closeness::Near => ("≈", "near"),
        Closeness::Missing => ("✗", "missing"),
        Closeness::Unknown => ("?", "unknown"),
    };
    (mark, class, sentence)
}

/// A list of links to the sensors where there are several.
fn sensor_links(page: &Page, panels: &[Panel]) -> String {
    let several = page.stages.last().is_some_and(|last| last.fit.runs.len() > 1);
    let links = panels.iter().enumerate().map(|(i, panel)| {
        let run = if several { format!(" · {}", escape(panel.file)) } else { String::new() };
        format!(r##"<li><a href="#sensor-{i}">{}{run}</a></li>"##, escape(&panel.fit.name))
    });
    if panels.len() > 1 { format!("<ul>{}</ul>", links.collect::<String>()) } else { String::new() }
}

fn sensors(out: &mut String, page: &Page, panels: &[Panel], links: &str) {
    if page.stages.is_empty() {
        return;
    }
    if panels.is_empty() {
        out.push_str("<section id=\"sensors\"><h2>Measurement and model</h2><p>No pressure sensor was calibrated.</p></section>\n");
        return;
    }
    out.push_str("<section id=\"sensors\"><h2>Measurement and model</h2>\n");
    if !links.is_empty() {
        let _ = writeln!(out, r#"<nav class="sensors" aria-label="Sensors">{links}</nav>"#);
    }
    let mut units: Vec<&str> = panels.iter().filter_map(|p| Some(p.unit.as_ref()?.symbol)).collect();
    units.dedup();
    if !units.is_empty() {
        // The script fills it with buttons; without one, and on paper, heads are in m.
        let _ = writeln!(out, r#"<p class="units" data-own="{}" hidden>Heads in </p>"#, escape(&units.join(", ")));
    }
    for (i, panel) in panels.iter().enumerate() {
        out.push_str(&crate::report::calibration::sensor::section(i, panel, page));
    }
    out.push_str("</section>\n");
}
