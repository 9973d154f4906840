//! What an honest Modbus slave answers, written from the specification and not with the program's code.

use surgescope::record::wire::modbus::Request;

use super::wire::crc16;

pub fn function(request: &Request) -> u8 {
    match request {
        Request::Read { input, .. } => 3 + u8::from(*input),
        Request::Echo(_) => 8,
    }
}

pub fn sealed(bytes: &[u8]) -> Vec<u8> {
    [bytes, &crc16(bytes, 0xa001, true).to_le_bytes()].concat()
}

/// What register `address` holds: no two of them the same.
pub fn word(input: bool, address: u16) -> u16 {
    address.wrapping_mul(2) + u16::from(input)
}

pub fn honest(unit: u8, request: &Request) -> Vec<u8> {
    match *request {
        Request::Echo(number) => sealed(&[&[unit, 8, 0, 0], &number.to_be_bytes()[..]].concat()),
        Request::Read { input, start, count } => {
            let words: Vec<u16> = (0..count).map(|i| word(input, start.wrapping_add(i))).collect();
            registers(unit, function(request), &words)
        }
    }
}

pub fn registers(unit: u8, function: u8, words: &[u16]) -> Vec<u8> {
    let mut bytes = vec![unit, function, 2 * words.len() as u8];
    bytes.extend(words.iter().flat_map(|word| word.to_be_bytes()));
    sealed(&bytes)
}

pub fn refusal(unit: u8, request: &Request, code: u8) -> Vec<u8> {
    sealed(&[unit, function(request) | 0x80, code])
}
