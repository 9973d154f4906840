//! MCAP files of other programs: each number of each message is a track, mapped to a sensor by a user. Recordings of
//! our own give the samples of their sensors.

pub(crate) mod fields;

use std::collections::HashMap;
use std::path::Path;

use mcap::records::Record;

use crate::recording::Series;
use crate::storage::error::LogError;
use crate::storage::import::gaps::gaps;
use crate::storage::import::mcap::fields::{Field, Format};
use crate::storage::import::source::{
    MessageTime, Repair, SourceFile, SourceOptions, Start, Track, counted, is_no_order,
};
use crate::storage::layout::{RIG_ATTACHMENT, to_s};
use crate::storage::read::{Unpacked, check_start, checked_options, decode, has_end, records};

/// A channel that can be read, and the fields of it that are wanted.
struct Channel {
    topic: String,
    format: Format,
}

/// Samples of a field, with their times in ns.
#[derive(Default)]
struct Found {
    time_ns: Vec<i64>,
    value: Vec<f64>,
    /// What was true or false instead, as 1 or 0, with its time in ns.
    switches: Vec<(i64, f64)>,
    /// Times of the messages in which it is no number.
    missing_ns: Vec<i64>,
    /// Messages of its topic that do not have it at all.
    absent: usize,
}

/// Reads a file.
pub(crate) fn read(bytes: &[u8], path: &Path, options: &SourceOptions) -> Result<SourceFile, LogError> {
    check_start(bytes, path)?;
    if !has_end(bytes) {
        let why = "it has no end: its recording was cut off, or is still running; the `mcap recover` tool saves what is in it";
        return Err(LogError::SourceFile { path: path.into(), why: why.into() });
    }
    let damaged = |why| LogError::SourceFile { path: path.into(), why: format!("it is damaged: {why}") };
    let mut reading = Reading::new(options);
    let checked = checked_options(bytes.len() as u64).with_check_finishes_after_end_magic(true);
    records(bytes, checked, &mut Unpacked::of(bytes.len() as u64), |record| reading.take(record)).map_err(damaged)?;
    if reading.ours {
        return ours(bytes, path);
    }
    reading.finish().map_err(|why| LogError::SourceFile { path: path.into(), why })
}

/// A recording of our own: its sensors are the tracks.
fn ours(bytes: &[u8], path: &Path) -> Result<SourceFile, LogError> {
    let recording = decode(bytes, path)?;
    let sensors = recording.rig.sensors.iter().zip(recording.series).filter(|(_, s)| !s.time_s.is_empty());
    let tracks = sensors.map(|(sensor, series)| {
        let unit = Some(sensor.unit.symbol.to_string());
        Track {
            name: sensor.name.clone(),
            short: sensor.name.clone(),
            unit,
            series,
            repairs: Vec::new(),
            shares: None,
            place: None,
        }
    });
    let unix_ns = recording.run.start_unix_ns;
    Ok(SourceFile {
        tracks: tracks.collect(),
        start: (unix_ns > 0).then_some(Start { unix_ns, digit_s: 1e-6 }),
        notes: recording.run.notes,
        repairs: Vec::new(),
        spare_tracks: true,
        others: Vec::new(),
    })
}

/// A time above a year is one since 1970; below, the clock counted from its own start, or was not set.
const YEAR_NS: i64 = 31_536_000_000_000_000;

/// The message about times of 2^63 ns and more.
const BEYOND: &str = "have times beyond what a recording holds (2^63 ns, which is the year 2262 where they count from 1970): check the clock of the logger, or \
     use another time with option `message_time publish` or option `time_field`";

struct Reading<'o> {
    options: &'o SourceOptions,
    ours: bool,
    schemas: HashMap<u16, (String, String, Vec<u8>)>,
    channels: HashMap<u16, Option<Channel>>,
    unreadable: Vec<String>,
    order: Vec<String>,
    found: HashMap<String, Found>,
    without_time: usize,
    /// Messages at times that no recording holds.
    beyond: usize,
}

impl<'o> Reading<'o> {
    fn new(options: &'o SourceOptions) -> Reading<'o> {
        Reading {
            options,
            ours: false,
            schemas: HashMap::new(),
            channels: HashMap::new(),
            unreadable: Vec::new(),
            order: Vec::new(),
            found: HashMap::new(),
            without_time: 0,
            beyond: 0,
        }
    }

    fn take(&mut self, record: Record<'_>) -> Result<(), String> {
        match record {
            Record::Attachment { header, .. } if header.name == RIG_ATTACHMENT => self.ours = true,
            Record::Schema { header, data } => {
                self.schemas.insert(header.id, (header.name, header.encoding, data.into_owned()));
            }
            Record::Channel(channel) if !self.channels.contains_key(&channel.id) => {
                let schema =
                    self.schemas.get(&channel.schema_id).map(|(name, encoding, data)| (&**name, &**encoding, &**data));
                let format = Format::of(&channel.message_encoding, schema);
                let readable = match format {
                    Ok(format) => Some(Channel { topic: channel.topic, format }),
                    Err(why) => {
                        self.unreadable.push(format!("{}: {why}", channel.topic));
                        None
                    }
                };
                self.channels.insert(channel.id, readable);
            }
            Record::Message { header, data } if !self.ours => {
                let known = self.channels.get(&header.channel_id);
                let Some(channel) =
                    known.ok_or_else(|| format!("a message of channel {}, which is not there", header.channel_id))?
                else {
                    return Ok(());
                };
                let fields = channel.format.numbers(&data);
                let fields = fields.map_err(|why| {
                    format!("a message of {} at log time {} ns {why}", channel.topic, header.log_time)
                })?;
                let time = match &self.options.message_time {
                    MessageTime::Log => i64::try_from(header.log_time).ok(),
                    MessageTime::Publish => i64::try_from(header.publish_time).ok(),
                    MessageTime::Field(name) => field_ns(&fields, name, self.options.time_unit_s.unwrap_or(1.0)),
                };
                let Some(time_ns) = time else {
                    match &self.options.message_time {
                        MessageTime::Field(_) => self.without_time += 1,
                        MessageTime::Log | MessageTime::Publish => self.beyond += 1,
                    }
                    return Ok(());
                };
                for (wanted, _) in &self.options.map {
                    let field = wanted.strip_prefix(channel.topic.as_str()).and_then(|rest| rest.strip_prefix('.'));
                    if field.is_some_and(|field| fields.iter().all(|found| found.path != field)) {
                        self.found.entry(wanted.clone()).or_default().absent += 1;
                    }
                }
                for Field { path, value, is_switch } in fields {
                    let name = format!("{}.{path}", channel.topic);
                    if !value.is_finite() {
                        self.found.entry(name).or_default().missing_ns.push(time_ns);
                        continue;
                    }
                    // a field that is never a number is none to choose
                    if self.found.get(&name).is_none_or(|f| f.value.is_empty() && f.switches.is_empty()) {
                        self.order.push(name.clone());
                    }
                    let found = self.found.entry(name).or_default();
                    if is_switch {
                        found.switches.push((time_ns, value));
                    } else {
                        found.time_ns.push(time_ns);
                        found.value.push(value);
                    }
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn finish(mut self) -> Result<SourceFile, String> {
        if self.order.is_empty() {
            if let MessageTime::Field(name) = &self.options.message_time
                && self.without_time > 0
            {
                return Err(format!("no message has a number named '{name}' to take its time from"));
            }
            if self.beyond > 0 {
                return Err(format!("all its messages {BEYOND}"));
            }
            let why = match self.unreadable.first() {
                Some(first) => format!("no numbers can be read from it. {first}"),
                None => "it holds no messages with numbers".into(),
            };
            return Err(why);
        }
        self.found.values_mut().for_each(Found::settle);
        let wanted: Vec<&String> =
            self.order.iter().filter(|name| self.options.map.iter().any(|(from, _)| from == *name)).collect();
        let absent = |name: &String| !self.order.contains(name);
        let is_text = |name: &String| self.found.get(name).is_some_and(|found| !found.missing_ns.is_empty());
        if let Some((name, _)) = self.options.map.iter().find(|(from, _)| absent(from) && is_text(from)) {
            return Err(format!("its field '{name}' is never a number. {}", self.say_fields()));
        }
        if wanted.is_empty() {
            return Err(self.say_fields());
        }
        if let Some((missing, _)) = self.options.map.iter().find(|(from, _)| from.starts_with('/') && absent(from)) {
            return Err(format!("it has no field '{missing}'. {}", self.say_fields()));
        }
        let mut repairs = Vec::new();
        if self.without_time > 0 {
            let text = counted(
                self.without_time,
                "message has no time and was left out",
                "messages have no time and were left out",
            );
            repairs.push(Repair { lost: true, ..Repair::new("no-time", self.without_time, None, text) });
        }
        if self.beyond > 0 {
            let text = format!("{} messages were left out: they {BEYOND}", self.beyond);
            repairs.push(Repair { lost: true, ..Repair::new("beyond-time", self.beyond, None, text) });
        }
        let wanted: Vec<String> = wanted.into_iter().cloned().collect();
        let unset = self.leave_out_unset(&wanted)?;
        if unset > 0 {
            let text = format!(
                "{} of the first year since 1970, where the others are later: the clock was not set; left out (or use another time with \
                 option `message_time publish` or option `time_field`)",
                counted(unset, "value is", "values are")
            );
            repairs.push(Repair { lost: true, ..Repair::new("unset-time", unset, None, text) });
        }
        let first =
            |name: &String| self.found.get(name).and_then(|f| f.time_ns.iter().chain(&f.missing_ns).min().copied());
        let zero_ns = wanted.iter().filter_map(first).min().unwrap_or(0);
        let mut tracks = Vec::new();
        for name in wanted {
            let found = self.found.remove(&name).unwrap_or_default();
            let missing = found.missing_ns.len();
            if missing > 0 {
                let text = counted(missing, "message has", "messages have")
                    + &format!(
                        " no number for {name} (text, a null, nan, or true and false among numbers): recorded as gaps"
                    );
                repairs.push(Repair { lost: true, ..Repair::new("no-number", missing, None, text) });
            }
            // a topic may have messages of several kinds
            if found.absent > 0 {
                let text = counted(found.absent, "message of its topic does", "messages of its topic do")
                    + &format!(" not have {name} at all");
                repairs.push(Repair::new("absent", found.absent, None, text));
            }
            let displaced = displaced(&found.time_ns);
            if is_no_order(displaced, found.time_ns.len()) {
                return Err(format!(
                    "{displaced} of {} messages of {name} have times before those that came earlier: was the clock set back? Use another time with \
                     option `message_time publish` or option `time_field`",
                    found.time_ns.len()
                ));
            }
            if displaced > 0 {
                let text = counted(displaced, "message", "messages") + &format!(" of {name} out of order, sorted in");
                repairs.push(Repair::new("order", displaced, None, text));
            }
            let (series, repeated) = found.series(zero_ns);
            if repeated > 0 {
                let text = counted(repeated, "message repeats", "messages repeat")
                    + &format!(
                        " the time of another, of {name}: left out; try option `time_field` or option `message_time publish`"
                    );
                repairs.push(Repair { lost: true, ..Repair::new("duplicate-times", repeated, None, text) });
            }
            tracks.push(Track {
                short: name.clone(),
                name,
                unit: None,
                series,
                repairs: Vec::new(),
                shares: None,
                place: None,
            });
        }
        let unix_ns = u64::try_from(zero_ns).ok().filter(|_| zero_ns > YEAR_NS);
        let start = unix_ns.map(|unix_ns| Start { unix_ns, digit_s: 1e-6 });
        Ok(SourceFile { tracks, start, notes: Vec::new(), repairs, spare_tracks: true, ..SourceFile::default() })
    }

    /// Leaves out what was logged before the clock was set, where most was after; how many values that is.
    fn leave_out_unset(&mut self, wanted: &[String]) -> Result<usize, String> {
        let is_set = |time_ns: &i64| *time_ns > YEAR_NS;
        let found = |name: &String| self.found.get(name).map(|found| &found.time_ns);
        let (mut set, mut unset) = (0, 0);
        for time_ns in wanted.iter().filter_map(found).flatten() {
            if is_set(time_ns) { set += 1 } else { unset += 1 }
        }
        if set == 0 || unset == 0 {
            return Ok(0);
        }
        let nothing_left = |name: &&String| found(name).is_some_and(|time_ns| !time_ns.iter().any(is_set));
        if unset >= set || wanted.iter().any(|name| nothing_left(&name)) {
            let of =
                wanted.iter().find(nothing_left).map_or_else(String::new, |name| format!(", all of {name} among them"));
            return Err(format!(
                "{} of the first year since 1970{of}, {set} are later: the clock was set in between; use another time with option `message_time publish` or \
                 option `time_field`",
                counted(unset, "value is", "values are")
            ));
        }
        for found in self.found.values_mut() {
            let mut kept = found.time_ns.iter().map(is_set);
            found.value.retain(|_| kept.next().unwrap_or(true));
            found.time_ns.retain(is_set);
            found.missing_ns.retain(is_set);
        }
        Ok(unset)
    }

    fn say_fields(&self) -> String {
        const MOST: usize = 40;
        let fields: Vec<String> = self
            .order
            .iter()
            .take(MOST)
            .map(|name| format!("\n  {name} ({} values)", self.found[name].value.len()))
            .collect();
        let more =
            if self.order.len() > MOST { format!("\n  and {} more", self.order.len() - MOST) } else { String::new() };
        let unreadable: String = self.unreadable.iter().map(|u| format!("\n  {u}")).collect();
        format!(
            "assign numbers to sensors, as in option `map '{}=P1'`. It has{}{more}{unreadable}",
            self.order.first().map_or("", String::as_str),
            fields.concat()
        )
    }
}

impl Found {
    /// What is true or false is 1 or 0 where it is never anything else; among numbers it is none.
    fn settle(&mut self) {
        let (time_ns, value) = std::mem::take(&mut self.switches).into_iter().unzip();
        if self.value.is_empty() {
            (self.time_ns, self.value) = (time_ns, value);
        } else {
            self.missing_ns.extend(time_ns);
        }
    }

    /// In the order of time from `zero_ns` on, and how many repeat a time.
    fn series(self, zero_ns: i64) -> (Series, usize) {
        let mut samples: Vec<(i64, f64)> = self.time_ns.into_iter().zip(self.value).collect();
        samples.sort_by_key(|(t, _)| *t);
        let all = samples.len();
        samples.dedup_by_key(|(t, _)| *t);
        let repeated = all - samples.len();
        let in_reach = |t: &i64| t.checked_sub(zero_ns).filter(|ns| ns.unsigned_abs() < 9_000_000_000_000_000_000);
        let (time_s, value) = samples.iter().filter_map(|(t, v)| Some((to_s(in_reach(t)?), *v))).unzip();
        let mut series = Series { time_s, value, gaps: Vec::new() };
        let mut missing_s: Vec<f64> = self.missing_ns.iter().filter_map(in_reach).map(to_s).collect();
        missing_s.sort_by(f64::total_cmp);
        series.gaps = gaps(&series.time_s, &missing_s);
        (series, repeated)
    }
}

/// How many times come before one that stands earlier in the file.
fn displaced(time_ns: &[i64]) -> usize {
    let mut latest = i64::MIN;
    let earlier = |time_ns: &&i64| {
        latest = latest.max(**time_ns);
        **time_ns < latest
    };
    time_ns.iter().filter(earlier).count()
}

/// The time that a field gives, ns: a number in its unit, or a message of seconds and nanoseconds.
fn field_ns(fields: &[Field], name: &str, unit_s: f64) -> Option<i64> {
    let number = |name: &str| fields.iter().find(|field| field.path == name).map(|field| field.value);
    let part = |names: [&str; 2]| names.iter().find_map(|part| number(&format!("{name}.{part}")));
    let fits = |ns: f64| (ns.abs() < 9e18).then_some(ns as i64);
    if let Some(value) = number(name) {
        return fits((value * unit_s * 1e9).round());
    }
    let seconds = part(["seconds", "sec"])?;
    let nanos = part(["nanos", "nsec"]).or_else(|| number(&format!("{name}.nanosec"))).unwrap_or(0.0);
    fits(seconds * 1e9).filter(|_| nanos.abs() < 1e18)?;
    (seconds as i64).checked_mul(1_000_000_000)?.checked_add(nanos as i64)
}
