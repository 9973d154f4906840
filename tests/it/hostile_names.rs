//! Names that control a terminal, or look like a line of the program: no command lets one through, on either stream, as
//! text or as JSON.

use std::fs;
use std::path::{Path, PathBuf};

use surgescope::storage::{read, write};
use tempfile::TempDir;

use crate::common::{CREEP, here, surgescope};

const FORGED: &str = "verdict: nothing missing";

/// A file name with escape, bell, a line of its own, a carriage return and a mark that turns the text around.
fn hostile(what: &str) -> String {
    format!("{what}\u{1b}]0;x\u{7}\r\n{FORGED}\n\u{202e}=cmd")
}

/// A folder with such a name, and in it a recording whose notes are as bad.
fn folder() -> (TempDir, PathBuf, PathBuf) {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().join(hostile("runs"));
    fs::create_dir(&folder).unwrap();
    let mut recording = read(&here(CREEP)).unwrap();
    recording.run.notes.push((hostile("operator"), hostile("someone")));
    recording.run.source = hostile("source");
    let file = folder.join(format!("{}.mcap", hostile("run")));
    write(&file, &recording).unwrap();
    (home, folder, file)
}

fn assert_harmless(output: &[u8], what: &str) {
    let text = String::from_utf8_lossy(output);
    let bad = text.chars().find(|c| c.is_control() && *c != '\n' && *c != '\t' || matches!(c, '\u{202a}'..='\u{202e}'));
    assert_eq!(bad, None, "{what}: {text:?}");
    assert!(!text.lines().any(|line| line.trim_start().starts_with(FORGED)), "{what}: {text}");
}

#[test]
fn no_command_lets_a_hostile_name_through() {
    let (home, folder, file) = folder();
    let path = |name: &str| folder.join(hostile(name)).display().to_string();
    let (file, inside) = (file.display().to_string(), folder.display().to_string());
    let csv = home.path().join("table.csv");
    fs::write(&csv, format!("time_s,\"P1\u{1b}[2J\n{FORGED}\",=P2\u{202e}\n0,1,2\n1,2,3\n")).unwrap();
    let csv = csv.display().to_string();
    let rig_file = here("rigs/demo-hdpe.toml").display().to_string();
    let (model, out) = (path("model.toml"), |name: &str| path(name));
    let commands: Vec<Vec<String>> = [
        vec!["inspect", &file],
        vec!["inspect", &out("missing")],
        vec![
            "calibrate",
            &file,
            "--effects",
            "viscoelastic-wall:1",
            "--against",
            "none",
            "--save",
            &model,
            "--report",
            &out("report.html"),
        ],
        vec!["model", &model],
        vec!["model", &file],
        vec!["refit", &model],
        vec!["predict", &model, &file],
        vec!["undo", &model],
        vec!["add", "leak", "--model", &out("no-model")],
        vec!["diagnose", &file, "--ignore", "P1\u{1b}[2J"],
        vec!["cross-validate", &out("missing")],
        vec!["frequency", &file, "--report", &out("frequency.html")],
        vec!["valve", &file],
        vec!["export", &file, "-o", &out("run.csv")],
        vec!["import", &csv, "--rig", &rig_file, "-o", &out("imported.mcap")],
        vec!["import", &csv, "--rig", &out("rig.toml"), "-o", &out("imported.mcap")],
        vec!["recover", &file, "-o", &out("recovered.mcap")],
        vec!["rig", "check", &rig_file, &file],
        vec!["rig", "check", &file],
        vec!["replay", &inside],
        vec!["record", "--replay", &file, "--speed", "0", "-o", &out("again.mcap")],
        vec![
            "simulate",
            "--rig",
            &rig_file,
            "--set",
            "initial_velocity_m_s=0.5",
            "--duration",
            "1",
            "-o",
            &out("simulated.csv"),
        ],
        vec!["watch", &inside, "--once", "--effects", "none"],
        vec!["history", "--folder", &inside],
        vec!["history", "--folder", &inside, "--csv", &out("history.csv")],
        vec!["accept", &file],
        vec!["results", &out("none"), "-o", &out("results.csv")],
        vec!["pest", &file, "-o", &out("pest")],
        vec!["family", &file, &file],
        vec!["creep", &csv],
        vec!["sensitivity", &rig_file, "--effects", "nothing\u{1b}[2J"],
        vec!["effects", "leak\u{1b}[2J\nverdict: nothing missing"],
        vec!["demo", "-o", &file],
        vec!["ports", "--rig", &out("rig.toml")],
        vec!["help", "nothing\u{1b}[2J"],
        vec!["nothing\u{1b}[2J\u{202e}\nverdict: nothing missing"],
    ]
    .into_iter()
    .map(|command| command.into_iter().map(str::to_owned).collect())
    .collect();
    for command in commands {
        for json in [false, true] {
            let mut arguments = command.clone();
            arguments.extend(json.then(|| "--json".to_owned()));
            let output = surgescope(&arguments).output().unwrap();
            assert_harmless(&output.stdout, &format!("{arguments:?}, standard output"));
            assert_harmless(&output.stderr, &format!("{arguments:?}, standard error"));
            assert!(output.status.code().is_some_and(|code| code < 4), "{arguments:?}: {:?}", output.status);
        }
    }
    assert!(Path::new(&model).exists(), "the names are allowed");
}

#[test]
fn a_rig_file_with_a_hostile_name_is_refused() {
    let rig = fs::read_to_string(here("rigs/demo-hdpe.toml")).unwrap();
    let long = "P".repeat(4000);
    for (name, why) in
        [("=1+1", "begin"), ("a\\u001b[2J", "control"), ("a\\nb", "control"), ("\u{202e}a", "control"), (&long, "200")]
    {
        let text = rig.replacen("name = \"P1\"", &format!("name = \"{name}\""), 1);
        let error = surgescope::Rig::from_toml(&text, "rig.toml").unwrap_err().to_string();
        assert!(error.contains(why) && error.len() < 8000, "{error}");
        assert_harmless(error.replace('\u{202e}', "").as_bytes(), name);
    }
}
