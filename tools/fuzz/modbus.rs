//! Modbus RTU: what is taken for an answer, against a reading of the specification that shares no code with the
//! program's.

use surgescope::record::wire::modbus::{Parsed, Request, parse};

use super::poller;
use super::slave::{function, honest, refusal, sealed};

/// No answer is longer.
const LONGEST: usize = 257;

/// Unit, flags, first register and number of registers (a byte each), then bytes of answers, which are a recipe of what
/// the line does to the poller too.
pub fn modbus(input: &[u8]) {
    let Some((&[unit, flags, start, count], bytes)) = input.split_first_chunk() else { return };
    let read = Request::Read { input: flags & 1 != 0, start: start.into(), count: u16::from(count % 125) + 1 };
    let asked = [read, Request::Echo(u16::from_be_bytes([start, count]))];
    for bytes in [bytes, &sealed(bytes)] {
        let bytes = &bytes[..bytes.len().min(LONGEST + 20)];
        answer(unit, bytes, &asked);
        answer(bytes.first().copied().unwrap_or(unit), bytes, &asked);
    }
    asked.iter().for_each(|request| others(unit, request));
    poller::poll(unit, flags, start, count, bytes);
}

/// What is taken for an answer is one, whatever comes behind it and wherever the bytes are split.
fn answer(unit: u8, bytes: &[u8], asked: &[Request]) {
    let parsed = parse(unit, bytes);
    for end in 0..bytes.len() {
        let early = parse(unit, &bytes[..end]);
        assert!(early == Parsed::Incomplete || early == parsed, "{early:?} after {end} bytes, {parsed:?} in the end");
    }
    let length = whole(unit, bytes);
    let Parsed::Whole(answer, taken) = &parsed else {
        assert_eq!(length, None, "an answer that was not taken");
        assert!(parsed == Parsed::Bad || bytes.len() < LONGEST, "waits for more than an answer has");
        return;
    };
    assert_eq!(Some(*taken), length, "{answer:?}");
    assert_eq!(answer.encode(unit), &bytes[..*taken], "the same answer sent again");
    for request in asked {
        assert_eq!(answer.fits(request), is_asked_for(&bytes[..*taken], request), "{answer:?} to {request:?}");
    }
}

/// Answers that would be right for other requests.
fn others(unit: u8, request: &Request) {
    let mut others = vec![Request::Echo(0), Request::Echo(u16::MAX)];
    others.extend(match *request {
        Request::Echo(number) => [Request::Echo(number ^ 1), Request::Echo(number.swap_bytes())],
        Request::Read { input, start, count } => {
            [Request::Read { input: !input, start, count }, Request::Read { input, start, count: count % 125 + 1 }]
        }
    });
    for other in others.iter().filter(|other| *other != request) {
        for bytes in [honest(unit, other), refusal(unit, other, 2)] {
            let Parsed::Whole(answer, length) = parse(unit, &bytes) else { panic!("no answer: {bytes:?}") };
            assert_eq!(length, bytes.len());
            assert_eq!(parse(unit.wrapping_add(1), &bytes), Parsed::Bad, "an answer of another unit");
            let same = function(other) == function(request) && bytes[1] & 0x80 != 0;
            assert_eq!(answer.fits(request), same, "{answer:?}, which was for {other:?}, to {request:?}");
        }
    }
}

/// Length of the answer that the bytes begin with, if they do.
fn whole(unit: u8, bytes: &[u8]) -> Option<usize> {
    let length = match *bytes.get(..3)? {
        [from, ..] if from != unit => return None,
        [_, 3 | 4, data] if data > 0 && data % 2 == 0 => usize::from(data) + 5,
        [_, 8, _] => 8,
        [_, 0x83 | 0x84 | 0x88, _] => 5,
        _ => return None,
    };
    let frame = bytes.get(..length)?;
    let right = sealed(&frame[..length - 2]) == frame;
    (right && (bytes[1] != 8 || bytes[2..4] == [0, 0])).then_some(length)
}

fn is_asked_for(frame: &[u8], request: &Request) -> bool {
    match *request {
        _ if frame[1] == function(request) | 0x80 => true,
        Request::Read { count, .. } => frame[1] == function(request) && u16::from(frame[2]) == 2 * count,
        Request::Echo(number) => frame[1] == 8 && frame[4..6] == number.to_be_bytes(),
    }
}
