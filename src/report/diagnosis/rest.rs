//! What would explain the rest, as text, JSON and page.

use std::fmt::Write;

use serde::Serialize;

use crate::diagnose::Diagnosis;
use crate::diagnose::rest::explanation::{Explanation, Site};
use crate::diagnose::rest::law::Law;
use crate::diagnose::rest::waveform::Pulsation;
use crate::report::html::figures;
use crate::report::svg::{LineChart, Series, Style};
use crate::report::text::escape::escape;
use crate::report::text::number::probability;

/// One explanation as JSON (see the contract).
#[derive(Serialize)]
pub(crate) struct Explained<'a> {
    r#where: String,
    pipe: Option<&'a str>,
    position_m: Option<f64>,
    position_error_m: Option<f64>,
    probability: f64,
    evidence: f64,
    says: &'a str,
    run: &'a str,
    onset_s: Option<f64>,
    pulsation: Option<Pulsation>,
    law: Option<Law>,
    law_share: Option<f64>,
    left_over_noise: f64,
    time_s: &'a [f64],
    value: &'a [f64],
    standard_error: &'a [f64],
    unit: &'static str,
}

#[derive(Serialize)]
struct Document<'a> {
    explanations: Vec<Explained<'a>>,
}

impl<'a> From<&'a Explanation> for Explained<'a> {
    fn from(of: &'a Explanation) -> Self {
        let (pipe, position_m, position_error_m) = match &of.site {
            Site::Pipe { pipe, position_m, error_m } => (pipe.as_deref(), Some(*position_m), Some(*error_m)),
            _ => (None, None, None),
        };
        Explained {
            r#where: of.site.name(),
            pipe,
            position_m,
            position_error_m,
            probability: of.probability,
            evidence: of.evidence,
            says: &of.says,
            run: &of.run,
            onset_s: of.onset_s,
            pulsation: of.pulsation,
            law: of.law.map(|(law, _)| law),
            law_share: of.law.map(|(_, share)| share),
            left_over_noise: of.left_over_noise,
            time_s: &of.time_s,
            value: &of.value,
            standard_error: &of.sd,
            unit: of.site.unit(),
        }
    }
}

/// The JSON document of `explain --json`.
///
/// # Errors
/// None in practice: all values can be written.
pub fn document(rest: &[Explanation]) -> serde_json::Result<serde_json::Value> {
    serde_json::to_value(Document { explanations: rest.iter().map(Explained::from).collect() })
}

/// The explanations for people, one a line; empty where there is none.
pub fn text(rest: &[Explanation]) -> String {
    let mut out = String::new();
    for (i, one) in rest.iter().enumerate() {
        let _ = match i {
            0 => writeln!(
                out,
                "What would explain the rest: {} (probability {}).",
                one.says,
                probability(one.probability)
            ),
            _ => writeln!(out, "  or {} ({})", one.says, probability(one.probability)),
        };
    }
    out
}

/// The section of a page, with the waveform of each explanation.
pub(crate) fn section(diagnoses: &[Diagnosis]) -> String {
    let Some(last) = diagnoses.last().filter(|d| !d.rest.is_empty()) else { return String::new() };
    let plate = |one: &Explanation| {
        let title = format!("{} (probability {})", one.says, probability(one.probability));
        (title, chart(one))
    };
    let plates: Vec<_> = last.rest.iter().map(plate).collect();
    format!(
        "<section class=\"rest\" id=\"rest\"><h2>What would explain the rest</h2>\n<p>{}.</p>\n{}<p class=\"note\">No effect of the catalogue explains the records. Here the forcing that is missing is solved for without a shape given, at each place in turn; the places are ranked by evidence. The band is two standard errors wide on either side.</p>\n</section>\n",
        escape(&last.rest[0].says),
        figures::plates(&plates)
    )
}

/// The waveform with its errors.
fn chart(one: &Explanation) -> LineChart {
    let (label, scale) = match one.site {
        Site::Supply => ("head of the supply, m", 1.0),
        Site::Valve | Site::Pipe { .. } => ("flow out, L/s", 1e3),
        Site::Sensor(_) => ("reading, m", 1.0),
        Site::Wall => ("strain, µm/m", 1e6),
    };
    let edge = |i: usize, sign: f64| (one.time_s[i], scale * (one.value[i] + sign * 2.0 * one.sd[i]));
    let all = 0..one.time_s.len();
    let band = all.clone().map(|i| edge(i, 1.0)).chain(all.clone().rev().map(|i| edge(i, -1.0)));
    LineChart {
        x_label: "time after the start of the closure, s".into(),
        y_label: label.into(),
        series: vec![
            Series { label: String::new(), points: band.collect(), style: Style::area(0) },
            Series {
                label: one.site.name(),
                points: all.map(|i| (one.time_s[i], scale * one.value[i])).collect(),
                style: Style::line(0),
            },
        ],
        marks: one.onset_s.iter().map(|t| (*t, "onset".to_owned())).collect(),
        ..LineChart::default()
    }
}
