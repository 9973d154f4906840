//! kill -9 at random moments: every file recovers, no sample is wrong, and how much is gone.

use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use surgescope::record::devices::simulated::{Faults, Script, SimulatedDevice};
use surgescope::record::session::live_test::live_devices;
use surgescope::storage::{read, recover};

use crate::{Measured, ramp};

const RATE_HZ: f64 = 2000.0;

/// Kills a recorder so many times.
pub fn run(count: usize, program: &str) -> Measured {
    let (rig, playback) = (ramp::rig()?, ramp::playback(RATE_HZ, 30.0));
    let device = live_devices(&rig, &[])?.remove(0);
    let script = Script::new(&playback, &rig, &device)?;
    let mut dice = fastrand::Rng::with_seed(17);
    let mut losses_ms = Vec::new();
    for index in 0..count {
        let folder = tempfile::tempdir()?;
        let (rig_file, file) = (folder.path().join("rig.toml"), folder.path().join("run.mcap"));
        std::fs::write(&rig_file, ramp::rig_text())?;
        let mut line = SimulatedDevice::open()?;
        let port = format!("daq={}", line.path().display());
        let mut recorder = Command::new(program);
        recorder.args(["record", "--port", &port, "--rig"]).arg(&rig_file).arg("-o").arg(&file);
        let mut recorder = recorder.stdout(Stdio::null()).stderr(Stdio::null()).spawn()?;
        // The device starts when the port is open; its first sample is taken now.
        thread::sleep(Duration::from_millis(300));
        line.start(script.clone(), 1.0, Faults::default())?;
        let started = Instant::now();
        while !file.exists() {
            if started.elapsed() > Duration::from_secs(20) {
                return Err("the recorder made no file".into());
            }
            thread::sleep(Duration::from_millis(1));
        }
        thread::sleep(Duration::from_micros(dice.u64(50_000..1_500_000)));
        let played_s = started.elapsed().as_secs_f64();
        recorder.kill()?;
        recorder.wait()?;
        line.stop()?;
        let whole = folder.path().join("whole.mcap");
        recover(&file, &whole).map_err(|error| format!("kill {index}: {error}"))?;
        let samples =
            ramp::check(&read(&whole)?, playback.sample_period_ns, 20).map_err(|why| format!("kill {index}: {why}"))?;
        losses_ms.push(1e3 * (played_s - samples as f64 / RATE_HZ));
    }
    losses_ms.sort_by(f64::total_cmp);
    let at = |share: f64| losses_ms[((losses_ms.len() - 1) as f64 * share) as usize];
    println!(
        "{count} kills: every file recovered, no sample wrong. Gone before the kill, with the 10 ms of a frame: median {:.1} ms, 95% {:.1} ms, \
         worst {:.1} ms",
        at(0.5),
        at(0.95),
        at(1.0)
    );
    let beyond = losses_ms.iter().filter(|loss| **loss > 50.0).count();
    if beyond == 0 { Ok(()) } else { Err(format!("{beyond} of {count} lost more than 50 ms").into()) }
}
