//! A recording with a model beside it: `export --with-model`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use prost::Message as _;
use serde_json::Value;
use surgescope::storage::schema::{MODELLED, Modelled};
use tempfile::TempDir;

use crate::common::{CREEP, HERE, NOTHING, calibration, done, here, refused, run, text};

/// A model of a shipped recording, fitted once for all tests, in a folder of its own.
fn model_of(recording: &str) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.toml");
    std::fs::write(&path, &calibration(&[recording, "--effects", "viscoelastic-wall:1", "--against", "none"]).file)
        .unwrap();
    (folder, path)
}

/// The bytes of messages by topic, with their times; the metadata and the attachments.
struct Content {
    messages: BTreeMap<String, Vec<(u64, Vec<u8>)>>,
    metadata: BTreeMap<String, BTreeMap<String, String>>,
    attachments: BTreeMap<String, Vec<u8>>,
    units: BTreeMap<String, String>,
    modelled: Vec<String>,
}

fn content(path: &Path) -> Content {
    let bytes = std::fs::read(path).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let mut found = Content {
        messages: BTreeMap::new(),
        metadata: BTreeMap::new(),
        attachments: BTreeMap::new(),
        units: BTreeMap::new(),
        modelled: Vec::new(),
    };
    for channel in summary.channels.values() {
        found.units.insert(channel.topic.clone(), channel.metadata["unit"].clone());
        if channel.schema.as_ref().is_some_and(|schema| schema.name == MODELLED) {
            found.modelled.push(channel.topic.clone());
        }
    }
    found.modelled.sort();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        let own = found.messages.entry(message.channel.topic.clone()).or_default();
        own.push((message.log_time, message.data.to_vec()));
    }
    for index in &summary.metadata_indexes {
        let metadata = mcap::read::metadata(&bytes, index).unwrap();
        found.metadata.insert(metadata.name, metadata.metadata);
    }
    for index in &summary.attachment_indexes {
        let attachment = mcap::read::attachment(&bytes, index).unwrap();
        found.attachments.insert(attachment.name, attachment.data.to_vec());
    }
    found
}

fn modelled(messages: &[(u64, Vec<u8>)]) -> Vec<(u64, f64)> {
    messages.iter().map(|(time, data)| (*time, Modelled::decode(&data[..]).unwrap().value.unwrap())).collect()
}

/// The residual is what was measured minus what is modelled, at the times of the samples; all that was there is there
/// as it was.
#[test]
fn a_copy_holds_the_recording_and_the_model_beside_it() {
    let (folder, model) = model_of(CREEP);
    let both = folder.path().join("run+model.mcap");
    let told = done(&["export", CREEP, "--with-model", text(&model), "-o", text(&both)]);
    assert_eq!(told["own_values"], "fitted");
    let (before, after) = (content(&here(CREEP)), content(&both));
    assert_eq!(after.attachments, before.attachments);
    for (topic, messages) in &before.messages {
        assert_eq!(&after.messages[topic], messages, "{topic}");
    }
    for (name, entries) in &before.metadata {
        assert_eq!(&after.metadata[name], entries, "{name}");
    }
    assert_eq!(after.metadata["surgescope.model"]["effects"], "viscoelastic-wall:1");
    assert!(after.metadata["surgescope.model"]["wave_speed_m_s"].parse::<f64>().is_ok_and(|a| a > 100.0));
    let wanted = ["P1", "P2", "P3"].map(|s| [format!("/{s}/model"), format!("/{s}/residual")]).concat();
    assert_eq!(after.modelled, wanted);

    let fit = &calibration(&[CREEP, "--effects", "viscoelastic-wall:1", "--against", "none"]).answer;
    let recording = surgescope::storage::read(&here(CREEP)).unwrap();
    for sensor in ["P1", "P2", "P3"] {
        let place = recording.rig.sensors.iter().position(|s| s.name == sensor).unwrap();
        let series = &recording.series[place];
        let of = |what: &str| modelled(&after.messages[&format!("/{sensor}/{what}")]);
        let (model, residual) = (of("model"), of("residual"));
        assert_eq!((model.len(), residual.len()), (series.value.len(), series.value.len()));
        let times: Vec<u64> = before.messages[&format!("/{sensor}")].iter().map(|(time, _)| *time).collect();
        for (i, measured) in series.value.iter().enumerate() {
            assert_eq!((model[i].0, residual[i].0), (times[i], times[i]));
            assert!((measured - model[i].1 - residual[i].1).abs() < 1e-9, "{sensor}, sample {i}");
        }
        assert_eq!(after.units[&format!("/{sensor}/model")], recording.rig.sensors[place].unit.symbol);

        // As the fit has it: kilopascals against metres of water.
        let closure_s = done(&["inspect", CREEP])["closure"]["start_s"].as_f64().unwrap();
        let after: Vec<f64> =
            series.time_s.iter().zip(&residual).filter(|(t, _)| **t > closure_s).map(|(_, r)| r.1).collect();
        let rms_kpa = (after.iter().map(|r| r * r).sum::<f64>() / after.len() as f64).sqrt();
        let sensors = fit["runs"][0]["sensors"].as_array().unwrap();
        let rmse_m = sensors.iter().find(|s| s["name"] == sensor).unwrap()["rmse_m"].as_f64().unwrap();
        let rms_m = rms_kpa / 9.81 / 0.9977;
        assert!((rms_m / rmse_m - 1.0).abs() < 0.03, "{sensor}: {rms_m} m here, {rmse_m} m in the fit");
    }
}

/// The added channels change nothing of what the program reads: a recording is a recording.
#[test]
fn the_copy_is_read_as_the_recording_that_it_was_made_from() {
    let (folder, model) = model_of(NOTHING);
    let both = folder.path().join("run+model.mcap");
    done(&["export", NOTHING, "--with-model", text(&model), "-o", text(&both)]);
    let without_names = |path: &str, command: &[&str]| {
        let mut told = done(&[command, &[path]].concat());
        let object = told.as_object_mut().unwrap();
        object.retain(|key, _| !["file", "source", "seconds"].contains(&key.as_str()));
        told
    };
    assert_eq!(without_names(text(&both), &["inspect"]), without_names(NOTHING, &["inspect"]));
    let value = |path: &str| {
        let told = done(&["calibrate", path, "--against", "none"]);
        told["parameters"].as_array().unwrap().iter().map(|p| p["value"].as_f64().unwrap()).collect::<Vec<_>>()
    };
    assert_eq!(value(text(&both)), value(NOTHING));
    let (csv, csv_of_copy) = (folder.path().join("a.csv"), folder.path().join("b.csv"));
    done(&["export", NOTHING, "-o", text(&csv)]);
    done(&["export", text(&both), "-o", text(&csv_of_copy)]);
    assert!(std::fs::read(csv).unwrap() == std::fs::read(csv_of_copy).unwrap());
}

/// A recording that the model was not fitted to is predicted: its own values come from its signals.
#[test]
fn another_recording_of_the_rig_is_predicted() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let record = |name: &str, velocity: &str| {
        let set = format!("initial_velocity_m_s={velocity}");
        let simulated = ["record", "--rig", "rigs/demo-hdpe.toml", "--simulate", "--speed", "0", "--rate", "200"];
        let more =
            ["--duration", "5", "--effects", "viscoelastic-wall:1", "--set", "J1_per_GPa=0.12", "tau1_s=0.1", &set];
        done(&[&simulated[..], &more, &["-o", text(&at(name))]].concat());
    };
    record("slow.mcap", "0.3");
    record("fast.mcap", "0.5");
    let model = at("model.toml");
    let slow = at("slow.mcap");
    let fit =
        ["calibrate", text(&slow), "--effects", "viscoelastic-wall:1", "--against", "none", "--save", text(&model)];
    done(&fit);
    let told = done(&["export", text(&at("fast.mcap")), "--with-model", text(&model), "-o", text(&at("both.mcap"))]);
    assert_eq!(told["own_values"], "read from its signals");
    let rms = |sensor: &Value| sensor["residual_rms"].as_f64().unwrap();
    let noise = done(&["export", text(&slow), "--with-model", text(&model), "-o", text(&at("own.mcap"))]);
    for (predicted, fitted) in told["sensors"].as_array().unwrap().iter().zip(noise["sensors"].as_array().unwrap()) {
        assert!(rms(predicted) < 3.0 * rms(fitted), "{predicted} against {fitted}");
    }
}

#[test]
fn what_cannot_be_exported_with_a_model_is_refused() {
    let (folder, model) = model_of(CREEP);
    let at = |name: &str| folder.path().join(name);
    let both = at("run+model.mcap");
    let export = |recording: &str, model: &Path, to: &Path, words: &[&str]| {
        refused(&["export", recording, "--with-model", text(model), "-o", text(to)], words);
    };
    export(CREEP, &model, &at("run.csv"), &["run.csv must end in .mcap"]);
    export(CREEP, &at("no.toml"), &both, &["no.toml does not exist"]);
    export(CREEP, &here("rigs/demo-hdpe.toml"), &both, &["is not a file of models"]);
    export(NOTHING, &model, &both, &["another pipeline", "length"]);
    export(CREEP, &model, &at("no/run.mcap"), &["folder", "does not exist"]);
    assert!(!both.exists());
    done(&["export", CREEP, "--with-model", text(&model), "-o", text(&both)]);
    export(CREEP, &model, &both, &["exists already", "never overwritten"]);
    export(text(&both), &model, &at("again.mcap"), &["holds the values of a model already"]);
    export(CREEP, &model, &Path::new(HERE).join(CREEP), &["never overwritten"]);
    // A copy under another name is known by its content.
    let (copy, of_copy) = (at("copy.mcap"), at("copy+model.mcap"));
    std::fs::copy(here(CREEP), &copy).unwrap();
    assert_eq!(
        done(&["export", text(&copy), "--with-model", text(&model), "-o", text(&of_copy)])["own_values"],
        "fitted"
    );
    [&copy, &of_copy].iter().for_each(|path| std::fs::remove_file(path).unwrap());
    // Nothing is left behind.
    let left: Vec<String> =
        std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    assert_eq!(left.len(), 2, "{left:?}");
    assert!(run(&["inspect", CREEP]).status.success());
}
