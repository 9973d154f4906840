//! A recording a shot: what a trigger cuts out of a stream, each shot in a file of its own.
//!
//! The last seconds of every sensor are kept in memory. When the trigger fires they go into a new file, what comes
//! after them follows until the shot is over; then the trigger settles for the next one.

pub(crate) mod kept;
pub(crate) mod name;

pub use crate::record::session::shots::name::stem;

use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::record::clock::device_clock::seconds;
use crate::record::error::RecordError;
use crate::record::health::monitor::{Expected, Monitor};
use crate::record::health::snapshot::{Phase, TriggerView};
use crate::record::session::output::{Absent, CutShort, DeviceCount, Output, SensorCount, Summary};
use crate::record::session::shot::{Batch, MARGIN_NS, Open, Progress, Share};
use crate::record::session::shots::kept::{Kept, MOST_BYTES, Needed};
use crate::record::session::shots::name::{MOST_COPIES, is_taken, with_causes};
use crate::record::session::trigger::{Condition, Event, Settings, State, Trigger};
use crate::recording::{Gap, RunInfo};
use crate::rig::Rig;
use crate::shown::Shown as _;
use crate::storage::{ClockFix, Retimer, SensorClock};

/// How much more is kept than a shot needs, ns.
const LATE_NS: i64 = 2 * MARGIN_NS;
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
    /// What may belong to the next shot.
    kept: Kept,
    /// Sensors that a device is to send.
    owed: Vec<bool>,
    /// How far each sensor has come.
    progress: Vec<Option<Progress>>,
    /// A device that is behind the trigger's is waited for so long, ns of recorded time.
    held_ns: i64,
    /// The trigger has fired at these times, ns as logged, and no shot has begun yet.
    fired: Vec<i64>,
    /// Shots that are being written: the last, and those before that still wait for late samples.
    open: Vec<Open>,
    done: Vec<Summary>,
    cut_short: Vec<CutShort>,
    absent: Vec<Absent>,
    /// Why shots could not be written, and why the last one was not written to its end.
    lost: Vec<String>,
    refused: Option<String>,
    /// How the devices' clocks lie to each other, as well as it is known by now, and what that makes of each sensor's
    /// times.
    clocks: Vec<ClockFix>,
    /// What is known of the devices' clocks by now.
    clock_notes: Vec<(String, String)>,
    moves: Vec<SensorClock>,
}

impl Shots {
    /// No shot yet; `run` is what is known of the session, `expected` are the sensors that will come. A device that is
    /// behind the trigger's by more than `silence` is not waited for.
    pub fn new(plan: Plan, rig: &Rig, run: &RunInfo, expected: &[Expected], silence: Duration) -> Shots {
        let sensors = rig.sensors.len();
        let silence_ns = i64::try_from(silence.as_nanos()).unwrap_or(i64::MAX);
        Shots {
            trigger: Trigger::new(plan.trigger),
            plan,
            rig: rig.clone(),
            run: run.clone(),
            events: Vec::new(),
            kept: Kept::new(sensors, MOST_BYTES),
            // a file that is played owes nothing but what it has
            owed: (0..sensors).map(|i| expected.iter().any(|e| e.sensor == i && e.device.is_some())).collect(),
            progress: vec![None; sensors],
            fired: Vec::new(),
            held_ns: silence_ns.clamp(LATE_NS, MOST_HELD_NS),
            open: Vec::new(),
            done: Vec::new(),
            cut_short: Vec::new(),
            absent: Vec::new(),
            lost: Vec::new(),
            refused: None,
            clocks: Vec::new(),
            clock_notes: Vec::new(),
            moves: vec![SensorClock::default(); sensors],
        }
    }

    /// Takes samples.
    pub fn samples(&mut self, sensor: usize, first_ns: i64, period_ns: f64, values: &[f64]) -> Result<(), RecordError> {
        if values.is_empty() || self.is_full() {
            return Ok(());
        }
        let batch = Batch { sensor, first_ns, period_ns, values: values.to_vec() };
        if let Some(progress) = self.progress.get_mut(sensor) {
            *progress = Some(Progress::after(*progress, &batch));
        }
        let clock = &self.moves[sensor];
        self.open.iter_mut().try_for_each(|open| open.write(clock, &batch))?;
        self.kept.push(batch);
        if sensor == self.plan.sensor {
            self.trigger.feed(first_ns, period_ns, values, &mut self.events);
            let fired = |event: Event| if let Event::Fired(at) = event { Some(at) } else { None };
            self.fired.extend(self.events.drain(..).filter_map(fired));
        }
        Ok(())
    }

    /// The trigger's sensor has come past the shot's end, and every other one too, or it is no longer waited for: nor
    /// is one of which nothing has come at all, as where the first line of a slow device is held back until the second.
    fn is_complete(&self, open: &Open) -> bool {
        let Some(trigger_ns) = self.come_ns(self.plan.sensor).filter(|come_ns| *come_ns >= open.to_ns) else {
            return false;
        };
        let is_there = |sensor: usize| self.come_ns(sensor).map_or(!self.owed[sensor], |come_ns| come_ns >= open.to_ns);
        trigger_ns > open.to_ns.saturating_add(self.held_ns) || (0..self.progress.len()).all(is_there)
    }

    /// A sensor's time on the recording's clock, ns, by when it was logged.
    fn at_ns(&self, sensor: usize, logged_ns: i64) -> i64 {
        self.moves.get(sensor).map_or(logged_ns, |clock| clock.time_ns(logged_ns))
    }

    /// How far a sensor has come on the recording's clock, ns.
    fn come_ns(&self, sensor: usize) -> Option<i64> {
        let progress = self.progress.get(sensor).copied().flatten()?;
        Some(self.at_ns(sensor, progress.last_ns))
    }

    /// Takes a gap.
    pub fn gap(&mut self, sensor: usize, gap: Gap) -> Result<(), RecordError> {
        if sensor == self.plan.sensor {
            self.trigger.gap();
        }
        self.kept.gap(sensor, gap);
        let clock = &self.moves[sensor];
        self.open.iter_mut().try_for_each(|open| open.gap(clock, sensor, gap))
    }

    /// Takes how the devices' clocks lie to each other, and what is to be noted of them.
    pub fn clocks(&mut self, fixes: Vec<ClockFix>, notes: Vec<(String, String)>) -> Result<(), RecordError> {
        self.clock_notes = notes;
        let retimer = Retimer::new(fixes.clone());
        self.moves = self.rig.sensors.iter().map(|sensor| retimer.of(&sensor.name)).collect();
        self.clocks = fixes;
        self.open.iter_mut().try_for_each(|open| open.clocks(&self.clocks))
    }

    /// Writes a note to what is being written.
    pub fn note(&mut self, key: &str, value: &str) -> Result<(), RecordError> {
        self.open.iter_mut().try_for_each(|open| open.output.note(key, value))
    }

    /// True where a shot is about to begin or to end, by how the clocks lie to each other now.
    pub fn wants_clocks(&self) -> bool {
        !self.fired.is_empty() || self.open.iter().any(|open| self.is_complete(open))
    }

    /// Begins and ends shots, and flushes, when it is time; alerts during a shot are kept with it.
    pub fn tick(&mut self, monitor: &Monitor) -> Result<(), RecordError> {
        self.begin_fired()?;
        while let Some(i) = self.open.iter().position(|open| self.is_complete(open)) {
            let mut open = self.open.remove(i);
            for (key, text) in &self.clock_notes {
                open.output.note(key, text)?;
            }
            self.end(open, "the shot was over", monitor)?;
        }
        if self.kept.is_due() {
            let needed: Vec<Needed> = (0..self.moves.len()).map(|sensor| self.needed(sensor)).collect();
            self.kept.forget(&needed);
        }
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
                let newest_ns =
                    self.progress.get(self.plan.sensor).copied().flatten().map_or(at, |progress| progress.last_ns);
                Phase::Fired { since_s: seconds(newest_ns - at), lasts_s: seconds(self.plan.trigger.post_ns) }
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

    fn begin_fired(&mut self) -> Result<(), RecordError> {
        let fired = std::mem::take(&mut self.fired);
        fired.into_iter().try_for_each(|logged_ns| self.begin(self.at_ns(self.plan.sensor, logged_ns)))
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
                self.lost.push(format!("shot {number} could not be written and is lost: {}", with_causes(&error)));
                return Ok(());
            }
        };
        output.note("shot", &number.to_string())?;
        output.note("fired_s", &format!("{}", seconds(fired_ns - from_ns)))?;
        let to_ns = fired_ns.saturating_add(self.plan.trigger.post_ns);
        let shares = self.owed.iter().map(|owed| Share::of(*owed)).collect();
        let mut open = Open { output, from_ns, to_ns, fired_ns, shares, lost: false };
        for (sensor, clock) in self.moves.iter().enumerate() {
            open.write_kept(clock, self.kept.dropped_ns(sensor), self.kept.of(sensor))?;
        }
        self.kept.gaps().try_for_each(|(sensor, gap)| open.gap(&self.moves[sensor], sensor, gap))?;
        open.clocks(&self.clocks)?;
        self.open.push(open);
        Ok(())
    }

    /// The file of a shot; its folder is made anew where it is gone.
    fn create(&self, from_ns: i64, number: usize) -> Result<Output, RecordError> {
        let start_unix_ns = match self.run.start_unix_ns {
            0 => 0,
            start => start.saturating_add_signed(from_ns),
        };
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
        let mut kept_s = open.close(&self.progress, &self.moves, self.plan.sensor)?;
        let absent: Vec<String> = open.absent().map(|sensor| self.rig.sensors[sensor].name.clone()).collect();
        if !absent.is_empty() {
            open.output.note("absent", &format!("{}: nothing had come when the shot ended", absent.join(", ")))?;
        }
        open.output.note("ended", ended)?;
        // a folder that was moved away or deleted takes the file anew
        let _ = std::fs::create_dir_all(&self.plan.folder);
        let listed: Vec<bool> = (0..open.shares.len()).map(|sensor| open.lists(sensor)).collect();
        let file = open.output.path().shown().into_owned();
        match open.output.finish(0, |sensor| listed[sensor], Vec::new(), ended.to_owned()) {
            Ok(mut summary) => {
                if summary.data_lost {
                    // The disk refused what came later: what is in the file counts; the reason comes with the end of
                    // the session.
                    kept_s = Some((summary.duration_s - seconds(open.fired_ns - open.from_ns)).max(0.0));
                    let why = summary.ended.strip_prefix(ended).unwrap_or_default().trim_start_matches(['.', ' ']);
                    self.refused = Some(format!("{file}: {why}"));
                }
                summary.data_lost |= open.lost;
                self.done.push(summary);
            }
            Err(error) => {
                self.lost.push(format!("{file} could not be finished: {}", with_causes(&error)));
                return Ok(());
            }
        }
        if !absent.is_empty() {
            self.absent.push(Absent { file: file.clone(), sensors: absent });
        }
        if let Some(kept_s) = kept_s {
            self.cut_short.push(CutShort { file, kept_s, asked_s: seconds(self.plan.trigger.post_ns) });
        }
        Ok(())
    }

    /// What of a sensor is needed for shots to come: by how far the trigger's own sensor has come, or where that stays
    /// away by how far its own has; for lack of memory, that stays away not at all.
    fn needed(&self, sensor: usize) -> Needed {
        let before_ns = self.plan.trigger.pre_ns.saturating_add(LATE_NS);
        let trigger_ns = self.come_ns(self.plan.sensor).unwrap_or(i64::MIN);
        let own_ns = self.come_ns(sensor).unwrap_or(i64::MIN);
        let from = |come_ns: i64| self.moves[sensor].logged_ns(trigger_ns.max(come_ns).saturating_sub(before_ns));
        Needed { from_ns: from(own_ns.saturating_sub(self.held_ns)), surely_ns: from(own_ns) }
    }

    /// As [`Output::finish`]: the sums over all shots.
    pub fn finish(
        mut self,
        devices: Vec<DeviceCount>,
        mut ended: String,
        monitor: &Monitor,
    ) -> Result<Summary, RecordError> {
        self.begin_fired()?;
        for open in std::mem::take(&mut self.open) {
            self.end(open, &ended, monitor)?;
        }
        if let Some(refused) = &self.refused {
            ended = format!("{ended}. {refused}");
        }
        let mut sensors: Vec<SensorCount> = Vec::new();
        for count in self.done.iter().flat_map(|shot| &shot.sensors) {
            match sensors.iter_mut().find(|s| s.name == count.name) {
                Some(sum) => (sum.samples, sum.gaps) = (sum.samples + count.samples, sum.gaps + count.gaps),
                None => sensors.push(count.clone()),
            }
        }
        Ok(Summary {
            file: self.plan.folder.shown().into_owned(),
            // the sum over none is -0
            duration_s: self.done.iter().fold(0.0, |sum, shot| sum + shot.duration_s),
            sensors,
            // what is missing between shots is nobody's loss; a device that was gone then may have cost one
            data_lost: devices.iter().any(|device| device.incomplete)
                || self.done.iter().any(|shot| shot.data_lost || (!devices.is_empty() && shot.has_gaps()))
                || !self.lost.is_empty(),
            devices,
            ended,
            alerts: Vec::new(),
            shots: self.done.into_iter().map(|shot| shot.file).collect(),
            cut_short: self.cut_short,
            absent: self.absent,
            lost_shots: self.lost,
            unheeded_edges: self.trigger.unheeded_edges(),
        })
    }
}

#[cfg(test)]
mod tests;
