//! What tests of several subjects share: the program as a user starts it, what it answers, and the files that ship.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::{Mutex, OnceLock};

use serde_json::Value;

/// The shipped recordings, as paths from [`HERE`].
pub const CREEP: &str = "recordings/hdpe-creep.mcap";
pub const LEAK: &str = "recordings/copper-leak.mcap";
pub const NOTHING: &str = "recordings/hdpe-nothing-missing.mcap";

/// The repository, where the program is started: `recordings/…` and `rigs/…` are found from there.
pub const HERE: &str = env!("CARGO_MANIFEST_DIR");

/// A file or folder of the repository.
pub fn here(path: &str) -> PathBuf {
    Path::new(HERE).join(path)
}

pub fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// The program, to be started in the repository.
pub fn surgescope<A: AsRef<OsStr>>(arguments: impl IntoIterator<Item = A>) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_surgescope"));
    command.current_dir(HERE).args(arguments);
    command
}

pub fn run(arguments: &[&str]) -> Output {
    surgescope(arguments).output().unwrap()
}

/// Exit code, standard output, standard error.
pub fn ended(output: Output) -> (i32, String, String) {
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

/// What a command has printed that had to succeed.
pub fn printed(output: Output) -> String {
    let (code, out, err) = ended(output);
    assert_eq!(code, 0, "{err}");
    out
}

/// The document of a command that had to succeed.
pub fn document(output: Output) -> Value {
    serde_json::from_str(&printed(output)).unwrap()
}

/// Runs a command that must succeed, with `--json`: its document.
pub fn done(arguments: &[&str]) -> Value {
    document(run(&[arguments, &["--json"]].concat()))
}

/// Runs a command that must refuse its input, in words that hold each of `words`, and print nothing else.
pub fn refused(arguments: &[&str], words: &[&str]) -> String {
    let (code, out, err) = ended(run(arguments));
    assert_eq!((code, out.as_str()), (2, ""), "{arguments:?}: {err}");
    for word in words {
        assert!(err.contains(word), "{arguments:?}: no {word:?} in: {err}");
    }
    err
}

/// A parameter of a fit's document.
pub fn parameter<'a>(fit: &'a Value, name: &str) -> &'a Value {
    fit["parameters"]
        .as_array()
        .unwrap()
        .iter()
        .find(|p| p["name"] == name)
        .unwrap_or_else(|| panic!("no {name}: {fit}"))
}

pub fn value(fit: &Value, name: &str) -> f64 {
    parameter(fit, name)["value"].as_f64().unwrap()
}

/// The error of a fit's first run, in times its noise.
pub fn over_noise(fit: &Value) -> f64 {
    let run = &fit["runs"][0];
    run["rmse_m"].as_f64().unwrap() / run["noise_m"].as_f64().unwrap()
}

/// Standard normal numbers, by Box and Muller: the same at every run of the tests.
pub fn normal(seed: u64) -> impl FnMut() -> f64 {
    let mut random = fastrand::Rng::with_seed(seed);
    move || (-2.0 * (1.0 - random.f64()).ln()).sqrt() * (std::f64::consts::TAU * random.f64()).cos()
}

/// What a command has answered, and what it has written.
pub struct Made {
    pub answer: Value,
    pub file: String,
}

/// A fit, and its file of models: made by the first test that asks for it, however many ask.
pub fn calibration(arguments: &[&str]) -> &'static Made {
    made("calibrate", arguments, "--save", "model.toml")
}

/// A diagnosis, and its page: made by the first test that asks for it, however many ask.
pub fn diagnosis(arguments: &[&str]) -> &'static Made {
    made("diagnose", arguments, "--report", "page.html")
}

fn made(command: &str, arguments: &[&str], option: &str, name: &str) -> &'static Made {
    static MADE: Mutex<BTreeMap<String, &OnceLock<Made>>> = Mutex::new(BTreeMap::new());
    let asked = [&[command], arguments].concat();
    let place: &'static OnceLock<Made> =
        MADE.lock().unwrap().entry(asked.join(" ")).or_insert_with(|| Box::leak(Box::default()));
    place.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join(name);
        let answer = done(&[&asked[..], &[option, text(&file)]].concat());
        Made { answer, file: std::fs::read_to_string(file).unwrap() }
    })
}
