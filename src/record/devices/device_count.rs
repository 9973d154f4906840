//! What came from one device, counted.

use serde::Serialize;

use crate::number::significant;
use crate::record::clock::summary::ClockSummary;

/// What came from one device. Lines and answers to polls count as frames.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct DeviceCount {
    /// Its name.
    pub name: String,
    /// Valid frames.
    pub frames: u64,
    /// Damaged ones (check sum, length, text that does not parse), and answers that refuse.
    pub bad_frames: u64,
    /// Missing ones: by the jumps of the sequence, where damaged ones are missing too; of polls, those without an
    /// answer.
    pub lost_frames: u64,
    /// Frames that came again and were dropped.
    pub duplicated_frames: u64,
    /// Answers that came after their time-out and were dropped.
    pub late_answers: u64,
    /// Polls that fell out because the one before took too long.
    pub skipped_polls: u64,
    /// Requests that its line itself sent back, as two-wire adapters do; they are taken off and do no harm.
    pub returned_requests: u64,
    /// How often samples are known to be missing.
    pub holes: u64,
    /// How often its port vanished and came back.
    pub reconnects: u64,
    /// How often its clock began anew.
    pub restarts: u64,
    /// How often its clock was set while its sequence went on; its times are as if it had not been.
    pub clock_steps: u64,
    /// Frames that by their stamps began before the one before them ended; their samples stand closer.
    pub squeezed_frames: u64,
    /// Frames whose time the ones around them refute: they stand where the sequence puts them.
    pub restamped_frames: u64,
    /// Standard deviation of its stamps, s, where they scatter by more than its samples are apart and are smoothed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stamps_scatter_s: Option<f64>,
    /// How much longer than its frames say the time between its samples is by its stamps, s, and over how many s; zeros
    /// where they agree.
    #[serde(skip)]
    pub period_off_s: (f64, f64),
    /// How often its thread waited because the session did not keep up.
    pub queue_waits: u64,
    /// How long it waited in all, s.
    pub queue_waited_s: f64,
    /// It ended before the others, or before the duration, or never spoke.
    pub incomplete: bool,
    /// It began so much later than the recording, s, where that is more than its rhythm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub began_late_s: Option<f64>,
    /// The last lines that it said to people, of a device that is a process.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub stderr: Vec<String>,
    /// How many lines there were.
    #[serde(skip)]
    pub said: u64,
    /// What of them is not among the notes.
    #[serde(skip)]
    pub said_more: Option<String>,
    /// Its clock against this computer's.
    pub clock: Option<ClockSummary>,
    /// How many times as fast as they arrive its times run, and within which factor, where that is no clock's drift and
    /// no other unit.
    #[serde(skip)]
    pub off: Option<(f64, f64)>,
    /// Why polls of it fell out, and what to do.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub poll_warning: Option<String>,
    /// Why its times cannot be trusted against those of other devices, or across a restart.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clock_warning: Option<String>,
}

impl DeviceCount {
    /// Whether samples of it are missing.
    pub(crate) fn lost_data(&self) -> bool {
        self.incomplete || self.began_late_s.is_some() || self.bad_frames > 0 || self.lost_frames > 0 || self.holes > 0
    }

    /// Says where its times cannot be trusted; `several` devices have theirs compared.
    pub(crate) fn warn(&mut self, several: bool) {
        let (off_s, over_s) = self.period_off_s;
        let period = (off_s != 0.0).then(|| {
            format!(
                "the sample period that it states is off by {:.2}% from its own time stamps, which were used: correct the period \
                 that it sends, or its clock",
                100.0 * off_s / over_s
            )
        });
        let compared = several || self.restarts > 0 || self.clock_steps > 0;
        let clock = self.clock.as_ref().filter(|_| compared).and_then(ClockSummary::warning);
        let scatter = self.stamps_scatter_s.map(|scatter_s| {
            format!(
                "its time stamps scatter by {:.1} ms, which is more than a sample period, and are smoothed: all its times may be off by \
                 about as much; let it take the time when it samples, not when it sends",
                1e3 * scatter_s
            )
        });
        let off = self.off.map(|(times, within)| {
            let (times, percent) = (significant(times, 3), significant(100.0 * (within - 1.0), 1));
            format!(
                "its times run {times} times as fast as they arrived (± {percent}%): correct the times that it sends, or their unit; the recording \
                 keeps them as they came"
            )
        });
        // what does not run as fast as ours was never to be on time
        let clock = clock.filter(|_| off.is_none());
        let all: Vec<String> = off.into_iter().chain(clock).chain(period).chain(scatter).collect();
        self.clock_warning = (!all.is_empty()).then(|| all.join("; "));
    }

    /// What is kept of it with the recording.
    pub(crate) fn notes(&self) -> Vec<(&'static str, String)> {
        let mut notes = vec![
            ("frames", self.frames.to_string()),
            ("bad_frames", self.bad_frames.to_string()),
            ("lost_frames", self.lost_frames.to_string()),
            ("duplicated_frames", self.duplicated_frames.to_string()),
        ];
        let seldom = [
            ("late_answers", self.late_answers),
            ("skipped_polls", self.skipped_polls),
            ("returned_requests", self.returned_requests),
            ("reconnects", self.reconnects),
            ("restarts", self.restarts),
            ("clock_steps", self.clock_steps),
            ("squeezed_frames", self.squeezed_frames),
            ("restamped_frames", self.restamped_frames),
            ("queue_waits", self.queue_waits),
        ];
        notes.extend(seldom.into_iter().filter(|(_, count)| *count > 0).map(|(what, count)| (what, count.to_string())));
        notes.extend(self.began_late_s.map(|late_s| ("began_late_s", format!("{late_s:.3}"))));
        notes.extend(self.said_more.iter().map(|more| ("stderr", more.clone())));
        if let Some(clock) = &self.clock {
            notes.push(("clock", clock.to_string()));
        }
        notes.extend(self.poll_warning.iter().map(|warning| ("poll_warning", warning.clone())));
        notes.extend(self.clock_warning.iter().map(|warning| ("clock_warning", warning.clone())));
        notes
    }
}
