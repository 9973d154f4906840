//! A test in memory: the samples of each sensor with their times, the gaps, and information on the run.

use crate::rig::Rig;

/// One recorded test.
#[derive(Debug, Clone)]
pub struct Recording {
    /// The rig it was made on.
    pub rig: Rig,
    /// One series for each sensor of the rig, in the rig's order; empty if nothing was recorded.
    pub series: Vec<Series>,
    /// Information on the run.
    pub run: RunInfo,
}

/// A rig that cannot replace the recording's own.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("the rig '{rig}' has no sensor named '{sensor}'; its sensors are {known}")]
pub struct RigMismatch {
    /// The rig's name.
    pub rig: String,
    /// The sensor that the rig lacks.
    pub sensor: String,
    /// The sensors that the rig has.
    pub known: String,
}

impl RigMismatch {
    fn of(rig: &Rig, sensor: &str) -> RigMismatch {
        let names: Vec<&str> = rig.sensors.iter().map(|s| s.name.as_str()).collect();
        let known = if names.is_empty() { "none".into() } else { names.join(", ") };
        RigMismatch { rig: rig.name.clone(), sensor: sensor.to_owned(), known }
    }
}

impl Recording {
    /// The same samples on another rig (`--rig`): each series goes to the sensor of its name. Sensors that the
    /// recording lacks stay empty; samples of a sensor that the rig lacks are an error.
    pub fn on_rig(mut self, rig: Rig) -> Result<Recording, RigMismatch> {
        let mut series = vec![Series::default(); rig.sensors.len()];
        for (sensor, recorded) in self.rig.sensors.iter().zip(&mut self.series) {
            match rig.sensors.iter().position(|s| s.name == sensor.name) {
                Some(place) => series[place] = std::mem::take(recorded),
                None if recorded.time_s.is_empty() => {}
                None => return Err(RigMismatch::of(&rig, &sensor.name)),
            }
        }
        Ok(Recording { rig, series, run: self.run })
    }

    /// The same as if these sensors had not been recorded.
    ///
    /// # Errors
    /// A name that no sensor of the rig has.
    pub fn without(mut self, sensors: &[String]) -> Result<Recording, RigMismatch> {
        for name in sensors {
            let Some(place) = self.rig.sensors.iter().position(|s| s.name == *name) else {
                return Err(RigMismatch::of(&self.rig, name));
            };
            self.series[place] = Series::default();
        }
        Ok(self)
    }
}

/// The samples of one sensor. Times are seconds on the recording's own clock, strictly increasing.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Series {
    /// Sample times, s.
    pub time_s: Vec<f64>,
    /// Sample values in the sensor's unit, same length as `time_s`.
    pub value: Vec<f64>,
    /// Stretches known to be lost.
    pub gaps: Vec<Gap>,
}

/// A stretch in which samples are known to be missing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gap {
    /// Time of the last sample before it, s.
    pub from_s: f64,
    /// Time of the first sample after it, s.
    pub to_s: f64,
    /// Number of samples lost, if known.
    pub samples: Option<u64>,
}

/// Information on a run.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RunInfo {
    /// Wall-clock time of the recording's time 0, ns since 1970 UTC; 0 if unknown.
    pub start_unix_ns: u64,
    /// Where the samples come from (`serial`, `import run.csv`, …).
    pub source: String,
    /// Version of the program that wrote it.
    pub program: String,
    /// Free notes, key and value.
    pub notes: Vec<(String, String)>,
    /// Format of the imported time series.
    pub csv: Option<CsvFormat>,
}

/// Number format of an imported time series, so that an export gives the same text again.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CsvFormat {
    /// Decimals of the times, if all have the same number.
    pub time_decimals: Option<u8>,
    /// Columns in the order of the file: index of the sensor in the rig, and decimals where all its cells have the
    /// same number.
    pub columns: Vec<(usize, Option<u8>)>,
}
