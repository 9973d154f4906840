//! A line that sends back what is sent on it, as two-wire RS-485 adapters do that listen while they speak: what comes
//! back is taken off.
//!
//! No slave answers a request to read registers with the request itself, so such a request that comes back gives the
//! line away. Until then a returned echo request (function 8) looks like the slave's answer: see
//! [`crate::record::devices::poll`] for what is done about that.

use std::io;
use std::time::{Duration, Instant};

use crate::record::devices::poll::Line;
use crate::record::wire::modbus::Request;

const READ_BYTES: usize = 512;
/// Bytes of a request for an echo, and of its answer.
const ECHO_BYTES: usize = 8;

/// A line without what it sends back.
pub struct Loopback<L> {
    line: L,
    /// What was sent and may come back.
    own: Vec<u8>,
    /// What came and may be it.
    held: Vec<u8>,
    /// What came from others.
    ready: Vec<u8>,
    /// Requests that came back.
    returned: u64,
}

impl<L: Line> Loopback<L> {
    /// The line may or may not send back what is sent.
    pub fn new(line: L) -> Loopback<L> {
        Loopback { line, own: Vec::new(), held: Vec::new(), ready: Vec::new(), returned: 0 }
    }

    /// Sorts what is held, where it tells.
    fn sort(&mut self) {
        // a slave's answer to an echo that was asked for earlier may come before the own request
        while !self.own.is_empty() && self.held.len() >= ECHO_BYTES && self.held[..ECHO_BYTES] != self.own[..] {
            let Some((_, Request::Echo(_))) = Request::decode(&self.held[..ECHO_BYTES]) else { break };
            self.ready.extend(self.held.drain(..ECHO_BYTES));
        }
        let alike = self.held.len().min(self.own.len());
        let may_be_own = self.held[..alike] == self.own[..alike];
        if may_be_own && self.held.len() < self.own.len() {
            return;
        }
        let is_read = matches!(Request::decode(&self.own), Some((_, Request::Read { .. })));
        if may_be_own && !self.own.is_empty() && (is_read || self.returned > 0) {
            self.returned += 1;
            self.held.drain(..self.own.len());
        }
        self.own.clear();
        self.ready.append(&mut self.held);
    }
}

impl<L: Line> Line for Loopback<L> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.ready.append(&mut self.held);
        self.own = bytes.to_vec();
        self.line.send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], within: Duration) -> io::Result<usize> {
        let until = Instant::now() + within;
        let mut came = [0; READ_BYTES];
        while self.ready.is_empty() {
            let length = self.line.receive(&mut came, until.saturating_duration_since(Instant::now()))?;
            self.held.extend(came.iter().take(length));
            if length == 0 {
                // nothing more comes: it was something else
                self.ready.append(&mut self.held);
                break;
            }
            self.sort();
        }
        let length = self.ready.len().min(buffer.len());
        for (to, from) in buffer.iter_mut().zip(self.ready.drain(..length)) {
            *to = from;
        }
        Ok(length)
    }

    fn returned(&self) -> u64 {
        self.returned
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use proptest::prelude::*;

    use super::*;
    use crate::record::wire::modbus::Answer;

    /// Says what it was given, a piece at a time.
    struct Said(VecDeque<Vec<u8>>);

    impl Line for Said {
        fn send(&mut self, _: &[u8]) -> io::Result<()> {
            Ok(())
        }

        fn receive(&mut self, buffer: &mut [u8], _: Duration) -> io::Result<usize> {
            let piece = self.0.pop_front().unwrap_or_default();
            buffer[..piece.len()].copy_from_slice(&piece);
            Ok(piece.len())
        }
    }

    fn heard(asked: &[u8], pieces: &[&[u8]], returned: u64) -> (Vec<u8>, u64) {
        let mut line = Loopback::new(Said(pieces.iter().map(|piece| piece.to_vec()).collect()));
        line.returned = returned;
        line.send(asked).unwrap();
        let (mut all, mut buffer) = (Vec::new(), [0; 7]);
        for _ in 0..pieces.len() + 40 {
            let length = line.receive(&mut buffer, Duration::ZERO).unwrap();
            all.extend(&buffer[..length]);
        }
        (all, line.returned() - returned)
    }

    #[test]
    fn the_own_request_is_taken_off_and_nothing_else() {
        let request = Request::Read { input: true, start: 0x0401, count: 2 }.encode(1);
        let answer = Answer::Registers { input: true, words: vec![7, 8] }.encode(1);
        let both = [request.clone(), answer.clone()].concat();
        for size in [1, 3, 8, 64] {
            let pieces: Vec<&[u8]> = both.chunks(size).collect();
            assert_eq!(heard(&request, &pieces, 0), (answer.clone(), 1));
        }
        assert_eq!(heard(&request, &[&answer], 0), (answer.clone(), 0));
        // a beginning of it that goes no further is not swallowed
        assert_eq!(heard(&request, &[&request[..5]], 0), (request[..5].to_vec(), 0));
        // an echo is the slave's until the line is known
        let echo = Request::Echo(5).encode(1);
        assert_eq!(heard(&echo, &[&echo], 0), (echo.clone(), 0));
        assert_eq!(heard(&echo, &[&echo], 1), (Vec::new(), 1));
        assert_eq!(heard(&echo, &[&echo, &echo], 1), (echo.clone(), 1));
        // the slave's answer to an echo comes after the next request was sent
        let [late, expected] = [[&echo[..], &both].concat(), [&echo[..], &answer].concat()];
        for size in [8, 16, 64] {
            let pieces: Vec<&[u8]> = late.chunks(size).collect();
            assert_eq!(heard(&request, &pieces, 0), (expected.clone(), 1), "{size}");
        }
    }

    proptest! {
        #[test]
        fn what_is_not_the_request_comes_through(bytes in prop::collection::vec(0u8..4, 0..40), size in 1usize..9, loops in any::<bool>()) {
            let request = Request::Read { input: false, start: 1, count: 2 }.encode(1);
            let sent = if loops { [&request[..], &bytes].concat() } else { bytes.clone() };
            let pieces: Vec<&[u8]> = sent.chunks(size).collect();
            prop_assert_eq!(heard(&request, &pieces, 0), (bytes, u64::from(loops)));
        }
    }
}
