//! What a user relies on in `next`: tests in order, settings that can be made, clear refusals.

use serde_json::Value;
use tempfile::TempDir;

use crate::common::{LEAK, done, printed, refused, run, text};

/// A model of the recording with a leak that lacks the leak.
fn model(folder: &TempDir) -> String {
    let path = folder.path().join("model.toml");
    printed(run(&["calibrate", LEAK, "--effects", "unsteady-friction", "--save", text(&path)]));
    text(&path).to_owned()
}

#[test]
fn the_test_that_narrows_a_parameter_comes_first_and_is_written() {
    let folder = TempDir::new().unwrap();
    let (model, test) = (model(&folder), folder.path().join("test.toml"));
    let answer: Value = done(&["next", &model, "--for", "wave_speed_m_s", "--save", text(&test)]);
    let tests = answer["narrowing"]["tests"].as_array().unwrap();
    let after: Vec<f64> = tests.iter().map(|t| t["standard_error_after"].as_f64().unwrap()).collect();
    assert!(after.is_sorted() && after[0] > 0.0, "{after:?}");
    assert!(tests.iter().all(|t| after[0] < t["standard_error_before"].as_f64().unwrap()));
    let settings: toml::Table = std::fs::read_to_string(&test).unwrap().parse().unwrap();
    assert_eq!(settings["instruction"].as_str(), tests[0]["instruction"].as_str());
    assert_eq!(settings["closing_time_s"].as_float(), tests[0]["settings"]["closing_time_s"].as_f64());
    // what is there already is not written over
    refused(&["next", &model, "--for", "wave_speed_m_s", "--save", text(&test)], &["exists"]);
    refused(&["next", &model, "--for", "leak_cda_mm2"], &["leak_cda_mm2", "wave_speed_m_s"]);
    refused(&["next", &model, "--between", "leak"], &["two effects"]);
}

#[test]
#[ignore = "takes half a minute; CI runs it at night"]
fn two_answers_are_set_against_each_other_and_drawn() {
    let folder = TempDir::new().unwrap();
    let (model, page) = (model(&folder), folder.path().join("next.html"));
    let answer: Value = done(&["next", &model, "--between", "leak,blockage", "--report", text(&page)]);
    let contest = &answer["answers"][0];
    assert_eq!(contest["between"], serde_json::json!(["leak", "blockage"]));
    let tests = contest["tests"].as_array().unwrap();
    let odds: Vec<f64> = tests.iter().map(|t| t["log_odds"].as_f64().unwrap()).collect();
    assert!(odds.is_sorted_by(|a, b| a >= b) && odds[0] > 20f64.ln(), "{odds:?}");
    let peak_m = tests[0]["peak_m"].as_f64().unwrap();
    let shown = tests[0]["curves"][0]["first_m"].as_array().unwrap();
    assert!(shown.iter().all(|h| h.as_f64().unwrap() <= peak_m));
    let page = std::fs::read_to_string(page).unwrap();
    assert!(page.contains("if leak") && page.contains(tests[0]["instruction"].as_str().unwrap()));
}
