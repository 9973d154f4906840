//! What is fuzzed. An input is taken in full or refused with an error; anything else is a finding.

use std::path::Path;

use surgescope::log;
use surgescope::rig::Rig;

/// A parser and the name of its folder in `corpus/`.
pub struct Target {
    pub name: &'static str,
    pub run: fn(&[u8]),
}

pub const TARGETS: &[Target] = &[Target { name: "rig", run: rig }, Target { name: "recording", run: recording }];

/// Rig files, and every sentence about what is wrong in them.
fn rig(input: &[u8]) {
    let Ok(text) = std::str::from_utf8(input) else { return };
    if let Err(error) = Rig::from_toml(text, "rig.toml") {
        let _ = error.to_string();
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
