//! What a session writes to: the log, with what went into it counted, flushed and reported on time.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::Serialize;

use super::RecordError;
use super::clock::seconds;
use crate::log::Writer;
use crate::recording::{Gap, RunInfo};
use crate::rig::Rig;

/// A crash loses no more than this.
const FLUSH_EVERY: Duration = Duration::from_millis(100);
const REPORT_EVERY: Duration = Duration::from_secs(1);

/// Where a session stands, about once a second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Recorded time, s.
    pub recorded_s: f64,
    /// Samples of all sensors so far.
    pub samples: u64,
    /// Gaps of all sensors so far.
    pub gaps: u64,
    /// Samples of all sensors per second of the wall clock since the last report.
    pub samples_per_s: f64,
}

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

/// What came from one device.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct DeviceCount {
    /// Its name.
    pub name: String,
    /// Valid frames.
    pub frames: u64,
    /// Damaged ones (CRC, COBS, version, length).
    pub bad_frames: u64,
    /// Missing ones, by the jumps of the sequence; damaged ones are missing too.
    pub lost_frames: u64,
    /// Frames that came again and were dropped.
    pub duplicated_frames: u64,
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
    /// The recordings of a triggered session, one a shot; `file` is then their folder.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub shots: Vec<String>,
}

/// The log of a running session. Dropped without [`Output::finish`], the file stays as a crash would leave it.
pub struct Output {
    writer: Writer,
    path: PathBuf,
    names: Vec<String>,
    counts: Vec<(u64, u64)>,
    end_ns: i64,
    flush_at: Instant,
    reported: (Instant, u64),
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
        _ => Ok(()),
    }
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
            flush_at: now + FLUSH_EVERY,
            reported: (now, 0),
        })
    }

    /// Writes evenly spaced samples of a sensor (index in the rig), in its unit; the first at `first_ns`.
    pub fn samples(&mut self, sensor: usize, first_ns: i64, period_ns: f64, values: &[f64]) -> Result<(), RecordError> {
        self.writer.samples(sensor, first_ns, period_ns, values).map_err(|source| self.failed(source))?;
        self.end_ns = self.end_ns.max(first_ns.saturating_add((period_ns * values.len() as f64) as i64));
        if let Some(count) = self.counts.get_mut(sensor) {
            count.0 += values.len() as u64;
        }
        Ok(())
    }

    /// Writes a gap of a sensor.
    pub fn gap(&mut self, sensor: usize, gap: Gap) -> Result<(), RecordError> {
        self.writer.gap(sensor, gap).map_err(|source| self.failed(source))?;
        if let Some(count) = self.counts.get_mut(sensor) {
            count.1 += 1;
        }
        Ok(())
    }

    /// Writes a note.
    pub fn note(&mut self, key: &str, value: &str) -> Result<(), RecordError> {
        self.writer.note(key, value).map_err(|source| self.failed(source))
    }

    /// To be called often: flushes when it is time, and returns the progress when it is time to report it.
    pub fn tick(&mut self) -> Result<Option<Progress>, RecordError> {
        let now = Instant::now();
        if now >= self.flush_at {
            self.writer.flush().map_err(|source| self.failed(source))?;
            self.flush_at = now + FLUSH_EVERY;
        }
        let (reported_at, reported_samples) = self.reported;
        let since = now.duration_since(reported_at);
        if since < REPORT_EVERY {
            return Ok(None);
        }
        let (samples, gaps) = self.counts.iter().fold((0, 0), |sum, count| (sum.0 + count.0, sum.1 + count.1));
        self.reported = (now, samples);
        let samples_per_s = (samples - reported_samples) as f64 / since.as_secs_f64();
        Ok(Some(Progress { recorded_s: seconds(self.end_ns), samples, gaps, samples_per_s }))
    }

    /// Finishes the file. `first_ns` is the time of the first sample, `listed` says which sensors the summary lists.
    pub fn finish(
        self,
        first_ns: i64,
        listed: impl Fn(usize) -> bool,
        devices: Vec<DeviceCount>,
        ended: String,
    ) -> Result<Summary, RecordError> {
        let file = self.path.clone();
        self.writer.finish().map_err(|source| RecordError::Write { file: file.clone(), source })?;
        let counts = self.names.into_iter().zip(self.counts).enumerate();
        Ok(Summary {
            file: file.display().to_string(),
            duration_s: seconds((self.end_ns - first_ns).max(0)),
            sensors: counts
                .filter(|(sensor, _)| listed(*sensor))
                .map(|(_, (name, (samples, gaps)))| SensorCount { name, samples, gaps })
                .collect(),
            data_lost: devices.iter().any(|device| device.bad_frames > 0 || device.lost_frames > 0),
            devices,
            ended,
            shots: Vec::new(),
        })
    }

    fn failed(&self, source: crate::log::LogError) -> RecordError {
        RecordError::Write { file: self.path.clone(), source }
    }
}
