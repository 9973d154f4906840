//! One shot of a triggered recording: its file, and what of the stream belongs into it.

use super::RecordError;
use super::clock::seconds;
use super::output::Output;
use crate::log::ClockFix;
use crate::recording::Gap;

/// Evenly spaced samples of a sensor.
pub(super) struct Batch {
    pub(super) sensor: usize,
    pub(super) first_ns: i64,
    pub(super) period_ns: f64,
    pub(super) values: Vec<f64>,
}

impl Batch {
    pub(super) fn at(&self, i: usize) -> i64 {
        self.first_ns.saturating_add((i as f64 * self.period_ns).round() as i64)
    }

    pub(super) fn last_ns(&self) -> i64 {
        self.at(self.values.len().saturating_sub(1))
    }
}

/// A shot that is being written.
pub(super) struct Open {
    pub(super) output: Output,
    /// Its bounds on the session's clock, ns.
    pub(super) from_ns: i64,
    pub(super) to_ns: i64,
    /// When the trigger fired, likewise.
    pub(super) fired_ns: i64,
    /// The sensors that have samples in it.
    pub(super) sensors: Vec<usize>,
    /// Samples that belong into it are missing.
    pub(super) lost: bool,
}

/// How far a sensor has come.
#[derive(Debug, Clone, Copy)]
pub(super) struct Heard {
    /// Time of its last sample, ns.
    pub(super) last_ns: i64,
    /// From the one before to it, ns; none of a sensor's first.
    pub(super) spacing_ns: Option<i64>,
}

impl Heard {
    /// With a batch more.
    pub(super) fn after(before: Option<Heard>, batch: &Batch) -> Heard {
        let spacing_ns = match before {
            _ if batch.values.len() > 1 => Some(batch.period_ns as i64),
            Some(before) => Some(batch.last_ns().saturating_sub(before.last_ns).max(0)),
            None => None,
        };
        Heard { last_ns: batch.last_ns(), spacing_ns }
    }

    /// Whether samples before `until_ns` are missing: one would have been due.
    fn lags(self, until_ns: i64) -> bool {
        self.spacing_ns.is_some_and(|spacing| until_ns.saturating_sub(self.last_ns) > spacing.saturating_mul(3) / 2)
    }
}

impl Open {
    /// Writes what of a batch lies in the shot.
    pub(super) fn write(&mut self, batch: &Batch) -> Result<(), RecordError> {
        let inside = |i: &usize| (self.from_ns..=self.to_ns).contains(&batch.at(*i));
        let Some(first) = (0..batch.values.len()).find(inside) else { return Ok(()) };
        let count = (first..batch.values.len()).take_while(inside).count();
        self.put(batch, first, count)
    }

    /// Writes a gap that reaches into the shot.
    pub(super) fn gap(&mut self, sensor: usize, gap: Gap) -> Result<(), RecordError> {
        let zero_s = seconds(self.from_ns);
        if gap.to_s <= zero_s || gap.from_s >= seconds(self.to_ns) {
            return Ok(());
        }
        self.output.gap(sensor, Gap { from_s: gap.from_s - zero_s, to_s: gap.to_s - zero_s, ..gap })
    }

    /// Writes how the clocks lie to each other, on the shot's own clock.
    pub(super) fn clocks(&mut self, fixes: &[ClockFix]) -> Result<(), RecordError> {
        let on_shot = |fix: &ClockFix| ClockFix {
            from_ns: fix.from_ns.saturating_sub(self.from_ns),
            to_ns: fix.to_ns.saturating_sub(self.from_ns),
            ..fix.clone()
        };
        self.output.clocks(fixes.iter().map(on_shot).collect())
    }

    /// Writes the last sample of a batch that lies before the shot.
    pub(super) fn write_last(&mut self, batch: &Batch) -> Result<(), RecordError> {
        self.put(batch, batch.values.len() - 1, 1)
    }

    fn put(&mut self, batch: &Batch, first: usize, count: usize) -> Result<(), RecordError> {
        if !self.sensors.contains(&batch.sensor) {
            self.sensors.push(batch.sensor);
        }
        let values = &batch.values[first..first + count];
        self.output.samples(batch.sensor, batch.at(first) - self.from_ns, batch.period_ns, values)
    }

    /// Notes what is missing where the shot ends with what has come by now: a gap for each sensor that is behind the others, and, where all
    /// are, that it is cut short. Says in that case how much of the time after it fired is kept, s.
    pub(super) fn close(&mut self, heard: &[Option<Heard>]) -> Result<Option<f64>, RecordError> {
        let newest = heard.iter().flatten().max_by_key(|h| h.last_ns).copied();
        let Some(newest) = newest else { return Ok(None) };
        let reached_ns = newest.last_ns.min(self.to_ns);
        for (sensor, heard) in heard.iter().enumerate() {
            if let Some(heard) = heard.filter(|heard| heard.lags(reached_ns)) {
                self.missing(sensor, heard.last_ns, reached_ns)?;
            }
        }
        if !newest.lags(self.to_ns) {
            return Ok(None);
        }
        self.lost = true;
        let (kept_s, asked_s) = (seconds(reached_ns - self.fired_ns), seconds(self.to_ns - self.fired_ns));
        self.output.note("cut_short", &format!("{kept_s:.3} of {asked_s} s after it fired were recorded"))?;
        Ok(Some(kept_s))
    }

    /// Samples of a sensor between two times of the session are not in the shot, though they belong there.
    pub(super) fn missing(&mut self, sensor: usize, from_ns: i64, to_ns: i64) -> Result<(), RecordError> {
        self.lost = true;
        let from_ns = from_ns.max(self.from_ns);
        self.gap(sensor, Gap { from_s: seconds(from_ns), to_s: seconds(to_ns), samples: None })
    }
}
