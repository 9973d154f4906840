//! A device that is not there: plays given data as real `frames` through a real pseudo-terminal, with faults where asked for.

use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::os::fd::AsFd;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use nix::fcntl::OFlag;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::pty::{PtyMaster, grantpt, posix_openpt, ptsname_r, unlockpt};
use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};

use super::RecordError;
use super::frames::Frame;
use super::pace::Pace;
use crate::rig::{Device, Rig};

/// Frames that a device sends per second.
const FRAMES_PER_S: u64 = 100;
/// A device has been on for a while when one starts to listen: its time is not 0, and its sequence soon wraps.
const FIRST_US: u64 = 3_600_000_000;
const FIRST_SEQUENCE: u16 = 65_500;

/// What a simulated device plays.
#[derive(Debug, Clone, PartialEq)]
pub struct Playback {
    /// Time between samples, ns.
    pub sample_period_ns: u32,
    /// Samples of each channel of the device, in the unit of the sensor wired to it; all of the same length.
    pub channels: Vec<Vec<f64>>,
}

/// How a simulated device misbehaves: probabilities per frame. The first and the last frame go through unharmed, so that
/// the sequence tells of every fault.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Faults {
    /// One bit of the frame flips on the wire.
    pub flip: f64,
    /// The frame is not sent.
    pub drop: f64,
    /// The frame is sent twice.
    pub duplicate: f64,
    /// Seed of the dice.
    pub seed: u64,
}

impl FromStr for Faults {
    type Err = String;

    /// Reads `flip=0.01,drop=0.02,duplicate=0.01,seed=7`, any of them.
    fn from_str(text: &str) -> Result<Faults, String> {
        let mut faults = Faults::default();
        for part in text.split(',') {
            let (name, value) = part.split_once('=').unwrap_or((part, ""));
            let slot = match name {
                "flip" => &mut faults.flip,
                "drop" => &mut faults.drop,
                "duplicate" => &mut faults.duplicate,
                "seed" => {
                    faults.seed = value.parse().map_err(|_| format!("the seed '{value}' is no whole number"))?;
                    continue;
                }
                _ => return Err(format!("unknown fault '{name}'; known are flip, drop, duplicate and seed")),
            };
            *slot = value
                .parse()
                .ok()
                .filter(|p| (0.0..=1.0).contains(p))
                .ok_or_else(|| format!("'{part}' needs a probability per frame from 0 to 1, as in {name}=0.01"))?;
        }
        Ok(faults)
    }
}

/// What a simulated device did.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Sent {
    /// Frames made, whatever became of them.
    pub frames: u64,
    /// Frames with a flipped bit.
    pub flipped: u64,
    /// Pieces between zeros that the flipped ones became: a flip can make a zero, which splits a frame.
    pub bad_pieces: u64,
    /// Frames not sent.
    pub dropped: u64,
    /// Frames sent twice.
    pub duplicated: u64,
}

/// A device on a pseudo-terminal. Dropped, it stops and hangs up.
#[derive(Debug)]
pub struct SimulatedDevice {
    path: PathBuf,
    wanted: Arc<AtomicBool>,
    line: Option<(PtyMaster, File)>,
    thread: Option<JoinHandle<io::Result<Sent>>>,
}

impl SimulatedDevice {
    /// Makes the pseudo-terminal; nothing is sent before [`SimulatedDevice::start`].
    pub fn open() -> Result<SimulatedDevice, RecordError> {
        let (master, slave, path) = raw_pty().map_err(RecordError::Pseudoterminal)?;
        Ok(SimulatedDevice { path, wanted: Arc::new(AtomicBool::new(true)), line: Some((master, slave)), thread: None })
    }

    /// The port to record from.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Starts to send, `speed` times as fast as real time (0: as fast as the line takes it), then hangs up.
    pub fn start(&mut self, counts: Counts, speed: f64, faults: Faults) -> Result<(), RecordError> {
        let Some(line) = self.line.take() else { return Ok(()) };
        let wanted = Arc::clone(&self.wanted);
        let thread = thread::Builder::new()
            .name("simulated device".into())
            .spawn(move || Sender { line, wanted, speed, faults }.run(&counts))
            .map_err(RecordError::Pseudoterminal)?;
        self.thread = Some(thread);
        Ok(())
    }

    /// Stops the device, if it still sends, and says what it did.
    pub fn stop(mut self) -> io::Result<Sent> {
        self.wanted.store(false, Ordering::Relaxed);
        self.join()
    }

    /// Waits until everything was sent and read, and says what the device did.
    pub fn join(&mut self) -> io::Result<Sent> {
        let Some(thread) = self.thread.take() else { return Ok(Sent::default()) };
        thread.join().unwrap_or_else(|_| Err(io::Error::other("the simulated device broke down")))
    }
}

impl Drop for SimulatedDevice {
    fn drop(&mut self) {
        self.wanted.store(false, Ordering::Relaxed);
        let _ = self.join();
    }
}

/// A playback as the device's converter sees it: counts, interleaved by channel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Counts {
    period_ns: u32,
    channels: u8,
    interleaved: Vec<i16>,
    /// Samples outside the converter's range, which it holds at its limits.
    pub clipped: u64,
}

impl Counts {
    /// Quantises by the inverse of each channel's scale and offset; a channel without a sensor has scale 1.
    pub fn new(playback: &Playback, rig: &Rig, device: &Device) -> Result<Counts, RecordError> {
        let refuse = |reason: &str| Err(RecordError::Playback(reason.to_owned()));
        let length = playback.channels.first().map_or(0, Vec::len);
        let Ok(channels) = u8::try_from(playback.channels.len()) else {
            return refuse("it has more than 255 channels");
        };
        if length == 0 || playback.sample_period_ns == 0 {
            return refuse("it has no samples, or no time between them");
        }
        if playback.channels.iter().any(|channel| channel.len() != length) {
            return refuse("its channels differ in length");
        }
        let mut interleaved = vec![0; length * usize::from(channels)];
        let mut clipped = 0;
        for (column, values) in playback.channels.iter().enumerate() {
            let (scale, offset) = rig
                .sensors
                .iter()
                .filter_map(|sensor| sensor.wiring.as_ref())
                .find(|wiring| wiring.device == device.name && usize::from(wiring.channel) == column)
                .map_or((1.0, 0.0), |wiring| (wiring.scale, wiring.offset));
            let slots = interleaved.iter_mut().skip(column).step_by(usize::from(channels));
            for (value, slot) in values.iter().zip(slots) {
                let count = ((value - offset) / scale).round();
                if !count.is_finite() {
                    return refuse("it has a value that is no finite number of counts");
                }
                *slot = count as i16;
                clipped += u64::from(f64::from(*slot) != count);
            }
        }
        Ok(Counts { period_ns: playback.sample_period_ns, channels, interleaved, clipped })
    }

    /// The frames that the device makes of them, each a hundredth of a second or one sample long.
    fn frames(&self) -> impl Iterator<Item = Frame> + '_ {
        let per_frame = (1_000_000_000 / FRAMES_PER_S / u64::from(self.period_ns)).clamp(1, 1000);
        let block = per_frame as usize * usize::from(self.channels);
        self.interleaved.chunks(block).enumerate().map_while(move |(index, counts)| {
            let first_ns = index as u64 * per_frame * u64::from(self.period_ns);
            let sequence = FIRST_SEQUENCE.wrapping_add(index as u16);
            Frame::new(sequence, FIRST_US + (first_ns + 500) / 1000, self.period_ns, self.channels, counts.to_vec())
        })
    }
}

struct Sender {
    line: (PtyMaster, File),
    wanted: Arc<AtomicBool>,
    speed: f64,
    faults: Faults,
}

impl Sender {
    fn run(mut self, counts: &Counts) -> io::Result<Sent> {
        let mut dice = fastrand::Rng::with_seed(self.faults.seed);
        let mut sent = Sent::default();
        let pace = Pace::start(self.speed);
        let wanted = Arc::clone(&self.wanted);
        let mut frames = counts.frames().peekable();
        let mut played_ns = 0;
        while let Some(frame) = frames.next() {
            played_ns += i64::from(frame.period_ns()) * frame.samples() as i64;
            if !pace.wait_until(played_ns, || wanted.load(Ordering::Relaxed)) {
                return Ok(sent);
            }
            let harmed = sent.frames > 0 && frames.peek().is_some();
            let bytes = if harmed { self.harm(frame.encode(), &mut dice, &mut sent) } else { frame.encode() };
            sent.frames += 1;
            if !self.write_all(&bytes)? {
                return Ok(sent);
            }
        }
        self.drain();
        Ok(sent)
    }

    /// At most one fault a frame.
    fn harm(&self, mut bytes: Vec<u8>, dice: &mut fastrand::Rng, sent: &mut Sent) -> Vec<u8> {
        let Faults { flip, drop, duplicate, .. } = self.faults;
        let throw = dice.f64();
        if throw < drop {
            sent.dropped += 1;
            bytes.clear();
        } else if throw < drop + flip {
            sent.flipped += 1;
            // The closing zero is spared: without it two frames would be lost by one flip.
            let at = dice.usize(..bytes.len().saturating_sub(1).max(1));
            if let Some(byte) = bytes.get_mut(at) {
                *byte ^= 1 << dice.u8(..8);
            }
            sent.bad_pieces += bytes.split(|&byte| byte == 0).filter(|piece| !piece.is_empty()).count() as u64;
        } else if throw < drop + flip + duplicate {
            sent.duplicated += 1;
            bytes.extend_from_within(..);
        }
        bytes
    }

    /// Writes as fast as the line takes it; false where nobody wants more.
    fn write_all(&mut self, mut bytes: &[u8]) -> io::Result<bool> {
        while !bytes.is_empty() {
            if !self.wanted.load(Ordering::Relaxed) {
                return Ok(false);
            }
            match self.line.0.write(bytes) {
                Ok(length) => bytes = bytes.get(length..).unwrap_or_default(),
                Err(error) if error.kind() == ErrorKind::WouldBlock => thread::sleep(Duration::from_millis(1)),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(true)
    }

    /// Hanging up throws away what was not read: waits until it was (or nobody wants it).
    fn drain(&self) {
        let mut quiet = 0;
        while quiet < 3 && self.wanted.load(Ordering::Relaxed) {
            let mut unread = [PollFd::new(self.line.1.as_fd(), PollFlags::POLLIN)];
            let empty = poll(&mut unread, PollTimeout::ZERO) == Ok(0);
            quiet = if empty { quiet + 1 } else { 0 };
            thread::sleep(Duration::from_millis(10));
        }
    }
}

/// A pseudo-terminal in raw mode, so that no byte is changed or echoed: the device's side, the port and its path.
fn raw_pty() -> io::Result<(PtyMaster, File, PathBuf)> {
    let master = posix_openpt(OFlag::O_RDWR | OFlag::O_NOCTTY | OFlag::O_NONBLOCK | OFlag::O_CLOEXEC)?;
    grantpt(&master)?;
    unlockpt(&master)?;
    let path = PathBuf::from(ptsname_r(&master)?);
    // Kept open: the terminal stays raw, and unread bytes can be seen.
    let slave = OpenOptions::new().read(true).write(true).open(&path)?;
    let mut modes = tcgetattr(&slave)?;
    cfmakeraw(&mut modes);
    tcsetattr(&slave, SetArg::TCSANOW, &modes)?;
    Ok((master, slave, path))
}
