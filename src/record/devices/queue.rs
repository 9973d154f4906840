//! The queue from the threads of the ports to the session: bounded, so that memory does not grow.

use std::io::ErrorKind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{SyncSender, TrySendError};
use std::thread;
use std::time::{Duration, Instant};

use crate::record::clock::host_clock::HostClock;
use crate::record::devices::backoff::Backoff;
use crate::record::devices::poll::PollCounts;

/// Messages that may wait for the session: seconds of several fast devices, at most 64 MiB.
pub(crate) const QUEUE: usize = 4096;
/// How long a thread that waits sleeps before it looks whether it is still wanted.
const NAP: Duration = Duration::from_millis(50);

/// What a device's thread passes on.
#[derive(Debug)]
pub enum Input {
    /// The next bytes, and when they arrived on the host's clock.
    Bytes {
        /// Time of their arrival, ns.
        at_ns: i64,
        /// The bytes.
        bytes: Vec<u8>,
    },
    /// What became of a poll.
    Polled(Polled),
    /// A message of the device for people, and when it came on the host's clock.
    Said {
        /// Time of its arrival, ns.
        at_ns: i64,
        /// A line of text.
        text: String,
    },
    /// The port is gone, and why; it is tried again.
    Vanished(String),
    /// It is back.
    Back,
    /// No more will come, and why.
    Ended(String),
}

/// How often and how long a port's thread had to wait for the session, and how much of it waits in the queue.
#[derive(Debug, Default)]
pub struct Pressure {
    waits: AtomicU64,
    waited_us: AtomicU64,
    pub(super) sent: AtomicU64,
    pub(super) taken: AtomicU64,
}

impl Pressure {
    /// Number of waits, and their sum in seconds.
    pub fn waited(&self) -> (u64, f64) {
        (self.waits.load(Ordering::Relaxed), self.waited_us.load(Ordering::Relaxed) as f64 / 1e6)
    }
}

/// A thread's end of the queue.
#[derive(Clone)]
pub struct Queue {
    pub(super) device: usize,
    pub(super) sender: SyncSender<(usize, Input)>,
    pub(super) pressure: Arc<Pressure>,
    pub(super) wanted: Arc<AtomicBool>,
    /// The clock of arrivals.
    pub host: HostClock,
}

impl Queue {
    /// False when nothing is wanted any more.
    pub fn wanted(&self) -> bool {
        self.wanted.load(Ordering::Relaxed)
    }

    /// Passes something on, waiting for room; false when the session has ended.
    pub fn send(&self, input: Input) -> bool {
        self.pressure.sent.fetch_add(1, Ordering::Relaxed);
        match self.sender.try_send((self.device, input)) {
            Ok(()) => true,
            Err(TrySendError::Disconnected(_)) => false,
            Err(TrySendError::Full(message)) => {
                self.pressure.waits.fetch_add(1, Ordering::Relaxed);
                let since = Instant::now();
                let taken = self.sender.send(message).is_ok();
                self.pressure.waited_us.fetch_add(since.elapsed().as_micros() as u64, Ordering::Relaxed);
                taken
            }
        }
    }

    /// Reports the lost port and tries to open it again until it is back; `None` when nothing is wanted any more.
    pub fn reopen<T>(&self, why: String, backoff: &mut Backoff, mut open: impl FnMut() -> Option<T>) -> Option<T> {
        if !self.send(Input::Vanished(why)) {
            return None;
        }
        loop {
            let until = Instant::now() + backoff.wait();
            while let Some(left) = until.checked_duration_since(Instant::now()).filter(|left| !left.is_zero()) {
                if !self.wanted() {
                    return None;
                }
                thread::sleep(left.min(NAP));
            }
            if let Some(port) = open() {
                return self.send(Input::Back).then_some(port);
            }
        }
    }
}

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

/// Why a port can no longer be used.
pub fn why(error: &std::io::Error) -> String {
    match error.kind() {
        ErrorKind::BrokenPipe | ErrorKind::UnexpectedEof => "the device hung up".to_owned(),
        // said by a socket or a process, in a whole sentence
        ErrorKind::Other if error.get_ref().is_some() => error.to_string(),
        _ => format!("the port vanished: {error}"),
    }
}
