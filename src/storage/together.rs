//! Several files of one closure become one recording: on one clock, or one after the other.

use crate::align::{AlignError, Clock, Method, Part, align, merge, refuse_overlaps};
use crate::recording::Recording;
use crate::rig::Rig;
use crate::storage::LogError;
use crate::storage::import::require_sensors;

/// One recording of all files.
#[derive(Debug, Clone)]
pub struct Together {
    /// The recording.
    pub recording: Recording,
    /// How the clock of each file was aligned; none of a single file.
    pub clocks: Vec<Clock>,
    /// What was left out, in words.
    pub left_out: Vec<String>,
}

impl Together {
    /// What became of each file but the first, in words.
    pub fn said(&self) -> Vec<String> {
        let clock = |clock: &Clock| match clock.events {
            0 => format!("{}: a part of one record, put in its place by its times", clock.file),
            _ => clock.to_string(),
        };
        self.clocks.iter().skip(1).map(clock).chain(self.left_out.iter().cloned()).collect()
    }
}

/// Why files are not joined.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the sentences say it
pub enum TogetherError {
    #[error(transparent)]
    Sensors(#[from] LogError),
    #[error(transparent)]
    Align(#[from] AlignError),
    #[error("no file to import")]
    NoFile,
}

/// Joins files, which have these `columns`, each read onto the sensors of a rig. Every sensor must be in one of several
/// files or among those `without` samples.
///
/// # Errors
/// A sensor that no file has, files that cannot be aligned, or that hold one sensor at the same times.
pub fn together(
    mut parts: Vec<Part>,
    rig: &Rig,
    without: &[String],
    columns: &[String],
    wanted: Option<Method>,
) -> Result<Together, TogetherError> {
    if parts.len() == 1 {
        return Ok(Together { recording: parts.remove(0).recording, clocks: Vec::new(), left_out: Vec::new() });
    }
    let recordings: Vec<&Recording> = parts.iter().map(|p| &p.recording).collect();
    require_sensors(&recordings, rig, without, columns)?;
    let clocks = align(&parts, wanted)?;
    refuse_overlaps(&parts, &clocks)?;
    let (recording, left_out) = merge(parts, &clocks).ok_or(TogetherError::NoFile)?;
    Ok(Together { recording, clocks, left_out })
}

/// Sensors of the rig that the files hold.
pub fn recorded(parts: &[Part], rig: &Rig) -> Vec<String> {
    let holds = |part: &Part, i: usize| part.recording.series.get(i).is_some_and(|s| !s.time_s.is_empty());
    let names = rig.sensors.iter().enumerate().filter(|(i, _)| parts.iter().any(|part| holds(part, *i)));
    names.map(|(_, sensor)| sensor.name.clone()).collect()
}
