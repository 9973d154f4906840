//! kill -9 at random moments: every file recovers, no sample is wrong, and how much is gone.

use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant, SystemTime};

use surgescope::record::devices::simulated::{Faults, Script, SimulatedDevice};
use surgescope::record::session::live_test::live_devices;
use surgescope::storage::{read, recover};

use crate::speak::{self, Way};
use crate::{Measured, ramp};

const RATE_HZ: f64 = 2000.0;

/// Kills a recorder so many times: of a device on a pseudo-terminal, or of one that comes another way.
pub fn run(count: usize, program: &str, way: Option<Way>) -> Measured {
    let (rig, playback) = (ramp::rig()?, ramp::playback(RATE_HZ, 30.0));
    let device = live_devices(&rig, &[])?.remove(0);
    let script = Script::new(&playback, &rig, &device)?;
    let mut dice = fastrand::Rng::with_seed(17);
    let mut losses_ms = Vec::new();
    for index in 0..count {
        let folder = tempfile::tempdir()?;
        let file = folder.path().join("run.mcap");
        let mut recorder = Command::new(program);
        recorder.args(["record", "--rig"]).arg(folder.path().join("rig.toml")).arg("-o").arg(&file);
        recorder.stdout(Stdio::null()).stderr(Stdio::null());
        let mut line = SimulatedDevice::open()?;
        let mut recorder = match way {
            Some(way) => {
                speak::device(way, RATE_HZ, 30.0, folder.path())?;
                recorder.spawn()?
            }
            None => {
                std::fs::write(folder.path().join("rig.toml"), ramp::rig_text())?;
                let recorder = recorder.arg("--port").arg(format!("daq={}", line.path().display())).spawn()?;
                // The device starts when the port is open; its first sample is taken now.
                thread::sleep(Duration::from_millis(300));
                line.start(script.clone(), 1.0, Faults::default())?;
                recorder
            }
        };
        let started = Instant::now();
        while !file.exists() {
            if started.elapsed() > Duration::from_secs(20) {
                return Err("the recorder made no file".into());
            }
            thread::sleep(Duration::from_millis(1));
        }
        thread::sleep(Duration::from_micros(dice.u64(50_000..1_500_000)));
        let played_s = match way {
            Some(_) => speak::unix_s(SystemTime::now()) - speak::lives(folder.path())?[0],
            None => started.elapsed().as_secs_f64(),
        };
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
