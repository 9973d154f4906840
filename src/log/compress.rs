//! A live file becomes a finished one: compressed, indexed, every sample on the recording's clock.

use std::collections::HashMap;
use std::fs::File;
use std::io::{BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::Path;

use mcap::records::{MessageHeader, Record};
use mcap::sans_io::{LinearReadEvent, LinearReader};
use mcap::{Attachment, McapError};
use prost::Message;

use super::layout::{key, to_ns};
use super::read::{checked_options, parse};
use super::retime::{CLOCKS_METADATA, Retimer, SensorClock};
use super::schema::{Block, Gap, Kind};
use super::{LogError, sink};

/// Copies a live file, record by record, into a finished one; `zero_ns` is the log time of recording time 0.
pub fn compress(live: &mut File, out: &File, path: &Path, retimer: &Retimer, zero_ns: u64) -> Result<(), LogError> {
    let read = |e| LogError::io("read", path, e);
    let write = |e| LogError::write(path, e);
    let length = live.seek(SeekFrom::End(0)).map_err(read)?;
    live.seek(SeekFrom::Start(0)).map_err(read)?;
    let mut input = BufReader::with_capacity(1 << 16, live);
    let mut reader = LinearReader::new_with_options(checked_options(length).with_skip_end_magic(true));
    let mut mcap = mcap::Writer::with_options(BufWriter::new(out), sink::finished()).map_err(write)?;
    let mut retimed = Retimed { retimer, zero_ns, kinds: HashMap::new(), channels: HashMap::new() };
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
                    let moved = retimed.message(&mut header, &data);
                    mcap.write_to_known_channel(&header, moved.as_deref().unwrap_or(&data)).map_err(write)?;
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
    mcap.into_inner().flush().map_err(|e| write(McapError::Io(e)))
}

/// Moves messages to the recording's clock.
struct Retimed<'a> {
    retimer: &'a Retimer,
    zero_ns: u64,
    kinds: HashMap<u16, Option<Kind>>,
    /// Channels whose times move.
    channels: HashMap<u16, (SensorClock, Kind)>,
}

impl Retimed<'_> {
    fn channel(&mut self, id: u16, schema: u16, sensor: Option<&String>) {
        let kind = self.kinds.get(&schema).copied().flatten();
        if let (Some(sensor), Some(kind)) = (sensor, kind) {
            let clock = self.retimer.of(sensor);
            if !clock.is_empty() {
                self.channels.insert(id, (clock, kind));
            }
        }
    }

    /// Moves a message's time; returns its new data where they name times themselves.
    fn message(&self, header: &mut MessageHeader, data: &[u8]) -> Option<Vec<u8>> {
        let (clock, kind) = self.channels.get(&header.channel_id)?;
        let time_ns = i64::try_from(i128::from(header.log_time) - i128::from(self.zero_ns)).ok()?;
        let at = |time_ns: i64| self.zero_ns.saturating_add_signed(clock.time_ns(time_ns));
        let moved = match kind {
            Kind::Sample => None,
            Kind::Block => {
                let block = Block::decode(data).ok()?;
                let period_ns = block.period_ns.map(|period| period * clock.rate(time_ns));
                Some(Block { period_ns, ..block }.encode_to_vec())
            }
            Kind::Gap => {
                let gap = Gap::decode(data).ok()?;
                let (from_s, to_s) = (gap.from_s?, gap.to_s?);
                let moved = clock.gap(crate::recording::Gap { from_s, to_s, samples: gap.samples });
                // A gap stands at its end, which may lie between two nanoseconds of the log.
                header.log_time = self.zero_ns.saturating_add_signed(to_ns(moved.to_s)?);
                header.publish_time = header.log_time;
                let gap = Gap { from_s: Some(moved.from_s), to_s: Some(moved.to_s), samples: gap.samples };
                return Some(gap.encode_to_vec());
            }
        };
        header.log_time = at(time_ns);
        header.publish_time = header.log_time;
        moved
    }
}
