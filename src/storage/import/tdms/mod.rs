//! NI TDMS, as "TDMS File Format Internal Structure" (NI, document 5696) describes it: segments of metadata and raw data,
//! contiguous or interleaved, little or big endian, cut off or whole. DAQmx raw data, which only NI's driver can scale, is refused.
//!
//! No published crate reads big-endian files, repeated metadata and scaled channels, and the format is small.

pub(crate) mod bytes;
pub(crate) mod channel;
pub(crate) mod property;
pub(crate) mod scale;
pub(crate) mod segment;

use std::collections::BTreeMap;

use crate::storage::import::tdms::channel::{Channel, Timing, Values};
use crate::storage::import::tdms::property::{Properties, Property};
use crate::storage::import::tdms::scale::scaling;
use crate::storage::import::tdms::segment::{Reader, names as names_of};

use crate::recording::{Gap, Series};
use crate::storage::import::csv::heading::time_unit;
use crate::storage::import::gaps::gaps;
use crate::storage::import::source::{Repair, SourceFile, Start, Track, counted};
use crate::storage::layout::{to_ns, to_s};

/// Reads a file. `Err` says what is wrong and what to do.
pub(crate) fn read(bytes: &[u8]) -> Result<SourceFile, String> {
    let mut reader = Reader::default();
    let incomplete = reader.read(bytes)?;
    let mut repairs = Vec::new();
    if incomplete {
        let text = "the file was not closed: the last segment is cut off; its complete part was read";
        repairs.push(Repair { lost: true, ..Repair::new("cut-off", 1, None, text) });
    }
    let mut notes = Vec::new();
    for (path, properties) in reader.properties.iter().filter(|(path, _)| names_of(path).len() < 2) {
        notes.extend(properties.iter().filter_map(|(key, value)| match value {
            Property::Text(text) if !key.starts_with("NI_") && !text.is_empty() => {
                let whose = names_of(path).join("/");
                Some((if whose.is_empty() { key.clone() } else { format!("{whose}: {key}") }, text.clone()))
            }
            _ => None,
        }));
    }
    let properties = reader.properties;
    let channels = reader.channels;
    let mut timed = Vec::new();
    for channel in &channels {
        if let Some(track) = timed_track(channel, &channels, &properties)? {
            timed.push(track);
        }
    }
    if timed.is_empty() {
        return Err(
            "it holds no channel of numbers with times: neither wf_increment nor a time channel in the same group"
                .into(),
        );
    }
    let start_ns = timed.iter().filter_map(|timed| timed.start_ns).filter(|ns| *ns > 0).min();
    let mut tracks = Vec::new();
    for Timed { mut track, start_ns: own_ns, holes_s } in timed {
        let late_s = own_ns.zip(start_ns).map_or(0.0, |(own, first)| to_s(own.saturating_sub(first)));
        // years after the first channel, steps of microseconds vanish
        let late = track.series.time_s.iter().map(|t| t + late_s).collect();
        track.series = in_order(&track.name, late, track.series.value, &mut track.repairs)?;
        let stands = |t: f64| track.series.time_s.partition_point(|s| *s <= t);
        let holes = holes_s.iter().filter_map(|t| stands(t + late_s).checked_sub(1));
        let holes: Vec<Gap> = holes
            .filter_map(|i| {
                Some(Gap { from_s: track.series.time_s[i], to_s: *track.series.time_s.get(i + 1)?, samples: None })
            })
            .collect();
        if !holes.is_empty() {
            let text = format!(
                "{} was recorded in several stretches, by its wf_start_time: gaps stand between them",
                track.name
            );
            track.repairs.push(Repair::new("stretches", holes.len(), None, text));
        }
        track.series.gaps.extend(holes);
        track.series.gaps.sort_by(|a, b| a.from_s.total_cmp(&b.from_s));
        tracks.push(track);
    }
    let start = start_ns.and_then(|ns| u64::try_from(ns).ok()).map(|unix_ns| Start { unix_ns, digit_s: 1e-6 });
    Ok(SourceFile { tracks, start, notes, repairs, spare_tracks: true, ..SourceFile::default() })
}

/// A channel of numbers with its times, s from its own start.
struct Timed {
    track: Track,
    /// Nanoseconds since 1970 UTC.
    start_ns: Option<i64>,
    /// The last time before each hole between its stretches, s from its start.
    holes_s: Vec<f64>,
}

/// Such a channel; `None` where it is none.
fn timed_track(
    channel: &Channel,
    all: &[Channel],
    properties: &BTreeMap<String, Properties>,
) -> Result<Option<Timed>, String> {
    let Values::Numbers(raw) = &channel.values else { return Ok(None) };
    let names = names_of(&channel.path);
    let (Some(group), Some(short)) = (names.first(), names.get(1)) else { return Ok(None) };
    let own = properties.get(&channel.path);
    let property = |key: &str| own.and_then(|p| p.get(key));
    let timing = own.map(Timing::of);
    let (time_s, start_ns, holes_s) = match timing.filter(|timing| timing.increment_s.is_some()) {
        Some(last) => evenly(channel, last, raw.len())?,
        None => {
            let beside = |c: &&Channel| {
                let names = names_of(&c.path);
                names.first() == Some(group) && c.path != channel.path && c.values.len() == raw.len()
            };
            match all.iter().filter(beside).find_map(|c| times(c, &names_of(&c.path), properties)) {
                Some((times, first)) => (times, first, Vec::new()),
                None => return Ok(None),
            }
        }
    };
    if is_time_name(short).is_some() && timing.is_none_or(|timing| timing.increment_s.is_none()) {
        return Ok(None);
    }
    let chain = [channel.path.clone(), format!("/'{}'", group.replace('\'', "''")), "/".into()];
    let scaled = chain.iter().filter_map(|path| properties.get(path)).find_map(|p| scaling(p).transpose());
    let values = match scaled.transpose().map_err(|why| format!("channel {}: {why}", channel.path))? {
        Some(scaling) => scaling.apply(raw),
        None => raw.clone(),
    };
    let unit = ["unit_string", "NI_UnitDescription", "Unit", "unit"].into_iter().find_map(|key| match property(key) {
        Some(Property::Text(text)) if !text.trim().is_empty() => Some(text.trim().to_string()),
        _ => None,
    });
    let series = Series { time_s, value: values, gaps: Vec::new() };
    let track =
        Track { name: channel.path.clone(), short: short.clone(), unit, series, repairs: Vec::new(), shares: None };
    Ok(Some(Timed { track, start_ns, holes_s }))
}

/// Times of a channel, s from its own start, that start, and the last time before each hole between its stretches.
type Times = (Vec<f64>, Option<i64>, Vec<f64>);

/// Those of a channel of even steps.
fn evenly(channel: &Channel, last: Timing, count: usize) -> Result<Times, String> {
    // properties behind the last value, or twice between two values, begin no stretch
    let mut stretches: Vec<(usize, Timing)> = channel.earlier.iter().copied().filter(|(to, _)| *to < count).collect();
    stretches.dedup_by_key(|(to, _)| *to);
    stretches.push((count, last));
    let start_ns = stretches[0].1.start_ns;
    let (mut time_s, mut holes_s) = (Vec::with_capacity(count), Vec::new());
    for (index, (to, timing)) in stretches.into_iter().enumerate() {
        let from = time_s.len();
        let step_s = timing.increment_s.filter(|_| index == 0 || (timing.start_ns.is_some() && start_ns.is_some()));
        let step_s = step_s.ok_or_else(|| {
            format!(
                "channel {}: its wf_increment changes at value {from}, and no wf_start_time gives the time of that value",
                channel.path
            )
        })?;
        let late_s = timing.start_ns.zip(start_ns).map_or(0.0, |(own, first)| to_s(own.saturating_sub(first)));
        let begins_s = late_s + timing.offset_s;
        holes_s.extend(time_s.last().copied().filter(|before| begins_s - before > 1.5 * step_s));
        time_s.extend((0..to.saturating_sub(from)).map(|i| begins_s + i as f64 * step_s));
    }
    Ok((time_s, start_ns, holes_s))
}

/// The times that a channel beside gives: timestamps, or numbers under a name such as `time_s` or `Time`.
fn times(
    channel: &Channel,
    names: &[String],
    properties: &BTreeMap<String, Properties>,
) -> Option<(Vec<f64>, Option<i64>)> {
    match &channel.values {
        Values::Times(ns) => {
            let first = *ns.first()?;
            Some((ns.iter().map(|t| to_s(t.saturating_sub(first))).collect(), Some(first)))
        }
        Values::Numbers(values) => {
            let unit_s = is_time_name(names.get(1)?)?;
            let said = properties.get(&channel.path).and_then(|p| p.get("unit_string"));
            let unit_s = match said {
                Some(Property::Text(unit)) => time_unit(unit).unwrap_or(unit_s),
                _ => unit_s,
            };
            Some((values.iter().map(|t| t * unit_s).collect(), None))
        }
        Values::Other(_) => None,
    }
}

/// Seconds of the unit of a channel of times, by its name.
fn is_time_name(name: &str) -> Option<f64> {
    match name.to_lowercase().as_str() {
        "time" | "time_s" | "time (s)" | "time [s]" | "t" | "zeit" => Some(1.0),
        "time_ms" | "time (ms)" | "time [ms]" => Some(1e-3),
        "time_us" | "time (us)" | "time [us]" => Some(1e-6),
        _ => None,
    }
}

/// The samples that are numbers, with reported gaps for those that are not; times must increase.
fn in_order(path: &str, time_s: Vec<f64>, value: Vec<f64>, repairs: &mut Vec<Repair>) -> Result<Series, String> {
    let all = time_s.len();
    let timed = |(t, _): &(f64, f64)| to_ns(*t).is_some();
    let timed: Vec<(f64, f64)> = time_s.into_iter().zip(value).filter(timed).collect();
    if timed.len() < all {
        let text = counted(all - timed.len(), "value", "values") + &format!(" of {path} without a time left out");
        repairs.push(Repair { lost: true, ..Repair::new("no-time", all - timed.len(), None, text) });
    }
    if let Some(w) = timed.windows(2).find(|w| w[1].0 <= w[0].0) {
        return Err(format!("channel {path}: its times do not increase: {} s, then {} s", w[0].0, w[1].0));
    }
    let (numbers, others): (Vec<_>, Vec<_>) = timed.into_iter().partition(|(_, v)| v.is_finite());
    let (time_s, value): (Vec<f64>, Vec<f64>) = numbers.into_iter().unzip();
    let missing_s: Vec<f64> = others.iter().map(|(t, _)| *t).collect();
    if !missing_s.is_empty() {
        let text =
            counted(missing_s.len(), "value", "values") + &format!(" of {path} are no numbers: recorded as gaps");
        repairs.push(Repair { lost: true, ..Repair::new("no-number", missing_s.len(), None, text) });
    }
    let gaps = gaps(&time_s, &missing_s);
    Ok(Series { time_s, value, gaps })
}
