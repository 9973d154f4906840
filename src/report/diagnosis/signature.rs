//! What an effect changes, over what was left to be changed: the one that is missing draws the residual.

use std::fmt::Write;

use crate::diagnose::{Diagnosis, Verdict};
use crate::report::Stage;
use crate::report::diagnosis::words::start_model;
use crate::report::html::figures;
use crate::report::svg::{LineChart, Series, Style};
use crate::report::text::escape::escape;
use crate::report::view::curves::Curves;
use crate::report::view::decimate;

/// Stretches of a chart, of each of which the extremes are kept.
const STRETCHES: usize = 420;

/// The signature of the best candidate of each diagnosis that found one.
pub(crate) fn section(diagnoses: &[Diagnosis]) -> String {
    let mut out = String::new();
    for diagnosis in diagnoses.iter().filter(|d| d.verdict != Verdict::NothingMissing) {
        out.push_str(&of(diagnosis).unwrap_or_default());
    }
    if out.is_empty() {
        return out;
    }
    format!(
        "<section class=\"signature\" id=\"signature\"><h2>Signature of the effect</h2>\n{out}<p class=\"note\">Broad: the residual of the start model, measured − start model. Line: the change by the effect, model with the effect − start model, both calibrated. The share of the residual’s square counts all samples.</p>\n</section>\n"
    )
}

fn of(diagnosis: &Diagnosis) -> Option<String> {
    let best = diagnosis.candidates.first()?;
    let with = best.fit.as_ref()?;
    let stages = [
        Stage { title: start_model(diagnosis), fit: &diagnosis.start },
        Stage { title: best.label.clone(), fit: with },
    ];
    let mut plates = Vec::new();
    for run in &with.runs {
        for sensor in &run.sensors {
            let Some(pair) = Pair::of(&stages, &run.file, &sensor.name) else { continue };
            let title = figures::title(with, &run.file, sensor);
            let title = format!("{title}: explains {:.1} % of the residual’s square", 100.0 * pair.share());
            plates.push((title, pair.chart(&best.label)));
        }
    }
    let mut out = String::new();
    let nearest = if diagnosis.verdict == Verdict::UnknownEffect { " (the nearest)" } else { "" };
    let _ = writeln!(
        out,
        "<h3><code>{}</code>{nearest} over the residual of the {}</h3>",
        escape(&best.label),
        escape(&start_model(diagnosis))
    );
    out.push_str(&figures::plates(&plates));
    (!plates.is_empty()).then_some(out)
}

/// Residual and signature at one sensor.
struct Pair {
    time_s: Vec<f64>,
    /// Measured − start model, m.
    left_m: Vec<f64>,
    /// Model with the effect − start model, m.
    change_m: Vec<f64>,
}

impl Pair {
    fn of(stages: &[Stage], file: &str, sensor: &str) -> Option<Self> {
        // All samples: what is left out for a chart is chosen by these two curves.
        let curves = Curves::of(stages, file, sensor, usize::MAX / 4)?;
        let minus = |a: &[f64]| a.iter().zip(&curves.models_m[0]).map(|(a, b)| a - b).collect::<Vec<f64>>();
        let (left_m, change_m) = (minus(&curves.measured_m), minus(&curves.models_m[1]));
        let any = left_m.iter().zip(&change_m).any(|(a, b)| a.is_finite() && b.is_finite());
        any.then_some(Pair { left_m, change_m, time_s: curves.time_s })
    }

    /// Share of the residual's square that the signature takes up, not below 0.
    fn share(&self) -> f64 {
        let (mut rest, mut whole) = (0.0, 0.0);
        for (left, change) in self.left_m.iter().zip(&self.change_m) {
            if left.is_finite() && change.is_finite() {
                rest += (left - change).powi(2);
                whole += left * left;
            }
        }
        if whole > 0.0 { (1.0 - rest / whole).max(0.0) } else { 0.0 }
    }

    fn chart(&self, effect: &str) -> LineChart {
        let line = |label: String, values: &[f64], style: Style| {
            let kept = decimate::keep(&[values], values.len(), STRETCHES);
            Series { label, points: kept.iter().map(|&i| (self.time_s[i], values[i])).collect(), style }
        };
        LineChart {
            x_label: "time after the start of the closure, s".into(),
            y_label: "change of head, m".into(),
            series: vec![
                line("measured − start model".into(), &self.left_m, Style::measured()),
                line(effect.into(), &self.change_m, Style::line(0)),
            ],
            ..LineChart::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signature_that_is_half_the_residual_takes_up_three_quarters_of_its_square() {
        let time_s: Vec<f64> = (0..100).map(f64::from).collect();
        let left_m: Vec<f64> = time_s.iter().map(|t| (0.2 * t).sin()).collect();
        let pair = |by: f64| Pair {
            time_s: time_s.clone(),
            change_m: left_m.iter().map(|l| by * l).collect(),
            left_m: left_m.clone(),
        };
        assert!((pair(0.5).share() - 0.75).abs() < 1e-12);
        assert!((pair(1.0).share() - 1.0).abs() < 1e-12);
        assert_eq!(pair(-1.0).share(), 0.0);
        assert_eq!(pair(f64::NAN).share(), 0.0);
        let svg = pair(0.5).chart("leak").to_svg(500.0, 300.0);
        assert!(svg.contains("class=\"measured\"") && svg.contains("class=\"series-0\"") && svg.contains(">leak<"));
    }
}
