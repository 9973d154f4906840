//! `--hold`: known values stay, models at published values lie over a measurement.

use std::process::Output;

use assert_cmd::Command;
use serde_json::Value;

const PUBLISHED: [&str; 7] = [
    "wave_speed_m_s=1319",
    "initial_velocity_m_s=1.4",
    "valve_head_m=17.92",
    "closing_time_s=0.009",
    "closure_start_s=0",
    "friction_scale=1",
    "cavity_lag_s=2e-4",
];

fn calibrated(more: &[&str]) -> Output {
    let mut command = Command::cargo_bin("surgescope").unwrap();
    command.current_dir(env!("CARGO_MANIFEST_DIR"));
    command.args(["calibrate", "recordings/adelaide/adelaide-severe.mcap", "--json", "--most-reaches", "64"]);
    command.args(more).output().unwrap()
}

/// The measured column separation, at the published values: nothing is left to fit but the sensor's zero.
#[test]
fn models_at_published_values_lie_over_the_measurement() {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("adelaide.html");
    let name = page.to_str().unwrap();
    let models = ["--effects", "vapour-cavity", "--against", "none", "--report", name, "--hold"];
    let output = calibrated(&[&models[..], &PUBLISHED].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let fit: Value = serde_json::from_slice(&output.stdout).unwrap();
    let parameters = fit["parameters"].as_array().unwrap();
    for held in PUBLISHED {
        let (name, value) = held.split_once('=').unwrap();
        let found = parameters.iter().find(|p| p["name"] == name).unwrap();
        assert_eq!(found["value"].as_f64().unwrap(), value.parse::<f64>().unwrap(), "{name}");
    }
    assert!(parameters.iter().any(|p| p["name"] == "offset_m[P1]"));
    let rmse_m = fit["runs"][0]["rmse_m"].as_f64().unwrap();
    assert!(rmse_m < 35.0, "{rmse_m} m of 215 m");
    let text = std::fs::read_to_string(page).unwrap();
    assert!(text.contains("+ vapour-cavity") && text.contains("base model"));
}

#[test]
fn what_no_model_has_cannot_be_held() {
    let output = calibrated(&["--hold", "leak_position_m=3"]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("no parameter 'leak_position_m'") && said.contains("valve_head_m"), "{said}");
}

/// A retardation time in milliseconds where seconds are asked for: a fit would not take it, and says so.
#[test]
fn a_value_beyond_what_a_fit_may_take_is_warned_of() {
    let output = calibrated(&["--hold", "closing_time_s=9000", "wave_speed_m_s=1319"]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("warning: --hold closing_time_s=9000 lies outside the bounds of a fit"), "{said}");
    assert!(!said.contains("--hold wave_speed_m_s"), "{said}");
}

/// The measured column separation again, four values known: the diagnosis leaves them as they are.
#[test]
fn a_diagnosis_holds_what_it_is_told_to() {
    let mut command = Command::cargo_bin("surgescope").unwrap();
    command.current_dir(env!("CARGO_MANIFEST_DIR"));
    command.args(["diagnose", "recordings/adelaide/adelaide-severe.mcap", "--json", "--most-reaches", "64"]);
    let known =
        [("wave_speed_m_s", 1319.0), ("closing_time_s", 0.009), ("initial_velocity_m_s", 1.4), ("valve_head_m", 20.0)];
    let output = command.arg("--hold").args(known.map(|(name, value)| format!("{name}={value}"))).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let said: Value = serde_json::from_slice(&output.stdout).unwrap();
    let start = said["start"]["parameters"].as_array().unwrap();
    for (name, value) in known {
        let found = start.iter().find(|p| p["name"] == name).unwrap();
        assert_eq!(found["value"].as_f64(), Some(value), "{name}");
    }
    // Its troughs lie on the floor of vapour pressure, and with cavities the model follows.
    let first = &said["candidates"][0];
    assert_eq!(first["effect"], "vapour-cavity");
    assert!(first["rmse_m"].as_f64().unwrap() < 15.0, "{first}");
}
