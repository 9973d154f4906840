//! Makes a whole recording of one that a crash cut off or a disk damaged, and says what was lost.

use std::fmt;
use std::path::Path;

use mcap::records::op;
use mcap::sans_io::LinearReaderOptions;
use serde::Serialize;

use super::assemble::Assembler;
use super::read::{check_start, checked_options, describe, has_end, parse, records};
use super::{LogError, Summary, disk, write};

/// What a recovery saved and what it could not.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Recovery {
    /// What the new recording holds.
    #[serde(flatten)]
    pub kept: Summary,
    /// The file was finished and nothing in it was wrong.
    pub whole: bool,
    /// Bytes of the torn file.
    pub bytes: u64,
    /// Bytes of it that could not be used.
    pub bytes_lost: u64,
    /// Recording time of the last sample saved, s.
    pub last_good_time_s: Option<f64>,
    /// Each loss.
    pub lost: Vec<Loss>,
}

/// One stretch of a file that could not be used.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Loss {
    /// Where it starts in the file.
    pub offset: u64,
    /// How long it is.
    pub bytes: u64,
    /// Why.
    pub reason: String,
}

impl fmt::Display for Loss {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} bytes at byte {} of the file: {}", self.bytes, self.offset, self.reason)
    }
}

/// Writes what is right in `torn` to `out`, a new finished file. Losses between samples become gaps, and the file
/// gets a note of each.
///
/// # Errors
/// When `torn` is not one of our recordings or was cut before its rig file was written, when `out` exists, or when it
/// cannot be written.
pub fn recover(torn: &Path, out: &Path) -> Result<Recovery, LogError> {
    disk::refuse_existing(out)?;
    let bytes = disk::read_file(torn)?;
    check_start(&bytes, torn)?;
    let salvage = salvage(&bytes);
    let mut lost = salvage.lost;
    let mut repeats = Vec::new();
    let mut recording = salvage.parts.assemble(torn, Some(&mut repeats))?;
    lost.extend(repeats.into_iter().map(|reason| Loss { offset: 0, bytes: 0, reason }));
    let whole = lost.is_empty() && has_end(&bytes);
    if !whole && !salvage.data_complete && lost.is_empty() {
        let reason =
            "the recording has no end: what was not yet written when it stopped (at most some 20 ms) is missing";
        lost.push(Loss { offset: bytes.len() as u64, bytes: 0, reason: reason.into() });
    }
    recording.run.notes.extend(lost.iter().map(|loss| ("lost before recovery".into(), loss.to_string())));
    write(out, &recording)?;
    let last = recording.series.iter().filter_map(|s| s.time_s.last().copied()).reduce(f64::max);
    Ok(Recovery {
        kept: Summary::of(&recording),
        whole: lost.is_empty(),
        bytes: bytes.len() as u64,
        bytes_lost: lost.iter().map(|l| l.bytes).sum(),
        last_good_time_s: last,
        lost,
    })
}

struct Salvage {
    parts: Assembler,
    lost: Vec<Loss>,
    /// The end of the data was seen.
    data_complete: bool,
}

/// Bytes of a record before its body: opcode and length.
const HEAD: usize = 9;

fn salvage(bytes: &[u8]) -> Salvage {
    let mut found = Salvage { parts: Assembler::default(), lost: Vec::new(), data_complete: false };
    let mut at = mcap::MAGIC.len();
    while at < bytes.len() {
        let Some((opcode, body)) = record_at(bytes, at) else {
            // The length is cut off or wrong: go on at the next chunk that is surely one.
            let next = (at + 1..bytes.len()).find(|&i| is_chunk(bytes, i)).unwrap_or(bytes.len());
            let reason = if next == bytes.len() { "the file ends within a record" } else { "not a record" };
            found.lose(at, next, reason.into());
            at = next;
            continue;
        };
        let end = at + HEAD + body.len();
        let taken = match opcode {
            op::CHUNK => {
                let options = LinearReaderOptions {
                    skip_start_magic: true,
                    skip_end_magic: true,
                    ..checked_options(bytes.len() as u64)
                };
                records(&bytes[at..end], options, |record| found.parts.take(record))
            }
            op::DATA_END => {
                found.data_complete = true;
                break;
            }
            _ => parse(opcode, body).map_err(describe).and_then(|record| found.parts.take(record)),
        };
        if let Err(reason) = taken {
            found.lose(at, end, reason);
        }
        at = end;
    }
    found
}

impl Salvage {
    fn lose(&mut self, from: usize, to: usize, reason: String) {
        self.parts.lost();
        self.lost.push(Loss { offset: from as u64, bytes: (to - from) as u64, reason });
    }
}

/// Opcode and body of the record at `at`, if it is one and lies in the file.
fn record_at(bytes: &[u8], at: usize) -> Option<(u8, &[u8])> {
    let head = bytes.get(at..at + HEAD)?;
    let length = u64::from_le_bytes(head[1..].try_into().ok()?);
    let end = (at + HEAD).checked_add(usize::try_from(length).ok()?)?;
    // Opcode 0 is none: a disk that lost its last pages in a power cut gives zeros.
    (head[0] != 0).then_some((head[0], bytes.get(at + HEAD..end)?))
}

/// True if a chunk surely starts here: its three lengths agree.
fn is_chunk(bytes: &[u8], at: usize) -> bool {
    if bytes[at] != op::CHUNK {
        return false;
    }
    let Some((_, body)) = record_at(bytes, at) else { return false };
    let number = |from: usize, size: usize| {
        let bytes = body.get(from..from.checked_add(size)?)?;
        Some(bytes.iter().rev().fold(0u64, |n, b| n << 8 | u64::from(*b)))
    };
    let compression = number(28, 4).unwrap_or(u64::MAX);
    let size = usize::try_from(compression).ok().and_then(|c| number(32usize.checked_add(c)?, 8));
    size.is_some_and(|size| size.checked_add(40 + compression) == Some(body.len() as u64))
}
