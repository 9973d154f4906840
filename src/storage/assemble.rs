//! Puts a recording together from MCAP records, in whatever order they come.

use std::collections::BTreeMap;
use std::path::Path;

use mcap::records::{self, MessageHeader, Record};
use prost::Message;
use rayon::prelude::*;

use crate::recording::{CsvFormat, Gap, Recording, RunInfo, Series};
use crate::rig::Rig;
use crate::shown::Shown as _;
use crate::storage::error::LogError;
use crate::storage::layout;
use crate::storage::layout::{key, offset_ns, to_s};
use crate::storage::nearest::nearest;
use crate::storage::retime::{CLOCKS_METADATA, Retimer, SensorClock};
use crate::storage::schema;
use crate::storage::schema::{Block, Kind, Sample};

/// The parts of a recording seen so far.
#[derive(Default)]
pub struct Assembler {
    rig: Option<String>,
    run: Option<BTreeMap<String, String>>,
    notes: Vec<(String, String)>,
    retimer: Retimer,
    schemas: BTreeMap<u16, Option<Kind>>,
    /// Column and kind of each channel, by its number; nothing of a channel that is none of ours.
    channels: Vec<Option<Option<(usize, Kind)>>>,
    columns: Vec<Column>,
}

/// What came for one sensor.
struct Column {
    sensor: String,
    unit: String,
    /// Its place in an imported time series, and the decimals there.
    csv: Option<(usize, Option<u8>)>,
    points: Points,
    gaps: Vec<Gap>,
    /// Where records were lost: the number of points before.
    breaks: Vec<usize>,
}

/// Samples in the order of the file: sixteen bytes each, for a long recording has many.
#[derive(Default)]
struct Points {
    log_time: Vec<u64>,
    value: Vec<f64>,
    /// Recording times that are not those of `log_time`, with the place of their sample.
    time_s: Vec<(usize, f64)>,
}

impl Points {
    fn push(&mut self, log_time: u64, value: f64, time_s: Option<f64>) {
        self.time_s.extend(time_s.map(|time_s| (self.value.len(), time_s)));
        self.log_time.push(log_time);
        self.value.push(value);
    }

    /// The samples of a block, whose times follow from its period; a value that is no number is returned, and nothing
    /// is taken then. A long recording has many: these are plain loops.
    fn push_block(&mut self, log_time: u64, period_ns: f64, values: &[u8]) -> Option<f64> {
        let (before, count) = (self.value.len(), values.len() / 8);
        self.value.reserve(count);
        self.log_time.reserve(count);
        for bytes in values.chunks_exact(8) {
            let mut eight = [0; 8];
            eight.copy_from_slice(bytes);
            let value = f64::from_le_bytes(eight);
            if !value.is_finite() {
                self.value.truncate(before);
                return Some(value);
            }
            self.value.push(value);
        }
        let mut after = |offset_ns: i64| self.log_time.push(log_time.saturating_add_signed(offset_ns));
        match count as f64 * period_ns < 2f64.powi(53) && period_ns.fract() == 0.0 {
            true => (0..count as i64).for_each(|i| after(i * period_ns as i64)),
            false => (0..count).for_each(|i| after(offset_ns(i, period_ns))),
        }
        None
    }
}

impl Assembler {
    /// Takes one record; an error says why it cannot be right, and the record is left out as a whole.
    pub fn take(&mut self, record: Record<'_>) -> Result<(), String> {
        match record {
            Record::Attachment { header, data, .. } if header.name == layout::RIG_ATTACHMENT => {
                self.rig = Some(String::from_utf8(data.into_owned()).map_err(|_| "the rig file is not text")?);
            }
            Record::Metadata(record) if record.name == layout::RUN_METADATA => {
                if record.metadata.get(key::CHECK) != Some(&layout::check_sum(&record.metadata)) {
                    return Err("the check sum of the run's metadata is wrong".into());
                }
                self.run = Some(record.metadata);
            }
            Record::Metadata(mut record) if record.name == layout::NOTE_METADATA => {
                let mut entry = |key: &str| record.metadata.remove(key).unwrap_or_default();
                self.notes.push((entry(key::NOTE), entry(key::VALUE)));
            }
            Record::Metadata(record) if record.name == CLOCKS_METADATA => self.retimer = Retimer::read(&record)?,
            Record::Schema { header, .. } => {
                let kind = Kind::ALL.into_iter().find(|k| k.schema_name() == header.name);
                self.schemas.insert(header.id, kind);
            }
            Record::Channel(channel) => self.channel(channel)?,
            Record::Message { header, data } => self.message(header, &data)?,
            _ => {}
        }
        Ok(())
    }

    /// Notes that records were lost here.
    pub fn lost(&mut self) {
        for column in &mut self.columns {
            column.breaks.push(column.points.value.len());
        }
    }

    fn channel(&mut self, channel: records::Channel) -> Result<(), String> {
        let topic = &channel.topic;
        let kind = self.schemas.get(&channel.schema_id).copied().flatten();
        // A channel of another program's messages is none of ours and stays out.
        let Some(kind) = kind else {
            self.set_channel(channel.id, None);
            return Ok(());
        };
        let entry = |key: &str| channel.metadata.get(key);
        let sensor = entry(key::SENSOR).ok_or_else(|| format!("channel {topic} does not name its sensor"))?;
        let number = |key: &str| {
            let parse = |text: &String| text.parse().map_err(|_| format!("channel {topic} has '{text}' for its {key}"));
            entry(key).map(parse).transpose()
        };
        let csv = match number(key::COLUMN)? {
            Some(place) => Some((place, number(key::DECIMALS)?.and_then(|d: usize| u8::try_from(d).ok()))),
            None => None,
        };
        let column = self.columns.iter().position(|c| c.sensor == *sensor).unwrap_or_else(|| {
            let (sensor, unit) = (sensor.clone(), entry(key::UNIT).cloned().unwrap_or_default());
            self.columns.push(Column { sensor, unit, csv, points: Points::default(), gaps: vec![], breaks: vec![] });
            self.columns.len() - 1
        });
        self.set_channel(channel.id, Some((column, kind)));
        Ok(())
    }

    fn set_channel(&mut self, id: u16, what: Option<(usize, Kind)>) {
        let id = usize::from(id);
        if self.channels.len() <= id {
            self.channels.resize(id + 1, None);
        }
        self.channels[id] = Some(what);
    }

    fn message(&mut self, header: MessageHeader, data: &[u8]) -> Result<(), String> {
        let known = self.channels.get(usize::from(header.channel_id)).copied().flatten();
        let Some((column, kind)) =
            known.ok_or_else(|| format!("a message of channel {}, which is not there", header.channel_id))?
        else {
            return Ok(());
        };
        let column = &mut self.columns[column];
        let bad = |sensor: &str| format!("a message of '{sensor}' at log time {} ns does not decode", header.log_time);
        let whole = |sensor: &str, values: &[f64]| match values.iter().find(|v| !v.is_finite()) {
            Some(value) => Err(format!("'{sensor}' has {value} at log time {} ns", header.log_time)),
            None => Ok(()),
        };
        if let (Kind::Block, Some((period_ns, values))) = (kind, schema::plain_block(data)) {
            let odd = column.points.push_block(header.log_time, period_ns, values);
            return odd.map_or(Ok(()), |value| whole(&column.sensor, &[value]));
        }
        match kind {
            Kind::Sample => {
                // nearly all are a value alone: its tag and eight bytes
                let sample = match data.split_first().map(|(tag, value)| (tag, <[u8; 8]>::try_from(value))) {
                    Some((0x09, Ok(value))) => Sample { value: Some(f64::from_le_bytes(value)), time_s: None },
                    _ => Sample::decode(data).map_err(|_| bad(&column.sensor))?,
                };
                let value = sample.value.ok_or_else(|| bad(&column.sensor))?;
                whole(&column.sensor, &[value, sample.time_s.unwrap_or_default()])?;
                column.points.push(header.log_time, value, sample.time_s);
            }
            Kind::Block => {
                let block = Block::decode(data).map_err(|_| bad(&column.sensor))?;
                let period_ns =
                    block.period_ns.filter(|p| p.is_finite() && *p >= 0.0).ok_or_else(|| bad(&column.sensor))?;
                whole(&column.sensor, &block.values)?;
                whole(&column.sensor, &block.times_s)?;
                if !block.times_s.is_empty() && block.times_s.len() != block.values.len() {
                    return Err(bad(&column.sensor));
                }
                for (i, &value) in block.values.iter().enumerate() {
                    let log_time = header.log_time.saturating_add_signed(offset_ns(i, period_ns));
                    column.points.push(log_time, value, block.times_s.get(i).copied());
                }
            }
            Kind::Gap => {
                let gap = schema::Gap::decode(data).map_err(|_| bad(&column.sensor))?;
                let (Some(from_s), Some(to_s)) = (gap.from_s, gap.to_s) else { return Err(bad(&column.sensor)) };
                whole(&column.sensor, &[from_s, to_s])?;
                column.gaps.push(Gap { from_s, to_s, samples: gap.samples });
            }
        }
        Ok(())
    }

    /// The recording. Two samples of a sensor at one time are an error, unless `repeats` takes the message about the
    /// second, which is then left out.
    pub fn assemble(self, path: &Path, mut repeats: Option<&mut Vec<String>>) -> Result<Recording, LogError> {
        let damaged = |why| LogError::Damaged { path: path.into(), why };
        let not_ours = |why: &str| LogError::NotOurs { path: path.into(), why: why.into() };
        let text = self.rig.ok_or_else(|| not_ours("it holds no rig file (attachment rig.toml)"))?;
        let entries = self.run.ok_or_else(|| not_ours("it has no time of recording (metadata surgescope.run)"))?;
        let number = |key: &str| entries.get(key).and_then(|v| v.parse::<u64>().ok());
        let format = number(key::FORMAT).ok_or_else(|| damaged("its format is missing".into()))?;
        if format > u64::from(layout::FORMAT) {
            return Err(not_ours("a newer version of the program wrote it: update surgescope"));
        }
        let zero_ns = number(key::TIME_ZERO).ok_or_else(|| damaged("its time 0 is missing".into()))?;
        let file_name = format!("rig.toml inside {}", path.shown());
        let rig = Rig::from_stored(&text, &file_name)
            .map_err(|e| LogError::Rig { path: path.into(), source: Box::new(e) })?;

        let mut series = vec![Series::default(); rig.sensors.len()];
        let mut places = Vec::new();
        let mut columns = Vec::new();
        for column in self.columns {
            let sensor = sensor_of(&rig, &column).map_err(|why| LogError::OtherRig { path: path.into(), why })?;
            if let Some((place, decimals)) = column.csv {
                places.push((place, sensor, decimals));
            }
            columns.push((sensor, self.retimer.of(&column.sensor), column));
        }
        let each = columns.into_par_iter().map(|(sensor, clock, column)| (sensor, column.into_series(zero_ns, &clock)));
        for (sensor, made) in each.collect::<Vec<_>>() {
            let (of_sensor, twice) = made.map_err(damaged)?;
            series[sensor] = of_sensor;
            match &mut repeats {
                Some(repeats) => repeats.extend(twice),
                None => twice.into_iter().next().map_or(Ok(()), |what| Err(damaged(what)))?,
            }
        }
        places.sort_unstable();
        let csv = entries.contains_key(key::CSV).then(|| CsvFormat {
            time_decimals: number(key::TIME_DECIMALS).and_then(|d| u8::try_from(d).ok()),
            columns: places.into_iter().map(|(_, sensor, decimals)| (sensor, decimals)).collect(),
        });
        let text = |key: &str| entries.get(key).cloned().unwrap_or_default();
        let run = RunInfo {
            start_unix_ns: number(key::START).unwrap_or_default(),
            source: text(key::SOURCE),
            program: text(key::PROGRAM),
            notes: self.notes,
            csv,
        };
        Ok(Recording { rig, series, run })
    }
}

fn sensor_of(rig: &Rig, column: &Column) -> Result<usize, String> {
    let name = &column.sensor;
    let names = || rig.sensors.iter().map(|s| s.name.as_str());
    let Some(index) = names().position(|n| n == name) else {
        let hint = nearest(name, names()).map(|n| format!("; did it mean '{n}'?")).unwrap_or_default();
        let known = names().collect::<Vec<_>>().join(", ");
        return Err(format!("it has samples of '{name}', which its own rig file lacks (it has {known}){hint}"));
    };
    let unit = rig.sensors[index].unit.symbol;
    if unit != column.unit {
        return Err(format!("samples of '{name}' are in '{}', but its own rig file says {unit}", column.unit));
    }
    Ok(index)
}

impl Column {
    /// Its samples in the order of time, and a message about each that is the second at its time, which is left out.
    fn into_series(self, zero_ns: u64, clock: &SensorClock) -> Result<(Series, Vec<String>), String> {
        let sensor = self.sensor;
        let Points { log_time, value, time_s: own } = self.points;
        let (mut first, mut last) = (zero_ns, zero_ns);
        for &time in &log_time {
            (first, last) = (first.min(time), last.max(time));
        }
        let is_far = |time: u64| i64::try_from(i128::from(time) - i128::from(zero_ns)).is_err();
        if is_far(first) || is_far(last) {
            return Err(format!("'{sensor}' has a sample centuries from its start"));
        }
        // in place: of the same size
        let mut time_s: Vec<f64> =
            log_time.into_iter().map(|t| to_s(clock.time_ns(t.wrapping_sub(zero_ns) as i64))).collect();
        own.into_iter().for_each(|(place, own_s)| time_s[place] = own_s);
        let mut gaps: Vec<Gap> = self.gaps.into_iter().map(|gap| clock.gap(gap)).collect();
        let mut breaks = self.breaks;
        breaks.dedup();
        let period_s = if breaks.is_empty() { 0.0 } else { typical_period_s(&time_s) };
        for place in breaks {
            let before = place.checked_sub(1).and_then(|i| time_s.get(i));
            if let (Some(&from_s), Some(&to_s)) = (before, time_s.get(place)) {
                // A slow sensor may well have had no sample in the lost stretch.
                if to_s - from_s > 1.5 * period_s {
                    gaps.push(Gap { from_s, to_s, samples: None });
                }
            }
        }
        gaps.sort_by(|a, b| a.from_s.total_cmp(&b.from_s));
        if time_s.windows(2).all(|w| w[0] < w[1]) {
            return Ok((Series { time_s, value, gaps }, Vec::new()));
        }
        let mut samples: Vec<(f64, f64)> = time_s.into_iter().zip(value).collect();
        samples.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut series = Series { gaps, ..Series::default() };
        let mut repeats = Vec::new();
        for (time_s, value) in samples {
            if series.time_s.last().is_some_and(|last| *last >= time_s) {
                repeats.push(format!("two samples of '{sensor}' at {time_s} s"));
                continue;
            }
            series.time_s.push(time_s);
            series.value.push(value);
        }
        Ok((series, repeats))
    }
}

/// Median of the steps between samples, s; 0 where there are none.
fn typical_period_s(time_s: &[f64]) -> f64 {
    let mut steps: Vec<f64> = time_s.windows(2).map(|w| w[1] - w[0]).collect();
    let middle = steps.len() / 2;
    if steps.is_empty() { 0.0 } else { *steps.select_nth_unstable_by(middle, f64::total_cmp).1 }
}
