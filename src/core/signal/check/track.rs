//! The record of one sensor: its samples, its steady value and the first wave.

use crate::recording::{Recording, Series};
use crate::rig::{Coupling, Rig, Sensor, SensorKind, WaterProperties};
use crate::robust::{MEDIAN_TO_SD, median};
use crate::units::GRAVITY_M_S2;

/// Share of the largest deviation from the steady pressure at which a front counts as arrived.
const ARRIVAL: f64 = 0.05;

/// A recording shows a closure when the pressure leaves its steady value by this many times its noise.
const SIGNAL_TO_NOISE: f64 = 10.0;

/// Least number of samples in a closure, and in the travel time from sensor to sensor.
pub(crate) const SAMPLES_OF_A_FRONT: f64 = 10.0;

/// A sensor with its samples (at least one).
pub(crate) struct Track<'a> {
    pub(crate) sensor: &'a Sensor,
    pub(crate) series: &'a Series,
}

pub(crate) fn tracks<'a>(rig: &'a Rig, recording: &'a Recording) -> Vec<Track<'a>> {
    let recorded = |name: &str| recording.rig.sensors.iter().position(|s| s.name == name);
    let series = |sensor: &Sensor| recording.series.get(recorded(&sensor.name)?).filter(|s| !s.value.is_empty());
    rig.sensors.iter().filter_map(|sensor| Some(Track { sensor, series: series(sensor)? })).collect()
}

impl Track<'_> {
    /// Mean of the samples up to a time, or of all; `None` if there are none.
    pub(crate) fn mean_until(&self, end_s: Option<f64>) -> Option<f64> {
        let end = end_s.map_or(self.series.value.len(), |end| self.series.time_s.partition_point(|t| *t < end));
        // the interval of a slow sensor may exceed the steady stretch: its first sample stands for it
        let values = self.series.value.get(..end.max(1))?;
        Some(values.iter().sum::<f64>() / values.len() as f64)
    }

    pub(crate) fn interval_s(&self) -> Option<f64> {
        let mut steps: Vec<f64> = self.series.time_s.windows(2).map(|w| w[1] - w[0]).collect();
        (!steps.is_empty()).then(|| median(&mut steps))
    }
}

pub(crate) fn temperature_degc(rig: &Rig, tracks: &[Track<'_>]) -> f64 {
    let thermometer = tracks.iter().find(|t| t.sensor.kind == SensorKind::Temperature);
    let mean = thermometer.and_then(|t| Some(t.sensor.unit.to_si(t.mean_until(None)?, 1000.0)));
    mean.filter(|t| (0.0..=100.0).contains(t)).unwrap_or(rig.fluid.temperature_degc)
}

/// The steady pressure of a sensor and the first wave that reaches it.
pub(crate) struct Front<'a> {
    pub(crate) track: &'a Track<'a>,
    /// Steady value, in the sensor's unit.
    pub(crate) steady: f64,
    /// Standard deviation of the noise, in the sensor's unit.
    pub(crate) noise: f64,
    /// Number of samples behind the steady value.
    pub(crate) steady_samples: usize,
    /// Arrival of the wave; `None` if there is none.
    pub(crate) arrival_s: Option<f64>,
}

impl<'a> Front<'a> {
    pub(crate) fn find(track: &'a Track<'a>) -> Self {
        let value = &track.series.value;
        let first = value.len().min((value.len() / 50).max(20));
        let baseline = median(&mut value[..first].to_vec());
        // noise from successive differences, whose median drift and wave hardly change
        let mut steps: Vec<f64> = value.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
        let noise = MEDIAN_TO_SD * median(&mut steps) / std::f64::consts::SQRT_2;
        let swing = value.iter().map(|v| (v - baseline).abs()).fold(0.0, f64::max);
        // a pump's pulsation before the closure is not a front
        let unrest = value.iter().take(first).map(|v| (v - baseline).abs()).fold(0.0, f64::max);
        let threshold = (ARRIVAL * swing).max(5.0 * noise).max(2.0 * unrest);
        let arrival = (swing > SIGNAL_TO_NOISE * noise && swing > threshold)
            .then(|| value.iter().position(|v| (v - baseline).abs() > threshold))
            .flatten();
        let before = arrival.unwrap_or(value.len()).max(1);
        let steady = value.iter().take(before).sum::<f64>() / before.min(value.len().max(1)) as f64;
        let arrival_s = arrival.and_then(|i| track.series.time_s.get(i).copied());
        Front { track, steady, noise, steady_samples: before, arrival_s }
    }

    /// Steady head above the datum and its uncertainty, m; `None` for a sensor that does not see the steady pressure.
    pub(crate) fn steady_head_m(&self, rig: &Rig, water: &WaterProperties) -> Option<(f64, f64)> {
        let sensor = self.track.sensor;
        if sensor.coupling == Coupling::Ac {
            return None;
        }
        let metres = |shown: f64| sensor.unit.to_si(shown, water.density_kg_m3) / (water.density_kg_m3 * GRAVITY_M_S2);
        let elevation = rig.sensor_elevation_m(sensor);
        let random = 3.0 * self.noise / (self.steady_samples as f64).sqrt();
        Some((metres(self.steady) + elevation, metres(sensor.accuracy(self.steady) + random)))
    }
}
