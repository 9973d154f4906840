//! Measurement times of a device: its clock through restarts and steps, against the arrivals, and against the other
//! devices' clocks.

use std::time::{Duration, Instant};

use crate::record::clock::align::Stretch;
use crate::record::clock::device_clock::{DeviceClock, seconds};
use crate::record::clock::time_unit::{Pace, Runs};
use crate::record::error::RecordError;
use crate::record::session::session_log::Live;
use crate::record::session::stream::stamp::Stamp;
use crate::rig::{Device, Protocol};
use crate::storage::SensorClock;

/// A device whose arrivals come later than this after where its clock should be has restarted, where something speaks
/// for it: s, and share of the time since.
const RESTART_S: (f64, f64) = (0.5, 1e-3);
/// Where its sequence began anew, or where they come too early, which no delay explains: s, and times what 95% of the
/// arrivals were off.
const ANEW_S: (f64, f64) = (0.1, 4.0);
/// A line below fewer arrivals than this says nothing of when something was sent.
const LINE_KNOWN: u64 = 50;
/// A device that sends its first so much later than the recording begins owes what was before, s; one that is slower,
/// by its rhythm.
const BEGINS_S: f64 = 1.0;

/// What is on its way when a session ends is not missed, nor what is not due for twice the longest pause.
pub const ON_ITS_WAY: Duration = Duration::from_millis(500);

/// What speaks for a restart, so that the device's time is looked at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Sign {
    None,
    /// Its sequence began anew.
    Sequence,
    /// Lines are missing.
    Hole,
}

/// The times of one device; see the module.
pub struct Timing {
    /// When it last sent something valid, or the session began.
    pub last_message: Instant,
    /// Others are recorded with it, on one clock.
    pub shared: bool,
    /// What it recorded, from restart to restart.
    pub stretches: Vec<Stretch>,
    pub(super) clock: Option<DeviceClock>,
    /// The logged time up to which it has come, ns.
    pub(super) come_ns: Option<i64>,
    /// The longest time between two messages, nothing missing between.
    pub(super) pause: Option<Duration>,
    /// How often its clock was set while it ran.
    pub(super) steps: u64,
    /// It says that it has restarted.
    pub(super) restarted: bool,
    /// Its port was gone, and nothing has come since.
    pub(super) returned: bool,
    /// What puts its logged times on the recording's clock, as well as it is known by now.
    moves: SensorClock,
    /// How its times run against their arrival; none where they are played at another pace, or are our own.
    pub pace: Option<Pace>,
    /// How long its last message was.
    span: Duration,
    /// How often it is asked, of one that is polled.
    poll: Option<Duration>,
}

impl Timing {
    /// Of a device, before its first message.
    pub(super) fn new(device: &Device) -> Timing {
        let (poll, pace) = match device.protocol {
            Protocol::ModbusRtu { poll_interval_s, .. } => (Duration::try_from_secs_f64(poll_interval_s).ok(), None),
            Protocol::Frames | Protocol::Lines { .. } => (None, Some(Pace::default())),
        };
        Timing {
            last_message: Instant::now(),
            shared: false,
            stretches: Vec::new(),
            clock: None,
            come_ns: None,
            pause: None,
            steps: 0,
            restarted: false,
            returned: false,
            moves: SensorClock::default(),
            pace,
            span: Duration::ZERO,
            poll,
        }
    }

    /// The device's clock for samples from a stamp on: a new one at the beginning, set anew after a restart, moved
    /// where it was set.
    pub(crate) fn begin(
        &mut self,
        stamp: &Stamp,
        sign: Sign,
        live: &mut Live<'_>,
    ) -> Result<&mut DeviceClock, RecordError> {
        let &Stamp { device_ns, sent_ns, began_ns, .. } = stamp;
        let host_ns = began_ns.saturating_sub(sent_ns - device_ns);
        live.begin(host_ns)?;
        let returned = std::mem::take(&mut self.returned);
        let elsewhere = (returned || sign != Sign::None) && self.is_elsewhere(sent_ns, began_ns, sign);
        let restarted = std::mem::take(&mut self.restarted) || elsewhere;
        let recording_ns = live.recording_ns(host_ns);
        let from_ns = match &mut self.clock {
            None => Some(recording_ns),
            Some(clock) if restarted => Some(clock.restart(device_ns, recording_ns)),
            Some(_) => None,
        };
        if let Some(from_ns) = from_ns {
            if let Some(last) = self.stretches.last_mut() {
                last.close();
            }
            // By the times that are logged, in which steps of its clock do not show.
            self.stretches.push(Stretch::new(from_ns, from_ns));
            live.clocks_changed();
            self.pace.iter_mut().for_each(Pace::begin_anew);
        } else if let Some(by_ns) = self.step_ns(stamp)
            && let Some(clock) = &mut self.clock
        {
            clock.step(by_ns);
            self.steps += 1;
            self.pace.iter_mut().for_each(Pace::begin_anew);
        }
        Ok(self.clock.get_or_insert_with(|| DeviceClock::starting_at(device_ns, recording_ns)))
    }

    /// True for a device whose clock cannot have run on until here.
    fn is_elsewhere(&self, sent_ns: i64, began_ns: i64, sign: Sign) -> bool {
        let stretch = self.stretches.last().and_then(|stretch| Some((stretch, stretch.line()?)));
        let (Some((stretch, line)), Some(clock)) = (stretch, self.clock) else { return false };
        let logged_ns = clock.at_ns(sent_ns);
        let away_s = (logged_ns - stretch.device_ns) as f64 / 1e9;
        let late_s = (began_ns as f64 - line.host_at(logged_ns)) / 1e9;
        let surely = sign == Sign::Sequence || late_s < 0.0;
        let least_s = if surely { ANEW_S.0 + ANEW_S.1 * line.residual_ns.1 / 1e9 } else { RESTART_S.0 };
        late_s.abs() > least_s + RESTART_S.1 * away_s.abs()
    }

    /// By how much the device's clock was set before a frame that is off its place, ns. It cannot be behind a hole
    /// where it stands before the end of those before it, or came earlier than it could have been sent. Where it stands
    /// before the end of frames that are missing, these may have been shorter than others: it came late by as much,
    /// unless they were, where arrivals are known so well.
    fn step_ns(&self, stamp: &Stamp) -> Option<i64> {
        let (clock, earliest) = (self.clock?, stamp.jump?);
        let missing_ns = (i64::from(stamp.lost) * stamp.rows as i64).saturating_mul(stamp.period_ns);
        let behind_ns = clock.at_ns(stamp.device_ns).saturating_sub(clock.end_ns());
        let ahead_ns = behind_ns.saturating_sub(missing_ns);
        let stretch = self.stretches.last()?;
        let line = stretch.line().filter(|line| line.is_real_time && stretch.seen() >= LINE_KNOWN);
        // how much earlier it came than the clock as it was says, and how far arrivals scatter
        let arrival = line
            .map(|line| (line.host_at(clock.at_ns(earliest.sent_ns)) - earliest.began_ns as f64, line.residual_ns.1));
        let half_ns = ahead_ns as f64 / 2.0;
        let is_step = match arrival {
            _ if ahead_ns <= 0 && behind_ns < 0 => true,
            Some((early_ns, scatter_ns)) if ahead_ns > 0 => early_ns > scatter_ns.max(half_ns),
            Some((early_ns, scatter_ns)) if -half_ns > scatter_ns => early_ns < half_ns,
            _ => ahead_ns <= 0,
        };
        is_step.then_some(ahead_ns)
    }

    /// Something has been recorded up to `last_ns`, and has come up to `come_ns`; true where it tells more of how its
    /// times run.
    pub(crate) fn arrived(&mut self, stamp: &Stamp, last_ns: i64, come_ns: i64) -> bool {
        let Some(clock) = self.clock else { return false };
        self.come_ns = Some(come_ns);
        self.span = Duration::from_nanos(stamp.sent_ns.saturating_sub(stamp.device_ns).unsigned_abs());
        if let Some(stretch) = self.stretches.last_mut() {
            stretch.arrived(clock.at_ns(stamp.sent_ns), stamp.began_ns);
            stretch.last_ns = last_ns;
        }
        self.pace.as_mut().is_some_and(|pace| pace.arrived(stamp.sent_ns, stamp.began_ns))
    }

    /// How its times run against their arrival.
    pub fn runs(&self) -> Runs {
        self.pace.as_ref().map_or(Runs::Evenly, Pace::runs)
    }

    /// It has sent something valid; `whole` where nothing is missing before.
    pub(crate) fn sent_something(&mut self, whole: bool) {
        let since = self.last_message.elapsed();
        if whole && !self.returned && !self.stretches.is_empty() {
            self.pause = Some(self.pause.map_or(since, |pause| pause.max(since)));
        }
        self.last_message = Instant::now();
    }

    /// Takes what puts its logged times on the recording's clock.
    pub fn set_moves(&mut self, moves: SensorClock) {
        self.moves = moves;
    }

    /// True where its times move when clocks are fitted anew: all is written then that comes before the session ends,
    /// and what is kept is cut in the finished file.
    pub fn is_moved(&self) -> bool {
        self.shared || self.stretches.len() > 1
    }

    /// The logged time up to which it is written, ns: to the end of the duration, unless its clock is moved, or not
    /// known to run as ours does.
    pub(crate) fn limit_ns(&self, live: &Live<'_>) -> i64 {
        let is_behind = self.come_ns.is_some_and(|come_ns| come_ns >= live.end_ns);
        if self.is_moved() || (is_behind && self.runs() != Runs::Evenly) { i64::MAX } else { live.end_ns }
    }

    /// A time on the recording's clock, such as that up to which it is kept, as logged, s.
    pub fn logged_s(&self, time_ns: i64) -> f64 {
        seconds(self.moves.logged_ns(time_ns))
    }

    /// True for a logged time before the end of the recording; of a clock that does not run as ours does, for any until
    /// it ends.
    pub(crate) fn is_wanted(&self, logged_ns: i64, live: &Live<'_>) -> bool {
        self.moves.time_ns(logged_ns) < live.end_ns || matches!(self.runs(), Runs::Off { .. })
    }

    /// True where it has recorded for the duration, at a time of ours on the recording's clock: by its own times, which
    /// say to the sample what was measured until then, unless these do not run as ours do.
    pub fn is_through(&self, end_ns: i64, now_ns: i64) -> bool {
        match self.runs() {
            Runs::Evenly => self.has_come_to(end_ns),
            Runs::Unknown => self.has_come_to(end_ns) && now_ns >= end_ns,
            Runs::Off { .. } => now_ns >= end_ns,
        }
    }

    /// True where it has come to a time on the recording's clock.
    pub fn has_come_to(&self, time_ns: i64) -> bool {
        self.come_ns.is_some_and(|come_ns| self.moves.time_ns(come_ns) >= time_ns)
    }

    /// Where it began later than the recording, by more than its rhythm: its first logged time, ns, and how much later
    /// that is, s.
    pub fn begins_late(&self) -> Option<(i64, f64)> {
        let (first, pause) = (self.stretches.first()?, self.pause?);
        let late_s = seconds(self.moves.time_ns(first.from_ns));
        (late_s > self.patience(pause).as_secs_f64().max(BEGINS_S)).then_some((first.from_ns, late_s))
    }

    /// When what came from it last was sent at the latest: not before its longest pause, for that may be a burst.
    pub fn sent_by(&self) -> Instant {
        self.pause.and_then(|pause| self.last_message.checked_sub(pause)).unwrap_or(self.last_message)
    }

    /// For how long a device that pauses for so long between two messages is not missed.
    pub(crate) fn patience(&self, pause: Duration) -> Duration {
        ON_ITS_WAY.max(2 * pause).max(2 * self.span)
    }

    /// Since when, as a logged time in ns, and for how long it has been silent at a moment, where more than its rhythm
    /// allows.
    pub fn silent_since(&self, moment: Instant, silence: Duration) -> Option<(i64, Duration)> {
        let since = moment.saturating_duration_since(self.last_message);
        // of one that spoke only once no rhythm is known
        let allowed = self.poll.max(self.pause).map_or(silence.max(2 * self.span), |pause| self.patience(pause));
        (since > allowed).then_some((self.stretches.last()?.last_ns, since))
    }
}
