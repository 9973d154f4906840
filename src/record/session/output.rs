//! What a session writes to: the log, with what went into it counted, flushed and reported on time.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::Serialize;

use crate::record::clock::device_clock::seconds;
pub use crate::record::devices::device_count::DeviceCount;
use crate::record::error::RecordError;
use crate::record::health::alert::Alert;
use crate::recording::{Gap, RunInfo};
use crate::rig::Rig;
use crate::shown::Shown as _;
use crate::storage as log;
use crate::storage::disk::temporary_beside;
use crate::storage::{ClockFix, Ending, LogError, Writer};

/// A crash loses no more than this and what is on its way.
const FLUSH_EVERY: Duration = crate::storage::FLUSH_EVERY;

/// What was recorded of one sensor.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct SensorCount {
    /// Its name.
    pub name: String,
    /// Samples recorded.
    pub samples: u64,
    /// Gaps among them.
    pub gaps: u64,
}

/// A finished session, as `record --json` prints it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// The recording.
    pub file: String,
    /// From the first sample to one period after the last, s.
    pub duration_s: f64,
    /// Each recorded sensor, in the rig's order.
    pub sensors: Vec<SensorCount>,
    /// Each device.
    pub devices: Vec<DeviceCount>,
    /// Why it ended.
    pub ended: String,
    /// Whether samples were lost on the way.
    pub data_lost: bool,
    /// What was wrong with sensors while they were recorded.
    #[serde(skip_serializing_if = "Vec::is_empty", rename = "callouts")]
    pub alerts: Vec<Alert>,
    /// The recordings of a triggered session, one a shot; `file` is then their folder.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub shots: Vec<String>,
    /// Those of them that the session's end cut short.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub cut_short: Vec<CutShort>,
    /// Those of them that have nothing of a sensor.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub absent: Vec<Absent>,
    /// Why shots could not be written.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lost_shots: Vec<String>,
    /// How often the valve's command switched while the trigger settled: no shot shows it.
    #[serde(skip_serializing_if = "is_zero")]
    pub unheeded_edges: usize,
}

impl Summary {
    /// True where something is missing between the samples.
    pub(crate) fn has_gaps(&self) -> bool {
        self.sensors.iter().any(|sensor| sensor.gaps > 0)
    }
}

fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// A shot that ended before its time.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CutShort {
    /// Its recording.
    pub file: String,
    /// Recorded after the trigger fired, s; 0 where the disk refused even what came before.
    pub kept_s: f64,
    /// What was asked for, s.
    pub asked_s: f64,
}

/// A shot without a sample of sensors that devices were to send.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Absent {
    /// Its recording.
    pub file: String,
    /// The sensors, in the rig's order.
    pub sensors: Vec<String>,
}

/// The log of a running session. Dropped without [`Output::finish`], the file stays as a crash would leave it.
pub struct Output {
    writer: Writer,
    path: PathBuf,
    names: Vec<String>,
    counts: Vec<(u64, u64)>,
    end_ns: i64,
    /// Nothing is kept from this time on, ns.
    until_ns: i64,
    flush_at: Instant,
    /// The disk has refused something; what came since is dropped.
    refused: bool,
}

/// Refuses early what the log would refuse at the first sample.
pub fn check_path(path: &Path) -> Result<(), RecordError> {
    if path.symlink_metadata().is_ok() {
        return Err(RecordError::Exists(path.to_owned()));
    }
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() && !folder.is_dir() => {
            Err(RecordError::NoFolder(folder.to_owned()))
        }
        _ => probe(path),
    }
}

/// Makes the folder of shots and refuses early what would be refused when the valve has closed.
pub fn check_folder(folder: &Path) -> Result<(), RecordError> {
    std::fs::create_dir_all(folder).map_err(|source| RecordError::Folder { folder: folder.to_owned(), source })?;
    probe(&folder.join("shot"))
}

/// A file can be made beside `path`; it goes again at once.
fn probe(path: &Path) -> Result<(), RecordError> {
    temporary_beside(path).map(drop).map_err(RecordError::Start)
}

impl Output {
    /// Creates the log; refuses a file that exists.
    pub fn create(path: &Path, rig: &Rig, run: &RunInfo) -> Result<Output, RecordError> {
        let now = Instant::now();
        Ok(Output {
            writer: Writer::create(path, rig, run).map_err(RecordError::Start)?,
            path: path.to_owned(),
            names: rig.sensors.iter().map(|sensor| sensor.name.clone()).collect(),
            counts: vec![(0, 0); rig.sensors.len()],
            end_ns: 0,
            until_ns: i64::MAX,
            flush_at: now + FLUSH_EVERY,
            refused: false,
        })
    }

    /// Writes evenly spaced samples of a sensor (index in the rig), in its unit; the first at `first_ns`.
    pub fn samples(&mut self, sensor: usize, first_ns: i64, period_ns: f64, values: &[f64]) -> Result<(), RecordError> {
        if !self.write(|writer| writer.samples(sensor, first_ns, period_ns, values))? {
            return Ok(());
        }
        self.end_ns = self.end_ns.max(first_ns.saturating_add((period_ns * values.len() as f64) as i64));
        if let Some(count) = self.counts.get_mut(sensor) {
            count.0 += values.len() as u64;
        }
        Ok(())
    }

    /// Writes a gap of a sensor.
    pub fn gap(&mut self, sensor: usize, gap: Gap) -> Result<(), RecordError> {
        let written = self.write(|writer| writer.gap(sensor, gap))?;
        if let Some(count) = self.counts.get_mut(sensor) {
            count.1 += u64::from(written);
        }
        Ok(())
    }

    /// Writes a note.
    pub fn note(&mut self, key: &str, value: &str) -> Result<(), RecordError> {
        self.write(|writer| writer.note(key, value)).map(drop)
    }

    /// Writes the relation of the devices' clocks.
    pub fn clocks(&mut self, fixes: Vec<ClockFix>) -> Result<(), RecordError> {
        self.write(|writer| writer.clocks(fixes)).map(drop)
    }

    /// Of a sensor, only what lies from one time to another on the recording's clock is kept, ns; the recording as a
    /// whole ends at `until_ns`.
    pub fn keep(&mut self, sensor: usize, from_ns: i64, to_ns: i64, until_ns: i64) {
        self.writer.keep(sensor, from_ns, to_ns);
        self.until_ns = until_ns;
    }

    /// True once the disk has refused something: the recording is over.
    pub fn refused(&self) -> bool {
        self.refused
    }

    /// Writes, unless the disk has refused before; false where nothing was written.
    fn write(&mut self, act: impl FnOnce(&mut Writer) -> Result<(), LogError>) -> Result<bool, RecordError> {
        if self.refused {
            return Ok(false);
        }
        match act(&mut self.writer) {
            Ok(()) => Ok(true),
            // No fault of the disk.
            Err(source @ LogError::BadSamples { .. }) => {
                Err(RecordError::Write { file: self.path.clone(), source: Box::new(source) })
            }
            Err(error) => {
                self.writer.fail(error);
                self.refused = true;
                Ok(false)
            }
        }
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// To be called often: flushes when it is time.
    pub fn tick(&mut self) -> Result<(), RecordError> {
        let now = Instant::now();
        if now >= self.flush_at {
            self.write(Writer::flush)?;
            self.flush_at = now + FLUSH_EVERY;
        }
        Ok(())
    }

    /// Finishes the file. `first_ns` is the time of the first sample, `listed` says which sensors the summary lists.
    pub fn finish(
        mut self,
        first_ns: i64,
        listed: impl Fn(usize) -> bool,
        devices: Vec<DeviceCount>,
        mut ended: String,
    ) -> Result<Summary, RecordError> {
        let file = self.path.clone();
        let ending = self
            .writer
            .finish()
            .map_err(|source| RecordError::Write { file: file.clone(), source: Box::new(source) })?;
        let mut data_lost = devices.iter().any(DeviceCount::lost_data);
        match ending {
            Ending::Finished(left_out) => {
                for (name, count) in self.names.iter().zip(&mut self.counts) {
                    let (samples, gaps) = left_out.get(name).copied().unwrap_or_default();
                    *count = (count.0.saturating_sub(samples), count.1.saturating_sub(gaps));
                }
                self.end_ns = self.end_ns.min(self.until_ns);
            }
            Ending::Plain(error) => {
                ended += &format!(". Every sample is in the file, but it could not be compressed: {}", cause(&error));
            }
            Ending::CutShort(error) => {
                ended += &format!(". The file is whole up to there, what came later is lost: {}", cause(&error));
                data_lost = true;
                (self.counts, self.end_ns) = counted(&self.path)?;
            }
        }
        let counts = self.names.into_iter().zip(self.counts).enumerate();
        Ok(Summary {
            file: file.shown().into_owned(),
            duration_s: seconds((self.end_ns - first_ns).max(0)),
            sensors: counts
                .filter(|(sensor, _)| listed(*sensor))
                .map(|(_, (name, (samples, gaps)))| SensorCount { name, samples, gaps })
                .collect(),
            data_lost,
            devices,
            ended,
            alerts: Vec::new(),
            shots: Vec::new(),
            cut_short: Vec::new(),
            absent: Vec::new(),
            lost_shots: Vec::new(),
            unheeded_edges: 0,
        })
    }
}

/// Samples and gaps of each sensor of a file, and the time of the last sample, ns.
fn counted(path: &Path) -> Result<(Vec<(u64, u64)>, i64), RecordError> {
    let recording = log::read(path).map_err(RecordError::Read)?;
    let last_s = recording.series.iter().filter_map(|series| series.time_s.last().copied()).fold(0.0, f64::max);
    let counts = recording.series.iter().map(|series| (series.value.len() as u64, series.gaps.len() as u64));
    Ok((counts.collect(), (last_s * 1e9) as i64))
}

/// What the system said.
fn cause(error: &LogError) -> String {
    let mut cause: &dyn std::error::Error = error;
    while let Some(inner) = cause.source() {
        cause = inner;
    }
    cause.to_string()
}
