//! How a valve closed, as a picture.

use crate::report::svg::{LineChart, Series, Style};
use crate::valve::curve::ValveClosure;

/// The curve, its nearest two stages, and what other wave speeds and no creep make of it.
pub fn chart(closure: &ValveClosure) -> LineChart {
    let line = |n: usize, label: &str, time_s: &[f64], opening: &dyn Fn(usize) -> f64| Series {
        label: label.into(),
        points: time_s.iter().enumerate().map(|(i, t)| (*t, opening(i))).filter(|p| p.1.is_finite()).collect(),
        style: Style::line(n),
    };
    let (curve, law) = (&closure.curve, closure.two_stage);
    let mut series = vec![
        line(0, "reconstructed from the head", &curve.time_s, &|i| curve.opening[i]),
        line(1, "nearest two stages", &curve.time_s, &|i| law.opening(curve.time_s[i])),
    ];
    // Five lines can be told apart; a standard error moves the curve by less than a line's width.
    let drawn = closure.shifts.iter().filter(|s| s.what.starts_with("wave speed") && s.what.ends_with('%'));
    let drawn = drawn.chain(closure.shifts.iter().filter(|s| s.what == "creep left out"));
    series.extend(drawn.enumerate().map(|(n, s)| line(n + 2, &s.what, &s.curve.time_s, &|i| s.curve.opening[i])));
    LineChart {
        title: format!("{}: how the valve closed, by {}", closure.file, closure.sensor),
        x_label: "time after the start of the closure, s".into(),
        y_label: "opening, relative".into(),
        series,
        ..LineChart::default()
    }
}
