//! A foreign file as an import understands it, for programs and pages.

use std::path::Path;

use serde_json::{Value, json};

use crate::recording::Series;
use crate::rig::Sensor;
use crate::storage::import::file::Imported;

/// Values of each sensor that are shown.
const SHOWN: usize = 4;

impl Imported {
    /// Each sensor with its column, unit, rate and first values.
    pub fn understood(&self, path: &Path) -> Value {
        let sensors = self.recording.rig.sensors.iter().zip(&self.recording.series).zip(&self.columns);
        let one = |((sensor, series), column): ((&Sensor, &Series), &Option<String>)| {
            json!({
                "sensor": sensor.name,
                "column": column,
                "unit": sensor.unit.symbol,
                "samples": series.time_s.len(),
                "rate_hz": rate_hz(series),
                "first": series.value.iter().take(SHOWN).collect::<Vec<_>>(),
            })
        };
        json!({ "file": path, "sensors": sensors.map(one).collect::<Vec<_>>() })
    }
}

/// Samples a second; none of fewer than two.
pub fn rate_hz(series: &Series) -> Option<f64> {
    let (first, last) = (series.time_s.first()?, series.time_s.last()?);
    Some((series.time_s.len() - 1) as f64 / (last - first)).filter(|rate| rate.is_finite())
}
