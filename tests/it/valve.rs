//! How a valve closed, read back from a recording by the program.
//!
//! The recordings come from a simulator that shares nothing with this project (recordings/README.md); its closure is
//! linear.

use std::process::Output;

use serde_json::Value;

use crate::common::{CREEP, done, here, printed, refused, run, text};

fn valve(arguments: &[&str]) -> Output {
    run(&[&["valve"], arguments].concat())
}

#[test]
fn a_linear_closure_is_read_back_as_one() {
    let answer: Value = done(&["valve", CREEP, "--effects", "viscoelastic-wall"]);
    assert_eq!(answer["effects"].as_array().unwrap().len(), 1, "no law of two stages: {}", answer["effects"]);
    let run = &answer["runs"][0];
    assert_eq!(run["two_stage"]["straight"], true, "{}", run["two_stage"]);
    let fitted_s = run["fitted_closing_time_s"].as_f64().unwrap();
    assert!((run["effective_closing_time_s"].as_f64().unwrap() / fitted_s - 1.0).abs() < 0.02, "{run}");
    // The curve and the linear law tell the same first rise, and the pipe's own parameters move the curve.
    let left = |law: &str| run["errors"][law]["first_rise_rms_m"].as_f64().unwrap();
    assert!(left("fitted") < 0.1 && left("two_stage") < 0.1 && left("curve") < 0.1, "{}", run["errors"]);
    let shifts = run["shifts"].as_array().unwrap();
    let moved = |what: &str| {
        let shift = shifts.iter().find(|s| s["what"] == what).unwrap_or_else(|| panic!("no {what}"));
        shift["largest_change_of_opening"].as_f64().unwrap()
    };
    assert!(moved("wave speed +2%") > 3.0 * moved("wave speed +1 standard error"));
    assert!(moved("creep left out") > 2.0 * moved("creep +20%") && moved("creep +20%") > 1e-3);
    let numbers = |name: &str| -> Vec<f64> {
        run[name].as_array().unwrap().iter().map(|v| v.as_f64().unwrap_or(f64::NAN)).collect()
    };
    let (time_s, opening) = (numbers("time_s"), numbers("opening"));
    assert!((opening[0] - 1.0).abs() < 1e-12);
    for (t, found) in time_s.iter().zip(&opening) {
        assert!((found - (1.0 - t / fitted_s).max(0.0)).abs() < 0.02, "{t}: {found}");
    }
}

#[test]
fn the_curve_is_drawn_and_its_worth_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let svg = folder.path().join("valve.svg");
    let said = printed(valve(&[CREEP, "--effects", "viscoelastic-wall:1", "--svg", text(&svg)]));
    assert!(said.contains("creep left out") && said.contains("nearest two stages"), "{said}");
    let drawn = std::fs::read_to_string(svg).unwrap();
    assert!(drawn.ends_with("</svg>") && drawn.contains("wave speed +2%"), "{drawn}");
    refused(&["valve", CREEP, CREEP, "--svg", "x.svg"], &[]);
}

/// A picture takes the place of a picture, never of a recording or any other file.
#[test]
fn pictures_replace_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let victim = folder.path().join("run.mcap");
    std::fs::copy(here(CREEP), &victim).unwrap();
    let before = std::fs::read(&victim).unwrap();
    refused(&["valve", CREEP, "--svg", text(&victim)], &["is not overwritten"]);
    refused(&["effects", "leak", "--svg", text(&victim)], &["is not overwritten"]);
    assert_eq!(std::fs::read(&victim).unwrap(), before);
    let picture = folder.path().join("leak.svg");
    for _ in 0..2 {
        let drawn = run(&["effects", "leak", "--svg", text(&picture)]);
        assert!(drawn.status.success(), "over itself, too");
    }
}

/// The elastic model of a pipe that creeps makes the valve open below nothing: the program says so, and what to do.
#[test]
fn a_curve_that_is_no_valves_is_called_so() {
    let output = valve(&[CREEP]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{said}");
    assert!(said.contains("are impossible") && said.contains("add --effects viscoelastic-wall"), "{said}");
}

#[test]
fn without_a_sensor_at_the_valve_it_says_so_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let rig = std::fs::read_to_string(here("rigs/demo-hdpe.toml")).unwrap();
    let moved = rig.replace("position_m = 135.52", "position_m = 1.5");
    assert_ne!(rig, moved);
    let path = folder.path().join("rig.toml");
    std::fs::write(&path, moved).unwrap();
    refused(&["valve", CREEP, "--rig", text(&path)], &["no pressure sensor stands at the valve"]);
}

/// Two valves of a branched rig, each with its own time and start: a fit finds both, and a diagnosis says whose law it
/// is.
#[test]
fn each_of_two_valves_is_calibrated_and_diagnosed() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let branched = std::fs::read_to_string(here("rigs/branched.toml")).unwrap();
    let closes = "kind = \"valve\"\ncda_mm2 = 3\nclosing_time_s = 0.1\nclosing_start_s = 0.2\ndischarge_head_m = 0";
    let two = branched.replace("kind = \"dead-end\"", closes).replace("\"reservoir\"", "\"reservoir\"\nhead_m = 42");
    let rig = file("two.toml");
    std::fs::write(&rig, two).unwrap();
    let simulated = |name: &str, more: &[&str]| {
        let to = file(name);
        let mut all = vec!["simulate", "--rig", text(&rig), "--duration", "4", "--seed", "1", "-o", text(&to)];
        all.extend(["--set", "initial_velocity_m_s=0.05", "--set", "valve_head_m=40"]);
        all.extend(more);
        printed(run(&all));
        to
    };
    let apart = simulated("apart.mcap", &["--set", "closing_time_s[end]=0.13", "--set", "closing_start_s[end]=0.23"]);
    let fit: Value = done(&["calibrate", text(&apart)]);
    let parameters = fit["parameters"].as_array().unwrap();
    for (name, true_s) in [("closing_time_s", 0.05), ("closing_time_s[end]", 0.13), ("closing_start_s[end]", 0.23)] {
        let found = parameters.iter().find(|p| p["name"] == name).unwrap_or_else(|| panic!("no {name}"));
        let [value, error] = ["value", "standard_error"].map(|key| found[key].as_f64().unwrap());
        assert!((value - true_s).abs() < 4.0 * error && error < 0.01 * true_s, "{name}: {value} ± {error}");
    }
    let law =
        ["--effects", "valve-law@end", "--set", "inflection_time_fraction=0.3", "--set", "inflection_opening=0.35"];
    let found: Value = done(&["diagnose", text(&simulated("law.mcap", &law))]);
    let best = &found["candidates"][0]["label"];
    assert_eq!((&found["verdict"], best), (&"missing-effect".into(), &"valve-law@end".into()));
    refused(&["calibrate", text(&apart), "--effects", "valve-law"], &["valve-law@valve"]);
}
