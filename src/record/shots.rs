//! A recording a shot: what a trigger cuts out of a stream, each shot in a file of its own.
//!
//! The last seconds of every sensor are kept in memory. When the trigger fires they go into a new file, what comes after them follows until
//! the shot is over; then the trigger settles for the next one.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};

use chrono::DateTime;

use super::RecordError;
use super::clock::seconds;
use super::monitor::Monitor;
use super::output::{DeviceCount, Output, SensorCount, Summary};
use super::snapshot::{Phase, TriggerView};
use super::trigger::{Condition, Event, Settings, State, Trigger};
use crate::log::ClockFix;
use crate::recording::{Gap, RunInfo};
use crate::rig::Rig;

/// How long a shot's file is kept open for sensors whose samples come later than the trigger's, ns.
const LATE_NS: i64 = 500_000_000;

/// What is to be recorded of a stream.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// What fires, and what a shot holds.
    pub trigger: Settings,
    /// Index in the rig of the sensor that fires.
    pub sensor: usize,
    /// Shots after which it is over; none for as many as come.
    pub most: Option<usize>,
    /// Where the files go, named by rig, time and number.
    pub folder: PathBuf,
}

/// Evenly spaced samples of a sensor.
struct Batch {
    sensor: usize,
    first_ns: i64,
    period_ns: f64,
    values: Vec<f64>,
}

impl Batch {
    fn at(&self, i: usize) -> i64 {
        self.first_ns.saturating_add((i as f64 * self.period_ns).round() as i64)
    }

    fn last_ns(&self) -> i64 {
        self.at(self.values.len().saturating_sub(1))
    }
}

/// A shot that is being written.
struct Open {
    output: Output,
    /// Its bounds on the session's clock, ns.
    from_ns: i64,
    to_ns: i64,
    sensors: Vec<usize>,
}

/// See the module.
pub struct Shots {
    plan: Plan,
    rig: Rig,
    run: RunInfo,
    trigger: Trigger,
    events: Vec<Event>,
    /// What may belong to the next shot, in the order in which it came.
    kept: VecDeque<Batch>,
    gaps: Vec<(usize, Gap)>,
    /// The newest sample of any sensor, ns.
    newest_ns: i64,
    open: Option<Open>,
    done: Vec<Summary>,
    /// How the devices' clocks lie to each other, as well as it is known by now.
    clocks: Vec<ClockFix>,
}

impl Shots {
    /// No shot yet; `run` is what is known of the session.
    pub fn new(plan: Plan, rig: &Rig, run: &RunInfo) -> Shots {
        Shots {
            trigger: Trigger::new(plan.trigger),
            plan,
            rig: rig.clone(),
            run: run.clone(),
            events: Vec::new(),
            kept: VecDeque::new(),
            gaps: Vec::new(),
            newest_ns: i64::MIN,
            open: None,
            done: Vec::new(),
            clocks: Vec::new(),
        }
    }

    /// Takes samples; what the monitor has called out during a shot is kept with it.
    pub fn samples(
        &mut self,
        sensor: usize,
        first_ns: i64,
        period_ns: f64,
        values: &[f64],
        monitor: &Monitor,
    ) -> Result<(), RecordError> {
        if values.is_empty() || self.is_full() {
            return Ok(());
        }
        let batch = Batch { sensor, first_ns, period_ns, values: values.to_vec() };
        self.newest_ns = self.newest_ns.max(batch.last_ns());
        if let Some(open) = &mut self.open {
            open.write(&batch)?;
        }
        self.kept.push_back(batch);
        if sensor == self.plan.sensor {
            self.trigger.feed(first_ns, period_ns, values, &mut self.events);
            for event in std::mem::take(&mut self.events) {
                if let Event::Fired(at) = event {
                    self.begin(at, monitor)?;
                }
            }
        }
        if self.open.as_ref().is_some_and(|open| self.newest_ns > open.to_ns.saturating_add(LATE_NS)) {
            self.end("the shot was over", monitor)?;
        }
        self.forget();
        Ok(())
    }

    /// Takes a gap.
    pub fn gap(&mut self, sensor: usize, gap: Gap) -> Result<(), RecordError> {
        if sensor == self.plan.sensor {
            self.trigger.gap();
        }
        self.gaps.push((sensor, gap));
        self.open.as_mut().map_or(Ok(()), |open| open.gap(sensor, gap))
    }

    /// Takes how the devices' clocks lie to each other.
    pub fn clocks(&mut self, fixes: Vec<ClockFix>) -> Result<(), RecordError> {
        self.clocks = fixes;
        self.open.as_mut().map_or(Ok(()), |open| open.clocks(&self.clocks))
    }

    /// Writes a note to the shot that is being written.
    pub fn note(&mut self, key: &str, value: &str) -> Result<(), RecordError> {
        self.open.as_mut().map_or(Ok(()), |open| open.output.note(key, value))
    }

    /// Flushes when it is time.
    pub fn tick(&mut self) -> Result<(), RecordError> {
        self.open.as_mut().map_or(Ok(()), |open| open.output.tick())
    }

    /// As [`Output::refused`].
    pub fn refused(&self) -> bool {
        self.open.as_ref().is_some_and(|open| open.output.refused())
    }

    /// The file that is being written, or else the folder.
    pub fn place(&self) -> &Path {
        self.open.as_ref().map_or(&self.plan.folder, |open| open.output.path())
    }

    /// How the trigger stands.
    pub fn view(&self) -> TriggerView {
        let wanted_s = seconds(self.plan.trigger.pre_ns);
        let phase = match self.trigger.state() {
            _ if self.is_full() => Phase::Over,
            State::Settling(None) => Phase::Settling { quiet_s: 0.0, wanted_s },
            State::Settling(Some(since)) => Phase::Settling { quiet_s: seconds(self.newest_ns - since), wanted_s },
            State::Armed => Phase::Armed,
            State::Fired(at) => {
                Phase::Fired { since_s: seconds(self.newest_ns - at), lasts_s: seconds(self.plan.trigger.post_ns) }
            }
        };
        let (name, unit) =
            self.rig.sensors.get(self.plan.sensor).map_or(("", ""), |s| (s.name.as_str(), s.unit.symbol));
        let condition = match self.plan.trigger.condition {
            Condition::Edge => format!("{name} switches"),
            Condition::Level(level) => format!("{name} reaches {level} {unit}"),
            Condition::Slope(slope) => format!("{name} rises by {slope} {unit}/s"),
        };
        let fired = self.done.len() + usize::from(self.open.is_some());
        TriggerView { condition, phase, fired, most: self.plan.most }
    }

    /// Whether all shots that were asked for are there.
    pub fn is_full(&self) -> bool {
        self.open.is_none() && self.plan.most.is_some_and(|most| self.done.len() >= most)
    }

    /// A shot begins: its file takes what was kept.
    fn begin(&mut self, fired_ns: i64, monitor: &Monitor) -> Result<(), RecordError> {
        // the one before may still wait for late samples
        self.end("the next shot began", monitor)?;
        if self.is_full() {
            return Ok(());
        }
        let from_ns = fired_ns.saturating_sub(self.plan.trigger.pre_ns);
        let start_unix_ns = self.run.start_unix_ns.saturating_add_signed(from_ns);
        let number = self.done.len() + 1;
        let file = self.plan.folder.join(name(&self.rig.name, start_unix_ns, number));
        let run = RunInfo { start_unix_ns, ..self.run.clone() };
        let mut output = Output::create(&file, &self.rig, &run)?;
        output.note("shot", &number.to_string())?;
        output.note("fired_s", &format!("{}", seconds(fired_ns - from_ns)))?;
        let to_ns = fired_ns.saturating_add(self.plan.trigger.post_ns);
        let mut open = Open { output, from_ns, to_ns, sensors: Vec::new() };
        for sensor in 0..self.rig.sensors.len() {
            // A slow sensor may have had no sample in the time before the shot: then its last one says how it stood.
            let own = || self.kept.iter().filter(|b| b.sensor == sensor);
            let within = own().any(|b| b.last_ns() >= from_ns);
            match own().next_back() {
                Some(last) if !within => open.write_last(last)?,
                _ => own().try_for_each(|batch| open.write(batch))?,
            }
        }
        self.gaps.iter().try_for_each(|(sensor, gap)| open.gap(*sensor, *gap))?;
        open.clocks(&self.clocks)?;
        self.open = Some(open);
        Ok(())
    }

    fn end(&mut self, ended: &str, monitor: &Monitor) -> Result<(), RecordError> {
        let Some(mut open) = self.open.take() else { return Ok(()) };
        for (key, text) in monitor.notes(open.from_ns, open.to_ns) {
            open.output.note(&key, &text)?;
        }
        open.output.note("ended", ended)?;
        let sensors = open.sensors;
        let summary = open.output.finish(0, |s| sensors.contains(&s), Vec::new(), ended.to_owned())?;
        self.done.push(summary);
        Ok(())
    }

    /// Drops what is too old for any shot to come; of each sensor its last batch stays.
    fn forget(&mut self) {
        let oldest_ns = self.newest_ns.saturating_sub(self.plan.trigger.pre_ns).saturating_sub(LATE_NS);
        let mut last = vec![0; self.rig.sensors.len()];
        for (i, batch) in self.kept.iter().enumerate() {
            last[batch.sensor] = i;
        }
        let mut i = 0;
        self.kept.retain(|batch| {
            i += 1;
            batch.last_ns() >= oldest_ns || last[batch.sensor] + 1 == i
        });
        self.gaps.retain(|(_, gap)| gap.to_s >= seconds(oldest_ns));
    }

    /// As [`Output::finish`]: the sums over all shots.
    pub fn finish(
        mut self,
        devices: Vec<DeviceCount>,
        ended: String,
        monitor: &Monitor,
    ) -> Result<Summary, RecordError> {
        self.end(&ended, monitor)?;
        let mut sensors: Vec<SensorCount> = Vec::new();
        for count in self.done.iter().flat_map(|shot| &shot.sensors) {
            match sensors.iter_mut().find(|s| s.name == count.name) {
                Some(sum) => (sum.samples, sum.gaps) = (sum.samples + count.samples, sum.gaps + count.gaps),
                None => sensors.push(count.clone()),
            }
        }
        Ok(Summary {
            file: self.plan.folder.display().to_string(),
            duration_s: self.done.iter().map(|shot| shot.duration_s).sum(),
            sensors,
            data_lost: devices.iter().any(DeviceCount::lost_data) || self.done.iter().any(|shot| shot.data_lost),
            devices,
            ended,
            callouts: Vec::new(),
            shots: self.done.into_iter().map(|shot| shot.file).collect(),
        })
    }
}

impl Open {
    /// Writes what of a batch lies in the shot.
    fn write(&mut self, batch: &Batch) -> Result<(), RecordError> {
        let inside = |i: &usize| (self.from_ns..=self.to_ns).contains(&batch.at(*i));
        let Some(first) = (0..batch.values.len()).find(inside) else { return Ok(()) };
        let count = (first..batch.values.len()).take_while(inside).count();
        self.put(batch, first, count)
    }

    /// Writes a gap that reaches into the shot.
    fn gap(&mut self, sensor: usize, gap: Gap) -> Result<(), RecordError> {
        let zero_s = seconds(self.from_ns);
        if gap.to_s <= zero_s || gap.from_s >= seconds(self.to_ns) {
            return Ok(());
        }
        self.output.gap(sensor, Gap { from_s: gap.from_s - zero_s, to_s: gap.to_s - zero_s, ..gap })
    }

    /// Writes how the clocks lie to each other, on the shot's own clock.
    fn clocks(&mut self, fixes: &[ClockFix]) -> Result<(), RecordError> {
        let on_shot = |fix: &ClockFix| ClockFix {
            from_ns: fix.from_ns.saturating_sub(self.from_ns),
            to_ns: fix.to_ns.saturating_sub(self.from_ns),
            ..fix.clone()
        };
        self.output.clocks(fixes.iter().map(on_shot).collect())
    }

    /// Writes the last sample of a batch that lies before the shot.
    fn write_last(&mut self, batch: &Batch) -> Result<(), RecordError> {
        self.put(batch, batch.values.len() - 1, 1)
    }

    fn put(&mut self, batch: &Batch, first: usize, count: usize) -> Result<(), RecordError> {
        if !self.sensors.contains(&batch.sensor) {
            self.sensors.push(batch.sensor);
        }
        let values = &batch.values[first..first + count];
        self.output.samples(batch.sensor, batch.at(first) - self.from_ns, batch.period_ns, values)
    }
}

/// A file name of a shot: rig, start (UTC), number.
fn name(rig: &str, start_unix_ns: u64, number: usize) -> String {
    let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '-' };
    let rig: String = rig.chars().map(plain).collect();
    let when =
        DateTime::from_timestamp_nanos(i64::try_from(start_unix_ns).unwrap_or(i64::MAX)).format("%Y%m%dT%H%M%SZ");
    format!("{}-{when}-{number:03}.mcap", rig.trim_start_matches('.'))
}
