//! The tables of an index.

/// Name of the index in its folder.
pub const FILE: &str = "surgescope.sqlite";
/// Marks a SQLite file as ours (`PRAGMA application_id`): "surg".
pub(crate) const APPLICATION: i64 = 0x7375_7267;
/// Version of the tables (`PRAGMA user_version`); a reader refuses a higher one.
pub(crate) const VERSION: i64 = 1;

/// Makes them.
///
/// `run` holds each recording once, by its content; `file` the names under which it was seen, with the size and time at
/// which that name need not be read again; `parameter` the values fitted; `accepted` the models accepted as a rig's,
/// the last one in force.
pub(crate) const TABLES: &str = "
CREATE TABLE run (
    id INTEGER PRIMARY KEY,
    content TEXT NOT NULL UNIQUE,
    file TEXT NOT NULL,
    rig TEXT NOT NULL,
    recorded_unix_ns INTEGER NOT NULL,
    state TEXT NOT NULL CHECK (state IN ('waiting', 'running', 'done', 'failed')),
    tries INTEGER NOT NULL DEFAULT 0,
    error TEXT,
    temperature_degC REAL,
    flow_m3_s REAL,
    effects TEXT,
    verdict TEXT,
    missing TEXT,
    probability REAL,
    line TEXT,
    rmse_m REAL,
    noise_m REAL,
    model_file TEXT,
    report_file TEXT
) STRICT;
CREATE TABLE file (
    file TEXT PRIMARY KEY,
    size INTEGER NOT NULL,
    modified_ns INTEGER NOT NULL,
    run INTEGER REFERENCES run (id)
) STRICT;
CREATE TABLE parameter (
    run INTEGER NOT NULL REFERENCES run (id),
    place INTEGER NOT NULL,
    name TEXT NOT NULL,
    value REAL NOT NULL,
    standard_error REAL,
    unit TEXT NOT NULL,
    own INTEGER NOT NULL,
    PRIMARY KEY (run, name)
) STRICT;
CREATE TABLE accepted (
    id INTEGER PRIMARY KEY,
    rig TEXT NOT NULL,
    run INTEGER NOT NULL REFERENCES run (id),
    at TEXT NOT NULL,
    how TEXT NOT NULL,
    model TEXT NOT NULL
) STRICT;
CREATE INDEX run_of_rig ON run (rig, recorded_unix_ns);
";

/// Made where it is missing: an index of an earlier program has none.
///
/// `given_up` holds the runs during which the program ended too often, and from when on each is tried once more.
pub(crate) const LATER_TABLES: &str = "
CREATE TABLE IF NOT EXISTS given_up (
    run INTEGER PRIMARY KEY REFERENCES run (id),
    again_unix_s INTEGER NOT NULL
) STRICT;
";
