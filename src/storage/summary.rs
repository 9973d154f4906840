//! What a recording holds, counted.

use std::fmt;

use serde::Serialize;

use crate::recording::Recording;

/// Counts of a recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Name of its rig.
    pub rig: String,
    /// From the first sample of any sensor to the last of any, s.
    pub duration_s: f64,
    /// Each sensor of the rig.
    pub sensors: Vec<SensorSummary>,
}

/// Counts of one sensor.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SensorSummary {
    /// Its name.
    pub name: String,
    /// What it measures.
    pub kind: &'static str,
    /// Unit of its samples.
    pub unit: &'static str,
    /// Number of samples.
    pub samples: usize,
    /// Number of gaps.
    pub gaps: usize,
    /// Time of the first sample, s.
    pub first_s: Option<f64>,
    /// Time of the last sample, s.
    pub last_s: Option<f64>,
}

impl Summary {
    /// Counts a recording.
    pub fn of(recording: &Recording) -> Summary {
        let sensor = |(sensor, series): (&crate::rig::Sensor, &crate::recording::Series)| SensorSummary {
            name: sensor.name.clone(),
            kind: sensor.kind.name(),
            unit: sensor.unit.symbol,
            samples: series.time_s.len(),
            gaps: series.gaps.len(),
            first_s: series.time_s.first().copied(),
            last_s: series.time_s.last().copied(),
        };
        Summary::of_sensors(
            &recording.rig.name,
            recording.rig.sensors.iter().zip(&recording.series).map(sensor).collect(),
        )
    }

    /// Of sensors that are counted.
    pub(crate) fn of_sensors(rig: &str, sensors: Vec<SensorSummary>) -> Summary {
        let first = sensors.iter().filter_map(|s| s.first_s).reduce(f64::min);
        let last = sensors.iter().filter_map(|s| s.last_s).reduce(f64::max);
        let duration_s = first.zip(last).map_or(0.0, |(first, last)| last - first);
        Summary { rig: rig.to_owned(), duration_s, sensors }
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // a difference of two times ends in meaningless digits
        let duration_s = (self.duration_s * 1e6).round() / 1e6;
        write!(f, "{duration_s} s of rig '{}'", self.rig)?;
        for sensor in &self.sensors {
            write!(f, "\n  {}: {} samples", sensor.name, sensor.samples)?;
            match sensor.gaps {
                0 => {}
                1 => write!(f, ", 1 gap")?,
                gaps => write!(f, ", {gaps} gaps")?,
            }
        }
        Ok(())
    }
}
