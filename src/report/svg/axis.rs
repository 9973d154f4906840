//! Axes: where a value lies, where the marks are, and how both are drawn.

use std::fmt::Write;

use crate::report::text::escape::escape;
use crate::report::text::number::significant;

/// Where a chart's marks stand, px.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Area {
    pub(crate) left: f64,
    pub(crate) top: f64,
    pub(crate) right: f64,
    pub(crate) bottom: f64,
}

/// A scale, the marks along it, and its quantity and unit.
pub(crate) struct Labelled<'a> {
    pub(crate) scale: &'a Scale,
    pub(crate) ticks: &'a Ticks,
    pub(crate) label: &'a str,
}

/// Draws the lines left of and below an area, their numbers and what they are.
pub(crate) fn draw(out: &mut String, Area { left, top, right, bottom }: Area, x: &Labelled, y: &Labelled) {
    let _ = write!(
        out,
        r##"<path class="axis" d="M{left:.1} {top:.1}V{bottom:.1}H{right:.1}" stroke="#666" fill="none"/><g class="label">"##
    );
    for t in &x.ticks.at {
        let (at, below) = (x.scale.px(*t), bottom + 16.0);
        let _ = write!(out, r#"<text x="{at:.1}" y="{below:.1}" text-anchor="middle">{}</text>"#, x.ticks.label(*t));
    }
    for t in &y.ticks.at {
        let (beside, at) = (left - 6.0, y.scale.px(*t) + 4.0);
        let _ = write!(out, r#"<text x="{beside:.1}" y="{at:.1}" text-anchor="end">{}</text>"#, y.ticks.label(*t));
    }
    let (mid_x, mid_y) = (0.5 * (left + right), 0.5 * (top + bottom));
    let _ = write!(
        out,
        r#"<text x="{mid_x:.1}" y="{:.1}" text-anchor="middle">{}</text><text transform="translate(11 {mid_y:.1}) rotate(-90)" text-anchor="middle">{}</text></g>"#,
        bottom + 35.0,
        escape(x.label),
        escape(y.label)
    );
}

/// Maps a range of values to a range of pixels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scale {
    range: (f64, f64),
    from_px: f64,
    to_px: f64,
    log: bool,
}

impl Scale {
    pub(crate) fn new(range: (f64, f64), from_px: f64, to_px: f64, log: bool) -> Self {
        Self { range, from_px, to_px, log }
    }

    pub(crate) fn px(&self, value: f64) -> f64 {
        let (lo, hi) = self.range;
        let part = if self.log { (value.ln() - lo.ln()) / (hi.ln() - lo.ln()) } else { (value - lo) / (hi - lo) };
        self.from_px + part * (self.to_px - self.from_px)
    }

    pub(crate) fn ticks(&self, about: usize) -> Ticks {
        if self.log { Ticks::log(self.range, about) } else { Ticks::nice(self.range, about) }
    }
}

/// Places of the marks along an axis, and the decimals that tell them apart.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Ticks {
    pub(crate) at: Vec<f64>,
    decimals: Option<usize>,
}

impl Ticks {
    /// Multiples of 1, 2 or 5 times a power of ten, about as many as asked for.
    fn nice((lo, hi): (f64, f64), about: usize) -> Self {
        let raw = (hi - lo) / about.clamp(2, 20) as f64;
        let power = 10f64.powf(raw.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|s| *s >= raw).unwrap_or(10.0 * power);
        let (first, last) = ((lo / step).ceil(), (hi / step).floor());
        // In whole steps from a whole number, so that 0.3 is not 0.30000000000000004; `+ 0.0` turns -0 into 0.
        let at = (0..=((last - first).clamp(0.0, 100.0) as usize)).map(|k| (first + k as f64) * step + 0.0).collect();
        let decimals = (-step.log10().floor()).max(0.0) as usize;
        Self { at, decimals: (decimals <= 9 && hi.abs().max(lo.abs()) < 1e7).then_some(decimals) }
    }

    /// Powers of ten: with 2 and 5 between them where they are few, every other or fewer where they are many.
    fn log((lo, hi): (f64, f64), about: usize) -> Self {
        let (first, last) = (lo.log10().floor() as i32, hi.log10().ceil() as i32);
        let between: &[f64] = if last - first <= 3 { &[1.0, 2.0, 5.0] } else { &[1.0] };
        let every = 1 + (last - first) as usize / about.clamp(4, 20);
        let slack = 1.0 + 1e-9;
        let at = (first..=last)
            .step_by(every)
            .flat_map(|e| between.iter().map(move |m| m * 10f64.powi(e)))
            .filter(|t| *t >= lo / slack && *t <= hi * slack)
            .collect();
        Self { at, decimals: None }
    }

    /// The marks at whole numbers only, labelled so.
    pub(crate) fn whole(mut self) -> Self {
        self.at.retain(|t| t.fract() == 0.0);
        Self { decimals: Some(0), ..self }
    }

    pub(crate) fn label(&self, value: f64) -> String {
        match self.decimals {
            Some(decimals) => format!("{value:.decimals$}").replace('-', "−"),
            None => significant(value, 1),
        }
    }
}

/// A range that is not empty, so that a constant curve can be drawn.
pub(crate) fn wide((lo, hi): (f64, f64)) -> (f64, f64) {
    let least = 1e-9 * lo.abs().max(hi.abs()).max(1e-3);
    if hi - lo > least { (lo, hi) } else { (lo - 0.5 * lo.abs().max(1.0), hi + 0.5 * hi.abs().max(1.0)) }
}

pub(crate) fn padded(range: (f64, f64)) -> (f64, f64) {
    let (lo, hi) = wide(range);
    (lo - 0.05 * (hi - lo), hi + 0.05 * (hi - lo))
}

pub(crate) fn log_range((lo, hi): (f64, f64)) -> (f64, f64) {
    if hi / lo > 1.5 { (lo / 1.2, hi * 1.2) } else { (lo / 2.0, hi * 2.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_numbers() {
        assert_eq!(Ticks::nice((0.0, 1.0), 5).at, [0.0, 0.2, 0.4, 0.6000000000000001, 0.8, 1.0]);
        let ticks = Ticks::nice((-3.7, 61.0), 6);
        assert_eq!(ticks.at, [0.0, 20.0, 40.0, 60.0]);
        assert_eq!(ticks.label(20.0), "20");
        assert_eq!(Ticks::nice((-0.05, 0.05), 4).label(-0.05), "−0.05");
        let runs = Ticks::nice((0.9, 3.1), 6).whole();
        assert_eq!((runs.at.as_slice(), runs.label(2.0).as_str()), ([1.0, 2.0, 3.0].as_slice(), "2"));
        assert_eq!(Ticks::log((0.03, 2.0), 6).at, [0.05, 0.1, 0.2, 0.5, 1.0, 2.0]);
        assert_eq!(Ticks::log((1e-4, 1e2), 6).at, [1e-4, 1e-2, 1.0, 1e2]);
        assert_eq!(Ticks::log((1e-4, 1e2), 8).at.len(), 7);
    }
}
