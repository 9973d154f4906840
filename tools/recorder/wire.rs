//! Three channels, at their rate, for a while: nothing lost, nothing changed, and what it takes.

use std::io::{self, Read};
use std::process::{Command, Stdio};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use surgescope::record::clock::pace::Pace;
use surgescope::record::devices::simulated::{Faults, Script, SimulatedDevice};
use surgescope::record::devices::source::Sources;
use surgescope::record::session::live_test::{Options, live_devices, record};

use crate::speak::{self, Way};
use crate::{Measured, ramp, usage};

/// A simulated device in this process, the recorder in another; with its live view on a terminal, where it is to be
/// viewed.
pub fn over_a_pseudoterminal(rate_hz: f64, seconds: f64, program: &str, viewed: bool) -> Measured {
    let folder = tempfile::tempdir()?;
    let (rig_file, file) = (folder.path().join("rig.toml"), folder.path().join("run.mcap"));
    std::fs::write(&rig_file, ramp::rig_text())?;
    let (rig, playback) = (ramp::rig()?, ramp::playback(rate_hz, seconds));
    let device = live_devices(&rig, &[])?.remove(0);
    let script = Script::new(&playback, &rig, &device)?;
    let mut line = SimulatedDevice::open()?;
    let port = format!("daq={}", line.path().display());
    let mut recorder = Command::new(program);
    recorder.args(["record", "--json", "--wait", "0", "--port", &port, "--rig"]).arg(&rig_file).arg("-o").arg(&file);
    recorder.stdout(Stdio::piped()).stderr(Stdio::null());
    let screen = viewed.then(|| terminal(&mut recorder)).transpose()?;
    let child = recorder.spawn()?;
    // its copy of the terminal keeps the screen's reader waiting
    drop(recorder);
    let recorder = child;
    std::thread::sleep(Duration::from_millis(500));
    line.start(script, 1.0, Faults::default())?;
    let output = recorder.wait_with_output()?;
    let cpu_s = usage::children_cpu_s();
    line.stop()?;
    if let Some(screen) = screen {
        println!("{} bytes drawn", screen.join().unwrap_or(0));
    }
    let length = std::fs::metadata(&file)?.len();
    let samples = ramp::check_file(&file, playback.sample_period_ns)?;
    let sent = playback.sensors[0].1.len();
    println!(
        "{rate_hz} Hz x {} for {seconds} s: {samples} of {sent} samples a channel, all right; exit code {:?}; CPU {cpu_s:.2} s = {:.1}% of a core, \
         with finishing the file of {:.1} MB",
        ramp::CHANNELS,
        output.status.code(),
        100.0 * cpu_s / seconds,
        length as f64 / 1e6
    );
    println!("{}", String::from_utf8_lossy(&output.stdout).trim());
    if samples == sent { Ok(()) } else { Err("samples are missing".into()) }
}

/// A device that is a process, or behind a socket of this process; the recorder in another.
pub fn through(way: Way, rate_hz: f64, seconds: f64, program: &str) -> Measured {
    let folder = tempfile::tempdir()?;
    let (rig_file, file) = (folder.path().join("rig.toml"), folder.path().join("run.mcap"));
    speak::device(way, rate_hz, seconds, folder.path())?;
    let mut recorder = Command::new(program);
    recorder.args(["record", "--json", "--wait", "0", "--rig"]).arg(&rig_file).arg("-o").arg(&file);
    let output = recorder.stdout(Stdio::piped()).stderr(Stdio::null()).output()?;
    // a process that the recorder started counts with it
    let cpu_s = usage::children_cpu_s();
    let summary: serde_json::Value = serde_json::from_slice(&output.stdout)?;
    let samples = ramp::check_file(&file, ramp::period_ns(rate_hz))?;
    let sent = (seconds * rate_hz) as usize;
    println!(
        "{rate_hz} Hz x {} for {seconds} s: {samples} of {sent} samples a channel, all right; exit code {:?}; CPU {cpu_s:.2} s = {:.1}% of a core, \
         with finishing the file{}",
        ramp::CHANNELS,
        output.status.code(),
        100.0 * cpu_s / seconds,
        summary["devices"][0]["stderr"][0]
            .as_str()
            .map_or(String::new(), |own| format!(" and {own} of the device itself"))
    );
    if samples == sent { Ok(()) } else { Err("samples are missing".into()) }
}

/// Gives a program a terminal of 100 columns and 30 lines, which somebody reads; returns how much.
fn terminal(program: &mut Command) -> io::Result<std::thread::JoinHandle<usize>> {
    let size = nix::pty::Winsize { ws_row: 30, ws_col: 100, ws_xpixel: 0, ws_ypixel: 0 };
    let pty = nix::pty::openpty(&size, None)?;
    program.stderr(pty.slave).env("TERM", "xterm-256color");
    let mut master = std::fs::File::from(pty.master);
    Ok(std::thread::spawn(move || {
        let mut buffer = [0; 4096];
        std::iter::from_fn(|| master.read(&mut buffer).ok().filter(|length| *length > 0)).sum()
    }))
}

/// Frames made as they are read, at their pace.
struct Maker {
    period_ns: u32,
    samples: i64,
    frames: i64,
    index: i64,
    pace: Pace,
    pending: io::Cursor<Vec<u8>>,
}

impl Read for Maker {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.pending.position() == self.pending.get_ref().len() as u64 {
            if self.index == self.frames {
                return Ok(0);
            }
            let frame = ramp::frame(self.index, self.samples, self.period_ns);
            let frame = frame.ok_or_else(|| io::Error::other("a frame too long for the wire"))?;
            self.index += 1;
            self.pace.wait_until(self.index * self.samples * i64::from(self.period_ns), || true);
            self.pending = io::Cursor::new(frame.encode());
        }
        self.pending.read(buffer)
    }
}

/// Device and recorder in this process; the device's thread is counted apart.
pub fn in_this_process(rate_hz: f64, seconds: f64) -> Measured {
    for speed in [1.0, 0.0] {
        let folder = tempfile::tempdir()?;
        let file = folder.path().join("run.mcap");
        let rig = ramp::rig()?;
        let device = live_devices(&rig, &[])?.remove(0);
        let (period_ns, samples) = (ramp::period_ns(rate_hz), ramp::samples_a_frame(rate_hz));
        let frames = (seconds * rate_hz) as i64 / samples;
        let pace = Pace::start(speed);
        let maker = Maker { period_ns, samples, frames, index: 0, pace, pending: io::Cursor::default() };
        let options = Options::new(&file);
        let (cpu_0, made_0, started) = (usage::own_cpu_s(), usage::threads_cpu_s("port"), Instant::now());
        let sources = Sources::reading(&device, maker)?;
        let mut live_s = 0.0;
        let mut made_s = 0.0;
        let summary = record(&rig, &sources, &options, &AtomicBool::new(false), &mut |_| {
            live_s = started.elapsed().as_secs_f64();
            made_s = usage::threads_cpu_s("port") - made_0;
        })?;
        let (wall_s, cpu_s) = (started.elapsed().as_secs_f64(), usage::own_cpu_s() - cpu_0);
        let got = ramp::check_file(&file, period_ns)?;
        let values = got as f64 * ramp::CHANNELS as f64;
        println!(
            "{rate_hz} Hz x {}, {}: {got} of {} samples a channel, all right; {wall_s:.1} s with finishing, the last live report after {live_s:.1} s; \
             {:.1} MB/s of values; CPU {:.2} s without making frames = {:.1}% of a core; waits of the port's thread: {}",
            ramp::CHANNELS,
            if speed > 0.0 { "paced" } else { "as fast as it goes" },
            frames * samples,
            8.0 * values / wall_s / 1e6,
            cpu_s - made_s,
            100.0 * (cpu_s - made_s) / wall_s,
            summary.devices[0].queue_waits,
        );
        if got as i64 != frames * samples {
            return Err("samples are missing".into());
        }
    }
    Ok(())
}
