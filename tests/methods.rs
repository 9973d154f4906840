//! The searches that a calibration knows, on a recording whose truth is known: a simulator that shares nothing with this project made it
//! (recordings/README.md).

use assert_cmd::Command;
use serde_json::Value;

const RECORDING: &str = "recordings/hdpe-creep.mcap";

fn calibrated(arguments: &[&str]) -> Value {
    let mut command = Command::cargo_bin("surgescope").unwrap();
    command.current_dir(env!("CARGO_MANIFEST_DIR")).args(["calibrate", RECORDING, "--json", "--most-reaches", "64"]);
    let output = command.args(["--effects", "viscoelastic-wall:2"]).args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn over_noise(fit: &Value) -> f64 {
    let run = &fit["runs"][0];
    run["rmse_m"].as_f64().unwrap() / run["noise_m"].as_f64().unwrap()
}

fn value(fit: &Value, name: &str) -> f64 {
    let parameters = fit["parameters"].as_array().unwrap();
    parameters.iter().find(|p| p["name"] == name).unwrap()["value"].as_f64().unwrap()
}

/// A wave speed half as large again or half as large, and retardation times in each other's place.
#[test]
fn starts_in_traps_are_left_again() {
    for start in [
        vec!["--start", "wave_speed_m_s=171"],
        vec!["--start", "wave_speed_m_s=513"],
        vec!["--start", "tau1_s=0.43", "tau2_s=0.034", "J1_per_GPa=0.136", "J2_per_GPa=0.175"],
    ] {
        for random in [&[][..], &["--starts", "8"]] {
            let fit = calibrated(&[&start[..], random].concat());
            assert!(over_noise(&fit) < 1.05, "{start:?} {random:?}: {}", over_noise(&fit));
            assert!((value(&fit, "wave_speed_m_s") - 342.5).abs() < 1.0);
            assert!(value(&fit, "tau1_s") < value(&fit, "tau2_s"));
        }
    }
}

#[test]
fn a_global_search_with_descent_after_it_ends_at_the_noise() {
    let fit = calibrated(&["--method", "global-local", "--budget", "3000", "--start", "wave_speed_m_s=171"]);
    assert!(over_noise(&fit) < 1.05, "{}", over_noise(&fit));
}

/// Without descent a search comes near, keeps its budget, and gives the same with the same seed.
#[test]
fn searches_without_descent_keep_their_budget_and_repeat_themselves() {
    for method in ["global", "micro-ga"] {
        let search = |seed: &str| calibrated(&["--method", method, "--budget", "1500", "--seed", seed]);
        let one = search("1");
        assert!(over_noise(&one) < 40.0, "{method}: {}", over_noise(&one));
        let start = calibrated(&["--method", method, "--budget", "1"]);
        assert!(
            over_noise(&one) < 0.7 * over_noise(&start),
            "{method}: {} of {}",
            over_noise(&one),
            over_noise(&start)
        );
        // Besides the budget, what it takes to say how far the numbers can be trusted.
        let spent = one["evaluations"].as_u64().unwrap();
        assert!((1000..1600).contains(&spent), "{method}: {spent}");
        assert_eq!(one["parameters"], search("1")["parameters"], "{method}");
        assert_ne!(one["parameters"], search("2")["parameters"], "{method}");
    }
}

/// Stepwise comes down to the noise with friction near the pipe's own, and what a creep test knows holds for it, too, with as many elements as that
/// test has.
#[test]
fn stepwise_comes_near_the_noise_and_heeds_a_creep_test() {
    let fit = calibrated(&["--method", "stepwise"]);
    assert!(over_noise(&fit) < 1.1, "{}", over_noise(&fit));
    assert!((value(&fit, "friction_scale") - 1.0).abs() < 0.2 && (value(&fit, "wave_speed_m_s") - 342.5).abs() < 3.0);
    let folder = tempfile::tempdir().unwrap();
    let creep = folder.path().join("creep.toml");
    let name = creep.to_str().unwrap();
    let test = "recordings/creep/hdpe-25degC.csv";
    let output = Command::cargo_bin("surgescope")
        .unwrap()
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .args(["creep", test, "--temperature-degC", "25", "-o", name])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mut command = Command::cargo_bin("surgescope").unwrap();
    command.current_dir(env!("CARGO_MANIFEST_DIR")).args(["calibrate", RECORDING, "--json", "--most-reaches", "64"]);
    let known = ["--effects", "viscoelastic-wall", "--creep", name, "--method", "stepwise"];
    let output = command.args(known).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let fit: Value = serde_json::from_slice(&output.stdout).unwrap();
    let elements = fit["parameters"].as_array().unwrap().iter().filter(|p| p["unit"] == "1/GPa").count();
    assert_eq!(fit["effects"][0], format!("viscoelastic-wall:{elements}"));
    assert!(elements > 2, "{elements}");
    assert!(over_noise(&fit) < 2.0, "{}", over_noise(&fit));
}

/// Each step is told; the error falls over them; stopped after some of them it goes on from where it was.
#[test]
fn steps_are_told_and_can_be_stopped_and_continued() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("steps.toml");
    let name = file.to_str().unwrap();
    let three = calibrated(&["--method", "stepwise", "--steps", "3", "--save", name]);
    let steps = three["steps"].as_array().unwrap();
    assert_eq!(steps.len(), 3);
    assert_eq!(steps[0]["parameters"][0][0], "wave_speed_m_s");
    assert!(steps.iter().all(|s| !s["why"].as_str().unwrap().is_empty()));
    let whole = calibrated(&["--method", "stepwise", "--from", name]);
    let steps = whole["steps"].as_array().unwrap();
    assert!(steps.len() > 3);
    let before = steps[0]["before_over_noise"].as_f64().unwrap();
    let left = three["steps"][2]["after_over_noise"].as_f64().unwrap();
    assert!((before / left - 1.0).abs() < 0.02, "{before} goes on from {left}");
    let kept = steps.iter().filter(|s| s["kept"] == true);
    let after = kept.map(|s| s["after_over_noise"].as_f64().unwrap()).fold(f64::INFINITY, f64::min);
    assert!(after < 0.3 * before, "{before} to {after}");
    assert!(over_noise(&whole) < 1.2 * after);
}

#[test]
fn a_start_for_what_the_model_has_not_is_refused() {
    let mut command = Command::cargo_bin("surgescope").unwrap();
    command.current_dir(env!("CARGO_MANIFEST_DIR")).args(["calibrate", RECORDING, "--most-reaches", "64"]);
    let output = command.args(["--start", "wave_sped_m_s=300"]).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("wave_sped_m_s") && said.contains("wave_speed_m_s"), "{said}");
}
