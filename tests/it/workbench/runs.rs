//! Runs beside the one that is open: glances, a comparison with a reference, drift.

use std::path::Path;

use serde_json::{Value, json};

use crate::common::{CREEP, LEAK, here};
use crate::workbench::client::{Workbench, done_in};

/// Simulated runs of one rig, each with its own wave speed.
fn folder_of_runs(speeds: &[f64]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let rig = here("rigs/demo-hdpe.toml");
    for (i, speed) in speeds.iter().enumerate() {
        let (set, out) = (format!("wave_speed_m_s={speed}"), format!("run-{}.mcap", i + 1));
        let words = ["simulate", "--rig", rig.to_str().unwrap(), "--set", &set, "--seed", "1", "-o", &out];
        done_in(folder.path(), &words);
    }
    folder
}

/// Head and columns of a packed answer.
fn unpacked(bytes: &[u8]) -> (Value, Vec<u8>) {
    let length = u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize;
    (serde_json::from_slice(&bytes[4..4 + length]).unwrap(), bytes[4 + length..].to_vec())
}

fn number_of(state: &Value, name: &str) -> String {
    let run = state["runs"].as_array().unwrap().iter().find(|run| run["name"] == name).unwrap();
    run["id"].as_str().unwrap().to_owned()
}

fn inspected(folder: &Path, run: &str) -> f64 {
    done_in(folder, &["inspect", run])["period_s"]["value"].as_f64().unwrap()
}

#[test]
fn runs_are_compared_at_the_closure_with_what_inspect_says_of_each() {
    let folder = folder_of_runs(&[360.0, 380.0]);
    let bench = Workbench::open(folder.path(), &["."]);
    let state = bench.fitted();
    let [a, b] = ["run-1.mcap", "run-2.mcap"].map(|name| number_of(&state, name));
    let (head, numbers) = unpacked(&bench.get(&format!("/api/compare?runs={a},{b}&points=800")));
    let columns: Vec<&str> = head["columns"].as_array().unwrap().iter().map(|c| c.as_str().unwrap()).collect();
    assert_eq!(columns[..3], ["0/time_s", &format!("0/{a}_m"), &format!("0/{b}_m")]);
    let points = head["sensors"][0]["points"].as_u64().unwrap() as usize;
    let column = |i: usize| -> Vec<f64> {
        let bytes = &numbers[8 * i * points..8 * (i + 1) * points];
        bytes.chunks(8).map(|eight| f64::from_le_bytes(eight.try_into().unwrap())).collect()
    };
    let (time_s, one, other) = (column(0), column(1), column(2));
    assert!(points <= 900 && time_s.windows(2).all(|w| w[0] < w[1]));
    // before the closure both stand still, and differ by no more than noise; a faster wave makes a higher rise
    let before = time_s.iter().position(|t| *t > -0.2).unwrap();
    assert!((one[before] - other[before]).abs() < 0.3, "{} {}", one[before], other[before]);
    let most = |of: &[f64]| of.iter().copied().filter(|h| h.is_finite()).fold(f64::NEG_INFINITY, f64::max);
    assert!(most(&other) > most(&one) + 0.5);
    for (i, run) in ["run-1.mcap", "run-2.mcap"].iter().enumerate() {
        let measured = head["runs"][i]["measured"].as_array().unwrap();
        let period = measured.iter().find(|q| q["label"] == "period").unwrap()["value"].as_f64().unwrap();
        assert!((period / inspected(folder.path(), run) - 1.0).abs() < 1e-9);
    }
    // the run that is open has a model, though no file has it yet
    let open = state["open"]["runs"][0]["name"].as_str().unwrap();
    for run in head["runs"].as_array().unwrap() {
        assert_eq!(run["rmse_m"].is_number(), run["name"] == open, "{run}");
    }
    assert!(!folder.path().join(open).with_extension("model.toml").exists());
    let sensor = head["sensors"][0]["name"].as_str().unwrap();
    assert_eq!(head["runs"][0]["differences_m"][sensor], 0.0);
    assert!(head["runs"][1]["differences_m"][sensor].as_f64().unwrap() > 1.0);

    let (near, _) = unpacked(&bench.get(&format!("/api/compare?runs={a},{b}&from=0&to=0.1&points=4000")));
    assert!(near["sensors"][0]["points"].as_u64().unwrap() > 20);
    let refused = |query: &str| bench.refused(&format!("/api/compare?{query}"));
    assert!(refused("runs=77").contains("no such run") && refused("runs=../x").contains("by their numbers"));
}

#[test]
fn a_run_that_is_not_open_is_glanced_at_and_its_model_is_taken_into_account() {
    let folder = folder_of_runs(&[360.0, 380.0]);
    done_in(folder.path(), &["calibrate", "run-1.mcap", "--effects", "none", "--save", "run-1.model.toml"]);
    let model = done_in(folder.path(), &["model", "run-1.model.toml"]);
    std::fs::write(folder.path().join("broken.mcap"), b"no recording").unwrap();
    let bench = Workbench::open(folder.path(), &["."]);
    let state = bench.state();
    let glance = |name: &str| -> Value {
        serde_json::from_slice(&bench.get(&format!("/api/glance?run={}", number_of(&state, name)))).unwrap()
    };
    let seen = glance("run-1.mcap");
    assert!((10..=100).contains(&seen["spark"].as_array().unwrap().len()), "{seen}");
    assert_eq!(seen["rmse_m"], model["models"][0]["rmse_m"]);
    assert_eq!((&glance("run-2.mcap")["rmse_m"], &seen["rig"]), (&Value::Null, &json!("demo-hdpe")));
    let broken = glance("broken.mcap");
    assert!(broken["error"].as_str().unwrap().len() > 10 && broken["spark"] == json!([]), "{broken}");
}

#[test]
fn a_run_that_was_left_is_found_as_it_was_left() {
    let folder = folder_of_runs(&[360.0, 380.0]);
    let bench = Workbench::open(folder.path(), &["."]);
    let first = bench.fitted();
    let [name, other] =
        [&first["open"]["runs"][0]["name"], &json!("run-1.mcap")].map(|name| name.as_str().unwrap().to_owned());
    assert_ne!(name, other);
    bench.job("/api/diagnose", &json!({}));
    let diagnosed = bench.state();
    let open = |name: &str| bench.job("/api/open", &json!({ "run": number_of(&first, name) }));
    let row = |state: &Value| -> Value {
        let mut row = state["runs"].as_array().unwrap().iter().find(|run| run["name"] == name[..]).unwrap().clone();
        row.as_object_mut().unwrap().retain(|key, _| ["rmse_m", "noise_m", "verdict", "effect"].contains(&&key[..]));
        row
    };
    open(&other);
    let left = bench.fitted();
    assert_eq!((row(&left), left["diagnosis"].is_null()), (row(&diagnosed), true));
    assert!(row(&left)["rmse_m"].is_number() && row(&left)["verdict"].is_string());
    let events = open(&name);
    assert!(events.iter().all(|(name, _)| name != "progress"), "it was fitted again: {events:?}");
    let back = bench.state();
    assert_eq!((&back["diagnosis"], &back["model"]), (&diagnosed["diagnosis"], &diagnosed["model"]));

    // a model that a command made meanwhile counts
    open(&other);
    let model = Path::new(&name).with_extension("model.toml");
    done_in(folder.path(), &["calibrate", &name, "--effects", "unsteady-friction", "--save", model.to_str().unwrap()]);
    open(&name);
    assert_eq!(bench.state()["model"]["effects"], json!(["unsteady-friction"]));
}

#[test]
fn drift_is_what_history_says() {
    let folder = folder_of_runs(&[360.0, 365.0, 370.0]);
    let bench = Workbench::open(folder.path(), &["."]);
    assert!(bench.refused("/api/history").contains("watch"), "it says what makes an index");
    done_in(folder.path(), &["watch", ".", "--once", "--effects", "none"]);
    let by_page: Value = serde_json::from_slice(&bench.get("/api/history")).unwrap();
    let mut by_command = done_in(folder.path(), &["history", "--folder", "."]);
    let told = by_command.as_object_mut().unwrap().remove("warnings");
    assert_eq!((&by_page[0], told), (&by_command, Some(json!([]))));
    assert_eq!(by_page[0]["parameters"][0]["values"].as_array().unwrap().len(), 3);
}

#[test]
fn the_values_of_a_simulated_test_follow_its_effects() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(here(LEAK), folder.path().join("run.mcap")).unwrap();
    let bench = Workbench::open(folder.path(), &["run.mcap"]);
    bench.fitted();
    let settings = |effects: &str| -> Vec<String> {
        let found: Value = serde_json::from_slice(&bench.get(&format!("/api/simulation?effects={effects}"))).unwrap();
        found["settings"].as_array().unwrap().iter().map(|s| s["name"].as_str().unwrap().to_owned()).collect()
    };
    let has = |all: &[String], name: &str| all.iter().any(|own| own == name);
    let (plain, leaking) = (settings(""), settings("leak"));
    assert!(has(&plain, "wave_speed_m_s") && !has(&plain, "leak_position_m") && has(&leaking, "leak_position_m"));
    // like the run that is open: a copper pipe at the usual 1 m/s would fall far below vapour pressure
    let found: Value = serde_json::from_slice(&bench.get("/api/simulation?effects=")).unwrap();
    let value = |name: &str| {
        let all = found["settings"].as_array().unwrap();
        all.iter().find(|s| s["name"] == name).unwrap()["value"].as_f64().unwrap()
    };
    assert!((value("initial_velocity_m_s") - 0.244).abs() < 0.01 && (value("valve_head_m") - 47.2).abs() < 0.5);
    assert!(bench.refused("/api/simulation?effects=leek").contains("leek"));
    let located = bench.state()["open"]["rig"]["located"].clone();
    assert!(located.as_array().unwrap().contains(&json!({ "effect": "leak", "from": "leak_position_m", "to": null })));
}

#[test]
fn a_run_that_another_program_puts_into_the_folder_is_told() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(here(LEAK), folder.path().join("first.mcap")).unwrap();
    let bench = Workbench::open(folder.path(), &["."]);
    bench.fitted();
    let mut events = bench.events();
    std::fs::copy(here(CREEP), folder.path().join("second.mcap")).unwrap();
    while events.next().expect("the stream of events ended").0 != "state" {}
    assert_eq!(bench.state()["runs"].as_array().unwrap().len(), 2);
}
