//! Other people's data: what other programs write, read as named tracks of numbers with times, then brought to the sensors
//! of a rig.
//!
//! | file | what it does |
//! | --- | --- |
//! | `csv/` | text tables, however they are written, with a report of what was mended |
//! | `tdms/` | NI TDMS |
//! | `mcap`, `fields` | MCAP of other programs: JSON and protobuf messages |
//! | `gaps` | gaps of a track where its file says that there is no number |
//! | `file` | one file becomes a recording |
//! | `bind` | tracks → sensors: names, units, what is left out |
//! | `doubt` | values that look like those of another unit |

pub(crate) mod bind;
pub(crate) mod csv;
pub(crate) mod doubt;
pub(crate) mod fields;
pub(crate) mod file;
pub(crate) mod gaps;
pub(crate) mod mcap;
pub(crate) mod tdms;

use std::path::Path;

use serde::Serialize;

use crate::recording::Series;
use crate::storage::{LogError, disk};

pub use crate::storage::foreign::bind::{bind, require_sensors};
pub(crate) use crate::storage::foreign::csv::{comment_notes, even_holes};
pub use crate::storage::foreign::csv::{time_unit, zone_seconds};
pub use crate::storage::foreign::doubt::doubts;
pub use crate::storage::foreign::file::{Imported, import_file};

/// What a file of another program holds.
#[derive(Debug, Clone, Default)]
pub struct Foreign {
    /// Its columns, channels or fields.
    pub tracks: Vec<Track>,
    /// Wall-clock time of its time 0, where it says so.
    pub start: Option<Start>,
    /// What it says of itself: comments, properties.
    pub notes: Vec<(String, String)>,
    /// What was mended on the way.
    pub mended: Vec<Mended>,
    /// Tracks that no sensor wants are left out silently (a table's columns are not: one may be misspelt).
    pub spare_tracks: bool,
}

/// A wall-clock time, and how finely it was written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Start {
    /// Nanoseconds since 1970 UTC.
    pub unix_ns: u64,
    /// Value of its last digit, s.
    pub digit_s: f64,
}

/// One column, channel or field.
#[derive(Debug, Clone, Default)]
pub struct Track {
    /// Its full name.
    pub name: String,
    /// A shorter name that it may be known by.
    pub short: String,
    /// Its unit, as written.
    pub unit: Option<String>,
    /// Its samples, in that unit.
    pub series: Series,
    /// What was mended of it, said where it is a sensor.
    pub mended: Vec<Mended>,
}

/// Something about a file that was put right, or could not be.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Mended {
    /// What it was, in one word: `separator`, `duplicate-times`, `unit`, ….
    pub what: &'static str,
    /// How often.
    pub count: usize,
    /// Where first, as a line of the file from 1.
    pub line: Option<usize>,
    /// The sentence for a user.
    pub text: String,
    /// Data was lost by it.
    pub lost: bool,
}

impl Mended {
    fn new(what: &'static str, count: usize, line: Option<usize>, text: impl Into<String>) -> Mended {
        Mended { what, count, line, text: text.into(), lost: false }
    }
}

/// A count with what is said of one, or of several.
fn counted(count: usize, one: &str, several: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { several })
}

/// Part of a file's times that may come before earlier ones.
const MOST_DISPLACED: f64 = 0.01;

/// True where more stand out of order than can be sorted in: several runs were joined, or a clock was set back.
fn is_no_order(displaced: usize, all: usize) -> bool {
    displaced > 2 && displaced as f64 > MOST_DISPLACED * all as f64
}

/// What a file does not say of itself.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ForeignOptions {
    /// Columns, channels or fields and the sensors that they are.
    pub map: Vec<(String, String)>,
    /// Columns that are no sensors; `*` is every one that is not named otherwise.
    pub ignore: Vec<String>,
    /// Zone of date-times without one, seconds east of UTC; UTC if not given.
    pub zone_s: Option<i32>,
    /// Whether 03/04/2026 is the third of April.
    pub day_first: Option<bool>,
    /// Seconds of the unit that times are written in, where their heading does not say.
    pub time_unit_s: Option<f64>,
    /// Which time of an MCAP message counts.
    pub message_time: MessageTime,
}

/// Which time of an MCAP message counts.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum MessageTime {
    /// When it was logged.
    #[default]
    Log,
    /// When it was published.
    Publish,
    /// What this field of it says.
    Field(String),
}

/// Reads a file of another program, whichever of the known kinds it is.
///
/// # Errors
/// Says what is wrong, where, and what to do.
pub fn read_foreign(path: &Path, options: &ForeignOptions) -> Result<Foreign, LogError> {
    decode_foreign(&disk::read_file(path)?, path, options)
}

/// [`read_foreign`] of the bytes of a file.
///
/// # Errors
/// As there.
pub fn decode_foreign(bytes: &[u8], path: &Path, options: &ForeignOptions) -> Result<Foreign, LogError> {
    if bytes.starts_with(::mcap::MAGIC) {
        crate::storage::foreign::mcap::read(bytes, path, options)
    } else if bytes.starts_with(b"TDSm") {
        crate::storage::foreign::tdms::read(bytes).map_err(|why| LogError::Foreign { path: path.into(), why })
    } else if bytes.starts_with(b"TDSh") {
        let why = "this is the index of a TDMS file: name the .tdms file that stands beside it".into();
        Err(LogError::Foreign { path: path.into(), why })
    } else {
        crate::storage::foreign::csv::read(bytes, options).map_err(|(line, problem)| LogError::Csv {
            path: path.into(),
            line,
            problem,
        })
    }
}
