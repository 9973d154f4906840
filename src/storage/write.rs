//! A whole recording becomes a finished file.

use std::io::{BufWriter, Write as _};
use std::path::Path;

use crate::recording::{Recording, Series};
use crate::storage::disk;
use crate::storage::error::LogError;
use crate::storage::layout::{BLOCK_ABOVE_HZ, offset_ns, to_ns, to_s};
use crate::storage::schema::{Block, Kind};
use crate::storage::sink;
use crate::storage::sink::Sink;

/// Writes a recording as a finished file: indexed, zstd-compressed, with CRCs. Its samples, gaps, notes and rig text
/// come back from [`read`](crate::storage::read) bit by bit.
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

/// Puts the bytes of a recording at a path where nothing stands.
///
/// # Errors
/// As [`write`].
pub fn keep(path: &Path, recording: &[u8]) -> Result<(), LogError> {
    disk::refuse_existing(path)?;
    let temporary = disk::temporary_beside(path)?;
    temporary.as_file().write_all(recording).map_err(|e| LogError::io("write", path, e))?;
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
pub(crate) const BLOCK_SAMPLES: usize = 2000;

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

/// Samples of a series, up to but without `end`, as a block.
pub(crate) fn block(series: &Series, start: usize, end: usize) -> Block {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::{Gap, RunInfo};
    use crate::storage::fixtures::{assert_same, place, recording, rig};
    use crate::storage::read;
    use proptest::prelude::*;

    fn through_a_file(recording: &Recording) -> Recording {
        let (_folder, path) = place("run.mcap");
        write(&path, recording).unwrap();
        read(&path).unwrap()
    }

    fn of_first_sensor(time_s: Vec<f64>, value: Vec<f64>, gaps: Vec<Gap>) -> Recording {
        let mut series = vec![Series::default(); 4];
        series[0] = Series { time_s, value, gaps };
        Recording { rig: rig(), series, run: RunInfo { program: "test".into(), ..RunInfo::default() } }
    }

    #[test]
    fn a_recording_comes_back_as_it_was() {
        assert_same(&through_a_file(&recording()), &recording());
    }

    #[test]
    fn the_same_recording_gives_the_same_bytes() {
        let bytes = || {
            let (_folder, path) = place("run.mcap");
            write(&path, &recording()).unwrap();
            std::fs::read(path).unwrap()
        };
        assert_eq!(bytes(), bytes());
    }

    #[test]
    fn a_fast_sensor_goes_in_blocks_and_comes_back_as_it_was() {
        // 48 kHz from before time 0, with a gap and a stretch of unsteady clock.
        let mut time_s: Vec<f64> = (-1000..9000).map(|i| f64::from(i) / 48_000.0).collect();
        time_s.drain(5000..5100);
        time_s[7000] += 3e-6;
        let gap = Gap { from_s: time_s[4999], to_s: time_s[5000], samples: Some(100) };
        let value = (0..time_s.len()).map(|i| (i as f64).sqrt()).collect();
        let recording = of_first_sensor(time_s, value, vec![gap]);
        assert!(blocks_of(&recording.series[0]).any(|(_, end)| end == 5000), "no block runs across the gap");
        let (_folder, path) = place("run.mcap");
        write(&path, &recording).unwrap();
        assert_same(&read(&path).unwrap(), &recording);
        let bytes = std::fs::read(&path).unwrap();
        let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
        let messages = summary.stats.unwrap().message_count;
        assert!(messages < 10, "{messages} messages");
    }

    #[test]
    fn a_file_is_never_overwritten() {
        let (_folder, path) = place("run.mcap");
        std::fs::write(&path, "mine").unwrap();
        assert!(matches!(write(&path, &recording()), Err(LogError::Exists(p)) if p == path));
        assert_eq!(std::fs::read(&path).unwrap(), b"mine");
    }

    #[test]
    fn what_is_no_series_is_refused_and_leaves_no_file() {
        let bad = [
            of_first_sensor(vec![0.0, 0.0], vec![1.0, 1.0], vec![]),
            of_first_sensor(vec![0.0, f64::NAN], vec![1.0, 1.0], vec![]),
            of_first_sensor(vec![0.0, 1.0], vec![1.0, f64::INFINITY], vec![]),
            of_first_sensor(vec![0.0, 1.0], vec![1.0], vec![]),
            of_first_sensor(vec![0.0, 1e11], vec![1.0, 1.0], vec![]),
            Recording { series: vec![], ..recording() },
        ];
        for bad in bad {
            let (folder, path) = place("run.mcap");
            let error = write(&path, &bad).unwrap_err();
            assert!(matches!(error, LogError::BadSamples { .. }), "{error}");
            assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn any_series_comes_back_bit_by_bit(
            mut time_s in prop::collection::vec(-1e4f64..1e4, 0..60),
            scale in prop::sample::select(vec![1.0, 1e-3, 1e-7]),
            values in prop::collection::vec(any::<f64>().prop_filter("finite", |v| v.is_finite()), 60),
            start_unix_ns in prop::sample::select(vec![0u64, 1_700_000_000_123_456_789]),
        ) {
            time_s.iter_mut().for_each(|t| *t *= scale);
            time_s.sort_by(f64::total_cmp);
            time_s.dedup();
            let value = values[..time_s.len()].to_vec();
            let mut recording = of_first_sensor(time_s, value, vec![]);
            recording.run.start_unix_ns = start_unix_ns;
            assert_same(&through_a_file(&recording), &recording);
        }
    }
}
