//! Reads finished files, and trusts nothing whose check sum is wrong.

use std::path::Path;

use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{MAGIC, McapError, McapResult};

use crate::recording::Recording;
use crate::storage::assemble::Assembler;
use crate::storage::disk;
use crate::storage::error::LogError;
use crate::storage::lengths::texts_fit;

/// Reads a recording, with the rig from inside it.
///
/// # Errors
/// Says whether the file is no MCAP, not one of ours, cut off ([`LogError::Torn`]) or damaged: every CRC is checked, and
/// no sample is given out of a file in which anything is wrong.
pub fn read(path: &Path) -> Result<Recording, LogError> {
    decode(&disk::read_file(path)?, path)
}

/// [`read`] of the bytes of a file.
pub fn decode(bytes: &[u8], path: &Path) -> Result<Recording, LogError> {
    check_start(bytes, path)?;
    if !has_end(bytes) {
        return Err(LogError::Torn(path.into()));
    }
    let damaged = |why| LogError::Damaged { path: path.into(), why };
    let mut assembler = Assembler::default();
    records(bytes, checked_options(bytes.len() as u64).with_check_finishes_after_end_magic(true), |record| {
        assembler.take(record)
    })
    .map_err(damaged)?;
    assembler.assemble(path, None)
}

/// Hands each record of `bytes`, those in chunks included, to `take`; stops at the first error and says it.
pub fn records(
    bytes: &[u8],
    options: LinearReaderOptions,
    mut take: impl FnMut(Record<'_>) -> Result<(), String>,
) -> Result<(), String> {
    let mut reader = LinearReader::new_with_options(options);
    let mut rest = bytes;
    while let Some(event) = reader.next_event() {
        match event.map_err(describe)? {
            LinearReadEvent::ReadRequest(need) => {
                let (now, later) = rest.split_at(need.min(rest.len()));
                reader.insert(now.len()).copy_from_slice(now);
                reader.notify_read(now.len());
                rest = later;
            }
            LinearReadEvent::Record { opcode, data } => take(parse(opcode, data).map_err(describe)?)?,
        }
    }
    Ok(())
}

/// Check every CRC, each chunk's before its first message comes out. `length` of the input bounds what a
/// length field may ask for.
pub fn checked_options(length: u64) -> LinearReaderOptions {
    // A chunk of samples compresses by far less than this.
    let limit = usize::try_from(length).unwrap_or(usize::MAX).saturating_mul(100).max(1 << 24);
    LinearReaderOptions::default()
        .with_prevalidate_chunk_crcs(true)
        .with_validate_data_section_crc(true)
        .with_validate_summary_section_crc(true)
        .with_record_length_limit(limit)
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
    mcap::parse_record(opcode, body)
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
    let csv = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv"));
    let hint = if csv { "; `surgescope import` makes a recording of a time series" } else { "" };
    Err(LogError::NotMcap { path: path.into(), hint: hint.into() })
}

/// True if the file ends with a footer and the closing magic bytes.
pub fn has_end(bytes: &[u8]) -> bool {
    const FOOTER_BYTES: usize = 1 + 8 + 20;
    let Some(body) = bytes.strip_suffix(MAGIC) else { return false };
    let footer = body.len().checked_sub(FOOTER_BYTES).and_then(|at| body.get(at..));
    footer.is_some_and(|f| f.starts_with(&[op::FOOTER, 20, 0, 0, 0, 0, 0, 0, 0]))
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
