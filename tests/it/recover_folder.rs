//! `recover FOLDER`: what a rig computer does when the power comes back.

use std::fs;
use std::path::Path;

use surgescope::storage as log;

use crate::common::{CREEP, ended, here, refused, run, text};

/// The answer of a recovery that lost something, and that of one that did not.
fn recovered(folder: &Path, expected: i32) -> serde_json::Value {
    let (code, out, err) = ended(run(&["recover", text(folder), "--json"]));
    assert_eq!(code, expected, "{err}");
    serde_json::from_str(&out).unwrap()
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = entries.collect();
    names.sort();
    names
}

#[test]
fn every_torn_recording_of_a_folder_becomes_a_whole_one_and_nothing_else_is_touched() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    let whole = fs::read(here(CREEP)).unwrap();
    fs::write(folder.join("whole.mcap"), &whole).unwrap();
    fs::write(folder.join("torn.mcap"), &whole[..whole.len() / 2]).unwrap();
    fs::write(folder.join("empty.mcap"), b"").unwrap();
    fs::write(folder.join("notes.txt"), b"mine").unwrap();

    let answer = recovered(folder, 3);
    let files = ["empty.mcap.torn", "notes.txt", "torn-recovered.mcap", "torn.mcap.torn", "whole.mcap"];
    assert_eq!(names(folder), files);
    assert_eq!(answer["recovered"].as_array().unwrap().len(), 1);
    assert!(answer["failed"][0]["source"].as_str().unwrap().ends_with("empty.mcap"), "{answer}");
    assert_eq!(fs::read(folder.join("whole.mcap")).unwrap(), whole);
    assert_eq!(fs::read(folder.join("torn.mcap.torn")).unwrap(), whole[..whole.len() / 2], "the torn file stays");
    let (all, saved) = (log::read(&here(CREEP)).unwrap(), log::read(&folder.join("torn-recovered.mcap")).unwrap());
    let (all, saved) = (&all.series[0], &saved.series[0]);
    assert!(saved.value.len() > all.value.len() / 4, "{} of {}", saved.value.len(), all.value.len());
    assert_eq!(saved.value[..], all.value[..saved.value.len()]);

    assert_eq!(recovered(folder, 0)["recovered"], serde_json::json!([]), "the second time there is nothing to do");
    assert_eq!(names(folder), files);

    // killed after it had written the whole one, and before it put the torn one aside
    fs::rename(folder.join("torn.mcap.torn"), folder.join("torn.mcap")).unwrap();
    recovered(folder, 0);
    assert_eq!(names(folder), files);
}

#[test]
fn a_recording_that_grows_is_left_alone() {
    let place = tempfile::tempdir().unwrap();
    let file = place.path().join("run.mcap");
    let whole = fs::read(here(CREEP)).unwrap();
    fs::write(&file, &whole[..1000]).unwrap();
    let grown = file.clone();
    let (done, wait) = std::sync::mpsc::channel::<()>();
    let writer = std::thread::spawn(move || {
        let mut length = 1000;
        let tick = std::time::Duration::from_millis(50);
        while wait.recv_timeout(tick) == Err(std::sync::mpsc::RecvTimeoutError::Timeout) && length + 100 < whole.len() {
            length += 100;
            fs::write(&grown, &whole[..length]).unwrap();
        }
    });
    let (code, _, err) = ended(run(&["recover", text(place.path())]));
    drop(done);
    writer.join().unwrap();
    assert!(code == 0 && err.contains("is being recorded"), "{code}: {err}");
    assert_eq!(names(place.path()), ["run.mcap"]);
}

#[test]
fn a_recording_needs_a_name_for_the_whole_one_and_a_folder_does_not() {
    let place = tempfile::tempdir().unwrap();
    refused(&["recover", CREEP], &["--output is missing"]);
    refused(&["recover", text(place.path()), "-o", "x.mcap"], &["--output is for one recording"]);
}
