//! All results of a campaign in one table: a row a task, sorted by its name, the same however and wherever the tasks
//! were done.

use std::collections::{BTreeSet, HashMap};
use std::path::PathBuf;

use serde::Deserialize;
use serde_json::Value;

use crate::campaign::error::{CampaignError, Result};
use crate::campaign::folder::Folder;
use crate::campaign::lines;
use crate::campaign::program::unnamed;
use crate::campaign::status::Failure;
use crate::campaign::task::{Input, Task, Work};
use crate::results::fit_record::FitRecord;
use crate::results::table::Table;

/// Columns that every table has.
const COLUMNS: [&str; 10] =
    ["task", "kind", "case", "recordings", "effects", "method", "seed", "state", "reason", "program"];

/// A table, and what is not in it.
pub struct Gathered {
    /// The table.
    pub table: Table,
    /// Tasks without a result.
    pub missing: usize,
    /// Tasks that have failed.
    pub failed: usize,
    /// The programs that have found the results, by name.
    pub programs: BTreeSet<String>,
    /// Files of results with lines that are cut off or damaged, which count as missing.
    pub damaged: Vec<PathBuf>,
}

/// A line of results.
#[derive(Deserialize)]
struct Line<'a> {
    task: String,
    #[serde(default = "unnamed")]
    program: String,
    #[serde(borrow)]
    answer: &'a serde_json::value::RawValue,
}

/// Columns by name, in the order in which they appear.
#[derive(Default)]
struct Columns {
    names: Vec<String>,
    places: HashMap<String, usize>,
}

impl Columns {
    fn place(&mut self, name: &str) -> usize {
        if let Some(place) = self.places.get(name) {
            return *place;
        }
        self.places.insert(name.to_owned(), self.names.len());
        self.names.push(name.to_owned());
        self.names.len() - 1
    }
}

/// What one task adds to the columns that every table has.
type Cells = Vec<(String, String)>;

/// Gathers all results.
///
/// # Errors
/// Files that cannot be read; a result that no program of this version wrote.
pub fn gather(folder: &Folder) -> Result<Gathered> {
    let tasks: Vec<Task> = folder.tasks(|_| true)?.into_iter().map(|(_, task)| task).collect();
    let place = |name: &str| tasks.binary_search_by(|task| task.task.as_str().cmp(name)).ok();
    let mut found: Vec<Option<(Cells, String)>> = vec![None; tasks.len()];
    let mut programs = BTreeSet::new();
    let mut damaged = Vec::new();
    let mut unread = None;
    each_line(folder.results(), &mut damaged, |line| {
        let Ok(Line { task, program, answer }) = serde_json::from_str::<Line>(line) else { return };
        let Some(at) = place(&task).filter(|at| found[*at].is_none()) else { return };
        match cells(&tasks[at], answer.get()) {
            Ok(cells) => {
                programs.insert(program.clone());
                found[at] = Some((cells, program));
            }
            Err(e) => drop(unread.get_or_insert((task, e))),
        }
    })?;
    if let Some((task, error)) = unread {
        let source = std::io::Error::other(format!("the result of task {task} is of another version: {error}"));
        return Err(CampaignError::Io { action: "read", path: folder.results(), source });
    }
    let mut reasons: Vec<Option<String>> = vec![None; tasks.len()];
    each_line(folder.failures(), &mut damaged, |line| {
        let Ok(failure) = serde_json::from_str::<Failure>(line) else { return };
        if let Some(at) = place(&failure.task) {
            reasons[at] = Some(failure.reason);
        }
    })?;

    let mut columns = Columns::default();
    let placed = |cells: &Cells, columns: &mut Columns| -> Vec<usize> {
        cells.iter().map(|(name, _)| columns.place(name)).collect()
    };
    let places: Vec<Vec<usize>> =
        found.iter().map(|one| one.as_ref().map_or(Vec::new(), |(cells, _)| placed(cells, &mut columns))).collect();
    let (mut missing, mut failed) = (0, 0);
    let mut rows = Vec::with_capacity(tasks.len());
    for (((task, found), places), reason) in tasks.iter().zip(found).zip(places).zip(reasons) {
        let (state, reason) = match (&found, reason) {
            (Some(_), _) => ("done", None),
            (None, Some(reason)) => ("failed", Some(reason)),
            (None, None) => ("missing", None),
        };
        missing += usize::from(state == "missing");
        failed += usize::from(state == "failed");
        let (cells, program) = found.unwrap_or_default();
        let mut row = about(task, state, reason.unwrap_or_default());
        row.push(program);
        row.resize(COLUMNS.len() + columns.names.len(), String::new());
        for ((_, text), place) in cells.into_iter().zip(places) {
            row[COLUMNS.len() + place] = text;
        }
        rows.push(row);
    }
    let names = COLUMNS.iter().map(|name| (*name).to_owned()).chain(columns.names).collect();
    Ok(Gathered { table: Table { columns: names, rows }, missing, failed, programs, damaged })
}

fn each_line(path: PathBuf, damaged: &mut Vec<PathBuf>, mut take: impl FnMut(&str)) -> Result<()> {
    for file in lines::files(&path).map_err(CampaignError::io("list", &path))? {
        if lines::read(&file, &mut take).map_err(CampaignError::io("read", &file))? > 0 {
            damaged.push(file);
        }
    }
    Ok(())
}

fn about(task: &Task, state: &str, reason: String) -> Vec<String> {
    let names: Vec<&str> = task.recordings.iter().map(|input| input.name.as_str()).collect();
    vec![
        task.task.clone(),
        task.work.kind().to_owned(),
        task.case.clone(),
        names.join(" "),
        task.list_of_effects().replace(',', " "),
        task.work.method().unwrap_or_default().to_owned(),
        task.work.seed().map(|seed| seed.to_string()).unwrap_or_default(),
        state.to_owned(),
        reason,
    ]
}

/// The numbers of a result.
fn cells(task: &Task, answer: &str) -> serde_json::Result<Cells> {
    match &task.work {
        Work::Calibrate { .. } => Ok(of_fit(&task.recordings, &serde_json::from_str(answer)?)),
        Work::Diagnose { .. } => Ok(of_diagnosis(&serde_json::from_str(answer)?)),
        Work::Reliability { truth, .. } => {
            let mut cells = of_diagnosis(&serde_json::from_str(answer)?);
            let said = cells.iter().find(|(name, _)| name == "answer").map(|(_, said)| said.clone());
            cells.push(("truth".into(), truth.clone()));
            cells.push(("right".into(), (said.as_ref() == Some(truth)).to_string()));
            Ok(cells)
        }
        Work::Simulate { .. } => Ok(of_simulation(&serde_json::from_str(answer)?)),
        Work::Sensitivity { .. } => Ok(of_design(&serde_json::from_str(answer)?)),
    }
}

/// As many digits as it takes to read the same number back.
fn number(value: f64) -> String {
    if value.is_finite() { value.to_string() } else { String::new() }
}

fn plain(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Number(_) => value.as_f64().map(number).unwrap_or_default(),
        Value::Bool(flag) => flag.to_string(),
        Value::Array(list) => list.iter().map(plain).collect::<Vec<_>>().join(" "),
        _ => String::new(),
    }
}

fn of_fit(recordings: &[Input], fit: &FitRecord) -> Cells {
    let mut cells: Cells = vec![
        ("fitted_effects".into(), fit.effects.join(" ")),
        ("converged".into(), fit.converged.to_string()),
        ("rmse_m".into(), number(fit.rmse_m)),
        ("noise_m".into(), number(fit.noise_m)),
        ("cost".into(), number(fit.cost)),
        ("evaluations".into(), fit.evaluations.to_string()),
        ("reaches".into(), fit.reaches.to_string()),
    ];
    for p in &fit.parameters {
        // of several recordings, a column each for what is a run's own
        let of_run = p.run.as_ref().filter(|_| fit.runs.len() > 1);
        let run = of_run.and_then(|run| fit.runs.iter().zip(recordings).find(|(r, _)| r.file == *run));
        let suffix = run.map_or(String::new(), |(_, input)| format!("[{}]", input.name));
        let name = format!("{}{suffix}", p.name);
        let error = p.standard_error.filter(|_| !p.held).unwrap_or(f64::NAN);
        let interval = if p.held { [f64::NAN; 2] } else { p.interval_95 };
        cells.extend([
            (format!("{name}_standard_error"), number(error)),
            (format!("{name}_lower_95"), number(interval[0])),
            (format!("{name}_upper_95"), number(interval[1])),
            (format!("{name}_at_bound"), p.at_bound.to_string()),
        ]);
        cells.insert(cells.len() - 4, (name, number(p.value)));
    }
    cells
}

fn of_diagnosis(found: &Value) -> Cells {
    let best = &found["candidates"][0];
    let verdict = plain(&found["verdict"]);
    let answer = match verdict.as_str() {
        "missing-effect" => plain(&best["effect"]),
        "nothing-missing" => "nothing".to_owned(),
        _ => "unknown".to_owned(),
    };
    vec![
        ("verdict".into(), verdict),
        ("answer".into(), answer),
        ("probability".into(), plain(&found["probability"])),
        ("rmse_m".into(), plain(&found["start"]["rmse_m"])),
        ("noise_m".into(), plain(&found["start"]["noise_m"])),
        ("best".into(), plain(&best["label"])),
        ("best_probability".into(), plain(&best["probability"])),
        ("best_rmse_m".into(), plain(&best["rmse_m"])),
        ("indistinguishable_from".into(), plain(&best["indistinguishable_from"])),
    ]
}

fn entries(of: &Value) -> impl Iterator<Item = (&String, &Value)> {
    of.as_object().into_iter().flatten()
}

fn of_simulation(found: &Value) -> Cells {
    let settings = entries(&found["settings"]).map(|(name, value)| (name.clone(), plain(value)));
    let sensors = entries(&found["sensors"]);
    let features = sensors.flat_map(|(sensor, features)| {
        entries(features).map(move |(name, value)| (format!("{name}[{sensor}]"), plain(value)))
    });
    settings.chain(features).collect()
}

fn of_design(found: &Value) -> Cells {
    let mut cells = vec![("sensor".to_owned(), plain(&found["sensor"]))];
    for (method, numbers) in [
        ("morris", &[("mu_star", "/mu_star"), ("sigma", "/sigma")]),
        ("sobol", &[("first", "/first/value"), ("total", "/total/value")]),
    ] {
        let table = &found[method];
        let list = |of: &Value| of.as_array().cloned().unwrap_or_default();
        let factors: Vec<String> = list(&table["factors"]).iter().map(|f| plain(&f["name"])).collect();
        for output in list(&table["outputs"]) {
            for (factor, value) in factors.iter().zip(list(&output["parameters"])) {
                for (name, place) in numbers {
                    let number = value.pointer(place).map(plain).unwrap_or_default();
                    cells.push((format!("{name}[{factor},{}]", plain(&output["output"]["name"])), number));
                }
            }
        }
    }
    cells
}
