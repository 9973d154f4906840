//! What one sensor in one run shows under all stages.

use crate::fit::outcome::fit::SensorFit;
use crate::report::view::curves::{BUCKETS, Curves, find};
use crate::report::{Overlay, Stage};

/// What one sensor in one run shows.
pub(crate) struct Panel<'a> {
    /// The last stage's fit of it, whose numbers the text gives.
    pub(crate) fit: &'a SensorFit,
    pub(crate) file: &'a str,
    pub(crate) curves: Curves,
    pub(crate) overlays: Vec<&'a Overlay>,
    /// Stages whose residual is shown from the start: the last, and those not so much larger that it would vanish.
    pub(crate) residual_shown: Vec<bool>,
}

/// A residual this many times the last stage's is left out until the reader asks for it.
const DWARFS: f64 = 4.0;

/// A panel for each sensor of each run of the last stage.
pub(crate) fn panels<'a>(stages: &'a [Stage], overlays: &'a [Overlay]) -> Vec<Panel<'a>> {
    let Some(last) = stages.last() else { return Vec::new() };
    let mut panels = Vec::new();
    for run in &last.fit.runs {
        for fit in &run.sensors {
            let Some(curves) = Curves::of(stages, &run.file, &fit.name, BUCKETS) else { continue };
            let residual_shown = stages.iter().enumerate().map(|(i, stage)| {
                let rmse_m = find(stage.fit, &run.file, &fit.name).map_or(f64::INFINITY, |s| s.rmse_m);
                i + 1 == stages.len() || rmse_m <= DWARFS * fit.rmse_m
            });
            panels.push(Panel {
                fit,
                file: &run.file,
                residual_shown: residual_shown.collect(),
                curves,
                overlays: overlays.iter().filter(|o| o.sensor == fit.name).collect(),
            });
        }
    }
    panels
}
