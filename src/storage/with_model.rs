//! A recording with a model beside it: a copy of the file, and two channels more for each sensor that the model shows.
//!
//! The copy keeps every record of the data as it is: attachments, metadata, channels and messages. The added messages
//! stand among them by time, so that a player reads the file from front to back. Readers of recordings pass over them.

use std::collections::BTreeMap;
use std::io::{BufReader, BufWriter};
use std::path::Path;

use mcap::records::{MessageHeader, Metadata, Record};
use mcap::{Attachment, McapResult};
use prost::Message;

use crate::rig::Sensor;
use crate::storage::disk;
use crate::storage::error::LogError;
use crate::storage::layout::{RUN_METADATA, key, to_ns};
use crate::storage::read::{Unpacked, checked_options, records};
use crate::storage::retime::CLOCKS_METADATA;
use crate::storage::schema::{MODELLED, Modelled, Shows, modelled_descriptor_set};
use crate::storage::sink;

/// Name of the metadata record that says which model it is.
pub const MODEL_METADATA: &str = "surgescope.model";
/// The added schema's number; the channels' numbers go down from the same. Those of a recording go up from 1.
const LAST_ID: u16 = u16::MAX;

/// A model at one sensor, in the sensor's unit.
#[derive(Debug, Clone)]
pub struct Curve {
    /// The sensor.
    pub sensor: Sensor,
    /// Recording times of samples, s.
    pub time_s: Vec<f64>,
    /// What the sensor would show there if the model were the truth.
    pub model: Vec<f64>,
    /// Measured minus modelled.
    pub residual: Vec<f64>,
}

/// Writes a copy of the recording `source` with these curves to `target`; `about` says which model it is.
///
/// # Errors
/// When there is a file at `target`, when `source` cannot be read or has such channels already.
pub fn write_with_model(
    source: &Path,
    target: &Path,
    about: BTreeMap<String, String>,
    curves: &[Curve],
) -> Result<(), LogError> {
    disk::refuse_existing(target)?;
    let input = disk::open_file(source)?;
    let length = input.metadata().map_err(|e| LogError::io("read", source, e))?.len();
    let temporary = disk::temporary_beside(target)?;
    let stream = BufWriter::new(temporary.as_file());
    let mcap = mcap::Writer::with_options(stream, sink::finished()).map_err(|e| LogError::write(target, e))?;
    let added = added(curves).into_iter().peekable();
    let mut copy = Copy { mcap, source, target, zero_ns: None, added, curves, about, at_end: false };

    let mut stopped = None;
    let input = BufReader::with_capacity(1 << 16, input);
    let copied = records(input, checked_options(length), &mut Unpacked::of(length), |record| {
        copy.take(record).map_err(|error| {
            stopped = Some(error);
            String::new()
        })
    });
    copied.map_err(|why| stopped.unwrap_or_else(|| LogError::Damaged { path: source.into(), why }))?;
    let stream = copy.finish().map_err(|e| LogError::write(target, e))?;
    stream.into_inner().map_err(|e| LogError::io("write", target, e.into_error()))?;
    disk::publish_new(temporary, target)
}

/// A value to be added.
struct Added {
    /// Recording time, ns.
    ns: i64,
    curve: usize,
    shows: Shows,
    value: f64,
}

/// All values of the curves, by time.
fn added(curves: &[Curve]) -> Vec<Added> {
    let mut all = Vec::new();
    for (i, curve) in curves.iter().enumerate() {
        for (place, &time_s) in curve.time_s.iter().enumerate() {
            let Some(ns) = to_ns(time_s) else { continue };
            all.push(Added { ns, curve: i, shows: Shows::Model, value: curve.model[place] });
            all.push(Added { ns, curve: i, shows: Shows::Residual, value: curve.residual[place] });
        }
    }
    all.sort_by_key(|one| one.ns);
    all
}

type Stream<'a> = BufWriter<&'a std::fs::File>;

struct Copy<'a, I: Iterator<Item = Added>> {
    mcap: mcap::Writer<Stream<'a>>,
    source: &'a Path,
    target: &'a Path,
    /// Log time of recording time 0, once it was read.
    zero_ns: Option<u64>,
    added: std::iter::Peekable<I>,
    curves: &'a [Curve],
    about: BTreeMap<String, String>,
    /// What follows the data is an index of the source, which the copy makes anew.
    at_end: bool,
}

impl<'a, I: Iterator<Item = Added>> Copy<'a, I> {
    fn take(&mut self, record: Record<'_>) -> Result<(), LogError> {
        let target = self.target;
        let fail = |error| LogError::write(target, error);
        match record {
            _ if self.at_end => {}
            Record::DataEnd(_) => {
                self.add_until(u64::MAX)?;
                self.at_end = true;
            }
            Record::Attachment { header, data, .. } => self
                .mcap
                .attach(&Attachment {
                    log_time: header.log_time,
                    create_time: header.create_time,
                    name: header.name,
                    media_type: header.media_type,
                    data,
                })
                .map_err(fail)?,
            Record::Metadata(metadata) => {
                match metadata.name.as_str() {
                    CLOCKS_METADATA => return Err(LogError::ClocksLeft(self.source.into())),
                    RUN_METADATA => {
                        self.zero_ns = metadata.metadata.get(key::TIME_ZERO).and_then(|v| v.parse().ok());
                        self.add_head().map_err(fail)?;
                    }
                    _ => {}
                }
                self.mcap.write_metadata(&metadata).map_err(fail)?;
            }
            Record::Schema { header, .. } if header.name == MODELLED => {
                return Err(LogError::HasModel(self.source.into()));
            }
            Record::Schema { header, data } => {
                self.mcap.add_schema_with_id(header.id, &header.name, &header.encoding, &data).map_err(fail)?;
            }
            Record::Channel(channel) => {
                let (id, schema) = (channel.id, channel.schema_id);
                let (topic, encoding) = (&channel.topic, &channel.message_encoding);
                self.mcap.add_channel_with_id(id, schema, topic, encoding, &channel.metadata).map_err(fail)?;
            }
            Record::Message { header, data } => {
                self.add_until(header.log_time)?;
                self.mcap.write_to_known_channel(&header, &data).map_err(fail)?;
            }
            _ => {}
        }
        Ok(())
    }

    /// Says which model it is, and makes the channels.
    fn add_head(&mut self) -> McapResult<()> {
        let about = Metadata { name: MODEL_METADATA.into(), metadata: std::mem::take(&mut self.about) };
        self.mcap.write_metadata(&about)?;
        let schema = self.mcap.add_schema_with_id(LAST_ID, MODELLED, "protobuf", &modelled_descriptor_set())?;
        for (i, Curve { sensor, .. }) in self.curves.iter().enumerate() {
            for shows in Shows::ALL {
                let metadata = BTreeMap::from([
                    (key::SENSOR.to_owned(), sensor.name.clone()),
                    (key::KIND.to_owned(), sensor.kind.name().to_owned()),
                    (key::UNIT.to_owned(), sensor.unit.to_string()),
                    (key::POSITION.to_owned(), sensor.position_m.to_string()),
                    ("shows".to_owned(), shows.name().to_owned()),
                ]);
                let topic = shows.topic(&sensor.name);
                self.mcap.add_channel_with_id(channel_id(i, shows), schema, &topic, "protobuf", &metadata)?;
            }
        }
        Ok(())
    }

    /// Writes what is to be added before a log time.
    fn add_until(&mut self, end: u64) -> Result<(), LogError> {
        let damaged = || LogError::Damaged { path: self.source.into(), why: "its time 0 is missing".into() };
        let zero_ns = self.zero_ns.ok_or_else(damaged)?;
        let log_time = |ns: i64| zero_ns.saturating_add_signed(ns);
        while let Some(one) = self.added.next_if(|one| log_time(one.ns) < end) {
            let log_time = log_time(one.ns);
            let channel_id = channel_id(one.curve, one.shows);
            let header = MessageHeader { channel_id, sequence: 0, log_time, publish_time: log_time };
            let message = Modelled { value: Some(one.value) };
            self.mcap
                .write_to_known_channel(&header, &message.encode_to_vec())
                .map_err(|e| LogError::write(self.target, e))?;
        }
        Ok(())
    }

    fn finish(mut self) -> McapResult<Stream<'a>> {
        self.mcap.finish()?;
        Ok(self.mcap.into_inner())
    }
}

fn channel_id(curve: usize, shows: Shows) -> u16 {
    LAST_ID - (2 * curve + shows as usize) as u16
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::storage::fixtures::{assert_same, place, recording};
    use crate::storage::retime::Retimer;
    use crate::storage::{read, write};

    fn curves() -> Vec<Curve> {
        let recording = recording();
        let (sensor, series) = (recording.rig.sensors[0].clone(), &recording.series[0]);
        let model: Vec<f64> = series.value.iter().map(|v| v - 0.5).collect();
        vec![Curve { sensor, time_s: series.time_s.clone(), residual: vec![0.5; model.len()], model }]
    }

    #[test]
    fn samples_gaps_and_notes_come_back_from_the_copy_as_they_were() {
        let (_folder, path) = place("run.mcap");
        write(&path, &recording()).unwrap();
        let out = path.with_file_name("out.mcap");
        write_with_model(&path, &out, BTreeMap::new(), &curves()).unwrap();
        assert_same(&read(&out).unwrap(), &recording());

        let bytes = std::fs::read(&out).unwrap();
        let times: Vec<u64> = mcap::MessageStream::new(&bytes).unwrap().map(|m| m.unwrap().log_time).collect();
        assert!(times.is_sorted(), "a player reads the file from front to back");
        let count = |path: &Path| {
            let bytes = std::fs::read(path).unwrap();
            mcap::Summary::read(&bytes).unwrap().unwrap().stats.unwrap().message_count as usize
        };
        assert_eq!(count(&out), count(&path) + 2 * recording().series[0].value.len());
        let again = write_with_model(&out, &path.with_file_name("again.mcap"), BTreeMap::new(), &curves());
        assert!(matches!(again, Err(LogError::HasModel(p)) if p == out));
        let over = write_with_model(&path, &out, BTreeMap::new(), &curves());
        assert!(matches!(over, Err(LogError::Exists(p)) if p == out));
    }

    /// Its samples are not yet at the times at which the model was computed.
    #[test]
    fn a_file_whose_clocks_are_still_to_be_applied_is_refused() {
        let (folder, path) = place("run.mcap");
        let mut writer = mcap::Writer::new(std::fs::File::create(&path).unwrap()).unwrap();
        writer.write_metadata(&Retimer::new(Vec::new()).metadata()).unwrap();
        writer.finish().unwrap();
        let refused = write_with_model(&path, &path.with_file_name("out.mcap"), BTreeMap::new(), &curves());
        assert!(matches!(refused, Err(LogError::ClocksLeft(p)) if p == path));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left behind");
    }
}
