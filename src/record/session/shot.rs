//! One shot of a triggered recording: its file, and what of the stream belongs into it.

use crate::record::clock::device_clock::seconds;
use crate::record::error::RecordError;
use crate::record::session::output::Output;
use crate::recording::Gap;
use crate::storage::layout::{offset_ns, within};
use crate::storage::{ClockFix, SensorClock};

/// Evenly spaced samples of a sensor.
pub(crate) struct Batch {
    pub(crate) sensor: usize,
    pub(crate) first_ns: i64,
    pub(crate) period_ns: f64,
    pub(crate) values: Vec<f64>,
}

impl Batch {
    fn at(&self, i: usize) -> i64 {
        self.first_ns.saturating_add(offset_ns(i, self.period_ns))
    }

    /// Memory that it takes, bytes.
    pub(crate) fn bytes(&self) -> usize {
        size_of::<Batch>() + size_of_val(&self.values[..])
    }

    /// Time of its last sample, as logged, ns.
    pub(crate) fn last_ns(&self) -> i64 {
        self.at(self.values.len().saturating_sub(1))
    }
}

/// How a sensor's samples lie to a shot. Times are as logged, ns.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Share {
    /// A device was to send them.
    owed: bool,
    /// Nothing of them is in the shot.
    absent: bool,
    /// The last sample that was left out before it, the first and the last that were written, and the first left out
    /// behind it.
    before: Option<i64>,
    written: Option<(i64, i64)>,
    behind: Option<i64>,
    /// It had no sample in the time before the shot: its last one stands for it.
    carried: bool,
}

impl Share {
    /// Of a sensor from which a device was to send, or not.
    pub(crate) fn of(owed: bool) -> Share {
        Share { owed, ..Share::default() }
    }
}

/// A shot that is being written. Samples are cut by the clocks as they were known when they came, with a margin where
/// these may still move; what the finished file keeps is cut by the clocks as they are known in the end.
pub(crate) struct Open {
    pub(crate) output: Output,
    /// Its bounds on the recording's clock, ns.
    pub(crate) from_ns: i64,
    pub(crate) to_ns: i64,
    /// When the trigger fired, likewise.
    pub(crate) fired_ns: i64,
    /// Each sensor of the rig.
    pub(crate) shares: Vec<Share>,
    /// Samples that belong into it are missing.
    pub(crate) lost: bool,
}

/// How far a sensor has come.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Progress {
    /// Time of its last sample as logged, ns.
    pub(crate) last_ns: i64,
    /// From the one before to it, ns; none of a sensor's first.
    pub(crate) spacing_ns: Option<i64>,
}

impl Progress {
    /// With a batch more.
    pub(crate) fn after(before: Option<Progress>, batch: &Batch) -> Progress {
        let spacing_ns = match before {
            _ if batch.values.len() > 1 => Some(batch.period_ns as i64),
            Some(before) => Some(batch.last_ns().saturating_sub(before.last_ns).max(0)),
            None => None,
        };
        Progress { last_ns: batch.last_ns(), spacing_ns }
    }

    /// Whether samples before `until_ns` on the recording's clock are missing: one would have been due.
    fn lags(self, clock: &SensorClock, until_ns: i64) -> bool {
        self.lacks(clock.time_ns(self.last_ns), until_ns)
    }

    /// Whether one would have been due between two times.
    fn lacks(self, from_ns: i64, to_ns: i64) -> bool {
        self.spacing_ns.is_some_and(|spacing| to_ns.saturating_sub(from_ns) > spacing.saturating_mul(3) / 2)
    }
}

/// How much more than a shot needs is kept and written of sensors whose clock may still move, ns.
pub(crate) const MARGIN_NS: i64 = 500_000_000;

impl Open {
    /// Its bounds as logged, ns, with the margin.
    fn bounds(&self, clock: &SensorClock) -> (i64, i64) {
        let margin_ns = if clock.is_empty() { 0 } else { MARGIN_NS };
        (clock.logged_ns(self.from_ns.saturating_sub(margin_ns)), clock.logged_ns(self.to_ns.saturating_add(margin_ns)))
    }

    /// Writes what was kept of a sensor, whose last sample no longer kept is `dropped_ns`.
    pub(crate) fn write_kept<'a>(
        &mut self,
        clock: &SensorClock,
        dropped_ns: Option<i64>,
        kept: impl DoubleEndedIterator<Item = &'a Batch> + Clone,
    ) -> Result<(), RecordError> {
        let Some(last) = kept.clone().next_back() else { return Ok(()) };
        // A slow sensor may have had no sample in the time before the shot: then its last one says how it stood.
        if clock.time_ns(last.last_ns()) < self.from_ns {
            self.shares[last.sensor].carried = true;
            return self.put(last, last.values.len() - 1, 1);
        }
        self.shares[last.sensor].before = dropped_ns;
        kept.into_iter().try_for_each(|batch| self.write(clock, batch))
    }

    /// Writes what of a batch lies in the shot.
    pub(crate) fn write(&mut self, clock: &SensorClock, batch: &Batch) -> Result<(), RecordError> {
        let ((from_ns, to_ns), all) = (self.bounds(clock), batch.values.len());
        let inside = within(batch.first_ns, batch.period_ns, all, from_ns, to_ns);
        let share = &mut self.shares[batch.sensor];
        if inside.start > 0 {
            share.before = Some(batch.at(inside.start - 1));
        }
        if inside.end < all {
            share.behind.get_or_insert(batch.at(inside.end));
        }
        if inside.is_empty() { Ok(()) } else { self.put(batch, inside.start, inside.len()) }
    }

    /// Writes a gap that reaches into the shot; it is as logged.
    pub(crate) fn gap(&mut self, clock: &SensorClock, sensor: usize, gap: Gap) -> Result<(), RecordError> {
        let (from_ns, to_ns) = self.bounds(clock);
        if gap.to_s <= seconds(from_ns) || gap.from_s >= seconds(to_ns) {
            return Ok(());
        }
        let zero_s = seconds(self.from_ns);
        self.output.gap(sensor, Gap { from_s: gap.from_s - zero_s, to_s: gap.to_s - zero_s, ..gap })
    }

    /// Writes how the clocks lie to each other, on the shot's own clock.
    pub(crate) fn clocks(&mut self, fixes: &[ClockFix]) -> Result<(), RecordError> {
        let on_shot = |fix: &ClockFix| ClockFix {
            from_ns: fix.from_ns.saturating_sub(self.from_ns),
            to_ns: fix.to_ns.saturating_sub(self.from_ns),
            ..fix.clone()
        };
        self.output.clocks(fixes.iter().map(on_shot).collect())
    }

    fn put(&mut self, batch: &Batch, first: usize, count: usize) -> Result<(), RecordError> {
        let written = &mut self.shares[batch.sensor].written;
        *written = Some((written.map_or(batch.at(first), |(began, _)| began), batch.at(first + count - 1)));
        let values = &batch.values[first..first + count];
        self.output.samples(batch.sensor, batch.at(first) - self.from_ns, batch.period_ns, values)
    }

    /// True of a sensor that has samples in it, or should have.
    pub(crate) fn lists(&self, sensor: usize) -> bool {
        self.shares.get(sensor).is_some_and(|share| share.written.is_some() || share.absent)
    }

    /// Sensors of which nothing is in it, though it should, as [`close`](Open::close) found them.
    pub(crate) fn absent(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.shares.len()).filter(|&sensor| self.shares[sensor].absent)
    }

    /// Notes what is missing where the shot ends with what has come by now, of the sensors `progress`, which have
    /// `clocks`: a gap for each that is behind the trigger's, that began within the shot or has not spoken at all
    /// though a device was to send it, or was cut where by the clocks as they are known now it should not have been;
    /// and, where the trigger's is behind too, that it is cut short. Says in that case how much of the time after it
    /// fired is kept, s.
    pub(crate) fn close(
        &mut self,
        progress: &[Option<Progress>],
        clocks: &[SensorClock],
        trigger: usize,
    ) -> Result<Option<f64>, RecordError> {
        let Some(fired_by) = progress.get(trigger).copied().flatten() else { return Ok(None) };
        let reached_ns = clocks[trigger].time_ns(fired_by.last_ns).min(self.to_ns);
        for (sensor, (progress, clock)) in progress.iter().zip(clocks).enumerate() {
            let share = self.shares[sensor];
            let (from_ns, to_ns) = (clock.logged_ns(self.from_ns), clock.logged_ns(reached_ns));
            let begins_ns = share.written.map_or(to_ns, |(first, _)| first.min(to_ns));
            if share.owed && !share.carried && share.written.is_none_or(|(first, _)| first > to_ns) {
                self.shares[sensor].absent = true;
                self.missing(clock, sensor, from_ns, to_ns)?;
                continue;
            }
            let Some(progress) = progress else { continue };
            // its last sample stands for it, though more were due since
            self.shares[sensor].absent = share.owed && share.carried && progress.lags(clock, self.from_ns);
            let (dropped, begun) = match share.before {
                Some(before) => (before >= from_ns, false),
                // its very first samples are in the shot: it began later
                None => (false, share.owed && progress.lacks(from_ns, begins_ns)),
            };
            if (dropped || begun) && !share.carried {
                self.missing(clock, sensor, from_ns, begins_ns)?;
            }
            if progress.lags(clock, reached_ns) {
                self.missing(clock, sensor, progress.last_ns.max(from_ns), to_ns)?;
            } else if share.behind.is_some_and(|behind| behind <= to_ns) {
                self.missing(clock, sensor, share.written.map_or(from_ns, |(_, last)| last), to_ns)?;
            }
            if !clock.is_empty() {
                let from_ns = if share.carried { i64::MIN } else { 0 };
                let length_ns = self.to_ns - self.from_ns;
                self.output.keep(sensor, from_ns, length_ns, length_ns);
            }
        }
        if !fired_by.lags(&clocks[trigger], self.to_ns) {
            return Ok(None);
        }
        self.lost = true;
        let (kept_s, asked_s) = (seconds(reached_ns - self.fired_ns), seconds(self.to_ns - self.fired_ns));
        self.output.note("cut_short", &format!("{kept_s:.3} of {asked_s} s after it fired were recorded"))?;
        Ok(Some(kept_s))
    }

    /// Samples of a sensor between two logged times are not in the shot, though they belong there.
    fn missing(&mut self, clock: &SensorClock, sensor: usize, from_ns: i64, to_ns: i64) -> Result<(), RecordError> {
        self.lost = true;
        self.gap(clock, sensor, Gap { from_s: seconds(from_ns), to_s: seconds(to_ns), samples: None })
    }
}
