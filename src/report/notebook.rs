//! Results as pieces of a page, for a notebook that shows them in a cell: still pictures, and a style that reaches
//! nothing else.

use crate::diagnose::Diagnosis;
use crate::fit::outcome::fit::Fit;
use crate::recording::{Recording, Series as Samples};
use crate::report::Stage;
use crate::report::calibration::{parameters, sensor};
use crate::report::diagnosis::{self, ranking};
use crate::report::page::judged;
use crate::report::svg::{LineChart, Series, Style};
use crate::report::text::escape::escape;
use crate::report::text::number::significant;
use crate::report::view::curves::{BUCKETS, Curves};
use crate::report::view::decimate::keep;
use crate::report::view::panel::Panel;
use crate::report::view::summary;
use crate::rig::{Sensor, SensorKind};

/// Stretches of a trace that are drawn.
const DRAWN: usize = 420;

/// The style of a piece. Its rules have the weight of an id, so that those of a notebook for all tables and headings do
/// not mix with them (a row may be dark in one and its text, too, in the other). The colours are those of the notebook
/// where it says whether it is dark (JupyterLab, VS Code, Colab, marimo and Sphinx do), else those of the reader's
/// system.
const STYLE: &str = concat!(
    ":is(.surgescope, #surgescope) {\n:where(:not(svg, svg *)) { all: revert; }\n& {\n",
    include_str!("html/assets/light.css"),
    "}\n@media screen and (prefers-color-scheme: dark) { & {\n",
    include_str!("html/assets/dark.css"),
    "} }\n:is([data-jp-theme-light=\"false\"], .vscode-dark, [theme=\"dark\"], .dark, [data-theme=\"dark\"]) & {\n",
    include_str!("html/assets/dark.css"),
    "}\n:is([data-jp-theme-light=\"true\"], .vscode-light, [theme=\"light\"], .light, [data-theme=\"light\"]) & {\n",
    include_str!("html/assets/light.css"),
    "}\n",
    include_str!("html/assets/page.css"),
    "& { display: block; padding: 0.5rem 1rem 1rem; max-width: 1000px; color: var(--text); background: var(--ground); ",
    "font: 14px/1.5 system-ui, -apple-system, \"Segoe UI\", Roboto, \"Helvetica Neue\", Arial, sans-serif; ",
    "font-variant-numeric: tabular-nums; }\nh2 { margin-top: 1.25rem; }\nh3 { margin-top: 1rem; }\n}"
);

/// A fit: how far it errs, its curves and residuals at each sensor, its parameters.
pub fn fit(fit: &Fit, warnings: &[String]) -> String {
    let stages = [Stage::of(fit)];
    let verdict = judged(summary::judge(fit), summary::verdict(&stages));
    let body = notes(warnings) + &curves(&stages) + &parameters::section(&stages);
    piece("calibration", verdict, &body)
}

/// A diagnosis: the verdict, the candidates, the curves of the start model and of the answer.
pub fn diagnosis(found: &Diagnosis) -> String {
    let stages: Vec<Stage> = [Some(&found.start), found.answer()].into_iter().flatten().map(Stage::of).collect();
    let diagnoses = std::slice::from_ref(found);
    let verdict = diagnosis::html::verdict(&stages, diagnoses);
    let body = notes(&found.warnings) + &ranking::section(diagnoses) + &curves(&stages);
    piece("diagnosis", verdict, &body)
}

/// A recording: the readings of each sensor, broken where samples are missing.
pub fn recording(file: &str, recording: &Recording) -> String {
    let sensors = recording.rig.sensors.iter().zip(&recording.series);
    let pictures: String =
        sensors.filter(|(_, samples)| samples.time_s.len() > 1).map(|(s, all)| trace(s, all)).collect();
    let gaps: usize = recording.series.iter().map(|samples| samples.gaps.len()).sum();
    let missing = if gaps == 0 { String::new() } else { format!(" {gaps} gaps, where the lines break.") };
    let words = format!("{file} on {}.{missing}", recording.rig.name);
    piece("recording", ("", "unknown", words), &pictures)
}

fn piece(kind: &str, (mark, class, verdict): (&str, &str, String), body: &str) -> String {
    format!(
        "<div class=\"surgescope\" data-piece=\"{kind}\"><style>{STYLE}</style>\n\
         <p class=\"verdict {class}\"><span class=\"mark\" aria-hidden=\"true\">{mark}</span> <span>{}</span></p>\n{body}</div>",
        escape(&verdict)
    )
}

fn notes(warnings: &[String]) -> String {
    warnings.iter().map(|w| format!("<p class=\"note\"><strong>Warning:</strong> {}.</p>\n", escape(w))).collect()
}

/// Head and residual at each sensor of each run of the last stage.
fn curves(stages: &[Stage]) -> String {
    let Some(last) = stages.last() else { return String::new() };
    let several = last.fit.runs.len() > 1;
    let runs = last.fit.runs.iter().flat_map(|run| run.sensors.iter().map(move |fit| (run.file.as_str(), fit)));
    runs.filter_map(|(file, fit)| {
        let curves = Curves::of(stages, file, &fit.name, BUCKETS)?;
        let panel = Panel { fit, file, curves, overlays: Vec::new(), unit: None };
        let place = significant(fit.position_m, 4);
        let of = if several { format!(" · {}", escape(file)) } else { String::new() };
        let name = escape(&fit.name);
        Some(format!("<h3>{name} <small>at {place} m{of}</small></h3>\n{}", sensor::pictures(&panel, stages)))
    })
    .collect()
}

/// Readings over time.
fn trace(sensor: &Sensor, samples: &Samples) -> String {
    let kept = keep(&[&samples.value], samples.time_s.len(), DRAWN);
    let mut gaps = samples.gaps.iter().peekable();
    let mut points = Vec::with_capacity(kept.len());
    for i in kept {
        while gaps.next_if(|gap| gap.to_s <= samples.time_s[i]).is_some() {
            points.push((f64::NAN, f64::NAN));
        }
        points.push((samples.time_s[i], samples.value[i]));
    }
    let series = vec![Series { label: String::new(), points, style: Style::line(0) }];
    let height = if sensor.kind == SensorKind::Pressure { 220.0 } else { 140.0 };
    LineChart {
        title: format!("{}, {}", sensor.name, sensor.kind.name()),
        x_label: "time, s".into(),
        y_label: sensor.unit.symbol.into(),
        series,
        ..LineChart::default()
    }
    .to_svg(900.0, height)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::study::Study;

    #[test]
    fn pieces_show_curves_values_and_gaps_and_style_only_themselves() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings/hdpe-nothing-missing.mcap");
        let study = Study::open([file]).unwrap();
        let fitted = study
            .calibrate("none")
            .options(crate::fit::search::options::Options { most_reaches: 32, ..Default::default() });
        let shown = fit(&fitted.run().unwrap(), &["a <b> & c".to_owned()]);
        assert!(
            shown.starts_with("<div class=\"surgescope\"") && shown.contains("<style>:is(.surgescope, #surgescope) {"),
            "{shown:.200}"
        );
        assert!(shown.contains("<svg") && shown.contains("wave_speed_m_s") && shown.contains("a &lt;b&gt; &amp; c"));
        assert!(!shown.contains("<script"));

        let mut recorded = study.recordings()[0].recording.clone();
        let pressure = recorded.rig.pressure_sensors().next().unwrap().0;
        let whole = recording("a.mcap", &recorded);
        let samples = &mut recorded.series[pressure];
        let (from_s, to_s) = (samples.time_s[50], samples.time_s[51]);
        samples.gaps.push(crate::recording::Gap { from_s, to_s, samples: None });
        let broken = recording("a.mcap", &recorded);
        assert_eq!(broken.matches('M').count(), whole.matches('M').count() + 1, "a line begins anew behind the gap");
        assert!(broken.contains("1 gaps") && !whole.contains("gaps"));
    }
}
