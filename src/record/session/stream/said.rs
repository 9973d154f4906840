//! What a device says to people: kept with the recording, a note a line, and shown while it runs.

use std::collections::VecDeque;

use crate::record::clock::device_clock::seconds;
use crate::record::error::RecordError;
use crate::record::session::session_log::Live;

/// So many lines of a device are kept with a recording: a device that says the same for hours does not fill it.
const MOST_NOTES: u64 = 200;
/// So many lines are shown, and told when it fails.
const LAST: usize = 20;

/// The lines that a device said.
#[derive(Debug)]
pub struct Said {
    key: String,
    /// The last ones.
    pub last: VecDeque<String>,
    /// How many there were.
    pub lines: u64,
    /// What came before the recording began.
    early: Vec<(i64, String)>,
    /// How many went to the notes.
    noted: u64,
}

impl Said {
    /// Nothing yet, of the device of that name.
    pub(super) fn of(device: &str) -> Said {
        Said { key: format!("{device}.stderr"), last: VecDeque::new(), lines: 0, early: Vec::new(), noted: 0 }
    }

    /// A line came at a time on the host's clock, ns.
    pub(super) fn take(&mut self, at_ns: i64, text: String, live: &mut Live<'_>) -> Result<(), RecordError> {
        self.lines += 1;
        if self.last.len() == LAST {
            self.last.pop_front();
        }
        self.last.push_back(text.clone());
        if self.noted + (self.early.len() as u64) < MOST_NOTES {
            self.early.push((at_ns, text));
        }
        self.note(live)
    }

    /// Writes what is not written yet, if the recording has begun.
    pub(crate) fn note(&mut self, live: &mut Live<'_>) -> Result<(), RecordError> {
        if !live.has_begun() {
            return Ok(());
        }
        for (at_ns, text) in std::mem::take(&mut self.early) {
            let at_s = seconds(live.recording_ns(at_ns));
            live.output()?.note(&self.key, &format!("at {at_s:.3} s: {text}"))?;
            self.noted += 1;
        }
        Ok(())
    }

    /// What is left out of the notes.
    pub(super) fn left_out(&self) -> Option<String> {
        let left_out = self.lines.saturating_sub(self.noted);
        (left_out > 0).then(|| format!("{left_out} more lines"))
    }

    /// The end of what it said, for a message.
    pub(super) fn ending(&self) -> String {
        let last: Vec<&str> = self.last.iter().rev().take(3).rev().map(String::as_str).collect();
        if last.is_empty() { String::new() } else { format!("; its last words: {}", last.join(" | ")) }
    }
}
