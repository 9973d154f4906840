//! Files of other programs become recordings: a reader gives named tracks of numbers with times, which are then bound
//! to the sensors of a rig.
//!
//! | file | what it does |
//! | --- | --- |
//! | `source` | what a file holds, what was repaired in it, what the user says about it |
//! | `csv/` | the one parser of text tables: strict for a plain time series, or repairing what can be repaired safely |
//! | `tdms/` | NI TDMS |
//! | `mcap/` | MCAP of other programs: JSON and protobuf messages |
//! | `arrays/` | MAT files and HDF5, by way of text |
//! | `json` | records and columns in JSON, by way of text |
//! | `sheet` | workbooks of Excel and LibreOffice, by way of text |
//! | `tables` | the tables of such files: texts become one source |
//! | `kinds` | what a column measures, by its name and unit |
//! | `gaps` | gaps of a track where its file says that there is no number |
//! | `decode` | picks the reader |
//! | `bind` | tracks → sensors: names, units, what is left out |
//! | `file` | one file becomes a recording |
//! | `understood` | what an import took of a file, for programs and pages |
//! | `long` | a plain time series too long for memory |
//! | `unit_warnings` | values that look like those of another unit |

pub(crate) mod arrays;
pub(crate) mod bind;
pub(crate) mod csv;
pub(crate) mod decode;
pub(crate) mod file;
pub(crate) mod gaps;
pub(crate) mod json;
pub(crate) mod kinds;
pub(crate) mod long;
pub(crate) mod mcap;
pub(crate) mod sheet;
pub(crate) mod source;
pub(crate) mod tables;
pub(crate) mod tdms;
pub(crate) mod understood;
pub(crate) mod unit_warnings;

pub use crate::storage::import::bind::{Bound, bind, check_names, require_sensors};
pub use crate::storage::import::csv::heading::{time_symbol, time_unit};
pub use crate::storage::import::csv::stamp::zone_seconds;
pub use crate::storage::import::csv::text::encoding_named;
pub use crate::storage::import::decode::{decode_source, read_source};
pub use crate::storage::import::file::{Imported, import_file};
pub use crate::storage::import::kinds::{is_electric, is_nameless, kind_of, kind_of_name, line_like};
pub use crate::storage::import::long::{ImportedLong, LongImport, OnSample, Pass};
pub use crate::storage::import::source::{
    ImportOptions, Line, MessageTime, Repair, SourceFile, SourceOptions, Start, Track,
};
pub use crate::storage::import::understood::rate_hz;
pub use crate::storage::import::unit_warnings::unit_warnings;
