//! Reads the devices: one thread per port, socket or process (Modbus slaves may share one), all into one bounded queue.
//!
//! A blocking thread hands bytes on in 0.1 ms where an async serial port on a busy runtime needs 8 ms. Where the queue
//! is full (the disk stalls) a thread waits, and how often and how long is counted; then the kernel's buffer may
//! overflow, and sequence numbers and times show what was lost. Memory does not grow.

use std::io::{ErrorKind, Read};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use crate::record::clock::host_clock::HostClock;
use crate::record::devices::backoff::Backoff;
use crate::record::devices::polling;
use crate::record::devices::polling::{Asked, Polling};
use crate::record::devices::port::SerialLine;
use crate::record::devices::queue::{Input, Pressure, QUEUE, Queue, why};
use crate::record::devices::reader::{self, Reader};
use crate::record::error::RecordError;
use crate::rig::{Device, Port, Protocol, Rig};

const READ_BYTES: usize = 16 * 1024;

/// All devices of a session. Dropped, their threads end.
#[derive(Debug)]
pub struct Sources {
    /// The devices, in the order of the numbers that come with the inputs.
    pub devices: Vec<Device>,
    /// What comes from them.
    pub inputs: Receiver<(usize, Input)>,
    /// The clock of arrivals.
    pub host: HostClock,
    pressure: Vec<Arc<Pressure>>,
    wanted: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Sources {
    /// Opens the ports of the devices and starts to listen, or to ask; slaves on one line come one after the other. A
    /// port that vanishes later is tried again where `reopen` says so.
    pub fn open(rig: &Rig, devices: &[Device], reopen: bool) -> Result<Sources, RecordError> {
        let (mut sources, sender) = Sources::empty();
        for (index, device) in devices.iter().enumerate() {
            match (&device.protocol, &device.port) {
                (Protocol::ModbusRtu { .. }, Port::Serial(serial)) => {
                    if devices[..index].iter().any(|other| other.port == device.port) {
                        continue; // asked together with the first on its line
                    }
                    let line = SerialLine::open(&device.name, serial)?;
                    let slaves = devices.iter().filter(|other| other.port == device.port);
                    let asked =
                        |slave| Asked { polling: Polling::of(rig, slave), queue: sources.queue(&sender, slave) };
                    let asked: Vec<Asked> = slaves.map(asked).collect();
                    let (name, serial) = (device.name.clone(), serial.clone());
                    sources.spawn(device, move || {
                        polling::run(line, asked, reopen.then_some((name.as_str(), &serial)));
                    })?;
                }
                (Protocol::ModbusRtu { .. }, _) => {
                    return Err(RecordError::NotSerial { device: device.name.clone(), port: device.port.to_string() });
                }
                (Protocol::Frames | Protocol::Lines { .. }, _) => {
                    let queue = sources.queue(&sender, device);
                    let reader = reader::open(device, &queue)?;
                    let own = device.clone();
                    sources.spawn(device, move || pump(reader, &own, reopen, &queue))?;
                }
            }
        }
        Ok(sources)
    }

    /// One device read from anything whose reads return within a moment: a timeout is no end of the stream.
    pub fn reading(device: &Device, reader: impl Read + Send + 'static) -> Result<Sources, RecordError> {
        let (mut sources, sender) = Sources::empty();
        let queue = sources.queue(&sender, device);
        let own = device.clone();
        sources.spawn(device, move || pump(Box::new(reader), &own, false, &queue))?;
        Ok(sources)
    }

    /// How often and how long the thread of a device had to wait for the session.
    pub fn waited(&self, device: usize) -> (u64, f64) {
        self.pressure.get(device).map_or((0, 0.0), |pressure| pressure.waited())
    }

    /// The next input and the number of its device.
    ///
    /// # Errors
    /// None came in time, or no thread is left.
    pub fn next(&self, within: Duration) -> Result<(usize, Input), RecvTimeoutError> {
        let (device, input) = self.inputs.recv_timeout(within)?;
        if let Some(pressure) = self.pressure.get(device) {
            pressure.taken.fetch_add(1, Ordering::Relaxed);
        }
        Ok((device, input))
    }

    /// How much of the queue waits for the session with what a device has sent, 0 to 1.
    pub fn queued(&self, device: usize) -> f64 {
        let Some(pressure) = self.pressure.get(device) else { return 0.0 };
        let taken = pressure.taken.load(Ordering::Relaxed);
        let waiting = pressure.sent.load(Ordering::Relaxed).saturating_sub(taken);
        (waiting as f64 / QUEUE as f64).min(1.0)
    }

    /// None yet, and the devices' end of the queue.
    fn empty() -> (Sources, SyncSender<(usize, Input)>) {
        let (sender, inputs) = sync_channel(QUEUE);
        let sources = Sources {
            devices: Vec::new(),
            inputs,
            host: HostClock::start(),
            pressure: Vec::new(),
            wanted: Arc::new(AtomicBool::new(true)),
            threads: Vec::new(),
        };
        (sources, sender)
    }

    /// A device's end of the queue.
    fn queue(&mut self, sender: &SyncSender<(usize, Input)>, device: &Device) -> Queue {
        let pressure = Arc::<Pressure>::default();
        self.devices.push(device.clone());
        self.pressure.push(Arc::clone(&pressure));
        Queue {
            device: self.devices.len() - 1,
            sender: sender.clone(),
            pressure,
            wanted: Arc::clone(&self.wanted),
            host: self.host,
        }
    }

    /// The thread of the port that the device is on.
    fn spawn(&mut self, device: &Device, run: impl FnOnce() + Send + 'static) -> Result<(), RecordError> {
        let thread = thread::Builder::new()
            .name(format!("port {}", device.name))
            .spawn(run)
            .map_err(|source| RecordError::Thread { device: device.name.clone(), source })?;
        self.threads.push(thread);
        Ok(())
    }
}

impl Drop for Sources {
    fn drop(&mut self) {
        self.wanted.store(false, Ordering::Relaxed);
        // A thread may wait for room in the queue: closing our end of it wakes it.
        let (_, closed) = sync_channel(0);
        drop(std::mem::replace(&mut self.inputs, closed));
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

/// Reads until the stream ends; then the device is opened again where that is wanted. Not so a command that is done, or
/// that failed before it ever sent anything: that fails again.
fn pump(mut reader: Reader, device: &Device, reopen: bool, queue: &Queue) {
    let is_command = device.port.command().is_some();
    let mut ever_sent = false;
    let mut backoff = Backoff::of(&device.port);
    loop {
        let Some(End { why, sent, done }) = read(&mut *reader, queue) else { return };
        ever_sent |= sent;
        if !reopen || (is_command && (done || !ever_sent)) {
            // The session may have ended meanwhile.
            queue.send(Input::Ended(if is_command && done { "the command has ended".to_owned() } else { why }));
            return;
        }
        drop(reader);
        if sent {
            backoff.reset();
        }
        let Some(again) = queue.reopen(why, &mut backoff, || reader::open(device, queue).ok()) else { return };
        reader = again;
    }
}

/// How a stream ended.
struct End {
    why: String,
    /// Something had come from it.
    sent: bool,
    /// It was no fault.
    done: bool,
}

/// Reads until the stream ends; `None` when nothing is wanted any more.
fn read(reader: &mut dyn Read, queue: &Queue) -> Option<End> {
    let mut buffer = vec![0; READ_BYTES];
    let mut sent = false;
    loop {
        if !queue.wanted() {
            return None;
        }
        match reader.read(&mut buffer) {
            Ok(0) => return Some(End { why: "the stream ended".to_owned(), sent, done: true }),
            Ok(length) => {
                sent = true;
                let bytes = buffer.get(..length).unwrap_or_default().to_vec();
                if !queue.send(Input::Bytes { at_ns: queue.host.now_ns(), bytes }) {
                    return None;
                }
            }
            Err(error) => match error.kind() {
                ErrorKind::TimedOut | ErrorKind::Interrupted | ErrorKind::WouldBlock => {}
                _ => return Some(End { why: why(&error), sent, done: false }),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Instant;

    fn device() -> Device {
        Device { name: "daq".into(), port: Port::Tcp("daq:1".into()), protocol: Protocol::Frames }
    }

    #[test]
    fn bytes_arrive_in_order_and_then_the_end() {
        let bytes: Vec<u8> = (0..100_000u32).map(|i| i as u8).collect();
        let sources = Sources::reading(&device(), std::io::Cursor::new(bytes.clone())).unwrap();
        let mut received = Vec::new();
        let mut last_ns = 0;
        loop {
            match sources.inputs.recv().unwrap() {
                (0, Input::Bytes { bytes, at_ns }) => {
                    assert!(at_ns >= last_ns);
                    last_ns = at_ns;
                    received.extend(bytes);
                }
                (0, Input::Ended(why)) => break assert_eq!(why, "the stream ended"),
                other => panic!("{other:?}"),
            }
        }
        assert_eq!(received, bytes);
        assert_eq!(sources.waited(0), (0, 0.0));
    }

    #[test]
    fn a_source_nobody_reads_ends_when_dropped() {
        let sources = Sources::reading(&device(), std::io::repeat(7)).unwrap();
        drop(sources); // hangs if the thread does not notice
    }

    #[test]
    fn waiting_for_a_slow_session_is_counted() {
        let bytes = vec![7; (QUEUE + 100) * READ_BYTES];
        let sources = Sources::reading(&device(), std::io::Cursor::new(bytes)).unwrap();
        let started = Instant::now();
        while sources.waited(0).0 == 0 {
            assert!(started.elapsed() < Duration::from_secs(20), "nobody waits");
            thread::sleep(Duration::from_millis(5));
        }
        assert_eq!(sources.queued(0), 1.0, "the queue is full");
        let inputs = std::iter::from_fn(|| sources.next(Duration::from_secs(5)).ok());
        let received = inputs.filter(|(_, input)| matches!(input, Input::Bytes { .. })).count();
        assert_eq!(received, QUEUE + 100, "not one is lost by waiting");
        assert_eq!(sources.queued(0), 0.0);
        assert!(sources.waited(0).1 > 0.0);
    }
}
