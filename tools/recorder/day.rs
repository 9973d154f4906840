//! A day of recording, time compressed: memory flat, file readable, index intact.

use std::io::{self, Read};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use surgescope::record::devices::source::Sources;
use surgescope::record::session::live_test::{Options, live_devices, record};

use crate::{Measured, ramp, usage};

/// Frames of a tenth of a second, made as they are read.
struct Day {
    period_ns: u32,
    samples: i64,
    frames: i64,
    index: i64,
    pending: io::Cursor<Vec<u8>>,
}

impl Read for Day {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.pending.position() == self.pending.get_ref().len() as u64 {
            if self.index == self.frames {
                return Ok(0);
            }
            let frame = ramp::frame(self.index, self.samples, self.period_ns).ok_or(io::ErrorKind::InvalidData)?;
            self.index += 1;
            self.pending = io::Cursor::new(frame.encode());
        }
        self.pending.read(buffer)
    }
}

/// Records so many hours at a rate, then goes through the file by its index.
pub fn run(hours: f64, rate_hz: f64) -> Measured {
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("run.mcap");
    let rig = ramp::rig()?;
    let device = live_devices(&rig, &[])?.remove(0);
    let (period_ns, samples) = ((1e9 / rate_hz) as u32, (rate_hz / 10.0).max(1.0) as i64);
    let frames = (hours * 3600.0 * rate_hz) as i64 / samples;
    let day = Day { period_ns, samples, frames, index: 0, pending: io::Cursor::default() };
    let options = Options { silence: Duration::from_secs(60), ..Options::new(&file) };
    let started = Instant::now();
    let sources = Sources::reading(&device, day)?;
    let mut memory = Vec::new();
    let summary = record(&rig, &sources, &options, &AtomicBool::new(false), &mut |progress| {
        memory.push((progress.recorded_s.unwrap_or(0.0) / 3600.0, usage::memory_mib()));
    })?;
    let finished_mib = usage::memory_mib();
    println!(
        "{hours} h at {rate_hz} Hz x {}: {:.1} s; {} samples a channel",
        ramp::CHANNELS,
        started.elapsed().as_secs_f64(),
        summary.sensors[0].samples
    );
    for tenth in 0..=10 {
        if let Some((hour, mib)) = memory.get((memory.len().saturating_sub(1)) * tenth / 10) {
            println!("  after {hour:5.1} h {mib:6.1} MiB");
        }
    }
    println!("  finished    {finished_mib:6.1} MiB");
    check(&file, frames * samples, period_ns)
}

/// Reads the index, then every message through it.
fn check(file: &std::path::Path, samples: i64, period_ns: u32) -> Measured {
    let bytes = std::fs::read(file)?;
    let index = mcap::Summary::read(&bytes)?.ok_or("the file has no index")?;
    let stats = index.stats.as_ref().ok_or("the index has no statistics")?;
    let expected = samples as u64 * ramp::CHANNELS as u64;
    if stats.message_count != expected {
        return Err(format!("the index counts {} messages, not {expected}", stats.message_count).into());
    }
    let mut next = [0_i64; ramp::CHANNELS];
    let mut first_ns = None;
    for chunk in &index.chunk_indexes {
        for message in index.stream_chunk(&bytes, chunk)? {
            let message = message?;
            let channel: usize = message.channel.topic.trim_start_matches("/P").parse()?;
            // A sample: the tag of field 1, then the value.
            let value = f64::from_le_bytes(message.data.get(1..9).ok_or("a short message")?.try_into()?);
            let number = next[channel];
            let zero_ns = *first_ns.get_or_insert(message.log_time);
            let off_ns = (message.log_time - zero_ns) as i64 - number * i64::from(period_ns);
            if value != f64::from(ramp::count(channel, number)) || off_ns.abs() > 1000 {
                return Err(format!("channel {channel}, sample {number}: {value}, {off_ns} ns off").into());
            }
            next[channel] += 1;
        }
    }
    if next.iter().any(|count| *count != samples) {
        return Err(format!("the chunks of the index hold {next:?} samples").into());
    }
    println!(
        "  {:.1} MB, {} chunks in the index, every one of {expected} messages read through it and right",
        bytes.len() as f64 / 1e6,
        index.chunk_indexes.len()
    );
    Ok(())
}
