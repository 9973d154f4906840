//! A recording, or an imported CSV, played as if it were live: its samples and gaps, at their own times, at a chosen
//! pace.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::record::clock::pace::Pace;
use crate::record::error::RecordError;
use crate::record::health::monitor::Expected;
use crate::record::health::snapshot::{Reports, Snapshot};
use crate::record::session::options::Options;
use crate::record::session::output::Summary;
use crate::record::session::recorder::Recorder;
use crate::recording::{Gap, Recording, RunInfo, Series};
use crate::rig::Rig;
use crate::shown::Shown as _;
use crate::storage as log;
use crate::storage::{ImportOptions, import_csv_with};

/// How much recorded time is written at once.
const STEP_NS: i64 = 20_000_000;

/// Reads what is to be played: a recording, or else a CSV, which needs the rig. Where a rig is given it is the one
/// played on, and each sensor that has samples must be one of its sensors, in the same unit. `without` names the
/// sensors that have no column in the CSV.
pub fn load(path: &Path, rig: Option<&Rig>, without: &[String]) -> Result<Recording, RecordError> {
    let csv = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv"));
    let columns = ImportOptions { without: without.to_vec(), ..ImportOptions::default() };
    match rig {
        Some(rig) if csv => import_csv_with(path, rig, &columns).map_err(RecordError::Read),
        Some(rig) => on_rig(log::read(path).map_err(RecordError::Read)?, rig, path),
        None if csv => Err(RecordError::CsvWithoutRig(path.shown().into_owned())),
        None => log::read(path).map_err(RecordError::Read),
    }
}

fn on_rig(recording: Recording, rig: &Rig, path: &Path) -> Result<Recording, RecordError> {
    let other =
        |reason: String| RecordError::OtherRig { recording: path.shown().into_owned(), rig: rig.name.clone(), reason };
    let mut series = vec![Series::default(); rig.sensors.len()];
    for (sensor, played) in recording.rig.sensors.iter().zip(recording.series) {
        if played.time_s.is_empty() && played.gaps.is_empty() {
            continue;
        }
        let place = rig
            .sensors
            .iter()
            .position(|known| known.name == sensor.name)
            .ok_or_else(|| other(format!("it has no sensor '{}'", sensor.name)))?;
        let (Some(known), Some(slot)) = (rig.sensors.get(place), series.get_mut(place)) else { continue };
        if known.unit.symbol != sensor.unit.symbol {
            return Err(other(format!("'{}' is recorded in {}, there in {}", sensor.name, sensor.unit, known.unit)));
        }
        *slot = played;
    }
    // The layout of an imported file counts the columns of the other rig.
    let run = RunInfo { csv: None, ..recording.run };
    Ok(Recording { rig: rig.clone(), series, run })
}

/// Plays `recording` into a new one. `speed` 1 is real time, 0 as fast as possible. Sample times stay as they are.
pub fn replay(
    recording: &Recording,
    name: &str,
    speed: f64,
    options: &Options,
    stop: &AtomicBool,
    on_report: &mut dyn FnMut(Snapshot),
) -> Result<Summary, RecordError> {
    options.check()?;
    let mut tracks: Vec<Track> = recording.series.iter().map(Track::new).collect();
    let first_ns =
        tracks.iter().filter_map(Track::next_ns).min().ok_or_else(|| RecordError::NothingToPlay(name.to_owned()))?;
    let run = RunInfo {
        source: format!("replay of {name}"),
        program: format!("surgescope {}", env!("CARGO_PKG_VERSION")),
        notes: recording.run.notes.iter().chain(&options.notes).cloned().collect(),
        ..recording.run.clone()
    };
    let listed = |sensor: usize| recording.series.get(sensor).is_some_and(|series| !series.time_s.is_empty());
    let played = (0..recording.series.len()).filter(|&sensor| listed(sensor));
    // where the file has no sample there is no device to be looked at
    let expected: Vec<_> = played.map(|sensor| Expected { sensor, device: None, silent_after: None }).collect();
    let mut output = Recorder::create(options, &recording.rig, &run, &expected)?;
    let mut reports = Reports::to(on_report);
    let end_ns = options.end_ns(first_ns);
    let pace = Pace::start(speed);
    let wanted = || !stop.load(Ordering::Relaxed);
    let mut now_ns = first_ns;
    let ended = loop {
        if now_ns >= end_ns {
            break "the duration was reached";
        }
        if output.is_over() {
            break "all shots were recorded";
        }
        if tracks.iter().all(|track| track.next_ns().is_none()) {
            break "everything was played";
        }
        now_ns = now_ns.saturating_add(STEP_NS).min(end_ns);
        if !pace.wait_until(now_ns.saturating_sub(first_ns), wanted) {
            break "stopped by the user";
        }
        for (sensor, track) in tracks.iter_mut().enumerate() {
            track.play_until(now_ns, sensor, &mut output)?;
        }
        output.tick()?;
        reports.when_due(|| output.snapshot());
        if output.refused() {
            break "the disk takes no more";
        }
    };
    output.finish(first_ns, listed, Vec::new(), ended.to_owned())
}

/// One sensor's series and how far it was played.
struct Track<'a> {
    times_ns: Vec<i64>,
    values: &'a [f64],
    gaps: &'a [Gap],
    played: usize,
}

impl<'a> Track<'a> {
    fn new(series: &'a Series) -> Track<'a> {
        let times_ns = series.time_s.iter().map(|s| nanoseconds(*s)).collect();
        Track { times_ns, values: &series.value, gaps: &series.gaps, played: 0 }
    }

    /// Time of what comes next, ns.
    fn next_ns(&self) -> Option<i64> {
        let sample = self.times_ns.get(self.played).copied();
        let gap = self.gaps.first().map(|gap| nanoseconds(gap.from_s));
        sample.into_iter().chain(gap).min()
    }

    fn play_until(&mut self, until_ns: i64, sensor: usize, output: &mut Recorder) -> Result<(), RecordError> {
        while self.next_ns().is_some_and(|next| next < until_ns) {
            // A gap goes behind the sample that it starts at.
            let gap_ns = self.gaps.first().map(|gap| nanoseconds(gap.from_s));
            let limit_ns = gap_ns.map_or(until_ns, |from| until_ns.min(from.saturating_add(1)));
            let rest = self.times_ns.get(self.played..).unwrap_or_default();
            let due = &rest[..rest.partition_point(|&time| time < limit_ns)];
            let (period_ns, length) = even_run(due);
            if let (Some(&first_ns), Some(values)) =
                (due.first(), self.values.get(self.played..self.played + length).filter(|values| !values.is_empty()))
            {
                output.samples(sensor, first_ns, f64::from(period_ns), values)?;
                self.played += length;
            } else if let Some((gap, later)) = self.gaps.split_first() {
                output.gap(sensor, *gap)?;
                self.gaps = later;
            } else {
                break;
            }
        }
        Ok(())
    }
}

/// The longest evenly spaced run that the times begin with: its period, ns, and its length.
fn even_run(times_ns: &[i64]) -> (u32, usize) {
    let step = |pair: &[i64]| u32::try_from(pair[1] - pair[0]).ok();
    let Some(period_ns) = times_ns.windows(2).next().and_then(step) else { return (0, times_ns.len().min(1)) };
    (period_ns, 1 + times_ns.windows(2).take_while(|pair| step(pair) == Some(period_ns)).count())
}

fn nanoseconds(time_s: f64) -> i64 {
    (time_s * 1e9).round() as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_taken_as_long_as_their_spacing_is_even() {
        assert_eq!(even_run(&[]), (0, 0));
        assert_eq!(even_run(&[5]), (0, 1));
        assert_eq!(even_run(&[0, 10, 20, 31]), (10, 3));
        assert_eq!(even_run(&[0, 10_000_000_000, 20_000_000_000]), (0, 1));
    }
}
