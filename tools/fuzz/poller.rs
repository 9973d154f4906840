//! The poller of a Modbus slave that answers in order, late, twice or not at all, on a line that flips bits or says
//! anything.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::io;
use std::time::{Duration, Instant};

use surgescope::record::devices::poll::{Line, Outcome, Poller};
use surgescope::record::wire::modbus::Request;
use surgescope::record::wire::registers::Group;

use super::slave::{function, honest, refusal, registers, sealed, word};
use super::wire::recipe;

/// Short, so that requests time out here in earnest; a wait in the recipe is one such time.
const TIMEOUT: Duration = Duration::from_micros(200);
const MOST_WAITS: u32 = 100;
/// Reads of a group in a run.
const MOST_READS: usize = 40;
/// Registers from here on are refused.
const REFUSED_FROM: u16 = 700;

/// Reads groups in turn on a line that does what the recipe says. Words come only from the one answer on the line that
/// fits, and, as long as nobody else speaks on it, they are those of the registers asked for.
pub fn poll(unit: u8, flags: u8, start: u8, count: u8, bytes: &[u8]) {
    fastrand::seed(start.into());
    let (input, start, count) = (flags & 1 != 0, u16::from(start), u16::from(count % 4) + 1);
    let groups = [(input, start), (input, start + 256), (!input, start), (input, start + 512)]
        .map(|(input, start)| Group { input, start, count, members: Vec::new() });
    let state = State { recipe: Box::new(recipe(bytes)), ..State::default() };
    let line = Scripted { unit, knows_echoes: flags & 2 == 0, state: RefCell::new(state) };
    let mut poller = Poller::new(&line, unit, TIMEOUT);
    for group in groups.iter().cycle().take(MOST_READS) {
        let outcome = poller.read(group).expect("a line that is there");
        let state = line.state.borrow();
        if let Outcome::Words(words, _) = outcome {
            assert_eq!(words.len(), usize::from(count));
            let answer = registers(unit, 3 + u8::from(group.input), &words);
            assert_eq!(without_echoes(unit, &state.since_request), answer, "all that came since the request");
            let held: Vec<u16> = (0..count).map(|i| word(group.input, group.start + i)).collect();
            assert!(state.is_noisy || words == held, "{words:?} for {held:?}: an answer to another request");
        }
        if state.is_over {
            break;
        }
    }
}

/// Answers to echoes, and their refusals, may stand before the answer.
fn without_echoes(unit: u8, mut bytes: &[u8]) -> &[u8] {
    loop {
        let length = match bytes {
            [from, 8, 0, 0, ..] if *from == unit && bytes.len() >= 8 => 8,
            [from, 0x88, ..] if *from == unit && bytes.len() >= 5 => 5,
            _ => return bytes,
        };
        if sealed(&bytes[..length - 2]) != bytes[..length] {
            return bytes;
        }
        bytes = &bytes[length..];
    }
}

struct Scripted<'a> {
    unit: u8,
    knows_echoes: bool,
    state: RefCell<State<'a>>,
}

struct State<'a> {
    recipe: Box<dyn Iterator<Item = (u8, &'a [u8])> + 'a>,
    /// Answers, each with whether it comes twice.
    on_its_way: VecDeque<(Vec<u8>, bool)>,
    /// The first of them has begun to arrive.
    has_begun: bool,
    since_request: Vec<u8>,
    waits: u32,
    /// Bytes came that no slave had sent.
    is_noisy: bool,
    /// Nothing will ever come again.
    is_over: bool,
}

impl Default for State<'_> {
    fn default() -> Self {
        State {
            recipe: Box::new(std::iter::empty()),
            on_its_way: VecDeque::new(),
            has_begun: false,
            since_request: Vec::new(),
            waits: 0,
            is_noisy: false,
            is_over: false,
        }
    }
}

impl Line for &Scripted<'_> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut state = self.state.borrow_mut();
        assert_eq!(bytes, sealed(&bytes[..6]), "the check sum of a request");
        let (first, second) = (u16::from_be_bytes([bytes[2], bytes[3]]), u16::from_be_bytes([bytes[4], bytes[5]]));
        let request = match bytes[1] {
            8 => Request::Echo(second),
            code => Request::Read { input: code == 4, start: first, count: second },
        };
        assert_eq!((bytes[0], bytes[1]), (self.unit, function(&request)));
        let refuses = match request {
            Request::Echo(_) => !self.knows_echoes,
            Request::Read { start, .. } => start >= REFUSED_FROM,
        };
        let answer = if refuses { refusal(self.unit, &request, 2) } else { honest(self.unit, &request) };
        state.on_its_way.push_back((answer, false));
        state.since_request.clear();
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], within: Duration) -> io::Result<usize> {
        let mut state = self.state.borrow_mut();
        let bytes = state.next(within);
        let length = bytes.len().min(buffer.len());
        buffer[..length].copy_from_slice(&bytes[..length]);
        state.since_request.extend(&bytes[..length]);
        Ok(length)
    }
}

impl State<'_> {
    /// What the recipe has come next: nothing for a while, bytes of the answers on their way, or others.
    fn next(&mut self, within: Duration) -> Vec<u8> {
        while let Some((kind, piece)) = self.recipe.next() {
            match kind % 9 {
                0 => return Vec::new(),
                1 => return self.arriving(usize::MAX),
                2 if !piece.is_empty() => return self.arriving(piece.len()),
                3 if !piece.is_empty() => {
                    self.is_noisy = true;
                    return piece.to_vec();
                }
                4 => {
                    self.is_noisy = true;
                    return sealed(piece);
                }
                // a bit of a whole answer flips: no check sum of 16 bits overlooks one
                5 if !self.has_begun => self.flip(piece),
                6 if !self.has_begun => drop(self.on_its_way.pop_front()),
                8 if !self.has_begun => self.copy(),
                7 if self.waits < MOST_WAITS => {
                    self.waits += 1;
                    let since = Instant::now();
                    while since.elapsed() < within.min(TIMEOUT) {
                        std::hint::spin_loop();
                    }
                    return Vec::new();
                }
                _ => {}
            }
        }
        self.is_over = true;
        Vec::new()
    }

    fn arriving(&mut self, most: usize) -> Vec<u8> {
        let mut bytes = Vec::new();
        while let Some((answer, _)) = self.on_its_way.front_mut() {
            let taken = answer.len().min(most - bytes.len());
            bytes.extend(answer.drain(..taken));
            self.has_begun = !answer.is_empty();
            if self.has_begun {
                break;
            }
            self.on_its_way.pop_front();
        }
        bytes
    }

    /// Once an answer: it comes again before any other does.
    fn copy(&mut self) {
        if let Some((answer, is_copied)) = self.on_its_way.front_mut()
            && !*is_copied
        {
            *is_copied = true;
            let copy = (answer.clone(), true);
            self.on_its_way.insert(1, copy);
        }
    }

    /// Once an answer: two flips could make a right one of it.
    fn flip(&mut self, piece: &[u8]) {
        let Some((answer, _)) = self.on_its_way.front_mut() else { return };
        let &[at, bit, ..] = piece else { return };
        let at = usize::from(at) % answer.len();
        answer[at] ^= 1 << (bit % 8);
        self.has_begun = true;
    }
}
