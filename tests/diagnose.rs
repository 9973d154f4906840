//! What a user relies on in a diagnosis: the effect that is missing is found, nothing is invented, the answer is always the same.
//!
//! The recordings come from a simulator that shares nothing with this project (recordings/README.md).

use std::path::Path;

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
    assert!(text.contains("Refitted to the first three fifths"), "{text}");
    assert!(text.contains("Too small to be seen"), "{text}");
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

/// Copper does not creep: the effect is not tried, and a start model that has it is doubted.
#[test]
fn what_a_rig_cannot_have_is_not_tried_and_is_doubted() {
    let answer = diagnose(&["recordings/copper-leak.mcap", "--effects", "viscoelastic-wall:1"]);
    let warnings = answer["warnings"].to_string();
    assert!(warnings.contains("viscoelastic-wall") && warnings.contains("creeps"), "{warnings}");
    let answer = diagnose(&["recordings/copper-leak.mcap"]);
    let tried = answer["candidates"].as_array().unwrap();
    assert!(tried.iter().all(|c| c["effect"] != "viscoelastic-wall"));
    assert_eq!(answer["not_tried"][0]["effect"], "viscoelastic-wall");
    // Unsteady friction explains most of it; that a leak is missing, too, does not make that less so.
    assert_eq!(best(&answer)["effect"], "unsteady-friction");
    assert!(answer["probability"].as_f64().unwrap() > 0.8, "{answer}");
    assert!(best(&answer)["held_out_m"].as_f64() < answer["start"]["held_out_m"].as_f64());
}

/// A sensor's gain is arithmetic, so its recordings can be made without any solver: much is found, less than is said to be visible is not.
#[test]
fn the_least_visible_gain_is_where_it_says() {
    let nothing = diagnose(&["recordings/hdpe-nothing-missing.mcap", "--effects", "viscoelastic-wall"]);
    let seen = nothing["least_visible"].as_array().unwrap();
    let gain = seen.iter().find(|v| v["effect"].as_str().unwrap().starts_with("sensor-gain@")).unwrap();
    let sensor = gain["effect"].as_str().unwrap().split('@').nth(1).unwrap();
    let least = gain["value"].as_f64().unwrap();
    assert!(least > 0.0 && least < 0.02, "{gain}");
    let folder = tempfile::tempdir().unwrap();
    let rig = folder.path().join("rig.toml");
    let original = Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings/hdpe-nothing-missing.mcap");
    std::fs::write(&rig, surgescope::storage::read(&original).unwrap().rig.source).unwrap();
    let with_gain = |error: f64| {
        let csv = folder.path().join("gain.csv");
        let mcap = folder.path().join(format!("gain{error}.mcap"));
        let run = |arguments: &[&str]| {
            let output = Command::cargo_bin("surgescope")
                .unwrap()
                .current_dir(env!("CARGO_MANIFEST_DIR"))
                .args(arguments)
                .output();
            let output = output.unwrap();
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        };
        let _ = std::fs::remove_file(&csv);
        run(&["export", "recordings/hdpe-nothing-missing.mcap", "-o", csv.to_str().unwrap()]);
        let text = std::fs::read_to_string(&csv).unwrap();
        let column = text.lines().next().unwrap().split(',').position(|name| name == sensor).unwrap();
        let changed: Vec<String> = text
            .lines()
            .enumerate()
            .map(|(i, line)| {
                let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
                if i > 0 && !cells[column].is_empty() {
                    cells[column] = format!("{:.6}", cells[column].parse::<f64>().unwrap() * (1.0 + error));
                }
                cells.join(",")
            })
            .collect();
        std::fs::write(&csv, changed.join("\n") + "\n").unwrap();
        run(&["import", csv.to_str().unwrap(), "--rig", rig.to_str().unwrap(), "-o", mcap.to_str().unwrap()]);
        diagnose(&[mcap.to_str().unwrap(), "--effects", "viscoelastic-wall"])
    };
    let large = with_gain(0.06);
    assert_eq!(best(&large)["effect"], "sensor-gain", "{large}");
    assert_eq!(with_gain(0.3 * least)["verdict"], "nothing-missing");
}
