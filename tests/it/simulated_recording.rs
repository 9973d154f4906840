//! Trying the program without hardware: a recording simulated on any rig, and a live test on a rig without wiring.

use crate::common::{document, done, refused, run, text};

const PIPE: &str = "name = \"unwired\"\n[fluid]\nname = \"water\"\ntemperature_degC = 18\n[[pipe]]\nname = \"main\"\nlength_m = 120\n\
                    inner_diameter_mm = 22.1\nwall_thickness_mm = 1.63\nmaterial = \"copper\"\n[upstream]\nkind = \"reservoir\"\n[downstream]\n\
                    kind = \"valve\"\nclosing_time_s = 0.02\n[[sensor]]\nname = \"P1\"\nkind = \"pressure\"\nposition_m = 120\nunit = \"bar\"\n\
                    [[sensor]]\nname = \"P2\"\nkind = \"pressure\"\nposition_m = 50\nunit = \"kPa\"\n[[sensor]]\nname = \"Q1\"\nkind = \"flow\"\n\
                    unit = \"L/min\"\n[[sensor]]\nname = \"T1\"\nkind = \"temperature\"\nunit = \"degC\"\n";

fn rig() -> (tempfile::TempDir, String) {
    let folder = tempfile::tempdir().unwrap();
    let rig = folder.path().join("rig.toml");
    std::fs::write(&rig, PIPE).unwrap();
    let rig = text(&rig).to_owned();
    (folder, rig)
}

#[test]
fn an_effect_hidden_in_a_simulated_recording_is_found() {
    let (folder, rig) = rig();
    let run_1 = folder.path().join("run.mcap");
    let hidden = ["--effects", "leak", "--set", "leak_position_m=40", "leak_cda_mm2=6", "initial_velocity_m_s=0.3"];
    let made = done(&[&["simulate", "--rig", &rig, "--seed", "5", "-o", text(&run_1)], &hidden[..]].concat());
    assert_eq!((made["seed"].as_u64(), made["settings"]["leak_position_m"].as_f64()), (Some(5), Some(40.0)));
    let seen = done(&["inspect", text(&run_1)]);
    assert!((seen["closure"]["start_s"].as_f64().unwrap() - 1.0).abs() < 0.01, "{seen}");
    let said = done(&["diagnose", text(&run_1), "--most-reaches", "64"]);
    assert_eq!(said["candidates"][0]["effect"], "leak", "{}", said["verdict"]);
    let place = said["candidates"][0]["parameters"].as_array().unwrap();
    let place = place.iter().find(|p| p["name"] == "leak_position_m").unwrap()["value"].as_f64().unwrap();
    assert!((place - 40.0).abs() < 1.0, "{place}");
    // The same seed gives the same recording, another seed another one; neither replaces what is there.
    let export = |mcap: &str| {
        let csv = mcap.replace(".mcap", ".csv");
        done(&["export", mcap, "-o", &csv]);
        std::fs::read_to_string(csv).unwrap()
    };
    let again = |name: &str, seed: &str| {
        let path = folder.path().join(name);
        done(&[&["simulate", "--rig", &rig, "--seed", seed, "-o", text(&path)], &hidden[..]].concat());
        export(text(&path))
    };
    let first = export(text(&run_1));
    assert!(first.lines().count() > 1000);
    assert_eq!(again("same.mcap", "5"), first);
    assert_ne!(again("other.mcap", "6"), first);
    refused(&["simulate", "--rig", &rig, "-o", text(&run_1)], &["never overwritten"]);
    refused(&["simulate", "--rig", &rig, "--seed", "1", "-o", "x.csv"], &["--seed", ".mcap"]);
}

#[cfg(unix)]
#[test]
fn a_live_test_is_simulated_on_a_rig_without_wiring() {
    let (folder, rig) = rig();
    let live = folder.path().join("live.mcap");
    let arguments =
        ["record", "--rig", &rig, "--simulate", "--speed", "0", "--duration", "3", "--json", "-o", text(&live)];
    let recorded = document(run(&arguments));
    let sensors = recorded["sensors"].as_array().unwrap();
    assert_eq!(sensors.len(), 4);
    assert!(sensors.iter().all(|s| s["samples"].as_u64().unwrap() > 2900 && s["gaps"] == 0), "{recorded}");
    assert_eq!(recorded["devices"][0]["name"], "simulated");
    let seen = done(&["inspect", text(&live)]);
    assert_eq!(seen["sensors"].as_array().map(Vec::len), Some(2), "{seen}");
}
