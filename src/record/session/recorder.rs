//! Where a session's samples go: all into one recording, or each shot into one; watched either way.

use crate::record::error::RecordError;
use crate::record::health::monitor::{Expected, Monitor};
use crate::record::health::snapshot::Snapshot;
use crate::record::session::feed::Tap;
use crate::record::session::options::Options;
use crate::record::session::output::{DeviceCount, Output, Summary};
use crate::record::session::shots::Shots;
use crate::recording::{Gap, RunInfo};
use crate::rig::Rig;
use crate::storage::ClockFix;
use crate::storage::layout::live_zero_ns;

/// See the module.
pub struct Recorder {
    to: Destination,
    /// How the sensors do.
    pub monitor: Monitor,
    /// Who watches.
    tap: Option<Tap>,
}

enum Destination {
    Whole(Box<Output>),
    Shots(Box<Shots>),
}

impl Recorder {
    /// As the options ask for; `run` is what is known of the session, `expected` the sensors that will come.
    ///
    /// # Errors
    /// A file that cannot be made.
    pub fn create(options: &Options, rig: &Rig, run: &RunInfo, expected: &[Expected]) -> Result<Recorder, RecordError> {
        let to = match &options.shots {
            None => Destination::Whole(Box::new(Output::create(&options.file, rig, run)?)),
            Some(plan) => Destination::Shots(Box::new(Shots::new(plan.clone(), rig, run, expected, options.silence))),
        };
        let tap = options.feed.as_ref().map(|feed| Tap::new(feed, rig, live_zero_ns(run.start_unix_ns)));
        Ok(Recorder { to, monitor: Monitor::new(rig, expected), tap })
    }

    /// As [`Output::samples`].
    pub fn samples(&mut self, sensor: usize, first_ns: i64, period_ns: f64, values: &[f64]) -> Result<(), RecordError> {
        self.monitor.samples(sensor, first_ns, period_ns, values);
        match &mut self.to {
            Destination::Whole(output) => output.samples(sensor, first_ns, period_ns, values)?,
            Destination::Shots(shots) => shots.samples(sensor, first_ns, period_ns, values)?,
        }
        if let Some(tap) = &mut self.tap {
            tap.samples(sensor, first_ns, period_ns, values);
        }
        Ok(())
    }

    /// As [`Output::gap`].
    pub fn gap(&mut self, sensor: usize, gap: Gap) -> Result<(), RecordError> {
        self.monitor.gap(sensor);
        match &mut self.to {
            Destination::Whole(output) => output.gap(sensor, gap)?,
            Destination::Shots(shots) => shots.gap(sensor, gap)?,
        }
        if let Some(tap) = &mut self.tap {
            tap.gap(sensor, gap);
        }
        Ok(())
    }

    /// Takes a gap at the end of a sensor, of whose device nothing came any more; a shot looks for itself what it
    /// lacks.
    pub fn never_came(&mut self, sensor: usize, gap: Gap) -> Result<(), RecordError> {
        match &mut self.to {
            Destination::Whole(output) => output.gap(sensor, gap)?,
            Destination::Shots(_) => return Ok(()),
        }
        if let Some(tap) = &mut self.tap {
            tap.gap(sensor, gap);
        }
        Ok(())
    }

    /// Of a sensor, only what lies before a time on the recording's clock is kept, ns; a shot has an end of its own.
    pub fn keep_until(&mut self, sensor: usize, end_ns: i64) {
        if let Destination::Whole(output) = &mut self.to {
            output.keep(sensor, i64::MIN, end_ns - 1, end_ns);
        }
    }

    /// True where what comes next hangs on how the clocks lie to each other now.
    pub fn wants_clocks(&self) -> bool {
        matches!(&self.to, Destination::Shots(shots) if shots.wants_clocks())
    }

    /// As [`Output::note`]; notes at the end of a session belong only to the shot that it cut off.
    pub fn note(&mut self, key: &str, value: &str) -> Result<(), RecordError> {
        match &mut self.to {
            Destination::Whole(output) => output.note(key, value),
            Destination::Shots(shots) => shots.note(key, value),
        }
    }

    /// To be called often: begins and ends shots, flushes, and judges the sensors, when it is time.
    pub fn tick(&mut self) -> Result<(), RecordError> {
        self.monitor.tick();
        if let Some(tap) = &mut self.tap {
            tap.tick();
        }
        match &mut self.to {
            Destination::Whole(output) => output.tick(),
            Destination::Shots(shots) => shots.tick(&self.monitor),
        }
    }

    /// As [`Output::clocks`]; shots that end before the session keep what is to be `noted` of the clocks by then.
    pub fn clocks(
        &mut self,
        fixes: Vec<ClockFix>,
        noted: impl FnOnce() -> Vec<(String, String)>,
    ) -> Result<(), RecordError> {
        match &mut self.to {
            Destination::Whole(output) => output.clocks(fixes),
            Destination::Shots(shots) => shots.clocks(fixes, noted()),
        }
    }

    /// As [`Output::refused`].
    pub fn refused(&self) -> bool {
        match &self.to {
            Destination::Whole(output) => output.refused(),
            Destination::Shots(shots) => shots.refused(),
        }
    }

    /// All shots that were asked for are there.
    pub fn is_over(&self) -> bool {
        matches!(&self.to, Destination::Shots(shots) if shots.is_full())
    }

    /// Where the recording stands, but for the devices.
    pub fn snapshot(&self) -> Snapshot {
        let (samples, gaps) = self.monitor.totals();
        let (trigger, place) = match &self.to {
            Destination::Whole(output) => (None, output.path().to_owned()),
            Destination::Shots(shots) => (Some(shots.view()), shots.place().to_owned()),
        };
        let (recorded_s, sensors) = (self.monitor.newest_s(), self.monitor.views());
        Snapshot { recorded_s, samples, gaps, sensors, trigger, place, ..Snapshot::default() }
    }

    /// As [`Output::finish`]; what was wrong with sensors is kept in the recording's notes.
    pub fn finish(
        self,
        first_ns: i64,
        listed: impl Fn(usize) -> bool,
        devices: Vec<DeviceCount>,
        ended: String,
    ) -> Result<Summary, RecordError> {
        let mut summary = match self.to {
            Destination::Whole(mut output) => {
                for (key, text) in self.monitor.notes(0, i64::MAX) {
                    output.note(&key, &text)?;
                }
                output.finish(first_ns, listed, devices, ended)?
            }
            Destination::Shots(shots) => shots.finish(devices, ended, &self.monitor)?,
        };
        summary.alerts = self.monitor.alerts().to_vec();
        Ok(summary)
    }
}
