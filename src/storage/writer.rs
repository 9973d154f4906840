//! The live, crash-safe writer.

use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::recording::{Gap, RunInfo};
use crate::rig::Rig;
use crate::storage::compress::{LeftOut, Moves, compress};
use crate::storage::disk;
use crate::storage::end::end_in_place;
use crate::storage::error::LogError;
use crate::storage::layout::{kind_of, live_zero_ns, offset_ns, to_ns, to_s};
use crate::storage::retime::{ClockFix, Retimer};
use crate::storage::schema::{Block, Kind};
use crate::storage::sink;
use crate::storage::sink::{LIVE_CHUNK_BYTES, Muted, Sink};

/// While samples arrive, none waits longer than this before it is handed to the system.
pub const FLUSH_EVERY: Duration = Duration::from_millis(20);
/// After so many chunks the MCAP writer, which remembers something of each, is renewed.
const CHUNKS_BEFORE_RENEWAL: u32 = if cfg!(test) { 3 } else { 10_000 };

/// How a recording ended.
#[derive(Debug)]
pub enum Ending {
    /// A finished file, compressed and indexed, with every sample but those that [`Writer::keep`] left out, counted by
    /// sensor: samples and gaps.
    Finished(HashMap<String, (u64, u64)>),
    /// Every sample is there, but the file could not be compressed, and why.
    Plain(LogError),
    /// A whole file, but its last samples are missing, and why.
    CutShort(LogError),
}

/// Writes a recording while it is made.
///
/// The file has its final name from the start. Killed at any moment, it holds every sample but those of the last
/// [`FLUSH_EVERY`], and [`recover`](crate::storage::recover) makes it whole. Dropping the writer without
/// [`finish`](Writer::finish) leaves such a file. Times are nanoseconds on the recording's clock (0 at
/// [`RunInfo::start_unix_ns`]) and must increase from sample to sample of a sensor.
pub struct Writer {
    sink: Option<Sink<Muted<BufWriter<File>>>>,
    file: File,
    path: PathBuf,
    names: Vec<String>,
    last_ns: Vec<Option<i64>>,
    waiting_bytes: u64,
    flushed: Instant,
    chunks: u32,
    zero_ns: u64,
    retimer: Retimer,
    windows: HashMap<String, (i64, i64)>,
    /// The disk refused something: what came since is not in the file.
    failed: Option<LogError>,
}

impl Writer {
    /// Starts a recording; the rig and the run are with the system when this returns, and soon on the disk.
    ///
    /// # Errors
    /// [`LogError::Exists`] when there is a file at `path`.
    pub fn create(path: &Path, rig: &Rig, run: &RunInfo) -> Result<Writer, LogError> {
        let io = |e| LogError::io("write", path, e);
        disk::refuse_existing(path)?;
        disk::require_folder(path)?;
        let file = OpenOptions::new().read(true).write(true).create_new(true).open(path).map_err(io)?;
        let stream = BufWriter::with_capacity(4 * LIVE_CHUNK_BYTES as usize, file.try_clone().map_err(io)?);
        let stream = Muted::new(stream);
        let begun = Sink::start(stream, sink::live(), path, rig, run, live_zero_ns(run.start_unix_ns));
        let begun = begun.and_then(|mut sink| sink.flush().map(|()| sink));
        // of a file that a full disk did not let begin nothing stays
        let sink = begun.inspect_err(|_| drop(std::fs::remove_file(path)))?;
        // On a busy disk this takes longer than the first samples may wait; an error shows again at the end.
        let head = file.try_clone().map_err(io)?;
        std::thread::spawn(move || drop(head.sync_all()));
        Ok(Writer {
            sink: Some(sink),
            file,
            path: path.into(),
            names: rig.sensors.iter().map(|s| s.name.clone()).collect(),
            last_ns: vec![None; rig.sensors.len()],
            waiting_bytes: 0,
            flushed: Instant::now(),
            chunks: 0,
            zero_ns: live_zero_ns(run.start_unix_ns),
            retimer: Retimer::default(),
            windows: HashMap::new(),
            failed: None,
        })
    }

    /// Samples at `first_ns + round(i·period_ns)`, the sensor an index into [`Rig::sensors`].
    ///
    /// # Errors
    /// [`LogError::BadSamples`], with nothing written, when a value is not finite or the times do not come after the
    /// sensor's last one.
    pub fn samples(&mut self, sensor: usize, first_ns: i64, period_ns: f64, values: &[f64]) -> Result<(), LogError> {
        let Some(last) = values.len().checked_sub(1) else { return Ok(()) };
        // Two samples of less than a nanosecond apart could fall on one time.
        if last > 0 && !(period_ns >= 1.0 && period_ns.is_finite()) {
            return Err(self.bad(sensor, format!("a sample period of {period_ns} ns")));
        }
        if let Some(value) = values.iter().find(|v| !v.is_finite()) {
            return Err(self.bad(sensor, format!("a value of {value}")));
        }
        let end_ns = first_ns.checked_add(offset_ns(last, period_ns));
        let end_ns = end_ns.ok_or_else(|| self.bad(sensor, format!("a period of {period_ns} ns")))?;
        self.advance(sensor, first_ns, end_ns)?;
        let path = &self.path;
        let sink = self.sink.as_mut().ok_or_else(|| closed(path))?;
        if kind_of(values.len(), period_ns) == Kind::Block {
            let block = Block { period_ns: Some(period_ns), values: values.to_vec(), times_s: Vec::new() };
            sink.block(sensor, first_ns, &block)?;
            self.written(64 + 8 * values.len() as u64)
        } else {
            for (i, &value) in values.iter().enumerate() {
                sink.sample(sensor, first_ns + offset_ns(i, period_ns), None, value)?;
            }
            self.written(MESSAGE_BYTES * values.len() as u64)
        }
    }

    /// One sample.
    ///
    /// # Errors
    /// As [`samples`](Writer::samples).
    pub fn sample(&mut self, sensor: usize, time_ns: i64, value: f64) -> Result<(), LogError> {
        self.samples(sensor, time_ns, 0.0, &[value])
    }

    /// A stretch known to be lost.
    ///
    /// # Errors
    /// [`LogError::BadSamples`] when its times are not finite.
    pub fn gap(&mut self, sensor: usize, gap: Gap) -> Result<(), LogError> {
        let (Some(_), Some(ns)) = (to_ns(gap.from_s), to_ns(gap.to_s)) else {
            return Err(self.bad(sensor, format!("a gap from {} s to {} s", gap.from_s, gap.to_s)));
        };
        if sensor >= self.names.len() {
            return Err(self.bad(sensor, "a gap".into()));
        }
        self.sink.as_mut().ok_or_else(|| closed(&self.path))?.gap(sensor, ns, gap)?;
        self.written(MESSAGE_BYTES)
    }

    /// A note on the run, such as the counts of a device.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn note(&mut self, key: &str, value: &str) -> Result<(), LogError> {
        self.sink.as_mut().ok_or_else(|| closed(&self.path))?.note(key, value)?;
        self.written((key.len() + value.len()) as u64)
    }

    /// Says how the clocks of the devices lie to each other, as well as it is known by now: the last word holds for the
    /// whole recording. Fixes of one sensor must keep its times in order.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn clocks(&mut self, fixes: Vec<ClockFix>) -> Result<(), LogError> {
        let retimer = Retimer::new(fixes);
        if retimer == self.retimer {
            return Ok(());
        }
        self.retimer = retimer;
        let record = self.retimer.metadata();
        self.sink.as_mut().ok_or_else(|| closed(&self.path))?.record(&record)?;
        self.written(MESSAGE_BYTES)
    }

    /// Of a sensor, the finished file has only samples from one time to another, ns on the recording's clock as
    /// [`clocks`](Writer::clocks) says it last, and the gaps that reach between them. Where no finished file can be
    /// made, the live one keeps what it has.
    pub fn keep(&mut self, sensor: usize, from_ns: i64, to_ns: i64) {
        if let Some(name) = self.names.get(sensor) {
            self.windows.insert(name.clone(), (from_ns, to_ns));
        }
    }

    /// Hands everything to the system, so that a kill of this program loses none of it. Happens by itself while
    /// samples arrive; call it when they pause.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn flush(&mut self) -> Result<(), LogError> {
        self.sink.as_mut().ok_or_else(|| closed(&self.path))?.flush()?;
        self.flushed = Instant::now();
        if std::mem::take(&mut self.waiting_bytes) > 0 {
            self.chunks += 1;
        }
        if self.chunks >= CHUNKS_BEFORE_RENEWAL {
            self.chunks = 0;
            self.sink = self.sink.take().map(|sink| sink.renew(sink::live())).transpose()?;
        }
        Ok(())
    }

    /// Ends the recording: a finished file, compressed and indexed, takes the live file's place in one step. Where the
    /// disk has no room for it, or refused samples before, the live file itself is given an end: it is read as any
    /// other.
    ///
    /// # Errors
    /// [`LogError::Unfinished`] when neither can be done: the live file stays, with all samples in it that were
    /// written. [`LogError::Gone`] when it no longer stands at its name.
    pub fn finish(mut self) -> Result<Ending, LogError> {
        let flushed = self.flush();
        drop(self.sink.take().map(Sink::abandon));
        let failed = self.failed.take().or(flushed.err());
        let synced = disk::sync(&self.file, &self.path);
        let replaced = match (&failed, synced) {
            // What stands in the file may end within a record: nothing can be copied from it as a whole.
            (Some(_), _) => Err(None),
            (None, Err(error)) => Err(Some(error)),
            (None, Ok(())) => self.replace().map_err(Some),
        };
        let why = match replaced {
            Ok(left_out) => return Ok(Ending::Finished(left_out)),
            Err(why) => why,
        };
        if !disk::is_same_file(&self.path, &self.file) {
            let source = Box::new(failed.or(why).unwrap_or_else(|| closed(&self.path)));
            return Err(LogError::Gone { path: self.path.clone(), source });
        }
        let ended = end_in_place(&mut self.file).is_ok();
        match (failed, why) {
            (Some(error), _) if ended => Ok(Ending::CutShort(error)),
            (None, Some(error)) if ended => Ok(Ending::Plain(error)),
            (Some(error), _) => Err(LogError::CutShort { path: self.path.clone(), source: Box::new(error) }),
            (None, why) => {
                let source = Box::new(why.unwrap_or_else(|| closed(&self.path)));
                Err(LogError::Unfinished { path: self.path.clone(), source })
            }
        }
    }

    /// The disk refused what was written last; from now on only [`finish`](Writer::finish) is of use.
    pub fn fail(&mut self, error: LogError) {
        self.failed.get_or_insert(error);
    }

    fn replace(&mut self) -> Result<LeftOut, LogError> {
        let temporary = disk::temporary_beside(&self.path)?;
        let moves = Moves { retimer: &self.retimer, zero_ns: self.zero_ns, windows: &self.windows };
        let left_out = compress(&mut self.file, temporary.as_file(), &self.path, &moves)?;
        if !disk::is_same_file(&self.path, &self.file) {
            // Someone moved our file away: what stands at its name now, if anything, is not ours to replace.
            disk::publish_new(temporary, &self.path)?;
        } else {
            disk::publish_over(temporary, &self.path)?;
        }
        Ok(left_out)
    }

    fn advance(&mut self, sensor: usize, first_ns: i64, end_ns: i64) -> Result<(), LogError> {
        match self.last_ns.get(sensor) {
            None => return Err(self.bad(sensor, "samples".into())),
            Some(Some(last)) if first_ns <= *last => {
                let (first, last) = (to_s(first_ns), to_s(*last));
                return Err(self.bad(sensor, format!("a sample at {first} s after one at {last} s")));
            }
            Some(_) => self.last_ns[sensor] = Some(end_ns),
        }
        Ok(())
    }

    fn written(&mut self, bytes: u64) -> Result<(), LogError> {
        self.waiting_bytes = self.waiting_bytes.saturating_add(bytes);
        if self.waiting_bytes >= LIVE_CHUNK_BYTES || self.flushed.elapsed() >= FLUSH_EVERY {
            self.flush()
        } else {
            Ok(())
        }
    }

    fn bad(&self, sensor: usize, what: String) -> LogError {
        let name = self
            .names
            .get(sensor)
            .map_or_else(|| format!("sensor {sensor}, which the rig lacks"), |n| format!("'{n}'"));
        LogError::BadSamples { path: self.path.clone(), why: format!("{what} came for {name}") }
    }
}

/// Bytes that a message of one sample takes in a chunk.
const MESSAGE_BYTES: u64 = 40;

impl Drop for Writer {
    fn drop(&mut self) {
        if let Some(mut sink) = self.sink.take() {
            let _ = sink.flush();
            drop(sink.abandon());
        }
    }
}

fn closed(path: &Path) -> LogError {
    LogError::io("write", path, std::io::Error::other("the recording is closed"))
}

#[cfg(test)]
mod tests;
