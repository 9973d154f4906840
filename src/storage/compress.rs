//! A live file becomes a finished one: compressed, indexed, every sample on the recording's clock.

use std::collections::HashMap;
use std::fs::File;
use std::io::{BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::Path;

use mcap::records::{MessageHeader, Record};
use mcap::sans_io::{LinearReadEvent, LinearReader};
use mcap::{Attachment, McapError};
use prost::Message;

use crate::storage::error::LogError;
use crate::storage::layout::{key, offset_ns, to_ns as nanoseconds, within};
use crate::storage::read::{checked_options, parse};
use crate::storage::retime::{CLOCKS_METADATA, Retimer, SensorClock};
use crate::storage::schema::{Block, Gap, Kind};
use crate::storage::sink;

/// What becomes of the samples of a live file.
pub struct Moves<'a> {
    /// What puts them on the recording's clock.
    pub retimer: &'a Retimer,
    /// Log time of recording time 0.
    pub zero_ns: u64,
    /// First and last time on the recording's clock, ns, of the sensors of which not everything is kept.
    pub windows: &'a HashMap<String, (i64, i64)>,
}

/// Samples and gaps of each sensor that were left out.
pub type LeftOut = HashMap<String, (u64, u64)>;

/// Copies a live file, record by record, into a finished one.
pub fn compress(live: &mut File, out: &File, path: &Path, moves: &Moves<'_>) -> Result<LeftOut, LogError> {
    let read = |e| LogError::io("read", path, e);
    let write = |e| LogError::write(path, e);
    let length = live.seek(SeekFrom::End(0)).map_err(read)?;
    live.seek(SeekFrom::Start(0)).map_err(read)?;
    let mut input = BufReader::with_capacity(1 << 16, live);
    let mut reader = LinearReader::new_with_options(checked_options(length).with_skip_end_magic(true));
    let mut mcap = mcap::Writer::with_options(BufWriter::new(out), sink::finished()).map_err(write)?;
    let mut retimed = Retimed { moves, kinds: HashMap::new(), channels: HashMap::new(), left_out: LeftOut::new() };
    while let Some(event) = reader.next_event() {
        match event.map_err(write)? {
            LinearReadEvent::ReadRequest(need) => {
                let got = input.read(reader.insert(need)).map_err(read)?;
                reader.notify_read(got);
            }
            LinearReadEvent::Record { opcode, data } => match parse(opcode, data).map_err(write)? {
                Record::Schema { header, data } => {
                    retimed.kinds.insert(header.id, Kind::ALL.into_iter().find(|k| k.schema_name() == header.name));
                    mcap.add_schema_with_id(header.id, &header.name, &header.encoding, &data).map_err(write)?;
                }
                Record::Channel(c) => {
                    retimed.channel(c.id, c.schema_id, c.metadata.get(key::SENSOR));
                    mcap.add_channel_with_id(c.id, c.schema_id, &c.topic, &c.message_encoding, &c.metadata)
                        .map_err(write)?;
                }
                Record::Message { mut header, data } => {
                    let data = match retimed.message(&mut header, &data) {
                        Moved::NotAtAll | Moved::InTime => data,
                        Moved::To(data) => data.into(),
                        Moved::Out => continue,
                    };
                    mcap.write_to_known_channel(&header, &data).map_err(write)?;
                }
                // What it says is done.
                Record::Metadata(metadata) if metadata.name == CLOCKS_METADATA => {}
                Record::Metadata(metadata) => mcap.write_metadata(&metadata).map_err(write)?,
                Record::Attachment { header, data, .. } => {
                    let (log_time, create_time) = (header.log_time, header.create_time);
                    let attachment =
                        Attachment { log_time, create_time, name: header.name, media_type: header.media_type, data };
                    mcap.attach(&attachment).map_err(write)?;
                }
                _ => {}
            },
        }
    }
    mcap.finish().map_err(write)?;
    mcap.into_inner().flush().map_err(|e| write(McapError::Io(e)))?;
    Ok(retimed.left_out)
}

/// What became of a message.
enum Moved {
    /// Its sensor's stays as it is.
    NotAtAll,
    /// Its header alone says when it was.
    InTime,
    /// It has new data.
    To(Vec<u8>),
    /// Nothing of it is kept.
    Out,
}

/// Moves messages to the recording's clock.
struct Retimed<'a> {
    moves: &'a Moves<'a>,
    kinds: HashMap<u16, Option<Kind>>,
    /// Channels whose times move, or of which not everything is kept.
    channels: HashMap<u16, Moving>,
    left_out: LeftOut,
}

struct Moving {
    sensor: String,
    clock: SensorClock,
    kind: Kind,
    window_ns: (i64, i64),
}

impl Retimed<'_> {
    fn channel(&mut self, id: u16, schema: u16, sensor: Option<&String>) {
        let kind = self.kinds.get(&schema).copied().flatten();
        if let (Some(sensor), Some(kind)) = (sensor, kind) {
            let (clock, window) = (self.moves.retimer.of(sensor), self.moves.windows.get(sensor));
            if !clock.is_empty() || window.is_some() {
                let window_ns = window.copied().unwrap_or((i64::MIN, i64::MAX));
                self.channels.insert(id, Moving { sensor: sensor.clone(), clock, kind, window_ns });
            }
        }
    }

    /// Moves a message's time, and cuts off what is not kept of it.
    fn message(&mut self, header: &mut MessageHeader, data: &[u8]) -> Moved {
        let Some(moving) = self.channels.get(&header.channel_id) else { return Moved::NotAtAll };
        let zero_ns = self.moves.zero_ns;
        let Ok(logged_ns) = i64::try_from(i128::from(header.log_time) - i128::from(zero_ns)) else {
            return Moved::NotAtAll;
        };
        let Some((moved, time_ns, left_out)) = moving.message(logged_ns, data) else { return Moved::NotAtAll };
        if left_out != (0, 0) {
            let sum = self.left_out.entry(moving.sensor.clone()).or_default();
            *sum = (sum.0 + left_out.0, sum.1 + left_out.1);
        }
        header.log_time = zero_ns.saturating_add_signed(time_ns);
        header.publish_time = header.log_time;
        moved
    }
}

impl Moving {
    /// What becomes of a message logged at a time, when it is then, ns, and how many samples and gaps are left out of
    /// it; `None` where it cannot be understood.
    fn message(&self, logged_ns: i64, data: &[u8]) -> Option<(Moved, i64, (u64, u64))> {
        let (from_ns, to_ns) = self.window_ns;
        let time_ns = self.clock.time_ns(logged_ns);
        Some(match self.kind {
            Kind::Sample if (from_ns..=to_ns).contains(&time_ns) => (Moved::InTime, time_ns, (0, 0)),
            Kind::Sample => (Moved::Out, time_ns, (1, 0)),
            Kind::Block => {
                let mut block = Block::decode(data).ok()?;
                let period_ns = block.period_ns? * self.clock.rate(logged_ns);
                let all = block.values.len();
                let inside = within(time_ns, period_ns, all, from_ns, to_ns);
                let first_ns = time_ns.saturating_add(offset_ns(inside.start, period_ns));
                let kept = block.values.get(inside)?.to_vec();
                let left_out = ((all - kept.len()) as u64, 0);
                if kept.is_empty() && all > 0 {
                    return Some((Moved::Out, time_ns, left_out));
                }
                // blocks of a live file say no times of their own
                block.values = kept;
                block.period_ns = Some(period_ns);
                (Moved::To(block.encode_to_vec()), first_ns, left_out)
            }
            Kind::Gap => {
                let gap = Gap::decode(data).ok()?;
                let (from_s, to_s) = (gap.from_s?, gap.to_s?);
                let moved = self.clock.gap(crate::recording::Gap { from_s, to_s, samples: gap.samples });
                // A gap stands at its end, which may lie between two nanoseconds of the log.
                let end_ns = nanoseconds(moved.to_s)?;
                if end_ns <= from_ns || nanoseconds(moved.from_s)? >= to_ns {
                    return Some((Moved::Out, end_ns, (0, 1)));
                }
                let gap = Gap { from_s: Some(moved.from_s), to_s: Some(moved.to_s), samples: gap.samples };
                (Moved::To(gap.encode_to_vec()), end_ns, (0, 0))
            }
        })
    }
}
