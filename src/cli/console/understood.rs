//! A foreign file as an import understands it, before anything is written.

use std::path::Path;

use serde_json::{Value, json};

use crate::recording::Series;
use crate::report::text::number::significant;
use crate::report::text::table::Table;
use crate::rig::Sensor;
use crate::shown::Shown as _;
use crate::storage::import::Imported;

/// Values of each sensor that are shown.
const SHOWN: usize = 4;

/// A line for each sensor: its column, unit, rate, and first values; then what was repaired, and what was guessed.
pub fn text(path: &Path, imported: &Imported) -> String {
    let mut table =
        Table::new(&["sensor", "column", "unit", "<samples", "<per second", "<from s", "<to s", "first values"]);
    let recording = &imported.recording;
    for ((sensor, series), column) in recording.rig.sensors.iter().zip(&recording.series).zip(&imported.columns) {
        let (Some(column), Some(first), Some(last)) = (column, series.time_s.first(), series.time_s.last()) else {
            continue;
        };
        let values: Vec<String> = series.value.iter().take(SHOWN).map(|v| significant(*v, 5)).collect();
        table.row([
            sensor.name.clone(),
            column.clone(),
            sensor.unit.to_string(),
            series.time_s.len().to_string(),
            rate_hz(series).map_or(String::new(), |rate| significant(rate, 4)),
            significant(*first, 5),
            significant(*last, 5),
            values.join("  "),
        ]);
    }
    let mut text = format!("{}, as understood:\n{table}", path.shown());
    let guesses: Vec<&str> = imported.repairs.iter().filter(|r| r.guessed).map(|r| r.text.as_str()).collect();
    if !guesses.is_empty() {
        text += &format!("guessed:\n  {}", guesses.join("\n  "));
    }
    text
}

/// The same for programs.
pub fn document(path: &Path, imported: &Imported) -> Value {
    let recording = &imported.recording;
    let sensors = recording.rig.sensors.iter().zip(&recording.series).zip(&imported.columns);
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

/// Samples a second; none of fewer than two.
fn rate_hz(series: &Series) -> Option<f64> {
    let (first, last) = (series.time_s.first()?, series.time_s.last()?);
    Some((series.time_s.len() - 1) as f64 / (last - first)).filter(|rate| rate.is_finite())
}
