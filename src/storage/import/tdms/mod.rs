//! NI TDMS, as "TDMS File Format Internal Structure" (NI, document 5696) describes it: segments of metadata and raw
//! data, contiguous or interleaved, little or big endian, cut off or whole. DAQmx raw data, which only NI's driver can
//! scale, is refused.
//!
//! No published crate reads big-endian files, repeated metadata and scaled channels, and the format is small.

pub(crate) mod bytes;
pub(crate) mod channel;
pub(crate) mod property;
pub(crate) mod scale;
pub(crate) mod segment;
pub(crate) mod times;

use std::collections::BTreeMap;

use crate::storage::import::csv::heading::key_of;
use crate::storage::import::csv::scaled::{changes, property_is_absolute};
use crate::storage::import::kinds::pressure_unit;
use crate::storage::import::tdms::channel::{Channel, Values};
use crate::storage::import::tdms::property::{Properties, Property};
use crate::storage::import::tdms::scale::scaling;
use crate::storage::import::tdms::segment::{Reader, names as names_of};
use crate::storage::import::tdms::times::{Times, is_times, times_of};

use crate::recording::{Gap, Series};
use crate::storage::import::gaps::gaps;
use crate::storage::import::source::{Repair, SourceFile, SourceOptions, Start, Track, counted};
use crate::storage::layout::{to_ns, to_s};
use crate::storage::nearest::listed;

/// Reads a file. `Err` says what is wrong and what to do.
pub(crate) fn read(bytes: &[u8], options: &SourceOptions) -> Result<SourceFile, String> {
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
    let (mut timed, mut left_out) = (Vec::new(), Vec::new());
    for channel in &channels {
        match found(channel, &channels, &properties, options)? {
            Found::Track(track) => timed.push(*track),
            Found::LeftOut(why) => left_out.push((channel.path.clone(), why)),
            Found::Times => {}
        }
    }
    if timed.is_empty() {
        return Err(
            "it holds no channel of numbers with times: neither wf_increment nor a time channel in the same group; if there is one sample \
             after the other, give their rate with option `rate`"
                .into(),
        );
    }
    repairs.extend(not_read(&left_out, options));
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
    let short = |path: &String| names_of(path).pop().unwrap_or_default();
    let others = left_out.into_iter().flat_map(|(path, _)| [short(&path), path]).collect();
    Ok(SourceFile { tracks, start, notes, repairs, spare_tracks: true, others })
}

/// A channel of numbers with its times, s from its own start.
struct Timed {
    track: Track,
    /// Nanoseconds since 1970 UTC.
    start_ns: Option<i64>,
    /// The last time before each hole between its stretches, s from its start.
    holes_s: Vec<f64>,
}

/// What a channel is.
enum Found {
    Track(Box<Timed>),
    /// The times of others.
    Times,
    /// Neither, and why.
    LeftOut(String),
}

fn found(
    channel: &Channel,
    all: &[Channel],
    properties: &BTreeMap<String, Properties>,
    options: &SourceOptions,
) -> Result<Found, String> {
    let raw = match &channel.values {
        Values::Numbers(raw) => raw,
        Values::Times(_) => return Ok(Found::Times),
        Values::Other(count) => return Ok(Found::LeftOut(format!("{count} texts"))),
    };
    let names = names_of(&channel.path);
    let (Some(group), Some(short)) = (names.first(), names.get(1)) else { return Ok(Found::Times) };
    let property = |key: &str| properties.get(&channel.path).and_then(|p| p.get(key));
    let chain = [channel.path.clone(), format!("/'{}'", group.replace('\'', "''")), "/".into()];
    let chain: Vec<&Properties> = chain.iter().filter_map(|path| properties.get(path)).collect();
    let mut repairs = Vec::new();
    if is_times(channel, properties) {
        return Ok(Found::Times);
    }
    let Some(Times { time_s, start_ns, holes_s }) = times_of(channel, all, properties, &chain, options, &mut repairs)?
    else {
        let single = raw.len() < 2;
        return Ok(if single { Found::Times } else { Found::LeftOut(format!("{} numbers without times", raw.len())) });
    };
    let scaled = chain.iter().find_map(|p| scaling(p).transpose());
    let values = match scaled.transpose().map_err(|why| format!("channel {}: {why}", channel.path))? {
        Some(scaling) => scaling.apply(raw),
        None => raw.clone(),
    };
    let unit = ["unit_string", "NI_UnitDescription", "Unit", "unit"].into_iter().find_map(|key| match property(key) {
        Some(Property::Text(text)) if !text.trim().is_empty() => Some(text.trim().to_string()),
        _ => None,
    });
    let unit = stated(unit, &chain);
    let series = Series { time_s, value: values, gaps: Vec::new() };
    let track =
        Track { name: channel.path.clone(), short: short.clone(), unit, series, repairs, shares: None, place: None };
    Ok(Found::Track(Box::new(Timed { track, start_ns, holes_s })))
}

/// A unit with what other properties say of it: a factor or a zero, which make an unknown one of it, or that it counts
/// from the vacuum.
fn stated(unit: Option<String>, chain: &[&Properties]) -> Option<String> {
    let shown = |property: &Property| match property {
        Property::Text(text) => text.clone(),
        Property::Number(number) => number.to_string(),
        Property::Time(_) => String::new(),
    };
    let all = || chain.iter().flat_map(|properties| properties.iter()).filter(|(name, _)| !name.starts_with("NI_"));
    if let Some((name, value)) = all().find(|(name, value)| changes(&key_of(name), &shown(value))) {
        return Some(format!("{name} {} {}", shown(value), unit.unwrap_or_default()).trim_end().to_owned());
    }
    let is_vacuum = all().any(|(name, value)| property_is_absolute(name, &shown(value)));
    let is_gauge = |unit: &String| pressure_unit("", unit).is_some_and(|(_, absolute)| !absolute);
    unit.map(|unit| if is_vacuum && is_gauge(&unit) { format!("{unit} abs") } else { unit })
}

/// What is left out is lost where it is a series of numbers.
fn not_read(left_out: &[(String, String)], options: &SourceOptions) -> Option<Repair> {
    let is_ignored = |path: &String| {
        let short = names_of(path).pop().unwrap_or_default();
        options.ignore.iter().any(|name| name == path || *name == short || name == "*")
    };
    let named = left_out.iter().filter(|(path, _)| !is_ignored(path));
    let named: Vec<String> = named.map(|(path, why)| format!("{path} ({why})")).collect();
    let lost = left_out.iter().any(|(path, why)| !is_ignored(path) && why.contains("numbers"));
    let hint = if lost { "; give their rate with option `rate`, or leave them out with option `ignore`" } else { "" };
    let text = format!("not read: {}{hint}", listed(&named));
    (!named.is_empty()).then(|| Repair { lost, ..Repair::new("not-read", named.len(), None, text) })
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
