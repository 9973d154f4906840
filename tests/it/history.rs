//! What the index of a folder tells: the drift of a rig's parameters, as table, JSON, CSV and picture.

use std::fs;
use std::path::Path;

use serde_json::Value as Json;
use surgescope::results::history::index::{Entered, Name};
use surgescope::results::history::{Accepted, Finding, Index, NOTHING_MISSING, Run, State, Value};

use crate::common::{ended, run, text};

const DEGC: [f64; 8] = [20.0, 24.0, 18.0, 26.0, 21.0, 19.0, 25.0, 20.0];
/// Standard errors of the wave speeds, and how far off each is, in these.
const ERRORS: [f64; 8] = [0.2, 0.3, 0.2, 0.4, 0.2, 0.3, 0.2, 0.2];
const OFF: [f64; 8] = [0.3, -0.8, 0.5, 1.1, -0.4, -0.9, 0.2, 0.1];

fn value(name: &str, value: f64, standard_error: Option<f64>, unit: &str, own: bool) -> Value {
    Value { name: name.into(), value, standard_error, unit: unit.into(), own }
}

/// An index of eight runs of a rig whose wave speed falls by 2 m/s a kelvin and rises by 0.5 m/s a run, one run with a
/// leak, one failed.
fn index(folder: &Path) {
    let mut index = Index::open(folder).unwrap();
    let mut enter = |n: usize, error: Option<&str>| {
        let name = Name { file: format!("run-{n:02}.mcap"), size: 100, modified_ns: 1 };
        let recorded = 1_790_000_000_000_000_000 + n as i64 * 3_600_000_000_000;
        let entered = index.enter(&name, &format!("content {n}"), ("lab", recorded), error, |_| true).unwrap();
        let Entered::New(id) = entered else { panic!("{entered:?}") };
        index.claim(Some(id)).unwrap().map(|run| (run, recorded))
    };
    let runs: Vec<_> = (1..=9).map(|n| enter(n, None).unwrap().0).collect();
    assert!(enter(10, Some("no closure")).is_none());
    for (i, run) in runs.iter().enumerate() {
        let leaky = i == 8;
        let degc = if leaky { 22.0 } else { DEGC[i] };
        let exact = 395.0 - 2.0 * (degc - 20.0) + 0.5 * (i + 1) as f64;
        let (error, off) = if leaky { (0.2, 100.0) } else { (ERRORS[i], OFF[i]) };
        let finding = Finding {
            temperature_degc: Some(degc),
            flow_m3_s: Some(5e-4),
            effects: vec!["viscoelastic-wall:1".into()],
            verdict: if leaky { "missing-effect" } else { NOTHING_MISSING }.into(),
            missing: leaky.then(|| "leak".to_owned()),
            probability: 0.98,
            line: "a line".into(),
            rmse_m: if leaky { 0.3 } else { 0.031 },
            noise_m: 0.03,
            parameters: vec![
                value("wave_speed_m_s", exact + off * error, Some(error), "m/s", false),
                value("J1_per_GPa", 0.12 + 0.002 * (degc - 20.0), Some(0.001), "1/GPa", false),
                value("initial_velocity_m_s", 0.5, Some(0.001), "m/s", true),
            ],
            ..Finding::default()
        };
        let accepted =
            Accepted { file: run.file.clone(), when: "now".into(), how: "automatic".into(), model: String::new() };
        index.done(run, "lab", &finding, Some(&accepted).filter(|_| i == 7)).unwrap();
    }
}

fn failed(index: &Index) -> Vec<Run> {
    index.all().unwrap().into_iter().filter(|run| run.state == State::Failed).collect()
}

/// A run that the program does not survive is begun so often, then once more after each of ever longer pauses; a failed
/// one waits only when it is asked for.
#[test]
fn a_run_that_ends_the_program_is_given_up_for_longer_and_longer() {
    let folder = tempfile::tempdir().unwrap();
    let mut index = Index::open(folder.path()).unwrap();
    let name = Name { file: "run.mcap".into(), size: 1, modified_ns: 1 };
    index.enter(&name, "content", ("lab", 1), None, |_| true).unwrap();
    let mut now_s = 1000;
    for tries in 1..=3 {
        assert_eq!(index.claim(None).unwrap().map(|run| run.tries), Some(tries));
        assert_eq!(index.resume(3, now_s).unwrap().len(), 1, "it was cut off");
    }
    for (pause_s, ended) in [(60, "ended 3 times"), (120, "ended 4 times"), (240, "ended 5 times")] {
        let given_up = failed(&index);
        assert!(given_up[0].error.as_ref().unwrap().contains(ended), "{given_up:?}");
        assert!(index.resume(3, now_s + pause_s - 1).unwrap().is_empty());
        assert_eq!(index.claim(None).unwrap(), None);
        now_s += pause_s;
        assert_eq!(index.resume(3, now_s).unwrap().len(), 1);
        assert!(failed(&index).is_empty());
        assert!(index.claim(None).unwrap().is_some());
        index.resume(3, now_s).unwrap();
    }
    assert_eq!(index.retry().unwrap(), 1);
    assert_eq!(index.claim(None).unwrap().map(|run| run.tries), Some(1));
    assert!(failed(&index).is_empty());
}

fn history(folder: &Path, more: &[&str]) -> (i32, String, String) {
    ended(run(&[&["history", "--folder", text(folder)], more].concat()))
}

#[test]
fn drift_over_runs_and_temperature_is_found_with_intervals_that_hold_it() {
    let folder = tempfile::tempdir().unwrap();
    index(folder.path());
    let (code, out, err) = history(folder.path(), &["lab", "--json"]);
    assert_eq!(code, 0, "{err}");
    let document: Json = serde_json::from_str(&out).unwrap();
    assert_eq!(document["runs"].as_array().unwrap().len(), 10);
    assert_eq!(document["in_force"]["file"], "run-08.mcap");
    let names: Vec<&str> =
        document["parameters"].as_array().unwrap().iter().map(|p| p["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["wave_speed_m_s", "J1_per_GPa"], "what is each run's own has no drift");
    let speed = &document["parameters"][0];
    assert_eq!(speed["values"].as_array().unwrap().len(), 9);
    assert_eq!(speed["values"][8]["sound"], false, "a run in which something is missing is shown, not counted");
    let drift = &speed["drift"];
    for (which, exact) in [("per_run", 0.5), ("per_kelvin", -2.0)] {
        let number = |i: usize| drift[which]["interval"][i].as_f64().unwrap();
        assert!(number(0) < exact && exact < number(1) && number(1) - number(0) < 0.4, "{which}: {drift}");
    }
    assert_eq!(drift["together"], true);
    let slope = document["parameters"][1]["drift"]["per_kelvin"]["value"].as_f64().unwrap();
    assert!((slope - 0.002).abs() < 1e-9, "J1 rises by 0.002 a kelvin: {slope}");
}

#[test]
fn table_csv_picture_and_page_show_every_run() {
    let folder = tempfile::tempdir().unwrap();
    index(folder.path());
    let at = |name: &str| folder.path().join(name).display().to_string();
    let (csv, svg, page) = (at("runs.csv"), at("drift.svg"), at("drift.html"));
    let (code, out, err) = history(folder.path(), &["--csv", &csv, "--svg", &svg, "--report", &page]);
    assert_eq!(code, 0, "one rig needs no name: {err}");
    for word in [
        "10 runs (9 done, 1 failed)",
        "missing-effect: leak",
        "failed: no closure",
        "nothing-missing, accepted",
        "24.0",
    ] {
        assert!(out.contains(word), "no {word:?} in {out}");
    }
    // 391 + 9 · 0.5 + 100 · 0.2, of a model that leaves ten times the noise
    let [leaky, sound] = ["run-09.mcap", "run-08.mcap"].map(|run| out.lines().find(|line| line.contains(run)).unwrap());
    assert!(leaky.contains(" 416? ") && leaky.contains(" 0.124? ") && !sound.contains('?'), "{leaky}\n{sound}");
    assert!(out.contains("?: the model leaves more than the noise"), "{out}");
    let text = fs::read_to_string(&csv).unwrap();
    let mut rows = csv::Reader::from_reader(text.as_bytes());
    let header = rows.headers().unwrap().clone();
    let column = header.iter().position(|h| h == "wave_speed_m_s").unwrap();
    let rows: Vec<csv::StringRecord> = rows.records().map(Result::unwrap).collect();
    assert_eq!(rows.len(), 10);
    assert!((rows[1][column].parse::<f64>().unwrap() - (395.0 - 8.0 + 1.0 - 0.8 * 0.3)).abs() < 1e-9);
    assert_eq!(&rows[9][column], "");
    let svg = fs::read_to_string(&svg).unwrap();
    // a dot a run and chart, and one in the legend of what is missing
    assert_eq!(svg.matches("<circle").count(), 2 * 2 * (9 + 1), "{svg}");
    assert!(fs::read_to_string(&page).unwrap().contains("data-page=\"history\""));
    // Written again over its own kind, not over another.
    assert_eq!(history(folder.path(), &["--csv", &csv]).0, 0);
    assert_eq!(history(folder.path(), &["--csv", &page]).0, 2);
}

#[test]
fn what_is_not_there_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let (code, _, err) = history(folder.path(), &["lab"]);
    assert!(code == 2 && err.contains("has no index of runs"), "{err}");
    let (code, _, err) = ended(run(&["history", text(folder.path())]));
    assert!(code == 2 && err.contains("is a folder") && err.contains("`surgescope history --folder "), "{err}");
    index(folder.path());
    let (code, _, err) = history(folder.path(), &["bench"]);
    assert!(code == 2 && err.contains("'bench'") && err.contains("it knows lab"), "{err}");
    fs::write(
        folder.path().join("surgescope.sqlite"),
        "something else altogether, long enough to be no header of a database",
    )
    .unwrap();
    let (code, _, err) = history(folder.path(), &["lab"]);
    assert!(code == 2 && err.contains("is not an index of runs"), "{err}");
}
