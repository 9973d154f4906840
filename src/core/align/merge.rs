//! Merges aligned parts into one recording.

use crate::align::clock::{Clock, Part};
use crate::recording::{Gap, Recording, RunInfo, Series};
use crate::robust::median;

/// Puts all parts on the first one's clock and merges them. What several files have of a sensor is joined where one
/// goes on after the other; otherwise the one with most samples stays. Notes state how each part was aligned and what
/// was left out; comments keep their file's name. The second value lists what was left out. Times are whole nanoseconds
/// afterwards.
pub fn merge(parts: Vec<Part>, clocks: &[Clock]) -> Option<(Recording, Vec<String>)> {
    let rig = parts.first()?.recording.rig.clone();
    let mut left_out = Vec::new();
    let mut series = vec![Series::default(); rig.sensors.len()];
    for (sensor, place) in series.iter_mut().enumerate() {
        let count = |part: &Part| part.recording.series.get(sensor).map_or(0, |s| s.time_s.len());
        let mut pieces: Vec<(usize, Series)> = (0..parts.len())
            .filter(|&i| count(&parts[i]) > 0)
            .map(|i| (i, on_clock(&parts[i].recording.series[sensor], &clocks[i])))
            .collect();
        pieces.sort_by(|a, b| a.1.time_s[0].total_cmp(&b.1.time_s[0]));
        let again: Option<Vec<usize>> = pieces.windows(2).map(|w| repeated(&w[0].1, &w[1].1)).collect();
        if let Some(again) = again {
            for (n, w) in again.iter().zip(pieces.windows(2)).filter(|(n, _)| **n > 0) {
                let (name, [before, file]) = (&rig.sensors[sensor].name, [&w[0], &w[1]].map(|(i, _)| &parts[*i].file));
                let samples = if *n == 1 { "sample" } else { "samples" };
                left_out.push(format!("{file} begins with the last {n} {samples} of '{name}' in {before}: kept once"));
            }
            *place = pieces.into_iter().map(|(_, series)| series).reduce(joined).unwrap_or_default();
            continue;
        }
        // of a trigger that several recorded one is enough
        let most = pieces.iter().map(|(i, _)| count(&parts[*i])).max().unwrap_or(0);
        let Some(best) = (0..parts.len()).find(|&i| count(&parts[i]) == most) else { continue };
        for (i, part) in parts.iter().enumerate().filter(|(i, p)| *i != best && count(p) > 0) {
            let name = &rig.sensors[sensor].name;
            left_out.push(format!(
                "'{name}' of {} ({} samples) is left out: {} has more",
                parts[i].file,
                count(part),
                parts[best].file
            ));
        }
        *place = on_clock(&parts[best].recording.series[sensor], &clocks[best]);
    }
    let mut notes = Vec::new();
    for (part, clock) in parts.iter().zip(clocks) {
        notes.extend(
            part.recording.run.notes.iter().map(|(key, text)| (format!("{key} ({})", part.file), text.clone())),
        );
        if parts.len() > 1 && clock.events > 0 {
            notes.push(("alignment".into(), clock.to_string()));
        }
    }
    notes.extend(left_out.iter().map(|text| ("alignment".into(), text.clone())));
    // the first known start holds for all
    let start = parts.iter().zip(clocks).find_map(|(part, clock)| {
        let ns = part.recording.run.start_unix_ns;
        let own = i128::from(ns) - (clock.offset_s * 1e9).round() as i128;
        (ns > 0).then(|| u64::try_from(own).ok()).flatten()
    });
    let names: Vec<&str> = parts.iter().map(|p| p.file.as_str()).collect();
    let first = &parts.first()?.recording.run;
    let run = RunInfo {
        start_unix_ns: start.unwrap_or_default(),
        source: format!("import {}", names.join(", ")),
        program: first.program.clone(),
        notes,
        csv: None,
    };
    Some((Recording { rig, series, run }, left_out))
}

/// Times that differ by less than this share of a step are one time.
const SAME_TIME: f64 = 1e-3;

/// How many samples at the beginning of the later series are those at the end of the first, time by time and value by
/// value; `None` where the series overlap otherwise.
pub(crate) fn repeated(first: &Series, then: &Series) -> Option<usize> {
    let (Some(&end_s), Some(&begin_s)) = (first.time_s.last(), then.time_s.first()) else { return Some(0) };
    let step_s = median(&mut then.time_s.windows(2).map(|w| w[1] - w[0]).collect::<Vec<f64>>());
    let near_s = SAME_TIME * step_s;
    if end_s < begin_s - near_s {
        return Some(0);
    }
    let count = then.time_s.partition_point(|t| *t <= end_s + near_s);
    let from = first.time_s.len().checked_sub(count)?;
    let is_same = (0..count)
        .all(|i| (first.time_s[from + i] - then.time_s[i]).abs() <= near_s && first.value[from + i] == then.value[i]);
    is_same.then_some(count)
}

/// One series after the other, what both hold once, with a gap where there is more than a step between them.
fn joined(mut first: Series, mut then: Series) -> Series {
    let again = repeated(&first, &then).unwrap_or(0);
    then.time_s.drain(..again);
    then.value.drain(..again);
    then.gaps.retain(|gap| first.time_s.last().is_none_or(|end_s| gap.to_s > *end_s));
    if let (Some(&from_s), Some(&to_s)) = (first.time_s.last(), then.time_s.first()) {
        let steps = first.time_s.windows(2).chain(then.time_s.windows(2)).map(|w| w[1] - w[0]);
        let step_s = median(&mut steps.collect::<Vec<f64>>());
        let missing = ((to_s - from_s) / step_s).round() - 1.0;
        if missing >= 1.0 {
            first.gaps.push(Gap { from_s, to_s, samples: Some(missing as u64) });
        }
    }
    first.time_s.extend(then.time_s);
    first.value.extend(then.value);
    first.gaps.extend(then.gaps);
    first
}

pub(crate) fn on_clock(series: &Series, clock: &Clock) -> Series {
    if clock.offset_s == 0.0 && clock.drift_ppm.is_none() {
        return series.clone();
    }
    // whole nanoseconds are far below any uncertainty and take an eighth of the space in a log
    let offset_ns = (clock.offset_s * 1e9).round();
    let drift = clock.drift_ppm.unwrap_or(0.0) * 1e-6;
    let moved = |t: f64| ((t * 1e9).round() + offset_ns + (t * drift * 1e9).round()) / 1e9;
    let mut moved_series = Series {
        time_s: series.time_s.iter().map(|t| moved(*t)).collect(),
        value: series.value.clone(),
        gaps: series.gaps.iter().map(|g| Gap { from_s: moved(g.from_s), to_s: moved(g.to_s), ..*g }).collect(),
    };
    if moved_series.time_s.windows(2).any(|w| w[1] <= w[0]) {
        // samples were less than a nanosecond apart
        moved_series.time_s = series.time_s.iter().map(|t| clock.time_s(*t)).collect();
    }
    moved_series
}
