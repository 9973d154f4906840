//! How a valve closed, read back from a recording by the program.
//!
//! The recordings come from a simulator that shares nothing with this project (recordings/README.md); its closure is linear.

use assert_cmd::Command;
use serde_json::Value;

fn valve(arguments: &[&str]) -> std::process::Output {
    Command::cargo_bin("surgescope")
        .unwrap()
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .arg("valve")
        .args(arguments)
        .output()
        .unwrap()
}

#[test]
fn a_linear_closure_is_read_back_as_one() {
    let output = valve(&["recordings/hdpe-creep.mcap", "--effects", "viscoelastic-wall", "--json"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    let run = &answer["runs"][0];
    let fitted_s = run["fitted_closing_time_s"].as_f64().unwrap();
    assert!((run["effective_closing_time_s"].as_f64().unwrap() / fitted_s - 1.0).abs() < 0.02, "{run}");
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
fn without_a_sensor_at_the_valve_it_says_so_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let rig = std::fs::read_to_string("rigs/demo-hdpe.toml").unwrap();
    let moved = rig.replace("position_m = 135.52", "position_m = 1.5");
    assert_ne!(rig, moved);
    let path = folder.path().join("rig.toml");
    std::fs::write(&path, moved).unwrap();
    let output = valve(&["recordings/hdpe-creep.mcap", "--rig", path.to_str().unwrap()]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("no pressure sensor stands at the valve"), "{said}");
}
