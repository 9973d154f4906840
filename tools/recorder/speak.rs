//! A device that is a process or behind a socket: frames of the ramp at their pace, on standard output or to who
//! connects.

use std::io::{self, Write};
use std::net::TcpListener;
use std::path::Path;
use std::thread;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use surgescope::record::clock::pace::Pace;

use crate::{Measured, ramp, usage};

/// How the device reaches the recorder.
#[derive(Clone, Copy, PartialEq)]
pub enum Way {
    Command,
    Socket,
}

impl std::str::FromStr for Way {
    type Err = String;

    fn from_str(word: &str) -> Result<Way, String> {
        match word {
            "command" => Ok(Way::Command),
            "tcp" => Ok(Way::Socket),
            _ => Err(format!("'{word}' is no way to the recorder: command or tcp")),
        }
    }
}

/// The rig file in a folder, and the device, which begins as soon as the recorder listens. When its first sample was
/// taken stands in the file `started` of that folder then.
pub fn device(way: Way, rate_hz: f64, seconds: f64, folder: &Path) -> io::Result<()> {
    let started = folder.join("started");
    let source = match way {
        Way::Command => {
            let program = std::env::current_exe()?;
            format!("command = [{program:?}, \"speak\", \"{rate_hz}\", \"{seconds}\", {started:?}]")
        }
        Way::Socket => {
            let listener = TcpListener::bind("127.0.0.1:0")?;
            let address = listener.local_addr()?;
            thread::spawn(move || {
                let (mut stream, _) = listener.accept()?;
                play(&mut stream, rate_hz, seconds, &started)
            });
            format!("port = \"tcp://{address}\"")
        }
    };
    let serial = "port = \"/dev/none\"\nbaud = 921600";
    std::fs::write(folder.join("rig.toml"), ramp::rig_text().replace(serial, &source))
}

/// Says everything on standard output, and on standard error what that took. It dies at the end where it is to `die`.
pub fn run(rate_hz: f64, seconds: f64, started: &str, die: bool) -> Measured {
    play(&mut io::stdout().lock(), rate_hz, seconds, Path::new(started))?;
    eprintln!("{:.2} s of CPU", usage::own_cpu_s());
    if die { Err("dies as it was told to".into()) } else { Ok(()) }
}

fn play(to: &mut dyn Write, rate_hz: f64, seconds: f64, started: &Path) -> io::Result<()> {
    let (period_ns, samples) = (ramp::period_ns(rate_hz), ramp::samples_a_frame(rate_hz));
    // each life of a device that dies adds a line
    let mut lives = std::fs::OpenOptions::new().create(true).append(true).open(started)?;
    let pace = Pace::start(1.0);
    writeln!(lives, "{}", unix_s(SystemTime::now()))?;
    for index in 0..(seconds * rate_hz) as i64 / samples {
        let frame =
            ramp::frame(index, samples, period_ns).ok_or_else(|| io::Error::other("a frame too long for the wire"))?;
        pace.wait_until((index + 1) * samples * i64::from(period_ns), || true);
        to.write_all(&frame.encode())?;
        to.flush()?;
    }
    Ok(())
}

/// A time of day, s since 1970.
pub fn unix_s(time: SystemTime) -> f64 {
    time.duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64())
}

/// When the first sample of each life was taken, s since 1970, once there is one.
pub fn lives(folder: &Path) -> Result<Vec<f64>, String> {
    for _ in 0..2000 {
        let text = std::fs::read_to_string(folder.join("started")).unwrap_or_default();
        if text.ends_with('\n') {
            return text.lines().map(|line| line.parse().map_err(|_| format!("'{line}' is no time"))).collect();
        }
        thread::sleep(Duration::from_millis(10));
    }
    Err("the device did not start".into())
}
