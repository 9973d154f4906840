//! What is said when the work is done must not keep the program from ending: a terminal that was stopped (Ctrl-S), or a pipe that nobody
//! reads, would block it for ever.

use std::process::exit;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::Duration;

use super::Outcome;

/// How long words wait for their reader once the program was asked to end.
const PATIENCE: Duration = Duration::from_secs(2);
/// How often it is looked whether it was.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// While this is held, the program ends as `outcome` says when `stop` is set and what is being written does not go on.
pub(super) struct LastWords {
    /// Dropped with this: the words are said.
    _said: Sender<()>,
}

impl LastWords {
    /// From now on.
    pub(super) fn before(outcome: Outcome, stop: &'static AtomicBool) -> LastWords {
        let (said, wait) = channel::<()>();
        let look = move || {
            let mut waited = Duration::ZERO;
            while wait.recv_timeout(LOOK_EVERY) == Err(RecvTimeoutError::Timeout) {
                if stop.load(Ordering::Relaxed) {
                    waited += LOOK_EVERY;
                }
                if waited >= PATIENCE {
                    exit(outcome.code().into());
                }
            }
        };
        // without a thread the words may have to wait
        let _ = thread::Builder::new().name("last words".into()).spawn(look);
        LastWords { _said: said }
    }
}
