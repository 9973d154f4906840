//! What can go wrong with recordings on disk, in sentences for users.

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::rig::RigError;
use crate::shown::Shown as _;

/// A recording or a time series could not be read or written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum LogError {
    /// The operating system refused.
    #[error("cannot {action} {}", path.shown())]
    Io {
        /// `read`, `write`, …
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The file to read does not exist.
    #[error("{} does not exist: check the path", .0.shown())]
    Missing(PathBuf),
    /// A folder where a file is expected.
    #[error("{} is a folder: name a file in it", .0.shown())]
    Folder(PathBuf),
    /// A device or a socket where a file is expected.
    #[error("{} is neither a file nor a pipe: name a file", .0.shown())]
    NoFile(PathBuf),
    /// More than can be held in memory.
    #[error("{} has {gib:.1} GiB or more, which do not fit into memory: cut it into parts", path.shown())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its size, GiB.
        gib: f64,
    },
    /// The folder to write in is not there.
    #[error("the folder {} does not exist: create it, or write elsewhere", .0.shown())]
    NoFolder(PathBuf),
    /// The file to write exists already.
    #[error("{} exists already and recordings are never overwritten: choose another name or move it away", .0.shown())]
    Exists(PathBuf),
    /// Not MCAP at all.
    #[error("{} is not an MCAP file{hint}", path.shown())]
    NotMcap {
        /// The file.
        path: PathBuf,
        /// What to do, starting with a separator; may be empty.
        hint: String,
    },
    /// MCAP, but not written by this program.
    #[error("{} is an MCAP file, but not a surgescope recording: {why}", path.shown())]
    NotOurs {
        /// The file.
        path: PathBuf,
        /// What is missing.
        why: String,
    },
    /// The end of the file is missing.
    #[error("{file} has no end: its recording was cut off, or is still running; `surgescope recover {file} -o NEW.mcap` saves what is in it", file = .0.shown())]
    Torn(PathBuf),
    /// A check sum or a message is wrong.
    #[error("{file} is damaged: {why}; `surgescope recover {file} -o NEW.mcap` saves the rest", file = path.shown())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong and where.
        why: String,
    },
    /// The rig file inside a recording does not parse.
    #[error("the rig file inside {} is not valid", path.shown())]
    Rig {
        /// The recording.
        path: PathBuf,
        /// What is wrong with it; boxed, for it is large.
        source: Box<RigError>,
    },
    /// A channel and the rig inside the same file contradict each other.
    #[error("{}: {why}", path.shown())]
    OtherRig {
        /// The recording.
        path: PathBuf,
        /// Which sensor, and what the rig has.
        why: String,
    },
    /// Samples that no recording may hold were handed to a writer.
    #[error("cannot record to {}: {why}", path.shown())]
    BadSamples {
        /// The file being written.
        path: PathBuf,
        /// Which sensor, and why.
        why: String,
    },
    /// It has the channels already that are to be added.
    #[error("{} holds the values of a model already: export the recording that it was made from", .0.shown())]
    HasModel(PathBuf),
    /// Its times are not final.
    #[error("{file} was closed in haste, with clocks that are still to be applied: `surgescope recover {file} -o NEW.mcap` does it; export that", file = .0.shown())]
    ClocksLeft(PathBuf),
    /// Something is wrong in a time series.
    #[error("{}{}: {problem}", path.shown(), line.map(|l| format!(":{l}")).unwrap_or_default())]
    Csv {
        /// The file.
        path: PathBuf,
        /// Its line, from 1.
        line: Option<usize>,
        /// What is wrong.
        problem: Box<CsvProblem>,
    },
    /// Something is wrong in a file of another program that has no lines.
    #[error("{}: {why}", path.shown())]
    SourceFile {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what to do.
        why: String,
    },
    /// No file of several has a sensor of the rig.
    #[error(transparent)]
    Sensors(Box<CsvProblem>),
    /// The disk refused the last samples.
    #[error("{file} lacks its last samples; `surgescope recover {file} -o NEW.mcap` saves those before", file = path.shown())]
    CutShort {
        /// The live file.
        path: PathBuf,
        /// Why.
        source: Box<LogError>,
    },
    /// The live file no longer stands at its name, and a finished one could not be put there either.
    #[error("{file} was moved or deleted while it was written, and could not be rewritten: if it was moved, run `surgescope recover` on it at its new place; if it was deleted, its samples are lost", file = path.shown())]
    Gone {
        /// Where it was.
        path: PathBuf,
        /// Why it could not be written anew.
        source: Box<LogError>,
    },
    /// The live file was written whole, but could not be turned into a finished one.
    #[error("every sample is safe in {file}, but it could not be finished; once the cause is gone, `surgescope recover {file} -o NEW.mcap` does it", file = path.shown())]
    Unfinished {
        /// The live file.
        path: PathBuf,
        /// Why.
        source: Box<LogError>,
    },
}

/// What is wrong in a time series.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum CsvProblem {
    /// Nothing in it.
    #[error("the file is empty: expected a header like time_s,P1,P2 and a line for each time")]
    Empty,
    /// No column of times.
    #[error("no column holds times{named}. The columns are {columns}")]
    NoTimes {
        /// What to do about it.
        named: String,
        /// Whether the rate of the samples is what lacks.
        counted: bool,
        /// The columns.
        columns: String,
    },
    /// Times that are written in a way that is not known.
    #[error(
        "column '{column}' holds times that cannot be read, such as '{cell}': write them like 2026-03-14 09:26:53.250, like 09:26:53.250 or in seconds; or, for samples that are evenly apart, give their rate with option `rate`"
    )]
    TimesUnread {
        /// The column.
        column: String,
        /// The first of them.
        cell: String,
    },
    /// A line that is none of a table.
    #[error("a line is longer than {mebibytes} MiB: this is no table of samples")]
    LongLine {
        /// The longest that is read.
        mebibytes: usize,
    },
    /// A header and no line under it.
    #[error("there is a header but no line of samples under it")]
    HeaderOnly,
    /// A file of another kind.
    #[error("this is {what}, no table: {doing}")]
    OtherKind {
        /// What it is.
        what: &'static str,
        /// What to do with it.
        doing: &'static str,
    },
    /// Bytes that are not text.
    #[error("not UTF-8 text{hint}: save it as a CSV in UTF-8")]
    NotUtf8 {
        /// What it probably is, starting with a space; may be empty.
        hint: &'static str,
    },
    /// Bytes that the encoding which the user gave does not have.
    #[error("this is no text in {encoding}: give the right one with option `encoding`, or leave the option out")]
    NotInEncoding {
        /// Its name.
        encoding: &'static str,
    },
    /// The first column is not `time_s`.
    #[error("the first column must be time_s (times in seconds), but it is '{found}'{hint}")]
    NoTimeColumn {
        /// What stands there.
        found: String,
        /// What to do, starting with a separator; may be empty.
        hint: String,
    },
    /// A sensor of the rig has no column.
    #[error(
        "no column for the {kind} sensor '{sensor}' of rig '{rig}'; the columns are {found}{hint} Rename the column, use the rig file of this test, or leave the sensor out with option `without {sensor}`"
    )]
    MissingColumn {
        /// The sensor.
        sensor: String,
        /// What it measures.
        kind: &'static str,
        /// The rig's name.
        rig: String,
        /// Columns of the file.
        found: String,
        /// The nearest column, as a question; a full stop where none is near.
        hint: String,
    },
    /// A column that no sensor has.
    #[error(
        "column '{column}' is no sensor of rig '{rig}', which has {known}{hint} Rename or remove the column, or use the rig file of this test"
    )]
    UnknownColumn {
        /// The column.
        column: String,
        /// The rig's name.
        rig: String,
        /// Sensors of the rig.
        known: String,
        /// The nearest sensor, as a question; a full stop where none is near.
        hint: String,
    },
    /// Two columns of one name.
    #[error("column '{0}' appears twice in the header: keep one")]
    DuplicateColumn(String),
    /// A sensor to leave out that the rig does not have, or that has a column.
    #[error("option `without {sensor}`: {why}")]
    BadWithout {
        /// The sensor.
        sensor: String,
        /// What is wrong.
        why: String,
    },
    /// A last line without its end.
    #[error("the file ends within this line: its last number is shorter than all those above it. Remove the line")]
    CutOff,
    /// A line with too many or too few cells.
    #[error("{found} cells where the header has {expected}: a decimal comma, or a separator too many or too few?")]
    Ragged {
        /// Cells of the line.
        found: usize,
        /// Columns of the header.
        expected: usize,
    },
    /// A cell that is not a number.
    #[error("column '{column}': '{cell}' is not a number; leave the cell empty where there is no sample")]
    NotANumber {
        /// The column.
        column: String,
        /// What stands there.
        cell: String,
    },
    /// NaN or an infinity.
    #[error("column '{column}': '{cell}' is not a finite number; leave the cell empty where there is no sample")]
    NotFinite {
        /// The column.
        column: String,
        /// What stands there.
        cell: String,
    },
    /// A line without a time.
    #[error("column 'time_s' is empty: every line needs its time")]
    NoTime,
    /// Lines without a time, too many to do without.
    #[error(
        "{count} of {rows} lines have no time, this one first: that is too many to leave out; write the time of every line"
    )]
    TimesMissing {
        /// Lines whose time is empty or nan.
        count: usize,
        /// Lines in all.
        rows: usize,
    },
    /// A time beyond what the log's nanoseconds can hold.
    #[error("column 'time_s': {0} s is out of range; times are seconds, within ±290 years of the recording's time 0")]
    TimeOutOfRange(String),
    /// Times that run backwards or repeat.
    #[error(
        "column 'time_s': {time} does not come after {previous} of line {previous_line}; times must increase from line to line: if another run begins here, split the file; if the clock was set back, leave it out with option `ignore` and give option `rate`"
    )]
    TimeNotIncreasing {
        /// The time of this line, as written.
        time: String,
        /// The time before it, as written.
        previous: String,
        /// Where that stands.
        previous_line: usize,
    },
    /// A sensor whose column is empty throughout.
    #[error(
        "column '{column}': the pressure sensor has no sample in the whole file; if it was not recorded, remove the column and add option `without {column}`"
    )]
    NoSamples {
        /// The column.
        column: String,
    },
    /// Decimal points and decimal commas in one file.
    #[error(
        "column '{column}': '{cell}' has another decimal mark than the numbers before it, so its value is ambiguous: use one mark throughout"
    )]
    TwoDecimalMarks {
        /// The column.
        column: String,
        /// What stands there.
        cell: String,
    },
    /// A date whose day and month are ambiguous.
    #[error(
        "'{0}' may be two dates, and no other line shows which: add option `date_order dmy` or option `date_order mdy`"
    )]
    WhichDay(String),
    /// A cell that is no date-time where the others are.
    #[error("'{0}' is not a time like those of the lines above")]
    NotATime(String),
    /// A time out of order that is none of the grid's.
    #[error(
        "the time of this line, {time_s} s, is out of order and falls between the other times, which are {step_s} s apart: it is wrong, or the file holds two runs; correct it, or split the file"
    )]
    OffTheGrid {
        /// The time, s.
        time_s: f64,
        /// Step of the others, s.
        step_s: f64,
    },
    /// Times with too few digits.
    #[error(
        "{repeats} of {rows} lines repeat the time of the line above: the times are written too coarsely for this sample rate; give the rate with option \
         `rate`{likely}, or export the times with more decimals"
    )]
    TimesTooCoarse {
        /// Lines that repeat a time.
        repeats: usize,
        /// All lines.
        rows: usize,
        /// The rate that they seem to have, starting with a separator; may be empty.
        likely: String,
    },
    /// A rate that the times of the file contradict.
    #[error(
        "at {rate_hz} samples a second, this line would come later than its time, '{time}', says: the rate or the time is wrong; give another rate with option `rate`"
    )]
    RateContradicted {
        /// The rate, Hz.
        rate_hz: f64,
        /// The time, as written.
        time: String,
    },
    /// A rate beside times that tell another one.
    #[error(
        "column '{column}' holds times, {step_s} s apart, and option `rate {rate_hz}` says otherwise: leave the rate out; if the times are wrong, add option `ignore '{column}'`"
    )]
    RateBesideTimes {
        /// The rate, Hz.
        rate_hz: f64,
        /// The column of times.
        column: String,
        /// Their step, s.
        step_s: String,
    },
    /// Two clocks of one table of which one must be in another unit.
    #[error(
        "'{device}' runs for {device_s} s, and '{host}' for {host_s} s: one of them is in another unit than it says; leave the wrong one out, as in option `ignore '{device}'`, or correct its heading"
    )]
    ClocksApart {
        /// The heading of the device's clock, and how long it runs, s.
        device: String,
        /// See `device`.
        device_s: String,
        /// The heading of the date-times, and how long they run, s.
        host: String,
        /// See `host`.
        host_s: String,
    },
    /// A number without the unit that stands behind the others.
    #[error(
        "column '{column}': '{cell}' is not in '{unit}', as the numbers above say they are: write one unit throughout"
    )]
    NoUnit {
        /// The column.
        column: String,
        /// What stands there.
        cell: String,
        /// The unit of the others.
        unit: String,
    },
    /// Headings of other columns among the rows.
    #[error(
        "other headings stand in this line: another table begins here; cut the file in two, and name both files in one import if they are one run"
    )]
    AnotherTable,
    /// A row above the first one that can be read.
    #[error("this line looks like a row and cannot be read as one: correct it, or make a comment of it (#)")]
    NotARow,
    /// A column of two units.
    #[error(
        "column '{column}' is in '{first}' by its heading and in '{second}' by what stands elsewhere: give the unit that is right with option `scale '{column}={first}'`, or correct the file"
    )]
    TwoUnits {
        /// Its heading.
        column: String,
        /// The unit of its heading.
        first: String,
        /// That of the line.
        second: String,
    },
    /// The ends of each interval, and nothing between them.
    #[error(
        "columns '{largest}' and '{least}' hold the largest and the least value of each interval, and no column holds the values between: leave one out with option `ignore '{least}'`, or keep both by saying what their numbers stand for, each with option `scale '{largest}=UNIT'`"
    )]
    EndsAlone {
        /// The column of the largest values.
        largest: String,
        /// That of the least.
        least: String,
    },
    /// A pressure above the vacuum, where nothing says what the atmosphere was.
    #[error(
        "column '{column}' is absolute ('{unit}'), and a sensor's pressure counts from the atmosphere: accept the standard one as a guess, or give the \
         column's line with option `scale`, such as '{column}=x-1.013'"
    )]
    Absolute {
        /// The column.
        column: String,
        /// Its unit.
        unit: String,
    },
    /// A unit that the sensor's samples cannot have.
    #[error(
        "column '{column}' is in '{unit}', which is no known {kind} unit (known are {known}); give its line, as in option `scale {remedy}`, or correct the heading"
    )]
    WrongUnit {
        /// The column.
        column: String,
        /// Its unit.
        unit: String,
        /// What the sensor measures.
        kind: &'static str,
        /// Units that it may have.
        known: String,
        /// A line for it, as it may look.
        remedy: String,
    },
    /// Nothing to calibrate with.
    #[error("no pressure sensor is left: a recording needs at least one")]
    NoPressure,
}

/// A line of a time series, from 1, where there is one, and what is wrong there.
pub(crate) type CsvFault = (Option<usize>, Box<CsvProblem>);

impl LogError {
    /// Whether the file can be read as soon as somebody knows the rate of its samples.
    #[must_use]
    pub fn lacks_rate(&self) -> bool {
        matches!(self, LogError::Csv { problem, .. } if matches!(**problem, CsvProblem::NoTimes { counted: true, .. }))
    }

    /// An I/O failure on `path`, with the plain cases in plain words.
    pub(crate) fn io(action: &'static str, path: &Path, source: io::Error) -> Self {
        match source.kind() {
            io::ErrorKind::NotFound if action == "read" => LogError::Missing(path.into()),
            io::ErrorKind::IsADirectory => LogError::Folder(path.into()),
            io::ErrorKind::AlreadyExists => LogError::Exists(path.into()),
            _ => LogError::Io { action, path: path.into(), source },
        }
    }

    /// A failure of the MCAP writer on `path`; nearly always the disk's.
    pub(crate) fn write(path: &Path, error: mcap::McapError) -> Self {
        match error {
            mcap::McapError::Io(source) => LogError::io("write", path, source),
            other => LogError::Io { action: "write", path: path.into(), source: io::Error::other(other) },
        }
    }
}
