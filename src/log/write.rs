//! A whole recording becomes a finished file.

use std::io::BufWriter;
use std::path::Path;

use super::layout::{BLOCK_ABOVE_HZ, offset_ns, to_ns, to_s};
use super::schema::{Block, Kind};
use super::sink::{self, Sink};
use super::{LogError, disk};
use crate::recording::{Recording, Series};

/// Writes a recording as a finished file: indexed, zstd-compressed, with CRCs. Its samples, gaps, notes and rig text
/// come back from [`read`](super::read) bit by bit.
///
/// # Errors
/// [`LogError::Exists`] when there is a file at `path`; [`LogError::BadSamples`] when a series is not one (times that
/// do not increase, values that are not finite, one series too many or too few).
pub fn write(path: &Path, recording: &Recording) -> Result<(), LogError> {
    disk::refuse_existing(path)?;
    check(recording).map_err(|why| LogError::BadSamples { path: path.into(), why })?;
    let temporary = disk::temporary_beside(path)?;
    let stream = BufWriter::new(temporary.as_file());
    let zero_ns = time_zero_ns(recording);
    let mut sink = Sink::start(stream, sink::finished(), path, &recording.rig, &recording.run, zero_ns)?;

    let mut parts = Vec::new();
    for (sensor, series) in recording.series.iter().enumerate() {
        let blocks = mean_rate_hz(series) > BLOCK_ABOVE_HZ;
        sink.channel(sensor, if blocks { Kind::Block } else { Kind::Sample })?;
        if blocks {
            parts.extend(blocks_of(series).map(|(start, end)| (start, sensor, Part::Block(end))));
        } else {
            parts.extend((0..series.time_s.len()).map(|i| (i, sensor, Part::Sample)));
        }
        parts.extend((0..series.gaps.len()).map(|i| (i, sensor, Part::Gap)));
    }
    // By time over all sensors, so that a player reads the file from front to back.
    let time_of = |&(i, sensor, part): &(usize, usize, Part)| match part {
        Part::Gap => recording.series[sensor].gaps[i].to_s,
        _ => recording.series[sensor].time_s[i],
    };
    parts.sort_by(|a, b| time_of(a).total_cmp(&time_of(b)));

    for (i, sensor, part) in parts {
        let series = &recording.series[sensor];
        match part {
            Part::Sample => {
                let time_s = series.time_s[i];
                let ns = nanoseconds(time_s);
                sink.sample(sensor, ns, (to_s(ns) != time_s).then_some(time_s), series.value[i])?;
            }
            Part::Block(end) => sink.block(sensor, nanoseconds(series.time_s[i]), &block(series, i, end))?,
            Part::Gap => sink.gap(sensor, nanoseconds(series.gaps[i].to_s), series.gaps[i])?,
        }
    }
    let stream = sink.finish()?;
    stream.into_inner().map_err(|e| LogError::io("write", path, e.into_error()))?;
    disk::publish_new(temporary, path)
}

#[derive(Clone, Copy)]
enum Part {
    Sample,
    /// Up to, but without, this sample.
    Block(usize),
    Gap,
}

/// Most samples of a block: a tenth of a second at 20 kHz.
const BLOCK_SAMPLES: usize = 2000;

/// First sample and end of each block: full ones, save that none runs across a gap.
fn blocks_of(series: &Series) -> impl Iterator<Item = (usize, usize)> {
    let mut start = 0;
    std::iter::from_fn(move || {
        let first = *series.time_s.get(start)?;
        let mut end = (start + BLOCK_SAMPLES).min(series.time_s.len());
        if let Some(gap) = series.gaps.iter().find(|g| g.to_s > first) {
            end = start + 1 + series.time_s[start + 1..end].partition_point(|&t| t < gap.to_s);
        }
        Some((std::mem::replace(&mut start, end), end))
    })
}

fn block(series: &Series, start: usize, end: usize) -> Block {
    let times = &series.time_s[start..end];
    let first = nanoseconds(times[0]);
    let steps = (times.len() - 1).max(1) as f64;
    let period_ns = (nanoseconds(times[times.len() - 1]) - first) as f64 / steps;
    let regular = times.iter().enumerate().all(|(i, &t)| to_s(first + offset_ns(i, period_ns)) == t);
    Block {
        period_ns: Some(period_ns),
        values: series.value[start..end].to_vec(),
        times_s: if regular { Vec::new() } else { times.to_vec() },
    }
}

/// Whole nanoseconds of a time that [`check`] has seen.
fn nanoseconds(time_s: f64) -> i64 {
    to_ns(time_s).unwrap_or_default()
}

fn mean_rate_hz(series: &Series) -> f64 {
    match (series.time_s.first(), series.time_s.last()) {
        (Some(first), Some(last)) if last > first => (series.time_s.len() - 1) as f64 / (last - first),
        _ => 0.0,
    }
}

/// The log time of recording time 0: the start of the run where it is known, else 0, or as many whole seconds as
/// the times before 0 need.
fn time_zero_ns(recording: &Recording) -> u64 {
    if recording.run.start_unix_ns > 0 {
        return recording.run.start_unix_ns;
    }
    let series = recording.series.iter();
    let earliest = series.flat_map(|s| s.time_s.iter().take(1).copied().chain(s.gaps.iter().map(|g| g.to_s)));
    let earliest = earliest.fold(0.0, f64::min);
    (-earliest).ceil() as u64 * 1_000_000_000
}

fn check(recording: &Recording) -> Result<(), String> {
    let (sensors, series) = (recording.rig.sensors.len(), recording.series.len());
    if sensors != series {
        return Err(format!("{series} series for the {sensors} sensors of the rig"));
    }
    for (sensor, series) in recording.rig.sensors.iter().zip(&recording.series) {
        let name = &sensor.name;
        if series.time_s.len() != series.value.len() {
            return Err(format!("'{name}' has {} times for {} values", series.time_s.len(), series.value.len()));
        }
        if let Some(i) = series.value.iter().position(|v| !v.is_finite()) {
            return Err(format!("'{name}' has {} at {} s", series.value[i], series.time_s[i]));
        }
        if let Some(pair) = series.time_s.windows(2).find(|t| t[0].partial_cmp(&t[1]) != Some(std::cmp::Ordering::Less))
        {
            return Err(format!("times of '{name}' do not increase: {} s, then {} s", pair[0], pair[1]));
        }
        let gap_ends = series.gaps.iter().flat_map(|g| [g.from_s, g.to_s]);
        if let Some(time) =
            series.time_s.iter().copied().chain(gap_ends).find(|t| !t.is_finite() || to_ns(*t).is_none())
        {
            return Err(format!("'{name}' has a time of {time} s; a log holds ±290 years"));
        }
    }
    Ok(())
}
