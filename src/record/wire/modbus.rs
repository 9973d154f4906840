//! Modbus RTU: requests to bytes and answers from bytes, without any I/O.
//!
//! A frame is unit, function, data, CRC-16/MODBUS (low byte first). Three functions are spoken: 3 and 4 read registers;
//! 8, sub-function 0, returns what was sent ("Return Query Data") and brings a line back into step: no answer to a read
//! can be taken for its answer. (Modbus Application Protocol V1.1b3 and Modbus over Serial Line V1.02, modbus.org.)

use crc::{CRC_16_MODBUS, Crc};

const CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_MODBUS);
const READ_HOLDING: u8 = 3;
const READ_INPUT: u8 = 4;
/// Function of an echo.
pub(crate) const DIAGNOSTICS: u8 = 8;
/// Set in the function of an answer that refuses.
const REFUSED: u8 = 0x80;
const REFUSED_HOLDING: u8 = REFUSED | READ_HOLDING;
const REFUSED_INPUT: u8 = REFUSED | READ_INPUT;
const REFUSED_DIAGNOSTICS: u8 = REFUSED | DIAGNOSTICS;

/// What is asked of a slave.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Request {
    /// Read registers.
    Read {
        /// Input registers rather than holding registers.
        input: bool,
        /// Address of the first.
        start: u16,
        /// How many, 1 to 125.
        count: u16,
    },
    /// Send this number back.
    Echo(u16),
}

impl Request {
    fn function(&self) -> u8 {
        match self {
            Request::Read { input: true, .. } => READ_INPUT,
            Request::Read { input: false, .. } => READ_HOLDING,
            Request::Echo(_) => DIAGNOSTICS,
        }
    }

    /// The slave's no, with an exception code.
    pub fn refused(&self, code: u8) -> Answer {
        Answer::Refused { function: self.function(), code }
    }

    /// The bytes on the wire.
    pub fn encode(&self, unit: u8) -> Vec<u8> {
        let mut bytes = vec![unit, self.function()];
        let (first, second) = match *self {
            Request::Read { start, count, .. } => (start, count),
            Request::Echo(number) => (0, number),
        };
        bytes.extend(first.to_be_bytes());
        bytes.extend(second.to_be_bytes());
        sealed(bytes)
    }

    /// A request as a slave sees it: with the unit that it is for. `None` while bytes are missing or where there is
    /// none.
    pub fn decode(bytes: &[u8]) -> Option<(u8, Request)> {
        let &[unit, function, a, b, c, d, ..] = unsealed(bytes.get(..8)?)? else { return None };
        let (first, second) = (u16::from_be_bytes([a, b]), u16::from_be_bytes([c, d]));
        match function {
            READ_HOLDING | READ_INPUT => {
                Some((unit, Request::Read { input: function == READ_INPUT, start: first, count: second }))
            }
            DIAGNOSTICS if first == 0 => Some((unit, Request::Echo(second))),
            _ => None,
        }
    }
}

/// What a slave says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Answer {
    /// The registers read.
    Registers {
        /// Input registers rather than holding registers.
        input: bool,
        /// Their words.
        words: Vec<u16>,
    },
    /// The number sent back.
    Echo(u16),
    /// No, with the exception's code.
    Refused {
        /// The function refused: 3, 4 or 8.
        function: u8,
        /// Modbus exception code.
        code: u8,
    },
}

impl Answer {
    /// The bytes on the wire.
    pub fn encode(&self, unit: u8) -> Vec<u8> {
        let bytes = match self {
            Answer::Registers { input, words } => {
                let function = if *input { READ_INPUT } else { READ_HOLDING };
                let mut bytes = vec![unit, function, 2 * words.len() as u8];
                bytes.extend(words.iter().flat_map(|word| word.to_be_bytes()));
                bytes
            }
            Answer::Echo(number) => {
                let [high, low] = number.to_be_bytes();
                vec![unit, DIAGNOSTICS, 0, 0, high, low]
            }
            Answer::Refused { function, code } => vec![unit, REFUSED | function, *code],
        };
        sealed(bytes)
    }

    /// True if this can be what `request` asked for. Answers do not say which registers they are of: one that comes
    /// late fits the next request for as many of them.
    pub fn fits(&self, request: &Request) -> bool {
        match (self, request) {
            (Answer::Registers { input, words }, Request::Read { input: asked, count, .. }) => {
                input == asked && words.len() == usize::from(*count)
            }
            (Answer::Echo(number), Request::Echo(asked)) => number == asked,
            (Answer::Refused { function, .. }, request) => *function == request.function(),
            _ => false,
        }
    }
}

/// What the first bytes of an answer are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Parsed {
    /// More bytes are needed to tell.
    Incomplete,
    /// A whole answer of the unit, and how many bytes it takes.
    Whole(Answer, usize),
    /// No answer of this unit: noise, a wrong check sum, another slave.
    Bad,
}

/// Reads the answer that `bytes` begin with.
pub fn parse(unit: u8, bytes: &[u8]) -> Parsed {
    let (Some(&from), Some(&function)) = (bytes.first(), bytes.get(1)) else {
        return if bytes.first().is_some_and(|&from| from != unit) { Parsed::Bad } else { Parsed::Incomplete };
    };
    let length = match (function, bytes.get(2)) {
        _ if from != unit => return Parsed::Bad,
        (READ_HOLDING | READ_INPUT, None) => return Parsed::Incomplete,
        (READ_HOLDING | READ_INPUT, Some(&data)) if data > 0 && data % 2 == 0 => 5 + usize::from(data),
        (DIAGNOSTICS, _) => 8,
        (REFUSED_HOLDING | REFUSED_INPUT | REFUSED_DIAGNOSTICS, _) => 5,
        _ => return Parsed::Bad,
    };
    let Some(frame) = bytes.get(..length) else { return Parsed::Incomplete };
    let answer = unsealed(frame).and_then(|body| match (function, body) {
        (READ_HOLDING | READ_INPUT, [_, _, _, data @ ..]) => {
            let words = data.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect();
            Some(Answer::Registers { input: function == READ_INPUT, words })
        }
        (DIAGNOSTICS, &[_, _, 0, 0, high, low]) => Some(Answer::Echo(u16::from_be_bytes([high, low]))),
        (DIAGNOSTICS, _) => None,
        (_, &[_, refused, code]) => Some(Answer::Refused { function: refused & !REFUSED, code }),
        _ => None,
    });
    answer.map_or(Parsed::Bad, |answer| Parsed::Whole(answer, length))
}

/// What an exception's code means, for the one at the rig.
pub fn exception(code: u8) -> &'static str {
    match code {
        1 => "it does not know the function: is register_kind right?",
        2 => "it has no register at that address: check channel, register_kind and encoding",
        3 => "it does not read so many registers at once",
        4 => "it has failed",
        6 => "it is busy",
        _ => "it gives no known reason",
    }
}

fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    bytes.extend(CRC.checksum(&bytes).to_le_bytes());
    bytes
}

/// The bytes before a check sum that is right.
fn unsealed(bytes: &[u8]) -> Option<&[u8]> {
    let (body, sum) = bytes.split_last_chunk::<2>()?;
    (CRC.checksum(body) == u16::from_le_bytes(*sum)).then_some(body)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const READ: Request = Request::Read { input: false, start: 0x6B, count: 3 };

    /// The example of the specification (section 6.3), with the check sum that other implementations give for it.
    #[test]
    fn the_bytes_are_those_of_the_specification() {
        assert_eq!(READ.encode(0x11), [0x11, 0x03, 0x00, 0x6B, 0x00, 0x03, 0x76, 0x87]);
        let bytes = [0x11, 0x03, 0x06, 0xAE, 0x41, 0x56, 0x52, 0x43, 0x40, 0x49, 0xAD];
        let answer = Answer::Registers { input: false, words: vec![0xAE41, 0x5652, 0x4340] };
        assert_eq!(parse(0x11, &bytes), Parsed::Whole(answer.clone(), 11));
        assert_eq!(answer.encode(0x11), bytes);
        assert!(answer.fits(&READ));
        assert!(!answer.fits(&Request::Read { input: true, start: 0x6B, count: 3 }));
        assert!(!answer.fits(&Request::Read { input: false, start: 0x6B, count: 2 }));
        assert!(!answer.fits(&Request::Echo(3)));
    }

    /// A slave that refuses function 4, or one that nobody asked for, has not refused function 3.
    #[test]
    fn a_refusal_is_of_the_function_asked_for() {
        let refused = |function: u8| parse(0x11, &sealed(vec![0x11, REFUSED | function, 2]));
        for function in [READ_HOLDING, READ_INPUT, DIAGNOSTICS] {
            let Parsed::Whole(answer, 5) = refused(function) else { panic!("function {function}") };
            assert_eq!(answer.fits(&READ), function == READ_HOLDING);
            assert_eq!(answer.fits(&Request::Echo(2)), function == DIAGNOSTICS);
        }
        assert_eq!(READ.refused(2).encode(0x11), [0x11, 0x83, 0x02, 0xC1, 0x34]);
        assert_eq!(refused(6), Parsed::Bad);
    }

    fn any_answer() -> impl Strategy<Value = Answer> {
        prop_oneof![
            (any::<bool>(), prop::collection::vec(any::<u16>(), 1..125))
                .prop_map(|(input, words)| Answer::Registers { input, words }),
            any::<u16>().prop_map(Answer::Echo),
            (prop_oneof![Just(3u8), Just(4), Just(8)], any::<u8>())
                .prop_map(|(function, code)| Answer::Refused { function, code }),
        ]
    }

    proptest! {
        #[test]
        fn an_answer_comes_back_as_it_went_and_never_early(answer in any_answer(), unit in 1u8..248, more in prop::collection::vec(any::<u8>(), 0..9)) {
            let mut bytes = answer.encode(unit);
            let length = bytes.len();
            for cut in 0..length {
                prop_assert_eq!(parse(unit, &bytes[..cut]), Parsed::Incomplete);
            }
            bytes.extend(more);
            prop_assert_eq!(parse(unit, &bytes), Parsed::Whole(answer, length));
            prop_assert_eq!(parse(unit + 1, &bytes), Parsed::Bad);
        }

        #[test]
        fn a_flipped_bit_is_no_answer(answer in any_answer(), at in any::<prop::sample::Index>(), bit in 0u8..8) {
            let mut bytes = answer.encode(9);
            let at = at.index(bytes.len());
            bytes[at] ^= 1 << bit;
            prop_assert!(!matches!(parse(9, &bytes), Parsed::Whole(..)));
        }

        #[test]
        fn any_bytes_are_survived(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            let _ = (parse(1, &bytes), Request::decode(&bytes));
        }

        #[test]
        fn a_request_comes_back_as_it_went(input in any::<bool>(), start in any::<u16>(), count in 1u16..126, unit in 1u8..248) {
            for request in [Request::Read { input, start, count }, Request::Echo(start)] {
                prop_assert_eq!(Request::decode(&request.encode(unit)), Some((unit, request)));
            }
        }
    }
}
