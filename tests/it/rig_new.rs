//! From a logger's file and a tape measure to a rig file that fits: `rig new`, `rig show`.

use std::path::Path;

use serde_json::Value;
use tempfile::TempDir;

use crate::common::{done, ended, surgescope, text};

/// Runs the program in a folder; its exit code, output and messages.
fn within(folder: &TempDir, arguments: &[&str]) -> (i32, String, String) {
    ended(surgescope(arguments).current_dir(folder.path()).output().unwrap())
}

fn must(folder: &TempDir, arguments: &[&str]) -> (String, String) {
    let (code, out, said) = within(folder, arguments);
    assert_eq!(code, 0, "{arguments:?}\n{out}\n{said}");
    (out, said)
}

const TAPE: [&str; 8] = ["--material", "copper", "--length-m", "100", "--pipe", "22x1.5", "--temperature-degC", "18"];

/// A logger's table of a simulated closure, with German headings and times in ms, in a folder. The sensors stand at 100
/// m and 40 m.
fn logged() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let sensors = [&TAPE[..], &["--sensor", "P1=100", "--sensor", "P2=40", "--yes", "-o", "true.toml"]].concat();
    must(&folder, &[&["rig", "new"], &sensors[..]].concat());
    must(
        &folder,
        &[
            "simulate",
            "--rig",
            "true.toml",
            "--set",
            "initial_velocity_m_s=0.4",
            "--set",
            "valve_head_m=70",
            "-o",
            "true.mcap",
        ],
    );
    must(&folder, &["export", "true.mcap", "-o", "true.csv"]);
    let plain = std::fs::read_to_string(folder.path().join("true.csv")).unwrap();
    let mut table = String::from("Messung 7\nNr;Zeit;Druck Ventil (bar);Druck Mitte (bar)\n");
    for (i, line) in plain.lines().skip(1).enumerate() {
        let cells: Vec<f64> = line.split(',').map(|c| c.parse().unwrap()).collect();
        table += &format!("{i};{:.2};{:.5};{:.5}\n", 1e3 * cells[0], cells[1], cells[2]).replace('.', ",");
    }
    std::fs::write(folder.path().join("log.csv"), table).unwrap();
    folder
}

#[test]
fn a_rig_from_a_loggers_file_imports_and_fits_it() {
    let folder = logged();
    let (out, said) = must(&folder, &[&["rig", "new", "log.csv", "--yes"], &TAPE[..]].concat());
    for words in ["assumed: Druck Mitte at ", "measure it", "import log.csv --rig rig.toml"] {
        assert!(said.contains(words), "no '{words}' in {said}");
    }
    assert!(
        out.contains("contradictions: 0") && out.contains("reservoir") && out.contains("Druck Ventil 100.0 m"),
        "{out}"
    );
    let file = std::fs::read_to_string(folder.path().join("rig.toml")).unwrap();
    assert!(file.contains("inner_diameter_mm = 19.0") && file.contains("# assumed: not given"), "{file}");
    let rig = surgescope::rig::Rig::from_toml(&file, "rig.toml").unwrap();
    let places: Vec<f64> = rig.pressure_sensors().map(|(_, s)| s.position_m).collect();
    assert!((places[0] - 100.0).abs() < 1e-9 && (places[1] - 40.0).abs() < 3.0, "{places:?}");
    must(&folder, &["import", "log.csv", "--rig", "rig.toml", "--yes", "-o", "run.mcap"]);
    assert!(
        within(&folder, &["rig", "check", "rig.toml", "log.csv"])
            .1
            .contains("wave from 'Druck Ventil' to 'Druck Mitte'")
    );
    let (fit, _) = must(&folder, &["calibrate", "run.mcap", "--json"]);
    let fit: serde_json::Value = serde_json::from_str(&fit).unwrap();
    let run = &fit["runs"][0];
    assert!(run["rmse_m"].as_f64().unwrap() < 1.1 * run["noise_m"].as_f64().unwrap(), "{run}");
    // Nothing is replaced.
    let (code, _, said) = within(&folder, &[&["rig", "new", "--yes"], &TAPE[..]].concat());
    assert!(code == 2 && said.contains("rig.toml exists already"), "{said}");
}

/// Volts under names that say nothing, and counted samples: what `import` needs to know, `rig new` takes as well.
#[test]
fn a_rig_from_volts_needs_their_line() {
    let folder = tempfile::tempdir().unwrap();
    let rows: String = (0..500)
        .map(|i| format!("{i},{:.4}\n", 1.0 + if i > 100 { (0.1 * f64::from(i)).sin() } else { 0.0 }))
        .collect();
    std::fs::write(folder.path().join("volts.csv"), format!("sample,AI0 (V)\n{rows}")).unwrap();
    let pipe = ["rig", "new", "volts.csv", "--yes", "--material", "PVC", "--length-m", "60", "--pipe", "50x2.4"];
    let (code, _, said) = within(&folder, &pipe);
    assert!(code == 2 && said.contains("--rate"), "{said}");
    let rated = [&pipe[..], &["--rate", "500"]].concat();
    let (code, _, said) = within(&folder, &rated);
    assert!(code == 2 && said.contains("--scale"), "{said}");
    let scaled = [&rated[..], &["--scale", "AI0=100*x-50", "--unit", "psig"]].concat();
    must(&folder, &scaled);
    let rig = surgescope::rig::Rig::load(&folder.path().join("rig.toml")).unwrap();
    assert_eq!((rig.sensors.len(), rig.sensors[0].unit.symbol), (1, "psi"));
    must(
        &folder,
        &[
            "import",
            "volts.csv",
            "--rig",
            "rig.toml",
            "--yes",
            "--rate",
            "500",
            "--scale",
            "AI0=100*x-50",
            "-o",
            "v.mcap",
        ],
    );
}

#[test]
fn what_is_missing_is_named_with_its_option() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("none.csv"), "Time (s),x,y\n0,1,2\n1,1,2\n2,1,2\n").unwrap();
    for (arguments, words) in [
        (&["rig", "new", "--yes"][..], "--material; known are HDPE"),
        (&["rig", "new", "--yes", "--material", "cheese"], "known are HDPE"),
        (&["rig", "new", "--yes", "--material", "PVC"], "--length-m"),
        (&["rig", "new", "--yes", "--material", "PVC", "--length-m", "10"], "--inner-diameter-mm (or --pipe)"),
        (&["rig", "new", "--yes", "--material", "PVC", "--length-m", "10", "--pipe", "7"], "63 SDR11"),
        (
            &["rig", "new", "none.csv", "--yes", "--material", "PVC", "--length-m", "10", "--pipe", "22x1"],
            "no column looks like a pressure",
        ),
        (&["rig", "new", "gone.csv", "--yes", "--material", "PVC", "--length-m", "10", "--pipe", "22x1"], "gone.csv"),
    ] {
        let (code, _, said) = within(&folder, arguments);
        assert!(code == 2 && said.contains(words) && !said.contains("panicked"), "{arguments:?}: {code} {said}");
        assert!(!folder.path().join("rig.toml").exists());
    }
}

/// A rig takes the names that import will give, and a name that the file lacks is a slip.
#[test]
fn names_are_those_of_the_options_and_slips_are_named() {
    let folder = logged();
    let new = [&["rig", "new", "log.csv", "--yes"], &TAPE[..]].concat();
    for (slip, words) in [
        (["--map", "Presure=P1"], "--map: there is no 'Presure'"),
        (["--ignore", "Nothing"], "--ignore: there is no 'Nothing'"),
        (["--scale", "Volt=2*x bar"], "--scale: there is no 'Volt'"),
    ] {
        let (code, _, said) = within(&folder, &[&new[..], &slip].concat());
        assert!(code == 2 && said.contains(words), "{said}");
        assert!(!folder.path().join("rig.toml").exists());
    }
    let heading = std::fs::read_to_string(folder.path().join("log.csv")).unwrap();
    let heading = heading.lines().find(|line| line.contains("bar")).unwrap().to_owned();
    let pressure = heading.split([',', ';', '\t']).find(|name| name.contains("bar")).unwrap().trim().to_owned();
    let map = format!("{pressure}=P7");
    let said = must(&folder, &[&new[..], &["--map", &map]].concat()).1;
    assert!(!said.contains("warning"), "{said}");
    let rig = surgescope::rig::Rig::load(&folder.path().join("rig.toml")).unwrap();
    assert!(rig.sensors.iter().any(|s| s.name == "P7"), "{:?}", rig.sensors);
    must(&folder, &["import", "log.csv", "--rig", "rig.toml", "--yes", "--map", &map, "-o", "run.mcap"]);
}

/// What a workbench cannot open is refused before a page is served.
#[test]
fn a_workbench_refuses_what_it_cannot_open() {
    let folder = logged();
    for (files, words) in [
        (&["gone.mcap"][..], "gone.mcap does not exist"),
        (&["gone.csv"], "gone.csv does not exist"),
        (&["true.toml", "true.mcap"], "not a mixture of them"),
        (&["log.csv", "true.mcap"], "not a mixture of them"),
        (&["log.csv", "more.csv"], "`surgescope import log.csv more.csv --rig rig.toml` joins them"),
    ] {
        let (code, _, said) = within(&folder, &[&["open", "--no-browser"], files].concat());
        assert!(code == 2 && said.contains(words), "{said}");
    }
}

#[test]
fn a_rig_is_drawn_to_scale() {
    let folder = tempfile::tempdir().unwrap();
    let svg = folder.path().join("rig.svg");
    let document = done(&["rig", "show", "rigs/adelaide-copper.toml", "--svg", text(&svg)]);
    assert_eq!(document["pressure_sensors"].as_array().unwrap().len(), 2);
    let drawn = std::fs::read_to_string(&svg).unwrap();
    // P2 stands in the middle of the pipe, which goes from x = 90 to 870.
    assert!(drawn.starts_with("<svg") && drawn.contains("cx=\"480.0\"") && drawn.contains("P2 18.6 m"), "{drawn}");
    let said = within(&folder, &["rig", "show", text(Path::new(&crate::common::here("rigs/demo-hdpe.toml")))]).1;
    let valve = said.lines().nth(1).unwrap().find('X').unwrap();
    assert!(said.contains("P3 54.2 m") && valve == 70, "{said}");
    // What branches off is drawn off the way: the sensor at the dead end stands above the tee, at x = 90 + 780 ·
    // 300/420.
    done(&["rig", "show", "rigs/branched.toml", "--svg", text(&svg)]);
    let drawn = std::fs::read_to_string(&svg).unwrap();
    assert!(drawn.contains("cx=\"647.1\" cy=\"150.0\"") && drawn.contains("P3 83.0 m on branch"), "{drawn}");
    let refused =
        within(&folder, &["rig", "show", text(&crate::common::here("rigs/demo-hdpe.toml")), "--svg", "rig.toml"]);
    assert!(refused.0 == 2 && refused.2.contains("must be named .svg"), "{}", refused.2);
}

/// A length in feet and a wall of another material are noticed when the rig is made.
#[test]
fn answers_that_the_record_contradicts_are_named() {
    let folder = logged();
    let asked = |material: &str, length: &str, file: &str| {
        let pipe = ["--material", material, "--length-m", length, "--pipe", "22x1.5"];
        must(&folder, &[&["rig", "new", "log.csv", "--yes", "-o", file], &pipe[..]].concat()).0
    };
    let said = asked("copper", "328.1", "feet.toml");
    assert!(said.contains("If its length is 328.1 feet, which are 100.00 m"), "{said}");
    let said = asked("HDPE", "100", "plastic.toml");
    assert!(said.contains("would fit if it were of") && said.contains("copper"), "{said}");
    assert!(asked("copper", "100", "right.toml").contains("warnings: 0"));
}

/// Milliamperes are no metres of water, and a logger's heading in Latin-1 is text.
#[test]
fn a_table_in_milliamperes_and_latin_1_needs_its_lines_only() {
    let folder = logged();
    let plain = std::fs::read_to_string(folder.path().join("true.csv")).unwrap();
    let mut table = "Messung im Prüfstand\nSecond,CH1 (mA),CH2 (mA)\n".to_owned();
    for line in plain.lines().skip(1) {
        let cells: Vec<f64> = line.split(',').map(|c| c.parse().unwrap()).collect();
        table += &format!("{:.5e},{:.5},{:.5}\n", cells[0], 4.0 + cells[1], 4.0 + cells[2]);
    }
    let latin_1: Vec<u8> = table.chars().map(|c| c as u8).collect();
    std::fs::write(folder.path().join("current.csv"), latin_1).unwrap();
    let new = [&["rig", "new", "current.csv", "--yes"], &TAPE[..]].concat();
    let (code, _, said) = within(&folder, &new);
    assert!(
        code == 2 && said.contains("no column looks like a pressure") && said.contains("'CH1 (mA)=1..5 -> 0..10 bar'"),
        "{said}"
    );
    let lines = ["--scale", "CH1 (mA)=x-4 bar", "--scale", "CH2 (mA)=x-4 bar"];
    let said = must(&folder, &[&new[..], &lines].concat()).1;
    assert!(!said.contains("warning"), "{said}");
    let said = must(&folder, &[&["import", "current.csv", "--rig", "rig.toml", "--yes"], &lines[..]].concat()).1;
    assert!(said.contains("read as windows-1252") && said.contains("next: surgescope open current.mcap"), "{said}");
}

#[test]
fn a_flow_measured_by_hand_is_known_to_the_fit() {
    let folder = logged();
    let area_m2 = std::f64::consts::FRAC_PI_4 * 0.019_f64.powi(2);
    let flow = format!("{:.4} L/s", 1e3 * area_m2 * 0.4);
    let (_, said) = must(&folder, &[&["rig", "new", "log.csv", "--flow", &flow, "--yes"], &TAPE[..]].concat());
    assert!(said.contains(&format!("--flow '{flow}'")), "{said}");
    let read = ["import", "log.csv", "--rig", "rig.toml", "--yes", "--flow"];
    let (out, said) = must(&folder, &[&read[..], &[&flow, "-o", "run.mcap"]].concat());
    assert!(out.contains("Q: 1 samples") && said.contains("measured by hand"), "{out}{said}");
    let seen: Value = serde_json::from_str(&must(&folder, &["inspect", "run.mcap", "--json"]).0).unwrap();
    let velocity = seen["steady_velocity_m_s"]["value"].as_f64().unwrap();
    assert!((velocity / 0.4 - 1.0).abs() < 1e-3, "{velocity}");
    // what a slip of the unit makes is named
    let (code, _, said) = within(&folder, &[&read[..], &["6.8 L/s", "-o", "wrong.mcap"]].concat());
    assert!(code == 2 && said.contains("the unit or the scale of the pressures or of the flow is wrong"), "{said}");
    let (code, _, said) = within(&folder, &[&read[..], &["0.1", "-o", "none.mcap"]].concat());
    assert!(code != 0 && said.contains("0.25 L/s"), "{said}");
    let known = [&["rig", "new", "log.csv", "--yes", "-o", "bare.toml"], &TAPE[..]].concat();
    must(&folder, &known);
    let onto = ["import", "log.csv", "--rig", "bare.toml", "--yes", "--flow", &flow, "-o", "none.mcap"];
    let (code, _, said) = within(&folder, &onto);
    assert!(code != 0 && said.contains("no flow sensor"), "{said}");
}

/// Types each answer once its question is there; everything that was shown.
#[cfg(unix)]
fn typed(command: &mut std::process::Command, answers: &[(&str, &str)]) -> (i32, String) {
    use std::fs::File;
    use std::io::{Read as _, Write as _};
    use std::os::fd::AsFd as _;

    use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
    let pty = nix::pty::openpty(None, None).unwrap();
    let mut child = command
        .stdin(pty.slave.try_clone().unwrap())
        .stderr(pty.slave)
        .stdout(std::process::Stdio::null())
        .spawn()
        .unwrap();
    // the command keeps copies of the terminal's end, which would never close
    command.stdin(std::process::Stdio::null()).stderr(std::process::Stdio::null());
    let mut screen = File::from(pty.master);
    let (mut shown, mut since, mut bytes) = (String::new(), 0, [0; 4096]);
    for (question, answer) in answers {
        while !shown[since..].contains(question) {
            let mut readable = [PollFd::new(screen.as_fd(), PollFlags::POLLIN)];
            let is_asked = poll(&mut readable, PollTimeout::from(60_000_u16)).unwrap() > 0;
            let n = if is_asked { screen.read(&mut bytes).unwrap_or(0) } else { 0 };
            assert!(n > 0, "'{question}' was not asked: {shown}");
            shown += &String::from_utf8_lossy(&bytes[..n]);
        }
        since = shown.len();
        write!(screen, "{answer}\r").unwrap();
    }
    // a terminal whose other end is closed is an error on Linux
    while let Ok(n) = screen.read(&mut bytes)
        && n > 0
    {
        shown += &String::from_utf8_lossy(&bytes[..n]);
    }
    (child.wait().unwrap().code().unwrap_or(-1), shown)
}

#[cfg(unix)]
#[test]
fn an_answer_can_be_taken_back() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = surgescope(["rig", "new"]);
    let (code, shown) = typed(
        command.current_dir(folder.path()),
        &[
            ("material of the wall", "steel"),
            ("length from the supply", "10"),
            ("size of the pipe", "<"),
            ("length from the supply", "<"),
            ("material of the wall", "copper"),
            ("length from the supply", ""),
            ("type a number in m", "79"),
            ("size of the pipe", "22x1.5"),
            ("what feeds the pipe", ""),
            ("temperature", "15"),
            ("closing time", "20 ms"),
            ("distance from the supply", "60"),
            ("Enter writes rig.toml", "<"),
            ("distance from the supply", "79"),
            ("Enter writes rig.toml", ""),
        ],
    );
    assert_eq!(code, 0, "{shown}");
    let rig = surgescope::rig::Rig::load(&folder.path().join("rig.toml")).unwrap();
    assert_eq!((rig.pipes[0].material.as_str(), rig.pipes[0].length_m), ("copper", 79.0));
    assert_eq!((rig.sensors[0].position_m, rig.fluid.temperature_degc), (79.0, 15.0));
}

/// Volts that nobody gave a line are no pressure; on a terminal they are asked for, each with its ranges.
#[cfg(unix)]
#[test]
fn a_column_in_volts_is_asked_for_its_ranges() {
    let folder = logged();
    let plain = std::fs::read_to_string(folder.path().join("true.csv")).unwrap();
    let mut table = "sample,ch0_V,ch1_V\n".to_owned();
    for (i, line) in plain.lines().skip(1).enumerate() {
        let cells: Vec<f64> = line.split(',').map(|c| c.parse().unwrap()).collect();
        table += &format!("{i},{:.5},{:.5}\n", 1.0 + 0.2 * cells[1], 1.0 + 0.2 * cells[2]);
    }
    std::fs::write(folder.path().join("volts.csv"), table).unwrap();
    let seconds: Vec<f64> =
        plain.lines().skip(1).take(2).map(|l| l.split(',').next().unwrap().parse().unwrap()).collect();
    let rate = format!("{:.0}", 1.0 / (seconds[1] - seconds[0]));
    let new = [&["rig", "new", "volts.csv", "-o", "volts.toml", "--rate", &rate], &TAPE[..]].concat();
    let (code, _, said) = within(&folder, &[&new[..], &["--yes", "--sensor", "ch0=100"]].concat());
    assert!(code == 2 && said.contains("1..5 -> 0..10 bar"), "{said}");
    let (code, shown) = typed(
        surgescope(&new).current_dir(folder.path()),
        &[
            ("ch0_V", "twice"),
            ("write it like", "1..5 -> 0..20 bar"),
            ("ch1_V", "1..5 -> 0..20 bar"),
            ("what feeds the pipe", ""),
            ("flow before the closure", ""),
            ("closing time", ""),
            ("distance from the supply", ""),
            ("distance from the supply", ""),
            ("Enter writes volts.toml", ""),
        ],
    );
    assert!(code == 0 && shown.contains("--scale 'ch0_V=5*x-5 bar'"), "{shown}");
    let rig = surgescope::rig::Rig::load(&folder.path().join("volts.toml")).unwrap();
    assert!((rig.sensors[0].position_m - 100.0).abs() < 1e-9 && (rig.sensors[1].position_m - 40.0).abs() < 3.0);
}

/// A pipe that is a quarter shorter than its file says: no effect is named for it.
#[test]
#[ignore = "takes 15 s; CI runs it at night"]
fn a_wave_faster_than_the_rig_allows_is_no_effect() {
    let folder = tempfile::tempdir().unwrap();
    let table = crate::common::here("recordings/logger.csv");
    let pipe = ["--material", "copper", "--length-m", "125", "--pipe", "22x1.5", "--temperature-degC", "18", "--yes"];
    must(&folder, &[&["rig", "new", text(&table)], &pipe[..]].concat());
    must(&folder, &["import", text(&table), "--rig", "rig.toml", "--yes", "-o", "run.mcap"]);
    let answer: Value = serde_json::from_str(&must(&folder, &["diagnose", "run.mcap", "--json"]).0).unwrap();
    assert_eq!(answer["verdict"], "unknown-effect", "{answer}");
    assert!(answer["pair"].is_null() && answer["warnings"].to_string().contains("no effect makes a wave faster"));
}

/// A network of EPANET becomes a rig that can be simulated; what the file does not say is asked for.
#[test]
fn a_network_of_epanet_becomes_a_rig() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(
        folder.path().join("net.inp"),
        "[JUNCTIONS]\n A 0 0\n B 0 18\n C 0 0\n D 0 36\n[RESERVOIRS]\n R 40\n[PIPES]\n p1 R A 300 200 110 0 Open\n p2 A B 120 150 110 0 Open\n\
         p3 C A 80 150 110 0 Open\n[VALVES]\n V C D 150 FCV 10\n[CONTROLS]\n LINK V CLOSED AT TIME 5\n[OPTIONS]\n Units CMH\n",
    )
    .unwrap();
    let walls = ["--material", "steel", "--wall-thickness-mm", "5"];
    let (code, _, said) = within(&folder, &["rig", "new", "net.inp", "-o", "net.toml"]);
    assert!(code == 2 && said.contains("net.inp: the file says nothing of the walls: add --material"), "{said}");
    let (code, _, said) =
        within(&folder, &[&["rig", "new", "net.inp", "--valve", "A", "-o", "net.toml"], &walls[..]].concat());
    assert!(code == 2 && said.contains("'A' is no valve or dead end: give --valve NAME"), "{said}");
    let made = within(&folder, &[&["rig", "new", "net.inp", "-o", "net.toml", "--json"], &walls[..]].concat());
    let document: serde_json::Value = serde_json::from_str(&made.1).unwrap();
    assert!(made.0 == 0 && document["left_out"] == serde_json::json!(["controls"]), "{}", made.2);
    let settings = ["--set", "initial_velocity_m_s=0.5", "valve_head_m=39", "--duration", "1", "-o", "net.csv"];
    let (code, _, said) = within(&folder, &[&["simulate", "--rig", "net.toml"], &settings[..]].concat());
    assert!(code == 0, "{said}");
    let heads = std::fs::read_to_string(folder.path().join("net.csv")).unwrap();
    assert!(heads.starts_with("time_s,P1\n") && heads.lines().count() > 5, "{heads}");
}
