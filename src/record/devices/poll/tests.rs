//! What the poller promises: no value under another's name, whatever the slave's delays do.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, Sender, channel};

use crate::record::devices::poll::*;

const UNIT: u8 = 5;
const TIMEOUT: Duration = Duration::from_millis(20);

/// A slave in a thread of its own that answers in order, each answer as often as it chooses, after a delay each time;
/// register `a` holds `a`.
struct Slave {
    requests: Sender<Vec<u8>>,
    answers: Receiver<Vec<u8>>,
    ready: VecDeque<u8>,
}

impl Slave {
    fn new(echoes: bool, mut reply: impl FnMut(Vec<u8>) -> (Duration, Vec<Vec<u8>>) + Send + 'static) -> Slave {
        let (requests, asked) = channel::<Vec<u8>>();
        let (answer, answers) = channel();
        std::thread::spawn(move || {
            for bytes in asked {
                let (unit, request) = Request::decode(&bytes).unwrap();
                assert_eq!(unit, UNIT);
                let honest = match request {
                    Request::Read { input, start, count } => {
                        Answer::Registers { input, words: (start..start + count).collect() }
                    }
                    Request::Echo(number) if echoes => Answer::Echo(number),
                    Request::Echo(_) => request.refused(1),
                };
                let (delay, answers) = reply(honest.encode(UNIT));
                for bytes in answers {
                    std::thread::sleep(delay);
                    if answer.send(bytes).is_err() {
                        return;
                    }
                }
            }
        });
        Slave { requests, answers, ready: VecDeque::new() }
    }
}

impl Line for Slave {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.requests.send(bytes.to_vec()).map_err(|_| io::ErrorKind::BrokenPipe.into())
    }

    fn receive(&mut self, buffer: &mut [u8], within: Duration) -> io::Result<usize> {
        if self.ready.is_empty() {
            self.ready.extend(self.answers.recv_timeout(within).unwrap_or_default());
        }
        // In pieces, as a serial port gives them.
        let length = self.ready.len().min(buffer.len()).min(5);
        buffer.iter_mut().zip(self.ready.drain(..length)).for_each(|(slot, byte)| *slot = byte);
        Ok(length)
    }
}

fn group(start: u16) -> Group {
    Group { input: true, start, count: 2, members: vec![0, 1] }
}

/// Polls two groups of the same form in turn; every value must be its own. Returns what was answered.
fn poll(mut poller: Poller<Slave>, polls: u16) -> (u64, PollCounts) {
    let mut answers = 0;
    for index in 0..polls {
        let start = 100 * (index % 2);
        if let Outcome::Words(words, _) = poller.read(&group(start)).unwrap() {
            assert_eq!(words, [start, start + 1], "poll {index}");
            answers += 1;
        }
    }
    (answers, poller.counts())
}

#[test]
fn delays_around_the_timeout_put_no_value_under_anothers_name() {
    for echoes in [true, false] {
        let mut dice = fastrand::Rng::with_seed(3);
        let slave = Slave::new(echoes, move |bytes| (Duration::from_micros(dice.u64(100..26_000)), vec![bytes]));
        let (answers, counts) = poll(Poller::new(slave, UNIT, TIMEOUT), 250);
        assert_eq!(answers, counts.answers);
        assert!(counts.late > 10 && answers > 60, "echoes {echoes}: {counts:?}");
    }
}

/// The second answer comes before that to the next request, as with a gateway that asks again.
#[test]
fn answers_that_come_twice_put_no_value_under_anothers_name() {
    for (echoes, slowest_us) in [(true, 2000), (false, 2000), (true, 26_000), (false, 26_000)] {
        let mut dice = fastrand::Rng::with_seed(7);
        let slave = Slave::new(echoes, move |bytes| {
            let copies = if dice.f64() < 0.2 { 2 } else { 1 };
            (Duration::from_micros(dice.u64(100..slowest_us)), vec![bytes; copies])
        });
        let (answers, counts) = poll(Poller::new(slave, UNIT, TIMEOUT), 250);
        assert!(counts.late > 10 && answers > 30, "echoes {echoes}, {slowest_us} µs: {counts:?}");
    }
}

/// Nothing that comes again would fit the next request: no echo is needed between the two.
#[test]
fn requests_of_unlike_length_are_asked_for_one_behind_the_other() {
    let (seen, echoes) = channel();
    let slave = Slave::new(true, move |bytes| {
        seen.send(bytes[1] == 8).unwrap();
        (Duration::ZERO, vec![bytes])
    });
    let mut poller = Poller::new(slave, UNIT, Duration::from_secs(5));
    for index in 0..20 {
        let group = Group { count: 1 + index % 2, ..group(100 * (index % 2)) };
        assert!(matches!(poller.read(&group).unwrap(), Outcome::Words(..)));
    }
    assert_eq!(echoes.try_iter().filter(|&echo| echo).count(), 1, "the one that brought the line into step");
    for index in 0..20 {
        assert!(matches!(poller.read(&group(100 * (index % 2))).unwrap(), Outcome::Words(..)));
    }
    assert_eq!(echoes.try_iter().filter(|&echo| echo).count(), 20, "one before each: the last above was as long");
}

#[test]
fn noise_and_wrong_check_sums_are_counted_and_give_no_value() {
    let mut dice = fastrand::Rng::with_seed(5);
    let slave = Slave::new(true, move |mut bytes| {
        if dice.f64() < 0.2 {
            let at = dice.usize(..bytes.len());
            bytes[at] ^= 1 << dice.u8(..8);
        } else if dice.f64() < 0.1 {
            bytes.truncate(dice.usize(..bytes.len()));
        }
        (Duration::ZERO, vec![bytes])
    });
    let (answers, counts) = poll(Poller::new(slave, UNIT, TIMEOUT), 200);
    assert!(counts.bad > 10 && answers > 80, "{counts:?}");
    assert_eq!(counts.answers + counts.missed, 200);
}

#[test]
fn a_slave_that_was_away_is_read_again() {
    let mut asked = 0;
    let slave = Slave::new(true, move |bytes| {
        asked += 1;
        (Duration::ZERO, if (20..30).contains(&asked) { vec![] } else { vec![bytes] })
    });
    let (answers, counts) = poll(Poller::new(slave, UNIT, TIMEOUT), 60);
    assert!(answers >= 35 && counts.missed >= 9 && counts.unproven == 0, "{counts:?}");
}

/// A slave that ignores what it does not know is read again when it has been silent for long.
#[test]
fn a_slave_that_does_not_even_refuse_an_echo_is_read_all_the_same() {
    let slave = Slave::new(true, |bytes| (Duration::ZERO, if bytes[1] == 8 { vec![] } else { vec![bytes] }));
    // a time-out that a loaded machine keeps, too
    let (answers, counts) = poll(Poller::new(slave, UNIT, 10 * TIMEOUT), 40);
    assert!(answers >= 25 && counts.unproven == 1, "{counts:?}");
}

#[test]
fn a_time_is_the_middle_between_request_and_answer() {
    let slave = Slave::new(true, |bytes| (Duration::from_millis(8), vec![bytes]));
    let mut poller = Poller::new(slave, UNIT, Duration::from_secs(5));
    while !poller.in_step {
        poller.read(&group(0)).unwrap();
    }
    let before = Instant::now();
    let Outcome::Words(_, at) = poller.read(&group(0)).unwrap() else { panic!("no answer") };
    let (since, took) = (at.duration_since(before).as_secs_f64(), before.elapsed().as_secs_f64());
    assert!((since - took / 2.0).abs() < 0.25 * took, "{since} s of {took} s");
}
