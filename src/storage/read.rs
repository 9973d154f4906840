//! Reads finished files, and trusts nothing whose check sum is wrong.

use std::borrow::Cow;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;
use std::sync::mpsc::sync_channel;

use mcap::records::{MessageHeader, Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{MAGIC, McapError, McapResult};

use crate::recording::Recording;
use crate::rig::own_effects::beside;
use crate::rig::{Rig, RigError};
use crate::storage::assemble::Assembler;
use crate::storage::disk;
use crate::storage::error::LogError;
use crate::storage::lengths::texts_fit;

/// Reads a recording, with the rig from inside it, and the rig's own effects in the folder `effects` beside it.
///
/// # Errors
/// Says whether the file is no MCAP, not one of ours, cut off ([`LogError::Torn`]) or damaged: every CRC is checked,
/// and no sample is given out of a file in which anything is wrong.
pub fn read(path: &Path) -> Result<Recording, LogError> {
    let io = |e| LogError::io("read", path, e);
    let mut file = disk::open_file(path)?;
    if !file.metadata().map_err(io)?.is_file() {
        return decode(&disk::read_file(path)?, path);
    }
    let length = file.seek(SeekFrom::End(0)).map_err(io)?;
    check_start(&piece(&mut file, 0, MAGIC.len() as u64).map_err(io)?, path)?;
    let from = length.saturating_sub(END_BYTES as u64);
    if !has_end(&piece(&mut file, from, END_BYTES as u64).map_err(io)?) {
        return Err(LogError::Torn(path.into()));
    }
    file.seek(SeekFrom::Start(0)).map_err(io)?;
    let mut recording = decode_stream(BufReader::with_capacity(1 << 16, file), length, path)?;
    // Effects in files are newer than those kept inside: they were written or changed after the test.
    let effects = beside(path.parent().unwrap_or(Path::new("")));
    recording.rig.own_effects.extend(effects.map_err(|e| LogError::Rig { path: path.into(), source: Box::new(e) })?);
    Ok(recording)
}

/// Makes known the own effects of a rig file, a recording or a folder, so that a command or a plan may name them.
/// Another file has none. What else is wrong with a file is reported when it is read for its own sake.
///
/// # Errors
/// The file of an effect that cannot be read.
pub fn read_own_effects(path: &Path) -> Result<(), RigError> {
    let found = match path.extension().and_then(|e| e.to_str()) {
        Some("toml") => Rig::load(path).map(drop),
        Some("mcap") => {
            drop(read(path));
            beside(path.parent().unwrap_or(Path::new(""))).map(drop)
        }
        _ if path.is_dir() => beside(path).map(drop),
        _ => Ok(()),
    };
    match found {
        Err(faulty @ RigError::Effect { .. }) => Err(faulty),
        _ => Ok(()),
    }
}

/// [`read`] of the bytes of a file.
pub fn decode(bytes: &[u8], path: &Path) -> Result<Recording, LogError> {
    check_start(bytes, path)?;
    if !has_end(bytes) {
        return Err(LogError::Torn(path.into()));
    }
    decode_stream(bytes, bytes.len() as u64, path)
}

/// One thread unpacks, this one takes: each has about half of the work of a long recording.
fn decode_stream(input: impl Read + Send, length: u64, path: &Path) -> Result<Recording, LogError> {
    let mut assembler = Assembler::default();
    let options = checked_options(length).with_check_finishes_after_end_magic(true);
    let read = std::thread::scope(|scope| {
        let (send, receive) = sync_channel::<Batch>(BATCHES_AHEAD);
        let (give_back, empty) = sync_channel::<Batch>(BATCHES_AHEAD);
        let unpacking = scope.spawn(move || {
            let mut batch = Batch::default();
            // nobody receives any more where a record was wrong, and that is the error to report
            let hand_over = |batch: &mut Batch| {
                let next = empty.try_recv().unwrap_or_default();
                send.send(std::mem::replace(batch, next)).map_err(|_| String::new())
            };
            raw_records(input, options, &mut Unpacked::of(length), |opcode, body| {
                batch.push(opcode, body);
                if batch.bodies.len() < BATCH_BYTES { Ok(()) } else { hand_over(&mut batch) }
            })?;
            hand_over(&mut batch)
        });
        for mut batch in receive {
            for (opcode, body) in batch.records() {
                assembler.take(parse(opcode, body).map_err(describe)?)?;
            }
            batch.clear();
            if batch.bodies.capacity() <= 4 * BATCH_BYTES {
                // if the channel is full, the batch is dropped
                let _ = give_back.try_send(batch);
            }
        }
        unpacking.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    });
    read.map_err(|why| LogError::Damaged { path: path.into(), why })?;
    assembler.assemble(path, None)
}

/// Bytes of records that change threads together, at least.
const BATCH_BYTES: usize = 1 << 16;
/// Batches that may wait.
const BATCHES_AHEAD: usize = 8;

/// Records one after the other.
#[derive(Default)]
struct Batch {
    bodies: Vec<u8>,
    /// Opcode and where the body ends.
    ends: Vec<(u8, usize)>,
}

impl Batch {
    fn push(&mut self, opcode: u8, body: &[u8]) {
        self.bodies.extend_from_slice(body);
        self.ends.push((opcode, self.bodies.len()));
    }

    fn clear(&mut self) {
        self.bodies.clear();
        self.ends.clear();
    }

    fn records(&self) -> impl Iterator<Item = (u8, &[u8])> {
        let starts = std::iter::once(0).chain(self.ends.iter().map(|end| end.1));
        starts.zip(&self.ends).map(|(start, &(opcode, end))| (opcode, &self.bodies[start..end]))
    }
}

/// Hands each record of the input, those in chunks included, to `take`, but for the indices of messages; stops at the
/// first error and returns it.
pub fn records(
    input: impl Read,
    options: LinearReaderOptions,
    unpacked: &mut Unpacked,
    mut take: impl FnMut(Record<'_>) -> Result<(), String>,
) -> Result<(), String> {
    raw_records(input, options, unpacked, |opcode, body| take(parse(opcode, body).map_err(describe)?))
}

fn raw_records(
    mut input: impl Read,
    options: LinearReaderOptions,
    unpacked: &mut Unpacked,
    mut take: impl FnMut(u8, &[u8]) -> Result<(), String>,
) -> Result<(), String> {
    let mut reader = LinearReader::new_with_options(options);
    while let Some(event) = reader.next_event() {
        match event.map_err(describe)? {
            LinearReadEvent::ReadRequest(need) => {
                let got = input.read(reader.insert(need)).map_err(|e| format!("it cannot be read ({e})"))?;
                reader.notify_read(got);
            }
            LinearReadEvent::Record { opcode, data } => {
                unpacked.add(RECORD_HEAD + data.len())?;
                if opcode != op::MESSAGE_INDEX {
                    take(opcode, data)?;
                }
            }
        }
    }
    Ok(())
}

/// Bytes of a record before its body: opcode and length.
pub const RECORD_HEAD: usize = 9;

/// How much a file may still unpack to: a small file is not to cost minutes, whatever it claims to hold.
pub struct Unpacked {
    left: u64,
}

impl Unpacked {
    /// Samples compress by far less than this.
    const RATIO: u64 = 100;
    /// Any file may unpack to this much, bytes.
    const LEAST: u64 = 64 << 20;

    /// Of a file of so many bytes.
    pub fn of(length: u64) -> Unpacked {
        Unpacked { left: length.saturating_mul(Unpacked::RATIO).saturating_add(Unpacked::LEAST) }
    }

    fn add(&mut self, bytes: usize) -> Result<(), String> {
        let left = self.left.checked_sub(bytes as u64);
        self.left = left.unwrap_or_default();
        left.map(drop).ok_or_else(|| {
            format!("it unpacks to more than {} times its size, which no recording does", Unpacked::RATIO)
        })
    }

    /// Options of a reader that unpacks no more at once than the file still may.
    pub fn options(&self, length: u64) -> LinearReaderOptions {
        let left = usize::try_from(self.left).unwrap_or(usize::MAX);
        checked_options(length).with_record_length_limit(length_limit(length).min(left))
    }
}

/// What a length field in so many bytes may ask for: a chunk of samples compresses by far less.
fn length_limit(length: u64) -> usize {
    usize::try_from(length).unwrap_or(usize::MAX).saturating_mul(100).max(1 << 24)
}

/// Check every CRC, each chunk's before its first message comes out. `length` of the input bounds what a
/// length field may ask for.
pub fn checked_options(length: u64) -> LinearReaderOptions {
    LinearReaderOptions::default()
        .with_prevalidate_chunk_crcs(true)
        .with_validate_data_section_crc(true)
        .with_validate_summary_section_crc(true)
        .with_record_length_limit(length_limit(length))
}

/// [`mcap::parse_record`], for bytes that may be anything: it takes the lengths in them on trust.
pub fn parse(opcode: u8, body: &[u8]) -> McapResult<Record<'_>> {
    if !texts_fit(opcode, body) {
        return Err(McapError::UnexpectedEoc);
    }
    if opcode == op::ATTACHMENT {
        let length_at = |at: usize| {
            let bytes = body.get(at..at.checked_add(4)?)?;
            Some(u32::from_le_bytes(bytes.try_into().ok()?) as usize)
        };
        let name = length_at(16);
        let media_type = name.and_then(|name| length_at(20usize.checked_add(name)?));
        let header = name.zip(media_type).map(|(name, media_type)| (name + media_type + 32) as u64);
        if header.is_none_or(|header| header + 4 > body.len() as u64) {
            return Err(McapError::BadAttachmentLength { header: header.unwrap_or(32), available: body.len() as u64 });
        }
    }
    match opcode {
        // nearly all records are messages, and these few lines read them many times as fast
        op::MESSAGE => message(body).ok_or(McapError::UnexpectedEoc),
        _ => mcap::parse_record(opcode, body),
    }
}

fn message(body: &[u8]) -> Option<Record<'_>> {
    let (channel_id, rest) = body.split_first_chunk()?;
    let (sequence, rest) = rest.split_first_chunk()?;
    let (log_time, rest) = rest.split_first_chunk()?;
    let (publish_time, data) = rest.split_first_chunk()?;
    let header = MessageHeader {
        channel_id: u16::from_le_bytes(*channel_id),
        sequence: u32::from_le_bytes(*sequence),
        log_time: u64::from_le_bytes(*log_time),
        publish_time: u64::from_le_bytes(*publish_time),
    };
    Some(Record::Message { header, data: Cow::Borrowed(data) })
}

/// Fails unless a file is there and begins as an MCAP file does.
///
/// # Errors
/// A file that is not there or cannot be read; [`LogError::NotMcap`], [`LogError::Torn`].
pub fn check_recording(path: &Path) -> Result<(), LogError> {
    let mut start = Vec::new();
    let read = disk::open_file(path)?.take(MAGIC.len() as u64).read_to_end(&mut start);
    read.map_err(|e| LogError::io("read", path, e))?;
    check_start(&start, path)
}

/// Fails unless this is the beginning of an MCAP file.
pub fn check_start(bytes: &[u8], path: &Path) -> Result<(), LogError> {
    let start = &bytes[..bytes.len().min(MAGIC.len())];
    if start == MAGIC {
        return Ok(());
    }
    if bytes.is_empty() {
        return Err(LogError::NotMcap { path: path.into(), hint: ": it is empty".into() });
    }
    if MAGIC.starts_with(start) {
        return Err(LogError::Torn(path.into()));
    }
    let is = |names: &[&str]| path.extension().is_some_and(|e| names.iter().any(|n| e.eq_ignore_ascii_case(n)));
    let hint = match () {
        () if is(&["csv", "txt", "tsv", "tdms", "xlsx", "xls", "ods"]) => {
            "; `surgescope import` makes a recording of a time series"
        }
        () if is(&["toml"]) => {
            "; a model file is for `surgescope open` or `surgescope model`, a rig file for `surgescope rig show`"
        }
        () => "",
    };
    Err(LogError::NotMcap { path: path.into(), hint: hint.into() })
}

/// Bytes of a footer: opcode, length and body; and of all that ends a file.
const FOOTER_BYTES: usize = 1 + 8 + 20;
const END_BYTES: usize = FOOTER_BYTES + MAGIC.len();

fn piece(file: &mut File, from: u64, bytes: u64) -> std::io::Result<Vec<u8>> {
    file.seek(SeekFrom::Start(from))?;
    let mut piece = Vec::new();
    file.take(bytes).read_to_end(&mut piece)?;
    Ok(piece)
}

/// True if the file ends with a footer and the closing magic bytes.
pub fn has_end(bytes: &[u8]) -> bool {
    let Some(body) = bytes.strip_suffix(MAGIC) else { return false };
    let footer = body.len().checked_sub(FOOTER_BYTES).and_then(|at| body.get(at..));
    footer.is_some_and(|f| f.starts_with(&[op::FOOTER, 20, 0, 0, 0, 0, 0, 0, 0]))
}

/// The same of a file, of which only the end is read.
///
/// # Errors
/// A file that cannot be read.
pub fn file_has_end(path: &Path) -> std::io::Result<bool> {
    let mut file = File::open(path)?;
    let from = file.metadata()?.len().saturating_sub(END_BYTES as u64);
    Ok(has_end(&piece(&mut file, from, END_BYTES as u64)?))
}

/// An error of the MCAP library for a user: the cause where the message only says that there is one.
pub fn describe(error: McapError) -> String {
    match error {
        McapError::Io(cause) => format!("a compressed chunk does not unpack ({cause})"),
        McapError::Parse(_) => "a record does not parse".into(),
        McapError::UnexpectedEoc => "a text in a record is longer than the record".into(),
        McapError::BadChunkCrc { .. } => "the check sum of a chunk is wrong".into(),
        McapError::BadDataCrc { .. } => "the check sum of its data is wrong".into(),
        McapError::BadSummaryCrc { .. } => "the check sum of its index is wrong".into(),
        McapError::BadAttachmentCrc { .. } => "the check sum of an attachment is wrong".into(),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    /// A file of a few kilobytes that holds so many mebibytes of zeros, honestly declared.
    fn bomb(mebibytes: usize) -> Vec<u8> {
        let mut file = Cursor::new(Vec::new());
        let options = mcap::WriteOptions::new().compression(Some(mcap::Compression::Zstd)).chunk_size(Some(8 << 20));
        let mut writer = mcap::Writer::with_options(&mut file, options).unwrap();
        let channel = writer.add_channel(0, "/zeros", "", &Default::default()).unwrap();
        let header = MessageHeader { channel_id: channel, sequence: 0, log_time: 0, publish_time: 0 };
        (0..mebibytes).for_each(|_| writer.write_to_known_channel(&header, &vec![0; 1 << 20]).unwrap());
        writer.finish().unwrap();
        drop(writer);
        file.into_inner()
    }

    #[test]
    fn what_a_small_file_unpacks_to_is_bounded() {
        let (small, large) = (bomb(16), bomb(80));
        assert!(large.len() < 50_000, "{}", large.len());
        let why = |bytes: &[u8]| decode(bytes, Path::new("bomb.mcap")).unwrap_err().to_string();
        assert!(why(&large).contains("100 times its size"), "{}", why(&large));
        assert!(!why(&small).contains("times its size"), "{}", why(&small));
        // recovering takes no more: chunks behind the limit are not unpacked
        let mut unpacked = Unpacked::of(large.len() as u64);
        let options = checked_options(large.len() as u64);
        assert!(records(&large[..], options, &mut unpacked, |_| Ok(())).is_err());
        assert_eq!(unpacked.left, 0);
    }
}
