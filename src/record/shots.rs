//! A recording a shot: what a trigger cuts out of a stream, each shot in a file of its own.
//!
//! The last seconds of every sensor are kept in memory. When the trigger fires they go into a new file, what comes after them follows until
//! the shot is over; then the trigger settles for the next one.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::time::Duration;

use chrono::DateTime;

use super::RecordError;
use super::clock::seconds;
use super::monitor::Monitor;
use super::output::{CutShort, DeviceCount, Output, SensorCount, Summary};
use super::shot::{Batch, Heard, Open};
use super::snapshot::{Phase, TriggerView};
use super::trigger::{Condition, Event, Settings, State, Trigger};
use crate::log::{ClockFix, LogError};
use crate::recording::{Gap, RunInfo};
use crate::rig::Rig;

/// How much more is kept than a shot needs, ns: clocks that are fitted anew move a little.
const LATE_NS: i64 = 500_000_000;
/// The longest that samples are kept, and a shot is held open, for a device that is behind the others, ns.
const MOST_HELD_NS: i64 = 60_000_000_000;

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
    /// How far each sensor has come, and the last sample of it that was dropped, ns.
    heard: Vec<Option<Heard>>,
    dropped_ns: Vec<i64>,
    /// What is older was looked through for what is no longer needed, ns.
    forgot_ns: i64,
    /// A device that is behind the others is waited for so long, ns of recorded time.
    held_ns: i64,
    /// Shots that are being written: the last, and those before that still wait for late samples.
    open: Vec<Open>,
    done: Vec<Summary>,
    cut_short: Vec<CutShort>,
    /// Why shots could not be written.
    lost: Vec<String>,
    /// How the devices' clocks lie to each other, as well as it is known by now.
    clocks: Vec<ClockFix>,
}

impl Shots {
    /// No shot yet; `run` is what is known of the session. A device that is behind the others by more than `silence` is not waited for.
    pub fn new(plan: Plan, rig: &Rig, run: &RunInfo, silence: Duration) -> Shots {
        let sensors = rig.sensors.len();
        let silence_ns = i64::try_from(silence.as_nanos()).unwrap_or(i64::MAX);
        Shots {
            trigger: Trigger::new(plan.trigger),
            plan,
            rig: rig.clone(),
            run: run.clone(),
            events: Vec::new(),
            kept: VecDeque::new(),
            gaps: Vec::new(),
            newest_ns: i64::MIN,
            heard: vec![None; sensors],
            dropped_ns: vec![i64::MIN; sensors],
            forgot_ns: i64::MIN,
            held_ns: silence_ns.clamp(LATE_NS, MOST_HELD_NS),
            open: Vec::new(),
            done: Vec::new(),
            cut_short: Vec::new(),
            lost: Vec::new(),
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
        if let Some(heard) = self.heard.get_mut(sensor) {
            *heard = Some(Heard::after(*heard, &batch));
        }
        self.open.iter_mut().try_for_each(|open| open.write(&batch))?;
        self.kept.push_back(batch);
        if sensor == self.plan.sensor {
            self.trigger.feed(first_ns, period_ns, values, &mut self.events);
            for event in std::mem::take(&mut self.events) {
                if let Event::Fired(at) = event {
                    self.begin(at)?;
                }
            }
        }
        while let Some(i) = self.open.iter().position(|open| self.is_complete(open)) {
            let open = self.open.remove(i);
            self.end(open, "the shot was over", monitor)?;
        }
        if self.newest_ns.saturating_sub(self.forgot_ns) >= LATE_NS / 5 {
            self.forgot_ns = self.newest_ns;
            self.forget();
        }
        Ok(())
    }

    /// Every sensor has come past the shot's end, or is no longer waited for.
    fn is_complete(&self, open: &Open) -> bool {
        self.heard.iter().flatten().all(|heard| heard.last_ns >= open.to_ns)
            || self.newest_ns > open.to_ns.saturating_add(self.held_ns)
    }

    /// Takes a gap.
    pub fn gap(&mut self, sensor: usize, gap: Gap) -> Result<(), RecordError> {
        if sensor == self.plan.sensor {
            self.trigger.gap();
        }
        self.gaps.push((sensor, gap));
        self.open.iter_mut().try_for_each(|open| open.gap(sensor, gap))
    }

    /// Takes how the devices' clocks lie to each other.
    pub fn clocks(&mut self, fixes: Vec<ClockFix>) -> Result<(), RecordError> {
        self.clocks = fixes;
        self.open.iter_mut().try_for_each(|open| open.clocks(&self.clocks))
    }

    /// Writes a note to what is being written.
    pub fn note(&mut self, key: &str, value: &str) -> Result<(), RecordError> {
        self.open.iter_mut().try_for_each(|open| open.output.note(key, value))
    }

    /// Flushes when it is time.
    pub fn tick(&mut self) -> Result<(), RecordError> {
        self.open.iter_mut().try_for_each(|open| open.output.tick())
    }

    /// As [`Output::refused`].
    pub fn refused(&self) -> bool {
        self.open.iter().any(|open| open.output.refused())
    }

    /// The file that is being written, or else the folder.
    pub fn place(&self) -> &Path {
        self.open.last().map_or(&self.plan.folder, |open| open.output.path())
    }

    /// How the trigger stands.
    pub fn view(&self) -> TriggerView {
        let wanted_s = seconds(self.plan.trigger.pre_ns);
        let phase = match self.trigger.state() {
            _ if self.is_full() => Phase::Over,
            State::Settling(quiet_ns) => Phase::Settling { quiet_s: seconds(quiet_ns), wanted_s },
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
        TriggerView { condition, phase, fired: self.fired(), most: self.plan.most, lost: self.lost.clone() }
    }

    fn fired(&self) -> usize {
        self.done.len() + self.open.len() + self.lost.len()
    }

    /// Whether all shots that were asked for are there.
    pub fn is_full(&self) -> bool {
        self.open.is_empty() && self.plan.most.is_some_and(|most| self.done.len() >= most)
    }

    /// A shot begins: its file takes what was kept. Where none can be made, the shot is lost and the session goes on.
    fn begin(&mut self, fired_ns: i64) -> Result<(), RecordError> {
        if self.plan.most.is_some_and(|most| self.done.len() + self.open.len() >= most) {
            return Ok(());
        }
        let from_ns = fired_ns.saturating_sub(self.plan.trigger.pre_ns);
        let number = self.fired() + 1;
        let mut output = match self.create(from_ns, number) {
            Ok(output) => output,
            Err(error) => {
                self.lost.push(format!("shot {number} could not be written and is lost: {}", told(&error)));
                return Ok(());
            }
        };
        output.note("shot", &number.to_string())?;
        output.note("fired_s", &format!("{}", seconds(fired_ns - from_ns)))?;
        let to_ns = fired_ns.saturating_add(self.plan.trigger.post_ns);
        let mut open = Open { output, from_ns, to_ns, fired_ns, sensors: Vec::new(), lost: false };
        for sensor in 0..self.rig.sensors.len() {
            // A slow sensor may have had no sample in the time before the shot: then its last one says how it stood.
            let own = || self.kept.iter().filter(|b| b.sensor == sensor);
            let within = own().any(|b| b.last_ns() >= from_ns);
            match own().next_back() {
                Some(last) if !within => open.write_last(last)?,
                _ => own().try_for_each(|batch| open.write(batch))?,
            }
            // so long behind the others came the trigger
            if self.dropped_ns.get(sensor).is_some_and(|dropped| *dropped >= from_ns) {
                let kept_ns = own().map(|batch| batch.first_ns).min().unwrap_or(self.newest_ns);
                open.missing(sensor, from_ns, kept_ns)?;
            }
        }
        self.gaps.iter().try_for_each(|(sensor, gap)| open.gap(*sensor, *gap))?;
        open.clocks(&self.clocks)?;
        self.open.push(open);
        Ok(())
    }

    /// The file of a shot; its folder is made anew where it is gone.
    fn create(&self, from_ns: i64, number: usize) -> Result<Output, RecordError> {
        let start_unix_ns = self.run.start_unix_ns.saturating_add_signed(from_ns);
        let run = RunInfo { start_unix_ns, ..self.run.clone() };
        let stem = stem(&self.rig.name, start_unix_ns, number);
        // what cannot be made shows in the file's error
        let _ = std::fs::create_dir_all(&self.plan.folder);
        let mut copy = 1;
        loop {
            let again = if copy == 1 { String::new() } else { format!("-{copy}") };
            let file = self.plan.folder.join(format!("{stem}{again}.mcap"));
            match Output::create(&file, &self.rig, &run) {
                Err(RecordError::Start(error)) if copy < MOST_COPIES && is_taken(&error) => copy += 1,
                other => return other,
            }
        }
    }

    /// A shot ends with what has come of it.
    fn end(&mut self, mut open: Open, ended: &str, monitor: &Monitor) -> Result<(), RecordError> {
        for (key, text) in monitor.notes(open.from_ns, open.to_ns) {
            open.output.note(&key, &text)?;
        }
        let kept_s = open.close(&self.heard)?;
        open.output.note("ended", ended)?;
        let (file, sensors, lost) = (open.output.path().display().to_string(), open.sensors, open.lost);
        if let Some(kept_s) = kept_s {
            self.cut_short.push(CutShort { file: file.clone(), kept_s, asked_s: seconds(self.plan.trigger.post_ns) });
        }
        match open.output.finish(0, |s| sensors.contains(&s), Vec::new(), ended.to_owned()) {
            Ok(summary) => self.done.push(Summary { data_lost: summary.data_lost || lost, ..summary }),
            Err(error) => self.lost.push(format!("{file} could not be finished: {}", told(&error))),
        }
        Ok(())
    }

    /// Drops what is too old for any shot to come, by how far the trigger's own sensor has come; of each sensor its last batch stays.
    fn forget(&mut self) {
        let trigger_ns = self.heard.get(self.plan.sensor).copied().flatten().map_or(i64::MIN, |heard| heard.last_ns);
        let behind_ns = trigger_ns.max(self.newest_ns.saturating_sub(self.held_ns));
        let oldest_ns = behind_ns.saturating_sub(self.plan.trigger.pre_ns).saturating_sub(LATE_NS);
        let mut last = vec![0; self.rig.sensors.len()];
        for (i, batch) in self.kept.iter().enumerate() {
            last[batch.sensor] = i;
        }
        let mut i = 0;
        let dropped_ns = &mut self.dropped_ns;
        self.kept.retain(|batch| {
            i += 1;
            let stays = batch.last_ns() >= oldest_ns || last[batch.sensor] + 1 == i;
            if !stays {
                dropped_ns[batch.sensor] = dropped_ns[batch.sensor].max(batch.last_ns());
            }
            stays
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
        for open in std::mem::take(&mut self.open) {
            self.end(open, &ended, monitor)?;
        }
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
            data_lost: devices.iter().any(DeviceCount::lost_data)
                || self.done.iter().any(|shot| shot.data_lost)
                || !self.lost.is_empty(),
            devices,
            ended,
            callouts: Vec::new(),
            shots: self.done.into_iter().map(|shot| shot.file).collect(),
            cut_short: self.cut_short,
            lost_shots: self.lost,
        })
    }
}

/// Names that are tried for a shot.
const MOST_COPIES: u32 = 1000;

/// Another file has the name.
fn is_taken(error: &LogError) -> bool {
    match error {
        LogError::Exists(_) => true,
        LogError::Io { source, .. } => source.kind() == std::io::ErrorKind::AlreadyExists,
        _ => false,
    }
}

/// An error with its causes.
fn told(error: &dyn std::error::Error) -> String {
    let causes = std::iter::successors(Some(error), |error| error.source());
    causes.map(ToString::to_string).collect::<Vec<_>>().join(": ")
}

/// The file name of a shot, but for its ending: rig, start (UTC), number.
fn stem(rig: &str, start_unix_ns: u64, number: usize) -> String {
    let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '-' };
    let rig: String = rig.chars().map(plain).collect();
    let when =
        DateTime::from_timestamp_nanos(i64::try_from(start_unix_ns).unwrap_or(i64::MAX)).format("%Y%m%dT%H%M%SZ");
    format!("{}-{when}-{number:03}", rig.trim_start_matches('.'))
}
