//! Makes a whole recording of one that a crash cut off or a disk damaged, and says what was lost.

use std::fmt;
use std::path::Path;

use mcap::records::op;
use serde::Serialize;

use crate::recording::{Recording, Series};
use crate::rig::{Protocol, Rig, Sensor};
use crate::storage::assemble::Assembler;
use crate::storage::disk;
use crate::storage::error::LogError;
use crate::storage::read::{RECORD_HEAD, Unpacked, check_start, describe, parse, records};
use crate::storage::summary::Summary;
use crate::storage::write::write;

/// What a recovery saved and what it could not.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Recovery {
    /// What the new recording holds.
    #[serde(flatten)]
    pub kept: Summary,
    /// Nothing was lost: the file was finished, or cut off only after its last sample.
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
        match self.bytes {
            0 => f.write_str(&self.reason),
            bytes => write!(f, "{bytes} bytes at byte {} of the file: {}", self.offset, self.reason),
        }
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
    let (recording, lost) = salvaged(&bytes, torn)?;
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

/// What is right in the bytes of the recording `torn`, with a note of each loss, and the losses.
///
/// # Errors
/// When it is not one of our recordings or was cut before its rig file was written.
pub fn salvaged(bytes: &[u8], torn: &Path) -> Result<(Recording, Vec<Loss>), LogError> {
    check_start(bytes, torn)?;
    let salvage = salvage(bytes);
    let mut lost = salvage.lost;
    let mut repeats = Vec::new();
    let mut recording = salvage.parts.assemble(torn, Some(&mut repeats))?;
    lost.extend(repeats.into_iter().map(|reason| Loss { offset: 0, bytes: 0, reason }));
    // what was imported came in rows, not in frames
    if !salvage.data_complete && !recording.run.source.starts_with("import ") {
        lost.extend(end_at_one_frame(&recording.rig, &mut recording.series).into_iter().map(|reason| Loss {
            offset: bytes.len() as u64,
            bytes: 0,
            reason,
        }));
    }
    if lost.is_empty() && !salvage.data_complete {
        let reason =
            "the recording has no end: what was not yet written when it stopped (at most some 20 ms) is missing";
        lost.push(Loss { offset: bytes.len() as u64, bytes: 0, reason: reason.into() });
    }
    recording.run.notes.extend(lost.iter().map(|loss| ("lost before recovery".into(), loss.to_string())));
    Ok((recording, lost))
}

/// Sensors of a device that end further apart than this do so for another reason than a frame that was not written
/// whole, s.
const LONGEST_FRAME_S: f64 = 1.0;

/// Ends the sensors of each device that sends frames at the last one of which all have their samples: what was written
/// of the next is a part of it. Says how many samples were left out.
fn end_at_one_frame(rig: &Rig, series: &mut [Series]) -> Vec<String> {
    let mut left_out = Vec::new();
    for device in rig.devices.iter().filter(|device| matches!(device.protocol, Protocol::Frames)) {
        let own = |sensor: &Sensor| sensor.wiring.as_ref().is_some_and(|wiring| wiring.device == device.name);
        let places: Vec<usize> = (0..rig.sensors.len()).filter(|&i| own(&rig.sensors[i])).collect();
        let last = |i: &usize| series[*i].time_s.last().copied();
        let Some(end_s) = places.iter().filter_map(last).reduce(f64::min) else { continue };
        let most_s = places.iter().filter_map(last).fold(end_s, f64::max);
        if most_s - end_s > LONGEST_FRAME_S {
            continue;
        }
        for i in places {
            let keep = series[i].time_s.partition_point(|t| *t <= end_s);
            let more = series[i].time_s.len() - keep;
            if more > 0 {
                series[i].time_s.truncate(keep);
                series[i].value.truncate(keep);
                series[i].gaps.retain(|gap| gap.to_s <= end_s);
                let name = &rig.sensors[i].name;
                left_out
                    .push(format!("{more} samples of {name} belong to a frame that was not written whole: left out"));
            }
        }
    }
    left_out
}

struct Salvage {
    parts: Assembler,
    unpacked: Unpacked,
    lost: Vec<Loss>,
    /// The end of the data was seen.
    data_complete: bool,
}

fn salvage(bytes: &[u8]) -> Salvage {
    let unpacked = Unpacked::of(bytes.len() as u64);
    let mut found = Salvage { parts: Assembler::default(), unpacked, lost: Vec::new(), data_complete: false };
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
        let end = at + RECORD_HEAD + body.len();
        let taken = match opcode {
            op::CHUNK => found.chunk(&bytes[at..end]),
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
    /// Takes what is right in a chunk whose check sum is; all of it, but for messages of channels lost elsewhere.
    fn chunk(&mut self, bytes: &[u8]) -> Result<(), String> {
        let options = self.unpacked.options(bytes.len() as u64).with_skip_start_magic(true).with_skip_end_magic(true);
        let mut wrong = Vec::new();
        records(bytes, options, &mut self.unpacked, |record| {
            wrong.extend(self.parts.take(record).err());
            Ok(())
        })?;
        match wrong.first() {
            Some(first) => Err(format!("{} of its messages cannot be used: {first}", wrong.len())),
            None => Ok(()),
        }
    }

    fn lose(&mut self, from: usize, to: usize, reason: String) {
        self.parts.lost();
        self.lost.push(Loss { offset: from as u64, bytes: (to - from) as u64, reason });
    }
}

/// Opcode and body of the record at `at`, if it is one and lies in the file.
fn record_at(bytes: &[u8], at: usize) -> Option<(u8, &[u8])> {
    let head = bytes.get(at..at + RECORD_HEAD)?;
    let length = u64::from_le_bytes(head[1..].try_into().ok()?);
    let end = (at + RECORD_HEAD).checked_add(usize::try_from(length).ok()?)?;
    // Opcode 0 is none: a disk that lost its last pages in a power cut gives zeros.
    (head[0] != 0).then_some((head[0], bytes.get(at + RECORD_HEAD..end)?))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::{Recording, RunInfo};
    use crate::storage::fixtures::{assert_same, place, play, recording, rig};
    use crate::storage::read::decode;
    use crate::storage::{Writer, read};

    /// The bytes of a finished file and of a live one, of the same recording.
    fn files() -> [Vec<u8>; 2] {
        let (_folder, path) = place("run.mcap");
        write(&path, &recording()).unwrap();
        let finished = std::fs::read(&path).unwrap();
        let live = path.with_file_name("live.mcap");
        let recording = recording();
        let mut writer = Writer::create(&live, &recording.rig, &recording.run).unwrap();
        play(&recording, &mut writer).unwrap();
        [finished, std::fs::read(&live).unwrap()]
    }

    fn saved(bytes: &[u8]) -> Result<Recording, LogError> {
        check_start(bytes, Path::new("x"))?;
        salvage(bytes).parts.assemble(Path::new("x"), Some(&mut Vec::new()))
    }

    /// Every sample is one of the truth, at its time; returns their number.
    fn assert_nothing_wrong(got: &Recording, truth: &Recording) -> usize {
        for (got, truth) in got.series.iter().zip(&truth.series) {
            for (time, value) in got.time_s.iter().zip(&got.value) {
                let place = truth.time_s.iter().position(|t| t == time).expect("a time of the truth");
                assert_eq!(value.to_bits(), truth.value[place].to_bits());
            }
        }
        got.series.iter().map(|s| s.time_s.len()).sum()
    }

    #[test]
    fn cut_at_any_byte_gives_an_error_or_true_samples_only() {
        let truth = recording();
        for bytes in files() {
            let mut most = 0;
            for length in 0..bytes.len() {
                let cut = &bytes[..length];
                let error = decode(cut, Path::new("x")).expect_err("a cut file is no recording");
                assert!(matches!(error, LogError::Torn(_) | LogError::NotMcap { .. }), "{error}");
                match saved(cut) {
                    Ok(recording) => {
                        let samples = assert_nothing_wrong(&recording, &truth);
                        assert!(samples >= most, "{samples} samples of {length} bytes, {most} of fewer");
                        most = samples;
                    }
                    Err(error) => {
                        assert!(
                            matches!(error, LogError::NotOurs { .. } | LogError::Torn(_) | LogError::NotMcap { .. }),
                            "{error}"
                        );
                        assert_eq!(most, 0);
                    }
                }
            }
            let all = assert_nothing_wrong(&saved(&bytes).unwrap(), &truth);
            assert_eq!(all, truth.series.iter().map(|s| s.time_s.len()).sum::<usize>());
            assert!(most >= 30, "only the last chunk may be missing: {most}");
        }
    }

    #[test]
    fn the_channels_of_a_device_end_at_one_frame() {
        let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("rigs/demo-hdpe.toml")).unwrap();
        let rig = Rig::from_toml(&text, "demo-hdpe.toml").unwrap();
        let series = |samples: usize| Series {
            time_s: (0..samples).map(|i| i as f64 * 1e-3).collect(),
            value: vec![1.0; samples],
            gaps: vec![],
        };
        let mut all: Vec<Series> = [1900, 1900, 900, 1900, 1900].map(series).into();
        all.resize(rig.sensors.len(), Series::default());
        let left_out = end_at_one_frame(&rig, &mut all);
        let of_daq = |i: usize| rig.sensors[i].wiring.is_some();
        let lengths: Vec<usize> = (0..5).filter(|i| of_daq(*i)).map(|i| all[i].time_s.len()).collect();
        assert!(lengths.len() > 3 && lengths.iter().all(|n| *n == 900), "{lengths:?}");
        assert!(left_out[0].starts_with("1000 samples of P1"), "{left_out:?}");
        let mut apart: Vec<Series> = [4000, 4000, 1000, 4000, 4000].map(series).into();
        apart.resize(rig.sensors.len(), Series::default());
        assert_eq!(end_at_one_frame(&rig, &mut apart), Vec::<String>::new(), "three seconds are no frame");
        assert_eq!(apart[0].time_s.len(), 4000);
    }

    /// Blocks of a fast sensor beside samples of a slow one, with renewals of the writer between them.
    #[test]
    fn ten_thousand_cuts_of_a_fast_recording_give_true_samples_only() {
        let (_folder, path) = place("fast.mcap");
        let make = |path: &Path| {
            let mut writer = Writer::create(path, &rig(), &RunInfo::default()).unwrap();
            for block in 0..20 {
                let values: Vec<f64> = (0..100).map(|i| f64::from(100 * block + i)).collect();
                writer.samples(0, i64::from(block) * 4_000_000, 20_000.0, &values).unwrap();
                writer.samples(1, i64::from(block) * 4_000_000, 1e6, &values[..4]).unwrap();
                writer.flush().unwrap();
            }
            writer
        };
        let live = path.with_file_name("live.mcap");
        drop(make(&live));
        make(&path).finish().unwrap();
        let mut dice = fastrand::Rng::with_seed(9);
        for bytes in [live, path].map(|path| std::fs::read(path).unwrap()) {
            let mut all = 0;
            for cut in 0..5000 {
                let length = if cut == 0 { bytes.len() } else { dice.usize(..bytes.len()) };
                let Ok(recording) = saved(&bytes[..length]) else { continue };
                for (series, period_s, per_block) in [(0, 20e-6, 100), (1, 1e-3, 4)] {
                    let series = &recording.series[series];
                    for (at, (time_s, value)) in series.time_s.iter().zip(&series.value).enumerate() {
                        let (block, within) = (at / per_block, at % per_block);
                        assert_eq!(*value, (100 * block + within) as f64);
                        assert!((time_s - (block as f64 * 4e-3 + within as f64 * period_s)).abs() < 1e-12);
                    }
                }
                all = all.max(recording.series[0].value.len());
            }
            assert_eq!(all, 2000, "the whole file gives everything");
        }
    }

    #[test]
    fn a_flipped_bit_anywhere_never_gives_a_wrong_sample() {
        let truth = recording();
        let [finished, live] = files();
        for at in 0..finished.len() {
            let mut bytes = finished.clone();
            bytes[at] ^= 1 << (at % 8);
            if let Ok(recording) = decode(&bytes, Path::new("x")) {
                assert_same(&recording, &truth);
            }
        }
        let mut saved_most = 0;
        for bytes in [finished, live] {
            for at in 0..bytes.len() {
                let mut bytes = bytes.clone();
                bytes[at] ^= 1 << (at % 8);
                if let Ok(recording) = saved(&bytes) {
                    saved_most += usize::from(assert_nothing_wrong(&recording, &truth) > 25);
                }
            }
        }
        assert!(saved_most > 1000, "one flip costs one chunk: {saved_most}");
    }

    #[test]
    fn a_whole_file_is_copied_and_nothing_is_lost() {
        let (_folder, path) = place("run.mcap");
        write(&path, &recording()).unwrap();
        let out = path.with_file_name("out.mcap");
        let recovery = recover(&path, &out).unwrap();
        assert!(recovery.whole && recovery.lost.is_empty() && recovery.bytes_lost == 0);
        assert_same(&read(&out).unwrap(), &recording());
        assert!(matches!(recover(&path, &out), Err(LogError::Exists(_))));
    }

    #[test]
    fn damage_between_samples_becomes_a_gap_and_a_note() {
        let (_folder, path) = place("run.mcap");
        let mut writer = Writer::create(&path, &rig(), &RunInfo::default()).unwrap();
        let mut ends = Vec::new();
        for block in 0..4 {
            writer.samples(0, block * 10_000_000, 1e6, &[block as f64; 10]).unwrap();
            if block == 0 {
                writer.sample(2, 0, 7.0).unwrap();
            }
            writer.flush().unwrap();
            ends.push(std::fs::metadata(&path).unwrap().len() as usize);
        }
        writer.samples(2, 40_000_000, 1e9, &[8.0]).unwrap();
        drop(writer);
        let mut bytes = std::fs::read(&path).unwrap();
        // Chunk 1 with its head, as a bad sector takes it; one byte within chunk 2.
        bytes[ends[0]..ends[0] + 100].fill(0xff);
        bytes[ends[2] - 3] ^= 1;
        std::fs::write(&path, bytes).unwrap();
        let out = path.with_file_name("out.mcap");
        let recovery = recover(&path, &out).unwrap();
        assert!(!recovery.whole && recovery.lost.len() == 2, "{:?}", recovery.lost);
        assert_eq!(recovery.bytes_lost as usize, ends[2] - ends[0]);
        let recording = read(&out).unwrap();
        assert_eq!(recording.series[0].value, [vec![0.0; 10], vec![3.0; 10]].concat());
        let gaps: Vec<_> = recording.series[0].gaps.iter().map(|g| (g.from_s, g.to_s, g.samples)).collect();
        assert_eq!(gaps, [(0.009, 0.03, None)]);
        assert_eq!(recording.run.notes.len(), 2);
    }
}
