//! Which parameters the data tell apart: the correlations between their errors in the last fit.

use std::fmt::Write;

use crate::fit::outcome::fit::Fit;
use crate::report::Stage;
use crate::report::html::matrix::{Cell, matrix};
use crate::report::html::page::minus;
use crate::report::text::escape::escape;

/// Size of a correlation from which on two parameters are named: half the variance of one and more is the other's.
const STRONG: f64 = 0.9;
/// Most parameters that a table can show; with more only the shared ones are in it.
const MOST: usize = 20;

pub(crate) fn section(stages: &[Stage]) -> String {
    let Some(last) = stages.last() else { return String::new() };
    let known = known(last.fit);
    if known.len() < 2 {
        return String::new();
    }
    let names: Vec<String> = known.iter().map(|&i| name(last.fit, i)).collect();
    let columns: Vec<String> = (1..=known.len()).map(|n| n.to_string()).collect();
    let rows: Vec<(String, Vec<Cell>)> = known
        .iter()
        .enumerate()
        .map(|(n, &i)| {
            let cells = known.iter().map(|&j| Some(cell(last.fit.correlation[i][j], i == j))).collect();
            (format!("{} {}", n + 1, names[n]), cells)
        })
        .collect();
    let caption = format!("Correlation between the parameters of {}", last.title);
    let mut out = String::from("<section class=\"correlation\" id=\"correlation\"><h2>Correlated parameters</h2>\n");
    out.push_str(&key());
    out.push_str(&matrix(&caption, "parameter", &columns, &rows));
    let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
    for (a, &i) in known.iter().enumerate() {
        pairs.extend(known[..a].iter().map(|&j| (last.fit.correlation[i][j], j, i)));
    }
    pairs.retain(|(r, _, _)| r.abs() >= STRONG);
    pairs.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
    let strong: Vec<String> = pairs
        .iter()
        .take(5)
        .map(|&(r, j, i)| {
            let name = |i| escape(&name(last.fit, i));
            format!("<code>{}</code> and <code>{}</code> ({})", name(j), name(i), minus(&format!("{r:+.2}")))
        })
        .collect();
    if !strong.is_empty() {
        let _ = writeln!(out, "<p>Strongly correlated parameters: {}.</p>", strong.join(", "));
    }
    out.push_str("<p class=\"note\">Correlation between the errors of each pair of parameters of the last model. Near ±1 one can stand in for the other, and only their combination is well determined. Parameters at a bound are left out.</p>\n</section>\n");
    out
}

/// What the colours stand for.
fn key() -> String {
    let classes = [
        ("n3", "−0.9 and below"),
        ("n2", "to −0.6"),
        ("n1", "to −0.3"),
        ("r0", "weak"),
        ("p1", "from 0.3"),
        ("p2", "from 0.6"),
        ("p3", "0.9 and above"),
    ];
    let cells: String = classes.map(|(class, text)| format!(r#"<span class="cell {class}">{text}</span>"#)).concat();
    format!("<p class=\"key\" aria-hidden=\"true\">correlation: {cells}</p>\n")
}

/// Indices of the parameters whose correlations are known.
fn known(fit: &Fit) -> Vec<usize> {
    let n = fit.parameters.len();
    if fit.correlation.len() != n || fit.correlation.iter().any(|row| row.len() != n) {
        return Vec::new();
    }
    let known: Vec<usize> = (0..n).filter(|&i| fit.correlation[i][i].is_finite()).collect();
    if known.len() <= MOST { known } else { known.into_iter().filter(|&i| fit.parameters[i].run.is_none()).collect() }
}

fn name(fit: &Fit, i: usize) -> String {
    let p = &fit.parameters[i];
    match &p.run {
        Some(run) if fit.runs.len() > 1 => format!("{} · {run}", p.name),
        _ => p.name.clone(),
    }
}

fn cell(r: f64, diagonal: bool) -> (&'static str, String) {
    let size = [0.3, 0.6, STRONG].iter().filter(|l| r.abs() >= **l).count();
    let class = match (diagonal, r < 0.0) {
        (true, _) => "same",
        (_, true) => ["r0", "n1", "n2", "n3"][size],
        (_, false) => ["r0", "p1", "p2", "p3"][size],
    };
    let text = if diagonal { "1".into() } else { minus(&format!("{r:.2}")) };
    (class, if text == "−0.00" { "0.00".into() } else { text })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_tell_sign_and_size() {
        assert_eq!(cell(1.0, true), ("same", "1".into()));
        assert_eq!(cell(-0.934, false), ("n3", "−0.93".into()));
        assert_eq!(cell(0.45, false), ("p1", "0.45".into()));
        assert_eq!(cell(-0.001, false), ("r0", "0.00".into()));
    }
}
