//! A foreign file as an import understands it, before anything is written.

use std::path::Path;

use crate::report::text::number::significant;
use crate::report::text::table::Table;
use crate::shown::Shown as _;
use crate::storage::import::{Imported, rate_hz};

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
