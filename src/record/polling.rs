//! The thread of a Modbus device: asks for its registers at an even pace and passes on what they say.

use std::io;
use std::thread;
use std::time::{Duration, Instant};

use serialport::SerialPort;

use super::poll::{Outcome, PollCounts, Poller};
use super::port::{SerialLine, open_port};
use super::registers::{Group, Place, group, value};
use super::source::{Input, Queue, why};
use crate::rig::{Device, Protocol, Rig};

/// How long the thread sleeps before it looks whether it is still wanted.
const NAP: Duration = Duration::from_millis(50);

/// What became of a request for a group of registers.
#[derive(Debug, Clone, PartialEq)]
pub struct Polled {
    /// The middle between request and answer on the host's clock, ns.
    pub at_ns: i64,
    /// Sensors by their place among those wired to the device, each with the number in its registers; without one where
    /// there was no answer, or no finite number in it.
    pub values: Vec<(usize, Option<f64>)>,
    /// Modbus exception code, where the device refused.
    pub refused: Option<u8>,
    /// What was seen of the device so far.
    pub counts: PollCounts,
}

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
            Protocol::Frames | Protocol::Lines => (1, 0.1, 0.2),
        };
        let seconds =
            |s: f64| Duration::try_from_secs_f64(s).unwrap_or(Duration::MAX / 4).max(Duration::from_micros(100));
        Polling { unit, interval: seconds(interval_s), timeout: seconds(timeout_s), groups: group(&places), places }
    }
}

/// Asks until nothing is wanted any more, or the port is gone for good.
pub fn run(port: Box<dyn SerialPort>, polling: &Polling, again: Option<&Device>, queue: &Queue) {
    let mut poller = Poller::new(SerialLine(port), polling.unit, polling.timeout);
    loop {
        let reason = match poll(&mut poller, polling, queue) {
            Ok(()) => return,
            Err(error) => why(&error),
        };
        let Some(device) = again else {
            queue.send(Input::Ended(reason));
            return;
        };
        let Some(port) = queue.reopen(reason, || open_port(device).ok()) else { return };
        poller = poller.reopened(SerialLine(port));
    }
}

/// Asks until nothing is wanted any more; an error when the port is gone.
fn poll(poller: &mut Poller<SerialLine>, polling: &Polling, queue: &Queue) -> io::Result<()> {
    let mut due = Instant::now();
    loop {
        while let Some(left) = due.checked_duration_since(Instant::now()).filter(|left| !left.is_zero()) {
            if !queue.wanted() {
                return Ok(());
            }
            thread::sleep(left.min(NAP));
        }
        for group in &polling.groups {
            let outcome = poller.read(group)?;
            let polled = polled(&outcome, group, polling, poller.counts(), queue);
            if !queue.wanted() || !queue.send(Input::Polled(polled)) {
                return Ok(());
            }
        }
        due += polling.interval;
        // A poll that took too long costs those that fell into it, not the rhythm.
        let behind = Instant::now().saturating_duration_since(due).as_nanos() / polling.interval.as_nanos().max(1);
        let behind = u32::try_from(behind).unwrap_or(u32::MAX);
        due += polling.interval.saturating_mul(behind);
        poller.skipped(u64::from(behind));
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
