//! The thread of a line of Modbus devices: polls each at an even pace and passes the answers on.

use std::io;
use std::thread;
use std::time::{Duration, Instant};

use crate::record::devices::backoff::Backoff;
use crate::record::devices::bus::{Tap, taps};
use crate::record::devices::loopback::Loopback;
use crate::record::devices::poll::{Outcome, PollCounts, Poller};
use crate::record::devices::port::SerialLine;
use crate::record::devices::queue::{Input, Polled, Queue, why};
use crate::record::wire::registers::{Group, Place, alternate, group, value};
use crate::rig::{Device, Port, Protocol, Rig, Serial};

/// How long the thread sleeps before it looks whether it is still wanted.
const NAP: Duration = Duration::from_millis(50);

/// A slave that has missed so many polls in a row takes no more of a line that it shares than a poll in so many
/// time-outs.
const SILENT: u32 = 5;
const SILENT_TIMEOUTS: u32 = 10;

/// What a device is asked for, and how often.
#[derive(Debug, Clone, PartialEq)]
pub struct Polling {
    unit: u8,
    interval: Duration,
    timeout: Duration,
    places: Vec<Place>,
    groups: Vec<Group>,
}

impl Polling {
    /// What the sensors wired to the device need.
    pub fn of(rig: &Rig, device: &Device) -> Polling {
        let wiring = rig.sensors.iter().filter_map(|sensor| sensor.wiring.as_ref());
        let places: Vec<Place> = wiring
            .filter(|wiring| wiring.device == device.name)
            .filter_map(|wiring| Some(Place { address: wiring.channel, register: wiring.register? }))
            .collect();
        let (unit, interval_s, timeout_s) = match device.protocol {
            Protocol::ModbusRtu { unit_id, poll_interval_s, timeout_s } => (unit_id, poll_interval_s, timeout_s),
            Protocol::Frames | Protocol::Lines { .. } => (1, 0.1, 0.2),
        };
        let seconds =
            |s: f64| Duration::try_from_secs_f64(s).unwrap_or(Duration::MAX / 4).max(Duration::from_micros(100));
        Polling {
            unit,
            interval: seconds(interval_s),
            timeout: seconds(timeout_s),
            groups: alternate(group(&places)),
            places,
        }
    }
}

/// One of the slaves on a line: what it is asked for, and where its answers go.
pub struct Asked {
    /// What it is asked for.
    pub polling: Polling,
    /// Where its answers go.
    pub queue: Queue,
}

/// Asks the slaves of a line in turn until nothing is wanted any more, or the port is gone for good.
pub fn run(line: SerialLine, asked: Vec<Asked>, again: Option<(&str, &Serial)>) {
    let units: Vec<u8> = asked.iter().map(|asked| asked.polling.unit).collect();
    let turn = |(asked, line): (Asked, Tap<Loopback<SerialLine>>)| {
        let poller = Poller::new(line, asked.polling.unit, asked.polling.timeout);
        Turn { asked, poller, due: Instant::now(), missed: 0 }
    };
    let mut turns: Vec<Turn> = asked.into_iter().zip(taps(Loopback::new(line), &units)).map(turn).collect();
    loop {
        let reason = match poll(&mut turns) {
            Ok(()) => return,
            Err(error) => why(&error),
        };
        let Some((first, others)) = turns.split_first() else { return };
        let tell = |input: fn(String) -> Input| {
            for other in others {
                other.asked.queue.send(input(reason.clone()));
            }
        };
        let Some((device, serial)) = again else {
            tell(Input::Ended);
            first.asked.queue.send(Input::Ended(reason));
            return;
        };
        tell(Input::Vanished);
        let backoff = &mut Backoff::of(&Port::Serial(serial.clone()));
        let reopened = first.asked.queue.reopen(reason.clone(), backoff, || SerialLine::open(device, serial).ok());
        let Some(line) = reopened else { return };
        tell(|_| Input::Back);
        turns =
            turns.into_iter().zip(taps(Loopback::new(line), &units)).map(|(turn, line)| turn.reopened(line)).collect();
    }
}

/// A slave, and when it is its turn.
struct Turn {
    asked: Asked,
    poller: Poller<Tap<Loopback<SerialLine>>>,
    due: Instant,
    /// Polls since it last answered.
    missed: u32,
}

/// Asks the slave that is due, until nothing is wanted any more; an error when the port is gone.
fn poll(turns: &mut [Turn]) -> io::Result<()> {
    let shared = turns.len() > 1;
    while let Some(turn) = turns.iter_mut().min_by_key(|turn| turn.due) {
        while let Some(left) = turn.due.checked_duration_since(Instant::now()).filter(|left| !left.is_zero()) {
            if !turn.asked.queue.wanted() {
                return Ok(());
            }
            thread::sleep(left.min(NAP));
        }
        if !turn.ask()? {
            return Ok(());
        }
        turn.again(shared);
    }
    Ok(())
}

impl Turn {
    /// Asks for all groups; false when nothing is wanted any more.
    fn ask(&mut self) -> io::Result<bool> {
        let Asked { polling, queue } = &self.asked;
        for group in &polling.groups {
            let outcome = self.poller.read(group)?;
            self.missed = if outcome == Outcome::Missed { self.missed.saturating_add(1) } else { 0 };
            let polled = polled(&outcome, group, polling, self.poller.counts(), queue);
            if !queue.wanted() || !queue.send(Input::Polled(polled)) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// The port is back: what was due meanwhile was missed.
    fn reopened(mut self, line: Tap<Loopback<SerialLine>>) -> Turn {
        let missed = self.behind(self.asked.polling.interval);
        let mut poller = self.poller.reopened(line);
        poller.missed(missed);
        Turn { poller, due: Instant::now(), ..self }
    }

    /// Polls that fell out since it was due, which cost no rhythm.
    fn behind(&mut self, interval: Duration) -> u32 {
        let behind = Instant::now().saturating_duration_since(self.due).as_nanos() / interval.as_nanos().max(1);
        let behind = u32::try_from(behind).unwrap_or(u32::MAX);
        self.due += interval.saturating_mul(behind);
        behind
    }

    /// Says when it is asked again.
    fn again(&mut self, shared: bool) {
        let Polling { interval, timeout, .. } = self.asked.polling;
        // Who does not answer keeps the line from the others.
        let interval = if shared && self.missed >= SILENT { interval.max(SILENT_TIMEOUTS * timeout) } else { interval };
        self.due += interval;
        // A poll that took too long costs those that fell into it.
        let behind = self.behind(interval);
        self.poller.skipped(behind);
    }
}

fn polled(outcome: &Outcome, group: &Group, polling: &Polling, counts: PollCounts, queue: &Queue) -> Polled {
    let (words, at) = match outcome {
        Outcome::Words(words, at) => (words.as_slice(), *at),
        _ => (&[][..], Instant::now()),
    };
    let number = |index: usize| polling.places.get(index).and_then(|place| value(place, group.start, words));
    Polled {
        at_ns: queue.host.at_ns(at),
        values: group.members.iter().map(|&index| (index, number(index))).collect(),
        refused: if let Outcome::Refused(code) = outcome { Some(*code) } else { None },
        counts,
    }
}
