//! Observations as a table: what was measured, or what a model shows in their place, one row each.
//!
//! Columns: `file` (the recording), `sensor`, `time_s` (on the recording's clock; empty for the flow before the
//! closure), `unit` (`m` of the fluid column, `m3/s`) and `value`, the last.

use crate::fit::data::run_data::RunData;
use crate::fit::problem::observed::{Gauge, Place};
use crate::rig::{Rig, SensorKind};

/// First line of such a table.
pub const HEADER: &str = "file,sensor,time_s,unit,value";

/// A table that cannot be used.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the sentences say it
pub enum TableError {
    #[error("{0} does not begin with '{HEADER}'")]
    Header(String),
    #[error("{name}, row {row}: {what}")]
    Row { name: String, row: usize, what: String },
    #[error("{0} cannot be read as CSV: {1}")]
    Csv(String, csv::Error),
}

/// The runs that a table is about, and what their files are called in it.
pub struct Table<'a> {
    /// The rig.
    pub rig: &'a Rig,
    /// The runs.
    pub runs: &'a [RunData],
    /// A name for each.
    pub files: &'a [String],
}

impl Table<'_> {
    /// One row, without its end of line.
    pub fn row(&self, place: &Place, value: f64) -> String {
        let (sensor, unit) = self.gauge(place);
        let time_s = if place.time_s.is_finite() { place.time_s.to_string() } else { String::new() };
        format!("{},{},{time_s},{unit},{value}", quoted(&self.files[place.run]), quoted(sensor))
    }

    /// The whole table.
    pub fn text(&self, rows: impl Iterator<Item = (Place, f64)>) -> String {
        let rows = rows.map(|(place, value)| self.row(&place, value) + "\n");
        std::iter::once(format!("{HEADER}\n")).chain(rows).collect()
    }

    /// The places of a table; what it says there is left unread. `name` is for messages.
    ///
    /// # Errors
    /// Another header, a file or sensor that these runs do not have, a time that is no number.
    pub fn places(&self, text: &str, name: &str) -> Result<Vec<Place>, TableError> {
        if text.lines().next().map(str::trim_end) != Some(HEADER) {
            return Err(TableError::Header(name.to_owned()));
        }
        let mut places = Vec::new();
        for (i, record) in csv::Reader::from_reader(text.as_bytes()).records().enumerate() {
            let record = record.map_err(|e| TableError::Csv(name.to_owned(), e))?;
            let place = self.place([&record[0], &record[1], &record[2]]);
            places.push(place.map_err(|what| TableError::Row { name: name.to_owned(), row: i + 1, what })?);
        }
        Ok(places)
    }

    fn place(&self, [file, sensor, time_s]: [&str; 3]) -> Result<Place, String> {
        let run = self.files.iter().position(|f| f == file).ok_or_else(|| format!("'{file}' is not given"))?;
        let own = &self.runs[run];
        if let Some(s) = own.sensors.iter().position(|s| s.sensor.name == sensor) {
            let time: Option<f64> = time_s.trim().parse().ok().filter(|t: &f64| t.is_finite());
            let time_s = time.ok_or_else(|| format!("the time '{time_s}' is not a number"))?;
            return Ok(Place { run, gauge: Gauge::Sensor(s), time_s });
        }
        if own.meter.is_some() && meter_name(self.rig) == sensor {
            return Ok(Place { run, gauge: Gauge::Meter, time_s: f64::NAN });
        }
        Err(format!("{file} has no pressure sensor or flow meter named '{sensor}'"))
    }

    /// Name and unit of what reads a place.
    pub fn gauge(&self, place: &Place) -> (&str, &'static str) {
        match place.gauge {
            Gauge::Sensor(s) => (&self.runs[place.run].sensors[s].sensor.name, "m"),
            Gauge::Meter => (meter_name(self.rig), "m3/s"),
        }
    }
}

/// Name of the flow meter that a fit takes: the first.
fn meter_name(rig: &Rig) -> &str {
    rig.sensors.iter().find(|s| s.kind == SensorKind::Flow).map_or("", |s| &s.name)
}

/// A cell, in quotes where it must be.
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
}
