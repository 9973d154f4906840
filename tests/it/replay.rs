//! What a CI job relies on: recordings give the results kept beside them, or `surgescope replay` says which one moved.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tempfile::TempDir;

use crate::common::{ended, here, surgescope};

fn shipped() -> PathBuf {
    here("recordings")
}

/// Runs `surgescope replay` with arguments and a path: exit code, standard output, standard error.
fn replay(arguments: &str, path: &Path) -> (i32, String, String) {
    ended(surgescope(["replay"]).args(arguments.split_whitespace()).arg(path).output().unwrap())
}

/// A shipped recording alone in a folder, with its expected results after an edit; none where the edit gives none.
fn bench(edit: impl Fn(String) -> Option<String>) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("hdpe.mcap");
    fs::copy(shipped().join("hdpe-nothing-missing.mcap"), &recording).unwrap();
    let expected = fs::read_to_string(shipped().join("hdpe-nothing-missing.expected.toml")).unwrap();
    if let Some(text) = edit(expected) {
        fs::write(folder.path().join("hdpe.expected.toml"), text).unwrap();
    }
    (folder, recording)
}

/// The text with the value of a quantity put in place of the one it has.
fn with_value(text: &str, name: &str, value: f64) -> String {
    let start = text.find(&format!("\n{name} = ")).expect("the quantity is expected") + 1;
    let end = start + text[start..].find('\n').unwrap();
    format!("{}{name} = {{ value = {value}, tolerance = 0.001 }}{}", &text[..start], &text[end..])
}

/// How many quantities are expected of a recording.
fn expected_of(recording: &Path) -> usize {
    let text = fs::read_to_string(recording.with_extension("expected.toml")).unwrap();
    text.lines().filter(|l| l.contains(" = { value = ")).count()
}

#[test]
fn the_shipped_recordings_give_their_results() {
    let (code, out, err) = replay("", &shipped());
    assert_eq!(code, 0, "{out}\n{err}");
    assert!(out.contains("of 4 recordings compared: all held"), "{out}");
    assert!(err.contains("[1/4]") && err.contains("adelaide-severe.mcap"), "folders are searched too: {err}");
}

#[test]
fn a_result_that_moved_is_named() {
    let (_folder, recording) = bench(|text| Some(with_value(&text, "period_s", 1.1)));
    let (code, out, err) = replay("", &recording);
    assert_eq!(code, 1, "{out}\n{err}");
    let moved: Vec<&str> = out.lines().filter(|l| l.contains("inspect.period_s")).collect();
    assert_eq!(moved.len(), 1, "{out}");
    assert!(moved[0].contains("1.10000") && moved[0].contains("1.015") && moved[0].contains("MOVED"), "{out}");
    assert!(!out.contains("rmse_m"), "what held is not shown: {out}");
    assert!(replay("--verbose", &recording).1.contains("calibrate.rmse_m"), "but with --verbose it is");
}

#[test]
fn a_result_that_is_gone_is_named() {
    let line = "\nJ9_per_GPa = { value = 0.1, tolerance = 10.0 }\n";
    let (_folder, recording) =
        bench(|text| Some(text.replace("[calibrate.parameter]", &format!("[calibrate.parameter]{line}"))));
    let (code, out, _) = replay("", &recording);
    assert_eq!(code, 1, "{out}");
    assert!(out.lines().any(|l| l.contains("calibrate.parameter.J9_per_GPa") && l.contains("GONE")), "{out}");
}

#[test]
fn a_recording_without_expected_results_is_no_success() {
    let (_folder, recording) = bench(|_| None);
    let (code, _, err) = replay("", &recording);
    assert_eq!(code, 2, "{err}");
    assert!(err.contains("hdpe.expected.toml does not exist") && err.contains("replay --accept"), "{err}");
    let (_folder, recording) = bench(|_| Some("effects = \"none\"\n".into()));
    let (code, _, err) = replay("", &recording);
    assert_eq!(code, 2, "{err}");
    assert!(err.contains("no quantity to compare"), "{err}");
}

#[test]
fn accepted_results_hold_from_then_on() {
    let (folder, recording) = bench(|_| None);
    let before = fs::read(&recording).unwrap();
    let (code, out, err) = replay("--accept --effects viscoelastic-wall:2", &recording);
    assert_eq!(code, 0, "{out}\n{err}");
    let file = folder.path().join("hdpe.expected.toml");
    let text = fs::read_to_string(&file).unwrap();
    assert!(text.contains("effects = \"viscoelastic-wall:2\"") && text.contains("\ntau2_s = {"), "{text}");
    let (code, out, err) = replay("", folder.path());
    assert_eq!(code, 0, "{out}\n{err}");
    assert!(out.contains("viscoelastic-wall:2") && out.contains("all held"), "{out}");
    assert_eq!(fs::read_to_string(&file).unwrap(), text, "without --accept nothing is written");

    // accepted again after an edit: the effects stay, the values are new
    fs::write(&file, with_value(&text, "period_s", 1.1)).unwrap();
    let (code, out, _) = replay("--accept", &recording);
    assert_eq!(code, 0, "{out}");
    assert!(out.contains("inspect.period_s") && out.contains("MOVED"), "what is accepted is shown: {out}");
    assert_eq!(fs::read_to_string(&file).unwrap(), text);
    assert_eq!(fs::read(&recording).unwrap(), before, "the recording is as it was");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2, "nothing else is left behind");
}

#[test]
fn a_slip_in_the_expected_results_is_named_with_its_line() {
    let (_folder, recording) = bench(|text| Some(text.replace("\nperiod_s", "\nperiod_ms")));
    let (code, _, err) = replay("", &recording);
    assert_eq!(code, 2, "{err}");
    let text = fs::read_to_string(recording.with_extension("expected.toml")).unwrap();
    let line = 1 + text.lines().position(|l| l.starts_with("period_ms")).unwrap();
    assert!(err.contains(&format!("hdpe.expected.toml:{line}: unknown key 'period_ms'")), "{err}");
    assert!(err.contains("did you mean 'period_s'?"), "{err}");
    // not even --accept writes over what it does not understand
    assert_eq!(replay("--accept", &recording).0, 2);
    assert_eq!(fs::read_to_string(recording.with_extension("expected.toml")).unwrap(), text);
}

#[test]
fn a_torn_recording_is_an_error_and_the_others_are_compared() {
    let (folder, recording) = bench(Some);
    let whole = fs::read(&recording).unwrap();
    fs::write(folder.path().join("a-torn.mcap"), &whole[..whole.len() / 2]).unwrap();
    fs::copy(recording.with_extension("expected.toml"), folder.path().join("a-torn.expected.toml")).unwrap();
    let (code, out, err) = replay("", folder.path());
    assert_eq!(code, 2, "{out}\n{err}");
    assert!(err.contains("a-torn.mcap") && err.contains("1 of 2 recordings could not be compared"), "{err}");
    assert!(out.contains(&format!("hdpe.mcap: {} held", expected_of(&recording))), "{out}");
}

#[test]
fn a_folder_without_recordings_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let (code, _, err) = replay("", folder.path());
    assert_eq!(code, 2, "{err}");
    assert!(err.contains("contain no recording"), "{err}");
}

#[test]
fn json_is_one_document_with_every_comparison() {
    let (folder, recording) = bench(|text| Some(with_value(&text, "wave_speed_m_s", 400.0)));
    fs::copy(&recording, folder.path().join("unexpected.mcap")).unwrap();
    let (code, out, _) = replay("--json", folder.path());
    assert_eq!(code, 2, "one has no expected results");
    let document: Value = serde_json::from_str(&out).expect("one document");
    let all = expected_of(&recording);
    assert!(all > 20, "{all}");
    assert_eq!((document["compared"].as_u64(), document["moved"].as_u64()), (Some(all as u64), Some(1)));
    let [hdpe, other] = document["recordings"].as_array().unwrap().as_slice() else { panic!("{out}") };
    assert!(other["error"].as_str().unwrap().contains("unexpected.expected.toml does not exist"));
    assert_eq!(hdpe["effects"][0], "viscoelastic-wall:3");
    let comparisons = hdpe["comparisons"].as_array().unwrap();
    assert_eq!(comparisons.len(), all);
    for c in comparisons {
        let (expected, found) = (c["expected"].as_f64().unwrap(), c["found"].as_f64().unwrap());
        let moved = (found - expected).abs() > c["tolerance"].as_f64().unwrap();
        assert_eq!(c["verdict"], if moved { "moved" } else { "held" });
        assert_eq!(moved, c["quantity"] == "calibrate.parameter.wave_speed_m_s");
    }
}
