//! What a command tells beside its result: each warning on standard error stands in the JSON document, too.

use serde_json::Value;

use crate::common::{CREEP, LEAK, ended, run, text};

/// The lines of standard error that warn, and the `warnings` of the document.
fn told(arguments: &[&str]) -> (Vec<String>, Vec<String>) {
    let (code, out, err) = ended(run(&[arguments, &["--json"]].concat()));
    assert_eq!(code, 0, "{arguments:?}: {err}");
    let document: Value = serde_json::from_str(&out).unwrap_or_else(|e| panic!("{arguments:?}: {e}: {out}"));
    let list = document["warnings"].as_array().unwrap_or_else(|| panic!("{arguments:?}: {document}"));
    let of = |warning: &Value| warning["text"].as_str().or(warning.as_str()).unwrap().to_owned();
    let lines = err.lines().filter_map(|line| line.strip_prefix("warning: ")).map(str::to_owned).collect();
    (lines, list.iter().map(of).collect())
}

/// A number that draws what is hidden, and nothing is hidden.
#[test]
fn a_seed_without_anything_hidden_says_what_to_write() {
    let (code, _, err) = ended(run(&["demo", "--seed", "7"]));
    assert!(code == 2 && err.contains("`surgescope demo --hidden leak --seed 7`"), "{err}");
}

#[test]
fn every_warning_on_standard_error_is_in_the_document() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (csv, model, table, again) = (at("out.csv"), at("model.toml"), at("table.csv"), at("again.mcap"));
    let with_model = at("with-model.mcap");
    let rig = "rigs/demo-hdpe.toml";
    // P1 is in kPa by the rig, but holds bar.
    let rows: Vec<String> =
        (0..30).map(|i| format!("{:.1},2.4{i:02},24{i:02},23{i:02},1.0,20", 0.1 * f64::from(i))).collect();
    std::fs::write(&table, format!("time_s,P1,P2,P3,Q1,T1\n{}\n", rows.join("\n"))).unwrap();
    let cases: [(&[&str], &str); 8] = [
        (&["simulate", "--rig", rig, "--set", "initial_velocity_m_s=2", "-o", text(&csv)], "below vapour pressure"),
        (
            &["calibrate", LEAK, "--hold", "closing_time_s=9000", "--save", text(&model)],
            "--hold closing_time_s=9000 lies",
        ),
        (&["predict", text(&model), LEAK], "is one of the recordings"),
        (&["frequency", LEAK, "--model", text(&model)], "is one of the recordings"),
        (&["add", "viscoelastic-wall:1", text(&model)], "viscoelastic-wall:1: no pipe"),
        (&["valve", CREEP], "openings from"),
        (&["import", text(&table), "--rig", rig, "-o", text(&again)], "P1"),
        (&["export", LEAK, "--with-model", text(&model), "-o", text(&with_model)], ""),
    ];
    for (arguments, words) in cases {
        let (lines, list) = told(arguments);
        assert!(words.is_empty() || lines.iter().any(|line| line.contains(words)), "{arguments:?}: {lines:#?}");
        assert!(lines.iter().all(|line| list.contains(line)), "{arguments:?}: {lines:#?} are not all in {list:#?}");
        let once = list.iter().filter(|text| **text == list[0]).count();
        assert!(list.is_empty() || once == 1, "{arguments:?}: {list:#?}");
    }
    // Where nothing is to be told, the list is there and empty.
    assert_eq!(told(&["effects"]), (Vec::new(), Vec::new()));
}

/// The friction has one name in what was not set: the factor, in which its scale is contained.
#[test]
fn the_friction_that_was_used_is_told_once() {
    let used = |more: &[&str]| {
        let settings =
            ["simulate", "--rig", "rigs/demo-hdpe.toml", "--duration", "0.1", "--set", "initial_velocity_m_s=0.5"];
        let (code, _, err) = ended(run(&[&settings[..], more].concat()));
        assert_eq!((code, err.contains("friction_scale=")), (0, false), "{err}");
        let (_, behind) = err.split_once("friction_factor=").unwrap();
        behind.split_whitespace().next().unwrap().parse::<f64>().unwrap()
    };
    let (usual, twice) = (used(&[]), used(&["friction_scale=2"]));
    assert!((twice / usual - 2.0).abs() < 1e-5, "{usual} {twice}");
}

/// A demonstration that hides an effect ends with its true values beside those found, and another seed hides others.
#[test]
#[cfg(unix)]
fn a_demonstration_ends_with_the_truth_beside_what_was_found() {
    let shown = |seed: &str| {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("demo");
        let asked = ["demo", "--hidden", "leak", "--seed", seed, "--speed", "100", "-o", text(&out), "--json"];
        let (code, out, err) = ended(run(&asked));
        assert_eq!(code, 0, "{err}");
        let document: Value = serde_json::from_str(&out).unwrap();
        assert_eq!((&document["hidden"], &document["answer"]), (&"leak".into(), &"leak".into()), "{document}");
        let truth = document["truth"].as_array().unwrap().clone();
        assert_eq!(truth.len(), 3, "{truth:?}");
        for value in &truth {
            let of = |key: &str| value[key].as_f64().unwrap();
            // The model that finds them made the test: only its grid and the device's counts differ.
            assert!((of("found") - of("hidden")).abs() < 5.0 * of("standard_error") + 1e-3 * of("hidden"), "{value}");
        }
        truth.iter().map(|value| value["hidden"].as_f64().unwrap()).collect::<Vec<_>>()
    };
    let (first, second) = (shown("3"), shown("4"));
    assert_eq!(first[0], second[0], "the wave speed is the pipe's");
    assert!(first[1..].iter().zip(&second[1..]).all(|(a, b)| a != b), "{first:?} {second:?}");
}
