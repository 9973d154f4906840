//! What is fuzzed. An input is taken in full or refused with an error; anything else is a finding.

use std::path::Path;

use surgescope::draft::epanet;
use surgescope::draft::network::{Told, draft};
use surgescope::rig::Rig;
use surgescope::storage as log;
use surgescope::storage::import::{MessageTime, SourceOptions, bind, decode_source};

/// A parser and the name of its folder in `corpus/`.
pub struct Target {
    pub name: &'static str,
    pub run: fn(&[u8]),
}

pub const TARGETS: &[Target] = &[
    Target { name: "rig", run: rig },
    Target { name: "epanet", run: epanet },
    Target { name: "recording", run: recording },
    Target { name: "csv", run: csv },
    Target { name: "tdms", run: tdms },
    Target { name: "mcap", run: mcap },
    Target { name: "arrays", run: arrays },
    Target { name: "frames", run: super::frames::frames },
    Target { name: "lines", run: super::lines::lines },
    Target { name: "modbus", run: super::modbus::modbus },
];

/// Rig files, and every sentence about what is wrong in them.
fn rig(input: &[u8]) {
    let Ok(text) = std::str::from_utf8(input) else { return };
    if let Err(error) = Rig::from_toml(text, "rig.toml") {
        let _ = error.to_string();
    }
}

/// Networks of EPANET: what becomes a rig file is read as one, or refused with a sentence.
fn epanet(input: &[u8]) {
    let Ok(text) = std::str::from_utf8(input) else { return };
    let network = match epanet::read(text) {
        Ok(network) => network,
        Err(fault) => return drop(fault.to_string()),
    };
    let (material, wall_thickness_mm) = ("steel", 4.0);
    let told = Told {
        name: "net",
        temperature_degc: 20.0,
        material,
        wall_thickness_mm,
        valve: None,
        closing_time_s: 0.1,
        unit: "bar",
    };
    if let Ok(made) = draft(&network, &told) {
        if let Err(error) = Rig::from_toml(&made.text, "net.toml") {
            let _ = error.to_string();
        }
        made.text.parse::<toml::Table>().expect("a rig file is TOML");
    }
}

/// Our own recordings, finished ones and torn ones.
fn recording(input: &[u8]) {
    let path = Path::new("run.mcap");
    let whole = log::decode(input, path);
    if let Ok(recording) = &whole {
        let mut out = Vec::new();
        log::export_csv(recording, &mut out).expect("a recording that was read can be exported");
    }
    let saved = log::salvaged(input, path);
    assert!(whole.is_err() || saved.is_ok(), "what can be read can be recovered");
}

const BENCH: &str = r#"name = "b"
fluid = { name = "water", temperature_degC = 20.0 }
upstream = { kind = "reservoir" }
downstream = { kind = "valve", closing_time_s = 0.1 }
[[pipe]]
name = "main"
length_m = 50.0
inner_diameter_mm = 20.0
wall_thickness_mm = 2.0
material = "copper"
[[sensor]]
name = "P1"
kind = "pressure"
position_m = 25.0
unit = "kPa"
[[sensor]]
name = "P2"
kind = "pressure"
position_m = 50.0
unit = "bar"
"#;

/// Reads a file of another program, and brings it to the sensors of a rig: what comes out can be written as a
/// recording.
fn foreign(input: &[u8], name: &str, options: &SourceOptions) {
    static RIG: std::sync::LazyLock<Rig> =
        std::sync::LazyLock::new(|| Rig::from_toml(BENCH, "bench.toml").expect("a rig"));
    let path = Path::new(name);
    let file = match decode_source(input, path, options) {
        Ok(file) => file,
        Err(error) => return drop(error.to_string()),
    };
    for track in &file.tracks {
        let (time_s, value) = (&track.series.time_s, &track.series.value);
        assert_eq!(time_s.len(), value.len(), "a value for each time");
        assert!(time_s.windows(2).all(|t| t[0] < t[1]), "times increase");
        assert!(time_s.iter().chain(value).all(|n| n.is_finite()), "numbers are finite");
    }
    let mut repairs = Vec::new();
    match bind(file, path, &RIG, options, &mut repairs) {
        Ok(bound) => log::import::unit_warnings(&bound.recording).iter().for_each(|d| assert!(!d.text.is_empty())),
        Err(error) => drop(error.to_string()),
    }
}

/// Tables in text.
fn csv(input: &[u8]) {
    foreign(input, "run.csv", &SourceOptions::default());
    foreign(input, "run.csv", &SourceOptions { guess: true, period_s: Some(0.5), ..SourceOptions::default() });
    let told = SourceOptions {
        day_first: Some(false),
        time_unit_s: Some(1e-3),
        ignore: vec!["*".into()],
        ..Default::default()
    };
    foreign(input, "run.csv", &told);
}

/// NI TDMS; what does not begin like one goes to the other readers.
fn tdms(input: &[u8]) {
    let map = vec![("/'Group'/'Channel'".to_string(), "P1".to_string())];
    foreign(input, "run.tdms", &SourceOptions { map, ..SourceOptions::default() });
}

/// MAT files and HDF5; what does not begin like one goes to the other readers.
fn arrays(input: &[u8]) {
    foreign(input, "run.mat", &SourceOptions { guess: true, ..SourceOptions::default() });
}

/// MCAP of other programs, its messages timed in three ways.
fn mcap(input: &[u8]) {
    let map = vec![("/a.p".to_string(), "P1".to_string()), ("/b.value".to_string(), "P2".to_string())];
    for message_time in [MessageTime::Log, MessageTime::Publish, MessageTime::Field("t".into())] {
        foreign(input, "run.mcap", &SourceOptions { map: map.clone(), message_time, ..SourceOptions::default() });
    }
}
