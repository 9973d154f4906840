//! The log of a session and its clock: both begin with the first valid sample of any device.

use crate::record::clock::host_clock::HostClock;
use crate::record::error::RecordError;
use crate::record::health::monitor::Expected;
use crate::record::health::snapshot::Snapshot;
use crate::record::session::options::Options;
use crate::record::session::recorder::Recorder;
use crate::recording::RunInfo;
use crate::rig::Rig;
use crate::storage::ClockFix;

/// What a session writes to, once it has begun: a device that never speaks leaves no file behind.
pub struct Live<'a> {
    /// The rig.
    pub rig: &'a Rig,
    /// End of the recording on its own clock, ns.
    pub end_ns: i64,
    options: &'a Options,
    source: String,
    expected: Vec<Expected>,
    host: HostClock,
    /// The output, and recording time 0 on the host's clock.
    begun: Option<(Recorder, i64)>,
    clocks_changed: bool,
}

impl<'a> Live<'a> {
    /// Nothing is written yet; `source` says where the samples of the `expected` sensors come from.
    pub fn new(
        rig: &'a Rig,
        options: &'a Options,
        source: String,
        expected: Vec<Expected>,
        host: HostClock,
    ) -> Live<'a> {
        let end_ns = options.end_ns(0);
        Live { rig, end_ns, options, source, expected, host, begun: None, clocks_changed: false }
    }

    /// True from the first sample on.
    pub fn has_begun(&self) -> bool {
        self.begun.is_some()
    }

    /// Begins with a sample taken at this time on the host's clock, if it has not begun.
    pub fn begin(&mut self, host_ns: i64) -> Result<(), RecordError> {
        if self.begun.is_none() {
            let run = RunInfo {
                start_unix_ns: self.host.unix_ns(host_ns),
                source: self.source.clone(),
                program: format!("surgescope {}", env!("CARGO_PKG_VERSION")),
                notes: self.options.notes.clone(),
                ..RunInfo::default()
            };
            self.begun = Some((Recorder::create(self.options, self.rig, &run, &self.expected)?, host_ns));
        }
        Ok(())
    }

    /// Recording time 0 on the host's clock, ns.
    pub fn zero_ns(&self) -> i64 {
        self.begun.as_ref().map_or(0, |(_, zero_ns)| *zero_ns)
    }

    /// Recording time of a time on the host's clock, ns.
    pub fn recording_ns(&self, host_ns: i64) -> i64 {
        host_ns.saturating_sub(self.zero_ns())
    }

    /// What is written to, after [`begin`](Live::begin).
    pub fn output(&mut self) -> Result<&mut Recorder, RecordError> {
        self.begun.as_mut().map(|(output, _)| output).ok_or(RecordError::NotBegun)
    }

    /// A device began a new stretch: the log is to know of it soon.
    pub fn clocks_changed(&mut self) {
        self.clocks_changed = true;
    }

    /// True once after clocks changed.
    pub fn take_clocks_changed(&mut self) -> bool {
        std::mem::take(&mut self.clocks_changed)
    }

    /// Writes the relation of the clocks; see [`Recorder::clocks`].
    pub fn write_clocks(
        &mut self,
        fixes: Vec<ClockFix>,
        noted: impl FnOnce() -> Vec<(String, String)>,
    ) -> Result<(), RecordError> {
        match &mut self.begun {
            Some((output, _)) => output.clocks(fixes, noted),
            None => Ok(()),
        }
    }

    /// Where the recording stands, but for the devices; nothing yet where nothing began.
    pub fn snapshot(&self) -> Snapshot {
        let place = || self.options.shots.as_ref().map_or(&self.options.file, |plan| &plan.folder).clone();
        let begun = self.begun.as_ref().map(|(output, _)| output.snapshot());
        begun.unwrap_or_else(|| Snapshot { place: place(), ..Snapshot::default() })
    }

    /// The output, to be finished; `None` where nothing began.
    pub fn into_output(self) -> Option<Recorder> {
        self.begun.map(|(output, _)| output)
    }
}
