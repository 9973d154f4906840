//! The live view on a real terminal: it stays within it, leaves it clean, and never holds up the recording.
#![cfg(target_os = "linux")]

use std::fs::File;
use std::io::{Read, Write as _};
use std::os::fd::OwnedFd;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use nix::fcntl::{FcntlArg, OFlag, fcntl};
use nix::pty::{Winsize, openpty};
use nix::sys::termios::{FlowArg, SetArg, cfmakeraw, tcflow, tcgetattr, tcsetattr};
use nix::unistd::ttyname;
use surgescope::storage as log;
use tempfile::TempDir;

use crate::common::{here, surgescope, text};

const COLUMNS: u16 = 44;

/// `record` of a simulated test, with its standard error on a terminal of 44 columns and 18 lines.
fn recording(folder: &TempDir, no_color: bool, more: &[&str]) -> (Child, OwnedFd, OwnedFd, PathBuf) {
    let size = Winsize { ws_row: 18, ws_col: COLUMNS, ws_xpixel: 0, ws_ypixel: 0 };
    let pty = openpty(&size, None).unwrap();
    let file = folder.path().join("run.mcap");
    let mut command = surgescope(["record", "--simulate", "--rig", "rigs/demo-hdpe.toml", "-o"]);
    command.arg(&file).args(more);
    command.env_remove("NO_COLOR").env("TERM", "xterm-256color");
    if no_color {
        command.env("NO_COLOR", "1");
    }
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(pty.slave.try_clone().unwrap());
    (command.spawn().unwrap(), pty.master, pty.slave, file)
}

/// Everything that was drawn.
fn drawn(master: OwnedFd, slave: OwnedFd) -> String {
    // the last other end: when the program is gone, reading ends
    drop(slave);
    let mut bytes = Vec::new();
    let mut master = File::from(master);
    let mut buffer = [0; 4096];
    while let Ok(length) = master.read(&mut buffer) {
        if length == 0 {
            break;
        }
        bytes.extend_from_slice(&buffer[..length]);
    }
    String::from_utf8(bytes).unwrap()
}

#[test]
fn it_is_drawn_within_the_terminal_and_taken_away_by_ctrl_c() {
    let folder = TempDir::new().unwrap();
    let faults = ["--duration", "30", "--faults", "drop=0.03,seed=2"];
    let (mut program, master, slave, file) = recording(&folder, true, &faults);
    std::thread::sleep(Duration::from_secs(4));
    assert!(Command::new("kill").args(["-INT", &program.id().to_string()]).status().unwrap().success());
    let text = drawn(master, slave);
    assert_eq!(program.wait().unwrap().code(), Some(3), "{text}");
    assert!(log::read(&file).unwrap().series[0].value.len() > 1000);
    let frames: Vec<&str> = text.split("\x1b[0J").collect();
    assert!(frames.len() > 8, "drawn a few times a second: {text:?}");
    for line in frames[..frames.len() - 1].iter().flat_map(|frame| frame.split("\r\n")) {
        let plain = console::strip_ansi_codes(line);
        assert!(console::measure_text_width(&plain) < usize::from(COLUMNS), "{plain:?}");
    }
    let busy = frames[frames.len() - 3];
    assert!(busy.contains("last 10 s") && busy.contains("P3") && busy.contains("lost"), "{busy}");
    assert!(busy.contains('▁'), "{busy}");
    // no colour and no hidden cursor, and the block is gone before the last word
    assert!(!text.contains("\x1b[3") && !text.contains("\x1b[2m") && !text.contains("\x1b[?25l"), "{text:?}");
    let last = frames[frames.len() - 1];
    assert!(last.contains("stopped by the user") && !last.contains("last 10 s"), "{last}");
}

#[test]
fn a_terminal_that_has_stopped_does_not_hold_up_the_recording() {
    let folder = TempDir::new().unwrap();
    let (mut program, master, slave, file) = recording(&folder, false, &["--duration", "3"]);
    // as Ctrl-S does
    tcflow(&slave, FlowArg::TCOOFF).unwrap();
    let started = Instant::now();
    let recorded = loop {
        match log::read(&file) {
            Ok(recording) => break recording,
            Err(error) => assert!(started.elapsed() < Duration::from_secs(30), "{error}"),
        }
        std::thread::sleep(Duration::from_millis(100));
    };
    assert_eq!(recorded.series[0].value.len(), 3000, "every sample, in a finished file");
    tcflow(&slave, FlowArg::TCOON).unwrap();
    let text = drawn(master, slave);
    assert!(text.contains("the duration was reached"), "{text}");
    assert_eq!(program.wait().unwrap().code(), Some(0), "{text}");
}

#[test]
fn a_stopped_terminal_does_not_keep_the_program_from_ending() {
    let folder = TempDir::new().unwrap();
    let (mut program, master, slave, file) = recording(&folder, true, &["--duration", "60"]);
    std::thread::sleep(Duration::from_secs(2));
    tcflow(&slave, FlowArg::TCOOFF).unwrap();
    std::thread::sleep(Duration::from_millis(500));
    assert!(Command::new("kill").args(["-TERM", &program.id().to_string()]).status().unwrap().success());
    let asked = Instant::now();
    let status = loop {
        if let Some(status) = program.try_wait().unwrap() {
            break status;
        }
        if asked.elapsed() > Duration::from_secs(15) {
            program.kill().unwrap();
            panic!("it does not end");
        }
        std::thread::sleep(Duration::from_millis(50));
    };
    assert_eq!(status.code(), Some(0));
    assert!(log::read(&file).unwrap().series[0].value.len() > 1000);
    drop((master, slave));
}

/// A log collector that hangs is no reason to miss the test: the program prints "listening to …" before it records
/// anything.
#[test]
fn a_reader_that_reads_nothing_from_the_beginning_does_not_hold_up_the_recording() {
    let folder = TempDir::new().unwrap();
    let (rig, file) = (folder.path().join("rig.toml"), folder.path().join("run.mcap"));
    let text = std::fs::read_to_string(here("rigs/demo-hdpe.toml")).unwrap();
    let head = text.split("[[sensor]]").next().unwrap();
    let sensor = "name = \"P1\"\nkind = \"pressure\"\nposition_m = 1.0\nunit = \"kPa\"\ndevice = \"log\"\nchannel = 0\nscale = 1.0\noffset = 0.0\n";
    let device = "name = \"log\"\nport = \"/dev/null\"\nbaud = 115200\nprotocol = \"lines\"\n";
    std::fs::write(&rig, format!("{head}[[sensor]]\n{sensor}[[device]]\n{device}")).unwrap();
    let pty = openpty(None, None).unwrap();
    let mut raw = tcgetattr(&pty.slave).unwrap();
    cfmakeraw(&mut raw);
    tcsetattr(&pty.slave, SetArg::TCSANOW, &raw).unwrap();
    let (reader, mut writer) = std::io::pipe().unwrap();
    fcntl(&writer, FcntlArg::F_SETFL(OFlag::O_NONBLOCK)).unwrap();
    while writer.write(&[b'x'; 512]).is_ok() {}
    while writer.write(b"x").is_ok() {}
    fcntl(&writer, FcntlArg::F_SETFL(OFlag::empty())).unwrap();
    let mut command = surgescope(["record", "--duration", "0.2", "--rig"]);
    command.arg(&rig).arg("-o").arg(&file);
    command.arg("--port").arg(format!("log={}", ttyname(&pty.slave).unwrap().display()));
    let mut program = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(writer).spawn().unwrap();
    let (started, mut master) = (Instant::now(), File::from(pty.master));
    let mut sent = 0;
    let recorded = (0..).find_map(|index| {
        std::thread::sleep(Duration::from_millis(1));
        // the device keeps its time, however late this thread wakes
        while sent < started.elapsed().as_millis().min(1000) {
            // after the duration nobody takes them any more
            let _ = master.write_all(format!("{},{sent}\n", 1000 * sent).as_bytes());
            sent += 1;
        }
        let late = started.elapsed() > Duration::from_secs(30);
        if index % 50 == 0 || late { log::read(&file).map(Some).ok().or(late.then_some(None)) } else { None }
    });
    program.kill().unwrap();
    program.wait().unwrap();
    let series = &recorded.flatten().expect("nothing was recorded within 30 s").series;
    assert!((199..=201).contains(&series[0].value.len()), "{} samples", series[0].value.len());
    drop((reader, pty.slave));
}

#[test]
fn a_terminal_that_has_hung_up_does_not_spoil_a_whole_recording() {
    let folder = TempDir::new().unwrap();
    let pty = openpty(None, None).unwrap();
    let file = folder.path().join("run.mcap");
    let mut command =
        surgescope(["record", "--simulate", "--duration", "2", "--rig", "rigs/demo-hdpe.toml", "-o", text(&file)]);
    let (out, err) = (pty.slave.try_clone().unwrap(), pty.slave);
    let mut program = command.stdin(Stdio::null()).stdout(out).stderr(err).spawn().unwrap();
    drop((command, pty.master));
    assert_eq!(program.wait().unwrap().code(), Some(0));
    assert!(log::read(&file).unwrap().series[0].value.len() > 1000);
}
