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
use crate::storage::import::arrays::times::{rest_of_name, rises, seconds, unit_in_name};
use crate::storage::import::csv::heading::time_unit;
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
            Found::Track(track) => timed.push(track),
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
    let others = left_out.into_iter().map(|(path, _)| path).collect();
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
    Track(Timed),
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
    let own = properties.get(&channel.path);
    let property = |key: &str| own.and_then(|p| p.get(key));
    let chain = [channel.path.clone(), format!("/'{}'", group.replace('\'', "''")), "/".into()];
    let timing = own.map(Timing::of);
    let mut repairs = Vec::new();
    let (time_s, start_ns, holes_s) = match timing.filter(|timing| timing.increment_s.is_some()) {
        Some(last) => evenly(channel, last, raw.len())?,
        None if times(channel, &names, properties).is_some() => return Ok(Found::Times),
        None => {
            let beside = |c: &Channel| {
                names_of(&c.path).first() == Some(group) && c.path != channel.path && c.values.len() == raw.len()
            };
            let mut fitting: Vec<(&Channel, (Vec<f64>, Option<i64>))> = (all.iter().filter(|c| beside(c)))
                .filter_map(|c| Some((c, times(c, &names_of(&c.path), properties)?)))
                .collect();
            // in tables the times stand before what belongs to them
            let own_place = all.iter().position(|c| c.path == channel.path);
            let place = |c: &Channel| all.iter().position(|other| other.path == c.path);
            let before = fitting.iter().rposition(|(c, _)| place(c) < own_place).unwrap_or_default();
            let is_choice = fitting.windows(2).any(|pair| pair[0].1 != pair[1].1);
            if is_choice {
                let text = format!("the times of {} are {}", channel.path, fitting[before].0.path);
                repairs.push(Repair::guess("times-of", text));
            }
            let step = (chain.iter().filter_map(|path| properties.get(path)))
                .find_map(stated_step)
                .or_else(|| options.rate_hz.map(|rate_hz| (1.0 / rate_hz, "option `rate`".to_owned())));
            match (fitting.is_empty(), step) {
                (false, _) => {
                    let (times, first) = fitting.swap_remove(before).1;
                    (times, first, Vec::new())
                }
                (true, Some((step_s, by))) => {
                    let text = format!("{} has a sample every {step_s} s, by {by}", channel.path);
                    repairs.push(Repair::new("step", 1, None, text));
                    ((0..raw.len()).map(|i| i as f64 * step_s).collect(), timing.and_then(|t| t.start_ns), Vec::new())
                }
                (true, None) if raw.len() < 2 => return Ok(Found::Times),
                (true, None) => {
                    return Ok(Found::LeftOut(format!("{} numbers without times", raw.len())));
                }
            }
        }
    };
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
    let track = Track { name: channel.path.clone(), short: short.clone(), unit, series, repairs, shares: None };
    Ok(Found::Track(Timed { track, start_ns, holes_s }))
}

/// A step or a rate among properties, such as `Sample Rate`, in s, and where it stands.
fn stated_step(properties: &Properties) -> Option<(f64, String)> {
    properties.iter().find_map(|(key, value)| match value {
        Property::Number(number) => Some((seconds(key, *number, None)?, format!("'{key}'"))),
        _ => None,
    })
}

/// What is left out is lost where it is a series of numbers.
fn not_read(left_out: &[(String, String)], options: &SourceOptions) -> Option<Repair> {
    let is_ignored = |path: &String| options.ignore.iter().any(|name| name == path || name == "*");
    let named = left_out.iter().filter(|(path, _)| !is_ignored(path));
    let named: Vec<String> = named.map(|(path, why)| format!("{path} ({why})")).collect();
    let lost = left_out.iter().any(|(path, why)| !is_ignored(path) && why.contains("numbers"));
    let hint = if lost { "; give their rate with option `rate`, or leave them out with option `ignore`" } else { "" };
    let text = format!("not read: {}{hint}", listed(&named));
    (!named.is_empty()).then(|| Repair { lost, ..Repair::new("not-read", named.len(), None, text) })
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
            let name = names.get(1)?;
            rest_of_name(name).filter(|rest| rest.is_empty() || rises(values))?;
            let said = match properties.get(&channel.path).and_then(|p| p.get("unit_string")) {
                Some(Property::Text(unit)) => time_unit(unit),
                _ => None,
            };
            let unit_s = said.or_else(|| time_unit(unit_in_name(name)?)).unwrap_or(1.0);
            Some((values.iter().map(|t| t * unit_s).collect(), None))
        }
        Values::Other(_) => None,
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
