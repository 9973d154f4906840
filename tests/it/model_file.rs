//! A file of models: it grows, is edited by hand, goes a step back, and refuses what contradicts it.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::common::{CREEP, LEAK, calibration, done, refused, text};

/// The models of a leaking copper pipe: a first one without the leak.
fn calibrated(folder: &Path) -> PathBuf {
    let file = folder.join("copper.toml");
    std::fs::write(&file, &calibration(&[LEAK, "--effects", "unsteady-friction", "--against", "none"]).file).unwrap();
    file
}

fn rmse_m(models: &Value, number: usize) -> f64 {
    models["models"][number - 1]["rmse_m"].as_f64().unwrap()
}

fn edit(file: &Path, from: &str, to: &str) {
    let text = std::fs::read_to_string(file).unwrap();
    assert!(text.contains(from), "no {from:?} in {text}");
    std::fs::write(file, text.replacen(from, to, 1)).unwrap();
}

/// The value in a parameter's lines, as it stands there.
fn value_of(lines: &str) -> String {
    lines.lines().find_map(|l| l.strip_prefix("value = ")).unwrap().to_owned()
}

/// The lines of a parameter of the last model in the file.
fn lines_of(file: &Path, parameter: &str) -> String {
    let text = std::fs::read_to_string(file).unwrap();
    let last = text.split(&format!("name = \"{parameter}\"")).last().unwrap();
    last.split("[[").next().unwrap().to_owned()
}

#[test]
fn an_effect_is_added_and_taken_back_and_nothing_is_lost() {
    let folder = tempfile::tempdir().unwrap();
    let file = calibrated(folder.path());
    let name = text(&file);

    let grown = done(&["add", "leak", name]);
    assert_eq!(grown["in_force"], 2);
    assert_eq!(grown["models"][1]["grown_from"], 1);
    assert!(rmse_m(&grown, 2) < 0.5 * rmse_m(&grown, 1));
    assert!(grown["models"][1]["evidence"].as_f64().unwrap() > 100.0);
    let parameters = grown["models"][1]["parameter"].as_array().unwrap();
    let place = parameters.iter().find(|p| p["name"] == "leak_position_m").unwrap();
    assert!((place["value"].as_f64().unwrap() - 57.43).abs() < 0.5, "{place}");

    let back = done(&["undo", name]);
    assert_eq!(back["in_force"], 1);
    assert_eq!(back["models"], grown["models"]);
    refused(&["undo", name], &["no step back"]);
}

#[test]
#[ignore = "takes 11 s; CI runs it at night"]
fn what_a_person_holds_stays_held_through_refit_and_growth() {
    let folder = tempfile::tempdir().unwrap();
    let file = calibrated(folder.path());
    let name = text(&file);
    let before = lines_of(&file, "wave_speed_m_s");
    let value: f64 = before.lines().find_map(|l| l.strip_prefix("value = ")).unwrap().parse().unwrap();
    let held = before.replace(&format!("value = {value}"), &format!("value = {}", value + 3.0));
    edit(&file, &before, &held.replace("fixed = false", "fixed = true"));

    for models in [done(&["refit", name]), done(&["add", "leak", name])] {
        let last = models["models"].as_array().unwrap().last().unwrap();
        let speed = last["parameter"].as_array().unwrap().iter().find(|p| p["name"] == "wave_speed_m_s").unwrap();
        assert_eq!(speed["value"].as_f64().unwrap(), value + 3.0);
        assert_eq!(speed["fixed"], true);
        assert!(speed["lower"].as_f64().unwrap() < value && speed["upper"].as_f64().unwrap() > value + 3.0);
        assert!(last["parameter"].as_array().unwrap().iter().any(|p| p["fixed"] == false));
    }
    let models = done(&["model", name]);
    assert!(rmse_m(&models, 2) > rmse_m(&models, 1), "a wrong wave speed costs nothing");
}

/// `diagnose --apply` makes the file, grows it by what is missing, and goes on from there the next time.
#[test]
#[ignore = "takes 30 s; CI runs it at night"]
fn a_diagnosis_grows_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("models.toml");
    let name = text(&file);
    let first = done(&["diagnose", LEAK, "--effects", "unsteady-friction", "--apply", name]);
    assert_eq!(first["candidates"][0]["effect"], "leak");
    let models = done(&["model", name]);
    assert_eq!(models["in_force"], 2);
    assert!(models["models"][1]["why"].as_str().unwrap().contains("leak"));
    let second = done(&["diagnose", LEAK, "--apply", name]);
    assert_eq!(second["verdict"], "nothing-missing", "{second}");
    assert_eq!(done(&["model", name])["models"], models["models"]);
}

#[test]
fn contradictions_are_refused_and_the_file_is_left_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let file = calibrated(folder.path());
    let name = text(&file);
    let good = std::fs::read_to_string(&file).unwrap();
    refused(&["add", "leek", name], &["leek", "leak"]);
    refused(&["add", "unsteady-friction", name], &["unsteady-friction"]);
    refused(&["calibrate", CREEP, "--save", name], &["copper-leak.mcap", "another file"]);
    refused(&["diagnose", LEAK, "--effects", "leak", "--apply", name], &["current model"]);
    refused(&["model", LEAK], &["copper-leak.mcap"]);
    refused(&["refit", "no-such-file.toml"], &["no-such-file.toml"]);
    assert_eq!(std::fs::read_to_string(&file).unwrap(), good);

    let speed = lines_of(&file, "wave_speed_m_s");
    let upper = speed.lines().find(|l| l.starts_with("upper = ")).unwrap().to_owned();
    for (from, to, said) in [
        (upper.as_str(), "upper = 3.0", "above the upper one"),
        ("name = \"wave_speed_m_s\"", "name = \"wave_sped_m_s\"", "wave_sped_m_s"),
        (&format!("value = {}", value_of(&speed)), "value = 3.0", "outside its bounds"),
        ("in_force = 1", "in_force = 7", "does not exist"),
        ("recordings = [\"", "recordings = [] # [\"", "names no recordings"),
        ("when = ", "wen = ", "wen"),
        ("effects = [\"unsteady-friction\"]", "effects = [\"friction\"]", "friction"),
        ("recordings = [\"", "recordings = [\"/gone", "gone"),
    ] {
        edit(&file, from, to);
        let edited = std::fs::read_to_string(&file).unwrap();
        refused(&["refit", name], &[said]);
        assert_eq!(std::fs::read_to_string(&file).unwrap(), edited);
        std::fs::write(&file, &good).unwrap();
    }
}

/// Bounds that a parameter cannot have are refused, whichever way they come in.
#[test]
fn impossible_bounds_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = calibrated(folder.path());
    let speed = lines_of(&file, "wave_speed_m_s");
    let lower = speed.lines().find(|l| l.starts_with("lower = ")).unwrap().to_owned();
    edit(&file, &lower, "lower = -1.0");
    refused(&["refit", text(&file)], &["wave_speed_m_s", "-1"]);
    refused(&["calibrate", LEAK, "--hold", "wave_speed_m_s=-5"], &["wave_speed_m_s", "-5"]);
    refused(&["diagnose", LEAK, "--effects", "sensor-lag@P9"], &["P9", "P1"]);
    refused(&["diagnose", LEAK, "--apply", "no/such/folder/models.toml"], &["does not exist", "no/such/folder"]);
}

/// A link stays a link, and what may not be written to is not.
#[cfg(unix)]
#[test]
#[ignore = "takes 14 s; CI runs it at night"]
fn links_and_permissions_are_respected() {
    let folder = tempfile::tempdir().unwrap();
    let file = calibrated(folder.path());
    let link = folder.path().join("link.toml");
    std::os::unix::fs::symlink(&file, &link).unwrap();
    done(&["add", "leak", text(&link)]);
    assert!(std::fs::symlink_metadata(&link).unwrap().file_type().is_symlink());
    assert_eq!(done(&["model", text(&file)])["in_force"], 2);
    let mut permissions = std::fs::metadata(&file).unwrap().permissions();
    permissions.set_readonly(true);
    std::fs::set_permissions(&file, permissions).unwrap();
    let before = std::fs::read_to_string(&file).unwrap();
    refused(&["undo", text(&file)], &["may not be written"]);
    assert_eq!(std::fs::read_to_string(&file).unwrap(), before);
}
