//! A rig's history: table and drift as text, JSON and CSV. What `watch --json` prints of each run.

use std::fmt::Write as _;

use serde::Serialize;

use crate::report::text::number::{decimals_for, fixed, signed, significant, times, with_error};
use crate::results::history::drift::{Drift, Point, Slope};
use crate::results::history::{Finding, History, Run, State, Value};
use crate::shown::{Shown as _, cell};

/// One run as scripts see it. What is not known is `null`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunDocument<'a> {
    file: &'a str,
    rig: &'a str,
    recorded: Option<String>,
    state: &'static str,
    accepted: bool,
    verdict: Option<&'a str>,
    missing: Option<&'a str>,
    probability: Option<f64>,
    line: Option<&'a str>,
    error: Option<&'a str>,
    #[serde(rename = "temperature_degC")]
    temperature_degc: Option<f64>,
    flow_m3_s: Option<f64>,
    effects: &'a [String],
    rmse_m: Option<f64>,
    noise_m: Option<f64>,
    errors_are_lower_bounds: bool,
    parameters: Vec<ValueDocument<'a>>,
    model_file: Option<&'a str>,
    report_file: Option<&'a str>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct ValueDocument<'a> {
    name: &'a str,
    value: f64,
    standard_error: Option<f64>,
    unit: &'a str,
    own: bool,
}

/// What `watch --once --json` prints.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WatchDocument<'a> {
    /// The folder.
    pub folder: String,
    /// Runs that were worked on.
    pub runs: Vec<RunDocument<'a>>,
    /// Files without an end.
    pub unfinished: Vec<String>,
}

impl<'a> From<&'a Run> for RunDocument<'a> {
    fn from(run: &'a Run) -> Self {
        let f = run.finding.as_ref();
        let value = |v: &'a Value| ValueDocument {
            name: &v.name,
            value: v.value,
            standard_error: v.standard_error,
            unit: &v.unit,
            own: v.own,
        };
        RunDocument {
            file: &run.file,
            rig: &run.rig,
            recorded: recorded(run).map(|t| t.to_rfc3339_opts(chrono::SecondsFormat::Millis, true)),
            state: run.state.name(),
            accepted: run.accepted,
            verdict: f.map(|f| f.verdict.as_str()),
            missing: f.and_then(|f| f.missing.as_deref()),
            probability: f.map(|f| f.probability),
            line: f.map(|f| f.line.as_str()),
            error: run.error.as_deref(),
            temperature_degc: f.and_then(|f| f.temperature_degc),
            flow_m3_s: f.and_then(|f| f.flow_m3_s),
            effects: f.map_or(&[], |f| &f.effects),
            rmse_m: f.map(|f| f.rmse_m),
            noise_m: f.map(|f| f.noise_m),
            errors_are_lower_bounds: f.is_some_and(Finding::lacks_something),
            parameters: f.map_or(Vec::new(), |f| f.parameters.iter().map(value).collect()),
            model_file: f.map(|f| f.model_file.as_str()),
            report_file: f.map(|f| f.report_file.as_str()),
        }
    }
}

fn recorded(run: &Run) -> Option<chrono::DateTime<chrono::Utc>> {
    (run.recorded_unix_ns > 0).then(|| chrono::DateTime::from_timestamp_nanos(run.recorded_unix_ns))
}

/// A fitted value in the digits of its error; of a model that lacks something in three digits with a question mark.
fn value_of(value: &Value, of: &Finding) -> String {
    if of.lacks_something() {
        return format!("{}?", significant(value.value, 3));
    }
    with_error(value.value, value.standard_error.unwrap_or(f64::INFINITY))
}

/// What the question mark of a value means.
pub const LACKING: &str =
    "?: the model leaves more than the noise; what it lacks pulls the value, by how much nobody knows.";

/// What `history --json` prints.
#[derive(Serialize)]
pub struct Document<'a> {
    rig: &'a str,
    effects: &'a [String],
    in_force: Option<InForce<'a>>,
    runs: Vec<RunDocument<'a>>,
    parameters: Vec<ParameterDocument<'a>>,
}

#[derive(Serialize)]
struct InForce<'a> {
    file: &'a str,
    when: &'a str,
    how: &'a str,
}

#[derive(Serialize)]
struct ParameterDocument<'a> {
    name: &'a str,
    unit: &'a str,
    values: Vec<PointDocument<'a>>,
    drift: Option<DriftDocument>,
}

#[derive(Serialize)]
struct PointDocument<'a> {
    run: usize,
    file: &'a str,
    #[serde(rename = "temperature_degC")]
    temperature_degc: Option<f64>,
    value: f64,
    standard_error: f64,
    sound: bool,
}

#[derive(Serialize)]
struct DriftDocument {
    mean: f64,
    mean_run: f64,
    #[serde(rename = "mean_degC")]
    mean_degc: f64,
    per_run: Option<SlopeDocument>,
    per_kelvin: Option<SlopeDocument>,
    together: bool,
    scatter: f64,
}

#[derive(Serialize)]
struct SlopeDocument {
    value: f64,
    interval: [f64; 2],
}

/// The JSON document of `history`. `parameters` are those of the model in force, `values` what sound runs (nothing
/// missing, or accepted by hand) and others have of it; `drift` counts the sound ones: `per_run` and `per_kelvin` with
/// their 95% `interval`, determined `together` or each alone; `scatter` is the standard deviation from run to run
/// beyond the errors. `runs` as in `watch --json`.
pub fn document(history: &History) -> Document<'_> {
    let slope = |s: Slope| SlopeDocument { value: s.value, interval: [s.low, s.high] };
    let drift = |d: Drift| DriftDocument {
        mean: d.mean,
        mean_run: d.mean_run,
        mean_degc: d.mean_degc,
        per_run: d.per_run.map(slope),
        per_kelvin: d.per_kelvin.map(slope),
        together: d.together,
        scatter: d.scatter,
    };
    let parameters = history.parameters.iter().map(|p| {
        let point = |sound: bool| {
            move |v: &Point| PointDocument {
                run: v.run as usize,
                file: history.runs.get(v.run as usize - 1).map_or("", |r| &r.file),
                temperature_degc: v.temperature_degc,
                value: v.value,
                standard_error: v.standard_error,
                sound,
            }
        };
        let mut values: Vec<PointDocument> =
            p.points.iter().map(point(true)).chain(p.doubtful.iter().map(point(false))).collect();
        values.sort_by_key(|v| v.run);
        ParameterDocument { name: &p.name, unit: &p.unit, values, drift: p.drift.map(drift) }
    });
    Document {
        rig: &history.rig,
        effects: &history.effects,
        in_force: history.in_force.as_ref().map(|a| InForce { file: &a.file, when: &a.when, how: &a.how }),
        runs: history.runs.iter().map(RunDocument::from).collect(),
        parameters: parameters.collect(),
    }
}

/// The same as text.
///
/// # Errors
/// None in practice: all values can be written.
pub fn json(history: &History) -> serde_json::Result<String> {
    serde_json::to_string_pretty(&document(history))
}

/// The runs as CSV, one a line; a parameter's standard error stands in a column `NAME_se` behind it.
///
/// # Errors
/// None in practice: it is written to memory.
pub fn csv(history: &History) -> Result<String, csv::Error> {
    let mut out = csv::Writer::from_writer(Vec::new());
    let fixed =
        ["run", "file", "recorded_utc", "temperature_degC", "flow_m3_s", "state", "verdict", "missing", "accepted"];
    let errors = ["effects", "rmse_m", "noise_m", "error"];
    let mut header: Vec<String> = fixed.iter().chain(&errors).map(ToString::to_string).collect();
    for p in &history.parameters {
        header.extend([p.name.clone(), format!("{}_se", p.name)]);
    }
    out.write_record(&header)?;
    let number = |v: Option<f64>| v.filter(|v| v.is_finite()).map_or(String::new(), |v| v.to_string());
    for (i, run) in history.runs.iter().enumerate() {
        let d = RunDocument::from(run);
        let text = |t: Option<&str>| t.unwrap_or_default().to_owned();
        let mut row = vec![
            (i + 1).to_string(),
            d.file.to_owned(),
            d.recorded.unwrap_or_default(),
            number(d.temperature_degc),
            number(d.flow_m3_s),
            d.state.to_owned(),
            text(d.verdict),
            text(d.missing),
            u8::from(d.accepted).to_string(),
            d.effects.join("+"),
            number(d.rmse_m),
            number(d.noise_m),
            text(d.error),
        ];
        for p in &history.parameters {
            let value = d.parameters.iter().find(|v| v.name == p.name && d.effects == history.effects);
            row.extend([number(value.map(|v| v.value)), number(value.and_then(|v| v.standard_error))]);
        }
        out.write_record(row.iter().map(|text| cell(text).into_owned()))?;
    }
    let bytes = out.into_inner().map_err(|e| csv::Error::from(e.into_error()))?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// What the runs are and which model is in force, in a sentence.
pub fn headline(history: &History) -> String {
    let count = |state| history.runs.iter().filter(|r| r.state == state).count();
    let (all, done, failed) = (history.runs.len(), count(State::Done), count(State::Failed));
    let model = if history.effects.is_empty() { "base model".to_owned() } else { history.effects.join(" + ") };
    let runs = format!("{all} run{} ({done} done, {failed} failed)", if all == 1 { "" } else { "s" });
    match &history.in_force {
        Some(a) => format!("{runs}; model {model}, accepted from {} ({}, {})", a.file.shown(), a.how, minute(&a.when)),
        None => format!("{runs}; model {model}, none accepted yet"),
    }
}

/// A time of the index to the minute, as people write it; as it stands there where it is none.
fn minute(when: &str) -> String {
    let time = chrono::DateTime::parse_from_rfc3339(when);
    time.map_or_else(|_| when.to_owned(), |t| t.to_utc().format("%Y-%m-%d %H:%M UTC").to_string())
}

/// Whether a value of the table of runs is marked as one of a model that lacks something.
pub fn marks(history: &History) -> bool {
    let shown = history.runs.iter().filter_map(|run| run.finding.as_ref()).filter(|f| f.effects == history.effects);
    shown.into_iter().any(Finding::lacks_something)
}

/// Headings of the table of runs.
pub fn headings(history: &History) -> Vec<String> {
    let first = ["no", "recorded (UTC)", "file", "°C", "L/s"].map(str::to_owned);
    let names = history.parameters.iter().map(|p| p.name.clone());
    first.into_iter().chain(names).chain(["x noise", "verdict"].map(str::to_owned)).collect()
}

/// Rows of the table of runs.
pub fn rows(history: &History) -> Vec<Vec<String>> {
    let row = |(i, run): (usize, &Run)| {
        let f = run.finding.as_ref();
        let number = |v: Option<f64>, decimals| v.map_or("–".into(), |v| fixed(v, decimals));
        let when = recorded(run).map_or("–".into(), |t| t.format("%Y-%m-%d %H:%M:%S").to_string());
        let mut row = vec![
            (i + 1).to_string(),
            when,
            run.file.shown().into_owned(),
            number(f.and_then(|f| f.temperature_degc), 1),
            number(f.and_then(|f| f.flow_m3_s).map(|q| 1e3 * q), 3),
        ];
        let own = f.filter(|f| f.effects == history.effects);
        row.extend(history.parameters.iter().map(|p| {
            let value = own.and_then(|f| f.parameters.iter().find(|v| v.name == p.name));
            value.zip(own).map_or("–".into(), |(v, finding)| value_of(v, finding))
        }));
        row.push(f.map_or("–".into(), |f| times(f.rmse_m, f.noise_m)));
        row.push(outcome(run, own.is_none()));
        row
    };
    history.runs.iter().enumerate().map(row).collect()
}

fn outcome(run: &Run, other_model: bool) -> String {
    let Some(f) = &run.finding else {
        let error = run.error.as_ref().map_or(String::new(), |e| format!(": {e}"));
        return format!("{}{error}", run.state.name());
    };
    let missing = f.missing.as_ref().map_or(String::new(), |m| format!(": {m}"));
    let other = if other_model { format!(", by the model {}", f.effects.join(" + ")) } else { String::new() };
    let accepted = if run.accepted { ", accepted" } else { "" };
    format!("{}{missing}{other}{accepted}", f.verdict)
}

/// Headings of the table of drifts.
pub const DRIFT_HEADINGS: [&str; 6] = ["parameter", "runs", "mean", "per run (95%)", "per kelvin (95%)", "scatter"];

/// Rows of the table of drifts.
pub fn drift_rows(history: &History) -> Vec<[String; 6]> {
    let row = |p: &crate::results::history::ParameterHistory| {
        let runs = p.points.len().to_string();
        let none = || "–".to_owned();
        let Some(d) = &p.drift else { return [p.name.clone(), runs, none(), none(), none(), none()] };
        let slope = |s: Option<Slope>| s.map_or_else(none, |s| slope_text(&s));
        let scatter = if d.scatter > 0.0 { significant(d.scatter, 2) } else { "0".into() };
        [p.name.clone(), runs, significant(d.mean, 5), slope(d.per_run), slope(d.per_kelvin), scatter]
    };
    history.parameters.iter().map(row).collect()
}

/// A slope with its interval, in as many decimals as the interval's half width deserves; a star where it is not zero.
pub fn slope_text(s: &Slope) -> String {
    let half = 0.5 * (s.high - s.low);
    let decimals = (decimals_for(half) + 1).min(9);
    let star = if s.stands_out() { " *" } else { "" };
    format!("{} [{}, {}]{star}", signed(s.value, decimals), fixed(s.low, decimals), fixed(s.high, decimals))
}

/// What the drifts mean, in sentences.
pub fn drift_notes(history: &History) -> Vec<String> {
    let drifts: Vec<&Drift> = history.parameters.iter().filter_map(|p| p.drift.as_ref()).collect();
    let Some(first) = drifts.first() else {
        return vec!["Drift needs three runs with a complete model.".into()];
    };
    let mut notes = Vec::new();
    if first.mean_degc.is_finite() {
        notes.push(format!("Means are those at {:.1} °C.", first.mean_degc));
    }
    notes.push(if first.together {
        "Drift per run and per kelvin are fitted together.".into()
    } else if drifts.iter().any(|d| d.per_kelvin.is_some()) {
        "Drift per run and per kelvin are fitted separately: there are too few runs, or temperature and run number rise together, so one may stand for the other.".to_owned()
    } else {
        "The temperature hardly changed or is not known, so its influence does not show.".into()
    });
    notes.push(
        "*: differs from zero with 95% confidence. Scatter: standard deviation from run to run beyond the fits' own errors."
            .into(),
    );
    notes
}

/// The history for people.
pub fn text(history: &History) -> String {
    let mut out = format!("rig {}: {}\n\n", history.rig, headline(history));
    columns(&mut out, &headings(history), &rows(history));
    if marks(history) {
        let _ = writeln!(out, "{LACKING}");
    }
    out.push('\n');
    let rows: Vec<Vec<String>> = drift_rows(history).into_iter().map(Into::into).collect();
    columns(&mut out, &DRIFT_HEADINGS.map(str::to_owned), &rows);
    for note in drift_notes(history) {
        let _ = writeln!(out, "{note}");
    }
    out
}

/// Columns of text, each as wide as its widest cell; the last is left as it is.
fn columns(out: &mut String, headings: &[String], rows: &[Vec<String>]) {
    let width = |i: usize| {
        let cells = rows.iter().filter_map(|r| r.get(i)).chain(headings.get(i));
        cells.map(|c| c.chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..headings.len()).map(width).collect();
    for row in std::iter::once(headings).chain(rows.iter().map(Vec::as_slice)) {
        let cells: Vec<String> = row.iter().zip(&widths).map(|(cell, &width)| format!("{cell:<width$}")).collect();
        let _ = writeln!(out, "{}", cells.join("  ").trim_end());
    }
}
