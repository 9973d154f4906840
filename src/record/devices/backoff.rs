//! How long to wait before a port that has vanished is opened again.

use std::time::Duration;

use crate::rig::Port;

/// The first wait, and every one for a path: looking whether it is there costs nothing.
const FIRST: Duration = Duration::from_millis(200);
/// The longest wait for what costs something to open: a socket, a process.
const LONGEST: Duration = Duration::from_secs(2);

/// Waits that double as long as opening is in vain, or brings nothing.
#[derive(Debug)]
pub struct Backoff {
    next: Duration,
    longest: Duration,
}

impl Backoff {
    /// For a port of this kind.
    pub fn of(port: &Port) -> Backoff {
        let longest = if matches!(port, Port::Serial(_)) { FIRST } else { LONGEST };
        Backoff { next: FIRST, longest }
    }

    /// The next wait.
    pub fn wait(&mut self) -> Duration {
        let wait = self.next;
        self.next = (2 * wait).min(self.longest);
        wait
    }

    /// Something came: the next wait is a short one.
    pub fn reset(&mut self) {
        self.next = FIRST;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::{Framing, Serial};

    #[test]
    fn waits_double_up_to_the_longest_until_something_comes() {
        let mut backoff = Backoff::of(&Port::Tcp("daq:1".into()));
        let waits = |backoff: &mut Backoff| [(); 6].map(|()| backoff.wait().as_millis());
        assert_eq!(waits(&mut backoff), [200, 400, 800, 1600, 2000, 2000]);
        backoff.reset();
        assert_eq!(waits(&mut backoff)[..2], [200, 400]);
        let serial = Serial { path: "/dev/ttyUSB0".into(), baud: 9600, framing: Framing::default() };
        assert_eq!(waits(&mut Backoff::of(&Port::Serial(serial))), [200; 6]);
    }
}
