//! Messages must neither keep the work from beginning nor the program from ending: a terminal that was stopped
//! (Ctrl-S), or a pipe that nobody reads, would block it for ever.

use std::process::exit;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::Duration;

use crate::cli::console::print::tell;

/// How long words wait for their reader once the program was asked to end.
const PATIENCE: Duration = Duration::from_secs(2);
/// How often it is looked whether it was.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// How long the work waits for the messages before it.
const FIRST_WORDS: Duration = Duration::from_millis(500);

/// While this is held, the program ends with exit code `code` when `stop` is set and what is being written does not go
/// on.
pub(crate) struct LastWords {
    /// Dropped with this: the message is written.
    _said: Sender<()>,
}

impl LastWords {
    /// From now on.
    pub(crate) fn before(code: u8, stop: &'static AtomicBool) -> LastWords {
        let (said, wait) = channel::<()>();
        let look = move || {
            let mut waited = Duration::ZERO;
            while wait.recv_timeout(LOOK_EVERY) == Err(RecvTimeoutError::Timeout) {
                if stop.load(Ordering::Relaxed) {
                    waited += LOOK_EVERY;
                }
                if waited >= PATIENCE {
                    exit(code.into());
                }
            }
        };
        // without a thread the words may have to wait
        let _ = thread::Builder::new().name("last words".into()).spawn(look);
        LastWords { _said: said }
    }
}

/// Tells lines before work that must not wait for their reader: where they cannot be told soon, a thread of its own
/// goes on trying.
pub(crate) fn tell_first(lines: Vec<String>) {
    let (said, wait) = channel::<()>();
    let tell = move || {
        lines.iter().for_each(|line| tell!("{line}"));
        drop(said);
    };
    if thread::Builder::new().name("first words".into()).spawn(tell).is_ok() {
        let _ = wait.recv_timeout(FIRST_WORDS);
    }
}
