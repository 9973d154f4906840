//! Layouts of Foxglove and PlotJuggler plot what is in a recording.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use prost_reflect::DescriptorPool;
use serde_json::Value;

use crate::common::{CREEP, done, here, refused, text};

/// The rig of a recording, as a file.
fn rig_of(recording: &str, folder: &Path) -> PathBuf {
    let rig = folder.join("rig.toml");
    std::fs::write(&rig, surgescope::storage::read(&here(recording)).unwrap().rig.source).unwrap();
    rig
}

/// Topics of a recording with the fields of their messages.
fn fields(recording: &Path) -> BTreeSet<(String, String)> {
    let bytes = std::fs::read(recording).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let mut found = BTreeSet::new();
    for channel in summary.channels.values() {
        let schema = channel.schema.as_ref().unwrap();
        let pool = DescriptorPool::decode(&schema.data[..]).unwrap();
        let message = pool.get_message_by_name(&schema.name).unwrap();
        found.extend(message.fields().map(|field| (channel.topic.clone(), field.name().to_owned())));
    }
    found
}

/// What the panels of a Foxglove layout plot, those of the tree alone.
fn plotted_by_foxglove(layout: &Value) -> Vec<(String, Vec<(String, String)>)> {
    fn leaves(tree: &Value, found: &mut Vec<String>) {
        match tree.as_str() {
            Some(id) => found.push(id.to_owned()),
            None => ["first", "second"].iter().for_each(|side| leaves(&tree[side], found)),
        }
    }
    let mut ids = Vec::new();
    leaves(&layout["layout"], &mut ids);
    assert_eq!(ids.len(), layout["configById"].as_object().unwrap().len(), "each panel stands in the tree");
    let of = |id: &String| {
        let panel = &layout["configById"][id];
        let split = |path: &Value| {
            let (topic, field) = path["value"].as_str().unwrap().split_once('.').unwrap();
            (topic.to_owned(), field.to_owned())
        };
        let paths = panel["paths"].as_array().unwrap().iter().map(split).collect();
        (panel["foxglovePanelTitle"].as_str().unwrap().to_owned(), paths)
    };
    ids.iter().map(of).collect()
}

/// The curves of a PlotJuggler layout, as topic and field.
fn plotted_by_plotjuggler(layout: &str) -> BTreeSet<(String, String)> {
    let names = layout.split("<curve name=\"").skip(1).map(|rest| rest.split('"').next().unwrap());
    names
        .map(|name| name.rsplit_once('/').unwrap())
        .map(|(topic, field)| (topic.to_owned(), field.to_owned()))
        .collect()
}

#[test]
fn a_layout_plots_each_sensor_of_a_recording() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let rig = rig_of(CREEP, folder.path());
    let (json, xml) = (at("run.json"), at("run.xml"));
    let told = done(&["layout", "--rig", text(&rig), "-o", text(&json)]);
    assert_eq!(told["program"], "Foxglove");
    assert_eq!(done(&["layout", "--rig", text(&rig), "-o", text(&xml)])["program"], "PlotJuggler");

    let there = fields(&here(CREEP));
    let sampled: BTreeSet<_> = there.iter().filter(|(_, field)| field == "value").cloned().collect();
    assert!(sampled.len() >= 4, "{sampled:?}");
    let panels = plotted_by_foxglove(&serde_json::from_str(&std::fs::read_to_string(&json).unwrap()).unwrap());
    assert_eq!(panels.iter().flat_map(|(_, paths)| paths.clone()).collect::<BTreeSet<_>>(), sampled);
    let titles: Vec<&str> = panels.iter().map(|(title, _)| title.as_str()).collect();
    assert!(titles[0].starts_with("Pressure, ") && titles.iter().any(|t| t.starts_with("Flow, ")), "{titles:?}");
    assert_eq!(panels[0].1.len(), 3, "pressures of one unit share a plot");

    let xml = std::fs::read_to_string(&xml).unwrap();
    assert_eq!(plotted_by_plotjuggler(&xml), sampled);
    assert_eq!(xml.matches("<plot ").count(), panels.len());
    assert!(xml.contains("<root version=\"2.3.8\">"), "PlotJuggler asks about layouts of another version");
}

#[test]
fn with_a_model_a_layout_plots_what_export_adds() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let rig = rig_of(CREEP, folder.path());
    let (model, both) = (at("model.toml"), at("run+model.mcap"));
    done(&["calibrate", CREEP, "--against", "none", "--save", text(&model)]);
    done(&["export", CREEP, "--with-model", text(&model), "-o", text(&both)]);
    let there = fields(&both);
    for name in ["run.json", "run.xml"] {
        done(&["layout", "--rig", text(&rig), "--with-model", "-o", text(&at(name))]);
    }
    let layout = serde_json::from_str(&std::fs::read_to_string(at("run.json")).unwrap()).unwrap();
    let panels = plotted_by_foxglove(&layout);
    assert!(panels[1].0.starts_with("Residual, "), "{panels:?}");
    let foxglove: BTreeSet<_> = panels.into_iter().flat_map(|(_, paths)| paths).collect();
    assert!(foxglove.is_subset(&there), "{foxglove:?} of {there:?}");
    for topic in ["/P1", "/P1/model", "/P1/residual"] {
        assert!(foxglove.contains(&(topic.to_owned(), "value".to_owned())), "{topic}");
    }
    assert_eq!(plotted_by_plotjuggler(&std::fs::read_to_string(at("run.xml")).unwrap()), foxglove);
}

#[test]
fn a_layout_replaces_nothing_unasked() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let rig = rig_of(CREEP, folder.path());
    let to = |output: &Path, more: &[&str]| {
        let arguments = [&["layout", "--rig", text(&rig), "-o", text(output)], more].concat();
        arguments.iter().map(|a| (*a).to_owned()).collect::<Vec<String>>()
    };
    let refused = |output: &Path, more: &[&str], words: &[&str]| {
        let arguments = to(output, more);
        refused(&arguments.iter().map(String::as_str).collect::<Vec<_>>(), words);
    };
    refused(&at("run.yaml"), &[], &["run.yaml", ".json for Foxglove", ".xml for PlotJuggler"]);
    std::fs::write(at("mine.json"), "mine").unwrap();
    refused(&at("mine.json"), &[], &["mine.json exists", "--overwrite"]);
    std::fs::copy(here(CREEP), at("copy.json")).unwrap();
    refused(&at("copy.json"), &["--overwrite"], &["recordings are never overwritten"]);
    refused(&at("no/run.json"), &[], &["does not exist"]);
    assert_eq!(std::fs::read_to_string(at("mine.json")).unwrap(), "mine");
}
