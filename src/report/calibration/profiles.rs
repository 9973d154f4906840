//! How the fit gets worse along each profiled parameter, beside the parabola that its linear interval stands for.

use crate::fit::numeric::quantiles::Z_95;
use crate::fit::outcome::fit::{Fit, FittedParameter};
use crate::fit::outcome::profile::Profile;
use crate::report::svg::{LineChart, Series, Style};
use crate::report::text::escape::escape;
use crate::report::text::number::interval;

/// Rise of the sum of squares up to which the parabola is drawn.
const HIGHEST: f64 = 8.0;

/// The charts; nothing where nothing was profiled.
pub(crate) fn section(fit: &Fit) -> String {
    let charts: String = fit
        .parameters
        .iter()
        .filter_map(|p| p.profile.as_ref().map(|profile| figure(p, profile, fit.runs.len() > 1)))
        .collect();
    if charts.is_empty() {
        return charts;
    }
    format!(
        "<h3>Profiles</h3>\n<p class=\"note\">Rise of the sum of squares (scaled by the noise and its autocorrelation) along each parameter while all others are refitted. The 95% interval ends at 3.84. Where the curve leaves the dashed parabola, the standard error misleads; where it never reaches 3.84, the interval is open.</p>\n<div class=\"profiles\">\n{charts}</div>\n"
    )
}

fn figure(p: &FittedParameter, profile: &Profile, several: bool) -> String {
    let run = p.run.as_ref().filter(|_| several).map_or(String::new(), |r| format!(" · {r}"));
    format!(
        "<figure><figcaption><code>{}</code>{}: {} {}</figcaption>{}</figure>\n",
        escape(&p.name),
        escape(&run),
        interval(profile.interval_95),
        if p.unit == "1" { String::new() } else { escape(p.unit) },
        chart(p, profile).to_svg(360.0, 220.0)
    )
}

fn chart(p: &FittedParameter, profile: &Profile) -> LineChart {
    let (first, last) =
        (profile.points.first().map_or(p.value, |x| x.0), profile.points.last().map_or(p.value, |x| x.0));
    let mut series = vec![
        Series { label: "profile".into(), points: profile.points.clone(), style: Style::line(0) },
        Series { label: String::new(), points: profile.points.clone(), style: Style::points(0) },
        Series { label: "95%".into(), points: vec![(first, Z_95 * Z_95), (last, Z_95 * Z_95)], style: Style::line(3) },
    ];
    if p.standard_error() > 0.0 && p.standard_error().is_finite() {
        let parabola = (0..=60).map(|i| first + (last - first) * f64::from(i) / 60.0);
        let points = parabola
            .map(|x| (x, ((x - profile.best) / p.standard_error()).powi(2)))
            .filter(|p| p.1 <= HIGHEST)
            .collect();
        series.push(Series { label: "linear".into(), points, style: Style::line(1) });
    }
    LineChart {
        x_label: if p.unit == "1" { p.name.clone() } else { format!("{}, {}", p.name, p.unit) },
        y_label: "rise of χ²".into(),
        series,
        ..LineChart::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::outcome::uncertainty::Uncertainty;

    #[test]
    fn a_profile_is_drawn_with_threshold_and_parabola() {
        let profile = Profile {
            interval_95: (0.9, f64::INFINITY),
            unknown_beyond: [None; 2],
            unresolved: 0,
            linear_95: (0.9, 1.1),
            points: vec![(0.9, 3.84), (1.0, 0.0), (2.0, 1.5)],
            fell_by: 0.0,
            best: 1.0,
        };
        let p = FittedParameter {
            name: "tau1_s".into(),
            value: 1.0,
            uncertainty: Uncertainty::Known(0.05),
            unit: "s",
            ..Default::default()
        };
        let drawn = chart(&p, &profile);
        let labels: Vec<&str> = drawn.series.iter().map(|s| s.label.as_str()).filter(|l| !l.is_empty()).collect();
        assert_eq!(labels, ["profile", "95%", "linear"]);
        assert!(drawn.series[3].points.iter().all(|p| p.1 <= HIGHEST) && drawn.series[3].points.len() > 2);
        let text = figure(&p, &profile, false);
        assert!(text.contains("tau1_s</code>: from 0.900 s") && text.contains("<svg"), "{text}");
    }
}
