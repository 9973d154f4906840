//! A device that dies many times: each death is a gap, and every sample stands where it was taken.

use std::process::{Command, Stdio};
use std::thread;
use std::time::Duration;

use surgescope::storage::read;

use crate::{Measured, ramp, speak};

const RATE_HZ: f64 = 20_000.0;
/// How long a life lasts, s.
const LIFE_S: f64 = 0.75;
/// A sample may stand so far from where it was taken, s: what a process needs to say something, on a busy machine.
const OFF_S: f64 = 0.02;

/// A command that dies so many times, at 3 x 20 kHz.
pub fn run(deaths: usize, program: &str) -> Measured {
    let folder = tempfile::tempdir()?;
    let (rig_file, file) = (folder.path().join("rig.toml"), folder.path().join("run.mcap"));
    speak::device(speak::Way::Command, RATE_HZ, LIFE_S, folder.path())?;
    let dies = std::fs::read_to_string(&rig_file)?.replace("\"speak\"", "\"die\"");
    std::fs::write(&rig_file, dies)?;
    let mut recorder = Command::new(program);
    recorder
        .args(["record", "--json", "--rig"])
        .arg(&rig_file)
        .arg("-o")
        .arg(&file)
        .stdout(Stdio::piped())
        .stderr(Stdio::null());
    let recorder = recorder.spawn()?;
    while speak::lives(folder.path())?.len() <= deaths {
        thread::sleep(Duration::from_millis(5));
    }
    // in the middle of the life after the last death
    thread::sleep(Duration::from_secs_f64(LIFE_S / 2.0));
    Command::new("kill").args(["-INT", &recorder.id().to_string()]).status()?;
    let output = recorder.wait_with_output()?;
    let lives = speak::lives(folder.path())?;
    let recording = read(&file)?;
    let start_s = recording.run.start_unix_ns as f64 / 1e9;
    let mut worst_s = 0f64;
    let mut samples = 0;
    for (channel, series) in recording.series.iter().enumerate() {
        let (mut life, mut index) = (0, 0);
        for (at, (time_s, value)) in series.time_s.iter().zip(&series.value).enumerate() {
            if at > 0 && series.gaps.iter().any(|gap| gap.to_s == *time_s && gap.from_s == series.time_s[at - 1]) {
                (life, index) = (life + 1, 0);
            }
            let began_s = lives.get(life).ok_or("more gaps than lives")?;
            worst_s = worst_s.max((start_s + time_s - began_s - index as f64 / RATE_HZ).abs());
            if *value != f64::from(ramp::count(channel, index)) || worst_s > OFF_S {
                return Err(format!(
                    "channel {channel}, life {life}, sample {index}: {value} at {time_s} s, {worst_s} s off"
                )
                .into());
            }
            index += 1;
        }
        if series.gaps.len() != deaths {
            return Err(format!("{deaths} deaths left {} gaps", series.gaps.len()).into());
        }
        samples = series.value.len();
    }
    let whole = deaths * (LIFE_S * RATE_HZ) as usize;
    println!(
        "{deaths} deaths of a command at {RATE_HZ} Hz x {}: {deaths} gaps, {samples} samples a channel ({whole} before the last death), all right, \
         at most {:.1} ms from where they were taken; exit code {:?}",
        ramp::CHANNELS,
        1e3 * worst_s,
        output.status.code()
    );
    if samples >= whole { Ok(()) } else { Err("samples are missing".into()) }
}
