//! Devices that are asked: Modbus slaves on one line, whose registers hold what the scripts say at that time.

use std::io;
use std::thread;
use std::time::{Duration, Instant};

use crate::record::devices::simulated::faults::{Fault, Faults, Sent, noise, place};
use crate::record::devices::simulated::pty::Wire;
use crate::record::devices::simulated::script::{Form, Script};
use crate::record::wire::modbus::{Answer, Request};
use crate::record::wire::registers::words;

/// A request that stops in its middle is forgotten after so long.
const QUIET: Duration = Duration::from_millis(20);

/// Answers until a script is over, then hangs up.
pub fn run(mut line: Wire, scripts: &[Script], speed: f64, faults: Faults) -> io::Result<Sent> {
    let mut dice = fastrand::Rng::with_seed(faults.seed);
    let mut sent = Sent::default();
    let started = Instant::now();
    // Without a pace there is no telling what is asked when: real time.
    let speed = if speed > 0.0 { speed } else { 1.0 };
    let mut pending = Vec::new();
    let mut buffer = [0; 256];
    while line.wanted() {
        let played_ns = || started.elapsed().as_nanos() as f64 * speed;
        if scripts.iter().any(|script| row(script, played_ns()) >= script.rows) {
            line.drain();
            break;
        }
        let length = line.read(&mut buffer, QUIET)?;
        if length == 0 {
            pending.clear();
            continue;
        }
        if faults.echo && !line.write_all(&buffer[..length])? {
            return Ok(sent);
        }
        pending.extend(buffer.iter().take(length));
        while pending.len() >= 8 {
            let Some((asked, request)) = Request::decode(&pending) else {
                pending.remove(0);
                continue;
            };
            pending.drain(..8);
            let Some((script, timeout_s)) = scripts.iter().find_map(|script| match script.form {
                Form::Registers { unit, timeout_s, .. } if unit == asked => Some((script, timeout_s)),
                _ => None,
            }) else {
                continue; // nobody has that number
            };
            let Some(bytes) = answer(script, &request, row(script, played_ns()).min(script.rows - 1)) else { continue };
            sent.frames += 1;
            let fault = if sent.frames > 1 { faults.throw(&mut dice) } else { None };
            let bytes = match fault {
                Some(fault) => harm(fault, bytes, timeout_s, &mut dice, &mut sent),
                None => bytes,
            };
            if !line.write_all(&bytes)? {
                return Ok(sent);
            }
        }
    }
    Ok(sent)
}

/// The row that a script has come to.
fn row(script: &Script, played_ns: f64) -> usize {
    (played_ns / f64::from(script.period_ns)) as usize
}

/// What the slave says.
fn answer(script: &Script, request: &Request, row: usize) -> Option<Vec<u8>> {
    let Form::Registers { unit, values, .. } = &script.form else { return None };
    let answer = match *request {
        Request::Echo(number) => Answer::Echo(number),
        Request::Read { input, start, count } => {
            let word = |address: u16| {
                values.iter().filter(|(place, _)| place.register.input == input).find_map(|(place, numbers)| {
                    let at = usize::from(address.checked_sub(place.address)?);
                    words(&place.register, *numbers.get(row)?).get(at).copied()
                })
            };
            let addresses = (0..count).map(|offset| start.checked_add(offset));
            match addresses.map(|address| word(address?)).collect::<Option<Vec<u16>>>() {
                Some(words) if !words.is_empty() => Answer::Registers { input, words },
                _ => request.refused(2),
            }
        }
    };
    Some(answer.encode(*unit))
}

fn harm(fault: Fault, mut bytes: Vec<u8>, timeout_s: f64, dice: &mut fastrand::Rng, sent: &mut Sent) -> Vec<u8> {
    match fault {
        Fault::Drop | Fault::Reset => {
            sent.dropped += 1;
            bytes.clear();
        }
        Fault::Flip => {
            sent.flipped += 1;
            let at = place(&bytes, dice);
            bytes[at] ^= 1 << dice.u8(..8);
        }
        Fault::Duplicate => {
            sent.duplicated += 1;
            bytes.extend_from_within(..);
        }
        Fault::Noise => {
            sent.noisy += 1;
            bytes.splice(0..0, noise(dice));
        }
        Fault::Cut => {
            sent.cut += 1;
            bytes.truncate(place(&bytes, dice));
        }
        Fault::Crc => {
            sent.wrong_crc += 1;
            if let Some(last) = bytes.last_mut() {
                *last ^= 0x55;
            }
        }
        Fault::Stall | Fault::Late => {
            sent.late += 1;
            let share = if fault == Fault::Late { 0.8 + 0.7 * dice.f64() } else { 4.0 };
            thread::sleep(Duration::from_secs_f64(timeout_s * share));
        }
    }
    bytes
}
