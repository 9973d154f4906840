//! The frame of a page, its tables and its colours.

use std::fmt::Write;

use crate::report::text::escape::escape;

/// A page's style; its colours are as the reader's system has them, light or dark.
pub(crate) const CSS: &str = concat!(
    ":root {\n",
    include_str!("assets/light.css"),
    "}\n@media screen and (prefers-color-scheme: dark) { :root {\n",
    include_str!("assets/dark.css"),
    "} }\n",
    include_str!("assets/page.css")
);
const UPLOT_CSS: &str = include_str!("assets/uplot/uPlot.min.css");

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
    format!("<section id=\"remarks\"><h2>Notes</h2>\n<ul class=\"failings\">\n{items}</ul></section>\n")
}

/// The end of a page's text.
pub(crate) fn footer(more: &str) -> String {
    format!(
        "<footer>Written by surgescope {}. The page holds its own data and needs no network.{more}</footer>\n</main>\n",
        env!("CARGO_PKG_VERSION")
    )
}

/// Links to the chapters that a body has: headings right after an `id`. Where there is room they stand beside the page;
/// there the chapter of this id has a list of its own below it.
pub(crate) fn contents(body: &str, (chapter, within): (&str, &str)) -> String {
    let chapters: Vec<String> = body
        .split(r#" id=""#)
        .skip(1)
        .filter_map(|rest| {
            let (id, rest) = rest.split_once(r#""><h2>"#)?;
            let (heading, _) = rest.split_once("</h2>")?;
            let within = if id == chapter { within } else { "" };
            (!id.contains('<')).then(|| format!(r##"<li><a href="#{id}">{heading}</a>{within}</li>"##))
        })
        .collect();
    format!("<nav class=\"contents\" aria-label=\"Contents\"><ul>{}</ul></nav>\n", chapters.concat())
}

/// Number of the colour of a stage: the result is always 0; those before it take 1 to 4 in turn.
pub(crate) fn colour(stage: usize, stages: usize) -> usize {
    if stage + 1 == stages { 0 } else { 1 + stage % 4 }
}

/// A table in which the columns of `numbers` hold numbers; cells and headings are HTML. Where there is no room for
/// columns, each cell brings its heading along.
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
