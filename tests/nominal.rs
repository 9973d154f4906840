//! What a rig file says wrongly of a test, and the recording tells: a fit does not go astray by it, and says so.

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

/// Calibrates the shipped creep recording with a changed rig file; the answer and what was said besides.
fn calibrated(from: &str, to: &str) -> (Value, String) {
    let folder = TempDir::new().unwrap();
    let rig = folder.path().join("rig.toml");
    let text = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/rigs/demo-hdpe.toml")).unwrap();
    assert!(text.contains(from), "{from} is not in the rig file");
    std::fs::write(&rig, text.replacen(from, to, 1)).unwrap();
    let mut command = Command::cargo_bin("surgescope").unwrap();
    command.current_dir(env!("CARGO_MANIFEST_DIR")).args([
        "calibrate",
        "recordings/hdpe-creep.mcap",
        "--json",
        "--rig",
    ]);
    let output = command.arg(&rig).args(["--effects", "viscoelastic-wall:2", "--most-reaches", "64"]).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{said}");
    (serde_json::from_slice(&output.stdout).unwrap(), said)
}

fn over_noise(fit: &Value) -> f64 {
    fit["runs"][0]["rmse_m"].as_f64().unwrap() / fit["runs"][0]["noise_m"].as_f64().unwrap()
}

/// The valve of that recording closes in 0.29 s.
#[test]
fn a_closing_time_far_off_is_found_in_the_first_rise() {
    for nominal in ["0.01", "1.5", "3.0"] {
        let (fit, said) = calibrated("closing_time_s = 0.30", &format!("closing_time_s = {nominal}"));
        assert!(over_noise(&fit) < 1.05, "{nominal}: {}", over_noise(&fit));
        let closing = fit["parameters"].as_array().unwrap().iter().find(|p| p["name"] == "closing_time_s").unwrap();
        assert!((closing["value"].as_f64().unwrap() / 0.29 - 1.0).abs() < 0.03, "{closing}");
        assert!(said.contains("closing_time_s of the rig file is far from it"), "{said}");
    }
    let (_, said) = calibrated("closing_time_s = 0.30", "closing_time_s = 0.20");
    assert!(!said.contains("far from it"), "{said}");
}

/// A range that ends below the first peaks, as an amplifier that clips.
#[test]
fn samples_at_the_end_of_a_range_are_left_out_and_said() {
    let (fit, said) = calibrated("range = [-100.0, 1000.0]", "range = [-100.0, 300.0]");
    assert!(over_noise(&fit) < 1.05, "{}", over_noise(&fit));
    assert!(said.contains("samples of P1 stand at the end of what it can show and are left out"), "{said}");
    assert!(!said.contains("of P2 stand"), "{said}");
}
