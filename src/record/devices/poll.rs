//! Asking a Modbus slave, so that no answer is ever taken for another's.
//!
//! An answer does not say which registers it is of. One that comes after its time-out, or twice as from a gateway that
//! asks again, would fit the next request for as many registers, and pressures would stand under a flow's name. So
//! after anything but the answer asked for the line is *out of step*: it is drained to silence, then an echo with a
//! number of its own is asked for, and only when that comes back (or its refusal) are registers read again. A slave
//! answers in order, so nothing older can then be on its way.
//!
//! A second answer can still be on its way when all seems well. Where it would fit the next request, an echo is asked
//! for between the two: one round trip more for requests of equal length next to each other, which
//! [`crate::record::wire::registers::alternate`] makes as few as it can. Of the same registers asked for again a second
//! answer is only older; there an echo once a second keeps it from staying so.
//!
//! A slave that has never answered an echo leaves only silence to go by: ten time-outs of it, and two seconds at least,
//! when out of step, and 20 ms between requests of equal length. A second answer later than that puts one value under a
//! wrong name.

use std::io;
use std::time::{Duration, Instant};

use crate::record::wire::modbus::{Answer, DIAGNOSTICS, Parsed, Request, parse};
use crate::record::wire::registers::Group;

/// A line without bytes for so long is silent: longer than the 16 ms that USB adapters hold bytes back.
const SILENCE: Duration = Duration::from_millis(20);
/// The same registers are read for so long without an echo.
const UNPROVEN: Duration = Duration::from_secs(1);
/// A slave that does not know echoes and was silent for so many time-outs, and for so long, will not answer earlier
/// requests any more.
const FORGOTTEN_TIMEOUTS: u32 = 10;
const FORGOTTEN: Duration = Duration::from_millis(if cfg!(test) { 200 } else { 2000 });
/// Another echo is asked for after so many time-outs: a slave that is slow already is not to be flooded.
const ECHO_TIMEOUTS: u32 = 4;
/// An answer comes so often at most.
const MOST_COPIES: u32 = 2;
/// Longest answer, bytes, and some.
const MOST_BYTES: usize = 512;

/// How long a slave that says nothing to an echo is left alone when out of step.
pub fn forgotten_after(timeout: Duration) -> Duration {
    FORGOTTEN.max(timeout.saturating_mul(FORGOTTEN_TIMEOUTS))
}

/// A line to a slave.
pub trait Line {
    /// Sends bytes; returns when they are on their way.
    ///
    /// # Errors
    /// When the line is gone.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;
    /// Waits for bytes; 0 where none came in time.
    ///
    /// # Errors
    /// When the line is gone.
    fn receive(&mut self, buffer: &mut [u8], within: Duration) -> io::Result<usize>;
    /// Requests that the line itself sent back, and that were taken off.
    fn returned(&self) -> u64 {
        0
    }
}

/// What was seen of a slave.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct PollCounts {
    /// Requests answered.
    pub answers: u64,
    /// Requests not answered in time, or not asked because the line was out of step.
    pub missed: u64,
    /// Answers that were none: noise, wrong check sums.
    pub bad: u64,
    /// Answers that came after their time-out, or twice; dropped.
    pub late: u64,
    /// Requests refused by the slave.
    pub refused: u64,
    /// Polls that fell out because the one before took too long.
    pub skipped: u64,
    /// Requests that the line itself sent back.
    pub returned: u64,
    /// Times that nothing but a long silence brought the line into step, because the slave has not answered an echo
    /// yet.
    pub unproven: u64,
}

/// What became of a request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome {
    /// The registers, and the middle between request and answer.
    Words(Vec<u16>, Instant),
    /// The slave refused, with the exception's code.
    Refused(u8),
    /// Nothing that can be used.
    Missed,
}

/// What came last, and may come again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Before {
    /// The echo that brought the line into step.
    Echo,
    /// The answer to this request.
    Words(Request),
    /// A refusal, which fits any request for its kind of registers.
    Refusal,
}

impl Before {
    /// Whether it could be taken for the answer to `next`.
    fn fits(self, next: Request, unproven: Duration) -> bool {
        match (self, next) {
            (Before::Words(last), next) if last == next => unproven >= UNPROVEN,
            (
                Before::Words(Request::Read { input: last_input, count: last, .. }),
                Request::Read { input, count, .. },
            ) => (last_input, last) == (input, count),
            (Before::Refusal, _) => true,
            _ => false,
        }
    }
}

/// Asks one slave.
pub struct Poller<L> {
    line: L,
    unit: u8,
    timeout: Duration,
    counts: PollCounts,
    in_step: bool,
    /// Numbers of the echoes asked for since the line fell out of step.
    echoes: Vec<u16>,
    /// Echoes and refusals of them that may be on their way, now and when the line fell out of step; a refusal does not
    /// say which it refuses.
    owed_echoes: u32,
    owed_before: u32,
    /// Refusals since then.
    refusals: u32,
    stepped: Instant,
    before: Before,
    next_echo: u16,
    echo_asked: Option<Instant>,
    /// It has returned or refused an echo before.
    knows_echoes: bool,
    /// The line is known to send back what is sent.
    loops: bool,
    last_byte: Instant,
}

impl<L: Line> Poller<L> {
    /// A poller that first brings the line into step: an answer to an earlier request may still be on its way.
    pub fn new(line: L, unit: u8, timeout: Duration) -> Poller<L> {
        let next_echo = fastrand::u16(..);
        Poller {
            line,
            unit,
            timeout,
            counts: PollCounts::default(),
            in_step: false,
            echoes: Vec::new(),
            owed_echoes: 0,
            owed_before: 0,
            refusals: 0,
            stepped: Instant::now(),
            before: Before::Echo,
            next_echo,
            echo_asked: None,
            knows_echoes: false,
            loops: false,
            last_byte: Instant::now(),
        }
    }

    /// What was seen so far.
    pub fn counts(&self) -> PollCounts {
        PollCounts { returned: self.line.returned(), ..self.counts }
    }

    /// Counts polls that fell out.
    pub fn skipped(&mut self, polls: u32) {
        self.counts.skipped += u64::from(polls);
    }

    /// Counts polls that were not asked because the port was gone.
    pub fn missed(&mut self, polls: u32) {
        self.counts.missed += u64::from(polls);
    }

    /// Goes on counting after the line was opened anew.
    pub fn reopened(self, line: L) -> Poller<L> {
        Poller { counts: self.counts, ..Poller::new(line, self.unit, self.timeout) }
    }

    /// Reads the registers of a group; takes about two time-outs at most.
    ///
    /// # Errors
    /// When the line is gone.
    pub fn read(&mut self, group: &Group) -> io::Result<Outcome> {
        let request = Request::Read { input: group.input, start: group.start, count: group.count };
        if !self.is_ready(request)? {
            self.counts.missed += 1;
            return Ok(Outcome::Missed);
        }
        let outcome = match self.ask(&request)? {
            _ if self.loops_after_all() => Outcome::Missed,
            outcome => outcome,
        };
        match &outcome {
            Outcome::Words(..) => {
                self.counts.answers += 1;
                self.before = Before::Words(request);
                // What was asked for earlier has been answered earlier, or was lost on the wire.
                self.owed_echoes = 0;
            }
            Outcome::Refused(_) => {
                self.counts.refused += 1;
                self.before = Before::Refusal;
            }
            Outcome::Missed => {
                self.counts.missed += 1;
                self.fall_out();
            }
        }
        Ok(outcome)
    }

    /// True where no answer can be on its way that would be taken for the one to `next`.
    fn is_ready(&mut self, next: Request) -> io::Result<bool> {
        if self.loops_after_all() {
            self.fall_out();
        }
        if !self.in_step {
            return self.step();
        }
        let strays = self.counts.late;
        let quiet = self.drain(Duration::ZERO)?;
        let strayed = self.counts.late > strays;
        if quiet && !strayed && !self.before.fits(next, self.stepped.elapsed()) {
            return Ok(true);
        }
        self.fall_out();
        if self.knows_echoes {
            let back = self.echo()?;
            if !back {
                // As after any answer that did not come, another is asked for at once.
                self.echo_asked = None;
            }
            return Ok(back);
        }
        let silent = self.drain(SILENCE)? && self.counts.late == strays;
        Ok(silent && self.stepped())
    }

    /// True where the line has just been found to send back what is sent: the echoes so far were its own, and prove
    /// nothing.
    fn loops_after_all(&mut self) -> bool {
        let found = !self.loops && self.line.returned() > 0;
        if found {
            (self.loops, self.knows_echoes) = (true, false);
            self.echoes.clear();
        }
        found
    }

    fn fall_out(&mut self) {
        self.in_step = false;
        (self.owed_before, self.refusals) = (self.owed_echoes, 0);
        self.last_byte = Instant::now();
    }

    fn ask(&mut self, request: &Request) -> io::Result<Outcome> {
        self.line.send(&request.encode(self.unit))?;
        let asked = Instant::now();
        let mut answered = None;
        let mut bytes = Vec::new();
        while let Some(arrived) = self.more(&mut bytes, asked)? {
            let answered = *answered.get_or_insert(arrived);
            loop {
                match parse(self.unit, &bytes) {
                    Parsed::Incomplete => break,
                    Parsed::Bad => {
                        self.counts.bad += 1;
                        return Ok(Outcome::Missed);
                    }
                    Parsed::Whole(answer, length) if self.is_old_echo(&answer) => drop(bytes.drain(..length)),
                    // More behind an answer: which of the two is it?
                    Parsed::Whole(answer, length) if !answer.fits(request) || bytes.len() > length => {
                        self.counts.late += 1;
                        return Ok(Outcome::Missed);
                    }
                    Parsed::Whole(Answer::Registers { words, .. }, _) => {
                        return Ok(Outcome::Words(words, asked + answered.duration_since(asked) / 2));
                    }
                    Parsed::Whole(Answer::Refused { code, .. }, _) => return Ok(Outcome::Refused(code)),
                    Parsed::Whole(Answer::Echo(_), _) => return Ok(Outcome::Missed),
                }
            }
        }
        Ok(Outcome::Missed)
    }

    /// An echo that is still owed comes back, or its refusal: no answer to a read.
    fn is_old_echo(&mut self, answer: &Answer) -> bool {
        let old = matches!(answer, Answer::Echo(_) | Answer::Refused { function: DIAGNOSTICS, .. });
        self.owed_echoes = self.owed_echoes.saturating_sub(u32::from(old));
        if old && !self.knows_echoes {
            self.knows_echoes = true;
            self.counts.unproven = 0;
        }
        old
    }

    /// Tries once to bring the line into step.
    fn step(&mut self) -> io::Result<bool> {
        if !self.drain(SILENCE)? {
            return Ok(false);
        }
        if self.in_step || self.echo()? {
            return Ok(true);
        }
        let forgotten = self.last_byte.elapsed() >= forgotten_after(self.timeout) && !self.knows_echoes;
        self.counts.unproven += u64::from(forgotten);
        Ok(forgotten && self.stepped())
    }

    /// Asks for an echo, where none has been asked for lately, and waits for one.
    fn echo(&mut self) -> io::Result<bool> {
        let asked = Instant::now();
        if self.echo_asked.is_none_or(|before| before.elapsed() >= self.timeout * ECHO_TIMEOUTS) {
            self.echo_asked = Some(asked);
            let number = self.next_echo;
            self.next_echo = number.wrapping_add(1);
            self.echoes.push(number);
            self.owed_echoes += MOST_COPIES;
            self.line.send(&Request::Echo(number).encode(self.unit))?;
        }
        let mut bytes = Vec::new();
        while self.more(&mut bytes, asked)?.is_some() {
            if self.take_old(&mut bytes) {
                return Ok(self.stepped());
            }
        }
        Ok(false)
    }

    fn stepped(&mut self) -> bool {
        self.in_step = true;
        self.stepped = Instant::now();
        self.before = Before::Echo;
        self.echoes.clear();
        self.echo_asked = None;
        true
    }

    /// Takes whatever stands in `bytes`; true where it brings the line into step.
    fn take_old(&mut self, bytes: &mut Vec<u8>) -> bool {
        loop {
            match parse(self.unit, bytes) {
                Parsed::Incomplete => return false,
                Parsed::Bad => drop(bytes.drain(..1)),
                Parsed::Whole(answer, length) => {
                    bytes.drain(..length);
                    let old_echo = self.is_old_echo(&answer);
                    match answer {
                        Answer::Echo(number) if self.echoes.contains(&number) => return true,
                        Answer::Refused { function: DIAGNOSTICS, .. } => {
                            self.refusals += 1;
                            if self.refusals > self.owed_before {
                                return true;
                            }
                            // Perhaps of an earlier echo; the slave is there, so it can be asked at once.
                            self.echo_asked = None;
                        }
                        _ => self.counts.late += u64::from(!old_echo),
                    }
                }
            }
        }
    }

    /// Waits for more bytes of an answer; `None` when its time is over.
    fn more(&mut self, bytes: &mut Vec<u8>, asked: Instant) -> io::Result<Option<Instant>> {
        let left = self.timeout.saturating_sub(asked.elapsed());
        if left.is_zero() {
            return Ok(None);
        }
        let mut buffer = [0; MOST_BYTES];
        let length = self.line.receive(&mut buffer, left)?;
        if length == 0 {
            return Ok(None);
        }
        bytes.extend(buffer.iter().take(length));
        self.last_byte = Instant::now();
        Ok(Some(self.last_byte))
    }

    /// Takes what is on the line until nothing comes for so long; false where it goes on and on.
    fn drain(&mut self, quiet: Duration) -> io::Result<bool> {
        let started = Instant::now();
        let (mut bytes, mut buffer) = (Vec::new(), [0; MOST_BYTES]);
        loop {
            match self.line.receive(&mut buffer, quiet)? {
                0 => break,
                length => bytes.extend(buffer.iter().take(length)),
            }
            self.last_byte = Instant::now();
            if started.elapsed() > self.timeout + SILENCE {
                self.counts.bad += 1;
                return Ok(false);
            }
        }
        // What comes between requests is late; an echo among it brings no line into step that is in step.
        let in_step = self.take_old(&mut bytes);
        if in_step && !self.in_step {
            self.stepped();
        }
        Ok(true)
    }
}

#[cfg(test)]
mod tests;
