//! A line with several Modbus slaves on it, such as RS-485: each one's poller sees the answers of its own slave only.
//!
//! One master asks and one slave at a time answers, but a late answer comes while another slave is asked. It says which
//! unit it is of, so it is kept for that one's poller, which needs it to come back into step (see
//! [`crate::record::devices::poll`]).

use std::cell::RefCell;
use std::io;
use std::rc::Rc;
use std::time::{Duration, Instant};

use crate::record::devices::poll::Line;
use crate::record::wire::modbus::{Parsed, parse};

const READ_BYTES: usize = 512;

/// A line to one of the slaves.
pub struct Tap<L> {
    bus: Rc<RefCell<Bus<L>>>,
    slave: usize,
}

struct Bus<L> {
    line: L,
    slaves: Vec<Slave>,
    /// What came since the last whole answer.
    pending: Vec<u8>,
    /// So many bytes of it have gone to the one that asks: its answer is under way.
    passed: usize,
}

struct Slave {
    unit: u8,
    /// What waits for its poller.
    inbox: Vec<u8>,
}

/// A line to each of the slaves with these units, on one line.
pub fn taps<L: Line>(line: L, units: &[u8]) -> Vec<Tap<L>> {
    let slaves = units.iter().map(|&unit| Slave { unit, inbox: Vec::new() }).collect();
    let bus = Rc::new(RefCell::new(Bus { line, slaves, pending: Vec::new(), passed: 0 }));
    (0..units.len()).map(|slave| Tap { bus: Rc::clone(&bus), slave }).collect()
}

impl<L: Line> Line for Tap<L> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut bus = self.bus.borrow_mut();
        bus.forget();
        bus.line.send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], within: Duration) -> io::Result<usize> {
        let mut bus = self.bus.borrow_mut();
        bus.fill(self.slave, within)?;
        let Some(slave) = bus.slaves.get_mut(self.slave) else { return Ok(0) };
        let length = slave.inbox.len().min(buffer.len());
        for (to, from) in buffer.iter_mut().zip(slave.inbox.drain(..length)) {
            *to = from;
        }
        Ok(length)
    }

    fn returned(&self) -> u64 {
        self.bus.borrow().line.returned()
    }
}

impl<L: Line> Bus<L> {
    fn forget(&mut self) {
        self.pending.clear();
        self.passed = 0;
    }

    /// Waits until something stands in the inbox of the slave that is listened to, or the time is over.
    fn fill(&mut self, slave: usize, within: Duration) -> io::Result<()> {
        let until = Instant::now() + within;
        let mut buffer = [0; READ_BYTES];
        loop {
            self.sort(slave);
            if self.slaves.get(slave).is_none_or(|slave| !slave.inbox.is_empty()) {
                return Ok(());
            }
            let length = self.line.receive(&mut buffer, until.saturating_duration_since(Instant::now()))?;
            if length == 0 {
                // Incomplete answers are noise to every listener.
                self.pass(slave, self.pending.len());
                self.forget();
                return Ok(());
            }
            self.pending.extend(buffer.iter().take(length));
        }
    }

    /// Puts what came into inboxes: whole answers into that of their unit, the rest of an answer under way and what is
    /// none into that of the slave that is listened to.
    fn sort(&mut self, listening: usize) {
        while let Some(&first) = self.pending.first() {
            let of = self.slaves.iter().position(|slave| slave.unit == first);
            match (of, parse(first, &self.pending)) {
                (Some(of), Parsed::Whole(_, length)) => {
                    self.pass(of, length);
                    self.pending.drain(..length);
                    self.passed = 0;
                    if of == listening {
                        return;
                    }
                }
                (Some(of), Parsed::Incomplete) => {
                    if of == listening {
                        self.pass(of, self.pending.len());
                        self.passed = self.pending.len();
                    }
                    return;
                }
                (None, _) | (_, Parsed::Bad) => {
                    self.pass(listening, self.pending.len());
                    self.forget();
                }
            }
        }
    }

    /// Passes on what stands before `end` and has not been passed on yet.
    fn pass(&mut self, to: usize, end: usize) {
        let bytes = self.pending.get(self.passed..end).unwrap_or_default();
        if let Some(slave) = self.slaves.get_mut(to) {
            slave.inbox.extend(bytes);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use proptest::prelude::*;

    use super::*;
    use crate::record::wire::modbus::Answer;

    /// Says what it was given, a piece at a time.
    #[derive(Default)]
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

    fn answer(unit: u8, word: u16) -> Vec<u8> {
        Answer::Registers { input: true, words: vec![word] }.encode(unit)
    }

    fn two(pieces: &[&[u8]]) -> Vec<Tap<Said>> {
        taps(Said(pieces.iter().map(|piece| piece.to_vec()).collect()), &[1, 2])
    }

    fn heard(tap: &mut Tap<Said>) -> Vec<u8> {
        let mut buffer = [0; 64];
        let length = tap.receive(&mut buffer, Duration::ZERO).unwrap();
        buffer[..length].to_vec()
    }

    #[test]
    fn a_late_answer_waits_for_the_poller_of_its_own_slave() {
        let late = answer(1, 7);
        let own = answer(2, 8);
        for pieces in [vec![[late.clone(), own.clone()].concat()], vec![late[..3].into(), [&late[3..], &own].concat()]]
        {
            let pieces: Vec<&[u8]> = pieces.iter().map(Vec::as_slice).collect();
            let mut taps = two(&pieces);
            assert_eq!(heard(&mut taps[1]), own);
            assert!(heard(&mut taps[1]).is_empty());
            assert_eq!(heard(&mut taps[0]), late);
            assert!(heard(&mut taps[0]).is_empty());
        }
    }

    /// The second byte of its data is the number of the other slave, and would begin an answer of that.
    #[test]
    fn an_answer_in_pieces_goes_on_as_it_began() {
        let own = answer(2, 0x0103);
        let mut taps = two(&[&own[..3], &own[3..5], &own[5..]]);
        let all: Vec<u8> = (0..3).flat_map(|_| heard(&mut taps[1])).collect();
        assert_eq!(all, own);
        assert!(heard(&mut taps[0]).is_empty());
    }

    #[test]
    fn what_is_nobodys_answer_is_heard_by_who_listens() {
        let (cut, mut wrong) = (answer(1, 7), answer(1, 9));
        wrong[3] ^= 1;
        let mut taps = two(&[&[77, 78], &cut[..4], &[], &wrong]);
        assert_eq!(heard(&mut taps[1]), [77, 78]);
        assert_eq!(heard(&mut taps[1]), cut[..4], "nothing came behind it");
        assert_eq!(heard(&mut taps[1]), wrong);
        assert!(heard(&mut taps[0]).is_empty());
    }

    fn piece() -> impl Strategy<Value = Vec<u8>> {
        let noise = prop::collection::vec(prop_oneof![0u8..4, any::<u8>()], 1..12);
        prop_oneof![(1u8..4, any::<u16>()).prop_map(|(unit, word)| answer(unit, word)), noise]
    }

    proptest! {
        /// Whatever comes, in whatever pieces and whoever listens, no byte is lost and none comes twice.
        #[test]
        fn every_byte_is_heard_once(pieces in prop::collection::vec(piece(), 0..12), size in 1usize..20, who in any::<u32>()) {
            let mut sent = pieces.concat();
            let pieces: Vec<&[u8]> = sent.chunks(size).collect();
            let mut taps = two(&pieces);
            let mut all = Vec::new();
            for turn in 0..pieces.len() + 3 {
                all.extend(heard(&mut taps[(who >> (turn % 32) & 1) as usize]));
            }
            for tap in [0, 0, 0, 1, 1, 1] {
                all.extend(heard(&mut taps[tap]));
            }
            all.sort_unstable();
            sent.sort_unstable();
            prop_assert_eq!(all, sent);
        }
    }
}
