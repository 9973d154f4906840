//! NI TDMS, as "TDMS File Format Internal Structure" (NI, document 5696) describes it: segments of metadata and raw data,
//! contiguous or interleaved, little or big endian, cut off or whole. DAQmx raw data, which only NI's driver can scale, is refused.
//!
//! No published crate reads big-endian files, repeated metadata and scaled channels, and the format is small.

mod bytes;
mod channel;
mod scale;
mod segment;

use std::collections::BTreeMap;

use channel::{Channel, Values};
use segment::Reader;

use super::{Foreign, Mended, Start, Track};
use crate::log::layout::to_s;
use crate::recording::Series;

/// A property of an object.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Property {
    Text(String),
    Number(f64),
    /// Nanoseconds since 1970 UTC.
    Time(i64),
}

type Properties = BTreeMap<String, Property>;

/// Reads a file. `Err` says what is wrong and what to do.
pub(super) fn read(bytes: &[u8]) -> Result<Foreign, String> {
    let mut reader = Reader::default();
    let incomplete = reader.read(bytes)?;
    let mut mended = Vec::new();
    if incomplete {
        let text = "the file was not closed: the last segment is cut off, and what is whole in it was read";
        mended.push(Mended { lost: true, ..Mended::new("cut-off", 1, None, text) });
    }
    let mut notes = Vec::new();
    for (path, properties) in reader.properties.iter().filter(|(path, _)| segment::names(path).len() < 2) {
        notes.extend(properties.iter().filter_map(|(key, value)| match value {
            Property::Text(text) if !key.starts_with("NI_") && !text.is_empty() => {
                let whose = segment::names(path).join("/");
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
            "it holds no channel of numbers that has times: neither wf_increment nor a channel of times beside it"
                .into(),
        );
    }
    let start_ns = timed.iter().filter_map(|(_, start)| *start).filter(|ns| *ns > 0).min();
    let mut tracks = Vec::new();
    for (mut track, start) in timed {
        if let (Some(own), Some(first)) = (start, start_ns) {
            let late_s = to_s(own.saturating_sub(first));
            let Series { time_s, value, .. } = track.series;
            let late: Vec<f64> = time_s.iter().map(|t| t + late_s).collect();
            // years after the first channel, steps of microseconds vanish
            let (time_s, value) = in_order(&track.name, late, value)?;
            track.series = Series { time_s, value, gaps: Vec::new() };
        }
        tracks.push(track);
    }
    let start = start_ns.and_then(|ns| u64::try_from(ns).ok()).map(|unix_ns| Start { unix_ns, digit_s: 1e-6 });
    Ok(Foreign { tracks, start, notes, mended, spare_tracks: true })
}

/// A channel of numbers with its times, s from its own start, and that start; `None` where it is no such channel.
fn timed_track(
    channel: &Channel,
    all: &[Channel],
    properties: &BTreeMap<String, Properties>,
) -> Result<Option<(Track, Option<i64>)>, String> {
    let Values::Numbers(raw) = &channel.values else { return Ok(None) };
    let names = segment::names(&channel.path);
    let (Some(group), Some(short)) = (names.first(), names.get(1)) else { return Ok(None) };
    let own = properties.get(&channel.path);
    let property = |key: &str| own.and_then(|p| p.get(key));
    let number = |key: &str| match property(key) {
        Some(Property::Number(n)) if n.is_finite() => Some(*n),
        _ => None,
    };
    let mut start = None;
    let time_s: Vec<f64> = match number("wf_increment").filter(|dt| *dt > 0.0) {
        Some(dt) => {
            if let Some(Property::Time(ns)) = property("wf_start_time") {
                start = Some(*ns);
            }
            let offset = number("wf_start_offset").unwrap_or(0.0);
            (0..raw.len()).map(|i| offset + i as f64 * dt).collect()
        }
        None => {
            let beside = |c: &&Channel| {
                let names = segment::names(&c.path);
                names.first() == Some(group) && c.path != channel.path && c.values.len() == raw.len()
            };
            match all.iter().filter(beside).find_map(|c| times(c, &segment::names(&c.path), properties)) {
                Some((times, first)) => {
                    start = first;
                    times
                }
                None => return Ok(None),
            }
        }
    };
    if is_time_name(short).is_some() && number("wf_increment").is_none() {
        return Ok(None);
    }
    let chain = [channel.path.clone(), format!("/'{}'", group.replace('\'', "''")), "/".into()];
    let scaled = chain.iter().filter_map(|path| properties.get(path)).find_map(|p| scale::scaling(p).transpose());
    let values = match scaled.transpose().map_err(|why| format!("channel {}: {why}", channel.path))? {
        Some(scaling) => scaling.apply(raw),
        None => raw.clone(),
    };
    let (time_s, value) = in_order(&channel.path, time_s, values)?;
    let unit = ["unit_string", "NI_UnitDescription", "Unit", "unit"].into_iter().find_map(|key| match property(key) {
        Some(Property::Text(text)) if !text.trim().is_empty() => Some(text.trim().to_string()),
        _ => None,
    });
    let series = Series { time_s, value, gaps: Vec::new() };
    Ok(Some((Track { name: channel.path.clone(), short: short.clone(), unit, series }, start)))
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
                Some(Property::Text(unit)) => super::csv::time_unit(unit).unwrap_or(unit_s),
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

/// Leaves out samples that are no numbers; times must increase.
fn in_order(path: &str, time_s: Vec<f64>, value: Vec<f64>) -> Result<(Vec<f64>, Vec<f64>), String> {
    let fine = |(t, v): &(f64, f64)| v.is_finite() && crate::log::layout::to_ns(*t).is_some();
    let (time_s, value): (Vec<f64>, Vec<f64>) = time_s.into_iter().zip(value).filter(fine).unzip();
    match time_s.windows(2).find(|w| w[1] <= w[0]) {
        Some(w) => Err(format!("channel {path}: its times do not increase: {} s, then {} s", w[0], w[1])),
        None => Ok((time_s, value)),
    }
}
