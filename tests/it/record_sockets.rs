//! What someone relies on whose device is behind a socket: the same as of a serial line, and that a lost connection is
//! taken up again.
#![cfg(unix)]

use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command, Output, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use surgescope::record::devices::simulated::{Faults, Script, SimulatedDevice};
use surgescope::record::session::live_test::live_devices;
use surgescope::record::wire::frames::Frame;
use surgescope::rig::Rig;
use surgescope::storage as log;

use crate::common::surgescope;
use crate::record_commands::Bench;
use crate::record_live::{SCALES, check, device, playback, rig};

fn listening() -> (TcpListener, String) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("tcp://{}", listener.local_addr().unwrap());
    (listener, address)
}

fn recorder(bench: &Bench, more: &[&str]) -> Child {
    let mut command = surgescope(["record", "--json", "--rig"]);
    command.arg(&bench.rig).arg("-o").arg(&bench.file).args(more);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

fn json(output: &Output) -> serde_json::Value {
    let text = String::from_utf8_lossy(&output.stdout);
    serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}\n{}", String::from_utf8_lossy(&output.stderr)))
}

/// Hands on what a simulated device sends to who connects, until it hangs up.
fn relay(line: &SimulatedDevice, mut to: TcpStream) {
    let mut terminal = std::fs::File::open(line.path()).unwrap();
    thread::spawn(move || {
        let mut buffer = [0; 4096];
        while let Ok(length) = terminal.read(&mut buffer) {
            if length == 0 || to.write_all(&buffer[..length]).is_err() {
                return;
            }
        }
    });
}

#[test]
fn a_socket_is_recorded_as_a_serial_line_is() {
    for (speed, seconds, faults) in [
        (4.0, 2.0, Faults::default()),
        (
            0.0,
            20.0,
            Faults {
                flip: 0.01,
                drop: 0.02,
                duplicate: 0.01,
                noise: 0.01,
                cut: 0.01,
                crc: 0.01,
                seed: 4,
                ..Faults::default()
            },
        ),
    ] {
        let (listener, address) = listening();
        let bench = Bench::new("frames", &format!("port = \"{address}\""));
        let child = recorder(&bench, &["--wait", "0"]);
        let (stream, _) = listener.accept().unwrap();
        let played = playback(seconds);
        let mut line = SimulatedDevice::open().unwrap();
        relay(&line, stream);
        line.start(Script::new(&played, &rig(), &device()).unwrap(), speed, faults).unwrap();
        let output = child.wait_with_output().unwrap();
        let sent = line.stop().unwrap();
        let samples = check(&log::read(&bench.file).unwrap(), &played);
        let summary = json(&output);
        assert_eq!(summary["ended"], "the device closed the connection");
        if sent.harmed() == 0 {
            assert_eq!((samples, output.status.code()), (vec![4000; 3], Some(0)));
        } else {
            assert!(sent.flipped > 5 && sent.dropped > 15, "too few faults to test: {sent:?}");
            assert_eq!(output.status.code(), Some(3));
        }
    }
}

/// A frame of ten samples at 1 kHz that say their own time, ms since the device began.
fn frame(sequence: u16, first_ms: u64) -> Vec<u8> {
    let counts = (0..10).flat_map(|i| [(first_ms + i) as i16; 3]).collect();
    Frame::new(sequence, 1000 * first_ms, 1_000_000, 3, counts).unwrap().encode()
}

/// Sends frames in real time from a number on.
fn send(stream: &mut TcpStream, began: Instant, numbers: std::ops::Range<u64>) {
    for number in numbers {
        thread::sleep(Duration::from_millis(10 * (number + 1)).saturating_sub(began.elapsed()));
        stream.write_all(&frame(number as u16, 10 * number)).unwrap();
    }
}

/// A connection that is lost and comes back, the device's clock going on; then a device that has restarted.
#[test]
fn a_lost_connection_is_taken_up_again_and_the_hole_is_a_gap() {
    let (listener, address) = listening();
    let bench = Bench::new("frames", &format!("port = \"{address}\""));
    let child = recorder(&bench, &[]);
    let (mut stream, _) = listener.accept().unwrap();
    let began = Instant::now();
    send(&mut stream, began, 0..50);
    drop(stream);
    let (mut stream, _) = listener.accept().unwrap();
    let from = began.elapsed().as_millis() as u64 / 10;
    send(&mut stream, began, from..from + 50);
    drop(stream);
    let (mut stream, _) = listener.accept().unwrap();
    let anew = Instant::now();
    send(&mut stream, anew, 0..50);
    thread::sleep(Duration::from_millis(100));
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(3), "{}", String::from_utf8_lossy(&output.stderr));
    let device = &json(&output)["devices"][0];
    assert_eq!((device["reconnects"].as_u64(), device["restarts"].as_u64()), (Some(2), Some(1)), "{device}");
    let series = &log::read(&bench.file).unwrap().series[0];
    assert_eq!((series.value.len(), series.gaps.len()), (1500, 2));
    let (scale, offset) = SCALES[0];
    let restarted_s = (anew - began).as_secs_f64();
    for (at, (time_s, value)) in series.time_s.iter().zip(&series.value).enumerate() {
        let own_s = (value - offset) / scale / 1e3;
        let true_s = if at < 1000 { own_s } else { own_s + restarted_s };
        let most_s = if at < 1000 { 1e-9 } else { 0.1 };
        assert!((time_s - true_s).abs() < most_s, "sample {at}: {time_s} s for {true_s} s");
    }
}

#[test]
fn a_recorder_killed_at_any_moment_leaves_what_it_had_recorded() {
    let played = playback(60.0);
    let mut dice = fastrand::Rng::with_seed(13);
    for _ in 0..4 {
        let (listener, address) = listening();
        // the rig file names a serial port, the command line the socket
        let bench = Bench::new("frames", "port = \"/dev/ttyBENCH\"\nbaud = 921600");
        let mut child = recorder(&bench, &["--port", &format!("daq={address}")]);
        let (stream, _) = listener.accept().unwrap();
        let mut line = SimulatedDevice::open().unwrap();
        relay(&line, stream);
        let rig = Rig::load(&bench.rig).unwrap();
        line.start(Script::new(&played, &rig, &live_devices(&rig, &[]).unwrap()[0]).unwrap(), 1.0, Faults::default())
            .unwrap();
        let started = Instant::now();
        while !bench.file.exists() {
            assert!(started.elapsed() < Duration::from_secs(20), "the recorder made no file");
            thread::sleep(Duration::from_millis(10));
        }
        thread::sleep(Duration::from_micros(1_000_000 + dice.u64(..100_000)));
        child.kill().unwrap();
        child.wait().unwrap();
        let whole = bench.folder.path().join("whole.mcap");
        log::recover(&bench.file, &whole).unwrap();
        let samples = check(&log::read(&whole).unwrap(), &played);
        assert!(samples.iter().all(|&count| count >= 1000), "of a second were saved: {samples:?}");
    }
}

#[test]
fn a_socket_that_cannot_be_recorded_says_why() {
    let closed = listening().1;
    let (silent, silent_address) = listening();
    for (port, more, said) in [
        (closed.as_str(), &[][..], "nothing listens on that port"),
        ("tcp://no-such-host.invalid:5025", &[], "host 'no-such-host.invalid' of device 'daq' is not found"),
        (silent_address.as_str(), &["--silence", "1"], "does it send by itself to whoever connects"),
    ] {
        let bench = Bench::new("lines", &format!("port = \"{port}\""));
        let output = recorder(&bench, more).wait_with_output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{port}: {stderr}");
        assert!(stderr.contains(said) && !bench.file.exists(), "{port}: {stderr}");
    }
    drop(silent);
    // a device that is polled has no socket, and two devices share none
    let bench = Bench::new("lines", &format!("port = \"{closed}\""));
    let output = surgescope(["ports", "--json", "--rig"]).arg(&bench.rig).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(json(&output)["devices"][0]["port"], closed);
}
