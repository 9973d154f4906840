//! What a user relies on in a diagnosis: the effect that is missing is found, nothing is invented, the answer is always the same.
//!
//! The recordings come from a simulator that shares nothing with this project (recordings/README.md).

use assert_cmd::Command;
use serde_json::Value;

fn diagnose(arguments: &[&str]) -> Value {
    let output = Command::cargo_bin("surgescope")
        .unwrap()
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .arg("diagnose")
        .args(arguments)
        .arg("--json")
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn best(answer: &Value) -> &Value {
    &answer["candidates"][0]
}

#[test]
fn creep_is_found_and_brings_the_error_down_to_the_noise() {
    let answer = diagnose(&["recordings/hdpe-creep.mcap"]);
    assert_eq!(answer["verdict"], "missing-effect");
    assert_eq!(best(&answer)["effect"], "viscoelastic-wall");
    assert!(best(&answer)["probability"].as_f64().unwrap() > 0.9);
    let noise_m = answer["start"]["noise_m"].as_f64().unwrap();
    assert!(answer["start"]["rmse_m"].as_f64().unwrap() > 30.0 * noise_m);
    assert!(best(&answer)["rmse_m"].as_f64().unwrap() < 1.1 * noise_m);
    assert!(!answer["fails"].as_array().unwrap().is_empty());
}

/// The leak lies at 57.43 m.
#[test]
fn a_leak_is_found_where_it_is() {
    let answer = diagnose(&["recordings/copper-leak.mcap", "--effects", "unsteady-friction"]);
    assert_eq!(best(&answer)["effect"], "leak");
    let parameters = best(&answer)["parameters"].as_array().unwrap();
    let place = parameters.iter().find(|p| p["name"] == "leak_position_m").unwrap();
    assert!((place["value"].as_f64().unwrap() - 57.43).abs() < 0.5, "{place}");
    assert!(place["standard_error"].as_f64().unwrap() < 1.0, "{place}");
}

#[test]
fn where_nothing_is_missing_nothing_is_found() {
    let answer = diagnose(&["recordings/hdpe-nothing-missing.mcap", "--effects", "viscoelastic-wall"]);
    assert_eq!(answer["verdict"], "nothing-missing");
    let most = answer["candidates"].as_array().unwrap().iter().map(|c| c["probability"].as_f64().unwrap());
    assert!(most.fold(0.0, f64::max) < 0.5);
}

#[test]
fn the_same_question_has_the_same_answer_to_the_last_digit() {
    let ask = || diagnose(&["recordings/copper-leak.mcap", "--effects", "unsteady-friction"]).to_string();
    assert_eq!(ask(), ask());
}

/// What is asked to go on until nothing is missing stops by itself, and shows the errors on the way.
#[test]
fn effects_are_added_until_nothing_is_missing() {
    let output = Command::cargo_bin("surgescope")
        .unwrap()
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .args(["diagnose", "recordings/hdpe-creep.mcap", "--until-done"])
        .output()
        .unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success());
    assert!(text.contains("Missing: viscoelastic-wall") && text.contains("Nothing is missing"), "{text}");
    let stairs = text.split("Models, one after the other:").nth(1).unwrap();
    assert_eq!(stairs.trim().lines().count(), 2, "{stairs}");
}

#[test]
fn bad_questions_are_refused_with_what_to_do() {
    for (arguments, said) in [
        (vec!["recordings/none.mcap"], "none.mcap"),
        (vec!["recordings/copper-leak.mcap", "--effects", "leek"], "leak"),
        (vec![], "MCAP"),
    ] {
        let output = Command::cargo_bin("surgescope")
            .unwrap()
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .arg("diagnose")
            .args(&arguments)
            .output()
            .unwrap();
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{text}");
        assert!(text.contains(said), "{text}");
        assert!(output.stdout.is_empty());
    }
}
