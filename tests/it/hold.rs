//! `--hold`: known values stay, models at published values lie over a measurement.

use crate::common::{NOTHING, done, ended, run, text};

const SEVERE: &str = "recordings/adelaide/adelaide-severe.mcap";
const PUBLISHED: [&str; 7] = [
    "wave_speed_m_s=1319",
    "initial_velocity_m_s=1.4",
    "valve_head_m=17.92",
    "closing_time_s=0.009",
    "closure_start_s=0",
    "friction_scale=1",
    "cavity_lag_s=2e-4",
];

/// Exit code and messages of a fit on a coarse grid.
fn calibrated(more: &[&str]) -> (i32, String) {
    let (code, _, said) = ended(run(&[&["calibrate", SEVERE, "--json", "--most-reaches", "64"], more].concat()));
    (code, said)
}

/// The measured column separation, at the published values: nothing is left to fit but the sensor's zero.
#[test]
fn models_at_published_values_lie_over_the_measurement() {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("adelaide.html");
    let models = ["--effects", "vapour-cavity", "--against", "none", "--report", text(&page), "--hold"];
    let fit = done(&[&["calibrate", SEVERE, "--most-reaches", "64"], &models[..], &PUBLISHED].concat());
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

/// What a fit lists can be held by the name it is listed by: shared values, places of sensors, values of the run.
#[test]
fn whatever_a_fit_lists_can_be_held() {
    let command = ["calibrate", NOTHING, "--effects", "viscoelastic-wall:1", "--most-reaches", "32", "--hold"];
    let values = |fit: &serde_json::Value| -> Vec<String> {
        let parameters = fit["parameters"].as_array().unwrap().iter();
        parameters.map(|p| format!("{}={}", p["name"].as_str().unwrap(), p["value"])).collect()
    };
    let fitted = values(&done(&[&command[..], &["friction_scale=1"]].concat()));
    let held: Vec<&str> = fitted.iter().map(String::as_str).collect();
    assert!(
        held.iter().any(|name| name.starts_with("position_m[P2]")) && held.contains(&"friction_scale=1.0"),
        "{held:?}"
    );
    assert_eq!(values(&done(&[&command[..], &held].concat())), fitted);
}

#[test]
fn what_no_model_has_cannot_be_held() {
    let (code, said) = calibrated(&["--hold", "leak_position_m=3"]);
    assert_eq!(code, 2, "{said}");
    assert!(said.contains("no parameter 'leak_position_m'") && said.contains("valve_head_m"), "{said}");
}

/// A retardation time in milliseconds where seconds are asked for: a fit would not take it, and says so.
#[test]
fn a_value_beyond_what_a_fit_may_take_is_warned_of() {
    let (_, said) = calibrated(&["--hold", "closing_time_s=9000", "wave_speed_m_s=1319"]);
    assert!(said.contains("warning: --hold closing_time_s=9000 lies outside the bounds of a fit"), "{said}");
    assert!(!said.contains("--hold wave_speed_m_s"), "{said}");
}
