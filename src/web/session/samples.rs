//! What a sensor recorded, as it was recorded: a fit uses a part of a long record, averaged; a chart shows every peak.

use std::ops::Range;

use crate::fit::data::run_data::SensorData;
use crate::recording::Recording;
use crate::report::view::decimate;
use crate::report::view::panel::OwnUnit;
use crate::rig::Coupling;
use crate::study::open::Loaded;

/// Points of a chart that does not say how many it wants, and the most that it gets.
const POINTS: usize = 1200;
const MOST_POINTS: usize = 20_000;

/// The part of a record that a chart shows, s after the start of the closure, and at how many points.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Stretch {
    /// From when on.
    pub from_s: Option<f64>,
    /// Until when.
    pub to_s: Option<f64>,
    /// Points.
    pub points: Option<usize>,
}

/// Samples of a sensor. A value is `per_m` × head + `zero`.
pub struct Samples<'a> {
    /// Times on the recording's clock, s.
    pub time_s: &'a [f64],
    value: &'a [f64],
    per_m: f64,
    zero: f64,
    /// Those that the fit uses, or would if it did not average.
    used: Range<usize>,
    start_s: f64,
}

impl<'a> Samples<'a> {
    /// Those of a sensor as a fit has them, or as they lie in the `whole` of a record of which it has a part. The
    /// closure starts at `start_s`.
    pub fn of(loaded: &Loaded, data: &'a SensorData, whole: Option<&'a Recording>, start_s: f64) -> Samples<'a> {
        let rig = &loaded.recording.rig;
        let series = whole.zip(rig.sensors.iter().position(|s| s.name == data.sensor.name));
        let Some(series) = series.and_then(|(whole, place)| whole.series.get(place)) else {
            let (time_s, value) = (&data.time_s[..], &data.head_m[..]);
            return Samples { time_s, value, per_m: 1.0, zero: 0.0, used: 0..time_s.len(), start_s };
        };
        let unit = OwnUnit::of(rig, &data.sensor.name, loaded.features.temperature_degc);
        let (per_m, mut zero) = unit.map_or((1.0, 0.0), |unit| (unit.per_m, unit.zero));
        if data.sensor.coupling == Coupling::Ac {
            // as in a fit: it shows no steady pressure, and so no elevation
            zero += per_m * rig.sensor_elevation_m(&data.sensor);
        }
        let (time_s, value) = (&series.time_s[..], &series.value[..]);
        let (from_s, to_s) = loaded.window.map_or((f64::MIN, f64::MAX), |window| (window.from_s, window.to_s));
        let used = time_s.partition_point(|&t| t < from_s)..time_s.partition_point(|&t| t <= to_s);
        Samples { time_s, value, per_m, zero, used, start_s }
    }

    /// Time of a sample after the start of the closure, s.
    pub fn after_start_s(&self, i: usize) -> f64 {
        self.time_s[i] - self.start_s
    }

    /// Head of a sample, m.
    pub fn head_m(&self, i: usize) -> f64 {
        (self.value[i] - self.zero) / self.per_m
    }

    /// Indices of the samples to show, every peak among them; and how many the stretch has.
    pub fn shown(&self, stretch: &Stretch) -> (Vec<usize>, usize) {
        let used = &self.time_s[self.used.clone()];
        let at = |s: f64| self.used.start + used.partition_point(|&t| t < self.start_s + s);
        // one sample beyond each edge, so that the line reaches it
        let from = stretch.from_s.map_or(self.used.start, |s| at(s).saturating_sub(1).max(self.used.start));
        let to = stretch.to_s.map_or(self.used.end, |s| (at(s) + 1).min(self.used.end)).max(from);
        let points = stretch.points.unwrap_or(POINTS).clamp(4, MOST_POINTS);
        let values = &self.value[from..to];
        let kept = decimate::keep(&[values], values.len(), (points - 2) / 2);
        (kept.into_iter().map(|i| from + i).collect(), to - from)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STRETCH: Stretch = Stretch { from_s: None, to_s: None, points: Some(100) };

    /// A hundred thousand samples of 0 with a single peak, of which a fit uses the middle.
    fn samples(time_s: &[f64], value: &[f64]) -> (Vec<f64>, usize) {
        let samples = Samples { time_s, value, per_m: 10.0, zero: 5.0, used: 20_000..80_000, start_s: 3.0 };
        let (kept, count) = samples.shown(&STRETCH);
        let near = Stretch {
            from_s: Some(samples.after_start_s(54_000)),
            to_s: Some(samples.after_start_s(54_010)),
            ..STRETCH
        };
        assert_eq!(samples.shown(&near).0, (53_999..54_011).collect::<Vec<_>>(), "near by, every sample");
        let beyond = Stretch { from_s: Some(-1e9), to_s: Some(f64::NAN), ..STRETCH };
        assert_eq!(samples.shown(&beyond).1, 1, "no number is no time");
        (kept.iter().map(|&i| samples.head_m(i)).collect(), count)
    }

    #[test]
    fn every_peak_of_what_is_used_is_shown_at_any_zoom() {
        let time_s: Vec<f64> = (0..100_000).map(|i| f64::from(i) * 1e-3).collect();
        let mut value = vec![5.0; 100_000];
        (value[54_321], value[10], value[99_000]) = (25.0, 1e6, -1e6);
        let (heads, count) = samples(&time_s, &value);
        assert_eq!(count, 60_000);
        assert!(heads.len() <= 100 && heads.iter().filter(|h| **h == 2.0).count() == 1, "{heads:?}");
        assert!(heads.iter().all(|h| *h == 0.0 || *h == 2.0), "what lies outside does not show");
    }
}
