//! Puts valid frames in order: finds repeated and missing ones, and stamps that are false.
//!
//! A frame whose sequence number and stamp follow those before it is handed on at once. Any other is held until the
//! next ones decide: the next frame refutes a single false stamp; a hole, a clock that was set and a restart are
//! believed once [`AGREEING`] frames agree.
//!
//! A sequence number, a restart rule and a line through the arrivals would do less. These cases need the stamps to be
//! judged; the tests named are in `tests/resequencer.rs`, and `session/live_test/tests/clocks.rs` repeats the first
//! four with samples that carry their own true time.
//!
//! | case | why the simple rule fails | test |
//! | --- | --- | --- |
//! | one false stamp (a 64-bit clock read in halves) | the CRC is right and the sequence unbroken; alone, the stamp looks like a hole | `a_false_time_is_dropped_and_a_true_jump_is_not` |
//! | the clock is set, also beside lost frames | the sequence does not show it; the restart rule would begin a new clock | `a_step_of_the_clock_loses_no_frame`, `a_clock_that_is_set_back_where_frames_are_missing_is_told_by_the_sequence` |
//! | the device pauses without skipping a number | the sequence shows no hole | `a_false_time_is_dropped_and_a_true_jump_is_not` |
//! | stamps that scatter by several sample periods, or tick | arrivals scatter as much, and bursts delay them more | `stamps_that_scatter_are_smoothed`, `bursts_do_not_speak_for_a_false_stamp` |
//! | a hole longer than the sequence | 65 536 frames look like none | `a_hole_longer_than_the_sequence_is_counted_by_the_devices_time` |
//! | a stated period that is wrong | samples within a frame would be spread wrongly | `a_wrong_period_is_taken_from_the_stamps_and_told` |

use std::collections::VecDeque;
use std::hash::{DefaultHasher, Hash, Hasher};

use crate::record::wire::frames::event::{Event, FrameCounts, Sent, Taken};
use crate::record::wire::frames::frame::Frame;
use crate::record::wire::frames::period::StatedPeriod;
use crate::record::wire::frames::timestamp_filter::TimestampFilter;

/// Held frames are believed when so many in sequence agree with each other.
const AGREEING: usize = 3;

/// So many of the last frames are remembered, to recognise repeated ones.
const RECENT: usize = 64;

/// See the module.
#[derive(Debug, Default)]
pub(crate) struct Resequencer {
    filter: Option<TimestampFilter>,
    stated: StatedPeriod,
    /// The filter before a hop that one stamp alone was believed.
    before: Option<TimestampFilter>,
    /// The end of what was handed on, where that may be beyond what comes next, µs.
    floor_us: f64,
    /// Frames off their place, with their arrivals: in sequence among themselves.
    held: Vec<(Frame, i64)>,
    /// The last frames: a device that restarts twice may say the same numbers and times again, but not the same
    /// samples.
    recent: VecDeque<Name>,
    /// Frames missing since the last one handed on, and whether the sequence began anew since.
    lost_before: u32,
    anew: bool,
    /// The frames held were believed, and the next one handed on is the first of them.
    jump: Option<Sent>,
    pub(crate) counts: FrameCounts,
}

impl Resequencer {
    /// What was seen so far; a frame in doubt is a bad one until it is believed.
    pub(crate) fn counts(&self) -> FrameCounts {
        FrameCounts { bad: self.counts.bad + self.in_doubt() as u64, ..self.counts }
    }

    /// Standard deviation of the device's stamps, s; `None` where they hold as they are.
    pub(crate) fn stamps_scatter_s(&self) -> Option<f64> {
        self.filter.as_ref()?.smoothed_scatter_us().map(|scatter_us| scatter_us / 1e6)
    }

    /// As [`StatedPeriod::off_s`]; where the stamps are gone by, as a share and 1. Of stamps that scatter a small
    /// disagreement says nothing.
    pub(crate) fn period_off_s(&self) -> (f64, f64) {
        match (self.longer(), self.stamps_scatter_s()) {
            (Some(share), _) => (share, 1.0),
            (None, Some(_)) => (0.0, 1.0),
            (None, None) => self.stated.off_s(),
        }
    }

    fn longer(&self) -> Option<f64> {
        self.filter.as_ref().and_then(TimestampFilter::longer)
    }

    /// Puts a valid frame in its place behind the last one, or keeps it aside.
    pub(crate) fn accept(&mut self, frame: Frame, began_ns: i64, events: &mut Vec<Event>) {
        let Some(filter) = &self.filter else {
            match frame.samples() {
                0 => self.counts.frames += 1,
                _ => self.begin(frame, began_ns, events),
            }
            return;
        };
        if self.held.is_empty() && frame.samples() > 0 && filter.fits(&frame) {
            self.take(frame, began_ns, false, events);
        } else if self.is_repeated(&frame) {
            self.counts.duplicated += 1;
        } else if frame.samples() == 0 {
            self.sign_of_life(frame, began_ns);
        } else if !self.settle(&frame, began_ns, events) {
            self.place(frame, began_ns, events);
        }
    }

    /// What comes next has nothing to do with what came before.
    pub(crate) fn begin_anew(&mut self) {
        self.drop_held();
        self.stated.interrupt();
        *self = Resequencer { counts: self.counts, stated: self.stated, ..Resequencer::default() };
    }

    /// Frames with samples that are held.
    fn in_doubt(&self) -> usize {
        self.held.iter().filter(|(frame, _)| frame.samples() > 0).count()
    }

    /// No more will come, and none says what those that are held are: behind others in a known filter they stand by
    /// their sequence, for nothing but their own stamps speaks for a hole; else what can only be behind one is handed
    /// on.
    pub(crate) fn finish(&mut self, events: &mut Vec<Event>) {
        let Some((filter, (first, began_ns))) = self.filter.as_ref().zip(self.held.first()) else { return };
        if filter.is_known() && filter.goes_on_with(first) && !filter.paused_until(first, *began_ns) {
            self.refute_held(events);
        } else if self.is_behind_a_hole() {
            self.believe(events);
        }
    }

    fn is_repeated(&self, frame: &Frame) -> bool {
        let held = |(held, _): &(Frame, i64)| held == frame;
        self.recent.contains(&name(frame)) || self.held.iter().any(held)
    }

    /// What is held is judged by the next frame. True where that is taken care of, too.
    fn settle(&mut self, next: &Frame, began_ns: i64, events: &mut Vec<Event>) -> bool {
        let last = self.held.iter().rfind(|(frame, _)| frame.samples() > 0);
        let (Some(filter), Some((last, _)), Some((before, _))) = (&self.filter, last, self.held.last()) else {
            return false;
        };
        if self.stand_by_sequence(next) {
            self.refute_held(events);
        } else if next.sequence == before.sequence.wrapping_add(1) && goes_on_from(last, next, filter.jitter_us()) {
            self.held.push((next.clone(), began_ns));
            if self.in_doubt() >= AGREEING {
                self.believe(events);
            }
            return true;
        } else if !filter.fits(next)
            && self.is_behind_a_hole()
            && next.first_us >= last.first_us + last.length_us() as u64
        {
            // a device that samples now and then
            self.believe(events);
        } else {
            self.drop_held();
        }
        false
    }

    /// True where a frame stands as if those that are held stood where the sequence puts them: only their stamps were
    /// false.
    fn stand_by_sequence(&self, next: &Frame) -> bool {
        let Some(mut filter) = self.filter.clone() else { return false };
        for (frame, began_ns) in &self.held {
            if !filter.is_next(frame) {
                return false;
            }
            filter.pass(frame, *began_ns);
        }
        filter.fits(next)
    }

    /// True where what is held begins behind the end of the last frame.
    fn is_behind_a_hole(&self) -> bool {
        let first = self.held.first();
        self.filter.as_ref().zip(first).is_some_and(|(filter, (first, _))| filter.is_behind(first))
    }

    /// A frame with nothing held before it.
    fn place(&mut self, frame: Frame, began_ns: i64, events: &mut Vec<Event>) {
        let Some(filter) = &self.filter else { return };
        if filter.fits(&frame) {
            self.take(frame, began_ns, false, events);
        } else if self.before.as_ref().is_some_and(|before| before.fits(&frame)) {
            // The hop was none. Nothing can be handed on until its time has passed.
            self.floor_us = filter.due_us;
            self.filter = self.before.take();
            self.take(frame, began_ns, false, events);
        } else if filter.is_behind(&frame) && filter.paused_until(&frame, began_ns) {
            let mut before = filter.clone();
            if before.is_next(&frame) {
                before.pass(&frame, began_ns);
            }
            self.held.push((frame, began_ns));
            self.believe(events);
            self.before = Some(before);
        } else {
            self.held.push((frame, began_ns));
        }
    }

    /// What is held is true: behind a hole, after a step of the clock, or of a device that has restarted; of that, none
    /// is lost.
    fn believe(&mut self, events: &mut Vec<Event>) {
        let held = std::mem::take(&mut self.held);
        let (Some(filter), Some((first, began_ns))) = (&self.filter, held.first()) else { return };
        let goes_on = filter.goes_on_with(first);
        self.stated.interrupt();
        if !goes_on && !filter.is_behind(first) {
            events.push(Event::Restarted);
            self.begin_anew();
        } else {
            let anew = !goes_on && filter.begins_anew_with(first);
            let lost = if anew { 0 } else { filter.missing(first, *began_ns) };
            self.filter = Some(filter.jump(first, *began_ns));
            self.anew |= anew;
            self.lost(lost);
            let sent = held.iter().filter(|(frame, _)| frame.samples() > 0);
            self.jump = sent.map(|(frame, began_ns)| Sent::of(frame, *began_ns)).max_by_key(Sent::early_ns);
        }
        for (frame, began_ns) in held {
            if self.filter.is_none() {
                self.begin(frame, began_ns, events);
            } else {
                self.take(frame, began_ns, false, events);
            }
        }
    }

    /// What is held stands by the sequence: its stamps were false.
    fn refute_held(&mut self, events: &mut Vec<Event>) {
        for (frame, began_ns) in std::mem::take(&mut self.held) {
            self.take(frame, began_ns, true, events);
        }
    }

    fn drop_held(&mut self) {
        self.counts.bad += self.in_doubt() as u64;
        self.held.clear();
    }

    fn begin(&mut self, frame: Frame, began_ns: i64, events: &mut Vec<Event>) {
        self.filter = Some(TimestampFilter::of(&frame, began_ns));
        self.stated.add(&frame, false);
        let first_us = frame.first_us;
        self.hand_on(frame, first_us, began_ns, events);
    }

    /// A frame without samples: it has a number, but no sample that its time would be of. Among those that are held it
    /// keeps its number.
    fn sign_of_life(&mut self, frame: Frame, began_ns: i64) {
        self.counts.frames += 1;
        if let Some((last, _)) = self.held.last() {
            if frame.sequence == last.sequence.wrapping_add(1) {
                self.held.push((frame, began_ns));
            }
            return;
        }
        if self.filter.as_ref().is_some_and(|filter| filter.is_next(&frame)) {
            self.skip(&frame, began_ns);
        }
    }

    fn skip(&mut self, frame: &Frame, began_ns: i64) {
        let Some(filter) = &mut self.filter else { return };
        let lost = filter.steps_to(frame).saturating_sub(1);
        filter.skip(frame, began_ns);
        self.lost(u32::from(lost));
    }

    /// Takes a frame that stands by its sequence: by its stamp, too, or its stamp is `refuted`.
    fn take(&mut self, frame: Frame, began_ns: i64, refuted: bool, events: &mut Vec<Event>) {
        if frame.samples() == 0 {
            self.skip(&frame, began_ns);
            return;
        }
        let Some(filter) = &mut self.filter else { return };
        let lost = u32::from(filter.steps_to(&frame).saturating_sub(1));
        let first_us = filter.take(&frame, began_ns, refuted);
        self.before = None;
        match refuted {
            true => self.stated.interrupt(),
            false => self.stated.add(&frame, lost == 0),
        }
        self.lost(lost);
        self.counts.restamped += u64::from(refuted);
        self.hand_on(frame, first_us, began_ns, events);
    }

    fn lost(&mut self, frames: u32) {
        self.counts.lost += u64::from(frames);
        self.lost_before = self.lost_before.saturating_add(frames);
    }

    fn hand_on(&mut self, mut frame: Frame, first_us: u64, began_ns: i64, events: &mut Vec<Event>) {
        self.recent.push_back(name(&frame));
        if self.recent.len() > RECENT {
            self.recent.pop_front();
        }
        let jitter_us = self.filter.as_ref().map_or(0.0, TimestampFilter::jitter_us);
        if first_us as f64 + jitter_us < self.floor_us {
            self.counts.bad += 1;
            self.lost(1);
            return;
        }
        self.floor_us = 0.0;
        self.counts.frames += 1;
        frame.first_us = first_us;
        if let Some(longer) = self.longer() {
            frame.period_ns = ((f64::from(frame.period_ns) * (1.0 + longer)).round() as u32).max(1);
        }
        let (lost_before, anew) = (std::mem::take(&mut self.lost_before), std::mem::take(&mut self.anew));
        let (jump, filter) = (self.jump.take(), self.filter.as_ref());
        let hole_from_us = if jump.is_some() || anew { 0.0 } else { filter.map_or(0.0, TimestampFilter::hole_from_us) };
        let hole_from_ns = (hole_from_us * 1e3) as i64;
        events.push(Event::Frame(Taken { frame, lost_before, began_ns, anew, jump, hole_from_ns }));
    }
}

/// What tells a frame from others: its number, its stamp and its samples.
type Name = (u16, u64, u64);

fn name(frame: &Frame) -> Name {
    let mut hasher = DefaultHasher::new();
    frame.counts.hash(&mut hasher);
    (frame.sequence, frame.first_us, hasher.finish())
}

/// True for a frame that goes on where another ends, by its stamp.
fn goes_on_from(last: &Frame, next: &Frame, jitter_us: f64) -> bool {
    let step_us = next.first_us as f64 - last.first_us as f64;
    step_us > 0.0 && (step_us - last.length_us()).abs() <= jitter_us
}
