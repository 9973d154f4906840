//! A device that sends by itself: frames or lines.

use std::fmt::Write as _;
use std::io;
use std::thread;
use std::time::Duration;

use crate::record::clock::pace::Pace;
use crate::record::devices::simulated::faults::{Fault, Faults, Sent, noise, place};
use crate::record::devices::simulated::pty::Wire;
use crate::record::devices::simulated::script::{Form, Script};
use crate::record::wire::frames::Frame;

/// Frames that a device sends per second.
const FRAMES_PER_S: u64 = 100;
/// A device has been on for a while when one starts to listen: its time is not 0, and its sequence soon wraps.
const FIRST_US: u64 = 3_600_000_000;
const FIRST_SEQUENCE: u16 = 65_500;
/// How long a stalled device says nothing, and how much a restarting one does not send.
const STALL: Duration = Duration::from_millis(300);
const RESTART_NS: u64 = 200_000_000;

/// Plays the script, then hangs up.
pub fn run(mut line: Wire, script: &Script, speed: f64, faults: Faults) -> io::Result<Sent> {
    let mut dice = fastrand::Rng::with_seed(faults.seed);
    let mut sent = Sent::default();
    let pace = Pace::start(speed);
    let mut device = Booted { at_ns: 0, first_us: FIRST_US, sequence: FIRST_SEQUENCE };
    let per_piece = match script.form {
        Form::Lines { .. } => 1,
        _ => (1_000_000_000 / FRAMES_PER_S / u64::from(script.period_ns)).clamp(1, 1000) as usize,
    };
    let pieces = script.rows.div_ceil(per_piece);
    let mut silent_until_ns = 0;
    for index in 0..pieces {
        let rows = index * per_piece..script.rows.min((index + 1) * per_piece);
        let first_ns = rows.start as u64 * u64::from(script.period_ns);
        let played_ns = rows.end as u64 * u64::from(script.period_ns);
        let true_ns = played_ns as f64 / (1.0 + faults.drift_ppm * 1e-6);
        let wanted = line.wanted.clone();
        if !pace.wait_until(true_ns as i64, || wanted.load(std::sync::atomic::Ordering::Relaxed)) {
            return Ok(sent);
        }
        sent.frames += 1;
        if first_ns < silent_until_ns {
            sent.reset_frames += 1;
            continue;
        }
        if silent_until_ns > device.at_ns {
            device = Booted { at_ns: first_ns, first_us: 5_000, sequence: 0 };
        }
        let harmed = index > 0 && index + 1 < pieces;
        let fault = if harmed { faults.throw(&mut dice) } else { None };
        let good = device.encode(script, rows, false)?;
        let bytes = match fault {
            Some(Fault::Reset) if index + 1 + (RESTART_NS / 10_000_000) as usize * 2 < pieces => {
                sent.resets += 1;
                sent.reset_frames += 1;
                silent_until_ns = first_ns + RESTART_NS;
                continue;
            }
            Some(Fault::Crc) if matches!(script.form, Form::Frames { .. }) => {
                sent.wrong_crc += 1;
                sent.bad_pieces += 1;
                device.encode(script, index * per_piece..script.rows.min((index + 1) * per_piece), true)?
            }
            Some(fault) => harm(fault, good, &mut dice, &mut sent),
            None => good,
        };
        device.sequence = device.sequence.wrapping_add(1);
        if !line.write_all(&bytes)? {
            return Ok(sent);
        }
    }
    line.drain();
    Ok(sent)
}

/// A device since it was switched on.
struct Booted {
    /// Played time then, ns.
    at_ns: u64,
    /// What its clock showed.
    first_us: u64,
    /// Sequence number of the next frame.
    sequence: u16,
}

impl Booted {
    fn encode(&self, script: &Script, rows: std::ops::Range<usize>, wrong_crc: bool) -> io::Result<Vec<u8>> {
        let first_ns = rows.start as u64 * u64::from(script.period_ns) - self.at_ns;
        let time_us = self.first_us + (first_ns + 500) / 1000;
        match &script.form {
            Form::Frames { channels, interleaved } => {
                let width = usize::from(*channels);
                let counts = interleaved.get(rows.start * width..rows.end * width).unwrap_or_default().to_vec();
                let frame = Frame::new(self.sequence, time_us, script.period_ns, *channels, counts);
                let frame = frame.ok_or_else(|| io::Error::other("a frame that the wire cannot hold"))?;
                Ok(if wrong_crc { frame.encode_with_wrong_crc() } else { frame.encode() })
            }
            Form::Lines { columns, time_unit } => {
                let ticks = (time_us as f64 * 1e-6 / time_unit.seconds()).round() as u64;
                let mut text = ticks.to_string();
                for number in columns.iter().filter_map(|column| column.get(rows.start)) {
                    let _ = write!(text, ",{number}");
                }
                text.push('\n');
                Ok(text.into_bytes())
            }
            Form::Registers { .. } => Ok(Vec::new()),
        }
    }
}

fn harm(fault: Fault, mut bytes: Vec<u8>, dice: &mut fastrand::Rng, sent: &mut Sent) -> Vec<u8> {
    match fault {
        Fault::Drop => {
            sent.dropped += 1;
            bytes.clear();
        }
        Fault::Flip => {
            sent.flipped += 1;
            // The closing byte is spared: without it two frames would be lost by one flip.
            let at = place(&bytes, dice);
            bytes[at] ^= 1 << dice.u8(..8);
            let end = bytes.last().copied().unwrap_or_default();
            sent.bad_pieces += bytes.split(|&byte| byte == end).filter(|piece| !piece.is_empty()).count() as u64;
        }
        Fault::Duplicate => {
            sent.duplicated += 1;
            bytes.extend_from_within(..);
        }
        Fault::Noise => {
            sent.noisy += 1;
            sent.bad_pieces += 1;
            bytes.splice(0..0, noise(dice));
        }
        Fault::Cut => {
            sent.cut += 1;
            let end = bytes.pop();
            let at = place(&bytes, dice);
            bytes.truncate(at);
            sent.bad_pieces += u64::from(at > 0);
            bytes.extend(end);
        }
        Fault::Stall => {
            sent.stalls += 1;
            thread::sleep(STALL);
        }
        Fault::Crc | Fault::Reset | Fault::Late => {}
    }
    bytes
}
