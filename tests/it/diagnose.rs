//! What a user relies on in a diagnosis: the effect that is missing is found, nothing is invented, the answer is always
//! the same.
//!
//! The recordings come from a simulator that shares nothing with this project (recordings/README.md).

use serde_json::Value;
use surgescope::Study;
use surgescope::diagnose::Verdict;
use surgescope::fit::search::options::Options;
use surgescope::model::effects::{Chosen, parse_list};
use surgescope::study::until_done::{Step, UntilDone};

use crate::common::{CREEP, LEAK, NOTHING, diagnosis, done, here, parameter, printed, refused, run, text};

/// Asked for by this test alone.
fn diagnose(arguments: &[&str]) -> Value {
    done(&[&["diagnose"], arguments].concat())
}

fn best(answer: &Value) -> &Value {
    &answer["candidates"][0]
}

#[test]
fn creep_is_found_and_brings_the_error_down_to_the_noise() {
    let answer = diagnose(&[CREEP]);
    assert_eq!(answer["verdict"], "missing-effect");
    assert_eq!(best(&answer)["effect"], "viscoelastic-wall");
    assert!(best(&answer)["probability"].as_f64().unwrap() > 0.9);
    let noise_m = answer["start"]["noise_m"].as_f64().unwrap();
    assert!(answer["start"]["rmse_m"].as_f64().unwrap() > 30.0 * noise_m);
    assert!(best(&answer)["rmse_m"].as_f64().unwrap() < 1.1 * noise_m);
    assert!(!answer["fails"].as_array().unwrap().is_empty());
}

/// The error before is the least that the smaller model leaves, and what that bends of it is no doubt of an answer that
/// explains the record.
#[test]
fn an_answer_that_explains_the_record_is_not_doubted() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (rig, table) = (at("rig.toml"), at("table.mcap"));
    let pipe = ["--material", "copper", "--length-m", "100", "--pipe", "22x1.5", "--temperature-degC", "18", "--yes"];
    printed(run(&[&["rig", "new", "recordings/logger.csv", "-o", text(&rig)], &pipe[..]].concat()));
    printed(run(&["import", "recordings/logger.csv", "--rig", text(&rig), "--yes", "-o", text(&table)]));
    let answers = [(text(&table), "leak"), (CREEP, "viscoelastic-wall")].map(|(recording, effect)| {
        let answer = diagnose(&[recording]);
        assert_eq!((&answer["verdict"], &best(&answer)["effect"]), (&"missing-effect".into(), &effect.into()));
        let fit = done(&["calibrate", recording]);
        let (before, free) = (&answer["start"]["rmse_m"], &fit["runs"][0]["rmse_m"]);
        assert_eq!(before.as_f64().unwrap(), free.as_f64().unwrap(), "{recording}");
        // What the record shows by itself stays: its first rise is lower than the flow says, which asks for a leak.
        let shown = done(&["inspect", recording])["doubts"].as_array().unwrap().clone();
        let own = |doubt: &Value| shown.iter().any(|s| doubt.as_str().unwrap().ends_with(s.as_str().unwrap()));
        let doubts = answer["warnings"].as_array().unwrap();
        assert!(doubts.iter().all(own), "{recording}: {doubts:?}");
        answer
    });
    let place_m = parameter(best(&answers[0]), "leak_position_m")["value"].as_f64().unwrap();
    assert!((place_m - 35.0).abs() < 0.05, "{place_m} m");
}

/// Where the number of elements is fixed too low, a leak would make up for the third one.
#[test]
fn elements_that_the_wall_lacks_are_missing_like_an_effect() {
    let folder = tempfile::tempdir().unwrap();
    let model = folder.path().join("model.toml");
    let answer = diagnose(&[CREEP, "--effects", "viscoelastic-wall:1", "--apply", model.to_str().unwrap()]);
    let found = best(&answer);
    assert_eq!(
        (answer["verdict"].as_str(), found["label"].as_str()),
        (Some("missing-effect"), Some("viscoelastic-wall:3"))
    );
    assert!(answer["probability"].as_f64().unwrap() > 0.95, "{}", answer["probability"]);
    let (rmse, noise) = (found["rmse_m"].as_f64().unwrap(), answer["start"]["noise_m"].as_f64().unwrap());
    assert!(rmse < 1.05 * noise, "{rmse} {noise}");
    assert_eq!(found["parameters"].as_array().unwrap().len(), 6);
    let kept = std::fs::read_to_string(&model).unwrap();
    assert!(kept.contains("in_force = 2") && kept.contains("[\"viscoelastic-wall:3\"]"), "{kept}");
}

/// The leak lies at 57.43 m.
#[test]
#[ignore = "takes 36 s; CI runs it at night"]
fn a_leak_is_found_where_it_is() {
    let answer = &diagnosis(&[LEAK, "--effects", "unsteady-friction"]).answer;
    assert_eq!(best(answer)["effect"], "leak");
    let place = parameter(best(answer), "leak_position_m");
    assert!((place["value"].as_f64().unwrap() - 57.43).abs() < 0.5, "{place}");
    assert!(place["standard_error"].as_f64().unwrap() < 1.0, "{place}");
}

/// A sensor's wiring picks up the mains: that is noise, and no effect in the pipe.
#[test]
fn hum_of_the_mains_is_noise() {
    let folder = tempfile::tempdir().unwrap();
    let mut recorded = surgescope::storage::read(&here(NOTHING)).unwrap();
    let pressure = &mut recorded.series[0];
    for (time_s, kpa) in pressure.time_s.iter().zip(&mut pressure.value) {
        *kpa += 0.4 * (std::f64::consts::TAU * 50.0 * time_s).sin();
    }
    let recording = folder.path().join("hum.mcap");
    surgescope::storage::write(&recording, &recorded).unwrap();
    let answer = diagnose(&[text(&recording), "--effects", "viscoelastic-wall"]);
    assert_eq!(answer["verdict"], "nothing-missing", "{answer}");
    let doubts = done(&["inspect", text(&recording)])["doubts"].to_string();
    assert!(doubts.contains("as the mains do"), "{doubts}");
}

#[test]
fn where_nothing_is_missing_nothing_is_found() {
    let answer = &diagnosis(&[NOTHING, "--effects", "viscoelastic-wall"]).answer;
    assert_eq!(answer["verdict"], "nothing-missing");
    let most = answer["candidates"].as_array().unwrap().iter().map(|c| c["probability"].as_f64().unwrap());
    assert!(most.fold(0.0, f64::max) < 0.5);
}

#[test]
#[ignore = "takes 39 s; CI runs it at night"]
fn the_same_question_has_the_same_answer_to_the_last_digit() {
    let question = [LEAK, "--effects", "unsteady-friction"];
    assert_eq!(diagnosis(&question).answer.to_string(), diagnose(&question).to_string());
}

/// What is asked to go on until nothing is missing stops by itself, and shows the errors on the way.
#[test]
#[ignore = "takes 17 s; CI runs it at night"]
fn effects_are_added_until_nothing_is_missing() {
    let text = printed(run(&["diagnose", CREEP, "--until-done"]));
    assert!(text.contains("Refitted to the first three fifths"), "{text}");
    assert!(text.contains("Too small to be seen"), "{text}");
    assert!(text.contains("Missing: viscoelastic-wall") && text.contains("Nothing is missing"), "{text}");
    let stairs = text.split("Models, one after the other:").nth(1).unwrap();
    assert_eq!(stairs.trim().lines().count(), 2, "{stairs}");
}

/// An effect that was added first and stood in for another gives way to it.
#[test]
#[ignore = "takes 20 s; CI runs it at night"]
fn an_effect_that_stood_in_for_another_is_exchanged() {
    let study = Study::open([LEAK]).unwrap();
    let [start, wrong] = ["unsteady-friction", "unsteady-friction,side-branch"].map(|list| parse_list(list).unwrap());
    let mut search = UntilDone::grown_from(start, wrong, Options::default());
    let mut gone = Vec::new();
    while let Some(step) = search.step(&study).unwrap() {
        if let Step::TakenOut(effects) = step {
            gone.extend(effects.iter().map(Chosen::label));
        }
    }
    assert_eq!(gone, ["side-branch"]);
    let last = search.models().last().unwrap();
    assert_eq!(last.labels(), ["unsteady-friction", "leak"]);
    assert_eq!(search.diagnoses().last().unwrap().verdict, Verdict::NothingMissing);
}

/// What an answer adds is in the model that is sampled, and the page of the diagnosis shows the draws.
#[test]
#[ignore = "takes 30 s; CI runs it at night"]
fn the_posterior_is_that_of_the_final_model() {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("page.html");
    let asked = [CREEP, "--most-reaches", "32", "--posterior", "100", "--report", text(&page)];
    let answer = diagnose(&asked);
    assert_eq!(answer["verdict"], "missing-effect");
    let last = &answer["final"];
    assert_eq!(last["effects"], serde_json::json!([best(&answer)["label"]]));
    assert_eq!(last["rmse_m"], best(&answer)["rmse_m"]);
    let sampled = &last["posterior"];
    assert_eq!((&sampled["converged"], &sampled["wanted"]), (&Value::Bool(true), &100.into()), "{sampled}");
    for name in ["wave_speed_m_s", "J1_per_GPa", "tau1_s"] {
        let p = parameter(last, name);
        assert_eq!(p["interval_95"], p["posterior"]["interval_95"], "{p}");
        let [low, high] = [0, 1].map(|i| p["interval_95"][i].as_f64().unwrap());
        assert!((low..high).contains(&p["posterior"]["median"].as_f64().unwrap()), "{p}");
    }
    let html = std::fs::read_to_string(&page).unwrap();
    assert!(html.contains("Joint posterior") && html.contains("Draws of the joint posterior"));
    refused(&["diagnose", CREEP, "--posterior", "99"], &["--posterior", "100"]);
}

#[test]
fn bad_questions_are_refused_with_what_to_do() {
    refused(&["diagnose", "recordings/none.mcap"], &["none.mcap"]);
    refused(&["diagnose", LEAK, "--effects", "leek"], &["leak"]);
    refused(&["diagnose"], &["MCAP"]);
}

/// Copper does not creep: the effect is not tried, and a start model that has it is doubted.
#[test]
#[ignore = "takes 48 s; CI runs it at night"]
fn what_a_rig_cannot_have_is_not_tried_and_is_doubted() {
    let answer = diagnose(&[LEAK, "--effects", "viscoelastic-wall:1"]);
    let warnings = answer["warnings"].to_string();
    assert!(warnings.contains("viscoelastic-wall") && warnings.contains("creeps"), "{warnings}");
    let answer = diagnose(&[LEAK]);
    let tried = answer["candidates"].as_array().unwrap();
    assert!(tried.iter().all(|c| c["effect"] != "viscoelastic-wall"));
    assert_eq!(answer["not_tried"][0]["effect"], "viscoelastic-wall");
    // Unsteady friction explains most of it; that a leak is missing, too, does not make that less so.
    assert_eq!(best(&answer)["effect"], "unsteady-friction");
    assert!(answer["probability"].as_f64().unwrap() > 0.8, "{answer}");
    assert!(best(&answer)["held_out_m"].as_f64() < answer["start"]["held_out_m"].as_f64());
}

/// A sensor's gain is arithmetic, so its recordings can be made without any solver: much is found, less than the
/// program calls visible is not.
#[test]
#[ignore = "takes 23 s; CI runs it at night"]
fn the_least_visible_gain_is_where_it_says() {
    let nothing = &diagnosis(&[NOTHING, "--effects", "viscoelastic-wall"]).answer;
    let seen = nothing["least_visible"].as_array().unwrap();
    let gain = seen.iter().find(|v| v["effect"].as_str().unwrap().starts_with("sensor-gain@")).unwrap();
    let sensor = gain["effect"].as_str().unwrap().split('@').nth(1).unwrap();
    let least = gain["value"].as_f64().unwrap();
    assert!(least > 0.0 && least < 0.02, "{gain}");
    let folder = tempfile::tempdir().unwrap();
    let rig = folder.path().join("rig.toml");
    std::fs::write(&rig, surgescope::storage::read(&here(NOTHING)).unwrap().rig.source).unwrap();
    let with_gain = |error: f64| {
        let csv = folder.path().join("gain.csv");
        let mcap = folder.path().join(format!("gain{error}.mcap"));
        let _ = std::fs::remove_file(&csv);
        printed(run(&["export", NOTHING, "-o", text(&csv)]));
        let whole = std::fs::read_to_string(&csv).unwrap();
        let column = whole.lines().next().unwrap().split(',').position(|name| name == sensor).unwrap();
        let changed: Vec<String> = whole
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
        printed(run(&["import", text(&csv), "--rig", text(&rig), "-o", text(&mcap)]));
        diagnose(&[text(&mcap), "--effects", "viscoelastic-wall"])
    };
    let large = with_gain(0.06);
    assert_eq!(best(&large)["effect"], "sensor-gain", "{large}");
    assert_eq!(with_gain(0.3 * least)["verdict"], "nothing-missing");
}

/// A leak and a slow sensor in one record: neither explains it alone, and both are named at once with their values.
#[test]
fn two_effects_at_once_are_named_together() {
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("both.mcap");
    let truth = ["lag_time_s=0.04", "lag_damping_ratio=1", "leak_position_m=60", "leak_cda_mm2=4"];
    let rig = here("rigs/demo-hdpe.toml");
    let fixed = ["record", "--rig", text(&rig), "--simulate", "--speed", "0", "--duration", "8", "--effects"];
    let made = [&fixed[..], &["sensor-lag@P2,leak", "-o", text(&recording), "--set"], &truth].concat();
    printed(run(&made));
    let answer = diagnose(&[text(&recording), "--effects", "none", "--most-reaches", "64"]);
    assert_eq!(answer["verdict"], "missing-effect");
    let pair = &answer["pair"];
    let mut effects: Vec<&str> = pair["effects"].as_array().unwrap().iter().map(|e| e.as_str().unwrap()).collect();
    effects.sort_unstable();
    assert_eq!(effects, ["leak", "sensor-lag"]);
    assert!(pair["probability"].as_f64().unwrap() > 0.9 && answer["probability"] == pair["probability"], "{pair}");
    for truth in truth.iter().filter(|t| !t.starts_with("lag_damping")) {
        let (name, value) = truth.split_once('=').unwrap();
        let (found, exact) = (parameter(pair, name)["value"].as_f64().unwrap(), value.parse::<f64>().unwrap());
        assert!((found / exact - 1.0).abs() < 0.02, "{name}: {found}");
    }
    // each is in the pair, so each is missing with at least its probability
    for effect in effects {
        let own = answer["candidates"].as_array().unwrap().iter().find(|c| c["effect"] == effect).unwrap();
        assert!(own["probability"].as_f64().unwrap() >= pair["probability"].as_f64().unwrap());
    }
}
