//! What a session is asked for.

use std::path::PathBuf;
use std::time::Duration;

use crate::record::error::RecordError;
use crate::record::session::feed::Feed;
use crate::record::session::output::{check_folder, check_path};
use crate::record::session::shots::Plan;

/// A stream that says nothing valid for so long has ended, where nothing else is asked for, s.
pub const SILENCE_S: f64 = 5.0;

/// What a session is asked for.
#[derive(Debug, Clone)]
pub struct Options {
    /// The recording to write; must not exist.
    pub file: PathBuf,
    /// Stop after so much recorded time, s.
    pub duration_s: Option<f64>,
    /// A stream has ended when nothing valid came for so long.
    pub silence: Duration,
    /// A device whose port has vanished is waited for so long.
    pub wait: Duration,
    /// The devices send as time goes by; not those that are simulated at another speed.
    pub real_time: bool,
    /// Free notes to keep with the run.
    pub notes: Vec<(String, String)>,
    /// Record shots around what a trigger sees, each in a file of its own, instead of everything in `file`.
    pub shots: Option<Plan>,
    /// Where what is recorded is handed on.
    pub feed: Option<Feed>,
}

impl Options {
    /// Until the streams end or are silent for [`SILENCE_S`]; a device that vanishes is not waited for.
    pub fn new(file: impl Into<PathBuf>) -> Options {
        Options {
            file: file.into(),
            duration_s: None,
            silence: Duration::from_secs_f64(SILENCE_S),
            wait: Duration::ZERO,
            real_time: true,
            notes: Vec::new(),
            shots: None,
            feed: None,
        }
    }

    /// Refuses early what the log would refuse at the first sample.
    pub(crate) fn check(&self) -> Result<(), RecordError> {
        self.shots.as_ref().map_or_else(|| check_path(&self.file), |plan| check_folder(&plan.folder))
    }

    /// End of the recording on its own clock, ns, for one that starts at `first_ns`.
    pub(crate) fn end_ns(&self, first_ns: i64) -> i64 {
        self.duration_s.map_or(i64::MAX, |s| first_ns.saturating_add((s * 1e9).round() as i64))
    }
}
