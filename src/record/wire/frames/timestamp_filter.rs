//! Predicts the stamp of a device's next frame from those before it, and how far off stamps usually are.
//!
//! Stamps that are nearer to their place than half a sample hold as they are. Where they scatter by more, as those that
//! a device's program takes or a clock that ticks, the samples of an unbroken sequence are known better from each other
//! than from their stamps: then a delay-locked loop follows them (Adriaensen 2005, "Using a DLL to filter time", Linux
//! Audio Conference).

use std::collections::VecDeque;

use crate::record::wire::frames::frame::Frame;
use crate::robust::{median, quantile, sd_about};

/// Stamps seen before their scatter is judged, and stamps remembered.
const LEARNT: usize = 8;
const REMEMBERED: usize = 32;
/// A stamp further off than this many times what nine in ten of the others stay within is no scatter; one off by half a
/// sample is.
const FAR: f64 = 3.0;
const NINE_IN_TEN: f64 = 0.9;
/// Before anything is known of them, by this many frames.
const FAR_AT_FIRST: f64 = 2.0;
/// Samples stand by the period that their device states, unless it is wrong by this share.
const WRONG_PERIOD: f64 = 0.03;
/// Where stamps scatter: what a stamp moves the place of its frame by, and the length of the frames; critically damped.
const GAIN: (f64, f64) = (1.0 / 8.0, 1.0 / 256.0);
/// Where they do not: what a stamp moves the length of the frames by.
const EXACT_GAIN: f64 = 1.0 / 64.0;
/// Share of the longest pause that is left after each frame: one stall says nothing of the pauses to come.
const FORGET_PAUSE: f64 = 0.98;
/// A sequence goes on within so many frames.
const GOES_ON: u16 = 64;

/// See the module. Times in µs of the device, as placed.
#[derive(Debug, Clone)]
pub(crate) struct TimestampFilter {
    /// Sequence number of the last frame.
    sequence: u16,
    /// When it began to arrive, ns.
    began_ns: i64,
    /// When the next one should begin.
    pub(crate) due_us: f64,
    /// What the last frame with samples says to be its length.
    length_us: f64,
    period_us: f64,
    /// How far a stamp may be off, before anything is learnt of it.
    jitter_us: f64,
    /// How much longer frames are than they say.
    longer_us: f64,
    /// How far the last stamps were off, the standard deviation of one, and what nine in ten of them stay within.
    off_us: VecDeque<f64>,
    scatter_us: f64,
    within_us: f64,
    smooth: bool,
    /// The longest pause of the arrivals of late, ns.
    pause_ns: f64,
}

impl TimestampFilter {
    pub(crate) fn of(first: &Frame, began_ns: i64) -> TimestampFilter {
        let mut filter = TimestampFilter {
            sequence: first.sequence.wrapping_sub(1),
            began_ns,
            due_us: first.first_us as f64,
            length_us: 0.0,
            period_us: 0.0,
            jitter_us: 0.0,
            longer_us: 0.0,
            off_us: VecDeque::new(),
            scatter_us: 0.0,
            within_us: 0.0,
            smooth: false,
            pause_ns: 0.0,
        };
        filter.stand(first, began_ns, filter.due_us);
        filter
    }

    /// Frames from the last one on; 0 for its own number again, more than half of the sequence for one from before.
    pub(crate) fn steps_to(&self, frame: &Frame) -> u16 {
        frame.sequence.wrapping_sub(self.sequence)
    }

    /// True for a frame that comes behind the last one by its sequence.
    pub(crate) fn is_next(&self, frame: &Frame) -> bool {
        (1..1 << 15).contains(&self.steps_to(frame))
    }

    /// True for a frame with which the sequence goes on but for a few, whatever its stamp says.
    pub(crate) fn goes_on_with(&self, frame: &Frame) -> bool {
        (1..=GOES_ON).contains(&self.steps_to(frame))
    }

    /// How far a stamp is off from where the sequence puts it.
    pub(crate) fn off_us(&self, frame: &Frame) -> f64 {
        frame.first_us as f64 - self.place_us(frame)
    }

    /// Where a frame stands by its sequence.
    fn place_us(&self, frame: &Frame) -> f64 {
        let missing = f64::from(self.steps_to(frame)) - 1.0;
        self.due_us + missing * (self.length_us + self.longer_us)
    }

    /// How far a stamp may be off, where nothing is missing before it.
    pub(crate) fn jitter_us(&self) -> f64 {
        if !self.is_known() {
            return self.jitter_us.max(FAR_AT_FIRST * self.length_us);
        }
        (FAR * self.within_us).max(self.period_us / 2.0)
    }

    /// True where enough was learnt of its stamps.
    pub(crate) fn is_known(&self) -> bool {
        self.off_us.len() >= LEARNT
    }

    /// From which jump of its time on samples are missing before a frame that fits and has its number in the sequence;
    /// infinite where their times say nothing.
    pub(crate) fn hole_from_us(&self) -> f64 {
        let known = self.is_known() && !self.smooth;
        if known { (FAR * self.within_us).max(self.period_us / 2.0) } else { f64::INFINITY }
    }

    /// How much longer its frames are by the stamps than they say, as a share, where that is too much for them to stand
    /// so.
    pub(crate) fn longer(&self) -> Option<f64> {
        let share = self.longer_us / self.length_us;
        (self.is_known() && share.abs() > WRONG_PERIOD).then_some(share)
    }

    /// Standard deviation of a stamp, where they are not taken as they are.
    pub(crate) fn smoothed_scatter_us(&self) -> Option<f64> {
        self.smooth.then_some(self.scatter_us)
    }

    /// True for a frame that comes behind the last one, by its sequence and, as well as they are known, by its stamp.
    pub(crate) fn fits(&self, frame: &Frame) -> bool {
        self.is_next(frame) && self.off_us(frame).abs() <= self.jitter_us()
    }

    /// True for a frame that does not begin before the last one's end.
    pub(crate) fn is_behind(&self, frame: &Frame) -> bool {
        frame.first_us as f64 >= self.due_us - self.jitter_us()
    }

    /// True where the arrivals paused as never before, and for as long as a frame is late by its stamp: a device that
    /// had nothing to send. A line that only stalled does not pause for as long as a false stamp happens to say.
    pub(crate) fn paused_until(&self, frame: &Frame, began_ns: i64) -> bool {
        let elapsed_ns = began_ns.saturating_sub(self.began_ns) as f64;
        let step_us = frame.first_us as f64 - self.due_us + self.length_us;
        let jitter_us = self.jitter_us();
        let as_long =
            step_us >= (elapsed_ns - 2.0 * self.pause_ns) / 1e3 - jitter_us && step_us <= elapsed_ns / 1e3 + jitter_us;
        elapsed_ns > 2.0 * self.pause_ns + 1e3 * jitter_us && as_long
    }

    /// Frames missing before one, by the sequence; where it wrapped unseen in a long hole, the device's time tells how
    /// often, unless the sequence goes on but for a few and the arrivals know of no such hole: then its clock was set.
    pub(crate) fn missing(&self, frame: &Frame, began_ns: i64) -> u32 {
        let by_sequence = u64::from(self.steps_to(frame).saturating_sub(1));
        let mut hole_us = self.hole_us(frame);
        if by_sequence < u64::from(GOES_ON) {
            let elapsed_us = began_ns.saturating_sub(self.began_ns) as f64 / 1e3;
            hole_us = hole_us.min(elapsed_us + by_sequence as f64 * self.length_us);
        }
        let by_time = if self.length_us > 0.0 { (hole_us / self.length_us) as u64 } else { 0 };
        let wraps = (by_time.saturating_sub(by_sequence) + (1 << 15)) >> 16;
        u32::try_from(by_sequence + (wraps << 16)).unwrap_or(u32::MAX)
    }

    /// True where the sequence went back, and more frames would be missing by it than fit into the hole.
    pub(crate) fn begins_anew_with(&self, frame: &Frame) -> bool {
        let missing_us = (f64::from(self.steps_to(frame)) - 1.0) * self.length_us;
        frame.sequence < self.sequence && missing_us > self.hole_us(frame)
    }

    fn hole_us(&self, frame: &Frame) -> f64 {
        (frame.first_us as f64 - self.due_us).max(0.0)
    }

    /// Takes a frame that fits, or whose stamp those behind it refuted, and says when it begins.
    pub(crate) fn take(&mut self, frame: &Frame, began_ns: i64, refuted: bool) -> u64 {
        let (place_us, off_us) = (self.place_us(frame), self.off_us(frame));
        let learnt = self.is_known();
        if self.steps_to(frame) == 1 {
            self.learn(off_us);
            let pause_ns = began_ns.saturating_sub(self.began_ns) as f64;
            self.pause_ns = pause_ns.max(FORGET_PAUSE * self.pause_ns);
        }
        let (gain, length_gain) = match (refuted, self.smooth) {
            (true, _) => (0.0, 0.0),
            (false, true) => GAIN,
            (false, false) => (1.0, EXACT_GAIN),
        };
        if learnt && self.steps_to(frame) == 1 {
            self.longer_us += length_gain * off_us;
        }
        // the stamp itself, without a rounding
        let first_us = if gain == 1.0 { frame.first_us as f64 } else { (place_us + gain * off_us).max(0.0) };
        self.stand(frame, began_ns, first_us);
        first_us.round() as u64
    }

    /// Goes on as if a frame stood where the sequence puts it; nothing is learnt of its stamp.
    pub(crate) fn pass(&mut self, frame: &Frame, began_ns: i64) {
        if frame.samples() > 0 {
            self.stand(frame, began_ns, self.place_us(frame));
        } else {
            self.skip(frame, began_ns);
        }
    }

    /// Goes on from a frame with which those behind it agree, and those before do not.
    pub(crate) fn jump(&self, first: &Frame, began_ns: i64) -> TimestampFilter {
        let sequence = first.sequence.wrapping_sub(1);
        TimestampFilter { sequence, began_ns, due_us: first.first_us as f64, ..self.clone() }
    }

    /// A frame without samples has a number, and no time.
    pub(crate) fn skip(&mut self, frame: &Frame, began_ns: i64) {
        let missing = f64::from(self.steps_to(frame).saturating_sub(1));
        self.due_us += missing * (self.length_us + self.longer_us);
        (self.sequence, self.began_ns) = (frame.sequence, began_ns);
    }

    fn stand(&mut self, frame: &Frame, began_ns: i64, first_us: f64) {
        let length_us = frame.length_us();
        (self.sequence, self.began_ns) = (frame.sequence, began_ns);
        self.length_us = length_us;
        self.period_us = f64::from(frame.period_ns) / 1e3;
        self.jitter_us = frame.most_jitter_us();
        self.due_us = first_us + length_us + self.longer_us;
    }

    fn learn(&mut self, off_us: f64) {
        self.off_us.push_back(off_us);
        if self.off_us.len() > REMEMBERED {
            self.off_us.pop_front();
        }
        if self.off_us.len() == LEARNT && self.longer_us == 0.0 {
            self.first_lesson();
        }
        if self.off_us.len() >= LEARNT {
            // stamp against stamp, both scatter; against the loop, nearly only one
            let pair = if self.smooth { 1.0 } else { std::f64::consts::SQRT_2 };
            let off_us = self.off_us.make_contiguous();
            self.scatter_us = sd_about(0.0, off_us) / pair;
            self.within_us = quantile(&mut off_us.iter().map(|off| off.abs()).collect::<Vec<_>>(), NINE_IN_TEN);
            let half = if self.smooth { self.period_us / 4.0 } else { self.period_us / 2.0 };
            self.smooth = self.scatter_us > half;
        }
    }

    /// What the first stamps were all off by is the length of the frames: by their mean where they scatter, for in
    /// their sum all but the first and the last cancel; by their median where one of them may be a hole. One far from
    /// the others is none of them.
    fn first_lesson(&mut self) {
        let off_us = self.off_us.make_contiguous();
        let middle = median(&mut off_us.to_vec());
        let scatter = sd_about(middle, off_us);
        let near: Vec<f64> = off_us.iter().copied().filter(|off| (off - middle).abs() <= FAR * scatter).collect();
        let mean = near.iter().sum::<f64>() / near.len().max(1) as f64;
        self.longer_us = if scatter > self.period_us { mean } else { middle };
        self.off_us.iter_mut().for_each(|off| *off -= self.longer_us);
    }
}
