//! Writes the parts of a recording as MCAP records; shared by whole and live writing.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, WriteOptions};
use prost::Message;

use crate::recording::{CsvFormat, Gap, RunInfo};
use crate::rig::{Rig, Sensor};
use crate::storage::error::LogError;
use crate::storage::layout;
use crate::storage::layout::key;
use crate::storage::schema;
use crate::storage::schema::{Block, Kind, Sample};

/// An MCAP file being written, after its head: the rig and what is known of the run.
pub struct Sink<W: Write + Seek> {
    mcap: mcap::Writer<W>,
    path: PathBuf,
    zero_ns: u64,
    sensors: Vec<SensorChannels>,
    descriptors: Vec<u8>,
    schemas: [Option<u16>; 3],
    buffer: Vec<u8>,
}

/// The channels of one sensor, made when their first message comes.
struct SensorChannels {
    name: String,
    metadata: BTreeMap<String, String>,
    ids: [Option<u16>; 3],
}

/// Options of a finished file: zstd chunks, CRCs and an index.
pub fn finished() -> WriteOptions {
    // Without worker threads the bytes do not depend on the machine.
    WriteOptions::new().profile(layout::PROFILE).library(program()).compression_threads(0)
}

/// Options of a live file: small chunks that are written in one go as they are, each with its CRC.
pub fn live() -> WriteOptions {
    finished().compression(None).disable_seeking(true).chunk_size(Some(LIVE_CHUNK_BYTES)).emit_message_indexes(false)
}

/// What a live file holds back at most before it goes to the system.
pub const LIVE_CHUNK_BYTES: u64 = 8 * 1024;

/// This program and its version.
pub fn program() -> String {
    format!("surgescope {}", env!("CARGO_PKG_VERSION"))
}

impl<W: Write + Seek> Sink<W> {
    /// Writes the head; `zero_ns` is the log time of recording time 0, `path` serves messages only.
    pub fn start(
        inner: W,
        options: WriteOptions,
        path: &Path,
        rig: &Rig,
        run: &RunInfo,
        zero_ns: u64,
    ) -> Result<Self, LogError> {
        let mcap = mcap::Writer::with_options(inner, options).map_err(|e| LogError::write(path, e))?;
        let mut sink = Sink {
            mcap,
            path: path.into(),
            zero_ns,
            sensors: rig
                .sensors
                .iter()
                .enumerate()
                .map(|(i, sensor)| SensorChannels {
                    name: sensor.name.clone(),
                    metadata: metadata_of(i, sensor, run.csv.as_ref()),
                    ids: [None; 3],
                })
                .collect(),
            descriptors: schema::descriptor_set(),
            schemas: [None; 3],
            buffer: Vec::new(),
        };
        let attachment = Attachment {
            log_time: zero_ns,
            create_time: run.start_unix_ns,
            name: layout::RIG_ATTACHMENT.into(),
            media_type: "application/toml".into(),
            data: Cow::Owned(rig.stored_text().into_bytes()),
        };
        sink.mcap.attach(&attachment).map_err(|e| LogError::write(path, e))?;
        sink.metadata(layout::RUN_METADATA, run_metadata(run, zero_ns))?;
        for (key, value) in &run.notes {
            sink.note(key, value)?;
        }
        Ok(sink)
    }

    /// One sample at `ns` recording time; `time_s` where that is not the time itself.
    pub fn sample(&mut self, sensor: usize, ns: i64, time_s: Option<f64>, value: f64) -> Result<(), LogError> {
        self.message(sensor, Kind::Sample, ns, &Sample { value: Some(value), time_s })
    }

    /// A block whose first sample lies at `ns` recording time.
    pub fn block(&mut self, sensor: usize, ns: i64, block: &Block) -> Result<(), LogError> {
        self.message(sensor, Kind::Block, ns, block)
    }

    /// A gap, logged at its end `ns`.
    pub fn gap(&mut self, sensor: usize, ns: i64, gap: Gap) -> Result<(), LogError> {
        let message = schema::Gap { from_s: Some(gap.from_s), to_s: Some(gap.to_s), samples: gap.samples };
        self.message(sensor, Kind::Gap, ns, &message)
    }

    /// One note on the run.
    pub fn note(&mut self, key: &str, value: &str) -> Result<(), LogError> {
        let entries = [(key::NOTE, key.to_string()), (key::VALUE, value.to_string())];
        self.metadata(layout::NOTE_METADATA, entries.map(|(k, v)| (k.to_string(), v)).into())
    }

    /// Makes a sensor's channel of a kind even if no message comes.
    pub fn channel(&mut self, sensor: usize, kind: Kind) -> Result<u16, LogError> {
        let fail = |e| LogError::write(&self.path, e);
        let channels = &mut self.sensors[sensor];
        if let Some(id) = channels.ids[kind as usize] {
            return Ok(id);
        }
        let schema = match self.schemas[kind as usize] {
            Some(id) => id,
            None => self.mcap.add_schema(kind.schema_name(), "protobuf", &self.descriptors).map_err(fail)?,
        };
        self.schemas[kind as usize] = Some(schema);
        let topic = kind.topic(&channels.name);
        let id = self.mcap.add_channel(schema, &topic, "protobuf", &channels.metadata).map_err(fail)?;
        channels.ids[kind as usize] = Some(id);
        Ok(id)
    }

    /// Hands everything written so far to the system.
    pub fn flush(&mut self) -> Result<(), LogError> {
        self.mcap.flush().map_err(|e| LogError::write(&self.path, e))
    }

    /// Writes the index and gives the stream back.
    pub fn finish(mut self) -> Result<W, LogError> {
        self.mcap.finish().map_err(|e| LogError::write(&self.path, e))?;
        Ok(self.mcap.into_inner())
    }

    /// Writes a record of metadata.
    pub fn record(&mut self, record: &Metadata) -> Result<(), LogError> {
        self.mcap.write_metadata(record).map_err(|e| LogError::write(&self.path, e))
    }

    /// Gives the stream back without an end: a file left so is seen to be cut off.
    pub fn abandon(self) -> W {
        self.mcap.into_inner()
    }

    fn message(&mut self, sensor: usize, kind: Kind, ns: i64, message: &impl Message) -> Result<(), LogError> {
        let channel_id = self.channel(sensor, kind)?;
        let log_time = u64::try_from(i128::from(self.zero_ns) + i128::from(ns)).map_err(|_| LogError::BadSamples {
            path: self.path.clone(),
            why: format!("time {} s lies before 1970 or after 2554 on the log's clock", layout::to_s(ns)),
        })?;
        self.buffer.clear();
        message.encode_raw(&mut self.buffer);
        let header = MessageHeader { channel_id, sequence: 0, log_time, publish_time: log_time };
        self.mcap.write_to_known_channel(&header, &self.buffer).map_err(|e| LogError::write(&self.path, e))
    }

    fn metadata(&mut self, name: &str, metadata: BTreeMap<String, String>) -> Result<(), LogError> {
        self.record(&Metadata { name: name.into(), metadata })
    }
}

/// A stream that can be made to swallow what is written.
pub struct Muted<W> {
    inner: W,
    muted: Arc<AtomicBool>,
}

impl<W> Muted<W> {
    /// A stream that lets everything through.
    pub fn new(inner: W) -> Muted<W> {
        Muted { inner, muted: Arc::default() }
    }
}

impl<W: Write> Write for Muted<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.muted.load(Ordering::Relaxed) { Ok(bytes.len()) } else { self.inner.write(bytes) }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

impl<W: Seek> Seek for Muted<W> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.inner.seek(to)
    }
}

impl<W: Write + Seek> Sink<Muted<W>> {
    /// Goes on in the same file with a new MCAP writer, without a second head: the old one remembers each chunk for an
    /// index that a live file does not have, and a day's chunks would take half a gigabyte.
    pub fn renew(mut self, options: WriteOptions) -> Result<Self, LogError> {
        self.flush()?;
        let Sink { mcap, path, zero_ns, sensors, descriptors, schemas, buffer } = self;
        let fail = |e| LogError::write(&path, e);
        let stream = mcap.into_inner();
        let muted = Arc::clone(&stream.muted);
        muted.store(true, Ordering::Relaxed);
        let renewed = mcap::Writer::with_options(stream, options);
        let mut mcap = renewed.map_err(fail)?;
        mcap.flush().map_err(fail)?;
        muted.store(false, Ordering::Relaxed);
        // Each as it was: the same numbers mean the same all through the file.
        for (kind, id) in Kind::ALL.iter().zip(schemas) {
            if let Some(id) = id {
                mcap.add_schema_with_id(id, kind.schema_name(), "protobuf", &descriptors).map_err(fail)?;
            }
        }
        for sensor in &sensors {
            for ((kind, id), schema) in Kind::ALL.iter().zip(sensor.ids).zip(schemas) {
                if let (Some(id), Some(schema)) = (id, schema) {
                    let topic = kind.topic(&sensor.name);
                    mcap.add_channel_with_id(id, schema, &topic, "protobuf", &sensor.metadata).map_err(fail)?;
                }
            }
        }
        Ok(Sink { mcap, path, zero_ns, sensors, descriptors, schemas, buffer })
    }
}

/// What the channels of a sensor say of it, an index in the rig; `csv` is how its time series was written, where it was
/// imported.
pub(crate) fn metadata_of(index: usize, sensor: &Sensor, csv: Option<&CsvFormat>) -> BTreeMap<String, String> {
    let mut metadata = BTreeMap::from([
        (key::SENSOR.to_string(), sensor.name.clone()),
        (key::KIND.to_string(), sensor.kind.name().to_string()),
        (key::UNIT.to_string(), sensor.unit.to_string()),
        (key::POSITION.to_string(), sensor.position_m.to_string()),
    ]);
    let column = csv.and_then(|c| c.columns.iter().enumerate().find(|(_, (sensor, _))| *sensor == index));
    if let Some((place, (_, decimals))) = column {
        metadata.insert(key::COLUMN.into(), place.to_string());
        if let Some(decimals) = decimals {
            metadata.insert(key::DECIMALS.into(), decimals.to_string());
        }
    }
    metadata
}

fn run_metadata(run: &RunInfo, zero_ns: u64) -> BTreeMap<String, String> {
    let program = if run.program.is_empty() { program() } else { run.program.clone() };
    let mut entries = BTreeMap::from([
        (key::FORMAT.to_string(), layout::FORMAT.to_string()),
        (key::START.to_string(), run.start_unix_ns.to_string()),
        (key::TIME_ZERO.to_string(), zero_ns.to_string()),
        (key::PROGRAM.to_string(), program),
        (key::SOURCE.to_string(), run.source.clone()),
    ]);
    if let Some(csv) = &run.csv {
        entries.insert(key::CSV.into(), "1".into());
        if let Some(decimals) = csv.time_decimals {
            entries.insert(key::TIME_DECIMALS.into(), decimals.to_string());
        }
    }
    entries.insert(key::CHECK.into(), layout::check_sum(&entries));
    entries
}
