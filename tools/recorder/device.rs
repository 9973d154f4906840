//! The device alone, for a recorder that somebody else starts; and the check of what was recorded of it.

use std::io;
use std::path::Path;
use std::time::Duration;

use surgescope::record::devices::simulated::{Faults, Script, SimulatedDevice};
use surgescope::record::session::live_test::live_devices;

use crate::{Measured, ramp};

/// Writes a rig file with the device's port, waits for a line on standard input, and plays.
pub fn play(rate_hz: f64, seconds: f64, rig_file: &str) -> Measured {
    let (rig, playback) = (ramp::rig()?, ramp::playback(rate_hz, seconds));
    let script = Script::new(&playback, &rig, &live_devices(&rig, &[])?[0])?;
    let mut line = SimulatedDevice::open()?;
    std::fs::write(rig_file, ramp::rig_text().replace("/dev/none", &line.path().to_string_lossy()))?;
    println!("ready");
    io::stdin().read_line(&mut String::new())?;
    line.start(script, 1.0, Faults::default())?;
    std::thread::sleep(Duration::from_secs_f64(seconds));
    line.stop()?;
    Ok(())
}

/// Says how many samples of each channel a file holds, every one as it was sent.
pub fn check(rate_hz: f64, file: &str) -> Measured {
    println!("{}", ramp::check_file(Path::new(file), (1e9 / rate_hz) as u32)?);
    Ok(())
}
